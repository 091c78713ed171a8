//! Thermal strain and rotation against closed forms; parts that are turned.

use crate::common::or_panic::OrPanic as _;
use crate::common::solve_case;
use signorini::case::{Case, CaseProblem};
use signorini::contact::Space;
use signorini::elasticity::{Incompressible, Material, stresses_at};
use signorini::mesh::structured::{CellShape, SolidShape, block, rectangle};
use signorini::mesh::{ElementKind, Mesh};
use signorini::model::{AnyBuilt, Built, Model, Support, Temperature};
use std::path::Path;

fn case(text: &str) -> AnyBuilt {
    let case = Case::parse(Path::new("case.toml"), text.to_owned(), &[]).or_panic();
    match case.build().or_panic() {
        CaseProblem::Elastic(built) => *built,
        CaseProblem::Algebraic(_) => panic!("no bodies"),
    }
}

fn plane(text: &str) -> Built {
    match case(text) {
        AnyBuilt::Plane(built) => built,
        AnyBuilt::Space(_) => panic!("none of the plane"),
    }
}

fn displacements<const D: usize>(built: &Built<D>) -> Vec<[f64; D]>
where
    ElementKind: Space<D>,
{
    let solution = built.solve(&Default::default()).or_panic().remove(0);
    let data = built.step(0).or_panic();
    data.unknowns.displacements(&solution.u)
}

/// Held at a corner and kept from rotating, a body with a linear or uniform temperature has no stress and the displacement of
/// free expansion: α θ x where θ is uniform.
fn expands_freely<const D: usize>(mesh: Mesh<D>, incompressible: Incompressible)
where
    ElementKind: Space<D>,
{
    let material = Material {
        expansion: 2e-4,
        incompressible,
        ..Material::new(3.0, 0.3)
    };
    let mut corners = [[0.0; D]; 3];
    corners[1][0] = 1.0;
    corners[2][1] = 1.0;
    let mut model = Model::on(mesh).material(material);
    model = model.temperature(Temperature::everywhere(50.0));
    // Along each axis one, two and three points of the planes through the origin.
    let hold = |point: [f64; D], axis: usize| match axis {
        0 => Support::at_point(point).x(0.0),
        _ => Support::at_point(point).y(0.0),
    };
    model = model
        .support(hold(corners[0], 0))
        .support(hold(corners[0], 1));
    model = model.support(hold(corners[1], 1));
    let built = match D {
        2 => model,
        _ => {
            // u_z = 0 at three corners of the bottom.
            let bottom = Support::on("bottom").symmetry();
            model.support(bottom)
        }
    };
    let built = built.build().or_panic();
    let u = displacements(&built);
    // In plane strain the expansion that is prevented across the plane adds to that inside it.
    let factor = if D == 2 { 1.3 } else { 1.0 };
    for (u, x) in u.iter().zip(&built.elastic.mesh.nodes) {
        for c in 0..D {
            assert!(
                (u[c] - factor * 2e-4 * 50.0 * x[c]).abs() < 1e-14,
                "{u:?} at {x:?}"
            );
        }
    }
    let data = built.step(0).or_panic();
    assert!(data.total_load.iter().all(|v| v.abs() < 1e-12));
    let field = |region, x| data.temperature.at(region, x);
    let (nodes, elements) = stresses_at(&built.elastic.body(), &u, Some(&field));
    let across = if factor > 1.0 {
        -3.0 * 2e-4 * 50.0
    } else {
        0.0
    };
    for s in nodes.iter().chain(&elements) {
        let all = [s.xx, s.yy, s.xy, s.yz, s.zx, s.zz - across];
        assert!(all.iter().all(|v| v.abs() < 1e-12), "{s:?}");
    }
}

#[test]
fn warm_bodies_expand_without_stress() {
    for incompressible in [Incompressible::No, Incompressible::Yes] {
        for shape in [CellShape::Quad, CellShape::Triangle] {
            let mesh = rectangle([0.0; 2], [1.0; 2], [3, 2], shape, "body", "");
            expands_freely(mesh.clone(), incompressible);
            expands_freely(mesh.raised().or_panic(), incompressible);
        }
        for shape in [
            SolidShape::Hexahedron,
            SolidShape::Tetrahedron,
            SolidShape::Wedge,
        ] {
            let mesh = block([0.0; 3], [1.0; 3], [2; 3], shape, "body", "");
            expands_freely(mesh.clone(), incompressible);
            expands_freely(mesh.raised().or_panic(), incompressible);
        }
    }
}

