//! Valid pairs of contact: supports that drive contact nodes, corners, lists of boundaries, distances.

use crate::common::models::{answer, on_the_cpu};
use crate::common::or_panic::OrPanic as _;
use crate::common::solved::{built, solve_case};
use crate::common::{Solved, case, distance, solve_case_twice};
use signorini::contact::Obstacle;
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::structured::{self, SolidShape};
use signorini::model::{Model, Pair, Support, Traction};
use signorini::output::{ContactFields, NodeStatus};
use signorini::ssnm::Status;

const ROCK: &str = "[[material]]\nyoung = 1e9\npoisson = 0.3\n";

fn run(text: &str) -> Solved {
    solve_case_twice(text, 1e-9)
}

fn error(text: &str) -> String {
    match case(text).build() {
        Ok(_) => panic!("this was accepted:\n{text}"),
        Err(error) => error.to_string(),
    }
}

/// The resultant of the contact forces on the bodies of the boundaries named first.
fn resultant(solved: &Solved) -> [f64; 2] {
    let m = solved.build.problem.m();
    let lambda = &solved.solution().lambda;
    let mut sum = [0.0; 2];
    for (i, node) in solved.elastic().contact.places.iter().enumerate() {
        for c in 0..2 {
            sum[c] -= lambda[i] * node.frame[0][c] + lambda[m + i] * node.frame[1][c];
        }
    }
    sum
}

/// A block on a floor, 1 m wide and half as high.
fn block(supports: &str, contacts: &str) -> String {
    format!("[mesh.rectangle]\nsize = [1, 0.5]\ncells = [8, 4]\n{ROCK}{supports}{contacts}")
}

fn support(boundary: &str, x: Option<f64>, y: Option<f64>) -> String {
    let line = |name: &str, value: Option<f64>| {
        value.map_or(String::new(), |value| format!("{name} = {value:e}\n"))
    };
    format!(
        "[[support]]\nboundary = {boundary}\n{}{}",
        line("x", x),
        line("y", y)
    )
}

fn on_floor(boundary: &str, height: f64, more: &str) -> String {
    format!(
        "[[contact]]\nboundary = {boundary}\n\
         obstacle = {{ half_plane = {{ point = [0, {height}], normal = [0, 1] }} }}\n{more}"
    )
}

#[test]
fn a_support_cannot_drive_a_node_into_a_floor() {
    // All of the bottom, or one of its corners by a support of the side.
    for held in ["\"bottom\"", "\"left\""] {
        let at = |y| {
            block(
                &support(held, Some(0.0), Some(y)),
                &on_floor("\"bottom\"", -0.005, ""),
            )
        };
        if held == "\"left\"" {
            // It may go as far as the floor, and not a hundredth of the way further.
            run(&at(-0.005));
            let message = error(&at(-0.00505));
            assert!(message.contains("5.000e-5 into"), "{message}");
        }
        let message = error(&at(-0.01));
        assert!(message.contains("line 7"), "{message}");
        assert!(
            message.contains("drive the node at (0.000000e0, 0.000000e0) 5.000e-3 into"),
            "{message}"
        );
    }
    // In a later step, before the first is solved.
    let text = block(
        &support("\"left\"", Some(0.0), Some(-0.01)),
        &on_floor("\"bottom\"", -0.005, ""),
    ) + "[steps]\nfactors = [0.1, 0.2, 1]\n";
    let message = error(&text);
    assert!(message.contains("load step 3"), "{message}");
}

