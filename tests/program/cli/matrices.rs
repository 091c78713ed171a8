//! Matrices of one's own: a case from files, and errors of broken ones.

use crate::or_panic::OrPanic as _;
use crate::run::{directory, report, signorini, text, write};
use signorini::matrix_market;
use std::path::{Path, PathBuf};

/// A small algebraic case on disk: two springs against a wall (the example of the library's front page).
pub fn algebraic(directory: &Path) -> PathBuf {
    let file = |name: &str, contents: &str| write(&directory.join(name), contents);
    file(
        "K.mtx",
        "%%MatrixMarket matrix coordinate real symmetric\n% two springs\n2 2 3\n1 1 2\n2 1 -1\n2 2 1\n",
    );
    file(
        "f.mtx",
        "%%MatrixMarket matrix array real general\n2 1\n0\n1\n",
    );
    file(
        "N.mtx",
        "%%MatrixMarket matrix coordinate integer general\n1 2 1\n1 2 1\n",
    );
    file(
        "T.mtx",
        "%%MatrixMarket matrix array real general\n1 2\n1.0\n0.0\n",
    );
    file(
        "d.mtx",
        "%%MatrixMarket matrix array real general\n1 1\n1\n",
    );
    file(
        "g.mtx",
        "%%MatrixMarket matrix coordinate real general\n1 1 1\n1 1 1e-1\n",
    );
    let case = directory.join("springs.toml");
    write(
        &case,
        "[algebraic]\nstiffness = \"K.mtx\"\nload = \"f.mtx\"\nnormal = \"N.mtx\"\ntangential = \"T.mtx\"\n\
         gap = \"d.mtx\"\nslip_bound = \"g.mtx\"\n[solver]\ntolerance = 1e-9\n",
    );
    case
}

#[test]
fn algebraic_case_from_files() {
    let place = directory();
    let case = algebraic(place.path()).to_string_lossy().into_owned();
    let run = signorini(&["solve", &case]);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    // The default output is beside the case.
    let out = place.path().join("springs-out");
    assert_eq!(report(&out)["status"], "converged");
    let vector = |name: &str| {
        matrix_market::read(&out.join(name))
            .and_then(matrix_market::Matrix::into_vector)
            .or_panic()
    };
    let u = vector("u.mtx");
    assert!(
        (u[0] - 0.45).abs() < 1e-8 && (u[1] - 1.0).abs() < 1e-8,
        "{u:?}"
    );
    assert!((vector("lambda_normal.mtx")[0] - 0.45).abs() < 1e-8);
    assert!((vector("lambda_tangential.mtx")[0] - 0.1).abs() < 1e-8);
    let check = signorini(&["check", &case]);
    assert!(text(&check.stdout).contains("n = 2, m = 1"));
}

/// Every condition on the matrices has its own message, which names the file or the entry.
#[test]
fn broken_matrices_are_explained() {
    let array = |entries: &str, size: &str| {
        format!("%%MatrixMarket matrix array real general\n{size}\n{entries}\n")
    };
    let coordinate = |entries: &str, size: &str| {
        format!("%%MatrixMarket matrix coordinate real general\n{size}\n{entries}\n")
    };
    let cases: Vec<(&str, String, &str)> = vec![
        (
            "K.mtx",
            coordinate("1 1 2\n1 2 -1\n2 1 -1.1\n2 2 1", "2 2 4"),
            "not symmetric: K(1, 2) = -1e0 but K(2, 1) = -1.1e0",
        ),
        (
            "K.mtx",
            coordinate("1 1 2\n2 2 -1", "2 2 2"),
            "diagonal entry 2 is -1e0",
        ),
        (
            "K.mtx",
            coordinate("1 1 1\n1 2 -1\n2 1 -1\n2 2 1", "2 2 4"),
            "need supports, or coordinates that define their rigid-body motions",
        ),
        (
            "K.mtx",
            coordinate("1 1 1\n1 2 -2\n2 1 -2\n2 2 1", "2 2 4"),
            "not positive definite",
        ),
        (
            "K.mtx",
            coordinate("1 1 1", "2 3 1"),
            "2 × 3: it must be square",
        ),
        (
            "K.mtx",
            coordinate("1 1 nan\n2 2 1", "2 2 2"),
            "(1, 1) is NaN",
        ),
        (
            "K.mtx",
            coordinate("1 1 2\n3 2 1", "2 2 2"),
            "K.mtx, line 4: row \"3\" is not between 1 and 2",
        ),
        (
            "K.mtx",
            coordinate("1 1 2", "2 2 2"),
            "ends after 1 of 2 entries",
        ),
        ("K.mtx", "hello\n".into(), "K.mtx, line 1"),
        (
            "f.mtx",
            array("0\n1\n2", "3 1"),
            "load f has length 3, expected 2",
        ),
        ("f.mtx", array("0\ninf", "2 1"), "load f: entry 2 is inf"),
        ("f.mtx", array("0\n1\n2\n3", "2 2"), "expected a vector"),
        (
            "f.mtx",
            array("0\n1e-310", "2 1"),
            "the load f: entry 2 (the largest one) is 1e-310: nonzero values must be between",
        ),
        (
            "K.mtx",
            coordinate("1 1 2e-320\n1 2 -1e-320\n2 1 -1e-320\n2 2 1e-320", "2 2 4"),
            "the stiffness matrix K: entry (1, 1) is 2e-320: nonzero values must be between",
        ),
        (
            "K.mtx",
            coordinate("1 1 2e200\n1 2 -1e200\n2 1 -1e200\n2 2 1e200", "2 2 4"),
            "the stiffness matrix K: entry (1, 1) is 2e200: nonzero values must be between",
        ),
        (
            "f.mtx",
            array("0\nx", "2 1"),
            "f.mtx, line 4: \"x\" is not a number",
        ),
        (
            "N.mtx",
            coordinate("1 2 1", "1 3 1"),
            "N is 1 × 3, expected 1 × 2",
        ),
        (
            "T.mtx",
            coordinate("1 2 -3", "1 2 1"),
            "rows 1 and 2 of (N; T) are parallel",
        ),
        ("d.mtx", array("-1", "1 1"), "d(1) = -1e0"),
        (
            "d.mtx",
            array("1\n1", "2 1"),
            "slip bound g has length 1, expected 2",
        ),
        ("g.mtx", array("-1", "1 1"), "g(1) = -1e0"),
    ];
    for (file, contents, expected) in cases {
        let place = directory();
        let case = algebraic(place.path());
        write(&place.path().join(file), &contents);
        let run = signorini(&["solve", &case.to_string_lossy()]);
        let said = text(&run.stderr);
        assert_eq!(run.status.code(), Some(1), "{file}: {contents}\n{said}");
        assert!(
            said.starts_with("error: ") && said.contains(expected),
            "{expected}\n{said}"
        );
    }
    let place = directory();
    let case = algebraic(place.path());
    std::fs::remove_file(place.path().join("g.mtx")).or_panic();
    let run = signorini(&["solve", &case.to_string_lossy()]);
    assert!(text(&run.stderr).contains("cannot read") && text(&run.stderr).contains("g.mtx"));
}
