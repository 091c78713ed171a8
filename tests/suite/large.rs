//! Large displacements: what turns as a whole, figures of an independent program, closed forms, and what buckles.

mod alike;
mod connected;
mod elements;
mod itself;
mod known;
mod pairs;
mod random;
mod sliding;
mod tied;

use crate::common::models::on_the_cpu;
use crate::common::{built, case};
use elements::plus;
use signorini::backend::{GpuOptions, Precision};
use signorini::contact::Obstacle;
use signorini::control::Costs;
use signorini::dual::DualOperator as _;
use signorini::elasticity::{Hyperelastic, Material};
use signorini::engine::{Device, Engine, EngineOptions, Stiffness};
use signorini::mesh::Mesh;
use signorini::mesh::structured::{CellShape, SolidShape, block, rectangle};
use signorini::model::{
    Analysis, Axis, Built, Coupling, Model, Motion, Pair, Support, Temperature, Traction,
};
use signorini::output::{Report, Results, StepReport, StepResults};
use signorini::quasistatic::StepSettings;
use signorini::solve::Event;
use signorini::ssnm::Status;
use std::ops::ControlFlow;

/// The end of a load step.
struct End<const D: usize> {
    status: Status,
    parts: usize,
    iterations: usize,
    /// The first node of each place.
    nodes: Vec<u32>,
    /// On the bodies, of all places.
    forces: Vec<[f64; D]>,
    displacement: Vec<[f64; D]>,
    report: StepReport,
}

impl<const D: usize> End<D> {
    fn force(&self) -> [f64; D] {
        std::array::from_fn(|c| self.forces.iter().map(|force| force[c]).sum())
    }
}

macro_rules! solved_in {
    ($name:ident, $on:ident, $d:literal) => {
        fn $name(
            model: Model<$d>,
            tolerance: f64,
            stiffness: Stiffness,
        ) -> Result<Vec<End<$d>>, Box<dyn std::error::Error>> {
            let options = EngineOptions {
                stiffness,
                ..EngineOptions::default()
            };
            Ok($on(model, tolerance, options)?.0)
        }

        /// The same with these options; and what PCG cost.
        fn $on(
            model: Model<$d>,
            tolerance: f64,
            options: EngineOptions,
        ) -> Result<(Vec<End<$d>>, Option<Costs>), Box<dyn std::error::Error>> {
            let built = model.build()?;
            let mut settings = StepSettings::default();
            settings.ssnm.tolerance = tolerance;
            let mut engine = Engine::new(&built.problem, options, |_| {})?;
            let (mut ends, mut report) = (Vec::new(), Report::new("", &built));
            Analysis::from(&built).solve_on(&mut engine, &settings, |event| {
                if let Event::Ends(step) = event {
                    let there = step.displaced.as_deref().unwrap_or(&built);
                    let (data, solution) = (step.data.expect("of a model"), &step.solution);
                    let m = there.problem.m();
                    let (normal, tangential) = solution.lambda.split_at(m);
                    let places = there.elastic.contact.places.iter().enumerate();
                    let forces = places.map(|(i, place)| {
                        std::array::from_fn(|c| {
                            let rubbed = (place.frame[1..].iter().enumerate())
                                .map(|(a, tangent)| tangential[($d - 1) * i + a] * tangent[c]);
                            -normal[i] * place.frame[0][c] - rubbed.sum::<f64>()
                        })
                    });
                    ends.push(End {
                        status: solution.status,
                        parts: step.parts,
                        iterations: solution.rounds.len(),
                        nodes: (there.elastic.contact.places.iter())
                            .map(|place| place.own[0].0)
                            .collect(),
                        forces: forces.collect(),
                        displacement: data.unknowns.displacements(&solution.u),
                        report: {
                            report.add_step(&StepResults::new(Analysis::from(&built), &step));
                            report.steps.last().expect("just added").clone()
                        },
                    });
                }
                ControlFlow::Continue(())
            })?;
            Ok((ends, engine.costs()))
        }
    };
}

solved_in!(tried, tried_on, 2);
solved_in!(tried_in_space, tried_in_space_on, 3);

