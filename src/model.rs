//! Models of elastic bodies in contact: materials, supports, loads and contacts.
//!
//! A [`Model`] states on a mesh, in the plane or in space, the tables of a case file, and case files are built by it.
//! [`Model::build`] checks it, assembles K, f, N, T, d and g, and finds the bodies that only contact holds; [`Elastic::step`] gives
//! the load of each step.
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
mod carrier;
mod changes;
mod contacts;
mod coupled;
mod coupling;
mod cyclic;
mod driven;
mod elastic;
mod entities;
mod equation;
mod error;
mod holding;
mod large;
mod loads;
mod motion;
mod nodal;
mod pair;
mod preload;
mod quantity;
mod revolution;
#[cfg(feature = "mpi")]
pub(crate) mod share;
mod spring;
mod stated;
mod stated_gap;
mod supports;
#[cfg(test)]
mod tests;
mod units;
mod wear;

pub use analysis::{Analysis, AnyAnalysis};
pub use axis::Axis;
#[cfg(feature = "mpi")]
pub use build::Draft;
pub use build::{AnyBuilt, Built};
pub use changes::Changes;
pub use contacts::PairData;
pub use coupling::Coupling;
pub use cyclic::Cyclic;
pub use driven::{Drive, Driven};
pub use elastic::Elastic;
pub use entities::{BodyForce, Equal, Force, Foundation, Names, Support, Temperature, Traction};
pub use equation::Equation;
pub use error::{Entity, EntityKind, Fault, ModelError};
pub(crate) use large::{Configuration, Deformation, Help, Moment, turned_with};
pub use loads::{StepData, TemperatureField};
pub use motion::Motion;
pub use pair::Pair;
pub use preload::Preload;
pub use quantity::Quantity;
pub use spring::Spring;
pub use units::Units;
pub(crate) use wear::{Cycles, JUMP, Wearing};

#[cfg(feature = "case")]
pub(crate) use entities::AXES;
pub(crate) use entities::{Filling, Part};
#[cfg(feature = "case")]
pub(crate) use error::{nearest, without_boundaries};
#[cfg(feature = "case")]
pub(crate) use quantity::Number;
#[cfg(feature = "case")]
pub(crate) use stated::{MEANING, as_vector, exactly};

use crate::elasticity::{Material, Plane};
use crate::mesh::{ElementKind, Mesh, Topology};
use crate::problem::{SIZES, is_sized};
use serde::{Deserialize, Serialize};

/// A model under construction: a mesh and its definition. Numbers are in any consistent units.
#[derive(Clone, Debug)]
pub struct Model<const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    pub(crate) mesh: Mesh<D>,
    pub(crate) definition: Definition<D>,
}

/// The definition of a model apart from its mesh: the tables of a case file.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Definition<const D: usize = 2> {
    /// None: not stated.
    #[serde(serialize_with = "units::labels")]
    pub(crate) units: Option<Units>,
    #[serde(default)]
    pub(crate) analysis: Whole<D>,
    #[serde(default, rename = "material")]
    pub(crate) materials: Vec<Filling>,
    #[serde(default, rename = "support")]
    pub(crate) supports: Vec<Support<D>>,
    #[serde(default, rename = "foundation")]
    pub(crate) foundations: Vec<Foundation<D>>,
    #[serde(default, rename = "traction")]
    pub(crate) tractions: Vec<Traction<D>>,
    #[serde(default, rename = "body_force")]
    pub(crate) body_forces: Vec<BodyForce<D>>,
    #[serde(default, rename = "force")]
    pub(crate) forces: Vec<Force<D>>,
    #[serde(default, rename = "temperature")]
    pub(crate) temperatures: Vec<Temperature<D>>,
    #[serde(default, rename = "contact")]
    pub(crate) pairs: Vec<Pair<D>>,
    #[serde(default, rename = "tie", deserialize_with = "pair::ties")]
    pub(crate) ties: Vec<Pair<D>>,
    #[serde(default, rename = "equal")]
    pub(crate) equals: Vec<Equal<D>>,
    #[serde(default, rename = "spring")]
    pub(crate) springs: Vec<Spring<D>>,
    #[serde(default, rename = "preload")]
    pub(crate) preloads: Vec<Preload<D>>,
    #[serde(default, rename = "coupling")]
    pub(crate) couplings: Vec<Coupling<D>>,
    #[serde(default, rename = "cyclic")]
    pub(crate) cyclics: Vec<Cyclic<D>>,
    #[serde(default, rename = "equation")]
    pub(crate) equations: Vec<Equation<D>>,
    /// Of preloads, once the mesh is cut.
    #[serde(skip)]
    pub(crate) sections: Vec<preload::Section<D>>,
    /// The nodes that are added for each coupling, once they are.
    #[serde(skip)]
    pub(crate) carriers: Vec<Vec<u32>>,
    /// None: one step with the factor 1.
    pub(crate) steps: Option<Steps>,
}

