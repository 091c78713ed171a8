//! Preload of bolts: uniform bars, a joint with its knee, locked forces against shortenings.

use crate::common::apart;
use crate::common::models::{answer, on_the_cpu};
use crate::common::or_panic::OrPanic as _;
use signorini::contact::Space;
use signorini::elasticity::{Material, Plane};
use signorini::engine::Stiffness;
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::mesh::{ElementKind, Mesh, facet};
use signorini::model::{
    Coupling, Equation, Force, Model, Pair, Preload, Quantity, Spring, Support, Temperature,
    Traction,
};
use signorini::output::{ContactReport, StepReport};
use signorini::ssnm::Status;

const PATHS: [Stiffness; 2] = [Stiffness::Cholesky, Stiffness::Pcg];
const YOUNG: f64 = 2e9;

fn tension(report: &ContactReport) -> f64 {
    report.tension.expect("it is a preload")
}

/// A bar of 4 × 1 × 1 with ν = 0 between walls: σ = F/A, and the ends at the section overlap by F l/(E A); half of it on either side,
/// where the section is in the middle. Any way across the bar, elements of either order and shape.
#[test]
fn a_bar_between_walls_is_pulled_evenly() {
    let force = 3e5;
    let shapes = [SolidShape::Hexahedron, SolidShape::Tetrahedron];
    for (shape, order) in [(0, 1), (1, 1), (0, 2), (1, 2)] {
        let mesh = block(
            [0.0; 3],
            [4.0, 1.0, 1.0],
            [5, 2, 2],
            shapes[shape],
            "bar",
            "",
        );
        let mesh = if order == 2 {
            mesh.raised().or_panic()
        } else {
            mesh
        };
        let nodes = mesh.nodes.len();
        let model = Model::on(mesh)
            .material(Material::new(YOUNG, 0.0))
            .support(Support::on("left").fixed())
            .support(Support::on("right").fixed())
            .preload(
                Preload::across([1.7, 0.5, 0.5], [2.0, 0.0, 0.0])
                    .force(force)
                    .named("bolt"),
            );
        for path in PATHS {
            let found = answer(model.clone(), 1e-11, path);
            let strain = force / YOUNG;
            let stretched = 4.0 * strain;
            // The section is between cells whose middles are on either side of 1.7: at x = 1.6 of hexahedra.
            let u = found.displacement();
            for (i, (x, u)) in found.built.elastic.mesh.nodes.iter().zip(&u).enumerate() {
                let from = |wall: f64| strain * (x[0] - wall);
                let low = apart(u, &[from(0.0), 0.0, 0.0]) < 1e-9 * stretched;
                let high = apart(u, &[from(4.0), 0.0, 0.0]) < 1e-9 * stretched;
                assert!(low || high, "{x:?} {u:?}");
                assert!(i < nodes || high, "new nodes are those in front");
            }
            let report = &found.report().contacts[0];
            assert!((tension(report) - force).abs() < 1e-9 * force);
            let short = report.shortening.expect("it is a preload");
            assert!((short - stretched).abs() < 1e-9 * stretched, "{short}");
            assert!(apart(&report.force, &[force, 0.0, 0.0]) < 1e-9 * force);
            assert!(report.moment.iter().all(|m| m.abs() < 1e-9 * force));
            let walls = &found.report().supports;
            assert!((walls[0].force[0] + force).abs() < 1e-9 * force);
            assert!((walls[1].force[0] - force).abs() < 1e-9 * force);
        }
    }
}

