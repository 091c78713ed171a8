// Included by kernels where several invocations share a block row: a matrix of few or long rows would leave most of the
// device idle, or keep each invocation waiting for one block after the other.

var<workgroup> sums_of_lanes: array<Out, WIDTH>;

/// Block rows that a workgroup handles at a time.
fn rows_at_a_time() -> u32 {
    return WIDTH / params.lanes;
}

/// (M x) at a row of the part, for the invocation `lane` of the workgroup; zeros beyond the last row. The invocations of a
/// row are as many apart as there are rows, and the first one gets the product. All of the workgroup have to call it.
fn times_x(row: u32, lane: u32) -> Out {
    let rows = rows_at_a_time();
    let first = lane / rows;
    var sum = Out();
    if row < params.count {
        sum = row_times_x(row, first, params.lanes);
    }
    sums_of_lanes[lane] = sum;
    // The same order in every run, hence the same sums.
    for (var half = params.lanes / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if first < half {
            for (var i = 0u; i < ROWS; i++) {
                sum[i] += sums_of_lanes[lane + half * rows][i];
            }
            sums_of_lanes[lane] = sum;
        }
    }
    // The reads end before the next call writes.
    workgroupBarrier();
    return sum;
}
