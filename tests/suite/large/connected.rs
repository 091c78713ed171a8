//! Springs, foundations, preloads, couplings and sectors of bodies that move far.

use super::elements::plus;
use super::{End, neo_hooke, solved, solved_in_space, works};
use crate::bolts;
use crate::common::apart;
use crate::common::models::stacked;
use crate::common::or_panic::OrPanic as _;
use crate::common::oracle::length;
use signorini::contact::Obstacle;
use signorini::elasticity::Material;
use signorini::engine::Stiffness::{Cholesky, Pcg};
use signorini::mesh::Mesh;
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::model::{
    Axis, Coupling, Cyclic, Equal, Foundation, Model, Pair, Preload, Spring, Support, Traction,
};
use signorini::output::ContactReport;
use signorini::ssnm::Status;
use std::array::from_fn;
use std::f64::consts::{FRAC_PI_2, PI};

/// A rotation of space by a vector, by the formula of Rodrigues.
pub fn turned(x: [f64; 3], by: [f64; 3]) -> [f64; 3] {
    let angle = length(&by);
    let axis = by.map(|v| v / angle);
    let cross = [
        axis[1] * x[2] - axis[2] * x[1],
        axis[2] * x[0] - axis[0] * x[2],
        axis[0] * x[1] - axis[1] * x[0],
    ];
    let along: f64 = (0..3).map(|c| axis[c] * x[c]).sum();
    from_fn(|c| x[c] * angle.cos() + cross[c] * angle.sin() + axis[c] * along * (1.0 - angle.cos()))
}

fn converged<const D: usize>(ends: &[End<D>], most: usize) {
    for (step, end) in ends.iter().enumerate() {
        assert_eq!(end.status, Status::Converged, "step {}", step + 1);
        assert_eq!(end.parts, 1, "step {}", step + 1);
        assert!(
            end.iterations <= most,
            "step {}: {}",
            step + 1,
            end.iterations
        );
    }
}

fn motion(report: &ContactReport) -> Vec<f64> {
    (report.motion.iter())
        .map(|one| one.unwrap_or(f64::NAN))
        .collect()
}

/// A body that nothing else holds goes with its point, through more than half a turn in three load steps, and is nowhere strained.
#[test]
fn a_free_body_goes_with_its_point() {
    let mesh = rectangle([1.0, 0.5], [2.0, 1.0], [4, 2], CellShape::Quad, "body", "");
    let point = [0.3, -0.4];
    let rigid = Coupling::on("left", point)
        .moved(0, 0.7)
        .moved(1, -0.2)
        .turned(2, 1.3);
    for path in [Cholesky, Pcg] {
        for coupling in [rigid.clone(), rigid.clone().distributing()] {
            let model = Model::on(mesh.clone())
                .large_displacements()
                .material(neo_hooke(10.0, 0.3))
                .coupling(coupling)
                .steps([1.0, 2.0, 3.0]);
            let ends = solved(model, 1e-10, path);
            converged(&ends, 12);
            for (k, end) in (1..).zip(&ends) {
                let k = f64::from(k);
                let (sin, cos) = (1.3 * k).sin_cos();
                for (x, u) in mesh.nodes.iter().zip(&end.displacement) {
                    let [a, b] = [x[0] - point[0], x[1] - point[1]];
                    let there = [
                        point[0] + 0.7 * k + cos * a - sin * b,
                        point[1] - 0.2 * k + sin * a + cos * b,
                    ];
                    assert!(apart(&plus(*x, *u), &there) < 1e-8, "{k} {x:?} {u:?}");
                }
                let found = motion(&end.report.contacts[0]);
                assert!(
                    apart(&found, &[0.7 * k, -0.2 * k, 1.3 * k]) < 1e-9,
                    "{found:?}"
                );
            }
        }
    }
}

