/// Block-Jacobi: a 2×2 block of D⁻¹, in f32, times the residual of a node.
fn precondition(block: vec4<f32>, r: real2) -> real2 {
    let rounded = vec2<f32>(r);
    return real2(vec2<f32>(
        block.x * rounded.x + block.y * rounded.y,
        block.z * rounded.x + block.w * rounded.y,
    ));
}