/// The properties of a model as a whole.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Whole<const D: usize = 2> {
    /// In the plane only; in space plane strain, which has the same moduli.
    #[serde(default, deserialize_with = "stated::plane::<_, D>")]
    pub(crate) plane: Option<Plane>,
    /// In the plane only.
    #[serde(default, deserialize_with = "stated::thickness::<_, D>")]
    pub(crate) thickness: Option<f64>,
    #[serde(
        default,
        deserialize_with = "stated::vector",
        serialize_with = "stated::entries"
    )]
    gravity: Option<[f64; D]>,
    rotation: Option<Rotation<D>>,
    #[serde(default, skip_serializing_if = "stated::is_default")]
    pub(crate) geometry: Geometry,
}

/// The size of displacements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Geometry {
    /// So small that balance is computed at the original positions of the bodies.
    #[default]
    Small,
    /// Balance, contact and friction hold at the displaced positions of the bodies.
    Large,
}

/// A steady rotation.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields, expecting = "a table such as { speed = 100 }")]
pub(crate) struct Rotation<const D: usize = 2> {
    /// On the axis; None: the origin.
    #[serde(
        default,
        deserialize_with = "stated::vector",
        serialize_with = "stated::entries"
    )]
    point: Option<[f64; D]>,
    /// Of any length; in space only.
    #[serde(default, deserialize_with = "stated::axis::<_, D>")]
    axis: Option<[f64; 3]>,
    speed: f64,
}

impl<const D: usize> Rotation<D> {
    fn axis(&self) -> Axis<D> {
        Axis::through(self.point.unwrap_or([0.0; D]), self.axis)
    }
}

/// Load steps, one after another.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Steps {
    /// The factors of loads and prescribed displacements in each step.
    pub factors: Vec<f64>,
    /// How often the steps are made; None: once.
    pub cycles: Option<usize>,
    /// Of cycles with wear: those are left out between which at most this part of it moves elsewhere; None: 0.05.
    pub jump: Option<f64>,
}

/// The plane.
impl Model {
    /// Sets the behaviour perpendicular to the plane.
    pub fn plane(mut self, plane: Plane) -> Self {
        self.definition.analysis.plane = Some(plane);
        self
    }

    /// The thickness in m to which forces refer; 1 by default. Bodies of revolution have none: forces are for the whole
    /// ring.
    pub fn thickness(mut self, thickness: f64) -> Self {
        self.definition.analysis.thickness = Some(thickness);
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
        let filling = Filling::of(None, material);
        self.definition.materials.push(filling);
        self
    }

    /// Gives one or several regions, or groups of regions, their material.
    pub fn material_in(mut self, region: impl Into<Names>, material: Material) -> Self {
        let filling = Filling::of(Some(region.into()), material);
        self.definition.materials.push(filling);
        self
    }

    /// An acceleration in m/s², which acts where a material has a density.
    pub fn gravity(mut self, acceleration: [f64; D]) -> Self {
        self.definition.analysis.gravity = Some(acceleration);
        self
    }

    /// Adds prescribed displacements.
    pub fn support(mut self, support: Support<D>) -> Self {
        self.definition.supports.push(support);
        self
    }

