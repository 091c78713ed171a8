#!/bin/sh
# The whole test suite, from a fresh machine: build and run every test, doctest and example case.
set -eu
cd "$(dirname "$0")/.."
exec cargo test --release "$@"
