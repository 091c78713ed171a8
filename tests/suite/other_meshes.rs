//! Meshes of other programs: Abaqus input files and grids of VTK in the layout of their writers.

use crate::common::or_panic::OrPanic as _;
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::mesh::{AnyMesh, ElementKind, FaultKind, Mesh, Topology, msh, read};
use std::collections::BTreeMap;
use std::path::PathBuf;

fn at(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("tests/meshes")
        .join(name)
}

/// The result of a text under this name.
fn parsed(name: &str, text: &str, cell_data: Option<&str>) -> Result<AnyMesh, String> {
    let place = tempfile::tempdir().or_panic();
    let path = place.path().join(name);
    std::fs::write(&path, text).or_panic();
    read(&path, 1.0, cell_data).map_err(|error| error.to_string())
}

fn solid(read: Result<AnyMesh, String>) -> Mesh<3> {
    match read {
        Ok(AnyMesh::Space(mesh)) => mesh,
        other => panic!("no solid: {other:?}"),
    }
}

fn plane(read: Result<AnyMesh, String>) -> Mesh {
    match read {
        Ok(AnyMesh::Plane(mesh)) => mesh,
        other => panic!("none of the plane: {other:?}"),
    }
}

fn area<const D: usize>(mesh: &Mesh<D>, name: &str) -> f64
where
    ElementKind: Topology<D>,
{
    let facets = mesh.outer_facets(name).or_panic();
    facets.iter().map(|facet| mesh.facet_normal(facet).0).sum()
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-6 * b.abs().max(1e-3)
}

/// An assembly as Abaqus/CAE writes it: one brick of two cells twice, shifted, the second turned by a right angle about
/// z; a face set of the assembly, a surface with its internal set, a reference point.
const CAE: &str = "*Heading\n** Job name: job Model name: Model-1\n*Preprint, echo=NO\n**\n** PARTS\n**\n\
    *Part, name=Brick\n*Node\n\
          1,           0.,           0.,           0.\n\
          2,           1.,           0.,           0.\n\
          3,           2.,           0.,           0.\n\
          4,           0.,           1.,           0.\n\
          5,           1.,           1.,           0.\n\
          6,           2.,           1.,           0.\n\
          7,           0.,           0.,           1.\n\
          8,           1.,           0.,           1.\n\
          9,           2.,           0.,           1.\n\
         10,           0.,           1.,           1.\n\
         11,           1.,           1.,           1.\n\
         12,           2.,           1.,           1.\n\
    *Element, type=C3D8R\n1, 1, 2, 5, 4, 7, 8, 11, 10\n2, 2, 3, 6, 5, 8, 9, 12, 11\n\
    *Nset, nset=Set-1, generate\n  1,  12,   1\n*Elset, elset=Set-1, generate\n 1,  2,  1\n\
    *Nset, nset=Left\n  1,  4,  7, 10\n*Elset, elset=Left\n 1,\n\
    ** Section: Section-1\n*Solid Section, elset=Set-1, material=Steel\n,\n*End Part\n**\n**\n** ASSEMBLY\n**\n\
    *Assembly, name=Assembly\n**\n*Instance, name=Brick-1, part=Brick\n*End Instance\n**\n\
    *Instance, name=Brick-2, part=Brick\n          5.,           0.,           3.\n\
              5.,           0.,           3.,           5.,           0.,           4.,          90.\n\
    *End Instance\n**\n*Node\n      1,           9.,           9.,           9.\n\
    *Nset, nset=RefPoint, internal\n 1,\n*Nset, nset=Point\n 1,\n\
    *Nset, nset=Held, instance=Brick-1\n  3,  6,  9, 12\n*Elset, elset=Held, instance=Brick-1\n 2,\n\
    *Elset, elset=_Top_S2, internal, instance=Brick-1, generate\n 1,  2,  1\n\
    *Elset, elset=_Top_S6, internal, instance=Brick-2\n 1,\n\
    *Surface, type=ELEMENT, name=Top\n_Top_S2, S2\n_Top_S6, S6\n*End Assembly\n\
    *Material, name=Steel\n*Elastic\n 2.1e11, 0.3\n*Step, name=Load\n*Static\n*End Step\n";

