//! Gmsh files as they come: elements in several groups, reversed and inner curves, older formats, other files.

mod common;

use signorini::case::Case;
use signorini::mesh::gmsh::read;
use signorini::mesh::structured::{CellShape, join, rectangle};
use signorini::mesh::{AnyMesh, BoundaryError, Element, FaultKind, Mesh, MeshError};
use signorini::model::Built;
use std::collections::BTreeMap;
use std::path::Path;

/// Numbers as text, or as bytes of either order.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Coding {
    Ascii,
    Little,
    Big,
}

const CODINGS: [Coding; 3] = [Coding::Ascii, Coding::Little, Coding::Big];

struct Out {
    coding: Coding,
    bytes: Vec<u8>,
}

impl Out {
    fn new(version: &str, coding: Coding) -> Self {
        let mut out = Self {
            coding,
            bytes: Vec::new(),
        };
        let binary = u8::from(coding != Coding::Ascii);
        out.text(&format!("$MeshFormat\n{version} {binary} 8\n"));
        if binary == 1 {
            out.int(1);
            out.end();
        }
        out.text("$EndMeshFormat\n");
        out
    }

    fn text(&mut self, text: &str) {
        self.bytes.extend(text.bytes());
    }

    fn number<const N: usize>(&mut self, text: String, little: [u8; N]) {
        match self.coding {
            Coding::Ascii => self.text(&(text + " ")),
            Coding::Little => self.bytes.extend(little),
            Coding::Big => self.bytes.extend(little.iter().rev()),
        }
    }

    fn int(&mut self, value: i64) {
        self.number(value.to_string(), (value as i32).to_le_bytes());
    }

    fn size(&mut self, value: u64) {
        self.number(value.to_string(), value.to_le_bytes());
    }

    fn float(&mut self, value: f64) {
        self.number(value.to_string(), value.to_le_bytes());
    }

    fn end(&mut self) {
        self.text("\n");
    }
}

/// A curve or surface with its physical groups and its elements.
#[derive(Clone)]
struct Entity {
    dim: i64,
    groups: Vec<i64>,
    elements: Vec<Vec<i64>>,
}

fn curve(groups: &[i64], edges: &[[i64; 2]]) -> Entity {
    Entity {
        dim: 1,
        groups: groups.to_vec(),
        elements: edges.iter().map(|edge| edge.to_vec()).collect(),
    }
}

fn surface(groups: &[i64], elements: &[&[i64]]) -> Entity {
    Entity {
        dim: 2,
        groups: groups.to_vec(),
        elements: elements.iter().map(|nodes| nodes.to_vec()).collect(),
    }
}

