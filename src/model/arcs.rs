//! Sides of a contact that are drawn as arcs about one axis (or as parts of balls about one point). Between their facets the gap
//! varies by the deviation of the facets from the arcs, which is an artefact of the mesh.

use crate::contact::{Centre, Space, fit, frame, is_straight, ridge, smooth_parts_of};
use crate::dense::{least_squares, symmetric_eigen};
use crate::mesh::vector::{dot, length, minus, unit};
use crate::mesh::{ElementKind, Facet, Mesh, Topology, facet_corners, facet_nodes};
use faer::Mat;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// Gaps that scatter by no more than this part of that between the arcs are even enough.
pub(super) const EVEN: f64 = 0.1;
/// Normals with less than this part of their square along a direction are perpendicular to it: the surface around it is a
/// cylinder.
const ACROSS: f64 = 1e-6;
/// Nodes are this near to an arc, as a part of how much the gap scatters.
const ON_ARC: f64 = 0.05;
/// Of two sides at least one looks in so many directions. Else they may be a groove or a chamfer with an element for each flank: their
/// few corners are on an arc, too.
const ROUND: usize = 5;
/// Normals whose cosine is this near to 1 are one direction (0.08°).
const ALIKE: f64 = 1e-6;
/// Coordinates in files have six digits at least.
const WRITTEN: f64 = 2e-6;

/// The gap between two sides that are drawn as arcs about one axis. Given where the initial gaps `range` of their
/// facets scatter by more than a tenth of it, and of the largest.
pub(super) fn between_arcs<const D: usize>(
    mesh: &Mesh<D>,
    sides: [&[Facet<D>]; 2],
    range: [f64; 2],
) -> Option<f64>
where
    ElementKind: Topology<D>,
{
    let scatter = range[1] - range[0];
    if !(scatter > EVEN * range[1].abs() && scatter > 0.0) {
        return None;
    }
    let nodes = sides.map(|facets| corners_of(mesh, facets));
    let across = directions_across(mesh, &sides)?;
    let Arcs { radii, .. } = concentric(&nodes, across, |_, _| ON_ARC * scatter)?;
    let gap = (radii[1] - radii[0]).abs();
    (scatter > EVEN * gap).then_some(gap)
}

/// The places of the corners of facets.
fn corners_of<const D: usize>(mesh: &Mesh<D>, facets: &[Facet<D>]) -> Vec<[f64; D]>
where
    ElementKind: Topology<D>,
{
    let nodes: BTreeSet<u32> = facets.iter().flat_map(facet_corners).copied().collect();
    (nodes.iter())
        .map(|&node| mesh.nodes[node as usize])
        .collect()
}

/// The gap between two sides that are drawn as arcs about one axis (or as parts of balls), at least one with facets of
/// first order. It is below 0 where the arcs overlap. Edges sharper than `steepest`, in degrees, are real edges, not
/// arcs.
pub(super) fn gap_of_arcs<const D: usize>(
    mesh: &Mesh<D>,
    sides: [&[Facet<D>]; 2],
    steepest: f64,
) -> Option<f64>
where
    ElementKind: Topology<D>,
{
    let is_flat = |facet| is_straight(mesh, facet);
    if !sides.iter().any(|facets| facets.iter().any(is_flat)) {
        return None;
    }
    // The gap has to be as well known as the arcs.
    let near = |off: f64, radii: &[f64]| ON_ARC * off.min((radii[1] - radii[0]).abs());
    let Arcs { radii, centre } = smooth_arcs(mesh, &sides, steepest, near)?;
    Some((radii[1] - radii[0]) * faces_away(mesh, sides[0], &centre))
}

/// 1 for a side that faces away from its axis, -1 for one that faces it.
fn faces_away<const D: usize>(mesh: &Mesh<D>, side: &[Facet<D>], centre: &Centre<D>) -> f64
where
    ElementKind: Topology<D>,
{
    let each = side.iter().map(|facet| {
        let (area, normal) = mesh.facet_normal(facet);
        let from = centre.radius_to(mesh.nodes[facet_corners(facet)[0] as usize]);
        area * dot(from, normal)
    });
    each.sum::<f64>().signum()
}