/// Three upright bars with ν = 0 on a common foot and under a common rigid head: the middle one, the bolt, pulls the other two, the
/// plates, together, which are cut at half their height. The bolt takes φ P of a load P on the head until the plates part, at F/(1 − φ), and
/// then all of it.
pub fn joint() -> Joint {
    let bar = |x: f64, from: f64, height: f64, name: &str| {
        rectangle(
            [x, from],
            [1.0, height],
            [2, 4],
            CellShape::Quad,
            name,
            &format!("{name}-"),
        )
    };
    let mut mesh = bar(2.0, 0.0, 2.0, "bolt");
    for (x, side) in [(0.0, "left"), (4.0, "right")] {
        mesh = join(mesh, bar(x, 0.0, 1.0, &format!("low-{side}")));
        mesh = join(mesh, bar(x, 1.0, 1.0, &format!("up-{side}")));
    }
    // k = E A/l of the bolt and of both plates.
    let (bolt, plates) = (YOUNG / 2.0, YOUNG);
    let phi = bolt / (bolt + plates);
    let preload = 4e5;
    let parts = preload / (1.0 - phi);
    let loads = [0.0, 0.5 * parts, 0.999 * parts, 1.001 * parts, 1.5 * parts];
    let factors: Vec<f64> = loads.iter().map(|load| load / parts).collect();
    let pair = |side: &str| Pair::new(format!("up-{side}-bottom"), format!("low-{side}-top"));
    let model = Model::on(mesh)
        .material(Material::new(YOUNG, 0.0))
        .support(Support::on(["bolt-bottom", "low-left-bottom", "low-right-bottom"]).fixed())
        .contact(pair("left").coulomb(0.2))
        .contact(pair("right"))
        .preload(
            Preload::across([2.5, 0.9], [0.0, 1.0])
                .within("bolt")
                .force(preload)
                .factors(vec![1.0; loads.len()])
                .locked(),
        )
        .coupling(
            Coupling::on(["bolt-top", "up-left-top", "up-right-top"], [2.5, 2.0])
                .force([0.0, parts])
                .named("head"),
        )
        .steps(factors);
    Joint {
        model,
        loads: loads.to_vec(),
        stiffness: [bolt, plates],
        preload,
    }
}

/// A bolted joint in one dimension, with the loads of its steps and k of the bolt and of the plates.
pub struct Joint {
    pub model: Model,
    pub loads: Vec<f64>,
    stiffness: [f64; 2],
    preload: f64,
}

impl Joint {
    /// Whether a load step is as linear theory says, to a part of the preload.
    pub fn check(&self, load: f64, report: &StepReport, tolerance: f64) {
        let (preload, [bolt, plates]) = (self.preload, self.stiffness);
        let [left, right, bolt_report, head] = &report.contacts[..] else {
            panic!("four contacts");
        };
        let clamp = (preload - plates / (bolt + plates) * load).max(0.0);
        let expected = clamp + load;
        let scale = tolerance * preload;
        assert!((tension(bolt_report) - expected).abs() < scale, "{load}");
        assert!((left.normal_force + right.normal_force - clamp).abs() < scale);
        // The plates expand as their pressure falls; once they have parted, the bolt gets longer.
        let lift = head.motion[1].expect("it is determined");
        let free = if clamp > 0.0 {
            -clamp / plates
        } else {
            (load - preload) / bolt - preload / plates
        };
        let scale_of_motion = scale / bolt;
        assert!((lift - free).abs() < scale_of_motion, "{lift} {free}");
        assert!(head.motion[2].is_some_and(|turn| turn.abs() < scale_of_motion));
        assert!((head.force[1] - load).abs() < scale);
    }
}

#[test]
fn a_joint_parts_where_theory_says() {
    let joint = joint();
    for path in PATHS {
        let found = answer(joint.model.clone(), 1e-11, path);
        for (load, report) in joint.loads.iter().zip(&found.reports()) {
            joint.check(*load, report, 1e-8);
        }
    }
}

