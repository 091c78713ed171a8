//! `signorini man`.

use super::advice::message_of;
use super::{Cli, print};
use clap::{Command, CommandFactory as _};
use clap_mangen::Man;
use signorini::output::write_whole;
use std::path::Path;

pub fn run(directory: Option<&Path>) -> Result<u8, String> {
    // `help` adds nothing to the pages; building gives commands their full names.
    let mut program = Cli::command().disable_help_subcommand(true);
    program.build();
    match directory {
        None => print(&page(&Man::new(program)))?,
        Some(directory) => {
            std::fs::create_dir_all(directory)
                .map_err(|error| format!("{}: cannot be made: {error}", directory.display()))?;
            let commands: Vec<Command> = program.get_subcommands().cloned().collect();
            for command in std::iter::once(program).chain(commands) {
                let man = Man::new(command);
                let path = directory.join(man.get_filename());
                write_whole(&path, page(&man).as_bytes()).map_err(|e| message_of(&e))?;
                print(&format!("{}\n", path.display()))?;
            }
        }
    }
    Ok(0)
}

/// A page in troff's language.
fn page(man: &Man) -> String {
    let mut text = Vec::new();
    man.render(&mut text).expect("memory takes all");
    // The text after the options is about exit codes; readers of man pages look for it under this heading.
    String::from_utf8_lossy(&text).replace(".SH EXTRA\n", ".SH \"EXIT STATUS\"\n")
}
