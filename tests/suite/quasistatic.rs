//! Mortar rows, load steps, bodies held by contact only, moving tools.

use crate::common::or_panic::OrPanic as _;
use crate::common::{
    Random, Solved, built, case, distance, price_of_coulomb, solve_case, solve_case_twice,
};
use signorini::case::Case;
use signorini::contact::{PairOptions, mortar_contact};
use signorini::dual::DirectDual;
use signorini::elasticity::{Body, Material, Plane};
use signorini::mesh::structured::{CellShape, join, rectangle};
use signorini::model::Analysis;
use signorini::output::NodeStatus;
use signorini::problem::ContactProblem;
use signorini::quasistatic::{self, Event, Load, State};
use signorini::ssnm::Status;
use std::ops::ControlFlow;
use std::path::Path;

/// On random curved boundaries of two bodies: weights add up to one, and on straight ones linear functions
/// are transferred exactly.
#[test]
fn mortar_weights_reproduce_linear_fields() {
    let mut random = Random(7);
    for round in 0..60 {
        let cells = |random: &mut Random| [1 + random.below(12), 1 + random.below(3)];
        let (below, above) = (cells(&mut random), cells(&mut random));
        let mut low = rectangle(
            [0.0, -1.0],
            [2.0, 1.0],
            below,
            CellShape::Quad,
            "low",
            "low-",
        );
        let overhang = if round % 3 == 0 { 0.4 } else { 0.0 };
        let mut up = rectangle(
            [overhang, 0.0],
            [2.0, 1.0],
            above,
            CellShape::Triangle,
            "up",
            "up-",
        );
        // Uneven nodes along the interface, and a common curve under both.
        let bend = if round % 2 == 0 { 0.0 } else { 0.1 };
        let crooked = random.between(0.0, 0.1);
        for x in &mut low.nodes {
            x[0] += crooked * (std::f64::consts::PI * x[0]).sin();
        }
        let angle = random.between(0.0, 6.0);
        for x in low.nodes.iter_mut().chain(&mut up.nodes) {
            x[1] -= bend * (x[0] - 1.0).powi(2);
            *x = [
                x[0] * angle.cos() - x[1] * angle.sin(),
                x[0] * angle.sin() + x[1] * angle.cos(),
            ];
        }
        let mesh = join(low, up);
        let materials = [Material::new(1.0, 0.3); 2];
        let body = Body {
            mesh: &mesh,
            materials: &materials,
            plane: Plane::PlaneStrain,
            thickness: 2.0,
        };
        let options = PairOptions {
            adjust: 0.2,
            ..Default::default()
        };
        for (first, second) in [("up-bottom", "low-top"), ("low-top", "up-bottom")] {
            let nodes = mortar_contact(
                &body,
                &mesh.boundaries[first],
                &mesh.boundaries[second],
                &options,
            )
            .unwrap_or_else(|error| panic!("round {round}: {error}"))
            .places;
            for node in &nodes {
                let sum: f64 = node.partners.iter().map(|p| p.1).sum();
                assert!((sum - 1.0).abs() < 1e-12, "round {round}: {sum}");
                assert!(node.area > 0.0 && node.gap >= 0.0);
                let tangent = node.frame[1];
                let along = |x: [f64; 2]| x[0] * tangent[0] + x[1] * tangent[1];
                let partners = node.partners.iter();
                let there: f64 = partners
                    .map(|p| p.1 * along(mesh.nodes[p.0 as usize]))
                    .sum();
                assert!((there - along(node.place)).abs() < 1e-11, "round {round}");
            }
            // The area is that of the facing parts.
            let area: f64 = nodes.iter().map(|n| n.area).sum();
            if bend == 0.0 {
                assert!((area - 2.0 * (2.0 - overhang)).abs() < 1e-9, "{area}");
            }
        }
    }
}

