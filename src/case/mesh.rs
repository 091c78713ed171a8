//! The mesh of a case.

use super::build::BuildError;
use super::{BoxTable, Case, CaseError, MeshTable, PartTable, RectangleTable, RotateTable};
use crate::mesh::{self, AnyMesh, ElementKind, Mesh, Topology, structured};
use crate::model::{Axis, Definition, Quantity, as_vector};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// The source of a mesh.
enum Source<'a> {
    /// A file, the factor for its coordinates, and the cell array that names its regions.
    File(&'a Path, f64, Option<&'a str>),
    Rectangle(&'a RectangleTable),
    Box(&'a BoxTable),
}

impl Source<'_> {
    /// The dimension of its mesh, if it is known without a file.
    fn dimension(&self) -> Option<usize> {
        match self {
            Self::File(..) => None,
            Self::Rectangle(_) => Some(2),
            Self::Box(_) => Some(3),
        }
    }
}

/// The sources of a mesh that a table states.
struct Stated<'a> {
    file: &'a Option<PathBuf>,
    scale: Option<f64>,
    cell_data: &'a Option<String>,
    rectangle: &'a Option<RectangleTable>,
    block: &'a Option<BoxTable>,
}

impl MeshTable {
    fn source(&self) -> Result<Source<'_>, String> {
        let stated = Stated {
            file: &self.file,
            scale: self.scale,
            cell_data: &self.cell_data,
            rectangle: &self.rectangle,
            block: &self.block,
        };
        stated.source("[mesh]")
    }
}

impl PartTable {
    fn source(&self) -> Result<Source<'_>, String> {
        let stated = Stated {
            file: &self.file,
            scale: self.scale,
            cell_data: &self.cell_data,
            rectangle: &self.rectangle,
            block: &self.block,
        };
        stated.source("a [[mesh.part]]")
    }
}

impl<'a> Stated<'a> {
    /// The one source in a table; `what` is the name of that table.
    fn source(self, what: &str) -> Result<Source<'a>, String> {
        let (name, source) = match (self.file, self.rectangle, self.block) {
            (Some(_), None, None) if self.scale.is_some_and(|s| !(s > 0.0 && s.is_finite())) => {
                return Err("scale must be a positive number".to_owned());
            }
            (Some(file), None, None) => {
                let groups = self.cell_data.as_deref();
                if groups.is_some() && !mesh::has_cell_arrays(file) {
                    return Err(
                        "cell_data applies only to .vtu files: other formats name their regions themselves"
                            .to_owned(),
                    );
                }
                return Ok(Source::File(file, self.scale.unwrap_or(1.0), groups));
            }
            (None, Some(rectangle), None) => ("rectangle", Source::Rectangle(rectangle)),
            (None, None, Some(block)) => ("box", Source::Box(block)),
            (None, None, None) => {
                return Err(format!(
                    "{what} describes no bodies: give it file, rectangle or, for a solid, box"
                ));
            }
            (file, rectangle, block) => {
                let stated = [
                    ("file", file.is_some()),
                    ("rectangle", rectangle.is_some()),
                    ("box", block.is_some()),
                ];
                let stated = stated.iter().filter(|place| place.1).map(|place| place.0);
                let stated: Vec<&str> = stated.collect();
                return Err(format!(
                    "{what} has {}: keep one, or make each a [[mesh.part]] with a name",
                    stated.join(" and ")
                ));
            }
        };
        if self.cell_data.is_some() {
            return Err("cell_data applies only to .vtu files".to_owned());
        }
        if self.scale.is_some() {
            return Err(format!(
                "scale applies only to mesh files: give the {name} its size in metres"
            ));
        }
        match &source {
            Source::Rectangle(r) => check_cells(name, r.origin, r.size, r.cells)?,
            Source::Box(b) => check_cells(name, b.origin, b.size, b.cells)?,
            Source::File(..) => {}
        }
        Ok(source)
    }
}

