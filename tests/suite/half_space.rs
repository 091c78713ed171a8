//! Rigid bodies on an elastic half-space, with closed forms: Hertz's sphere, the flat punch, and a disc that is twisted
//! and slips from its edge inwards.
//!
//! A quarter of the half-space z < 0 is meshed up to two to four radii of the contact. On the outer faces, the
//! displacement under the pressure of the closed form is prescribed (by Boussinesq's forces on circles), or that under
//! a point torque, which is off by some 10⁻³ of the rotation. So neither the size of the block nor the contact's own
//! pressure enters; the error is that of the elements.

use crate::common::half_space::{
    STEEL, balanced, compare, growing, hertz_fit, hertz_share, modulus, on_rings, rings,
    shear_modulus, sizes, under_a_pressed_disc, under_a_torque,
};
use crate::common::models::answer;
use crate::common::order::{Order, of_order};
use crate::common::space::Vector;
use signorini::contact::Obstacle;
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::structured::{SolidShape, block};
use signorini::mesh::{Mesh, facet_nodes};
use signorini::model::{Model, Pair, Support, Traction};
use std::f64::consts::PI;

/// A block of the quarter x, y > 0 of z < 0, with `place` giving its nodes from their numbers along the axes, the third
/// from the surface down; the faces of its top with all corners within `reach` of the z axis are "contact".
fn quarter(
    cells: [usize; 3],
    shape: SolidShape,
    reach: f64,
    place: impl Fn([usize; 3]) -> Vector,
) -> Mesh<3> {
    let size = cells.map(|n| n as f64);
    let mut mesh = block([0.0, 0.0, -size[2]], size, cells, shape, "body", "");
    for node in &mut mesh.nodes {
        let [i, j, k] = node.map(|x| x.abs().round() as usize);
        *node = place([i, j, k]);
    }
    let inside = |node: &u32| {
        let [x, y, _] = mesh.nodes[*node as usize];
        x.hypot(y) <= reach * (1.0 + 1e-9)
    };
    let mut faces = mesh.boundaries["top"].clone();
    faces.retain(|face| facet_nodes(face).iter().all(inside));
    mesh.boundaries.insert("contact".to_owned(), faces);
    mesh
}

/// The quarter of the half-space with prescribed displacements far away.
fn half_space(
    mesh: Mesh<3>,
    material: Material,
    far: impl Fn(Vector) -> Vector + Copy + Send + Sync + 'static,
) -> Model<3> {
    let along = move |c: usize| move |x: Vector| far(x)[c];
    Model::on(mesh).material(material).support(
        Support::on(["right", "back", "bottom"])
            .x(along(0))
            .y(along(1))
            .z(along(2)),
    )
}

/// A rigid sphere on a block of this many elements across the radius of contact, with a Tresca bound if it is not zero; the
/// force at an approach, the radius and the peak may be off by the limits.
fn hertz(
    name: &str,
    (shape, order): (SolidShape, Order),
    across: usize,
    bound: f64,
    [of_force, of_fit]: [f64; 2],
) {
    let (r, a, size) = (10.0, 0.1f64, 0.4);
    let (approach, modulus) = (a * a / r, modulus(STEEL));
    let force = 4.0 / 3.0 * modulus * a.powi(3) / r;
    let p0 = 1.5 * force / (PI * a * a);
    let h = a / across as f64;
    let inner: Vec<f64> = (0..=across + across / 5).map(|k| h * k as f64).collect();
    let flat = growing(&inner, 1.3 * h, 8, size);
    let deep = growing(&[0.0], h, 11, size);
    let cells = [flat.len() - 1, flat.len() - 1, deep.len() - 1];
    let place = |[i, j, k]: [usize; 3]| [flat[i], flat[j], -deep[k]];
    let mesh = quarter(cells, shape, 1.2 * a * 2f64.sqrt(), place);
    let sphere = Obstacle::Sphere {
        center: [0.0, 0.0, r],
        radius: r,
    };
    let mut pair = Pair::obstacle("contact", sphere);
    if bound > 0.0 {
        // In Hertz's contact the gap was up to a²/(2R).
        pair = pair.tresca(bound * p0).search_distance(0.5 * a * a / r);
    }
    // Far away the block comes towards the sphere.
    let far = move |x: Vector| {
        let u = under_a_pressed_disc(STEEL, force, a, hertz_share, x);
        [u[0], u[1], u[2] + approach]
    };
    let model = half_space(of_order(mesh, order), STEEL, far)
        .support(Support::on(["left", "front"]).symmetry())
        .contact(pair);
    let answer = answer(model, 1e-8, Stiffness::Cholesky);
    let [_, contact, _] = answer.resultants();
    balanced(&answer, 1e-9 * force);
    sizes(name, &answer);
    let found = -4.0 * contact[2];
    compare(
        &format!("{name}, force at the approach a²/R"),
        found,
        force,
        of_force,
    );
    let (radius, peak) = hertz_fit(&answer);
    let expected = (0.75 * found * r / modulus).cbrt();
    compare(&format!("{name}, a"), radius, expected, of_fit);
    compare(
        &format!("{name}, p₀"),
        peak,
        1.5 * found / (PI * expected.powi(2)),
        of_fit,
    );
    if bound > 0.0 {
        let mut slipping = 0;
        for i in 0..answer.m() {
            let rubbing = answer.friction(i).map(|f| f / answer.area(i));
            let size = rubbing.iter().map(|f| f * f).sum::<f64>().sqrt();
            assert!(size <= bound * p0 * (1.0 + 1e-9));
            slipping += usize::from(size > bound * p0 * (1.0 - 1e-6));
        }
        assert!(slipping > 20, "{slipping}");
    }
}

