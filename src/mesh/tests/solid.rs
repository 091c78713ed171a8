//! Meshes of space: blocks, orientation, boundaries, faults.

use super::*;
use crate::mesh::structured::{SolidShape, block};
use approx::assert_relative_eq;
use std::collections::HashMap;

const SHAPES: [(SolidShape, usize); 3] = [
    (SolidShape::Hexahedron, 1),
    (SolidShape::Tetrahedron, 6),
    (SolidShape::Wedge, 2),
];

/// The occurrences of each facet of the elements of a mesh, by its nodes in order, and the parity of their rotation.
fn owners(mesh: &Mesh<3>) -> HashMap<Vec<u32>, Vec<Vec<u32>>> {
    let mut owners: HashMap<Vec<u32>, Vec<Vec<u32>>> = HashMap::new();
    for facet in mesh.elements.iter().flat_map(Element::facets) {
        let mut nodes = facet_nodes(&facet).to_vec();
        let lowest = (0..nodes.len()).min_by_key(|&a| nodes[a]).unwrap_or(0);
        nodes.rotate_left(lowest);
        let mut key = nodes.clone();
        key.sort_unstable();
        owners.entry(key).or_default().push(nodes);
    }
    owners
}

#[test]
fn blocks_of_each_kind_are_whole() {
    for (shape, per_cell) in SHAPES {
        let mesh = block(
            [1.0, 2.0, 3.0],
            [3.0, 2.0, 1.5],
            [3, 2, 4],
            shape,
            "steel",
            "a-",
        );
        assert_eq!(mesh.nodes.len(), 4 * 3 * 5);
        assert_eq!(mesh.elements.len(), 24 * per_cell);
        assert_eq!(mesh.bounding_box(), ([1.0, 2.0, 3.0], [4.0, 4.0, 4.5]));
        assert_eq!(mesh.bodies().0, 1);
        assert_relative_eq!(mesh.measures()[0], 9.0, max_relative = 1e-14);
        let cell = 9.0 / 24.0 / per_cell as f64;
        for element in &mesh.elements {
            assert_relative_eq!(mesh.measure(element), cell, max_relative = 1e-13);
        }
        // Neighbours share whole faces and see them from either side; the rest is the surface.
        let mut outside = 0;
        for sides in owners(&mesh).values() {
            match &sides[..] {
                [_] => outside += 1,
                [a, b] => {
                    let back: Vec<u32> =
                        [&b[..1], &b[1..].iter().rev().copied().collect::<Vec<_>>()].concat();
                    assert_eq!(*a, back);
                }
                _ => panic!("three elements meet in a face"),
            }
        }
        let boundaries: usize = mesh.boundaries.values().map(Vec::len).sum();
        assert_eq!(boundaries, outside);
        for (name, area, outward) in [
            ("a-left", 3.0, [-1.0, 0.0, 0.0]),
            ("a-right", 3.0, [1.0, 0.0, 0.0]),
            ("a-front", 4.5, [0.0, -1.0, 0.0]),
            ("a-back", 4.5, [0.0, 1.0, 0.0]),
            ("a-bottom", 6.0, [0.0, 0.0, -1.0]),
            ("a-top", 6.0, [0.0, 0.0, 1.0]),
        ] {
            let mut sum = 0.0;
            for face in &mesh.boundaries[name] {
                let (area, normal) = mesh.facet_normal(face);
                sum += area;
                for c in 0..3 {
                    assert_relative_eq!(normal[c], outward[c], epsilon = 1e-14);
                }
            }
            assert_relative_eq!(sum, area, max_relative = 1e-13);
        }
        // The checks would leave the result of `block` unchanged.
        let (elements, boundaries) = (mesh.elements.clone(), mesh.boundaries.clone());
        let checked = Mesh::new(mesh.nodes, mesh.elements, mesh.regions, mesh.boundaries);
        let checked = checked.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(checked.elements, elements);
        assert!(checked.faults.is_empty());
        for (name, faces) in &boundaries {
            let sorted = |faces: &[Facet<3>]| {
                let mut faces: Vec<_> = faces.iter().map(element::unsided).collect();
                faces.sort_unstable();
                faces
            };
            assert_eq!(sorted(faces), sorted(&checked.boundaries[name]));
        }
    }
    let part = |x, name| {
        let size = [1.0; 3];
        block(
            [x, 0.0, 0.0],
            size,
            [1; 3],
            SolidShape::Hexahedron,
            name,
            name,
        )
    };
    let both = join(part(0.0, "a"), part(1.0, "b"));
    assert_eq!(both.bodies().0, 2);
    for measure in both.measures() {
        assert_relative_eq!(measure, 1.0, max_relative = 1e-15);
    }
    assert_eq!(both.boundaries["bleft"].len(), 1);
}

