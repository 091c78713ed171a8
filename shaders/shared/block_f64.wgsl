// The value array of a matrix in f64: two 16-byte loads per 2×2 block, the top rows of the 32 blocks of a
// column first, then their bottom rows, so that neighbouring invocations read neighbouring addresses.

alias Stored = vec2<f64>;

/// Block `lane` of the column of 32 blocks that starts at `slot`, times x.
fn block_times(slot: u32, lane: u32, x: real2) -> real2 {
    let top = values[2u * slot + lane];
    let bottom = values[2u * slot + 32u + lane];
    return real2(top.x * x.x + top.y * x.y, bottom.x * x.x + bottom.y * x.y);
}