/// A section that is not shortened leaves a body what it was, whatever its elements, and passes on what statics says: the load beyond it,
/// and its moment.
#[test]
fn a_section_that_is_not_shortened_does_nothing() {
    let load = [2e4, -3e4, 5e4];
    let shapes = [
        SolidShape::Hexahedron,
        SolidShape::Tetrahedron,
        SolidShape::Wedge,
    ];
    for (shape, order) in [(0, 1), (1, 1), (2, 1), (0, 2), (1, 2), (2, 2)] {
        let mesh = block(
            [0.0; 3],
            [4.0, 1.0, 1.0],
            [6, 2, 3],
            shapes[shape],
            "bar",
            "",
        );
        let mesh = if order == 2 {
            mesh.raised().or_panic()
        } else {
            mesh
        };
        let base = Model::on(mesh)
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on("left").fixed())
            .traction(Traction::on("right").force(load));
        let cut = Preload::across([2.1, 0.0, 0.0], [1.0, 0.1, 0.0]).shortening(0.0);
        for path in PATHS {
            let report = cut_as_whole(base.clone(), cut.clone(), path);
            assert!(
                apart(&report.force, &load) < 1e-8 * 5e4,
                "{:?}",
                report.force
            );
            // The load acts in the middle of the end, beside the middle of the section.
            let arm: [f64; 3] = std::array::from_fn(|c| [4.0, 0.5, 0.5][c] - report.centre[c]);
            let cross = |a: usize, b: usize| arm[a] * load[b] - arm[b] * load[a];
            let moment = [cross(1, 2), cross(2, 0), cross(0, 1)];
            assert!(
                apart(&report.moment, &moment) < 1e-8 * 2e5,
                "{:?}",
                report.moment
            );
        }
    }
    for (shape, order) in [
        (CellShape::Quad, 1),
        (CellShape::Triangle, 1),
        (CellShape::Quad, 2),
        (CellShape::Triangle, 2),
    ] {
        for plane in [Plane::PlaneStress, Plane::Axisymmetric] {
            let mesh = rectangle([1.0, 0.0], [1.0, 3.0], [3, 7], shape, "bar", "");
            let mesh = if order == 2 {
                mesh.raised().or_panic()
            } else {
                mesh
            };
            let base = Model::on(mesh)
                .plane(plane)
                .material(Material::new(YOUNG, 0.3))
                .support(Support::on("bottom").fixed())
                .traction(Traction::on("top").force([1e4, 4e4]));
            let cut = Preload::across([1.2, 1.4], [0.1, 1.0]).shortening(0.0);
            let force = cut_as_whole(base, cut, Stiffness::Cholesky).force;
            // Across the axis a ring carries a part around it.
            let carried = if plane == Plane::PlaneStress {
                force[0]
            } else {
                1e4
            };
            assert!(
                apart(&[carried, force[1]], &[1e4, 4e4]) < 1e-8 * 4e4,
                "{force:?}"
            );
        }
    }
}

/// Compares a body without and with a section, whose report is returned.
fn cut_as_whole<const D: usize>(base: Model<D>, cut: Preload<D>, path: Stiffness) -> ContactReport
where
    ElementKind: Space<D>,
{
    let whole = answer(base.clone(), 1e-11, path);
    let found = answer(base.preload(cut), 1e-11, path);
    let (expected, u) = (whole.displacement(), found.displacement());
    let most = expected.iter().flatten();
    let most = most.fold(0.0, |most: f64, v| most.max(v.abs()));
    for (a, b) in u.iter().zip(&expected) {
        assert!(apart(a, b) < 1e-9 * most, "{a:?} {b:?}");
    }
    found.report().contacts.remove(0)
}