fn corners() -> Vec<[f64; 3]> {
    let below = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let layers = [0.0, 1.0].map(|z| below.map(|[x, y]| [x, y, z]));
    layers.concat()
}

fn made(
    nodes: Vec<[f64; 3]>,
    elements: Vec<Element<3>>,
    boundaries: &[(&str, &[Facet<3>])],
) -> Result<Mesh<3>, MeshError> {
    let boundaries = boundaries.iter();
    let boundaries = boundaries.map(|(name, faces)| (name.to_string(), faces.to_vec()));
    Mesh::new(
        nodes,
        elements,
        vec!["body".to_owned()],
        boundaries.collect(),
    )
}

#[test]
fn solids_and_faces_are_turned_around() {
    let inverted = [
        (Element::hexahedron([4, 5, 6, 7, 0, 1, 2, 3], 0), 1.0),
        (Element::hexahedron([0, 3, 2, 1, 4, 7, 6, 5], 0), 1.0),
        (Element::wedge([4, 5, 6, 0, 1, 2], 0), 0.5),
        (Element::wedge([0, 2, 1, 4, 6, 5], 0), 0.5),
        (Element::tetrahedron([0, 2, 1, 5], 0), 1.0 / 6.0),
    ];
    for (element, volume) in inverted {
        // The side x = 1 as the file has it, from inside and from outside; a triangle of it for tetrahedra.
        for side in [[1, 2, 6, 5], [5, 6, 2, 1], [2, 1, 5, 6]] {
            let side = match element.kind() {
                ElementKind::Tetrahedron => side.map(|node| if node == 6 { 2 } else { node }),
                _ => side,
            };
            let mut nodes: Vec<u32> = side.to_vec();
            nodes.dedup();
            if nodes.first() == nodes.last() {
                nodes.pop();
            }
            let side = facet::<3>(&nodes);
            let mesh = made(corners(), vec![element], &[("side", &[side, side])]);
            let mesh = mesh.unwrap_or_else(|error| panic!("{error}"));
            assert_relative_eq!(mesh.measures()[0], volume, max_relative = 1e-15);
            let [face] = mesh.outer_facets("side").unwrap_or_default() else {
                panic!("one face")
            };
            let (area, normal) = mesh.facet_normal(face);
            assert_eq!(normal, [1.0, 0.0, 0.0]);
            assert_eq!(area, if nodes.len() == 3 { 0.5 } else { 1.0 });
        }
    }
}

#[test]
fn folded_solids_are_refused() {
    let degenerate = |nodes: Vec<[f64; 3]>, element| {
        let error = made(nodes, vec![element], &[]).expect_err("it is folded");
        assert!(matches!(error, MeshError::Degenerate { .. }), "{error}");
        assert!(
            error.to_string().contains("has no volume or folds"),
            "{error}"
        );
    };
    // Flat; twisted by two right angles, where only the middle shows it; a corner pushed inwards.
    degenerate(corners(), Element::tetrahedron([0, 1, 2, 3], 0));
    degenerate(corners(), Element::hexahedron([0, 1, 2, 3, 6, 7, 4, 5], 0));
    degenerate(corners(), Element::wedge([0, 1, 2, 1, 2, 0], 0));
    let mut dented = corners();
    dented[6] = [0.2, 0.2, 0.2];
    degenerate(
        dented.clone(),
        Element::hexahedron([0, 1, 2, 3, 4, 5, 6, 7], 0),
    );
    degenerate(corners(), Element::hexahedron([0, 0, 2, 3, 4, 5, 6, 7], 0));
    // A flattened corner is not a fault of a wedge without that corner.
    assert!(made(dented, vec![Element::wedge([0, 1, 3, 4, 5, 7], 0)], &[]).is_ok());
}

