//! Obstacles that move with a point and carry loads: force against displacement, statics, what is refused.

use crate::common::apart;
use crate::common::models::{Answer, answer, on_the_cpu};
use crate::common::or_panic::OrPanic as _;
use crate::common::solved::{built, case};
use signorini::contact::{Obstacle, Space};
use signorini::elasticity::{Material, Plane};
use signorini::engine::Stiffness;
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::mesh::{ElementKind, Mesh};
use signorini::model::{Coupling, Model, Pair, Support};
use signorini::output::ContactReport;
use signorini::ssnm::Status;

const PATHS: [Stiffness; 2] = [Stiffness::Cholesky, Stiffness::Pcg];
const YOUNG: f64 = 2e9;

/// The report of the coupling, which follows the contacts.
fn point<const D: usize>(found: &Answer<D>) -> ContactReport
where
    ElementKind: Space<D>,
{
    let all = found.report().contacts;
    let coupled = all.into_iter().find(|contact| !contact.motion.is_empty());
    coupled.expect("there is a coupling")
}

fn motion(report: &ContactReport) -> Vec<f64> {
    let known = report.motion.iter();
    known
        .map(|motion| motion.expect("it is determined"))
        .collect()
}

/// Pressed by a displacement, and by the force that this has taken: the same forces at each place, and the same displacement.
fn pressed_alike<const D: usize>(
    model: Model<D>,
    punch: Pair<D>,
    along: usize,
    depth: f64,
    at: [f64; D],
) where
    ElementKind: Space<D>,
{
    let held = |coupling: Coupling<D>| coupling.fixed();
    let of = |coupling: Coupling<D>| {
        let contact = punch.clone().named("punch");
        model.clone().contact(contact).coupling(coupling)
    };
    for path in PATHS {
        let driven = held(Coupling::of_obstacles("punch", at)).moved(along, -depth);
        let by_motion = answer(of(driven), 1e-11, path);
        let taken = point(&by_motion);
        assert!(taken.force[along] < 0.0, "{taken:?}");
        // What the punch takes is what its contact gives.
        let report = by_motion.report();
        let met = &report.contacts[0];
        assert!(
            apart(&[met.force[along]], &[taken.force[along]]) < 1e-9 * taken.force[along].abs()
        );
        let mut force = [0.0; D];
        force[along] = taken.force[along];
        let mut loaded = Coupling::of_obstacles("punch", at).force(force);
        for axis in (0..D).filter(|&axis| axis != along) {
            loaded = loaded.moved(axis, 0.0);
        }
        for axis in if D == 2 { 2..3 } else { 0..3 } {
            loaded = loaded.turned(axis, 0.0);
        }
        let by_force = answer(of(loaded), 1e-11, path);
        let m = by_motion.m();
        let largest = by_motion.solution.lambda[..m]
            .iter()
            .fold(0.0_f64, |most, v| most.max(v.abs()));
        let off = apart(
            &by_motion.solution.lambda[..by_motion
                .built
                .elastic
                .pair_of
                .partition_point(|&pair| pair == 0)],
            &by_force.solution.lambda[..by_motion
                .built
                .elastic
                .pair_of
                .partition_point(|&pair| pair == 0)],
        );
        assert!(off < 1e-8 * largest, "{path:?}: {off:e} of {largest:e}");
        let moved = point(&by_force).motion[along].expect("it is determined");
        assert!((moved + depth).abs() < 1e-8 * depth, "{moved} for {depth}");
    }
}

