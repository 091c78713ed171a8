//! Problems of the plane, extruded: one layer of hexahedra that cannot move across gives the plane's answer. Between flat
//! faces the mortar rows are the same, and so is everything.

use crate::common::or_panic::OrPanic as _;
use crate::common::{built, case, published};
use signorini::case::{Case, CaseProblem};
use signorini::contact::Space;
use signorini::dual::DirectDual;
use signorini::mesh::ElementKind;
use signorini::model::Built;
use signorini::quasistatic::{self, State};
use signorini::ssnm::Status;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

/// The width of a solid.
const WIDTH: f64 = 0.3;

/// A case of the plane as one of space: its y axis is that of space, and z goes across.
fn extruded(text: &str) -> String {
    let names = |line: &str| line.replace("bottom", "front").replace("top", "back");
    let (mut made, mut parts) = (String::new(), Vec::new());
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        let key = line.split([' ', '=']).next().unwrap_or_default();
        match key {
            "rectangle" => made += &wider(line),
            "boundary" | "against" => made += &names(line),
            "shift" => made += &line.replace(']', ", 0]"),
            "obstacle" => {
                made += &(line.replace("half_plane", "half_space")).replace(']', ", 0]");
            }
            // A node of the plane is an edge across the solid.
            "point" => {
                let component = lines.next().unwrap_or_default();
                let at = |z: f64| line.replace(']', &format!(", {z}]"));
                made += &format!(
                    "{}\n{component}\n[[support]]\n{}\n{component}",
                    at(0.0),
                    at(WIDTH)
                );
            }
            "name" => {
                parts.extend(line.split('"').nth(1).map(|name| format!("{name}-")));
                made += line;
            }
            _ => made += line,
        }
        made.push('\n');
    }
    if parts.is_empty() {
        parts.push(String::new());
    }
    // Before the tables that occur once in the case.
    let held = parts
        .iter()
        .map(|part| format!("\"{part}bottom\", \"{part}top\""));
    let held = held.collect::<Vec<_>>().join(", ");
    made + &format!("[[support]]\nboundary = [{held}]\nz = 0\n")
}

/// A rectangle's line as that of a box one cell wide.
fn wider(line: &str) -> String {
    let mut made = String::new();
    let mut parts = line.replace("rectangle", "box");
    while let Some(end) = parts.find(']') {
        let rest = parts.split_off(end);
        let key = parts.rsplit_once(" = [").map_or("", |(before, _)| before);
        let key = key.rsplit([' ', '{', ',']).next().unwrap_or_default();
        let more = match key {
            "size" => format!(", {WIDTH}"),
            "cells" => ", 1".to_owned(),
            "origin" => ", 0".to_owned(),
            "map" => ", \"z\"".to_owned(),
            _ => panic!("{key} in {line}"),
        };
        made += &(parts + &more + "]");
        parts = rest[1..].to_owned();
    }
    made + &parts
}

/// The final state of a contact place.
struct Contact<const D: usize> {
    place: [f64; D],
    area: f64,
    partners: Vec<(u32, f64)>,
    pressure: f64,
    traction: Vec<f64>,
    separated: bool,
    slips: bool,
}

struct Solved<const D: usize> {
    places: Vec<[f64; D]>,
    displacement: Vec<[f64; D]>,
    contacts: Vec<Contact<D>>,
    products: usize,
}