#[test]
fn hertz_sphere() {
    let hexahedra = (SolidShape::Hexahedron, Order::First);
    hertz("sphere, hexahedra", hexahedra, 10, 0.0, [0.03, 0.02]);
    hertz(
        "sphere, hexahedra, Tresca bound p₀/200",
        hexahedra,
        10,
        0.005,
        [0.03, 0.02],
    );
}

#[test]
fn hertz_sphere_on_tetrahedra() {
    let tetrahedra = (SolidShape::Tetrahedron, Order::First);
    hertz("sphere, tetrahedra", tetrahedra, 10, 0.0, [0.03, 0.02]);
}

#[test]
fn hertz_sphere_of_second_order() {
    for (name, shape, order) in [
        ("tet10", SolidShape::Tetrahedron, Order::Lagrange),
        ("hex20", SolidShape::Hexahedron, Order::Serendipity),
        ("hex27", SolidShape::Hexahedron, Order::Lagrange),
    ] {
        hertz(
            &format!("sphere, {name}"),
            (shape, order),
            4,
            0.0,
            [0.03, 0.02],
        );
    }
}

/// A quarter whose grid follows the circle of radius 1: squares bent into circles there and left alone far away and
/// near the axis; fine on both sides of the circle, with this many cells from the axis to it, and from it outwards and down.
fn disc_mesh(across: usize, size: f64, [out, down]: [usize; 2]) -> Mesh<3> {
    let (radii, last) = rings(across, out, size);
    let deep = growing(&[0.0], last, down, size);
    let n = radii.len() - 1;
    let cells = [n, n, deep.len() - 1];
    quarter(cells, SolidShape::Hexahedron, 1.0, |[i, j, k]| {
        let [x, y] = on_rings(&radii, size, [i, j]);
        [x, y, -deep[k]]
    })
}

fn floor() -> Obstacle<3> {
    Obstacle::HalfSpace {
        point: [0.0; 3],
        normal: [0.0, 0.0, -1.0],
    }
}

/// Radius 1: δ = F/(2E*a).
#[test]
fn flat_punch() {
    let (approach, modulus) = (1e-3, modulus(STEEL));
    let force = 2.0 * modulus * approach;
    let far = move |x: Vector| {
        let u = under_a_pressed_disc(STEEL, force, 1.0, f64::sin, x);
        [u[0], u[1], u[2] + approach]
    };
    let model = half_space(disc_mesh(12, 2.0, [16, 20]), STEEL, far)
        .support(Support::on(["left", "front"]).symmetry())
        .contact(Pair::obstacle("contact", floor()));
    let answer = answer(model, 1e-8, Stiffness::Cholesky);
    let [_, contact, _] = answer.resultants();
    balanced(&answer, 1e-9 * force);
    assert!((0..answer.m()).all(|i| answer.pressure(i) > 0.0));
    let area: f64 = (0..answer.m()).map(|i| answer.area(i)).sum();
    sizes("punch", &answer);
    compare("punch, area of its base", 4.0 * area, PI, 0.005);
    compare(
        "punch, F/(2 E* δ)",
        -4.0 * contact[2] / (2.0 * modulus * approach),
        1.0,
        0.01,
    );
    // p = F/(2π √(1 − r²)) away from the edge.
    for i in 0..answer.m() {
        let [x, y, _] = answer.place(i);
        let r2 = x * x + y * y;
        let expected = force / (2.0 * PI * (1.0 - r2).sqrt());
        if r2 < 0.25 {
            assert!((answer.pressure(i) / expected - 1.0).abs() < 0.02);
        }
    }
}

