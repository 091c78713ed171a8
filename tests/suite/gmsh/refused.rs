//! Files that are not meshes, or not usable ones, and their remedies.

use super::drawing::{Coding, Out, squares};
use super::{HELD, material, measures_are, mesh_of, message, read_named, refused};
use crate::common::or_panic::OrPanic as _;
use signorini::mesh::gmsh::read;
use signorini::mesh::{Element, Mesh, MeshError};
use std::collections::BTreeMap;

#[test]
fn a_mesh_without_physical_curves_explains_how_to_add_them() {
    let mut drawing = squares();
    drawing.entities.retain(|e| e.dim == 2);
    let bytes = drawing.msh2("2.2", Coding::Ascii, false, false);
    let mesh = mesh_of(&bytes);
    assert!(mesh.boundaries.is_empty());
    let error = refused(&bytes, &format!("{HELD}{}", material("all", 1.0)));
    assert!(
        error.contains("the mesh file has no physical curves")
            && error.contains("Physical Curve(\"left\") = {"),
        "{error}"
    );
    // One part without curves beside one with them.
    let error = refused(
        &bytes,
        "[[mesh.part]]\nname = \"a\"\nrectangle = { size = [1, 1], cells = [1, 1] }\n\
         [[mesh.part]]\nname = \"b\"\nfile = \"test.msh\"\nshift = [5, 0]\n\
         [[material]]\nyoung = 1\npoisson = 0\n[[support]]\nboundary = \"b-left\"\nx = 0\n",
    );
    assert!(error.contains("Physical Curve(\"left\") = {"), "{error}");
    let error = refused(
        &squares().msh4(Coding::Ascii),
        &format!("{}{}", HELD.replace("left", "lift"), material("all", 1.0)),
    );
    assert!(error.contains("did you mean \"left\"?"), "{error}");
}

#[test]
fn other_versions_and_other_files_name_the_remedy() {
    for version in ["4", "4.0", "3.0", "2.3", "1.0"] {
        let error = message(&squares().msh2(version, Coding::Ascii, false, false));
        assert!(
            error.contains(&format!(
                "MSH version {version} is not supported: save as 4.1 or 2.2"
            )),
            "{error}"
        );
    }
    assert!(message(b"$NOD\n1\n1 0 0 0\n$ENDNOD\n").contains("MSH version 1 is not supported"));
    // The output of MSH 2 for a drawing with Mesh.SaveAll = 1, and a drawing without any groups.
    let mut drawing = squares();
    drawing.entities.iter_mut().for_each(|e| e.groups.clear());
    let error = message(&drawing.msh2("2.2", Coding::Ascii, false, false));
    assert!(error.contains("save it with Mesh.SaveAll = 0"), "{error}");
    drawing.names.clear();
    let mesh = mesh_of(&drawing.msh2("2.2", Coding::Ascii, false, false));
    assert_eq!(mesh.regions, ["unnamed"]);
    assert!(mesh.boundaries.is_empty());
    // The byte order mark of Notepad.
    let mut marked = b"\xef\xbb\xbf".to_vec();
    marked.extend(squares().msh4(Coding::Ascii));
    assert_eq!(mesh_of(&marked).elements.len(), 3);

    let geo =
        "// a drawing\nPoint(1) = {0, 0, 0};\nCurve Loop(1) = {1};\nPlane Surface(1) = {1};\n";
    let lfs = "version https://git-lfs.github.com/spec/v1\noid sha256:ab\nsize 12\n";
    let vtu = "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\">";
    for (name, content, what) in [
        ("a.geo", geo, "mesh it first: gmsh -2 a.geo -o a.msh"),
        ("a.msh", geo, "mesh it first: gmsh -2 a.geo -o a.msh"),
        (
            "c.geo",
            "Point(1) = {0, 0, 0};\nPhysical Volume(1) = {1};\n",
            "mesh it first: gmsh -3 c.geo -o c.msh",
        ),
        ("b.geo", "Merge \"b.step\";", "mesh it first: gmsh -2 b.geo"),
        (
            "a.inp",
            "*Heading\n*Node\n1, 0, 0\n",
            "an Abaqus input file",
        ),
        (
            "a.msh",
            "** Abaqus\n*NODE, NSET=all\n1, 0, 0\n",
            "an Abaqus input file",
        ),
        ("a.vtk", "# vtk DataFile Version 3.0\n", "a VTK file"),
        ("a.msh", vtu, "a VTK file"),
        (
            "a.step",
            "ISO-10303-21;\nHEADER;\n",
            "a geometry, not a mesh",
        ),
        (
            "a.msh",
            "ISO-10303-21;\nHEADER;\n",
            "a geometry, not a mesh",
        ),
        ("a.msh", "solid a\n facet normal 0 0 1\n", "an STL file"),
        ("a.stl", "\u{1}\u{2}\u{3}", "an STL file"),
        (
            "a.msh",
            lfs,
            "a Git LFS pointer, not the mesh: git lfs pull",
        ),
        ("a.msh", "<!DOCTYPE html>\n<html></html>", "an HTML page"),
        (
            "a.msh",
            "PK\u{3}\u{4}",
            "a compressed file: unpack it first",
        ),
        ("a.msh", "", "an empty file: save the mesh again"),
        ("a.msh", " \n\n", "an empty file"),
        ("a.msh", "$ Nastran\nGRID,1\n", "save it as MSH 4.1 or 2.2"),
        ("a.msh", "1 2 3\n", "does not begin with $MeshFormat"),
        (
            "a.msh",
            "$Nodes\n0\n$EndNodes\n",
            "does not begin with $MeshFormat",
        ),
        ("a.msh", "$Comments\nnothing\n$EndComments\n", "cut short"),
    ] {
        match read_named(name, content.as_bytes()) {
            Ok(_) => panic!("{content} was read"),
            Err(error) => assert!(error.contains(what), "{error}"),
        }
    }
}