/// A clamped end slides along an inclined floor: what is left of its motion across that is rounding, whether the motion is
/// stated along the axes, along the floor, or twice.
#[test]
fn a_support_may_drive_nodes_along_an_inclined_floor() {
    for number in 0..60 {
        let angle = 0.1 * f64::from(number);
        let (sin, cos) = angle.sin_cos();
        let turned = |x: [f64; 2]| [cos * x[0] - sin * x[1], sin * x[0] + cos * x[1]];
        let mut mesh = structured::rectangle(
            [0.0; 2],
            [1.5, 1.0],
            [3, 2],
            structured::CellShape::Quad,
            "body",
            "",
        );
        mesh.nodes.iter_mut().for_each(|x| *x = turned(*x));
        let floor = Obstacle::HalfSpace {
            point: [0.0; 2],
            normal: [-sin, cos],
        };
        let model = Model::on(mesh)
            .material(Material::new(1e4, 0.3))
            .traction(Traction::on("top").pressure(10.0))
            .contact(Pair::obstacle("bottom", floor).coulomb(0.2));
        let along_axes = Support::on("left").x(1e-4 * cos).y(1e-4 * sin);
        let along_floor = Support::on("left")
            .directed([[cos, sin], [-sin, cos]])
            .x(1e-4)
            .y(0.0);
        let twice = Support::on("left").x(1e-4 * cos + 1e-20).y(1e-4 * sin);
        for all in [
            vec![along_axes.clone()],
            vec![along_floor],
            vec![along_axes, twice],
        ] {
            let model = all.into_iter().fold(model.clone(), Model::support);
            model.build().or_panic();
        }
    }
    // One value is the rounding of zero. The value of another support shows the size of that rounding.
    let text = block(
        &(support("\"left\"", Some(1e-20), None) + &support("\"left\"", Some(0.0), Some(-1e-3))),
        &on_floor("\"bottom\"", -0.005, ""),
    );
    case(&text).build().or_panic();
}

/// A place that has no other side has an infinite gap after loading, too, and hints leave it out.
#[test]
fn infinite_gaps_stay_infinite() {
    for (gap, hint) in [
        (f64::INFINITY, "every gap is infinite"),
        (0.5, "the least gap left is"),
    ] {
        let mesh = structured::rectangle(
            [0.0; 2],
            [2.0, 1.0],
            [4, 2],
            structured::CellShape::Quad,
            "body",
            "",
        );
        let floor = Obstacle::HalfSpace {
            point: [0.0; 2],
            normal: [0.0, 1.0],
        };
        let far = move |x: [f64; 2]| if x[0] < 0.9 { f64::INFINITY } else { gap };
        let model = Model::on(mesh)
            .material(Material::new(1e4, 0.3))
            .support(Support::on("left").x(0.0).y(0.0))
            .traction(Traction::on("right").y(-1.0))
            .contact(Pair::obstacle("bottom", floor).gap(far));
        let found = answer(model, 1e-9, Stiffness::Cholesky);
        let fields = ContactFields::new(
            &found.built.problem,
            &found.built.elastic,
            &found.data,
            &found.solution,
        );
        for (place, gap) in found.built.elastic.contact.places.iter().zip(fields.gap) {
            assert_eq!(gap.is_infinite(), far(place.place).is_infinite(), "{gap}");
        }
        let hints = found.hints();
        assert!(hints.iter().any(|told| told.contains(hint)), "{hints:?}");
        assert!(hints.iter().all(|told| !told.contains("e140")), "{hints:?}");
    }
}

/// A punch with its sides held and driven down, on a block: its corners are contact nodes that cannot move.
fn punch(first: &str, second: &str, fine: usize, friction: &str) -> [f64; 2] {
    let text = format!(
        "[[mesh.part]]\nname = \"die\"\nrectangle = {{ size = [3, 1], cells = [{}, {}] }}\n\
         [[mesh.part]]\nname = \"punch\"\nrectangle = {{ size = [0.6, 0.4], cells = [{}, {}] }}\nshift = [1.2, 1]\n\
         {ROCK}{}{}\
         [[contact]]\nboundary = \"{first}\"\nagainst = \"{second}\"\nfriction = {friction}\n",
        24 * fine,
        8 * fine,
        5 * fine,
        4 * fine,
        support("\"die-bottom\"", Some(0.0), Some(0.0)),
        support("[\"punch-left\", \"punch-right\"]", Some(1e-4), Some(-1e-3)),
    );
    let force = resultant(&run(&text));
    if first == "die-top" {
        force
    } else {
        force.map(|f| -f)
    }
}

