use super::*;
use crate::mesh::structured::{SolidShape, block};
use crate::model::{Definition, Support};

const MESH: &str = "[mesh.rectangle]\nsize = [1, 1]\ncells = [1, 1]\n";

/// Each kind that may occur several times, once.
const ONE_OF_EACH: &str = "\
    [[material]]\nyoung = 1\npoisson = 0\n\
    [[support]]\nboundary = \"left\"\nx = 0\n\
    [[foundation]]\nboundary = \"bottom\"\nstiffness = { normal = 1 }\n\
    [[traction]]\nboundary = \"top\"\ny = 1\n\
    [[body_force]]\nx = 1\n\
    [[force]]\nnodes = \"set\"\nx = 1\n\
    [[temperature]]\nvalue = 1\n\
    [[contact]]\nboundary = \"bottom\"\nagainst = \"other\"\n\
    [[tie]]\nboundary = \"right\"\nagainst = \"next\"\n\
    [[equal]]\nsets = \"set\"\n\
    [[spring]]\npoint = [0, 0]\nstiffness = 1\ndirection = [0, 1]\n\
    [[preload]]\nboundary = \"cut\"\nforce = 1\n\
    [[coupling]]\nboundary = \"right\"\npoint = [1, 0]\n\
    [[cyclic]]\nlow = \"left\"\nhigh = \"right\"\naxis = { point = [0, 0] }\nsectors = 12\n\
    [[equation]]\nterms = [{ point = [0, 0], x = 1 }]\n";

/// The keys of these kinds: the keys of a model without those of tables that appear once.
fn lists() -> Vec<&'static str> {
    let all = text::OF_BODIES.iter().copied();
    all.filter(|key| !["analysis", "steps"].contains(key))
        .collect()
}

fn refusal(text: &str) -> String {
    match Case::parse(Path::new("case.toml"), text.to_owned(), &[]) {
        Ok(_) => panic!("accepted: {text}"),
        Err(error) => error.to_string(),
    }
}

/// A text after reading and writing.
fn written<const D: usize>(text: &str) -> String {
    let read: Result<Definition<D>, _> = text::read(text);
    let mut document = toml_edit::DocumentMut::new();
    let written = read.map(|definition| text::write(&definition, &mut document));
    match written {
        Ok(Ok(())) => document.to_string(),
        Ok(Err(error)) => panic!("{error}"),
        Err(error) => panic!("{error}"),
    }
}