#[test]
fn boundaries_that_cannot_meet_are_explained() {
    let text = |extra: &str, shift: &str| {
        format!(
            "[[mesh.part]]\nname = \"low\"\nrectangle = {{ size = [2, 1], cells = [4, 2] }}\n\
             [[mesh.part]]\nname = \"up\"\nrectangle = {{ size = [2, 1], cells = [4, 2] }}\nshift = {shift}\n\
             [[material]]\nyoung = 1e3\npoisson = 0.3\n[[support]]\nboundary = \"low-bottom\"\nx = 0\ny = 0\n\
             [[support]]\nboundary = \"up-top\"\nx = 0\ny = -0.01\n[[contact]]\nboundary = \"up-bottom\"\n{extra}\n"
        )
    };
    let error = |extra: &str, shift: &str| {
        let case = case(&text(extra, shift));
        match case.build() {
            Ok(_) => panic!("accepted: {extra}"),
            Err(error) => error.to_string(),
        }
    };
    let against = "against = \"low-top\"";
    assert!(error(against, "[0, 3]").contains("at least 2.000e0 apart"));
    assert!(
        error("against = \"low-top\"\nsearch_distance = 0.01", "[0, 1.1]")
            .contains("search_distance")
    );
    // Facing away.
    assert!(error("against = \"low-bottom\"", "[0, 1]").contains("no part of it faces"));
    assert!(error(against, "[0, 0.9]").contains("overlap by 1.000e-1"));
    assert!(error("against = \"low-top\"\ngap = -0.1", "[0, 1]").contains("the gap is -0.1 at"));
    assert!(error("against = \"up-left\"", "[0, 1]").contains("belongs to both boundaries"));
    assert!(error("against = \"low_top\"", "[0, 1]").contains("did you mean \"low-top\"?"));
    // An overlap may be declared touching, or be given a gap.
    for extra in ["adjust = 0.1", "gap = 0.002"] {
        let solved = solve_case_twice(&text(&format!("{against}\n{extra}"), "[0, 0.9]"), 1e-9);
        let fields = solved.fields();
        assert!(fields.pressure.iter().all(|&p| p > 0.0), "{extra}");
    }
}

/// A bar on a Tresca foundation, loaded and unloaded: half of the displacement stays, and against the full
/// reverse load it is the negative (Masing's rule).
#[test]
fn unloading_leaves_half() {
    let (h, g, p) = (0.02, 10.0, 40.0);
    let text = |factors: &str| {
        // Pressed on the foundation all the time.
        let always = format!("[1{}]", ", 1".repeat(factors.matches(',').count()));
        format!(
            "[mesh]\nrectangle = {{ size = [6, {h}], cells = [200, 2] }}\n[analysis]\nplane = \"plane_stress\"\n\
             [[material]]\nyoung = 1e6\npoisson = 0\n[[support]]\nboundary = \"left\"\nx = 0\n\
             [[support]]\nboundary = \"top\"\ny = -1e-6\nfactors = {always}\n\
             [[traction]]\nboundary = \"right\"\nx = {}\n\
             [[contact]]\nboundary = \"bottom\"\nfriction = {{ tresca = {g} }}\n\
             obstacle = {{ half_plane = {{ point = [0, 0], normal = [0, 1] }} }}\n[steps]\nfactors = {factors}\n",
            p / h
        )
    };
    let end = |solved: &Solved| solved.displacement()[solved.node_at([6.0, 0.5 * h])][0];
    let full = end(&solve_case(&text("[1]"), 1e-9));
    assert!((full / 0.004 - 1.0).abs() < 0.01);
    // The result is the same in one step or in four, because the load only grows.
    let grown = solve_case_twice(&text("[0.25, 0.5, 0.75, 1]"), 1e-9);
    assert!((end(&grown) / full - 1.0).abs() < 1e-3);
    let unloaded = end(&solve_case_twice(&text("[1, 0]"), 1e-9));
    assert!((unloaded / full - 0.5).abs() < 0.01, "{unloaded} {full}");
    let reversed = end(&solve_case_twice(&text("[1, 0, -1]"), 1e-9));
    assert!((reversed / full + 1.0).abs() < 0.01, "{reversed} {full}");
    // A step in which nothing changes changes nothing.
    let again = solve_case_twice(&text("[1, 0, 0]"), 1e-9);
    assert!((end(&again) / unloaded - 1.0).abs() < 1e-5);
}