#[test]
fn a_force_presses_as_deep_as_its_displacement() {
    let mesh = rectangle([0.0, 0.0], [2.0, 1.0], [16, 8], CellShape::Quad, "body", "");
    for (plane, centre) in [(Plane::PlaneStrain, 1.1), (Plane::Axisymmetric, 0.0)] {
        let model = Model::on(mesh.clone())
            .plane(plane)
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on("bottom").y(0.0))
            .support(Support::on("left").x(0.0));
        let ball = Obstacle::Sphere {
            center: [centre, 2.5],
            radius: 1.5,
        };
        let punch = Pair::obstacle("top", ball);
        pressed_alike(
            model.clone(),
            punch.clone().coulomb(0.3),
            1,
            1e-2,
            [centre, 2.5],
        );
        pressed_alike(model, punch, 1, 1e-2, [centre, 1.0]);
    }
    let mesh = block(
        [0.0; 3],
        [2.0, 2.0, 1.0],
        [6, 6, 3],
        SolidShape::Hexahedron,
        "body",
        "",
    );
    let model = Model::on(mesh)
        .material(Material::new(YOUNG, 0.3))
        .support(Support::on("bottom").fixed())
        .support(Support::on("left").symmetry());
    let ball = Obstacle::Sphere {
        center: [0.0, 0.9, 3.0],
        radius: 2.0,
    };
    pressed_alike(
        model,
        Pair::obstacle("top", ball).coulomb(0.2),
        2,
        1e-2,
        [0.0, 0.9, 3.0],
    );
}

/// A half-plane with the outward normal along ±y.
fn plate(y: f64, up: f64) -> Obstacle {
    Obstacle::HalfSpace {
        point: [0.0, y],
        normal: [0.0, up],
    }
}

/// A block between two free rigid plates: both press with their force, and where the force is off the middle, so is the pressure.
#[test]
fn a_block_between_free_plates() {
    let (force, off) = (4e5, 0.1);
    let mesh = rectangle([-1.0, 0.0], [2.0, 1.0], [8, 4], CellShape::Quad, "body", "");
    let model = Model::on(mesh.raised().or_panic())
        .material(Material::new(YOUNG, 0.0))
        .support(Support::at_point([0.0, 0.0]).x(0.0))
        .contact(Pair::obstacle("bottom", plate(0.0, 1.0)).named("below"))
        .contact(Pair::obstacle("top", plate(1.0, -1.0)).named("above"))
        .coupling(
            Coupling::of_obstacles("below", [off, 0.0])
                .moved(0, 0.0)
                .moved(1, 0.0)
                .turned(2, 0.0),
        )
        .coupling(
            Coupling::of_obstacles("above", [off, 1.0])
                .moved(0, 0.0)
                .force([0.0, -force]),
        );
    for path in PATHS {
        let found = answer(model.clone(), 1e-12, path);
        // ν = 0: a linear pressure, by its moment, and a plate that turns by M l/(E I).
        let inertia = 8.0 / 12.0;
        let turn = -force * off / (YOUNG * inertia);
        let depth = force / (2.0 * YOUNG);
        let report = found.report();
        let above = &report.contacts[3];
        let expected = [0.0, -depth + turn * off, turn];
        assert!(apart(&motion(above), &expected) < 1e-9 * depth, "{above:?}");
        let below = &report.contacts[2];
        assert!(
            apart(&below.force, &[0.0, force]) < 1e-9 * force,
            "{below:?}"
        );
        assert!(below.moment[0].abs() < 1e-9 * force, "{below:?}");
        for i in 0..found.m() {
            let [x, y] = found.place(i);
            if found.built.elastic.pair_of[i] == 1 && y == 1.0 && x.abs() < 1.0 {
                let pressure = force / 2.0 + force * off * x / inertia;
                assert!(
                    (found.pressure(i) - pressure).abs() < 1e-8 * force,
                    "{x}: {}",
                    found.pressure(i)
                );
            }
        }
    }
    // Pushed beyond its edge, the block tips over: nothing holds the plate.
    let tipping = model.clone();
    let mut tipping = tipping.coupling(Coupling::of_obstacles("above", [0.0, 1.0]));
    let text = tipping.clone().build().expect_err("two points").to_string();
    assert!(text.contains("moves with another point already"), "{text}");
    tipping = Model::on(rectangle(
        [-1.0, 0.0],
        [2.0, 1.0],
        [8, 4],
        CellShape::Quad,
        "body",
        "",
    ))
    .material(Material::new(YOUNG, 0.0))
    .support(Support::on("bottom").fixed())
    .contact(Pair::obstacle("top", plate(1.0, -1.0)).named("above"))
    .coupling(Coupling::of_obstacles("above", [1.01, 1.0]).force([0.0, -force]));
    let steps = tipping
        .build()
        .or_panic()
        .solve(&on_the_cpu(1e-9, Stiffness::Cholesky))
        .or_panic();
    assert_eq!(steps[0].status, Status::NotHeld);
    let motion = &steps[0].not_held[0].motion;
    assert!(
        motion.contains("rotates clockwise about (1.0000e0, "),
        "{motion}"
    );
}