/// Checks that a rectangle or a box can be divided into cells.
fn check_cells<const D: usize>(
    name: &str,
    origin: [f64; D],
    size: [f64; D],
    cells: [usize; D],
) -> Result<(), String> {
    let nodes = cells.iter().map(|&c| c as f64 + 1.0).product::<f64>();
    if !size.iter().all(|&s| s > 0.0 && s.is_finite())
        || cells.contains(&0)
        || !origin.iter().all(|o| o.is_finite())
    {
        Err(format!(
            "the {name} needs positive sizes and numbers of cells"
        ))
    } else if nodes > 4e8 {
        Err(format!("the {name} has more than 4e8 nodes"))
    } else {
        Ok(())
    }
}

impl Case {
    /// The order of elements that a table asks for, checked.
    fn order(&self, at: &str, order: Option<usize>) -> Result<Option<usize>, CaseError> {
        match order {
            None | Some(1 | 2) => Ok(order),
            Some(_) => {
                let at = format!("{at}.order");
                self.invalid(&at, "order is the order of the elements: 1 or 2")
            }
        }
    }

    /// Checks `[mesh]` and its tables, without the files; returns its dimension, if known.
    pub(super) fn check_mesh(&self) -> Result<Option<usize>, CaseError> {
        let Some(mesh) = &self.tables.mesh else {
            return Ok(None);
        };
        self.order(MESH, mesh.order)?;
        if mesh.part.is_empty() {
            return match mesh.source() {
                Ok(source) => Ok(source.dimension()),
                Err(problem) => self.invalid(MESH, problem),
            };
        }
        if mesh.file.is_some()
            || mesh.rectangle.is_some()
            || mesh.block.is_some()
            || mesh.scale.is_some()
            || mesh.cell_data.is_some()
        {
            return self.invalid(
                MESH,
                "[mesh] has parts: put file, scale, rectangle and box into a [[mesh.part]]",
            );
        }
        let mut names: Vec<&str> = Vec::new();
        let mut dimension = None;
        for (number, part) in mesh.part.iter().enumerate() {
            let at = &part_at(number);
            self.order(at, part.order)?;
            let here = match part.source() {
                Ok(source) => source.dimension(),
                Err(problem) => return self.invalid(at, problem),
            };
            if part.name.is_empty() || names.contains(&part.name.as_str()) {
                return self.invalid(
                    at,
                    format!(
                        "the name \"{}\" of the part is empty or used twice",
                        part.name
                    ),
                );
            }
            if let Some(shift) = &part.shift
                && !shift.iter().all(|v| v.is_finite())
            {
                return self.invalid(&format!("{at}.shift"), "shift needs finite numbers");
            }
            if dimension.is_some() && here.is_some() && dimension != here {
                return self.invalid(at, MIXED);
            }
            dimension = dimension.or(here);
            names.push(&part.name);
        }
        Ok(dimension)
    }

    /// The mesh of an elastic case, its parts side by side.
    ///
    /// # Errors
    /// If there is none, or a file cannot be read.
    pub fn mesh(&self) -> Result<AnyMesh, BuildError> {
        if let Some(mesh) = &self.given {
            return Ok(match mesh.clone() {
                AnyMesh::Plane(mesh) => AnyMesh::Plane(self.given_mesh(mesh)?),
                AnyMesh::Space(mesh) => AnyMesh::Space(self.given_mesh(mesh)?),
            });
        }
        let Some(table) = &self.tables.mesh else {
            return Ok(self.invalid("", "the case has no [mesh]")?);
        };
        let order = self.order(MESH, table.order)?;
        if table.part.is_empty() {
            return self.part(MESH, table.source(), order);
        }
        let mut whole: Option<AnyMesh> = None;
        for (number, part) in table.part.iter().enumerate() {
            let at = &part_at(number);
            let order = self.order(at, part.order)?.or(order);
            let mesh = self.part(at, part.source(), order)?;
            whole = Some(match (whole, mesh) {
                (None, AnyMesh::Plane(mesh)) => AnyMesh::Plane(self.placed(at, part, mesh)?),
                (None, AnyMesh::Space(mesh)) => AnyMesh::Space(self.placed(at, part, mesh)?),
                (Some(AnyMesh::Plane(before)), AnyMesh::Plane(mesh)) => {
                    AnyMesh::Plane(self.joined(at, before, self.placed(at, part, mesh)?)?)
                }
                (Some(AnyMesh::Space(before)), AnyMesh::Space(mesh)) => {
                    AnyMesh::Space(self.joined(at, before, self.placed(at, part, mesh)?)?)
                }
                _ => return Ok(self.invalid(at, MIXED)?),
            });
        }
        Ok(whole.expect("there are parts"))
    }

