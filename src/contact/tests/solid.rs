//! Obstacles and contact nodes in space.

use super::*;
use crate::mesh::structured::{SolidShape, block};

const SHAPES: [SolidShape; 3] = [
    SolidShape::Hexahedron,
    SolidShape::Tetrahedron,
    SolidShape::Wedge,
];

fn cube(shape: SolidShape) -> Mesh<3> {
    block([0.0, 0.0, 0.5], [3.0, 2.0, 1.0], [3, 2, 2], shape, "a", "")
}

const FLOOR: Obstacle<3> = Obstacle::HalfSpace {
    point: [7.0, -1.0, 0.0],
    normal: [0.0, 0.0, 2.0],
};

#[test]
fn distances_from_a_cylinder() {
    let bar = Obstacle::Cylinder {
        point: [1.0, 5.0, 2.0],
        axis: [0.0, -3.0, 0.0],
        radius: 2.0,
    };
    assert_eq!(bar.distance([4.0, -7.0, 6.0]), (3.0, [-0.6, 0.0, -0.8]));
    assert_eq!(bar.distance([1.0, 9.0, 1.0]), (-1.0, [0.0, 0.0, 1.0]));
    let infinity = f64::INFINITY;
    assert_eq!(bar.bounds(), ([-1.0, -infinity, 0.0], [3.0, infinity, 4.0]));
    // Along any axis: the distance does not change along it, and grows by as much as one moves away from it.
    let axis = unit([1.0, 2.0, -2.0]);
    let bar = Obstacle::Cylinder {
        point: [0.3, 0.1, 0.2],
        axis: axis.map(|v| 5.0 * v),
        radius: 0.5,
    };
    let x = [1.0, -2.0, 3.0];
    let (distance, towards) = bar.distance(x);
    assert_relative_eq!(dot(towards, axis), 0.0, epsilon = 1e-15);
    assert_relative_eq!(length(towards), 1.0, max_relative = 1e-15);
    let moved = |by: [f64; 3], far: f64| std::array::from_fn(|c| x[c] + far * by[c]);
    assert_relative_eq!(
        bar.distance(moved(axis, 4.0)).0,
        distance,
        max_relative = 1e-14
    );
    let nearer = bar.distance(moved(towards, 0.25)).0;
    assert_relative_eq!(nearer, distance - 0.25, max_relative = 1e-14);
    let surface = bar.distance(moved(towards, distance)).0;
    assert_relative_eq!(surface, 0.0, epsilon = 1e-14);
    assert_eq!(
        [
            FLOOR.name(),
            bar.name(),
            Obstacle::Sphere {
                center: x,
                radius: 1.0
            }
            .name()
        ],
        ["half-space", "cylinder", "sphere"]
    );
    let flat = Obstacle::Sphere {
        center: [0.0; 2],
        radius: 1.0,
    };
    assert_eq!(flat.name(), "circle");
}

/// Tresca bounds add up to bound × area and to its moments; areas to the area; gaps and normals are those of the
/// obstacle.
#[test]
fn bounds_add_up_over_a_face() {
    let ball = Obstacle::Sphere {
        center: [1.0, 1.0, -4.0],
        radius: 3.0,
    };
    let bar = Obstacle::Cylinder {
        point: [0.0, 1.0, -2.0],
        axis: [1.0, 0.0, 0.0],
        radius: 1.5,
    };
    for shape in SHAPES {
        let mesh = cube(shape);
        for obstacle in [FLOOR, ball, bar] {
            let options = PairOptions {
                friction: Friction::Tresca(&|[x, y, _]| 2.0 + x + 3.0 * y),
                search_distance: Some(10.0),
                ..Default::default()
            };
            let found = obstacle_contact(
                &body(&mesh),
                &mesh.boundaries["bottom"],
                &obstacle,
                &options,
            );
            let found = found.unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(found.len(), 12);
            let (mut area, mut bound) = (0.0, 0.0);
            for node in &found {
                let x = node.place;
                assert_eq!(x[2], 0.5);
                area += node.area;
                let SlipBound::Given(given) = node.slip_bound else {
                    panic!("Tresca")
                };
                bound += given;
                assert!(node.partners.is_empty());
                // The obstacle is along the normal at the distance of the gap.
                let foot = std::array::from_fn(|c| x[c] + node.gap * node.frame[0][c]);
                let onto = match obstacle {
                    Obstacle::HalfSpace { .. } => foot[2],
                    Obstacle::Sphere { center, radius } => length(minus(foot, center)) - radius,
                    Obstacle::Cylinder { radius, .. } => {
                        (foot[1] - 1.0).hypot(foot[2] + 2.0) - radius
                    }
                };
                assert_relative_eq!(onto, 0.0, epsilon = 1e-14);
            }
            // 3 × 2 about (1.5, 1).
            assert_relative_eq!(area, 6.0, max_relative = 1e-13);
            assert_relative_eq!(bound, 6.0 * (2.0 + 1.5 + 3.0), max_relative = 1e-13);
        }
    }
}