#[test]
fn it_matters_little_which_side_is_named_first_where_supports_hold_corners() {
    for friction in ["\"none\"", "{ coulomb = 0.4 }"] {
        let mut before = f64::INFINITY;
        for fine in [2, 4, 8] {
            let a = punch("die-top", "punch-bottom", fine, friction);
            let b = punch("punch-bottom", "die-top", fine, friction);
            let off = ((a[0] - b[0]).hypot(a[1] - b[1])) / a[0].hypot(a[1]);
            println!("{friction}, {fine}: {a:?} {b:?}, off by {off:.4}");
            // The edges of a held punch are singular: forces settle slowly as the mesh is refined, from above where its
            // corners are points of the die's facets, from below where they have no forces of their own.
            assert!(off < 0.9 * before, "{off}");
            before = off;
        }
        assert!(before < 0.12, "{before}");
    }
}

#[test]
fn a_side_that_cannot_move_at_all_carries_contact() {
    // All of the punch is driven; its mesh is the coarser one, so that each of its nodes meets unknowns.
    let text = |first: &str, second: &str| {
        format!(
            "[[mesh.part]]\nname = \"die\"\nrectangle = {{ size = [3, 1], cells = [60, 20] }}\n\
             [[mesh.part]]\nname = \"punch\"\nrectangle = {{ size = [0.6, 0.4], cells = [3, 2] }}\nshift = [1.21, 1]\n\
             {ROCK}{}{}[[contact]]\nboundary = \"{first}\"\nagainst = \"{second}\"\n",
            support("\"die-bottom\"", Some(0.0), Some(0.0)),
            support("\"punch-bottom\"", Some(0.0), Some(-1e-3)),
        )
    };
    // Whichever side is named first, the die has the multipliers.
    let a = -resultant(&run(&text("punch-bottom", "die-top")))[1];
    let b = -resultant(&run(&text("die-top", "punch-bottom")))[1];
    assert!(a > 1e5 && a == b, "{a} {b}");
    let fine = text("punch-bottom", "die-top").replace("cells = [3, 2]", "cells = [90, 2]");
    let c = -resultant(&run(&fine))[1];
    assert!((c / b - 1.0).abs() < 0.15, "{c} {b}");
}

#[test]
fn a_box_in_a_corner_rests_on_both_walls() {
    // No supports at all: floor and wall hold the box, each with its own load, and the corner node with both.
    let text = |friction: &str| {
        format!(
            "[mesh.rectangle]\nsize = [1, 0.5]\ncells = [8, 4]\n{ROCK}\
             [[traction]]\nboundary = \"top\"\npressure = 2e6\n[[traction]]\nboundary = \"right\"\npressure = 3e6\n{}\
             [[contact]]\nboundary = \"left\"\nobstacle = {{ half_plane = {{ point = [0, 0], normal = [1, 0] }} }}\n\
             friction = {friction}\n",
            on_floor("\"bottom\"", 0.0, &format!("friction = {friction}\n")),
        )
    };
    let solved = run(&text("\"none\""));
    let fields = solved.fields();
    let elastic = solved.elastic();
    assert_eq!(fields.pressure.len(), 9 + 5);
    for (i, &pair) in elastic.pair_of.iter().enumerate() {
        let expected = [2e6, 3e6][pair as usize];
        assert!((fields.pressure[i] / expected - 1.0).abs() < 1e-6);
        assert_eq!(fields.status[i], NodeStatus::Frictionless);
    }
    for friction in ["{ coulomb = 0.2 }", "{ tresca = 1e5 }"] {
        let solved = run(&text(friction));
        let [x, y] = resultant(&solved);
        assert!(
            (x / 1.5e6 - 1.0).abs() < 1e-6 && (y / 2e6 - 1.0).abs() < 1e-6,
            "{x} {y}"
        );
        assert!(solved.elastic().pairs.iter().all(|pair| pair.kept == 0));
    }
    // Between two bodies the corner keeps its friction: the other side can move.
    let between = format!(
        "[[mesh.part]]\nname = \"box\"\nrectangle = {{ size = [1, 1], cells = [4, 4] }}\n\
         [[mesh.part]]\nname = \"wall\"\nrectangle = {{ size = [1, 1], cells = [3, 3] }}\nshift = [-1, 0]\n\
         [[mesh.part]]\nname = \"floor\"\nrectangle = {{ size = [1, 1], cells = [5, 3] }}\nshift = [0, -1]\n{ROCK}{}{}\
         [[traction]]\nboundary = \"box-top\"\npressure = 2e6\n[[traction]]\nboundary = \"box-right\"\npressure = 3e6\n\
         [[contact]]\nboundary = \"box-left\"\nagainst = \"wall-right\"\nfriction = {{ coulomb = 0.2 }}\n\
         [[contact]]\nboundary = \"box-bottom\"\nagainst = \"floor-top\"\nfriction = {{ coulomb = 0.2 }}\n",
        support("\"wall-left\"", Some(0.0), Some(0.0)),
        support("\"floor-bottom\"", Some(0.0), Some(0.0)),
    );
    let solved = run(&between);
    let [x, y] = resultant(&solved);
    assert!(
        (x / 3e6 - 1.0).abs() < 1e-6 && (y / 2e6 - 1.0).abs() < 1e-6,
        "{x} {y}"
    );
    assert!(solved.elastic().pairs.iter().all(|pair| pair.kept == 0));
}

