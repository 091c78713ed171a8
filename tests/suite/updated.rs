//! Engines that switch to another problem: they give the same results as new engines, and set up no more than
//! necessary.

use crate::common::or_panic::OrPanic as _;
use signorini::contact::{Obstacle, Space};
use signorini::dual::DualOperator as _;
use signorini::elasticity::Material;
use signorini::engine::{Device, Engine, EngineOptions, SetUps, Stiffness};
use signorini::mesh::structured::{CellShape, SolidShape, block, rectangle};
use signorini::mesh::{ElementKind, Mesh, Topology};
use signorini::model::{Model, Pair, Support, Traction};
use signorini::problem::{ContactData, ContactProblem};
use signorini::quasistatic::{StepSettings, StepSolution};
use signorini::sparse::{BlockCsr, Csr, norm};
use signorini::ssnm::Status;

/// Half of the elements become a second region.
fn in_halves<const D: usize>(mut mesh: Mesh<D>) -> Mesh<D>
where
    ElementKind: Topology<D>,
{
    mesh.regions.push("second".to_owned());
    mesh.groups.insert("second".to_owned(), vec![1]);
    let (half, nodes) = (mesh.nodes.len() / 2, &mesh.nodes);
    let middle = nodes[half][D - 1];
    for element in &mut mesh.elements {
        let lowest = (element.nodes().iter()).map(|&i| nodes[i as usize][D - 1]);
        element.region = u32::from(lowest.fold(f64::INFINITY, f64::min) >= middle);
    }
    mesh
}

/// A block of two layers, with these Young's moduli, pressed and pushed on a floor.
fn pressed<const D: usize>(mesh: Mesh<D>, floor: Obstacle<D>, young: [f64; 2]) -> ContactProblem<D>
where
    ElementKind: Space<D>,
{
    let model = Model::on(in_halves(mesh))
        .material_in("body", Material::new(young[0], 0.3))
        .material_in("second", Material::new(young[1], 0.3))
        .support(Support::on("left").fixed())
        .traction(Traction::on("top").pressure(100.0))
        .contact(Pair::obstacle("bottom", floor).coulomb(0.3));
    model.build().or_panic().problem
}

/// The one in the plane, on a floor with the given slope.
pub fn plane(cells: [usize; 2], young: [f64; 2], slope: f64) -> ContactProblem {
    let mesh = rectangle([0.0; 2], [3.0, 1.0], cells, CellShape::Quad, "body", "");
    let floor = Obstacle::HalfSpace {
        point: [0.0, -1e-4],
        normal: [slope, 1.0],
    };
    pressed(mesh, floor, young)
}

/// The same in space.
pub fn space(cells: [usize; 3], young: [f64; 2], slope: f64) -> ContactProblem<3> {
    let shape = SolidShape::Hexahedron;
    let mesh = block([0.0; 3], [3.0, 1.0, 1.0], cells, shape, "body", "");
    let floor = Obstacle::HalfSpace {
        point: [0.0, 0.0, -1e-4],
        normal: [slope, 0.0, 1.0],
    };
    pressed(mesh, floor, young)
}

fn solved<const D: usize>(problem: &ContactProblem<D>, engine: &mut Engine) -> StepSolution<D>
where
    ElementKind: Space<D>,
{
    let mut settings = StepSettings::default();
    settings.ssnm.tolerance = 1e-8;
    let solution = problem.solve_on(engine, &settings).or_panic();
    assert_eq!(solution.status, Status::Converged);
    solution
}