/// Columns of 1 × 1 beside each other.
fn columns(heights: &[(f64, [f64; 2])]) -> Mesh<3> {
    let column = |(number, (height, [x, y])): (usize, &(f64, [f64; 2]))| {
        let (cells, name) = ([1, 1, 3], number.to_string());
        let column = block(
            [*x, *y, 0.0],
            [1.0, 1.0, *height],
            cells,
            SolidShape::Hexahedron,
            &name,
            &name,
        );
        column.raised().or_panic()
    };
    let all = heights.iter().enumerate().map(column);
    all.reduce(join).expect("there is one")
}

/// A free rigid plate pressed by a force on four columns of different heights: a table, whose feet push as statics and their
/// stiffness say. The oracle presses each foot by its springs alone, and looks for the plate's motion by Newton's method.
#[test]
fn a_plate_on_columns_of_different_heights() {
    let heights = [
        (3.0, [0.0, 0.0]),
        (2.9999, [4.0, 0.0]),
        (3.0, [0.0, 3.0]),
        (2.9997, [4.0, 3.0]),
    ];
    let (at, force) = ([2.3, 1.9], 3e5);
    let model = Model::on(columns(&heights))
        .material(Material::new(YOUNG, 0.0))
        .support(Support::on(["0bottom", "1bottom", "2bottom", "3bottom"]).fixed())
        .contact(
            Pair::obstacle(
                ["0top", "1top", "2top", "3top"],
                Obstacle::HalfSpace {
                    point: [0.0, 0.0, 3.0],
                    normal: [0.0, 0.0, -1.0],
                },
            )
            .named("plate"),
        )
        .coupling(
            Coupling::of_obstacles("plate", [at[0], at[1], 3.0])
                .force([0.0, 0.0, -force])
                .moved(0, 0.0)
                .moved(1, 0.0)
                .turned(2, 0.0),
        );
    // A column with ν = 0 under a linear pressure: stretched by its mean, bent by its moment to an arc whose top turns by M h/(E I).
    // The plate is z = 3 − w(x, y) with w = q · (1, x − a, y − b); a column whose top it covers wholly has the mean gap and both slopes.
    let stiffness = |h: f64| [YOUNG / h, YOUNG / 12.0 / h];
    let mut q = [0.0_f64; 3];
    for _ in 0..50 {
        let mut residual = [force, 0.0, 0.0];
        let mut tangent = [[0.0; 3]; 3];
        for (h, [x, y]) in heights {
            let row = [1.0, x + 0.5 - at[0], y + 0.5 - at[1]];
            let closed = row.iter().zip(q).map(|(r, q)| r * q).sum::<f64>() - (3.0 - h);
            if closed <= 0.0 {
                continue;
            }
            let [along, bent] = stiffness(h);
            for i in 0..3 {
                residual[i] -= along * closed * row[i];
                for j in 0..3 {
                    tangent[i][j] += along * row[i] * row[j];
                }
            }
            for i in 1..3 {
                residual[i] -= bent * q[i];
                tangent[i][i] += bent;
            }
        }
        if tangent[0][0] == 0.0 {
            q[0] += 1e-4;
            continue;
        }
        let step = solved(tangent, residual);
        (0..3).for_each(|i| q[i] += step[i]);
    }
    for path in PATHS {
        let found = answer(model.clone(), 1e-12, path);
        let report = point(&found);
        // Rotations about x lower the plate where y is small: w = −u_z.
        let [w, rx, ry] =
            [report.motion[2], report.motion[3], report.motion[4]].map(|q| q.expect("it is known"));
        let expected = [-q[0], -q[2], q[1]];
        assert!(
            apart(&[w, rx, ry], &expected) < 1e-8 * q[0],
            "{:?} {expected:?}",
            [w, rx, ry]
        );
        let met = &found.report().contacts[0];
        assert!((met.normal_force - force).abs() < 1e-9 * force, "{met:?}");
    }
}