/// A disc that turns on the half-space and slips outside of the radius c under Tresca's bound g. By superposition of the rigid
/// discs of Reissner and Sagoci (1944) of all radii from c to 1, whose tractions must add up to g there (Abel's equation): θ =
/// g/(2G) arcosh(1/c), M = 4g/3 (arccos c + c √(1 − c²)), which is 16Gθ/3 without slip and 2πg/3 if everything slips; inside of c
/// the traction is 2g/π arctan(r √((1 − c²)/(c² − r²))). Only a uniform pressure, which keeps the disc in contact, causes motion
/// along z.
#[test]
fn twisted_disc() {
    let (g, p, shear) = (1e6, 2e6, shear_modulus(STEEL));
    let nu = STEEL.poisson;
    // Of a uniform pressure where nothing moves aside.
    let strain = p * (1.0 + nu) * (1.0 - 2.0 * nu) / ((1.0 - nu) * STEEL.young);
    for c in [0.25, 0.5, 0.75] {
        let angle = 0.5 * g / shear * f64::acosh(1.0 / c);
        let torque = 4.0 / 3.0 * g * (f64::acos(c) + c * (1.0 - c * c).sqrt());
        // The disc is at rest and everything else rotates back.
        let far = move |x: Vector| {
            let u = under_a_torque(STEEL, torque, x);
            [u[0] + angle * x[1], u[1] - angle * x[0], -strain * x[2]]
        };
        let mut mesh = disc_mesh(10, 3.0, [10, 14]);
        let disc = mesh.boundaries["contact"].clone();
        let touches = |node: &u32| disc.iter().any(|face| facet_nodes(face).contains(node));
        for (name, whole) in [
            ("around", "top"),
            ("below-left", "left"),
            ("below-front", "front"),
        ] {
            let mut faces = mesh.boundaries[whole].clone();
            match name {
                "around" => faces.retain(|face| !disc.contains(face)),
                // Only the disc determines its normal displacement.
                _ => faces.retain(|face| !facet_nodes(face).iter().any(touches)),
            }
            mesh.boundaries.insert(name.to_owned(), faces);
        }
        // Torsion turns the planes of symmetry out of themselves, and moves nothing in them.
        let model = half_space(mesh, STEEL, far)
            .support(Support::on("left").y(0.0))
            .support(Support::on("front").x(0.0))
            .support(Support::on(["below-left", "below-front"]).z(move |x: Vector| far(x)[2]))
            .traction(Traction::on("around").pressure(p))
            .traction(Traction::on(["left", "front"]).pressure(nu / (1.0 - nu) * p))
            .contact(Pair::obstacle("contact", floor()).tresca(g));
        let answer = answer(model, 1e-8, Stiffness::Cholesky);
        let (mut found, mut slips) = (0.0, 0);
        for i in 0..answer.m() {
            let ([x, y, _], [fx, fy, _]) = (answer.place(i), answer.friction(i));
            let (r, size) = (x.hypot(y), fx.hypot(fy));
            found -= 4.0 * (x * fy - y * fx);
            let slipping = r > 0.0 && answer.solution.sets.slips(i);
            slips += usize::from(slipping);
            assert!(slipping == (r > c) || (r - c).abs() < 0.1, "{r} {slipping}");
            // Around the axis.
            let along = (x * fx + y * fy) / r.max(1e-9);
            assert!(along.abs() < 0.05 * g * answer.area(i), "{along}");
            if r < c {
                let rubs = (r * (1.0 - c * c).sqrt()).atan2((c * c - r * r).sqrt()) * 2.0 / PI;
                assert!(
                    (size / (g * answer.area(i)) - rubs).abs() < 0.1,
                    "{r} {rubs}"
                );
            }
            // On the planes of symmetry the shear that they cut goes to the contact, too.
            if x > 0.0 && y > 0.0 {
                let pressure = answer.pressure(i);
                assert!((pressure / p - 1.0).abs() < 0.03, "{pressure}");
            }
        }
        sizes(&format!("disc, c = {c}, {slips} nodes slip"), &answer);
        compare(
            &format!("disc that slips from c = {c}, torque"),
            found,
            torque,
            0.01,
        );
    }
}