/// Two blocks on top of each other expand freely. They need no forces, and rounding must not count as one.
#[test]
fn warm_blocks_on_each_other_bear_nothing() {
    for friction in ["none", "{ coulomb = 0.3 }"] {
        for (cells, warmth) in [([9, 6], 37.3_f64), ([4, 7], 100.0), ([11, 5], -41.0)] {
            let solved = solve_case(
                &format!(
                    "[[mesh.part]]\nname = \"a\"\nrectangle = {{ size = [3, 1], cells = [{}, 3] }}\n\
                     [[mesh.part]]\nname = \"b\"\nrectangle = {{ size = [3, 0.7], cells = [{}, 3] }}\nshift = [0, 1]\n\
                     [[material]]\nyoung = 1\npoisson = 0\nexpansion = 1e-5\n[[temperature]]\nvalue = {warmth}\n\
                     [[support]]\nboundary = \"a-bottom\"\ny = 0\n[[support]]\npoint = [0, 0]\nx = 0\n\
                     [[contact]]\nboundary = \"b-bottom\"\nagainst = \"a-top\"\nfriction = {}\n",
                    cells[0],
                    cells[1],
                    if friction == "none" {
                        "\"none\""
                    } else {
                        friction
                    },
                ),
                1e-6,
            );
            let most = (solved.solution().lambda.iter()).fold(0.0_f64, |most, l| most.max(l.abs()));
            assert!(most <= 1e-14 * 1e-5 * warmth.abs(), "{cells:?}: {most:e}");
        }
    }
}

/// A ring in the text of a case: from `inner` to `outer`, a quarter of `around` by `across` cells, as a part of this name.
fn ring(name: &str, inner: f64, outer: f64, cells: [usize; 2]) -> String {
    let size = outer - inner;
    format!(
        "[[mesh.part]]\nname = \"{name}\"\n[mesh.part.rectangle]\nsize = [1, 1]\ncells = [{}, {}]\n\
         map = [\"({inner} + {size} * x) * cos(pi / 2 * y)\", \"({inner} + {size} * x) * sin(pi / 2 * y)\"]\n",
        cells[0], cells[1]
    )
}

const HELD: &str = "[[support]]\nboundary = [\"in-bottom\", \"in-top\", \"out-bottom\", \"out-top\"]\nsymmetry = true\n";

/// Two rings that just touch; the inner one is warmed by θ: as if it were too large by α θ b. Plane stress, one material:
/// p = E α θ (b² − a²) (c² − b²) / (2 b² (c² − a²)).
#[test]
fn a_shrink_fit_by_temperature_has_lames_pressure() {
    let [a, b, c] = [0.5_f64, 1.0, 1.5];
    let (young, alpha, warmth) = (2.0e5, 1.2e-5, 100.0);
    let p = young * alpha * warmth * (b * b - a * a) * (c * c - b * b)
        / (2.0 * b * b * (c * c - a * a));
    let mut last = f64::INFINITY;
    for n in [8, 16] {
        let text = format!(
            "{}{}[analysis]\nplane = \"plane_stress\"\n[[material]]\nyoung = {young}\npoisson = 0.3\nexpansion = {alpha}\n\
             {HELD}[[contact]]\nboundary = \"in-right\"\nagainst = \"out-left\"\ngap = 0\n\
             [[temperature]]\nregion = \"in\"\nvalue = {warmth}\n",
            ring("in", a, b, [n, 2 * n]),
            ring("out", b, c, [n, 3 * n]),
        );
        let built = plane(&text);
        let solution = built.solve(&Default::default()).or_panic().remove(0);
        let forces = &solution.lambda[..built.problem.m()];
        let length: f64 = built
            .elastic
            .contact
            .places
            .iter()
            .map(|place| place.area)
            .sum();
        let mean = forces.iter().sum::<f64>() / length;
        let off = (mean / p - 1.0).abs();
        println!(
            "shrink fit, {n} cells across a ring: {mean:.4} for {p:.4}, {:+.3} %",
            100.0 * (mean / p - 1.0)
        );
        assert!(off < 0.5 * last, "{off:e} after {last:e}");
        last = off;
    }
    assert!(last < 2e-3, "{last:e}");
}

/// The radial displacement of a rotating ring of plane stress (Timoshenko and Goodier, § 32).
#[test]
fn a_rotating_ring_grows_as_it_should() {
    let (a, b): (f64, f64) = (0.5, 1.5);
    let (young, nu, density, speed) = (2.0e5, 0.3, 7.8, 40.0);
    let text = format!(
        "[mesh]\norder = 2\n{}[analysis]\nplane = \"plane_stress\"\nrotation = {{ speed = {speed} }}\n\
         [[material]]\nyoung = {young}\npoisson = {nu}\ndensity = {density}\n\
         [[support]]\nboundary = [\"disc-bottom\", \"disc-top\"]\nsymmetry = true\n",
        ring("disc", a, b, [8, 12]),
    );
    let built = plane(&text);
    let exact = |r: f64| {
        density * speed * speed / (8.0 * young)
            * ((3.0 + nu) * (1.0 - nu) * (a * a + b * b) * r
                + (1.0 + nu) * (3.0 + nu) * a * a * b * b / r
                - (1.0 - nu * nu) * r.powi(3))
    };
    for (u, x) in displacements(&built).iter().zip(&built.elastic.mesh.nodes) {
        let r = x[0].hypot(x[1]);
        let radial = (u[0] * x[0] + u[1] * x[1]) / r;
        assert!(
            (radial / exact(r) - 1.0).abs() < 1e-4,
            "{radial} for {} at {r}",
            exact(r)
        );
    }
    // The mass of a quarter times the distance of its centroid along each axis.
    let whole = density * speed * speed * (b.powi(3) - a.powi(3)) / 3.0;
    let load = built.step(0).or_panic().total_load;
    assert!(
        load.iter().all(|v| (v / whole - 1.0).abs() < 1e-4),
        "{load:?} for {whole}"
    );
}

