#!/bin/sh
# The site, in target/site (open target/site/index.html): pages by mdBook, the examples beside them, so that links into the repository
# lead somewhere, and a result page made by the program. `pictures` makes docs/pictures by the program first, which is all that
# `sh docs/build.sh pictures` does. SIGNORINI names a program that is built already.
set -eu
cd "$(dirname "$0")/.."
program="${SIGNORINI:-}"
[ -n "$program" ] || { cargo build --release; program="${CARGO_TARGET_DIR:-target}/release/signorini"; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# A template and where its results go.
solve() {
    "$program" solve "examples/$1.toml" --plots --quiet --output "$work/$1" 2>"$work/log" || { cat "$work/log" >&2; exit 1; }
}

if [ "${1:-}" = pictures ]; then
    # What the gallery shows of each template: its name, the picture among its results, the picture in docs/pictures.
    while read -r template result picture; do
        [ -d "$work/$template" ] || solve "$template"
        cp "$work/$template/$result.svg" "docs/pictures/$picture.svg"
    done <<END
stack deformed stack
press deformed press
cylinder contact cylinder
shear deformed-003 shear
dovetail deformed-001 dovetail
dovetail contact-002 dovetail-contact
fretting wear fretting
roller deformed roller
collar deformed-002 collar
shrink-fit deformed-002 shrink-fit
shrink-fit contact-002 shrink-fit-contact
brake deformed-003 brake
ball-joint contact-003 ball-joint
ironing deformed-003 ironing
bolted-flange contact-1-005 bolted-flange
snap-fit deformed-004 snap-fit
hose deformed-015 hose
gears deformed-016 gears
bracket-3d deformed bracket-3d
ball deformed ball
END
    exit
fi

site="${CARGO_TARGET_DIR:-target}/site"
rm -rf "$site"
mdbook build docs --dest-dir "$PWD/$site/docs"
mkdir -p "$site/live" "$site/python"
cp -r examples "$site/"
cp -r python/examples "$site/python/"
rm -rf "$site"/examples/*-out
# The page to turn and zoom that the gallery links to.
solve brake
mkdir "$site/live/brake"
cp "$work/brake/report.html" "$site/live/brake/"
echo '<meta http-equiv="refresh" content="0; url=docs/index.html">' >"$site/index.html"
