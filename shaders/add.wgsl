// y += c1 x on one segment.
//
// Bytes: x and y read, y written.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> x: array<real2>;
@group(0) @binding(2) var<storage, read_write> y: array<real2>;

@compute @workgroup_size(WIDTH)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    for (var i = group.x * WIDTH + lane; i < params.count; i += groups.x * WIDTH) {
        y[i] += real(params.c1) * x[i];
    }
}
