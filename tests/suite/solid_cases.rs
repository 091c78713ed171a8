//! Cases of solids against closed forms.

use crate::common::close;
use crate::common::or_panic::OrPanic as _;
use signorini::case::Case;
use signorini::dual::DirectDual;
use signorini::model::{Analysis, Built};
use signorini::model::{Elastic, StepData};
use signorini::output::StepResults;
use signorini::output::{ContactFields, NodeStatus, Report, StepFields, StepReport};
use signorini::quasistatic::{self, State, StepSolution};
use signorini::ssnm::Status;
use std::ops::ControlFlow;
use std::path::Path;

/// A case in space, solved in one step.
struct Solved {
    build: Built<3>,
    data: StepData<3>,
    solution: StepSolution<3>,
}

fn solve(text: &str) -> Solved {
    let case = Case::parse(Path::new("tests/case.toml"), text.to_owned(), &[]);
    let case = case.or_panic();
    let made = case.build().or_panic();
    let build = made.space().expect("an elastic case in space");
    let data = build.step(0).or_panic();
    let mut dual = DirectDual::new(&build.problem).or_panic();
    let mut settings = case.settings();
    settings.ssnm.tolerance = 1e-12;
    let start = State::at_rest(&build.problem);
    let solution = quasistatic::solve_step(
        &build.problem,
        &data.load,
        &start,
        &mut dual,
        &settings,
        &mut Default::default(),
        |_| ControlFlow::Continue(()),
    )
    .or_panic();
    assert_eq!(solution.status, Status::Converged);
    Solved {
        build,
        data,
        solution,
    }
}

impl Solved {
    fn elastic(&self) -> &Elastic<3> {
        &self.build.elastic
    }

    fn data(&self) -> &StepData<3> {
        &self.data
    }

    fn fields(&self) -> ContactFields<3> {
        ContactFields::new(
            &self.build.problem,
            self.elastic(),
            self.data(),
            &self.solution,
        )
    }

    /// The report of the step.
    fn report(&self) -> StepReport {
        let mut report = Report::new("", &self.build);
        let solved = signorini::solve::Solved {
            number: 1,
            data: Some(self.data()),
            solution: self.solution.clone(),
            displaced: None,
            parts: 1,
        };
        report.add_step(&StepResults::new(Analysis::from(&self.build), &solved));
        report.steps.remove(0)
    }
}

/// Boxes of all shapes, one of them bent, one a part that is moved.
const MESHES: [&str; 5] = [
    "[mesh.box]\norigin = [1, 2, 0]\nsize = [2, 1, 1.5]\ncells = [4, 2, 3]\n",
    "[mesh.box]\norigin = [1, 2, 0]\nsize = [2, 1, 1.5]\ncells = [3, 2, 2]\nshape = \"tetrahedron\"\n",
    "[mesh.box]\norigin = [1, 2, 0]\nsize = [2, 1, 1.5]\ncells = [3, 3, 2]\nshape = \"wedge\"\n",
    "[mesh.box]\norigin = [1, 2, 0]\nsize = [2, 1, 1.5]\ncells = [4, 3, 3]\nshape = \"tetrahedron\"\n\
     map = [\"x + 0.2*(x - 1)*(3 - x)\", \"y + 0.04*sin(pi*(y - 2))*x*(1.5 - z)\", \"z*(0.7 + 0.2*z)\"]\n",
    "[[mesh.part]]\nname = \"only\"\nshift = [1, 2, 0]\nbox = { size = [2, 1, 1.5], cells = [4, 2, 3] }\n",
];