/// What each facet of two sides is round about: the smooth parts that are arcs, or parts of balls, and fit to one of the other
/// side. Empty where none does.
///
/// Polygons that are turned against each other resist turning: normals between their facets pass the axis by a part of a
/// facet. A ring without friction would turn on a shaft until nothing presses it.
pub(super) fn centres_of_arcs<const D: usize>(
    mesh: &Mesh<D>,
    sides: [&[Facet<D>]; 2],
    steepest: f64,
) -> [Vec<Option<Centre<D>>>; 2]
where
    ElementKind: Space<D>,
{
    let rounds = sides.map(|facets| Round::all(mesh, facets, steepest));
    let mut centres = sides.map(|facets| vec![None; facets.len()]);
    let mut any = false;
    for one in &rounds[0] {
        for other in &rounds[1] {
            let fit = fit(one.centre.radius, other.centre.radius);
            if !fit || one.ways.max(other.ways) < ROUND {
                continue;
            }
            any = true;
            for (round, centres) in [one, other].into_iter().zip(&mut centres) {
                for &k in &round.facets {
                    centres[k] = Some(round.centre.clone());
                }
            }
        }
    }
    match any {
        true => centres,
        false => [Vec::new(), Vec::new()],
    }
}

/// A smooth part of a side that is an arc.
struct Round<const D: usize> {
    facets: Vec<usize>,
    centre: Centre<D>,
    /// The number of directions that its facets look in; not more than [`ROUND`].
    ways: usize,
}

impl<const D: usize> Round<D> {
    /// Those of a side. None of one that turns back on itself.
    fn all(mesh: &Mesh<D>, side: &[Facet<D>], steepest: f64) -> Vec<Self>
    where
        ElementKind: Space<D>,
    {
        let mut parts: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        let of_facets = smooth_parts_of(mesh, side, steepest).unwrap_or_default();
        for (k, part) in of_facets.into_iter().enumerate() {
            parts.entry(part).or_default().push(k);
        }
        let round = |facets: Vec<usize>| Self::of(mesh, side, facets);
        parts.into_values().filter_map(round).collect()
    }

    /// Of a smooth part, if it is an arc.
    fn of(mesh: &Mesh<D>, side: &[Facet<D>], facets: Vec<usize>) -> Option<Self>
    where
        ElementKind: Space<D>,
    {
        let part: Vec<Facet<D>> = facets.iter().map(|&k| side[k]).collect();
        // Nodes in the middle between corners say nothing about the surface.
        let of_facet = match part.iter().all(|facet| is_straight(mesh, facet)) {
            true => facet_corners,
            false => facet_nodes,
        };
        // Each node is as near to the arc as its own facets tell, however much coarser others are.
        let all = part.iter().flat_map(of_facet);
        let mut off: BTreeMap<u32, f64> = all.map(|&node| (node, 0.0)).collect();
        for turn in turns(mesh, &part) {
            let both = turn.facets.into_iter().flat_map(|k| of_facet(&part[k]));
            for node in both {
                let off = off.entry(*node).or_default();
                *off = off.max(turn.sagitta());
            }
        }
        let points: Vec<[f64; D]> = off.keys().map(|&node| mesh.nodes[node as usize]).collect();
        let off: Vec<f64> = off.into_values().collect();
        let sides = [points];
        let size = extent(&sides[0]);
        let on = |across| {
            let near =
                |radii: &[f64], k: usize| (ON_ARC * off[k]).max(WRITTEN * radii[0].min(size));
            concentric(&sides, across, near)
        };
        let across = directions_across(mesh, &[&part])?;
        let is_ball = across.len() == D;
        let arcs = on(across);
        // Triangles whose corners are on a cylinder lean along its axis.
        let arcs = arcs.or_else(|| on(across_axis(mesh, &part, &sides[0])?).filter(|_| is_ball));
        let Arcs { radii, mut centre } = arcs?;
        centre.radius = radii[0] * faces_away(mesh, &part, &centre);
        let mut ways: Vec<[f64; D]> = Vec::new();
        for facet in &part {
            let way = mesh.facet_normal(facet).1;
            if ways.len() < ROUND && ways.iter().all(|other| dot(*other, way) < 1.0 - ALIKE) {
                ways.push(way);
            }
        }
        Some(Self {
            facets,
            centre,
            ways: ways.len(),
        })
    }
}