/// A x = b of three.
fn solved(mut a: [[f64; 3]; 3], mut b: [f64; 3]) -> [f64; 3] {
    for i in 0..3 {
        let pivot = (i..3)
            .max_by(|&j, &k| a[j][i].abs().total_cmp(&a[k][i].abs()))
            .expect("three");
        a.swap(i, pivot);
        b.swap(i, pivot);
        for j in i + 1..3 {
            let factor = a[j][i] / a[i][i];
            (0..3).for_each(|k| a[j][k] -= factor * a[i][k]);
            b[j] -= factor * b[i];
        }
    }
    for i in (0..3).rev() {
        b[i] = (b[i] - (i + 1..3).map(|k| a[i][k] * b[k]).sum::<f64>()) / a[i][i];
    }
    b
}

/// An obstacle on a rigid end of a body: what it takes, the body carries.
#[test]
fn an_obstacle_moves_with_a_rigid_end() {
    let both = join(
        rectangle(
            [0.0, 0.0],
            [4.0, 1.0],
            [8, 2],
            CellShape::Quad,
            "arm",
            "arm_",
        ),
        rectangle(
            [3.0, -2.0],
            [2.0, 1.5],
            [6, 4],
            CellShape::Quad,
            "block",
            "block_",
        ),
    );
    let ball = Obstacle::Sphere {
        center: [4.0, -0.2],
        radius: 0.3,
    };
    let model = Model::on(both)
        .material(Material::new(YOUNG, 0.3))
        .support(Support::on("arm_left").fixed())
        .support(Support::on("block_bottom").fixed())
        .contact(Pair::obstacle("block_top", ball).named("tip"))
        .coupling(
            Coupling::on("arm_right", [4.0, 0.5])
                .with_obstacles("tip")
                .force([0.0, -1e6]),
        );
    for path in PATHS {
        let found = answer(model.clone(), 1e-11, path);
        let report = found.report();
        let [root, ground] = [&report.supports[0], &report.supports[1]];
        let tip = report.contacts[0].force[1];
        assert!(tip < -1e4, "it meets the block: {tip}");
        assert!((ground.force[1] + tip).abs() < 1e-8 * 1e6);
        assert!((root.force[1] - 1e6 - tip).abs() < 1e-8 * 1e6, "{root:?}");
        // About the root: the load, and the contact on the ball at its foot.
        let moment = root.moment[0] + 4.0 * -1e6 - 4.0 * tip;
        assert!(moment.abs() < 1e-3 * 4e6, "{moment}");
    }
}

/// Nodes that supports keep from moving along a plate which moves itself: the plate slides, and friction pulls it back.
#[test]
fn a_plate_slides_over_nodes_that_are_held() {
    let press = 2e6;
    let mesh = rectangle([0.0, 0.0], [2.0, 1.0], [8, 4], CellShape::Quad, "body", "");
    let model = Model::on(mesh)
        .material(Material::new(YOUNG, 0.3))
        .support(Support::on("bottom").fixed())
        .support(Support::on("top").x(0.0))
        .contact(
            Pair::obstacle("top", plate(1.0, -1.0))
                .named("plate")
                .coulomb(0.3),
        )
        .coupling(
            Coupling::of_obstacles("plate", [1.0, 1.0])
                .moved(0, 1e-3)
                .turned(2, 0.0)
                .force([0.0, -press]),
        );
    for path in PATHS {
        let found = answer(model.clone(), 1e-11, path);
        let report = found.report();
        let plate = &report.contacts[0];
        let expected = [0.3 * press, -press];
        assert!(apart(&plate.force, &expected) < 1e-7 * press, "{plate:?}");
        assert!(apart(&point(&found).force, &expected) < 1e-7 * press);
    }
}