/// A block pressed on the ground has the pressure of the load everywhere.
#[test]
fn uniform_pressure_is_uniform_in_space() {
    let (e, nu, p) = (3000.0, 0.4, 10.0);
    for (i, mesh) in MESHES.iter().enumerate() {
        let prefix = if i == 4 { "only-" } else { "" };
        let solved = solve(&format!(
            "{mesh}[[material]]\nyoung = {e}\npoisson = {nu}\n\
             [[support]]\nboundary = \"{prefix}left\"\nsymmetry = true\n\
             [[support]]\nboundary = \"{prefix}front\"\ny = 0\n\
             [[traction]]\nboundary = \"{prefix}top\"\npressure = {p}\n\
             [[contact]]\nboundary = \"{prefix}bottom\"\n\
             obstacle = {{ half_space = {{ point = [0, 0, 0], normal = [0, 0, 3] }} }}\n"
        ));
        let fields = solved.fields();
        assert!(fields.pressure.len() > 8);
        for (i, pressure) in fields.pressure.iter().enumerate() {
            assert!((pressure - p).abs() < 1e-8, "{pressure}");
            assert_eq!(fields.status[i], NodeStatus::Frictionless);
        }
        let of_step = StepFields::new(solved.elastic(), solved.data(), &solved.solution);
        for (x, u) in solved
            .elastic()
            .mesh
            .nodes
            .iter()
            .zip(&of_step.displacement)
        {
            let expected = [
                nu * p / e * (x[0] - 1.0),
                nu * p / e * (x[1] - 2.0),
                -p / e * x[2],
            ];
            close(u, &expected, 1e-11);
        }
        for s in of_step.at_nodes.iter().chain(&of_step.in_elements) {
            close(
                &[s.xx, s.yy, s.zz, s.xy, s.yz, s.zx],
                &[0.0, 0.0, -p, 0.0, 0.0, 0.0],
                1e-8,
            );
            close(&[s.von_mises()], &[p], 1e-8);
        }
        let report = solved.report();
        let (contact, force) = (&report.contacts[0], p * 2.0);
        assert_eq!(contact.against, "rigid half-space");
        close(&contact.force, &[0.0, 0.0, force], 1e-8);
        close(&[contact.normal_force, contact.area], &[force, 2.0], 1e-8);
        assert_eq!(report.total_load.as_ref().map(Vec::len), Some(3));
        for support in &report.supports {
            close(&support.force, &[0.0; 3], 1e-8);
        }
    }
}

/// The ground and the wall carry the weight of a block that rests on the ground and leans on the wall.
#[test]
fn reactions_add_up_to_the_weight() {
    let (density, volume) = (2.0, 3.0);
    for shape in ["hexahedron", "tetrahedron", "wedge"] {
        let case = |floor: &str| {
            format!(
                "[mesh.box]\nsize = [2, 1, 1.5]\ncells = [4, 2, 3]\nshape = \"{shape}\"\n\
                 [analysis]\ngravity = [0, -1, -10]\n\
                 [[material]]\nyoung = 1e5\npoisson = 0.3\ndensity = {density}\n{floor}\
                 [[contact]]\nboundary = \"front\"\n\
                 obstacle = {{ half_space = {{ point = [0, 0, 0], normal = [0, 1, 0] }} }}\n"
            )
        };
        let weight = density * volume * 10.0;
        // A support below: the wall takes the push towards it.
        let report = solve(&case("[[support]]\nboundary = \"bottom\"\nx = 0\nz = 0\n")).report();
        close(
            report.total_load.as_deref().unwrap_or(&[]),
            &[0.0, -0.1 * weight, -weight],
            1e-9,
        );
        close(&report.supports[0].force, &[0.0, 0.0, weight], 1e-7);
        close(&report.contacts[0].force, &[0.0, 0.1 * weight, 0.0], 1e-7);
        // Only ground and wall, and supports that keep it from sliding away along both.
        let ground = "[[support]]\nboundary = \"left\"\nx = 0\n[[contact]]\nboundary = \"bottom\"\n\
                      obstacle = { half_space = { point = [0, 0, 0], normal = [0, 0, 1] } }\n";
        let solved = solve(&case(ground));
        assert_eq!(solved.build.problem.floating_bodies().n_modes(), 3);
        let report = solved.report();
        close(&report.supports[0].force, &[0.0; 3], 1e-6);
        close(&report.contacts[0].force, &[0.0, 0.0, weight], 1e-6);
        close(&report.contacts[1].force, &[0.0, 0.1 * weight, 0.0], 1e-6);
    }
}

