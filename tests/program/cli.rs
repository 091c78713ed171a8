//! The program as a user sees it: exit codes, files, messages.

mod cases;
mod groups;
mod help;
mod matrices;
mod results;

use crate::or_panic::OrPanic as _;
use crate::run::{command, directory, read, report, signorini, signorini_in, solved_in, text};
use std::path::Path;
use std::process::Output;

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
    let seconds = |of: &str| report["timings"][of].as_f64().unwrap_or(f64::NAN);
    let parts = ["mesh", "assembly", "setup", "factor", "ssnm", "output"].map(seconds);
    assert!(parts.iter().all(|&part| part >= 0.0), "{parts:?}");
    assert!(parts.iter().sum::<f64>() <= seconds("total"), "{parts:?}");
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
fn limits_write_results_so_far_and_exit_with_3() {
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

/// A limit beyond the range of the clock counts as no limit; an invalid duration stays an error.
#[test]
fn absurdly_long_time_limits_are_no_limit() {
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

/// Over ssh and in containers there is no screen to ask for its device: drivers print nothing about that into a run.
#[test]
fn a_run_without_a_screen_has_no_lines_of_drivers() {
    let out = directory();
    let path = out.path().to_string_lossy().into_owned();
    let case = "examples/press.toml";
    for backend in ["gpu", "auto"] {
        let arguments = [
            "solve",
            case,
            "--backend",
            backend,
            "--stiffness",
            "pcg",
            "--quiet",
            "--output",
            &path,
        ];
        let run = command(&arguments)
            .env_remove("XDG_RUNTIME_DIR")
            .env_remove("NODEVICE_SELECT")
            .output()
            .expect("the program starts");
        assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
        assert_eq!(text(&run.stderr), "", "{backend}");
    }
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
fn the_report_names_the_nested_path() {
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

/// Bodies that meet later have no places at rest: every command says so, and results are those of the end.
#[test]
fn bodies_may_meet_later() {
    let case = r#"
        [[mesh.part]]
        name = "low"
        rectangle = { size = [4, 1], cells = [24, 6] }
        [[mesh.part]]
        name = "up"
        rectangle = { origin = [1, 3], size = [0.5, 0.5], cells = [4, 4] }
        [analysis]
        geometry = "large"
        [[material]]
        young = 1
        poisson = 0.3
        law = "neo-hooke"
        [[support]]
        boundary = "low-bottom"
        x = 0
        y = 0
        [[support]]
        boundary = "up-top"
        x = 0
        y = -2.1
        [[contact]]
        boundary = "up-bottom"
        against = "low-top"
        [steps]
        factors = [0.5, 1]
    "#;
    let place = directory();
    let report = solved_in(place.path(), case);
    let force = |step: usize| report["steps"][step]["contacts"][0]["force"][1].as_f64();
    assert_eq!(force(0), Some(0.0));
    assert!(force(1).is_some_and(|force| force > 0.05), "{report}");
    let run = signorini_in(place.path(), &["check", "case.toml"]);
    let said = text(&run.stdout);
    assert!(said.contains("no places at rest"), "{said}");
    assert!(!said.contains(" inf "), "{said}");
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
    let document: serde_json::Value = serde_json::from_str(&read(Path::new(&json))).or_panic();
    assert_eq!(document["cells"].as_array().map(Vec::len), Some(8));
}
