//! Large displacements: tangents against differences, forces against the energy, turns, and known results at rest.

use super::super::*;
use crate::mesh::structured::{CellShape, SolidShape, block, rectangle};
use approx::assert_relative_eq;

/// A number in (−1, 1) that looks random.
fn noise(seed: usize) -> f64 {
    let x = (seed as f64 * 12.9898 + 1.0).sin() * 43758.5453;
    2.0 * (x - x.floor()) - 1.0
}

/// A vector turned in the plane of the first two axes.
fn turned_about_last<const D: usize>(v: [f64; D], angle: f64) -> [f64; D] {
    let (sin, cos) = angle.sin_cos();
    std::array::from_fn(|c| match c {
        0 => cos * v[0] - sin * v[1],
        1 => sin * v[0] + cos * v[1],
        _ => v[c],
    })
}

fn noisy<const D: usize>(n: usize, size: f64, seed: usize) -> Vec<[f64; D]> {
    let of = |i: usize| std::array::from_fn(|c| size * noise(seed + D * i + c));
    (0..n).map(of).collect()
}

fn free<const D: usize>(n: usize) -> Unknowns<D> {
    Unknowns::new(vec![[None; D]; n])
}

fn difference<const D: usize>(a: &[[f64; D]], b: &[[f64; D]]) -> f64 {
    let each = a.as_flattened().iter().zip(b.as_flattened());
    each.fold(0.0, |max: f64, (a, b)| max.max((a - b).abs()))
}

fn largest<const D: usize>(a: &[[f64; D]]) -> f64 {
    a.as_flattened()
        .iter()
        .fold(0.0, |max: f64, v| max.max(v.abs()))
}

/// Displaced by a quarter of an element and more: forces are the slopes of the energy, the tangent those of the forces.
/// At rest the tangent is the stiffness matrix. A turn of everything turns forces and stresses.
fn check<const D: usize>(body: &Body<D>, what: &str)
where
    ElementKind: Topology<D>,
{
    let n = body.mesh.nodes.len();
    let unknowns = free::<D>(n);
    let warm = |_: u32, x: [f64; D]| 20.0 + 5.0 * x[1];
    let temperature: Temperature<D> = &warm;
    let at = |u: &[[f64; D]], warm: bool| {
        let of = Deformed::new(body, u, warm.then_some(temperature));
        (of.resistance(), of.tangent(&unknowns))
    };
    let u = noisy::<D>(n, 0.08, 7);
    let of = Deformed::new(body, &u, None);
    assert!(of.least_volume() > 0.1, "{what}: {}", of.least_volume());
    let step = 1e-5;
    for warm in [false, true] {
        let (_, k) = at(&u, warm);
        let way = noisy::<D>(n, 1.0, 1234);
        let moved = |sign: f64| -> Vec<[f64; D]> {
            let each = u.iter().zip(&way);
            each.map(|(u, w)| std::array::from_fn(|c| u[c] + sign * step * w[c]))
                .collect()
        };
        let [(before, _), (behind, _)] = [moved(-1.0), moved(1.0)].map(|u| at(&u, warm));
        let (here, _) = at(&u, warm);
        let slope = (behind.energy - before.energy) / (2.0 * step);
        let work: f64 = (here.forces.as_flattened().iter())
            .zip(way.as_flattened())
            .map(|(f, w)| f * w)
            .sum();
        assert!(
            (slope - work).abs() < 1e-7 * (1.0 + work.abs()),
            "{what}: {slope} {work}"
        );
        let mut product = vec![0.0; D * n];
        k.mul(way.as_flattened(), &mut product);
        let slopes: Vec<f64> = (behind.forces.as_flattened().iter())
            .zip(before.forces.as_flattened())
            .map(|(a, b)| (a - b) / (2.0 * step))
            .collect();
        let size = product.iter().fold(0.0, |max: f64, v| max.max(v.abs()));
        for (a, b) in product.iter().zip(&slopes) {
            assert!((a - b).abs() < 1e-7 * size, "{what}, warm: {warm}: {a} {b}");
        }
    }
    let (rest, k) = at(&vec![[0.0; D]; n], false);
    assert!(largest(&rest.forces) < 1e-14);
    let (linear, _) = assemble(body, &unknowns, &vec![[0.0; D]; n]);
    for (found, expected) in k.values().iter().zip(linear.values()) {
        for (a, b) in found.as_flattened().iter().zip(expected.as_flattened()) {
            assert_relative_eq!(a, b, epsilon = 1e-13, max_relative = 1e-10);
        }
    }
    // About the last axis: a body of revolution does not turn about it.
    if body.plane == Plane::Axisymmetric && D == 2 {
        return;
    }
    let turned = |v| turned_about_last(v, 1.9);
    let whole = body.mesh.nodes.iter().zip(&u).map(|(x, u)| {
        let there = turned(std::array::from_fn(|c| x[c] + u[c]));
        std::array::from_fn(|c| there[c] - x[c])
    });
    let whole: Vec<[f64; D]> = whole.collect();
    let (here, there) = (at(&u, true).0, at(&whole, true).0);
    let expected: Vec<[f64; D]> = here.forces.iter().map(|f| turned(*f)).collect();
    assert!(
        difference(&there.forces, &expected) < 1e-12 * (1.0 + largest(&expected)),
        "{what}"
    );
    assert_relative_eq!(here.energy, there.energy, max_relative = 1e-11);
    let [before, behind] = [&u, &whole].map(|u| {
        let of = Deformed::new(body, u, Some(temperature));
        cauchy_stresses(&of).1
    });
    for (a, b) in before.iter().zip(&behind) {
        assert_relative_eq!(a.von_mises(), b.von_mises(), max_relative = 1e-9);
        assert_relative_eq!(a.zz, b.zz, max_relative = 1e-9, epsilon = 1e-12);
        assert_relative_eq!(
            a.xx + a.yy,
            b.xx + b.yy,
            max_relative = 1e-9,
            epsilon = 1e-12
        );
    }
}