/// Loads and means over nodes are those of the drawn mesh: the nodes that a cut doubles count once.
#[test]
fn a_cut_doubles_no_node() {
    let mut mesh = rectangle([0.0, 0.0], [1.0, 4.0], [4, 16], CellShape::Quad, "bar", "");
    let column = |x: f64| -> Vec<u32> {
        let of_column = |node: &u32| mesh.nodes[*node as usize][0] == x;
        (0..mesh.nodes.len() as u32).filter(of_column).collect()
    };
    let sets = [
        ("middle", column(0.5)),
        ("third", column(0.75)),
        ("side", column(1.0)),
    ];
    mesh.node_sets
        .extend(sets.map(|(name, nodes)| (name.to_owned(), nodes)));
    let top: Vec<u32> = mesh.node_sets["side"][8..].to_vec();
    mesh.node_sets.insert("upper".to_owned(), top);
    let bar = || {
        Model::on(mesh.clone())
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on("bottom").fixed())
    };
    let pushed = || bar().force(Force::at_point([1.0, 4.0]).x(1e5).y(3e4));
    for (model, load) in [
        (bar().force(Force::on("right").x(1.0)), 17.0),
        (bar().force(Force::at_nodes("middle").x(1.0)), 17.0),
        (
            bar().force(Force::at_nodes(["upper", "middle"]).x(1.0)),
            26.0,
        ),
        (
            pushed().spring(Spring::at_nodes("middle", 1e7).along([1.0, 0.0])),
            1e5,
        ),
        (
            bar().coupling(
                Coupling::at_nodes("middle", [0.0, 0.0])
                    .distributing()
                    .force([2.0, 0.0])
                    .moment([5.0]),
            ),
            2.0,
        ),
        (
            pushed().equation(
                Equation::of(0.0)
                    .nodes("third", [0.0, 1.0])
                    .nodes("side", [0.0, -1.0]),
            ),
            1e5,
        ),
    ] {
        let cut = Preload::across([0.5, 2.0], [0.0, 1.0]).shortening(0.0);
        for preload in [None, Some(cut.clone())] {
            let model = preload.into_iter().fold(model.clone(), Model::preload);
            let total = model.build().or_panic().step(0).or_panic().total_load;
            assert!((total[0] - load).abs() < 1e-12 * load, "{total:?} {load}");
        }
        cut_as_whole(model, cut, Stiffness::Cholesky);
    }
}

/// A bolt between two plates, one of which has its head, with a section on a named surface: what a force has made, locked, is what the same shortening
/// makes, under whatever load follows.
#[test]
fn a_locked_force_is_a_shortening() {
    let mut mesh = rectangle(
        [0.0, 0.0],
        [1.0, 4.0],
        [3, 8],
        CellShape::Quad,
        "bolt",
        "bolt-",
    );
    let nodes = mesh.nodes.len() as u32;
    for (x, name) in [(-1.0, "a"), (1.0, "b")] {
        mesh = join(
            mesh,
            rectangle(
                [x, 0.0],
                [1.0, 4.0],
                [2, 7],
                CellShape::Triangle,
                name,
                &format!("{name}-"),
            ),
        );
    }
    // The row of nodes at half the height of the bolt.
    let row: Vec<u32> = (0..nodes)
        .filter(|&node| mesh.nodes[node as usize][1] == 2.0)
        .collect();
    let surface = row.windows(2).map(facet::<2>).collect();
    let mut boundaries = mesh.boundaries.clone();
    boundaries.insert("cut".to_owned(), surface);
    let mesh = Mesh::new(mesh.nodes, mesh.elements, mesh.regions, boundaries).or_panic();
    let with = |preload: Preload| {
        Model::on(mesh.clone())
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on(["bolt-bottom", "a-bottom", "b-bottom"]).fixed())
            .contact(Pair::new("a-right", "bolt-left").coulomb(0.1))
            .contact(Pair::new("b-left", "bolt-right").coulomb(0.3))
            .traction(Traction::on("bolt-top").x(2e5).factors([0.0, 0.5, 1.0]))
            .preload(preload)
            .coupling(Coupling::on(["bolt-top", "a-top"], [0.0, 4.0]))
            .steps([0.5, 1.0, 1.0])
    };
    for path in PATHS {
        let forced = answer(with(Preload::on("cut").force(4e5).locked()), 1e-10, path);
        let short = |step: &StepReport| step.contacts[2].shortening.expect("a preload");
        let first = forced.reports();
        let length = short(&first[1]);
        assert!(
            length > 0.0 && (short(&first[2]) - length).abs() < 1e-10 * length,
            "{length} {}",
            short(&first[2])
        );
        let turned = with(Preload::on("cut").shortening(length).factors([
            short(&first[0]) / length,
            1.0,
            1.0,
        ]));
        let second = answer(turned.clone(), 1e-10, path);
        // Where the tolerance is below rounding, the best point comes back.
        let built = turned.build().or_panic();
        let steps = built.solve(&on_the_cpu(1e-13, path)).or_panic();
        assert!(steps[0].kkt.max() < 1e-10, "{:?}", steps[0]);
        let most = norm_max(&forced.displacement());
        let off = apart(
            forced.displacement().as_flattened(),
            second.displacement().as_flattened(),
        );
        assert!(off < 1e-9 * most, "{off} {most}");
        for (a, b) in first.iter().zip(second.reports()) {
            let [a, b] = [&a.contacts[2], &b.contacts[2]].map(tension);
            assert!((a - b).abs() < 1e-8 * 4e5, "{a} {b}");
        }
        assert!((tension(&first[1].contacts[2]) - 4e5).abs() < 1e-8 * 4e5);
        assert!((tension(&first[2].contacts[2]) - 4e5).abs() > 1e-4 * 4e5);
    }
}

