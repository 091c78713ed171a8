//! The data that change from load step to load step.

use std::sync::Arc;

/// The load of a contact problem, and the origins of gap and slip: a small value beside a [`System`](super::System). Each
/// request to the dual operator has its f.
#[derive(Clone, Debug)]
pub struct LoadCase {
    /// f.
    pub(crate) force: Arc<Vec<f64>>,
    /// d.
    pub(crate) gap: Vec<f64>,
    /// The origin of slip: T u minus this is the slip, an entry per row of T.
    pub(crate) slip_origin: Vec<f64>,
    /// g, where it is given.
    pub(crate) slip_bound: Vec<f64>,
    /// μ, length m, 0 where the slip bound is given; empty without Coulomb friction.
    pub(crate) friction: Arc<Vec<f64>>,
    /// ‖forces that act on the bodies‖: ‖f‖ without the contribution of prescribed displacements.
    pub(crate) acting: f64,
    /// For each unknown the largest displacement of its body before this load step, which determines the rounding of
    /// differences. None at rest, on all ranks.
    pub(crate) travelled: Option<Arc<Vec<f64>>>,
    /// λ before this load step, the source of errors in the origin of slip; empty at rest.
    pub(crate) before: Vec<f64>,
}

impl LoadCase {
    /// From rest, with the size of the acting forces: f may be larger, by the contribution of prescribed displacements, and
    /// may be distributed over ranks.
    pub(crate) fn new(
        force: Vec<f64>,
        acting: f64,
        gap: Vec<f64>,
        slip_origin: Vec<f64>,
        slip_bound: Vec<f64>,
    ) -> Self {
        Self {
            acting,
            force: Arc::new(force),
            gap,
            slip_origin,
            slip_bound,
            friction: Arc::default(),
            travelled: None,
            before: Vec::new(),
        }
    }

    /// f, with an entry per row of K. Clones of a load case share it.
    pub fn force(&self) -> &Arc<Vec<f64>> {
        &self.force
    }

    /// (d, origin of slip): c in r = c − B u, length D m.
    pub fn offsets(&self) -> Vec<f64> {
        [&self.gap[..], &self.slip_origin].concat()
    }
}