const LAWS: [Hyperelastic; 2] = [Hyperelastic::StVenantKirchhoff, Hyperelastic::NeoHooke];

fn material(law: Hyperelastic, poisson: f64, incompatible_modes: bool) -> Material {
    Material {
        law,
        expansion: 1e-3,
        incompatible_modes,
        ..Material::new(2.0, poisson)
    }
}

/// Laws, Poisson's ratios, and whether elements of first order have incompatible modes: nearly incompressible ones are on the verge of
/// buckling here, and differences are less accurate.
fn cases(order: usize) -> impl Iterator<Item = (Hyperelastic, f64, bool)> {
    let with = LAWS.into_iter().flat_map(|law| [(law, 0.3), (law, 0.48)]);
    let with = with.flat_map(|(law, poisson)| [(law, poisson, false), (law, poisson, true)]);
    with.filter(move |case| !case.2 || order == 1 && case.1 == 0.3)
}

/// The same mesh with elements of any shape, if wanted.
fn bent<const D: usize>(mesh: &Mesh<D>, wanted: bool) -> Mesh<D>
where
    ElementKind: Topology<D>,
{
    let mut mesh = mesh.clone();
    let by = noisy::<D>(mesh.nodes.len(), if wanted { 0.1 } else { 0.0 }, 99);
    for (x, by) in mesh.nodes.iter_mut().zip(by) {
        (0..D).for_each(|c| x[c] += by[c]);
    }
    mesh
}

#[test]
fn laws_of_the_plane() {
    for shape in [CellShape::Quad, CellShape::Triangle] {
        for order in [1, 2] {
            let mut mesh = rectangle([1.0, 0.0], [3.0, 1.0], [2, 1], shape, "body", "");
            if order == 2 {
                mesh = mesh.raised().unwrap_or_else(|error| panic!("{error}"));
            }
            for plane in [Plane::PlaneStrain, Plane::PlaneStress, Plane::Axisymmetric] {
                for (law, poisson, modes) in cases(order) {
                    let body = Body {
                        mesh: &bent(&mesh, modes),
                        materials: &[material(law, poisson, modes)],
                        plane,
                        thickness: if plane == Plane::Axisymmetric {
                            1.0
                        } else {
                            0.7
                        },
                    };
                    check(
                        &body,
                        &format!("{shape:?} {order} {plane:?} {law:?} {poisson} {modes}"),
                    );
                }
            }
        }
    }
}

