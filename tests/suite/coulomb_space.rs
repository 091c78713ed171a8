//! Coulomb friction in space: its cost compared with the Tresca problem with its final slip bounds, and whether `converged`
//! solutions obey the law, which code independent of the solver checks here.
//!
//! `cargo test --release --test suite -- --nocapture coulomb_space::` prints the cost of each problem; with `--ignored` it tries
//! finer meshes, longer beams and more random problems.

mod problems;
mod runs;

use crate::common::distance;
use problems::{
    Vector, ball_on_floor, beam, block_on_block, body, case_c, cases_c, cube, driven_ball,
    loaded_as_c, on_floor, random,
};
use runs::{Run, few_products, priced};
use signorini::contact::Obstacle;
use signorini::engine::Stiffness;
use signorini::mesh::structured::{SolidShape, block};
use signorini::model::{BodyForce, Model, Pair, Support, Traction};
use signorini::quasistatic::StepSettings;
use signorini::reference::MATERIAL;
use signorini::ssnm::Status;

#[test]
fn case_c_costs_as_much_as_tresca() {
    few_products(cases_c(&[4, 8, 12]), [60, 80], 1.3);
}

#[test]
#[ignore = "a minute"]
fn case_c_costs_as_much_as_tresca_on_fine_meshes() {
    few_products(cases_c(&[16, 24]), [100, 130], 1.3);
}

#[test]
fn gaps_elements_and_materials_do_not_matter() {
    let mut all = Vec::new();
    let nu = MATERIAL.poisson;
    for mu in [0.1, 0.3, 0.6, 1.0] {
        let loaded = |shape, nu| loaded_as_c(6, shape, nu);
        let hexahedra = || loaded(SolidShape::Hexahedron, nu);
        let gap = on_floor(mu).gap(|x: Vector| 2e-5 * x[0] * x[1]);
        all.push((format!("gap, mu = {mu}"), hexahedra().contact(gap)));
        for shape in [SolidShape::Tetrahedron, SolidShape::Wedge] {
            let name = format!("{shape:?}, mu = {mu}");
            all.push((name, loaded(shape, nu).contact(on_floor(mu))));
        }
    }
    let varies = |x: Vector| 0.05 + 0.5 * (1.0 + (7.0 * x[0] + 5.0 * x[1]).sin());
    let blocks = loaded_as_c(8, SolidShape::Hexahedron, nu);
    all.push(("mu varies".to_owned(), blocks.contact(on_floor(varies))));
    few_products(all, [75, 90], 1.3);
}

#[test]
fn nearly_incompressible_blocks() {
    let all = [0.1, 0.3, 0.6, 1.0].map(|mu| {
        let model = loaded_as_c(8, SolidShape::Hexahedron, 0.49).contact(on_floor(mu));
        (format!("nu = 0.49, mu = {mu}"), model)
    });
    few_products(all, [80, 130], 1.3);
}

#[test]
fn every_beta_converges() {
    for beta in [0.01, 0.1, 20.0, 1000.0] {
        let mut settings = StepSettings::default();
        settings.ssnm.beta = beta;
        let run = Run::new(case_c(4, 0.6), Stiffness::Cholesky, &settings);
        println!("beta = {beta}: {} products", run.products());
        assert!(run.products() <= 120, "{}", run.products());
        run.check("case C");
    }
}

#[test]
fn slender_beams() {
    let all = [0.2, 0.4, 1.0, 1.6].map(|mu| (format!("beam 10, mu = {mu}"), beam(10.0, mu)));
    few_products(all, [80, 160], 1.3);
}

#[test]
#[ignore = "hard ones"]
fn longer_beams() {
    let all = [0.2, 0.4, 1.0, 1.6].map(|mu| (format!("beam 20, mu = {mu}"), beam(20.0, mu)));
    few_products(all, [300, 500], 4.0);
}

#[test]
fn free_cubes_are_held_by_friction() {
    let mut all = Vec::new();
    for mu in [0.1, 0.3] {
        for (part, twist) in [(0.2, 0.0), (0.5, 0.3), (0.8, 0.0), (0.85, 0.1), (0.0, 1.0)] {
            let name = format!("cube, mu = {mu}, pull {part}, twist {twist}");
            all.push((name, cube(6, mu, part, twist)));
        }
    }
    few_products(all, [40, 55], 1.4);
}

