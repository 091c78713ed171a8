// A step of the smoother on one part: d = c₁ d + c₂ D⁻¹(b − A x), x_next = x + d.
// Bytes: A, D⁻¹, b, x, d read once, d and x_next written once.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> state: State;
@group(0) @binding(2) var<storage, read> structure: array<u32>;
@group(0) @binding(3) var<storage, read> values: array<f32>;
/// Blocks of D⁻¹, by rows.
@group(0) @binding(4) var<storage, read> inverse_diagonal: array<f32>;
@group(0) @binding(5) var<storage, read> b: array<f32>;
@group(0) @binding(6) var<storage, read> x: array<f32>;
@group(0) @binding(7) var<storage, read_write> d: array<f32>;
@group(0) @binding(8) var<storage, read_write> x_next: array<f32>;

@compute @workgroup_size(WIDTH)
fn chebyshev_step(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if state.done != 0u {
        return;
    }
    for (var row = group.x * WIDTH + lane; row < params.count; row += groups.x * WIDTH) {
        let place = ROWS * (params.first + row);
        var r = row_times_x(row);
        for (var i = 0u; i < ROWS; i++) {
            r[i] = b[place + i] - r[i];
        }
        for (var i = 0u; i < ROWS; i++) {
            var z = 0.0;
            for (var j = 0u; j < ROWS; j++) {
                z += inverse_diagonal[ROWS * (place + i) + j] * r[j];
            }
            let step = params.c1 * d[place + i] + params.c2 * z;
            d[place + i] = step;
            x_next[place + i] = x[place + i] + step;
        }
    }
}
