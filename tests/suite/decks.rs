//! Whole decks: against closed forms, against the case files that they become, and refusals. An ignored test compares with
//! CalculiX itself.

use crate::common::or_panic::OrPanic as _;
use signorini::case::{Case, CaseProblem};
use signorini::deck::{self, Deck, DeckError};
use signorini::engine::{Engine, EngineOptions};
use signorini::mesh::{AnyMesh, ElementKind, Topology, msh};
use signorini::model::{Analysis, AnyBuilt, Built};
use signorini::output::ContactFields;
use signorini::solve::Event;
use std::collections::HashMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::Command;

/// The result of a text; other files may be beside it.
pub(crate) fn read(text: &str, beside: &[(&str, &str)], ignored: &[&str]) -> Result<Deck, String> {
    let place = tempfile::tempdir().or_panic();
    for (name, text) in beside.iter().chain(&[("deck.inp", text)]) {
        let path = place.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).or_panic();
        std::fs::write(path, text).or_panic();
    }
    let ignored: Vec<String> = ignored.iter().map(|&name| name.to_owned()).collect();
    let read = deck::read(&place.path().join("deck.inp"), "deck.msh", &ignored);
    let shown = |error: DeckError| {
        let folder = format!("{}/", place.path().display());
        error.to_string().replace(&folder, "")
    };
    read.map_err(shown)
}

/// The equivalent case file.
pub(crate) fn written(deck: &Deck) -> String {
    let case = Case::of_deck(deck.clone(), &[]).or_panic();
    case.text().to_owned()
}

pub(crate) fn built(deck: &Deck) -> CaseProblem {
    let case = Case::of_deck(deck.clone(), &[]).or_panic();
    case.build().or_panic()
}

/// The displacements of the nodes at the end of each load step, three of each.
pub(crate) fn displacements(problem: &CaseProblem) -> Vec<Vec<[f64; 3]>> {
    fn of<const D: usize>(built: &Built<D>) -> Vec<Vec<[f64; 3]>>
    where
        ElementKind: Topology<D> + signorini::contact::Space<D>,
    {
        let solutions = built.solve(&Default::default()).or_panic();
        let of_step = |(step, solution): (usize, &signorini::quasistatic::StepSolution<D>)| {
            let data = built.step(step).or_panic();
            let all = data.unknowns.displacements(&solution.u);
            let three = |u: [f64; D]| std::array::from_fn(|c| u.get(c).copied().unwrap_or(0.0));
            all.into_iter().map(three).collect()
        };
        solutions.iter().enumerate().map(of_step).collect()
    }
    let CaseProblem::Elastic(built) = problem else {
        panic!("no bodies");
    };
    match &**built {
        AnyBuilt::Plane(built) => of(built),
        AnyBuilt::Space(built) => of(built),
    }
}

/// A strip 4 by 1 of four squares; nodes 1 to 5 below, 11 to 15 above, node 99 of none.
const STRIP: &str = "*HEADING\nA strip\n*NODE, NSET=Nall\n1,0,0\n2,1,0\n3,2,0\n4,3,0\n5,4,0\n\
    11,0,1\n12,1,1\n13,2,1\n14,3,1\n15,4,1\n99,7,7\n\
    *ELEMENT, TYPE=CPS4, ELSET=Eall\n1,1,2,12,11\n2,2,3,13,12\n3,3,4,14,13\n4,4,5,15,14\n\
    *NSET, NSET=Nleft\n1,11\n*NSET, NSET=Nright\n5,15\n\
    *SURFACE, NAME=Send\n4,S2\n*SURFACE, NAME=Sbelow\nEall,S1\n";

pub(crate) fn material(nu: f64) -> String {
    format!(
        "*MATERIAL, NAME=soft\n*ELASTIC\n200., {nu}\n*DENSITY\n3.\n*SOLID SECTION, ELSET=Eall, MATERIAL=soft\n0.5\n"
    )
}

pub(crate) fn strip(rest: &str) -> String {
    let held = "*BOUNDARY\nNleft,1\n1,2\n";
    format!("{STRIP}{}{held}{rest}", material(0.0))
}

pub(crate) const STATIC: &str = "*STEP\n*STATIC\n1.,1.\n";

/// Every kind of load against u = ∫ N / (E A) of a bar with A = 0.5.
#[test]
fn loads_pull_a_bar_as_they_should() {
    let area_young = 0.5 * 200.0;
    type Expected = fn(f64) -> f64;
    let loads: [(&str, Expected); 6] = [
        // 2 × 5 N at the end, by a set and by numbers.
        ("*CLOAD\nNright,1,5.\n", |x| 10.0 * x),
        ("*CLOAD\n5,1,5.\n15,1,5.\n", |x| 10.0 * x),
        // −(−20) Pa on 1 × 0.5.
        ("*DLOAD\n4,P2,-20.\n", |x| 10.0 * x),
        ("*DSLOAD\nSend,P,-20.\n", |x| 10.0 * x),
        // ρ g A = 3 · 2 · 0.5 along x.
        ("*DLOAD\nEall,GRAV,2.,1.,0.,0.\n", |x| {
            3.0 * (4.0 * x - x * x / 2.0)
        }),
        // ρ ω² A x about the middle of the left end: linear elements are exact at nodes.
        ("*DLOAD\nEall,CENTRIF,2.,0.,0.5,0.,0.,0.,1.\n", |x| {
            3.0 * (8.0 * x - x.powi(3) / 6.0)
        }),
    ];
    for (load, expected) in loads {
        let deck = read(&strip(&format!("{STATIC}{load}*END STEP\n")), &[], &[]).or_panic();
        assert_eq!(
            deck.node_numbers,
            [1, 2, 3, 4, 5, 11, 12, 13, 14, 15],
            "in the order of the file"
        );
        let u = displacements(&built(&deck)).remove(0);
        for (&number, u) in deck.node_numbers.iter().zip(u) {
            let x = ((number - 1) % 10) as f64;
            let expected = expected(x) / area_young;
            assert!(
                (u[0] - expected).abs() < 1e-12,
                "{load}: {} at {x}, not {expected}",
                u[0]
            );
        }
    }
}

/// Loads that one step states on the same thing add up, however they are named; a later step replaces them.
#[test]
fn loads_of_a_step_add_up() {
    let twice = |load: &str| format!("{load}{}", &load[load.find('\n').expect("a line") + 1..]);
    for load in [
        "*CLOAD\nNright,1,5.\n",
        "*CLOAD\n5,1,5.\n15,1,5.\n",
        "*DLOAD\n4,P2,-20.\n",
        "*DSLOAD\nSend,P,-20.\n",
    ] {
        let (once, both) = (load.to_owned(), twice(load));
        let cards = format!("{load}{load}");
        let swings = format!(
            "{load}*AMPLITUDE, NAME=half\n0,0,1,0.5\n{}",
            load.replacen('\n', ", AMPLITUDE=half\n", 1)
        );
        let new = load.replacen('\n', ", OP=NEW\n", 1);
        let steps: String = [
            &once,
            &both,
            &cards,
            &once,
            &format!("{new}{load}"),
            &new,
            &swings,
        ]
        .map(|loads| format!("{STATIC}{loads}*END STEP\n"))
        .concat();
        let deck = read(&strip(&steps), &[], &[]).or_panic();
        let ends: Vec<f64> = displacements(&built(&deck))
            .iter()
            .map(|u| u[4][0] / 0.4)
            .collect();
        let expected = [1.0, 2.0, 2.0, 1.0, 2.0, 1.0, 1.5];
        assert!(
            ends.len() == 7 && ends.iter().zip(expected).all(|(u, e)| (u - e).abs() < 1e-9),
            "{load}: {ends:?}"
        );
    }
    let all = "*CLOAD\nNright,1,5.\n5,1,5.\n15,1,5.\n*DLOAD\n4,P2,-20.\n*DSLOAD\nSend,P,-20.\n";
    let deck = read(&strip(&format!("{STATIC}{all}*END STEP\n")), &[], &[]).or_panic();
    let u = displacements(&built(&deck)).remove(0);
    assert!((u[4][0] - 4.0 * 0.4).abs() < 1e-9, "{:?}", u[4]);
}

/// Steps, amplitudes and OP=NEW: loads grow linearly over a step, those with an amplitude follow it.
#[test]
fn steps_and_amplitudes_are_load_steps() {
    let text = strip(
        "*AMPLITUDE, NAME=saw\n0.,0.,0.5,1.,1.,0.5\n\
         *STEP\n*STATIC\n0.1,1.\n*CLOAD\nNright,1,5.\n*CLOAD, AMPLITUDE=saw\nNright,2,2.\n*END STEP\n\
         *STEP\n*STATIC\n0.1,2.\n*CLOAD, OP=NEW\n5,1,4.\n15,1,4.\n*END STEP\n",
    );
    let deck = read(&text, &[], &[]).or_panic();
    let CaseProblem::Elastic(made) = built(&deck) else {
        panic!("no bodies");
    };
    let AnyBuilt::Plane(made) = *made else {
        panic!("none of the plane");
    };
    let loads: Vec<[f64; 2]> = (0..made.n_steps())
        .map(|step| made.step(step).or_panic().total_load)
        .collect();
    // The ends of the steps, and the corner of the amplitude.
    assert_eq!(loads, [[5.0, 4.0], [10.0, 2.0], [8.0, 0.0]]);
}

/// A prescribed motion with an amplitude, and one that is kept over a second step.
#[test]
fn prescribed_displacements_follow_the_steps() {
    let text = strip(
        "*STEP\n*STATIC\n*BOUNDARY\nNright,1,1,0.04\n*END STEP\n*STEP\n*STATIC\n*BOUNDARY\nNright,1,1,0.08\n*END STEP\n\
         *STEP\n*STATIC\n*END STEP\n",
    );
    // It is held from the first step on: there is nothing that comes or goes.
    let deck = read(&text, &[], &[]).or_panic();
    let ends: Vec<f64> = displacements(&built(&deck))
        .iter()
        .map(|u| u[2][0])
        .collect();
    for (u, expected) in ends.iter().zip([0.02, 0.04, 0.04]) {
        assert!((u - expected).abs() < 1e-12, "{ends:?}");
    }
    let later = "*STEP\n*STATIC\n*END STEP\n*STEP\n*STATIC\n*BOUNDARY\nNright,1\n*END STEP\n";
    let deck = read(&strip(later), &[], &[]).or_panic();
    let text = written(&deck);
    assert!(text.contains("active = [0.0, 1.0]"), "{text}");
}

/// A support that a step adds begins where its nodes are: corners on the way from there are not in the deck.
#[test]
fn a_support_begins_where_its_nodes_are() {
    let text = |amplitude: &str| {
        strip(&format!(
            "*AMPLITUDE, NAME=saw\n0.,0.,0.5,1.,1.,0.5\n*STEP\n*STATIC\n*CLOAD\nNright,1,5.\n*END STEP\n\
             *STEP\n*STATIC\n*BOUNDARY{amplitude}\nNright,1,1,0.06\n*CLOAD, AMPLITUDE=saw\nNright,2,2.\n*END STEP\n"
        ))
    };
    let error = read(&text(""), &[], &[]).expect_err("corners");
    assert!(error.contains("it begins where its nodes are"), "{error}");
    read(&text(", AMPLITUDE=saw"), &[], &[]).or_panic();
}

/// What holds from the beginning is not stated in a step.
#[test]
fn definitions_belong_before_steps() {
    let text = strip("*STEP\n*STATIC\n*EQUATION\n2\n5,1,1.,15,1,-1.\n*END STEP\n");
    let error = read(&text, &[], &[]).expect_err("in a step");
    assert!(error.contains("*EQUATION in a step"), "{error}");
}

/// Supports that a step clears and states again are those of before; others end, begin, or hold nodes where they are.
#[test]
fn supports_may_be_stated_again() {
    let step = |held: &str, force: f64| {
        format!("{STATIC}*BOUNDARY, OP=NEW\n{held}*CLOAD\n5,1,{force}\n15,1,{force}\n*END STEP\n")
    };
    let text = |steps: &[String]| format!("{STRIP}{}{}", material(0.0), steps.concat());
    let same = text(&[
        step("Nleft,1\n1,2\n", 5.0),
        step("1,1\n11,1\n1,2\n", 10.0),
        step("Nleft,1\n1,2\n", 2.5),
    ]);
    let deck = read(&same, &[], &[]).or_panic();
    for (u, expected) in displacements(&built(&deck)).iter().zip([0.4, 0.8, 0.2]) {
        assert!((u[4][0] - expected).abs() < 1e-12, "{u:?}");
    }
    let changed = text(&[step("Nleft,1\n1,2\n", 5.0), step("Nleft,1\n", 5.0)]);
    // Nothing acts along y.
    let deck = read(&changed, &[], &[]).or_panic();
    for u in displacements(&built(&deck)) {
        assert!((u[4][0] - 0.4).abs() < 1e-9, "{u:?}");
    }
    let all = text(&[step("Nleft,1\n1,2\n", 5.0), step("Nright,1\n5,2\n", 5.0)]);
    let deck = read(&all, &[], &[]).or_panic();
    let made = displacements(&built(&deck));
    assert!((made[0][4][0] - 0.4).abs() < 1e-9, "{made:?}");
    assert!(made[1].iter().all(|u| u[0].abs() < 1e-9), "{made:?}");
    let fixed = format!("{STATIC}*BOUNDARY, FIXED\nNright,1\n*CLOAD, OP=NEW\n*END STEP\n");
    let deck = read(&text(&[step("Nleft,1\n1,2\n", 5.0), fixed]), &[], &[]).or_panic();
    for u in displacements(&built(&deck)) {
        assert!((u[4][0] - 0.4).abs() < 1e-9, "{u:?}");
    }
}

