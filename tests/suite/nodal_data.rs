//! Forces and supports on sets of nodes, and names of parts: against tractions, closed forms and files.

use crate::common::or_panic::OrPanic as _;
use crate::common::oracle::length;
use signorini::case::Case;
use signorini::contact::Obstacle;
use signorini::mesh::{AnyMesh, Mesh, MeshParts, msh, read};
use signorini::model::{AnyBuilt, Built, Force, Model, Pair, Support, Traction};
use signorini::ssnm::Status;
use signorini::{
    case::CaseProblem,
    elasticity::{Material, Plane},
    mesh::structured::{CellShape, SolidShape, block, join, rectangle},
};

/// A strip of plane stress, one cell high, with its ends as sets of nodes.
fn strip(order: usize) -> Mesh {
    let mut mesh = rectangle([0.0; 2], [3.0, 1.0], [4, 1], CellShape::Quad, "strip", "");
    for (name, x) in [("first", 0.0), ("last", 3.0)] {
        let here = (0..).zip(&mesh.nodes).filter(|(_, at)| at[0] == x);
        let nodes = here.map(|(node, _)| node).collect();
        mesh.node_sets.insert(name.to_owned(), nodes);
    }
    mesh.node_sets.insert("corner".to_owned(), vec![0]);
    match order {
        1 => mesh,
        _ => mesh.raised().or_panic(),
    }
}

fn pulled(mesh: Mesh, pull: impl FnOnce(Model) -> Model) -> Built {
    let model = Model::on(mesh)
        .plane(Plane::PlaneStress)
        .material(Material::new(200.0, 0.25))
        .support(Support::at_nodes("first").x(0.0))
        .support(Support::at_nodes("corner").y(0.0));
    pull(model).build().or_panic()
}

fn displacements(built: &Built) -> Vec<[f64; 2]> {
    let solution = built.solve(&Default::default()).or_panic().remove(0);
    let data = built.step(0).or_panic();
    data.unknowns.displacements(&solution.u)
}

/// Half of a resultant on both nodes of an end is that of an even traction: u = F x / (E A).
#[test]
fn forces_on_nodes_pull_as_a_traction_does() {
    let by_nodes = pulled(strip(1), |model| {
        model.force(Force::at_nodes("last").x(5.0))
    });
    let by_traction = pulled(strip(1), |model| {
        model.traction(Traction::on("right").x(10.0))
    });
    let [nodes, traction] = [by_nodes, by_traction].map(|built| displacements(&built));
    for (u, v) in nodes.iter().flatten().zip(traction.iter().flatten()) {
        assert!((u - v).abs() < 1e-14, "{u} and {v}");
    }
    for (u, x) in nodes.iter().zip(strip(1).nodes) {
        assert!((u[0] - 10.0 * x[0] / 200.0).abs() < 1e-13);
        assert!((u[1] + 0.25 * 10.0 * x[1] / 200.0).abs() < 1e-13);
    }
}

/// A new node between nodes of a set joins the set: the end stays straight.
#[test]
fn raised_sets_hold_the_middles_too() {
    let mesh = strip(2);
    assert_eq!(
        [&mesh.node_sets["first"], &mesh.node_sets["corner"]].map(Vec::len),
        [3, 1]
    );
    let built = pulled(mesh, |model| model.traction(Traction::on("right").x(10.0)));
    let nodes = built.elastic.mesh.nodes.clone();
    for (u, x) in displacements(&built).iter().zip(nodes) {
        assert!((u[0] - 10.0 * x[0] / 200.0).abs() < 1e-13);
    }
}

/// A force at a point acts only on its node, one on a boundary on each of its nodes; factors count.
#[test]
fn forces_at_points_and_on_boundaries_add_up() {
    let built = pulled(strip(1), |model| {
        let end = Force::at_point([3.0, 1.0]).x(2.0).factors([1.0, 3.0]);
        let side = Force::on(["right", "top"]).y(|x: [f64; 2]| x[0]);
        model.force(end).force(side).steps([1.0, 0.5])
    });
    // Nodes at x = 0, 0.75 … 3 on top, and one more at x = 3.
    let sum = 0.75 * (1.0 + 2.0 + 3.0 + 4.0) + 3.0;
    for (step, expected) in [(0, [2.0, sum]), (1, [6.0, 0.5 * sum])] {
        let total = built.step(step).or_panic().total_load;
        assert!((total[0] - expected[0]).abs() < 1e-12 && (total[1] - expected[1]).abs() < 1e-12);
    }
}

