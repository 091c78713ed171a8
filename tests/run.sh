#!/bin/sh
# The whole test suite, from a fresh machine: install a software adapter if no adapter answers, then build
# and run every test, doctest and example case, and those of the Python package. With arguments, which go to cargo test, that
# alone is run.
set -eu
cd "$(dirname "$0")/.."

# The software adapter computes in the calling thread: for small tests that is faster. Mesa complains
# without a runtime directory.
export LP_NUM_THREADS="${LP_NUM_THREADS:-0}"
export XDG_RUNTIME_DIR="${XDG_RUNTIME_DIR:-/tmp}"

# Unit tests are quick with little optimisation as well, and compile in half of the time.
unit="--config profile.release.package.signorini.opt-level=1 --lib"
all="--test suite --test program"
# With what the tests need, so that nothing is compiled twice: their dependencies ask others for more than a build does.
# shellcheck disable=SC2086 # options
cargo test --release --no-run $all
if ! target/release/signorini adapters | grep -q "f64 yes"; then
    echo "No adapter with f64 answers: installing a software one (mesa-vulkan-drivers, libvulkan1)."
    if ! command -v apt-get >/dev/null; then
        echo "This machine has no apt-get: install Mesa's software Vulkan driver (lavapipe) by hand." >&2
        exit 1
    fi
    root=""
    [ "$(id -u)" -eq 0 ] || root="sudo"
    $root apt-get update -qq
    $root apt-get install -y -qq --no-install-recommends mesa-vulkan-drivers libvulkan1
fi
if [ "$#" -gt 0 ]; then
    exec cargo test --release "$@"
fi
# shellcheck disable=SC2086 # options
cargo test --release $unit
# shellcheck disable=SC2086 # options
cargo test --release $all
cargo test --release --doc
exec sh tests/python.sh
