//! One block among obstacles, and a stack of them.

use super::super::Random;
use super::super::draw::{chance, decade, pick};
use super::{
    Factors, Laws, Range, Stuff, Turn, Written, cells, coefficient, friction, half_plane, list,
    pressure, support, traction,
};
use std::fmt::Write as _;

/// One block with rigid obstacles around it.
pub fn one_body(random: &mut Random, range: Range) -> Written {
    let stuff = Stuff::new(random, range);
    let scale = decade(random, range.length[0], range.length[1]);
    let [w, h] = pick(
        random,
        &[
            [1.0, 1.0],
            [2.0, 1.0],
            [4.0, 1.0],
            [10.0, 1.0],
            [1.0, 2.0],
            [1.0, 3.0],
            [1.5, 0.5],
        ],
    )
    .map(|v| v * scale);
    let [nx, ny] = cells(random, [w, h], range.nodes);
    let shape = pick(random, &["quad", "quad", "triangle"]);
    let angle = match random.below(3) {
        0 => random.between(-0.7, 0.7),
        _ => 0.0,
    };
    let turn = Turn::by(angle);
    let mut laws = Vec::new();
    let p = stuff.pressure * random.between(0.2, 1.0);
    let gap = |random: &mut Random| match random.below(3) {
        0 => stuff.strain * h * random.between(0.0, 1.0),
        _ => 0.0,
    };

    // The frame of the body: ξ from −w/2 to w/2, η from 0 to h; `lean` makes it narrower below.
    let place = pick(
        random,
        &[
            "floor", "floor", "floor", "tilted", "disc", "walls", "V", "V",
        ],
    );
    let lean = if place == "V" {
        decade(random, -2.0, 0.3).min(0.6 * w / h)
    } else {
        0.0
    };
    let xi = format!("x * (1 + {:e} * (y - {:e}))", 2.0 * lean / w, 0.5 * h);
    let mut text = format!(
        "[mesh.rectangle]\norigin = [{:e}, 0]\nsize = [{w:e}, {h:e}]\ncells = [{nx}, {ny}]\n\
         shape = \"{shape}\"\n",
        -0.5 * w
    );
    if angle != 0.0 || lean != 0.0 {
        text += &turn.map(&xi, "y");
        text += "\n";
    }
    text += &stuff.material("body", 1.0);

    // Sides are numbered below, right, above, left.
    let mut contact = [false; 4];
    let mut contacts = String::new();
    let mut wall = |random: &mut Random, side: usize, tilt: f64, laws: &mut Vec<String>| {
        contact[side] = true;
        let slant = 1.0f64.hypot(lean);
        let (boundary, point, normal) = match side {
            0 => {
                // A tilted floor touches at a corner.
                let corner = -0.5 * w * tilt.signum() * f64::from(u8::from(tilt != 0.0));
                ("bottom", [corner, 0.0], [tilt.sin(), tilt.cos()])
            }
            1 => ("right", [0.5 * w, 0.5 * h], [-1.0 / slant, lean / slant]),
            2 => ("top", [0.0, h], [0.0, -1.0]),
            _ => ("left", [-0.5 * w, 0.5 * h], [1.0 / slant, lean / slant]),
        };
        let gap = gap(random);
        let point = [point[0] - gap * normal[0], point[1] - gap * normal[1]];
        let law = friction(random, range.laws, p, w, laws);
        contacts += &half_plane(boundary, turn.of(point), turn.of(normal), &law);
    };
    match place {
        "tilted" => {
            let tilt = decade(random, -5.0, -1.0) * pick(random, &[-1.0, 1.0]);
            wall(random, 0, tilt, &mut laws);
        }
        "walls" => {
            let sides = if chance(random, 0.5) { [0, 2] } else { [1, 3] };
            for side in sides {
                wall(random, side, 0.0, &mut laws);
            }
        }
        "V" => {
            for side in [1, 3] {
                wall(random, side, 0.0, &mut laws);
            }
        }
        "disc" => {
            contact[0] = true;
            let radius = w * decade(random, -0.3, 1.5);
            let at = turn.of([random.between(-0.2, 0.2) * w, -radius - gap(random)]);
            let law = friction(random, range.laws, p, w, &mut laws);
            contacts += &format!(
                "[[contact]]\nboundary = \"bottom\"\nfriction = {law}\n\
                 obstacle = {{ circle = {{ center = [{:e}, {:e}], radius = {radius:e} }} }}\n",
                at[0], at[1]
            );
        }
        _ => wall(random, 0, 0.0, &mut laws),
    }
    // One law at least is Coulomb's.
    if range.laws == Laws::Coulomb && !contacts.contains("coulomb") {
        let (mu, law) = (coefficient(random).max(0.1), contacts.rfind("friction = "));
        let start = law.expect("there is a contact");
        let end = start + contacts[start..].find('\n').expect("a line ends");
        contacts.replace_range(start..end, &format!("friction = {{ coulomb = {mu:e} }}"));
        laws.pop();
        laws.push(format!("coulomb {mu:.2}"));
    }
    text += &contacts;

    let sides = ["bottom", "right", "top", "left"];
    let open: Vec<usize> = (0..4).filter(|&side| !contact[side]).collect();
    let held = pick(
        random,
        &[
            "clamped", "clamped", "moved", "rollers", "pinned", "free", "free",
        ],
    );
    let factors = Factors::new(random, held != "free");
    let side = if contact[0] && !contact[2] && held == "moved" {
        2
    } else {
        pick(random, &open)
    };
    let boundary = format!("boundary = \"{}\"", sides[side]);
    match held {
        "clamped" => text += &support(&boundary, [Some(0.0); 2], &factors.shear),
        "moved" => {
            // Pressed on the opposite side, and drawn along it.
            let down = -stuff.strain * h * random.between(0.0, 1.5);
            let along = stuff.strain * h * random.between(-2.0, 2.0);
            let motion = turn.of([along, down]);
            text += &support(&boundary, motion.map(Some), &factors.shear);
        }
        "rollers" => {
            let value = if chance(random, 0.5) {
                0.0
            } else {
                stuff.strain * w * random.between(-1.0, 1.0)
            };
            let along = if side % 2 == 0 {
                [None, Some(value)]
            } else {
                [Some(value), None]
            };
            text += &support(&boundary, along, &factors.shear);
        }
        "pinned" => {
            // The middle of an open side, perhaps without a node: the nearest is taken.
            let corner = match side {
                1 | 2 => [0.5 * w * (1.0 + lean * h / w), h],
                _ => [-0.5 * w * (1.0 + lean * h / w), h],
            };
            let [x, y] = turn.of(corner);
            text += &support(
                &format!("point = [{x:e}, {y:e}]"),
                [Some(0.0); 2],
                &factors.shear,
            );
        }
        _ => {}
    }
    // The pressing load on the obstacles.
    let pressed = if place == "walls" && contact[1] {
        pick(random, &[0, 2])
    } else if contact[2] {
        pick(random, &[1, 3])
    } else {
        2
    };
    if held == "free" || chance(random, 0.8) {
        if chance(random, 0.3) {
            let force = turn.of([0.0, -p / h]);
            text += &format!(
                "[[body_force]]\nx = {:e}\ny = {:e}\nfactors = {}\n",
                force[0],
                force[1],
                list(&factors.press)
            );
        } else {
            let value = match random.below(3) {
                0 => format!("{p:e} * (1 + 0.5 * sin(5 * x / {w:e}))"),
                _ => format!("{p:e}"),
            };
            text += &pressure(sides[pressed], &value, &factors.press);
        }
    }
    // The shearing load.
    if chance(random, 0.8) {
        let side = pick(random, &open);
        let size = p * random.between(-0.8, 0.8) * if side % 2 == 1 { w / h } else { 1.0 };
        let size = if held == "free" { 0.5 * size } else { size };
        let force = if held != "free" && chance(random, 0.3) {
            [size, p * random.between(-0.5, 0.5)]
        } else {
            [size, 0.0]
        };
        text += &traction(sides[side], turn.of(force), &factors.shear);
    }
    text += &factors.text();
    Written {
        name: format!(
            "block {:.1}x{:.1} ({nx}x{ny}), {place}{}, {held}, {}, {} steps",
            w / scale,
            h / scale,
            if angle == 0.0 { "" } else { ", turned" },
            laws.join(" & "),
            factors.shear.len()
        ),
        text,
    }
}

