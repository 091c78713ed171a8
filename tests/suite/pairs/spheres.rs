//! Two elastic spheres: pressed together (Hertz), pushed sideways (Cattaneo, Mindlin), and twisted (Lubkin).
//!
//! Of each sphere a block around the contact is meshed, two to four radii of the contact large, its surface bent as the
//! sphere is. On the faces inside the sphere the displacement is prescribed that the tractions of the closed form make
//! there on a half-space, as in `half_space.rs`; the approach, the shift and the angle are prescribed with it, and the
//! forces are results. Meshes do not match.

use crate::common::half_space::{
    STEEL, balanced, compare, ellipsoid_fit, growing, hertz_fit, hertz_share, modulus, on_rings,
    rings, shear_modulus, sizes, under_a_disc, under_a_drag, under_a_pressed_disc, under_a_torque,
};
use crate::common::models::{Answer, answer, answer_in_turn, on_the_cpu};
use crate::common::order::{Order, of_order};
use crate::common::space::{Vector, cross};
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::structured::{SolidShape, block, join};
use signorini::mesh::{Mesh, facet_nodes};
use signorini::model::{Model, Pair, Support};
use std::f64::consts::PI;

/// Radius of each sphere.
const RADIUS: f64 = 40.0;
/// The radius of contact that belongs to the force.
const A: f64 = 0.1;
/// Approach: a²/R with R half of the radius.
const APPROACH: f64 = 2.0 * A * A / RADIUS;

/// The meshed part of the x and y axes: both sides of them, or a half up to a plane of symmetry.
#[derive(Clone, Copy)]
struct Extent {
    both: [bool; 2],
    /// As far as the block reaches.
    size: f64,
    /// Growing elements beyond the contact.
    outer: usize,
    /// Whether the grid follows circles, and is finest at the edge of the contact.
    rings: bool,
}

/// The block of a sphere above (1) or below (−1) the plane z = 0, with this many elements across the radius of contact;
/// faces within 1.2 a √2 of the axis are "name-contact", those inside the sphere "name-far".
fn part(
    name: &str,
    side: f64,
    across: usize,
    (shape, order): (SolidShape, Order),
    extent: Extent,
) -> Mesh<3> {
    let h = A / across as f64;
    let inner: Vec<f64> = (0..=across + across / 5).map(|k| h * k as f64).collect();
    let (flat, first) = match extent.rings {
        true => {
            let (radii, last) = rings(across, extent.outer, extent.size / A);
            (radii.iter().map(|r| A * r).collect(), A * last)
        }
        false => (growing(&inner, 1.3 * h, extent.outer, extent.size), h),
    };
    let units: Vec<f64> = flat.iter().map(|x| x / A).collect();
    let deep = growing(&[0.0], first, extent.outer + 3, extent.size);
    // Node i of an axis: its number from the plane of symmetry or the middle on, and its side.
    let n = flat.len() - 1;
    let from_middle = |c: usize, i: usize| match extent.both[c] {
        true => (i.abs_diff(n), if i < n { -1.0 } else { 1.0 }),
        false => (i, 1.0),
    };
    let wide = extent.both.map(|both| if both { 2 * n } else { n });
    let cells = [wide[0], wide[1], deep.len() - 1];
    let size = cells.map(|n| n as f64);
    let low = if side > 0.0 { 0.0 } else { -size[2] };
    let prefix = format!("{name}-");
    let mut mesh = block([0.0, 0.0, low], size, cells, shape, name, &prefix);
    for node in &mut mesh.nodes {
        let [i, j, k] = node.map(|x| x.abs().round() as usize);
        let [(i, sign_x), (j, sign_y)] = [from_middle(0, i), from_middle(1, j)];
        let [x, y] = match extent.rings {
            true => on_rings(&units, extent.size / A, [i, j]).map(|x| A * x),
            false => [flat[i], flat[j]],
        };
        *node = [sign_x * x, sign_y * y, deep[k]];
    }
    // Nodes in the middle of sides are bent as all others.
    let mut mesh = of_order(mesh, order);
    for node in &mut mesh.nodes {
        let [x, y, depth] = *node;
        let bent = (x * x + y * y) / (2.0 * RADIUS) * (1.0 - depth / extent.size);
        *node = [x, y, side * (depth + bent)];
    }
    let [surface, end] = if side > 0.0 {
        ["bottom", "top"]
    } else {
        ["top", "bottom"]
    };
    let inside = |node: &u32| {
        let [x, y, _] = mesh.nodes[*node as usize];
        x.hypot(y) <= 1.2 * A * 2f64.sqrt() * (1.0 + 1e-9)
    };
    let mut contact = mesh.boundaries[&format!("{name}-{surface}")].clone();
    contact.retain(|face| facet_nodes(face).iter().all(inside));
    let mut far = Vec::new();
    for (wanted, face) in [
        (true, "right"),
        (true, "back"),
        (true, end),
        (extent.both[0], "left"),
        (extent.both[1], "front"),
    ] {
        if wanted {
            far.extend_from_slice(&mesh.boundaries[&format!("{name}-{face}")]);
        }
    }
    mesh.boundaries.insert(format!("{name}-contact"), contact);
    mesh.boundaries.insert(format!("{name}-far"), far);
    mesh
}

