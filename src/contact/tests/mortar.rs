//! Contact between boundaries of two bodies in space: conditions on the weights of partners and the gaps.

use super::*;
use crate::mesh::structured::{SolidShape, block, join};
use crate::mesh::vector::{cross, minus};
use SolidShape::{Hexahedron, Tetrahedron, Wedge};

/// The map that moves a block of cells.
type Map<'a> = &'a dyn Fn([f64; 3]) -> [f64; 3];

/// A block whose boundaries have its name in front.
fn part(name: &str, at: [f64; 3], size: [f64; 3], cells: [usize; 3], shape: SolidShape) -> Mesh<3> {
    block(at, size, cells, shape, name, &format!("{name}-"))
}

/// A block of 2 × 1.5 × 1 under one of `size` × 1 with the lower corner `at`; both with their nodes moved.
fn blocks(
    lower: (SolidShape, [usize; 2]),
    upper: (SolidShape, [usize; 2]),
    at: [f64; 3],
    size: [f64; 2],
    map: Map,
) -> Mesh<3> {
    blocks_of([1, 1], lower, upper, at, size, map)
}

/// The same, optionally with elements of second order.
fn blocks_of(
    orders: [usize; 2],
    lower: (SolidShape, [usize; 2]),
    upper: (SolidShape, [usize; 2]),
    at: [f64; 3],
    size: [f64; 2],
    map: Map,
) -> Mesh<3> {
    let of = |(shape, [a, b]): (SolidShape, [usize; 2]), order: usize, at, size, name: &str| {
        let mut mesh = part(name, at, size, [a, b, 2], shape);
        if order == 2 {
            mesh = mesh.raised().unwrap_or_else(|error| panic!("{error}"));
        }
        mesh.nodes.iter_mut().for_each(|x| *x = map(*x));
        mesh
    };
    join(
        of(lower, orders[0], [0.0; 3], [2.0, 1.5, 1.0], "low"),
        of(upper, orders[1], at, [size[0], size[1], 1.0], "up"),
    )
}

const ORDERS: [[usize; 2]; 4] = [[1, 1], [2, 2], [1, 2], [2, 1]];

fn found(mesh: &Mesh<3>, sides: [&str; 2], options: &PairOptions<3>) -> Vec<ContactPlace<3>> {
    let [here, there] = sides.map(|name| &mesh.boundaries[name][..]);
    let found = mortar_contact(&body(mesh), here, there, options);
    let found = found.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(found.unmet, None);
    found.places
}

/// The mean position of the partners of a node.
fn met(mesh: &Mesh<3>, node: &ContactPlace<3>) -> [f64; 3] {
    mean(&node.partners, |other| mesh.nodes[other as usize])
}

const PAIRS: [[(SolidShape, [usize; 2]); 2]; 5] = [
    [(Hexahedron, [4, 3]), (Hexahedron, [4, 3])],
    [(Hexahedron, [5, 4]), (Hexahedron, [3, 7])],
    [(Tetrahedron, [5, 4]), (Hexahedron, [4, 3])],
    [(Hexahedron, [3, 5]), (Tetrahedron, [7, 2])],
    [(Wedge, [6, 5]), (Tetrahedron, [5, 7])],
];

/// A turn of space by a full matrix, and a shift.
fn turned([x, y, z]: [f64; 3]) -> [f64; 3] {
    let axes = [
        unit([2.0, 1.0, -2.0]),
        unit([1.0, 2.0, 2.0]),
        unit([2.0, -2.0, 1.0]),
    ];
    std::array::from_fn(|c| 0.3 + x * axes[0][c] + y * axes[1][c] + z * axes[2][c])
}

