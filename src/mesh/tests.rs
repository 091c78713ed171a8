mod solid;
mod threads;

use super::structured::{CellShape, SolidShape, block, join, rectangle, shared_name};
use super::*;

const CORNERS: [[f64; 2]; 4] = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]];

fn mesh(
    nodes: &[[f64; 2]],
    elements: Vec<Element>,
    boundaries: &[(&str, &[[u32; 2]])],
) -> Result<Mesh, MeshError> {
    let boundaries = (boundaries.iter()).map(|(name, edges)| {
        let edges = edges.iter().map(|edge| facet::<2>(edge));
        (name.to_string(), edges.collect())
    });
    Mesh::new(
        nodes.to_vec(),
        elements,
        vec!["body".to_owned()],
        boundaries.collect(),
    )
}

#[test]
fn facets_go_round_a_kind() {
    for kind in [ElementKind::Triangle, ElementKind::Quad] {
        for (number, facet) in kind.facets().iter().enumerate() {
            assert_eq!(**facet, [number, (number + 1) % kind.n_nodes()]);
        }
    }
    let edges: Vec<_> = Element::quad([7, 3, 5, 9], 0).facets().collect();
    assert_eq!(edges, [[7, 3, 3], [3, 5, 5], [5, 9, 9], [9, 7, 7]]);
}

#[test]
fn elements_and_edges_are_turned_around() {
    let elements = vec![
        Element::triangle([0, 3, 1], 0),
        Element::triangle([1, 2, 3], 0),
    ];
    let made = mesh(&CORNERS, elements, &[("side", &[[0, 1], [2, 1]])]);
    let made = made.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(made.elements[0].nodes(), [1, 3, 0]);
    assert_eq!(made.elements[1].nodes(), [1, 2, 3]);
    assert!((made.measures()[0] - 2.0).abs() < 1e-15);
    assert_eq!(made.boundaries["side"], [[0, 1, 1], [1, 2, 2]]);
    assert!(made.faults.is_empty());
    assert_eq!(made.facet_normal(&[1, 2, 2]), (1.0, [1.0, 0.0]));
    assert_eq!(made.groups["body"], [0]);

    let quad = mesh(&CORNERS, vec![Element::quad([0, 3, 2, 1], 0)], &[]);
    let quad = quad.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(quad.elements[0].nodes(), [1, 2, 3, 0]);
    assert_eq!(quad.measures(), [2.0]);
}

#[test]
fn nodes_of_no_element_go() {
    let mut nodes = vec![[9.0, 9.0]];
    nodes.extend(CORNERS);
    let made = mesh(
        &nodes,
        vec![Element::quad([1, 2, 3, 4], 0)],
        &[("low", &[[1, 2]])],
    );
    let made = made.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(made.nodes, CORNERS);
    assert_eq!(made.elements[0].nodes(), [0, 1, 2, 3]);
    assert_eq!(made.boundaries["low"], [[0, 1, 1]]);
}

#[test]
fn edges_that_are_not_outside_are_noted() {
    let halves = || {
        vec![
            Element::triangle([0, 1, 2], 0),
            Element::triangle([0, 2, 3], 0),
        ]
    };
    let inside = mesh(&CORNERS, halves(), &[("cut", &[[2, 0], [0, 2], [0, 1]])]);
    let inside = inside.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(inside.boundaries["cut"], [[0, 1, 1], [2, 0, 0]]);
    assert_eq!(inside.faults["cut"].kind, FaultKind::Inside);
    assert!(inside.facets("cut").is_ok());
    let error = inside.outer_facets("cut").expect_err("it lies inside");
    assert_eq!(
        error.to_string(),
        "boundary \"cut\": its edge from (2.000000e0, 1.000000e0) to (0.000000e0, 0.000000e0) lies between elements, \
         not on the outside of the body: take that curve out of the physical group or, where two bodies touch, draw \
         it once for each"
    );

    let stray = mesh(&CORNERS, halves(), &[("line", &[[0, 1], [1, 3]])]);
    let stray = stray.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(stray.boundaries["line"], [[0, 1, 1]]);
    assert!(matches!(
        stray.facets("line"),
        Err(BoundaryError::Faulty { .. })
    ));
    assert!(matches!(
        stray.facets("lime"),
        Err(BoundaryError::Unknown(_))
    ));

    let empty = mesh(&CORNERS, halves(), &[("none", &[])]);
    let empty = empty.unwrap_or_else(|error| panic!("{error}"));
    for refused in [empty.facets("none"), empty.outer_facets("none")] {
        assert_eq!(
            refused.expect_err("it is empty").to_string(),
            "boundary \"none\": it has no facet: look at what selects its curves (coordinates are rounded), or leave it out"
        );
    }
}