#[test]
fn wrong_parts_of_a_mesh_are_errors() {
    let new = |region: u32, node: u32| {
        Mesh::new(
            vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
            vec![Element::triangle([0, 1, 2], region)],
            vec!["only".to_owned()],
            BTreeMap::from([("side".to_owned(), vec![[0, node, node]])]),
        )
    };
    assert_eq!(
        new(0, 1).map(|mesh| mesh.groups).unwrap_or_default(),
        BTreeMap::from([("only".to_owned(), vec![0])])
    );
    let error = new(1, 1).expect_err("there is no region 1");
    assert!(matches!(error, MeshError::NoSuchRegion { .. }));
    assert!(error.to_string().contains("region 1, but there are only 1"));
    let error = new(0, 3).expect_err("there is no node 3");
    assert!(matches!(error, MeshError::NoSuchBoundaryNode { .. }));
    assert!(error.to_string().contains("\"side\" names node 3"));
}

/// Files that announce more than they hold: an error at once, whatever their headers announce.
#[test]
fn hostile_files_are_errors() {
    for coding in [Coding::Little, Coding::Big] {
        let mut out = Out::new("2.2", coding);
        out.text("$Nodes\n99999999999999999999\n");
        assert!(message(&out.bytes).contains("is not a number of nodes"));
        let mut out = Out::new("2.2", coding);
        out.text("$Nodes\n4000000000000\n");
        assert!(message(&out.bytes).contains("the file ends in the middle"));
        let mut out = Out::new("2.2", coding);
        out.text("$Nodes\n0\n$EndNodes\n$Elements\n4000000000\n");
        for value in [2, i64::from(i32::MAX), 2] {
            out.int(value);
        }
        assert!(message(&out.bytes).contains("the file ends in the middle"));
        for header in [[2, 0, 2], [2, -5, 2], [2, 1, -1], [2, 1, 1 << 30]] {
            let mut out = Out::new("2.2", coding);
            out.text("$Elements\n1\n");
            header.iter().for_each(|&value| out.int(value));
            assert!(message(&out.bytes).contains("is invalid"));
        }
        for section in ["Entities", "Nodes", "Elements"] {
            for count in [1 << 40, 1 << 50, u64::MAX] {
                let mut out = Out::new("4.1", coding);
                out.text(&format!("${section}\n"));
                (0..4).for_each(|_| out.size(count));
                message(&out.bytes);
            }
        }
    }
    let mut drawing = squares();
    drawing.entities[5].groups = (1..300).collect();
    for (format, bytes) in drawing.files() {
        let error = message(&bytes);
        assert!(
            error.contains("more than 255 physical groups"),
            "{format}: {error}"
        );
    }
    // Every number of a file in turn replaced by a hostile one.
    const HOSTILE: [&str; 7] = [
        "-1",
        "1099511627776",
        "-9223372036854775808",
        "nan",
        "1e400",
        "0",
        "\u{e9}",
    ];
    let directory = tempfile::tempdir().or_panic();
    let path = directory.path().join("test.msh");
    for text in [
        squares().msh2("2.2", Coding::Ascii, true, false),
        squares().msh2("2.2", Coding::Ascii, true, true),
        squares().msh4(Coding::Ascii),
    ] {
        let text = String::from_utf8(text).unwrap_or_default();
        let words: Vec<&str> = text.split_inclusive([' ', '\n']).collect();
        for place in 0..words.len() {
            if words[place].trim().parse::<f64>().is_err() {
                continue;
            }
            // By turns; a disk is slow.
            let hostile = HOSTILE[place % HOSTILE.len()];
            let mut changed = words.clone();
            let word = words[place].replace(words[place].trim(), hostile);
            changed[place] = &word;
            // Many of them do no harm, such as the number of an element.
            std::fs::write(&path, changed.concat()).or_panic();
            let _ = read(&path, 1.0);
        }
    }

    let text =
        String::from_utf8(squares().msh2("2.2", Coding::Ascii, false, false)).unwrap_or_default();
    let with = |from: &str, to: &str| {
        assert!(text.contains(from));
        text.replacen(from, to, 1)
    };
    let error = message(with("\n4 2 1 0 \n", "\n-4 2 1 0 \n").as_bytes());
    assert!(error.contains("-4 is not the number of a node"), "{error}");
    let error = message(with("\n4 2 1 0 \n", "\n4 2 nan 0 \n").as_bytes());
    assert!(
        error.contains("node 4 has a coordinate that is not finite"),
        "{error}"
    );
    // Elements that the header does not count would be lost.
    for (count, section) in [("\n8\n", "$Nodes"), ("\n19\n", "$Elements")] {
        let less: usize = count.trim().parse().unwrap_or_default();
        let error = message(
            with(
                &format!("{section}{count}"),
                &format!("{section}\n{}\n", less - 1),
            )
            .as_bytes(),
        );
        assert!(error.contains(section), "{error}");
    }
    // Names in Latin-1 are understood.
    let mut latin: Vec<u8> = Vec::new();
    for c in with("\"left\"", "\"Stütze\"").chars() {
        latin.push(c as u32 as u8);
    }
    assert!(mesh_of(&latin).boundaries.contains_key("Stütze"));
    // Tags far apart.
    let far = with("\n6 0 1 0 \n", "\n2000000000 0 1 0 \n").replace(" 6 ", " 2000000000 ");
    measures_are(&mesh_of(far.as_bytes()), &[1.0, 1.0]);
}
