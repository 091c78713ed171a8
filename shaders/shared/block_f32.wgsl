// The value array of a matrix in f32: one 16-byte load per 2×2 block.

alias Stored = vec4<f32>;

/// Block `lane` of the column of 32 blocks that starts at `slot`, times x.
fn block_times(slot: u32, lane: u32, x: real2) -> real2 {
    let block = values[slot + lane];
    return real2(block.x * x.x + block.y * x.y, block.z * x.x + block.w * x.y);
}
