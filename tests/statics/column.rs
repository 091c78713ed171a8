//! A plate on a column, twisted: no distribution of the weight over the column's section bears more torque than all of it
//! at the corners.

use crate::common_area::common;
use crate::scene::{Body, Interface, MU, Scene, Solid, Tally, end, judge, options, pair};
use crate::scene::{Fate, turned};
use signorini::engine::Stiffness;
use signorini::mesh::Kind;
use signorini::model::{Axis, Traction};
use signorini::ssnm::Status;

/// The side of the column's section, and the weight in N.
const SIDE: f64 = 0.5;
const WEIGHT: f64 = 1000.0;

/// The mean distance from the middle of the column's section, by the midpoint rule with as many points as it takes for
/// four figures.
fn mean_lever() -> f64 {
    let n = 200;
    let at = |k: usize| SIDE * ((k as f64 + 0.5) / n as f64 - 0.5);
    let sum: f64 = (0..n * n).map(|k| at(k / n).hypot(at(k % n))).sum();
    sum / (n * n) as f64
}

/// With so many facets along each side of the plate; the torque is that of a traction on its top.
fn twisted(
    cells: usize,
    plate_first: bool,
    shape: usize,
    turn: usize,
    torque: f64,
) -> (Scene<3>, Traction<3>) {
    let mut column = Body::new(
        "column",
        [-0.5 * SIDE, -0.5 * SIDE, -1.0],
        [SIDE, SIDE, 1.0],
        0.2,
    );
    column.cells = [3, 3, 4];
    column.shape = shape;
    let mut plate = Body::new("plate", [-1.0, -1.0, 0.0], [2.0, 2.0, 0.4], 0.2);
    plate.cells = [cells, cells, 2];
    plate.shape = shape;
    let scene = Scene {
        bodies: vec![column, plate],
        frame: <Kind as Solid<3>>::frames()[turn],
        loads: vec![(1, WEIGHT, [0.0; 2])],
        pairs: vec![pair("plate", "column", plate_first, MU)],
        held: vec![("column-bottom".to_owned(), [0.0; 3])],
        guided: Vec::new(),
    };
    let up = turned(&scene.frame, [0.0, 0.0, 1.0]);
    let torque = Traction::on("plate-top")
        .about(Axis::new([0.0; 3], up))
        .torque(torque);
    (scene, torque)
}

#[test]
fn a_plate_on_a_column_bears_no_more_torque_than_its_corners() {
    assert!(
        (mean_lever() / SIDE - 0.3826).abs() < 1e-4,
        "known of a square"
    );
    let most = MU * WEIGHT * SIDE * 0.5f64.sqrt();
    // What uniform pressure bears that slips everywhere; the elastic one is larger near the border.
    let plenty = MU * WEIGHT * mean_lever();
    let mut tally = Tally::default();
    for (number, cells) in [3, 5, 9].into_iter().enumerate() {
        for plate_first in [true, false] {
            let (shape, turn) = (number % 3, usize::from(plate_first));
            let stiffness = [Stiffness::Cholesky, Stiffness::Pcg][(number + turn) % 2];
            for (torque, holds) in [(0.8 * plenty, true), (1.02 * most, false)] {
                let (scene, load) = twisted(cells, plate_first, shape, turn, torque);
                let name = format!(
                    "{cells} × {cells} facets, {plate_first}, {stiffness:?}, {torque:.1} N m"
                );
                let found = end(scene.model().traction(load), &options(stiffness));
                // Beyond all bounds there is no solution; whether that is told from not getting on does not matter here.
                let result =
                    found.and_then(|(status, _)| match (status == Status::Converged) == holds {
                        true => Ok(()),
                        false => Err(format!("{status:?}")),
                    });
                tally.add(&name, result);
            }
            // Without any torque.
            let (scene, _) = twisted(cells, plate_first, shape, turn, 0.0);
            let area = common(&scene.bodies[0].area(), &scene.bodies[1].area());
            let interface = Interface {
                upper_first: plate_first,
                areas: vec![area],
                force: WEIGHT,
                at: Some([0.0; 2]),
            };
            let name = format!("{cells} × {cells} facets, {plate_first}, at rest");
            tally.add(&name, judge(&scene, &[interface], Fate::Stands, stiffness));
        }
    }
    tally.end();
}
