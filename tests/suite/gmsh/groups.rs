//! Elements and curves in several groups, reversed, between elements and apart from them.

use super::drawing::{Coding, curve, squares, surface};
use super::{HELD, case, material, measures_are, mesh_of, message, near, refused, total_load};
use crate::common::or_panic::OrPanic as _;
use signorini::mesh::structured::{CellShape, join, rectangle};
use signorini::mesh::{BoundaryError, FaultKind};
use std::collections::BTreeMap;

#[test]
fn an_element_in_two_groups_counts_once_in_every_format() {
    for (format, bytes) in squares().files() {
        let mesh = mesh_of(&bytes);
        assert_eq!(mesh.elements.len(), 3, "{format}");
        assert_eq!(mesh.nodes.len(), 6, "{format}");
        assert_eq!(mesh.regions, ["steel & all", "rubber & all"], "{format}");
        measures_are(&mesh, &[1.0, 1.0]);
        let groups: Vec<(&str, &[u32])> = (mesh.groups.iter())
            .map(|(name, regions)| (name.as_str(), &regions[..]))
            .collect();
        assert_eq!(
            groups,
            [
                ("all", &[0, 1][..]),
                ("rubber", &[1]),
                ("rubber & all", &[1]),
                ("steel", &[0]),
                ("steel & all", &[0]),
            ],
            "{format}"
        );
        // Turned around or not, boundaries have the body on their left.
        let bottom = mesh.outer_facets("bottom").unwrap_or_default();
        assert_eq!(bottom.len(), 2, "{format}");
        for &edge in bottom {
            assert_eq!(mesh.facet_normal(&edge), (1.0, [0.0, -1.0]), "{format}");
        }
        assert_eq!(mesh.boundaries["top"].len(), 2, "{format}");
    }
}

#[test]
fn weight_and_materials_of_elements_in_two_groups() {
    let gravity = format!("{HELD}[analysis]\ngravity = [0, -10]\nthickness = 0.5\n");
    for (format, bytes) in squares().files() {
        for (materials, weight) in [
            (material("all", 100.0), 1000.0),
            (material("steel", 100.0) + &material("rubber", 40.0), 700.0),
            (
                material("rubber & all", 40.0) + &material("steel", 100.0),
                700.0,
            ),
            // No contradiction.
            (material("all", 100.0) + &material("steel", 100.0), 1000.0),
            (
                "[[material]]\nyoung = 1\npoisson = 0\ndensity = 2\n".to_owned(),
                20.0,
            ),
        ] {
            println!("{format}: {materials}");
            let [x, y] = total_load(&bytes, &format!("{gravity}{materials}"));
            assert_eq!(x, 0.0);
            near(y, -weight);
        }
    }
    let bytes = squares().msh4(Coding::Ascii);
    for (region, load) in [("all", 6.0), ("steel", 3.0), ("rubber & all", 3.0)] {
        let force = format!("[[body_force]]\nregion = \"{region}\"\nx = 3\n");
        let [x, _] = total_load(&bytes, &format!("{HELD}{}{force}", material("all", 0.0)));
        near(x, load);
    }

    let error = refused(
        &bytes,
        &format!("{HELD}{}{}", material("all", 1.0), material("rubber", 2.0)),
    );
    assert!(
        error.contains("regions \"all\" and \"rubber\" overlap: \"rubber & all\" would have two"),
        "{error}"
    );
    let error = refused(
        &bytes,
        &format!("{HELD}{}{}", material("all", 1.0), material("all", 1.0)),
    );
    assert!(error.contains("\"all\" has two materials"), "{error}");
    let error = refused(&bytes, &format!("{HELD}{}", material("steel", 1.0)));
    assert!(
        error.contains("region \"rubber & all\" has no material"),
        "{error}"
    );
    let error = refused(&bytes, &format!("{HELD}{}", material("steal", 1.0)));
    assert!(error.contains("did you mean \"steel\"?"), "{error}");
}

