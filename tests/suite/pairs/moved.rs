//! The places of a pair do not depend on its position, rotation, unit of length, or numbering of nodes.

use crate::common::Random;
use crate::common::draw::generator;
use crate::common::or_panic::OrPanic as _;
use crate::common::order::{Order, of_order};
use signorini::contact::{ContactPlace, PairOptions, Space, contact_rows, mortar_contact};
use signorini::elasticity::{Body, Plane, Unknowns};
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::mesh::{Element, ElementKind, Facet, Mesh};
use signorini::reference::MATERIAL;
use std::f64::consts::FRAC_PI_2;

/// x ↦ scale · turn x + shift, with other numbers of nodes and another order of facets.
struct Motion<const D: usize> {
    turn: [[f64; D]; D],
    scale: f64,
    shift: [f64; D],
    /// The new number of each node.
    number: Vec<u32>,
}

fn shuffled(random: &mut Random, n: usize) -> Vec<u32> {
    let mut all: Vec<u32> = (0..n as u32).collect();
    (1..n).for_each(|i| all.swap(i, random.below(i + 1)));
    all
}

impl<const D: usize> Motion<D>
where
    ElementKind: Space<D>,
{
    /// The first ones are only small shifts.
    fn random(random: &mut Random, number: usize, mesh: &Mesh<D>) -> Self {
        let is_small = number.is_multiple_of(4);
        let mut turn: [[f64; D]; D] =
            std::array::from_fn(|a| std::array::from_fn(|c| f64::from(u8::from(a == c))));
        // Turns about the axes, one after the other.
        for (a, b) in [(0, 1), (1, 2 % D), (2 % D, 0)] {
            if is_small || a >= D || b >= D || a == b {
                continue;
            }
            let (sin, cos) = random.between(0.0, 6.3).sin_cos();
            for row in &mut turn {
                (row[a], row[b]) = (cos * row[a] - sin * row[b], sin * row[a] + cos * row[b]);
            }
        }
        let scale = if is_small {
            1.0
        } else {
            10f64.powf(random.between(-9.0, 9.0))
        };
        let reach = if is_small {
            10f64.powf(random.between(-14.0, -8.0))
        } else {
            10.0
        };
        Self {
            turn,
            scale,
            shift: std::array::from_fn(|_| scale * reach * random.between(-1.0, 1.0)),
            number: match is_small {
                true => (0..mesh.nodes.len() as u32).collect(),
                false => shuffled(random, mesh.nodes.len()),
            },
        }
    }

    fn turned(&self, x: [f64; D]) -> [f64; D] {
        self.turn
            .map(|row| row.iter().zip(x).map(|(a, x)| a * x).sum())
    }

    fn of(&self, x: [f64; D]) -> [f64; D] {
        let turned = self.turned(x);
        std::array::from_fn(|c| self.scale * turned[c] + self.shift[c])
    }

    fn mesh(&self, random: &mut Random, mesh: &Mesh<D>) -> Mesh<D> {
        let renamed = |nodes: &[u32]| -> Vec<u32> {
            nodes
                .iter()
                .map(|&node| self.number[node as usize])
                .collect()
        };
        let mut nodes = mesh.nodes.clone();
        for (x, &to) in mesh.nodes.iter().zip(&self.number) {
            nodes[to as usize] = self.of(*x);
        }
        let elements = mesh.elements.iter();
        let elements = elements
            .map(|element| Element::new(element.kind(), &renamed(element.nodes()), element.region))
            .collect();
        let boundaries = mesh.boundaries.iter().map(|(name, facets)| {
            let order = shuffled(random, facets.len());
            let moved = order.iter().map(|&i| -> Facet<D> {
                let mut moved = facets[i as usize];
                for node in moved.as_mut() {
                    if let Some(&to) = self.number.get(*node as usize) {
                        *node = to;
                    }
                }
                moved
            });
            (name.clone(), moved.collect())
        });
        let boundaries = boundaries.collect();
        Mesh::new(nodes, elements, mesh.regions.clone(), boundaries).or_panic()
    }
}

