//! Bodies of revolution: the allowed entries of their models, and their axis.

use super::Definition;
use super::entities::{Part as _, Support};
use super::error::{Entity, EntityKind, Fault, ModelError};
use crate::contact::Space;
use crate::elasticity::Plane;
use crate::mesh::vector::length;
use crate::mesh::{ElementKind, Location, Mesh};

/// The name of the set of nodes on the axis, and of the support that holds them there.
const AXIS: &str = "axis of revolution";
/// Nodes this close to the axis, relative to the size of the mesh, are on it: files have six digits at least.
pub(super) const ON_AXIS: f64 = 1e-6;

impl<const D: usize> Definition<D> {
    fn is_of_revolution(&self) -> bool {
        D == 2 && self.plane() == Plane::Axisymmetric
    }

    /// Checks that the entries are consistent with a body of revolution, if the model is one.
    pub(super) fn check_revolution(&self) -> Result<(), ModelError> {
        if !self.is_of_revolution() {
            return Ok(());
        }
        let whole = (self.thickness() != 1.0).then(|| Entity::all(EntityKind::Thickness));
        let own = self.own_thicknesses().map(|(entity, _)| entity);
        if let Some(entity) = whole.into_iter().chain(own).next() {
            let text = "a body of revolution has no thickness: forces are for the whole ring; leave it out";
            return Err(entity.error(text));
        }
        if self.analysis.gravity.is_some_and(|g| g[0] != 0.0) {
            let text = "gravity of a body of revolution acts along its axis, y";
            return Err(Entity::all(EntityKind::Gravity).error(text));
        }
        if let Some(rotation) = &self.analysis.rotation
            && rotation.axis().across([0.0; D])[0] != 0.0
        {
            let text = "a body of revolution rotates about its axis, x = 0: leave point out";
            return Err(Entity::all(EntityKind::Rotation).error(text));
        }
        let text = "in a body of revolution x is radial and y axial, and nothing acts around its axis: leave out axis \
                    and its components";
        let held = |support: &Support<D>| support.axis.is_some();
        if let Some(number) = self.supports.iter().position(held) {
            return Err(self.supports[number].entity(number).error(text));
        }
        if let Some(number) = self.tractions.iter().position(|t| t.axis.is_some()) {
            return Err(self.tractions[number].entity(number).error(text));
        }
        if let Some(first) = self.cyclics.first() {
            let text = "a body of revolution has no sectors";
            return Err(first.entity(0).error(text));
        }
        Ok(())
    }

    /// Moves nodes on the axis of a body of revolution exactly onto it and holds them there: a ring around them cannot
    /// open.
    pub(super) fn hold_axis(&mut self, mesh: &mut Mesh<D>) -> Result<(), ModelError>
    where
        ElementKind: Space<D>,
    {
        if !self.is_of_revolution() {
            return Ok(());
        }
        let (low, high) = mesh.bounding_box();
        let same = ON_AXIS * length(std::array::from_fn::<_, D, _>(|c| high[c] - low[c]));
        let mut on_axis = Vec::new();
        for (number, x) in (0..).zip(&mut mesh.nodes) {
            if x[0] < -same {
                return Err(Entity::all(EntityKind::Model).error(Fault::Stated(format!(
                    "the node at {} is beyond the axis of revolution, x = 0: draw the half with x ≥ 0",
                    Location::from(*x)
                ))));
            }
            if x[0] <= same {
                x[0] = 0.0;
                on_axis.push(number);
            }
        }
        if !on_axis.is_empty() {
            mesh.node_sets.insert(AXIS.to_owned(), on_axis);
            self.supports.push(Support::at_nodes(AXIS).x(0.0));
        }
        Ok(())
    }

    /// The way from the axis of its rotation, if it has one, to a point.
    pub(super) fn arm(&self, x: [f64; D]) -> [f64; D] {
        match &self.analysis.rotation {
            _ if self.is_of_revolution() => {
                std::array::from_fn(|c| if c == 0 { x[0] } else { 0.0 })
            }
            Some(rotation) => rotation.axis().across(x),
            None => [0.0; D],
        }
    }

    /// Of a node: whether the axis of a body of revolution passes through it.
    pub(super) fn is_on_axis(&self, x: [f64; D]) -> bool {
        self.is_of_revolution() && x[0] == 0.0
    }
}
