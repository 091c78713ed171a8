//! Decks and meshes at the command line: solved, converted, checked, refused.

use crate::or_panic::OrPanic as _;
use crate::run::{directory, read, signorini_in, text, write};
use std::path::Path;

/// Two blocks on top of each other, pressed together through a linear law: the upper one sinks by p (1 / E + 1 / E + 1 / k).
const PRESSED: &str = "*HEADING\nTwo blocks\n*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,1\n6,1,0,1\n7,1,1,1\n8,0,1,1\n\
    11,0,0,1\n12,1,0,1\n13,1,1,1\n14,0,1,1\n15,0,0,2\n16,1,0,2\n17,1,1,2\n18,0,1,2\n\
    *ELEMENT,TYPE=C3D8,ELSET=Elow\n1,1,2,3,4,5,6,7,8\n*ELEMENT,TYPE=C3D8,ELSET=Eup\n2,11,12,13,14,15,16,17,18\n\
    *NSET,NSET=Nlow\n1,2,3,4\n*NSET,NSET=Nall,GENERATE\n1,18\n*NSET,NSET=Ntop\n15,16,17,18\n\
    *SURFACE,NAME=Sup\n2,S1\n*SURFACE,NAME=Slow\n1,S2\n\
    *MATERIAL,NAME=el\n*ELASTIC\n100.,0.\n*SOLID SECTION,ELSET=Elow,MATERIAL=el\n*SOLID SECTION,ELSET=Eup,MATERIAL=el\n\
    *SURFACE INTERACTION,NAME=I\n*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=LINEAR\n50.\n*FRICTION\n0.2,400.\n\
    *CONTACT PAIR,INTERACTION=I,TYPE=SURFACE TO SURFACE\nSup,Slow\n*BOUNDARY\nNlow,3\nNall,1,2\n\
    *STEP\n*STATIC\n*CLOAD\nNtop,3,-0.5\n*NODE PRINT,NSET=Nall\nU\n*END STEP\n";

fn solved(directory: &Path, arguments: &[&str]) -> String {
    let run = signorini_in(directory, arguments);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    text(&run.stdout) + &text(&run.stderr)
}

#[test]
fn a_deck_is_solved_and_converted() {
    let place = directory();
    write(&place.path().join("blocks.inp"), PRESSED);
    let said = solved(place.path(), &["solve", "blocks.inp", "-v"]);
    assert!(
        said.contains("blocks.inp, line 53: *NODE PRINT is skipped"),
        "{said}"
    );
    assert!(said.contains("pressure up to 2.0000e0\n"), "{said}");
    // The units of its numbers are unknown.
    assert!(!said.contains(" Pa") && !said.contains(" N,"), "{said}");
    let told = [
        "solve",
        "blocks.inp",
        "--set",
        "units.length=mm",
        "--set",
        "units.force=N",
        "--output",
        "told",
    ];
    let told = solved(place.path(), &told);
    assert!(told.contains("pressure up to 2.0000e0 MPa"), "{told}");
    let csv = read(&place.path().join("blocks-out/contact.csv"));
    // The springs are pressed by p / k.
    for row in csv.lines().skip(1) {
        let gap: f64 = row.split(',').nth(3).expect("a gap").parse().or_panic();
        assert!((gap + 2.0 / 50.0).abs() < 1e-9, "{row}");
    }
    let said = solved(place.path(), &["convert", "blocks.inp", "case.toml"]);
    assert!(said.contains("case.msh\ncase.toml\n"), "{said}");
    let case = read(&place.path().join("case.toml"));
    for line in [
        "title = \"Two blocks\"",
        "file = \"case.msh\"",
        "friction = { coulomb = 0.2 }",
        "stiffness = { normal = 50.0, tangential = 400.0 }",
        "nodes = \"Nlow\"\nz = 0.0",
        "nodes = \"Nall\"\nx = 0.0\ny = 0.0",
    ] {
        assert!(case.contains(line), "{line} is not in {case}");
    }
    solved(place.path(), &["solve", "case.toml"]);
    let solution = |of: &str| read(&place.path().join(of).join("contact.csv"));
    assert_eq!(solution("blocks-out"), solution("case-out"));
    // Entries can be replaced as those of a case file.
    let said = solved(
        place.path(),
        &[
            "solve",
            "blocks.inp",
            "--set",
            "force.0.z=-1",
            "--set",
            "contact.0.name=joint",
        ],
    );
    assert!(
        said.contains("contact joint: ") && said.contains("pressure up to 4.0000e0"),
        "{said}"
    );
}