/// The same in space, by a rotation vector that grows beyond a whole turn.
#[test]
fn a_free_solid_goes_with_its_point() {
    // A turn of 1.1 in each step.
    const FACTORS: [f64; 7] = [0.7, 1.4, 2.1, 2.8, 3.5, 4.2, 4.9];
    let mesh = block(
        [1.0, 0.5, 0.2],
        [2.0, 1.0, 1.0],
        [2, 1, 1],
        SolidShape::Hexahedron,
        "body",
        "",
    );
    let (point, by, to) = ([0.3, -0.4, 0.1], [0.9, -0.7, 1.1], [0.5, 0.1, -0.6]);
    let mut rigid = Coupling::on("left", point);
    for c in 0..3 {
        rigid = rigid.moved(c, to[c]).turned(c, by[c]);
    }
    for coupling in [rigid.clone(), rigid.clone().distributing()] {
        let model = Model::on(mesh.clone())
            .large_displacements()
            .material(neo_hooke(10.0, 0.3))
            .coupling(coupling)
            .steps(FACTORS);
        let ends = solved_in_space(model, 1e-10, Cholesky);
        converged(&ends, 24);
        for (k, end) in FACTORS.into_iter().zip(&ends) {
            for (x, u) in mesh.nodes.iter().zip(&end.displacement) {
                let arm = turned(from_fn(|c| x[c] - point[c]), by.map(|v| k * v));
                let there: [f64; 3] = from_fn(|c| point[c] + k * to[c] + arm[c]);
                assert!(
                    apart(&plus(*x, *u), &there) < 1e-8,
                    "{k} {x:?} {u:?} {there:?}"
                );
            }
            let found = motion(&end.report.contacts[0]);
            for c in 0..3 {
                let expected = [k * to[c], k * by[c]];
                assert!(
                    apart(&[found[c], found[3 + c]], &expected) < 1e-9,
                    "{found:?}"
                );
            }
        }
    }
}

/// Where one rotation of the point is stated, the others are free. Its row is a turn about its axis, and θ is not quite that: iterations
/// converge linearly.
#[test]
fn a_point_turns_about_one_axis() {
    let mesh = block(
        [0.0; 3],
        [2.0, 1.0, 1.0],
        [2, 1, 1],
        SolidShape::Hexahedron,
        "body",
        "",
    );
    let point = [0.0, 0.5, 0.5];
    let coupling = Coupling::on("left", point)
        .moved(0, 0.0)
        .moved(1, 0.0)
        .moved(2, 0.0)
        .turned(2, 0.8);
    let model = Model::on(mesh)
        .large_displacements()
        .material(neo_hooke(10.0, 0.3))
        .coupling(coupling)
        // The far end is held where a turn by (0.3, −0.2, 0.8) takes it.
        .coupling({
            let by = [0.3, -0.2, 0.8];
            let far = turned([2.0, 0.0, 0.0], by);
            let mut at_end = Coupling::on("right", [2.0, 0.5, 0.5]);
            for c in 0..3 {
                at_end = at_end
                    .moved(c, far[c] - if c == 0 { 2.0 } else { 0.0 })
                    .turned(c, by[c]);
            }
            at_end
        });
    let ends = solved_in_space(model, 1e-10, Cholesky);
    converged(&ends, 24);
    let found = motion(&ends[0].report.contacts[0]);
    for (found, expected) in found[3..].iter().zip([0.3, -0.2, 0.8]) {
        assert!((found - expected).abs() < 1e-7, "{found} {expected}");
    }
}