/// Elements with incompatible modes are kept; in a section with other elements, separately.
#[test]
fn incompatible_modes_are_those_of_the_elements() {
    let bent = format!("{STATIC}*CLOAD\n5,1,-2.\n15,1,2.\n*END STEP\n");
    let tip = |text: &str| {
        let deck = read(text, &[], &[]).or_panic();
        let number = written(&deck).matches("incompatible_modes = true").count();
        (displacements(&built(&deck)).remove(0)[4][1], number)
    };
    let plain = strip(&bent);
    // M = 2, E I = 200 · 0.5/12, u = M x²/(2 E I).
    let exact = -2.0 * 16.0 / (2.0 * 200.0 * 0.5 / 12.0);
    let (found, number) = tip(&plain.replace("CPS4", "CPS4I"));
    assert!((found / exact - 1.0).abs() < 1e-9 && number == 1, "{found}");
    let (stiff, number) = tip(&plain);
    assert!((stiff / exact) < 0.7 && number == 0, "{stiff}");
    let both = plain.replace(
        "3,3,4,14,13",
        "*ELEMENT, TYPE=CPS4I, ELSET=Eall\n3,3,4,14,13",
    );
    let (between, number) = tip(&both);
    assert!(
        between < stiff && between > found && number == 1,
        "{between}"
    );
}

/// `--set` changes the order and the size of the mesh of a deck, and nothing else.
#[test]
fn the_mesh_of_a_deck_has_an_order_and_a_size() {
    let pulled = read(
        &strip(&format!("{STATIC}*DLOAD\n4,P2,-20.\n*END STEP\n")),
        &[],
        &[],
    )
    .or_panic();
    let with = |deck: &Deck, setting: &str| {
        let case = Case::of_deck(deck.clone(), &[setting.to_owned()]);
        case.and_then(|case| case.build().map_err(|e| panic!("{e}")))
    };
    let u = displacements(&with(&pulled, "mesh.order=2").or_panic()).remove(0);
    assert!(u.len() == 27 && (u[4][0] - 0.4).abs() < 1e-9, "{u:?}");
    // Twice as long and high, twice the force, half of the stiffness.
    let u = displacements(&with(&pulled, "mesh.scale=2").or_panic()).remove(0);
    assert!((u[4][0] - 0.8).abs() < 1e-9, "{u:?}");
    let error = with(&pulled, "mesh.file=other.msh").expect_err("another mesh");
    assert!(
        error.to_string().contains("a deck has its own mesh"),
        "{error}"
    );
    let forces = read(
        &strip(&format!("{STATIC}*CLOAD\nNright,1,5.\n*END STEP\n")),
        &[],
        &[],
    )
    .or_panic();
    let case = Case::of_deck(forces, &["mesh.order=2".to_owned()]).or_panic();
    let error = case.build().expect_err("a force on each node");
    assert!(
        error.to_string().contains("3 nodes instead of 2"),
        "{error}"
    );
}

/// A ring of plane stress under outer pressure, held across the symmetry planes in cylindrical directions:
/// Lamé's solution with quadratic elements.
#[test]
fn transforms_turn_supports() {
    let (inner, outer, n) = (1.0, 2.0, 8);
    let mut nodes = String::new();
    let mut elements = String::new();
    let mut held = String::new();
    for j in 0..=2 * n {
        let angle = std::f64::consts::FRAC_PI_2 * j as f64 / (2 * n) as f64;
        for i in 0..=2 * n {
            let r = inner + (outer - inner) * i as f64 / (2 * n) as f64;
            let number = 1 + i + 100 * j;
            nodes += &format!("{number},{:?},{:?}\n", r * angle.cos(), r * angle.sin());
            if j == 0 || j == 2 * n {
                held += &format!("{number},2\n");
            }
        }
    }
    for j in 0..n {
        for i in 0..n {
            let at = |i: usize, j: usize| 1 + i + 100 * j;
            let (i, j) = (2 * i, 2 * j);
            let corners = [at(i, j), at(i + 2, j), at(i + 2, j + 2), at(i, j + 2)];
            let middles = [
                at(i + 1, j),
                at(i + 2, j + 1),
                at(i + 1, j + 2),
                at(i, j + 1),
            ];
            let all: Vec<String> = corners
                .iter()
                .chain(&middles)
                .map(usize::to_string)
                .collect();
            elements += &format!("{},{}\n", 1 + i + 100 * j, all.join(","));
        }
    }
    let pressed: String = (0..n)
        .map(|j| format!("{},P2,3.\n", 1 + 2 * (n - 1) + 200 * j))
        .collect();
    let text = format!(
        "*NODE,NSET=Nall\n{nodes}*ELEMENT,TYPE=CPS8,ELSET=Eall\n{elements}*TRANSFORM,NSET=Nall,TYPE=C\n0,0,0,0,0,1\n\
         *BOUNDARY\n{held}*MATERIAL,NAME=el\n*ELASTIC\n1000.,0.3\n*SOLID SECTION,ELSET=Eall,MATERIAL=el\n\
         {STATIC}*DLOAD\n{pressed}*END STEP\n"
    );
    // Only nodes of elements stay: midside nodes of no element are dropped.
    let deck = read(&text, &[], &[]).or_panic();
    let u = displacements(&built(&deck)).remove(0);
    let at = |number: u64| {
        let place = deck.node_numbers.iter().position(|&one| one == number);
        u[place.expect("one of the mesh")]
    };
    // u(r) for p outside: −p b² ((1 − ν) r + (1 + ν) a² / r) / (E (b² − a²)).
    let exact = |r: f64| -3.0 * 4.0 * (0.7 * r + 1.3 / r) / (1000.0 * 3.0);
    for (number, r) in [(1, 1.0), (1 + 2 * n as u64, 2.0)] {
        let found = at(number)[0];
        assert!(
            (found - exact(r)).abs() < 2e-6 * exact(r).abs(),
            "{found} and {}",
            exact(r)
        );
        assert!(at(number)[1].abs() < 1e-15);
    }
}

/// Equations that make displacements equal: of nodes, sets and chains, and through a node without elements, which is pulled or
/// driven.
#[test]
fn equations_make_displacements_equal() {
    let load = format!("{STATIC}*CLOAD\n5,1,10.\n*END STEP\n");
    let on_bare = format!("{STATIC}*CLOAD\n99,1,10.\n*END STEP\n");
    let driven = format!("{STATIC}*BOUNDARY\n99,1,1,0.4\n*END STEP\n");
    let shared = format!("{STATIC}*CLOAD\n99,1,7.\n15,1,3.\n*END STEP\n");
    for (equation, steps) in [
        ("2\n15,1,1.,5,1,-1.\n", &load),
        // Two lines for the terms, and two equations.
        (
            "2\n15,1,-2.,\n14,1,2.,\n2\n13,2,1.,15,2,-1.\n",
            &String::new(),
        ),
        ("2\nNright,1,1.,99,1,-1.\n", &on_bare),
        ("2\n15,1,1.,5,1,-1.\n2\n99,1,-0.5,15,1,0.5\n", &on_bare),
        ("2\n99,1,1.,15,1,-1.\n2\n5,1,1.,99,1,-1.\n", &driven),
        ("2\nNright,1,1.,99,1,-1.\n", &shared),
    ] {
        if steps.is_empty() {
            let deck = read(&strip(&format!("*EQUATION\n{equation}{load}")), &[], &[]).or_panic();
            for table in [
                "\n[[equal]]\nsets = \"equal-1\"\ndirections = [\"x\"]\n",
                "\n[[equal]]\nsets = \"equal-2\"\ndirections = [\"y\"]\n",
            ] {
                assert!(written(&deck).contains(table), "{}", written(&deck));
            }
            continue;
        }
        let deck = read(&strip(&format!("*EQUATION\n{equation}{steps}")), &[], &[]).or_panic();
        let u = displacements(&built(&deck)).remove(0);
        for (&number, u) in deck.node_numbers.iter().zip(u) {
            let expected = 0.1 * ((number - 1) % 10) as f64;
            assert!((u[0] - expected).abs() < 1e-9, "{equation}: {number} {u:?}");
        }
    }
    // Any other equation holds.
    type Terms = &'static [(u64, usize, f64)];
    let of_right: [(&str, Terms); 4] = [
        ("2\n15,1,1.,5,1,1.\n", &[(15, 0, 1.0), (5, 0, 1.0)]),
        ("2\n15,1,1.,5,2,-1.\n", &[(15, 0, 1.0), (5, 1, -1.0)]),
        (
            "3\n15,1,1.,5,1,-1.,4,1,1.\n",
            &[(15, 0, 1.0), (5, 0, -1.0), (4, 0, 1.0)],
        ),
        ("2\nNright,1,1.,4,1,-2.\n", &[(15, 0, 1.0), (4, 0, -2.0)]),
    ];
    for (equation, terms) in of_right {
        let deck = read(&strip(&format!("*EQUATION\n{equation}{load}")), &[], &[]).or_panic();
        let u = displacements(&built(&deck)).remove(0);
        let at = |number: u64| {
            let here = deck.node_numbers.iter().position(|&other| other == number);
            u[here.expect("it is there")]
        };
        let parts = terms
            .iter()
            .map(|&(number, c, factor)| factor * at(number)[c]);
        let sum: f64 = parts.sum();
        assert!(sum.abs() < 1e-9, "{equation}: {sum}");
        assert!(u.as_flattened().iter().any(|v| v.abs() > 1e-3), "{u:?}");
    }
    let error = read(
        &strip(&format!("*EQUATION\n2\n15,4,1.,5,1,1.\n{load}")),
        &[],
        &[],
    );
    let error = error.expect_err("a rotation");
    assert!(
        error.contains("along x, y and z only") && error.contains("line 39"),
        "{error}"
    );
    for (equation, what) in [
        ("2\n15,1,1.\n", "fewer terms than it announces"),
        ("two\n15,1,1.\n", "\"two\" is not a number of terms"),
        (
            "2\n15,1\n5,1,-1.\n",
            "a node or set, a direction and a factor",
        ),
        ("2\nNall,1,1.,Nright,1,-1.\n", "the same number of nodes"),
    ] {
        let error = read(
            &strip(&format!("*EQUATION\n{equation}{STATIC}*END STEP\n")),
            &[],
            &[],
        );
        let error = error.expect_err(equation);
        assert!(error.contains(what), "{error}");
    }
}

