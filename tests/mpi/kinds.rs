//! Kinds of problems without an example, as small as possible, each on 2, 3 and 4 ranks.

use super::run::compare;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A beam tied on a foot of another mesh that is on compliant ground, pushed to and fro: only contact and friction hold them.
const TIED: &str = r#"
title = "tied and compliant"
[[mesh.part]]
name = "foot"
rectangle = { size = [4, 1], cells = [24, 6] }
[[mesh.part]]
name = "beam"
rectangle = { origin = [0.5, 1], size = [2, 1], cells = [9, 5] }
[[material]]
region = "foot"
young = 2e9
poisson = 0.3
[[material]]
region = "beam"
young = 7e9
poisson = 0.2
thickness = 0.5
[[traction]]
boundary = "beam-top"
y = "-1e6 * (1 + x)"
factors = [1, 1, 1]
[[traction]]
boundary = "beam-left"
x = 4e5
factors = [0, 1, -1]
[[tie]]
boundary = "beam-bottom"
against = "foot-top"
[[contact]]
boundary = "foot-bottom"
obstacle = { half_plane = { point = [0, 0], normal = [0, 1] } }
friction = { coulomb = 0.4 }
stiffness = { normal = 5e9, tangential = 2e9 }
[steps]
factors = [1, 1, 1]
"#;

/// A hot bar that turns about an axis at its side and presses on a rim, of different materials and meshes; nothing else holds it.
pub const WARM: &str = r#"
title = "warm and turning"
[[mesh.part]]
name = "bar"
rectangle = { origin = [20, 0], size = [40, 20], cells = [12, 6], shape = "triangle" }
[[mesh.part]]
name = "rim"
rectangle = { origin = [60.001, 0], size = [15, 30], cells = [5, 11] }
[units]
length = "mm"
force = "N"
[analysis]
plane = "plane_stress"
rotation = { speed = 900 }
[[material]]
region = "bar"
young = 2.1e5
poisson = 0.3
density = 7.8e-9
expansion = 1.2e-5
[[material]]
region = "rim"
young = 1.1e5
poisson = 0.34
density = 4.4e-9
expansion = 9e-6
[[support]]
boundary = ["bar-bottom", "rim-bottom"]
y = 0
[[support]]
boundary = "rim-right"
x = 0
[[temperature]]
region = "bar"
value = "150 - x + y^2 / 4"
factors = [1, 0.5]
[[temperature]]
value = 20
[[contact]]
boundary = "bar-right"
against = "rim-left"
friction = { coulomb = 0.2 }
[steps]
factors = [1, 0.8]
"#;

/// A block that expands between walls, warmer by values at its nodes.
pub const NODAL: &str = r#"
title = "warm at nodes"
[mesh]
order = 2
box = { size = [2, 1, 1], cells = [6, 3, 3], shape = "tetrahedron" }
[[material]]
young = 2e11
poisson = 0.3
expansion = 1e-5
[[support]]
boundary = "left"
x = 0
[[support]]
boundary = "bottom"
z = 0
[[support]]
boundary = "front"
y = 0
[[temperature]]
value = [NODAL]
[[contact]]
boundary = "right"
obstacle = { half_space = { point = [2.0005, 0, 0], normal = [-1, 0, 0] } }
friction = { coulomb = 0.1 }
"#;

/// Wavy sides of second order, their meshes do not match.
const WAVE: &str = r#"
title = "wavy sides of second order"
[[mesh.part]]
name = "lower"
box = { size = [1, 1, 0.5], cells = [4, 3, 2], map = ["x", "y", "z * (1 + 0.1*sin(6*x)*cos(5*y))"] }
order = 2
[[mesh.part]]
name = "upper"
box = { size = [1, 1, 0.5], cells = [5, 4, 2], map = ["x", "y", "2*z + (1 - 2*z) * (0.5 + 0.05*sin(6*x)*cos(5*y))"] }
order = 2
[[material]]
young = 1e9
poisson = 0.3
[[support]]
boundary = "lower-bottom"
x = 0
y = 0
z = 0
[[traction]]
boundary = "upper-top"
z = -1e6
x = 1e5
[[contact]]
boundary = "upper-bottom"
against = "lower-top"
adjust = 0.01
friction = { tresca = 1e5 }
"#;

