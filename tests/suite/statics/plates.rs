//! Plates that hang over the edge or a corner of a table: they are held while the resultant of the weights on them is
//! above the common area with the table, and fall beyond.

use super::common_area::{Point, common, middle};
use super::scene::{
    Body, Fate, Interface, MU, STRAIN, Scene, Solid, Tally, YOUNG, judge, pair, path, plan,
};
use crate::common::Random;
use crate::common::draw::generator;
use signorini::mesh::ElementKind;

/// The distance of the resultant from the border, inside or outside, as a part of the plate's length.
const NEAR: f64 = 1e-3;

/// A plate on a table that is held from below, with its weight at some position: with friction, or guided without it.
fn plate_on_table<const D: usize>(
    table: Body<D>,
    plate: Body<D>,
    at: Point,
    upper_first: bool,
    random: &mut Random,
) -> (Scene<D>, Interface)
where
    ElementKind: Solid<D>,
{
    let area = common(&plate.area(), &table.area());
    let force = STRAIN * YOUNG * plate.volume();
    let interface = Interface {
        upper_first,
        areas: vec![area],
        force,
        at: Some(at),
    };
    let guided = random.below(4) == 0;
    let frames = <ElementKind as Solid<D>>::frames();
    let mu = if guided { 0.0 } else { MU };
    let scene = Scene {
        frame: frames[if guided { 0 } else { random.below(2) }],
        // Gravity needs no other load.
        loads: if plate.density > 0.0 {
            Vec::new()
        } else {
            vec![(1, force, at)]
        },
        pairs: vec![pair("plate", "table", upper_first, mu)],
        held: vec![("table-bottom".to_owned(), [0.0; D])],
        guided: if guided { vec![1] } else { Vec::new() },
        bodies: vec![table, plate],
    };
    (scene, interface)
}

/// Tries a plate with its weight near some points of the common area's border: a corner, or the middle of a side, inside
/// and outside.
fn near_the_border<const D: usize>(
    name: &str,
    table: &Body<D>,
    plate: &Body<D>,
    targets: usize,
    random: &mut Random,
    tally: &mut Tally,
) where
    ElementKind: Solid<D>,
{
    let area = common(&plate.area(), &table.area());
    let centre = middle(&area);
    let n = area.len();
    let length = plate.size[..D - 1].iter().copied().fold(0.0, f64::max);
    // Each of them in turn, starting anywhere.
    let first = random.below(2 * n);
    for target in (first..first + targets).map(|k| k % (2 * n)) {
        let (a, b) = (area[target / 2], area[(target / 2 + 1) % n]);
        let corner = target % 2 == 0 || D == 2;
        let border = match corner {
            true => a,
            false => [0, 1].map(|c| 0.5 * (a[c] + b[c])),
        };
        // From a corner away from the middle, from a side straight across it.
        let way = match corner {
            true => [0, 1].map(|c| border[c] - centre[c]),
            false => [b[1] - a[1], a[0] - b[0]],
        };
        let long = way[0].hypot(way[1]);
        for (fate, sign) in [(Fate::Stands, -1.0), (Fate::Falls, 1.0)] {
            for upper_first in [true, false] {
                let at = [0, 1].map(|c| border[c] + sign * NEAR * length * way[c] / long);
                let (mut table, mut plate) = (table.clone(), plate.clone());
                let shapes = <ElementKind as Solid<D>>::SHAPES;
                table.shape = random.below(shapes);
                plate.shape = random.below(shapes);
                let stiffness = path(random);
                let case = format!(
                    "{name}, shapes {} on {}, {} first, {stiffness:?}, weight {} {} at {border:.3?}",
                    plate.shape,
                    table.shape,
                    if upper_first { "plate" } else { "table" },
                    if sign < 0.0 { "inside" } else { "outside" },
                    if corner { "corner" } else { "side" },
                );
                let (scene, interface) = plate_on_table(table, plate, at, upper_first, random);
                tally.add(&case, judge(&scene, &[interface], fate, stiffness));
            }
        }
    }
}