/// A tool without a free node is pushed down on a block and then drawn sideways: friction pulls the block along.
#[test]
fn a_moving_tool_drags_the_block() {
    let text = |mu: f64| {
        format!(
            "[[mesh.part]]\nname = \"low\"\nrectangle = {{ size = [2, 1], cells = [8, 4] }}\n\
             [[mesh.part]]\nname = \"tool\"\nrectangle = {{ size = [3, 0.2], cells = [5, 1] }}\nshift = [-0.5, 1]\n\
             [[material]]\nyoung = 1e3\npoisson = 0\n[[support]]\nboundary = \"low-bottom\"\nx = 0\ny = 0\n\
             [[support]]\nboundary = \"tool-top\"\ny = -0.02\nfactors = [1, 1]\n\
             [[support]]\nboundary = \"tool-top\"\nx = 0.05\n[[support]]\nboundary = \"tool-bottom\"\nx = 0.05\n\
             [[contact]]\nboundary = \"low-top\"\nagainst = \"tool-bottom\"\nfriction = {{ coulomb = {mu} }}\n\
             [steps]\nfactors = [0, 1]\n"
        )
    };
    // The tool's lower side is free in y, held in x: partners that are held in part.
    let stick = solve_case_twice(&text(10.0), 1e-10);
    let m = stick.build.problem.m();
    // The far end of the sheared block lifts off, the rest goes with the tool.
    let sticking: Vec<usize> = (0..m)
        .filter(|&i| stick.fields().status[i] == NodeStatus::Stick)
        .collect();
    assert!(sticking.len() > m / 2, "{} of {m}", sticking.len());
    for i in sticking {
        let displacement = stick.displacement();
        let [x, _] = stick.elastic().contact.places[i].mean(|node| displacement[node as usize]);
        assert!((x - 0.05).abs() < 1e-6, "{x}");
    }
    let slip = solve_case_twice(&text(0.1), 1e-8);
    let fields = slip.fields();
    let slipping = (0..m)
        .filter(|&i| fields.status[i] == NodeStatus::Slip)
        .count();
    assert!(slipping > m / 2, "{slipping} of {m}");
    for i in 0..m {
        // The block stays behind the tool, and the tool pulls it along: τ points along −x on top.
        assert!(fields.slip[i] * fields.traction[i] <= 1e-12);
        let bound = 0.1 * fields.pressure[i];
        assert!(fields.traction[i].abs() <= bound * (1.0 + 1e-4) + 1e-9);
    }
    let force: f64 = slip.solution().lambda[..m].iter().sum();
    let drag: f64 = slip.solution().lambda[m..].iter().map(|l| l.abs()).sum();
    assert!((drag / force - 0.1).abs() < 0.02, "{drag} {force}");
}