    /// The given mesh, with the order and size of the table.
    fn given_mesh<const D: usize>(&self, mesh: Mesh<D>) -> Result<Mesh<D>, CaseError>
    where
        ElementKind: Topology<D>,
    {
        let Some(table) = &self.tables.mesh else {
            return Ok(mesh);
        };
        let order = self.order(MESH, table.order)?;
        let definition: Definition<D> = self.said()?;
        // Forces act on the nodes they are stated for: other nodes would change their sum.
        let loaded: Vec<&str> = (definition.forces.iter())
            .flat_map(|force| force.sets())
            .map(String::as_str)
            .collect();
        let counts = |mesh: &Mesh<D>| -> Vec<usize> {
            let sets = loaded.iter().map(|&name| mesh.node_sets.get(name));
            sets.map(|set| set.map_or(0, Vec::len)).collect()
        };
        let before = counts(&mesh);
        let mut mesh = match order {
            Some(1) => {
                let made = mesh.linear();
                made.or_else(|error| self.invalid(MESH, error.to_string()))?
            }
            _ => self.raised(MESH, mesh, order)?,
        };
        let after = counts(&mesh);
        if let Some(number) = (0..before.len()).find(|&number| before[number] != after[number]) {
            let message = format!(
                "another order gives the set \"{}\" {} nodes instead of {}, and the stated force acts on each: state \
                 a traction",
                loaded[number], after[number], before[number]
            );
            return self.invalid(MESH, message);
        }
        if let Some(scale) = table.scale {
            mesh.place_nodes(|x| x.map(|x| scale * x));
        }
        Ok(mesh)
    }

    /// Numbers as a vector in the dimension of the future mesh.
    fn vector<const D: usize>(&self, at: &str, entries: &[f64]) -> Result<[f64; D], CaseError> {
        as_vector(entries).or_else(|message| self.invalid(at, message))
    }

    /// The axis of a part's rotation.
    fn axis<const D: usize>(&self, at: &str, table: &RotateTable) -> Result<Axis<D>, CaseError> {
        let point = table.point.as_ref();
        let point = point.map(|point| self.vector(&format!("{at}.point"), point));
        let way = &format!("{at}.axis");
        let direction = match &table.axis {
            Some(_) if D == 2 => {
                let text =
                    "in the plane an axis is a point, perpendicular to the plane: leave out axis";
                return self.invalid(way, text);
            }
            None if D == 3 => {
                let text = "in space an axis is needed: axis = [x, y, z], its direction";
                return self.invalid(at, text);
            }
            axis => axis.as_ref().map(|axis| self.vector(way, axis)),
        };
        let point = point.transpose()?.unwrap_or([0.0; D]);
        Ok(Axis::through(point, direction.transpose()?))
    }

    /// A part of the mesh where it belongs, under its name.
    fn placed<const D: usize>(
        &self,
        at: &str,
        part: &PartTable,
        mut mesh: Mesh<D>,
    ) -> Result<Mesh<D>, CaseError>
    where
        ElementKind: Topology<D>,
    {
        if let Some(table) = &part.rotate {
            let at = &format!("{at}.rotate");
            let axis = self.axis::<D>(at, table)?;
            if let Some(fault) = axis.fault() {
                return self.invalid(at, fault);
            }
            if !table.angle.is_finite() {
                return self.invalid(at, "the angle must be finite");
            }
            mesh.place_nodes(|x| axis.turned(x, table.angle.to_radians()));
        }
        if let Some(shift) = &part.shift {
            mesh.shift(self.vector(&format!("{at}.shift"), shift)?);
        }
        let named = |name: &str| format!("{}-{name}", part.name);
        let region = |name: &str| match part.file {
            None => part.name.clone(),
            Some(_) => named(name),
        };
        mesh.rename(region, named);
        Ok(mesh)
    }