/// A ball touches in a few nodes; separated nodes bear no friction, and must not hinder convergence.
#[test]
fn balls_on_the_floor() {
    for n in [4, 8, 12] {
        for push in [0.0, 0.3] {
            let name = format!("ball of {n}, pushed {push}");
            let [coulomb, _] = priced(&name, ball_on_floor(n, 0.3, push));
            assert!(coulomb[2] <= 30, "{name}: {coulomb:?}");
        }
    }
}

/// Pressed, sheared, sheared another way, and relieved.
#[test]
fn load_steps_follow_the_slip() {
    for mu in [0.2, 0.6] {
        let [coulomb, given] = priced(&format!("driven ball, mu = {mu}"), driven_ball(8, mu));
        assert!(
            coulomb[2] as f64 <= 1.5 * given[2] as f64,
            "{coulomb:?} {given:?}"
        );
        let [by_factor, by_pcg] = [Stiffness::Cholesky, Stiffness::Pcg].map(|stiffness| {
            let run = Run::new(driven_ball(6, mu), stiffness, &StepSettings::default());
            run.check("driven ball");
            run
        });
        assert!(distance(&by_factor.last().u, &by_pcg.last().u) < 1e-4);
    }
}

#[test]
fn two_bodies_rub_on_each_other() {
    let mut all = Vec::new();
    for (mu, part, twist) in [(0.3, 0.3, 0.0), (0.3, 0.6, 0.3), (0.6, 0.2, 0.5)] {
        let name = format!("blocks, mu = {mu}, pull {part}, twist {twist}");
        all.push((name, block_on_block(5, mu, part, twist)));
    }
    few_products(all, [75, 90], 1.4);
    let [by_factor, by_pcg] = [Stiffness::Cholesky, Stiffness::Pcg].map(|stiffness| {
        let run = Run::new(
            block_on_block(4, 0.3, 0.5, 0.2),
            stiffness,
            &StepSettings::default(),
        );
        run.check("blocks");
        run
    });
    assert!(distance(&by_factor.last().u, &by_pcg.last().u) < 1e-4);
}

/// A load that friction cannot hold is reported at once, with the direction of the motion.
#[test]
fn sliding_bodies_are_not_held() {
    let not_held = |model: Model<3>| {
        let run = Run::new(model, Stiffness::Cholesky, &StepSettings::default());
        let step = run.last();
        assert_eq!(step.status, Status::NotHeld);
        // One for the gradient there, and no step.
        assert!(step.n_a() <= 1 && step.iter() == 0, "{}", step.n_a());
        assert!(step.not_held.len() == 1 && step.not_held[0].proven);
        step.not_held[0].motion.clone()
    };
    let slides = not_held(cube(4, 0.3, 1.5, 0.0));
    assert!(slides.starts_with("slides along (0.85"), "{slides}");
    // About the edge that it is pulled over, though it is pulled sideways as well.
    let tips = not_held(cube(4, 0.8, 0.8, 0.0));
    let edge = "rotates about the axis through (1.0000e0, 5.0000e-1, ";
    assert!(tips.starts_with(edge), "{tips}");
    assert!(tips.ends_with("along (0.000, 1.000, 0.000)"), "{tips}");
    let turns = not_held(cube(4, 0.1, 0.0, 6.0));
    assert!(turns.contains("along (0.000, 0.000, 1.000)"), "{turns}");
}

/// A cube turned about the vertical: forces on its corners alone would hold a twist of 4.24 μ, the actual pressures hold
/// about 2.3 μ (a uniform one 2.296). Between the two there is no proof, but an answer.
#[test]
fn bodies_turned_beyond_friction_are_not_held() {
    for stiffness in [Stiffness::Cholesky, Stiffness::Pcg] {
        let turned = |twist: f64| {
            let run = Run::new(
                cube(4, 0.3, 0.0, twist),
                stiffness,
                &StepSettings::default(),
            );
            let step = run.last();
            (step.status, step.not_held.clone(), step.n_a())
        };
        let (status, _, held) = turned(2.2);
        assert_eq!(status, Status::Converged);
        for twist in [2.4, 3.0, 4.2] {
            let (status, bodies, products) = turned(twist);
            assert_eq!(status, Status::NotHeld, "{twist}");
            let [body] = &bodies[..] else {
                panic!("{bodies:?}");
            };
            assert!(!body.proven);
            let axis = "rotates about the axis through (5.0000e-1, 5.0000e-1, ";
            assert!(body.motion.starts_with(axis), "{}", body.motion);
            // By PCG the first solve has more accurate products at its end.
            let most = if stiffness == Stiffness::Pcg { 12 } else { 8 };
            assert!(products <= most * held, "{products} against {held}");
        }
        let (status, bodies, _) = turned(4.4);
        assert_eq!(status, Status::NotHeld);
        assert!(bodies[0].proven);
    }
}

