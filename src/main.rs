//! The command-line program; see `signorini --help` and the README.

fn main() -> std::process::ExitCode {
    signorini::cli::run(std::env::args_os()).into()
}
