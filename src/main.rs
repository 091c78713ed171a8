//! The command-line program; see `signorini --help` and the README.

mod cli;

fn main() -> std::process::ExitCode {
    cli::run()
}