#[test]
fn an_assembly_is_placed_by_its_instances() {
    let mesh = solid(parsed("cae.inp", CAE, None));
    assert_eq!((mesh.nodes.len(), mesh.elements.len()), (24, 4));
    assert_eq!(mesh.bodies().0, 2);
    // Left and Held are faces, not regions: sections name others.
    let groups: Vec<&str> = mesh.groups.keys().map(String::as_str).collect();
    assert_eq!(groups, ["Brick-1.Set-1", "Brick-2.Set-1"]);
    assert!(mesh.measures().iter().all(|&volume| near(volume, 2.0)));
    for (name, expected) in [
        ("Brick-1.Left", 1.0),
        ("Brick-2.Left", 1.0),
        ("Held", 1.0),
        // Two faces of the first on top, and one end of the second.
        ("Top", 3.0),
        ("Brick-2.Set-1", 10.0),
    ] {
        assert!(near(area(&mesh, name), expected), "{name}");
    }
    // Turned about the shifted z: x goes to y.
    let normal = mesh.facet_normal(&mesh.boundaries["Brick-2.Left"][0]).1;
    assert!(near(normal[1], -1.0), "{normal:?}");
    let (low, high) = mesh.bounding_box();
    assert!(near(high[0], 5.0) && near(high[1], 2.0) && near(high[2], 4.0) && near(low[0], 0.0));
    assert_eq!(mesh.faults["Point"].kind, FaultKind::NoFacet);
    let told = mesh.outer_facets("Point").map(drop);
    let told = told.map_err(|error| error.to_string());
    assert!(
        told.as_ref()
            .is_err_and(|text| text.contains("that has all corners of no outer face")),
        "{told:?}"
    );
    assert!(!mesh.boundaries.contains_key("RefPoint"));
}

/// Instances with their own meshes, as Abaqus/CAE writes independent ones, are the same bodies.
#[test]
fn instances_may_have_meshes_of_their_own() {
    let (begin, rest) = CAE.split_once("*Node\n").expect("nodes");
    let (body, rest) = rest.split_once("*End Part\n").expect("a part");
    let body = format!("*Node\n{body}");
    let independent = format!("{begin}*End Part\n{rest}")
        .replace("*End Instance\n", &format!("{body}*End Instance\n"));
    let (a, b) = (
        solid(parsed("a.inp", CAE, None)),
        solid(parsed("b.inp", &independent, None)),
    );
    assert_eq!((a.nodes, a.elements), (b.nodes, b.elements));
    assert_eq!((a.groups, a.boundaries), (b.groups, b.boundaries));
    let twice = CAE.replacen("*End Instance", "*Node\n99, 0., 0., 0.\n*End Instance", 1);
    let told = parsed("c.inp", &twice, None).err().unwrap_or_default();
    assert!(
        told.contains("nodes or elements of its own beside those of its part"),
        "{told}"
    );
}