/// Every key of every table that is read is written, with its value in the text.
#[test]
fn entries_read_are_written() {
    let plane = r#"
[units]
length = "mm"
force = "N"
[analysis]
plane = "plane_stress"
geometry = "large"
thickness = 2.0
gravity = [0.0, -9.81]
rotation = { point = [1.0, 2.0], speed = 3e9 }
[[material]]
region = ["a", "b"]
young = 2.1e11
poisson = 0.3
density = 7.8e-9
expansion = 1.2e-5
incompressible = true
law = "neo-hooke"
[[material]]
region = "c"
young = 1.0
poisson = 0.0
incompressible = false
incompatible_modes = true
[[support]]
name = "clamp"
boundary = ["left", "right"]
x = 0.1
y = "2e-3 * x"
factors = [0.5, 1.0]
[[support]]
nodes = "set"
radial = 0.0
hoop = 1.0
axis = { point = [1.0, 2.0] }
[[support]]
point = [0.5, 0.25]
x = 0.0
directions = [[0.0, 1.0], [-2.0, 0.0]]
[[support]]
boundary = "middle"
symmetry = true
[[support]]
boundary = "turned"
rotate = { point = [1.0, 2.0], angle = 90.0 }
[[foundation]]
name = "soil"
boundary = "bottom"
stiffness = { normal = "1e7 * x", tangential = 1e6 }
[[traction]]
name = "push"
boundary = "top"
x = 1.0
y = "x"
pressure = [1.0, 2e-7, 3.0]
factors = [1.0, 2.0]
[[traction]]
boundary = "top"
radial = 1.0
hoop = 2.0
torque = 3.0
force = [4.0, 5.0]
axis = { point = [0.0, 0.0] }
[[body_force]]
name = "weight"
region = "a"
x = 1.0
y = 2.0
factors = [0.0, 1.0]
[[force]]
name = "pull"
nodes = ["one", "two"]
x = 1.0
[[force]]
point = [1.0, 1.0]
y = 2.0
factors = [0.0, 1.0]
[[force]]
boundary = "top"
y = 1.0
[[temperature]]
name = "warm"
region = "b"
value = 80.0
factors = [0.0, 1.0]
[[contact]]
name = "joint"
boundary = "bottom"
against = "other"
friction = { coulomb = 0.3 }
overlap = "interference"
stiffness = { normal = 1e12, tangential = "1e11 * x" }
adjust = 0.1
offset = -0.2
edge_angle = 40.0
search_distance = 2.0
[[contact]]
nodes = "set"
obstacle = { half_plane = { point = [0.0, 1.0], normal = [0.0, 2.0] } }
friction = { tresca = 5.0 }
gap = 0.01
motion = { shift = [0.0, -0.1], rotate = { point = [1.0, 2.0], angle = 5.0 }, factors = [0.0, 1.0] }
[[contact]]
boundary = "side"
obstacle = { circle = { center = [0.0, 1.0], radius = 3.0 } }
interference = 0.02
[[tie]]
name = "weld"
boundary = "here"
against = ["there", "beyond"]
adjust = 0.5
edge_angle = 60.0
[[equal]]
name = "lid"
sets = ["p", "q"]
directions = ["y"]
[[equal]]
sets = "p"
[steps]
factors = [0.5, 1.0]
"#;
    let space = r#"
[analysis]
gravity = [0.0, 0.0, -9.81]
rotation = { axis = [0.0, 0.0, 1.0], speed = 3.0 }
[[support]]
boundary = "left"
z = 0.0
axial = 1.0
axis = { point = [1.0, 2.0, 3.0], direction = [0.0, 0.0, 1.0] }
[[traction]]
boundary = "top"
z = 1.0
axial = 2.0
axis = { point = [1.0, 2.0, 3.0], direction = [0.0, 0.0, 1.0] }
[[body_force]]
z = 1.0
[[force]]
point = [1.0, 2.0, 3.0]
z = 1.0
[[contact]]
boundary = "a"
obstacle = { half_space = { point = [0.0, 1.0, 2.0], normal = [0.0, 2.0, 0.0] } }
[[contact]]
boundary = "b"
obstacle = { sphere = { center = [0.0, 1.0, 2.0], radius = 3.0 } }
[[contact]]
boundary = "c"
obstacle = { cylinder = { point = [0.0, 1.0, 2.0], axis = [0.0, 2.0, 0.0], radius = 3.0 } }
[[equal]]
sets = "p"
directions = ["x", "z"]
"#;
    let tables = |text: &str| toml::from_str::<toml::Table>(text).expect("TOML");
    for (text, written) in [(plane, written::<2>(plane)), (space, written::<3>(space))] {
        assert_eq!(tables(&written), tables(text), "{written}");
    }
    assert!(written::<2>(plane).contains("young = 2.1e11\n"));
}

/// Who states a function in a program has no text of it.
#[test]
fn a_function_of_a_program_is_not_written() {
    let support = Support::<2>::on("left").x(|x: [f64; 2]| x[0]);
    let definition = Definition {
        supports: vec![support],
        ..Default::default()
    };
    let error = text::write(&definition, &mut toml_edit::DocumentMut::new()).expect_err("no text");
    assert!(
        error
            .to_string()
            .contains("cannot be written as an expression")
    );
}

/// A model would accept a kind without checks if the kind had a key but no entry in `parts`. Nobody would find a kind without
/// documentation or without a method in Python.
#[test]
fn every_kind_is_a_part_and_documented() {
    let definition: Definition = match text::read(ONE_OF_EACH) {
        Ok(definition) => definition,
        Err(error) => panic!("{error}"),
    };
    let stated: Vec<&str> = (definition.parts())
        .map(|(number, part)| {
            assert_eq!(number, 0);
            part.facts().kind.words()[0]
        })
        .collect();
    assert_eq!(stated, lists());
    let docs = include_str!("../../docs/case-file.md");
    let decks = include_str!("../../docs/decks.md");
    let python = include_str!("../../python/signorini/_model.py");
    for key in stated {
        // No keyword of a deck states a stiffness per area.
        assert_eq!(
            decks.contains(&format!("`[[{key}]]`")),
            key != "foundation",
            "{key}"
        );
        let is_heading =
            |line: &str| line.starts_with("## ") && line.contains(&format!("`[[{key}]]`"));
        assert!(docs.lines().any(is_heading), "no section about {key}");
        assert!(
            python.contains(&format!("    def {key}(\n"))
                || python.contains(&format!("    def {key}(self")),
            "{key}"
        );
    }
}