/// A surface that meets itself: both sides in one.
#[test]
fn a_contact_pair_may_have_one_surface() {
    let place = directory();
    for sides in ["Skin", "Skin,Skin"] {
        let deck = PRESSED
            .replace("Sup,Slow\n", &format!("{sides}\n"))
            .replace("*MATERIAL,", "*SURFACE,NAME=Skin\n2,S1\n1,S2\n*MATERIAL,");
        write(&place.path().join("blocks.inp"), &deck);
        let said = solved(place.path(), &["solve", "blocks.inp"]);
        assert!(said.contains("pressure up to 2.0000e0\n"), "{said}");
        assert!(said.contains("Skin / itself"), "{said}");
    }
}

/// The force of a rotation is that of where the bodies are.
#[test]
fn a_rotation_follows_large_displacements() {
    let place = directory();
    let rotating = PRESSED
        .replace("*ELASTIC", "*DENSITY\n1.\n*ELASTIC")
        .replace("*CLOAD", "*DLOAD\nEup,CENTRIF,2.,0.,0.,0.,0.,0.,1.\n*CLOAD");
    for (deck, displaced) in [
        (rotating.clone(), false),
        (rotating.replace("*STEP\n", "*STEP,NLGEOM\n"), true),
    ] {
        write(&place.path().join("blocks.inp"), &deck);
        solved(place.path(), &["convert", "blocks.inp", "case.toml"]);
        let case = read(&place.path().join("case.toml"));
        assert!(case.contains("[[body_force]]"), "{case}");
        assert_eq!(case.contains("displaced = true"), displaced, "{case}");
        solved(place.path(), &["solve", "case.toml"]);
    }
}

/// General contact: all of the outside, with properties of its own for two surfaces, without what is excluded.
#[test]
fn general_contact_has_no_list_of_pairs() {
    let place = directory();
    let pair = "*CONTACT PAIR,INTERACTION=I,TYPE=SURFACE TO SURFACE\nSup,Slow\n";
    let given = |general: &str| {
        let general = format!(
            "*SURFACE INTERACTION,NAME=Hard\n*CONTACT, OP=NEW\n{general}*CONTACT CONTROLS ASSIGNMENT, AUTOMATIC TOLERANCES\n"
        );
        write(
            &place.path().join("blocks.inp"),
            &PRESSED.replace(pair, &general),
        );
    };
    let all = "*CONTACT INCLUSIONS, ALL EXTERIOR\n";
    for (general, contacts) in [
        (
            format!("{all}*CONTACT PROPERTY ASSIGNMENT\n ,  , I\n"),
            vec!["exterior-1 / itself"],
        ),
        (
            "*CONTACT INCLUSIONS\nSup, Slow\n*CONTACT PROPERTY ASSIGNMENT\n,,I\n".to_owned(),
            vec!["Sup / Slow"],
        ),
        // Two surfaces with their own interaction, the first one of all the rest.
        (
            format!("{all}*CONTACT PROPERTY ASSIGNMENT\n,,Hard\nSlow, Sup, I\n"),
            vec!["exterior-1 / itself", "Slow / Sup"],
        ),
    ] {
        given(&general);
        let said = solved(place.path(), &["solve", "blocks.inp", "-v"]);
        assert!(said.contains("pressure up to 2.0000e0\n"), "{said}");
        assert!(
            said.contains("*CONTACT CONTROLS ASSIGNMENT is skipped"),
            "{said}"
        );
        for contact in contacts {
            assert!(said.contains(contact), "{contact} is not in {said}");
        }
    }
    // What is excluded does not hold the upper block.
    given(&format!("{all}*CONTACT EXCLUSIONS\nSup, Slow\n"));
    let error = text(&signorini_in(place.path(), &["solve", "blocks.inp"]).stderr);
    assert!(
        error.contains("\"Eup\"") && error.contains("has no contact to hold it"),
        "{error}"
    );
    for (general, wanted) in [
        ("", "no *CONTACT INCLUSIONS belongs to it"),
        (
            "*CONTACT INCLUSIONS, ALL EXTERIOR\n*CONTACT PROPERTY ASSIGNMENT\n,,Nix\n",
            "line 48: there is no *SURFACE INTERACTION \"NIX\"",
        ),
        (
            "*CONTACT INCLUSIONS, ALL EXTERIOR\n*CONTACT PROPERTY ASSIGNMENT\n,Sup,I\n",
            "line 48: an assignment to one surface and all others is not supported: name both",
        ),
        (
            "*CONTACT INCLUSIONS\nSup, Slow\n*CONTACT EXCLUSIONS\n,Slow\n",
            "line 49: *CONTACT EXCLUSIONS: a part of \"Sup\" and \"Slow\"",
        ),
    ] {
        given(general);
        let run = signorini_in(place.path(), &["solve", "blocks.inp"]);
        let error = text(&run.stderr);
        assert_eq!(run.status.code(), Some(1), "{error}");
        assert!(error.contains(wanted), "{wanted} is not in {error}");
    }
}