/// The work of loads, supports and contacts on the bodies in all steps.
fn works<const D: usize>(ends: &[End<D>]) -> [f64; 3] {
    ends.iter().fold([0.0; 3], |sum, end| {
        let energy = end.report.energy.as_ref().expect("no temperatures");
        let [_, all @ ..] = energy.all();
        std::array::from_fn(|kind| sum[kind] + all[kind])
    })
}

/// The strain energy at the end of a step.
fn strain<const D: usize>(end: &End<D>) -> f64 {
    end.report.energy.as_ref().expect("no temperatures").strain
}

/// Solves the problems of these seeds; what is wrong, and how many load steps converged, were found unstable or not held, and ended
/// otherwise. `broken` judges a load step that converged, by its number from 0 and the displacements at the end of the one before.
fn campaign<P>(
    seeds: std::ops::Range<u64>,
    stiffness: Stiffness,
    problem: fn(u64) -> P,
    model: fn(&P) -> Model,
    broken: impl Fn(&P, usize, &[[f64; 2]], &End<2>) -> Option<String>,
) -> (Vec<String>, [usize; 3]) {
    let (mut wrong, mut counts) = (Vec::new(), [0; 3]);
    for seed in seeds {
        let problem = problem(seed);
        let ends = match tried(model(&problem), 1e-8, stiffness) {
            Ok(ends) => ends,
            Err(error) => {
                wrong.push(format!("{seed}: {error}"));
                continue;
            }
        };
        let mut before = vec![[0.0; 2]; ends.first().map_or(0, |end| end.displacement.len())];
        for (step, end) in ends.iter().enumerate() {
            match end.status {
                Status::Converged => counts[0] += 1,
                Status::Unstable | Status::NotHeld => {
                    counts[1] += 1;
                    continue;
                }
                other => {
                    counts[2] += 1;
                    eprintln!(
                        "{seed}: step {} ended as {other:?} after {} iterations, {} parts",
                        step + 1,
                        end.iterations,
                        end.parts
                    );
                    continue;
                }
            }
            if let Some(what) = broken(&problem, step, &before, end) {
                wrong.push(format!("{seed}: step {}: {what}", step + 1));
            }
            before.clone_from(&end.displacement);
        }
    }
    (wrong, counts)
}

fn solved(model: Model, tolerance: f64, stiffness: Stiffness) -> Vec<End<2>> {
    tried(model, tolerance, stiffness).unwrap_or_else(|error| panic!("{error}"))
}

fn solved_in_space(model: Model<3>, tolerance: f64, stiffness: Stiffness) -> Vec<End<3>> {
    tried_in_space(model, tolerance, stiffness).unwrap_or_else(|error| panic!("{error}"))
}

fn neo_hooke(young: f64, poisson: f64) -> Material {
    Material {
        law: Hyperelastic::NeoHooke,
        ..Material::new(young, poisson)
    }
}

/// Contact with an obstacle that nothing reaches, as a model needs one: it lies in this direction.
fn far(boundary: &str, towards: [f64; 2]) -> Pair {
    let obstacle = Obstacle::HalfSpace {
        point: towards.map(|v| 50.0 * v),
        normal: towards.map(|v| -v),
    };
    Pair::obstacle(boundary, obstacle)
}

/// A block that is pressed on its floor by a tenth of its height and pushed aside: figures of an independent program.
#[test]
fn a_block_is_pressed_on_its_floor() {
    for coulomb in [0.0, 0.3] {
        let mesh = rectangle([-0.5, 0.0], [1.0, 1.0], [8, 8], CellShape::Quad, "body", "");
        let floor = Obstacle::HalfSpace {
            point: [0.0; 2],
            normal: [0.0, 1.0],
        };
        let model = Model::on(mesh)
            .large_displacements()
            .material(neo_hooke(1.0, 0.3))
            .support(Support::on("top").x(0.02).y(-0.1))
            .contact(Pair::obstacle("bottom", floor).coulomb(coulomb))
            .steps([0.5, 1.0]);
        let ends = solved(model, 1e-11, Stiffness::Cholesky);
        for end in &ends {
            assert_eq!(end.status, Status::Converged);
            assert!(end.iterations <= 6, "{}", end.iterations);
        }
        let force = ends[1].force();
        // Figures of the independent program, in two steps.
        if coulomb > 0.0 {
            assert!((force[0] + 0.004_621_982_1).abs() < 1e-8, "{force:?}");
            assert!((force[1] - 0.127_159_21).abs() < 1e-7, "{force:?}");
        }
    }
}