    /// A part of the mesh, joined to those before it.
    fn joined<const D: usize>(
        &self,
        at: &str,
        before: Mesh<D>,
        mesh: Mesh<D>,
    ) -> Result<Mesh<D>, CaseError>
    where
        ElementKind: Topology<D>,
    {
        match structured::shared_name(&before, &mesh) {
            None => Ok(structured::join(before, mesh)),
            Some(name) => self.invalid(
                at,
                format!(
                    "two parts have a region or boundary called \"{name}\": give the parts other names"
                ),
            ),
        }
    }

    fn part(
        &self,
        at: &str,
        source: Result<Source, String>,
        order: Option<usize>,
    ) -> Result<AnyMesh, BuildError> {
        Ok(match source {
            Ok(Source::File(file, scale, groups)) => {
                let path = self.beside(file);
                match order {
                    Some(1) => mesh::read_linear(&path, scale, groups)?,
                    _ => match mesh::read(&path, scale, groups)? {
                        AnyMesh::Plane(mesh) => AnyMesh::Plane(self.raised(at, mesh, order)?),
                        AnyMesh::Space(mesh) => AnyMesh::Space(self.raised(at, mesh, order)?),
                    },
                }
            }
            // A map that bends the sides also bends their midside nodes.
            Ok(Source::Rectangle(r)) => {
                let mesh = structured::rectangle(r.origin, r.size, r.cells, r.shape, "body", "");
                let mesh = self.raised(at, mesh, order)?;
                AnyMesh::Plane(self.mapped(at, "rectangle", mesh, &r.map)?)
            }
            Ok(Source::Box(b)) => {
                let mesh = structured::block(b.origin, b.size, b.cells, b.shape, "body", "");
                let mesh = self.raised(at, mesh, order)?;
                AnyMesh::Space(self.mapped(at, "box", mesh, &b.map)?)
            }
            Err(problem) => self.invalid(at, problem)?,
        })
    }

    /// The mesh with elements of second order, if these are wanted.
    fn raised<const D: usize>(
        &self,
        at: &str,
        mesh: Mesh<D>,
        order: Option<usize>,
    ) -> Result<Mesh<D>, CaseError>
    where
        ElementKind: Topology<D>,
    {
        match order {
            Some(2) => (mesh.raised()).or_else(|error| self.invalid(at, error.to_string())),
            _ => Ok(mesh),
        }
    }

    /// A structured mesh, bent by its table.
    fn mapped<const D: usize>(
        &self,
        at: &str,
        name: &str,
        mut mesh: Mesh<D>,
        map: &Option<[Quantity<D>; D]>,
    ) -> Result<Mesh<D>, CaseError>
    where
        ElementKind: Topology<D>,
    {
        let Some(map) = map else {
            return Ok(mesh);
        };
        (mesh.nodes.par_iter_mut())
            .for_each(|place| *place = std::array::from_fn(|c| map[c].at(*place)));
        let turned = (mesh.elements.par_iter())
            .filter(|element| mesh.measure(element) < 0.0)
            .count();
        if turned != 0 && turned != mesh.elements.len() {
            return self.invalid(at, format!("map folds the {name} over itself"));
        }
        Mesh::new(mesh.nodes, mesh.elements, mesh.regions, mesh.boundaries)
            .or_else(|error| self.invalid(at, format!("map: {error}")))
    }
}

/// The table of the mesh.
const MESH: &str = "mesh";

/// One of its parts.
fn part_at(number: usize) -> String {
    format!("{MESH}.part[{number}]")
}

/// Parts that do not go together.
const MIXED: &str = "the parts of a mesh must all be plane (rectangles, files with surfaces) or all solid (boxes, \
                     files with volumes): this one differs from those before it";