/// Two blocks with prescribed displacements far away, for the upper and the lower one; planes of symmetry are held too.
fn spheres(
    parts: [Mesh<3>; 2],
    extent: Extent,
    material: Material,
    far: [impl Fn(Vector) -> Vector + Copy + Send + Sync + 'static; 2],
    pair: Pair<3>,
) -> Model<3> {
    let [up, low] = parts;
    let mut model = Model::on(join(up, low)).material(material).contact(pair);
    for (name, far) in ["up-far", "low-far"].into_iter().zip(far) {
        let along = move |c: usize| move |x: Vector| far(x)[c];
        model = model.support(Support::on(name).x(along(0)).y(along(1)).z(along(2)));
    }
    for (axis, side) in ["left", "front"].into_iter().enumerate() {
        if !extent.both[axis] {
            let names = [format!("up-{side}"), format!("low-{side}")];
            model = model.support(Support::on(names.to_vec()).symmetry());
        }
    }
    model
}

/// The displacement under Hertz's pressure on a sphere below, for the upper sphere if `side` is positive.
fn pressed(material: Material, side: f64, [x, y, z]: Vector) -> Vector {
    // The mirror image.
    let [u, v, w] =
        under_a_pressed_disc(material, force(material), A, hertz_share, [x, y, -side * z]);
    [u, v, -side * w]
}

/// The force that makes a radius of contact of a.
fn force(material: Material) -> f64 {
    4.0 / 3.0 * 0.5 * modulus(material) * A.powi(3) / (0.5 * RADIUS)
}

/// The resultant of the contact forces on the first-named boundary, and their moment about the z axis.
fn resultant(answer: &Answer<3>) -> (Vector, f64) {
    let (mut sum, mut moment) = ([0.0; 3], 0.0);
    for i in 0..answer.m() {
        let force = answer.contact_force(i);
        (0..3).for_each(|c| sum[c] += force[c]);
        moment += cross(answer.place(i), force)[2];
    }
    (sum, moment)
}

const PAIRS: [[&str; 2]; 2] = [["up-contact", "low-contact"], ["low-contact", "up-contact"]];

/// Two spheres pressed together: radius and peak for the force that results, and the force for the approach.
fn hertz(
    name: &str,
    shapes: [(SolidShape, Order); 2],
    across: [usize; 2],
    sides: [&str; 2],
    limit: f64,
    stiffness: Stiffness,
) {
    let extent = Extent {
        both: [false; 2],
        size: 4.0 * A,
        outer: 8,
        rings: false,
    };
    let parts = [
        part("up", 1.0, across[0], shapes[0], extent),
        part("low", -1.0, across[1], shapes[1], extent),
    ];
    let far = [1.0, -1.0].map(|side| {
        move |x: Vector| {
            let [u, v, w] = pressed(STEEL, side, x);
            [u, v, w - side * 0.5 * APPROACH]
        }
    });
    let model = spheres(parts, extent, STEEL, far, Pair::new(sides[0], sides[1]));
    let answer = answer(model, 1e-7, stiffness);
    sizes(name, &answer);
    let (contact, _) = resultant(&answer);
    let found = 4.0 * contact[2].abs();
    balanced(&answer, 1e-7 * found);
    // δ = a²/R where a is that of the force.
    let radius = (0.75 * found * 0.5 * RADIUS / (0.5 * modulus(STEEL))).cbrt();
    compare(
        &format!("{name}, δ"),
        APPROACH,
        radius * radius / (0.5 * RADIUS),
        limit,
    );
    let (a, peak) = hertz_fit(&answer);
    compare(&format!("{name}, a"), a, radius, limit);
    let p0 = 1.5 * found / (PI * radius * radius);
    compare(&format!("{name}, p₀"), peak, p0, limit);
    // At the very centre, too.
    let centre = (0..answer.m()).find(|&i| answer.place(i)[0].hypot(answer.place(i)[1]) < 1e-9);
    let centre = centre.expect("a node in the middle");
    compare(
        &format!("{name}, p(0)"),
        answer.pressure(centre),
        p0,
        2.0 * limit,
    );
}

const HEXAHEDRA: [(SolidShape, Order); 2] = [(SolidShape::Hexahedron, Order::First); 2];

#[test]
fn hertz_spheres() {
    for sides in PAIRS {
        let name = format!("Hertz, 10 and 8 hexahedra across a, λ on {}", sides[0]);
        hertz(&name, HEXAHEDRA, [10, 8], sides, 0.02, Stiffness::Pcg);
    }
}

/// Two faces of second order, of another kind on either side.
const QUADRATIC: [(SolidShape, Order); 2] = [
    (SolidShape::Hexahedron, Order::Serendipity),
    (SolidShape::Hexahedron, Order::Lagrange),
];

#[test]
fn hertz_spheres_of_second_order() {
    let tetrahedra = (SolidShape::Tetrahedron, Order::Lagrange);
    for (name, shapes) in [
        ("hex20 on hex27", QUADRATIC),
        ("tet10 on hex27", [tetrahedra, QUADRATIC[1]]),
    ] {
        for sides in PAIRS {
            let name = format!("Hertz, 5 {name} across a, λ on {}", sides[0]);
            hertz(&name, shapes, [5, 4], sides, 0.02, Stiffness::Pcg);
        }
    }
}

#[test]
#[ignore = "takes a minute"]
fn hertz_spheres_finely() {
    for sides in PAIRS {
        let name = format!("Hertz, 20 and 16 hexahedra across a, λ on {}", sides[0]);
        hertz(&name, HEXAHEDRA, [20, 16], sides, 0.01, Stiffness::Pcg);
    }
    let shapes = [
        (SolidShape::Tetrahedron, Order::First),
        (SolidShape::Hexahedron, Order::First),
    ];
    hertz(
        "Hertz, 20 tetrahedra and 16 hexahedra",
        shapes,
        [20, 16],
        PAIRS[0],
        0.02,
        Stiffness::Pcg,
    );
}

/// As [`STEEL`], without Poisson's effect, for which the closed form of Cattaneo and Mindlin is exact.
const CORK: Material = Material::new(2e11, 0.0);

/// Pressed together, then pushed sideways: c/a = (1 − Q/(μP))^(1/3), q = μ p₀ (√(1 − r²/a²) − c/a √(1 − r²/c²)) along x,
/// δ = 3μP/(16a) · 2 (2 − ν)/G · (1 − (c/a)²). The push is two thirds of the sliding limit.
fn cattaneo(shapes: [(SolidShape, Order); 2], across: [usize; 2], sides: [&str; 2]) {
    let extent = Extent {
        both: [true, false],
        size: 4.0 * A,
        outer: 7,
        rings: false,
    };
    let (mu, ratio, shear) = (0.5, 0.5, shear_modulus(CORK));
    let push = ratio * mu * force(CORK);
    let shift_of = |p: f64, q: f64, a: f64| {
        3.0 * mu * p / (16.0 * a) * 4.0 / shear * (1.0 - (1.0 - q / (mu * p)).powf(2.0 / 3.0))
    };
    let shift = shift_of(force(CORK), push, A);
    let c = A * (1.0 - ratio).cbrt();
    // Two of Hertz's ellipses: μ p on a, minus the part of the stick zone.
    let [whole, inner] = [mu * force(CORK), mu * force(CORK) * (1.0 - ratio)];
    let dragged = move |side: f64, [x, y, z]: Vector| -> Vector {
        let along = |force: f64, radius: f64| {
            let alone = |x| under_a_drag(CORK, force, x);
            under_a_disc(alone, radius, hertz_share, [x, y, -side * z])
        };
        let (more, less) = (along(whole, A), along(inner, c));
        let [u, v, w] = [0, 1, 2].map(|k| more[k] - less[k]);
        // The upper sphere is drawn back by the lower one.
        [-side * u, if y == 0.0 { 0.0 } else { -side * v }, w]
    };
    let model = |pushed: f64| {
        let parts = [
            part("up", 1.0, across[0], shapes[0], extent),
            part("low", -1.0, across[1], shapes[1], extent),
        ];
        let far = [1.0, -1.0].map(|side| {
            move |x: Vector| {
                let (n, t) = (pressed(CORK, side, x), dragged(side, x));
                [
                    n[0] + pushed * (t[0] + side * 0.5 * shift),
                    n[1] + pushed * t[1],
                    n[2] + pushed * t[2] - side * 0.5 * APPROACH,
                ]
            }
        });
        let pair = Pair::new(sides[0], sides[1]).coulomb(mu);
        spheres(parts, extent, CORK, far, pair)
    };
    let options = on_the_cpu(1e-6, Stiffness::Pcg);
    let answer = answer_in_turn(vec![model(0.0), model(1.0)], &options);
    let name = format!("Cattaneo, λ on {}", sides[0]);
    sizes(&name, &answer);
    println!("{} products in the first step", answer.before[0].n_a());
    let most = answer.before[0].n_a().max(answer.solution.n_a());
    assert!(most <= 150, "{most} products");
    let (sum, _) = resultant(&answer);
    let [p, q] = [2.0 * sum[2].abs(), 2.0 * sum[0].abs()];
    balanced(&answer, 1e-7 * p);
    compare(&format!("{name}, P at the approach"), p, force(CORK), 0.03);
    let a = (0.75 * p * 0.5 * RADIUS / (0.5 * modulus(CORK))).cbrt();
    let p0 = 1.5 * p / (PI * a * a);
    let stuck = a * (1.0 - q / (mu * p)).cbrt();
    compare(&format!("{name}, δ_t"), shift, shift_of(p, q, a), 0.01);
    // In the stick zone the rest of the bound is half an ellipsoid of radius c.
    let (mut stuck_nodes, mut aside) = (Vec::new(), 0.0f64);
    for i in 0..answer.m() {
        let (place, f) = (answer.place(i), answer.friction(i));
        let (r2, area) = (place[0].powi(2) + place[1].powi(2), answer.area(i));
        aside = aside.max(f[1].abs() / area / (mu * p0));
        if r2 > (0.85 * stuck).powi(2) {
            continue;
        }
        stuck_nodes.push((area, r2, mu * answer.pressure(i) - f[0].abs() / area));
    }
    let (radius, _) = ellipsoid_fit(stuck_nodes.into_iter());
    compare(&format!("{name}, c/a"), radius / a, stuck / a, 0.03);
    let centre = (0..answer.m()).find(|&i| answer.place(i)[0].hypot(answer.place(i)[1]) < 1e-9);
    let centre = centre.expect("a node in the middle");
    let traction = answer.friction(centre)[0].abs() / answer.area(centre);
    compare(
        &format!("{name}, q(0)"),
        traction,
        mu * p0 * (1.0 - stuck / a),
        0.03,
    );
    println!("{name}: friction across the push up to {aside:.4} of μ p₀");
    assert!(aside < 0.02);
}

#[test]
fn cattaneo_mindlin_spheres() {
    cattaneo(HEXAHEDRA, [10, 8], PAIRS[0]);
}

#[test]
#[ignore = "takes a minute"]
fn cattaneo_mindlin_spheres_either_side() {
    cattaneo(HEXAHEDRA, [10, 8], PAIRS[1]);
    cattaneo(HEXAHEDRA, [14, 16], PAIRS[0]);
    cattaneo(QUADRATIC, [8, 7], PAIRS[0]);
}

/// Twisted: without slip θ = 3M/(8Ga³) (the angle between both, Reissner and Sagoci's on either side), and
/// M = 3πμPa/16 where all slips.
fn torsion(
    shapes: [(SolidShape, Order); 2],
    across: [usize; 2],
    rings: bool,
    mu: f64,
    angle: f64,
) -> (Answer<3>, f64, f64) {
    let extent = Extent {
        both: [true; 2],
        size: 4.0 * A,
        outer: if rings { 9 } else { 6 },
        rings,
    };
    let shear = shear_modulus(STEEL);
    let most = 3.0 / 16.0 * PI * mu * force(STEEL) * A;
    let torque = (8.0 / 3.0 * shear * A.powi(3) * angle).min(most);
    let model = |turned: f64| {
        let parts = [
            part("up", 1.0, across[0], shapes[0], extent),
            part("low", -1.0, across[1], shapes[1], extent),
        ];
        let far = [1.0, -1.0].map(|side| {
            move |x: Vector| {
                let (n, t) = (pressed(STEEL, side, x), under_a_torque(STEEL, torque, x));
                // The far parts turn by half of the angle each, minus the part of the torque there.
                let turn = side * 0.5 * angle;
                [
                    n[0] - turned * (turn * x[1] + side * t[0]),
                    n[1] + turned * (turn * x[0] - side * t[1]),
                    n[2] - side * 0.5 * APPROACH,
                ]
            }
        });
        let pair = Pair::new("up-contact", "low-contact").coulomb(mu);
        spheres(parts, extent, STEEL, far, pair)
    };
    let options = on_the_cpu(1e-6, Stiffness::Pcg);
    let answer = answer_in_turn(vec![model(0.0), model(1.0)], &options);
    sizes(&format!("torsion, μ = {mu}"), &answer);
    let (sum, moment) = resultant(&answer);
    balanced(&answer, 1e-7 * sum[2].abs());
    compare(
        "torsion, P at the approach",
        sum[2].abs(),
        force(STEEL),
        0.03,
    );
    (answer, sum[2].abs(), moment.abs())
}

#[test]
#[ignore = "takes a minute"]
fn torsion_without_slip() {
    // Slip at the edge, where the traction is singular, is smaller than an element: the grid is fine there.
    let angle = 1e-5;
    let (_, p, moment) = torsion(HEXAHEDRA, [10, 8], true, 10.0, angle);
    let cube = 0.75 * p * 0.5 * RADIUS / (0.5 * modulus(STEEL));
    compare(
        "torsion without slip, θ",
        angle,
        3.0 * moment / (8.0 * shear_modulus(STEEL) * cube),
        0.01,
    );
}

#[test]
fn torsion_with_slip() {
    let mu = 0.1;
    let p0 = 1.5 * force(STEEL) / (PI * A * A);
    let angle = 20.0 * mu * p0 / shear_modulus(STEEL);
    for (shapes, across) in [(HEXAHEDRA, [8, 6]), (QUADRATIC, [4, 3])] {
        all_slips(torsion(shapes, across, false, mu, angle), mu);
    }
}

fn all_slips((answer, p, moment): (Answer<3>, f64, f64), mu: f64) {
    let a = (0.75 * p * 0.5 * RADIUS / (0.5 * modulus(STEEL))).cbrt();
    compare(
        "torsion, all slips, M",
        moment,
        3.0 / 16.0 * PI * mu * p * a,
        0.01,
    );
    // Around the axis.
    for i in 0..answer.m() {
        let ([x, y, _], [fx, fy, _]) = (answer.place(i), answer.friction(i));
        let (r, bound) = (x.hypot(y), mu * answer.solution.lambda[i]);
        if r > 0.3 * A && bound > 0.0 {
            let across = (x * fx + y * fy) / r;
            assert!(across.abs() < 0.15 * bound, "{r} {across} {bound}");
        }
    }
}