/// Equations with nodes that no element has: what they carry, and where they are driven to; in directions of transforms, between
/// different directions; of the strip whose displacements are 0.1 x under a force of 10.
#[test]
fn equations_through_nodes_without_elements() {
    let load = |what: &str| format!("{STATIC}*CLOAD\n{what}\n*END STEP\n");
    let cell = "*EQUATION\n3\nNright,1,1.,Nleft,1,-1.,99,1,-2.\n";
    let driven = format!(
        "{STATIC}*BOUNDARY\n99,1,1,0.1\n*END STEP\n{STATIC}*BOUNDARY\n99,1,1,0.2\n*END STEP\n"
    );
    for (equations, steps) in [
        // Its work is 20 q = 10 (u − u').
        (cell.to_owned(), load("99,1,20.")),
        (cell.to_owned(), driven),
        // Through a second one, and through one in another direction of its own.
        (format!("*NODE\n98,9,9\n{cell}2\n98,2,3.,99,1,1.\n"), load("98,2,-60.")),
        (
            format!(
                "*NODE\n98,9,9\n*NSET,NSET=N98\n98\n*TRANSFORM,NSET=N98,TYPE=R\n0,1,0,-1,0,0\n{cell}2\n98,2,3.,99,1,1.\n"
            ),
            load("98,2,-60."),
        ),
        // Each side follows the same one, a pair and not.
        (
            "*EQUATION\n2\nNright,1,1.,99,1,-1.\n2\n99,1,1.,4,1,-1.\n2\n99,1,1.,14,1,-1.25\n".to_owned(),
            String::new(),
        ),
        // The direction 2 here is −x.
        (
            "*TRANSFORM,NSET=Nright,TYPE=R\n0,1,0,-1,0,0\n*EQUATION\n2\n15,2,1.,5,2,-1.\n".to_owned(),
            load("5,2,-10."),
        ),
        (
            "*TRANSFORM,NSET=Nright,TYPE=R\n0,1,0,-1,0,0\n*EQUATION\n2\n15,2,3.,14,1,4.\n".to_owned(),
            load("5,2,-5.\n15,2,-5."),
        ),
        (
            "*EQUATION\n2\n15,1,1.,5,1,-1.\n2\n15,1,1.,5,1,-1.\n".to_owned(),
            load("5,1,10."),
        ),
        ("*MPC\nTIE,15,5\nPIN,14,4\n".to_owned(), load("5,1,10.")),
        ("*NODE\n98,9,.5\n*MPC\nBEAM,Nright,98\n".to_owned(), load("98,1,10.")),
        ("*NODE\n98,9,.5\n*MPC\nBEAM,15,98\nBEAM,5,98\n".to_owned(), load("98,1,10.")),
        ("*MPC\nBEAM,15,5\n".to_owned(), load("5,1,5.\n15,1,5.")),
        ("*MPC\nLINK,15,5\nSLIDER,13,11,\n0,15\n".to_owned(), load("5,1,5.\n15,1,5.")),
        ("*MPC\nSTRAIGHT,11,12,13,\n0,14,15\n".to_owned(), load("5,1,5.\n15,1,5.")),
        (
            "*NODE\n98,9,.5\n*ELEMENT,TYPE=DCOUP2D,ELSET=Elead\n50,98\n*DISTRIBUTING COUPLING,ELSET=Elead\nNright,1.\n".to_owned(),
            load("98,1,10."),
        ),
    ] {
        if steps.is_empty() {
            // 4 and 15 move alike: refused by nothing, but not the strip's answer.
            let deck = read(&strip(&format!("{equations}{}", load("99,1,10."))), &[], &[]).or_panic();
            let u = displacements(&built(&deck)).remove(0);
            let at = |number: u64| {
                let place = deck.node_numbers.iter().position(|&one| one == number);
                u[place.expect("one of the mesh")][0]
            };
            for (a, b) in [(15, 5), (15, 4)] {
                assert!((at(a) - at(b)).abs() < 1e-9, "{equations}");
            }
            assert!((at(15) - 1.25 * at(14)).abs() < 1e-9 && at(15) > 0.3, "{equations}");
            continue;
        }
        let deck = read(&strip(&format!("{equations}{steps}")), &[], &[]).or_panic();
        let u = displacements(&built(&deck)).pop().expect("a step");
        for (&number, u) in deck.node_numbers.iter().zip(u) {
            let expected = 0.1 * ((number - 1) % 10) as f64;
            assert!((u[0] - expected).abs() < 1e-9, "{equations}: {number} {u:?}");
        }
    }
    // Alike ones are one table, which says the nodes of each term.
    let text = strip(&format!("{cell}{}", load("99,1,20.")));
    let deck = read(&text, &[], &[]).or_panic();
    let count = written(&deck).matches("[[equation]]").count();
    assert_eq!(count, 1, "{}", written(&deck));
    for (rest, what) in [
        (
            format!("{cell}*BOUNDARY\n99,1,1,.2\n{}", load("99,1,5.")),
            "no body follows this node in this direction, or a *BOUNDARY holds it",
        ),
        (
            format!(
                "*NODE\n98,9,9\n*BOUNDARY\n98,1,1,.2\n99,1\n*EQUATION\n2\n98,1,1.,99,1,1.\n{}",
                load("5,1,1.")
            ),
            "contradicts",
        ),
        (
            format!(
                "*NODE\n98,9,9\n*EQUATION\n2\n98,1,1.,99,1,1.\n{}",
                load("98,1,1.")
            ),
            "no body follows this node",
        ),
        (
            format!("*MPC\nPLANE,1,2,3\n{}", load("5,1,1.")),
            "in the plane nodes stay on a line",
        ),
        (
            format!("*MPC\nSTRAIGHT,11,15,3\n{}", load("5,1,1.")),
            "node 3 is beside the others",
        ),
        (
            format!("*MPC\nLINK,11\n{}", load("5,1,1.")),
            "it has two nodes",
        ),
        (
            format!("*MPC\nTIE,11\n{}", load("5,1,1.")),
            "needs its two nodes in a line",
        ),
        (
            format!("*MPC\nMEANROT,11,12,99\n{}", load("5,1,1.")),
            "are understood",
        ),
        (
            format!(
                "*MPC\nLINK,11,15\n{}",
                load("5,1,1.").replace("*STEP", "*STEP,NLGEOM")
            ),
            "linear in the displacements",
        ),
        (
            format!(
                "*ELEMENT,TYPE=DCOUP2D,ELSET=E\n50,99\n*DISTRIBUTING COUPLING,ELSET=E\n5,1.\n15,2.\n{}",
                load("99,1,1.")
            ),
            "all of them with the same weight",
        ),
    ] {
        let error = read(&strip(&rest), &[], &[]).expect_err(what);
        assert!(error.contains(what), "{error}");
    }
}

/// Two cubes above each other, pulled at a corner: what stays in a plane, on a line, at a distance, and as a rigid body.
#[test]
fn nodes_in_space_depend_on_each_other() {
    let deck_of = |rest: &str| {
        format!(
            "*NODE,NSET=Nall\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,1\n6,1,0,1\n7,1,1,1\n8,0,1,1\n9,0,0,2\n10,1,0,2\n11,1,1,2\n\
             12,0,1,2\n99,.3,.2,3\n*ELEMENT,TYPE=C3D8,ELSET=Eall\n1,1,2,3,4,5,6,7,8\n2,5,6,7,8,9,10,11,12\n*NSET,NSET=Ntop\n9,10,11,12\n{}\
             *BOUNDARY\n1,1,3\n2,1,3\n3,1,3\n4,1,3\n{rest}{STATIC}*CLOAD\n11,3,7.\n10,1,-2.\n*END STEP\n",
            material(0.3).replace("0.5\n", "\n")
        )
    };
    let answer = |rest: &str| {
        let deck = read(&deck_of(rest), &[], &[]).or_panic();
        let u = displacements(&built(&deck)).remove(0);
        let number = |node: usize| {
            u[deck
                .node_numbers
                .iter()
                .position(|&n| n == node as u64)
                .expect("a node")]
        };
        let at: Vec<[f64; 3]> = (1..=12).map(number).collect();
        move |node: usize| at[node - 1]
    };
    // By how much the middles of the diagonals of the top differ along z, and of a side from 6 over 10 to the line.
    let free = answer("");
    let warp = |u: &dyn Fn(usize) -> [f64; 3]| u(9)[2] + u(11)[2] - u(10)[2] - u(12)[2];
    let bend = |u: &dyn Fn(usize) -> [f64; 3], c: usize| u(6)[c] - 0.5 * (u(2)[c] + u(10)[c]);
    assert!(warp(&free).abs() > 1e-3 && bend(&free, 0).abs() > 1e-4);
    for plane in ["PLANE,Ntop", "PLANE,9,10,11,\n0,12"] {
        let u = answer(&format!("*MPC\n{plane}\n"));
        assert!(
            warp(&u).abs() < 1e-10 && bend(&u, 0).abs() > 1e-4,
            "{plane}"
        );
    }
    let u = answer("*MPC\nSTRAIGHT,2,6,10\n");
    assert!(bend(&u, 0).abs() < 1e-10 && bend(&u, 1).abs() < 1e-10 && bend(&u, 2).abs() > 1e-4);
    for link in ["LINK,11,9", "BEAM,11,9"] {
        let u = answer(&format!("*MPC\n{link}\n"));
        let grown = u(11)[0] + u(11)[1] - u(9)[0] - u(9)[1];
        assert!(
            grown.abs() < 1e-10 && warp(&u).abs() > 1e-3,
            "{link}: {grown}"
        );
    }
    // A rigid top, by beams to a node of it and to one of its own, and as a coupling.
    let [of_node, of_own, rigid] = [
        "*MPC\nBEAM,10,9\nBEAM,11,9\nBEAM,12,9\n",
        "*MPC\nBEAM,Ntop,99\n",
        "*RIGID BODY,NSET=Ntop,REF NODE=99\n",
    ]
    .map(answer);
    for node in 5..=12 {
        for c in 0..3 {
            let all = [of_node(node)[c], of_own(node)[c], rigid(node)[c]];
            assert!(
                (all[0] - all[1]).abs() < 1e-10 && (all[1] - all[2]).abs() < 1e-12,
                "{node}: {all:?}"
            );
        }
    }
    for (rest, what) in [
        ("*MPC\nPLANE,9,10,11,6\n", "node"),
        ("*MPC\nPLANE,2,6,10\n", "define nothing"),
    ] {
        let error = read(&deck_of(rest), &[], &[]).expect_err(what);
        assert!(error.contains(what), "{error}");
    }
}

/// Two squares above each other: the lower side of the upper one goes from (0, 1.01) to (1, 1.03).
pub(crate) fn squares(low: [f64; 2], pair: &str) -> String {
    let [a, b] = low;
    format!(
        "*NODE, NSET=Nall\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n11,0,{a}\n12,1,{b}\n13,1,2\n14,0,2\n\
         *ELEMENT, TYPE=CPS4, ELSET=Eall\n1,1,2,3,4\n2,11,12,13,14\n*NSET, NSET=Nright\n12,13\n\
         *SURFACE, NAME=Supper\n2,S1\n*SURFACE, NAME=Slower\n1,S3\n{}\
         *SURFACE INTERACTION, NAME=hard\n*CONTACT PAIR, INTERACTION=hard{pair}\nSupper,Slower\n\
         *BOUNDARY\n1,1,2\n2,2\n13,2\n14,1,2\n{STATIC}*END STEP\n",
        material(0.0)
    )
}

/// ADJUST= moves nodes of the slave surface onto the master surface: those within a distance, those of a set; an overlap without it
/// is pressed apart, as in a press fit: p = E δ / (the height of both).
#[test]
fn nodes_are_adjusted_as_in_the_deck() {
    for (low, pair, expected) in [
        ([1.01, 1.03], ", ADJUST=0.02", [1.0, 1.03]),
        ([1.01, 1.03], ", ADJUST=0.05", [1.0, 1.0]),
        ([1.01, 1.03], ", ADJUST=Nright", [1.01, 1.0]),
        ([0.99, 0.99], ", ADJUST=0.0", [1.0, 1.0]),
        ([0.99, 0.99], "", [0.99, 0.99]),
        ([1.01, 1.03], "", [1.01, 1.03]),
    ] {
        let deck = read(&squares(low, pair), &[], &[]).or_panic();
        let AnyMesh::Plane(mesh) = &deck.mesh else {
            panic!("none of the plane");
        };
        for (number, y) in [(11, expected[0]), (12, expected[1])] {
            let place = deck.node_numbers.iter().position(|&one| one == number);
            let [x, found] = mesh.nodes[place.expect("one of the mesh")];
            let is_there = (found - y).abs() < 1e-12 && (x - (number - 11) as f64).abs() < 1e-12;
            assert!(is_there, "{pair}: {number} at {x}, {found}");
        }
        let u = displacements(&built(&deck)).remove(0);
        let pressed = match (low, pair) {
            ([0.99, _], "") => -0.01 / (1.0 + 1.01),
            _ => 0.0,
        };
        assert!((u[2][1] - pressed).abs() < 1e-9, "{pair}: {:?}", u[2]);
    }
    let error = read(&squares([1.01, 1.03], ", ADJUST=Nowhere"), &[], &[]);
    let error = error.expect_err("no such set");
    assert!(
        error.contains("there is no node set \"NOWHERE\""),
        "{error}"
    );
}

/// A table of pressures is a linear law, with a gap where it begins elsewhere, or a sum of such; against springs in a row:
/// p = δ / (h / E + 1 / k).
#[test]
fn tables_of_pressures_are_sums_of_linear_laws() {
    let table = |low: f64, points: &str, rest: &str| {
        let law = format!("NAME=hard\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n{points}");
        squares([low; 2], "")
            .replace("NAME=hard\n", &law)
            .replace("*BOUNDARY\n1,1,2\n", &format!("{rest}*BOUNDARY\n1,1,2\n"))
    };
    let clearance = "*CLEARANCE, SLAVE=Supper, MASTER=Slower, VALUE=-0.01\n";
    for (low, points, rest, overlap) in [
        (0.99, "0,0\n10,0.001\n20,0.002\n", "", 0.01),
        (0.99, "0,-1\n0,0\n20,0.002\n", "", 0.01),
        (1.0, "0,0.002\n10,0.003\n", clearance, 0.008),
        (1.0, "0,-0.002\n10,-0.001\n", clearance, 0.012),
        (0.99, "0,0.002\n10,0.003\n", "", 0.008),
        (0.99, "0,-0.002\n10,-0.001\n", "", 0.012),
    ] {
        let deck = read(&table(low, points, rest), &[], &[]).or_panic();
        let u = displacements(&built(&deck)).remove(0);
        let pressure = overlap / ((1.0 + 2.0 - low) / 200.0 + 1e-4);
        assert!(
            (u[2][1] + pressure / 200.0).abs() < 1e-9,
            "{points}: {:?}",
            u[2]
        );
    }
    // Two pieces: p = 100 h + 1000 (h − 0.004), and both squares give way by 0.02 − h.
    for (low, points, rest, overlap, heights) in [
        (
            0.98,
            "0,0\n0.4,0.004\n12,0.014545454545454545\n",
            "",
            0.02,
            2.02,
        ),
        (
            1.0,
            "0,0\n0.4,0.004\n12,0.014545454545454545\n",
            "*CLEARANCE, SLAVE=Supper, MASTER=Slower, VALUE=-0.02\n",
            0.02,
            2.0,
        ),
    ] {
        let deck = read(&table(low, points, rest), &[], &[]).or_panic();
        assert_eq!(
            written(&deck).matches("[[contact]]").count(),
            2,
            "{}",
            written(&deck)
        );
        let u = displacements(&built(&deck)).remove(0);
        // (1100 h − 4) heights / 200 = overlap − h.
        let part: f64 = heights / 200.0;
        let h = (overlap + 4.0 * part) / (1.0 + 1100.0 * part);
        let pressure = 1100.0 * h - 4.0;
        assert!(
            (u[2][1] + pressure / 200.0).abs() < 1e-9,
            "{points}: {:?}",
            u[2]
        );
    }
    for (points, what) in [
        ("0,0\n10,0.001\n15,0.002\n", "must not become softer"),
        (
            "1,0\n10,0.001\n",
            "increase with the overclosure, from 0 on",
        ),
        ("0,0\n", "increase with the overclosure, from 0 on"),
        (
            "0,0\n10\n",
            "each line of a table needs a pressure and an overclosure",
        ),
    ] {
        let error = read(&table(0.99, points, ""), &[], &[]).expect_err(points);
        assert!(error.contains(what), "{error}");
    }
}