#[test]
fn contacts_of_a_node_need_normals_that_differ() {
    let twice = |second: &str| {
        block(
            &support("\"top\"", Some(0.0), Some(0.0)),
            &(on_floor("\"bottom\"", 0.0, "") + second),
        )
    };
    let message = error(&twice(&on_floor("\"bottom\"", -0.1, "")));
    assert!(
        message.contains("normals depend on each other"),
        "{message}"
    );
    // A wedge is valid.
    let wedge = "[[contact]]\nboundary = \"bottom\"\nobstacle = { half_plane = { point = [0, 0], normal = [0.3, 1] } }\n";
    run(&twice(wedge));
    // Three directions in the plane are too many.
    let message = error(&twice(&(wedge.to_owned() + &wedge.replace("0.3", "0.6"))));
    assert!(
        message.contains("normals depend on each other"),
        "{message}"
    );
}

#[test]
fn friction_is_never_dropped_in_silence() {
    // All of a boundary between two rigid obstacles. One of them is far away, and takes no friction from the other.
    let ramp = "[[contact]]\nboundary = \"bottom\"\nobstacle = { half_plane = { point = [-1, 0], normal = [0.3, 1] } }\n";
    let driven = support("\"top\"", Some(1e-3), Some(-1e-4));
    for friction in ["{ coulomb = 0.3 }", "{ tresca = 1e4 }"] {
        let floor = on_floor("\"bottom\"", 0.0, &format!("friction = {friction}\n"));
        let [with, without] =
            [ramp, ""].map(|ramp| resultant(&run(&block(&driven, &(floor.clone() + ramp)))));
        assert!(without[0] < -1e3 && (with[0] / without[0] - 1.0).abs() < 1e-5);
    }
    // A side held along the contact with the finer mesh: more tangential forces than the other side has unknowns.
    let text = |first: &str, second: &str| {
        format!(
            "[[mesh.part]]\nname = \"punch\"\nrectangle = {{ origin = [0.25, 1], size = [0.5, 0.5], cells = [6, 6] }}\n\
             [[mesh.part]]\nname = \"die\"\nrectangle = {{ size = [1, 1], cells = [25, 10] }}\n{ROCK}{}{}{}\
             [[contact]]\nboundary = \"{first}\"\nagainst = \"{second}\"\nfriction = {{ coulomb = 0.3 }}\n",
            support("\"die-top\"", Some(0.0), None),
            support("\"punch-top\"", Some(1e-2), Some(-1e-3)),
            support("\"die-bottom\"", Some(0.0), Some(0.0)),
        )
    };
    for (first, second) in [("die-top", "punch-bottom"), ("punch-bottom", "die-top")] {
        let [x, y] = resultant(&run(&text(first, second)));
        assert!((x / y + 0.3).abs() < 1e-3, "{first}: {x} {y}");
    }
}

