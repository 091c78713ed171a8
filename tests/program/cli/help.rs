//! Completions of shells, man pages, and readers that go away.

use crate::or_panic::OrPanic as _;
use crate::run::{command, directory, names, read, signorini, text};

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
    // A file is not a directory.
    let file = pages.join("signorini.1");
    let run = signorini(&["man", &file.to_string_lossy()]);
    assert_eq!(run.status.code(), Some(1));
    assert!(text(&run.stderr).contains("signorini.1: cannot be made"));
}

/// `signorini completions bash | head -1` and the like: a closed pipe is not an error.
#[test]
fn a_broken_pipe_is_no_error() {
    for arguments in [&["completions", "zsh"][..], &["man"]] {
        let (reader, writer) = std::io::pipe().or_panic();
        drop(reader);
        let run = command(arguments).stdout(writer).output();
        let run = run.or_panic();
        assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    }
}