/// The exponential law, 1 % of p₀ at a gap of c₀: between two squares pressed together by 0.01, from pressures far below p₀ to
/// far above it, p = p₀ 100^((0.01 − p h/E) / c₀) within 3.5 % of c₀ in the overclosure.
#[test]
fn exponential_pressures_are_chords_of_the_curve() {
    for (c, p) in [(1e-3, 0.1), (1e-3, 1e-3), (2e-2, 0.01), (5e-3, 30.0)] {
        let law =
            format!("NAME=hard\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=EXPONENTIAL\n{c},{p}\n");
        let text = squares([0.99; 2], "").replace("NAME=hard\n", &law);
        let u = displacements(&built(&read(&text, &[], &[]).or_panic())).remove(0);
        let pressure = -200.0 * u[2][1];
        let overclosure = 0.01 - pressure * 2.01 / 200.0;
        let exact = c * (pressure / p).ln() / 100_f64.ln();
        assert!(pressure > 0.01 * p, "{pressure} of {p}");
        assert!(
            (overclosure - exact).abs() <= 0.036 * c,
            "{c} {p}: {overclosure} {exact}"
        );
    }
    let law = "NAME=hard\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=EXPONENTIAL\n0.001\n";
    let text = squares([0.99; 2], "").replace("NAME=hard\n", law);
    let error = read(&text, &[], &[]).expect_err("no pressure");
    assert!(error.contains("needs a distance and a pressure"), "{error}");
}

/// Tied, then pressed by a linear law, then hard: each behavior acts in its steps.
#[test]
fn behaviors_change_with_the_steps() {
    let begin = squares([1.0; 2], "").replace(
        "NAME=hard\n",
        "NAME=hard\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TIED\n1e9\n",
    );
    let begin = begin.split(STATIC).next().expect("what is before");
    let begin = begin.replace("13,2\n14,1,2\n", "14,1\n");
    let moved = |y: f64| format!("*BOUNDARY\n13,2,2,{y}\n14,2,2,{y}\n");
    let change = "*CHANGE SURFACE BEHAVIOR, INTERACTION=hard\n*SURFACE BEHAVIOR";
    let text = [
        begin,
        format!("{STATIC}{}*END STEP\n", moved(0.01)),
        format!("{STATIC}{change}, PRESSURE-OVERCLOSURE=LINEAR\n400.\n*END STEP\n"),
        format!("{STATIC}{}*END STEP\n", moved(-0.03)),
        format!("{STATIC}{change}\n*END STEP\n"),
    ]
    .concat();
    let u = displacements(&built(&read(&text, &[], &[]).or_panic()));
    // Both squares of E = 200; 1/400 of the law is half of what a square gives way.
    for (u, below) in u.iter().zip([0.005, 0.0, -0.012, -0.015]) {
        assert!((u[2][1] - below).abs() < 1e-9, "{below}: {u:?}");
    }
    let early = format!("{change}\n{STATIC}");
    let error = read(&text.replacen(STATIC, &early, 1), &[], &[]).expect_err("before a step");
    assert!(error.contains("comes before any *STEP"), "{error}");
}

/// The springs of a stick slope go on under a behavior that is stated again; another one would begin without their force.
#[test]
fn a_stick_slope_keeps_its_force() {
    let law = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n400.\n";
    let begin = squares([1.0; 2], "").replace(
        "NAME=hard\n",
        &format!("NAME=hard\n{law}*FRICTION\n0.5,50.\n"),
    );
    let begin = begin.split(STATIC).next().expect("what is before");
    let begin = begin.replace("13,2\n14,1,2\n", "");
    let push = "*BOUNDARY\n13,2,2,-0.02\n14,2,2,-0.02\n13,1,1,0.01\n14,1,1,0.01\n";
    let text =
        |second: &str| format!("{begin}{STATIC}{push}*END STEP\n{STATIC}{second}*END STEP\n");
    let change = format!("*CHANGE SURFACE BEHAVIOR, INTERACTION=hard\n{law}");
    let u = displacements(&built(&read(&text(&change), &[], &[]).or_panic()));
    let plain = displacements(&built(&read(&text(""), &[], &[]).or_panic()));
    assert!(u[0][2][0] > 1e-4, "{u:?}");
    for (a, b) in u
        .iter()
        .flatten()
        .flatten()
        .zip(plain.iter().flatten().flatten())
    {
        assert!((a - b).abs() < 1e-12, "{u:?}\n{plain:?}");
    }
    let error = read(&text(&change.replace("400.", "300.")), &[], &[]).expect_err("other springs");
    let expected = "line 49: *CHANGE SURFACE BEHAVIOR: the force that the stick slope";
    assert!(error.contains(expected), "{error}");
}

/// The elements of a set rotate about one axis at a time.
#[test]
fn bodies_rotate_about_one_axis() {
    let first = "*DLOAD\nEall,CENTRIF,2.,0.,0.,0.,0.,0.,1.\n";
    let second = |option: &str, axis: &str| {
        let next = format!("{STATIC}*DLOAD{option}\nEall,CENTRIF,1.,{axis}\n*END STEP\n");
        read(
            &strip(&format!("{STATIC}{first}*END STEP\n{next}")),
            &[],
            &[],
        )
    };
    let error = second("", "0.,0.,0.,0.,1.,0.").expect_err("two axes");
    let expected = "*DLOAD, CENTRIF: some of its elements rotate by deck.inp, line 42 as well";
    assert!(error.contains(expected), "{error}");
    second("", "0.,0.,0.,0.,0.,1.").or_panic();
    second(",OP=NEW", "0.,0.,0.,0.,1.,0.").or_panic();
}

/// Gravity and rotation need a density, be it 0.
#[test]
fn loads_on_mass_need_a_density() {
    for load in [
        "Eall,GRAV,9.81,0.,-1.,0.",
        "Eall,CENTRIF,2.,0.,0.,0.,0.,0.,1.",
    ] {
        let text = strip(&format!("{STATIC}*DLOAD\n{load}\n*END STEP\n"));
        let none = text.replace("*DENSITY\n3.\n", "");
        let error = read(&none, &[], &[]).expect_err("no mass");
        assert!(error.contains("line 40: *DLOAD, GRAV or CENTRIF acts on mass: state the *DENSITY of *MATERIAL \"SOFT\""), "{error}");
        read(&text.replace("3.\n*SOLID", "0.\n*SOLID"), &[], &[]).or_panic();
    }
}

/// Sides of a tie that look the same way, as where one part is drawn within the other, and a surface of nodes are tied node by node.
#[test]
fn ties_hold_node_by_node() {
    let text = |kind: &str| {
        format!(
            "*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n11,0,0.5\n12,1,0.5\n13,1,1\n14,0,1\n*ELEMENT, TYPE=CPS4, ELSET=Eall\n1,1,2,3,4\n\
             2,11,12,13,14\n*NSET, NSET=Nupper\n13,14\n*SURFACE, NAME=Supper{kind}\n*SURFACE, NAME=Slower\n1,S3\n*TIE, NAME=glue\nSupper,Slower\n\
             {}*BOUNDARY\n1,1,2\n2,2\n11,1\n{STATIC}*CLOAD\n11,2,0.5\n12,2,0.5\n*END STEP\n",
            material(0.0)
        )
    };
    for kind in ["\n2,S3", ", TYPE=NODE\nNupper"] {
        let deck = read(&text(kind), &[], &[]).or_panic();
        let u = displacements(&built(&deck)).remove(0);
        let u: Vec<f64> = [2, 6, 4].map(|node| u[node][1]).into();
        // 1 N on an area of 0.5: the lower square is pulled by 0.01, the upper one pressed by half of that.
        let expected = [0.01, 0.01, 0.015];
        assert!(
            u.iter().zip(expected).all(|(u, e)| (u - e).abs() < 1e-9),
            "{kind}: {u:?}"
        );
    }
}

/// Temperatures that are linear in the place make a free body grow without stress: of θ = 10 x, u = 5 α (x² − y², 2 x y), which elements
/// of second order have exactly. In steps with multiples, and with others; from temperatures that differ at the beginning.
#[test]
fn temperatures_may_differ_from_node_to_node() {
    let places = [
        [0.0, 0.0],
        [2.0, 0.0],
        [2.0, 1.0],
        [0.0, 1.0],
        [1.0, 0.0],
        [2.0, 0.5],
        [1.0, 1.0],
        [0.0, 0.5],
    ];
    let at_nodes = |value: &dyn Fn([f64; 2]) -> f64| -> String {
        let lines = (1..)
            .zip(places)
            .map(|(number, x)| format!("{number},{:?}\n", value(x)));
        lines.collect()
    };
    let nodes: String = (1..)
        .zip(places)
        .map(|(number, [x, y])| format!("{number},{x:?},{y:?}\n"))
        .collect();
    let first = at_nodes(&|[x, y]| 3.0 + y + 10.0 * x);
    let half = at_nodes(&|[x, y]| 3.0 + y + 5.0 * x);
    let other = at_nodes(&|[_, y]| 3.0 + y - 10.0 * y);
    let start = at_nodes(&|[_, y]| 3.0 + y);
    let text = |second: &str| {
        format!(
            "*NODE,NSET=Nall\n{nodes}*ELEMENT,TYPE=CPS8,ELSET=Eall\n1,1,2,3,4,5,6,7,8\n*MATERIAL,NAME=el\n*ELASTIC\n200.,0.3\n\
             *EXPANSION\n1e-3\n*SOLID SECTION,ELSET=Eall,MATERIAL=el\n*INITIAL CONDITIONS,TYPE=TEMPERATURE\n{start}\
             *BOUNDARY\n1,1,2\n8,1,1,-1.25e-3\n{STATIC}*TEMPERATURE\n{first}*END STEP\n\
             {STATIC}*TEMPERATURE\n{second}*BOUNDARY\n8,1,1,{}\n*END STEP\n",
            if second == half { "-6.25e-4" } else { "0" }
        )
    };
    type Expected = fn([f64; 2]) -> [f64; 2];
    let grown: Expected = |[x, y]| [5e-3 * (x * x - y * y), 1e-2 * x * y];
    let halved: Expected = |[x, y]| [2.5e-3 * (x * x - y * y), 5e-3 * x * y];
    // Of −10 y: u = 5 α (−2 x y, x² − y²), and no rotation if the left side stays upright.
    let across: Expected = |[x, y]| [-1e-2 * x * y, 5e-3 * (x * x - y * y)];
    for (second, expected, tables) in [(&half, halved, 1), (&other, across, 2)] {
        let deck = read(&text(second), &[], &[]).or_panic();
        assert_eq!(
            written(&deck).matches("[[temperature]]").count(),
            tables,
            "{}",
            written(&deck)
        );
        for (u, expected) in displacements(&built(&deck)).iter().zip([grown, expected]) {
            for (x, u) in places.iter().zip(u) {
                let [a, b] = expected(*x);
                assert!(
                    (u[0] - a).abs() < 1e-12 && (u[1] - b).abs() < 1e-12,
                    "{x:?}: {u:?}"
                );
            }
        }
    }
}