fn norm_max(u: &[[f64; 2]]) -> f64 {
    u.iter().flatten().fold(0.0, |most, v| most.max(v.abs()))
}

/// Nothing tightens the bolt, and nothing else holds the plate that hangs on it.
#[test]
fn a_bolt_without_a_force_does_not_hold() {
    let mesh = rectangle([0.0, 0.0], [1.0, 4.0], [2, 8], CellShape::Quad, "bolt", "");
    let model = Model::on(mesh)
        .material(Material::new(YOUNG, 0.3))
        .support(Support::on("top").fixed())
        .traction(Traction::on("bottom").y(-1e5))
        .preload(Preload::across([0.5, 1.9], [0.0, 1.0]).force(0.0));
    let built = model.build().or_panic();
    let steps = built
        .solve(&on_the_cpu(1e-9, Stiffness::Cholesky))
        .or_panic();
    assert_eq!(steps[0].status, Status::NotHeld);
    let motion = &steps[0].not_held[0].motion;
    assert!(motion.contains("slides along (0.000, -1.000)"), "{motion}");
}

fn refusal(mesh: Mesh, preload: Preload) -> String {
    let model = Model::on(mesh)
        .material(Material::new(YOUNG, 0.3))
        .support(Support::on("bottom").fixed())
        .preload(preload);
    model.build().expect_err("it is no section").to_string()
}

#[test]
fn sections_that_do_not_cut_a_bolt_through_are_refused() {
    let mesh = rectangle([0.0, 0.0], [2.0, 4.0], [4, 8], CellShape::Quad, "bolt", "");
    let named = |nodes: &[u32]| {
        let surface = nodes.windows(2).map(facet::<2>).collect();
        let mut boundaries = mesh.boundaries.clone();
        boundaries.insert("cut".to_owned(), surface);
        let parts = mesh.clone();
        Mesh::new(parts.nodes, parts.elements, parts.regions, boundaries).or_panic()
    };
    // The nodes of row 4, from the left.
    let row: Vec<u32> = (20..25).collect();
    for (mesh, preload, text) in [
        (
            named(&row[..4]),
            Preload::on("cut"),
            "ends within the body, at (1.5",
        ),
        (
            mesh.clone(),
            Preload::on("top"),
            "the surface is not within the body",
        ),
        (
            named(&[20, 21, 26]),
            Preload::on("cut"),
            "ends within the body",
        ),
        (
            mesh.clone(),
            Preload::across([1.0, 4.1], [0.0, 1.0]),
            "no elements are on both sides",
        ),
        (
            mesh.clone(),
            Preload::across([30.0, 1.0], [0.0, 1.0]),
            "preload 1: the point of its plane, (3.000000e1",
        ),
        (
            mesh.clone(),
            Preload::across([1.0, 1.0], [0.0, 1.0]).within("nut"),
            "there is no region \"nut\"",
        ),
    ] {
        let refused = refusal(mesh, preload.force(1.0));
        assert!(refused.contains(text), "{refused}");
    }
    let twice = Model::on(mesh.clone())
        .material(Material::new(YOUNG, 0.3))
        .support(Support::on("bottom").fixed())
        .preload(Preload::across([1.0, 1.9], [0.0, 1.0]).force(1.0))
        .preload(Preload::across([1.2, 1.9], [1.0, 0.0]).force(1.0));
    let refused = twice.build().expect_err("they cross").to_string();
    assert!(
        refused.contains("preload 2: its section meets that of another"),
        "{refused}"
    );
    for (preload, text) in [
        (Preload::on("top"), "needs one of force and shortening"),
        (
            Preload::on("top").force(1.0).shortening(1.0),
            "needs one of force and shortening",
        ),
        (Preload::default().force(1.0), "needs a section"),
        (
            Preload::on("top").shortening(1.0).locked(),
            "lock belongs to a force",
        ),
        (
            Preload::across([0.0; 2], [0.0; 2]).force(1.0),
            "a normal that is not zero",
        ),
    ] {
        let refused = refusal(mesh.clone(), preload);
        assert!(refused.contains(text), "{refused}");
    }
}

