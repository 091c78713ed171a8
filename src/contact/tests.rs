mod mortar;
mod solid;

use super::*;
use crate::elasticity::{Material, Plane, Unknowns};
use crate::mesh::structured::{CellShape, rectangle};
use crate::mesh::vector::{dot, unit};
use crate::mesh::{self, Mesh};
use approx::assert_relative_eq;

const MATERIAL: Material = Material::new(1.0, 0.3);

fn body<const D: usize>(mesh: &Mesh<D>) -> Body<'_, D>
where
    ElementKind: Topology<D>,
{
    Body {
        mesh,
        materials: &[MATERIAL],
        plane: Plane::PlaneStrain,
        thickness: 1.0,
    }
}

fn node<const D: usize>(
    node: u32,
    partners: &[(u32, f64)],
    normal: [f64; D],
    slip_bound: SlipBound,
) -> ContactPlace<D> {
    ContactPlace {
        place: std::array::from_fn(|c| if c == 0 { f64::from(node) } else { 0.0 }),
        node: Some(node),
        own: vec![(node, 1.0)],
        partners: partners.to_vec(),
        directed: Vec::new(),
        further: Vec::new(),
        sectors: None,
        frame: frame(unit(normal)),
        gap: 0.1,
        area: 1.0,
        part: 0,
        pool: 0,
        slip_bound,
        compliance: [0.0; 2],
    }
}

/// A matrix row by row.
fn dense(rows: &crate::sparse::Csr) -> Vec<Vec<f64>> {
    let mut dense = vec![vec![0.0; rows.n_cols()]; rows.n_rows()];
    for (i, j, v) in rows.triplets() {
        dense[i][j] = v;
    }
    dense
}

#[test]
fn distances_from_obstacles() {
    let plane = Obstacle::HalfSpace {
        point: [0.0, 1.0],
        normal: [0.0, 5.0],
    };
    assert_eq!(plane.distance([7.0, 3.0]), (2.0, [0.0, -1.0]));
    let disc = Obstacle::Sphere {
        center: [3.0, 4.0],
        radius: 2.0,
    };
    assert_eq!(disc.distance([0.0, 0.0]), (3.0, [0.6, 0.8]));
    assert_eq!(disc.distance([3.0, 5.0]), (-1.0, [0.0, -1.0]));

    let floor = Obstacle::HalfSpace {
        point: [1.0, 1.0, 1.0],
        normal: [2.0, 3.0, 6.0],
    };
    let (distance, towards) = floor.distance([3.0, 4.0, 7.0]);
    assert_relative_eq!(distance, 7.0, max_relative = 1e-15);
    assert_relative_eq!(dot(towards, [2.0, 3.0, 6.0]), -7.0, max_relative = 1e-15);
    let ball = Obstacle::Sphere {
        center: [2.0, 3.0, 6.0],
        radius: 1.0,
    };
    assert_eq!(
        ball.distance([0.0; 3]),
        (6.0, [2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0])
    );
    assert_eq!(ball.bounds(), ([1.0, 2.0, 5.0], [3.0, 4.0, 7.0]));
}

