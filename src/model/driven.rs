//! Rows whose motion a load step states, or the force in place of it: preloads and couplings.
//!
//! Such a row measures one motion: the shortening of a bolt, a displacement or rotation of a coupled point. With a stated motion it is
//! tied, its multiplier is the force. With a stated force, which is a load, it does not act.

use super::entities::Part as _;
use super::loads::end_of;
use super::{Definition, ModelError, PairData};
use crate::contact::Space;
use crate::elasticity::Body;
use crate::mesh::ElementKind;
use serde::{Deserialize, Serialize};

/// A motion that a row of a preload or a coupling measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// Of a coupled point: along the axes, then about them; 0 of a preload.
    pub component: usize,
    /// The motion is what the row measures over this, and the force what its multiplier is times this.
    pub size: f64,
}

/// The state of such a row in a load step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Driven {
    /// The row.
    pub row: usize,
    /// The motion, as the row measures it, where it is stated.
    pub motion: Option<f64>,
    /// The force of the loads along the motion.
    pub force: f64,
    /// Whether the row holds its motion where that was at the end of the step before.
    pub locked: bool,
}

impl<const D: usize> Definition<D>
where
    ElementKind: Space<D>,
{
    /// The number of the first preload, and of the first coupling, among all contacts.
    fn first_driven(&self) -> [usize; 2] {
        let first = self.pairs.len() + self.ties.len() + self.equals.len() + self.springs.len();
        [first, first + self.preloads.len()]
    }

    /// The state of all such rows in a load step, counted from 0; `pair_of` has the contact of each row.
    pub(super) fn driven(
        &self,
        pairs: &[PairData<D>],
        pair_of: &[u32],
        step: usize,
    ) -> Vec<Driven> {
        let [preloads, couplings] = self.first_driven();
        let mut all = Vec::new();
        let mut before = None;
        let mut within = 0;
        for (row, &pair) in pair_of.iter().enumerate() {
            within = if before == Some(pair) { within + 1 } else { 0 };
            before = Some(pair);
            let number = pair as usize;
            let Some(drive) = pairs[number].drives.get(within) else {
                continue;
            };
            let (motion, force, locked) = match number.checked_sub(couplings) {
                None => self.preloads[number - preloads].state(self, step),
                Some(coupling) => {
                    let coupling = &self.couplings[coupling];
                    let factor = self.factor(coupling.load_factors(), end_of(step));
                    let motion = coupling.motion(drive.component);
                    let force = coupling.load(drive.component);
                    (
                        motion.map(|motion| factor * drive.size * motion),
                        factor * force / drive.size,
                        false,
                    )
                }
            };
            all.push(Driven {
                row,
                motion,
                force,
                locked,
            });
        }
        all
    }

    /// Adds the loads of preloads and couplings in a load step, counted from 0.
    pub(super) fn add_driven(
        &self,
        body: &Body<D>,
        step: usize,
        forces: &mut [[f64; D]],
    ) -> Result<(), ModelError> {
        for (preload, section) in self.preloads.iter().zip(&self.sections) {
            let (_, tension, _) = preload.state(self, step);
            if tension != 0.0 {
                section.pull(tension, forces);
            }
        }
        for (number, coupling) in self.couplings.iter().enumerate() {
            let factor = self.factor(coupling.load_factors(), end_of(step));
            coupling
                .push(body, factor, forces)
                .map_err(|fault| coupling.entity(number).error(fault))?;
        }
        Ok(())
    }
}
