//! Models of elastic bodies in contact: what they are made of, what holds and loads them, and what they may touch.
//!
//! A [`Model`] says on a mesh, in the plane or in space, what a case file says in its tables, and case files are built by it. [`Model::build`]
//! checks it, assembles K, f, N, T, d and g, and finds the bodies that nothing but contact holds; [`Elastic::step`]
//! gives the load of each step.
//!
//! A block of steel, held at one end, pressed on a rigid floor and pushed along it:
//!
//! ```
//! use signorini::contact::Obstacle;
//! use signorini::elasticity::Material;
//! use signorini::mesh::structured::{SolidShape, block};
//! use signorini::model::{Model, Pair, Support, Traction};
//! use signorini::ssnm::Status;
//!
//! let floor = Obstacle::HalfSpace { point: [0.0; 3], normal: [0.0, 0.0, 1.0] };
//! let mesh = block([0.0; 3], [3.0, 1.0, 1.0], [6, 2, 2], SolidShape::Hexahedron, "steel", "");
//! let built = Model::on(mesh)
//!     .material(Material::new(2.1e11, 0.3))
//!     .support(Support::on("left").fixed())
//!     .traction(Traction::on("top").z(|x: [f64; 3]| -1e7 * (1.0 + x[0])))
//!     .traction(Traction::on("right").y(3e6))
//!     .contact(Pair::obstacle("bottom", floor).tresca(3e6))
//!     .build()?;
//! let solution = built.solve(&Default::default())?.remove(0);
//! assert_eq!(solution.status, Status::Converged);
//! // λ = (λν, λτ): what each contact node presses with, then along both tangents of each.
//! let m = built.problem.m();
//! assert_eq!((m, solution.lambda.len()), (18, 3 * m));
//! let pressed: f64 = solution.lambda[..m].iter().sum();
//! assert!(pressed > 5e7 && pressed < 7.5e7);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod analysis;
mod arcs;
mod axis;
mod build;
mod contacts;
mod elastic;
mod entities;
mod error;
mod loads;
mod nodal;
mod pair;
mod quantity;
mod revolution;
#[cfg(feature = "mpi")]
pub(crate) mod share;
mod supports;
#[cfg(test)]
mod tests;
mod units;

pub use analysis::{Analysis, AnyAnalysis};
pub use axis::Axis;
#[cfg(feature = "mpi")]
pub use build::Draft;
pub use build::{AnyBuilt, Built};
pub use contacts::PairData;
pub use elastic::Elastic;
pub use entities::{BodyForce, Equal, Force, Names, Support, Temperature, Traction};
pub use error::{Entity, EntityKind, Fault, ModelError};
pub use loads::{StepData, TemperatureField};
pub use pair::Pair;
pub use quantity::Quantity;
pub use units::Units;

#[cfg(feature = "case")]
pub(crate) use entities::AXES;
#[cfg(feature = "case")]
pub(crate) use error::{nearest, without_boundaries};

use crate::elasticity::{Material, Plane};
use crate::mesh::{ElementKind, Mesh, Topology};
use crate::problem::{SIZES, is_sized};

/// A model on its way: a mesh, and what is said about it. Numbers are in any consistent units.
#[derive(Clone, Debug)]
pub struct Model<const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    pub(crate) mesh: Mesh<D>,
    pub(crate) definition: Definition<D>,
}

/// What is said of a model beside its mesh.
#[derive(Clone, Debug)]
pub(crate) struct Definition<const D: usize = 2> {
    /// With the region that each is in; None: all of them.
    pub(crate) materials: Vec<(Option<Names>, Material)>,
    /// In space plane strain, which has the same moduli.
    pub(crate) plane: Plane,
    /// 1 in space.
    pub(crate) thickness: f64,
    pub(crate) gravity: Option<[f64; D]>,
    pub(crate) supports: Vec<Support<D>>,
    pub(crate) tractions: Vec<Traction<D>>,
    pub(crate) body_forces: Vec<BodyForce<D>>,
    pub(crate) forces: Vec<Force<D>>,
    pub(crate) temperatures: Vec<Temperature<D>>,
    /// The axis and the angular velocity.
    pub(crate) rotation: Option<(Axis<D>, f64)>,
    pub(crate) pairs: Vec<Pair<D>>,
    pub(crate) ties: Vec<Pair<D>>,
    pub(crate) equals: Vec<Equal<D>>,
    /// The factors of the load steps; None: one step with the factor 1.
    pub(crate) steps: Option<Vec<f64>>,
    /// None: not stated.
    pub(crate) units: Option<Units>,
}

impl<const D: usize> Default for Definition<D> {
    fn default() -> Self {
        Self {
            materials: Vec::new(),
            plane: Plane::default(),
            thickness: 1.0,
            gravity: None,
            supports: Vec::new(),
            tractions: Vec::new(),
            body_forces: Vec::new(),
            forces: Vec::new(),
            temperatures: Vec::new(),
            rotation: None,
            pairs: Vec::new(),
            ties: Vec::new(),
            equals: Vec::new(),
            steps: None,
            units: None,
        }
    }
}