fn solve<const D: usize>(case: &Case, build: &Built<D>, tolerance: f64) -> Solved<D>
where
    ElementKind: Space<D>,
{
    let elastic = &build.elastic;
    let mut dual = DirectDual::new(&build.problem).or_panic();
    let mut settings = case.settings();
    settings.ssnm.tolerance = tolerance;
    let mut state = State::at_rest(&build.problem);
    let mut last = None;
    let mut products = 0;
    for number in 0..case.n_steps() {
        let data = build.step(number).or_panic();
        let go_on = |_: quasistatic::Event| ControlFlow::Continue(());
        let (problem, load) = (&build.problem, &data.load);
        let solution = quasistatic::solve_step(
            problem,
            load,
            &state,
            &mut dual,
            &settings,
            &mut Default::default(),
            go_on,
        )
        .or_panic();
        assert_eq!(solution.status, Status::Converged);
        products += solution.n_a();
        state = solution.state(&data.load);
        last = Some((data, solution));
    }
    let (data, solution) = last.expect("a case has a step");
    let contacts = (elastic.contact.places.iter().enumerate())
        .map(|(i, place)| {
            // As they are: the pooling for figures depends on the dimension.
            let m = elastic.contact.places.len();
            let (frame, along) = (&place.frame, &solution.lambda[m + (D - 1) * i..][..D - 1]);
            let force = |c: usize| {
                let rubbed: f64 = (0..D - 1).map(|k| along[k] * frame[1 + k][c]).sum();
                -solution.lambda[i] * frame[0][c] - rubbed
            };
            Contact {
                place: place.place,
                area: place.area,
                partners: place.partners.clone(),
                pressure: solution.lambda[i] / place.area,
                traction: (0..D).map(|c| force(c) / place.area).collect(),
                separated: solution.sets.is_separated(i),
                slips: solution.sets.slips(i),
            }
        })
        .collect();
    Solved {
        places: elastic.mesh.nodes.clone(),
        displacement: data.unknowns.displacements(&solution.u),
        contacts,
        products,
    }
}

/// How far the answers of the plane and of space are apart.
#[derive(Default)]
struct Apart {
    /// Displacements, of the largest one.
    u: f64,
    /// Tractions, of the largest pressure.
    traction: f64,
    /// Weights of partners, summed over both layers.
    weights: f64,
    /// Multipliers in other sets.
    sets: usize,
}

/// Solves a case of the plane and its extrusion and compares displacements, tractions, sets, and the mortar rows.
fn apart(name: &str, text: &str, tolerance: f64) -> Apart {
    let plane = case(text);
    let build = built(&plane);
    let plane = solve(&plane, &build, tolerance);
    let text = extruded(text);
    let solid = case(&text);
    let solid = match solid.build().map(CaseProblem::space) {
        Ok(Some(build)) => solve(&solid, &build, tolerance),
        Ok(None) => panic!("this is no case in space:\n{text}"),
        Err(error) => panic!("{error}\n{text}"),
    };
    // Each part has its nodes twice, one layer after the other: those of the same place are in the same order.
    let mut layers: [Vec<u32>; 2] = Default::default();
    for (node, place) in (0..).zip(&solid.places) {
        layers[usize::from(place[2] > 0.5 * WIDTH)].push(node);
    }
    let (mut apart, mut largest, mut top) = (Apart::default(), 0.0f64, 0.0f64);
    for layer in &layers {
        assert_eq!(layer.len(), plane.places.len());
        for (&node, there) in layer.iter().zip(0..) {
            let (at, from) = (solid.places[node as usize], plane.places[there as usize]);
            assert!((at[0] - from[0]).hypot(at[1] - from[1]) < 1e-12);
            let (v, u) = (
                solid.displacement[node as usize],
                plane.displacement[there as usize],
            );
            largest = largest.max(u[0].hypot(u[1]));
            apart.u = apart.u.max((v[0] - u[0]).hypot(v[1] - u[1]).hypot(v[2]));
        }
    }
    for here in &solid.contacts {
        let off =
            |there: &&Contact<2>| (0..2).all(|c| (there.place[c] - here.place[c]).abs() < 1e-9);
        // Far from each other curved boundaries may be just within reach of each other in one of them.
        let Some(expected) = plane.contacts.iter().find(off) else {
            assert!(here.separated, "{:?}", here.place);
            continue;
        };
        top = top.max(expected.pressure);
        let [x, y] = [0, 1].map(|c| here.traction[c] - expected.traction[c]);
        let off = x.hypot(y).max(here.traction[2].abs());
        apart.traction = (apart.traction).max((here.pressure - expected.pressure).abs().max(off));
        apart.sets += usize::from(here.separated != expected.separated);
        apart.sets += usize::from(here.slips != expected.slips);
        // Half of the width to either layer; both layers of the other side together have the weight of its node.
        apart.weights = apart
            .weights
            .max((here.area / (0.5 * WIDTH * expected.area) - 1.0).abs());
        let weights = expected.partners.iter();
        let mut sums: BTreeMap<u32, f64> = weights.map(|&(j, w)| (j, -w)).collect();
        for &(partner, weight) in &here.partners {
            let other = usize::from(solid.places[partner as usize][2] > 0.5 * WIDTH);
            let place = layers[other].partition_point(|&node| node < partner);
            *sums.entry(place as u32).or_default() += weight;
        }
        apart.weights = sums
            .values()
            .fold(apart.weights, |worst, sum| worst.max(sum.abs()));
    }
    apart.u /= largest;
    apart.traction /= top;
    println!(
        "{name}: {} nodes, u off by {:.1e}, tractions by {:.1e} of the largest pressure, mortar weights by {:.1e}, \
         {} multipliers of {} in other sets; {} and {} products",
        solid.places.len(),
        apart.u,
        apart.traction,
        apart.weights,
        apart.sets,
        3 * solid.contacts.len(),
        plane.products,
        solid.products
    );
    apart
}

