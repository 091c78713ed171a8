//! The program as a user meets it: exit codes, files, messages.

mod common;

use signorini::case::Case;
use signorini::matrix_market;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_signorini"));
    command.args(arguments);
    command
}

fn signorini(arguments: &[&str]) -> Output {
    command(arguments)
        .output()
        .unwrap_or_else(|error| panic!("{error}"))
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn directory() -> tempfile::TempDir {
    tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"))
}

fn write(path: &Path, contents: &str) {
    std::fs::write(path, contents).unwrap_or_else(|error| panic!("{error}"));
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn report(directory: &Path) -> serde_json::Value {
    serde_json::from_str(&read(&directory.join("report.json")))
        .unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_example_of_the_readme() {
    let out = directory();
    let path = out.path().to_string_lossy().into_owned();
    let run = signorini(&["solve", "examples/press.toml", "--output", &path, "-v"]);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    assert!(text(&run.stdout).starts_with("converged\n"));
    // No terminal, no control characters.
    for stream in [&run.stdout, &run.stderr] {
        assert!(!stream.iter().any(|&b| b == 0x1b || b == b'\r'));
    }
    let report = report(out.path());
    for key in [
        "status",
        "n",
        "m",
        "iter",
        "n_A",
        "err_relative",
        "rho",
        "sigma_max",
        "v_cycles",
        "v_cycles_linear",
        "work_ratio",
        "backend",
        "adapter",
        "precision",
        "stiffness",
        "sets",
        "kkt",
        "timings",
        "peak_memory_mib",
        "version",
        "history",
    ] {
        assert!(report.get(key).is_some(), "{key} is missing");
    }
    assert_eq!(report["status"], "converged");
    assert_eq!(
        report["history"].as_array().map(Vec::len),
        report["iter"].as_u64().map(|i| i as usize)
    );
    for (name, value) in report["kkt"].as_object().into_iter().flatten() {
        assert!(value.as_f64().is_some_and(|v| v < 1e-7), "{name}: {value}");
    }
    let total = report["timings"]["total"].as_f64().unwrap_or(f64::NAN);
    let parts: f64 = ["mesh", "assembly", "setup", "factor", "ssnm", "output"]
        .iter()
        .map(|p| report["timings"][p].as_f64().unwrap_or(f64::NAN))
        .sum();
    assert!(parts <= total && parts > 0.5 * total, "{parts} of {total}");
    // Part of the base lifts off, part sticks, part slips in contact.
    let csv = read(&out.path().join("contact.csv"));
    let mut lines = csv.lines();
    assert_eq!(
        lines.next(),
        Some("x,y,gap,normal_pressure,tangential_traction,slip,status,contact,place")
    );
    let count = |what: &str| csv.lines().filter(|line| line.contains(what)).count();
    assert!(count(",separated,") > 10 && count(",stick,") > 3 && count(",slip,") > 10);
    assert_eq!(lines.count() as u64, report["m"].as_u64().unwrap_or(0));
    let vtu = read(&out.path().join("solution.vtu"));
    for field in [
        "displacement",
        "stress",
        "von_mises",
        "contact_pressure",
        "tangential_traction",
        "contact_status",
    ] {
        assert!(vtu.contains(&format!("Name=\"{field}\"")), "{field}");
    }
}

#[test]
fn quiet_is_quiet() {
    let out = directory();
    let path = out.path().to_string_lossy().into_owned();
    let run = signorini(&["solve", "examples/press.toml", "--output", &path, "--quiet"]);
    assert_eq!(run.status.code(), Some(0));
    assert!(run.stdout.is_empty() && run.stderr.is_empty());
}

#[test]
fn limits_write_what_there_is_and_exit_with_3() {
    for (setting, status) in [
        ("solver.max_iterations=2", "iteration_limit"),
        ("solver.time_limit=0s", "time_limit"),
        ("solver.tolerance=1e-17", "stagnated"),
    ] {
        let out = directory();
        let path = out.path().to_string_lossy().into_owned();
        let run = signorini(&[
            "solve",
            "examples/press.toml",
            "--output",
            &path,
            "--set",
            setting,
        ]);
        assert_eq!(
            run.status.code(),
            Some(3),
            "{setting}: {}",
            text(&run.stdout)
        );
        assert!(text(&run.stdout).starts_with("NOT converged"));
        assert_eq!(report(out.path())["status"], status);
        assert!(out.path().join("solution.vtu").exists());
    }
}

/// A limit that no clock can show is none; what is no duration stays an error.
#[test]
fn absurdly_long_time_limits_are_none() {
    let solve = |limit: &str| {
        let out = directory();
        let path = out.path().to_string_lossy().into_owned();
        let setting = format!("solver.time_limit={limit}");
        signorini(&[
            "solve",
            "examples/matrices/block.toml",
            "--output",
            &path,
            "--set",
            &setting,
        ])
    };
    for limit in [
        "500000000000years",
        "18446744073709551615s 1000000000ns",
        "584554530872years",
        "99999999999999999999999999 years 1 day",
        "18446744073709551615s",
    ] {
        let run = solve(limit);
        assert_eq!(run.status.code(), Some(0), "{limit}: {}", text(&run.stderr));
    }
    for limit in ["99999999999999999999999999 yards", "0.5ns", "-1s"] {
        let run = solve(limit);
        assert_eq!(run.status.code(), Some(1), "{limit}");
        assert!(text(&run.stderr).contains("is not a duration"), "{limit}");
    }
}

#[test]
fn wrong_usage_exits_with_2() {
    for arguments in [
        &["solve"][..],
        &["solv", "x.toml"],
        &["table1", "--beta", "fast"],
    ] {
        assert_eq!(signorini(arguments).status.code(), Some(2), "{arguments:?}");
    }
    assert_eq!(signorini(&["--help"]).status.code(), Some(0));
}

#[test]
fn shells_complete_commands_options_and_values() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let run = signorini(&["completions", shell]);
        assert_eq!(run.status.code(), Some(0), "{shell}");
        let script = text(&run.stdout);
        for word in ["signorini", "table1", "preconditioner", "block-jacobi"] {
            // Elvish and PowerShell complete no values.
            let none = word == "block-jacobi" && ["elvish", "powershell"].contains(&shell);
            assert!(none || script.contains(word), "{shell}: no {word}");
        }
    }
    assert_eq!(signorini(&["completions", "tcsh"]).status.code(), Some(2));
}

#[test]
fn a_man_page_for_each_command() {
    let directory = directory();
    let pages = directory.path().join("share/man1");
    let run = signorini(&["man", &pages.to_string_lossy()]);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    let help = text(&signorini(&["--help"]).stdout);
    // "  solve     Solve a case …", between "Commands:" and the next empty line.
    let commands = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let commands = commands.map_while(|line| line.split_whitespace().next());
    let mut expected: Vec<String> = commands
        .filter(|command| *command != "help")
        .map(|command| format!("signorini-{command}.1"))
        .collect();
    assert!(expected.len() > 5, "{help}");
    expected.push("signorini.1".to_owned());
    expected.sort();
    assert_eq!(names(&pages), expected);
    let solve = read(&pages.join("signorini-solve.1"));
    assert!(solve.contains(r"\-\-stiffness") && solve.contains(".SH \"EXIT STATUS\""));
    // Without a directory the main page is printed.
    let printed = signorini(&["man"]);
    assert_eq!(text(&printed.stdout), read(&pages.join("signorini.1")));
    // A file is no directory.
    let file = pages.join("signorini.1");
    let run = signorini(&["man", &file.to_string_lossy()]);
    assert_eq!(run.status.code(), Some(1));
    assert!(text(&run.stderr).contains("signorini.1: cannot be made"));
}

/// `signorini completions bash | head -1` and the like: a reader that has gone away is no error.
#[test]
fn a_broken_pipe_is_no_error() {
    for arguments in [&["completions", "zsh"][..], &["man"]] {
        let (reader, writer) = std::io::pipe().unwrap_or_else(|error| panic!("{error}"));
        drop(reader);
        let run = command(arguments).stdout(writer).output();
        let run = run.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    }
}

/// Runs the program with a wgpu that finds no adapter.
fn without_adapters(arguments: &[&str]) -> Output {
    command(arguments)
        .env("WGPU_BACKEND", "metal")
        .output()
        .expect("the program starts")
}

#[test]
fn without_an_adapter_a_gpu_is_an_error_and_an_open_choice_is_not() {
    let run = without_adapters(&["solve", "examples/press.toml", "--backend", "gpu"]);
    assert_eq!(run.status.code(), Some(1));
    let said = text(&run.stderr);
    assert!(
        said.contains("no GPU adapter") && said.contains("--backend cpu"),
        "{said}"
    );

    let out = directory();
    let path = out.path().to_string_lossy().into_owned();
    let run = without_adapters(&["solve", "examples/press.toml", "--output", &path]);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    let run = without_adapters(&["adapters"]);
    assert_eq!(run.status.code(), Some(0));
    assert!(text(&run.stdout).contains("no adapter"));
}

#[test]
fn cholesky_on_a_gpu_is_refused() {
    let run = signorini(&[
        "solve",
        "examples/press.toml",
        "--backend",
        "gpu",
        "--stiffness",
        "cholesky",
    ]);
    assert_eq!(run.status.code(), Some(1));
    assert!(text(&run.stderr).contains("--stiffness pcg"));
}

#[test]
fn the_nested_path_says_so_in_the_report() {
    let out = directory();
    let path = out.path().to_string_lossy().into_owned();
    let run = signorini(&[
        "solve",
        "examples/press.toml",
        "--backend",
        "cpu",
        "--stiffness",
        "pcg",
        "--output",
        &path,
        "-v",
    ]);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    assert!(text(&run.stderr).contains("PCG iterations"));
    let report = report(out.path());
    assert_eq!(report["backend"], "cpu");
    assert_eq!(report["stiffness"], "pcg");
    assert_eq!(report["status"], "converged");
    assert!(
        report["v_cycles"]
            .as_u64()
            .is_some_and(|count| count > 20 && count < 300)
    );
}

#[test]
fn check_describes_the_case() {
    let run = signorini(&["check", "examples/press.toml"]);
    assert_eq!(run.status.code(), Some(0));
    let said = text(&run.stdout);
    for part in [
        "4492 triangles",
        "\"steel\"",
        "\"base\": 116 edges",
        "117 places",
        "9.0",
        "-8.0",
    ] {
        assert!(said.contains(part), "{part} in\n{said}");
    }
}

#[test]
fn table1_prints_paper_and_ours() {
    let out = directory();
    let json = out.path().join("t.json").to_string_lossy().into_owned();
    let run = signorini(&["table1", "--max-k", "3", "--beta", "1,20", "--json", &json]);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    let said = text(&run.stdout);
    assert!(said.contains("1320/60") && said.contains("11160/180") && said.contains(" 7/ 35 |"));
    assert!(said.contains("Assumed here"));
    let document: serde_json::Value =
        serde_json::from_str(&read(Path::new(&json))).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(document["cells"].as_array().map(Vec::len), Some(8));
}

/// A small algebraic case on disk: two springs against a wall (the example of the library's front page).
fn algebraic(directory: &Path) -> PathBuf {
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
    // The default output lies beside the case.
    let out = place.path().join("springs-out");
    assert_eq!(report(&out)["status"], "converged");
    let vector = |name: &str| {
        matrix_market::read(&out.join(name))
            .and_then(matrix_market::Matrix::into_vector)
            .unwrap_or_else(|error| panic!("{error}"))
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

/// Every claim about the matrices has its own message, and it names the file or the entry.
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
            "need coordinates, which tell their rigid motions, or supports",
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
            "the load f: entry 2 (the largest one) is 1e-310: what is not 0 has to be between",
        ),
        (
            "K.mtx",
            coordinate("1 1 2e-320\n1 2 -1e-320\n2 1 -1e-320\n2 2 1e-320", "2 2 4"),
            "the stiffness matrix K: entry (1, 1) is 2e-320: what is not 0 has to be between",
        ),
        (
            "K.mtx",
            coordinate("1 1 2e200\n1 2 -1e200\n2 1 -1e200\n2 2 1e200", "2 2 4"),
            "the stiffness matrix K: entry (1, 1) is 2e200: what is not 0 has to be between",
        ),
        (
            "f.mtx",
            array("0\nx", "2 1"),
            "f.mtx, line 4: \"x\" is not a number",
        ),
        (
            "N.mtx",
            coordinate("1 2 0", "1 2 1"),
            "row 1 of N has no nonzero entry",
        ),
        (
            "N.mtx",
            coordinate("1 2 1", "1 3 1"),
            "N is 1 × 3, expected 1 × 2",
        ),
        (
            "T.mtx",
            coordinate("", "1 2 0"),
            "row 1 of T has no nonzero entry",
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
    std::fs::remove_file(place.path().join("g.mtx")).unwrap_or_else(|error| panic!("{error}"));
    let run = signorini(&["solve", &case.to_string_lossy()]);
    assert!(text(&run.stderr).contains("cannot read") && text(&run.stderr).contains("g.mtx"));
}

/// A sound case, to be broken in one place.
const SOUND: &str = "\
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

/// What lies in a directory.
fn names(directory: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(directory).unwrap_or_else(|error| panic!("{error}"));
    let mut names: Vec<String> = (entries.flatten())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn nothing_of_the_run_before_is_left() {
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
    // What is not called like a result is nobody's business.
    let kept = ["contact-3.csv", "notes.txt", "solution-old.vtu"];
    kept.iter().for_each(|name| write(&out.join(name), "mine"));
    run(SOUND, &[], 0);
    let results = ["contact.csv", "report.json", "solution.vtu"];
    let mut expected = [&kept[..], &results].concat();
    expected.sort_unstable();
    assert_eq!(names(&out), expected);
    // An error that comes before all results takes away what says that the run has converged, and no more.
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
fn what_a_run_reads_is_no_result_of_it() {
    let place = directory();
    let out = place.path().to_string_lossy().into_owned();
    let refused = |case: &Path, input: &str| {
        let input = place.path().join(input);
        let before = (names(place.path()), read(&input));
        let case = case.to_string_lossy();
        let run = signorini(&["solve", &case, "--output", &out]);
        let said = text(&run.stderr);
        assert_eq!(run.status.code(), Some(1), "{said}");
        let expected = format!("cannot write {}: this run reads it", input.display());
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
    // And where the user says what to write.
    let mesh = place.path().join("a.msh");
    std::fs::copy("tests/meshes/other.msh", &mesh).unwrap_or_else(|error| panic!("{error}"));
    let path = mesh.to_string_lossy().into_owned();
    let run = signorini(&["convert", &path, &path, "--scale", "2"]);
    assert_eq!(run.status.code(), Some(1));
    assert!(self::text(&run.stderr).contains("written over itself"));
    assert_eq!(read(&mesh), read(Path::new("tests/meshes/other.msh")));
}

#[test]
fn broken_cases_are_explained_with_their_line() {
    let cases = [
        ("[mesh]", "[mash]", "unknown field `mash`"),
        (
            "rectangle = { size = [2, 1], cells = [4, 2] }",
            "",
            "either file or rectangle",
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
            "symmetry = true\nx = 0",
            "symmetry stands alone",
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
            "line 8: factors belong to load steps",
        ),
        (
            "[[contact]]",
            "[solver]\nfriction_tolerance = 0\n[[contact]]",
            "friction_tolerance must lie",
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
            "normals are not independent",
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
    .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(case.settings().ssnm.tolerance, 1e-9);
    assert_eq!(case.tables.title, "a b");
    for (setting, expected) in [
        ("solver.tolerance", "key.path=value"),
        (
            "contact.3.boundary=top",
            "setting \"contact.3.boundary=top\": there is no entry 3",
        ),
        ("solver.tolerence=1", "unknown field"),
        ("title.deep=1", "unknown"),
    ] {
        match parse(&[setting]) {
            Ok(case) => panic!("{setting}: {case:?}"),
            Err(error) => assert!(
                error.contains(expected) || setting.starts_with("title"),
                "{setting}: {error}"
            ),
        }
    }
}

/// `--plots` draws what the case has, and report.html needs nothing from outside.
#[test]
fn plots_and_a_page_that_stands_alone() {
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
        // Any letters may stand in the image.
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
    assert!(!outside.contains("http") && !outside.contains("<script"));
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
fn hints_name_what_looks_wrong() {
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
    assert!(hard.contains("above E of the softest material"), "{hard}");
    let far = hints(
        punch,
        &["support.1.y=-0.3", "contact.0.search_distance=0.1"],
    );
    assert!(far.contains("state search_distance"), "{far}");
    // A pressure that the mesh resolves needs no word.
    let block = "[mesh.rectangle]\nsize = [1, 1]\ncells = [8, 8]\n[[material]]\nyoung = 1e9\npoisson = 0.3\n\
        [[support]]\nboundary = \"left\"\nx = 0\n[[traction]]\nboundary = \"top\"\npressure = 1e6\n\
        [[contact]]\nboundary = \"bottom\"\nobstacle = { half_plane = { point = [0, 0], normal = [0, 1] } }\n";
    assert_eq!(hints(block, &[]), "[]");
}