/// The plane.
impl Model {
    /// Says what happens perpendicular to the plane.
    pub fn plane(mut self, plane: Plane) -> Self {
        self.definition.plane = plane;
        self
    }

    /// The thickness in m that forces are for; 1 without. Bodies of revolution have none: forces are for the whole ring.
    pub fn thickness(mut self, thickness: f64) -> Self {
        self.definition.thickness = thickness;
        self
    }
}

impl<const D: usize> Model<D>
where
    ElementKind: Topology<D>,
{
    /// A model of the bodies of a mesh, with one load step; in the plane in plane strain and 1 thick.
    pub fn on(mesh: Mesh<D>) -> Self {
        Self {
            mesh,
            definition: Definition::default(),
        }
    }

    /// Gives all regions one material.
    pub fn material(mut self, material: Material) -> Self {
        self.definition.materials.push((None, material));
        self
    }

    /// Gives a region, a group of them, or several, their material.
    pub fn material_in(mut self, region: impl Into<Names>, material: Material) -> Self {
        let region = Some(region.into());
        self.definition.materials.push((region, material));
        self
    }

    /// An acceleration in m/s², which acts where a material has a density.
    pub fn gravity(mut self, acceleration: [f64; D]) -> Self {
        self.definition.gravity = Some(acceleration);
        self
    }

    /// Adds prescribed displacements.
    pub fn support(mut self, support: Support<D>) -> Self {
        self.definition.supports.push(support);
        self
    }

    /// Adds forces on a boundary.
    pub fn traction(mut self, traction: Traction<D>) -> Self {
        self.definition.tractions.push(traction);
        self
    }

    /// Adds forces in the volume.
    pub fn body_force(mut self, force: BodyForce<D>) -> Self {
        self.definition.body_forces.push(force);
        self
    }

    /// Adds forces on single nodes.
    pub fn force(mut self, force: Force<D>) -> Self {
        self.definition.forces.push(force);
        self
    }

    /// Makes bodies warmer.
    pub fn temperature(mut self, temperature: Temperature<D>) -> Self {
        self.definition.temperatures.push(temperature);
        self
    }

    /// A steady rotation about an axis, in rad/s, as its centrifugal force, which acts where a material has a density; the
    /// bodies are seen from a frame that turns with them. Load factors multiply the force, not the speed.
    pub fn rotation(mut self, axis: Axis<D>, speed: f64) -> Self {
        self.definition.rotation = Some((axis, speed));
        self
    }

    /// Adds a contact.
    pub fn contact(mut self, pair: Pair<D>) -> Self {
        self.definition.pairs.push(pair);
        self
    }

    /// Adds a tie: [`Pair::tied`].
    pub fn tie(mut self, pair: Pair<D>) -> Self {
        self.definition.ties.push(pair);
        self
    }

    /// Adds sets of nodes that move alike.
    pub fn equal(mut self, equal: Equal<D>) -> Self {
        self.definition.equals.push(equal);
        self
    }

    /// Load steps, one after another: what loads, gravity and prescribed displacements are multiplied by in each,
    /// where they have no factors of their own.
    pub fn steps(mut self, factors: impl Into<Vec<f64>>) -> Self {
        self.definition.steps = Some(factors.into());
        self
    }

    /// Says what results call lengths and forces.
    pub fn units(mut self, units: Units) -> Self {
        self.definition.units = Some(units);
        self
    }
}

impl<const D: usize> Definition<D> {
    /// Number of load steps.
    pub(crate) fn n_steps(&self) -> usize {
        self.steps.as_ref().map_or(1, Vec::len)
    }

    /// What something with these factors of its own is multiplied by in a step.
    fn factor(&self, own: &Option<Vec<f64>>, step: usize) -> f64 {
        let factors = own.as_ref().or(self.steps.as_ref());
        (factors.and_then(|factors| factors.get(step)).copied()).unwrap_or(1.0)
    }

    /// What lengths and forces are called.
    pub(crate) fn units(&self) -> Units {
        self.units.clone().unwrap_or_default()
    }

    /// Whether it can be meant, as far as that shows without the mesh.
    pub(crate) fn check(&self) -> Result<(), ModelError> {
        self.check_materials()?;
        if let Some(fault) = self.units.as_ref().and_then(Units::fault) {
            return Err(Entity::all(EntityKind::Units).error(fault));
        }
        if !(self.thickness > 0.0 && self.thickness.is_finite()) {
            return Err(Entity::all(EntityKind::Thickness).error("thickness must be positive"));
        }
        if !is_sized(self.thickness) {
            let text = format!("thickness is {:e}: {SIZES}", self.thickness);
            return Err(Entity::all(EntityKind::Thickness).error(text));
        }
        if let Some((axis, speed)) = &self.rotation {
            let finite = "the speed of the rotation must be finite";
            if let Some(fault) = axis.fault().or((!speed.is_finite()).then_some(finite)) {
                return Err(Entity::all(EntityKind::Rotation).error(fault));
            }
        }
        self.check_revolution()?;
        self.check_entities()?;
        self.check_steps()
    }

