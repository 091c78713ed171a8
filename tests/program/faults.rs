//! The remains of failures around a solve: signals, limits, full discs, errors in a late step.

use crate::or_panic::OrPanic as _;
use crate::run::{command, names};
use std::fs::OpenOptions;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::channel;
use std::time::Duration;

/// Some load steps.
const PROCESS: &str = "title = \"process\"\n[mesh.rectangle]\nsize = [4, 1]\ncells = [120, 30]\n\
    [[material]]\nyoung = 2e11\npoisson = 0.3\n[[support]]\nboundary = \"left\"\nx = 0\n\
    [[traction]]\nboundary = \"top\"\npressure = \"1e7 * (1 + x)\"\n\
    [[traction]]\nboundary = \"right\"\nx = 2e6\n\
    [[contact]]\nboundary = \"bottom\"\nfriction = { coulomb = 0.3 }\n\
    obstacle = { half_plane = { point = [0, 0], normal = [0, 1] } }\n\
    [steps]\nfactors = [0.2, 0.4, 0.6, 0.8, 1.0, 0.5, 0.25]\n";

struct Outcome {
    status: ExitStatus,
    errors: String,
    report: Option<serde_json::Value>,
    files: Vec<String>,
}

/// Runs a case in its own directory, under a shell that does `before` first; `signal` comes after so many lines.
fn run(text: &str, before: &str, signal: Option<(&str, usize)>) -> Outcome {
    let directory = tempfile::tempdir().or_panic();
    let (case, out) = (
        directory.path().join("case.toml"),
        directory.path().join("out"),
    );
    std::fs::write(&case, text).or_panic();
    let mut child = Command::new("sh")
        .arg("-c")
        .arg(format!(
            "{before} exec \"$0\" solve \"$1\" --output \"$2\" --plots"
        ))
        .arg(env!("CARGO_BIN_EXE_signorini"))
        .args([&case, &out])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .or_panic();
    let mut errors = String::new();
    let said = child.stderr.take().expect("it is piped");
    for (number, line) in (1..).zip(BufReader::new(said).lines()) {
        errors += &line.or_panic();
        errors.push('\n');
        if let Some((name, after)) = signal
            && number == after
        {
            send(name, &child);
        }
    }
    let status = child.wait().or_panic();
    let report = std::fs::read_to_string(out.join("report.json")).ok();
    Outcome {
        status,
        errors,
        report: report.map(|text| {
            serde_json::from_str(&text).unwrap_or_else(|e| panic!("half a report: {e}"))
        }),
        files: names(&out),
    }
}

fn send(signal: &str, to: &Child) {
    let sent = Command::new("kill")
        .args(["-s", signal, &to.id().to_string()])
        .status();
    assert!(sent.is_ok_and(|status| status.success()));
}

/// Files that every run leaves whole: each existing file must be complete.
fn check_files(outcome: &Outcome) {
    for name in &outcome.files {
        assert!(!name.ends_with(".part"), "{:?}", outcome.files);
    }
}

/// In the first step and in later ones. There are so many of them that a run that missed the signal would continue long
/// after it.
#[test]
fn a_signal_at_any_time_leaves_a_report() {
    const STEPS: usize = 2000;
    let factors = vec!["0.2, 0.4, 0.6, 0.8"; STEPS / 4].join(", ");
    let text = PROCESS
        .replace("cells = [120, 30]", "cells = [40, 10]")
        .replace(
            "factors = [0.2, 0.4, 0.6, 0.8, 1.0, 0.5, 0.25]",
            &format!("factors = [{factors}]"),
        );
    let mut latest = 0;
    for (name, after) in [
        ("INT", 1),
        ("TERM", 2),
        ("INT", 5),
        ("TERM", 20),
        ("INT", 60),
    ] {
        let outcome = run(&text, "", Some((name, after)));
        check_files(&outcome);
        let errors = &outcome.errors;
        assert_eq!(outcome.status.code(), Some(3), "{name}, {after}: {errors}");
        let report = outcome.report.unwrap_or_else(|| panic!("no report"));
        assert_eq!(report["status"], "interrupted", "{name}, {after}");
        let steps = report["steps"].as_array().map_or(0, Vec::len);
        assert!(steps < STEPS, "{name}, {after}: {steps}");
        latest = latest.max(steps);
        for step in 1..=steps {
            let name = format!("solution-{step:03}.vtu");
            assert!(outcome.files.contains(&name), "{name}: {:?}", outcome.files);
        }
    }
    assert!(latest > 1, "no signal has come in a later step");
}

/// Starts to solve a case; no correct run of these takes so much time of the processor that it is ended by that.
fn started(case: &Path) -> Child {
    Command::new("sh")
        .args(["-c", "ulimit -t 600; exec \"$0\" solve \"$1\""])
        .args([Path::new(env!("CARGO_BIN_EXE_signorini")), case])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .or_panic()
}