/// Sets of a part, of the assembly and surfaces that have one name are as many things, also those of one instance.
#[test]
fn equal_names_are_not_one_thing() {
    // CAE numbers the sets of the part, which has the section, and those of the assembly, here of faces, each from 1 on.
    let one = CAE
        .replace(
            &CAE[CAE.find("*Instance, name=Brick-2").expect("it is there")
                ..CAE
                    .find("**\n*Node\n      1,           9.")
                    .expect("it is there")],
            "",
        )
        .replace(
            "*Elset, elset=_Top_S6, internal, instance=Brick-2\n 1,\n",
            "",
        )
        .replace("_Top_S6, S6\n", "");
    for (nodes, faces) in [("Set-1", "Left"), ("Left", "Set-1"), ("Left", "Left")] {
        let text = one
            .replace("nset=Held,", &format!("nset={nodes},"))
            .replace("elset=Held,", &format!("elset={nodes},"))
            .replace("name=Top", &format!("name={faces}"));
        let mesh = solid(parsed("one.inp", &text, None));
        let volumes: f64 = mesh.measures().iter().sum();
        assert!(near(volumes, 2.0));
        let groups: Vec<&str> = mesh.groups.keys().map(String::as_str).collect();
        assert_eq!(groups, ["Set-1"], "{nodes}");
        assert!(near(area(&mesh, faces), 2.0), "{nodes}: {faces}");
        assert_eq!(mesh.node_sets[nodes].len(), 4, "{nodes}");
        let of_part = format!("Brick-1.{nodes}");
        let all = if nodes == "Set-1" { 12 } else { 4 };
        assert_eq!(mesh.node_sets[&of_part].len(), all, "{nodes}");
        assert!(near(
            area(&mesh, &of_part),
            if nodes == "Set-1" { 10.0 } else { 1.0 }
        ));
        if nodes != faces {
            assert!(near(area(&mesh, nodes), 1.0), "{nodes}");
        }
    }
}

/// One body as Gmsh writes it, by its surfaces as elements and by sets of nodes, against its own format.
#[test]
fn gmsh_writes_the_same_body_as_inp() {
    let Ok(AnyMesh::Space(own)) = signorini::mesh::gmsh::read(&at("other.msh"), 1e-3) else {
        panic!("no solid");
    };
    for (name, whole) in [("other.inp", "steel"), ("other-nodes.inp", "steel")] {
        let mesh = solid(read(&at(name), 1e-3, None).map_err(|error| error.to_string()));
        assert_eq!(mesh.elements.len(), own.elements.len(), "{name}");
        let volume = |mesh: &Mesh<3>| mesh.measures().iter().sum::<f64>();
        assert!((volume(&mesh) / volume(&own) - 1.0).abs() < 1e-9, "{name}");
        assert!(mesh.groups.contains_key(whole), "{:?}", mesh.groups);
        for (there, here) in [("left", "left"), ("bottom side", "bottom_side")] {
            let ratio = area(&mesh, here) / area(&own, there);
            assert!((ratio - 1.0).abs() < 1e-9, "{name}: {here} {ratio}");
        }
    }
}

/// A flat file of the plane with sets on the lines of elements, continued lines, surfaces without a side.
#[test]
fn a_flat_file_of_the_plane() {
    let text = "** by hand\n*NODE, NSET=ALL\n1, 0.0, 0.0\n2, 1.0, 0.0\n3, 2.D0, 0.0\n4, 0.0, 1.0\n5, 1.0, 1.0\n6, 2.0, 1.0\n\
        *ELEMENT, TYPE=CPE4R,\n ELSET=SOFT\n1, 1, 2,\n 5, 4\n*Element, type=CPE3, elset=\"hard part\"\n2, 2, 3, 6\n3, 2, 6, 5\n\
        *NSET, NSET=low\n1, 2, 3\n*NSET, NSET=both\nlow, 4, 6\n*SURFACE, NAME=skin\nsoft\n*SURFACE, NAME=end, TYPE=ELEMENT\n\
        2, S2\n*SURFACE, NAME=nodes, TYPE=NODE\nlow, 1.0\n";
    let mesh = plane(parsed("flat.INP", text, None));
    assert_eq!(mesh.regions, ["SOFT", "hard part"]);
    assert_eq!(mesh.nodes[2], [2.0, 0.0]);
    for (name, expected) in [
        ("low", 2.0),
        ("nodes", 2.0),
        ("end", 1.0),
        // Not the edge to its neighbour.
        ("skin", 3.0),
        ("both", 4.0),
        ("ALL", 6.0),
    ] {
        assert!(near(area(&mesh, name), expected), "{name}");
    }
}

