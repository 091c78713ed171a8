//! Points and polygons on the plane of a facet.

/// A point.
pub(super) type Flat = [f64; 2];

/// Twice the area of the triangle at the corner p between a and b.
pub(super) fn turn(p: Flat, a: Flat, b: Flat) -> f64 {
    (a[0] - p[0]) * (b[1] - p[1]) - (a[1] - p[1]) * (b[0] - p[0])
}

/// The area of a polygon, counter-clockwise.
pub(super) fn area(polygon: &[Flat]) -> f64 {
    let fan = polygon.windows(2).skip(1);
    0.5 * fan.map(|ab| turn(polygon[0], ab[0], ab[1])).sum::<f64>()
}

/// The edges of a polygon.
pub(super) fn edges(polygon: &[Flat]) -> impl Iterator<Item = (Flat, Flat)> {
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().copied().zip(next.copied())
}
