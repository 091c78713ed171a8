//! Each kind of element by itself.

use super::*;
use crate::mesh::{Topology, gmsh};
use approx::assert_relative_eq;

const PLANE: [ElementKind; 5] = [
    ElementKind::Triangle,
    ElementKind::Triangle6,
    ElementKind::Quad,
    ElementKind::Quad8,
    ElementKind::Quad9,
];

fn in_space() -> impl Iterator<Item = ElementKind> {
    (ElementKind::ALL.into_iter()).filter(|kind| !PLANE.contains(kind))
}

/// Numbers between 0 and 1 without a pattern.
fn scattered(i: usize) -> f64 {
    (1.0 + (12.9898 * i as f64).sin() * 43_758.545_3).rem_euclid(1.0)
}

/// The shape functions of a kind by the definition: 1 at their node, 0 at the others, a sum of 1, and derivatives that
/// differences confirm. Stresses are extrapolated from where they are taken to there.
struct Definition(ElementKind);

impl<const D: usize> Visit<D> for Definition {
    type Output = ();

    fn visit<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(self) {
        let kind = self.0;
        assert_eq!(kind.n_nodes(), N);
        for (a, &at) in E::NODES.iter().enumerate() {
            let (shape, _) = E::shapes(at);
            for (b, value) in shape.into_iter().enumerate() {
                let expected = f64::from(u8::from(a == b));
                assert_relative_eq!(value, expected, epsilon = 1e-15);
            }
        }
        for (k, of) in kind.middles().iter().enumerate() {
            let node = E::NODES[kind.n_corners() + k];
            let mean = |c: usize| of.iter().map(|&corner| E::NODES[corner][c]).sum::<f64>();
            for c in 0..D {
                assert_relative_eq!(node[c], mean(c) / of.len() as f64, epsilon = 1e-15);
            }
        }
        let points = E::stiffness_rule().into_iter().chain(E::load_rule());
        for (xi, weight) in points {
            assert!(weight > 0.0, "{kind:?}");
            let (shape, local) = E::shapes(xi);
            assert_relative_eq!(shape.iter().sum::<f64>(), 1.0, epsilon = 1e-14);
            for j in 0..D {
                const STEP: f64 = 1e-6;
                let [up, down] = [STEP, -STEP].map(|step| {
                    let mut moved = xi;
                    moved[j] += step;
                    E::shapes(moved).0
                });
                for a in 0..N {
                    let slope = (up[a] - down[a]) / (2.0 * STEP);
                    assert_relative_eq!(local[a][j], slope, epsilon = 1e-8);
                }
            }
        }
        let stress_points: Vec<_> = E::stress_points().collect();
        for (i, &at) in stress_points.iter().enumerate() {
            for j in 0..stress_points.len() {
                let expected = f64::from(u8::from(i == j));
                assert_relative_eq!(E::extrapolation(at, j), expected, epsilon = 1e-14);
            }
        }
        for at in E::NODES {
            let sum: f64 = (0..stress_points.len())
                .map(|point| E::extrapolation(at, point))
                .sum();
            assert_relative_eq!(sum, 1.0, epsilon = 1e-14);
        }
    }
}

#[test]
fn shape_functions_satisfy_their_definition() {
    PLANE
        .iter()
        .for_each(|&kind| Topology::<2>::with(kind, Definition(kind)));
    in_space().for_each(|kind| Topology::<3>::with(kind, Definition(kind)));
}

/// A rule applied to the products of powers of the coordinates, up to its degree, against closed forms.
struct Monomials {
    kind: ElementKind,
    /// Degrees of the two rules: all together on triangles and tetrahedra, else along each axis.
    stiffness: u32,
    load: u32,
}

fn factorial(n: u32) -> f64 {
    (1..=n).map(f64::from).product()
}

/// ∫ xᵖ over (−1, 1).
fn line(p: u32) -> f64 {
    if p.is_multiple_of(2) {
        2.0 / f64::from(p + 1)
    } else {
        0.0
    }
}