/// Obstacles that a body does not reach change nothing in a load step that repeats the loads, whatever rounding leaves of their
/// forces.
#[test]
fn open_obstacles_move_nothing_in_a_step_without_change() {
    let of = |cells: &str, top: f64, plane: &str, laws: [&str; 2], second: &str| {
        format!(
            "[mesh.rectangle]\nsize = [2, 0.5]\n{cells}\n{ROCK}[steps]\nfactors = [1, 1]\n\
             [[traction]]\nboundary = \"top\"\ny = {top}\n{}\
             [[contact]]\n{second}\nobstacle = {{ half_plane = {{ {plane} }} }}\nfriction = {{ {} }}\n",
            on_floor(
                "\"bottom\"",
                0.0,
                &format!("friction = {{ {} }}\n", laws[0])
            ),
            laws[1],
        )
    };
    let ramp = "point = [-2.5970247875046132e-5, -9.656886778516492e-5], normal = [0.2597024787504613, 0.9656886778516491]";
    let cases = [
        of(
            "cells = [1, 1]\nshape = \"triangle\"",
            -1704957.186444236,
            ramp,
            ["coulomb = 0.7", "coulomb = 0.2"],
            "boundary = \"bottom\"",
        ),
        of(
            "cells = [1, 3]",
            -1419514.5170390438,
            "point = [-0.001, 0], normal = [1, 0]",
            ["tresca = 1e5", "tresca = 1e4"],
            "boundary = \"left\"",
        ),
    ];
    for text in cases {
        let solved = solve_case(&text, 1e-9);
        let [first, second] = [&solved.steps[0].u, &solved.steps[1].u];
        let off = distance(second, first);
        assert!(off < 1e-6, "{off}: {text}");
    }
}

#[test]
fn symmetry_takes_sides_one_by_one() {
    let text = |supports: &str| block(supports, "[[traction]]\nboundary = \"right\"\nx = 1e6\n");
    let list = run(&text(
        "[[support]]\nboundary = [\"left\", \"bottom\"]\nsymmetry = true\n",
    ));
    let single = run(&text(
        &(support("\"left\"", Some(0.0), None) + &support("\"bottom\"", None, Some(0.0))),
    ));
    assert_eq!(list.displacement(), single.displacement());
}

#[test]
fn boundaries_in_a_list_are_one() {
    let text = |contacts: &str, traction: &str| {
        format!(
            "[[mesh.part]]\nname = \"a\"\nrectangle = {{ size = [1, 1], cells = [4, 4] }}\n\
             [[mesh.part]]\nname = \"b\"\nrectangle = {{ size = [1, 1], cells = [5, 5] }}\nshift = [2, 0]\n{ROCK}{}\
             {traction}{contacts}",
            support("[\"a-left\", \"b-right\"]", Some(0.0), None),
        )
    };
    let one = run(&text(
        &on_floor(
            "[\"a-bottom\", \"b-bottom\"]",
            0.0,
            "friction = { coulomb = 0.1 }\n",
        ),
        "[[traction]]\nboundary = [\"a-top\", \"b-top\"]\npressure = 1e6\n",
    ));
    let two = run(&text(
        &["a-bottom", "b-bottom"]
            .map(|name| {
                on_floor(
                    &format!("\"{name}\""),
                    0.0,
                    "friction = { coulomb = 0.1 }\n",
                )
            })
            .concat(),
        "[[traction]]\nboundary = \"a-top\"\npressure = 1e6\n[[traction]]\nboundary = \"b-top\"\npressure = 1e6\n",
    ));
    assert_eq!(
        (one.elastic().pairs.len(), two.elastic().pairs.len()),
        (1, 2)
    );
    assert_eq!(one.elastic().pairs[0].boundary, "a-bottom, b-bottom");
    assert_eq!(one.build.problem.m(), two.build.problem.m());
    assert!(crate::common::distance(&one.solution().u, &two.solution().u) < 1e-9);

    // A body over two others, which are named in one list.
    let bridge = "[[mesh.part]]\nname = \"a\"\nrectangle = { size = [1, 1], cells = [4, 4] }\n\
         [[mesh.part]]\nname = \"b\"\nrectangle = { size = [1, 1], cells = [5, 5] }\nshift = [2, 0]\n\
         [[mesh.part]]\nname = \"bridge\"\nrectangle = { size = [3, 0.5], cells = [13, 4] }\nshift = [0, 1]\n"
        .to_owned()
        + ROCK
        + &support("[\"a-bottom\", \"b-bottom\"]", Some(0.0), Some(0.0))
        + "[[traction]]\nboundary = \"bridge-top\"\npressure = 1e6\n\
           [[contact]]\nboundary = [\"a-top\", \"b-top\"]\nagainst = [\"bridge-bottom\"]\nfriction = { coulomb = 0.5 }\n";
    let [_, y] = resultant(&run(&bridge));
    assert!((y / -3e6 - 1.0).abs() < 1e-6, "{y}");

    let message = error(&bridge.replace("\"b-top\"]", "\"b-tap\"]"));
    assert!(
        message.contains("b-tap") && message.contains("did you mean \"b-top\""),
        "{message}"
    );
}