/// A law of large displacements does nothing where displacements are small, and a hint says so.
#[test]
fn a_law_without_effect_has_a_hint() {
    let of = |material: Material| {
        let mesh = rectangle([0.0; 2], [1.0; 2], [2, 2], CellShape::Quad, "body", "");
        let model = Model::on(mesh)
            .material(material)
            .support(Support::on("bottom").fixed())
            .traction(Traction::on("top").x(1e-3));
        crate::common::models::answer(model, 1e-10, Stiffness::Cholesky).hints()
    };
    assert!(of(Material::new(1.0, 0.3)).is_empty());
    let hints = of(neo_hooke(1.0, 0.3));
    assert!(hints[0].contains("region body: the law of its material has no effect"));
}

/// A block that is held at its top, which turns with the floor below it: at rest in a turned frame.
#[test]
fn supports_and_obstacles_turn() {
    let mesh = rectangle([-0.5, 0.0], [1.0, 1.0], [8, 8], CellShape::Quad, "body", "");
    let floor = Obstacle::HalfSpace {
        point: [0.0; 2],
        normal: [0.0, 1.0],
    };
    let origin = Axis::at([0.0; 2]);
    let steps = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0];
    let model = Model::on(mesh)
        .large_displacements()
        .material(neo_hooke(1.0, 0.3))
        .support(Support::on("top").turned(origin, 90.0))
        // The floor is drawn where it touches: it is to press.
        .contact(
            Pair::obstacle("bottom", floor)
                .coulomb(0.3)
                .interference(0.1)
                .moving(Motion::turn(origin, 90.0)),
        )
        .steps(steps);
    let ends = solved(model, 1e-10, Stiffness::Cholesky);
    assert_eq!(ends.len(), 4);
    let turned = |v: [f64; 2], angle: f64| {
        let (sin, cos) = angle.to_radians().sin_cos();
        [cos * v[0] - sin * v[1], sin * v[0] + cos * v[1]]
    };
    for (end, factor) in ends.iter().zip(steps) {
        assert_eq!(end.status, Status::Converged);
        assert!(end.iterations <= 8, "{}", end.iterations);
        for (force, first) in end.forces.iter().zip(&ends[0].forces) {
            let expected = turned(*first, 90.0 * factor);
            for c in 0..2 {
                assert!(
                    (force[c] - expected[c]).abs() < 1e-10,
                    "{force:?} {expected:?}"
                );
            }
        }
    }
    let pressed = ends[0].force();
    assert!(pressed[1] > 0.1, "{pressed:?}");
}

/// A block of rubber with a cylinder pressed into it by a fifth of its height, in one step: figures of an independent program.
#[test]
fn a_cylinder_is_pressed_into_a_block() {
    for (cells, expected) in [([16, 8], 0.25155), ([32, 16], 0.25408175)] {
        let mesh = rectangle([-1.0, 0.0], [2.0, 1.0], cells, CellShape::Quad, "body", "");
        let cylinder = Obstacle::Sphere {
            center: [0.0, 2.0],
            radius: 1.0,
        };
        let model = Model::on(mesh)
            .large_displacements()
            .material(neo_hooke(1.0, 0.3))
            .support(Support::on("bottom").fixed())
            .contact(Pair::obstacle("top", cylinder).moving(Motion::shift([0.0, -0.2])));
        let ends = solved(model, 1e-9, Stiffness::Cholesky);
        assert_eq!(ends[0].status, Status::Converged);
        assert!(ends[0].iterations <= 8, "{}", ends[0].iterations);
        let force = ends[0].force();
        assert!(
            (force[1] + expected).abs() < 2e-5,
            "{force:?}, expected {expected}"
        );
    }
}

