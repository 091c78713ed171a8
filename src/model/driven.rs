//! Rows whose motion a load step states, or the force in place of it: preloads, couplings, equations, and supports that do not always
//! act.
//!
//! Such a row measures one motion: the shortening of a bolt, a displacement or rotation of a coupled point. With a stated motion it is
//! tied, its multiplier is the force. With a stated force, which is a load, it does not act.

use super::entities::Part as _;
use super::error::EntityKind;
use super::loads::step_of;
use super::{Definition, ModelError, PairData};
use crate::contact::{ContactPlace, SlipBound, Space};
use crate::elasticity::Body;
use crate::mesh::ElementKind;
use serde::{Deserialize, Serialize};

/// A motion that a row measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// Of a coupled point: along the axes, then about them; 0 of everything else.
    pub component: usize,
    /// The motion is the measure of the row over this, and the force its multiplier times this.
    pub size: f64,
    /// The motion that is stated under the load factor 1; None: it is free, or follows from a force. (A preload states its own.)
    pub motion: Option<f64>,
    /// The force that is stated under the load factor 1.
    pub force: f64,
}

impl Drive {
    /// Of a motion that is stated.
    pub(super) fn moved(motion: f64) -> Self {
        Self {
            component: 0,
            size: 1.0,
            motion: Some(motion),
            force: 0.0,
        }
    }
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

/// A node with the vector that its displacement is multiplied by.
pub(super) type Term<const D: usize> = (u32, [f64; D]);

/// A place, known by its pool, with one row: the sum of these terms. A force along the first direction of the frame belongs to it.
pub(super) fn measured<const D: usize>(
    (place, pool): ([f64; D], u32),
    own: u32,
    frame: [[f64; D]; D],
    terms: Vec<Term<D>>,
) -> ContactPlace<D> {
    ContactPlace {
        place,
        node: None,
        own: vec![(own, 1.0)],
        partners: Vec::new(),
        directed: vec![Default::default(); D],
        further: vec![terms],
        sectors: None,
        frame,
        gap: 0.0,
        area: 1.0,
        part: 0,
        pool,
        slip_bound: SlipBound::Tied,
        compliance: [0.0; 2],
    }
}

impl<const D: usize> Definition<D>
where
    ElementKind: Space<D>,
{
    /// The state of all such rows at a time, where 1 is the end of the first load step; `pair_of` has the contact of each row.
    pub(super) fn driven(&self, pairs: &[PairData<D>], pair_of: &[u32], time: f64) -> Vec<Driven> {
        let step = step_of(time);
        let parts: Vec<(EntityKind, usize)> = (self.connections())
            .map(|(number, part)| (part.facts().kind, number))
            .collect();
        let mut all = Vec::new();
        let mut before = None;
        let mut within = 0;
        for (row, &pair) in pair_of.iter().enumerate() {
            within = if before == Some(pair) { within + 1 } else { 0 };
            before = Some(pair);
            let Some(drive) = pairs[pair as usize].drives.get(within) else {
                continue;
            };
            let (kind, number) = parts[pair as usize];
            let under = |factors: &Option<Vec<f64>>| {
                let factor = self.factor(factors, time);
                let motion = drive.motion.map(|motion| factor * drive.size * motion);
                (motion, factor * drive.force / drive.size, false)
            };
            let (motion, force, locked) = match kind {
                EntityKind::Preload => self.preloads[number].state(self, time),
                EntityKind::Coupling => under(self.couplings[number].load_factors()),
                EntityKind::Equation => under(self.equations[number].load_factors()),
                _ => {
                    let support = &self.supports[number];
                    match support.acts(step) {
                        true if !support.locks(step) => under(&support.factors),
                        acts => (None, 0.0, acts),
                    }
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

    /// Adds the loads of preloads and couplings at a time.
    pub(super) fn add_driven(
        &self,
        body: &Body<D>,
        time: f64,
        forces: &mut [[f64; D]],
    ) -> Result<(), ModelError> {
        for (preload, section) in self.preloads.iter().zip(&self.sections) {
            let (_, tension, _) = preload.state(self, time);
            if tension != 0.0 {
                section.pull(tension, forces);
            }
        }
        for (number, coupling) in self.couplings.iter().enumerate() {
            let factor = self.factor(coupling.load_factors(), time);
            coupling
                .push(body, self.carrier(number), factor, forces)
                .map_err(|fault| coupling.entity(number).error(fault))?;
        }
        Ok(())
    }
}