/// A cantilever of 10 × 0.1 bends to an arc by a moment on its end, up to a whole circle: θ = M l/(E I).
#[test]
fn a_moment_rolls_a_cantilever_up() {
    let (l, h) = (10.0, 0.1);
    let mesh = rectangle([0.0, 0.0], [l, h], [48, 1], CellShape::Quad, "beam", "");
    let mesh = mesh.raised().or_panic();
    let inertia = h * h * h / 12.0;
    let young = 1.2e7;
    let moment = 2.0 * PI * young * inertia / l;
    let end = || Coupling::on("right", [l, 0.5 * h]);
    // A distributed moment turns with nodes that move freely: the tangent does not have that.
    for (coupling, most) in [
        (end().moment([moment]), 20),
        (end().turned(2, 2.0 * PI), 14),
        (end().distributing().moment([moment]), 60),
    ] {
        let model = Model::on(mesh.clone())
            .large_displacements()
            .material(Material::new(young, 0.0))
            .support(Support::on("left").fixed())
            .coupling(coupling)
            .steps([0.25, 0.5, 0.75, 1.0]);
        let ends = solved(model, 1e-8, Cholesky);
        converged(&ends, most);
        for (k, end) in (1..).zip(&ends) {
            let angle = FRAC_PI_2 * f64::from(k);
            let report = &end.report.contacts[0];
            let found = motion(report);
            let to = [l * angle.sin() / angle - l, l * (1.0 - angle.cos()) / angle];
            assert!((found[2] - angle).abs() < 5e-3 * angle, "{found:?}");
            assert!(apart(&found[..2], &to) < 5e-3 * l, "{found:?} {to:?}");
            let expected = 0.25 * f64::from(k) * moment;
            assert!((report.moment[0] - expected).abs() < 5e-3 * expected);
        }
    }
}

/// A bolt that is pulled stays as it is when its joint turns: tension, shortening, and all distances.
#[test]
fn a_bolt_turns_with_its_joint() {
    let mesh = block(
        [-2.0, -0.5, -0.5],
        [4.0, 1.0, 1.0],
        [4, 1, 1],
        SolidShape::Hexahedron,
        "bar",
        "",
    );
    let axis = Axis::new([0.0; 3], [1.0, 2.0, 2.0]);
    let (young, force) = (2e5, 6e3);
    let bolt = || Preload::across([0.0; 3], [1.0, 0.0, 0.0]);
    for (preload, what) in [
        (bolt().force(force), "force"),
        (bolt().force(force).locked(), "locked"),
        (bolt().shortening(0.1), "shortening"),
    ] {
        let model = Model::on(mesh.clone())
            .large_displacements()
            .material(Material::new(young, 0.3))
            .support(
                Support::on(["left", "right"])
                    .turned(axis, 50.0)
                    .factors([0.0, 1.0, 2.0]),
            )
            .preload(preload)
            .steps([1.0; 3]);
        let ends = solved_in_space(model, 1e-10, Cholesky);
        converged(&ends, 12);
        let of = |end: &End<3>| {
            let report = &end.report.contacts[0];
            [report.tension, report.shortening].map(|value| value.unwrap_or(f64::NAN))
        };
        let first = of(&ends[0]);
        if what != "shortening" {
            assert!((first[0] - force).abs() < 1e-6 * force, "{what}: {first:?}");
        } else {
            assert!((first[1] - 0.1).abs() < 1e-9, "{what}: {first:?}");
        }
        for (k, end) in [1.0, 2.0].into_iter().zip(&ends[1..]) {
            let now = of(end);
            for (now, first) in now.iter().zip(first) {
                assert!((now - first).abs() < 1e-7 * first, "{what}: {now} {first}");
            }
            let by = [1.0, 2.0, 2.0].map(|v| v / 3.0 * k * 50.0_f64.to_radians());
            for (x, (first, now)) in mesh
                .nodes
                .iter()
                .zip(ends[0].displacement.iter().zip(&end.displacement))
            {
                let there = turned(plus(*x, *first), by);
                assert!(apart(&plus(*x, *now), &there) < 1e-8, "{what}: {x:?}");
            }
        }
    }
}