/// The largest distance of points from the first of them.
fn extent<const D: usize>(points: &[[f64; D]]) -> f64 {
    let all = points.iter().map(|x| length(minus(*x, points[0])));
    all.fold(0.0, f64::max)
}

/// The arcs about one axis that the corners of sides are on, if no edge is as sharp as `steepest`, in degrees. They may be off the arcs by
/// `near` of the deviation of flat facets and the radii.
fn smooth_arcs<const D: usize>(
    mesh: &Mesh<D>,
    sides: &[&[Facet<D>]],
    steepest: f64,
    near: impl Fn(f64, &[f64]) -> f64,
) -> Option<Arcs<D>>
where
    ElementKind: Topology<D>,
{
    // Each side is curved.
    for side in sides {
        directions_across(mesh, &[side])?;
    }
    let across = directions_across(mesh, sides)?;
    let turns: Vec<Turn> = (sides.iter())
        .flat_map(|facets| turns(mesh, facets))
        .collect();
    if !turns.iter().all(|turn| turn.angle < steepest.to_radians()) {
        return None;
    }
    let off = turns.iter().map(Turn::sagitta).fold(0.0, f64::max);
    let nodes: Vec<_> = (sides.iter())
        .map(|facets| corners_of(mesh, facets))
        .collect();
    let size = nodes
        .iter()
        .map(|points| extent(points))
        .fold(0.0, f64::max);
    concentric(&nodes, across, |radii, _| {
        near(off, radii).max(WRITTEN * radii[0].min(size))
    })
}

/// The deviation of facets of first order from the smooth surface that they appear to approximate. Edges sharper than `steepest`,
/// in degrees, are real edges.
pub(super) fn sagitta<const D: usize>(mesh: &Mesh<D>, sides: [&[Facet<D>]; 2], steepest: f64) -> f64
where
    ElementKind: Topology<D>,
{
    let turns = sides.map(|facets| turns(mesh, facets));
    let all = turns.iter().flatten();
    all.filter(|turn| turn.angle < steepest.to_radians())
        .map(Turn::sagitta)
        .fold(0.0, f64::max)
}

/// A facet beside a ridge.
struct Side<const D: usize> {
    number: usize,
    middle: [f64; D],
    normal: [f64; D],
    is_flat: bool,
}

/// Between neighbouring facets.
struct Turn {
    facets: [usize; 2],
    /// The distance of their middles.
    length: f64,
    /// The angle between their mean normals.
    angle: f64,
    /// Whether both are flat.
    is_flat: bool,
}

impl Turn {
    /// Facets of length h that turn by θ from one to the next are h θ/8 off an arc, if they are flat.
    fn sagitta(&self) -> f64 {
        match self.is_flat {
            true => self.length * self.angle / 8.0,
            false => 0.0,
        }
    }
}

fn turns<const D: usize>(mesh: &Mesh<D>, facets: &[Facet<D>]) -> Vec<Turn>
where
    ElementKind: Topology<D>,
{
    // By the ridges that facets share: a node in the plane, two in space.
    let mut at: HashMap<[u32; 2], Vec<Side<D>>> = HashMap::new();
    for (number, facet) in facets.iter().enumerate() {
        let corners = facet_corners(facet);
        let count = corners.len() as f64;
        let all = corners.iter().map(|&node| mesh.nodes[node as usize]);
        let middle = all.fold([0.0; D], |sum, x| {
            std::array::from_fn(|c| sum[c] + x[c] / count)
        });
        let normal = mesh.facet_normal(facet).1;
        for k in 0..corners.len() {
            let here = at.entry(ridge::<D>(corners, k)).or_default();
            here.push(Side {
                number,
                middle,
                normal,
                is_flat: is_straight(mesh, facet),
            });
        }
    }
    let pairs = at.values().filter_map(|here| match here.as_slice() {
        [one, other] => Some(Turn {
            facets: [one.number, other.number],
            length: length(minus(one.middle, other.middle)),
            angle: dot(one.normal, other.normal).clamp(-1.0, 1.0).acos(),
            is_flat: one.is_flat && other.is_flat,
        }),
        _ => None,
    });
    pairs.collect()
}