#[test]
fn faults_of_an_input_file_are_reported_with_their_line() {
    let flat = "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n*ELEMENT, TYPE=C3D4, ELSET=body\n1, 1, 2, 3, 4\n";
    assert!(parsed("a.inp", flat, None).is_ok());
    let cases = [
        (
            flat.replace("C3D4", "C3D10"),
            "a.inp, line 7: an element of this type has 10 nodes, but 4 are given",
        ),
        (
            flat.replace("C3D4", "C3D10")
                .replace("2, 3, 4\n", "2, 3, 4, 0, 0, 0, 0, 0, 0\n"),
            "a.inp, line 7: this element of second order lacks some midside nodes",
        ),
        (
            flat.replace("C3D4", "C3D15V"),
            "a.inp, line 6: elements of type C3D15V are not supported: use CPE3",
        ),
        (
            flat.replace("C3D4", "CGAX3"),
            "line 6: CGAX3 is an axisymmetric element with twist",
        ),
        (
            flat.replace("C3D4", "SPRINGA"),
            "line 6: elements of type SPRINGA are not supported: use CPE3",
        ),
        (
            flat.replace(", TYPE=C3D4", ""),
            "line 6: *ELEMENT needs TYPE=",
        ),
        (
            flat.replace("2, 3, 4", "2, 3"),
            "line 7: an element of this type has 4 nodes, but 3 are given",
        ),
        (
            flat.replace("2, 3, 4", "2, 3, 9"),
            "line 7: an element names node 9, which does not exist",
        ),
        (
            flat.replace("1, 0, 1, 0", "1, 0, l, 0")
                .replace("3, 0, 1, 0", "3, 0, l, 0"),
            "line 4: \"l\" is not a number",
        ),
        (
            flat.replace("2, 1, 0, 0", "1, 1, 0, 0"),
            "line 3: node 1 is listed twice",
        ),
        (
            flat.to_owned() + "*NSET, NSET=a\n77\n",
            "line 9: a set names node 77, which does not exist",
        ),
        (
            flat.to_owned() + "*ELSET, ELSET=a\nnone\n",
            "line 9: there is no element set \"NONE\"",
        ),
        (
            flat.to_owned() + "*NSET, NSET=a, GENRATE\n1, 4, 1\n",
            "line 8: *NSET, GENRATE: this option is not understood",
        ),
        (
            flat.to_owned() + "*NSET, NSET=a\na\n",
            "line 9: set \"A\" contains itself",
        ),
        (
            flat.to_owned() + "*SURFACE, NAME=a\nbody, S5\n",
            "line 9: surface \"a\": S5 is not a face of this element",
        ),
        (
            flat.replace("2, 3, 4", "2, 3, 4, 5"),
            "line 7: an element of this type has 4 nodes, but 5 are given",
        ),
        (
            flat.replace("2, 3, 4", "2, 3,\n4, 5"),
            "line 8: an element of this type has 4 nodes, but 5 are given",
        ),
        (
            flat.to_owned() + "*INCLUDE, INPUT=b.inp\n",
            "a.inp, line 8: *INCLUDE: cannot read ",
        ),
        (
            flat.to_owned() + "*ELEMENT, TYPE=C3D4,\nINPUT=\n",
            "a.inp, line 8: *ELEMENT: INPUT= must name a file",
        ),
        (
            flat.to_owned() + "*INCLUDE, INPUT=a.inp\n",
            "does one include itself?",
        ),
        (
            flat.to_owned() + "*NGEN\n1, 9, 1\n",
            "line 8: *NGEN: nodes and elements must be listed one by one",
        ),
        (
            CAE.replace("part=Brick\n          5.", "part=Prick\n          5."),
            "there is no part \"PRICK\"",
        ),
        (
            CAE.replace("5.,           0.,           4.,          90.", "90."),
            "an instance takes one line with its shift",
        ),
        (
            "*NODE\n1, 0, 0\n".to_owned(),
            "a.inp: it contains no elements of a body: write CPE3",
        ),
        (
            "solid cube\n".to_owned(),
            "a.inp: there is no keyword in it",
        ),
        (
            flat.replace("C3D4", "S4"),
            "a.inp: the mesh is not plane: its z coordinates differ; a solid body needs volume elements",
        ),
    ];
    for (text, expected) in cases {
        let told = parsed("a.inp", &text, None).err().unwrap_or_default();
        assert!(told.contains(expected), "{expected}\n{told}");
    }
}

