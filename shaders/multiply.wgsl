// y = ±K x over the rows of one part of K, and its share of the dot product xᵀKx.
//
// Bytes: the part of K once, x and y once. K is stored in slices of 32 block rows, column by column inside
// a slice; one invocation makes one block row.

/// The product is added to y instead of replacing it.
const ADD: u32 = 1u;
/// The product is negated.
const NEGATE: u32 = 2u;
/// Partial sums of xᵀKx are written.
const DOT: u32 = 4u;

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> state: State;
/// Slot of the first block of each slice of this part, and one past the last.
@group(0) @binding(2) var<storage, read> slices: array<u32>;
/// Column of each slot, within the bound segment of x.
@group(0) @binding(3) var<storage, read> columns: array<u32>;
@group(0) @binding(4) var<storage, read> values: array<Stored>;
@group(0) @binding(5) var<storage, read> x: array<real2>;
/// x on the rows of this part: the same segment as `x`, or another one.
@group(0) @binding(6) var<storage, read> x_rows: array<real2>;
@group(0) @binding(7) var<storage, read_write> y: array<real2>;
@group(0) @binding(8) var<storage, read_write> partials: array<real2>;

@compute @workgroup_size(WIDTH)
fn multiply(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if state.done != 0u {
        return;
    }
    var total = real(0.0);
    for (var row = group.x * WIDTH + lane; row < params.count; row += groups.x * WIDTH) {
        let slice = row / 32u;
        var sum = real2();
        let end = slices[slice + 1u];
        for (var slot = slices[slice]; slot < end; slot += 32u) {
            sum += block_times(slot, row % 32u, x[columns[slot + row % 32u]]);
        }
        if (params.flags & NEGATE) != 0u {
            sum = -sum;
        }
        let place = params.first + row;
        if (params.flags & DOT) != 0u {
            total += dot(x_rows[place], sum);
        }
        if (params.flags & ADD) != 0u {
            sum += y[place];
        }
        y[place] = sum;
    }
    if (params.flags & DOT) != 0u {
        let sum = sum_over_workgroup(lane, real2(total, real(0.0)));
        if lane == 0u {
            partials[params.first_partial + group.x] = sum;
        }
    }
}