#[test]
fn frames_are_orthonormal() {
    assert_eq!(frame([0.6, -0.8]), [[0.6, -0.8], [0.8, 0.6]]);
    assert_eq!(
        frame([0.0, 0.0, -1.0])[1..],
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    );
    assert_eq!(
        frame([1.0, 0.0, 0.0])[1..],
        [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    );
    for normal in [
        [1.0, 2.0, 3.0],
        [-0.3, 0.1, -1e-9],
        [1e-8, -1e-9, -1.0],
        [0.0, -1.0, 0.0],
        [0.7, -0.7, 1e-12],
    ] {
        let frame = frame(unit(normal));
        for i in 0..3 {
            for j in 0..3 {
                let delta = f64::from(u8::from(i == j));
                assert_relative_eq!(dot(frame[i], frame[j]), delta, epsilon = 1e-15);
            }
        }
    }
}

#[test]
fn a_block_on_a_half_plane() {
    let mesh = rectangle([0.0, 0.5], [2.0, 1.0], [2, 1], CellShape::Quad, "a", "");
    let floor = Obstacle::HalfSpace {
        point: [0.0; 2],
        normal: [0.0, 1.0],
    };
    let options = PairOptions {
        friction: Friction::Tresca(&|_| 3.0),
        ..Default::default()
    };
    let nodes = obstacle_contact(&body(&mesh), &mesh.boundaries["bottom"], &floor, &options)
        .unwrap_or_else(|error| panic!("{error}"));
    for (node, share) in nodes.iter().zip([0.5, 1.0, 0.5]) {
        assert_eq!(node.frame, [[0.0, -1.0], [1.0, 0.0]]);
        assert_eq!((node.gap, node.partners.len()), (0.5, 0));
        assert_relative_eq!(node.area, share, max_relative = 1e-15);
        let SlipBound::Given(bound) = node.slip_bound else {
            panic!("Tresca")
        };
        assert_relative_eq!(bound, 3.0 * share, max_relative = 1e-15);
    }
    let away = obstacle_contact(&body(&mesh), &mesh.boundaries["top"], &floor, &options);
    assert!(matches!(away, Err(ContactError::FacesAway { .. })));
}

#[test]
fn rows_of_a_node_in_the_plane() {
    let mesh = rectangle([0.0, 0.0], [2.0, 1.0], [2, 1], CellShape::Quad, "a", "");
    // Node 1 may not move in x but by 0.5; node 2 is held altogether and has no unknowns.
    let mut prescribed = vec![[None; 2]; 6];
    prescribed[1] = [Some(0.5), None];
    prescribed[2] = [Some(0.25), Some(-0.25)];
    let unknowns = Unknowns::new(prescribed);
    let candidates = [
        node(
            0,
            &[(2, 0.25), (3, 0.75)],
            [0.6, -0.8],
            SlipBound::Coulomb(0.3),
        ),
        node(1, &[], [0.0, -1.0], SlipBound::Given(2.0)),
        node(2, &[], [0.0, -1.0], SlipBound::Given(2.0)),
    ];
    let rows = contact_rows(&body(&mesh), &unknowns, &candidates)
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(rows.candidate, [0, 1]);
    // Blocks: nodes 0, 1, 3, 4, 5.
    let (n, t) = (dense(&rows.normal), dense(&rows.tangential));
    let first = |a: f64, b: f64| [&[a, b, 0.0, 0.0, -0.75 * a, -0.75 * b][..], &[0.0; 4]].concat();
    assert_eq!(n[0], first(0.6, -0.8));
    assert_eq!(t[0], first(0.8, 0.6));
    assert_eq!(n[1][3], -1.0);
    // Its slide is prescribed altogether: no friction.
    assert!(t[1].iter().all(|&v| v == 0.0));
    assert_eq!(rows.slip_bound, [0.0, 0.0]);
    assert_eq!(rows.coefficient, [0.3, 0.0]);
    assert!(rows.keeps_from_sliding(1) && !rows.keeps_from_sliding(0));
    let (normal, tangential) = rows.held_motion(&unknowns);
    assert_relative_eq!(
        normal[0],
        -0.25 * (0.6 * 0.25 + 0.8 * 0.25),
        epsilon = 1e-16
    );
    assert_relative_eq!(tangential[0], -0.25 * (0.8 - 0.6) * 0.25, epsilon = 1e-16);
    assert_eq!((normal[1], tangential[1]), (0.0, 0.5));
    assert_relative_eq!(rows.gap(&unknowns)[0], 0.1 + 0.0875, epsilon = 1e-15);
    // Node 2 is driven 0.25 towards an obstacle at 0.1.
    let error = rows.check(&unknowns).expect_err("it is driven in");
    assert!(
        error
            .to_string()
            .contains("(2.000000e0, 0.000000e0) 1.500e-1"),
        "{error}"
    );

    // One rigid obstacle twice, but between bodies rows may depend on each other.
    let floor = node(3, &[], [0.0, -1.0], SlipBound::Given(2.0));
    let twice = contact_rows(&body(&mesh), &unknowns, &[floor.clone(), floor]);
    assert!(matches!(twice, Err(ContactError::Twice { .. })));
    let twice = [candidates[0].clone(), candidates[0].clone()];
    let rows =
        contact_rows(&body(&mesh), &unknowns, &twice).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(dense(&rows.normal)[0], dense(&rows.normal)[1]);
    assert_eq!(rows.coefficient, [0.3, 0.3]);
}

#[test]
fn rows_of_nodes_in_space() {
    let mesh = mesh::tests::in_space(vec![[0.0; 3]; 4]);
    let mut prescribed = vec![[None; 3]; 4];
    // Node 1 is held in y.
    prescribed[1][1] = Some(0.5);
    let unknowns = Unknowns::new(prescribed);
    let tilted = [0.0, 0.6, -0.8];
    let candidates = [
        node(0, &[], [0.0, 0.0, -1.0], SlipBound::Given(2.0)),
        node(1, &[], tilted, SlipBound::Coulomb(0.3)),
        node(
            2,
            &[(0, 0.5), (3, 0.5)],
            [1.0, 2.0, 3.0],
            SlipBound::Given(1.0),
        ),
    ];
    let rows = contact_rows(&body(&mesh), &unknowns, &candidates)
        .unwrap_or_else(|error| panic!("{error}"));
    let (n, t) = (dense(&rows.normal), dense(&rows.tangential));
    assert_eq!((n.len(), t.len()), (3, 6));
    assert_eq!(n[0][..3], [0.0, 0.0, -1.0]);
    assert_eq!(t[0][..3], [1.0, 0.0, 0.0]);
    assert_eq!(t[1][..3], [0.0, 1.0, 0.0]);
    // Node 1 can slide along x alone; along the other tangent it would lift off.
    assert_relative_eq!(n[1][5], -0.8, max_relative = 1e-15);
    assert_relative_eq!(t[2][3].abs(), 1.0, max_relative = 1e-15);
    assert_eq!(t[2].iter().filter(|v| **v != 0.0).count(), 1);
    assert!(t[3].iter().all(|&v| v == 0.0));
    assert_eq!(rows.slip_bound, [2.0, 0.0, 1.0]);
    assert_eq!(rows.coefficient, [0.0, 0.3, 0.0]);
    let (normal, tangential) = rows.held_motion(&unknowns);
    assert_relative_eq!(normal[1], 0.3, max_relative = 1e-15);
    assert_relative_eq!(tangential[3].abs(), 0.4, max_relative = 1e-15);
    assert_eq!(tangential[2], 0.0);
    assert_relative_eq!(rows.gap(&unknowns)[1], 0.1 - 0.3, max_relative = 1e-14);
    // Node 2 and its partners, by their frames.
    for (row, v) in [(&n[2], 0), (&t[4], 1), (&t[5], 2)] {
        let v = rows.places[2].frame[v];
        for c in 0..3 {
            let found = [row[c], row[3 + c], row[6 + c], row[9 + c]];
            assert_eq!(found, [-0.5 * v[c], 0.0, v[c], -0.5 * v[c]]);
        }
    }
    // Full row rank: each row that is not empty counts.
    let all: Vec<&Vec<f64>> = (n.iter().chain(&t))
        .filter(|row| row.iter().any(|&v| v != 0.0))
        .collect();
    let matrix = faer::Mat::from_fn(all.len(), 12, |i, j| all[i][j]);
    let (values, _) = crate::dense::right_singular(&matrix).expect("finite");
    assert_eq!(all.len(), 8);
    assert!(values.iter().all(|&value| value > 0.1), "{values:?}");
}

#[test]
fn a_node_in_space_that_is_held_altogether_is_checked() {
    let mesh = mesh::tests::in_space(vec![[1.0, 2.0, 3.0]]);
    let unknowns = Unknowns::new(vec![[Some(0.0), Some(0.0), Some(-0.3)]]);
    let mut candidates = [node(0, &[], [0.0, 0.0, -1.0], SlipBound::Given(0.0))];
    candidates[0].place = mesh.nodes[0];
    let rows = contact_rows(&body(&mesh), &unknowns, &candidates)
        .unwrap_or_else(|error| panic!("{error}"));
    assert!(rows.places.is_empty());
    let error = rows.check(&unknowns).expect_err("it is driven in");
    assert!(
        error
            .to_string()
            .contains("(1.000000e0, 2.000000e0, 3.000000e0) 2.000e-1")
    );
}

#[test]
fn places_of_a_pool_have_their_forces_in_common() {
    let place = |pool: u32, frame: [[f64; 3]; 3]| ContactPlace {
        place: [0.0; 3],
        node: None,
        own: vec![(0, 1.0)],
        partners: Vec::new(),
        directed: Vec::new(),
        further: Vec::new(),
        sectors: None,
        frame,
        gap: 0.0,
        area: 1.0,
        part: 0,
        pool,
        slip_bound: SlipBound::Given(0.0),
        compliance: [0.0; 2],
    };
    let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    // The third has its tangents the other way round.
    let places = [
        place(0, [z, x, y]),
        place(1, [z, x, y]),
        place(0, [z, y, x]),
    ];
    assert_eq!(pooled(&places, &[1.0, 2.0, 4.0]), [5.0, 2.0, 5.0]);
    let tangential = [1.0, 10.0, 2.0, 20.0, 4.0, 40.0];
    assert_eq!(
        pooled(&places, &tangential),
        [41.0, 14.0, 2.0, 20.0, 14.0, 41.0]
    );
}
