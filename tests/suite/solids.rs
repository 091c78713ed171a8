//! Gmsh files of bodies in space: hexahedra, wedges and tetrahedra with physical volumes and surfaces.

use crate::common::or_panic::OrPanic as _;
use signorini::mesh::gmsh::read;
use signorini::mesh::{AnyMesh, BoundaryError, ElementKind, FaultKind, Mesh, facet_nodes};
use std::path::{Path, PathBuf};

fn mesh_of(path: &Path, scale: f64) -> Mesh<3> {
    match read(path, scale) {
        Ok(AnyMesh::Space(mesh)) => mesh,
        Ok(AnyMesh::Plane(_)) => panic!("{} is of space", path.display()),
        Err(error) => panic!("{error}"),
    }
}

/// A file of this content, read.
fn read_text(text: &str) -> Result<AnyMesh, String> {
    let directory = tempfile::tempdir().or_panic();
    let path = directory.path().join("test.msh");
    std::fs::write(&path, text).or_panic();
    read(&path, 1.0).map_err(|error| error.to_string())
}

fn shipped(name: &str) -> PathBuf {
    PathBuf::from(format!("tests/meshes/{name}.msh"))
}

#[track_caller]
fn near(a: f64, b: f64) {
    assert!((a - b).abs() <= 1e-9 * b.abs().max(1.0), "{a} {b}");
}

/// Area and mean position of a boundary, from its corners alone: a fan of triangles for each face.
fn area_and_centre(mesh: &Mesh<3>, name: &str) -> (f64, [f64; 3]) {
    let (mut area, mut centre) = (0.0, [0.0; 3]);
    for face in &mesh.boundaries[name] {
        let x: Vec<[f64; 3]> = (facet_nodes(face).iter())
            .map(|&node| mesh.nodes[node as usize])
            .collect();
        for k in 2..x.len() {
            let side = |a: usize, c: usize| x[a][c] - x[0][c];
            let normal = [(1, 2), (2, 0), (0, 1)]
                .map(|(i, j)| side(k - 1, i) * side(k, j) - side(k - 1, j) * side(k, i));
            let part = 0.5 * normal.iter().map(|v| v * v).sum::<f64>().sqrt();
            area += part;
            for c in 0..3 {
                centre[c] += part * (x[0][c] + x[k - 1][c] + x[k][c]) / 3.0;
            }
        }
    }
    (area, centre.map(|v| v / area))
}

/// The drawing tests/meshes/solid.geo in every format: a cube of hexahedra, one of wedges, one of tetrahedra upon it.
#[test]
fn a_solid_of_three_kinds_is_the_same_in_every_format() {
    for name in ["s22a", "s22b", "s41a", "s41b"] {
        let mesh = mesh_of(&shipped(name), 1.0);
        let count = |kind: ElementKind| mesh.elements.iter().filter(|e| e.kind() == kind).count();
        let counts = [
            ElementKind::Hexahedron,
            ElementKind::Wedge,
            ElementKind::Tetrahedron,
        ]
        .map(count);
        assert_eq!(counts, [8, 28, 100], "{name}");
        assert_eq!(mesh.bodies().0, 1);
        let measures = mesh.measures();
        // MSH 2 has the kinds in another order.
        let rubber = mesh.groups["rubber"][0] as usize;
        assert_eq!(mesh.regions[rubber], "rubber & all", "{name}");
        assert_eq!(mesh.regions[1 - rubber], "steel & all", "{name}");
        near(measures[rubber], 2.0);
        near(measures[1 - rubber], 1.0);
        assert_eq!(mesh.groups["all"], [0, 1]);
        let boundaries: Vec<&str> = mesh.boundaries.keys().map(String::as_str).collect();
        assert_eq!(
            boundaries,
            ["bottom", "left", "middle", "right", "sheet", "top"],
            "curves and points are left out"
        );
        for (boundary, area, centre, outward) in [
            ("bottom", 2.0, [1.0, 0.5, 0.0], [0.0, 0.0, -1.0]),
            ("left", 1.0, [0.0, 0.5, 0.5], [-1.0, 0.0, 0.0]),
            ("right", 2.0, [2.0, 0.5, 1.0], [1.0, 0.0, 0.0]),
            ("top", 1.0, [1.5, 0.5, 2.0], [0.0, 0.0, 1.0]),
        ] {
            let (found, place) = area_and_centre(&mesh, boundary);
            near(found, area);
            (0..3).for_each(|c| near(place[c], centre[c]));
            let faces = mesh.outer_facets(boundary).unwrap_or_default();
            assert!(!faces.is_empty());
            for face in faces {
                let (_, normal) = mesh.facet_normal(face);
                (0..3).for_each(|c| near(normal[c], outward[c]));
            }
            near(faces.iter().map(|f| mesh.facet_normal(f).0).sum(), area);
        }
        assert_eq!(mesh.faults["middle"].kind, FaultKind::Inside);
        assert_eq!(mesh.facets("middle").map(<[_]>::len).ok(), Some(4));
        let error = mesh.outer_facets("middle").expect_err("it lies inside");
        let text = error.to_string();
        assert!(
            text.starts_with("boundary \"middle\": its face with corners from (1.0"),
            "{text}"
        );
        assert!(
            text.ends_with(
                "lies between elements, not on the outside of the body: take that surface out of the physical group \
                 or, where two bodies touch, draw it once for each"
            ),
            "{text}"
        );
        assert!(mesh.boundaries["sheet"].is_empty());
        let Err(BoundaryError::Faulty { kind, fault, .. }) = mesh.facets("sheet") else {
            panic!("no element has it");
        };
        assert_eq!(kind, FaultKind::Stray);
        assert!(fault.contains("is not a face of any element: take that surface out"));

        let small = mesh_of(&shipped(name), 1e-3);
        near(small.measures().iter().sum::<f64>() * 1e9, 3.0);
    }
}