/// The exit code of a run, and its messages.
fn ended(run: Child) -> (Option<i32>, String) {
    let ended = run.wait_with_output().or_panic();
    let errors = String::from_utf8_lossy(&ended.stderr).into_owned();
    (ended.status.code(), errors)
}

fn pipe(path: &Path) {
    let made = Command::new("mkfifo").arg(path).status();
    assert!(made.is_ok_and(|status| status.success()));
}

/// The case with a mesh from this file.
fn with_mesh(file: &str) -> String {
    PROCESS.replace(
        "[mesh.rectangle]\nsize = [4, 1]\ncells = [120, 30]\n",
        &format!("[mesh]\nfile = \"{file}\"\n"),
    )
}

#[test]
fn the_first_signal_ends_a_run_that_waits_for_a_pipe() {
    let directory = tempfile::tempdir().or_panic();
    let fifo = directory.path().join("pipe");
    pipe(&fifo);
    let case = directory.path().join("case.toml");
    std::fs::write(&case, with_mesh("pipe")).or_panic();
    for (case, signal) in [(&fifo, "TERM"), (&case, "INT")] {
        let mut run = started(case);
        // A pipe is open for writing as soon as somebody reads.
        let (sender, opened) = channel();
        let writer = fifo.clone();
        std::thread::spawn(move || sender.send(OpenOptions::new().write(true).open(writer)));
        let _writer = loop {
            match opened.recv_timeout(Duration::from_millis(10)) {
                Ok(file) => break file.or_panic(),
                Err(_) => assert!(run.try_wait().is_ok_and(|ended| ended.is_none())),
            }
        };
        send(signal, &run);
        let (code, errors) = ended(run);
        assert_eq!(code, Some(3), "{signal}: {errors}");
        assert!(errors.contains("while reading the case"), "{errors}");
    }
}

#[test]
fn endless_input_is_not_read_to_its_end() {
    let directory = tempfile::tempdir().or_panic();
    let case = directory.path().join("case.toml");
    std::fs::write(&case, with_mesh("/dev/zero")).or_panic();
    for case in [&case, Path::new("/dev/zero")] {
        let (code, errors) = ended(started(case));
        assert_eq!(code, Some(1), "{errors}");
        let expected = "cannot read /dev/zero: this is a device";
        assert!(errors.contains(expected), "{errors}");
    }
    let fifo = directory.path().join("pipe");
    pipe(&fifo);
    // More than the limit, but finite: a program that reads all of it has another message.
    let mut endless = Command::new("sh")
        .args(["-c", "yes '# nothing' | head -c 100000000 > \"$0\""])
        .arg(&fifo)
        .stderr(Stdio::null())
        .spawn()
        .or_panic();
    let (code, errors) = ended(started(&fifo));
    let _ = endless.kill();
    let _ = endless.wait();
    assert_eq!(code, Some(1), "{errors}");
    assert!(
        errors.contains("it is larger than the limit of 64 MiB"),
        "{errors}"
    );
}

/// The target of a link with such a name is emptied, not removed; it is not a result if the run reads it.
#[test]
fn links_among_the_results_stay() {
    let directory = tempfile::tempdir().or_panic();
    let at = |name: &str| directory.path().join(name);
    let link = |to: &str, name: &str| {
        let made = std::os::unix::fs::symlink(at(to), at(name));
        made.or_panic();
    };
    let write = |name: &str, text: &str| {
        std::fs::write(at(name), text).or_panic();
    };
    let mesh = include_str!("../meshes/other.msh");
    std::fs::create_dir(at("case-out")).or_panic();
    write("case.toml", &with_mesh("a.msh"));
    write("a.msh", mesh);
    write("elsewhere.json", "{ \"status\": \"converged\" }");
    link("elsewhere.json", "case-out/report.json");
    link("a.msh", "case-out/contact-001.csv");
    let (code, errors) = ended(started(&at("case.toml")));
    assert_eq!(code, Some(1), "{errors}");
    assert!(
        errors.contains("contact-001.csv: this run reads this file"),
        "{errors}"
    );
    let read = |name: &str| std::fs::read_to_string(at(name)).or_panic();
    assert_eq!(read("a.msh"), mesh);
    assert!(read("elsewhere.json").contains("converged"));
    std::fs::remove_file(at("case-out/contact-001.csv")).or_panic();
    // The mesh has other boundaries than the case names.
    let (code, errors) = ended(started(&at("case.toml")));
    assert_eq!(code, Some(1), "{errors}");
    assert_eq!(read("elsewhere.json"), "");
    assert!(at("case-out/report.json").is_symlink());
}