/// Elements of second order, bent to a quarter of a ring about the origin.
fn ring(cells: usize, thickness: f64) -> Mesh {
    let square = rectangle([0.0; 2], [1.0; 2], [cells, 1], CellShape::Quad, "ring", "");
    let mut mesh = square.raised().unwrap_or_else(|error| panic!("{error}"));
    for x in &mut mesh.nodes {
        // Against the clock from the right, so that elements keep their orientation.
        let angle = std::f64::consts::FRAC_PI_2 * (1.0 - x[0]);
        let radius = 1.0 + thickness * (x[1] - 0.5);
        *x = [radius * angle.cos(), radius * angle.sin()];
    }
    mesh
}

/// A straight column under 25 times its buckling load is in balance and does not stay there.
#[test]
fn a_straight_column_is_told_as_unstable() {
    let mesh = rectangle([0.0; 2], [0.1, 2.0], [2, 20], CellShape::Quad, "column", "");
    let mesh = mesh.raised().unwrap_or_else(|error| panic!("{error}"));
    // Fixed below and free above: π² E I / (4 l²).
    let euler = std::f64::consts::PI.powi(2) * 1e6 * 0.1_f64.powi(3) / 12.0 / 16.0;
    let under = |load: f64, stiffness: Stiffness| {
        let model = Model::on(mesh.clone())
            .large_displacements()
            .material(Material::new(1e6, 0.0))
            .support(Support::on("bottom").fixed())
            .traction(Traction::on("top").y(-load / 0.1))
            .contact(far("left", [-1.0, 0.0]));
        solved(model, 1e-8, stiffness)[0].status
    };
    for stiffness in [Stiffness::Cholesky, Stiffness::Pcg] {
        assert_eq!(under(0.9 * euler, stiffness), Status::Converged);
        assert_eq!(under(25.0 * euler, stiffness), Status::Unstable);
    }
}

/// Nearly incompressible rubber that shrinks freely by a hundredth on its support. In one step K is not definite there.
#[test]
fn rubber_cools_in_parts_of_a_step() {
    let mesh = block(
        [0.0; 3],
        [1.0; 3],
        [2; 3],
        SolidShape::Hexahedron,
        "box",
        "",
    );
    let mesh = mesh.raised().unwrap_or_else(|error| panic!("{error}"));
    let model = Model::on(mesh.clone())
        .large_displacements()
        .material(Material {
            expansion: 1e-3,
            ..neo_hooke(1e3, 0.49)
        })
        .temperature(Temperature::within("box", -10.0))
        .support(Support::on("left").x(0.0))
        .support(Support::on("front").y(0.0))
        .support(Support::on("bottom").z(0.0));
    for stiffness in [Stiffness::Cholesky, Stiffness::Pcg] {
        let end = &solved_in_space(model.clone(), 1e-8, stiffness)[0];
        assert_eq!(end.status, Status::Converged);
        for (x, u) in mesh.nodes.iter().zip(&end.displacement) {
            for (x, u) in x.iter().zip(u) {
                assert!((u + 0.01 * x).abs() < 1e-5, "{u} at {x}");
            }
        }
    }
}

/// A thin plate whose corners are aggregated along lines: after it has moved they are 1e-8 off them.
#[test]
fn a_plate_is_stable_by_pcg() {
    let shape = SolidShape::Tetrahedron;
    let mesh = block([0.0; 3], [1.0, 1.0, 0.1], [4, 4, 2], shape, "plate", "");
    let model = Model::on(mesh.raised().expect("no pyramids"))
        .large_displacements()
        .material(Material::new(1e9, 0.3))
        .support(Support::on("left").x(0.0).y(0.0).z(0.0))
        .traction(Traction::on("top").z(-100.0));
    let ends = solved_in_space(model, 1e-6, Stiffness::Pcg);
    assert_eq!(ends[0].status, Status::Converged);
}

