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

# With what the tests need, so that nothing is compiled twice: their dependencies ask others for more than a build does.
cargo test --release --no-run
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
cargo test --release "$@"
[ "$#" -gt 0 ] || exec sh tests/python.sh
