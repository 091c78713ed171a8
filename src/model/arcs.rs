//! Sides of a contact that are drawn as arcs about one axis (or as parts of balls about one point). Between their facets the gap
//! varies by the deviation of the facets from the arcs, which is an artefact of the mesh.

use crate::contact::Centre;
use crate::dense::{least_squares, symmetric_eigen};
use crate::mesh::vector::{dot, length, minus};
use crate::mesh::{ElementKind, Facet, Mesh, Topology, facet_corners, facet_nodes};
use faer::Mat;
use std::collections::{BTreeSet, HashMap};

/// Gaps that scatter by no more than this part of that between the arcs are even enough.
pub(super) const EVEN: f64 = 0.1;
/// Normals with less than this part of their square along a direction are perpendicular to it: the surface around it is a
/// cylinder.
const ACROSS: f64 = 1e-6;
/// Nodes are this near to an arc, as a part of how much the gap scatters.
const ON_ARC: f64 = 0.05;
/// Two sides that look in fewer directions than this may be a groove or a chamfer with an element for each flank: their few
/// corners are on an arc, too.
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
    let nodes = nodes_of(mesh, sides, facet_corners);
    let across = directions_across(mesh, sides)?;
    let Arcs { radii, .. } = concentric(&nodes, across, |_| ON_ARC * scatter)?;
    let [first, second] = radii;
    let gap = (first - second).abs();
    (scatter > EVEN * gap).then_some(gap)
}

/// The places of some nodes of the facets of each side.
fn nodes_of<const D: usize>(
    mesh: &Mesh<D>,
    sides: [&[Facet<D>]; 2],
    of_facet: impl Fn(&Facet<D>) -> &[u32],
) -> [Vec<[f64; D]>; 2]
where
    ElementKind: Topology<D>,
{
    sides.map(|facets| {
        let nodes = facets.iter().flat_map(&of_facet);
        let nodes: BTreeSet<u32> = nodes.copied().collect();
        (nodes.iter())
            .map(|&node| mesh.nodes[node as usize])
            .collect()
    })
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
    if !sides.iter().any(|facets| facets.iter().any(is_flat)) {
        return None;
    }
    // The gap has to be as well known as the arcs.
    let near = |off: f64, gap: f64| ON_ARC * off.min(gap);
    let nodes = nodes_of(mesh, sides, facet_corners);
    let Arcs { radii, centre } = smooth_arcs(mesh, sides, &nodes, steepest, near)?;
    // The side that faces away from the axis.
    let outward: f64 = (sides[0].iter())
        .map(|facet| {
            let (area, normal) = mesh.facet_normal(facet);
            let from = minus(mesh.nodes[facet_corners(facet)[0] as usize], centre.point);
            let along = |axis: &[f64; D]| dot(*axis, normal) * dot(*axis, from);
            area * centre.across.iter().map(along).sum::<f64>()
        })
        .sum();
    Some((radii[1] - radii[0]) * outward.signum())
}

/// What two sides are round about.
///
/// Polygons that are turned against each other resist turning: normals between their facets pass the axis by a part of a
/// facet. A ring without friction would turn on a shaft until nothing presses it.
pub(super) fn centre_of_arcs<const D: usize>(
    mesh: &Mesh<D>,
    sides: [&[Facet<D>]; 2],
    steepest: f64,
) -> Option<Centre<D>>
where
    ElementKind: Topology<D>,
{
    let mut ways: Vec<[f64; D]> = Vec::new();
    for facet in sides.into_iter().flatten() {
        let normal = mesh.facet_normal(facet).1;
        if ways.iter().all(|way| dot(*way, normal).abs() < 1.0 - ALIKE) {
            ways.push(normal);
        }
        if ways.len() == ROUND {
            break;
        }
    }
    if ways.len() < ROUND {
        return None;
    }
    let nodes = nodes_of(mesh, sides, facet_nodes);
    let near = |off: f64, _| ON_ARC * off;
    Some(smooth_arcs(mesh, sides, &nodes, steepest, near)?.centre)
}

/// The arcs that these nodes of two sides are on, if no edge is as sharp as `steepest`, in degrees. The nodes may be off
/// them by `near` of the deviation of flat facets and the gap.
fn smooth_arcs<const D: usize>(
    mesh: &Mesh<D>,
    sides: [&[Facet<D>]; 2],
    nodes: &[Vec<[f64; D]>; 2],
    steepest: f64,
    near: impl Fn(f64, f64) -> f64,
) -> Option<Arcs<D>>
where
    ElementKind: Topology<D>,
{
    // Each side is curved.
    for side in sides {
        directions_across(mesh, [side, &[]])?;
    }
    let across = directions_across(mesh, sides)?;
    let turns = sides.map(|facets| turns(mesh, facets));
    let mut all = turns.iter().flatten();
    if !all.all(|turn| turn.angle < steepest.to_radians()) {
        return None;
    }
    let off = turns
        .iter()
        .flatten()
        .map(Turn::sagitta)
        .fold(0.0, f64::max);
    let near = |radii: [f64; 2]| {
        let gap = (radii[1] - radii[0]).abs();
        near(off, gap).max(WRITTEN * radii[0])
    };
    concentric(nodes, across, near)
}