/// A disc between two plates without its own supports; a motion that contact does not hold is reported.
#[test]
fn bodies_that_only_contact_holds() {
    let text = |load: &str, top: &str| {
        format!(
            "[[mesh.part]]\nname = \"low\"\nrectangle = {{ size = [3, 0.5], cells = [24, 4] }}\nshift = [-1.5, -0.5]\n\
             [[mesh.part]]\nname = \"roller\"\nrectangle = {{ origin = [-1, -1], size = [2, 2], cells = [20, 20], \
             map = [\"x*sqrt(1 - y^2/2)\", \"1 + y*sqrt(1 - x^2/2)\"] }}\n\
             [[mesh.part]]\nname = \"up\"\nrectangle = {{ size = [3, 0.5], cells = [20, 4] }}\nshift = [-1.5, 2]\n\
             [[material]]\nyoung = 1e3\npoisson = 0.3\n[[support]]\nboundary = \"low-bottom\"\nx = 0\ny = 0\n\
             [[support]]\nboundary = \"up-top\"\nx = 0\n{top}\n{load}\n\
             [[contact]]\nboundary = \"roller-bottom\"\nagainst = \"low-top\"\nfriction = {{ coulomb = 0.3 }}\n\
             [[contact]]\nboundary = \"roller-top\"\nagainst = \"up-bottom\"\nfriction = {{ coulomb = 0.3 }}\n"
        )
    };
    let squeezed = solve_case_twice(&text("", "y = -0.02"), 1e-8);
    assert_eq!(squeezed.build.problem.floating_bodies().n_modes(), 3);
    assert!(squeezed.solution().last().info.kkt.max() < 1e-7);
    // The plates carry the same force.
    let elastic = squeezed.elastic();
    let lambda = &squeezed.solution().lambda;
    let force = |pair: u32| -> f64 {
        (0..elastic.pair_of.len())
            .filter(|&i| elastic.pair_of[i] == pair)
            .map(|i| {
                let node = &elastic.contact.places[i];
                lambda[i] * node.frame[0][1] + lambda[i + elastic.pair_of.len()] * node.frame[1][1]
            })
            .sum()
    };
    assert!(force(1) > 1.0, "{}", force(1));
    assert!(
        (force(0) / force(1) + 1.0).abs() < 1e-5,
        "{} {}",
        force(0),
        force(1)
    );
    // The upper plate free in y as well, pressed down: two bodies float.
    let pressed = solve_case_twice(
        &text("[[traction]]\nboundary = \"up-top\"\npressure = 3", ""),
        1e-8,
    );
    assert_eq!(pressed.build.problem.floating_bodies().bodies().len(), 2);
    // The guide holds x along a line: the plate may still rise and turn.
    assert_eq!(pressed.build.problem.floating_bodies().n_modes(), 5);
    // Pulled up it has nothing to hold it: no panic, no false success.
    let case = case(&text(
        "[[traction]]\nboundary = \"up-top\"\npressure = -3",
        "",
    ));
    let build = built(&case);
    let mut dual = DirectDual::new(&build.problem).or_panic();
    let data = build.step(0).or_panic();
    let solution = quasistatic::solve_step(
        &build.problem,
        &data.load,
        &State::at_rest(&build.problem),
        &mut dual,
        &case.settings(),
        &mut Default::default(),
        |_| ControlFlow::Continue(()),
    )
    .or_panic();
    assert_eq!(solution.status, Status::NotHeld);
    let [up] = &solution.not_held[..] else {
        panic!("{:?}", solution.not_held);
    };
    assert!(Analysis::from(&build).body_name(up.body).contains("\"up\""));
    // Each of its motions that lift it everywhere does work: it slides, or turns about a point beside it on the line of its guide.
    let about = |way: &str| -> Option<f64> {
        let place = up.motion.strip_prefix(way)?.strip_suffix(", 2.5000e0)")?;
        place.parse().ok()
    };
    let lifts = up.motion == "slides along (0.000, 1.000)"
        || about("rotates counter-clockwise about (").is_some_and(|x| x < -1.5)
        || about("rotates clockwise about (").is_some_and(|x| x > 1.5);
    assert!(lifts, "{}", up.motion);
}

/// The weight of a soft block rests on the floor, however a stiff body beside it moves.
#[test]
fn the_weight_of_a_soft_body_beside_a_stiff_one() {
    let text = |moved: f64| {
        format!(
            "[[mesh.part]]\nname = \"pad\"\nrectangle = {{ size = [0.2, 0.04], cells = [40, 8] }}\n\
             [[mesh.part]]\nname = \"beam\"\nrectangle = {{ origin = [1, 0], size = [0.2, 0.04], cells = [20, 4] }}\n\
             [[material]]\nregion = \"pad\"\nyoung = 5e6\npoisson = 0.3\n\
             [[material]]\nregion = \"beam\"\nyoung = 2.1e11\npoisson = 0.3\n\
             [[body_force]]\nregion = \"pad\"\ny = -5e5\n\
             [[support]]\nboundary = \"pad-left\"\nx = 0\n\
             [[support]]\nboundary = \"beam-left\"\nx = 0\ny = 0\n\
             [[support]]\nboundary = \"beam-right\"\ny = {moved}\n\
             [[contact]]\nboundary = \"pad-bottom\"\n\
             obstacle = {{ half_plane = {{ point = [0, 0], normal = [0, 1] }} }}\n"
        )
    };
    for moved in [0.0, 1e-3] {
        let solved = solve_case_twice(&text(moved), 1e-8);
        let force: f64 = solved.solution().lambda[..solved.build.problem.m()]
            .iter()
            .sum();
        assert!(
            (force / 4000.0 - 1.0).abs() < 1e-5,
            "moved {moved}: {force}"
        );
    }
}

