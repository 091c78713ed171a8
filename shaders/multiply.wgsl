// y = M x over the rows of one part of a matrix, and its share of the dot product xᵀMx.
//
// Flags: NEGATE: −M x; ADD: the product is added to y; BASE: it is added to b; DOT: partial sums are written.
//
// Bytes: the part of M once, x once, b and y where they are read, y written once.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> state: State;
@group(0) @binding(2) var<storage, read> structure: array<u32>;
@group(0) @binding(3) var<storage, read> values: array<Stored>;
@group(0) @binding(4) var<storage, read> x: array<In>;
/// b or, for the dot product, x on the rows of this part: the same segment as `x`, or another one.
@group(0) @binding(5) var<storage, read> b: array<Row>;
@group(0) @binding(6) var<storage, read_write> y: array<Row>;
@group(0) @binding(7) var<storage, read_write> partials: array<real2>;

@compute @workgroup_size(WIDTH)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if state.done != 0u {
        return;
    }
    var total = real(0.0);
    let rows = rows_at_a_time();
    for (var base = group.x * rows; base < params.count; base += groups.x * rows) {
        let row = base + lane % rows;
        var sum = times_x(row, lane);
        if row < params.count && lane < rows {
            let place = params.first + row;
            if (params.flags & NEGATE) != 0u {
                for (var i = 0u; i < ROWS; i++) {
                    sum[i] = -sum[i];
                }
            }
            if (params.flags & (DOT | BASE)) != 0u {
                let there = load_b(place);
                for (var i = 0u; i < ROWS; i++) {
                    if (params.flags & DOT) != 0u {
                        total += real(there[i]) * real(sum[i]);
                    } else {
                        sum[i] += there[i];
                    }
                }
            }
            if (params.flags & ADD) != 0u {
                let before = load_y(place);
                for (var i = 0u; i < ROWS; i++) {
                    sum[i] += before[i];
                }
            }
            store_y(place, sum);
        }
    }
    if (params.flags & DOT) != 0u {
        let sum = sum_over_workgroup(lane, real2(total, real(0.0)));
        if lane == 0u {
            partials[params.first_partial + group.x] = sum;
        }
    }
}