#[test]
fn nonsense_is_refused() {
    let triangle = |nodes, region| vec![Element::triangle(nodes, region)];
    let message = |elements, boundaries: &[(&str, &[[u32; 2]])]| {
        let made = mesh(&CORNERS, elements, boundaries);
        made.expect_err("it is nonsense").to_string()
    };
    assert_eq!(message(vec![], &[]), "the mesh has no elements");
    assert!(message(triangle([0, 1, 4], 0), &[]).contains("names node 4"));
    assert!(message(triangle([0, 1, 2], 1), &[]).contains("in region 1"));
    assert!(message(triangle([0, 1, 2], 0), &[("b", &[[0, 9]])]).contains("\"b\" names node 9"));
    let flat = message(triangle([1, 1, 2], 0), &[]);
    assert!(
        flat.contains("element 0 near (2.000000e0, 0.000000e0)"),
        "{flat}"
    );
    // A corner that turns inwards.
    let mut nodes = CORNERS;
    nodes[2] = [0.2, 0.1];
    assert!(matches!(
        mesh(&nodes, vec![Element::quad([0, 1, 2, 3], 0)], &[]),
        Err(MeshError::Degenerate { .. })
    ));
    nodes[2] = [f64::NAN, 0.0];
    assert!(matches!(
        mesh(&nodes, triangle([0, 1, 3], 0), &[]),
        Err(MeshError::NotFinite(2))
    ));
}

#[test]
fn joined_meshes_are_bodies_of_their_own() {
    let part = |x, name| {
        rectangle(
            [x, 0.0],
            [1.0, 1.0],
            [2, 3],
            CellShape::Triangle,
            name,
            name,
        )
    };
    let both = join(part(0.0, "a"), part(1.0, "b"));
    let (bodies, body) = both.bodies();
    assert_eq!((bodies, body[0], body[12]), (2, 0, 1));
    assert_eq!(both.measures().len(), 2);
    for (name, outward) in [
        ("aleft", [-1.0, 0.0]),
        ("btop", [0.0, 1.0]),
        ("bbottom", [0.0, -1.0]),
    ] {
        for &edge in &both.boundaries[name] {
            assert_eq!(both.facet_normal(&edge).1, outward);
        }
    }
    assert_eq!(both.bounding_box(), ([0.0, 0.0], [2.0, 1.0]));
    let mut other = part(3.0, "c");
    assert_eq!(shared_name(&both, &other), None);
    other.node_sets.insert("aleft".to_owned(), vec![0]);
    assert_eq!(shared_name(&both, &other), Some("aleft"));
}

#[test]
fn points_in_space_move_and_have_a_box() {
    let mut solid = block(
        [0.0, -1.0, 2.0],
        [3.0, 2.0, 3.0],
        [1, 1, 1],
        SolidShape::Hexahedron,
        "body",
        "",
    );
    solid.shift([1.0, 2.0, 3.0]);
    // A node without elements does not belong to the body.
    solid.nodes.push([9.0; 3]);
    assert_eq!(solid.bounding_box(), ([1.0, 1.0, 5.0], [4.0, 3.0, 8.0]));
    let place = Location::from(solid.nodes[0]).to_string();
    assert_eq!(place, "(1.000000e0, 1.000000e0, 5.000000e0)");
    assert_eq!(vector::length([2.0, -3.0, 6.0]), 7.0);
    assert_eq!(vector::dot([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]), 32.0);
}

