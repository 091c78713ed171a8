// Included by the kernels that multiply with a matrix of the hierarchy.

/// (M x) at a block row of the part. M is stored in slices of 32 block rows, column by column inside a
/// slice, entry by entry inside a column.
fn row_times_x(row: u32) -> Out {
    let lane = row % 32u;
    var sum = Out();
    let end = structure[row / 32u + 1u];
    for (var slot = structure[row / 32u]; slot < end; slot += 32u) {
        let column = structure[params.columns + slot + lane];
        sum += block_times(ROWS * COLUMNS * slot + lane, load_column(column));
    }
    return sum;
}