/// A beam is bent by a follower pressure and by a ball in space: the same from the mesh and from its mirror image.
#[test]
fn a_plate_meets_a_ball_in_space() {
    let mesh = block(
        [0.0; 3],
        [4.0, 1.0, 0.2],
        [8, 2, 1],
        SolidShape::Hexahedron,
        "plate",
        "",
    );
    let mesh = mesh.raised().unwrap_or_else(|error| panic!("{error}"));
    let ball = Obstacle::Sphere {
        center: [3.0, 0.5, -1.05],
        radius: 1.0,
    };
    let model = Model::on(mesh)
        .large_displacements()
        .material(Material::new(1e5, 0.3))
        .support(Support::on("left").fixed())
        .traction(Traction::on("top").pressure(4.0))
        .contact(Pair::obstacle("bottom", ball).coulomb(0.2))
        .steps([0.5, 1.0]);
    let ends = solved_in_space(model, 1e-8, Stiffness::Cholesky);
    for end in &ends {
        assert_eq!(end.status, Status::Converged);
        assert!(end.iterations <= 12, "{}", end.iterations);
        // No node lies in the ball, and the plate rests on it.
        assert!(end.force()[2] > 0.5, "{:?}", end.force());
    }
    let lowest = ends[1]
        .displacement
        .iter()
        .fold(0.0, |min: f64, u| min.min(u[2]));
    assert!(lowest < -0.05, "{lowest}");
}

/// By PCG a plate of either order on a ball comes to the forces and places of the factor.
#[test]
fn pcg_comes_to_the_same() {
    for order in [1, 2] {
        let shape = SolidShape::Hexahedron;
        let mut mesh = block([0.0; 3], [4.0, 1.0, 0.5], [12, 3, 2], shape, "plate", "");
        if order == 2 {
            mesh = mesh.raised().unwrap_or_else(|error| panic!("{error}"));
        }
        let ball = Obstacle::Sphere {
            center: [3.0, 0.5, -1.05],
            radius: 1.0,
        };
        let model = Model::on(mesh)
            .large_displacements()
            .material(neo_hooke(1e4, 0.3))
            .support(Support::on("left").fixed())
            .traction(Traction::on("top").pressure(20.0))
            .contact(Pair::obstacle("bottom", ball).coulomb(0.2));
        let [factor, pcg] = [Stiffness::Cholesky, Stiffness::Pcg]
            .map(|stiffness| solved_in_space(model.clone(), 1e-8, stiffness).remove(0));
        assert_eq!([factor.status, pcg.status], [Status::Converged; 2]);
        let (force, same) = (factor.force(), pcg.force());
        for c in 0..3 {
            assert!(
                (force[c] - same[c]).abs() < 1e-5 * force[2],
                "{force:?} {same:?}"
            );
        }
        let apart = (factor.displacement.iter().zip(&pcg.displacement))
            .flat_map(|(a, b)| (0..3).map(move |c| (a[c] - b[c]).abs()))
            .fold(0.0, f64::max);
        assert!(apart < 1e-6, "order {order}: {apart}");
    }
}

/// One hierarchy a load step is enough, also where a body turns by a quarter, on all paths of PCG.
#[test]
fn hierarchies_turn_with_the_bodies() {
    let shape = SolidShape::Hexahedron;
    let mesh = block([0.0; 3], [2.0, 1.0, 1.0], [12, 6, 6], shape, "body", "");
    let floor = Obstacle::HalfSpace {
        point: [2.0, 0.0, 0.0],
        normal: [-1.0, 0.0, 0.0],
    };
    let axis = Axis::new([0.0, 0.5, 0.5], [0.0, 1.0, 0.0]);
    let model = Model::on(mesh)
        .large_displacements()
        .material(neo_hooke(1.0, 0.3))
        .support(Support::on("left").turned(axis, 90.0))
        .contact(
            Pair::obstacle("right", floor)
                .coulomb(0.2)
                .interference(0.2)
                .moving(Motion::turn(axis, 90.0)),
        )
        .steps([1.0 / 3.0, 2.0 / 3.0, 1.0]);
    let factor = solved_in_space(model.clone(), 1e-8, Stiffness::Cholesky);
    let gpu = |precision| EngineOptions {
        place: Device::Gpu,
        gpu: GpuOptions {
            precision: Some(precision),
            ..GpuOptions::default()
        },
        ..EngineOptions::default()
    };
    let cpu = EngineOptions {
        place: Device::Cpu,
        stiffness: Stiffness::Pcg,
        ..EngineOptions::default()
    };
    let mut on_cpu = 0;
    for options in [cpu, gpu(Precision::F64), gpu(Precision::F32)] {
        let what = format!("{:?} {:?}", options.place, options.gpu.precision);
        let (ends, costs) = tried_in_space_on(model.clone(), 1e-8, options)
            .unwrap_or_else(|error| panic!("{what}: {error}"));
        let solves = costs.expect("PCG").solves;
        println!("{what}: {solves:?}");
        assert_eq!([ends.len(), factor.len()], [3; 2], "{what}");
        for (end, same) in ends.iter().zip(&factor) {
            assert_eq!([end.status, same.status], [Status::Converged; 2], "{what}");
            let (force, other) = (end.force(), same.force());
            for c in 0..3 {
                let off = (force[c] - other[c]).abs();
                assert!(
                    off < 1e-5 * force[0].hypot(force[2]),
                    "{what}: {force:?} {other:?}"
                );
            }
        }
        // One for each step, the first one, and one for the bodies at rest at the end.
        assert!(solves.set_ups <= 5, "{what}: {solves:?}");
        if on_cpu == 0 {
            on_cpu = solves.iterations;
        }
        assert!(10 * solves.iterations <= 13 * on_cpu, "{what}: {solves:?}");
    }
    assert!(on_cpu <= 300, "{on_cpu}");
}

