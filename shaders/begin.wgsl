// The scalars of a CG run that has just started; one workgroup.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> goals: Goals;
@group(0) @binding(2) var<storage, read_write> partials: array<real2>;
/// The scalars that the iterations read.
@group(0) @binding(3) var<storage, read_write> state: State;
/// The scalars that the preconditioner and the step after it read.
@group(0) @binding(4) var<storage, read_write> next: State;

@compute @workgroup_size(WIDTH)
fn main(@builtin(local_invocation_index) lane: u32) {
    let sum = sum_of_partials(lane);
    if lane == 0u {
        let first = started(sum.y, goals);
        state = first;
        next = first;
    }
}