fn places<const D: usize>(mesh: &Mesh<D>, scale: f64) -> Vec<ContactPlace<D>>
where
    ElementKind: Space<D>,
{
    let body = Body {
        mesh,
        materials: &[MATERIAL; 2],
        plane: Plane::PlaneStrain,
        thickness: if D == 2 { scale } else { 1.0 },
    };
    let options = PairOptions {
        overlap: true,
        search_distance: Some(0.3 * scale),
        ..Default::default()
    };
    let sides = ["up-bottom", "low-top"].map(|name| &mesh.boundaries[name][..]);
    mortar_contact(&body, sides[0], sides[1], &options)
        .or_panic()
        .places
}

fn far<const D: usize>(a: [f64; D], b: [f64; D]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).powi(2))
        .sum::<f64>()
        .sqrt()
}

/// Compares the places of a mesh of size 1 or so with those of moved ones.
fn does_not_move<const D: usize>(what: &str, seed: u64, mesh: &Mesh<D>)
where
    ElementKind: Space<D>,
{
    let still = places(mesh, 1.0);
    assert!(still.len() >= 5, "{what}: {}", still.len());
    let mut random = generator(seed);
    for number in 0..200 {
        let motion = Motion::random(&mut random, number, mesh);
        let moved = motion.mesh(&mut random, mesh);
        let found = places(&moved, motion.scale);
        assert_eq!(found.len(), still.len(), "{what}, motion {number}");
        let mut taken = vec![false; found.len()];
        for place in &still {
            let at = motion.of(place.place);
            let near = (0..found.len())
                .min_by(|&a, &b| far(found[a].place, at).total_cmp(&far(found[b].place, at)));
            let k = near.expect("there are places");
            let there = &found[k];
            assert!(
                !std::mem::replace(&mut taken[k], true),
                "{what}, motion {number}"
            );
            let say = |of: &str, off: f64| {
                assert!(
                    off <= 1e-8,
                    "{what}, motion {number}, at {:?}: {of} off by {off:e}",
                    place.place
                );
            };
            say("place", far(there.place, at) / motion.scale);
            say("normal", far(there.frame[0], motion.turned(place.frame[0])));
            say("gap", (there.gap / motion.scale - place.gap).abs());
            say(
                "area",
                (there.area
                    / motion.scale.powi(D as i32 - 1)
                    / if D == 2 { motion.scale } else { 1.0 }
                    / place.area
                    - 1.0)
                    .abs(),
            );
            assert_eq!(
                there.node,
                place.node.map(|node| motion.number[node as usize])
            );
            for (there, here) in [(&there.own, &place.own), (&there.partners, &place.partners)] {
                let weight = |of: &[(u32, f64)], node: u32| {
                    of.iter()
                        .find(|entry| entry.0 == node)
                        .map_or(0.0, |entry| entry.1)
                };
                for &(node, value) in here {
                    say(
                        "weight",
                        (weight(there, motion.number[node as usize]) - value).abs(),
                    );
                }
                let sum: f64 = there.iter().map(|entry| entry.1).sum();
                say("sum", (sum - 1.0).abs());
            }
        }
        // Pressures that are shown together are so everywhere.
        let pools = |all: &[ContactPlace<D>]| {
            let mut pools: Vec<u32> = all.iter().map(|place| place.pool).collect();
            pools.sort_unstable();
            let mut sizes: Vec<usize> = pools.chunk_by(|a, b| a == b).map(<[u32]>::len).collect();
            sizes.sort_unstable();
            sizes
        };
        assert_eq!(pools(&found), pools(&still), "{what}, motion {number}");
    }
}