/// Over an edge, which cuts facets of the plate of size `cell` at the fraction `cut` of them; its other end is within facets of
/// the table.
fn over_an_edge(cell: f64, cut: f64, random: &mut Random, tally: &mut Tally) {
    let length = 3.0;
    let table = Body::new("table", [-4.0, -0.5], [4.0, 0.5], 0.73 * cell);
    let whole = (0.5 * length / cell).round();
    let plate = Body::new("plate", [-(whole + cut) * cell, 0.0], [length, 0.3], cell);
    let name = format!("edge, facets of {cell}, cut at {cut}");
    // Both ends of the common part.
    near_the_border(&name, &table, &plate, 4, random, tally);
}

/// A plate that overhangs by about half of it under its own weight: with its middle this far beyond the edge.
fn by_gravity<const D: usize>(random: &mut Random, tally: &mut Tally)
where
    ElementKind: Solid<D>,
{
    let size = std::array::from_fn(|c| if c == D - 1 { 0.2 } else { 1.7 });
    let mut low = [-1.1; D];
    low[D - 1] = -0.5;
    let mut wide = [2.2; D];
    wide[D - 1] = 0.5;
    low[0] = -wide[0];
    let table = Body::new("table", low, wide, 0.23);
    for cell in [0.3, 0.18] {
        for (fate, beyond) in [(Fate::Stands, -NEAR), (Fate::Falls, NEAR)] {
            for upper_first in [true, false] {
                let mut from = [-0.8; D];
                (from[0], from[D - 1]) = ((beyond - 0.5) * size[0], 0.0);
                let mut plate = Body::new("plate", from, size, cell);
                plate.density = STRAIN * YOUNG;
                plate.shape = random.below(<ElementKind as Solid<D>>::SHAPES);
                let (at, stiffness) = (plate.middle(), path(random));
                let at = plan(at);
                let (scene, interface) =
                    plate_on_table(table.clone(), plate, at, upper_first, random);
                let name = format!(
                    "{D} dimensions, facets of {cell}, {upper_first}, {stiffness:?}, {beyond} beyond"
                );
                tally.add(&name, judge(&scene, &[interface], fate, stiffness));
            }
        }
    }
}

#[test]
fn plates_overhang_by_half_of_them() {
    let (mut random, mut tally) = (generator(4), Tally::default());
    by_gravity::<2>(&mut random, &mut tally);
    by_gravity::<3>(&mut random, &mut tally);
    tally.end();
}

#[test]
fn plates_over_edges() {
    let (mut random, mut tally) = (generator(1), Tally::default());
    for cell in [0.3, 0.1, 0.03] {
        for cut in [0.13, 0.5, 0.83] {
            over_an_edge(cell, cut, &mut random, &mut tally);
        }
    }
    tally.end();
}

/// As above, where the table ends right after a node of the plate, or right before one: the covered part of that facet, or
/// the uncovered one, is a sliver.
#[test]
fn plates_over_edges_with_slivers() {
    let (mut random, mut tally) = (generator(2), Tally::default());
    for cell in [0.3, 0.1] {
        for cut in [1e-6, 1e-4, 3e-3, 0.03, 0.97, 1.0 - 3e-3, 1.0 - 1e-6] {
            over_an_edge(cell, cut, &mut random, &mut tally);
        }
    }
    tally.end();
}

/// Over one edge or a corner in space: the plate turned on the table by an angle.
fn over_a_corner(
    cell: f64,
    angle: f64,
    place: Point,
    random: &mut Random,
    tally: &mut Tally,
    targets: usize,
) {
    let table = Body::new("table", [-2.0, -2.0, -0.5], [2.0, 2.0, 0.5], 0.83 * cell);
    let size = [1.5, 1.1, 0.3];
    let low = [place[0] - 0.5 * size[0], place[1] - 0.5 * size[1], 0.0];
    let plate = Body {
        angle,
        ..Body::new("plate", low, size, cell)
    };
    let name = format!("middle {place:?}, facets of {cell}, angle {angle}");
    near_the_border(&name, &table, &plate, targets, random, tally);
}

#[test]
fn plates_over_edges_and_corners_in_space() {
    let (mut random, mut tally) = (generator(3), Tally::default());
    for angle in [0.0, 0.4, -1.1] {
        for place in [[-0.07, -1.0], [-0.13, -0.21], [0.11, 0.05]] {
            for (cell, targets) in [(0.3, 3), (0.17, 2)] {
                over_a_corner(cell, angle, place, &mut random, &mut tally, targets);
            }
        }
    }
    over_a_corner(0.08, 0.4, [-0.13, -0.21], &mut random, &mut tally, 1);
    tally.end();
}