#[test]
fn laws_of_space() {
    for shape in [
        SolidShape::Hexahedron,
        SolidShape::Tetrahedron,
        SolidShape::Wedge,
    ] {
        for order in [1, 2] {
            let mut mesh = block([0.0; 3], [1.2, 1.0, 0.9], [1, 1, 1], shape, "body", "");
            if order == 2 {
                mesh = mesh.raised().unwrap_or_else(|error| panic!("{error}"));
            }
            for (law, poisson, modes) in cases(order) {
                let body = Body {
                    mesh: &bent(&mesh, modes),
                    materials: &[material(law, poisson, modes)],
                    plane: Plane::PlaneStrain,
                    thickness: 1.0,
                };
                check(
                    &body,
                    &format!("{shape:?} {order} {law:?} {poisson} {modes}"),
                );
            }
        }
    }
}

/// A block that is stretched alike everywhere: the Cauchy stresses of the textbooks, and no stress of free expansion.
#[test]
fn known_stresses() {
    let mesh = block(
        [0.0; 3],
        [1.0; 3],
        [1, 1, 1],
        SolidShape::Hexahedron,
        "body",
        "",
    );
    let stretch = [1.5_f64, 0.8, 0.9];
    let u: Vec<[f64; 3]> = (mesh.nodes.iter())
        .map(|x| std::array::from_fn(|c| (stretch[c] - 1.0) * x[c]))
        .collect();
    for law in LAWS {
        let material = material(law, 0.3, true);
        let (lambda, mu) = material.lame(Plane::PlaneStrain);
        let body = Body {
            mesh: &mesh,
            materials: &[material],
            plane: Plane::PlaneStrain,
            thickness: 1.0,
        };
        let of = Deformed::new(&body, &u, None);
        let found = cauchy_stresses(&of).1[0];
        let j: f64 = stretch.iter().product();
        let trace: f64 = stretch.iter().map(|s| 0.5 * (s * s - 1.0)).sum();
        let expected = stretch.map(|s| match law {
            Hyperelastic::NeoHooke => (mu * (s * s - 1.0) + lambda * j.ln()) / j,
            Hyperelastic::StVenantKirchhoff => s * s * (lambda * trace + mu * (s * s - 1.0)) / j,
        });
        for (found, expected) in [found.xx, found.yy, found.zz].iter().zip(expected) {
            assert_relative_eq!(*found, expected, max_relative = 1e-12);
        }
        // In plane stress the thickness follows: as in space with the stretch across that leaves no stress there.
        let sheet = rectangle([0.0; 2], [1.0; 2], [1, 1], CellShape::Quad, "sheet", "");
        let body = Body {
            mesh: &sheet,
            materials: &[material],
            plane: Plane::PlaneStress,
            thickness: 1.0,
        };
        let u: Vec<[f64; 2]> = (sheet.nodes.iter())
            .map(|x| std::array::from_fn(|c| (stretch[c] - 1.0) * x[c]))
            .collect();
        let of = Deformed::new(&body, &u, None);
        let found = cauchy_stresses(&of).1[0];
        // By bisection.
        let across = |s: f64| match law {
            Hyperelastic::NeoHooke => {
                mu * (s * s - 1.0) + lambda * (stretch[0] * stretch[1] * s).ln()
            }
            Hyperelastic::StVenantKirchhoff => {
                let plane: f64 = stretch[..2].iter().map(|s| 0.5 * (s * s - 1.0)).sum();
                lambda * (plane + 0.5 * (s * s - 1.0)) + mu * (s * s - 1.0)
            }
        };
        let (mut low, mut high) = (0.1, 3.0);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if across(middle) < 0.0 {
                low = middle
            } else {
                high = middle
            }
        }
        let j = stretch[0] * stretch[1] * low;
        let expected = match law {
            Hyperelastic::NeoHooke => (mu * (stretch[0].powi(2) - 1.0) + lambda * j.ln()) / j,
            Hyperelastic::StVenantKirchhoff => {
                let trace: f64 = [stretch[0], stretch[1], low]
                    .map(|s| 0.5 * (s * s - 1.0))
                    .iter()
                    .sum();
                let s = stretch[0] * stretch[0];
                s * (lambda * trace + mu * (s - 1.0)) / j
            }
        };
        assert_relative_eq!(found.xx, expected, max_relative = 1e-12);
        assert_relative_eq!(found.zz, 0.0);
        let warm = |_: u32, _: [f64; 2]| 30.0;
        let u: Vec<[f64; 2]> = sheet.nodes.iter().map(|x| x.map(|x| 0.03 * x)).collect();
        let of = Deformed::new(&body, &u, Some(&warm));
        assert!(largest(&of.resistance().forces) < 1e-14);
    }
}

