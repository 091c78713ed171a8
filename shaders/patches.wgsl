// A step of the smoother from a residual r, on one part of D⁻¹, which is a matrix with a block for each node of a
// patch: d = c₁ d + c₂ D⁻¹ r, y += d.
//
// Flags: FIRST: y is zero: d = c₂ D⁻¹ r, y = d; ADD: another part of the same rows came before: c₂ D⁻¹ r is added to
// d and to y.
//
// Bytes: the part of D⁻¹ and r once, d and y read and written once.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> state: State;
@group(0) @binding(2) var<storage, read> structure: array<u32>;
@group(0) @binding(3) var<storage, read> values: array<Stored>;
/// r.
@group(0) @binding(4) var<storage, read> x: array<In>;
@group(0) @binding(5) var<storage, read_write> d: array<Row>;
@group(0) @binding(6) var<storage, read_write> y: array<Row>;

@compute @workgroup_size(WIDTH)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if state.done != 0u {
        return;
    }
    let rows = rows_at_a_time();
    for (var base = group.x * rows; base < params.count; base += groups.x * rows) {
        let row = base + lane % rows;
        var step = times_x(row, lane);
        if row < params.count && lane < rows {
            for (var i = 0u; i < ROWS; i++) {
                step[i] *= params.c2;
            }
            moves(params.first + row, step);
        }
    }
}

/// Moves a block by a step c₂ D⁻¹ r.
fn moves(place: u32, step: Out) {
    if (params.flags & (FIRST | ADD)) == FIRST {
        store_d(place, step);
        store_y(place, step);
        return;
    }
    let before = load_d(place);
    var moved = load_y(place);
    var sum = step;
    for (var i = 0u; i < ROWS; i++) {
        if (params.flags & ADD) != 0u {
            sum[i] += before[i];
            moved[i] += step[i];
        } else {
            sum[i] += params.c1 * before[i];
            moved[i] += sum[i];
        }
    }
    store_d(place, sum);
    store_y(place, moved);
}
