//! Contacts, ties and friction that change from load step to load step.
//!
//! The rows of B stay what they are, and with them A: a row that does not act has an infinite gap and no friction.

use super::loads::end_of;
use super::pair::Pair;
use super::supports::Prescriptions;
use super::{Definition, ModelError};
use crate::contact::{ContactRows, Space};
use crate::mesh::{ElementKind, Mesh};
use serde::{Deserialize, Serialize};

/// What the rows of contact are under in a load step, where a model changes that from step to step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Changes {
    /// Given slip bounds of the step, m; infinite where a place is tied.
    pub(crate) slip_bound: Vec<f64>,
    /// μ of the step, m.
    pub(crate) coefficient: Vec<f64>,
    /// The rows that do not act.
    pub(crate) idle: Vec<usize>,
    /// Rows of ties that have begun to act after the beginning, each with what supports move its sides towards each other by in this
    /// step: they hold their sides where those were at the end of the step before.
    pub(crate) bonded: Vec<(usize, f64)>,
}

impl Changes {
    /// Whether a row acts.
    pub fn acts(&self, row: usize) -> bool {
        self.idle.binary_search(&row).is_err()
    }
}

impl<const D: usize> Definition<D>
where
    ElementKind: Space<D>,
{
    /// What rows of contact, each with the number of its pair, are under in a load step counted from 0; None where it is the same in
    /// all of them.
    pub(super) fn changes(
        &self,
        mesh: &Mesh<D>,
        prescriptions: &Prescriptions<D>,
        contact: &ContactRows<D>,
        pair_of: &[u32],
        step: usize,
    ) -> Result<Option<Changes>, ModelError> {
        let pairs: Vec<&Pair<D>> = self.pairs.iter().chain(&self.ties).collect();
        if !pairs.iter().any(|pair| pair.has_steps()) {
            return Ok(None);
        }
        let mut made = Changes {
            slip_bound: contact.slip_bound.clone(),
            coefficient: contact.coefficient.clone(),
            idle: Vec::new(),
            bonded: Vec::new(),
        };
        let is_late = |pair: &Pair<D>| pair.is_tie() && (0..step).any(|before| !pair.acts(before));
        // What supports have moved the sides by since the step before.
        let mut moved: Option<Vec<f64>> = None;
        for (row, &number) in pair_of.iter().enumerate() {
            // Nodes that move alike and springs are always the same.
            let Some(pair) = pairs.get(number as usize) else {
                continue;
            };
            let factor = pair.friction_factor(step);
            if !pair.acts(step) {
                made.idle.push(row);
                (made.slip_bound[row], made.coefficient[row]) = (0.0, 0.0);
            } else if !pair.is_tie() {
                made.slip_bound[row] *= factor;
                made.coefficient[row] *= factor;
            } else if is_late(pair) {
                let moved = match &mut moved {
                    Some(moved) => moved,
                    none => {
                        let at = |step| {
                            let unknowns = self.unknowns(mesh, prescriptions, end_of(step))?;
                            Ok(contact.held_motion(&unknowns).0)
                        };
                        let (now, before): (Vec<f64>, Vec<f64>) = (at(step)?, at(step - 1)?);
                        let since = now.iter().zip(before).map(|(now, before)| now - before);
                        none.insert(since.collect())
                    }
                };
                made.bonded.push((row, moved[row]));
            }
        }
        Ok(Some(made))
    }
}
