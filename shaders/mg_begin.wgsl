// The scalars of a CG run with multigrid that has just started; one workgroup.

@group(0) @binding(0) var<uniform> params: Params;
/// The square of the relative tolerance.
@group(0) @binding(1) var<storage, read> tolerance: array<real>;
@group(0) @binding(2) var<storage, read_write> partials: array<real2>;
/// What the iterations read.
@group(0) @binding(3) var<storage, read_write> state: State;
/// What the cycle and the step after it read.
@group(0) @binding(4) var<storage, read_write> next: State;

@compute @workgroup_size(WIDTH)
fn mg_begin(@builtin(local_invocation_index) lane: u32) {
    let sum = sum_of_partials(lane);
    if lane == 0u {
        let goal = tolerance[0] * sum.y;
        // Written so that NaN ends the run.
        let done = u32(!(sum.y > goal));
        state.rz = real(0.0);
        state.rr = sum.y;
        state.goal = goal;
        state.done = done;
        state.broken = 0u;
        state.iterations = 0u;
        next.rz = real(0.0);
        next.rr = sum.y;
        next.goal = goal;
        next.done = done;
        next.broken = 0u;
        next.iterations = 0u;
    }
}