/// Nodes without elements.
pub(crate) fn in_space(nodes: Vec<[f64; 3]>) -> Mesh<3> {
    Mesh {
        nodes,
        elements: Vec::new(),
        regions: Vec::new(),
        groups: BTreeMap::new(),
        boundaries: BTreeMap::new(),
        node_sets: BTreeMap::new(),
        faults: BTreeMap::new(),
        notes: Vec::new(),
        twins: BTreeMap::new(),
        lost: BTreeMap::new(),
    }
}

/// Names of the regions of a group.
fn of_group<'a>(mesh: &'a Mesh, name: &str) -> Vec<&'a str> {
    let region = |&region: &u32| mesh.regions[region as usize].as_str();
    mesh.groups[name].iter().map(region).collect()
}

#[test]
fn copies_of_elements_count_once() {
    // The left triangle is in "all" and, under another name, twice in "sensor"; the right one is only in "all".
    let elements = vec![
        Element::triangle([0, 1, 3], 0),
        Element::triangle([1, 2, 3], 0),
        Element::triangle([3, 1, 0], 1),
        Element::triangle([1, 3, 0], 1),
    ];
    let regions = ["all", "sensor"].map(str::to_owned).to_vec();
    let edges = vec![facet::<2>(&[0, 1]), facet::<2>(&[0, 3])];
    let boundaries = BTreeMap::from([("side".to_owned(), edges)]);
    let made = Mesh::new(CORNERS.to_vec(), elements, regions, boundaries);
    let made = made.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(made.elements.len(), 2);
    let area: f64 = made.measures().iter().sum();
    assert!((area - 2.0).abs() < 1e-15, "{area}");
    assert_eq!(made.regions, ["all", "all & sensor"]);
    assert_eq!(of_group(&made, "all"), ["all", "all & sensor"]);
    assert_eq!(of_group(&made, "sensor"), ["all & sensor"]);
    let of: Vec<u32> = made.elements.iter().map(|element| element.region).collect();
    assert_eq!(of, [1, 0]);
    // A facet of one element is on the outside, though it is listed three times.
    assert!(made.faults.is_empty());
    assert_eq!(made.boundaries["side"].len(), 2);
    let [note] = &made.notes[..] else {
        panic!("{:?}", made.notes)
    };
    assert!(
        note.starts_with("2 elements of the mesh are copies"),
        "{note}"
    );
}

#[test]
fn elements_on_one_side_of_an_edge_overlap() {
    let overlaps = |nodes: &[[f64; 2]], elements: Vec<Element>| match mesh(nodes, elements, &[]) {
        Err(MeshError::Overlap { elements, .. }) => elements,
        other => panic!("{other:?}"),
    };
    let [a, b, c, d] = [0, 1, 2, 3];
    let quad = Element::quad([a, b, c, d], 0);
    let half = vec![quad, Element::triangle([a, b, c], 0)];
    assert_eq!(overlaps(&CORNERS, half.clone()), [0, 1]);
    // Both ways to cut a rectangle in two.
    let cut = [[a, b, c], [a, c, d], [a, b, d], [b, c, d]].map(|t| Element::triangle(t, 0));
    assert!(overlaps(&CORNERS, cut.to_vec())[1] >= 2);
    // Of first and of second order on the same corners.
    let mut nodes = CORNERS[..3].to_vec();
    nodes.extend([[1.0, 0.0], [2.0, 0.5], [1.0, 0.5]]);
    let orders = vec![
        Element::new(ElementKind::Triangle6, &[0, 1, 2, 3, 4, 5], 0),
        Element::triangle([2, 0, 1], 0),
    ];
    assert_eq!(overlaps(&nodes, orders), [0, 1]);
    let told = mesh(&CORNERS, half, &[]).err();
    let told = told.map(|error| error.to_string()).unwrap_or_default();
    let begins = "elements 0 and 1 overlap: both lie on the same side of the edge near (1.000000e0, 0.000000e0)";
    assert!(told.starts_with(begins), "{told}");
}