/// A column guided along one side, that comes down on a slope with one corner: under a given bound its other nodes rub there
/// without any pressure, and balancing it must not press them.
#[test]
fn nodes_rub_without_pressure_on_a_slope() {
    for slope in [[-0.139, 0.188], [0.27, 0.21], [0.1, -0.3]] {
        let corner = slope.map(|s: f64| if s < 0.0 { 1.0 } else { 0.0 });
        let plane = Obstacle::HalfSpace {
            point: [corner[0], 2.0 * corner[1], 0.0],
            normal: [slope[0], slope[1], 1.0],
        };
        let mesh = block(
            [0.0; 3],
            [1.0, 2.0, 4.0],
            [1, 2, 4],
            SolidShape::Hexahedron,
            "body",
            "",
        );
        let model = body(mesh, 0.3)
            .support(Support::on("front").x(0.0).y(0.0))
            .traction(
                Traction::on("top")
                    .x(-1e3)
                    .z(|x: Vector| -4e5 * (1.0 + 0.5 * (6.0 * x[0]).sin())),
            )
            .contact(Pair::obstacle("bottom", plane).tresca(4e4));
        let run = Run::new(model, Stiffness::Cholesky, &StepSettings::default());
        let step = run.last();
        assert_eq!(step.status, Status::Converged, "{slope:?}");
        assert!(step.iter() <= 12, "{}", step.iter());
        let m = step.slip_bound.len();
        let rubs = |i: usize| {
            step.lambda[i] == 0.0 && step.lambda[m + 2 * i].hypot(step.lambda[m + 2 * i + 1]) > 0.0
        };
        assert!((0..m).any(rubs), "{slope:?}");
    }
}

/// A block balanced on the top of a rigid ball: nothing turns it, on either path.
#[test]
fn a_block_on_a_ball_stays_upright() {
    let model = |cells: usize| {
        let ball = Obstacle::Sphere {
            center: [0.5, 0.5, -2.0],
            radius: 2.0,
        };
        let mesh = block(
            [0.0; 3],
            [1.0; 3],
            [cells; 3],
            SolidShape::Hexahedron,
            "body",
            "",
        );
        body(mesh, MATERIAL.poisson)
            .body_force(BodyForce::everywhere().z(-1e6))
            .contact(Pair::obstacle("bottom", ball).coulomb(0.3))
    };
    for cells in [4, 6] {
        let [by_factor, by_pcg] = [Stiffness::Cholesky, Stiffness::Pcg].map(|stiffness| {
            let run = Run::new(model(cells), stiffness, &StepSettings::default());
            run.check("block on a ball");
            run
        });
        let apart = distance(&by_pcg.last().u, &by_factor.last().u);
        println!("{cells} cells: {apart:e}");
        assert!(apart < 1e-4, "{apart:e}");
    }
}

fn random_problems(seeds: std::ops::Range<u64>) {
    let (mut converged, mut total, mut open) = (0, 0_usize, Vec::new());
    let mut products = 0;
    for seed in seeds {
        let (name, model) = random(seed);
        let run = Run::new(model, Stiffness::Cholesky, &StepSettings::default());
        for (number, step) in run.steps.iter().enumerate() {
            total += 1;
            products += step.n_a();
            match step.status {
                Status::Converged => {
                    converged += 1;
                    run.check_step(&name, number);
                }
                Status::NotHeld => {}
                _ => open.push(format!(
                    "{name}, step {number}: {:?} {:?}",
                    step.status, step.kkt
                )),
            }
            if step.n_a() > 150 {
                println!(
                    "{name}, step {number}: {:?} {} products, {} solves",
                    step.status,
                    step.n_a(),
                    step.rounds.len()
                );
            }
        }
    }
    println!("{converged} of {total} converged, {products} products; open: {open:#?}");
    // A block relieved between a wall and a floor that is steeper than one in one.
    assert!(open.len() <= total.div_ceil(80), "{open:#?}");
}

#[test]
fn random_blocks() {
    random_problems(0..60);
}

#[test]
#[ignore = "minutes"]
fn more_random_blocks() {
    random_problems(60..600);
}