/// Nodes, elements and sets in separate files, named by `INPUT=`, equal those of one file.
#[test]
fn data_may_be_in_other_files() {
    let place = tempfile::tempdir().or_panic();
    let file = |name: &str, text: &str| {
        let path = place.path().join(name);
        let folder = path.parent().unwrap_or(place.path());
        std::fs::create_dir_all(folder)
            .and_then(|()| std::fs::write(&path, text))
            .or_panic();
        path
    };
    let nodes = "1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n5, 1, 1, 1\n";
    let whole = format!(
        "*NODE\n{nodes}*ELEMENT, TYPE=C3D4, ELSET=body\n1, 1, 2, 3, 4\n2, 2, 3, 4, 5\n*NSET, NSET=low\n1, 2, 3\n"
    );
    let expected = solid(parsed("whole.inp", &whole, None));
    assert_eq!(expected.elements.len(), 2);
    let main = file(
        "main.inp",
        "*HEADING\nparts\n*NODE, INPUT=mesh/nodes.txt\n*Include,\n input=\"mesh/rest.inp\"\n\
         *AMPLITUDE, NAME=a, INPUT=none.txt\n*NSET, NSET=low, INPUT=low.txt\n**\n",
    );
    file("mesh/nodes.txt", nodes);
    file(
        "mesh/rest.inp",
        "** elements\n*ELEMENT, TYPE=C3D4, ELSET=body, INPUT=mesh/second.txt\n1, 1, 2, 3, 4\n",
    );
    // No newline at the end.
    file("mesh/second.txt", "2, 2, 3, 4, 5");
    file("low.txt", "1, 2,\n3\n");
    let told = |read: Result<AnyMesh, signorini::mesh::FileError>| {
        read.map(drop)
            .err()
            .map_or(String::new(), |e| e.to_string())
    };
    let mesh = solid(read(&main, 1.0, None).map_err(|error| error.to_string()));
    assert_eq!(mesh.nodes, expected.nodes);
    let volume = |mesh: &Mesh<3>| mesh.measures().iter().sum::<f64>();
    assert_eq!(mesh.elements.len(), 2);
    assert!(near(volume(&mesh), volume(&expected)));
    assert_eq!(mesh.boundaries, expected.boundaries);
    // A fault is reported with its file, and the line there.
    for (name, text, expected) in [
        (
            "low.txt",
            "1, 2\n9\n",
            "low.txt, line 2: a set names node 9",
        ),
        (
            "mesh/second.txt",
            "2, 2, 3, 4, 5, 1\n",
            "second.txt, line 1: an element of this type has 4 nodes, but 5 are given",
        ),
        (
            "mesh/rest.inp",
            "*ELEMENT, TYPE=C3D4, ELSET=body\n1, 1, 2, 3, 4\n2, 2, 3, 4, 7\n",
            "rest.inp, line 3: an element names node 7",
        ),
        (
            "mesh/rest.inp",
            "*ELEMENT, TYPE=C3D4, ELSET=body, INPUT=gone.txt\n",
            "rest.inp, line 1: *ELEMENT: cannot read ",
        ),
        (
            "main.inp",
            "*NODE, INPUT=mesh/nodes.txt\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n*NSET, NSET=a\n8\n",
            "main.inp, line 5: a set names node 8",
        ),
        (
            "main.inp",
            "*INCLUDE, INPUT=mesh/nodes.txt\n*NODE\n",
            "main.inp: it contains no elements",
        ),
    ] {
        let path = place.path().join(name);
        let before = std::fs::read_to_string(&path).or_panic();
        file(name, text);
        let told = told(read(&main, 1.0, None));
        assert!(told.contains(expected), "{expected}\n{told}");
        file(name, &before);
    }
}

