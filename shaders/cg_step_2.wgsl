// Second half of a CG iteration on one segment: β = new rᵀz / old rᵀz, p = D⁻¹ r + β p; the run ends
// where rᵀr has reached its goal.
//
// Bytes: r, p and D⁻¹ read, p written.

@group(0) @binding(0) var<uniform> params: Params;
/// Written by `cg_step_1`: rᵀz is still the old one.
@group(0) @binding(1) var<storage, read> state: State;
@group(0) @binding(2) var<storage, read_write> next: State;
/// The partial sums of rᵀz and rᵀr.
@group(0) @binding(3) var<storage, read_write> partials: array<real2>;
@group(0) @binding(4) var<storage, read> inverse_diagonal: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> r: array<real2>;
@group(0) @binding(6) var<storage, read_write> p: array<real2>;

@compute @workgroup_size(WIDTH)
fn cg_step_2(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if state.done != 0u {
        return;
    }
    let sum = sum_of_partials(lane);
    var after = state;
    after.rz = sum.x;
    after.rr = sum.y;
    let done = is_over(after);
    after.done = u32(done);
    if (params.flags & WRITES_STATE) != 0u && group.x == 0u && lane == 0u {
        next = after;
    }
    if done {
        return;
    }
    let beta = sum.x / state.rz;
    for (var i = group.x * WIDTH + lane; i < params.count; i += groups.x * WIDTH) {
        p[i] = precondition(inverse_diagonal[i], r[i]) + beta * p[i];
    }
}