/// Forces along directions of a transform: rectangular ones turn them all, cylindrical ones each by where its node is.
#[test]
fn transforms_turn_forces() {
    // 5 N along x on each of the nodes at the end, in other words.
    for (transform, load) in [
        ("*TRANSFORM, NSET=Nright\n0,1,0,-1,0,0\n", "Nright,2,-5.\n"),
        (
            "*TRANSFORM, NSET=Nright, TYPE=R\n3,4,0,-1,1,0\n",
            "Nright,1,3.\nNright,2,-4.\n",
        ),
        // From the axis at (4, 2) both nodes are below, and the hoop direction is along x there.
        (
            "*TRANSFORM, NSET=Nright, TYPE=C\n4,2,0,4,2,1\n",
            "Nright,2,5.\n",
        ),
        // From the axis at (5, 0) and (5, 1) they would differ: by numbers.
        (
            "*TRANSFORM, NSET=Nright, TYPE=C\n0,0,0,0,0,1\n",
            "5,1,5.\n15,1,4.850712500726659\n15,2,-1.2126781251816647\n",
        ),
        // A transform of the axes themselves.
        (
            "*TRANSFORM, NSET=Nright, TYPE=R\n2,0,0,1,1,0\n",
            "Nright,1,5.\n",
        ),
    ] {
        let text = strip(&format!("{transform}{STATIC}*CLOAD\n{load}*END STEP\n"));
        let deck = read(&text, &[], &[]).or_panic();
        let u = displacements(&built(&deck)).remove(0);
        for (&number, u) in deck.node_numbers.iter().zip(u) {
            let expected = 0.1 * ((number - 1) % 10) as f64;
            let is_there = (u[0] - expected).abs() < 1e-9 && u[1].abs() < 1e-9;
            assert!(is_there, "{transform}: {number} {u:?}\n{}", written(&deck));
        }
    }
}

/// Supports along directions of a rectangular transform: the end of the strip is drawn along x, in other words.
#[test]
fn rectangular_transforms_turn_supports() {
    for (transform, support) in [
        ("0,1,0,-1,0,0\n", "Nright,2,2,-0.4\n"),
        ("3,4,0,-1,1,0\n", "Nright,1,1,0.24\nNright,2,2,-0.32\n"),
        // In one step the first direction, in the next one both.
        (
            "3,4,0,-1,1,0\n",
            "Nright,1,1,0.24\n*END STEP\n*STEP\n*STATIC\n*BOUNDARY\nNright,2,2,-0.32\n",
        ),
    ] {
        let text = strip(&format!(
            "*TRANSFORM, NSET=Nright\n{transform}{STATIC}*BOUNDARY\n{support}*END STEP\n"
        ));
        let deck = read(&text, &[], &[]).or_panic();
        let u = displacements(&built(&deck)).pop().expect("a step");
        for (&number, u) in deck.node_numbers.iter().zip(u) {
            let expected = 0.1 * ((number - 1) % 10) as f64;
            let is_there = (u[0] - expected).abs() < 1e-9 && u[1].abs() < 1e-9;
            assert!(is_there, "{support}: {number} {u:?}\n{}", written(&deck));
        }
    }
    // Rollers on a slope: the end moves along (4, -3) only.
    let text = strip(&format!(
        "*TRANSFORM, NSET=Nright\n3,4,0,-1,1,0\n*BOUNDARY\nNright,1\n{STATIC}*CLOAD\nNright,2,-5.\n*END STEP\n"
    ));
    let deck = read(&text, &[], &[]).or_panic();
    let u = displacements(&built(&deck)).remove(0);
    for (&number, u) in deck.node_numbers.iter().zip(u) {
        let is_end = number % 10 == 5;
        assert!(
            !is_end || u[0] > 0.1 && (3.0 * u[0] + 4.0 * u[1]).abs() < 1e-12,
            "{u:?}"
        );
    }
    let text = strip(&format!(
        "*TRANSFORM, NSET=Nright\n1,0,1,0,1,0\n*BOUNDARY\nNright,1\n{STATIC}*END STEP\n"
    ));
    let error = read(&text, &[], &[]).expect_err("a direction across the plane");
    assert!(error.contains("leave the plane"), "{error}");
}

/// A ring from r = 1 to 2, 1 high, of one element: forces are for the whole ring, pressures per area.
#[test]
fn decks_of_revolution() {
    let text = |load: &str| {
        format!(
            "*NODE,NSET=Nall\n1,1,0\n2,2,0\n3,2,1\n4,1,1\n5,1.5,0\n6,2,.5\n7,1.5,1\n8,1,.5\n\
             *ELEMENT,TYPE=CAX8R,ELSET=Eall\n1,1,2,3,4,5,6,7,8\n*MATERIAL,NAME=el\n*ELASTIC\n1000.,0.\n*DENSITY\n2.\n*EXPANSION\n1e-3\n\
             *SOLID SECTION,ELSET=Eall,MATERIAL=el\n0.7\n*BOUNDARY\n1,2\n2,2\n5,2\n\
             *EQUATION\n2\n3,2,1.,4,2,-1.\n2\n7,2,1.,4,2,-1.\n{STATIC}{load}*END STEP\n"
        )
    };
    let area = std::f64::consts::PI * 3.0;
    for (load, [radial, axial]) in [
        (format!("*CLOAD\n4,2,{:?}\n", 10.0 * area), [0.0, 0.01]),
        ("*DLOAD\n1,P3,-10.\n".to_owned(), [0.0, 0.01]),
        // ∫ ρ g over the height.
        ("*DLOAD\nEall,GRAV,10.,0.,-1.,0.\n".to_owned(), [0.0, -0.01]),
        ("*TEMPERATURE\nNall,20.\n".to_owned(), [0.02, 0.02]),
    ] {
        let deck = read(&text(&load), &[], &[]).or_panic();
        assert!(
            written(&deck).contains("plane = \"axisymmetric\""),
            "{}",
            written(&deck)
        );
        let u = displacements(&built(&deck)).remove(0);
        for (x, u) in [(1.0, u[0]), (2.0, u[1]), (2.0, u[2]), (1.0, u[3])] {
            assert!((u[0] - radial * x).abs() < 1e-9, "{load}: {u:?}");
        }
        for u in [u[2], u[3]] {
            assert!((u[1] - axial).abs() < 1e-9, "{load}: {u:?}");
        }
    }
    for (load, what) in [
        (
            "*DLOAD\nEall,CENTRIF,2.,0.,0.,0.,0.,0.,1.\n",
            "rotates about its axis, y",
        ),
        ("*DLOAD\nEall,GRAV,10.,1.,0.,0.\n", "acts along its axis, y"),
    ] {
        let error = read(&text(load), &[], &[]).expect_err(load);
        assert!(error.contains(what), "{error}");
    }
    let both = text("").replace(
        "*MATERIAL",
        "*ELEMENT,TYPE=CPS3,ELSET=Eall\n2,1,2,3\n*MATERIAL",
    );
    let error = read(&both, &[], &[]).expect_err("two kinds");
    assert!(
        error.contains("of plane stress or of revolution in one deck"),
        "{error}"
    );
}

/// Data in other files, of nodes and of loads; none from outside of the folder, none in circles.
#[test]
fn files_that_a_deck_names_are_read() {
    let [mesh, rest] = [STRIP, "*BOUNDARY\nNleft,1\n1,2\n"];
    let text = format!(
        "*INCLUDE, INPUT=parts/mesh.inp\n{}{rest}{STATIC}*CLOAD, INPUT=loads.txt\n*END STEP\n",
        material(0.0)
    );
    let beside = [("parts/mesh.inp", mesh), ("loads.txt", "5,1,5.\n15,1,5.\n")];
    let deck = read(&text, &beside, &[]).or_panic();
    let u = displacements(&built(&deck)).remove(0);
    assert!((u[4][0] - 0.4).abs() < 1e-12);
    let outside = text.replace("loads.txt", "../loads.txt");
    let error = read(&outside, &beside, &[]).expect_err("a file from outside");
    assert!(
        error.contains("deck.inp, line 15: *CLOAD: ../loads.txt must be in the folder"),
        "{error}"
    );
    let circle = text.replace("loads.txt", "deck.inp");
    let error = read(&circle, &beside, &[]).expect_err("a file that names itself");
    assert!(error.contains("does one include itself?"), "{error}");
}

/// A bar with springs at its end, to the ground or to its other end: u = F/(E A/L + 2k).
#[test]
fn springs_hold_a_bar() {
    let (k, force) = (15.0, 10.0);
    let ground = "*NODE\n97,6,0\n98,6,1\n*BOUNDARY\n97,1,3\n98,1,3\n";
    let of = |kind: &str, elements: &str, data: &str| {
        format!(
            "*ELEMENT,TYPE={kind},ELSET=Espring\n{elements}*SPRING,ELSET=Espring\n{data}{k:?}\n"
        )
    };
    for springs in [
        of("SPRING1", "21,5\n22,15\n", "1\n"),
        ground.to_owned() + &of("SPRINGA", "21,5,97\n22,98,15\n", "\n"),
        ground.to_owned() + &of("SPRING2", "21,5,97\n22,15,98\n", "1,1\n"),
        of("SPRINGA", "21,1,5\n22,15,11\n", "\n"),
        of("SPRING2", "21,5,1\n22,15,11\n", "1, 1\n"),
    ] {
        let text = strip(&format!(
            "{springs}{STATIC}*CLOAD\nNright,1,5.\n*END STEP\n"
        ));
        let deck = read(&text, &[], &[]).or_panic();
        assert_eq!(written(&deck).matches("[[spring]]").count(), 2);
        for (x, u) in [0.0, 1.0, 2.0, 3.0, 4.0]
            .into_iter()
            .zip(&displacements(&built(&deck))[0])
        {
            let expected = force / (100.0 / 4.0 + 2.0 * k) * x / 4.0;
            assert!((u[0] - expected).abs() < 1e-8, "{springs} {x}: {u:?}");
        }
    }
    let loose = "*NODE\n97,6,0\n".to_owned();
    for (springs, expected) in [
        (
            of("SPRING2", "21,5,1\n", "1,2\n"),
            "both ends of a spring have one direction",
        ),
        (of("SPRING1", "21,5\n", "4\n"), "nodes have no rotations"),
        (
            of("SPRING1", "21,5\n", "3\n"),
            "in the plane there is no direction 3",
        ),
        (
            of("SPRING1", "21,5\n", ""),
            "a spring with one node needs a direction",
        ),
        (
            loose + &of("SPRINGA", "21,5,97\n", ""),
            "is the ground: hold it at 0",
        ),
        (
            "*ELEMENT,TYPE=SPRING1,ELSET=E\n21,5\n".to_owned(),
            "but no *SPRING",
        ),
    ] {
        let error = read(&strip(&format!("{springs}{STATIC}*END STEP\n")), &[], &[]);
        let error = error.expect_err(expected);
        assert!(error.contains(expected), "{error}");
    }
}

/// A bar of E A = 100 between walls: a force pulls its halves together, stays where it is, and meets a wall that moves.
#[test]
fn a_section_is_tightened_and_fixed() {
    let section = "*SURFACE,NAME=Scut\n2,S2\n*PRE-TENSION SECTION,SURFACE=Scut,NODE=99\n1.,0.\n";
    let walls = "*BOUNDARY\nNright,1,1\n";
    let steps = format!(
        "{STATIC}*CLOAD\n99,1,8.\n*END STEP\n{STATIC}*BOUNDARY,FIXED\n99,1,1\n*BOUNDARY\nNright,1,1,0.1\n*END STEP\n"
    );
    let deck = read(&strip(&format!("{section}{walls}{steps}")), &[], &[]).or_panic();
    let text = written(&deck);
    assert!(
        text.contains("lock = [0.0, 1.0]") && text.contains("force = 8.0"),
        "{text}"
    );
    let all = displacements(&built(&deck));
    for (u, [tension, wall]) in all.iter().zip([[8.0, 0.0], [10.5, 0.1]]) {
        for (x, u) in [0.0, 1.0, 2.0, 3.0, 4.0].into_iter().zip(u) {
            let strain = tension / 100.0;
            let from_left = (u[0] - strain * x).abs() < 1e-9;
            let from_right = (u[0] - wall - strain * (x - 4.0)).abs() < 1e-9;
            assert!(
                if x == 2.0 {
                    from_left || from_right
                } else if x < 2.0 {
                    from_left
                } else {
                    from_right
                },
                "{x} {u:?}"
            );
        }
    }
    // The same by a displacement of the node; with the normal into the elements of the surface, the opposite. As CalculiX's pret1 and
    // pret2 in ccx 2.20.
    for (normal, sign) in [("1.,0.", 1.0), ("-1.,0.", -1.0)] {
        let section = section.replace("1.,0.", normal);
        let stated = format!("{STATIC}*BOUNDARY\n99,1,1,0.32\n*END STEP\n");
        let deck = read(&strip(&format!("{section}{walls}{stated}")), &[], &[]).or_panic();
        let u = &displacements(&built(&deck))[0];
        assert!((u[1][0] - sign * 0.08).abs() < 1e-9, "{u:?}");
    }
    for (rest, expected) in [
        (
            format!("{section}{STATIC}*CLOAD\n99,2,8.\n*END STEP\n"),
            "the node of a *PRE-TENSION SECTION has one direction, 1",
        ),
        (
            format!("{section}{STATIC}*BOUNDARY,FIXED\n99,1,1\n*END STEP\n"),
            "state it in a later step than the first",
        ),
        (
            format!("{section}{STATIC}*CLOAD\n99,1,8.\n*BOUNDARY\n99,1,1,0.1\n*END STEP\n"),
            "its node has a force or a displacement, not both",
        ),
        (
            format!(
                "{}{STATIC}*END STEP\n",
                section.replace("NODE=99", "NODE=5")
            ),
            "must not belong to an element of a body",
        ),
        (
            format!(
                "*COUPLING,CONSTRAINT NAME=end,REF NODE=99,SURFACE=Send\n*KINEMATIC\n\
                 {STATIC}*END STEP\n{STATIC}*BOUNDARY,FIXED\n99,1,1\n*END STEP\n"
            ),
            "of reference nodes only that of a *PRE-TENSION SECTION can be fixed",
        ),
        (
            format!(
                "{section}{STATIC}*CLOAD\n99,1,8.\n*END STEP\n{STATIC}*BOUNDARY,FIXED\n99,1,1\n*END STEP\n{STATIC}*BOUNDARY,OP=NEW\nNleft,1\n1,2\n*END STEP\n"
            ),
            "a section that has been fixed stays so",
        ),
    ] {
        let error = read(&strip(&rest), &[], &[]).expect_err(expected);
        assert!(error.contains(expected), "{error}");
    }
}