/// Two or three bodies on top of each other.
pub fn stack(random: &mut Random, range: Range) -> Written {
    let stuff = Stuff::new(random, range);
    let scale = decade(random, range.length[0], range.length[1]);
    let layers = pick(random, &[2, 2, 2, 3]);
    let angle = match random.below(4) {
        0 => random.between(-0.5, 0.5),
        _ => 0.0,
    };
    let turn = Turn::by(angle);
    let p = stuff.pressure * random.between(0.2, 1.0);
    let mut laws = Vec::new();
    let (mut text, mut contacts) = (String::new(), String::new());
    let mut materials = String::new();
    let (mut bottom, mut height, mut widths) = (0.0, 0.0, Vec::new());
    for layer in 0..layers {
        let w = scale * random.between(0.8, 3.0);
        let h = scale * random.between(0.3, 1.2);
        let [nx, ny] = cells(random, [w, h], range.nodes);
        if layer > 0 && chance(random, 0.3) {
            bottom += stuff.strain * h * random.between(0.0, 1.0);
        }
        let left = -0.5 * w + scale * random.between(-0.2, 0.2);
        writeln!(
            text,
            "[[mesh.part]]\nname = \"b{layer}\"\n\
             [mesh.part.rectangle]\norigin = [{left:e}, {bottom:e}]\nsize = [{w:e}, {h:e}]\n\
             cells = [{nx}, {ny}]\n{}",
            if angle == 0.0 {
                String::new()
            } else {
                turn.map("x", "y")
            }
        )
        .expect("writing to a string cannot fail");
        materials += &stuff.material(&format!("b{layer}"), decade(random, -1.5, 1.5));
        if layer > 0 {
            let law = friction(random, range.laws, p, w, &mut laws);
            let (below, above) = (format!("b{}-top", layer - 1), format!("b{layer}-bottom"));
            let (first, second) = if chance(random, 0.5) {
                (above, below)
            } else {
                (below, above)
            };
            contacts += &format!(
                "[[contact]]\nboundary = \"{first}\"\nagainst = \"{second}\"\nfriction = {law}\n"
            );
        }
        bottom += h;
        height += h;
        widths.push(w);
    }
    let top = layers - 1;
    let ground = pick(random, &["clamped", "clamped", "on a floor"]);
    let head = pick(random, &["loaded", "loaded", "loaded", "moved", "guided"]);
    let factors = Factors::new(random, false);
    let mut rest = String::new();
    if ground == "clamped" {
        rest += &support("boundary = \"b0-bottom\"", [Some(0.0); 2], &factors.shear);
    } else {
        let law = friction(random, range.laws, p, widths[0], &mut laws);
        contacts += &half_plane("b0-bottom", [0.0; 2], turn.of([0.0, 1.0]), &law);
    }
    if range.laws == Laws::Coulomb && !contacts.contains("coulomb") {
        let (mu, start) = (coefficient(random).max(0.1), contacts.rfind("friction = "));
        let start = start.expect("there is a contact");
        let end = start + contacts[start..].find('\n').expect("a line ends");
        contacts.replace_range(start..end, &format!("friction = {{ coulomb = {mu:e} }}"));
        laws.pop();
        laws.push(format!("coulomb {mu:.2}"));
    }
    let name = format!("b{top}-top");
    let boundary = format!("boundary = \"{name}\"");
    let shear = p * random.between(-0.6, 0.6);
    match head {
        "moved" => {
            let down = -stuff.strain * height * random.between(0.2, 2.0);
            let along = stuff.strain * height * random.between(-2.0, 2.0);
            let factors = if chance(random, 0.5) {
                &factors.press
            } else {
                &factors.shear
            };
            rest += &support(&boundary, turn.of([along, down]).map(Some), factors);
        }
        "guided" => {
            // No motion in x; pressed down.
            rest += &support(&boundary, [Some(0.0), None], &factors.shear);
            rest += &pressure(&name, &format!("{p:e}"), &factors.press);
        }
        _ => {
            let w = widths[top];
            let value = match random.below(3) {
                0 => format!("{p:e} * (1 + 0.6 * sin(3 * x / {w:e}))"),
                _ => format!("{p:e}"),
            };
            rest += &pressure(&name, &value, &factors.press);
            if chance(random, 0.8) {
                rest += &traction(&name, turn.of([shear, 0.0]), &factors.shear);
            }
        }
    }
    if chance(random, 0.3) {
        let force = turn.of([shear * random.between(-0.3, 0.3), 0.0]);
        rest += &traction("b0-right", force, &factors.shear);
    }
    Written {
        name: format!(
            "stack of {layers}{}, {ground}, {head}, {}, {} steps",
            if angle == 0.0 { "" } else { ", turned" },
            laws.join(" & "),
            factors.shear.len()
        ),
        text: text + &materials + &contacts + &rest + &factors.text(),
    }
}
