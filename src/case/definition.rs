//! What the tables of a case say as parts of a model, in the dimension of its mesh.

use super::tables::{
    AxisTable, BodyForceTable, ContactTable, EqualTable, ForceTable, FrictionTable, MaterialTable,
    ObstacleTable, OverlapTable, RotationTable, SupportTable, TemperatureTable, TieTable,
    TractionTable,
};
use super::{NumberOrExpression, Tables};
use crate::contact::Obstacle;
use crate::elasticity::Material;
use crate::model::{
    AXES, Axis, BodyForce, Definition, Entity, EntityKind, Equal, Force, Names, Pair, Quantity,
    Support, Temperature, Traction, Units,
};
use serde::Deserialize;
use std::ops::Range;
use toml::Spanned;

/// Why something cannot be meant, and where in the text it stands.
pub(super) type Wrong = (Range<usize>, String);

/// What D dimensions are called.
pub(super) fn called<const D: usize>() -> &'static str {
    match D {
        2 => "the plane",
        _ => "space",
    }
}

/// The two spellings of names.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "expected the name of a boundary in quotes, or a list of names"
)]
enum Spelling {
    One(String),
    Several(Vec<String>),
}

impl<'de> Deserialize<'de> for Names {
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Ok(match Spelling::deserialize(from)? {
            Spelling::One(name) => name.into(),
            Spelling::Several(names) => names.into(),
        })
    }
}

/// A list of numbers as a point or a vector.
pub(super) fn vector<const D: usize>(list: &Spanned<Vec<f64>>) -> Result<[f64; D], Wrong> {
    let entries = list.get_ref();
    <[f64; D]>::try_from(entries.as_slice()).map_err(|_| {
        let found = entries.len();
        let message = format!(
            "expected {D} entries, found {found}: the mesh is one of {}",
            called::<D>()
        );
        (list.span(), message)
    })
}

/// A number or an expression as a quantity.
pub(super) fn quantity<const D: usize>(
    value: &Spanned<NumberOrExpression>,
) -> Result<Quantity<D>, Wrong> {
    let quantity = value.get_ref().quantity();
    quantity.map_err(|message| (value.span(), message))
}

/// A part of a model with what a table may say of it, if it does.
fn with<T, V: Clone>(part: T, value: &Option<V>, say: impl Fn(T, V) -> T) -> T {
    match value {
        Some(value) => say(part, value.clone()),
        None => part,
    }
}

/// The same for a number or an expression.
fn with_quantity<T, const D: usize>(
    part: T,
    value: &Option<Spanned<NumberOrExpression>>,
    say: impl Fn(T, Quantity<D>) -> T,
) -> Result<T, Wrong> {
    Ok(match value {
        Some(value) => say(part, quantity(value)?),
        None => part,
    })
}

/// What a mesh of the plane has no use for among components along x, y and z and about an axis.
const NO_Z: &str = "z has no meaning here: the mesh is one of the plane, with x and y";
const NO_AXIAL: &str =
    "axial has no meaning here: the mesh is one of the plane, where there are radial and hoop";

/// The same for a component along each direction; `beyond` is the message about more of them than dimensions.
fn along_each<T, const D: usize>(
    mut part: T,
    components: [&Option<Spanned<NumberOrExpression>>; 3],
    beyond: &str,
    say: impl Fn(T, usize, Quantity<D>) -> T,
) -> Result<T, Wrong> {
    for (way, value) in components.into_iter().enumerate() {
        match value {
            Some(value) if way >= D => return Err((value.span(), beyond.to_owned())),
            _ => part = with_quantity(part, value, |part, value| say(part, way, value))?,
        }
    }
    Ok(part)
}

/// The axis of a table, if it states one.
fn axis<const D: usize>(table: &Option<Spanned<AxisTable>>) -> Result<Option<Axis<D>>, Wrong> {
    let Some(table) = table else { return Ok(None) };
    let AxisTable { point, direction } = table.get_ref();
    let point = vector::<D>(point)?;
    match direction {
        None if D == 3 => {
            let message = "an axis in space needs a direction: axis = { point = [x, y, z], direction = [x, y, z] }";
            Err((table.span(), message.to_owned()))
        }
        Some(direction) if D == 2 => {
            let message =
                "in the plane an axis is a point and stands upright: leave out the direction";
            Err((direction.span(), message.to_owned()))
        }
        _ => {
            let direction = direction.as_ref().map(vector::<3>).transpose()?;
            Ok(Some(Axis::through(
                point,
                direction.unwrap_or([0.0, 0.0, 1.0]),
            )))
        }
    }
}

