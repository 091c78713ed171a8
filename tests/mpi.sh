#!/bin/sh
# The tests of the feature mpi, from a fresh Debian: install MPI, PETSc and what bindings are made with where they are missing,
# build, and run the tests on 1, 2, 3 and 4 ranks; then build with a PETSc that counts in 64 bits, and run some of them once more.
set -eu
cd "$(dirname "$0")/.."

missing=""
command -v mpirun >/dev/null || missing="$missing openmpi-bin"
command -v mpicc >/dev/null || missing="$missing libopenmpi-dev"
# Not libclang-cpp, which comes with Mesa.
ls /usr/lib/llvm-*/lib/ 2>/dev/null | grep -q '^libclang[-.][0-9s]' || missing="$missing libclang-dev"
command -v pkg-config >/dev/null || missing="$missing pkg-config"
pkg-config --exists PETSc 2>/dev/null || missing="$missing libpetsc-real-dev"
ls -d /usr/lib/petscdir/petsc64*/*-real >/dev/null 2>&1 || missing="$missing libpetsc64-real-dev"
# A software adapter, which a rank computes on like on a GPU.
ls /usr/share/vulkan/icd.d/*.json >/dev/null 2>&1 || missing="$missing mesa-vulkan-drivers libvulkan1"
if [ -n "$missing" ]; then
    echo "Installing:$missing"
    if ! command -v apt-get >/dev/null; then
        echo "This machine has no apt-get: install MPI, PETSc (with 32-bit and with 64-bit indices) and libclang by hand." >&2
        exit 1
    fi
    root=""
    [ "$(id -u)" -eq 0 ] || root="sudo"
    $root apt-get update -qq
    # shellcheck disable=SC2086 # a list of names
    $root apt-get install -y -qq --no-install-recommends $missing
fi

# The program without pictures, and quick to compile.
tests() {
    CARGO_INCREMENTAL=1 timeout 1800 cargo test --release --no-default-features --features mpi,cli,gpu \
        --config 'profile.release.package.signorini.opt-level=1' --test mpi --no-run
    CARGO_INCREMENTAL=1 timeout 600 cargo test --release --no-default-features --features mpi,cli,gpu \
        --config 'profile.release.package.signorini.opt-level=1' --test mpi -- "$@"
}

# The software adapter computes in the calling thread: ranks share the cores. Mesa complains without a runtime directory.
export LP_NUM_THREADS="${LP_NUM_THREADS:-0}"
export XDG_RUNTIME_DIR="${XDG_RUNTIME_DIR:-/tmp}"

unset PETSC_DIR PETSC_ARCH
tests "$@"
echo "The same with 64-bit indices:"
PETSC_DIR="$(ls -d /usr/lib/petscdir/petsc64*/*-real | head -n 1)"
export PETSC_DIR
tests kinds matrices own_rows
