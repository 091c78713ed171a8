//! `signorini table1`.

use super::advice::message_of;
use super::{GeometryArgument, NOT_CONVERGED, Table1Arguments, print};
use signorini::engine::Engine;
use signorini::output::write_whole;
use signorini::reference::{self, Geometry, TABLE1};
use signorini::ssnm::{Method, Status};
use signorini::table1::{ASSUMPTIONS, Cell, SIZES, TOLERANCE, row};
use std::io::IsTerminal as _;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};

pub fn run(arguments: &Table1Arguments) -> Result<u8, String> {
    let usable = |beta: &f64| *beta > 0.0 && beta.is_finite();
    if let Some(beta) = arguments.beta.iter().find(|beta| !usable(beta)) {
        return Err(format!("--beta {beta}: β must be positive"));
    }
    if arguments.max_k < 1 {
        return Err("--max-k 0: the smallest row is k = 1".into());
    }
    let cells = table(arguments)?;
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
            "geometry": match arguments.geometry {
                GeometryArgument::OneBody => "one-body",
                GeometryArgument::TwoBody => "two-body",
            },
            "tolerance": TOLERANCE,
            "assumptions": ASSUMPTIONS,
            "cells": cells,
        });
        let text = format!("{document:#}\n");
        write_whole(path, text.as_bytes()).map_err(|e| message_of(&e))?;
    }
    Ok(if failed == 0 { 0 } else { NOT_CONVERGED })
}

/// Computes the table and prints it row by row.
fn table(arguments: &Table1Arguments) -> Result<Vec<Cell>, String> {
    let options = arguments.engine.options();
    let (geometry, name) = match arguments.geometry {
        GeometryArgument::OneBody => (Geometry::OneBody, "one body on a rigid plane"),
        GeometryArgument::TwoBody => (Geometry::TwoBodies, "two bodies, matching nodes"),
    };
    let terminal = std::io::stderr().is_terminal();
    print(&format!(
        "Table 1, {name}, with ρ = β/σ_max: iter/n_A of the paper | of ISSNM as printed | on a surrogate of A (with the \
         final check)\n\n{:>12}",
        "n/m"
    ))?;
    for beta in &arguments.beta {
        print(&format!("  {:>32}", format!("β = {beta}")))?;
    }
    print("\n")?;
    let mut cells: Vec<Cell> = Vec::new();
    let said = Arc::new(Mutex::new(String::new()));
    for k in SIZES.into_iter().filter(|&k| k <= arguments.max_k) {
        let said = Arc::clone(&said);
        let log = move |line: &str| {
            // Each row makes the same choice: once is enough.
            let mut said = said.lock().unwrap_or_else(PoisonError::into_inner);
            if *said != line {
                eprintln!("{line}");
                *said = line.to_owned();
            }
        };
        let mesh = reference::mesh(geometry, k);
        let problem = reference::problem(geometry, &mesh, &TABLE1).map_err(|e| message_of(&e))?;
        let mut engine = Engine::new(&problem, options.clone(), log).map_err(|e| message_of(&e))?;
        let mut found = Vec::new();
        for method in [Method::Inexact, Method::Multisecant] {
            let made = row(&problem, &mut engine, k, &arguments.beta, method, |beta| {
                if terminal {
                    eprint!("\r\x1b[2Kk = {k}, β = {beta} …");
                }
                ControlFlow::Continue(())
            });
            found.push(made.map_err(|e| message_of(&e))?);
        }
        if terminal {
            eprint!("\r\x1b[2K");
        }
        print(&described(geometry, &found[0], &found[1]))?;
        cells.extend(found.into_iter().flatten());
    }
    Ok(cells)
}

/// A row of the table.
fn described(geometry: Geometry, printed: &[Cell], surrogate: &[Cell]) -> String {
    let size = printed.first().map_or(String::new(), |first| {
        // The paper's m: for two bodies the total number of multipliers.
        let m = match geometry {
            Geometry::OneBody => first.contact_nodes,
            Geometry::TwoBodies => 2 * first.contact_nodes,
        };
        format!("{}/{m}", first.n)
    });
    let mut text = format!("{size:>12}");
    for (printed, cell) in printed.iter().zip(surrogate) {
        let paper = match cell.paper {
            Some((iter, n_a)) => format!("{iter:2}/{n_a:3}"),
            None => "      ".to_owned(),
        };
        let mark = match [printed.status, cell.status] {
            [Status::Converged, Status::Converged] => ' ',
            _ => '!',
        };
        text += &format!(
            "  {paper} | {:2}/{:3} | {:2}/{:2} ({:2}/{:2}){mark}",
            printed.iter, printed.n_a, cell.iter, cell.n_a, cell.iter_checked, cell.n_a_checked
        );
    }
    text + "\n"
}
