//! A plate on a column, twisted: no distribution of the weight over the column's section bears more torque than all of it
//! at the corners.

use super::common_area::common;
use super::scene::{Body, Interface, MU, Scene, Solid, Tally, end, judge, options, pair};
use super::scene::{Fate, turned};
use signorini::engine::Stiffness;
use signorini::mesh::ElementKind;
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

/// With this many facets along each side of the plate; the torque is that of a traction on its top.
fn twisted(
    cells: usize,
    plate_first: bool,
    shape: usize,
    turn: usize,
    torque: f64,
) -> (Scene<3>, Traction<3>) {
    twisted_on(cells, 3, plate_first, shape, turn, torque)
}

/// The same with this many facets along each side of the column, too.
fn twisted_on(
    cells: usize,
    across: usize,
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
    column.cells = [across, across, 4];
    column.shape = shape;
    let mut plate = Body::new("plate", [-1.0, -1.0, 0.0], [2.0, 2.0, 0.4], 0.2);
    plate.cells = [cells, cells, 2];
    plate.shape = shape;
    let scene = Scene {
        bodies: vec![column, plate],
        frame: <ElementKind as Solid<3>>::frames()[turn],
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
    // The torque of a uniform pressure with slip everywhere; the elastic pressure is larger near the border.
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
                // Beyond all bounds there is no solution; whether that is distinguished from stagnation does not matter
                // here.
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

/// The torque that is held, to a hundredth of the limit of statics: the figures of docs/validation.md.
#[test]
#[ignore = "prints figures, some minutes"]
fn torques_held() {
    let most = MU * WEIGHT * SIDE * 0.5f64.sqrt();
    println!(
        "uniform {:.1}, corners {most:.1}",
        MU * WEIGHT * mean_lever()
    );
    for (cells, across) in [
        (3, 3),
        (5, 3),
        (9, 3),
        (17, 3),
        (3, 6),
        (9, 6),
        (17, 6),
        (17, 12),
    ] {
        for plate_first in [true, false] {
            let holds = |torque: f64| {
                let (scene, load) = twisted_on(cells, across, plate_first, 0, 0, torque);
                let mut options = options(Stiffness::Cholesky);
                options.settings.ssnm.max_iterations = 60;
                let found = end(scene.model().traction(load), &options);
                found.is_ok_and(|(status, _)| status == Status::Converged)
            };
            let (mut low, mut high) = (0.3 * most, 1.02 * most);
            while high - low > 0.01 * most {
                let middle = 0.5 * (low + high);
                *(if holds(middle) { &mut low } else { &mut high }) = middle;
            }
            println!("plate {cells}, column {across}, plate first {plate_first}: {low:.1}");
        }
    }
}