/// Half a bolt on a plane of symmetry has half the force of the whole one, with a section that bends: it stays on the plane.
#[test]
fn half_a_bolt_stays_on_its_plane() {
    let bar = |low: f64, cells: usize| {
        let mesh = block(
            [-2.0, low, -0.5],
            [4.0, 0.5 - low, 1.0],
            [6, cells, 2],
            SolidShape::Hexahedron,
            "bar",
            "",
        );
        mesh.raised().or_panic()
    };
    let (whole, half) = (bar(-0.5, 4), bar(0.0, 2));
    let model = |mesh: &Mesh<3>, part: f64| {
        let bolt = Preload::across([0.4, 0.1, 0.0], [1.0, 0.0, 0.0]);
        Model::on(mesh.clone())
            .large_displacements()
            .material(Material::new(2e3, 0.3))
            .support(Support::on(["left", "right"]).fixed())
            .traction(Traction::on("top").z(-2.0).factors([1.0, 1.0, 2.0]))
            .preload(bolt.force(60.0 * part).factors([0.5, 1.0, 1.0]).locked())
            .steps([1.0; 3])
    };
    let ends = solved_in_space(model(&whole, 2.0), 1e-10, Cholesky);
    let halves = model(&half, 1.0).support(Support::on("front").y(0.0));
    let halves = solved_in_space(halves, 1e-10, Cholesky);
    converged(&ends, 10);
    converged(&halves, 10);
    for (end, half_end) in ends.iter().zip(&halves) {
        let [bolt, of_half] = [end, half_end].map(|end| &end.report.contacts[0]);
        let [tension, half_tension] = [bolt, of_half].map(|bolt| bolt.tension.unwrap_or(f64::NAN));
        assert!(
            (tension - 2.0 * half_tension).abs() < 1e-3 * tension,
            "{tension} {half_tension}"
        );
        let [short, half_short] = [bolt, of_half].map(|bolt| bolt.shortening.unwrap_or(f64::NAN));
        assert!(
            (short - half_short).abs() < 1e-3 * short,
            "{short} {half_short}"
        );
        // Nodes of both that are not of the section, which has two at a place.
        for (x, u) in half.nodes.iter().zip(&half_end.displacement) {
            let there = whole.nodes.iter().position(|y| apart(x, y) < 1e-9);
            let v = end.displacement[there.expect("it is a half")];
            if x[0].abs() > 1.0 {
                assert!(apart(u, &v) < 1e-4, "{x:?} {u:?} {v:?}");
            }
        }
    }
}

/// The joint of `bolts` with parts that nothing but contact and the bolt hold. Its strains are 4e-4, and so is what linear theory leaves out.
#[test]
fn a_joint_is_tightened_and_pulled_apart() {
    let joint = bolts::joint();
    for path in [Cholesky, Pcg] {
        let ends = solved(joint.model.clone().large_displacements(), 1e-9, path);
        converged(&ends, 8);
        for (load, end) in joint.loads.iter().zip(&ends) {
            joint.check(*load, &end.report, 3e-3);
        }
    }
}

/// A contact with an obstacle that does not act in a step, after one of two bodies in the list, leaves that as it is.
#[test]
fn a_contact_that_does_not_act_leaves_others_alone() {
    let mesh = stacked(1.0, [6, 3]);
    let model = |mesh: &Mesh| {
        Model::on(mesh.clone())
            .large_displacements()
            .material(Material::new(10.0, 0.3))
            .support(Support::on("low-bottom").fixed())
            .traction(Traction::on("up-top").y(-0.3))
            .contact(Pair::new("up-bottom", "low-top").coulomb(0.4))
            .steps([1.0])
    };
    let wall = Obstacle::HalfSpace {
        point: [2.0, 0.0],
        normal: [-1.0, 0.0],
    };
    let idle = Pair::obstacle("up-right", wall).active([0.0]);
    let alone = solved(model(&mesh), 1e-10, Cholesky);
    let both = solved(model(&mesh).contact(idle), 1e-10, Cholesky);
    converged(&alone, 8);
    converged(&both, 8);
    let pairs = alone[0].displacement.iter().zip(&both[0].displacement);
    pairs.for_each(|(a, b)| assert!(apart(a, b) < 1e-9, "{a:?} {b:?}"));
    assert!((alone[0].force()[1] - 0.6).abs() < 1e-8);
}