/// Arcs about one axis.
struct Arcs<const D: usize> {
    radii: Vec<f64>,
    centre: Centre<D>,
}

/// ∫ n nᵀ over sides.
fn squares<const D: usize>(mesh: &Mesh<D>, sides: &[&[Facet<D>]]) -> Mat<f64>
where
    ElementKind: Topology<D>,
{
    let mut squares = Mat::<f64>::zeros(D, D);
    for facet in sides.iter().copied().flatten() {
        let (area, normal) = mesh.facet_normal(facet);
        for i in 0..D {
            for j in 0..D {
                squares[(i, j)] += area * normal[i] * normal[j];
            }
        }
    }
    squares
}

/// The directions of the plane of an arc: all of them, or those perpendicular to the axis of a cylinder.
fn directions_across<const D: usize>(mesh: &Mesh<D>, sides: &[&[Facet<D>]]) -> Option<Vec<[f64; D]>>
where
    ElementKind: Topology<D>,
{
    let (values, vectors) = symmetric_eigen(&squares(mesh, sides))?;
    let total: f64 = values.iter().sum();
    let some = (0..D).filter(|&k| values[k] > ACROSS * total);
    let some: Vec<[f64; D]> = some
        .map(|k| std::array::from_fn(|c| vectors[(c, k)]))
        .collect();
    // A flat side has one direction, and is not an arc.
    (some.len() > 1).then_some(some)
}

/// The directions across the axis of a cylinder that a part of a boundary may be of, whose corners are the points: about that in which
/// its normals lean least, turned until the points are nearest to a circle. None in the plane.
///
/// With coordinates z along the axis and x across it, the axis goes through c and is turned by t: |x − z t|² = 2 c·(x − z t) + k, by
/// least squares, with the c of the step before in the product of both.
fn across_axis<const D: usize>(
    mesh: &Mesh<D>,
    part: &[Facet<D>],
    points: &[[f64; D]],
) -> Option<Vec<[f64; D]>>
where
    ElementKind: Space<D>,
{
    /// Steps: 3 or 4 are enough where the points are on a cylinder at all.
    const STEPS: usize = 8;
    let (_, vectors) = symmetric_eigen(&squares(mesh, &[part]))?;
    let mut axis: [f64; D] = std::array::from_fn(|c| vectors[(c, 0)]);
    let (origin, size) = (points[0], extent(points));
    if D != 3 || points.len() < 6 {
        return None;
    }
    let mut centre = [0.0; 2];
    for step in 0..STEPS {
        let ways = frame(axis);
        // First the centre alone.
        let unknowns = if step == 0 { 3 } else { 5 };
        let mut matrix = Mat::<f64>::zeros(points.len(), unknowns);
        let mut right = vec![0.0; points.len()];
        for (row, x) in points.iter().enumerate() {
            let [z, x, y] = [0, 1, 2].map(|a| dot(ways[a], minus(*x, origin)) / size);
            let along = [2.0 * z * (x - centre[0]), 2.0 * z * (y - centre[1])];
            let entries = [2.0 * x, 2.0 * y, 1.0, along[0], along[1]];
            (0..unknowns).for_each(|k| matrix[(row, k)] = entries[k]);
            right[row] = x * x + y * y;
        }
        let found = least_squares(matrix, &right);
        centre = [found[0], found[1]];
        if step > 0 {
            axis = unit(std::array::from_fn(|c| {
                axis[c] + found[3] * ways[1][c] + found[4] * ways[2][c]
            }));
        }
    }
    axis.iter()
        .all(|c| c.is_finite())
        .then(|| frame(axis)[1..].to_vec())
}