impl SupportTable {
    fn support<const D: usize>(&self, span: Range<usize>) -> Result<Support<D>, Wrong> {
        let support = match (&self.boundary, &self.nodes, &self.point) {
            (Some(names), None, None) => Support::on(names.clone()),
            (None, Some(sets), None) => Support::at_nodes(sets.clone()),
            (None, None, Some(point)) => Support::at_point(vector(point)?),
            _ => {
                let message = "a support needs one of boundary, nodes and point";
                return Err((span, message.to_owned()));
            }
        };
        let components = [&self.x, &self.y, &self.z];
        let support = along_each(support, components, NO_Z, Support::along)?;
        let components = [&self.radial, &self.hoop, &self.axial];
        let support = along_each(support, components, NO_AXIAL, Support::around)?;
        let mut support = with(support, &axis(&self.axis)?, Support::about);
        if self.symmetry {
            support = support.symmetry();
        }
        let support = with(support, &self.name, Support::named);
        Ok(with(support, &self.factors, Support::factors))
    }
}

impl TractionTable {
    fn traction<const D: usize>(&self) -> Result<Traction<D>, Wrong> {
        let traction = Traction::on(self.boundary.clone());
        let traction = along_each(traction, [&self.x, &self.y, &self.z], NO_Z, Traction::along)?;
        let traction = with_quantity(traction, &self.pressure, Traction::pressure)?;
        let components = [&self.radial, &self.hoop, &self.axial];
        let traction = along_each(traction, components, NO_AXIAL, Traction::around)?;
        let traction = with(traction, &axis(&self.axis)?, Traction::about);
        let traction = with(traction, &self.torque, Traction::torque);
        let force = self.force.as_ref().map(vector).transpose()?;
        let traction = with(traction, &force, Traction::force);
        let traction = with(traction, &self.name, Traction::named);
        Ok(with(traction, &self.factors, Traction::factors))
    }
}

/// An axis, stated by a point (the origin if left out) and, in space, a direction.
pub(super) fn stated_axis<const D: usize>(
    point: &Option<Spanned<Vec<f64>>>,
    direction: &Option<Spanned<Vec<f64>>>,
    whole: Range<usize>,
) -> Result<Axis<D>, Wrong> {
    let point = point.as_ref().map(vector).transpose()?.unwrap_or([0.0; D]);
    match direction {
        None if D == 3 => Err((
            whole,
            "in space there has to be an axis: axis = [x, y, z], its direction".to_owned(),
        )),
        Some(direction) if D == 2 => Err((
            direction.span(),
            "in the plane an axis is a point and stands upright: leave out axis".to_owned(),
        )),
        None => Ok(Axis::through(point, [0.0, 0.0, 1.0])),
        Some(direction) => Ok(Axis::through(point, vector::<3>(direction)?)),
    }
}

impl TemperatureTable {
    fn temperature<const D: usize>(&self) -> Result<Temperature<D>, Wrong> {
        let value = quantity(&self.value)?;
        let temperature = match &self.region {
            Some(name) => Temperature::within(name, value),
            None => Temperature::everywhere(value),
        };
        let temperature = with(temperature, &self.name, Temperature::named);
        Ok(with(temperature, &self.factors, Temperature::factors))
    }
}

impl ForceTable {
    fn force<const D: usize>(&self, span: Range<usize>) -> Result<Force<D>, Wrong> {
        let force = match (&self.boundary, &self.nodes, &self.point) {
            (Some(names), None, None) => Force::on(names.clone()),
            (None, Some(sets), None) => Force::at_nodes(sets.clone()),
            (None, None, Some(point)) => Force::at_point(vector(point)?),
            _ => {
                let message = "a force needs one of nodes, point and boundary";
                return Err((span, message.to_owned()));
            }
        };
        let force = along_each(force, [&self.x, &self.y, &self.z], NO_Z, Force::along)?;
        let force = with(force, &self.name, Force::named);
        Ok(with(force, &self.factors, Force::factors))
    }
}

impl BodyForceTable {
    fn body_force<const D: usize>(&self) -> Result<BodyForce<D>, Wrong> {
        let force = match &self.region {
            Some(name) => BodyForce::within(name),
            None => BodyForce::everywhere(),
        };
        let force = along_each(force, [&self.x, &self.y, &self.z], NO_Z, BodyForce::along)?;
        let force = with(force, &self.name, BodyForce::named);
        Ok(with(force, &self.factors, BodyForce::factors))
    }
}

impl ObstacleTable {
    /// Its key, and those of the dimension that it has none of the shapes of.
    fn names(&self) -> (&'static str, &'static str) {
        const PLANE: &str = "half_plane or circle";
        const SPACE: &str = "half_space, sphere or cylinder";
        match self {
            Self::HalfPlane { .. } => ("half_plane", SPACE),
            Self::Circle { .. } => ("circle", SPACE),
            Self::HalfSpace { .. } => ("half_space", PLANE),
            Self::Sphere { .. } => ("sphere", PLANE),
            Self::Cylinder { .. } => ("cylinder", PLANE),
        }
    }