/// The end of the strip moves with node 99 at (7, 7), turned by 0.01: as a coupling, an older coupling, and a rigid body whose second
/// node has the rotation.
#[test]
fn nodes_move_with_a_reference_node() {
    let turn = 0.01;
    let moved = "99,1,1,0.02\n99,2,2,0.03\n";
    let own = format!("{moved}99,6,6,{turn}\n");
    let other = format!("{moved}98,3,3,{turn}\n");
    for (constraint, motions) in [
        (
            "*COUPLING,CONSTRAINT NAME=end,REF NODE=99,SURFACE=Send\n*KINEMATIC\n",
            &own,
        ),
        (
            "*COUPLING,CONSTRAINT NAME=end,REF NODE=99,SURFACE=Send\n*KINEMATIC\n1,2\n",
            &own,
        ),
        ("*KINEMATIC COUPLING,REF NODE=99\n5,1,2\n15,1,2\n", &own),
        ("*RIGID BODY,NSET=Nright,REF NODE=99\n", &own),
        (
            "*NODE\n98,0,0\n*RIGID BODY,NSET=Nright,REF NODE=99,ROT NODE=98\n",
            &other,
        ),
        (
            "*COUPLING,CONSTRAINT NAME=end,REF NODE=99,SURFACE=Send\n*DISTRIBUTING\n1,6\n",
            &own,
        ),
    ] {
        let text = strip(&format!(
            "{constraint}{STATIC}*BOUNDARY\n{motions}*END STEP\n"
        ));
        let deck = read(&text, &[], &[]).or_panic();
        assert_eq!(written(&deck).matches("[[coupling]]").count(), 1);
        let u = &displacements(&built(&deck))[0];
        for (node, y) in [(4, 0.0), (9, 1.0)] {
            let exact = [0.02 - turn * (y - 7.0), 0.03 + turn * (4.0 - 7.0)];
            // Two nodes move rigidly along both axes; spread, all but the change of their distance is that motion.
            let off = if constraint.contains("DISTRIBUTING") {
                0
            } else {
                1
            };
            for c in 0..=off {
                assert!(
                    (u[node][c] - exact[c]).abs() < 1e-9,
                    "{constraint} {y}: {:?} {exact:?}",
                    u[node]
                );
            }
        }
    }
    // All motions of a clamped node are held.
    let text = strip(&format!(
        "*RIGID BODY,NSET=Nright,REF NODE=99\n{STATIC}*BOUNDARY\n99,ENCASTRE\n*END STEP\n"
    ));
    let text = written(&read(&text, &[], &[]).or_panic());
    assert!(text.contains("x = 0.0\ny = 0.0\nrz = 0.0"), "{text}");
    // A force that grows after a rotation that is there at once: two histories, two parts.
    let grows = "*AMPLITUDE,NAME=late\n0.,0.,0.5,0.,1.,1.\n";
    let text = strip(&format!(
        "{grows}*COUPLING,CONSTRAINT NAME=end,REF NODE=99,SURFACE=Send\n*KINEMATIC\n{STATIC}*BOUNDARY\n99,6,6,{turn}\n*CLOAD,AMPLITUDE=late\n99,1,5.\n*END STEP\n"
    ));
    let deck = read(&text, &[], &[]).or_panic();
    assert_eq!(written(&deck).matches("[[coupling]]").count(), 2);
    let all = displacements(&built(&deck));
    let of_force = |step: usize| 0.5 * (all[step][4][0] + all[step][9][0]);
    assert!(of_force(0).abs() < 1e-9);
    // 5 over E A / l.
    assert!((of_force(1) - 5.0 / 25.0).abs() < 1e-9, "{}", of_force(1));
    assert!((all[1][4][0] - all[1][9][0] - turn).abs() < 1e-9);
    for (rest, expected) in [
        (
            format!("*COUPLING,REF NODE=99,SURFACE=Send\n{STATIC}*END STEP\n"),
            "*KINEMATIC or *DISTRIBUTING follows it",
        ),
        (
            format!("*KINEMATIC\n{STATIC}*END STEP\n"),
            "*KINEMATIC follows a *COUPLING",
        ),
        (
            format!("*RIGID BODY,ELSET=Eall,REF NODE=99\n{STATIC}*END STEP\n"),
            "nodes are needed",
        ),
        (
            format!(
                "*RIGID BODY,NSET=Nright,REF NODE=99\n*RIGID BODY,NSET=Nleft,REF NODE=99\n{STATIC}*END STEP\n"
            ),
            "two constraints have the same reference node",
        ),
        (
            format!(
                "*RIGID BODY,NSET=Nright,REF NODE=99\n*TRANSFORM,NSET=Nall,TYPE=R\n0.,1.,0.,-1.,0.,0.\n{STATIC}*END STEP\n"
            ),
            "the directions of a reference node are the axes",
        ),
        (
            format!(
                "*RIGID BODY,NSET=Nright,REF NODE=99\n*EQUATION\n2\n99,1,1.,1,1,-1.\n{STATIC}*END STEP\n"
            ),
            "a reference node cannot depend on other nodes",
        ),
        (
            format!("{STATIC}*CLOAD\nNright,5,1.\n*END STEP\n"),
            "*CLOAD, direction 5: nodes have forces along x, y and z only",
        ),
    ] {
        let error = read(&strip(&rest), &[], &[]).expect_err(expected);
        assert!(error.contains(expected), "{error}");
    }
}

/// A quarter of a ring, warmer by 100: it grows as the whole does.
#[test]
fn a_sector_of_a_ring() {
    let mut text = "*HEADING\nring\n*NODE\n".to_owned();
    for (i, r) in [1.0, 1.5, 2.0].into_iter().enumerate() {
        for j in 0..4 {
            let angle = std::f64::consts::FRAC_PI_2 * f64::from(j) / 3.0;
            text += &format!(
                "{},{},{}\n",
                10 * i + j as usize + 1,
                r * angle.cos(),
                r * angle.sin()
            );
        }
    }
    text += "*ELEMENT,TYPE=CPS4,ELSET=Eall\n1,1,11,12,2\n2,2,12,13,3\n3,3,13,14,4\n4,11,21,22,12\n5,12,22,23,13\n6,13,23,24,14\n\
        *NSET,NSET=Nlow\n1,11,21\n*NSET,NSET=Nhigh\n4,14,24\n*NSET,NSET=Nall,GENERATE\n1,24\n\
        *SURFACE,NAME=Slow,TYPE=NODE\nNlow\n*SURFACE,NAME=Shigh,TYPE=NODE\nNhigh\n\
        *TIE,CYCLIC SYMMETRY,NAME=sector,POSITION TOLERANCE=0.01\nShigh,Slow\n\
        *CYCLIC SYMMETRY MODEL,N=4,TIE=sector,NGRAPH=1\n0.,0.,0.,0.,0.,1.\n\
        *MATERIAL,NAME=soft\n*ELASTIC\n200.,0.3\n*EXPANSION\n1e-5\n*SOLID SECTION,ELSET=Eall,MATERIAL=soft\n1.\n\
        *BOUNDARY\n1,2\n";
    text += STATIC;
    text += "*TEMPERATURE\nNall,100.\n*DLOAD\n1,P4,1.\n2,P4,1.\n3,P4,1.\n4,P2,1.\n5,P2,1.\n6,P2,1.\n*END STEP\n";
    let deck = read(&text, &[], &[]).or_panic();
    let u = &displacements(&built(&deck))[0];
    let growth = 1e-3 - 0.7 / 200.0;
    for (i, r) in [1.0, 1.5, 2.0].into_iter().enumerate() {
        assert!((u[4 * i][0] - growth * r).abs() < 1e-8, "{u:?}");
        assert!((u[4 * i + 3][1] - growth * r).abs() < 1e-8, "{u:?}");
    }
    let without = text.replace("CYCLIC SYMMETRY,NAME=sector,", "");
    let error = read(&without, &[], &[]).expect_err("no tie");
    assert!(
        error.contains("no *TIE, CYCLIC SYMMETRY belongs to it"),
        "{error}"
    );
    let without = text.replace("TIE=sector", "TIE=other");
    let error = read(&without, &[], &[]).expect_err("no sectors");
    assert!(
        error.contains("no *CYCLIC SYMMETRY MODEL belongs to it"),
        "{error}"
    );
}

/// Two squares, one pressed on the other by δ and then pushed along: without friction, with it, and with the pair taken away.
#[test]
fn contacts_and_friction_change_with_the_steps() {
    let step = |rest: &str| format!("{STATIC}{rest}*END STEP\n");
    let begin = squares([1.0; 2], "").replace("NAME=hard\n", "NAME=hard\n*FRICTION\n0.\n");
    let begin = begin
        .split(STATIC)
        .next()
        .expect("what is before the steps");
    // The upper side moves down, and then along.
    let begin = begin.replace("13,2\n14,1,2\n", "");
    let press = "*BOUNDARY\n13,2,2,-0.01\n14,2,2,-0.01\n13,1,1,0.\n14,1,1,0.\n";
    let change = "*CHANGE FRICTION, INTERACTION=hard\n*FRICTION\n0.5\n";
    let push = "*BOUNDARY\n13,1,1,0.001\n14,1,1,0.001\n";
    let remove = "*MODEL CHANGE, TYPE=CONTACT PAIR, REMOVE\nSupper, Slower\n";
    let text = [
        begin,
        step(press),
        step(push),
        step(&format!("{change}*BOUNDARY\n13,1,1,0.002\n14,1,1,0.002\n")),
        step(remove),
    ]
    .concat();
    let deck = read(&text, &[], &[]).or_panic();
    let case = written(&deck);
    assert!(
        case.contains("friction_factors = [0.0, 0.0, 1.0, 1.0]"),
        "{case}"
    );
    assert!(case.contains("active = [1.0, 1.0, 1.0, 0.0]"), "{case}");
    let u = displacements(&built(&deck));
    // Nodes 1 to 4 below, 11 to 14 above: E A δ/h of both; the upper square moves along as a whole until friction takes the lower one with it.
    let pressed =
        |of: &[[f64; 3]]| (of[2][1] + 0.005).abs() < 1e-9 && (of[4][1] + 0.005).abs() < 1e-9;
    assert!((0..2).all(|step| pressed(&u[step])), "{u:?}");
    assert!(
        (u[1][4][0] - 0.001).abs() < 1e-9 && u[1][3][0].abs() < 1e-9,
        "{:?}",
        u[1]
    );
    // Where nodes 4 and 11 are apart by then they stay so.
    assert!((u[2][3][0] - u[2][4][0] + 0.001).abs() < 1e-8, "{:?}", u[2]);
    assert!(u[2][3][0] > 1e-4, "{:?}", u[2]);
    // Without the pair nothing is pressed.
    assert!(
        u[3][2][1].abs() < 1e-9 && (u[3][4][1] + 0.01).abs() < 1e-9,
        "{:?}",
        u[3]
    );
}

/// A pair that a later step adds again has no history; with a stick slope programs disagree about that.
#[test]
fn pairs_that_are_added_have_no_springs() {
    let begin = squares([1.0; 2], "");
    let change = |what: &str| format!("*MODEL CHANGE, TYPE=CONTACT PAIR, {what}\nSupper, Slower\n");
    let changes = |friction: &str, of_steps: &[&str]| {
        let begin = begin.replace("NAME=hard\n", &format!("NAME=hard\n{friction}"));
        let begin = begin
            .split(STATIC)
            .next()
            .expect("what is before the steps");
        let steps = of_steps.iter().map(|what| {
            let change = if what.is_empty() {
                String::new()
            } else {
                change(what)
            };
            format!("{STATIC}{change}*END STEP\n")
        });
        let steps: String = steps.collect();
        read(&format!("{begin}{steps}"), &[], &[])
    };
    let slope = "*FRICTION\n0.5, 1e3\n";
    for steps in [&["", "REMOVE", "ADD"], &["REMOVE", "", "ADD"]] {
        let error = changes(slope, steps).expect_err("springs that begin");
        let said = error.contains("MODEL CHANGE, ADD") && error.contains("leave the slope out");
        assert!(said, "{error}");
        changes("*FRICTION\n0.5\n", steps).or_panic();
    }
    for steps in [&["", "REMOVE"][..], &["ADD", ""], &["", "ADD"]] {
        changes(slope, steps).or_panic();
    }
}

