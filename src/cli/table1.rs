//! `signorini table1`.

use super::{GeometryArgument, NOT_CONVERGED, Table1Arguments, print};
use signorini::output::write_whole;
use signorini::reference::Geometry;
use signorini::ssnm::Status;
use signorini::table1::{ASSUMPTIONS, Cell, SIZES, TOLERANCE, row};
use std::io::IsTerminal as _;
use std::ops::ControlFlow;

pub fn run(arguments: &Table1Arguments) -> Result<u8, String> {
    let engine = arguments.engine.options();
    if let Some(beta) = arguments
        .beta
        .iter()
        .find(|b| !(**b > 0.0 && b.is_finite()))
    {
        return Err(format!("--beta {beta}: β must be positive"));
    }
    if arguments.max_k < 1 {
        return Err("--max-k 0: the smallest row is k = 1".into());
    }
    let (geometry, name) = match arguments.geometry {
        GeometryArgument::OneBody => (Geometry::OneBody, "one body on a rigid plane"),
        GeometryArgument::TwoBody => (Geometry::TwoBodies, "two bodies, matching nodes"),
    };
    let terminal = std::io::stderr().is_terminal();
    print(&format!(
        "Table 1, {name}; ISSNM with ρ = β/σ_max: paper | ours (ours with the final check)\n\n{:>12}",
        "n/m"
    ))?;
    for beta in &arguments.beta {
        print(&format!("  {:>23}", format!("β = {beta}")))?;
    }
    print("\n")?;
    let mut cells: Vec<Cell> = Vec::new();
    let mut said = String::new();
    for k in SIZES.into_iter().filter(|&k| k <= arguments.max_k) {
        let log = |line: &str| {
            // Each row makes the same choice: once is enough.
            if said != line {
                eprintln!("{line}");
                said = line.to_owned();
            }
        };
        let found = row(geometry, k, &arguments.beta, &engine, log, |beta| {
            if terminal {
                eprint!("\r\x1b[2Kk = {k}, β = {beta} …");
            }
            ControlFlow::Continue(())
        })
        .map_err(|e| e.to_string())?;
        if terminal {
            eprint!("\r\x1b[2K");
        }
        if let Some(first) = found.first() {
            // The paper's m: for two bodies the total number of multipliers.
            let m = match geometry {
                Geometry::OneBody => first.contact_nodes,
                Geometry::TwoBodies => 2 * first.contact_nodes,
            };
            print(&format!("{:>12}", format!("{}/{m}", first.n)))?;
        }
        for cell in &found {
            let paper = cell
                .paper
                .map_or("      ".to_owned(), |(i, n)| format!("{i:2}/{n:3}"));
            let mark = if cell.status == Status::Converged {
                ' '
            } else {
                '!'
            };
            print(&format!(
                "  {paper} | {:2}/{:3} ({:2}/{:3}){mark}",
                cell.iter, cell.n_a, cell.iter_checked, cell.n_a_checked
            ))?;
        }
        print("\n")?;
        cells.extend(found);
    }
    let failed = cells
        .iter()
        .filter(|c| c.status != Status::Converged)
        .count();
    let above = cells
        .iter()
        .filter(|c| c.paper.is_some_and(|(_, n)| c.n_a > n))
        .count();
    print(&format!(
        "\n{} of {} cells converged; n_A is above the paper's figure in {above}.\n\n{ASSUMPTIONS}\n",
        cells.len() - failed,
        cells.len()
    ))?;
    if let Some(path) = &arguments.json {
        let document = serde_json::json!({
            "geometry": match geometry { Geometry::OneBody => "one-body", Geometry::TwoBodies => "two-body" },
            "tolerance": TOLERANCE,
            "assumptions": ASSUMPTIONS,
            "cells": cells,
        });
        let text = format!("{document:#}\n");
        write_whole(path, text.as_bytes()).map_err(|e| e.to_string())?;
    }
    Ok(if failed == 0 { 0 } else { NOT_CONVERGED })
}