/// A block on a slope, pressed against it and dragged along it: tractions along the axes, whatever the tangents.
#[test]
fn tractions_are_vectors_along_the_axes() {
    // Turned by atan(3/4) about y: the block is on the plane with the normal (-0.6, 0, 0.8).
    let (bound, p) = (4.0, 10.0);
    let solved = solve(&format!(
        "[mesh.box]\nsize = [2, 1, 1]\ncells = [4, 2, 2]\nmap = [\"0.8*x - 0.6*z\", \"y\", \"0.6*x + 0.8*z\"]\n\
         [[material]]\nyoung = 1e5\npoisson = 0\n\
         [[traction]]\nboundary = \"top\"\npressure = {p}\nx = {}\ny = {}\nz = {}\n\
         [[support]]\nboundary = \"left\"\nx = 0\ny = 0\nz = 0\n\
         [[contact]]\nboundary = \"bottom\"\nfriction = {{ tresca = {bound} }}\n\
         obstacle = {{ half_space = {{ point = [0, 0, 0], normal = [-0.6, 0, 0.8] }} }}\n",
        // 40 along the slope and 30 across it: more than friction can hold.
        40.0 * 0.8,
        30.0,
        40.0 * 0.6,
    ));
    let fields = solved.fields();
    let mut sum = [0.0; 3];
    let mut slipping = 0;
    for (i, node) in solved.elastic().contact.places.iter().enumerate() {
        let [pressed, rubbed] = fields.traction_vectors(i);
        let out = [-0.6, 0.0, 0.8];
        close(&pressed, &out.map(|v| v * fields.pressure[i]), 1e-9 * p);
        let along: f64 = rubbed.iter().zip(out).map(|(t, n)| t * n).sum();
        close(&[along], &[0.0], 1e-12 * p);
        let size = rubbed.iter().map(|t| t * t).sum::<f64>().sqrt();
        close(
            &[size],
            &[fields.traction[2 * i].hypot(fields.traction[2 * i + 1])],
            1e-12 * p,
        );
        assert!(size <= bound * (1.0 + 1e-9));
        if fields.status[i] == NodeStatus::Slip {
            slipping += 1;
            close(&[size], &[bound], 1e-9);
            // Against the slip: no part of one is along the other.
            let slip = &fields.slip[2 * i..][..2];
            let traction = &fields.traction[2 * i..][..2];
            let dot = slip[0] * traction[0] + slip[1] * traction[1];
            let expected = -bound * slip[0].hypot(slip[1]);
            close(&[dot], &[expected], 1e-6 * expected.abs());
        }
        for c in 0..3 {
            sum[c] += node.area * (pressed[c] + rubbed[c]);
        }
    }
    assert!(slipping > 5, "{slipping}");
    let report = solved.report();
    close(&report.contacts[0].force, &sum, 1e-9);
    // All forces together.
    let load = report.total_load.unwrap_or_default();
    let total: Vec<f64> = (0..3)
        .map(|c| load[c] + sum[c] + report.supports[0].force[c])
        .collect();
    close(&total, &[0.0; 3], 1e-8);
    let tangential: f64 = (sum.iter().zip([-0.6, 0.0, 0.8]))
        .map(|(f, n)| f - report.contacts[0].normal_force * n)
        .map(|f| f * f)
        .sum();
    close(
        &[report.contacts[0].tangential_force],
        &[tangential.sqrt()],
        1e-9,
    );
}