/// A rigid block that slides along y hangs on a spring whose line turns: k (l − l₀) y/l = P.
#[test]
fn the_line_of_a_spring_turns() {
    let square = |low: [f64; 2], name: &str| {
        let prefix = format!("{name}-");
        rectangle(low, [1.0, 1.0], [2, 2], CellShape::Quad, name, &prefix)
    };
    let mesh = join(square([0.0, 1.0], "block"), square([4.0, -1.0], "wall"));
    let (k, load) = (3.0, 2.5);
    let spring = || Spring::at_point([1.0, 1.0], k).to_point([4.0, 0.0]);
    let model = |spring: Spring| {
        Model::on(mesh.clone())
            .large_displacements()
            .material(Material::new(1e5, 0.0))
            .support(Support::on(["block-left", "block-right"]).x(0.0))
            .support(Support::on("wall-right").fixed())
            .traction(Traction::on("block-bottom").y(load))
            .spring(spring)
            .steps([0.5, 1.0])
    };
    for path in [Cholesky, Pcg] {
        let ends = solved(model(spring()), 1e-9, path);
        converged(&ends, 10);
        for (part, end) in [0.5, 1.0].into_iter().zip(&ends) {
            let at = mesh
                .nodes
                .iter()
                .position(|x| *x == [1.0, 1.0])
                .expect("a node");
            let y = 1.0 + end.displacement[at][1];
            let (l0, l) = (10.0_f64.sqrt(), (9.0 + y * y).sqrt());
            let pull = k * (l - l0) * y / l;
            assert!((pull - part * load).abs() < 1e-3, "{y} {pull}");
        }
    }
    // With a direction it keeps that.
    let ends = solved(model(spring().along([0.0, 1.0])), 1e-9, Cholesky);
    converged(&ends, 4);
    let moved = ends[1].displacement[0][1];
    assert!((moved - load / k).abs() < 1e-3, "{moved}");
}

/// A block on a foundation goes down by p/k, however far, and slides on it by the traction over its tangential stiffness.
#[test]
fn a_foundation_gives_way() {
    let mesh = rectangle([0.0, 0.0], [2.0, 1.0], [4, 2], CellShape::Quad, "body", "");
    let model = Model::on(mesh.clone())
        .large_displacements()
        .material(Material::new(1e6, 0.0))
        .foundation(Foundation::under("bottom").normal(4.0).tangential(2.0))
        .support(Support::on("top").x(0.5).y(-1.5));
    for path in [Cholesky, Pcg] {
        let ends = solved(model.clone(), 1e-10, path);
        converged(&ends, 6);
        let report = &ends[0].report.supports;
        let of = |name: &str| {
            let found = report.iter().find(|one| one.support.contains(name));
            found.unwrap_or_else(|| panic!("{report:?}")).force.clone()
        };
        let (bed, top) = (of("foundation"), of("top"));
        assert!(
            (bed[0] + 2.0).abs() < 1e-4 && (bed[1] - 12.0).abs() < 1e-4,
            "{bed:?}"
        );
        for c in 0..2 {
            assert!((bed[c] + top[c]).abs() < 1e-8, "{bed:?} {top:?}");
        }
    }
    // Where a support holds nodes of the foundation, each has its own force, and all add up to nothing.
    let both = model.support(Support::on("bottom").x(0.2));
    let ends = solved(both, 1e-10, Cholesky);
    converged(&ends, 6);
    let forces = ends[0].report.supports.iter().map(|one| one.force.clone());
    let forces: Vec<Vec<f64>> = forces.collect();
    assert!(
        (forces.last().expect("a foundation")[0] + 0.8).abs() < 1e-4,
        "{forces:?}"
    );
    for c in 0..2 {
        let sum: f64 = forces.iter().map(|force| force[c]).sum();
        assert!(sum.abs() < 1e-6, "{forces:?}");
    }
}

