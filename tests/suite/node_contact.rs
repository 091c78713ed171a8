//! Contact of sets of nodes: one by one against facets and obstacles, and as the corners of facets that they make up together.

use crate::common::distance;
use crate::common::models::{Answer, answer};
use crate::common::or_panic::OrPanic as _;
use signorini::contact::{Obstacle, Space};
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::mesh::{ElementKind, Mesh, Topology};
use signorini::model::{Model, Pair, Support, Traction};

const YOUNG: f64 = 2e11;

/// The nodes of a mesh at places.
fn nodes_at<const D: usize>(mesh: &Mesh<D>, is: impl Fn([f64; D]) -> bool) -> Vec<u32>
where
    ElementKind: Topology<D>,
{
    let all = (0..).zip(&mesh.nodes);
    all.filter(|(_, x)| is(**x)).map(|(node, _)| node).collect()
}

fn stack(cells: [usize; 2], shape: SolidShape) -> Mesh<3> {
    let mut mesh = join(
        block(
            [0.0; 3],
            [1.0; 3],
            [cells[0], cells[0], 2],
            shape,
            "low",
            "low-",
        ),
        block(
            [0.0, 0.0, 1.0],
            [1.0; 3],
            [cells[1], cells[1], 3],
            SolidShape::Hexahedron,
            "up",
            "up-",
        ),
    );
    let count = (cells[0] + 1) * (cells[0] + 1) * 3;
    let of_up = nodes_at(&mesh, |x| x[2] == 1.0);
    let of_up = of_up.into_iter().filter(|&node| node >= count as u32);
    mesh.node_sets.insert("foot".to_owned(), of_up.collect());
    mesh
}

fn model<const D: usize>(mesh: Mesh<D>, pair: Pair<D>) -> Model<D>
where
    ElementKind: Space<D>,
{
    Model::on(mesh)
        .material(Material::new(YOUNG, 0.0))
        .contact(pair)
}

fn pressed(mesh: Mesh<3>, pair: Pair<3>) -> Model<3> {
    model(mesh, pair)
        .support(Support::on("low-bottom").fixed())
        .traction(Traction::on("up-top").z(-1e7).x(1e6))
}

/// Nodes that meet nodes transfer a uniform pressure unchanged; those that meet facets of another mesh transfer all of it, and
/// agree with the mortar method as far as the meshes do.
#[test]
fn nodes_against_faces() {
    let by_nodes = || Pair::new("foot", "low-top").by_nodes().coulomb(0.3);
    for path in [Stiffness::Cholesky, Stiffness::Pcg] {
        let found = answer(
            model(stack([4, 4], SolidShape::Hexahedron), by_nodes())
                .support(Support::on("low-bottom").fixed())
                .support(Support::on("up-left").x(0.0))
                .support(Support::on("up-front").y(0.0))
                .traction(Traction::on("up-top").z(-1e7)),
            1e-10,
            path,
        );
        assert_eq!(found.m(), 25);
        for i in 0..found.m() {
            assert!(
                (found.pressure(i) / 1e7 - 1.0).abs() < 1e-7,
                "{}",
                found.pressure(i)
            );
        }
        for shape in [
            SolidShape::Hexahedron,
            SolidShape::Tetrahedron,
            SolidShape::Wedge,
        ] {
            let mesh = || stack([3, 5], shape);
            let found = answer(pressed(mesh(), by_nodes()), 1e-9, path);
            let mortar = Pair::new("up-bottom", "low-top").coulomb(0.3);
            let expected = answer(pressed(mesh(), mortar), 1e-9, path);
            let carried = |answer: &Answer<3>| {
                (0..answer.m()).fold([0.0; 3], |sum, i| {
                    let force = answer.contact_force(i);
                    std::array::from_fn(|c| sum[c] + force[c])
                })
            };
            let force = carried(&found);
            assert!(
                (force[2] - 1e7).abs() < 10.0 && (force[0] + 1e6).abs() < 10.0,
                "{force:?}"
            );
            let apart = distance(&found.solution.u, &expected.solution.u);
            assert!(apart < 0.03, "{apart}");
        }
    }
}

/// Against an obstacle, nodes give the same rows and the same areas as their facets.
#[test]
fn nodes_against_an_obstacle() {
    let mut mesh = rectangle([0.0, 0.0], [2.0, 1.0], [8, 4], CellShape::Quad, "body", "");
    let bottom = nodes_at(&mesh, |x| x[1] == 0.0);
    let halves = [bottom[..4].to_vec(), bottom[4..].to_vec()];
    mesh.node_sets.insert("all".to_owned(), bottom);
    for (name, nodes) in ["a", "b"].into_iter().zip(halves) {
        mesh.node_sets.insert(name.to_owned(), nodes);
    }
    let floor = Obstacle::HalfSpace {
        point: [0.0, 0.0],
        normal: [0.0, 1.0],
    };
    let with = |pair: Pair| {
        let model = model(mesh.clone(), pair).traction(
            Traction::on("top")
                .y(|x: [f64; 2]| -1e7 * (1.0 + x[0]))
                .x(1e6),
        );
        answer(model, 1e-10, Stiffness::Cholesky)
    };
    let expected = with(Pair::obstacle("bottom", floor).coulomb(0.2));
    let by_nodes = with(Pair::obstacle("all", floor).by_nodes().coulomb(0.2));
    // Neither half has the edge between them.
    let halves = with(Pair::obstacle(["a", "b"], floor).coulomb(0.2));
    for found in [&by_nodes, &halves] {
        assert_eq!(found.m(), expected.m());
        assert!(distance(&found.solution.u, &expected.solution.u) < 1e-8);
        let areas = |answer: &Answer<2>| (0..answer.m()).map(|i| answer.area(i)).sum::<f64>();
        assert!((areas(found) - 2.0).abs() < 1e-12, "{}", areas(found));
    }
    // A set with a boundary.
    let mixed = with(Pair::obstacle(["bottom", "a"], floor).coulomb(0.2));
    assert_eq!(mixed.solution.lambda, expected.solution.lambda);
    let error = |pair: Pair| model(mesh.clone(), pair).build().unwrap_err().to_string();
    mesh_error(
        &error(Pair::obstacle("nowhere", floor).by_nodes()),
        "nowhere",
    );
    mesh_error(&error(Pair::obstacle("top", floor).by_nodes()), "top");
}

fn mesh_error(error: &str, name: &str) {
    assert!(error.contains(&format!("\"{name}\"")), "{error}");
}

#[test]
fn nodes_without_a_face_are_reported() {
    let mut mesh = stack([2, 2], SolidShape::Hexahedron);
    let foot = mesh.node_sets["foot"].clone();
    mesh.node_sets.insert("one".to_owned(), foot[..1].to_vec());
    let error = pressed(mesh.clone(), Pair::new("one", "low-top"))
        .build()
        .unwrap_err();
    assert!(error.to_string().contains("no outer face"), "{error}");
    // One node bears the whole force, with its share of area.
    let one = model(mesh, Pair::new("one", "low-top").by_nodes())
        .support(Support::on("low-bottom").fixed());
    let built = one
        .support(Support::on("up-top").fixed())
        .build()
        .or_panic();
    let places = &built.elastic.contact.places;
    assert_eq!(places.len(), 1);
    assert!(
        (places[0].area - 0.0625).abs() < 1e-12,
        "{}",
        places[0].area
    );
}