/// Between flat faces: a uniform pressure on one side is a uniform pressure on the other, as a patch test requires. The
/// partner point of a node is straight above it by the gap, and so no pair has a moment.
#[test]
fn flat_faces_hand_on_a_uniform_pressure() {
    let straight: Map = &|x| x;
    // Cells that are parallelograms, and cells that are not, in the planes z = 1 and z = 1.25.
    let sheared: Map = &|[x, y, z]| [x + 0.3 * y, y - 0.2 * x, z];
    let skew: Map = &|[x, y, z]| [x + 0.1 * x * y, y * (1.0 + 0.2 * x), z];
    let maps: [(Map, f64); 4] = [
        (straight, 1e-13),
        (sheared, 1e-13),
        (&turned, 1e-13),
        (skew, 1e-9),
    ];
    for (orders, [lower, upper]) in ORDERS.iter().flat_map(|n| PAIRS.map(|pair| (*n, pair))) {
        for (k, (map, accuracy)) in maps.into_iter().enumerate() {
            // Of faces whose edges are curved in their plane, the borders go from node to node.
            let is_curved = k == 3 && orders.contains(&2);
            let accuracy = if is_curved { 1e-5 } else { accuracy };
            let mesh = blocks_of(orders, lower, upper, [0.0, 0.0, 1.25], [2.0, 1.5], map);
            for sides in [["low-top", "up-bottom"], ["up-bottom", "low-top"]] {
                let nodes = found(&mesh, sides, &PairOptions::default());
                let here = body(&mesh);
                let whole = |name: &str| {
                    let mut areas = vec![0.0; mesh.nodes.len()];
                    here.integrate_on_boundary(&mesh.boundaries[name], &|_| 1.0, &mut areas);
                    areas
                };
                let [own, expected] = sides.map(whole);
                let mut handed_on = vec![0.0; mesh.nodes.len()];
                let mut taken = handed_on.clone();
                for node in &nodes {
                    let x = node.mean(|own| mesh.nodes[own as usize]);
                    // A curved border is not just where that of the other side is.
                    assert!(node.area > 0.0 && (node.node.is_some() || is_curved));
                    if !orders.contains(&2) {
                        assert_relative_eq!(
                            node.area,
                            own[node.node.expect("a node") as usize],
                            max_relative = accuracy
                        );
                    }
                    for &(other, weight) in &node.own {
                        taken[other as usize] += weight * node.area;
                    }
                    let sum: f64 = node.partners.iter().map(|p| p.1).sum();
                    assert_relative_eq!(sum, 1.0, max_relative = 1e-12);
                    assert_relative_eq!(node.gap, 0.25, max_relative = 1e-11);
                    let to = minus(met(&mesh, node), x);
                    for c in 0..3 {
                        assert_relative_eq!(to[c], 0.25 * node.frame[0][c], epsilon = 1e-11);
                    }
                    for &(other, weight) in &node.partners {
                        handed_on[other as usize] += weight * node.area;
                    }
                }
                for (handed_on, expected) in handed_on.iter().zip(&expected) {
                    assert_relative_eq!(handed_on, expected, epsilon = accuracy);
                }
                for (taken, expected) in taken.iter().zip(&own) {
                    assert_relative_eq!(taken, expected, epsilon = accuracy);
                }
            }
        }
    }
}

/// A face that covers a part of the other, whatever the part, from either side: the areas add up to it, and forces act
/// on it or on its border, never beyond, at the mean of their partners. A uniform pressure is transferred exactly.
#[test]
fn partly_covered_facets_count_in_part() {
    // Corners of the upper face, with overlaps from a half down to a needle on one facet.
    let uppers = [
        ([0.77, 0.41], [0.83, 2.0]),
        ([0.503, 0.1], [1.3, 0.9]),
        ([1.999, 0.3], [0.7, 1.2]),
        ([0.6, 0.6], [1e-3, 1e-3]),
        ([1.1, 0.7], [1e-6, 2e-6]),
    ];
    for (orders, [lower, upper]) in ORDERS.iter().flat_map(|n| PAIRS.map(|pair| (*n, pair))) {
        for (at, size) in uppers {
            let mesh = blocks_of(orders, lower, upper, [at[0], at[1], 1.0], size, &turned);
            let common = [2.0, 1.5].map(|v: f64| v);
            let to = [0, 1].map(|c| common[c].min(at[c] + size[c]));
            let common = (to[0] - at[0]) * (to[1] - at[1]);
            let origin = turned([0.0; 3]);
            let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(|x| minus(turned(x), origin));
            for sides in [["low-top", "up-bottom"], ["up-bottom", "low-top"]] {
                let places = found(&mesh, sides, &PairOptions::default());
                let area: f64 = places.iter().map(|place| place.area).sum();
                assert_relative_eq!(area, common, max_relative = 1e-7);
                let mut moments = [0.0; 2];
                for place in &places {
                    assert!(place.area > 0.0);
                    let off = minus(met(&mesh, place), place.place);
                    assert!(length(off) < 1e-9, "{off:?}");
                    let weights: f64 = place.own.iter().map(|p| p.1).sum();
                    assert_relative_eq!(weights, 1.0, max_relative = 1e-9);
                    let x = axes.map(|axis| dot(minus(place.place, origin), axis));
                    for c in 0..2 {
                        // The size of places is that of the facets here, and of slivers, which are pooled inwards.
                        assert!(x[c] > at[c] - 1e-9 && x[c] < to[c] + 1e-9, "{x:?}");
                        moments[c] += place.area * x[c];
                    }
                }
                for c in 0..2 {
                    let centre = 0.5 * (at[c] + to[c]);
                    assert_relative_eq!(moments[c], common * centre, max_relative = 1e-7);
                }
            }
        }
    }
}

