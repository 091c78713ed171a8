// Included by kernels whose invocations have a block row each.

/// Block rows that a workgroup handles at a time.
fn rows_at_a_time() -> u32 {
    return WIDTH;
}

/// (M x) at a row of the part, for the invocation `lane` of the workgroup; zeros beyond the last row.
fn times_x(row: u32, lane: u32) -> Out {
    if row < params.count {
        return row_times_x(row, 0u, 1u);
    }
    return Out();
}
