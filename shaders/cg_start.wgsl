// Start of CG on one segment: x = 0 unless it continues, p = M⁻¹ r, and the partial sums of rᵀp and rᵀr.

@group(0) @binding(0) var<uniform> params: Params;
/// D⁻¹, 2×2 blocks by rows.
@group(0) @binding(1) var<storage, read> inverse_diagonal: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> r: array<real2>;
@group(0) @binding(3) var<storage, read_write> x: array<real2>;
@group(0) @binding(4) var<storage, read_write> p: array<real2>;
@group(0) @binding(5) var<storage, read_write> partials: array<real2>;

@compute @workgroup_size(WIDTH)
fn cg_start(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    var sums = real2();
    for (var i = group.x * WIDTH + lane; i < params.count; i += groups.x * WIDTH) {
        let residual = r[i];
        let z = precondition(inverse_diagonal[i], residual);
        if (params.flags & CONTINUES) == 0u {
            x[i] = real2();
        }
        p[i] = z;
        sums += real2(dot(residual, z), dot(residual, residual));
    }
    let sum = sum_over_workgroup(lane, sums);
    if lane == 0u {
        partials[params.first_partial + group.x] = sum;
    }
}