/// Two needles of one body, and of two, under one facet: each has its own places.
#[test]
fn needles_under_one_facet_have_their_own_places() {
    let needle = |name: &str, at: [f64; 2]| {
        part(
            name,
            [at[0], at[1], 1.0],
            [0.01, 0.01, 0.5],
            [1, 1, 1],
            Hexahedron,
        )
    };
    let table = part("low", [0.0; 3], [4.0, 4.0, 1.0], [1, 1, 1], Hexahedron);
    let mesh = join(
        join(table, needle("a", [1.0, 1.0])),
        needle("b", [2.5, 3.0]),
    );
    let others = ["a-bottom", "b-bottom"]
        .map(|name| mesh.boundaries[name].clone())
        .concat();
    for sides in [
        [&mesh.boundaries["low-top"], &others],
        [&others, &mesh.boundaries["low-top"]],
    ] {
        let found = mortar_contact(&body(&mesh), sides[0], sides[1], &PairOptions::default())
            .unwrap_or_else(|error| panic!("{error}"));
        assert_eq!((found.places.len(), found.unmet), (8, None));
        for place in &found.places {
            assert_relative_eq!(place.area, 2.5e-5, max_relative = 1e-9);
            let [x, y, z] = place.place;
            let near = |at: f64| (at - 1e-9..at + 0.01 + 1e-9).contains(&x);
            assert!(
                (near(1.0) && y < 1.02) || (near(2.5) && y > 2.98),
                "{x} {y}"
            );
            assert_relative_eq!(z, 1.0, max_relative = 1e-12);
        }
        // On the large facet pressures of the four places of a needle are shown as one.
        let mut pools: Vec<u32> = found.places.iter().map(|place| place.pool).collect();
        pools.sort_unstable();
        pools.dedup();
        let on_large = std::ptr::eq(sides[0], &mesh.boundaries["low-top"]);
        assert_eq!(pools.len(), if on_large { 2 } else { 8 });
    }
}

/// Edges cut a boundary into parts with their own normals; near a plane of symmetry normals are in it.
#[test]
fn edges_and_planes_of_symmetry_have_their_normals() {
    // Two blocks with a roof of this slope in between.
    let roof = |slope: f64| {
        move |[x, y, z]: [f64; 3]| {
            [
                x,
                y,
                z - slope * (x - 1.0).abs() * if z > 1.5 { 0.0 } else { 1.0 },
            ]
        }
    };
    for (slope, is_edge) in [(0.3_f64, false), (1.0, true)] {
        let map = roof(slope);
        let mesh = blocks(PAIRS[0][0], PAIRS[0][1], [0.0, 0.0, 1.0], [2.0, 1.5], &map);
        let ridge = |place: &&ContactPlace<3>| (place.place[0] - 1.0).abs() < 1e-9;
        let places = found(&mesh, ["low-top", "up-bottom"], &PairOptions::default());
        let there: Vec<_> = places.iter().filter(ridge).collect();
        assert_eq!(there.len(), if is_edge { 8 } else { 4 });
        for place in there {
            let across = place.frame[0][0].abs();
            let expected = if is_edge { slope.atan().sin() } else { 0.0 };
            assert_relative_eq!(across, expected, epsilon = 1e-12);
        }
        let options = PairOptions {
            edge_angle: 180.0,
            ..Default::default()
        };
        let places = found(&mesh, ["low-top", "up-bottom"], &options);
        assert_eq!(places.iter().filter(ridge).count(), 4);
        // One half of it, with its mirror image in mind.
        let half = |places: &[ContactPlace<3>]| -> f64 {
            let there = places.iter().filter(|place| place.place[0] < 1e-9);
            there
                .map(|place| place.frame[0][0].abs())
                .fold(0.0, f64::max)
        };
        let planes = (0..mesh.nodes.len() as u32)
            .filter(|&node| mesh.nodes[node as usize][0] < 1e-9)
            .map(|node| (node, vec![[1.0, 0.0, 0.0]]))
            .collect();
        let options = PairOptions {
            symmetry: Some(&planes),
            ..Default::default()
        };
        let places = found(&mesh, ["low-top", "up-bottom"], &options);
        let expected = if is_edge { slope.atan().sin() } else { 0.0 };
        assert_relative_eq!(half(&places), expected, epsilon = 1e-12);
    }
}