/// The grid that meshio and VTK write of one body: inline and appended, raw, base64, compressed, in both byte orders.
#[test]
fn grids_of_vtk_in_every_coding() {
    let Ok(AnyMesh::Space(own)) = signorini::mesh::gmsh::read(&at("other.msh"), 1.0) else {
        panic!("no solid");
    };
    for name in [
        "other-zlib.vtu",
        "other-ascii.vtu",
        "other-raw.vtu",
        "other-appended.vtu",
        "other-big.vtu",
    ] {
        let mesh = solid(read(&at(name), 1.0, None).map_err(|error| error.to_string()));
        assert_eq!(mesh.nodes.len(), own.nodes.len(), "{name}");
        assert_eq!(mesh.elements.len(), own.elements.len(), "{name}");
        let volume = |mesh: &Mesh<3>| mesh.measures().iter().sum::<f64>();
        assert!((volume(&mesh) / volume(&own) - 1.0).abs() < 1e-6, "{name}");
        for (there, here) in [("left", "1"), ("bottom side", "2")] {
            let ratio = area(&mesh, here) / area(&own, there);
            assert!((ratio - 1.0).abs() < 1e-6, "{name}: {here} {ratio}");
        }
    }
}

/// Boundaries with their facets in order.
fn sorted<F: Ord>(mut boundaries: BTreeMap<String, Vec<F>>) -> BTreeMap<String, Vec<F>> {
    boundaries.values_mut().for_each(|facets| facets.sort());
    boundaries
}

/// A file of Gmsh written from a mesh is read as the same mesh.
#[test]
fn files_written_for_gmsh_are_read_back() {
    let solids = join(
        block(
            [0.0; 3],
            [2.0, 1.0, 1.0],
            [3, 2, 2],
            SolidShape::Wedge,
            "low",
            "low-",
        ),
        block(
            [0.0, 0.0, 1.0],
            [1.0; 3],
            [2, 2, 1],
            SolidShape::Hexahedron,
            "up",
            "up-",
        ),
    );
    let again = solid(parsed("a.msh", &msh(&AnyMesh::Space(solids.clone())), None));
    assert_eq!(again.nodes, solids.nodes);
    assert_eq!(again.elements, solids.elements);
    assert_eq!(again.groups, solids.groups);
    assert_eq!(sorted(again.boundaries), sorted(solids.boundaries));
    let flat = rectangle(
        [0.0; 2],
        [1.0, 1.0],
        [3, 2],
        CellShape::Triangle,
        "body",
        "",
    );
    let again = plane(parsed("a.msh", &msh(&AnyMesh::Plane(flat.clone())), None));
    assert_eq!(again.nodes, flat.nodes);
    assert_eq!(again.groups, flat.groups);
    assert_eq!(sorted(again.boundaries), sorted(flat.boundaries));
    // Elements in several groups.
    let cae = parsed(
        "cae.inp",
        &CAE.replace("elset=Left\n", "elset=Half\n"),
        None,
    );
    let mesh = solid(
        cae.as_ref()
            .map_err(Clone::clone)
            .and_then(|mesh| parsed("b.msh", &msh(mesh), None)),
    );
    let names: Vec<&str> = mesh.groups.keys().map(String::as_str).collect();
    assert!(
        names.contains(&"Brick-1.Set-1") && names.contains(&"Brick-1.Half"),
        "{names:?}"
    );
    let half: f64 = (mesh.groups["Brick-1.Half"].iter())
        .map(|&region| mesh.measures()[region as usize])
        .sum();
    assert!(near(half, 1.0), "{half}");
}
