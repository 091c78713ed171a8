//! The files that a run writes and those that it leaves alone, and the contents of pictures and hints.

use super::cases::SOUND;
use super::matrices::algebraic;
use crate::or_panic::OrPanic as _;
use crate::run::{directory, names, read, report, signorini, signorini_in, text, write};
use std::path::Path;

#[test]
fn an_earlier_run_leaves_nothing() {
    let place = directory();
    let (case, out) = (place.path().join("case.toml"), place.path().join("out"));
    let path = case.to_string_lossy().into_owned();
    let run = |text: &str, arguments: &[&str], code: i32| {
        write(&case, text);
        let output = out.to_string_lossy().into_owned();
        let run = signorini(&[&["solve", &path, "--output", &output], arguments].concat());
        let said = self::text(&run.stderr);
        assert_eq!(run.status.code(), Some(code), "{said}");
        said
    };
    let steps = format!("{SOUND}[steps]\nfactors = [0.2, 0.6, 1.0]\n");
    run(&steps, &["--plots"], 0);
    let before = names(&out);
    for name in [
        "contact-003.csv",
        "solution.pvd",
        "contact-002.svg",
        "report.html",
    ] {
        assert!(
            before.iter().any(|found| found == name),
            "{name}: {before:?}"
        );
    }
    // Files without names of results stay as they are.
    let kept = ["contact-3.csv", "notes.txt", "solution-old.vtu"];
    kept.iter().for_each(|name| write(&out.join(name), "mine"));
    run(SOUND, &[], 0);
    let results = ["contact.csv", "report.json", "solution.vtu"];
    let mut expected = [&kept[..], &results].concat();
    expected.sort_unstable();
    assert_eq!(names(&out), expected);
    // An error before all results removes the file that states convergence, and nothing else.
    for broken in [
        SOUND.replace(
            "rectangle = { size = [2, 1], cells = [4, 2] }",
            "file = \"none.msh\"",
        ),
        SOUND.replace("\"left\"", "\"lift\""),
        SOUND.replace("[mesh]", "[mash]"),
    ] {
        run(&steps, &["--plots"], 0);
        run(&broken, &[], 1);
        let left = names(&out);
        let has = |name: &str| left.iter().any(|found| found == name);
        assert!(!has("report.json") && !has("report.html"), "{left:?}");
        assert!(has("solution-003.vtu") && has("notes.txt"), "{left:?}");
    }
}

#[test]
fn inputs_of_a_run_are_not_its_results() {
    let place = directory();
    let out = place.path().to_string_lossy().into_owned();
    let refused = |case: &Path, input: &str| {
        let input = place.path().join(input);
        let before = (names(place.path()), read(&input));
        let case = case.to_string_lossy();
        let run = signorini(&["solve", &case, "--output", &out]);
        let said = text(&run.stderr);
        assert_eq!(run.status.code(), Some(1), "{said}");
        let expected = format!("cannot write {}: this run reads this file", input.display());
        assert!(said.contains(&expected), "{expected}\n{said}");
        assert_eq!((names(place.path()), read(&input)), before);
    };
    // A mesh.
    let case = place.path().join("case.toml");
    let mesh = read(Path::new("tests/meshes/other-ascii.vtu"));
    write(&place.path().join("solution-001.vtu"), &mesh);
    write(&place.path().join("report.json"), "{}");
    write(
        &case,
        &SOUND.replace(
            "rectangle = { size = [2, 1], cells = [4, 2] }",
            "file = \"solution-001.vtu\"",
        ),
    );
    refused(&case, "solution-001.vtu");
    // A matrix.
    let case = algebraic(place.path());
    let text = read(&case).replace("f.mtx", "u.mtx");
    write(&case, &text);
    write(
        &place.path().join("u.mtx"),
        &read(&place.path().join("f.mtx")),
    );
    refused(&case, "u.mtx");
    // The case itself.
    let case = place.path().join("report.json");
    write(&case, SOUND);
    refused(&case, "report.json");
    write(&case, "{ no case }");
    let run = signorini(&["solve", &case.to_string_lossy(), "--output", &out]);
    assert_eq!(run.status.code(), Some(1));
    assert_eq!(read(&case), "{ no case }");
    // The same where the user names the output.
    let mesh = place.path().join("a.msh");
    std::fs::copy("tests/meshes/other.msh", &mesh).or_panic();
    let path = mesh.to_string_lossy().into_owned();
    let run = signorini(&["convert", &path, &path, "--scale", "2"]);
    assert_eq!(run.status.code(), Some(1));
    assert!(self::text(&run.stderr).contains("written over itself"));
    assert_eq!(read(&mesh), read(Path::new("tests/meshes/other.msh")));
}