    /// The shape, if it is one of D dimensions.
    fn shape<const D: usize>(&self) -> Option<Obstacle<D>> {
        fn of<const D: usize>(vector: &[f64]) -> Option<[f64; D]> {
            vector.try_into().ok()
        }
        Some(match self {
            Self::HalfPlane { point, normal } => Obstacle::HalfSpace {
                point: of(point)?,
                normal: of(normal)?,
            },
            Self::HalfSpace { point, normal } => Obstacle::HalfSpace {
                point: of(point)?,
                normal: of(normal)?,
            },
            Self::Circle { center, radius } => Obstacle::Sphere {
                center: of(center)?,
                radius: *radius,
            },
            Self::Sphere { center, radius } => Obstacle::Sphere {
                center: of(center)?,
                radius: *radius,
            },
            Self::Cylinder {
                point,
                axis,
                radius,
            } => Obstacle::Cylinder {
                point: of(point)?,
                axis: of(axis)?,
                radius: *radius,
            },
        })
    }
}

impl ContactTable {
    fn pair<const D: usize>(&self, span: Range<usize>) -> Result<Pair<D>, Wrong> {
        let boundary = match (&self.boundary, &self.nodes) {
            (Some(names), None) | (None, Some(names)) => names.clone(),
            _ => {
                let message = "a contact needs a boundary or, instead of it, nodes";
                return Err((span, message.to_owned()));
            }
        };
        let mut pair = match (&self.against, &self.obstacle) {
            (Some(against), None) => Pair::new(boundary, against.clone()),
            (None, Some(obstacle)) => {
                let (name, others) = obstacle.get_ref().names();
                let shape = obstacle.get_ref().shape().ok_or_else(|| {
                    let place = called::<D>();
                    let message = format!(
                        "{name} is no obstacle in {place}, which the mesh is one of: write {others}"
                    );
                    (obstacle.span(), message)
                })?;
                Pair::obstacle(boundary, shape)
            }
            (None, None) => {
                let message = "a contact needs either against (another boundary) or an obstacle";
                return Err((span, message.to_owned()));
            }
            (Some(_), Some(_)) => {
                let message =
                    "a contact is either against a boundary or with an obstacle: keep one";
                return Err((span, message.to_owned()));
            }
        };
        if self.nodes.is_some() {
            pair = pair.by_nodes();
        }
        pair = match &self.friction {
            FrictionTable::None => pair,
            FrictionTable::Tresca(bound) => pair.tresca(quantity(bound)?),
            FrictionTable::Coulomb(coefficient) => pair.coulomb(quantity(coefficient)?),
        };
        pair = with_quantity(pair, &self.gap, Pair::gap)?;
        pair = with_quantity(pair, &self.interference, Pair::interference)?;
        if let Some(OverlapTable::Interference) = self.overlap {
            pair = pair.overlap_as_interference();
        }
        if let Some(stiffness) = &self.stiffness {
            pair = with_quantity(pair, &stiffness.normal, Pair::normal_stiffness)?;
            pair = with_quantity(pair, &stiffness.tangential, Pair::tangential_stiffness)?;
        }
        pair = with(pair, &self.adjust, Pair::adjust);
        pair = with(pair, &self.offset, Pair::offset);
        pair = with(pair, &self.edge_angle, Pair::edge_angle);
        pair = with(pair, &self.name, Pair::named);
        Ok(with(pair, &self.search_distance, Pair::search_distance))
    }
}

impl TieTable {
    fn pair<const D: usize>(&self) -> Pair<D> {
        let pair = Pair::tied(self.boundary.clone(), self.against.clone());
        let pair = with(pair, &self.adjust, Pair::adjust);
        let pair = with(pair, &self.name, Pair::named);
        with(pair, &self.edge_angle, Pair::edge_angle)
    }
}

impl EqualTable {
    fn equal<const D: usize>(&self) -> Result<Equal<D>, Wrong> {
        let equal = with(Equal::of(self.sets.clone()), &self.name, Equal::named);
        let Some(directions) = &self.directions else {
            return Ok(equal);
        };
        let mut bound = [false; D];
        for direction in directions.get_ref().all() {
            let axis = AXES[..D].iter().position(|axis| axis == direction);
            let Some(axis) = axis else {
                let known = AXES[..D].join("\", \"");
                let message = format!("\"{direction}\" is none of the directions \"{known}\"");
                return Err((directions.span(), message));
            };
            bound[axis] = true;
        }
        Ok(equal.along(bound))
    }
}

