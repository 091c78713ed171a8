//! `signorini completions`.

use super::{Cli, print};
use clap::CommandFactory as _;

pub fn run(shell: clap_complete::Shell) -> Result<u8, String> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "signorini", &mut script);
    print(&String::from_utf8_lossy(&script))?;
    Ok(0)
}