fn is_flat<F: AsRef<[u32]>>(facet: &F) -> bool {
    facet_nodes(facet).len() == facet_corners(facet).len()
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
    middle: [f64; D],
    normal: [f64; D],
    is_flat: bool,
}

/// Between neighbouring facets.
struct Turn {
    /// The distance of their middles.
    length: f64,
    /// The angle between their mean normals.
    angle: f64,
    /// Whether both are of first order.
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
    for facet in facets {
        let corners = facet_corners(facet);
        let count = corners.len() as f64;
        let all = corners.iter().map(|&node| mesh.nodes[node as usize]);
        let middle = all.fold([0.0; D], |sum, x| {
            std::array::from_fn(|c| sum[c] + x[c] / count)
        });
        let normal = mesh.facet_normal(facet).1;
        for (k, &a) in corners.iter().enumerate() {
            let b = match D {
                2 => a,
                _ => corners[(k + 1) % corners.len()],
            };
            let here = at.entry([a.min(b), a.max(b)]).or_default();
            here.push(Side {
                middle,
                normal,
                is_flat: is_flat(facet),
            });
        }
    }
    let pairs = at.values().filter_map(|here| match here.as_slice() {
        [one, other] => Some(Turn {
            length: length(minus(one.middle, other.middle)),
            angle: dot(one.normal, other.normal).clamp(-1.0, 1.0).acos(),
            is_flat: one.is_flat && other.is_flat,
        }),
        _ => None,
    });
    pairs.collect()
}

/// Two arcs about one axis.
struct Arcs<const D: usize> {
    radii: [f64; 2],
    centre: Centre<D>,
}

/// The directions of the plane of an arc: all of them, or those perpendicular to the axis of a cylinder.
fn directions_across<const D: usize>(
    mesh: &Mesh<D>,
    sides: [&[Facet<D>]; 2],
) -> Option<Vec<[f64; D]>>
where
    ElementKind: Topology<D>,
{
    let mut squares = Mat::<f64>::zeros(D, D);
    for facet in sides.into_iter().flatten() {
        let (area, normal) = mesh.facet_normal(facet);
        for i in 0..D {
            for j in 0..D {
                squares[(i, j)] += area * normal[i] * normal[j];
            }
        }
    }
    let (values, vectors) = symmetric_eigen(&squares)?;
    let total: f64 = values.iter().sum();
    let some = (0..D).filter(|&k| values[k] > ACROSS * total);
    let some: Vec<[f64; D]> = some
        .map(|k| std::array::from_fn(|c| vectors[(c, k)]))
        .collect();
    // A flat side has one direction, and is not an arc.
    (some.len() > 1).then_some(some)
}

/// Two sets of points about one centre in some directions, if none is farther from its arc than is `near` at these radii.
///
/// |x|² = 2 c·x + kᵢ for the points of side i, rᵢ² = kᵢ + |c|², by least squares; about a point among them, for accuracy.
fn concentric<const D: usize>(
    sides: &[Vec<[f64; D]>; 2],
    across: Vec<[f64; D]>,
    near: impl Fn([f64; 2]) -> f64,
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
    if rows < ways + 2 {
        return None;
    }
    let size = points()
        .map(|(_, x)| length(minus(x, origin)))
        .fold(0.0, f64::max);
    let mut matrix = Mat::<f64>::zeros(rows, ways + 2);
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
    let all = sides
        .each_ref()
        .map(|points| -> Vec<f64> { points.iter().map(|&x| distance(x)).collect() });
    let radii = all
        .each_ref()
        .map(|all| all.iter().sum::<f64>() / all.len() as f64);
    let mut off = all
        .iter()
        .zip(radii)
        .flat_map(|(all, radius)| all.iter().map(move |d| (d - radius).abs()));
    // NaN is not an arc, either.
    if !off.all(|off| off <= near(radii)) {
        return None;
    }
    let mut point = origin;
    for (way, c) in across.iter().zip(&centre) {
        (0..D).for_each(|k| point[k] += c * way[k]);
    }
    let centre = Centre { point, across };
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
            centre_of_arcs(mesh, [&inner, &outer], 50.0)
        };
        let point = centre(&rings([9, 14], 0.0)).expect("arcs").point;
        assert!(length(minus(point, [3.0, -7.0])) < 1e-9, "{point:?}");
        assert!(centre(&rings([9, 14], 0.01)).is_none());
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
            assert!(centre(&mesh).is_none(), "{flanks} flanks");
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
        // Six edges of a quarter circle of radius r are r (1 − cos(π/24)) off it.
        let off = sagitta(&mesh, [&inner, &[]], 50.0);
        let exact = 1.0 - (PI / 24.0).cos();
        assert!((off / exact - 1.0).abs() < 0.03, "{off} and {exact}");
    }
}