/// All entries that change the result are refused in one message, by line and by their names for `--ignore`; the others
/// are skipped.
#[test]
fn unsupported_entries_are_reported_at_once() {
    let text = strip(
        "*MATERIAL, NAME=other\n*PLASTIC\n1.,0.\n*ELEMENT,TYPE=SPRINGA,ELSET=Espring\n20,1,2\n*SPRING,ELSET=Espring,NONLINEAR\n\n3.\n\
         *STEP, NLGEOM\n*STATIC\n*NODE PRINT,NSET=Nall\nU\n*CLOAD\n99,1,5.\n*END STEP\n*STEP, NLGEOM\n*STATIC\n*END STEP\n",
    );
    let error = read(&text, &[], &[]).expect_err("refusals");
    let keys = "--ignore 'CLOAD,PLASTIC,SPRING'";
    assert!(error.contains(keys), "{error}");
    for line in [
        "\n  line 39: *PLASTIC: only linear-elastic materials are supported",
        "\n  line 43: *SPRING, NONLINEAR: springs are linear",
        "\n  line 51: *CLOAD: this node belongs to no element of a body",
    ] {
        assert!(error.contains(line), "{line} is not in {error}");
    }
    let ignored = ["nlgeom", "*Plastic", "SPRING", "CLOAD"];
    let deck = read(&text, &[], &ignored).or_panic();
    let notes = deck.notes.join("\n");
    assert!(notes.contains("line 48: *NODE PRINT is skipped"), "{notes}");
    assert!(
        notes.contains("line 46: *NLGEOM (ignored) is skipped"),
        "{notes}"
    );
    // Invalid entries cannot be ignored.
    for (rest, expected) in [
        (
            "*STEP\n*STATIC\n*CLOAD\nNowhere,1,5.\n*END STEP\n",
            "line 41: there is no node set \"NOWHERE\"",
        ),
        (
            "*STEP\n*STATIC\n*CLOAD\nNright,1,five\n*END STEP\n",
            "line 41: \"five\" is not a number",
        ),
        (
            "*STEP\n*STATIC\n*CLOAD\nNright,1\n*END STEP\n",
            "line 41: *CLOAD needs a node or set",
        ),
        (
            "*STEP\n*STATIC\n*DLOAD\nEall,P7,1.\n*END STEP\n",
            "line 41: P7 is not a face of this element",
        ),
        ("", "there is no *STEP: this is a mesh"),
    ] {
        let error = read(&strip(rest), &[], &[]).expect_err(rest);
        assert!(error.contains(expected), "{rest}: {error}");
    }
}

/// The first of several cards of a kind in a step says whether those of earlier steps go: the others add to it.
#[test]
fn cards_of_a_step_go_together() {
    for (one, two) in [
        ("*CLOAD,OP=NEW\n5,1,5.\n", "*CLOAD,OP=NEW\n15,1,5.\n"),
        ("*DLOAD,OP=NEW\n4,P2,-10.\n", "*DLOAD,OP=NEW\n4,P2,-10.\n"),
        (
            "*DSLOAD,OP=NEW\nSend,P,-10.\n",
            "*DSLOAD,OP=NEW\nSend,P,-10.\n",
        ),
    ] {
        // The load of the first step goes in the second one.
        let first = "*CLOAD\n3,1,100.\n*DLOAD\n2,P3,-7.\n*DSLOAD\nSmiddle,P,-7.\n";
        let keyword = &one[..one.find(',').expect("an option")];
        let first: String = first
            .split_inclusive('\n')
            .collect::<Vec<_>>()
            .chunks(2)
            .filter(|card| card[0].trim_end() == keyword)
            .flatten()
            .copied()
            .collect();
        let steps = format!(
            "*SURFACE,NAME=Smiddle\n2,S3\n{STATIC}{first}*END STEP\n{STATIC}{one}{two}*END STEP\n"
        );
        let u = displacements(&built(&read(&strip(&steps), &[], &[]).or_panic()));
        assert!((u[1][4][0] - 0.4).abs() < 1e-9, "{keyword}: {:?}", u[1][4]);
    }
    // Supports: without the second card the bar would not be held.
    let held = "*BOUNDARY,OP=NEW\nNleft,1\n*BOUNDARY,OP=NEW\n1,2\n*CLOAD\nNright,1,5.\n";
    let deck = read(&strip(&format!("{STATIC}{held}*END STEP\n")), &[], &[]).or_panic();
    let u = displacements(&built(&deck)).remove(0);
    assert!((u[4][0] - 0.4).abs() < 1e-9, "{u:?}");
}

/// A volume load replaces that of an earlier step on the same elements, whatever these are called.
#[test]
fn loads_are_those_of_their_elements() {
    let sets = "*ELSET,ELSET=Again,GENERATE\n1,4\n";
    for again in ["EALL", "Again", ""] {
        let load =
            |set: &str, g: f64| format!("{STATIC}*DLOAD\n{set},GRAV,{g},1.,0.,0.\n*END STEP\n");
        let text = strip(&format!("{sets}{}{}", load("Eall", 2.0), load(again, 4.0)));
        let u = displacements(&built(&read(&text, &[], &[]).or_panic()));
        assert!(
            (u[1][4][0] - 2.0 * u[0][4][0]).abs() < 1e-9,
            "{again}: {:?} {:?}",
            u[0][4],
            u[1][4]
        );
    }
}

/// Amplitudes in total time go on in steps that do not state their load or support again.
#[test]
fn total_time_goes_on() {
    let amplitude = "*AMPLITUDE,NAME=ramp,TIME=TOTAL TIME\n0.,0.,2.,2.,3.,1.\n";
    for (stated, end) in [
        ("*CLOAD,AMPLITUDE=ramp\nNright,1,5.\n", 0.4),
        ("*BOUNDARY,AMPLITUDE=ramp\nNright,1,1,0.3\n", 0.3),
    ] {
        let text = strip(&format!(
            "{amplitude}{STATIC}{stated}*END STEP\n{STATIC}*END STEP\n{STATIC}*END STEP\n"
        ));
        let u = displacements(&built(&read(&text, &[], &[]).or_panic()));
        for (u, factor) in u.iter().zip([1.0, 2.0, 1.0]) {
            assert!(
                (u[4][0] - factor * end).abs() < 1e-9,
                "{stated}: {:?}",
                u[4]
            );
        }
    }
}

/// A set of nodes may be those of a set of elements.
#[test]
fn sets_of_nodes_may_be_those_of_elements() {
    let text = strip(&format!(
        "*ELSET,ELSET=Elast\n4\n*NSET,NSET=Nlast,ELSET=Elast\n{STATIC}*BOUNDARY\nNlast,1,1,0.3\n*END STEP\n"
    ));
    let u = displacements(&built(&read(&text, &[], &[]).or_panic())).remove(0);
    for (u, expected) in u.iter().zip([0.0, 0.1, 0.2, 0.3, 0.3]) {
        assert!((u[0] - expected).abs() < 1e-9, "{u:?}");
    }
}

/// What a deck says and this program does not do is refused, with its line.
#[test]
fn options_that_change_the_answer_are_refused() {
    let bar =
        "*ELEMENT,TYPE=T2D2,ELSET=Ebar\n50,1,5\n*SOLID SECTION,ELSET=Ebar,MATERIAL=soft\n0.1\n";
    let surfaces = "*SURFACE INTERACTION,NAME=I\n";
    let end = format!("{STATIC}*END STEP\n");
    for (rest, expected) in [
        (format!("{bar}{end}"), "\"Ebar\" has no elements of bodies"),
        (
            format!("{surfaces}*SURFACE BEHAVIOR,NO SEPARATION\n{end}"),
            "NO SEPARATION: this option is not understood",
        ),
        (
            format!("{surfaces}*SURFACE BEHAVIOR,PENALTY\n100.\n{end}"),
            "PENALTY with a stiffness",
        ),
        (
            format!("*SURFACE INTERACTION,NAME=I,USER\n{end}"),
            "USER: this option is not understood",
        ),
        (
            format!("{surfaces}*FRICTION\n0.3,,0.\n0.1,,5.\n{end}"),
            "the coefficient cannot depend on",
        ),
        (
            format!("{surfaces}{STATIC}*FRICTION\n0.1\n*END STEP\n"),
            "*FRICTION in a step needs a *CHANGE FRICTION",
        ),
        (
            format!("{surfaces}{surfaces}{end}"),
            "*SURFACE INTERACTION \"I\" is stated twice",
        ),
        (
            format!("{STATIC}*DSLOAD\nSend,P,1.\n*END STEP\n{STATIC}*DLOAD,OP=NEW\nEall,GRAV,2.,1.,0.,0.\n*END STEP\n"),
            "while loads of *DSLOAD go on",
        ),
        (
            "*STEP\n*STATIC,RIKS\n*END STEP\n".to_owned(),
            "RIKS: this option is not understood",
        ),
        (
            "*AMPLITUDE,NAME=a,TIME=TOTAL TIME\n0.,0.,2.,2.\n*STEP\n*STATIC,TIME RESET\n*END STEP\n".to_owned(),
            "TIME RESET: this option is not understood",
        ),
        (
            format!(
                "*NSET,NSET=One,UNSORTED\n5,4\n*NSET,NSET=Two,UNSORTED\n14,15\n*EQUATION\n2\nOne,1,1.,Two,1,-1.\n{end}"
            ),
            "as it is UNSORTED",
        ),
        (
            "*ELEMENT,TYPE=SPRINGA,ELSET=Espring\n50,5,99\n*SPRING,ELSET=Espring\n\n3.\n*BOUNDARY\n99,1,2\n*STEP,NLGEOM\n*STATIC\n*END STEP\n".to_owned(),
            "needs elements at both ends",
        ),
        (
            format!("*ELEMENT,TYPE=CPS4,ELSET=Eall\n50,4,15,5,15\n{end}"),
            "element 50 has node 15 at several corners",
        ),
        (
            format!("*ELEMENT,TYPE=CPS8,ELSET=Eall\n50,1,2,12,11,2,3,4,5\n{end}"),
            "line 39: element 50 has node 2 twice: nodes in the middle of sides",
        ),
        (
            format!("*NODE\n20,5,0\n21,5,1\n*ELEMENT,TYPE=CPS4,ELSET=Eall\n50,5,15,20,21\n{end}"),
            "line 42: element 50 near (4.000000e0, 0.000000e0) has no area or folds over itself",
        ),
        (
            format!("*NSET,NSET=Some,GENRATE\n1,4,1\n{end}"),
            "*NSET, GENRATE: this option is not understood",
        ),
        (
            format!("*NSET,NSET=Some,\n1,4\n5\n{end}"),
            "line 38: *NSET: its line ends with a comma and goes on in the next one",
        ),
        (
            format!("*SURFACE,NAME=Both,COMBINE=UNION\nSend,Sbelow\n{end}"),
            "*SURFACE, COMBINE=UNION: this option is not understood",
        ),
        (
            format!("*INITIAL CONDITIONS,TYPE=TEMPERATURE,FILE=hot.odb\n{end}"),
            "FILE=HOT.ODB: this option is not understood",
        ),
        (
            format!("*RESTART,READ\n{end}"),
            "*RESTART, READ: this option is not understood",
        ),
        (
            "*STEP,NLGOEM\n*STATIC\n*END STEP\n".to_owned(),
            "*STEP, NLGOEM: this option is not understood",
        ),
        (
            format!("*MATERIAL,NAME=odd\n*ELASTIC,TYPE=ORTHO\n1.,1.,1.,1.,1.,1.,1.,1.\n1.\n{end}"),
            "*ELASTIC, TYPE=ORTHO: materials are isotropic",
        ),
        (
            format!("*MATERIAL,NAME=odd\n*ELASTIC\n1.,0.\n*EXPANSION,TYPE=ORTHO\n1.,2.,3.\n{end}"),
            "to go on without it: --ignore 'EXPANSION'",
        ),
        (
            format!("*MATERIAL,NAME=SOFT\n*ELASTIC\n1.,0.\n{end}"),
            "line 38: *MATERIAL \"SOFT\" is stated twice",
        ),
        (
            format!("*AMPLITUDE,NAME=a\n0.,0.,1.,1.\n*AMPLITUDE,NAME=A\n0.,1.,1.,1.\n{end}"),
            "line 40: *AMPLITUDE \"A\" is stated twice",
        ),
        (
            format!("*SURFACE,NAME=SEND\n1,S4\n{end}"),
            "line 38: *SURFACE: \"SEND\" is stated twice",
        ),
        (
            format!("{STATIC}*DLOAD\nEall,GRAV,9.81,0.,0.,0.\n*END STEP\n"),
            "line 42: *DLOAD, GRAV: the direction is zero",
        ),
        (
            format!("{STATIC}*DLOAD\nEall,CENTRIF,2.,0.,0.,0.,0.,0.,0.\n*END STEP\n"),
            "line 42: *DLOAD, CENTRIF: the axis is zero",
        ),
        (
            format!("{STATIC}*DLOAD\n1,P2,5.\n*END STEP\n"),
            "line 42: *DLOAD, P2: a face of \"1\" lies between elements",
        ),
        (
            format!("{STATIC}*CLOAD\nNright,3,5.\n*END STEP\n"),
            "--ignore 'CLOAD'",
        ),
        (
            format!("*PART,NAME=p\n*BOUNDARY\n1,1\n*END PART\n{end}"),
            "line 39: *BOUNDARY within a part or an instance",
        ),
    ] {
        let error = read(&strip(&rest), &[], &[]).expect_err(expected);
        assert!(error.contains(expected), "{error}");
    }
}