/// Sets of points about one centre in some directions, if none is farther from its arc than is `near` at these radii for the point of that
/// number in its set.
///
/// |x|² = 2 c·x + kᵢ for the points of side i, rᵢ² = kᵢ + |c|², by least squares; about a point among them, for accuracy.
fn concentric<const D: usize>(
    sides: &[Vec<[f64; D]>],
    across: Vec<[f64; D]>,
    near: impl Fn(&[f64], usize) -> f64,
) -> Option<Arcs<D>> {
    let origin = *sides[0].first()?;
    let points = || {
        let each = sides.iter().enumerate();
        each.flat_map(|(side, points)| points.iter().map(move |&x| (side, x)))
    };
    let flat = |x: [f64; D]| -> Vec<f64> {
        across
            .iter()
            .map(|way| dot(*way, minus(x, origin)))
            .collect()
    };
    let (rows, ways) = (points().count(), across.len());
    let unknowns = ways + sides.len();
    if rows < unknowns {
        return None;
    }
    let size = points()
        .map(|(_, x)| length(minus(x, origin)))
        .fold(0.0, f64::max);
    let mut matrix = Mat::<f64>::zeros(rows, unknowns);
    let mut right = vec![0.0; rows];
    for (row, (side, x)) in points().enumerate() {
        for (k, v) in flat(x).into_iter().enumerate() {
            matrix[(row, k)] = 2.0 * v / size;
            right[row] += (v / size).powi(2);
        }
        matrix[(row, ways + side)] = 1.0;
    }
    let found = least_squares(matrix, &right);
    let centre: Vec<f64> = found[..ways].iter().map(|c| c * size).collect();
    let distance = |x: [f64; D]| {
        let offsets = flat(x)
            .into_iter()
            .zip(&centre)
            .map(|(x, c)| (x - c).powi(2));
        offsets.sum::<f64>().sqrt()
    };
    let all: Vec<Vec<f64>> = (sides.iter())
        .map(|points| points.iter().map(|&x| distance(x)).collect())
        .collect();
    let mean = |all: &Vec<f64>| all.iter().sum::<f64>() / all.len() as f64;
    let radii: Vec<f64> = all.iter().map(mean).collect();
    let mut off = all
        .iter()
        .zip(&radii)
        .flat_map(|(all, radius)| all.iter().map(move |d| (d - radius).abs()).enumerate());
    // NaN is not an arc, either.
    if !off.all(|(k, off)| off <= near(&radii, k)) {
        return None;
    }
    let mut point = origin;
    for (way, c) in across.iter().zip(&centre) {
        (0..D).for_each(|k| point[k] += c * way[k]);
    }
    let centre = Centre {
        point,
        across,
        radius: radii[0],
    };
    Some(Arcs { radii, centre })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
    use std::f64::consts::PI;

    /// A ring within another one, 1 and 1.01 apart from the axis where they meet, with so many cells along each.
    fn rings(cells: [usize; 2], wave: f64) -> Mesh {
        let rectangle = |origin: f64, cells: usize, name: &str| {
            let prefix = format!("{name}-");
            rectangle(
                [origin, 0.0],
                [0.5, 0.5],
                [2, cells],
                CellShape::Quad,
                name,
                &prefix,
            )
        };
        let mut mesh = join(
            rectangle(0.5, cells[0], "in"),
            rectangle(1.01, cells[1], "out"),
        );
        for x in &mut mesh.nodes {
            let (sin, cos) = (PI * x[1]).sin_cos();
            let r = x[0] + wave * (20.0 * x[1]).sin();
            *x = [3.0 + r * cos, r * sin - 7.0];
        }
        mesh
    }

    fn found(mesh: &Mesh, range: [f64; 2]) -> Option<f64> {
        let side = |name: &str| mesh.outer_facets(name).map(<[_]>::to_vec);
        let (inner, outer) = (side("in-right"), side("out-left"));
        let (Ok(inner), Ok(outer)) = (inner, outer) else {
            panic!("the boundaries of a rectangle")
        };
        between_arcs(mesh, [&inner, &outer], range)
    }

    #[test]
    fn rings_that_fit_have_one_gap() {
        let gap = found(&rings([9, 14], 0.0), [0.002, 0.012]).expect("arcs");
        assert!((gap - 0.01).abs() < 1e-9, "{gap}");
        let whole = |mesh: &Mesh| {
            let side = |name: &str| mesh.outer_facets(name).map(<[_]>::to_vec);
            let (Ok(inner), Ok(outer)) = (side("in-right"), side("out-left")) else {
                panic!("the boundaries of a rectangle")
            };
            gap_of_arcs(mesh, [&inner, &outer], 50.0)
        };
        let gap = whole(&rings([9, 14], 0.0)).expect("arcs");
        assert!((gap - 0.01).abs() < 1e-9, "{gap}");
        assert_eq!(whole(&rings([9, 14], 0.01)), None);
        // Even enough; and no arcs.
        assert_eq!(found(&rings([9, 14], 0.0), [0.0099, 0.0101]), None);
        assert_eq!(found(&rings([9, 14], 0.01), [0.002, 0.012]), None);
        let flat = join(
            rectangle([0.0, 0.0], [0.5, 0.5], [2, 5], CellShape::Quad, "in", "in-"),
            rectangle(
                [0.6, 0.0],
                [0.5, 0.5],
                [2, 7],
                CellShape::Quad,
                "out",
                "out-",
            ),
        );
        assert_eq!(found(&flat, [0.0, 0.1]), None);
    }

    #[test]
    fn few_flanks_are_not_round() {
        let centre = |mesh: &Mesh| {
            let side = |name: &str| mesh.outer_facets(name).map(<[_]>::to_vec);
            let (Ok(inner), Ok(outer)) = (side("in-right"), side("out-left")) else {
                panic!("the boundaries of a rectangle")
            };
            centres_of_arcs(mesh, [&inner, &outer], 50.0)
        };
        let mut mesh = rings([9, 14], 0.0);
        let points = |mesh: &Mesh| {
            let first = |centres: Vec<Option<Centre>>| centres[0].clone().expect("an arc").point;
            centre(mesh).map(first)
        };
        for point in points(&mesh) {
            assert!(length(minus(point, [3.0, -7.0])) < 1e-9, "{point:?}");
        }
        // The inner one lies in the outer one.
        let lower = [3.0, -7.004];
        (mesh.nodes[..3 * 10].iter_mut()).for_each(|x| x[1] -= 0.004);
        for (point, expected) in points(&mesh).into_iter().zip([lower, [3.0, -7.0]]) {
            assert!(length(minus(point, expected)) < 1e-9, "{point:?}");
        }
        assert!(centre(&rings([9, 14], 0.01))[0].is_empty());
        // Waves far above the deviation of their facets from an arc of a large radius, and of an arc with one coarse facet.
        let bowed = |waves: f64| {
            let part = |x: f64, name: &str| {
                let prefix = format!("{name}-");
                rectangle(
                    [x, 0.0],
                    [1.0, 1.0],
                    [1, 200],
                    CellShape::Quad,
                    name,
                    &prefix,
                )
            };
            let mut mesh = join(part(-1.0, "in"), part(0.0, "out"));
            for x in &mut mesh.nodes {
                x[0] += 2e-3 * 4.0 * x[1] * (1.0 - x[1]) + waves * (40.0 * PI * x[1]).sin();
            }
            mesh
        };
        assert!(!centre(&bowed(0.0))[0].is_empty());
        assert!(centre(&bowed(1e-4))[0].is_empty());
        let serrated = |teeth: f64| {
            let mut mesh = rings([90, 90], 0.0);
            for x in &mut mesh.nodes {
                let [a, b] = [x[0] - 3.0, x[1] + 7.0];
                let (r, angle) = (a.hypot(b), b.atan2(a));
                // The last facet is nearly as long as all others.
                let share = angle / (0.5 * PI) * 90.0;
                let angle = if share > 89.5 { 0.45 * PI } else { angle / 2.0 };
                let r = r + teeth * (60.0 * angle).sin();
                *x = [r * angle.cos(), r * angle.sin()];
            }
            mesh
        };
        assert!(!centre(&serrated(0.0))[0].is_empty());
        assert!(centre(&serrated(3e-4))[0].is_empty());
        // A groove with two flanks, or three that end on a circle, and what fits into it.
        for flanks in [2, 3] {
            let part = |x: f64, name: &str| {
                let prefix = format!("{name}-");
                rectangle(
                    [x, -1.0],
                    [1.0, 2.0],
                    [1, flanks],
                    CellShape::Quad,
                    name,
                    &prefix,
                )
            };
            let mut mesh = join(part(-1.0, "in"), part(0.0, "out"));
            for x in &mut mesh.nodes {
                x[0] += 0.3 * x[1] * x[1];
            }
            assert!(centre(&mesh)[0].is_empty(), "{flanks} flanks");
            // With flanks of slightly other directions on both sides.
            let tilt = 0.005;
            for x in &mut mesh.nodes[..2 * (flanks + 1)] {
                *x = [x[0] - tilt * x[1], x[1] + tilt * x[0]];
            }
            assert!(centre(&mesh)[0].is_empty(), "{flanks} flanks, tilted");
        }
    }

    #[test]
    fn a_bolt_in_a_hole_is_round_about_its_axis() {
        let part = |origin: f64, cells: usize, name: &str| {
            let (from, prefix) = ([origin, 0.0, 0.0], format!("{name}-"));
            block(
                from,
                [0.5, 0.5, 1.0],
                [1, cells, 2],
                SolidShape::Hexahedron,
                name,
                &prefix,
            )
        };
        let mut mesh = join(part(0.5, 6, "in"), part(1.02, 9, "out"));
        for x in &mut mesh.nodes {
            let (sin, cos) = (PI * x[1]).sin_cos();
            // About an axis that is not one of the coordinate axes.
            let [a, b, c] = [x[0] * cos, x[0] * sin, x[2]];
            *x = [0.8 * a - 0.6 * c, b, 0.6 * a + 0.8 * c];
        }
        let side = |name: &str| mesh.outer_facets(name).map(<[_]>::to_vec);
        let (Ok(inner), Ok(outer)) = (side("in-right"), side("out-left")) else {
            panic!("the boundaries of a box")
        };
        let gap = between_arcs(&mesh, [&inner, &outer], [-0.01, 0.02]).expect("cylinders");
        assert!((gap - 0.02).abs() < 1e-9, "{gap}");
        for sides in [[&inner, &outer], [&outer, &inner]] {
            let gap = gap_of_arcs(&mesh, sides.map(Vec::as_slice), 50.0).expect("cylinders");
            assert!((gap - 0.02).abs() < 1e-9, "{gap}");
        }
        // Triangles whose corners are anywhere on the cylinders lean along their axis.
        let part = |origin: f64, cells: usize, name: &str| {
            let (from, prefix) = ([origin, 0.0, 0.0], format!("{name}-"));
            let (size, cells) = ([0.5, 0.5, 1.0], [1, cells, 4]);
            block(from, size, cells, SolidShape::Tetrahedron, name, &prefix)
        };
        let mut leaning = join(part(0.5, 6, "in"), part(1.02, 9, "out"));
        for (k, x) in leaning.nodes.iter_mut().enumerate() {
            if x[2] > 0.1 && x[2] < 0.9 {
                x[1] += 0.02 * (7.0 * k as f64).sin();
                x[2] += 0.06 * (11.0 * k as f64).sin();
            }
            let (sin, cos) = (PI * x[1]).sin_cos();
            let [a, b, c] = [x[0] * cos, x[0] * sin, x[2]];
            *x = [0.8 * a - 0.6 * c, b, 0.6 * a + 0.8 * c];
        }
        let [inner, outer] = ["in-right", "out-left"].map(|name| {
            let side = leaning.outer_facets(name).map(<[_]>::to_vec);
            side.unwrap_or_else(|_| panic!("the boundaries of a box"))
        });
        let sides = [&inner[..], &outer];
        for (centres, radius) in centres_of_arcs(&leaning, sides, 50.0)
            .iter()
            .zip([1.0, -1.02])
        {
            let centre = centres[0].as_ref().expect("a cylinder");
            assert!((centre.radius - radius).abs() < 1e-9, "{centre:?}");
            assert_eq!(centre.across.len(), 2);
        }
        let side = |name: &str| mesh.outer_facets(name).map(<[_]>::to_vec);
        let (Ok(inner), Ok(_)) = (side("in-right"), side("out-left")) else {
            panic!("the boundaries of a box")
        };
        // Six edges of a quarter circle of radius r are r (1 − cos(π/24)) off it.
        let off = sagitta(&mesh, [&inner, &[]], 50.0);
        let exact = 1.0 - (PI / 24.0).cos();
        assert!((off / exact - 1.0).abs() < 0.03, "{off} and {exact}");
    }
}
