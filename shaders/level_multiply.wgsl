// y = M x, y = y + M x, or y = b − M x on one part of a matrix of the hierarchy: residual, restriction,
// prolongation. Bytes: M, x, b once, y once or twice.

/// The product is added to y.
const ADD: u32 = 1u;
/// The product is subtracted from b.
const RESIDUAL: u32 = 2u;

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> state: State;
@group(0) @binding(2) var<storage, read> structure: array<u32>;
@group(0) @binding(3) var<storage, read> values: array<f32>;
@group(0) @binding(4) var<storage, read> x: array<f32>;
@group(0) @binding(5) var<storage, read> b: array<f32>;
@group(0) @binding(6) var<storage, read_write> y: array<f32>;

@compute @workgroup_size(WIDTH)
fn level_multiply(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if state.done != 0u {
        return;
    }
    for (var row = group.x * WIDTH + lane; row < params.count; row += groups.x * WIDTH) {
        let sum = row_times_x(row);
        let place = ROWS * (params.first + row);
        for (var i = 0u; i < ROWS; i++) {
            var value = sum[i];
            if (params.flags & RESIDUAL) != 0u {
                value = b[place + i] - value;
            }
            if (params.flags & ADD) != 0u {
                value += y[place + i];
            }
            y[place + i] = value;
        }
    }
}
