//! Contacts, ties and friction that change from load step to load step.
//!
//! The rows of B do not change, nor does A: a row that does not act has an infinite gap and no friction.

use super::entities::Support;
use super::loads::end_of;
use super::pair::Pair;
use super::supports::Prescriptions;
use super::{Definition, Driven, ModelError};
use crate::contact::{ContactRows, Space};
use crate::mesh::{ElementKind, Mesh};
use serde::{Deserialize, Serialize};

/// The law of the rows of contact in a load step, where a model changes it from step to step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Changes {
    /// By how much the slip bound or μ of each row is multiplied, m; 0 where it does not act.
    pub(crate) friction: Vec<f64>,
    /// The rows that do not act.
    pub(crate) idle: Vec<usize>,
    /// Rows of ties that have begun to act after the beginning, each with the amount by which supports move its sides
    /// towards each other in this step. They hold their sides where those were at the end of the step before.
    pub(crate) bonded: Vec<(usize, f64)>,
}

impl Changes {
    /// Slip bounds or coefficients of friction of this step, from those of the problem.
    pub(crate) fn of_step(&self, values: &[f64]) -> Vec<f64> {
        let of_row = |(&value, &factor): (&f64, &f64)| match factor {
            // Also of an infinite bound.
            0.0 => 0.0,
            factor => factor * value,
        };
        values.iter().zip(&self.friction).map(of_row).collect()
    }

    /// Whether a row acts.
    pub fn acts(&self, row: usize) -> bool {
        self.idle.binary_search(&row).is_err()
    }
}

impl<const D: usize> Definition<D>
where
    ElementKind: Space<D>,
{
    /// The law of rows of contact, each with the number of its pair, in a load step counted from 0; None where it is
    /// the same in all of them.
    pub(super) fn changes(
        &self,
        mesh: &Mesh<D>,
        prescriptions: &Prescriptions<D>,
        (contact, pair_of): (&ContactRows<D>, &[u32]),
        driven: &[Driven],
        step: usize,
    ) -> Result<Option<Changes>, ModelError> {
        let pairs: Vec<&Pair<D>> = self.pairs.iter().chain(&self.ties).collect();
        let is_free = |driven: &Driven| driven.motion.is_none();
        let changes = pairs.iter().any(|pair| pair.has_steps())
            || self.supports.iter().any(Support::changes)
            || driven.iter().any(is_free);
        if !changes {
            return Ok(None);
        }
        let mut made = Changes {
            friction: vec![1.0; pair_of.len()],
            idle: Vec::new(),
            bonded: Vec::new(),
        };
        let is_late = |pair: &Pair<D>| pair.is_tie() && (0..step).any(|before| !pair.acts(before));
        let mut free = driven.iter().filter(|driven| is_free(driven)).peekable();
        let (mut idle, mut late) = (Vec::new(), Vec::new());
        for (row, &number) in pair_of.iter().enumerate() {
            if let Some(driven) = free.next_if(|driven| driven.row == row) {
                if driven.locked { &mut late } else { &mut idle }.push(row);
                continue;
            }
            // Nodes that move alike and springs are always the same.
            let Some(pair) = pairs.get(number as usize) else {
                continue;
            };
            if !pair.acts(step) {
                idle.push(row);
            } else if !pair.is_tie() {
                made.friction[row] = pair.friction_factor(step);
            } else if is_late(pair) {
                late.push(row);
            }
        }
        for &row in &idle {
            made.friction[row] = 0.0;
        }
        made.idle = idle;
        if !late.is_empty() {
            // The relative motion of the sides by supports since the step before.
            let at = |step| {
                let unknowns = self.unknowns(mesh, prescriptions, end_of(step))?;
                Ok(contact.held_motion(&unknowns).0)
            };
            let (now, before): (Vec<f64>, Vec<f64>) = (at(step)?, at(step - 1)?);
            let bonded = late.iter().map(|&row| (row, now[row] - before[row]));
            made.bonded = bonded.collect();
        }
        Ok(Some(made))
    }
}
