//! Sets of nodes that move alike, against closed forms and against supports that hold the same motion.

use crate::common::models::{Answer, answer};
use crate::common::or_panic::OrPanic as _;
use signorini::case::{Case, CaseProblem};
use signorini::contact::Obstacle;
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::mesh::{ElementKind, Mesh, Topology};
use signorini::model::{AnyBuilt, Equal, Force, Model, Pair, Support, Traction};

const PATHS: [Stiffness; 2] = [Stiffness::Cholesky, Stiffness::Pcg];
const YOUNG: f64 = 2e11;

/// Makes a set of the nodes of a mesh at some positions.
fn set<const D: usize>(mesh: &mut Mesh<D>, name: &str, is_in: impl Fn([f64; D]) -> bool)
where
    ElementKind: Topology<D>,
{
    let nodes = (0u32..).zip(&mesh.nodes).filter(|one| is_in(*one.1));
    let nodes = nodes.map(|one| one.0).collect();
    mesh.node_sets.insert(name.to_owned(), nodes);
}

/// A block on rollers whose top stays level is in uniform tension, wherever on its top it is pulled: u_z = F z / (E A).
#[test]
fn a_level_top_spreads_a_force() {
    let size = [1.0, 0.5, 0.8];
    for shape in [SolidShape::Hexahedron, SolidShape::Tetrahedron] {
        let mesh = block([0.0; 3], size, [4, 3, 3], shape, "body", "");
        for mesh in [mesh.clone(), mesh.raised().or_panic()] {
            let model = Model::on(mesh.clone())
                .material(Material::new(YOUNG, 0.3))
                .support(Support::on("left").x(0.0))
                .support(Support::on("front").y(0.0))
                .support(Support::on("bottom").z(0.0))
                .force(Force::at_point([0.75, 0.2, 0.8]).z(3e6))
                .equal(Equal::of("top").along([false, false, true]));
            let strain = 3e6 / (YOUNG * 0.5);
            for path in PATHS {
                let found = answer(model.clone(), 1e-11, path);
                for (x, u) in mesh.nodes.iter().zip(found.displacement()) {
                    let expected = [-0.3 * strain * x[0], -0.3 * strain * x[1], strain * x[2]];
                    for c in 0..3 {
                        assert!((u[c] - expected[c]).abs() < 1e-9 * strain, "{x:?} {u:?}");
                    }
                }
                // The forces that move the nodes alike pull none of them along other axes, and add up to zero with the first
                // node.
                let forces = (0..found.m()).map(|i| found.contact_force(i));
                assert!({ forces }.all(|f| f[0] == 0.0 && f[1] == 0.0));
            }
        }
    }
}

/// An end that moves as a whole moves as under a support: under a skew force, with the same reaction.
#[test]
fn an_end_that_moves_as_one() {
    let mut mesh = rectangle([0.0, 0.0], [2.0, 1.0], [8, 4], CellShape::Quad, "body", "");
    set(&mut mesh, "end", |x| x[0] > 2.0 - 1e-9);
    let model = Model::on(mesh.clone())
        .material(Material::new(YOUNG, 0.3))
        .support(Support::on("left").fixed());
    let force = [2e6, -5e5];
    let pulled = model
        .clone()
        .force(Force::at_point([2.0, 0.5]).x(force[0]).y(force[1]))
        .equal(Equal::of("end").named("cap"));
    for path in PATHS {
        let found = answer(pulled.clone(), 1e-11, path);
        assert_eq!(found.built.elastic.pairs[0].title(), "cap");
        let u = found.displacement();
        let end = mesh.node_sets["end"][0] as usize;
        let [x, y] = u[end];
        let driven = model.clone().support(Support::on("right").x(x).y(y));
        let driven = answer(driven, 1e-11, Stiffness::Cholesky);
        for (a, b) in u.iter().zip(driven.displacement()) {
            assert!(apart(*a, b) < 1e-9 * x.hypot(y), "{a:?} {b:?}");
        }
        // The forces inside the driven body equal the pull on the free one.
        let internal = internal(&driven);
        let held = mesh.node_sets["end"].iter();
        let sum = held.fold([0.0; 2], |sum, &node| {
            let f = internal[node as usize];
            [sum[0] + f[0], sum[1] + f[1]]
        });
        assert!(apart(sum, force) < 1e-9 * 2e6, "{sum:?}");
    }
}