/// ∫ rᵃ sᵇ (tᶜ) over a reference element.
fn integral(kind: ElementKind, powers: &[u32]) -> f64 {
    let simplex = |powers: &[u32]| {
        let (product, sum) = (
            powers.iter().map(|&p| factorial(p)),
            powers.iter().sum::<u32>(),
        );
        product.product::<f64>() / factorial(sum + powers.len() as u32)
    };
    match kind.linear() {
        ElementKind::Triangle | ElementKind::Tetrahedron => simplex(powers),
        ElementKind::Wedge => simplex(&powers[..2]) * line(powers[2]),
        // The square at height t has the half width 1 − t.
        ElementKind::Pyramid => {
            let [a, b, c] = [powers[0], powers[1], powers[2]];
            let width = a + b + 2;
            line(a) * line(b) * factorial(c) * factorial(width) / factorial(c + width + 1)
        }
        _ => powers.iter().map(|&p| line(p)).product(),
    }
}

impl<const D: usize> Visit<D> for Monomials {
    type Output = ();

    fn visit<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(self) {
        let kind = self.kind;
        let rules: [(u32, Vec<_>); 2] = [
            (self.stiffness, E::stiffness_rule().to_vec()),
            (self.load, E::load_rule().collect()),
        ];
        for (degree, rule) in rules {
            let each = degree + 1;
            for number in 0..each.pow(D as u32) {
                let powers: Vec<u32> = (0..D as u32).map(|c| number / each.pow(c) % each).collect();
                let alone =
                    kind.linear() == ElementKind::Quad || kind.linear() == ElementKind::Hexahedron;
                if !alone && powers.iter().sum::<u32>() > degree {
                    continue;
                }
                let found: f64 = (rule.iter())
                    .map(|(at, weight)| {
                        let powers = at.iter().zip(&powers).map(|(x, &p)| x.powi(p as i32));
                        weight * powers.product::<f64>()
                    })
                    .sum();
                let expected = integral(kind, &powers);
                assert_relative_eq!(found, expected, epsilon = 1e-14);
            }
        }
    }
}

#[test]
fn rules_integrate_up_to_their_degrees() {
    for (kind, stiffness, load) in [
        (ElementKind::Triangle, 1, 4),
        (ElementKind::Triangle6, 2, 6),
        (ElementKind::Quad, 3, 5),
        (ElementKind::Quad8, 5, 7),
        (ElementKind::Quad9, 5, 7),
    ] {
        Topology::<2>::with(
            kind,
            Monomials {
                kind,
                stiffness,
                load,
            },
        );
    }
    for (kind, stiffness, load) in [
        (ElementKind::Tetrahedron, 1, 5),
        (ElementKind::Tetrahedron10, 2, 5),
        (ElementKind::Hexahedron, 3, 5),
        (ElementKind::Hexahedron20, 5, 5),
        (ElementKind::Hexahedron27, 5, 5),
        (ElementKind::Wedge, 2, 4),
        (ElementKind::Wedge15, 4, 4),
        (ElementKind::Wedge18, 4, 4),
        (ElementKind::Pyramid, 3, 3),
    ] {
        Topology::<3>::with(
            kind,
            Monomials {
                kind,
                stiffness,
                load,
            },
        );
    }
}

/// A curved element reproduces a quadratic field where its sides are straight, and a linear one always.
struct Fields(ElementKind);

impl<const D: usize> Visit<D> for Fields {
    type Output = ();