/// A plate tied to a block on a compliant pad.
const PADS: &str = r#"
title = "tied on a compliant pad"
[[mesh.part]]
name = "pad"
box = { size = [1, 1, 0.2], cells = [5, 4, 1] }
[[mesh.part]]
name = "block"
box = { origin = [0.1, 0.1, 0.2], size = [0.8, 0.8, 0.4], cells = [4, 3, 2], shape = "wedge" }
[[mesh.part]]
name = "plate"
box = { origin = [0, 0, 0.6], size = [1, 1, 0.1], cells = [7, 5, 1] }
[[material]]
young = 1e9
poisson = 0.3
[[support]]
boundary = "pad-bottom"
x = 0
y = 0
z = 0
[[traction]]
boundary = "plate-top"
z = "-1e6 * (1 + x)"
[[traction]]
boundary = "plate-left"
x = 2e5
[[tie]]
boundary = "block-top"
against = "plate-bottom"
[[contact]]
boundary = "block-bottom"
against = "pad-top"
friction = { coulomb = 0.5 }
stiffness = { normal = 2e9 }
"#;

/// A ring shrunk on a shaft and pushed along it, of revolution: friction alone holds it.
const ROUND: &str = r#"
title = "ring on a shaft"
[[mesh.part]]
name = "shaft"
rectangle = { size = [10, 60], cells = [4, 22] }
[[mesh.part]]
name = "ring"
rectangle = { origin = [10, 20], size = [8, 20], cells = [4, 9] }
[analysis]
plane = "axisymmetric"
[[material]]
young = 2.1e5
poisson = 0.3
[[support]]
boundary = "shaft-bottom"
y = 0
[[traction]]
boundary = "ring-top"
y = -8
factors = [0, 1, -0.5]
[[contact]]
boundary = "ring-left"
against = "shaft-right"
interference = 0.005
friction = { coulomb = 0.3 }
[steps]
factors = [1, 1, 1]
"#;

/// Forces on a set of nodes whose upper side stays level, and a set that meets faces one by one.
const NODES: &str = r#"
title = "node by node"
[mesh]
file = "blocks.inp"
[[material]]
young = 1e9
poisson = 0.3
[[support]]
nodes = "ground"
x = 0
y = 0
[[support]]
nodes = "handle"
x = 1e-4
[[equal]]
sets = "handle"
directions = ["y"]
[[force]]
nodes = "handle"
y = -1e4
[[contact]]
nodes = "feet"
against = "floor"
friction = { coulomb = 0.3 }
"#;

/// A block of second order on a foundation that leaves it free along one axis, where springs hold it, and another one that a spring and
/// friction hold, and a tie from the second step on; with supports that end and hold it where it is, and an equation.
const BED: &str = r#"
title = "on a foundation and springs"
[[mesh.part]]
name = "low"
box = { size = [2, 1, 0.5], cells = [6, 3, 2] }
order = 2
[[mesh.part]]
name = "up"
box = { origin = [0.5, 0, 0.5], size = [1, 1, 0.5], cells = [4, 4, 2] }
[[material]]
young = 1e9
poisson = 0.3
[[support]]
boundary = ["low-front", "up-front"]
y = 0
[[support]]
boundary = "up-right"
x = 1e-5
active = [1, 0, 0]
[[support]]
boundary = "low-right"
z = 0
active = [0, 1, 1]
lock = [0, 1, 1]
[[equation]]
terms = [{ point = [0.5, 0.5, 1], z = 1 }, { point = [1.5, 0.5, 1], z = -1, x = 0.5 }]
value = 1e-5
[[foundation]]
boundary = "low-bottom"
stiffness = { normal = "2e8 * (1 + x)" }
[[spring]]
boundary = "low-left"
direction = [1, 0, 0]
stiffness = 3e6
[[spring]]
point = [0.5, 0.5, 1]
to = { point = [0, 0.5, 0] }
stiffness = 2e6
[[traction]]
boundary = "up-top"
z = -1e6
factors = [1, 1, 1]
[[traction]]
boundary = "up-right"
x = 1e5
factors = [0, 1, 1]
[[contact]]
boundary = "up-bottom"
against = "low-top"
friction = { coulomb = 0.3 }
active = [1, 1, 0]
friction_factors = [0, 1, 1]
[[tie]]
boundary = "up-bottom"
against = "low-top"
active = [0, 0, 1]
[steps]
factors = [1, 1, 1]
"#;

