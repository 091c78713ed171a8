// Start of CG on one segment: x = 0 unless it continues, the residual in f32 for the preconditioner, and the partial
// sums of rᵀr.
//
// Flags: CONTINUES: from the given x.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> r: array<real2>;
@group(0) @binding(2) var<storage, read_write> x: array<real2>;
@group(0) @binding(3) var<storage, read_write> rounded: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read_write> partials: array<real2>;

@compute @workgroup_size(WIDTH)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    var sums = real2();
    for (var i = group.x * WIDTH + lane; i < params.count; i += groups.x * WIDTH) {
        let residual = r[i];
        if (params.flags & CONTINUES) == 0u {
            x[i] = real2();
        }
        rounded[i] = vec2<f32>(residual);
        sums.y += dot(residual, residual);
    }
    let sum = sum_over_workgroup(lane, sums);
    if lane == 0u {
        partials[params.first_partial + group.x] = sum;
    }
}