    /// Adds an elastic foundation.
    pub fn foundation(mut self, foundation: Foundation<D>) -> Self {
        self.definition.foundations.push(foundation);
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

    /// A steady rotation about an axis, in rad/s, as its centrifugal force, which acts where a material has a density.
    /// The bodies are seen from a frame that turns with them. Load factors multiply the force, not the speed.
    pub fn rotation(mut self, axis: Axis<D>, speed: f64) -> Self {
        let (point, axis) = axis.stated();
        self.definition.analysis.rotation = Some(Rotation {
            point: Some(point),
            axis,
            speed,
        });
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

    /// Adds a spring.
    pub fn spring(mut self, spring: Spring<D>) -> Self {
        self.definition.springs.push(spring);
        self
    }

    /// Adds the preload of a bolt, which cuts the mesh.
    pub fn preload(mut self, preload: Preload<D>) -> Self {
        self.definition.preloads.push(preload);
        self
    }

    /// Adds nodes that move with a point.
    pub fn coupling(mut self, coupling: Coupling<D>) -> Self {
        self.definition.couplings.push(coupling);
        self
    }

    /// Adds the sides of a sector that repeats itself.
    pub fn cyclic(mut self, cyclic: Cyclic<D>) -> Self {
        self.definition.cyclics.push(cyclic);
        self
    }

    /// Adds an equation between displacements.
    pub fn equation(mut self, equation: Equation<D>) -> Self {
        self.definition.equations.push(equation);
        self
    }

    /// Load steps in order: the factors of loads, gravity and prescribed displacements in each, where they have no
    /// factors of their own.
    pub fn steps(mut self, factors: impl Into<Vec<f64>>) -> Self {
        self.definition.steps.get_or_insert_default().factors = factors.into();
        self
    }

    /// The load steps ([`Model::steps`]) are made this often, one cycle after another. Where contacts wear ([`Pair::wear`]), cycles are
    /// left out over which at most the part `jump` of the wear moves elsewhere; 0 computes all.
    pub fn cycles(mut self, count: usize, jump: f64) -> Self {
        let steps = self.definition.steps.get_or_insert_default();
        (steps.cycles, steps.jump) = (Some(count), Some(jump));
        self
    }

    /// Displacements may be large: bodies turn and bend, and balance, contact and friction hold at their final positions.
    pub fn large_displacements(mut self) -> Self {
        self.definition.analysis.geometry = Geometry::Large;
        self
    }

    /// Sets the names of lengths and forces in results.
    pub fn units(mut self, units: Units) -> Self {
        self.definition.units = Some(units);
        self
    }
}

/// Parts of a kind with their numbers.
fn numbered<P: Part>(all: &[P]) -> impl Iterator<Item = (usize, &dyn Part)> {
    let parts = all.iter().map(|part| -> &dyn Part { part });
    parts.enumerate()
}

impl<const D: usize> Definition<D> {
    /// All parts of the kinds that may have several, kind by kind, each with its number among those of its kind. A new
    /// kind is added here, and nowhere else in this room.
    pub(crate) fn parts(&self) -> impl Iterator<Item = (usize, &dyn Part)> {
        let lasting =
            numbered(&self.supports).filter(|(number, _)| !self.supports[*number].changes());
        (numbered(&self.materials).chain(lasting))
            .chain(numbered(&self.foundations))
            .chain(numbered(&self.tractions))
            .chain(numbered(&self.body_forces))
            .chain(numbered(&self.forces))
            .chain(numbered(&self.temperatures))
            .chain(self.connections())
    }

    /// Those that have rows of contact, in the order of these.
    fn connections(&self) -> impl Iterator<Item = (usize, &dyn Part)> {
        numbered(&self.pairs)
            .chain(numbered(&self.ties))
            .chain(numbered(&self.equals))
            .chain(numbered(&self.springs))
            .chain(numbered(&self.preloads))
            .chain(numbered(&self.couplings))
            .chain(numbered(&self.cyclics))
            .chain(numbered(&self.equations))
            .chain(numbered(&self.supports).filter(|(number, _)| self.supports[*number].changes()))
    }

    /// The behaviour perpendicular to the plane.
    pub(crate) fn plane(&self) -> Plane {
        self.analysis.plane.unwrap_or_default()
    }

    /// Whether displacements may be large.
    pub(crate) fn is_large(&self) -> bool {
        self.analysis.geometry == Geometry::Large
    }

    /// 1 in space.
    pub(crate) fn thickness(&self) -> f64 {
        self.analysis.thickness.unwrap_or(1.0)
    }

    /// Number of load steps.
    pub(crate) fn n_steps(&self) -> usize {
        self.steps.as_ref().map_or(1, |steps| steps.factors.len())
    }

    /// How often they are made.
    pub(crate) fn cycles(&self) -> Cycles {
        (self.steps.as_ref()).map_or(Cycles::ONCE, |steps| Cycles {
            count: steps.cycles.unwrap_or(1),
            jump: steps.jump.unwrap_or(JUMP),
        })
    }

    /// The factor, at a time, of a part with these factors of its own: 1 is the end of the first load step, 2 that of the second.
    /// From one end to the next, and from 0 at the time 0, it varies linearly with time.
    fn factor(&self, own: &Option<Vec<f64>>, time: f64) -> f64 {
        let whole = self.steps.as_ref().map(|steps| &steps.factors);
        let factors = own.as_ref().or(whole);
        let at_end = |step: usize| match step {
            0 => 0.0,
            _ => (factors.and_then(|factors| factors.get(step - 1)).copied()).unwrap_or(1.0),
        };
        let end = time.ceil();
        let last = at_end(end as usize);
        match end - time {
            0.0 => last,
            left => last + left * (at_end(end as usize - 1) - last),
        }
    }

    /// The names of lengths and forces.
    pub(crate) fn units(&self) -> Units {
        self.units.clone().unwrap_or_default()
    }

    /// The thicknesses that regions have of their own.
    fn own_thicknesses(&self) -> impl Iterator<Item = (Entity, f64)> {
        (self.materials.iter().enumerate()).filter_map(|(number, material)| {
            let entity = material.entity(number).at("thickness");
            Some((entity, material.thickness?))
        })
    }

    /// Checks the thickness of all bodies, and those of regions.
    fn check_thickness(&self) -> Result<(), ModelError> {
        if let (3, Some((entity, _))) = (D, self.own_thicknesses().next()) {
            return Err(entity.error(stated::NO_THICKNESS));
        }
        let whole = (Entity::all(EntityKind::Thickness), self.thickness());
        for (entity, thickness) in std::iter::once(whole).chain(self.own_thicknesses()) {
            if !(thickness > 0.0 && thickness.is_finite()) {
                return Err(entity.error("thickness must be positive"));
            }
            if !is_sized(thickness) {
                return Err(entity.error(format!("thickness is {thickness:e}: {SIZES}")));
            }
        }
        Ok(())
    }

    /// Checks everything in the model that needs no mesh.
    pub(crate) fn check(&self) -> Result<(), ModelError> {
        self.check_parts()?;
        self.check_revolution()?;
        self.check_steps()
    }

    /// Every part is complete and consistent, and no contact is listed twice.
    pub(crate) fn check_parts(&self) -> Result<(), ModelError> {
        if let Some(fault) = self.units.as_ref().and_then(Units::fault) {
            return Err(Entity::all(EntityKind::Units).error(fault));
        }
        self.check_thickness()?;
        if let Some(rotation) = &self.analysis.rotation {
            let fault = match rotation.axis {
                None if D == 3 => {
                    Some("in space an axis is needed: axis = [x, y, z], its direction")
                }
                _ if !rotation.speed.is_finite() => {
                    Some("the speed of the rotation must be finite")
                }
                _ => rotation.axis().fault(),
            };
            if let Some(fault) = fault {
                return Err(Entity::all(EntityKind::Rotation).error(fault));
            }
        }
        if let Some((number, part, flaw)) =
            (self.parts()).find_map(|(number, part)| Some((number, part, part.fault()?)))
        {
            return Err(part.entity(number).at(flaw.key).error(flaw.text));
        }
        for (i, pair) in self.pairs.iter().enumerate() {
            if self.pairs[..i].iter().any(|other| pair.mirrors(other)) {
                return Err(pair.entity(i).error(
                    "this pair is already listed above with its sides swapped: name each pair once",
                ));
            }
            if pair.is_tie() {
                let text = "this is a tie: add it with Model::tie";
                return Err(pair.entity(i).error(text));
            }
        }
        match self.ties.iter().position(|tie| !tie.is_tie()) {
            Some(i) => {
                let text = "this is a contact, not a tie: make a tie with Pair::tied";
                Err(self.ties[i].entity(i).error(text))
            }
            None => Ok(()),
        }
    }

    /// There is at least one load step, and factors of a part's own are one for each step.
    fn check_steps(&self) -> Result<(), ModelError> {
        let finite = |factors: &[f64]| factors.iter().all(|f| f.is_finite());
        let unfit = |steps: &Steps| steps.factors.is_empty() || !finite(&steps.factors);
        if self.steps.as_ref().is_some_and(unfit) {
            return Err(Entity::all(EntityKind::Steps)
                .error("factors needs at least one number, all of them finite"));
        }
        let of_steps = |key, text: &str| Err(Entity::all(EntityKind::Steps).at(key).error(text));
        if self
            .steps
            .as_ref()
            .is_some_and(|steps| steps.cycles == Some(0))
        {
            return of_steps("cycles", "there is at least one cycle");
        }
        let jump = self.steps.as_ref().and_then(|steps| steps.jump);
        if jump.is_some_and(|jump| !(0.0..1.0).contains(&jump)) {
            return of_steps(
                "jump",
                "jump is a part of the wear: at least 0, and less than 1",
            );
        }
        let wears = self.pairs.iter().any(|pair| pair.wear.is_some());
        let repeats = self
            .steps
            .as_ref()
            .is_some_and(|steps| steps.cycles.is_some());
        if jump.is_some_and(|jump| jump > 0.0) && !(wears && repeats) {
            return of_steps(
                "jump",
                "jump leaves out cycles of contacts that wear: state cycles, and the wear of a contact, or leave it out",
            );
        }
        let n_steps = self.n_steps();
        for (number, part) in self.parts() {
            for (key, factors) in part.facts().factors {
                if factors.len() == n_steps && finite(factors) {
                    continue;
                }
                return Err(part.entity(number).at(key).error(match &self.steps {
                    None if key == "factors" => {
                        "factors apply to load steps: state the load steps, with their own factors"
                            .to_owned()
                    }
                    None => format!("{key} applies to load steps: state them under [steps]"),
                    Some(_) => {
                        format!("{key} needs {n_steps} finite numbers, one for each load step")
                    }
                }));
            }
        }
        Ok(())
    }
}
