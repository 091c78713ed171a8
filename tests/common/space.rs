//! Vectors and rotations of space.

pub type Vector = [f64; 3];

/// Columns of a matrix, times a vector.
pub fn times(columns: &[Vector; 3], v: Vector) -> Vector {
    std::array::from_fn(|i| (0..3).map(|j| columns[j][i] * v[j]).sum())
}

/// The scalar product.
pub fn dot(a: Vector, b: Vector) -> f64 {
    (0..3).map(|c| a[c] * b[c]).sum()
}

/// The length.
pub fn length(v: Vector) -> f64 {
    dot(v, v).sqrt()
}

#[track_caller]
pub fn close<const D: usize>(value: [f64; D], expected: [f64; D], tolerance: f64) {
    for c in 0..D {
        assert!(
            (value[c] - expected[c]).abs() <= tolerance,
            "{value:?}, not {expected:?}"
        );
    }
}

/// No rotation.
pub const UPRIGHT: [Vector; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The rotation by `angle` about an axis (Rodrigues), its columns.
pub fn rotation(axis: Vector, angle: f64) -> [Vector; 3] {
    let n = axis.map(|a| a / length(axis));
    let (s, c) = angle.sin_cos();
    UPRIGHT.map(|e| {
        let cross = cross(n, e);
        std::array::from_fn(|i| c * e[i] + s * cross[i] + (1.0 - c) * dot(n, e) * n[i])
    })
}

/// The vector product.
pub fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