#[test]
fn obstacles_that_cannot_move_are_refused() {
    let mesh = rectangle([0.0, 0.0], [2.0, 1.0], [4, 2], CellShape::Quad, "body", "");
    let refusal = |coupling: Coupling| {
        let model = Model::on(mesh.clone())
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on("bottom").fixed())
            .contact(Pair::obstacle("top", plate(1.0, -1.0)).named("plate"))
            .coupling(coupling);
        model.build().expect_err("it is refused").to_string()
    };
    for (coupling, text) in [
        (
            Coupling::of_obstacles("plat", [0.0; 2]),
            "there is no contact named \"plat\": write name",
        ),
        (
            Coupling::of_obstacles("plate", [0.0; 2]).distributing(),
            "obstacles are rigid",
        ),
        (
            Coupling::of_obstacles(Vec::<String>::new(), [0.0; 2]),
            "a list of contacts is empty",
        ),
    ] {
        let refused = refusal(coupling);
        assert!(refused.contains(text), "{refused}");
    }
}

/// A block on a floor that moves under it, held along by a spring far softer than itself: it sticks and slips like a rider. Newton's method
/// may go back and forth between slip to both sides, past the short way on which the block sticks.
#[test]
fn a_block_on_a_soft_spring_rides_on_a_moving_floor() {
    let rides: [(&[f64], &[f64]); 3] = [
        (
            &[0.74, 1.67, 0.37, 1.28, 1.51, 0.54, 0.3],
            &[-0.068, 0.047, 0.019, -0.105, -0.02, 0.051, -0.023],
        ),
        (
            &[0.67, 0.87, 1.79, 1.32, 0.28],
            &[0.116, 0.094, 0.054, -0.081, 0.103],
        ),
        (
            &[0.48, 1.05, 1.62, 1.07, 1.8, 0.83, 0.9, 0.2],
            &[0.084, 0.124, -0.084, 0.112, -0.091, 0.026, 0.078, 0.037],
        ),
    ];
    let (stiffness, mu) = (10.0, 0.4);
    for (forces, floors) in rides {
        let text = format!(
            r#"
            [[mesh.part]]
            name = "block"
            rectangle = {{ size = [1, 1], cells = [2, 2] }}
            [[material]]
            young = 1e6
            poisson = 0.3
            [[coupling]]
            boundary = "block-top"
            point = [0.5, 1]
            rz = 0
            force = [0, -1]
            factors = {forces:?}
            [[spring]]
            boundary = "block-top"
            direction = [1, 0]
            stiffness = {stiffness}
            [[contact]]
            boundary = "block-bottom"
            obstacle = {{ half_plane = {{ point = [0, 0], normal = [0, 1] }} }}
            friction = {{ coulomb = {mu} }}
            name = "floor"
            [[coupling]]
            contacts = "floor"
            point = [0, 0]
            x = 1
            y = 0
            rz = 0
            factors = {floors:?}
            [steps]
            factors = {:?}
            "#,
            vec![1.0; forces.len()],
        );
        let built = built(&case(&text));
        let steps = built
            .solve(&on_the_cpu(1e-9, Stiffness::Cholesky))
            .or_panic();
        let near = |x: &[f64; 2]| apart(x, &[0.5, 0.5]) < 1e-9;
        let middle = built.elastic.mesh.nodes.iter().position(near);
        let middle = middle.expect("there is such a node");
        let (mut place, mut floor) = (0.0_f64, 0.0);
        for (number, (step, (force, now))) in
            (steps.iter().zip(forces.iter().zip(floors))).enumerate()
        {
            assert_eq!(step.status, Status::Converged, "step {number}");
            let most = mu * force / stiffness;
            place = (place + now - floor).clamp(-most, most);
            floor = *now;
            let unknowns = built.step(number).or_panic().unknowns;
            let along = unknowns.displacements(&step.u)[middle][0];
            assert!(
                (along - place).abs() < 1e-3 * most,
                "step {number}: {along} for {place}"
            );
        }
    }
}