fn apart(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn internal(answer: &Answer<2>) -> Vec<[f64; 2]> {
    let body = answer.built.elastic.body();
    signorini::elasticity::internal_forces(&body, &answer.data.unknowns, &answer.displacement())
}

/// Two blocks whose nodes meet, pair by pair, are one block: a body that equal displacements alone hold, above a floor with friction.
#[test]
fn pairs_of_nodes_join_two_bodies() {
    let whole = rectangle([0.0, 0.0], [2.0, 1.0], [8, 4], CellShape::Quad, "body", "");
    let half = |x: f64, name: &str, prefix: &str| {
        rectangle([x, 0.0], [1.0, 1.0], [4, 4], CellShape::Quad, name, prefix)
    };
    let mut parts = join(half(0.0, "a", "a-"), half(1.0, "b", "b-"));
    let mut names = Vec::new();
    for row in 0..5 {
        let name = format!("pair-{row}");
        set(&mut parts, &name, |x| {
            (x[0] - 1.0).abs() < 1e-9 && (x[1] - 0.25 * f64::from(row)).abs() < 1e-9
        });
        assert_eq!(parts.node_sets[&name].len(), 2);
        names.push(name);
    }
    let floor = Obstacle::HalfSpace {
        point: [0.0, -1e-5],
        normal: [0.0, 1.0],
    };
    let model = |mesh: Mesh, left: &str, right: &str, bottom: &[&str]| {
        Model::on(mesh)
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on(left).fixed())
            .traction(Traction::on(right).y(-4e6).x(1e7))
            .contact(Pair::obstacle(bottom, floor).coulomb(0.3))
    };
    let whole = model(whole, "left", "right", &["bottom"]);
    let parts = model(parts, "a-left", "b-right", &["a-bottom", "b-bottom"]);
    let parts = parts.equal(Equal::of(names));
    for path in PATHS {
        let expected = answer(whole.clone(), 1e-9, path);
        let found = answer(parts.clone(), 1e-9, path);
        let of_whole = expected.displacement();
        let places = &expected.built.elastic.mesh.nodes;
        let size = of_whole
            .iter()
            .map(|u| u[0].hypot(u[1]))
            .fold(0.0, f64::max);
        for (x, u) in found
            .built
            .elastic
            .mesh
            .nodes
            .iter()
            .zip(found.displacement())
        {
            let same = |&k: &usize| apart(places[k], *x) < 1e-9;
            let at = (0..places.len()).find(same).expect("the node of the whole");
            assert!(apart(u, of_whole[at]) < 1e-6 * size, "{x:?}");
        }
        assert!(size > 1e-5);
    }
}

/// A case file can state it as well; inconsistencies are reported with their line.
#[test]
fn case_files_say_it() {
    let deck = "*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n*ELEMENT,TYPE=CPS4,ELSET=all\n1,1,2,3,4\n*NSET,NSET=top\n3,4\n*NSET,NSET=one\n3\n";
    let place = tempfile::tempdir().or_panic();
    std::fs::write(place.path().join("mesh.inp"), deck).or_panic();
    let case = |equal: &str| {
        let text = format!(
            "[mesh]\nfile = \"mesh.inp\"\n[analysis]\nplane = \"plane_stress\"\n[[material]]\nyoung = 100\npoisson = 0.0\n\
             [[support]]\npoint = [0, 0]\nx = 0\ny = 0\n[[support]]\npoint = [1, 0]\ny = 0\n\
             [[force]]\nnodes = \"one\"\ny = 1\n[[equal]]\n{equal}\n"
        );
        let path = place.path().join("case.toml");
        std::fs::write(&path, text).or_panic();
        let shown = |error: String| error.replace(&format!("{}/", place.path().display()), "");
        let case = Case::read(&path, &[]).map_err(|error| shown(error.to_string()))?;
        case.build().map_err(|error| shown(error.to_string()))
    };
    let built = case("sets = \"top\"\ndirections = \"y\"").or_panic();
    let CaseProblem::Elastic(built) = built else {
        panic!("no bodies");
    };
    let AnyBuilt::Plane(built) = *built else {
        panic!("none of the plane");
    };
    let found = built.solve(&Default::default()).or_panic().remove(0);
    let data = built.step(0).or_panic();
    let u = data.unknowns.displacements(&found.u);
    for node in [2, 3] {
        assert!((u[node][1] - 0.01).abs() < 1e-12, "{u:?}");
    }
    for (equal, expected) in [
        (
            "sets = \"top\"\ndirections = \"z\"",
            "case.toml, line 20: \"z\" is not one of the directions \"x\", \"y\"",
        ),
        ("sets = \"one\"", "the set of nodes \"one\" has one node"),
        ("sets = \"tip\"", "there is no set of nodes \"tip\""),
        ("sets = []", "it needs at least one set"),
        (
            "sets = \"top\"\ndirections = []",
            "directions needs at least one axis",
        ),
    ] {
        let error = case(equal).expect_err(equal);
        assert!(error.contains(expected), "{equal}: {error}");
    }
}