    /// The parts that it has so far can be meant.
    #[cfg(feature = "case")]
    pub(crate) fn check_parts(&self) -> Result<(), ModelError> {
        self.check_materials()?;
        self.check_entities()
    }

    /// Every material is one.
    fn check_materials(&self) -> Result<(), ModelError> {
        for (number, (_, m)) in self.materials.iter().enumerate() {
            let fault = if !(m.young > 0.0 && m.young.is_finite()) {
                format!("young is {}: it must be positive", m.young)
            } else if !is_sized(m.young) {
                format!("young is {:e}: {SIZES}", m.young)
            } else if !(m.poisson > -1.0 && m.poisson < 0.5) {
                format!(
                    "poisson is {}: it must lie between −1 and 0.5, both excluded",
                    m.poisson
                )
            } else if !m.expansion.is_finite() {
                format!("expansion is {}: it must be finite", m.expansion)
            } else if !(m.density >= 0.0 && m.density.is_finite()) {
                format!("density is {}: it must not be negative", m.density)
            } else {
                continue;
            };
            return Err(self.material_entity(number).error(fault));
        }
        Ok(())
    }

    fn material_entity(&self, number: usize) -> Entity {
        let regions = self.materials[number].0.as_ref();
        let place = regions.map_or(String::new(), |names| format!("of \"{names}\""));
        Entity::one(EntityKind::Material, number, place)
    }

    /// Every support, load and contact says enough and nothing impossible, and no contact stands twice.
    fn check_entities(&self) -> Result<(), ModelError> {
        let supports = (self.supports.iter().enumerate()).map(|(i, s)| (s.entity(i), s.fault()));
        let tractions = (self.tractions.iter().enumerate()).map(|(i, t)| (t.entity(i), t.fault()));
        let volume = (self.body_forces.iter().enumerate()).map(|(i, b)| (b.entity(i), b.fault()));
        let forces = (self.forces.iter().enumerate()).map(|(i, f)| (f.entity(i), f.fault()));
        let pairs = self.pairs.iter().enumerate().map(|(i, pair)| {
            let twice = self.pairs[..i].iter().any(|other| pair.mirrors(other));
            let twice = twice.then_some(
                "this contact stands above with its boundaries the other way round: name each pair once",
            );
            let stray = (pair.is_tie()).then_some("this is a tie: add it with Model::tie");
            (pair.entity(i), pair.fault().or(twice).or(stray))
        });
        let ties = (self.ties.iter().enumerate()).map(|(i, tie)| {
            let stray =
                (!tie.is_tie()).then_some("this is a contact and no tie: Pair::tied makes one");
            (tie.entity(i), tie.fault().or(stray))
        });
        let equals = (self.equals.iter().enumerate()).map(|(i, e)| (e.entity(i), e.fault()));
        let mut all = (supports.chain(tractions).chain(volume))
            .chain(forces)
            .chain(pairs)
            .chain(ties)
            .chain(equals);
        match all.find_map(|(entity, fault)| Some(entity.error(fault?))) {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }

    /// There is at least one load step, and factors of its own that something has are one for each.
    fn check_steps(&self) -> Result<(), ModelError> {
        let finite = |factors: &[f64]| factors.iter().all(|f| f.is_finite());
        if (self.steps.as_ref()).is_some_and(|steps| steps.is_empty() || !finite(steps)) {
            return Err(Entity::all(EntityKind::Steps)
                .error("factors needs at least one number, all of them finite"));
        }
        let supports = (self.supports.iter().enumerate()).map(|(i, s)| (s.entity(i), &s.factors));
        let tractions = (self.tractions.iter().enumerate()).map(|(i, t)| (t.entity(i), &t.factors));
        let volume = (self.body_forces.iter().enumerate()).map(|(i, b)| (b.entity(i), &b.factors));
        let forces = (self.forces.iter().enumerate()).map(|(i, f)| (f.entity(i), &f.factors));
        let warmth = (self.temperatures.iter().enumerate()).map(|(i, t)| (t.entity(i), &t.factors));
        let n_steps = self.n_steps();
        for (entity, factors) in (supports.chain(tractions).chain(volume))
            .chain(forces)
            .chain(warmth)
        {
            let Some(factors) = factors else { continue };
            if factors.len() == n_steps && finite(factors) {
                continue;
            }
            return Err(entity.error(match &self.steps {
                None => {
                    "factors belong to load steps: say what these are, with factors of their own"
                        .to_owned()
                }
                Some(_) => {
                    format!("factors needs {n_steps} finite numbers, one for each load step")
                }
            }));
        }
        Ok(())
    }
}