/// A boundary that is opposite, but behind something nearer, is reported.
#[test]
fn unmet_facets_are_reported() {
    let lower = part("low", [0.0; 3], [2.0, 1.0, 1.0], [5, 3, 1], Hexahedron);
    let plate = |name: &str, z: f64, length: f64| {
        part(
            name,
            [0.0, 0.0, z],
            [length, 1.0, 0.1],
            [4, 2, 1],
            Hexahedron,
        )
    };
    let mesh = join(join(lower, plate("a", 1.1, 1.0)), plate("b", 1.5, 2.0));
    let others = ["a-bottom", "b-bottom"]
        .map(|name| mesh.boundaries[name].clone())
        .concat();
    let options = PairOptions {
        search_distance: Some(1.0),
        ..Default::default()
    };
    let found = mortar_contact(&body(&mesh), &mesh.boundaries["low-top"], &others, &options)
        .unwrap_or_else(|error| panic!("{error}"));
    let unmet = found.unmet.expect("half of the upper plate");
    assert_eq!(unmet.facets, 4, "{unmet:?}");
    assert_relative_eq!(unmet.area, 1.0, max_relative = 1e-9);
}

/// On bent faces that fit into each other the forces of a pair have neither a resultant nor, along the normals, a moment.
#[test]
fn pressures_on_bent_faces_balance() {
    let bent: Map = &|[x, y, z]| {
        let (sin, cos) = (0.6 * (x - 1.0)).sin_cos();
        let radius = 2.0 + z + 0.1 * y * y;
        [radius * sin, y + 0.2 * x, radius * cos]
    };
    let options = PairOptions {
        gap: Some(&|_| 0.0),
        ..Default::default()
    };
    for (orders, [lower, upper]) in ORDERS.iter().flat_map(|n| PAIRS.map(|pair| (*n, pair))) {
        let mesh = blocks_of(orders, lower, upper, [0.0, 0.0, 1.0], [2.0, 1.5], bent);
        let nodes = found(&mesh, ["up-bottom", "low-top"], &options);
        let (mut moment, mut size) = ([0.0; 3], 0.0);
        let mut resultant = [0.0; 3];
        for (k, node) in nodes.iter().enumerate() {
            let x = node.mean(|own| mesh.nodes[own as usize]);
            let force = node.frame[0].map(|c| c * node.area * (1.0 + (k % 7) as f64));
            let about = cross(minus(x, met(&mesh, node)), force);
            let sum: f64 = node.partners.iter().map(|p| p.1).sum();
            for c in 0..3 {
                resultant[c] += (1.0 - sum) * force[c];
                moment[c] += about[c];
            }
            size += length(force);
            // Towards the other side: the upper body looks inwards.
            assert!(dot(node.frame[0], [0.0, 0.0, -1.0]) > 0.5);
        }
        assert!(length(resultant) < 1e-13 * size && length(moment) < 1e-12 * size);
    }
}

/// A face that could meet either of two faces meets the nearer one, whichever that is.
#[test]
fn the_nearer_of_two_faces_counts() {
    let lower = part("low", [0.0; 3], [2.0, 1.0, 1.0], [5, 3, 1], Hexahedron);
    let plate = |name: &str, x: f64, z: f64| {
        part(name, [x, 0.0, z], [1.3, 1.0, 0.1], [4, 2, 1], Tetrahedron)
    };
    let mesh = join(join(lower, plate("a", -0.3, 1.5)), plate("b", 0.7, 1.2));
    let others = [
        &mesh.boundaries["a-bottom"][..],
        &mesh.boundaries["b-bottom"][..],
    ];
    for others in [others, [others[1], others[0]]] {
        let options = PairOptions {
            search_distance: Some(1.0),
            ..Default::default()
        };
        let nodes = mortar_contact(
            &body(&mesh),
            &mesh.boundaries["low-top"],
            &others.concat(),
            &options,
        )
        .unwrap_or_else(|error| panic!("{error}"));
        let nodes = nodes.places;
        let area: f64 = nodes.iter().map(|node| node.area).sum();
        assert_relative_eq!(area, 2.0, max_relative = 1e-12);
        let volume: f64 = nodes.iter().map(|node| node.area * node.gap).sum();
        assert_relative_eq!(volume, 0.7 * 0.5 + 1.3 * 0.2, max_relative = 1e-12);
    }
}