impl Tables {
    /// What they say of a model on a mesh of D dimensions; if a table says nothing that can be meant, its place and
    /// why.
    pub(super) fn definition<const D: usize>(&self) -> Result<Definition<D>, Wrong> {
        let materials = self.material.iter().map(|table| {
            let &MaterialTable {
                ref region,
                young,
                poisson,
                density,
                expansion,
                incompressible,
                incompatible_modes,
            } = table.get_ref();
            let material = Material {
                young,
                poisson,
                density,
                expansion,
                incompressible,
                incompatible_modes,
            };
            (region.clone(), material)
        });
        let supports = (self.support.iter()).map(|table| table.get_ref().support(table.span()));
        let tractions = self.traction.iter().map(|table| table.get_ref().traction());
        let volume = (self.body_force.iter()).map(|table| table.get_ref().body_force());
        let forces = (self.force.iter()).map(|table| table.get_ref().force(table.span()));
        let warmth = (self.temperature.iter()).map(|table| table.get_ref().temperature());
        let pairs = (self.contact.iter()).map(|table| table.get_ref().pair(table.span()));
        let equals = (self.equal.iter()).map(|table| table.get_ref().equal());
        let analysis = &self.analysis;
        let plane = analysis.plane.as_ref().map(|p| ("plane", p.span()));
        let thickness = (analysis.thickness.as_ref()).map(|t| ("thickness", t.span()));
        if D == 3
            && let Some((name, span)) = plane.or(thickness)
        {
            let message = format!("{name} has no meaning for a solid: leave it out");
            return Err((span, message));
        }
        Ok(Definition {
            materials: materials.collect(),
            plane: (analysis.plane.as_ref()).map_or_else(Default::default, |p| *p.get_ref()),
            thickness: analysis.thickness.as_ref().map_or(1.0, |t| *t.get_ref()),
            gravity: analysis.gravity.as_ref().map(vector).transpose()?,
            supports: supports.collect::<Result<_, _>>()?,
            tractions: tractions.collect::<Result<_, _>>()?,
            body_forces: volume.collect::<Result<_, _>>()?,
            forces: forces.collect::<Result<_, _>>()?,
            temperatures: warmth.collect::<Result<_, _>>()?,
            rotation: self.rotation()?,
            pairs: pairs.collect::<Result<_, _>>()?,
            ties: (self.tie.iter())
                .map(|table| table.get_ref().pair())
                .collect(),
            equals: equals.collect::<Result<_, _>>()?,
            steps: self.factors().map(<[f64]>::to_vec),
            units: self.units(),
        })
    }

    /// The axis and the speed of the rotation, if there is one.
    fn rotation<const D: usize>(&self) -> Result<Option<(Axis<D>, f64)>, Wrong> {
        let Some(table) = &self.analysis.rotation else {
            return Ok(None);
        };
        let RotationTable { point, axis, speed } = table.get_ref();
        Ok(Some((stated_axis(point, axis, table.span())?, *speed)))
    }

    /// Those of the load steps.
    pub(super) fn factors(&self) -> Option<&[f64]> {
        (self.steps.as_ref()).map(|steps| steps.get_ref().factors.as_slice())
    }

    /// What lengths and forces are called, if it is said.
    pub(super) fn units(&self) -> Option<Units> {
        self.units.as_ref().map(|units| units.get_ref().clone())
    }

    /// Where what a model is made of stands in the file.
    pub(super) fn span(&self, entity: &Entity) -> Range<usize> {
        fn of<T>(tables: &[Spanned<T>], number: usize) -> Option<Range<usize>> {
            tables.get(number).map(Spanned::span)
        }
        let mesh = self.mesh.as_ref().map(Spanned::span);
        let number = entity.number.unwrap_or(0);
        let span = match entity.kind {
            EntityKind::Model => mesh,
            // A region without a material could stand behind the last.
            EntityKind::Material => match entity.number {
                Some(number) => of(&self.material, number),
                None => self.material.last().map(Spanned::span).or(mesh),
            },
            EntityKind::Gravity => of(&self.material, 0),
            EntityKind::Support => of(&self.support, number),
            EntityKind::Traction => of(&self.traction, number),
            EntityKind::BodyForce => of(&self.body_force, number),
            EntityKind::Force => of(&self.force, number),
            EntityKind::Temperature => of(&self.temperature, number),
            EntityKind::Rotation => self.analysis.rotation.as_ref().map(Spanned::span),
            EntityKind::Contact => of(&self.contact, number),
            EntityKind::Tie => of(&self.tie, number),
            EntityKind::Equal => of(&self.equal, number),
            EntityKind::Thickness => self.analysis.thickness.as_ref().map(Spanned::span),
            EntityKind::Steps => self.steps.as_ref().map(Spanned::span),
            EntityKind::Units => self.units.as_ref().map(Spanned::span),
        };
        span.unwrap_or(0..0)
    }
}