/// What belongs to small displacements alone, or to large ones alone, is refused with a word on what to do.
#[test]
fn what_is_not_known_is_refused() {
    let mesh = || rectangle([0.0; 2], [1.0; 2], [2, 2], CellShape::Quad, "body", "");
    let floor = Obstacle::HalfSpace {
        point: [0.0; 2],
        normal: [0.0, 1.0],
    };
    let model = || {
        Model::on(mesh())
            .material(Material::new(1.0, 0.3))
            .support(Support::on("top").fixed())
    };
    let refused = |model: Model, words: &str| {
        let error = model.build().expect_err("refused").to_string();
        assert!(error.contains(words), "{error}");
    };
    let pair = || Pair::obstacle("bottom", floor);
    refused(
        model().contact(pair().moving(Motion::shift([0.0, 1.0]))),
        "geometry = \"large\"",
    );
    refused(
        model()
            .support(Support::on("right").turned(Axis::at([0.0; 2]), 3.0))
            .contact(pair()),
        "geometry = \"large\"",
    );
    refused(
        model().large_displacements().contact(pair().tresca(1.0)),
        "coulomb",
    );
    let large = || model().large_displacements().contact(pair());
    let coupling = || Coupling::on("right", [1.0, 0.5]);
    let free = coupling().free([true, false]);
    refused(large().coupling(free), "geometry = \"small\"");
    let carries = pair().named("tool");
    let tool = Coupling::of_obstacles("tool", [0.5, 0.0]).fixed();
    let carried = model().large_displacements().contact(carries);
    refused(carried.coupling(tool), "motion = ");
}

