// First half of a CG iteration on one segment: α = rᵀz / pᵀKp, x += α p, r −= α Kp, r in f32 for the
// preconditioner, and the partial sums of rᵀr.
//
// Flags: WRITES_STATE: one dispatch of a step does.
//
// Bytes: p, q, x and r read, x, r and r in f32 written.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> state: State;
@group(0) @binding(2) var<storage, read_write> next: State;
/// Read: the partial sums of pᵀKp. Written, elsewhere: those of rᵀr.
@group(0) @binding(3) var<storage, read_write> partials: array<real2>;
@group(0) @binding(4) var<storage, read> p: array<real2>;
/// K p.
@group(0) @binding(5) var<storage, read> q: array<real2>;
@group(0) @binding(6) var<storage, read_write> x: array<real2>;
@group(0) @binding(7) var<storage, read_write> r: array<real2>;
@group(0) @binding(8) var<storage, read_write> rounded: array<vec2<f32>>;

@compute @workgroup_size(WIDTH)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let writes_state = (params.flags & WRITES_STATE) != 0u && group.x == 0u && lane == 0u;
    if state.done != 0u {
        if writes_state {
            next.done = 1u;
        }
        return;
    }
    let curvature = sum_of_partials(lane).x;
    let positive = curvature > real(0.0);
    var alpha = real(0.0);
    if positive {
        alpha = state.rz / curvature;
    }
    var sums = real2();
    for (var i = group.x * WIDTH + lane; i < params.count; i += groups.x * WIDTH) {
        x[i] += alpha * p[i];
        let residual = r[i] - alpha * q[i];
        r[i] = residual;
        rounded[i] = vec2<f32>(residual);
        sums.y += dot(residual, residual);
    }
    let sum = sum_over_workgroup(lane, sums);
    if lane == 0u {
        partials[params.first_partial + group.x] = sum;
    }
    if writes_state {
        next = after_step(state, alpha, positive);
    }
}