/// Like [`apart`], for values that have to be equal.
fn the_same(name: &str, text: &str) {
    let apart = apart(name, text, 1e-10);
    assert!(apart.u < 1e-7 && apart.traction < 1e-6);
    assert!(apart.weights < 1e-11 && apart.sets == 0);
}

/// A crooked block pressed and pushed on another one, with an overhang.
#[test]
fn flat_faces_extruded() {
    for sides in [
        "boundary = \"up-bottom\"\nagainst = \"low-top\"",
        "boundary = \"low-top\"\nagainst = \"up-bottom\"",
    ] {
        for friction in ["\"none\"", "{ tresca = 2 }", "{ coulomb = 0.3 }"] {
            let text = format!(
                "[[mesh.part]]\nname = \"low\"\n\
                 rectangle = {{ size = [3, 1], cells = [17, 6], map = [\"x + 0.05*sin(pi*x/3)*sin(5*x)\", \"y + 0.04*sin(3*x)*sin(pi*y)\"] }}\n\
                 [[mesh.part]]\nname = \"up\"\n\
                 rectangle = {{ size = [1.5, 1], cells = [11, 7], map = [\"x\", \"y - 0.03*sin(2*x)*sin(pi*y)\"] }}\n\
                 shift = [1.76, 1]\n\
                 [[material]]\nyoung = 3000\npoisson = 0.3\n\
                 [[support]]\nboundary = \"low-bottom\"\nx = 0\ny = 0\n\
                 [[support]]\nboundary = \"up-top\"\nx = 0.004\ny = \"-0.01*(1 - 0.4*(x - 1.76))\"\n\
                 [[contact]]\n{sides}\nfriction = {friction}\n"
            );
            the_same(&format!("two blocks, {friction}"), &text);
        }
    }
}

#[test]
fn greco_extruded() {
    the_same("GRECO", &published::greco(32));
}

/// Curved faces: places that meet are on a common normal, in space as in the plane.
#[test]
fn hertz_extruded() {
    for (name, sides) in [
        (
            "plate",
            "boundary = \"plate-top\"\nagainst = \"disc-bottom\"",
        ),
        (
            "disc",
            "boundary = \"disc-bottom\"\nagainst = \"plate-top\"",
        ),
    ] {
        let text = published::hertz(50.0, 40, 0.2, [70000.0, 210000.0], 35000.0, sides);
        let apart = apart(&format!("Hertz, λ on the {name}"), &text, 1e-8);
        assert!(apart.u < 1e-4 && apart.traction < 1e-3);
    }
}

#[test]
fn cattaneo_extruded() {
    let text = published::cattaneo(0.21, "{ coulomb = 0.2 }", 32);
    let apart = apart("Cattaneo", &text, 1e-8);
    assert!(apart.u < 2e-4 && apart.traction < 2e-3 && apart.sets == 0);
}