#[test]
fn interference_replaces_the_distance() {
    let mesh = blocks(
        PAIRS[1][0],
        PAIRS[1][1],
        [0.0, 0.0, 0.95],
        [2.0, 1.5],
        &|x| x,
    );
    let [here, there] = ["low-top", "up-bottom"].map(|name| &mesh.boundaries[name][..]);
    let with = |options| mortar_contact(&body(&mesh), here, there, &options);
    let error = with(PairOptions::default())
        .map(|_| ())
        .expect_err("it overlaps");
    assert!(
        matches!(error, ContactError::BodiesOverlap { depth, .. } if (depth - 0.05).abs() < 1e-9)
    );
    let nodes = with(PairOptions {
        interference: Some(&|_| 1e-3),
        ..Default::default()
    });
    for node in nodes.unwrap_or_else(|error| panic!("{error}")).places {
        assert_relative_eq!(node.gap, -1e-3, max_relative = 1e-11);
    }
    let error = with(PairOptions {
        interference: Some(&|x| x[0] - 1.0),
        ..Default::default()
    });
    let error = error.map(|_| ()).expect_err("negative").to_string();
    assert!(error.contains("the interference is -"), "{error}");
}

#[test]
fn faults_of_two_boundaries() {
    let mesh = blocks(
        PAIRS[0][0],
        PAIRS[0][1],
        [0.0, 0.0, 1.5],
        [2.0, 1.5],
        &|x| x,
    );
    let message = |here: &str, there: &str, search_distance| {
        let options = PairOptions {
            search_distance,
            ..Default::default()
        };
        let [here, there] = [here, there].map(|name| &mesh.boundaries[name][..]);
        mortar_contact(&body(&mesh), here, there, &options)
            .map(|_| ())
            .expect_err("a fault")
            .to_string()
    };
    let text = message("low-top", "up-bottom", Some(0.4));
    assert!(text.contains("they are at least 5.000e-1 apart"), "{text}");
    let text = message("low-bottom", "up-top", None);
    assert!(
        text.contains("no part of it faces the master boundary"),
        "{text}"
    );
    let text = message("low-top", "low-left", None);
    assert!(text.contains("belongs to both boundaries"), "{text}");
}

/// On a plane of symmetry through both bodies friction acts along it, and not on the small motions of nearby partners
/// across it.
#[test]
fn friction_along_a_plane_of_symmetry_only() {
    let bent: Map = &|[x, y, z]| {
        let (sin, cos) = (0.6 * x).sin_cos();
        [(2.0 + z) * sin, y, (2.0 + z) * cos]
    };
    let options = PairOptions {
        friction: Friction::Coulomb(&|_| 0.3),
        gap: Some(&|_| 0.0),
        ..Default::default()
    };
    for [lower, upper] in PAIRS {
        let mesh = blocks(lower, upper, [0.0, 0.0, 1.0], [2.0, 1.5], bent);
        let across = |x: &[f64; 3]| x[0] < 1e-12;
        let held = |x: &[f64; 3]| [across(x).then_some(0.0), None, None];
        let unknowns = Unknowns::new(mesh.nodes.iter().map(held).collect());
        for sides in [["low-top", "up-bottom"], ["up-bottom", "low-top"]] {
            let nodes = found(&mesh, sides, &options);
            let rows = contact_rows(&body(&mesh), &unknowns, &nodes)
                .unwrap_or_else(|error| panic!("{error}"));
            let mut there = 0;
            for (i, place) in rows.places.iter().enumerate() {
                let entries = [0, 1].map(|a| rows.tangential.row(2 * i + a).0.len());
                let on_it = across(&place.place);
                there += usize::from(on_it);
                let left = entries.iter().filter(|&&entries| entries > 0).count();
                assert_eq!(left, if on_it { 1 } else { 2 }, "{entries:?}");
                assert_eq!(rows.coefficient[i], 0.3);
            }
            assert!(there > 2);
            let (_, slide) = rows.held_motion(&unknowns);
            assert!(slide.iter().all(|&s| s == 0.0) && rows.check(&unknowns).is_ok());
        }
    }
}
