//! The rows of N and T: a contact force acts on both bodies with opposite forces and, where they touch, at the same place.
//! So each row, taken as forces on nodes, has neither a resultant nor a moment.

use super::scene::{Solid, Tally};
use super::stacks::Stack;
use crate::common::draw::generator;
use signorini::mesh::ElementKind;
use signorini::model::Built;
use signorini::sparse::Csr;

/// The remainder of resultant and moment, relative to their terms.
const LEFT: f64 = 1e-10;

/// The largest resultant and the largest moment of a row, relative to the forces on nodes and to these times their
/// distances from the middle of their nodes.
fn unbalance<const D: usize>(built: &Built<D>, rows: &Csr) -> [f64; 2]
where
    ElementKind: Solid<D>,
{
    let unknowns = &built.elastic.unknowns;
    let mut forces: Vec<Vec<([f64; D], usize, f64)>> = vec![Vec::new(); rows.n_rows()];
    for (row, column, value) in rows.triplets().filter(|entry| entry.2 != 0.0) {
        let node = unknowns.node(column / D);
        let place = built.elastic.mesh.nodes[node as usize];
        forces[row].push((place, column % D, value));
    }
    let mut worst = [0.0f64; 2];
    for row in &forces {
        let count = row.len() as f64;
        let middle: [f64; D] =
            std::array::from_fn(|c| row.iter().map(|(x, ..)| x[c]).sum::<f64>() / count);
        let (mut sum, mut size) = ([0.0; D], 0.0);
        // Entry (a, b): of the force along b at the distance a.
        let (mut first, mut arms) = ([[0.0; D]; D], 0.0);
        for &(x, b, value) in row {
            sum[b] += value;
            size += value.abs();
            for a in 0..D {
                first[a][b] += (x[a] - middle[a]) * value;
                arms += ((x[a] - middle[a]) * value).abs();
            }
        }
        for a in 0..D {
            worst[0] = worst[0].max(sum[a].abs() / size);
            for b in 0..a {
                worst[1] = worst[1].max((first[a][b] - first[b][a]).abs() / arms);
            }
        }
    }
    worst
}

fn rows_of_stacks<const D: usize>(cases: u64)
where
    ElementKind: Solid<D>,
{
    let mut tally = Tally::default();
    for seed in 0..cases {
        let stack = Stack::<D>::random(&mut generator(seed));
        if !stack.touches() {
            continue;
        }
        let result = (stack.scene.model().build()).map_err(|error| error.to_string());
        let result = result.and_then(|built| {
            let problem = &built.problem;
            for (name, rows) in [("N", problem.normal()), ("T", problem.tangential())] {
                let [force, moment] = unbalance(&built, rows);
                if !(force <= LEFT && moment <= LEFT) {
                    return Err(format!(
                        "{name} has a resultant of {force:e}, a moment of {moment:e}"
                    ));
                }
            }
            Ok(())
        });
        tally.add(&format!("{D} dimensions, stack {seed}"), result);
    }
    tally.end();
}

#[test]
fn rows_balance() {
    rows_of_stacks::<2>(60);
}

#[test]
fn rows_balance_in_space() {
    rows_of_stacks::<3>(60);
}