/// Elements with reduced integration are read as others, and each run reports it; those with incompatible modes are kept.
#[test]
fn elements_read_as_others_are_reported() {
    let place = directory();
    for (kind, told) in [("C3D8R", true), ("C3D8I", false), ("C3D8", false)] {
        write(
            &place.path().join("blocks.inp"),
            &PRESSED.replace("C3D8", kind),
        );
        let said = solved(place.path(), &["solve", "blocks.inp"]);
        let hint = format!("hint: {kind} is read as C3D8, with full integration");
        assert_eq!(said.contains(&hint), told, "{said}");
        assert_eq!(said.contains("is read as"), told, "{said}");
    }
}

#[test]
fn unsupported_entries_of_a_deck_are_refused_or_ignored() {
    let place = directory();
    let large = PRESSED.replace("*STEP\n", "*STEP,NLGEOM\n").replace(
        "*ELASTIC\n100.,0.\n",
        "*ELASTIC\n100.,0.\n*PLASTIC\n1.,0.\n",
    );
    write(&place.path().join("blocks.inp"), &large);
    let run = signorini_in(place.path(), &["solve", "blocks.inp"]);
    assert_eq!(run.status.code(), Some(1));
    let error = text(&run.stderr);
    for part in [
        "--ignore 'PLASTIC'",
        "line 37: *PLASTIC: only linear-elastic materials",
    ] {
        assert!(error.contains(part), "{part} is not in {error}");
    }
    solved(
        place.path(),
        &["solve", "blocks.inp", "--ignore", "nlgeom,plastic"],
    );
    let backwards = PRESSED.replace("GENERATE\n1,18\n", "GENERATE\n18,1\n");
    write(&place.path().join("blocks.inp"), &backwards);
    let run = signorini_in(place.path(), &["solve", "blocks.inp"]);
    assert_eq!(run.status.code(), Some(1));
    let error = text(&run.stderr);
    assert!(
        error.contains("blocks.inp, line 27: GENERATE counts up"),
        "{error}"
    );
    write(&place.path().join("case.toml"), "");
    let run = signorini_in(place.path(), &["check", "case.toml", "--ignore", "NLGEOM"]);
    assert!(text(&run.stderr).contains("--ignore applies only to decks"));
}

/// A mesh alone is listed; of a case that cannot be solved, so is its mesh.
#[test]
fn meshes_are_listed_by_check() {
    let place = directory();
    let mesh = PRESSED.split("*MATERIAL").next().expect("a text");
    write(&place.path().join("blocks.inp"), mesh);
    let listed = |said: &str| {
        for line in [
            "region        \"Elow\": volume 1",
            "boundary      \"Sup\": 1 faces",
            "nodes         \"Ntop\": 4 nodes",
        ] {
            assert!(said.contains(line), "{line} is not in {said}");
        }
    };
    listed(&solved(place.path(), &["check", "blocks.inp"]));
    solved(place.path(), &["convert", "blocks.inp", "blocks.msh"]);
    listed(&solved(place.path(), &["check", "blocks.msh"]));
    let case = "[mesh]\nfile = \"blocks.msh\"\n[[material]]\nyoung = 1\npoisson = 0\n[[support]]\nboundary = \"Sdown\"\nx = 0\n";
    write(&place.path().join("case.toml"), case);
    let run = signorini_in(place.path(), &["check", "case.toml"]);
    assert_eq!(run.status.code(), Some(1));
    assert!(text(&run.stderr).contains("there is no boundary \"Sdown\""));
    listed(&text(&run.stdout));
    let case = case.replace("[[material]]\nyoung = 1\npoisson = 0\n", "");
    write(&place.path().join("case.toml"), &case);
    let run = signorini_in(place.path(), &["check", "case.toml"]);
    assert_eq!(run.status.code(), Some(1));
    assert!(text(&run.stderr).contains("there is no material"));
    listed(&text(&run.stdout));
}
