//! Ties through which a held body holds another one, as a part of K.
//!
//! A body that only ties hold could move as a whole by its own K, which then must not resist that and has no stresses: iterations
//! converge slowly. With ρ BᵀB of its ties, K holds it. The answer stays the same, because the rows of a tie are met: at Δu = 0
//! they lack r, and ρ Bᵀr is among the forces.

use super::super::elastic::Elastic;
use super::super::error::EntityKind;
use super::meeting::{Meeting, of_pair};
use crate::contact::{ContactPlace, Space};
use crate::mesh::ElementKind;
use crate::mesh::vector::dot;
use crate::problem::ContactProblem;
use std::collections::HashMap;
use std::sync::Arc;

/// A place of a tie whose rows are a part of K.
#[derive(Clone, Debug)]
pub(crate) struct Glue {
    pair: u32,
    /// Its number among those of the pair.
    place: usize,
    /// ρ, about that of the nodes.
    stiffness: f64,
}

/// The rows of a place: nodes, each with the vector that its displacement is multiplied by.
fn rows<const D: usize>(place: &ContactPlace<D>) -> impl Iterator<Item = Vec<(u32, [f64; D])>> {
    (0..D).map(|a| place.terms(a).collect())
}

impl<const D: usize> Elastic<D>
where
    ElementKind: Space<D>,
{
    /// Makes ties between held and loose bodies a part of K. Returns whether there are any; the problem then has to be made again.
    pub(in super::super) fn glue(&mut self, problem: &ContactProblem<D>) -> bool {
        let unknowns = &self.unknowns;
        let loose = problem.floating_bodies().bodies();
        let body_of: HashMap<u32, usize> = (loose.iter().enumerate())
            .flat_map(|(body, of)| of.nodes().iter().map(move |&block| (block, body)))
            .map(|(block, body)| (unknowns.node(block as usize), body))
            .collect();
        // The ties of loose bodies: these bodies, and whether a held one is tied to them.
        let mut ties = Vec::new();
        let of_pairs = self.candidates.chunk_by(|a, b| a.1 == b.1);
        let is_tie = |of: &&[(_, u32)]| self.pairs[of[0].1 as usize].kind == EntityKind::Tie;
        for places in of_pairs.filter(is_tie) {
            for (number, (place, pair)) in places.iter().enumerate() {
                let nodes = rows(place).flatten().map(|(node, _)| node);
                let mut bodies: Vec<Option<usize>> =
                    nodes.map(|node| body_of.get(&node).copied()).collect();
                bodies.sort_unstable();
                bodies.dedup();
                if bodies.len() > 1 {
                    ties.push((*pair, number, place, bodies));
                }
            }
        }
        let mut held = vec![false; loose.len()];
        let is_held = |held: &[bool], body: &Option<usize>| body.is_none_or(|body| held[body]);
        let mut grows = true;
        while grows {
            grows = false;
            for (.., bodies) in &ties {
                if bodies.iter().any(|body| is_held(&held, body)) {
                    for body in bodies.iter().flatten() {
                        grows |= !std::mem::replace(&mut held[*body], true);
                    }
                }
            }
        }
        if ties.is_empty() {
            return false;
        }
        let diagonal = problem.stiffness().diagonal();
        let bedding = Arc::make_mut(&mut self.prescriptions.bedding);
        for (pair, place, of, bodies) in ties {
            if !bodies.iter().all(|body| is_held(&held, body)) {
                continue;
            }
            let nodes = rows(of)
                .flatten()
                .filter_map(|(node, _)| unknowns.block(node));
            let nodes: Vec<usize> = nodes.map(|block| D * block as usize).collect();
            let sum: f64 = (nodes.iter())
                .map(|&first| diagonal[first..first + D].iter().sum::<f64>())
                .sum();
            let stiffness = sum / (D * nodes.len()) as f64;
            rows(of).for_each(|terms| bedding.add_row(&terms, stiffness));
            self.glued.push(Glue {
                pair,
                place,
                stiffness,
            });
        }
        if self.glued.is_empty() {
            return false;
        }
        self.unknowns = unknowns
            .clone()
            .bedded(Arc::clone(&self.prescriptions.bedding));
        true
    }

    /// Adds the ρ Bᵀr of the ties in K to forces, for bodies of which prescribed displacements are still to come.
    pub(super) fn pull_glued(&self, met: &Meeting<D>, still: &[[f64; D]], forces: &mut [[f64; D]]) {
        for glue in &self.glued {
            let touch = &of_pair(&met.touches, glue.pair)[glue.place];
            let ways = touch.place.frame;
            for (a, terms) in rows(&touch.place).enumerate() {
                let lacks = match a {
                    0 => touch.place.gap,
                    a => -dot(touch.slip, ways[a]),
                };
                let moved = terms
                    .iter()
                    .map(|(node, way)| dot(*way, still[*node as usize]));
                let pull = glue.stiffness * (lacks - moved.sum::<f64>());
                for (node, way) in terms {
                    (0..D).for_each(|c| forces[node as usize][c] += pull * way[c]);
                }
            }
        }
    }
}