/// A quarter of a ring as a sector, and between planes of symmetry, under a pressure that makes it a fifth wider.
#[test]
fn a_sector_is_blown_up() {
    let mut mesh = rectangle([0.0; 2], [1.0; 2], [3, 6], CellShape::Quad, "ring", "");
    for x in &mut mesh.nodes {
        let (r, angle) = (1.0 + 0.5 * x[0], FRAC_PI_2 * x[1]);
        *x = [r * angle.cos(), r * angle.sin()];
    }
    let axis = Axis::at([0.0, 0.0]);
    let model = || {
        Model::on(mesh.clone())
            .large_displacements()
            .material(neo_hooke(1.0, 0.4))
            .traction(Traction::on("left").pressure(0.08))
            .steps([0.5, 1.0])
    };
    let whole = solved(
        model()
            .support(Support::on("bottom").y(0.0))
            .support(Support::on("top").x(0.0)),
        1e-10,
        Cholesky,
    );
    converged(&whole, 10);
    let sector = model()
        .support(Support::on("left").about(axis).hoop(0.0))
        .cyclic(Cyclic::between("bottom", "top", axis, 4));
    for path in [Cholesky, Pcg] {
        let ends = solved(sector.clone(), 1e-10, path);
        for (whole, end) in whole.iter().zip(&ends) {
            assert_eq!(end.status, Status::Converged);
            for (a, b) in whole.displacement.iter().zip(&end.displacement) {
                assert!(apart(a, b) < 1e-7, "{a:?} {b:?}");
            }
        }
    }
    let most = whole[1].displacement[0][0];
    assert!(most > 0.2, "{most}");
}

/// A block on a wider one, pressed down by a dead load, with a weak foundation beside it: contact that presses keeps it from tilting.
#[test]
fn a_block_on_a_wider_one_is_stable() {
    let part = |size, shift, cells, name: &str| {
        let prefix = format!("{name}-");
        rectangle(shift, size, cells, CellShape::Quad, name, &prefix)
    };
    let model = Model::on(join(
        part([1.6, 1.0], [0.0; 2], [8, 5], "a"),
        part([1.0, 1.0], [0.3, 1.0], [5, 5], "b"),
    ))
    .large_displacements()
    .material(Material::new(1e3, 0.0))
    .support(Support::on("a-bottom").fixed())
    .traction(Traction::on("b-top").y(-20.0))
    .foundation(Foundation::under("b-left").normal(20.0).tangential(20.0))
    .contact(Pair::new("b-bottom", "a-top"));
    for path in [Cholesky, Pcg] {
        let ends = solved(model.clone(), 1e-8, path);
        assert_eq!(ends[0].status, Status::Converged);
    }
}

/// A column whose flat top sticks to a stiff block that is pressed down stays level there: it buckles as one with clamped ends.
#[test]
fn a_column_that_sticks_buckles_late() {
    let part = |size, shift, cells, name: &str| {
        let prefix = format!("{name}-");
        let mesh = rectangle(shift, size, cells, CellShape::Quad, name, &prefix);
        mesh.raised().or_panic()
    };
    let mesh = join(
        part([0.1, 1.0], [0.0; 2], [2, 20], "column"),
        part([0.5, 0.3], [-0.2, 1.0], [5, 3], "block"),
    );
    let model = |shortening: f64| {
        Model::on(mesh.clone())
            .large_displacements()
            .material_in("column", Material::new(1e3, 0.0))
            .material_in("block", Material::new(1e5, 0.0))
            .support(Support::on("column-bottom").fixed())
            .support(Support::on("block-top").x(0.0).y(-shortening))
            .contact(Pair::new("column-top", "block-bottom").coulomb(0.5))
    };
    // E A / l of the column, and 4 π² E I / l².
    let (stiffness, euler) = (100.0, 4.0 * PI.powi(2) * 1e3 * 1e-3 / 12.0);
    for path in [Cholesky, Pcg] {
        let status = |load: f64| solved(model(load / stiffness), 1e-8, path)[0].status;
        assert_eq!(status(0.7 * euler), Status::Converged);
        assert_eq!(status(1.4 * euler), Status::Unstable);
    }
}

/// A column whose top stays level as its nodes move alike: these rows do not hide that it buckles.
#[test]
fn a_column_with_a_level_top_buckles() {
    let status = |load: f64, path| {
        let mesh = block(
            [0.0; 3],
            [1.0, 1.0, 20.0],
            [1, 1, 20],
            SolidShape::Hexahedron,
            "column",
            "",
        );
        let model = Model::on(mesh)
            .large_displacements()
            .material(Material {
                incompatible_modes: true,
                ..Material::new(1e3, 0.0)
            })
            .support(Support::on("bottom").fixed())
            .support(Support::on("top").x(0.0).y(0.0))
            .equal(Equal::of("top").along([false, false, true]))
            .traction(Traction::on("top").pressure(load));
        solved_in_space(model, 1e-10, path)[0].status
    };
    // Both ends are clamped: 4 π² E I / l².
    let euler = 4.0 * PI.powi(2) * 1e3 / 12.0 / 400.0;
    for path in [Cholesky, Pcg] {
        assert_eq!(status(0.8 * euler, path), Status::Converged);
        assert_eq!(status(1.2 * euler, path), Status::Unstable);
    }
}