/// Values at nodes belong to the mesh as it was before the cut, and the centre is that of the section, however uneven its nodes are.
#[test]
fn values_at_nodes_outlive_the_cut() {
    let mut mesh = rectangle([0.0, 0.0], [4.0, 1.0], [4, 3], CellShape::Quad, "bar", "");
    for x in &mut mesh.nodes {
        x[1] *= x[1];
    }
    let warm: Vec<f64> = mesh.nodes.iter().map(|_| 20.0).collect();
    let model = Model::on(mesh)
        .material(Material {
            expansion: 1e-5,
            ..Material::new(YOUNG, 0.0)
        })
        .support(Support::on("left").x(0.0))
        .support(Support::on("right").x(0.0))
        .support(Support::at_point([0.0, 0.0]).y(0.0))
        .temperature(Temperature::everywhere(Quantity::at_nodes(warm)))
        .preload(Preload::across([1.9, 0.5], [1.0, 0.0]).shortening(0.0));
    let found = answer(model, 1e-11, Stiffness::Cholesky);
    let report = &found.report().contacts[0];
    assert!(
        (tension(report) + YOUNG * 2e-4).abs() < 1e-8 * YOUNG * 2e-4,
        "{report:?}"
    );
    assert!((report.centre[1] - 0.5).abs() < 1e-12 && (report.area - 1.0).abs() < 1e-12);
}

/// A tie along the whole side of a bolt holds both ends of its section, and a hint says so. A free bolt gets no hint.
#[test]
fn a_section_beside_a_tie_has_a_hint() {
    for tied in [false, true] {
        let mesh = join(
            rectangle(
                [0.0, 0.0],
                [1.0, 4.0],
                [3, 8],
                CellShape::Quad,
                "bolt",
                "bolt-",
            ),
            rectangle(
                [1.0, 0.0],
                [1.0, 4.0],
                [3, 8],
                CellShape::Quad,
                "plate",
                "plate-",
            ),
        );
        let model = Model::on(mesh)
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on(["bolt-bottom", "plate-bottom", "bolt-top"]).fixed())
            .preload(
                Preload::across([0.5, 1.9], [0.0, 1.0])
                    .within("bolt")
                    .force(1e5),
            );
        let model = match tied {
            true => model.tie(Pair::tied("bolt-right", "plate-left")),
            false => model.contact(Pair::new("bolt-right", "plate-left").coulomb(0.1)),
        };
        let hints = answer(model, 1e-10, Stiffness::Cholesky).hints();
        let told = hints
            .iter()
            .any(|hint| hint.contains("does not shorten the bolt"));
        assert_eq!(told, tied, "{hints:?}");
    }
}
