#!/bin/sh
# On a GPU host, from the built binary alone: are the answers right in both precisions, and how fast are they, kernel by
# kernel? Needs no compiler; takes two minutes beside an H100 and 16 cores; writes two JSON files, that of space beside
# that of the plane.
#
#   benches/gpu.sh [BINARY [OUTPUT.json]]
#
# Build the binary elsewhere if need be: cargo build --release makes target/release/signorini, stripped.
set -eu
binary="${1:-$(dirname "$0")/../target/release/signorini}"
output="${2:-gpu.json}"
sizes="${SIZES:-3,7,13,26}"
solid="${SOLID_SIZES:-8,16,24,36,48}"

"$binary" adapters
echo
for precision in auto f32; do
    echo "Table 1 on the GPU, precision $precision:"
    "$binary" table1 --max-k 3 --backend gpu --precision "$precision" --json "$output.table" >/dev/null
    cells=$(grep -c '"status":' "$output.table")
    converged=$(grep -c '"status": "converged"' "$output.table")
    rm -f "$output.table"
    # Converged means: the optimality conditions were checked in f64 on the host.
    echo "  $converged of $cells cells converged"
    [ "$converged" -eq "$cells" ] || exit 1
done
echo
# The benchmark compares the solutions of all paths and fails if they differ.
timeout 420 "$binary" bench --k "$sizes" --json "$output"
echo
timeout 420 "$binary" bench --dimension 3 --k "$solid" --json "${output%.json}-3d.json"
echo "Figures written to $output and ${output%.json}-3d.json"