fn pair(
    lower: ([f64; 2], [f64; 2], [usize; 2]),
    upper: ([f64; 2], [f64; 2], [usize; 2]),
    shape: CellShape,
    order: Order,
    map: impl Fn([f64; 2]) -> [f64; 2],
) -> Mesh {
    let of = |(at, size, cells): ([f64; 2], [f64; 2], [usize; 2]), name: &str| {
        let mesh = rectangle(at, size, cells, shape, name, &format!("{name}-"));
        let mut mesh = of_order(mesh, order);
        mesh.nodes.iter_mut().for_each(|x| *x = map(*x));
        mesh
    };
    join(of(lower, "low"), of(upper, "up"))
}

type Box3 = ([f64; 3], [f64; 3], [usize; 3], SolidShape);

fn solid_pair(
    lower: Box3,
    upper: Box3,
    order: Order,
    map: impl Fn([f64; 3], bool) -> [f64; 3],
) -> Mesh<3> {
    let of = |(at, size, cells, shape): Box3, name: &str, is_upper: bool| {
        let mesh = block(at, size, cells, shape, name, &format!("{name}-"));
        let mut mesh = of_order(mesh, order);
        mesh.nodes.iter_mut().for_each(|x| *x = map(*x, is_upper));
        mesh
    };
    join(of(lower, "low", false), of(upper, "up", true))
}

#[test]
fn pairs_of_the_plane_may_be_anywhere() {
    use CellShape::{Quad, Triangle};
    let straight = |x: [f64; 2]| x;
    let long = ([0.0, 0.0], [2.0, 1.0], [9, 3]);
    let over = ([0.37, 1.0], [1.1, 1.0], [4, 2]);
    let even = ([0.3, 1.0], [1.0, 1.0], [4, 2]);
    for order in [Order::First, Order::Lagrange] {
        does_not_move(
            "a block on another",
            1,
            &pair(long, over, Quad, order, straight),
        );
        does_not_move(
            "the same with equal parts",
            2,
            &pair(
                ([0.0, 0.0], [2.0, 1.0], [8, 3]),
                even,
                Triangle,
                order,
                straight,
            ),
        );
        let arc = |[r, a]: [f64; 2]| {
            let (sin, cos) = (FRAC_PI_2 * a).sin_cos();
            [r * cos, r * sin]
        };
        // A ring in a ring; its sides are those of the rectangle turned.
        let ring = pair(
            ([0.0, 0.0], [1.0, 0.5], [8, 2]),
            ([0.1, 0.5], [0.9, 0.4], [5, 2]),
            Quad,
            order,
            |[x, y]| arc([1.5 - y, x]),
        );
        does_not_move(&format!("an arc on an arc, {order:?}"), 3, &ring);
    }
}

#[test]
fn pairs_of_space_may_be_anywhere() {
    use SolidShape::{Hexahedron, Tetrahedron, Wedge};
    let straight = |x: [f64; 3], _: bool| x;
    let low = |shape| ([0.0; 3], [2.0, 1.5, 1.0], [4, 3, 1], shape);
    let over = |shape| ([0.3, 0.2, 1.0], [1.1, 0.9, 1.0], [3, 2, 1], shape);
    // Curved as in a drawing whose lower side bulges a little.
    let bulged = |[x, y, z]: [f64; 3], is_upper: bool| {
        let off = (x - 0.85).powi(2) + (y - 0.65).powi(2);
        [x, y, if is_upper { z + 0.01 * off } else { z }]
    };
    does_not_move(
        "hexahedra",
        11,
        &solid_pair(low(Hexahedron), over(Hexahedron), Order::First, straight),
    );
    does_not_move(
        "tetrahedra",
        12,
        &solid_pair(low(Hexahedron), over(Tetrahedron), Order::First, straight),
    );
    does_not_move(
        "wedges",
        13,
        &solid_pair(low(Wedge), over(Wedge), Order::First, straight),
    );
    does_not_move(
        "bulged tetrahedra",
        14,
        &solid_pair(low(Hexahedron), over(Tetrahedron), Order::Lagrange, bulged),
    );
    does_not_move(
        "bulged hexahedra",
        15,
        &solid_pair(
            low(Hexahedron),
            over(Hexahedron),
            Order::Serendipity,
            bulged,
        ),
    );
    does_not_move(
        "hexahedra of 27 nodes",
        16,
        &solid_pair(low(Hexahedron), over(Hexahedron), Order::Lagrange, bulged),
    );
    let inside = ([0.25, 0.25, 1.0], [1.0, 0.75, 1.0], [4, 3, 1], Hexahedron);
    does_not_move(
        "equal parts",
        17,
        &solid_pair(
            ([0.0; 3], [2.0, 1.5, 1.0], [8, 6, 1], Hexahedron),
            inside,
            Order::First,
            straight,
        ),
    );
}

