// The scalars of a CG run that has just started; one workgroup.

@group(0) @binding(0) var<uniform> params: Params;
/// The square of the relative tolerance.
@group(0) @binding(1) var<storage, read> tolerance: array<real>;
@group(0) @binding(2) var<storage, read_write> partials: array<real2>;
@group(0) @binding(3) var<storage, read_write> state: State;

@compute @workgroup_size(WIDTH)
fn cg_begin(@builtin(local_invocation_index) lane: u32) {
    let sum = sum_of_partials(lane);
    if lane == 0u {
        let goal = tolerance[0] * sum.y;
        state.rz = sum.x;
        state.rr = sum.y;
        state.goal = goal;
        // Written so that NaN ends the run.
        state.done = u32(!(sum.y > goal));
        state.broken = 0u;
        state.iterations = 0u;
    }
}
