// Sums over a workgroup, always in the same order, hence the same in every run.

/// Invocations that make the sums of the first stage. Two stages need two barriers where a tree needs seven, and
/// barriers determine the time on a software adapter.
const STAGE: u32 = 16u;

var<workgroup> values_of_lanes: array<real2, WIDTH>;
var<workgroup> sums_of_stage: array<real2, STAGE>;

/// The sum of `value` over all invocations of the workgroup, known to all of them.
///
/// May be called again at once: a barrier separates the last reads of an array from the next writes.
fn sum_over_workgroup(lane: u32, value: real2) -> real2 {
    values_of_lanes[lane] = value;
    workgroupBarrier();
    if lane < STAGE {
        var sum = real2();
        for (var i = lane; i < WIDTH; i += STAGE) {
            sum += values_of_lanes[i];
        }
        sums_of_stage[lane] = sum;
    }
    workgroupBarrier();
    var total = real2();
    for (var i = 0u; i < STAGE; i++) {
        total += sums_of_stage[i];
    }
    return total;
}

/// The sum of all partial sums that an earlier dispatch has left, known to the whole workgroup.
fn sum_of_partials(lane: u32) -> real2 {
    var sums = real2();
    for (var i = lane; i < params.n_read; i += WIDTH) {
        sums += partials[params.first_read + i];
    }
    return sum_over_workgroup(lane, sums);
}