/// Sets of nodes go into a file of Gmsh as physical points, and come back.
#[test]
fn sets_of_nodes_go_through_files() {
    let mut mesh = block(
        [0.0; 3],
        [1.0; 3],
        [2; 3],
        SolidShape::Tetrahedron,
        "body",
        "",
    );
    mesh.node_sets.insert("some".to_owned(), vec![0, 3, 26]);
    mesh.node_sets.insert("one".to_owned(), vec![13]);
    let places = |mesh: &Mesh<3>, name: &str| {
        let mut places: Vec<[u64; 3]> = (mesh.node_sets[name].iter())
            .map(|&node| mesh.nodes[node as usize].map(f64::to_bits))
            .collect();
        places.sort_unstable();
        places
    };
    let expected = ["some", "one"].map(|name| places(&mesh, name));
    let place = tempfile::tempdir().or_panic();
    let path = place.path().join("sets.msh");
    std::fs::write(&path, msh(&AnyMesh::Space(mesh))).or_panic();
    let AnyMesh::Space(back) = read(&path, 1.0, None).or_panic() else {
        panic!("no solid");
    };
    assert_eq!(["some", "one"].map(|name| places(&back, name)), expected);
}

const DECK: &str = "*NODE\n1,0,0\n2,1,0\n3,2,0\n4,0,1\n5,1,1\n6,2,1\n7,9,9\n\
    *ELEMENT,TYPE=CPS4,ELSET=strip\n1,1,2,5,4\n2,2,3,6,5\n\
    *NSET,NSET=left\n1,4\n*NSET,NSET=corner\n1,7\n*NSET,NSET=middle\n2,5\n*NSET,NSET=nowhere\n7\n";

fn case(tables: &str) -> Result<CaseProblem, String> {
    let place = tempfile::tempdir().or_panic();
    std::fs::write(place.path().join("strip.inp"), DECK).or_panic();
    let text = format!(
        "[mesh]\nfile = \"strip.inp\"\n[analysis]\nplane = \"plane_stress\"\n\
         [[material]]\nyoung = 100.0\npoisson = 0.0\n{tables}"
    );
    let case = Case::parse(&place.path().join("strip.toml"), text, &[]);
    let built = case.map_err(|e| e.to_string())?.build();
    built.map_err(|e| e.to_string().replace(&*place.path().to_string_lossy(), ""))
}

/// Node sets of an input file hold and load nodes, whether or not they have facets; results use their names.
#[test]
fn node_sets_of_input_files_are_named_by_cases() {
    let made = case(
        "[[support]]\nname = \"clamp\"\nnodes = [\"left\", \"corner\"]\nx = 0\n\
         [[support]]\nnodes = \"corner\"\ny = 0\n[[force]]\nnodes = \"middle\"\nx = 0.5\n",
    );
    let CaseProblem::Elastic(built) = made.or_panic() else {
        panic!("no bodies");
    };
    let AnyBuilt::Plane(built) = *built else {
        panic!("none of the plane");
    };
    assert_eq!(built.elastic.supports, ["clamp", "corner, y"]);
    assert_eq!(built.elastic.support_centres[1], [0.0, 0.0]);
    // It is pulled up to the middle: u = F / E there and beyond.
    for (u, x) in displacements(&built).iter().zip(&built.elastic.mesh.nodes) {
        assert!((u[0] - x[0].min(1.0) / 100.0).abs() < 1e-15);
    }
}