/// `--plots` draws the features of the case, and report.html needs no other file.
#[test]
fn plots_and_a_self_contained_page() {
    let out = directory();
    let path = out.path().to_string_lossy().into_owned();
    let run = signorini(&[
        "solve",
        "examples/press.toml",
        "--output",
        &path,
        "--plots",
        "--quiet",
    ]);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    for name in ["deformed", "contact", "convergence"] {
        let svg = read(&out.path().join(format!("{name}.svg")));
        assert!(
            svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"),
            "{name}"
        );
        // The image may contain any letters.
        let drawn: String = svg
            .lines()
            .filter(|line| !line.contains("base64"))
            .collect();
        assert!(!drawn.contains("NaN") && !drawn.contains("inf"), "{name}");
    }
    let page = read(&out.path().join("report.html"));
    assert!(page.contains("Bracket pressed on a rigid foundation") && page.contains("converged"));
    assert!(page.contains("Balance of forces") && page.contains("<svg"));
    let outside = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!outside.contains("http") && !outside.contains(" src="));
    assert!(page.contains("id=\"bodies-data\"") && page.contains("\"plane\":true"));
}

/// Labels follow the case; without friction nothing sticks or slips.
#[test]
fn units_are_named_and_frictionless_nodes_are_in_contact() {
    let out = directory();
    let case = out.path().join("case.toml");
    write(
        &case,
        "[units]\nlength = \"mm\"\nforce = \"kN\"\n[mesh.rectangle]\nsize = [40, 10]\ncells = [16, 4]\n\
         [[material]]\nyoung = 210\npoisson = 0.3\n[[support]]\nboundary = \"left\"\nx = 0\n\
         [[traction]]\nboundary = \"top\"\npressure = \"0.1 * max(0, 1 - x / 20)\"\n\
         [[contact]]\nboundary = \"bottom\"\nobstacle = { half_plane = { point = [0, 0], normal = [0, 1] } }\n\
         [[contact]]\nboundary = \"right\"\nobstacle = { half_plane = { point = [41, 0], normal = [-1, 0] } }\n",
    );
    let (path, results) = (case.to_string_lossy().into_owned(), out.path().join("out"));
    let checked = signorini(&["check", &path]);
    assert_eq!(checked.status.code(), Some(0), "{}", text(&checked.stderr));
    let checked = text(&checked.stdout);
    for part in [
        "E = 2.1000e2 GPa",
        "mm²",
        "total load    (0.000000e0,",
        ") kN",
        "search distance",
    ] {
        assert!(checked.contains(part), "{part}: {checked}");
    }
    let run = signorini(&[
        "solve",
        &path,
        "--output",
        &results.to_string_lossy(),
        "--plots",
    ]);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    let summary = text(&run.stdout);
    assert!(
        summary.contains(" kN, pressure up to ") && summary.contains(" GPa"),
        "{summary}"
    );
    assert!(
        summary.contains("without friction") && !summary.contains("stick"),
        "{summary}"
    );
    assert!(
        summary.contains("no node touches; the least gap left is"),
        "{summary}"
    );
    let csv = read(&results.join("contact.csv"));
    let head = "x [mm],y [mm],gap [mm],normal_pressure [GPa],tangential_traction [GPa],slip [mm],status,contact,place";
    assert_eq!(csv.lines().next(), Some(head));
    assert!(csv.contains(",contact,bottom") && csv.contains(",separated,right"));
    assert!(!csv.contains(",stick,") && !csv.contains(",slip,bottom"));
    let report = report(&results);
    assert_eq!(report["units"]["stress"], "GPa");
    let sets = &report["sets"];
    assert_eq!(
        (&sets["stick"], &sets["slip_plus"], &sets["frictionless"]),
        (&0.into(), &0.into(), &22.into())
    );
    let contact = &report["steps"][0]["contacts"][0];
    assert!(contact["frictionless"].as_u64().is_some_and(|n| n > 3));
    assert_eq!(contact["stick"], 0);
    assert!(
        report["hints"][0]
            .as_str()
            .is_some_and(|hint| hint.contains("no node touches"))
    );
    for name in ["report.html", "contact-1.svg", "deformed.svg"] {
        assert!(read(&results.join(name)).contains("GPa"), "{name}");
    }
}