#[test]
fn a_case_of_matrices_has_no_table_of_a_model() {
    const MATRICES: &str = "[algebraic]\nstiffness = \"K\"\nload = \"f\"\nnormal = \"N\"\ntangential = \"T\"\ngap = \"d\"\n\
                            slip_bound = \"g\"\n";
    for key in text::OF_BODIES.iter() {
        for table in [format!("[{key}]"), format!("[[{key}]]")] {
            let said = refusal(&format!("{MATRICES}{table}\n"));
            let expected = format!("line 8: [{key}] has no meaning in an [algebraic] case");
            assert!(said.contains(&expected), "{said}");
        }
    }
    let said = refusal(&format!("analysis.thickness = -3\n{MATRICES}"));
    assert!(said.contains("line 1: [analysis] has no meaning"), "{said}");
}

#[test]
fn a_list_in_single_brackets_is_pointed_to_double_ones() {
    for key in lists() {
        let said = refusal(&format!("{MESH}[{key}]\n"));
        let expected = format!("write [[{key}]], with double brackets");
        assert!(said.contains(&expected), "{said}");
    }
    let said = refusal("[mesh.part]\nname = \"a\"\n");
    assert!(said.contains("write [[mesh.part]]"), "{said}");
    // Only tables need brackets.
    let said = refusal(&format!("{MESH}[steps]\nfactors = {{ a = 1 }}\n"));
    assert!(!said.contains("brackets"), "{said}");
}

/// The path of a fault leads to its line, to the first or the last of several, to its parent if it is missing, and to its words.
#[test]
fn paths_lead_to_lines_and_words() {
    let text = format!(
        "{MESH}[[support]]\nboundary = \"left\"\nx = 0\n[[support]]\nboundary = \"top\"\naxis = {{ point = [0, 0] }}\n[solver]\nbeta = 0.1\n"
    );
    let line = |path: &str| 1 + text[..text::span(&text, path).start].matches('\n').count();
    for (path, expected, words) in [
        ("", 1, ""),
        ("mesh.rectangle.cells", 3, "mesh.rectangle, cells"),
        ("support[0].x", 6, "support 1, x"),
        ("support[1].axis.point", 9, "support 2, axis.point"),
        ("support[]", 7, "support"),
        ("support[1].factors", 7, "support 2, factors"),
        ("solver.beta", 11, "solver, beta"),
        ("traction[0]", 1, "traction"),
    ] {
        assert_eq!(line(path), expected, "{path}");
        assert_eq!(text::words(&text, path), words);
        if text::has(&text, path) && !path.ends_with("[]") {
            let start = text::span(&text, path).start;
            assert_eq!(text::path(&text, start), path);
        }
    }
}

/// Faults of a deck are reported at its own lines, in the dimension of its mesh.
#[test]
fn tables_of_a_deck_have_its_lines() {
    let mesh = block(
        [0.0; 3],
        [1.0; 3],
        [1; 3],
        SolidShape::Hexahedron,
        "body",
        "",
    );
    let origins = [
        ("mesh", 1),
        ("material[0]", 7),
        ("support[0]", 9),
        ("support[1]", 12),
    ]
    .map(|(table, line)| Origin {
        table: table.to_owned(),
        file: PathBuf::from("deck.inp"),
        line,
    });
    let said = |material: &str, settings: &[String]| {
        let text = format!(
            "{material}[[support]]\nboundary = \"left\"\nz = 0\n[[support]]\nboundary = \"right\"\nx = 0\n"
        );
        let deck = Deck {
            path: PathBuf::from("deck.inp"),
            title: String::new(),
            mesh: AnyMesh::Space(mesh.clone()),
            mesh_file: "none.msh".to_owned(),
            definition: AnyDefinition::Space(text::read(&text).expect("a definition")),
            origins: origins.to_vec(),
            node_numbers: Vec::new(),
            notes: Vec::new(),
        };
        let case = Case::of_deck(deck, settings);
        match case.map(|case| case.build().map(drop)) {
            Err(error) => error.to_string(),
            Ok(Err(error)) => error.to_string(),
            Ok(Ok(())) => panic!("accepted"),
        }
    };
    const MATERIAL: &str = "[[material]]\nyoung = 1\npoisson = 0\n";
    let second = said(MATERIAL, &["support.1.x=2 *".to_owned()]);
    assert!(
        second.starts_with("deck.inp, line 12: cannot understand"),
        "{second}"
    );
    let regions = said(&MATERIAL.replace("young", "region = []\nyoung"), &[]);
    assert!(
        regions.starts_with("deck.inp, line 7: region \"body\" has no material"),
        "{regions}"
    );
    let none = said("", &[]);
    assert!(
        none.starts_with("deck.inp, line 7: there is no material"),
        "{none}"
    );
}