/// Slip bounds that are given again and again, each time those of the last pressures, come to the same (Nečas, Jarušek and
/// Haslinger 1980).
#[test]
fn a_fixed_point_of_slip_bounds_comes_to_the_same() {
    let text = "[mesh]\nrectangle = { size = [0.04, 0.04], cells = [48, 48] }\n\
        [[material]]\nyoung = 1.3e11\npoisson = 0.2\n\
        [[support]]\nboundary = \"right\"\nx = 0\n[[support]]\npoint = [0.04, 0]\ny = 0\n\
        [[traction]]\nboundary = \"left\"\npressure = 15e7\n[[traction]]\nboundary = \"top\"\npressure = 5e7\n\
        [[contact]]\nboundary = \"bottom\"\nfriction = { coulomb = 1 }\n\
        obstacle = { half_plane = { point = [0, 0], normal = [0, 1] } }\n";
    let case = case(text);
    let problem = built(&case).problem;
    let mut dual = DirectDual::new(&problem).or_panic();
    let mut settings = case.settings();
    settings.ssnm.tolerance = 1e-9;
    let mut run = |problem: &ContactProblem| {
        let solution = quasistatic::solve_step(
            problem,
            &Load::of(problem),
            &State::at_rest(problem),
            &mut dual,
            &settings,
            &mut Default::default(),
            |_| ControlFlow::Continue(()),
        )
        .or_panic();
        assert_eq!(solution.status, Status::Converged);
        solution
    };
    let coupled = run(&problem);
    assert_eq!(coupled.rounds.len(), 1);
    let (mut bounds, mut products) = (vec![0.0; problem.m()], 0);
    let end = loop {
        let (force, gap) = (problem.load().to_vec(), problem.gap().to_vec());
        let given = (problem.with_data(force, gap, problem.slip_origin().to_vec(), bounds.clone()))
            .and_then(|problem| problem.with_friction_coefficient(Vec::new()))
            .or_panic();
        let solution = run(&given);
        products += solution.n_a();
        let next = problem.bounds(&solution.lambda).into_owned();
        let most = next.iter().copied().fold(0.0, f64::max);
        let change = next.iter().zip(&bounds).map(|(a, b)| (a - b).abs());
        if change.fold(0.0, f64::max) < 1e-8 * most {
            break solution;
        }
        bounds = next;
    };
    assert!(distance(&end.u, &coupled.u) < 1e-7);
    assert!(2 * coupled.n_a() < products, "{} {products}", coupled.n_a());
    // |λτ| ≤ μλν holds with the λν at the end.
    let (normal, tangential) = coupled.lambda.split_at(problem.m());
    let top = normal.iter().copied().fold(0.0, f64::max);
    for (n, t) in normal.iter().zip(tangential) {
        assert!(t.abs() <= n + 1e-6 * top);
    }
}

/// Coulomb friction costs as much as given slip bounds, in every template.
#[test]
fn coulomb_at_the_price_of_tresca() {
    for (name, most) in [
        ("examples/dovetail", 80),
        ("examples/roller", 80),
        ("examples/shear", 250),
        ("examples/stack", 120),
        ("benches/two-bodies", 35),
    ] {
        let path = format!("{name}.toml");
        let case = Case::read(Path::new(&path), &[]).or_panic();
        print!("{name}: ");
        let [coulomb, tresca] = price_of_coulomb(&case, 1e-6);
        assert!(coulomb <= most, "{name}: {coulomb} products");
        assert!(
            10 * coulomb <= 13 * tresca,
            "{name}: {coulomb} products, {tresca} with given bounds"
        );
    }
}