/// Copies in the same group, in other groups and in none, in any order of nodes.
#[test]
fn copies_of_elements_count_once() {
    let mut drawing = squares();
    drawing.entities.truncate(5);
    drawing.entities.extend([
        surface(&[], &[&[5, 1, 2]]),
        surface(&[1], &[&[1, 2, 5], &[1, 5, 6], &[2, 1, 5]]),
        surface(&[2], &[&[2, 3, 4, 5], &[3, 2, 5, 4]]),
        surface(&[2], &[&[5, 6, 1]]),
        surface(&[3], &[&[4, 5, 2, 3]]),
    ]);
    for (format, bytes) in drawing.files() {
        let mesh = mesh_of(&bytes);
        assert_eq!(
            mesh.regions,
            ["steel", "steel & rubber", "rubber & all"],
            "{format}"
        );
        measures_are(&mesh, &[0.5, 0.5, 1.0]);
        assert_eq!(mesh.groups["rubber"], [1, 2], "{format}");
        assert_eq!(mesh.faults["middle"].kind, FaultKind::Inside);
        assert!(mesh.outer_facets("left").is_ok(), "{format}");
    }
    // A triangle and a quadrilateral with three nodes in common are different elements, one on the other.
    let mut drawing = squares();
    drawing.entities = vec![
        surface(&[1], &[&[2, 3, 4, 5]]),
        surface(&[3], &[&[2, 3, 4]]),
    ];
    let told = message(&drawing.msh4(Coding::Ascii));
    assert!(
        told.contains("elements 0 and 1 overlap: both lie on the same side of the edge"),
        "{told}"
    );
    // A group may have the name of the region of two others; and it keeps its name.
    let mut drawing = squares();
    drawing.names[8] = (2, 3, "steel & rubber");
    drawing.entities = vec![
        surface(&[1, 2], &[&[1, 2, 5]]),
        surface(&[3], &[&[2, 3, 4, 5]]),
    ];
    let mesh = mesh_of(&drawing.msh4(Coding::Ascii));
    measures_are(&mesh, &[0.5, 1.0]);
    assert_eq!(mesh.groups["steel & rubber"], [1]);
}

/// Curves between elements and apart from them do no harm where the case does not name them.
#[test]
fn a_2_1_file_with_inner_and_reversed_curves_is_solved() {
    let directory = tempfile::tempdir().or_panic();
    let path = directory.path().join("squares.msh");
    for (signs, coding) in [(false, Coding::Ascii), (true, Coding::Big)] {
        let bytes = squares().msh2("2.1", coding, signs, false);
        std::fs::write(&path, bytes).or_panic();
        let solved = crate::common::solve_case(
            &format!(
                "[mesh]\nfile = '{}'\n[[material]]\nregion = \"all\"\nyoung = 3000\npoisson = 0.4\n\
                 [[support]]\nboundary = \"left\"\nx = 0\n[[support]]\npoint = [0, 0]\ny = 0\n\
                 [[traction]]\nboundary = \"top\"\npressure = 10\n\
                 [[contact]]\nboundary = \"bottom\"\n\
                 obstacle = {{ half_plane = {{ point = [0, 0], normal = [0, 1] }} }}\n",
                path.display()
            ),
            1e-12,
        );
        let pressure = solved.fields().pressure;
        // The corner is held.
        assert_eq!(pressure.len(), 2);
        for p in pressure {
            assert!((p - 10.0).abs() < 1e-8, "{p}");
        }
    }
}