/// A case file with all that is for large displacements, and its results: supports carry what contact does, and files say where places are
/// and were.
#[test]
fn a_case_file_and_its_results() {
    let case = case(
        r#"
        [mesh]
        rectangle = { size = [2, 1], cells = [16, 8] }
        [analysis]
        geometry = "large"
        [[material]]
        young = 1
        poisson = 0.3
        law = "neo-hooke"
        [[support]]
        boundary = "bottom"
        rotate = { point = [1, 0], angle = 20 }
        factors = [0, 1]
        [[traction]]
        boundary = "left"
        pressure = 0.01
        [[contact]]
        boundary = "top"
        obstacle = { circle = { center = [1, 2], radius = 1 } }
        motion = { shift = [0, -0.1], rotate = { point = [1, 2], angle = 5 } }
        friction = { coulomb = 0.3 }
        [steps]
        factors = [1, 1.2]
        "#,
    );
    let built: Built = built(&case);
    let analysis = Analysis::from(&built);
    let directory = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    let mut results = Results::new(directory.path(), "Rolled", analysis)
        .unwrap_or_else(|error| panic!("{error}"));
    results.draw();
    let mut engine = Engine::new(&built.problem, Default::default(), |_| {})
        .unwrap_or_else(|error| panic!("{error}"));
    let mut settings = StepSettings::default();
    settings.ssnm.tolerance = 1e-9;
    // Twice the moment of a unit of pressure on the left, which its ends determine.
    let mut turned = Vec::new();
    let made = analysis.solve_on(&mut engine, &settings, |event| {
        if let Event::Ends(step) = event {
            let data = step.data.expect("of a model");
            let moved = data.unknowns.displacements(&step.solution.u);
            let square = |node: usize| {
                let x = plus(built.elastic.mesh.nodes[node], moved[node]);
                x[0] * x[0] + x[1] * x[1]
            };
            turned.push(square(0) - square(8 * 17));
            results.add(&step).unwrap_or_else(|error| panic!("{error}"));
        }
        ControlFlow::Continue(())
    });
    made.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(built.elastic.mesh.nodes[8 * 17], [0.0, 1.0]);
    results.finish().unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(results.report.status, Some(Status::Converged));
    for (step, turned) in results.report.steps.iter().zip(turned) {
        assert!(
            step.iterations.is_some_and(|count| count <= 20),
            "{:?}",
            step.iterations
        );
        let load = step.total_load.as_ref().expect("a model has loads");
        for c in 0..2 {
            let rest = step.contacts[0].force[c] + step.supports[0].force[c] + load[c];
            assert!(rest.abs() < 1e-8, "{rest}");
        }
        // About the origin, of the body where it is.
        let about =
            |[x, y]: [f64; 2], force: &[f64], moment: f64| moment + x * force[1] - y * force[0];
        let (contact, support) = (&step.contacts[0], &step.supports[0]);
        let at = |centre: &[f64]| [centre[0], centre[1]];
        let rest = about(at(&contact.centre), &contact.force, contact.moment[0])
            + about(at(&support.centre), &support.force, support.moment[0])
            + 0.005 * step.factor * turned;
        assert!(rest.abs() < 1e-8, "{rest}");
        assert!(step.contacts[0].normal_force > 0.01);
    }
    let table = directory.path().join("contact-002.csv");
    let table = std::fs::read_to_string(table).unwrap_or_else(|error| panic!("{error}"));
    let head = table.lines().next().expect("a head");
    assert!(head.ends_with("place,rest_x,rest_y"), "{head}");
    let columns = head.split(',').count();
    assert!(table.lines().all(|line| line.split(',').count() == columns));
}

/// A stack near tipping: Newton's method may run so far that a stiffness leaves the range of numbers, which is no fault of the case.
#[test]
fn a_stack_near_tipping_is_no_error() {
    let part = |name: &str, at: &str, size: &str, cells: &str| {
        format!(
            "[[mesh.part]]\nname = \"{name}\"\nrectangle = {{ origin = [{at}], size = [{size}], cells = [{cells}] }}\n"
        )
    };
    let parts = part("A", "0, 0", "1.65, 1.483", "2, 3")
        + &part("B", "0.08, 1.484383872356124", "0.503, 0.512", "2, 3")
        + &part("C", "0.02, 1.996", "0.935, 0.778", "2, 2");
    let materials = [
        ("A", 5000, "neo-hooke"),
        ("B", 1000, "neo-hooke"),
        ("C", 5000, "st-venant-kirchhoff"),
    ];
    let materials = materials.map(|(region, young, law)| {
        format!(
            "[[material]]\nregion = \"{region}\"\nyoung = {young}\npoisson = 0\nlaw = \"{law}\"\n"
        )
    });
    let text = parts
        + &materials.concat()
        + r#"
        [analysis]
        plane = "plane_stress"
        geometry = "large"
        [steps]
        factors = [1, 1]
        [[support]]
        boundary = "A-bottom"
        x = 0
        y = 0
        [[contact]]
        boundary = "A-top"
        against = "B-bottom"
        friction = { coulomb = 0.2 }
        [[tie]]
        boundary = "C-bottom"
        against = "B-top"
        [[traction]]
        boundary = "C-top"
        force = [1.5, -18]
        [[traction]]
        boundary = "C-right"
        force = [-1.96625544994612, 0]
        factors = [0.694, 1]
        [[traction]]
        boundary = "A-left"
        pressure = 1.943814047376744
        factors = [1.14, -0.736]
        "#;
    let steps = built(&case(&text)).solve(&on_the_cpu(1e-6, Stiffness::Cholesky));
    let steps = steps.unwrap_or_else(|error| panic!("{error}"));
    let last = steps.last().expect("a step").status;
    assert!(
        matches!(
            last,
            Status::Converged | Status::Stagnated | Status::NotHeld
        ),
        "{last:?}"
    );
}