    fn visit<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(self) {
        let kind = self.0;
        let bent = |amount: f64| -> [[f64; D]; N] {
            std::array::from_fn(|a| {
                let x = E::NODES[a];
                std::array::from_fn(|c| {
                    let turned = x[c] + 0.3 * x[(c + 1) % D];
                    turned + amount * (scattered(D * a + c) - 0.5)
                })
            })
        };
        // With straight sides and middles the map is affine.
        for (x, degree) in [(bent(0.0), kind.order()), (bent(0.15), 1)] {
            let field = |x: [f64; D]| {
                let square: f64 = x
                    .iter()
                    .enumerate()
                    .map(|(c, v)| (c as f64 - 0.5) * v * x[0])
                    .sum();
                2.0 - x[0] + 3.0 * x[1] + if degree == 2 { square } else { 0.0 }
            };
            for (xi, weight) in E::stiffness_rule() {
                let point = E::at(xi, weight, &x);
                let place = point.place(&x);
                let value: f64 = (point.shape.iter().zip(&x))
                    .map(|(phi, &x)| phi * field(x))
                    .sum();
                assert_relative_eq!(value, field(place), epsilon = 1e-13);
                for c in 0..D {
                    let slope: f64 = (point.gradient.iter().zip(&x))
                        .map(|(g, &x)| g[c] * field(x))
                        .sum();
                    const STEP: f64 = 1e-6;
                    let [up, down] = [STEP, -STEP].map(|step| {
                        let mut moved = place;
                        moved[c] += step;
                        field(moved)
                    });
                    assert_relative_eq!(slope, (up - down) / (2.0 * STEP), epsilon = 1e-8);
                }
            }
        }
    }
}

#[test]
fn elements_hold_the_fields_of_their_order() {
    PLANE
        .iter()
        .for_each(|&kind| Topology::<2>::with(kind, Fields(kind)));
    in_space().for_each(|kind| Topology::<3>::with(kind, Fields(kind)));
}

/// The nodes of facets are where those of the element are: a facet's middle nodes between its corners.
#[test]
fn facets_are_named_as_the_elements_are() {
    struct Nodes;
    impl<const D: usize> Visit<D> for Nodes {
        type Output = Vec<Vec<f64>>;
        fn visit<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(
            self,
        ) -> Vec<Vec<f64>> {
            E::NODES.iter().map(|x| x.to_vec()).collect()
        }
    }
    for kind in ElementKind::ALL {
        let plane = PLANE.contains(&kind);
        let nodes = if plane {
            Topology::<2>::with(kind, Nodes)
        } else {
            Topology::<3>::with(kind, Nodes)
        };
        let linear = kind.linear().facets();
        for (facet, corners) in kind.facets().iter().zip(linear) {
            let n = corners.len();
            assert_eq!(&facet[..n], *corners);
            let middles: Vec<Vec<usize>> = match (plane, n, facet.len()) {
                (_, n, len) if n == len => Vec::new(),
                (true, ..) => vec![vec![0, 1]],
                (_, n, len) => {
                    let mut middles: Vec<_> = (0..n).map(|k| vec![k, (k + 1) % n]).collect();
                    middles.extend((len == 9).then(|| (0..4).collect()));
                    middles
                }
            };
            assert_eq!(facet.len() - n, middles.len());
            for (&node, of) in facet[n..].iter().zip(middles) {
                for c in 0..nodes[node].len() {
                    let mean =
                        of.iter().map(|&k| nodes[facet[k]][c]).sum::<f64>() / of.len() as f64;
                    assert_relative_eq!(nodes[node][c], mean, epsilon = 1e-15);
                }
            }
        }
        // Reversed, the nodes are a mirror image, and reversed twice they are as before.
        let listed: Vec<u32> = (0..kind.n_nodes() as u32).collect();
        let mut turned = listed.clone();
        kind.turn(&mut turned);
        assert_ne!(turned, listed);
        for (k, of) in kind.middles().iter().enumerate() {
            let node = &nodes[turned[kind.n_corners() + k] as usize];
            for c in 0..node.len() {
                let mean = of
                    .iter()
                    .map(|&a| nodes[turned[a] as usize][c])
                    .sum::<f64>();
                assert_relative_eq!(node[c], mean / of.len() as f64, epsilon = 1e-15);
            }
        }
        kind.turn(&mut turned);
        assert_eq!(turned, listed);
    }
}

