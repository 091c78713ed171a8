#!/bin/sh
# The tests of the Python package, from a fresh machine with python3 and Rust: builds it and installs it with all that its
# tests need into an environment of its own, then runs them. Arguments go to pytest.
set -eu
cd "$(dirname "$0")/.."
export LP_NUM_THREADS="${LP_NUM_THREADS:-0}"
export XDG_RUNTIME_DIR="${XDG_RUNTIME_DIR:-/tmp}"
environment="${CARGO_TARGET_DIR:-target}/python"

install() {
    if ! command -v apt-get >/dev/null; then
        echo "This machine has no apt-get: install what corresponds to $* by hand." >&2
        exit 1
    fi
    root=""
    [ "$(id -u)" -eq 0 ] || root="sudo"
    $root apt-get update -qq
    $root apt-get install -y -qq --no-install-recommends "$@"
}

if ! "$environment/bin/python" -m pip --version >/dev/null 2>&1; then
    # Debian has the module for environments in a package of its own.
    python3 -c "import ensurepip, venv" 2>/dev/null || install python3-venv
    python3 -m venv "$environment"
fi
# The same bits as with full optimisation of the library, in a quarter of the time that compiling it takes.
MATURIN_PEP517_ARGS="${MATURIN_PEP517_ARGS:---config profile.release.package.signorini.opt-level=1 --config profile.release.package.signorini-python.opt-level=1}" \
    "$environment/bin/python" -m pip install --quiet --disable-pip-version-check "./python[test]"
# Gmsh and VTK draw, and load what they draw with when they are imported.
if ! "$environment/bin/python" -c "import gmsh, pyvista" 2>/dev/null; then
    echo "Gmsh or VTK cannot be loaded: installing the libraries that they draw with."
    install libegl1 libgl1 libglu1-mesa libx11-6 libxcursor1 libxft2 libxinerama1 libxrender1
fi
# The result page is read in a browser.
command -v chromium >/dev/null || install chromium
exec "$environment/bin/python" -m pytest -c python/pyproject.toml python/tests "$@"
