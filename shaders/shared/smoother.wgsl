// Included by the kernels of the smoother.

/// d = c₁ d + c₂ z, x_next = x + d on a block, z = D⁻¹(b − A x).
fn smoothed(place: u32, z: Out) {
    var step = load_d(place);
    var moved = load_x(place);
    for (var i = 0u; i < ROWS; i++) {
        step[i] = params.c1 * step[i] + params.c2 * z[i];
        moved[i] += step[i];
    }
    store_d(place, step);
    store_x_next(place, moved);
}