#[test]
fn tresca_rubs_only_within_the_search_distance() {
    let text = |height: f64, more: &str| {
        block(
            &support("\"left\"", Some(0.0), Some(0.0)),
            &("[[traction]]\nboundary = \"right\"\nx = 1e6\n".to_owned()
                + &on_floor(
                    "\"bottom\"",
                    height,
                    &format!("friction = {{ tresca = 1e5 }}\n{more}"),
                )),
        )
    };
    let friction = |text: &str| resultant(&run(text))[0];
    assert_eq!(friction(&text(-1000.0, "")), 0.0);
    // The corner that the support holds has none.
    let all = -1e5 * (1.0 - 1.0 / 16.0);
    let wide = friction(&text(-1000.0, "search_distance = 2e3\n"));
    assert!((wide / all - 1.0).abs() < 1e-6, "{wide}");
    // Half the width, by default.
    assert_eq!(friction(&text(-0.51, "")), 0.0);
    let near = friction(&text(-0.49, ""));
    assert!((near / all - 1.0).abs() < 1e-6, "{near}");
    // A node that comes from far away is stopped by the floor nevertheless.
    let falls = block(
        &support("\"top\"", Some(0.0), Some(-3.0)),
        &on_floor("\"bottom\"", -2.9, "friction = { tresca = 1e5 }\n"),
    );
    let solved = run(&falls);
    assert!(resultant(&solved)[1] > 1e6);
    let u = solved.displacement();
    let low = |node: usize| solved.elastic().mesh.nodes[node][1] + u[node][1];
    assert!((0..u.len()).all(|node| low(node) > -2.9 - 1e-9));
}

#[test]
fn inconsistent_entries_are_reported() {
    let circle = "[[contact]]\nboundary = \"bottom\"\nobstacle = { circle = { center = [0.5, 0.2], radius = 3 } }\n";
    let message = error(&block(&support("\"top\"", Some(0.0), Some(0.0)), circle));
    assert!(message.contains("circle from outside"), "{message}");
    let parse = |text: &str| match signorini::case::Case::parse(
        std::path::Path::new("c.toml"),
        text.to_owned(),
        &[],
    ) {
        Ok(_) => panic!("accepted"),
        Err(error) => error.to_string(),
    };
    let itself = block(
        "",
        "[[contact]]\nboundary = \"bottom\"\nagainst = [\"top\", \"bottom\"]\n",
    );
    let message = parse(&itself);
    assert!(message.contains("both sides"), "{message}");
    for name in [
        "contact",
        "tie",
        "equal",
        "force",
        "temperature",
        "mesh.part",
    ] {
        let single = block("", &format!("[{name}]\nboundary = \"bottom\"\n"));
        let message = parse(&single);
        let hint = format!("write [[{name}]], with double brackets");
        assert!(message.contains(&hint), "{message}");
    }
    let matrices = "[algebraic]\nstiffness = \"K\"\nload = \"f\"\nnormal = \"N\"\ntangential = \"T\"\ngap = \"d\"\nslip_bound = \"g\"\n";
    for (name, table) in [
        ("tie", "[[tie]]\nboundary = \"a\"\nagainst = \"b\"\n"),
        ("equal", "[[equal]]\nsets = \"a\"\n"),
        ("analysis", "[analysis]\nthickness = -3\n"),
        ("steps", "[steps]\nfactors = [1]\n"),
    ] {
        let message = parse(&format!("{matrices}{table}"));
        let refusal = format!("line 8: [{name}] has no meaning in an [algebraic] case");
        assert!(message.contains(&refusal), "{message}");
    }
    let message = parse(&block(
        "",
        "[[contact]]\nboundary = []\nagainst = \"top\"\n",
    ));
    assert!(message.contains("list of boundaries is empty"), "{message}");
    let message = parse(&(block("", "") + "[units]\nlength = \"m m\"\n"));
    assert!(message.contains("short name of a unit"), "{message}");
}