/// A bolt beside two plates under a common rigid head: tightened, locked, and pulled by the point of the head, whose foot a spread coupling
/// holds.
const BOLT: &str = r#"
title = "a bolt and its head"
[[mesh.part]]
name = "low"
box = { size = [2, 1, 0.5], cells = [6, 3, 2] }
[[mesh.part]]
name = "up"
box = { origin = [0, 0, 0.5], size = [2, 1, 0.5], cells = [5, 3, 2] }
[[mesh.part]]
name = "bolt"
box = { origin = [2.2, 0.2, 0], size = [0.5, 0.5, 1], cells = [2, 2, 5] }
[[material]]
young = 1e9
poisson = 0.3
[[support]]
boundary = "bolt-bottom"
x = 0
y = 0
z = 0
[[coupling]]
boundary = "low-bottom"
point = [1, 0.5, 0]
kind = "distributing"
x = 0
y = 0
z = 0
rx = 0
ry = 0
rz = 0
name = "foot"
[[coupling]]
boundary = ["up-top", "bolt-top"]
point = [1.5, 0.5, 1]
force = [1e4, 0, 5e4]
moment = [0, 1e4, 0]
factors = [0, 1]
name = "head"
[[contact]]
boundary = "up-bottom"
against = "low-top"
friction = { coulomb = 0.3 }
[[preload]]
plane = { point = [2.4, 0.4, 0.45], normal = [0, 0, 1] }
region = "bolt"
force = 2e5
lock = true
name = "bolt"
[steps]
factors = [1, 1]
"#;

/// A quarter of a block that is turned three times about the edge on the z axis: the sides have different cells.
const WHEEL: &str = r#"
title = "a quarter of a wheel"
[[mesh.part]]
name = "wheel"
box = { size = [1, 1, 0.5], cells = [5, 4, 3] }
[[material]]
young = 1e9
poisson = 0.3
[[cyclic]]
low = "wheel-front"
high = "wheel-left"
axis = { point = [0, 0, 0], direction = [0, 0, 1] }
sectors = 4
whole = true
[[support]]
boundary = "wheel-bottom"
z = 0
[[contact]]
boundary = "wheel-right"
obstacle = { half_space = { point = [1, 0, 0], normal = [-1, 0, 0] } }
friction = { coulomb = 0.4 }
[[traction]]
boundary = "wheel-top"
x = "1e6 * (1 + y)"
y = -2e5
[[traction]]
boundary = "wheel-back"
y = -5e5
"#;