#[test]
fn broken_files_of_solids_are_errors() {
    let directory = tempfile::tempdir().or_panic();
    let path = directory.path().join("broken.msh");
    for name in ["s22a", "s22b", "s41a", "s41b"] {
        let whole = std::fs::read(shipped(name)).or_panic();
        for end in (0..whole.len()).step_by(97) {
            std::fs::write(&path, &whole[..end]).or_panic();
            if let Err(error) = read(&path, 1.0) {
                assert!(error.to_string().contains("broken.msh"));
            }
            // Wherever a byte is another one, it must not be a panic.
            let mut changed = whole.clone();
            changed[end] = changed[end].wrapping_mul(31).wrapping_add(17);
            std::fs::write(&path, &changed).or_panic();
            let _ = read(&path, 1.0);
        }
    }
}

/// Nodes of a unit cube, the lower four first, then a fifth layer above; elements as rows of a 2.2 file.
fn file(names: &str, elements: &[&str]) -> String {
    let mut text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n".to_owned() + names + "$Nodes\n8\n";
    for (number, [x, y]) in (1..).zip([[0, 0], [1, 0], [1, 1], [0, 1]].repeat(2)) {
        text += &format!("{number} {x} {y} {}\n", (number - 1) / 4);
    }
    text += &format!("$EndNodes\n$Elements\n{}\n", elements.len());
    for (number, element) in (1..).zip(elements) {
        text += &format!("{number} {element}\n");
    }
    text + "$EndElements\n"
}

#[test]
fn kinds_groups_and_refusals() {
    let read_as =
        |elements: &[&str], volume: f64, region: &str| match read_text(&file("", elements)) {
            Ok(AnyMesh::Space(mesh)) => {
                assert_eq!(
                    (mesh.elements.len(), &mesh.regions[..]),
                    (1, &[region.to_owned()][..])
                );
                near(mesh.measures()[0], volume);
            }
            other => panic!("{other:?}"),
        };
    // Each kind, also from the other side, and one twice in two groups.
    for cube in ["5 2 0 1 1 2 3 4 5 6 7 8", "5 2 0 1 5 6 7 8 1 2 3 4"] {
        read_as(&[cube], 1.0, "unnamed");
    }
    for wedge in ["6 2 0 1 1 2 3 5 6 7", "6 2 0 1 5 6 7 1 2 3"] {
        read_as(&[wedge], 0.5, "unnamed");
    }
    for tetrahedron in ["4 2 0 1 1 2 3 5", "4 2 0 1 2 1 3 5"] {
        let others = ["15 2 0 1 1", "1 2 0 1 1 2"];
        read_as(&[tetrahedron, others[0], others[1]], 1.0 / 6.0, "unnamed");
    }
    read_as(&["7 2 0 1 1 2 3 4 5"], 1.0 / 3.0, "unnamed");
    let twice = ["5 2 7 1 1 2 3 4 5 6 7 8", "5 2 9 1 1 2 3 4 5 6 7 8"];
    read_as(&twice, 1.0, "7 & 9");

    let message = |names: &str, elements: &[&str]| match read_text(&file(names, elements)) {
        Ok(_) => panic!("it was read"),
        Err(error) => error,
    };
    for (elements, what) in [
        (
            "14 2 0 1 1 2 3 4 5 6 7 8 1 2 3 4 5 6",
            "pyramids of second order are not supported: set Mesh.ElementOrder = 1",
        ),
        ("19 2 0 1 1 2 3 4 5", "pyramids of second order"),
        ("29 2 0 1 1 2 3 4 5", "Mesh.ElementOrder = 1 or 2"),
        ("92 2 0 1 1 2 3 4 5 6 7 8", "Mesh.ElementOrder = 1 or 2"),
        ("199 2 0 1 1 2 3", "element type 199 is not supported"),
        (
            "4 2 0 1 1 2 3 4",
            "near (0.000000e0, 0.000000e0, 0.000000e0) has no volume",
        ),
        // The upper side turned by a right angle, and by two.
        ("5 2 0 1 1 2 3 4 7 8 5 6", "folds over itself"),
        ("5 2 0 1 1 2 3 9 5 6 7 8", "names node 9"),
    ] {
        let error = message("", &[elements]);
        assert!(error.contains(what), "{error}");
    }
    // Surfaces of a solid without its volumes.
    let error = message("", &["3 2 1 1 1 2 3 4", "3 2 1 1 5 6 7 8"]);
    assert!(
        error.contains("not plane") && error.contains("gmsh -3"),
        "{error}"
    );
    let names = "$PhysicalNames\n1\n3 1 \"steel\"\n$EndPhysicalNames\n";
    let error = message(names, &["5 2 0 1 1 2 3 4 5 6 7 8"]);
    assert!(error.contains("Mesh.SaveAll = 0"), "{error}");
}