/// The rows of N of a pair vanish for a motion of both bodies as a whole, even across a gap and between facets that do not
/// fit: pressures have no moment on it.
fn is_not_closed<const D: usize>(what: &str, mesh: &Mesh<D>)
where
    ElementKind: Space<D>,
{
    let body = Body {
        mesh,
        materials: &[MATERIAL; 2],
        plane: Plane::PlaneStrain,
        thickness: 1.0,
    };
    let options = PairOptions {
        overlap: true,
        search_distance: Some(0.5),
        ..Default::default()
    };
    let sides = ["up-bottom", "low-top"].map(|name| &mesh.boundaries[name][..]);
    let places = mortar_contact(&body, sides[0], sides[1], &options)
        .or_panic()
        .places;
    let unknowns = Unknowns::new(vec![[None; D]; mesh.nodes.len()]);
    let rows = contact_rows(&body, &unknowns, &places).or_panic();
    for (a, b) in [(0, 1), (1, 2), (2, 0)]
        .into_iter()
        .filter(|&(a, b)| a < D && b < D)
    {
        let mut turn = vec![0.0; D * mesh.nodes.len()];
        for (u, x) in turn.chunks_mut(D).zip(&mesh.nodes) {
            (u[a], u[b]) = (-x[b], x[a]);
        }
        let mut moved = vec![0.0; rows.normal.n_rows()];
        (rows.normal.triplets()).for_each(|(i, j, value)| moved[i] += value * turn[j]);
        let most = moved
            .iter()
            .fold(0.0, |most: f64, moved| most.max(moved.abs()));
        assert!(most < 1e-10, "{what}, about {a}{b}: {most:e}");
    }
}

#[test]
fn pairs_that_turn_as_a_whole_do_not_close() {
    use SolidShape::{Hexahedron, Tetrahedron};
    let long = ([0.0, 0.0], [2.0, 1.0], [9, 3]);
    for order in [Order::First, Order::Lagrange] {
        let over = ([0.37, 1.2], [1.1, 1.0], [4, 2]);
        let plane = pair(long, over, CellShape::Quad, order, |x| x);
        is_not_closed("blocks apart", &plane);
        let bent = pair(long, over, CellShape::Quad, order, |[x, y]| {
            [x, y + if y > 1.1 { 0.1 * (3.0 * x).sin() } else { 0.0 }]
        });
        is_not_closed("a wave over a block", &bent);
    }
    let low = ([0.0; 3], [2.0, 1.5, 1.0], [4, 3, 1], Hexahedron);
    for (order, shape) in [
        (Order::First, Hexahedron),
        (Order::First, Tetrahedron),
        (Order::Lagrange, Tetrahedron),
        (Order::Serendipity, Hexahedron),
    ] {
        let over = ([0.3, 0.2, 1.15], [1.1, 0.9, 1.0], [3, 2, 1], shape);
        let bulged = |[x, y, z]: [f64; 3], is_upper: bool| {
            let off = (x - 0.85).powi(2) + (y - 0.65).powi(2);
            [x, y, if is_upper { z + 0.1 * off } else { z }]
        };
        is_not_closed("solids apart", &solid_pair(low, over, order, |x, _| x));
        is_not_closed("a ball over a block", &solid_pair(low, over, order, bulged));
    }
}
