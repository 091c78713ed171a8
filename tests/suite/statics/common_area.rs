//! The common area of two boxes on each other, seen from above: a convex polygon, in the plane an interval.

/// A place seen from above; in the plane the second coordinate is zero.
pub type Point = [f64; 2];

/// The corners of a convex polygon, counter-clockwise; two of them are an interval along x, the lower end first.
pub type Area = Vec<Point>;

/// The part of the polygon `a` inside the convex polygon `b` (Sutherland and Hodgman); empty if there is none.
pub fn common(a: &Area, b: &Area) -> Area {
    if a.len() == 2 {
        let (low, high) = (a[0][0].max(b[0][0]), a[1][0].min(b[1][0]));
        return match low < high {
            true => vec![[low, 0.0], [high, 0.0]],
            false => Vec::new(),
        };
    }
    let mut left = a.clone();
    for (from, to) in edges(b) {
        let all = std::mem::take(&mut left);
        for (x, y) in edges(&all) {
            let [here, there] = [x, y].map(|point| side(from, to, point));
            if here >= 0.0 {
                left.push(x);
            }
            if (here > 0.0) != (there > 0.0) && here != there {
                let t = here / (here - there);
                left.push([0, 1].map(|c| x[c] + t * (y[c] - x[c])));
            }
        }
    }
    left
}

/// The sides of a polygon.
fn edges(area: &Area) -> impl Iterator<Item = (Point, Point)> + '_ {
    (0..area.len()).map(|k| (area[k], area[(k + 1) % area.len()]))
}

/// The distance of a point to the left of the line from one point to another.
fn side(from: Point, to: Point, point: Point) -> f64 {
    let [along, way] = [to, point].map(|end| [end[0] - from[0], end[1] - from[1]]);
    (along[0] * way[1] - along[1] * way[0]) / along[0].hypot(along[1]).max(f64::MIN_POSITIVE)
}

/// The distance of a point inside an area from its border; negative outside.
pub fn depth(area: &Area, point: Point) -> f64 {
    match area.len() {
        0 => f64::NEG_INFINITY,
        2 => (point[0] - area[0][0]).min(area[1][0] - point[0]),
        // Clipping leaves corners that coincide: sides without length mean nothing.
        _ => edges(area)
            .filter(|(x, y)| (x[0] - y[0]).hypot(x[1] - y[1]) > 1e-12)
            .map(|(x, y)| side(x, y, point))
            .fold(f64::INFINITY, f64::min),
    }
}

/// The mean of the corners, which is inside.
pub fn middle(area: &Area) -> Point {
    [0, 1].map(|c| area.iter().map(|x| x[c]).sum::<f64>() / area.len() as f64)
}

/// A length that an area is measured by: of an interval the length, of a polygon the root of its area.
pub fn size(area: &Area) -> f64 {
    match area.len() {
        0 => 0.0,
        2 => area[1][0] - area[0][0],
        _ => {
            let twice = edges(area).map(|(x, y)| x[0] * y[1] - x[1] * y[0]);
            (0.5 * twice.sum::<f64>()).sqrt()
        }
    }
}

#[test]
fn common_areas_are_those_known() {
    let square = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    // A square on its corner in the middle of a side.
    let turned = vec![[0.5, 0.5], [1.0, 1.0], [0.5, 1.5], [0.0, 1.0]];
    let half = common(&turned, &square);
    assert!((size(&half).powi(2) - 0.25).abs() < 1e-15);
    assert!((depth(&half, [0.5, 0.9]) - 0.1).abs() < 1e-15);
    assert!((depth(&half, [0.5, 1.1]) + 0.1).abs() < 1e-15);
    assert!(common(&vec![[2.0, 0.0], [3.0, 0.0], [3.0, 1.0]], &square).is_empty());
    let interval = common(&vec![[0.0, 0.0], [2.0, 0.0]], &vec![[1.5, 0.0], [3.0, 0.0]]);
    assert_eq!(interval, [[1.5, 0.0], [2.0, 0.0]]);
    assert_eq!(depth(&interval, [2.5, 0.0]), -0.5);
}
