// A step of the smoother from an existing residual r: d = c₁ d + c₂ D⁻¹ r, x_next = x + d. The residual is in x_next,
// the result of a product with a matrix of several segments.
//
// Flags: FIRST: r is b, and x is zero: d = c₂ D⁻¹ b, x_next = d; with c₂ = 1 that is block-Jacobi.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> state: State;
/// Blocks of D⁻¹, by rows.
@group(0) @binding(2) var<storage, read> inverse_diagonal: array<f32>;
@group(0) @binding(3) var<storage, read> b: array<Row>;
@group(0) @binding(4) var<storage, read> x: array<Row>;
@group(0) @binding(5) var<storage, read_write> d: array<Row>;
@group(0) @binding(6) var<storage, read_write> x_next: array<Row>;

@compute @workgroup_size(WIDTH)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if state.done != 0u {
        return;
    }
    for (var row = group.x * WIDTH + lane; row < params.count; row += groups.x * WIDTH) {
        if (params.flags & FIRST) != 0u {
            var step = diagonal_times(row, load_b(row));
            for (var i = 0u; i < ROWS; i++) {
                step[i] *= params.c2;
            }
            store_d(row, step);
            store_x_next(row, step);
        } else {
            smoothed(row, diagonal_times(row, load_x_next(row)));
        }
    }
}
