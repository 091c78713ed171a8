// The partial sums of rᵀz on one segment, z from the preconditioner in f32.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> state: State;
@group(0) @binding(2) var<storage, read> r: array<real2>;
@group(0) @binding(3) var<storage, read> z: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read_write> partials: array<real2>;

@compute @workgroup_size(WIDTH)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if state.done != 0u {
        return;
    }
    var sums = real2();
    for (var i = group.x * WIDTH + lane; i < params.count; i += groups.x * WIDTH) {
        sums.x += dot(r[i], real2(z[i]));
    }
    let sum = sum_over_workgroup(lane, sums);
    if lane == 0u {
        partials[params.first_partial + group.x] = sum;
    }
}
