use super::*;
use crate::mesh::structured::{SolidShape, block};
use crate::model::Definition;

const MESH: &str = "[mesh.rectangle]\nsize = [1, 1]\ncells = [1, 1]\n";

/// Each kind of which there may be several, once.
const ONE_OF_EACH: &str = "\
    [[material]]\nyoung = 1\npoisson = 0\n\
    [[support]]\nboundary = \"left\"\nx = 0\n\
    [[traction]]\nboundary = \"top\"\ny = 1\n\
    [[body_force]]\nx = 1\n\
    [[force]]\nnodes = \"set\"\nx = 1\n\
    [[temperature]]\nvalue = 1\n\
    [[contact]]\nboundary = \"bottom\"\nagainst = \"other\"\n\
    [[tie]]\nboundary = \"right\"\nagainst = \"next\"\n\
    [[equal]]\nsets = \"set\"\n";

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

/// A model would accept a kind without checks if the kind had a key but no entry in `parts`. Nobody would find a kind without
/// documentation or without a method in Python.
#[test]
fn every_kind_is_a_part_and_is_told_of() {
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
    let python = include_str!("../../python/signorini/_model.py");
    for key in stated {
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
fn a_list_in_single_brackets_is_told_of_the_double_ones() {
    for key in lists() {
        let said = refusal(&format!("{MESH}[{key}]\n"));
        let expected = format!("write [[{key}]], with double brackets");
        assert!(said.contains(&expected), "{said}");
    }
    let said = refusal("[mesh.part]\nname = \"a\"\n");
    assert!(said.contains("write [[mesh.part]]"), "{said}");
    // What is no table needs no brackets.
    let said = refusal(&format!("{MESH}[steps]\nfactors = {{ a = 1 }}\n"));
    assert!(!said.contains("brackets"), "{said}");
}

/// The path of what is at fault leads to its line, to the first or the last of several, to what it would lie in, and to its words.
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

/// What is wrong with a deck is told of its own lines, in the dimension of its mesh.
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
    let said = |material: &str, value: &str| {
        let text = format!(
            "[mesh]\nfile = \"none.msh\"\n{material}[[support]]\nboundary = \"left\"\nz = 0\n\
             [[support]]\nboundary = \"right\"\nx = {value}\n"
        );
        let given = Some((AnyMesh::Space(mesh.clone()), origins.to_vec()));
        let case = Case::made(Path::new("deck.inp"), text, &[], given);
        match case.map(|case| case.build().map(drop)) {
            Err(error) => error.to_string(),
            Ok(Err(error)) => error.to_string(),
            Ok(Ok(())) => panic!("accepted"),
        }
    };
    const MATERIAL: &str = "[[material]]\nyoung = 1\npoisson = 0\n";
    let second = said(MATERIAL, "\"2 *\"");
    assert!(
        second.starts_with("deck.inp, line 12: cannot understand"),
        "{second}"
    );
    let regions = said(&MATERIAL.replace("young", "region = []\nyoung"), "0");
    assert!(
        regions.starts_with("deck.inp, line 7: region \"body\" has no material"),
        "{regions}"
    );
    let none = said("", "0");
    assert!(
        none.starts_with("deck.inp, line 7: there is no material"),
        "{none}"
    );
}