/// A spring of 300 mm × 1 mm: its matrix is badly conditioned, and its answer right.
#[test]
fn slender_bodies_are_solved() {
    for (size, cells, load) in [
        ([0.3, 0.001], [1200, 4], 1000.0),
        ([1.5, 0.01], [1500, 10], 2e3),
    ] {
        let text = format!(
            "[analysis]\nplane = \"plane_stress\"\n[mesh.rectangle]\nsize = {size:?}\ncells = {cells:?}\n\
             [[material]]\nyoung = 2e11\npoisson = 0.0\n{}\
             [[traction]]\nboundary = \"top\"\npressure = {load}\n{}",
            support("\"left\"", Some(0.0), Some(0.0)),
            on_floor("\"bottom\"", -10.0, ""),
        );
        let solved = crate::common::solve_case(&text, 1e-6);
        // A cantilever under its load: q l⁴ / 8 E I, and the shear.
        let [l, h]: [f64; 2] = size;
        let bending = load * l.powi(4) / (8.0 * 2e11 * h.powi(3) / 12.0);
        let tip = -solved.displacement()[solved.node_at([l, 0.0])][1];
        assert!((tip / bending - 1.0).abs() < 0.08, "{tip} {bending}");
        // A floor takes the force beyond it.
        let text = text.replace("[0, -10]", &format!("[0, {}]", -0.4 * bending));
        let solved = crate::common::solve_case(&text, 1e-6);
        let tip = -solved.displacement()[solved.node_at([l, 0.0])][1];
        assert!((tip / (0.4 * bending) - 1.0).abs() < 1e-6, "{tip}");
        let kkt = solved.solution().kkt;
        assert!(kkt.max() < 1e-5, "{kkt:?}");
    }
}

/// A block that is drawn over a floor has all of its friction beside a wall that does not act, or that is infinitely far.
#[test]
fn walls_out_of_reach_take_no_friction() {
    for (rest, cells) in [("active = [0]\n", 4), ("gap = inf\n", 1)] {
        let text = format!(
            "[mesh.rectangle]\nsize = [2, 1]\ncells = [{cells}, 2]\n[[material]]\nyoung = 1e5\npoisson = 0\n\
             [steps]\nfactors = [1]\n[[support]]\nboundary = \"top\"\nx = 0.02\ny = -0.001\n\
             [[contact]]\nboundary = \"bottom\"\nfriction = {{ coulomb = 0.3 }}\n\
             obstacle = {{ half_plane = {{ point = [0, 0], normal = [0, 1] }} }}\n\
             [[contact]]\nboundary = \"left\"\n{rest}\
             obstacle = {{ half_plane = {{ point = [0, 0], normal = [1, 0] }} }}\n"
        );
        let [along, across] = resultant(&run(&text));
        assert!((along + 60.0).abs() < 1e-5, "{rest}: {along}");
        assert!((across - 200.0).abs() < 1e-5, "{rest}: {across}");
    }
}