#[test]
fn hints_name_suspicious_figures() {
    let hints = |case: &str, settings: &[&str]| {
        let out = directory();
        let path = out.path().join("case.toml");
        write(&path, case);
        let (path, results) = (path.to_string_lossy().into_owned(), out.path().join("out"));
        let results = results.to_string_lossy().into_owned();
        let mut arguments = vec!["solve", &path, "--output", &results, "--quiet"];
        settings
            .iter()
            .for_each(|setting| arguments.extend(["--set", setting]));
        let run = signorini(&arguments);
        assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
        report(Path::new(&results))["hints"].to_string()
    };
    let punch = "[[mesh.part]]\nname = \"die\"\nrectangle = { size = [3, 1], cells = [60, 20] }\n\
        [[mesh.part]]\nname = \"punch\"\nrectangle = { size = [0.8, 0.5], cells = [16, 10] }\nshift = [1.1, 1]\n\
        [[material]]\nregion = \"die\"\nyoung = 1e9\npoisson = 0.3\n\
        [[material]]\nregion = \"punch\"\nyoung = 1e13\npoisson = 0.3\n\
        [[support]]\nboundary = \"die-bottom\"\nx = 0\ny = 0\n[[support]]\nboundary = \"punch-top\"\nx = 0\ny = -1e-3\n\
        [[contact]]\nboundary = \"punch-bottom\"\nagainst = \"die-top\"\n";
    let edge = hints(punch, &[]);
    assert!(edge.contains("the mesh does not resolve it"), "{edge}");
    let hard = hints(punch, &["support.1.y=-0.9"]);
    assert!(hard.contains("exceeds E of the softest material"), "{hard}");
    let far = hints(
        punch,
        &["support.1.y=-0.3", "contact.0.search_distance=0.1"],
    );
    assert!(far.contains("state search_distance"), "{far}");
    // A pressure that the mesh resolves gives no hint.
    let block = "[mesh.rectangle]\nsize = [1, 1]\ncells = [8, 8]\n[[material]]\nyoung = 1e9\npoisson = 0.3\n\
        [[support]]\nboundary = \"left\"\nx = 0\n[[traction]]\nboundary = \"top\"\npressure = 1e6\n\
        [[contact]]\nboundary = \"bottom\"\nobstacle = { half_plane = { point = [0, 0], normal = [0, 1] } }\n";
    assert_eq!(hints(block, &[]), "[]");
}

/// A bar on a hinge that its other end swings about it: a hint from 8.1° on.
#[test]
fn rotated_bodies_are_reported() {
    let place = directory();
    for (degrees, told) in [(5.0_f64, false), (9.0, true)] {
        let case = format!(
            "[mesh.rectangle]\norigin = [0, -0.05]\nsize = [1, 0.1]\ncells = [10, 2]\n[[material]]\nyoung = 1e6\npoisson = 0.3\n\
             [[support]]\npoint = [0, 0]\nx = 0\ny = 0\n[[support]]\npoint = [1, 0]\ny = {}\n",
            degrees.to_radians().tan()
        );
        write(&place.path().join("swing.toml"), &case);
        let run = signorini_in(place.path(), &["solve", "swing.toml"]);
        let said = self::text(&run.stdout);
        assert_eq!(run.status.code(), Some(0), "{said}");
        let hint = format!("hint: the body with region \"body\" has turned by {degrees:.0}°");
        assert_eq!(said.contains(&hint), told, "{said}");
    }
}
