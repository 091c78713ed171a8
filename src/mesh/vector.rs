//! Vectors of D components.

/// a − b.
pub(crate) fn minus<const D: usize>(a: [f64; D], b: [f64; D]) -> [f64; D] {
    std::array::from_fn(|c| a[c] - b[c])
}

/// a·b.
pub(crate) fn dot<const D: usize>(a: [f64; D], b: [f64; D]) -> f64 {
    a.iter().zip(&b).map(|(a, b)| a * b).sum()
}

/// a × b.
pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// ‖v‖, without overflow; not for D = 1.
pub(crate) fn length<const D: usize>(v: [f64; D]) -> f64 {
    v[1..].iter().fold(v[0], |sum, &next| sum.hypot(next))
}

/// v divided by its length; not finite if that is zero.
pub(crate) fn unit<const D: usize>(v: [f64; D]) -> [f64; D] {
    let length = length(v);
    v.map(|c| c / length)
}

/// Smallest and largest corner of the box around some points.
pub(crate) fn bounds<const D: usize>(
    points: impl IntoIterator<Item = [f64; D]>,
) -> ([f64; D], [f64; D]) {
    let (mut low, mut high) = ([f64::INFINITY; D], [f64::NEG_INFINITY; D]);
    for x in points {
        for c in 0..D {
            low[c] = low[c].min(x[c]);
            high[c] = high[c].max(x[c]);
        }
    }
    (low, high)
}
