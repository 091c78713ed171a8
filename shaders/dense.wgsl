// x = M b with a dense M: the inverse on the coarsest level. One workgroup per row, `count` rows and columns.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> state: State;
/// By rows.
@group(0) @binding(2) var<storage, read> values: array<f32>;
@group(0) @binding(3) var<storage, read> b: array<f32>;
@group(0) @binding(4) var<storage, read_write> x: array<f32>;

var<workgroup> sums: array<f32, WIDTH>;

@compute @workgroup_size(WIDTH)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if state.done != 0u {
        return;
    }
    let row = group.x;
    var sum = 0.0;
    for (var j = lane; j < params.count; j += WIDTH) {
        sum += values[row * params.count + j] * b[j];
    }
    sums[lane] = sum;
    workgroupBarrier();
    if lane < 16u {
        for (var i = lane + 16u; i < WIDTH; i += 16u) {
            sum += sums[i];
        }
        sums[lane] = sum;
    }
    workgroupBarrier();
    if lane == 0u {
        for (var i = 1u; i < 16u; i++) {
            sum += sums[i];
        }
        x[row] = sum;
    }
}