/// What changes nothing here is read: options of increments, the stiffness that a program chooses, sets of one node in any order, and
/// quadrilaterals that are triangles.
#[test]
fn options_that_change_nothing_are_read() {
    for rest in [
        "*SURFACE INTERACTION,NAME=I\n*SURFACE BEHAVIOR,PENALTY\n,,1.\n",
        "*NSET,NSET=One,UNSORTED\n5\n*EQUATION\n2\nOne,1,1.,15,1,-1.\n",
        "*ELEMENT,TYPE=CPS4,ELSET=Eall\n50,5,99,15,15\n",
        "*SECTION CONTROLS,NAME=c,HOURGLASS=ENHANCED\n1.,1.,1.\n*SOLVER CONTROLS\n*SOLUTION TECHNIQUE\n*FILE OUTPUT\n*LATENT HEAT\n1.\n",
        "*SURFACEINTERACTION,NAME=I\n*SURFACEBEHAVIOR,PRESSURE-OVERCLOSURE=HARD\n*INITIALCONDITIONS,TYPE=TEMPERATURE\nNright,0.\n",
        "*NSET,\n** a comment\nNSET=One\n5\n*EQUATION\n2\nOne,1,1.,15,1,-1.\n",
        "*NSET,NSET=Face.1\n5\n*ELSET,ELSET=End.2\n4\n*SURFACE,NAME=S.3\nEnd.2,S2\n*NSET,NSET=All.4\nFace.1,15\n*EQUATION\n2\nFace.1,1,1.,15,1,-1.\n",
    ] {
        let text = strip(&format!(
            "{rest}*STEP\n*STATIC,DIRECT,TIME RESET\n1.,1.\n*CLOAD\nNright,1,5.\n*END STEP\n"
        ));
        read(&text, &[], &[]).or_panic();
    }
}

/// An error about an entry of a deck names its line, as if the case had been written by hand.
#[test]
fn errors_of_the_case_name_lines_of_the_deck() {
    let text = strip("*STEP\n*STATIC\n*CLOAD\nNright,1,1e80\n*END STEP\n");
    let case = Case::of_deck(read(&text, &[], &[]).or_panic(), &[]).or_panic();
    let error = case.build().expect_err("too large").to_string();
    assert!(error.contains("deck.inp, line 41: "), "{error}");
}

/// The case file made from a deck, with its mesh beside it, is the same problem.
#[test]
fn a_converted_deck_is_the_same_problem() {
    let text = strip(&format!(
        "{STATIC}*CLOAD\nNright,2,1.\n*DLOAD\n2,P3,7.\n*END STEP\n"
    ));
    let deck = read(&text, &[], &[]).or_panic();
    let expected = displacements(&built(&deck));
    let place = tempfile::tempdir().or_panic();
    std::fs::write(place.path().join("deck.msh"), msh(&deck.mesh)).or_panic();
    let path = place.path().join("case.toml");
    std::fs::write(&path, written(&deck)).or_panic();
    let case = Case::read(&path, &[]).or_panic();
    assert_eq!(case.tables.title, "A strip");
    assert_eq!(displacements(&case.build().or_panic()), expected);
    for table in [
        "# deck.inp, line 36\n[[support]]\nnodes = \"Nleft\"\nx = 0.0\n",
        "[[support]]\nnodes = \"support-1\"\ny = 0.0\n",
        "[[force]]\nnodes = \"Nright\"\ny = 1.0\n",
        "[[traction]]\nboundary = \"pressure-1\"\npressure = 7.0\n",
    ] {
        let text = written(&deck);
        let case = text.lines().map(|line| match line.strip_prefix("# ") {
            Some(place) => format!("# {}\n", place.rsplit('/').next().unwrap_or_default()),
            None => format!("{line}\n"),
        });
        let case: String = case.collect();
        assert!(case.contains(table), "{table} is not in {case}");
    }
}

/// The contact pressures at nodes at the end of the last load step, with the numbers of the nodes.
fn pressures(problem: &CaseProblem) -> Vec<(usize, f64)> {
    fn of<const D: usize>(built: &Built<D>) -> Vec<(usize, f64)>
    where
        ElementKind: Topology<D> + signorini::contact::Space<D>,
    {
        let mut engine = Engine::new(&built.problem, EngineOptions::default(), |_| {}).or_panic();
        let mut all = Vec::new();
        let solved = Analysis::from(built).solve_on(&mut engine, &Default::default(), |event| {
            if let Event::Ends(step) = event {
                let there = step.displaced.as_deref().unwrap_or(built);
                let data = step.data.expect("of a model");
                let (problem, elastic) = (&there.problem, &there.elastic);
                let fields = ContactFields::new(problem, elastic, data, &step.solution);
                let places = elastic.contact.places.iter().zip(fields.pressure);
                all = places
                    .filter_map(|(place, p)| Some((place.node? as usize, p)))
                    .collect();
            }
            ControlFlow::Continue(())
        });
        solved.or_panic();
        all
    }
    let CaseProblem::Elastic(built) = problem else {
        panic!("no bodies");
    };
    match &**built {
        AnyBuilt::Plane(built) => of(built),
        AnyBuilt::Space(built) => of(built),
    }
}

/// The static decks of CalculiX's own tests that run here, linear and with large displacements, and those with contact.
const DECKS: &[&str] = &[
    "achtelc",
    "achteld",
    "achtelg",
    "achtelp",
    "beam10p",
    "beam20p",
    "beam8p",
    "beamd",
    "beamidset",
    "beamp",
    "beamp2stage",
    "beampic",
    "beampis",
    "beampset",
    "c3d15",
    "planestrain",
    "planestrain2",
    "planestress",
    "segment1",
    "segment2",
    "segmentf",
    "beam8t",
    "beamt",
    "beamt2",
    "beamptied1",
    "beamptied2",
    "contactenergy",
    "cubef2f2",
    "friction1",
    "plate",
    "contact4",
    "cubespring",
    "contact3",
    "contact6",
    "fricloop",
    "achtel2",
    "beampdepmpc",
    "oneel",
    "axial",
    "ring1",
    "ring2",
    "cubef2f1",
    "hueeber1",
    "hueeber2",
    "hueeber3",
    "hueeber4",
    "contact1",
    "changefric",
    "contact2",
    "friction2",
    "scheibe2f2f",
    "changesurfbeh",
    "segmentm",
    "disk2",
    "distcoup",
    "planestress2",
];

/// Those of them with NLGEOM that run without it, here and there.
const SMALL: &[&str] = &["friction2", "changesurfbeh"];

/// Those of them whose contact pressures are compared, too: with hard contact, or nearly, and without a border of it within a
/// facet, where CalculiX extrapolates to nodes from points.
const PRESSED: &[&str] = &["contactenergy", "cubespring", "hueeber3"];

/// The values of a field of the last step in an .frd file, by the numbers of nodes.
fn last<const N: usize>(frd: &str, field: &str) -> HashMap<u64, [f64; N]> {
    let mut all = HashMap::new();
    let mut inside = false;
    for line in frd.lines() {
        match line.get(..3) {
            Some(" -4") => {
                inside = line.get(5..13).map(str::trim) == Some(field);
                if inside {
                    all.clear();
                }
            }
            Some(" -3") => inside = false,
            Some(" -1") if inside => {
                let number = line[3..13].trim().parse().or_panic();
                let value = |c: usize| line[13 + 12 * c..25 + 12 * c].trim().parse().or_panic();
                all.insert(number, std::array::from_fn(value));
            }
            _ => {}
        }
    }
    all
}

/// A deck that writes only displacements, with fully integrated elements of second order, as here.
fn for_ccx(text: &str) -> String {
    let pair = text.to_uppercase().contains("*CONTACT PAIR");
    let mut kept = String::new();
    let mut skips = false;
    for line in text.lines() {
        let upper = line.to_uppercase();
        if upper.starts_with('*') && !upper.starts_with("**") {
            let output = [
                "*NODE FILE",
                "*NODE PRINT",
                "*EL FILE",
                "*EL PRINT",
                "*CONTACT FILE",
                "*CONTACT PRINT",
            ];
            skips = output.iter().any(|keyword| upper.starts_with(keyword));
            if upper.starts_with("*END STEP") {
                kept += "*NODE FILE\nU\n";
                if pair {
                    kept += "*CONTACT FILE\nCDIS,CSTR\n";
                }
            }
        }
        if skips {
            continue;
        }
        let mut line = line.to_owned();
        if upper.starts_with("*ELEMENT") {
            line = upper
                .replace("C3D20R", "C3D20")
                .replace("CPS8R", "CPS8")
                .replace("CAX8R", "CAX8");
        }
        kept += &(line + "\n");
    }
    kept
}

/// Displacements of CalculiX (packages calculix-ccx and calculix-ccx-test of Debian) beside ours, on its own decks.
#[test]
#[ignore = "needs ccx and its test decks (Debian: calculix-ccx, calculix-ccx-test)"]
fn decks_of_calculix_are_solved_as_it_solves_them() {
    let folder = Path::new("/usr/share/doc/calculix-ccx-test/examples/test");
    let mut worse_than_a_thousandth = Vec::new();
    for &name in DECKS {
        let text = [format!("{name}.inp"), format!("{name}.inp.gz")]
            .iter()
            .find_map(|file| {
                let path = folder.join(file);
                let read = match file.ends_with("gz") {
                    true => {
                        Command::new("gzip")
                            .arg("-dc")
                            .arg(&path)
                            .output()
                            .ok()?
                            .stdout
                    }
                    false => std::fs::read(&path).ok()?,
                };
                (!read.is_empty()).then(|| String::from_utf8_lossy(&read).into_owned())
            });
        let text =
            text.unwrap_or_else(|| panic!("{name}: there is no such deck in {}", folder.display()));
        let text = match SMALL.contains(&name) {
            true => text.replace(",NLGEOM", ""),
            false => text,
        };
        // It leaves out the moment of a force beside the centre of the nodes that share it.
        let text = match name {
            "distcoup" => text.replace("262,0.,0.,0.", "262,.5,.5,8."),
            _ => text,
        };
        let place = tempfile::tempdir().or_panic();
        let path = place.path().join(format!("{name}.inp"));
        std::fs::write(&path, for_ccx(&text)).or_panic();
        let run = Command::new("ccx")
            .arg(name)
            .current_dir(place.path())
            .output();
        let run = run.expect("ccx runs");
        let frd = std::fs::read_to_string(path.with_extension("frd")).or_panic();
        let theirs = last::<3>(&frd, "DISP");
        assert!(
            !theirs.is_empty(),
            "{name}: {}",
            String::from_utf8_lossy(&run.stdout)
        );
        let deck = deck::read(&path, "deck.msh", &[]).or_panic();
        let problem = built(&deck);
        let ours = displacements(&problem).pop().expect("a step");
        let size = |u: [f64; 3]| u.iter().fold(0.0_f64, |size, v| size.hypot(*v));
        let largest = theirs.values().map(|&u| size(u)).fold(0.0, f64::max);
        let mut worst = 0.0_f64;
        for (number, u) in deck.node_numbers.iter().zip(ours) {
            let Some(v) = theirs.get(number) else {
                continue;
            };
            worst = worst.max(size(std::array::from_fn(|c| u[c] - v[c])) / largest);
        }
        println!("{name:<14} largest displacement {largest:.4e}, differs by {worst:.1e} of it");
        assert!(worst < 0.01, "{name}: {worst:e}");
        if PRESSED.contains(&name) {
            // Opening, slip (two), pressure, shear (two).
            let theirs = last::<6>(&frd, "CONTACT");
            let largest = theirs.values().map(|v| v[3]).fold(0.0, f64::max);
            let ours = pressures(&problem);
            let node = |number: u64| theirs.get(&number).map(|v| v[3]);
            let both = (ours.iter())
                .filter_map(|&(node_of, p)| Some((p, node(deck.node_numbers[node_of])?)));
            let both: Vec<(f64, f64)> = both.collect();
            assert!(both.len() > 3, "{name}");
            let off = both.iter().map(|(p, q)| (p - q).abs()).fold(0.0, f64::max);
            println!(
                "{:<14} largest pressure {largest:.4e}, differs by {:.1e} of it at {} nodes",
                "",
                off / largest,
                both.len()
            );
            assert!(off < 0.01 * largest, "{name}: {off:e}");
        }
        if worst > 1e-3 {
            worse_than_a_thousandth.push(name);
        }
    }
    assert!(
        2 * worse_than_a_thousandth.len() < DECKS.len(),
        "{worse_than_a_thousandth:?}"
    );
}