#[test]
fn inner_boundaries_may_be_held_but_not_loaded() {
    let bytes = squares().msh4(Coding::Ascii);
    let mesh = mesh_of(&bytes);
    let middle = mesh.facets("middle").unwrap_or_default();
    assert_eq!(middle, [[1, 4, 4]]);
    assert_eq!(mesh.facets("every").unwrap_or_default().len(), 6);
    assert_eq!(
        mesh.faults.keys().collect::<Vec<_>>(),
        ["every", "line", "middle"]
    );
    assert!(matches!(
        mesh.outer_facets("nothing"),
        Err(BoundaryError::Unknown(_))
    ));

    let start = "[mesh]\nfile = \"test.msh\"\n[[material]]\nyoung = 1\npoisson = 0\n";
    let support = |name: &str| format!("[[support]]\nboundary = \"{name}\"\nx = 0\ny = 0\n");
    let build = case(&bytes, &format!("{start}{}", support("middle"))).or_panic();
    let elastic = &build.elastic;
    let mut held: Vec<u32> = elastic.held.iter().map(|held| held.0).collect();
    held.sort_unstable();
    assert_eq!(held, [1, 1, 4, 4]);
    let build = case(
        &bytes,
        &format!("{start}[[support]]\nboundary = \"middle\"\nsymmetry = true\n[[support]]\npoint = [0, 0]\ny = 0\n"),
    )
    .or_panic();
    assert_eq!(build.elastic.held.len(), 3);

    let held = format!("{start}{}", support("left"));
    let traction = |name: &str| format!("{held}[[traction]]\nboundary = \"{name}\"\nx = 1\n");
    let contact = |name: &str| {
        format!(
            "{held}[[contact]]\nboundary = \"{name}\"\nobstacle = {{ half_plane = {{ point = [0, -1], normal = [0, 1] }} }}\n"
        )
    };
    let against =
        |name: &str| format!("{held}[[contact]]\nboundary = \"bottom\"\nagainst = \"{name}\"\n");
    for text in [contact("middle"), traction("middle"), against("every")] {
        let error = refused(&bytes, &text);
        let place = "its edge from (1.000000e0, 0.000000e0) to (1.000000e0, 1.000000e0)";
        assert!(error.contains(place), "{error}");
        let what = "lies between elements, not on the outside of the body";
        assert!(error.contains(what), "{error}");
        let name = if text.contains("every") {
            "every"
        } else {
            "middle"
        };
        assert!(error.contains(&format!("boundary \"{name}\"")), "{error}");
    }
    for text in [
        contact("line"),
        traction("line"),
        format!("{start}{}", support("line")),
    ] {
        let error = refused(&bytes, &text);
        assert!(
            error.contains(
                "boundary \"line\": its edge from (5.000000e0, 5.000000e0) to (6.000000e0, 5.000000e0) is not an edge \
                 of any element"
            ),
            "{error}"
        );
    }
    // The worse of two faults is reported, whatever their order.
    for curves in [[[2, 5], [7, 8]], [[7, 8], [5, 2]]] {
        let mut drawing = squares();
        drawing.entities.insert(0, curve(&[14], &curves));
        let mesh = mesh_of(&drawing.msh4(Coding::Ascii));
        assert_eq!(mesh.faults["middle"].kind, FaultKind::Stray);
        assert_eq!(mesh.faults["middle"].ends, [[5.0, 5.0], [6.0, 5.0]]);
        assert_eq!(mesh.boundaries["middle"], [[1, 4, 4]]);
        assert!(mesh.facets("middle").is_err());
    }
}

#[test]
fn parts_carry_their_groups_and_faults_along() {
    let bytes = squares().msh4(Coding::Ascii);
    let text = |materials: &str, more: &str| {
        format!(
            "[analysis]\ngravity = [0, -1]\n[[mesh.part]]\nname = \"a\"\nfile = \"test.msh\"\n\
             [[mesh.part]]\nname = \"b\"\nfile = \"test.msh\"\nshift = [10, 1]\n\
             [[mesh.part]]\nname = \"c\"\nrectangle = {{ size = [1, 1], cells = [1, 1] }}\nshift = [20, 0]\n\
             [[support]]\nboundary = \"a-left\"\nx = 0\ny = 0\n[[support]]\nboundary = \"b-left\"\nx = 0\ny = 0\n\
             [[support]]\nboundary = \"c-left\"\nx = 0\ny = 0\n{materials}{more}"
        )
    };
    let materials = material("a-all", 1.0)
        + &material("b-steel", 10.0)
        + &material("b-rubber", 100.0)
        + &material("c", 1000.0);
    let [_, y] = total_load(&bytes, &text(&materials, ""));
    near(y, -1112.0);
    let traction = "[[traction]]\nboundary = \"b-middle\"\nx = 1\n";
    let error = refused(&bytes, &text(&materials, traction));
    assert!(
        error.contains(
            "\"b-middle\": its edge from (1.100000e1, 1.000000e0) to (1.100000e1, 2.000000e0)"
        ),
        "{error}"
    );
    let both = material("a-all", 1.0) + &material("b-all", 10.0) + &material("b-steel", 1.0);
    let error = refused(&bytes, &text(&(both + &material("c", 1.0)), ""));
    assert!(
        error.contains("\"b-all\" and \"b-steel\" overlap"),
        "{error}"
    );

    let part =
        |name: &str, x: f64| rectangle([x, 0.0], [1.0, 1.0], [1, 1], CellShape::Quad, name, name);
    let mesh = join(join(part("a", 0.0), part("b", 2.0)), part("c", 4.0));
    assert_eq!(
        mesh.groups,
        BTreeMap::from([("a", 0), ("b", 1), ("c", 2)].map(|(name, r)| (name.to_owned(), vec![r])))
    );
}