#[test]
fn faces_that_are_not_outside_are_noted() {
    let halves = || {
        vec![
            Element::wedge([0, 1, 2, 4, 5, 6], 0),
            Element::wedge([0, 2, 3, 4, 6, 7], 0),
        ]
    };
    let cut = [[6, 4, 0, 2], [0, 4, 6, 2], [0, 1, 2, 2]].map(|nodes| facet::<3>(&nodes));
    let inside = made(corners(), halves(), &[("cut", &cut)]);
    let mut inside = inside.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(inside.boundaries["cut"].len(), 2);
    assert_eq!(inside.faults["cut"].kind, FaultKind::Inside);
    assert!(inside.facets("cut").is_ok());
    let error = inside.outer_facets("cut").expect_err("it lies inside");
    assert_eq!(
        error.to_string(),
        "boundary \"cut\": its face with corners from (1.000000e0, 1.000000e0, 1.000000e0) to (0.000000e0, \
         0.000000e0, 0.000000e0) lies between elements, not on the outside of the body: take that surface out of the \
         physical group or, where two bodies touch, draw it once for each"
    );
    inside.shift([1.0, 0.0, 0.0]);
    assert_eq!(inside.faults["cut"].ends[1], [1.0, 0.0, 0.0]);

    // A quadrilateral over two triangles, a crossed one, and three of its corners: faces of no element.
    for stray in [[0, 1, 2, 3], [1, 6, 2, 5], [1, 2, 6, 6]] {
        let mesh = made(corners(), halves(), &[("sheet", &[facet::<3>(&stray)])]);
        let mesh = mesh.unwrap_or_else(|error| panic!("{error}"));
        assert!(mesh.boundaries["sheet"].is_empty());
        let error = mesh.facets("sheet").expect_err("it is stray").to_string();
        assert!(
            error.contains("is not a face of any element: take that surface"),
            "{error}"
        );
    }
    assert_eq!(facet_nodes(&facet::<3>(&[4, 5, 6])), [4, 5, 6]);
    assert_eq!(facet_nodes(&facet::<2>(&[4, 5])), [4, 5]);
}

#[test]
fn elements_on_one_side_of_a_face_overlap() {
    let hexahedron = Element::hexahedron([0, 1, 2, 3, 4, 5, 6, 7], 0);
    let mut nodes = corners();
    nodes.extend([[0.5, 0.5, 2.0], [0.5, 0.5, 0.5]]);
    let pyramid = |nodes: [u32; 5]| Element::new(ElementKind::Pyramid, &nodes, 0);
    let made = |other| made(nodes.clone(), vec![hexahedron, other], &[]);
    // On the top of it, and within it.
    assert!(made(pyramid([4, 5, 6, 7, 8])).is_ok());
    let inside = [
        pyramid([4, 5, 6, 7, 9]),
        Element::wedge([0, 1, 2, 4, 5, 6], 0),
        Element::tetrahedron([0, 1, 2, 5], 0),
        Element::tetrahedron([1, 2, 6, 9], 0),
    ];
    for element in inside {
        let error = made(element).err();
        assert!(
            matches!(
                error,
                Some(MeshError::Overlap {
                    elements: [0, 1],
                    ..
                })
            ),
            "{error:?}"
        );
    }
    let copy = made(Element::hexahedron([4, 5, 6, 7, 0, 1, 2, 3], 0));
    let copy = copy.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((copy.elements.len(), copy.notes.len()), (1, 1));
}