/// About an axis in space, through a point: only the way across the axis counts, and factors multiply the force.
#[test]
fn rotation_in_space_acts_across_its_axis() {
    let text = "[mesh.box]\nsize = [1, 2, 3]\ncells = [2, 2, 2]\n[steps]\nfactors = [1, 0.25]\n\
                [analysis]\nrotation = { point = [1, 0, 5], axis = [0, 0, 2], speed = 3 }\n\
                [[material]]\nyoung = 1e3\npoisson = 0.3\ndensity = 2\n[[support]]\nboundary = \"bottom\"\nx = 0\ny = 0\nz = 0\n";
    let AnyBuilt::Space(built) = case(text) else {
        panic!("no solid");
    };
    // ρ ω² V times the centroid from the axis.
    for (step, factor) in [(0, 1.0), (1, 0.25)] {
        let load = built.step(step).or_panic().total_load;
        let expected = [-0.5, 1.0, 0.0].map(|arm| factor * 2.0 * 9.0 * 6.0 * arm);
        assert!(
            load.iter()
                .zip(expected)
                .all(|(a, b)| (a - b).abs() < 1e-10),
            "{load:?}"
        );
    }
}

/// A part is scaled, turned, then shifted.
#[test]
fn parts_are_turned() {
    let text = "[[mesh.part]]\nname = \"a\"\nbox = { size = [1, 2, 3], cells = [1, 1, 1] }\n\
                rotate = { point = [1, 0, 0], axis = [0, 0, 1], angle = 90 }\nshift = [0, 0, 10]\n\
                [[material]]\nyoung = 1e3\npoisson = 0.3\n[[support]]\nboundary = \"a-bottom\"\nx = 0\ny = 0\nz = 0\n";
    let AnyBuilt::Space(built) = case(text) else {
        panic!("no solid");
    };
    // (x, y) becomes (1 − y, x − 1).
    let (low, high) = built.elastic.mesh.bounding_box();
    let expected = [[-1.0, -1.0, 10.0], [1.0, 0.0, 13.0]];
    for (found, expected) in [low, high].iter().flatten().zip(expected.iter().flatten()) {
        assert!((found - expected).abs() < 1e-15, "{low:?} {high:?}");
    }
    // The normal along x is along y after the rotation.
    let facet = built.elastic.mesh.boundaries["a-right"][0];
    assert!((built.elastic.mesh.facet_normal(&facet).1[1] - 1.0).abs() < 1e-15);
}

#[test]
fn faults_of_temperatures_and_rotations_are_reported() {
    let read = |analysis: &str, rest: &str| {
        let text = format!(
            "[mesh.rectangle]\nsize = [1, 1]\ncells = [1, 1]\n[analysis]\n{analysis}\n\
             [[material]]\nyoung = 1.0\npoisson = 0.3\n{rest}\n[[support]]\nboundary = \"left\"\nx = 0\ny = 0\n"
        );
        let case = Case::parse(Path::new("case.toml"), text, &[]).map_err(|e| e.to_string())?;
        case.build().map(drop).map_err(|e| e.to_string())
    };
    for (analysis, rest, expected) in [
        (
            "",
            "[[temperature]]\nvalue = 5",
            "line 9: there is a temperature, but no material has an expansion",
        ),
        (
            "",
            "expansion = 1e-5\n[[temperature]]\nregion = \"bodi\"\nvalue = 5",
            "did you mean \"body\"?",
        ),
        (
            "",
            "expansion = 1e-5\n[[temperature]]\nvalue = \"1 / (x - x)\"",
            "the thermal expansion has no finite value",
        ),
        ("", "expansion = inf", "expansion is inf: it must be finite"),
        (
            "rotation = { speed = 3 }",
            "",
            "line 5: there is a rotation, but no material has a density",
        ),
        (
            "rotation = { axis = [0, 0, 1], speed = 3 }",
            "density = 1",
            "leave out axis",
        ),
        (
            "rotation = { point = [0, 0, 1], speed = 3 }",
            "density = 1",
            "expected 2 entries, found 3",
        ),
        (
            "rotation = { speed = nan }",
            "density = 1",
            "the speed of the rotation must be finite",
        ),
    ] {
        let error = read(analysis, rest).expect_err(expected);
        assert!(error.contains(expected), "{expected}: {error}");
    }
}