/// The edges of Gmsh's elements in its order (Gmsh reference manual, node ordering): the middle node k is between these
/// corners.
#[test]
fn gmsh_lists_the_middles_in_its_own_order() {
    let tetrahedron = [[0, 1], [1, 2], [2, 0], [3, 0], [2, 3], [1, 3]];
    let hexahedron = [
        [0, 1],
        [0, 3],
        [0, 4],
        [1, 2],
        [1, 5],
        [2, 3],
        [2, 6],
        [3, 7],
        [4, 5],
        [4, 7],
        [5, 6],
        [6, 7],
    ];
    let faces = [
        [0, 3, 2, 1],
        [0, 1, 5, 4],
        [0, 4, 7, 3],
        [1, 2, 6, 5],
        [2, 3, 7, 6],
        [4, 5, 6, 7],
    ];
    let wedge = [
        [0, 1],
        [0, 2],
        [0, 3],
        [1, 2],
        [1, 4],
        [2, 5],
        [3, 4],
        [3, 5],
        [4, 5],
    ];
    let sides = [[0, 1, 4, 3], [0, 3, 5, 2], [1, 2, 5, 4]];
    let sorted = |of: &[usize]| {
        let mut of = of.to_vec();
        of.sort_unstable();
        of
    };
    for (kind, edges, faces) in [
        (ElementKind::Tetrahedron10, &tetrahedron[..], &[][..]),
        (ElementKind::Hexahedron20, &hexahedron[..], &[][..]),
        (ElementKind::Hexahedron27, &hexahedron[..], &faces[..]),
        (ElementKind::Wedge15, &wedge[..], &[][..]),
        (ElementKind::Wedge18, &wedge[..], &sides[..]),
    ] {
        let theirs: Vec<Vec<usize>> = (edges.iter().map(|of| sorted(of)))
            .chain(faces.iter().map(|of| sorted(of)))
            .collect();
        let order = gmsh::order(kind).expect("another one");
        let n = kind.n_corners();
        for (k, of) in kind
            .middles()
            .iter()
            .enumerate()
            .filter(|(_, of)| of.len() < 8)
        {
            assert_eq!(theirs[order[n + k] - n], sorted(of), "{kind:?}, {k}");
        }
    }
}

/// Areas and volumes of curved elements: a sector of a ring and a quarter of a tube tend to their closed forms with the
/// fourth power of the size.
#[test]
fn curved_elements_have_the_measure_of_their_shape() {
    let ring = |cells: usize| {
        let angle = std::f64::consts::FRAC_PI_2 / cells as f64;
        let place = |[s, t]: [f64; 2]| {
            let (r, phi) = (1.5 + 0.5 * s, 0.5 * angle * (1.0 + t));
            [r * phi.cos(), r * phi.sin()]
        };
        struct Area<F>(F);
        impl<F: Fn([f64; 2]) -> [f64; 2]> Visit<2> for Area<F> {
            type Output = f64;
            fn visit<E: ShapeFunctions<2, N, Q>, const N: usize, const Q: usize>(self) -> f64 {
                let x = E::NODES.map(self.0);
                E::load_points(&x).map(|point| point.weight).sum()
            }
        }
        let exact = 0.75 * std::f64::consts::PI / cells as f64;
        [ElementKind::Quad, ElementKind::Quad8, ElementKind::Quad9]
            .map(|kind| (Topology::<2>::with(kind, Area(place)) / exact - 1.0).abs())
    };
    let (coarse, fine) = (ring(4), ring(8));
    for kind in 0..3 {
        let order = (coarse[kind] / fine[kind]).log2();
        let expected = if kind == 0 { 2.0 } else { 4.0 };
        assert!((order - expected).abs() < 0.1, "{kind}: {order}");
    }
}