/// In space, where both obstacles touch an edge, friction acts along it, however the scene is turned: a cube that is pressed into a groove
/// of a floor and a smooth wall is drawn along it.
#[test]
fn friction_in_a_groove_is_along_it() {
    for angle in [0.0_f64, 0.3, 0.785] {
        let (sin, cos) = angle.sin_cos();
        let mut mesh = structured::block(
            [0.0; 3],
            [1.0; 3],
            [2, 2, 2],
            SolidShape::Hexahedron,
            "cube",
            "",
        );
        for node in &mut mesh.nodes {
            let [x, y, z] = *node;
            *node = [cos * x - sin * y, sin * x + cos * y, z];
        }
        let half_space = |normal: [f64; 3]| Obstacle::HalfSpace {
            point: [0.0; 3],
            normal,
        };
        let drawn = [0.0, 2e-2];
        let model = Model::on(mesh)
            .material(Material::new(1e5, 0.0))
            .support(
                Support::on("top")
                    .x(cos * drawn[0] - sin * drawn[1])
                    .y(sin * drawn[0] + cos * drawn[1])
                    .z(-1e-3),
            )
            .contact(Pair::obstacle("left", half_space([cos, sin, 0.0])))
            .contact(Pair::obstacle("bottom", half_space([0.0, 0.0, 1.0])).coulomb(0.3));
        let found = answer(model, 1e-9, Stiffness::Cholesky);
        let floor = &found.report().contacts[1];
        let along = -sin * floor.force[0] + cos * floor.force[1];
        let across = cos * floor.force[0] + sin * floor.force[1];
        let limit = 0.3 * floor.normal_force;
        assert!((along + limit).abs() < 1e-6 * limit, "{angle}: {floor:?}");
        assert!(across.abs() < 1e-6 * limit, "{angle}: {floor:?}");
    }
}

/// A plate that nothing but the friction of a floor holds, under loads that come and go: forces at their bounds leave it free to
/// slide in what the steps before have learnt of it, and the next step has to find a way all the same.
#[test]
fn a_free_plate_under_loads_that_come_and_go() {
    let text = "[steps]\nfactors = [0.92, 0.52, 0.98, 0.93, 0.48]\n\
        [[mesh.part]]\nname = \"a\"\nrectangle = { size = [2, 1], cells = [6, 3] }\n\
        [[material]]\nyoung = 1e3\npoisson = 0.3\n\
        [[contact]]\nboundary = \"a-bottom\"\nfriction = { tresca = 2.2677726331710772 }\n\
        obstacle = { half_plane = { point = [0, 0], normal = [0, 1] } }\n\
        [[traction]]\nboundary = \"a-top\"\npressure = 10\n\
        [[traction]]\nboundary = \"a-left\"\nx = 0.7233315396231124\nfactors = [0.526, -0.336, 0.721, 0.16, -0.101]\n\
        [[traction]]\nboundary = \"a-top\"\ny = \"-5*x\"\nfactors = [0.351, 0.237, 0.521, 0.358, 0.022]\n";
    let built = built(&case(text));
    for stiffness in [Stiffness::Cholesky, Stiffness::Pcg] {
        let mut steps = 0;
        for solution in built.solve(&on_the_cpu(1e-6, stiffness)).or_panic() {
            assert_eq!(solution.status, Status::Converged, "{:?}", solution.kkt);
            steps += 1;
        }
        assert_eq!(steps, 5);
    }
}

/// A block that one support holds along x, on a floor without friction: nothing determines where it is along y, and it stays.
#[test]
fn what_nothing_holds_stays() {
    for shape in [SolidShape::Hexahedron, SolidShape::Tetrahedron] {
        let mesh = structured::block([0.0; 3], [2.0, 1.0, 1.0], [5, 4, 2], shape, "block", "");
        let model = Model::on(mesh)
            .material(Material::new(1e9, 0.3))
            .support(Support::on("left").x(0.0))
            .traction(Traction::on("top").z(-1e6))
            .traction(Traction::on("right").z(-3e5))
            .contact(Pair::obstacle(
                "bottom",
                Obstacle::HalfSpace {
                    point: [0.0; 3],
                    normal: [0.0, 0.0, 1.0],
                },
            ));
        for stiffness in [Stiffness::Cholesky, Stiffness::Pcg] {
            let found = answer(model.clone(), 1e-9, stiffness);
            let (u, count) = (&found.solution.u, found.solution.u.len() as f64 / 3.0);
            let most = u.iter().fold(0.0, |most: f64, u| most.max(u.abs()));
            let mean = u.iter().skip(1).step_by(3).sum::<f64>() / count;
            assert!(mean.abs() < 1e-7 * most, "{shape:?}: {mean:e} of {most:e}");
        }
    }
}