/// An eighth of a shaft that is pressed into a hub and turned in it: that of the hub begins elsewhere, so that both meet beyond the
/// sides of the other.
pub const FIT: &str = r#"
title = "sectors of a fit"
[[mesh.part]]
name = "shaft"
[mesh.part.box]
size = [1, 1, 0.3]
cells = [3, 6, 2]
map = ["(0.4 + 0.6 * x) * cos(pi / 4 * y)", "(0.4 + 0.6 * x) * sin(pi / 4 * y)", "z"]
[[mesh.part]]
name = "hub"
[mesh.part.box]
size = [1, 1, 0.3]
cells = [3, 8, 2]
map = ["(1 + 0.6 * x) * cos(pi / 4 * (y + 0.4))", "(1 + 0.6 * x) * sin(pi / 4 * (y + 0.4))", "z"]
[[material]]
young = 1e9
poisson = 0.3
[[support]]
boundary = "shaft-left"
x = 0
y = 0
z = 0
[[support]]
boundary = "hub-right"
radial = 0
hoop = 0.004
axial = 0
axis = { point = [0, 0, 0], direction = [0, 0, 1] }
factors = [0, 1]
[[contact]]
boundary = "shaft-right"
against = "hub-left"
interference = 0.01
friction = { coulomb = 0.1 }
[[cyclic]]
low = "shaft-front"
high = "shaft-back"
axis = { point = [0, 0, 0], direction = [0, 0, 1] }
sectors = 8
[[cyclic]]
low = "hub-front"
high = "hub-back"
axis = { point = [0, 0, 0], direction = [0, 0, 1] }
sectors = 8
[steps]
factors = [1, 1]
"#;

/// Two blocks of quadrilaterals, one above the other, with sets of nodes.
fn blocks() -> String {
    let (mut nodes, mut elements) = ("*NODE\n".to_owned(), String::new());
    let (mut ground, mut handle, mut feet) = (Vec::new(), Vec::new(), Vec::new());
    let mut number = 0;
    let mut element = 0;
    for (name, cells, width, low) in [("LOWER", [8, 4], 2.0, 0.0), ("UPPER", [5, 5], 1.0, 1.0)] {
        let first = number + 1;
        for j in 0..=cells[1] {
            for i in 0..=cells[0] {
                number += 1;
                let x = width * (f64::from(i) / f64::from(cells[0]) - 0.5);
                let y = low + f64::from(j) / f64::from(cells[1]);
                let _ = writeln!(nodes, "{number}, {x}, {y}");
                match (name, j) {
                    ("LOWER", 0) => ground.push(number),
                    ("UPPER", 0) => feet.push(number),
                    ("UPPER", 5) => handle.push(number),
                    _ => {}
                }
            }
        }
        let _ = writeln!(elements, "*ELEMENT, TYPE=CPE4, ELSET={name}");
        for j in 0..cells[1] {
            for i in 0..cells[0] {
                element += 1;
                let corner = first + j * (cells[0] + 1) + i;
                let above = corner + cells[0] + 1;
                let (right, across) = (corner + 1, above + 1);
                let _ = writeln!(elements, "{element}, {corner}, {right}, {across}, {above}");
            }
        }
    }
    let set = |name: &str, nodes: &[i32]| {
        let all: Vec<String> = nodes.iter().map(i32::to_string).collect();
        format!("*NSET, NSET={name}\n{}\n", all.join(",\n"))
    };
    let sets = [
        set("ground", &ground),
        set("handle", &handle),
        set("feet", &feet),
    ]
    .concat();
    // The upper side of the upper row of the lower block.
    let floor: Vec<String> = (25..=32).map(|e| format!("{e}, S3")).collect();
    format!(
        "{nodes}{elements}{sets}*SURFACE, NAME=floor\n{}\n",
        floor.join("\n")
    )
}

pub fn kinds() {
    let place = tempfile::tempdir().expect("a directory");
    for text in [
        TIED, WARM, NODAL, WAVE, PADS, ROUND, NODES, BED, BOLT, WHEEL, FIT,
    ] {
        compare(&case(text, place.path()), &[2, 3, 4]);
    }
}

/// One of the cases in a file, with its inputs.
pub fn case(text: &str, place: &Path) -> PathBuf {
    std::fs::write(place.join("blocks.inp"), blocks()).expect("a mesh");
    let values: Vec<String> = (0..13 * 7 * 7)
        .map(|node| (30 + node * 37 % 101).to_string())
        .collect();
    let title = text
        .lines()
        .nth(1)
        .expect("a title")
        .replace("title = ", "");
    let case = place.join(title.replace('"', "").replace(' ', "-") + ".toml");
    std::fs::write(&case, text.replace("NODAL", &values.join(", "))).expect("a case");
    case
}