/// One engine for all, beside one for each.
pub fn check<const D: usize>(
    made: impl Fn([f64; 2], f64) -> ContactProblem<D>,
    options: &EngineOptions,
) where
    ElementKind: Space<D>,
{
    let engine = |problem: &_| Engine::new(problem, options.clone(), |_| {}).or_panic();
    let first = made([1e5, 1e5], 0.0);
    let mut kept = engine(&first);
    solved(&first, &mut kept);
    // Up to `more` iterations than with its own hierarchy: aggregates are those of the earlier ties.
    let beside = |problem: &ContactProblem<D>, kept: &mut Engine, more: usize, what: &str| {
        kept.update(problem).or_panic();
        let mut fresh = engine(problem);
        let [found, expected] = [&mut *kept, &mut fresh].map(|engine| solved(problem, engine));
        let off: Vec<f64> = (found.lambda.iter().zip(&expected.lambda))
            .map(|(a, b)| a - b)
            .collect();
        let part = norm(&off) / norm(&expected.lambda);
        assert!(part < 1e-6, "{what}: {part:e}");
        let [kept, fresh] =
            [kept, &mut fresh].map(|engine| engine.linear_iterations(1e-8).or_panic());
        assert!(
            kept.is_none()
                || kept
                    .zip(fresh)
                    .is_some_and(|(kept, fresh)| kept.abs_diff(fresh) <= more),
            "{what}: {kept:?} iterations, {fresh:?} with an engine of its own"
        );
    };
    for (young, more) in [([7e5, 7e5], 1), ([2e5, 1e5], 1), ([1e5, 3e6], 3)] {
        beside(&made(young, 0.0), &mut kept, more, &format!("{young:?}"));
    }
    // Entries that cancel in a uniform body do not where two materials meet: the factor, which has no places for zeros, may be
    // ordered once more for these.
    let most = 1 + usize::from(options.stiffness == Stiffness::Cholesky);
    let SetUps {
        made: set_ups,
        renewed,
    } = kept.set_ups();
    assert!(
        set_ups <= most && set_ups + renewed == 4,
        "{:?}",
        kept.set_ups()
    );
    // Other rows on the present K; the load of gravity and supports alike.
    let last = made([1e5, 3e6], 0.0);
    kept.update(&last).or_panic();
    let other = made([1e5, 3e6], 1e-4);
    let (n, t) = (other.normal().clone(), other.tangential().clone());
    let bounds = vec![1.0; other.m()];
    let tilted = (last.with_contact(n, t, other.gap().to_vec(), bounds)).or_panic();
    beside(&tilted, &mut kept, 3, "other rows");
    // And only some of them.
    let m = last.m() / 2;
    let few = |rows: &Csr, each: usize| {
        let kept = rows.triplets().filter(|(i, ..)| *i < each * m);
        Csr::from_triplets(each * m, rows.n_cols(), kept)
    };
    let (n, t) = (few(last.normal(), 1), few(last.tangential(), D - 1));
    let half = (last.with_contact(n, t, vec![0.0; m], vec![0.5; m])).or_panic();
    beside(&half, &mut kept, 3, "fewer rows");
    let (made, renewed) = (set_ups, renewed + 1);
    assert_eq!(kept.set_ups(), SetUps { made, renewed });
}

#[test]
fn an_engine_switches_to_another_problem() {
    for (stiffness, cells) in [(Stiffness::Cholesky, 12), (Stiffness::Pcg, 40)] {
        let options = EngineOptions {
            place: Device::Cpu,
            stiffness,
            ..Default::default()
        };
        check(
            |young, slope| plane([3 * cells, cells], young, slope),
            &options,
        );
        let q = cells / 4;
        check(|young, slope| space([3 * q, q, q], young, slope), &options);
    }
}

/// Parts that do not fit are set up again, and a failed set-up leaves an engine that fits nothing until an update
/// succeeds.
#[test]
fn parts_that_do_not_fit_are_set_up_again() {
    for stiffness in [Stiffness::Cholesky, Stiffness::Pcg] {
        let options = EngineOptions {
            place: Device::Cpu,
            stiffness,
            ..Default::default()
        };
        let first = plane([30, 10], [1e5; 2], 0.0);
        let mut engine = Engine::new(&first, options, |_| {}).or_panic();
        let finer = plane([36, 12], [1e5; 2], 0.0);
        engine.update(&finer).or_panic();
        solved(&finer, &mut engine);
        let solid = space([6, 4, 4], [1e5; 2], 0.0);
        engine.update(&solid).or_panic();
        solved(&solid, &mut engine);
        let made = 3;
        assert_eq!(engine.set_ups(), SetUps { made, renewed: 0 });
        engine.update(&first).or_panic();
        let (k, m) = (first.stiffness(), first.m());
        // Without its stiffness a node is free: all but its diagonal, which is not positive beyond rounding.
        let triplets = k
            .triplets()
            .map(|(i, j, v)| (i, j, if i == j { 1e-3 * v } else { v }));
        let indefinite = BlockCsr::from_triplets(k.n_rows(), k.n_rows(), triplets);
        let data = ContactData {
            stiffness: indefinite,
            load: first.load().to_vec(),
            normal: first.normal().clone(),
            tangential: first.tangential().clone(),
            gap: vec![1.0; m],
            slip_bound: vec![0.0; m],
            coordinates: first.coordinates().map(<[_]>::to_vec),
        };
        let indefinite = ContactProblem::new(data).or_panic();
        assert!(engine.update(&indefinite).is_err());
        assert!(!engine.fits(&first) && !engine.fits(&indefinite));
        engine.update(&first).or_panic();
        solved(&first, &mut engine);
        assert_eq!(engine.set_ups().made, made + 2);
    }
}