#[test]
fn a_time_limit_at_any_time_leaves_a_report() {
    for limit in ["0s", "1ms", "20ms", "100ms", "200ms"] {
        let outcome = run(
            &format!("{PROCESS}[solver]\ntime_limit = \"{limit}\"\n"),
            "",
            None,
        );
        check_files(&outcome);
        let report = outcome
            .report
            .unwrap_or_else(|| panic!("no report: {}", outcome.errors));
        // Whether the others come before the end depends on the machine; either is reported correctly.
        let expected = match outcome.status.code() {
            Some(0) if limit == "0s" => panic!("it has taken some time"),
            Some(0) => "converged",
            Some(3) => "time_limit",
            code => panic!("{limit}: {code:?}: {}", outcome.errors),
        };
        assert_eq!(report["status"], expected, "{limit}");
    }
}

#[test]
fn a_full_disc_is_an_error_that_leaves_no_half_files() {
    // Files may grow to so many blocks of 512 bytes; larger ones fail as on a full disc.
    for blocks in [1, 8, 64, 256, 1024] {
        let limit = format!("ulimit -f {blocks};");
        let outcome = run(PROCESS, &limit, None);
        check_files(&outcome);
        assert_eq!(
            outcome.status.code(),
            Some(1),
            "{blocks}: {}",
            outcome.errors
        );
        assert!(
            outcome.errors.contains("cannot write"),
            "{}",
            outcome.errors
        );
        // The disc had room for the report, if for anything.
        if blocks >= 64 {
            let report = outcome
                .report
                .unwrap_or_else(|| panic!("no report: {blocks}"));
            assert_eq!(report["status"], "error");
        }
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_failed_standard_output_is_an_error() {
    let full = || {
        let file = std::fs::OpenOptions::new().write(true).open("/dev/full");
        Stdio::from(file.or_panic())
    };
    let run = command(&["check", "examples/press.toml"])
        .stdout(full())
        .output()
        .or_panic();
    assert_eq!(run.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&run.stderr).contains("cannot write to standard output"));
}

#[test]
fn an_unwritable_place_is_reported_before_the_solve() {
    let directory = tempfile::tempdir().or_panic();
    let (case, out) = (
        directory.path().join("case.toml"),
        directory.path().join("out"),
    );
    std::fs::write(&case, PROCESS).or_panic();
    std::fs::write(&out, "in the way").or_panic();
    for place in [out.clone(), "/proc/nowhere".into()] {
        let run = command(&["solve"])
            .args([&case, Path::new("--output"), &place])
            .output()
            .or_panic();
        let errors = String::from_utf8_lossy(&run.stderr).into_owned();
        assert_eq!(run.status.code(), Some(1), "{errors}");
        assert!(errors.contains("cannot write"), "{errors}");
        assert!(!errors.contains("step 1"), "it was told too late: {errors}");
    }
}

#[test]
fn an_error_in_a_late_step_keeps_the_steps_before() {
    // The load of the third step is beyond all numbers.
    let text = PROCESS.replace("factors = [0.2, 0.4, 0.6,", "factors = [0.2, 0.4, 1e305,");
    let outcome = run(&text, "", None);
    check_files(&outcome);
    assert_eq!(outcome.status.code(), Some(1), "{}", outcome.errors);
    assert!(
        outcome.errors.contains("no finite value"),
        "{}",
        outcome.errors
    );
    let report = outcome.report.unwrap_or_else(|| panic!("no report"));
    assert_eq!(report["status"], "error");
    assert!(
        report["error"]
            .as_str()
            .is_some_and(|text| text.contains("no finite value"))
    );
    assert_eq!(report["steps"].as_array().map(Vec::len), Some(2));
    for name in [
        "solution-001.vtu",
        "solution-002.vtu",
        "contact-002.csv",
        "report.html",
        "deformed-002.svg",
    ] {
        assert!(
            outcome.files.iter().any(|file| file == name),
            "{name}: {:?}",
            outcome.files
        );
    }
}

#[test]
fn files_are_replaced_whole() {
    use signorini::output::write_whole;
    let directory = tempfile::tempdir().or_panic();
    let file = directory.path().join("a.json");
    let write = |path: &Path, text: &str| write_whole(path, text.as_bytes()).or_panic();
    let read = |path: &Path| std::fs::read_to_string(path).or_panic();
    write(&file, "one");
    write(&file, "two");
    assert_eq!(read(&file), "two");
    // A link stays a link, a device a device.
    let link = directory.path().join("link");
    std::os::unix::fs::symlink(&file, &link).or_panic();
    write(&link, "three");
    assert_eq!(read(&file), "three");
    assert!(
        link.symlink_metadata()
            .is_ok_and(|there| there.is_symlink())
    );
    write(Path::new("/dev/null"), "nothing");
    assert!(!Path::new("/dev/null").is_file());
    // A file that cannot be moved to its place leaves nothing beside it.
    let folder = directory.path().join("folder");
    std::fs::create_dir(&folder).or_panic();
    assert!(write_whole(&folder, b"x").is_err());
    assert_eq!(names(directory.path()), ["a.json", "folder", "link"]);
}