/// Small strains: the forces and the energy are those of linear elasticity up to the size of the strains, and to rounding; of a body
/// that has turned, to the rounding of its coordinates.
fn check_small<const D: usize>(body: &Body<D>, what: &str)
where
    ElementKind: Topology<D>,
{
    let n = body.mesh.nodes.len();
    let (k, _) = assemble(body, &free::<D>(n), &vec![[0.0; D]; n]);
    let turned = |v| turned_about_last(v, 0.7);
    for size in [1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4] {
        let u = noisy::<D>(n, size, 7);
        let mut expected = vec![[0.0; D]; n];
        k.mul(u.as_flattened(), expected.as_flattened_mut());
        let whole = body.mesh.nodes.iter().zip(&u).map(|(x, u)| {
            let (there, by) = (turned(*x), turned(*u));
            std::array::from_fn(|c| there[c] - x[c] + by[c])
        });
        let whole: Vec<[f64; D]> = whole.collect();
        let work: f64 = (expected.as_flattened().iter().zip(u.as_flattened()))
            .map(|(f, u)| 0.5 * f * u)
            .sum();
        for (u, turn) in [(&u, false), (&whole, true)] {
            if turn && body.plane == Plane::Axisymmetric && D == 2 {
                continue;
            }
            let found = Deformed::new(body, u, None).resistance();
            let wanted: Vec<[f64; D]> = expected
                .iter()
                .map(|f| if turn { turned(*f) } else { *f })
                .collect();
            let most = 30.0 * size + 1e-12 + if turn { 3e-14 / size } else { 0.0 };
            let off = difference(&found.forces, &wanted) / largest(&wanted);
            let energy = (found.energy / work - 1.0).abs();
            assert!(
                off < most && energy < most,
                "{what}, {size}, turned: {turn}: {off} {energy}"
            );
        }
    }
}

#[test]
fn small_strains_keep_their_digits() {
    for (law, poisson, modes) in cases(1) {
        let materials = [material(law, poisson, modes)];
        let sheet = rectangle([1.0, 0.0], [3.0, 1.0], [2, 1], CellShape::Quad, "body", "");
        for plane in [Plane::PlaneStrain, Plane::PlaneStress, Plane::Axisymmetric] {
            let body = Body {
                mesh: &bent(&sheet, modes),
                materials: &materials,
                plane,
                thickness: 1.0,
            };
            check_small(&body, &format!("{plane:?} {law:?} {poisson} {modes}"));
        }
        let solid = block(
            [0.0; 3],
            [1.2, 1.0, 0.9],
            [1, 1, 1],
            SolidShape::Hexahedron,
            "body",
            "",
        );
        let body = Body {
            mesh: &bent(&solid, modes),
            materials: &materials,
            plane: Plane::PlaneStrain,
            thickness: 1.0,
        };
        check_small(&body, &format!("in space {law:?} {poisson} {modes}"));
    }
}