/// A sphere and a cylinder in the way of a block: the contact ends where they bend away.
#[test]
fn round_obstacles_stop_a_block() {
    for obstacle in [
        "sphere = { center = [0.5, 0.5, -20], radius = 20 }",
        "cylinder = { point = [0.5, 0, -20], axis = [0, 2, 0], radius = 20 }",
    ] {
        let solved = solve(&format!(
            "[mesh.box]\nsize = [1, 1, 0.5]\ncells = [10, 10, 4]\n\
             [[material]]\nyoung = 1e6\npoisson = 0.3\n\
             [[support]]\nboundary = \"top\"\nx = 0\ny = 0\nz = -1e-3\n\
             [[contact]]\nboundary = \"bottom\"\nobstacle = {{ {obstacle} }}\n"
        ));
        let fields = solved.fields();
        let elastic = solved.elastic();
        let sphere = obstacle.starts_with("sphere");
        assert_eq!(
            elastic.pairs[0].against,
            if sphere {
                "rigid sphere"
            } else {
                "rigid cylinder"
            }
        );
        let at = |x: f64, y: f64| {
            let there = |node: &&signorini::contact::ContactPlace<3>| {
                let place = node.place;
                (place[0] - x).abs() + (place[1] - y).abs() < 1e-9
            };
            let row = elastic.contact.places.iter().position(|node| there(&node));
            fields.pressure[row.unwrap_or_else(|| panic!("no node at {x}, {y}"))]
        };
        assert!(at(0.5, 0.5) > 100.0);
        assert_eq!(at(0.0, 0.5), 0.0);
        assert_eq!(at(0.5, 0.0) == 0.0, sphere);
        // As symmetric as the mesh and the obstacle.
        close(&[at(0.4, 0.4)], &[at(0.6, 0.6)], 1e-6);
        if sphere {
            assert!(at(0.4, 0.5) > 0.0);
            close(&[at(0.4, 0.5)], &[at(0.5, 0.4)], 1e-6);
        }
    }
}

/// A cube pressed on a floor, with additions to the traction on its top, and at the end.
fn cube(top: &str, end: &str) -> String {
    format!(
        "[mesh.box]\nsize = [1, 1, 1]\ncells = [4, 4, 4]\nshape = \"wedge\"\n\
         [[material]]\nyoung = 2.1e5\npoisson = 0.3\n\
         [[traction]]\nboundary = \"top\"\npressure = 10\n{top}\n\
         [[contact]]\nboundary = \"bottom\"\n\
         obstacle = {{ half_space = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}\n{end}\n"
    )
}

/// The states of contact nodes do not depend on the tolerance: nodes within their disc by less than that slip.
#[test]
fn states_are_those_of_a_finer_solution() {
    let text = cube("x = 1.246\ny = 0.626", "friction = { coulomb = 0.2 }");
    let case = Case::parse(Path::new("tests/case.toml"), text.clone(), &[]);
    let case = case.or_panic();
    let fine = solve(&text);
    let start = State::at_rest(&fine.build.problem);
    let mut dual = DirectDual::new(&fine.build.problem).or_panic();
    let coarse = quasistatic::solve_step(
        &fine.build.problem,
        &fine.data().load,
        &start,
        &mut dual,
        &case.settings(),
        &mut Default::default(),
        |_| ControlFlow::Continue(()),
    )
    .or_panic();
    assert_eq!(coarse.status, Status::Converged);
    let m = fine.build.problem.m();
    let slips = |solution: &StepSolution<3>| (0..m).filter(|&i| solution.sets.slips(i)).count();
    assert_eq!((slips(&coarse), slips(&fine.solution)), (23, 23));
}

#[test]
fn a_floor_that_supports_move_a_body_along_is_refused_where_friction_would_turn() {
    let moved = |support: &str| {
        let friction = "friction = { coulomb = 0.2 }\n[[support]]\nboundary = \"bottom\"\n";
        let text = cube("", &format!("{friction}{support}"));
        let case = Case::parse(Path::new("tests/case.toml"), text, &[]);
        let case = case.or_panic();
        case.build().err().map(|error| error.to_string())
    };
    let error = moved("x = 1e-5").expect("it is refused");
    assert!(
        error.contains("line 16") && error.contains("leave it free in the other"),
        "{error}"
    );
    for support in ["x = 0", "x = 1e-5\ny = 0"] {
        assert_eq!(moved(support), None);
    }
}
