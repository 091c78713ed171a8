//! The energy of the bodies at the end of a step, and the work on them in it.

use super::OfBodies;
use crate::contact::Space;
use crate::elasticity::Deformed;
use crate::mesh::ElementKind;
use crate::rigid::{self, Rotation};
use serde::Serialize;

/// Strain energy and work in a load step, in the unit of force times that of length; in the plane of the whole thickness, around an axis of
/// the whole ring.
///
/// Work is that of the mean of the forces at the beginning and at the end of the step (trapezoidal rule). Where displacements are
/// small, the strain energy has changed by the sum of all work. Where they are large, the difference is of third order in the length
/// of the step. There, couplings do the work of the forces and moments at their points, and none on the shape of their nodes. Friction that begins or turns round within a step does half of its work or none by this rule: its dissipation is
/// [`ContactReport::slipping_work`](super::ContactReport::slipping_work).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct EnergyReport {
    /// The strain energy of the bodies at the end of the step.
    pub strain: f64,
    /// The work of the loads on the bodies in the step, also of those on points of couplings.
    pub loads: f64,
    /// The work of supports and foundations.
    pub supports: f64,
    /// The work of contacts, ties, springs and all other joints: below 0 where friction dissipates or springs store, above 0 where
    /// obstacles or stated motions of joints push, interferences are pressed apart or bolts are tightened.
    pub contacts: f64,
}

impl EnergyReport {
    fn of([strain, loads, supports, contacts]: [f64; 4]) -> Self {
        Self {
            strain,
            loads,
            supports,
            contacts,
        }
    }

    /// In the order of its fields.
    pub fn all(&self) -> [f64; 4] {
        [self.strain, self.loads, self.supports, self.contacts]
    }

    /// The sum over ranks.
    #[cfg(feature = "mpi")]
    pub(crate) fn combined(self, sum: impl FnOnce(&mut [f64])) -> Self {
        let mut all = self.all();
        sum(&mut all);
        Self::of(all)
    }
}

/// The forces on all nodes at the end of a step.
pub(crate) struct NodalForces<const D: usize> {
    pub loads: Vec<[f64; D]>,
    /// Of supports and foundations.
    pub supports: Vec<[f64; D]>,
    /// Of contacts and joints.
    pub contacts: Vec<[f64; D]>,
    /// Where displacements are large, of points of couplings. They have no part in the others: where bodies turn by much, forces on nodes
    /// that hold each other would do work in a step.
    pub points: Vec<PointMotion>,
}

/// A motion of a point, along an axis or about it in rad.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PointMotion {
    pub pair: u32,
    pub component: usize,
    pub motion: f64,
    /// Those of the load and of the joint: forces or moments.
    pub forces: [f64; 2],
}

/// How far the motions of one point have gone since those `before`, which are zero at rest. Rotations go on from where they were.
fn gone_on<const D: usize>(now: &[PointMotion], before: &[PointMotion]) -> Vec<f64> {
    let from: Vec<f64> = (0..now.len())
        .map(|k| before.get(k).map_or(0.0, |before| before.motion))
        .collect();
    let to: Vec<f64> = now.iter().map(|point| point.motion).collect();
    let mut far: Vec<f64> = to.iter().zip(&from).map(|(to, from)| to - from).collect();
    let first = now.partition_point(|point| point.component < D);
    if now.len() - first == rigid::count(D) - D {
        let [to, from] = [to, from].map(|all| Rotation::<D>::by(&all[first..]));
        let turn = to.after_back(&from).vector_near(&far[first..]);
        far.splice(first.., turn);
    }
    far
}

/// Displacements and forces at the end of the step before, D numbers a node; empty if that is the state at rest.
#[derive(Debug, Default)]
pub(super) struct Before {
    displacement: Vec<f64>,
    /// Of loads, supports and contacts.
    forces: [Vec<f64>; 3],
    points: Vec<PointMotion>,
}

/// The energy of the first so many nodes, and the work on them since `before`, which becomes the present state. None where
/// temperatures act: they do work of their own.
pub(super) fn energy<const D: usize>(
    of: &OfBodies<D>,
    forces: NodalForces<D>,
    own: usize,
    before: &mut Before,
) -> Option<EnergyReport>
where
    ElementKind: Space<D>,
{
    if !of.data.temperature.is_none() {
        return None;
    }
    let displacement = &of.fields.displacement[..own];
    let flat = |of_nodes: &[[f64; D]]| of_nodes[..own].as_flattened().to_vec();
    let now = Before {
        displacement: flat(displacement),
        forces: [forces.loads, forces.supports, forces.contacts].map(|all| flat(&all)),
        points: forces.points,
    };
    let at = |values: &[f64], i: usize| values.get(i).copied().unwrap_or(0.0);
    let work = |kind: usize| -> f64 {
        let (here, there) = (&now.forces[kind], &before.forces[kind]);
        let each = here.iter().zip(&now.displacement).enumerate();
        each.map(|(i, (force, u))| 0.5 * (force + at(there, i)) * (u - at(&before.displacement, i)))
            .sum()
    };
    let [mut loads, supports, mut contacts] = [0, 1, 2].map(work);
    let mut earlier = before.points.as_slice();
    for points in now.points.chunk_by(|a, b| a.pair == b.pair) {
        let there;
        (there, earlier) = earlier.split_at(points.len().min(earlier.len()));
        for (k, (point, far)) in points.iter().zip(gone_on::<D>(points, there)).enumerate() {
            let at_begin = there.get(k).map_or([0.0; 2], |point| point.forces);
            for (work, (force, there)) in [&mut loads, &mut contacts]
                .into_iter()
                .zip(point.forces.iter().zip(at_begin))
            {
                *work += 0.5 * (force + there) * far;
            }
        }
    }
    let strain = match of.elastic.is_large() {
        true => {
            let body = of.elastic.body();
            Deformed::new(&body, displacement, None).resistance().energy
        }
        // Clapeyron's theorem.
        false => {
            let all = now.forces.iter();
            let of_kind = |forces: &Vec<f64>| {
                let each = forces.iter().zip(&now.displacement);
                each.map(|(force, u)| 0.5 * force * u).sum::<f64>()
            };
            all.map(of_kind).sum()
        }
    };
    *before = now;
    Some(EnergyReport::of([strain, loads, supports, contacts]))
}