#[test]
fn faults_of_sets_are_reported() {
    let of_force = |rest: &str| {
        case(&format!(
            "[[support]]\nnodes = \"left\"\nx = 0\ny = 0\n[[force]]\n{rest}\n"
        ))
        .expect_err("an error")
    };
    for (rest, expected) in [
        (
            "nodes = \"midle\"\nx = 1",
            "line 12: there is no set of nodes \"midle\"; the mesh has \"corner\", \"left\", \"middle\" and \"nowhere\": did \
             you mean \"middle\"?",
        ),
        (
            "name = \"pull\"\nnodes = \"nowhere\"\nx = 1",
            "line 12: force 1 \"pull\" on the nodes \"nowhere\": the set of nodes \"nowhere\" is empty, or its nodes belong",
        ),
        ("nodes = []\nx = 1", "line 12: a list of node sets is empty"),
        ("nodes = \"left\"", "line 12: a force needs x or y"),
        ("nodes = \"left\"\nz = 1", "z has no meaning here"),
        (
            "nodes = \"left\"\npoint = [0, 0]\nx = 1",
            "line 12: a force needs one of nodes, point and boundary",
        ),
        (
            "nodes = \"left\"\nx = \"1 / (x - x)\"",
            "no finite value near",
        ),
        (
            "nodes = \"left\"\nx = 1\nfactors = [1, 2]",
            "factors apply to load steps",
        ),
    ] {
        let text = of_force(rest);
        assert!(text.contains(expected), "{rest}: {text}");
    }
    let both = case("[[support]]\nnodes = \"left\"\nsymmetry = true\n");
    assert!(
        both.is_err_and(|text| { text.contains("symmetry takes a boundary and nothing else") })
    );
}

/// No obstacle in the way of a gap of ∞, and no slip under a bound or a coefficient of ∞, node by node and in the mean over places.
#[test]
fn infinity_is_a_gap_and_a_bound() {
    let floor = Obstacle::HalfSpace {
        point: [0.0; 2],
        normal: [0.0, 1.0],
    };
    let squeezed = |contact: Pair| {
        let blocks = rectangle([0.0; 2], [2.0, 1.0], [8, 4], CellShape::Quad, "up", "up-");
        let bed = rectangle(
            [-1.0, -1.0],
            [4.0, 1.0],
            [11, 3],
            CellShape::Quad,
            "bed",
            "bed-",
        );
        let model = Model::on(join(blocks, bed))
            .material(Material::new(100.0, 0.3))
            .support(Support::on("up-top").x(0.01).y(-0.02))
            .support(Support::on("bed-bottom").fixed())
            .contact(contact);
        let built = model.build().or_panic();
        let solution = built.solve(&Default::default()).or_panic().remove(0);
        assert_eq!(solution.status, Status::Converged);
        solution.lambda
    };
    let right_half = |gap: f64| move |x: [f64; 2]| if x[0] > 1.1 { gap } else { 0.0 };
    for pair in [
        Pair::obstacle("up-bottom", floor),
        Pair::new("up-bottom", "bed-top"),
    ] {
        let far = squeezed(pair.clone().coulomb(0.3).gap(right_half(1.0)));
        let none = squeezed(pair.clone().coulomb(0.3).gap(right_half(f64::INFINITY)));
        assert_eq!(far.len(), none.len());
        let off = norm_of_difference(&far, &none);
        assert!(off < 1e-9, "off by {off:e}");
        let pressed = none[..none.len() / 2].iter().filter(|&&force| force > 0.0);
        assert!((3..=7).contains(&pressed.count()));
        let rough = squeezed(pair.clone().coulomb(1e4));
        let scale = length(&rough);
        for never in [
            pair.clone().coulomb(f64::INFINITY),
            pair.tresca(f64::INFINITY),
        ] {
            let off = norm_of_difference(&rough, &squeezed(never)) / scale;
            assert!(off < 1e-5, "off by {off:e}");
        }
    }
}

fn norm_of_difference(a: &[f64], b: &[f64]) -> f64 {
    let apart: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    length(&apart)
}

/// A force on a node that no element has would be lost.
#[test]
fn forces_on_nodes_without_elements_are_refused() {
    let strip = strip(1);
    let mut nodes = strip.nodes.clone();
    nodes.push([9.0, 9.0]);
    let mut sets = strip.node_sets.clone();
    sets.insert("load".to_owned(), vec![0, nodes.len() as u32 - 1]);
    let parts = MeshParts {
        nodes,
        elements: strip.elements,
        regions: strip.regions,
        groups: strip.groups,
        boundaries: strip.boundaries,
        node_sets: sets,
        notes: Vec::new(),
    };
    let mesh = Mesh::from_parts(parts).or_panic();
    let on = |set: &str| {
        let model = Model::on(mesh.clone())
            .material(Material::new(1.0, 0.3))
            .support(Support::on("left").fixed())
            .force(Force::at_nodes(set).x(1.0));
        model.build().map(|_| ()).map_err(|error| error.to_string())
    };
    assert_eq!(on("last"), Ok(()));
    let refused = on("load").expect_err("a node has no element");
    assert!(
        refused.contains("1 of the nodes of the set \"load\" belong to no element"),
        "{refused}"
    );
}
