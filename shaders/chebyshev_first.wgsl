// First step of the smoother from x = 0: d = c₂ D⁻¹ b, x = d.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> state: State;
/// Blocks of D⁻¹, by rows.
@group(0) @binding(2) var<storage, read> inverse_diagonal: array<f32>;
@group(0) @binding(3) var<storage, read> b: array<f32>;
@group(0) @binding(4) var<storage, read_write> d: array<f32>;
@group(0) @binding(5) var<storage, read_write> x: array<f32>;

@compute @workgroup_size(WIDTH)
fn chebyshev_first(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if state.done != 0u {
        return;
    }
    for (var row = group.x * WIDTH + lane; row < params.count; row += groups.x * WIDTH) {
        let place = ROWS * row;
        for (var i = 0u; i < ROWS; i++) {
            var sum = 0.0;
            for (var j = 0u; j < ROWS; j++) {
                sum += inverse_diagonal[ROWS * (place + i) + j] * b[place + j];
            }
            d[place + i] = params.c2 * sum;
            x[place + i] = params.c2 * sum;
        }
    }
}
