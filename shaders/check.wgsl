// Whether the run is over, before the preconditioner is spent on it; one workgroup.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> state: State;
@group(0) @binding(2) var<storage, read_write> partials: array<real2>;
@group(0) @binding(3) var<storage, read_write> next: State;

@compute @workgroup_size(WIDTH)
fn main(@builtin(local_invocation_index) lane: u32) {
    if state.done != 0u {
        return;
    }
    let rr = sum_of_partials(lane).y;
    if lane == 0u {
        next.rr = rr;
        next.done = u32(is_over(next));
    }
}