/// A body comes down on the floor across any gap, a step may remove the whole load again, and a load that contact bears
/// at once, without any displacement, counts as solved.
#[test]
fn gaps_are_crossed_and_loads_taken_away() {
    let text = |gap: f64, moved: f64, factors: &str| {
        format!(
            "[mesh.rectangle]\norigin = [0, {gap}]\nsize = [1, 1]\ncells = [6, 6]\n\
             [[material]]\nyoung = 2e11\npoisson = 0.3\n[[support]]\nboundary = \"left\"\nx = {moved}\n\
             [[traction]]\nboundary = \"top\"\ny = -1e4\n\
             [[contact]]\nboundary = \"bottom\"\nfriction = {{ coulomb = 0.2 }}\n\
             obstacle = {{ half_plane = {{ point = [0, 0], normal = [0, 1] }} }}\n[steps]\nfactors = {factors}\n"
        )
    };
    for (gap, moved) in [(1e-3, 1e-6), (0.1, 0.0), (0.0, 0.0)] {
        let solved = solve_case_twice(&text(gap, moved, "[1]"), 1e-7);
        let m = solved.build.problem.m();
        let force: f64 = solved.solution().lambda[..m].iter().sum();
        assert!((force / 1e4 - 1.0).abs() < 1e-4, "gap {gap}: {force}");
    }
    let empty = solve_case(&text(0.0, 0.0, "[0.5, 1, 0]"), 1e-7);
    let m = empty.build.problem.m();
    let force: f64 = empty.solution().lambda[..m].iter().sum();
    assert!(force < 1.0, "{force}");
    let still = "[mesh.rectangle]\nsize = [2, 1]\ncells = [1, 1]\n[[material]]\nyoung = 1e9\npoisson = 0.3\n\
        [[support]]\nboundary = \"top\"\nx = 0\ny = 0\n[[traction]]\nboundary = \"right\"\ny = -1e6\n\
        [[contact]]\nboundary = \"bottom\"\nfriction = { tresca = 1e5 }\n\
        obstacle = { half_plane = { point = [0, 0], normal = [0, 1] } }\n";
    let solved = solve_case(still, 1e-6);
    let force: f64 = solved.solution().lambda[..solved.build.problem.m()]
        .iter()
        .sum();
    assert!((force / 5e5 - 1.0).abs() < 1e-6, "{force}");
}

/// Partly supported bodies that friction cannot hold, although larger pressures, which nothing presses on, could:
/// μλν is that of the pressures there are. And a block on a slope without friction, pressed straight against it.
#[test]
fn friction_is_that_of_the_pressures_there_are() {
    let solve = |text: &str| {
        let case = case(text);
        let build = built(&case);
        let mut dual = DirectDual::new(&build.problem).or_panic();
        let data = build.step(0).or_panic();
        let load = data.load;
        let start = State::at_rest(&build.problem);
        let go_on = |_: Event| ControlFlow::Continue(());
        quasistatic::solve_step(
            &build.problem,
            &load,
            &start,
            &mut dual,
            &case.settings(),
            &mut Default::default(),
            go_on,
        )
        .or_panic()
    };
    let block = |support: &str, push: f64| {
        format!(
            "[mesh.rectangle]\nsize = [1, 1]\ncells = [4, 4]\n[[material]]\nyoung = 1e6\npoisson = 0.3\n\
             [[contact]]\nboundary = \"bottom\"\nfriction = {{ coulomb = 0.1 }}\n\
             obstacle = {{ half_plane = {{ point = [0, 0], normal = [0, 1] }} }}\n[[support]]\n{support}\n\
             [[traction]]\nboundary = \"right\"\nx = {push}\n[[traction]]\nboundary = \"top\"\ny = -1\n"
        )
    };
    for (support, push, held) in [
        ("point = [0, 1]\ny = 0", 2.7, false),
        ("boundary = \"top\"\ny = -1e-3", 900.0, false),
        ("boundary = \"top\"\ny = -1e-3", 50.0, true),
        ("point = [0, 1]\nx = 0\ny = 0", 2.7, false),
    ] {
        let solution = solve(&block(support, push));
        let expected = if held {
            Status::Converged
        } else {
            Status::NotHeld
        };
        assert_eq!(solution.status, expected, "{support}, {push}");
        assert_eq!(solution.not_held.len(), usize::from(!held));
    }
    let (sin, cos) = (0.5_f64, 0.75_f64.sqrt());
    let slope = format!(
        "[analysis]\ngravity = [{}, {}]\n[mesh.rectangle]\nsize = [1, 0.5]\ncells = [60, 30]\n\
         map = [\"{cos}*x - {sin}*y\", \"{sin}*x + {cos}*y\"]\n\
         [[material]]\nyoung = 1e9\npoisson = 0.3\ndensity = 6377.4\n[[contact]]\nboundary = \"bottom\"\n\
         obstacle = {{ half_plane = {{ point = [0, 0], normal = [{}, {cos}] }} }}\n",
        10.0 * sin,
        -10.0 * cos,
        -sin
    );
    assert_eq!(solve(&slope).status, Status::Converged);
}