#[test]
fn faults_are_reported_in_the_words_of_space() {
    let mesh = cube(SolidShape::Wedge);
    let message = |boundary: &str, obstacle: Obstacle<3>| {
        let body = body(&mesh);
        let faces = &mesh.boundaries[boundary];
        match obstacle_contact(&body, faces, &obstacle, &PairOptions::default()) {
            Ok(_) => panic!("it was accepted"),
            Err(error) => error.to_string(),
        }
    };
    let ball = |center, radius| Obstacle::Sphere { center, radius };
    let bar = |point, axis, radius| Obstacle::Cylinder {
        point,
        axis,
        radius,
    };
    for (text, what) in [
        (
            message("top", FLOOR),
            "the normal of a half-space points out",
        ),
        (
            message("top", ball([0.0; 3], 0.1)),
            "faces the sphere from outside: the obstacle is the ball",
        ),
        (
            message("bottom", ball([0.0; 3], 9.0)),
            "faces the sphere from outside",
        ),
        (
            message("top", bar([0.0; 3], [0.0, 1.0, 0.0], 0.1)),
            "faces the cylinder from outside: the obstacle is the solid cylinder",
        ),
        (
            message("bottom", bar([0.0, 0.0, 0.5], [1.0, 0.0, -1.0], 0.1)),
            "lies on the axis of the cylinder",
        ),
        (
            message("bottom", bar([1.5, 0.0, 0.0], [0.0, 1.0, 0.0], 0.8)),
            "inside the obstacle",
        ),
    ] {
        assert!(text.contains(what), "{text}");
    }
}

/// A cube on a half-space with symmetry on two of its sides: at the corner and along the edges of these, supports leave
/// no or one direction to slide in.
#[test]
fn corners_of_a_cube_with_supports() {
    let mesh = cube(SolidShape::Hexahedron);
    let mut prescribed = vec![[None; 3]; mesh.nodes.len()];
    for (boundary, c) in [("left", 0), ("front", 1)] {
        for &node in mesh.boundaries[boundary].iter().flatten() {
            prescribed[node as usize][c] = Some(0.0);
        }
    }
    let unknowns = Unknowns::new(prescribed);
    let options = PairOptions {
        friction: Friction::Tresca(&|_| 1.0),
        search_distance: Some(1.0),
        ..Default::default()
    };
    let body = body(&mesh);
    let found = obstacle_contact(&body, &mesh.boundaries["bottom"], &FLOOR, &options)
        .unwrap_or_else(|error| panic!("{error}"));
    let rows = contact_rows(&body, &unknowns, &found).unwrap_or_else(|error| panic!("{error}"));
    let (n, t) = (dense(&rows.normal), dense(&rows.tangential));
    assert_eq!((n.len(), t.len()), (12, 24));
    for (i, place) in rows.places.iter().enumerate() {
        let [x, y, _] = place.place;
        let block = 3 * unknowns.block(place.own[0].0).expect("z is free") as usize;
        let mut expected = vec![0.0; n[i].len()];
        expected[block + 2] = -1.0;
        assert_eq!(n[i], expected);
        let free = [x > 0.0, y > 0.0];
        // The tangents span the free directions of the plane z = 0, and nothing else.
        let pair = &t[2 * i..2 * i + 2];
        let mut gram = [[0.0; 2]; 2];
        for row in pair {
            assert_eq!(
                row.iter().filter(|v| **v != 0.0).count(),
                row[block..block + 2].iter().filter(|v| **v != 0.0).count()
            );
            for a in 0..2 {
                for b in 0..2 {
                    gram[a][b] += row[block + a] * row[block + b];
                }
            }
        }
        for a in 0..2 {
            for b in 0..2 {
                let expected = f64::from(u8::from(a == b && free[a]));
                assert_relative_eq!(gram[a][b], expected, epsilon = 1e-14);
            }
        }
        let any = free[0] || free[1];
        assert_eq!(rows.slip_bound[i] > 0.0, any);
        assert_eq!(rows.keeps_from_sliding(i), !any);
        assert_relative_eq!(rows.gap(&unknowns)[i], 0.5);
    }
}