/// A drawing: nodes 1, 2, … and entities, as Gmsh keeps them.
#[derive(Clone)]
struct Drawing {
    names: Vec<(i64, i64, &'static str)>,
    nodes: Vec<[f64; 2]>,
    entities: Vec<Entity>,
}

/// Two unit squares side by side, the left one of triangles; nodes 1 to 6 around, and a line apart.
///
/// Surfaces: steel, rubber, and "all" of both. Curves: "bottom" turned around, "middle" between the squares, "every"
/// of these, and "line", which is no edge.
fn squares() -> Drawing {
    Drawing {
        names: vec![
            (1, 11, "bottom"),
            (1, 12, "left"),
            (1, 13, "top"),
            (1, 14, "middle"),
            (1, 15, "every"),
            (1, 16, "line"),
            (2, 1, "steel"),
            (2, 2, "rubber"),
            (2, 3, "all"),
        ],
        nodes: vec![
            [0.0, 0.0],
            [1.0, 0.0],
            [2.0, 0.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [0.0, 1.0],
            [5.0, 5.0],
            [6.0, 5.0],
        ],
        entities: vec![
            curve(&[-11, 15], &[[1, 2], [2, 3]]),
            curve(&[12, 15], &[[6, 1]]),
            curve(&[13, -15], &[[4, 5], [5, 6]]),
            curve(&[14, 15], &[[2, 5]]),
            curve(&[16], &[[7, 8]]),
            surface(&[1, 3], &[&[1, 2, 5], &[1, 5, 6]]),
            surface(&[-2, 3], &[&[2, 3, 4, 5]]),
        ],
    }
}

impl Drawing {
    fn names(&self, out: &mut Out) {
        let mut text = format!("$PhysicalNames\n{}\n", self.names.len());
        for (dim, tag, name) in &self.names {
            text += &format!("{dim} {tag} \"{name}\"\n");
        }
        out.text(&(text + "$EndPhysicalNames\n"));
    }

    /// As Gmsh writes it: an element stands once for each of its groups. It writes no signs, but turns elements
    /// around; other programs write the signs.
    fn msh2(&self, version: &str, coding: Coding, signs: bool, parametric: bool) -> Vec<u8> {
        let mut out = Out::new(version, coding);
        self.names(&mut out);
        let section = if parametric {
            "ParametricNodes"
        } else {
            "Nodes"
        };
        out.text(&format!("${section}\n{}\n", self.nodes.len()));
        for (number, x) in (1..).zip(&self.nodes) {
            out.int(number);
            out.float(x[0]);
            out.float(x[1]);
            out.float(0.0);
            if parametric {
                // On points, curves, surfaces and in volumes by turns.
                let dim = number % 4;
                out.int(dim);
                out.int(7);
                for parameter in 0..[0, 1, 2, 0][dim as usize] {
                    out.float(0.25 + f64::from(parameter));
                }
            }
            if coding == Coding::Ascii {
                out.end();
            }
        }
        let mut rows = Vec::new();
        for (entity, e) in (1..).zip(&self.entities) {
            for nodes in &e.elements {
                let none = [0];
                for &group in if e.groups.is_empty() {
                    &none[..]
                } else {
                    &e.groups
                } {
                    let mut nodes = nodes.clone();
                    if group < 0 {
                        nodes.reverse();
                    }
                    rows.push((entity, if signs { group } else { group.abs() }, nodes));
                }
            }
        }
        out.text(&format!("\n$End{section}\n$Elements\n{}\n", rows.len()));
        for (number, (entity, group, nodes)) in (1..).zip(rows) {
            let kind = nodes.len() as i64 - 1;
            let mut row = vec![number, kind, 2];
            if coding != Coding::Ascii {
                row = vec![kind, 1, 2, number];
            }
            row.extend([group, entity]);
            row.extend(nodes);
            row.iter().for_each(|&value| out.int(value));
            if coding == Coding::Ascii {
                out.end();
            }
        }
        out.text("\n$EndElements\n");
        out.bytes
    }

    fn msh4(&self, coding: Coding) -> Vec<u8> {
        let mut out = Out::new("4.1", coding);
        self.names(&mut out);
        out.text("$Entities\n");
        for dim in 0..4 {
            out.size(self.entities.iter().filter(|e| e.dim == dim).count() as u64);
        }
        for (tag, e) in (1..).zip(&self.entities) {
            out.int(tag);
            (0..6).for_each(|_| out.float(0.0));
            out.size(e.groups.len() as u64);
            e.groups.iter().for_each(|&group| out.int(group));
            out.size(0);
        }
        out.text("\n$EndEntities\n$Nodes\n");
        let n = self.nodes.len() as u64;
        [1, n, 1, n].iter().for_each(|&v| out.size(v));
        [2, 1, 0].iter().for_each(|&v| out.int(v));
        out.size(n);
        (1..=n).for_each(|tag| out.size(tag));
        for x in &self.nodes {
            [x[0], x[1], 0.0].iter().for_each(|&v| out.float(v));
        }
        out.text("\n$EndNodes\n$Elements\n");
        [self.entities.len() as u64, 1, 1, 1]
            .iter()
            .for_each(|&v| out.size(v));
        for (tag, e) in (1..).zip(&self.entities) {
            let kind = e.elements[0].len() as i64 - 1;
            [e.dim, tag, kind].iter().for_each(|&v| out.int(v));
            out.size(e.elements.len() as u64);
            for nodes in &e.elements {
                out.size(1);
                nodes.iter().for_each(|&node| out.size(node as u64));
            }
        }
        out.text("\n$EndElements\n");
        out.bytes
    }

    /// The file in every format there is.
    fn files(&self) -> Vec<(String, Vec<u8>)> {
        let mut files = Vec::new();
        for coding in CODINGS {
            files.push((format!("4.1 {coding:?}"), self.msh4(coding)));
            for version in ["2", "2.0", "2.1", "2.2"] {
                for (signs, parametric) in [(false, false), (true, false), (false, true)] {
                    files.push((
                        format!("{version} {coding:?}, signs {signs}, parametric {parametric}"),
                        self.msh2(version, coding, signs, parametric),
                    ));
                }
            }
        }
        files
    }
}

/// Reads a file of this name and content.
fn read_named(name: &str, bytes: &[u8]) -> Result<Mesh, String> {
    let directory = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    let path = directory.path().join(name);
    std::fs::write(&path, bytes).unwrap_or_else(|error| panic!("{error}"));
    match read(&path, 1.0) {
        Ok(AnyMesh::Plane(mesh)) => Ok(mesh),
        Ok(AnyMesh::Space(_)) => panic!("{name} is of the plane"),
        Err(error) => {
            let text = error.to_string();
            assert!(text.contains(name), "{text}");
            Err(text)
        }
    }
}

#[track_caller]
fn mesh_of(bytes: &[u8]) -> Mesh {
    read_named("test.msh", bytes).unwrap_or_else(|error| panic!("{error}"))
}

#[track_caller]
fn message(bytes: &[u8]) -> String {
    match read_named("test.msh", bytes) {
        Ok(_) => panic!("it was read"),
        Err(error) => error,
    }
}

/// Builds a case about the file `test.msh`.
fn case(bytes: &[u8], text: &str) -> Result<Built, String> {
    let directory = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    std::fs::write(directory.path().join("test.msh"), bytes)
        .unwrap_or_else(|error| panic!("{error}"));
    let case = Case::parse(&directory.path().join("case.toml"), text.to_owned(), &[])
        .map_err(|error| error.to_string())?;
    let made = case.build().map_err(|error| error.to_string())?;
    Ok(made.plane().expect("an elastic case in the plane"))
}

#[track_caller]
fn refused(bytes: &[u8], text: &str) -> String {
    match case(bytes, text) {
        Ok(_) => panic!("the case was accepted"),
        Err(error) => error,
    }
}

#[track_caller]
fn total_load(bytes: &[u8], text: &str) -> [f64; 2] {
    let built = case(bytes, text).unwrap_or_else(|error| panic!("{error}"));
    let step = built.step(0).unwrap_or_else(|error| panic!("{error}"));
    step.total_load
}

#[track_caller]
fn near(a: f64, b: f64) {
    assert!((a - b).abs() <= 1e-12 * a.abs().max(b.abs()), "{a} {b}");
}

const HELD: &str = "[mesh]\nfile = \"test.msh\"\n[[support]]\nboundary = \"left\"\nx = 0\ny = 0\n";

fn material(region: &str, density: f64) -> String {
    format!(
        "[[material]]\nregion = \"{region}\"\nyoung = 1e6\npoisson = 0.3\ndensity = {density}\n"
    )
}

#[test]
fn an_element_in_two_groups_stands_once_in_every_format() {
    for (format, bytes) in squares().files() {
        let mesh = mesh_of(&bytes);
        assert_eq!(mesh.elements.len(), 3, "{format}");
        assert_eq!(mesh.nodes.len(), 6, "{format}");
        assert_eq!(mesh.regions, ["steel & all", "rubber & all"], "{format}");
        assert_eq!(mesh.measures(), [1.0, 1.0], "{format}");
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
        assert_eq!(mesh.measures(), [0.5, 0.5, 1.0], "{format}");
        assert_eq!(mesh.groups["rubber"], [1, 2], "{format}");
        assert_eq!(mesh.faults["middle"].kind, FaultKind::Inside);
        assert!(mesh.outer_facets("left").is_ok(), "{format}");
    }
    // A triangle and a quadrilateral with three nodes in common are different elements.
    let mut drawing = squares();
    drawing.entities = vec![
        surface(&[1], &[&[2, 3, 4, 5]]),
        surface(&[3], &[&[2, 3, 4]]),
    ];
    assert_eq!(mesh_of(&drawing.msh4(Coding::Ascii)).elements.len(), 2);
    // A group may be called like the region of two others; and it keeps its name.
    let mut drawing = squares();
    drawing.names[8] = (2, 3, "steel & rubber");
    drawing.entities = vec![
        surface(&[1, 2], &[&[1, 2, 5]]),
        surface(&[3], &[&[2, 3, 4, 5]]),
    ];
    let mesh = mesh_of(&drawing.msh4(Coding::Ascii));
    assert_eq!(mesh.measures(), [0.5, 1.0]);
    assert_eq!(mesh.groups["steel & rubber"], [1]);
}

/// Curves between elements and apart from them do no harm where the case does not name them.
#[test]
fn a_2_1_file_with_inner_and_reversed_curves_is_solved() {
    let directory = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    let path = directory.path().join("squares.msh");
    for (signs, coding) in [(false, Coding::Ascii), (true, Coding::Big)] {
        let bytes = squares().msh2("2.1", coding, signs, false);
        std::fs::write(&path, bytes).unwrap_or_else(|error| panic!("{error}"));
        let solved = common::solve_case(
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
    assert_eq!(middle, [[1, 4]]);
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
    let build = case(&bytes, &format!("{start}{}", support("middle")))
        .unwrap_or_else(|error| panic!("{error}"));
    let elastic = &build.elastic;
    let mut held: Vec<u32> = elastic.held.iter().map(|held| held.0).collect();
    held.sort_unstable();
    assert_eq!(held, [1, 1, 4, 4]);
    let build = case(
        &bytes,
        &format!("{start}[[support]]\nboundary = \"middle\"\nsymmetry = true\n[[support]]\npoint = [0, 0]\ny = 0\n"),
    )
    .unwrap_or_else(|error| panic!("{error}"));
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
    // The worse of two faults is told, in whichever order they stand.
    for curves in [[[2, 5], [7, 8]], [[7, 8], [5, 2]]] {
        let mut drawing = squares();
        drawing.entities.insert(0, curve(&[14], &curves));
        let mesh = mesh_of(&drawing.msh4(Coding::Ascii));
        assert_eq!(mesh.faults["middle"].kind, FaultKind::Stray);
        assert_eq!(mesh.faults["middle"].ends, [[5.0, 5.0], [6.0, 5.0]]);
        assert_eq!(mesh.boundaries["middle"], [[1, 4]]);
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

#[test]
fn a_mesh_without_physical_curves_says_how_to_add_them() {
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
    // One part without curves beside one that has them.
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
fn other_versions_and_other_files_say_what_to_do() {
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
    // What MSH 2 makes of a drawing with Mesh.SaveAll = 1, and a drawing without any groups.
    let mut drawing = squares();
    drawing.entities.iter_mut().for_each(|e| e.groups.clear());
    let error = message(&drawing.msh2("2.2", Coding::Ascii, false, false));
    assert!(error.contains("save it with Mesh.SaveAll = 0"), "{error}");
    drawing.names.clear();
    let mesh = mesh_of(&drawing.msh2("2.2", Coding::Ascii, false, false));
    assert_eq!(mesh.regions, ["unnamed"]);
    assert!(mesh.boundaries.is_empty());
    // What Notepad puts in front of a text.
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
            BTreeMap::from([("side".to_owned(), vec![[0, node]])]),
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

/// Files that claim what they do not hold: an error at once, whatever stands in their headers.
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
            assert!(message(&out.bytes).contains("makes no sense"));
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
    let directory = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
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
            std::fs::write(&path, changed.concat()).unwrap_or_else(|error| panic!("{error}"));
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
    assert_eq!(mesh_of(far.as_bytes()).measures(), [1.0, 1.0]);
}

#[cfg(feature = "cli")]
#[test]
fn check_lists_groups_and_inner_boundaries() {
    let directory = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    let write = |name: &str, content: &[u8]| {
        std::fs::write(directory.path().join(name), content).unwrap_or_else(|e| panic!("{e}"));
    };
    write("test.msh", &squares().msh4(Coding::Ascii));
    write(
        "case.toml",
        format!("{HELD}{}", material("all", 1.0)).as_bytes(),
    );
    let output = std::process::Command::new(Path::new(env!("CARGO_BIN_EXE_signorini")))
        .arg("check")
        .arg(directory.path().join("case.toml"))
        .output()
        .unwrap_or_else(|error| panic!("{error}"));
    let text = String::from_utf8_lossy(&output.stdout);
    for line in [
        "region        \"steel & all\": area 1.0000e0 m²",
        "group         \"all\": \"steel & all\", \"rubber & all\"",
        "boundary      \"middle\": 1 edges, 1.0000e0 m; not for contact and traction: its edge from",
        "boundary      \"bottom\": 2 edges, 2.0000e0 m\n",
        "boundary      \"line\": 0 edges, 0.0000e0 m; not to be used: its edge from",
    ] {
        assert!(text.contains(line), "{line}\n{text}");
    }
}
