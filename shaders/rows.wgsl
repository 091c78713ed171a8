// y[target] = (y[target] +) Σ value · x[column] over the entries of each row: products with B and Bᵀ; only rows with
// entries are stored.
//
// Flags: ADD: the sums are added to y instead of replacing it.

@group(0) @binding(0) var<uniform> params: Params;
/// First entry of each row, and one past the last.
@group(0) @binding(1) var<storage, read> starts: array<u32>;
/// Place of each row's result in the bound segment of y.
@group(0) @binding(2) var<storage, read> targets: array<u32>;
/// Column of each entry, within the bound segment of x.
@group(0) @binding(3) var<storage, read> columns: array<u32>;
@group(0) @binding(4) var<storage, read> values: array<real>;
@group(0) @binding(5) var<storage, read> x: array<real>;
@group(0) @binding(6) var<storage, read_write> y: array<real>;

@compute @workgroup_size(WIDTH)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    for (var row = group.x * WIDTH + lane; row < params.count; row += groups.x * WIDTH) {
        var sum = real(0.0);
        let end = starts[row + 1u];
        for (var entry = starts[row]; entry < end; entry++) {
            sum += values[entry] * x[columns[entry]];
        }
        let place = targets[row];
        if (params.flags & ADD) != 0u {
            sum += y[place];
        }
        y[place] = sum;
    }
}