/// A sector of a ring of linear elements under a pressure from outside. Its rows at the sides hold it, and it is as stable as the
/// whole ring.
#[test]
fn a_sector_is_pressed_in() {
    let sector = |pressure: f64| {
        let mut mesh = block(
            [0.0; 3],
            [1.0; 3],
            [1, 2, 1],
            SolidShape::Hexahedron,
            "ring",
            "",
        );
        for x in &mut mesh.nodes {
            let (r, angle) = (1.0 + 0.2 * x[0], PI / 6.0 * x[1]);
            *x = [r * angle.cos(), r * angle.sin(), 0.2 * x[2]];
        }
        let axis = Axis::new([0.0; 3], [0.0, 0.0, 1.0]);
        Model::on(mesh)
            .large_displacements()
            .material(Material::new(1e3, 0.3))
            .support(Support::on("bottom").z(0.0))
            .support(Support::on("left").about(axis).hoop(0.0))
            .traction(Traction::on("right").pressure(pressure))
            .cyclic(Cyclic::between("front", "back", axis, 12))
    };
    for path in [Cholesky, Pcg] {
        let ends = solved_in_space(sector(0.5), 1e-10, path);
        converged(&ends, 10);
    }
}

/// The work of a moment, and of a force, on the point of a coupling is that of their means over a load step, in any direction of the drawing
/// and however the nodes pass them on; so is that of a stated rotation.
#[test]
fn points_do_the_work_of_their_forces() {
    let (l, h) = (5.0, 0.5);
    for turn in [0.0, 40.0] {
        let way = |x: [f64; 2]| super::elements::turned(x, turn);
        let mut mesh = rectangle(
            [0.0, -0.5 * h],
            [l, h],
            [10, 2],
            CellShape::Quad,
            "beam",
            "",
        );
        mesh.nodes.iter_mut().for_each(|x| *x = way(*x));
        let end = || Coupling::on("right", way([l, 0.0]));
        let (force, moment, angle) = (way([0.1, -0.2]), 3.0, 0.9);
        let works_of = |coupling: Coupling| {
            let model = Model::on(mesh.clone())
                .large_displacements()
                .material(Material::new(1e3, 0.3))
                .support(Support::on("left").fixed())
                .coupling(coupling)
                .steps([0.4, 1.0]);
            let ends = solved(model, 1e-10, Cholesky);
            converged(&ends, 30);
            let reports: Vec<_> = ends.iter().map(|end| &end.report.contacts[0]).collect();
            let motions: Vec<_> = reports.iter().map(|report| motion(report)).collect();
            let about: Vec<f64> = reports.iter().map(|report| report.moment[0]).collect();
            (works(&ends), motions, about)
        };
        for coupling in [end(), end().distributing()] {
            let (work, motions, _) = works_of(coupling.force(force).moment([moment]));
            let goal: f64 = (0..3)
                .map(|k| {
                    let [first, last] = [motions[0][k], motions[1][k]];
                    [force[0], force[1], moment][k] * (0.2 * first + 0.7 * (last - first))
                })
                .sum();
            assert!((work[0] - goal).abs() < 1e-6 * goal, "{work:?} {goal}");
            assert!(work[2].abs() < 1e-6 * goal, "{work:?}");
        }
        let (work, motions, about) = works_of(end().turned(2, angle));
        let [first, last] = [motions[0][2], motions[1][2]];
        let goal: f64 = 0.5 * (about[0] * first + (about[0] + about[1]) * (last - first));
        assert!(
            (work[2] - goal.abs()).abs() < 1e-6 * goal.abs(),
            "{work:?} {goal}"
        );
        assert!(work[0].abs() < 1e-9, "{work:?}");
    }
}
