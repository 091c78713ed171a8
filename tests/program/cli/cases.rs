//! Case files: errors of broken ones, and settings on the command line.

use crate::or_panic::OrPanic as _;
use signorini::case::Case;
use std::path::Path;

/// A sound case, to be broken in one place.
pub const SOUND: &str = "\
[mesh]
rectangle = { size = [2, 1], cells = [4, 2] }

[[material]]
young = 1e6
poisson = 0.3

[[support]]
boundary = \"left\"
x = 0
y = 0

[[traction]]
boundary = \"top\"
y = \"-1e3 * x\"

[[contact]]
boundary = \"bottom\"
obstacle = { half_plane = { point = [0, 0], normal = [0, 1] } }
friction = { tresca = 10 }
";

#[test]
fn broken_cases_are_explained_with_their_line() {
    let cases = [
        ("[mesh]", "[mash]", "unknown field `mash`"),
        (
            "rectangle = { size = [2, 1], cells = [4, 2] }",
            "",
            "give it file, rectangle or",
        ),
        (
            "size = [2, 1]",
            "size = [2, -1]",
            "line 1: the rectangle needs positive sizes",
        ),
        (
            "cells = [4, 2]",
            "cells = [4, 0]",
            "positive sizes and numbers of cells",
        ),
        ("young = 1e6", "young = 0", "line 4: young is 0"),
        ("poisson = 0.3", "poisson = 0.5", "poisson is 0.5"),
        ("young = 1e6", "yuong = 1e6", "unknown field `yuong`"),
        (
            "young = 1e6",
            "region = \"iron\"\nyoung = 1e6",
            "no region \"iron\"; the mesh has \"body\"",
        ),
        (
            "boundary = \"left\"",
            "boundary = \"lift\"",
            "line 8: there is no boundary \"lift\"",
        ),
        ("x = 0\ny = 0", "", "it holds nothing"),
        (
            "x = 0\ny = 0",
            "x = 0\ndirections = [[1, 1], [1, 0]]",
            "directions are finite vectors, perpendicular",
        ),
        (
            "x = 0\ny = 0",
            "x = 0\ndirections = [[1, 1]]",
            "expected 2 vectors, found 1",
        ),
        (
            "x = 0\ny = 0",
            "symmetry = true\ndirections = [[1, 1], [1, -1]]",
            "state one of these beside them",
        ),
        (
            "x = 0\ny = 0",
            "symmetry = true\nx = 0",
            "symmetry takes a boundary and nothing else",
        ),
        (
            "y = \"-1e3 * x\"",
            "",
            "a traction needs x, y, pressure or force",
        ),
        ("\"-1e3 * x\"", "\"-1e3 * z\"", "unknown name \"z\""),
        ("\"-1e3 * x\"", "\"-1e3 *\"", "cannot understand"),
        ("\"-1e3 * x\"", "\"1 / (x - x)\"", "no finite value"),
        ("\"-1e3 * x\"", "true", "expected a number or an expression"),
        (
            "normal = [0, 1]",
            "normal = [0, 0]",
            "line 17: half_plane needs",
        ),
        (
            "point = [0, 0], normal",
            "point = [0, 0.1], normal",
            "inside the obstacle",
        ),
        ("tresca = 10", "tresca = -10", "must be a finite number ≥ 0"),
        (
            "normal = [0, 1]",
            "normal = [0, 1, 0]",
            "expected 2 entries, found 3",
        ),
        (
            "cells = [4, 2]",
            "cells = [4, 2, 7]",
            "expected 2 entries, found 3",
        ),
        (
            "normal = [0, 1]",
            "normal = [0, -1]",
            "no part of it faces the obstacle",
        ),
        (
            "tresca = 10",
            "coulomb = -0.3",
            "the coefficient of friction is -0.3",
        ),
        ("tresca = 10", "coulumb = 0.3", "did you mean `coulomb`?"),
        (
            "tresca = 10",
            "tresca = 10 }\nadjust = { a = 1",
            "invalid type",
        ),
        ("young = 1e6", "yuong = 1e6", "did you mean `young`?"),
        (
            "boundary = \"left\"",
            "boundary = \"lift\"",
            "did you mean \"left\"?",
        ),
        (
            "boundary = \"bottom\"",
            "boundary = \"bottom\"\nagainst = \"top\"",
            "either against a boundary or with an obstacle",
        ),
        (
            "boundary = \"bottom\"",
            "boundary = \"bottom\"\nsearch_distance = -1",
            "finite and not negative",
        ),
        (
            "boundary = \"bottom\"",
            "boundary = \"bottom\"\nadjust = -1",
            "finite and not negative",
        ),
        (
            "boundary = \"bottom\"",
            "boundary = \"bottom\"\ngap = \"x - 1\"",
            "the gap is -1",
        ),
        (
            "[[contact]]",
            "[steps]\nfactors = []\n[[contact]]",
            "at least one number",
        ),
        (
            "boundary = \"left\"",
            "boundary = \"left\"\nfactors = [1, 2]",
            "line 10: factors apply to load steps",
        ),
        (
            "half_plane = { point = [0, 0], normal = [0, 1] }",
            "circle = { center = [0, 0], radius = 0 }",
            "positive radius",
        ),
        ("[[traction]]", "[[traction]\n", "line 13"),
        (
            "[[contact]]",
            "[solver]\ntolerance = 2\n[[contact]]",
            "tolerance must lie between 0 and 1",
        ),
        (
            "[[contact]]",
            "[solver]\nbeta = 0\n[[contact]]",
            "beta must be positive",
        ),
        (
            "[[contact]]",
            "[solver]\ntime_limit = \"soon\"\n[[contact]]",
            "is not a duration",
        ),
        (
            "[[contact]]",
            "[analysis]\ngravity = [0, -9.81]\n[[contact]]",
            "no material has a density",
        ),
        (
            "[[contact]]",
            "[analysis]\nthickness = 0\n[[contact]]",
            "thickness must be positive",
        ),
        (
            "[[contact]]\nboundary = \"bottom\"",
            "[[contact]]\nboundary = \"bottom\"\nobstacle = { half_plane = { point = [0, 0], normal = [0, 1] } }\n[[contact]]\nboundary = \"bottom\"",
            "normals depend on each other",
        ),
    ];
    let sound = Case::parse(Path::new("case.toml"), SOUND.to_owned(), &[])
        .map_err(|e| e.to_string())
        .and_then(|case| case.build().map_err(|e| e.to_string()));
    assert!(sound.is_ok(), "{:?}", sound.err());
    for (old, new, expected) in cases {
        assert!(SOUND.contains(old), "{old}");
        let broken = SOUND.replacen(old, new, 1);
        let error = match Case::parse(Path::new("case.toml"), broken.clone(), &[]) {
            Err(error) => error.to_string(),
            Ok(case) => match case.build() {
                Err(error) => error.to_string(),
                Ok(_) => panic!("accepted:\n{broken}"),
            },
        };
        assert!(
            error.starts_with("case.toml") && error.contains(expected),
            "expected \"{expected}\" in\n{error}"
        );
    }
}

#[test]
fn settings_replace_and_add() {
    let parse = |settings: &[&str]| {
        let settings: Vec<String> = settings.iter().map(|&s| s.to_owned()).collect();
        Case::parse(Path::new("case.toml"), SOUND.to_owned(), &settings).map_err(|e| e.to_string())
    };
    let case = parse(&[
        "solver.tolerance=1e-9",
        "contact.0.friction.tresca=x*2",
        "title=a b",
    ])
    .or_panic();
    assert_eq!(case.settings().ssnm.tolerance, 1e-9);
    assert_eq!(case.tables.title, "a b");
    for (setting, expected) in [
        ("solver.tolerance", "key.path=value"),
        (
            "contact.3.boundary=top",
            "setting \"contact.3.boundary=top\": there is no entry 3",
        ),
        ("solver.tolerence=1", "unknown field"),
        (
            "contact.0.boundary.deep=1",
            "would be inside an entry that is not a table",
        ),
    ] {
        match parse(&[setting]) {
            Ok(case) => panic!("{setting}: {case:?}"),
            Err(error) => assert!(error.contains(expected), "{setting}: {error}"),
        }
    }
}
