//! Boundaries that meet themselves.

use super::{End, neo_hooke, solved};
use signorini::contact::Obstacle;
use signorini::engine::Stiffness::Cholesky;
use signorini::mesh::Mesh;
use signorini::mesh::structured::{CellShape, join, rectangle};
use signorini::model::{Model, Motion, Pair, Support};
use signorini::ssnm::Status;
use std::f64::consts::PI;

/// The right part of a ring with these angles, in quarters of a turn.
fn arc(radii: [f64; 2], angles: [f64; 2], cells: [usize; 2]) -> Mesh {
    let mut mesh = rectangle([0.0; 2], [1.0; 2], cells, CellShape::Quad, "ring", "");
    for x in &mut mesh.nodes {
        let angle = 0.5 * PI * (angles[1] + (angles[0] - angles[1]) * x[0]);
        let radius = radii[0] + (radii[1] - radii[0]) * x[1];
        *x = [radius * angle.cos(), radius * angle.sin()];
    }
    mesh
}

fn plate(y: f64) -> Obstacle<2> {
    Obstacle::HalfSpace {
        point: [0.0, y],
        normal: [0.0, -y.signum()],
    }
}

/// A ring is crushed flat between two plates until its inside meets itself: each quarter behaves as one on a plane of symmetry.
#[test]
fn a_ring_is_crushed_flat() {
    let (radii, cells) = ([0.9, 1.1], [48, 4]);
    let factors: Vec<f64> = (1..=20).map(|i| f64::from(i) / 20.0).collect();
    let travel = 0.94;
    let mut half = arc(radii, [-1.0, 1.0], [2 * cells[0], cells[1]]);
    let outside = half.boundaries["top"].clone();
    let (up, down) = outside.into_iter().partition(|facet| half.nodes[facet[0] as usize][1] + half.nodes[facet[1] as usize][1] > 0.0);
    half.boundaries.insert("up".to_owned(), up);
    half.boundaries.insert("down".to_owned(), down);
    let side: Vec<u32> = (0..half.nodes.len() as u32)
        .filter(|&node| half.nodes[node as usize][1].abs() < 1e-9)
        .collect();
    half.node_sets.insert("side".to_owned(), side);
    let whole = Model::on(half)
        .large_displacements()
        .material(neo_hooke(1.0, 0.3))
        .support(Support::on(["left", "right"]).x(0.0))
        .support(Support::at_nodes("side").y(0.0))
        .contact(Pair::obstacle("up", plate(1.1)).moving(Motion::shift([0.0, -travel])))
        .contact(Pair::obstacle("down", plate(-1.1)).moving(Motion::shift([0.0, travel])))
        .contact(Pair::new("bottom", "bottom"))
        .steps(factors.clone());
    let quarter = Model::on(arc(radii, [0.0, 1.0], cells))
        .large_displacements()
        .material(neo_hooke(1.0, 0.3))
        .support(Support::on("left").x(0.0))
        .support(Support::on("right").y(0.0))
        .contact(Pair::obstacle("top", plate(1.1)).moving(Motion::shift([0.0, -travel])))
        .contact(Pair::obstacle(
            "bottom",
            Obstacle::HalfSpace {
                point: [0.0; 2],
                normal: [0.0, 1.0],
            },
        ))
        .steps(factors);
    let [whole, quarter] = [whole, quarter].map(|model| solved(model, 1e-9, Cholesky));
    for (end, of_quarter) in whole.iter().zip(&quarter) {
        let down = |end: &End<2>| -> f64 {
            let pressed = end.forces.iter().filter(|force| force[1] < 0.0);
            pressed.map(|force| force[1]).sum()
        };
        println!(
            "{:?} {} {} | {} {} | {:?}",
            end.status,
            end.iterations,
            end.parts,
            of_quarter.iterations,
            of_quarter.parts,
            [end, of_quarter].map(down)
        );
        assert_eq!(end.status, Status::Converged);
    }
}

/// Three blocks of meshes that do not match, pressed together by a fifth: any side may meet any other.
#[test]
fn blocks_meet_as_they_come() {
    let names = ["low", "middle", "up"];
    let cells = [[8, 4], [5, 3], [7, 2]];
    let heights = [0.0, 0.5, 0.8, 1.2];
    let part = |k: usize| {
        let (low, high) = (heights[k], heights[k + 1]);
        let prefix = format!("{}-", names[k]);
        rectangle(
            [0.0, low],
            [1.0, high - low],
            cells[k],
            CellShape::Quad,
            names[k],
            &prefix,
        )
    };
    let mesh = join(join(part(0), part(1)), part(2));
    let all: Vec<String> = (names.iter())
        .flat_map(|name| ["bottom", "top"].map(|side| format!("{name}-{side}")))
        .collect();
    let sides: Vec<String> = (names.iter())
        .flat_map(|name| ["left", "right"].map(|side| format!("{name}-{side}")))
        .collect();
    for large in [false, true] {
        let model = Model::on(mesh.clone())
            .material(neo_hooke(1.0, 0.3))
            .support(Support::on(sides.clone()).x(0.0))
            .support(Support::on("low-bottom").y(0.0))
            .support(Support::on("up-top").y(-0.2))
            .contact(Pair::new(all.clone(), all.clone()));
        let model = match large {
            true => model.large_displacements(),
            false => model,
        };
        let end = solved(model, 1e-10, Cholesky).remove(0);
        assert_eq!(end.status, Status::Converged);
        for (x, u) in mesh.nodes.iter().zip(&end.displacement) {
            let off = (u[1] + 0.2 * x[1] / 1.2).hypot(u[0]);
            assert!(off < 1e-8, "{off:e} at {x:?}, large: {large}");
        }
    }
}
