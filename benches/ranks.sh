#!/bin/sh
# One process on one thread, one rank by itself, and several ranks, on reference case C: the counts, seconds and memory of each.
#
#   benches/ranks.sh [BINARY [Q [RANKS...]]]
#
# The binary has the feature mpi: cargo build --release --features mpi. Q = 48 has 1 037 232 unknowns.
set -eu
here="$(dirname "$0")"
binary="${1:-$here/../target/release/signorini}"
q="${2:-32}"
[ "$#" -le 2 ] && set -- "$binary" "$q" 2
shift 2
place="$(mktemp -d)"
trap 'rm -rf "$place"' EXIT

# The first value of a key in a report, from a section on.
value() { sed -n "/\"$3/,\$p" "$place/$1/report.json" | grep -o "\"$2\": [0-9.]\{1,7\}" | head -n 1 | sed 's/.*: //'; }

run() { # name, command...
    name="$1"
    shift
    "$@" solve "$here/case-c.toml" --set "mesh.box.cells=[$((3 * q)), $q, $q]" $more --quiet --output "$place/$name" >/dev/null
    printf '%-12s' "$name"
    for key in n iter v_cycles v_cycles_linear; do printf ' %15s' "$(value "$name" "$key" title)"; done
    for key in total factor ssnm peak_memory_mib; do printf ' %15s' "$(value "$name" "$key" timings)"; done
    printf '\n'
}

printf '%-12s %15s %15s %15s %15s %15s %15s %15s %15s\n' run n steps iterations "of one system" seconds set-up "contact steps" MiB
more="--stiffness pcg --backend cpu"
run "one process" env RAYON_NUM_THREADS=1 "$binary"
more=""
run "one rank" env RAYON_NUM_THREADS=1 SIGNORINI_RANKS=1 "$binary"
for ranks in "$@"; do
    run "$ranks ranks" mpirun --map-by :OVERSUBSCRIBE -n "$ranks" "$binary"
done
