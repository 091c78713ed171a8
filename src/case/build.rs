//! From a case to a contact problem.

use super::{
    Case, CaseError, FrictionTable, MeshTable, Names, ObstacleTable, Quantity, RectangleTable,
    Units, nearest,
};
use crate::contact::{
    ContactError, ContactNode, ContactRows, Friction, Obstacle, PairOptions, contact_rows,
    mortar_contact, obstacle_contact,
};
use crate::elasticity::{Body, Material, Plane, Unknowns, assemble, load_vector};
use crate::matrix_market::{self, MatrixMarketError};
use crate::mesh::gmsh::GmshError;
use crate::mesh::{BoundaryError, Mesh, gmsh, structured};
use crate::problem::{ContactData, ContactProblem, FreeBody, ProblemError};
use crate::quasistatic::Load;
use crate::sparse::norm;
use std::collections::HashSet;
use std::ops::Range;
use std::path::PathBuf;
use std::time::Instant;

/// A case could not be turned into a contact problem.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    #[error(transparent)]
    Case(#[from] CaseError),
    #[error(transparent)]
    Gmsh(#[from] GmshError),
    #[error(transparent)]
    Matrix(#[from] MatrixMarketError),
    #[error("{case}: {source}")]
    Problem { case: String, source: ProblemError },
    #[error("{case}: {message}")]
    Unsupported { case: String, message: String },
}

/// The elastic side of a case: what the results are written on.
#[derive(Debug)]
pub struct Elastic {
    pub mesh: Mesh,
    /// One per region.
    pub materials: Vec<Material>,
    pub plane: Plane,
    pub thickness: f64,
    /// The numbering of the unknowns, with the prescribed displacements of the first step.
    pub unknowns: Unknowns,
    /// What `[[support]]` tables prescribe: node, component, number of the table.
    pub held: Vec<(u32, usize, usize)>,
    /// The boundary or point of each of these tables.
    pub supports: Vec<String>,
    /// The rows of N and T with their contact nodes.
    pub contact: ContactRows,
    /// The contacts of the case, in its order.
    pub pairs: Vec<Pair>,
    /// Which pair each row belongs to.
    pub pair_of: Vec<u32>,
    /// What lengths and forces are called.
    pub units: Units,
    /// Whether the case says so itself.
    pub units_stated: bool,
}

/// A `[[contact]]` of the case as it was understood.
#[derive(Clone, Debug)]
pub struct Pair {
    /// The boundary that carries the multipliers; several in one text.
    pub boundary: String,
    /// Its edges.
    pub edges: Vec<[u32; 2]>,
    /// Those of the other boundary; none for an obstacle.
    pub others: Vec<[u32; 2]>,
    /// The other boundary, or what kind of obstacle.
    pub against: String,
    /// The obstacle, where there is no other boundary.
    pub obstacle: Option<Obstacle>,
    /// The law and its figure.
    pub friction: String,
    /// How far apart candidates for contact may be; with an obstacle, up to where Tresca's bound acts.
    pub search_distance: f64,
    /// Contact nodes.
    pub nodes: usize,
    /// Those of them within the search distance.
    pub within: usize,
    /// Those of them that a law of friction is stated for, but that supports or another contact keep from sliding.
    pub kept: usize,
    /// The area that may come into contact, in m².
    pub area: f64,
    /// The least and the largest initial gap, in m.
    pub gap: [f64; 2],
}

/// What a load step puts on the bodies.
#[derive(Clone, Debug)]
pub struct StepData {
    /// The common load factor.
    pub factor: f64,
    /// The numbering, with the prescribed displacements of the step.
    pub unknowns: Unknowns,
    /// Nodal forces of the step, two per node of the mesh.
    pub forces: Vec<[f64; 2]>,
    /// The resultant of all loads, in N.
    pub total_load: [f64; 2],
    /// The same for the solver.
    pub load: Load,
}

impl Elastic {
    /// The body as the elasticity functions want it.
    pub fn body(&self) -> Body<'_> {
        Body {
            mesh: &self.mesh,
            materials: &self.materials,
            plane: self.plane,
            thickness: self.thickness,
        }
    }
}

/// A contact problem made from a case.
#[derive(Debug)]
pub struct Build {
    /// The problem with the load of the first step.
    pub problem: ContactProblem,
    /// None for an algebraic case.
    pub elastic: Option<Elastic>,
    /// Seconds for the mesh, or the matrices, to be read or made.
    pub mesh_seconds: f64,
    /// Seconds for K, f and the contact rows.
    pub assembly_seconds: f64,
    /// The part of it for the search and the integrals of the contacts.
    pub pairing_seconds: f64,
}

impl Build {
    /// Which body one of [`ContactProblem::free_bodies`] is: its region and a point of it.
    pub fn free_body_name(&self, body: usize) -> String {
        let free = &self.problem.free_bodies().bodies[body];
        let Some(elastic) = &self.elastic else {
            let [x, y] = free.centre;
            return format!("the body around ({x:.4e}, {y:.4e})");
        };
        let mesh = &elastic.mesh;
        let node = elastic.unknowns.node(free.nodes[0] as usize);
        let region = (mesh.elements.iter())
            .find(|element| element.nodes().contains(&node))
            .map_or(0, |element| element.region);
        let [x, y] = mesh.nodes[node as usize];
        format!(
            "the body with region \"{}\" (at ({x:.4e}, {y:.4e}))",
            mesh.regions[region as usize]
        )
    }

    /// The bodies that only contact holds, and what they could do without.
    pub fn free_bodies(&self) -> Vec<String> {
        let bodies = self.problem.free_bodies().bodies.iter().enumerate();
        bodies
            .map(|(number, body)| {
                let name = self.free_body_name(number);
                format!("{name} can {} as a whole", body.freedom())
            })
            .collect()
    }
}

impl Case {
    /// Reads the mesh or the matrices and assembles the contact problem.
    pub fn build(&self) -> Result<Build, BuildError> {
        if self.tables.algebraic.is_some() {
            self.build_algebraic()
        } else {
            self.build_elastic()
        }
    }

    fn build_algebraic(&self) -> Result<Build, BuildError> {
        let start = Instant::now();
        let table = self
            .tables
            .algebraic
            .as_ref()
            .expect("checked by the caller")
            .get_ref();
        let matrix = |path| matrix_market::read(&self.beside(path));
        let vector = |path| matrix(path)?.into_vector();
        let stiffness = matrix(&table.stiffness)?;
        let (rows, cols) = (stiffness.rows, stiffness.cols);
        let coefficient = match &table.friction_coefficient {
            Some(path) => vector(path)?,
            None => Vec::new(),
        };
        let data = ContactData {
            stiffness: stiffness.into_stiffness()?,
            load: vector(&table.load)?,
            normal: matrix(&table.normal)?.into_csr(),
            tangential: matrix(&table.tangential)?.into_csr(),
            gap: vector(&table.gap)?,
            slip_bound: match &table.slip_bound {
                Some(path) => vector(path)?,
                None => coefficient.clone(),
            },
            coordinates: match &table.coordinates {
                Some(path) => Some(matrix(path)?.into_points()?),
                None => None,
            },
        };
        let failed = |source| BuildError::Problem {
            case: self.path.display().to_string(),
            source,
        };
        // Blocks round the sizes up to even numbers and would hide these.
        if rows != cols {
            return Err(failed(ProblemError::NotSquare { rows, cols }));
        }
        if data.load.len() != rows {
            return Err(failed(ProblemError::Length {
                name: "the load f",
                found: data.load.len(),
                expected: rows,
                reason: "one entry per row of K",
            }));
        }
        let mesh_seconds = start.elapsed().as_secs_f64();
        // Coefficients are checked as slip bounds are; the bounds themselves come from the normal forces.
        let mut problem = ContactProblem::new(data).map_err(failed)?;
        if !coefficient.is_empty() {
            let zero = vec![0.0; problem.m()];
            let (load, gap) = (problem.load().to_vec(), problem.gap().to_vec());
            problem = problem
                .with_data(load, gap, zero.clone(), zero)
                .with_friction_coefficient(coefficient);
        }
        let build = Build {
            problem,
            elastic: None,
            mesh_seconds,
            assembly_seconds: start.elapsed().as_secs_f64() - mesh_seconds,
            pairing_seconds: 0.0,
        };
        self.check_touched(&build)?;
        Ok(build)
    }

    /// A body that can move as a whole has to have a contact.
    fn check_touched(&self, build: &Build) -> Result<(), BuildError> {
        let problem = &build.problem;
        let touched = problem.touched();
        let free = &problem.free_bodies().bodies;
        let alone = |body: &FreeBody| !body.nodes.iter().any(|&node| touched[node as usize]);
        let Some(number) = free.iter().position(alone) else {
            return Ok(());
        };
        let text = format!(
            "{} can {} as a whole, and it has no contact to hold it",
            build.free_body_name(number),
            free[number].freedom()
        );
        if build.elastic.is_some() {
            let span = self.tables.support.first().map_or(0..0, |s| s.span());
            Ok(self.invalid(
                span,
                format!("{text}: add a [[support]], symmetry, or hold a point"),
            )?)
        } else {
            Err(BuildError::Unsupported {
                case: self.path.display().to_string(),
                message: format!("the stiffness matrix is singular: {text}"),
            })
        }
    }

    fn build_elastic(&self) -> Result<Build, BuildError> {
        let start = Instant::now();
        let table = self
            .tables
            .mesh
            .as_ref()
            .expect("checked when it was read")
            .get_ref();
        let mesh = self.mesh(table)?;
        let mesh_seconds = start.elapsed().as_secs_f64();

        let materials = self.materials(&mesh)?;
        let analysis = &self.tables.analysis;
        let body = Body {
            mesh: &mesh,
            materials: &materials,
            plane: analysis.plane,
            thickness: *analysis.thickness.get_ref(),
        };
        let (prescribed, held) = self.prescribed(&mesh, 0)?;
        let unknowns = Unknowns::new(prescribed);
        if unknowns.n_free() == 0 {
            let span = self.tables.support.first().map_or(0..0, |s| s.span());
            return Ok(self.invalid(
                span,
                "the supports hold every node: nothing is left to solve",
            )?);
        }
        let forces = self.forces(&body, 0)?;
        let mut pairs = Vec::new();
        let pairing = Instant::now();
        let (candidates, owner) = self.contact_nodes(&body, &mut pairs)?;
        let pairing_seconds = pairing.elapsed().as_secs_f64();
        let contact = contact_rows(&body, &unknowns, &candidates).or_else(|error| {
            let span = self.tables.contact.first().map_or(0..0, |c| c.span());
            self.invalid(span, error.to_string())
        })?;
        let pair_of: Vec<u32> = contact.candidate.iter().map(|&i| owner[i]).collect();
        self.foresee(&mesh, &contact)?;
        self.count_nodes(&contact, &pair_of, &mut pairs)?;
        let (stiffness, load) = assemble(&body, &unknowns, &forces);
        let n_free = unknowns.n_free();
        let gap = contact.gap(&unknowns);
        let failed = |source| BuildError::Problem {
            case: self.path.display().to_string(),
            source,
        };
        let problem = ContactProblem::new(ContactData {
            stiffness,
            load: load.clone(),
            normal: contact.normal.clone(),
            tangential: contact.tangential.clone(),
            gap: contact.nodes.iter().map(|node| node.gap).collect(),
            slip_bound: contact.slip_bound.clone(),
            coordinates: Some(unknowns.coordinates(&mesh)),
        })
        .map_err(failed)?
        .with_free_unknowns(n_free);
        let zero = vec![0.0; problem.m()];
        let problem = problem
            .with_areas(contact.nodes.iter().map(|node| node.area).collect())
            .with_data(load, gap, zero, contact.slip_bound.clone())
            .with_friction_coefficient(contact.coefficient.clone())
            .with_acting_forces(acting(&forces));
        let (plane, thickness) = (body.plane, body.thickness);
        let build = Build {
            problem,
            elastic: Some(Elastic {
                mesh,
                materials,
                plane,
                thickness,
                unknowns,
                held,
                supports: self.support_names(),
                contact,
                pairs,
                pair_of,
                units: self.units(),
                units_stated: self.tables.units.is_some(),
            }),
            mesh_seconds,
            assembly_seconds: start.elapsed().as_secs_f64() - mesh_seconds,
            pairing_seconds,
        };
        self.check_touched(&build)?;
        Ok(build)
    }

    /// The load at the end of a step, counted from 0; None for an algebraic case, which has one.
    pub fn step(&self, build: &Build, step: usize) -> Result<Option<StepData>, BuildError> {
        let Some(elastic) = &build.elastic else {
            return Ok(None);
        };
        let body = elastic.body();
        let unknowns = Unknowns::new(self.prescribed(&elastic.mesh, step)?.0);
        let forces = self.forces(&body, step)?;
        let mut total_load = [0.0; 2];
        for force in &forces {
            total_load[0] += force[0];
            total_load[1] += force[1];
        }
        let (_, slide) = elastic.contact.held_motion(&unknowns);
        Ok(Some(StepData {
            factor: self.factor(&None, step),
            total_load,
            load: Load {
                force: load_vector(&body, &unknowns, &forces),
                acting: acting(&forces),
                gap: elastic.contact.gap(&unknowns),
                slide,
            },
            unknowns,
            forces,
        }))
    }

    fn mesh(&self, table: &MeshTable) -> Result<Mesh, BuildError> {
        let span = self.tables.mesh.as_ref().map_or(0..0, |m| m.span());
        if table.part.is_empty() {
            return self.part(span, &table.file, table.scale, &table.rectangle);
        }
        let mut whole: Option<Mesh> = None;
        for part in &table.part {
            let (span, part) = (part.span(), part.get_ref());
            let mut mesh = self.part(span.clone(), &part.file, part.scale, &part.rectangle)?;
            mesh.shift(part.shift);
            let named = |name: &str| format!("{}-{name}", part.name);
            let region = |name: &str| match part.rectangle {
                Some(_) => part.name.clone(),
                None => named(name),
            };
            mesh.rename(region, named);
            let twice = whole.as_ref().and_then(|whole| {
                let group = mesh
                    .groups
                    .keys()
                    .find(|&name| whole.groups.contains_key(name));
                group.or(mesh
                    .boundaries
                    .keys()
                    .find(|&name| whole.boundaries.contains_key(name)))
            });
            if let Some(name) = twice {
                return Ok(self.invalid(
                    span,
                    format!("two parts have a region or boundary called \"{name}\": name the parts otherwise"),
                )?);
            }
            whole = Some(match whole {
                Some(whole) => structured::join(whole, mesh),
                None => mesh,
            });
        }
        Ok(whole.expect("there are parts"))
    }

    fn part(
        &self,
        span: Range<usize>,
        file: &Option<PathBuf>,
        scale: Option<f64>,
        rectangle: &Option<RectangleTable>,
    ) -> Result<Mesh, BuildError> {
        let r = match (file, rectangle) {
            (Some(file), _) => return Ok(gmsh::read(&self.beside(file), scale.unwrap_or(1.0))?),
            (None, Some(rectangle)) => rectangle,
            (None, None) => unreachable!("checked when it was read"),
        };
        let mut mesh = structured::rectangle(r.origin, r.size, r.cells, r.shape, "body", "");
        if let Some([x, y]) = &r.map {
            for place in &mut mesh.nodes {
                *place = [x.at(*place), y.at(*place)];
            }
            let turned = (mesh.elements.iter())
                .filter(|element| mesh.signed_area(element) < 0.0)
                .count();
            if turned != 0 && turned != mesh.elements.len() {
                return Ok(self.invalid(span, "map folds the rectangle over itself")?);
            }
            mesh = Mesh::new(mesh.nodes, mesh.elements, mesh.regions, mesh.boundaries)
                .or_else(|error| self.invalid(span, format!("map: {error}")))?;
        }
        Ok(mesh)
    }

    /// A boundary for what `wanted` lets pass: [`Mesh::edges`] or [`Mesh::outer_edges`].
    fn edges<'m>(
        &self,
        mesh: &'m Mesh,
        name: &str,
        span: Range<usize>,
        wanted: impl Fn(&'m Mesh, &str) -> Result<&'m [[u32; 2]], BoundaryError>,
    ) -> Result<&'m [[u32; 2]], CaseError> {
        match wanted(mesh, name) {
            Ok(edges) => return Ok(edges),
            Err(BoundaryError::Unknown(_)) => {}
            Err(error) => return self.invalid(span, error.to_string()),
        }
        let tables = self.tables.mesh.iter();
        let part = tables
            .flat_map(|mesh| &mesh.get_ref().part)
            .map(|part| format!("{}-", part.get_ref().name))
            .find(|part| name.starts_with(part))
            .unwrap_or_default();
        if !mesh.boundaries.keys().any(|known| known.starts_with(&part)) {
            let curve = &name[part.len()..];
            return self.invalid(
                span,
                format!(
                    "there is no boundary \"{name}\": the mesh file has no physical curves; add \
                     Physical Curve(\"{curve}\") = {{…}}; in Gmsh and save the mesh again"
                ),
            );
        }
        self.invalid(
            span,
            format!(
                "there is no boundary \"{name}\"; the mesh has {}{}",
                listed(mesh.boundaries.keys()),
                meant(name, mesh.boundaries.keys())
            ),
        )
    }

    /// The edges of several boundaries as of one.
    fn all_edges<'m>(
        &self,
        mesh: &'m Mesh,
        names: &Names,
        span: Range<usize>,
        wanted: impl Fn(&'m Mesh, &str) -> Result<&'m [[u32; 2]], BoundaryError>,
    ) -> Result<Vec<[u32; 2]>, CaseError> {
        let mut all = Vec::new();
        for name in names.all() {
            all.extend_from_slice(self.edges(mesh, name, span.clone(), &wanted)?);
        }
        all.sort_unstable();
        all.dedup();
        Ok(all)
    }

    /// The regions that a name stands for.
    fn region<'m>(
        &self,
        mesh: &'m Mesh,
        name: &str,
        span: Range<usize>,
    ) -> Result<&'m [u32], CaseError> {
        match mesh.groups.get(name) {
            Some(regions) => Ok(regions),
            None => self.invalid(
                span,
                format!(
                    "there is no region \"{name}\"; the mesh has {}{}",
                    listed(mesh.groups.keys()),
                    meant(name, mesh.groups.keys())
                ),
            ),
        }
    }

    fn materials(&self, mesh: &Mesh) -> Result<Vec<Material>, CaseError> {
        let tables = &self.tables.material;
        // With the name that has brought it.
        let mut materials: Vec<Option<(Material, &str)>> = vec![None; mesh.regions.len()];
        for table in tables {
            let m = table.get_ref();
            let material = Material {
                young: m.young,
                poisson: m.poisson,
                density: m.density,
            };
            match &m.region {
                Some(name) => {
                    for &region in self.region(mesh, name, table.span())? {
                        let place = &mut materials[region as usize];
                        let message = match place.replace((material, name)) {
                            Some((_, other)) if other == name => {
                                format!("region \"{name}\" has two materials")
                            }
                            Some((old, other)) if old != material => format!(
                                "regions \"{other}\" and \"{name}\" overlap: \"{}\" would have two materials; \
                                 give both the same, or groups that share no surface",
                                mesh.regions[region as usize]
                            ),
                            _ => continue,
                        };
                        return self.invalid(table.span(), message);
                    }
                }
                None if tables.len() == 1 => materials.fill(Some((material, ""))),
                None => {
                    return self.invalid(
                        table.span(),
                        format!(
                            "with several materials each needs its region: {}",
                            listed(mesh.groups.keys())
                        ),
                    );
                }
            }
        }
        materials
            .iter()
            .zip(&mesh.regions)
            .map(|(material, name)| match material {
                Some((material, _)) => Ok(*material),
                None => self.invalid(
                    tables.last().map_or(0..0, |t| t.span()),
                    format!("region \"{name}\" has no material"),
                ),
            })
            .collect()
    }

    /// The prescribed displacements of all nodes in a step, and which `[[support]]` has prescribed each
    /// component first.
    #[expect(clippy::type_complexity)]
    fn prescribed(
        &self,
        mesh: &Mesh,
        step: usize,
    ) -> Result<(Vec<[Option<f64>; 2]>, Vec<(u32, usize, usize)>), CaseError> {
        let mut prescribed = vec![[None; 2]; mesh.nodes.len()];
        let mut held = Vec::new();
        let (low, high) = mesh.bounding_box();
        let size = (high[0] - low[0]).hypot(high[1] - low[1]);
        for (number, table) in self.tables.support.iter().enumerate() {
            let (s, span) = (table.get_ref(), table.span());
            let factor = self.factor(&s.factors, step);
            let stated: [Option<&Quantity>; 2] = [s.x.as_ref(), s.y.as_ref()];
            const ZERO: Quantity = Quantity::Constant(0.0);
            let mut nodes: Vec<(u32, [Option<&Quantity>; 2])> = Vec::new();
            match (&s.boundary, s.point) {
                (Some(names), _) => {
                    for name in names.all() {
                        let edges = self.edges(mesh, name, span.clone(), Mesh::edges)?;
                        let along = |axis: usize| {
                            edges
                                .iter()
                                .all(|&e| mesh.edge_normal(e).1[axis].abs() > 1.0 - 1e-9)
                        };
                        let components = match s.symmetry {
                            false => stated,
                            true if along(0) => [Some(&ZERO), None],
                            true if along(1) => [None, Some(&ZERO)],
                            true => {
                                return self.invalid(
                                    span,
                                    format!("boundary \"{name}\" is not parallel to an axis: symmetry needs one that is"),
                                );
                            }
                        };
                        nodes.extend(edges.iter().flatten().map(|&node| (node, components)));
                    }
                }
                (None, Some(point)) => {
                    let distance = |x: &[f64; 2]| (x[0] - point[0]).hypot(x[1] - point[1]);
                    let nearest = (0..mesh.nodes.len())
                        .min_by(|&a, &b| {
                            distance(&mesh.nodes[a]).total_cmp(&distance(&mesh.nodes[b]))
                        })
                        .expect("a mesh has nodes");
                    let far = distance(&mesh.nodes[nearest]);
                    if !(far <= 0.05 * size) {
                        return self.invalid(
                            span,
                            format!("the node nearest to ({}, {}) is {far:.3e} away: is the point on the body?", point[0], point[1]),
                        );
                    }
                    nodes.push((nearest as u32, stated));
                }
                (None, None) => unreachable!("checked when it was read"),
            }
            for (node, components) in nodes {
                let x = mesh.nodes[node as usize];
                for (c, quantity) in components.iter().enumerate() {
                    let Some(quantity) = quantity else { continue };
                    let value = factor * quantity.at(x);
                    if !value.is_finite() {
                        return self.invalid(
                            span,
                            format!(
                                "the displacement is {value} at ({:.6e}, {:.6e})",
                                x[0], x[1]
                            ),
                        );
                    }
                    let place = &mut prescribed[node as usize][c];
                    if place.is_some_and(|old: f64| {
                        (old - value).abs() > 1e-12 * old.abs().max(value.abs())
                    }) {
                        return self.invalid(
                            span,
                            format!(
                                "two supports prescribe different displacements in {} at ({:.6e}, {:.6e})",
                                ["x", "y"][c], x[0], x[1]
                            ),
                        );
                    }
                    if place.replace(value).is_none() {
                        held.push((node, c, number));
                    }
                }
            }
        }
        Ok((prescribed, held))
    }

    /// The boundary or point of each `[[support]]`, with the component where it holds one.
    fn support_names(&self) -> Vec<String> {
        let name = |table: &toml::Spanned<super::SupportTable>| {
            let s = table.get_ref();
            let place = match (&s.boundary, s.point) {
                (Some(names), _) => names.to_string(),
                (None, point) => {
                    let [x, y] = point.unwrap_or_default();
                    format!("({x}, {y})")
                }
            };
            match (&s.x, &s.y) {
                (Some(_), None) => place + ", x",
                (None, Some(_)) => place + ", y",
                _ => place,
            }
        };
        self.tables.support.iter().map(name).collect()
    }

    fn forces(&self, body: &Body, step: usize) -> Result<Vec<[f64; 2]>, CaseError> {
        let mut forces = vec![[0.0; 2]; body.mesh.nodes.len()];
        let at = |quantity: &Option<Quantity>, x| quantity.as_ref().map_or(0.0, |q| q.at(x));
        let finite = |forces: &[[f64; 2]], span, what: &str| match forces
            .iter()
            .position(|f| !f.iter().all(|v| v.is_finite()))
        {
            Some(node) => {
                let [x, y] = body.mesh.nodes[node];
                self.invalid(
                    span,
                    format!("the {what} has no finite value near ({x:.6e}, {y:.6e})"),
                )
            }
            None => Ok(()),
        };
        for table in &self.tables.traction {
            let t = table.get_ref();
            let edges = self.all_edges(body.mesh, &t.boundary, table.span(), Mesh::outer_edges)?;
            let factor = self.factor(&t.factors, step);
            body.add_traction(
                &edges,
                |x, n| {
                    let p = at(&t.pressure, x);
                    [at(&t.x, x) - p * n[0], at(&t.y, x) - p * n[1]].map(|v| factor * v)
                },
                &mut forces,
            );
            finite(&forces, table.span(), "traction")?;
        }
        for table in &self.tables.body_force {
            let t = table.get_ref();
            let regions = match &t.region {
                Some(name) => Some(self.region(body.mesh, name, table.span())?),
                None => None,
            };
            let factor = self.factor(&t.factors, step);
            let force = |x, _| [at(&t.x, x), at(&t.y, x)].map(|v| factor * v);
            body.add_body_force(regions, force, &mut forces);
            finite(&forces, table.span(), "body force")?;
        }
        if let Some(g) = self.tables.analysis.gravity {
            if body.materials.iter().all(|m| m.density == 0.0) {
                let span = self.tables.material.first().map_or(0..0, |m| m.span());
                return self.invalid(span, "there is gravity, but no material has a density");
            }
            let factor = self.factor(&None, step);
            let force = |_, density| g.map(|g| factor * g * density);
            body.add_body_force(None, force, &mut forces);
        }
        Ok(forces)
    }

    /// The contact nodes of all contacts, and which contact each belongs to; describes these in `pairs`.
    fn contact_nodes(
        &self,
        body: &Body,
        pairs: &mut Vec<Pair>,
    ) -> Result<(Vec<ContactNode>, Vec<u32>), CaseError> {
        let (mut nodes, mut owner) = (Vec::new(), Vec::new());
        for (number, table) in self.tables.contact.iter().enumerate() {
            let (t, span) = (table.get_ref(), table.span());
            let edges = self.all_edges(body.mesh, &t.boundary, span.clone(), Mesh::outer_edges)?;
            let stress = self.units().stress();
            let (quantity, friction) = match &t.friction {
                FrictionTable::None => (None, "no friction".to_owned()),
                FrictionTable::Tresca(q) => (Some(q), format!("Tresca bound {q} {stress}")),
                FrictionTable::Coulomb(q) => (Some(q), format!("Coulomb coefficient {q}")),
            };
            let law = |x| quantity.map_or(0.0, |q| q.at(x));
            let gap = |x| t.gap.as_ref().map_or(0.0, |gap| gap.at(x));
            let options = PairOptions {
                friction: match &t.friction {
                    FrictionTable::None => Friction::None,
                    FrictionTable::Tresca(_) => Friction::Tresca(&law),
                    FrictionTable::Coulomb(_) => Friction::Coulomb(&law),
                },
                gap: t.gap.is_some().then_some(&gap),
                adjust: t.adjust.unwrap_or(0.0),
                search_distance: t.search_distance,
            };
            let obstacle = t.obstacle.as_ref().map(|table| match *table {
                ObstacleTable::HalfPlane { point, normal } => Obstacle::HalfPlane { point, normal },
                ObstacleTable::Circle { center, radius } => Obstacle::Circle { center, radius },
            });
            let mut others = Vec::new();
            let (found, against, search_distance) = match (&t.against, &obstacle) {
                (Some(names), _) => {
                    others = self.all_edges(body.mesh, names, span.clone(), Mesh::outer_edges)?;
                    let distance = options.distance_between(body, &edges, &others);
                    let found = mortar_contact(body, &edges, &others, &options);
                    (found, names.to_string(), distance)
                }
                (None, Some(obstacle)) => {
                    let name = match obstacle {
                        Obstacle::HalfPlane { .. } => "rigid half-plane",
                        Obstacle::Circle { .. } => "rigid circle",
                    };
                    let distance = options.distance_to(body, &edges, obstacle);
                    let found = obstacle_contact(body, &edges, obstacle, &options);
                    (found, name.to_owned(), distance)
                }
                (None, None) => unreachable!("checked when it was read"),
            };
            let found = found.or_else(|error| {
                self.invalid(span, format!("contact on \"{}\": {error}", t.boundary))
            })?;
            pairs.push(Pair {
                boundary: t.boundary.to_string(),
                edges,
                others,
                against,
                obstacle,
                friction,
                search_distance,
                within: 0,
                kept: 0,
                nodes: 0,
                area: 0.0,
                gap: [f64::INFINITY, 0.0],
            });
            owner.extend(found.iter().map(|_| number as u32));
            nodes.extend(found);
        }
        Ok((nodes, owner))
    }

    /// Completes the descriptions of the contacts with the nodes that are left of them.
    fn count_nodes(
        &self,
        contact: &ContactRows,
        pair_of: &[u32],
        pairs: &mut [Pair],
    ) -> Result<(), CaseError> {
        for (i, (node, &pair)) in contact.nodes.iter().zip(pair_of).enumerate() {
            let pair = &mut pairs[pair as usize];
            pair.nodes += 1;
            pair.within += usize::from(node.gap <= pair.search_distance);
            pair.kept += usize::from(contact.keeps_from_sliding(i));
            pair.area += node.area;
            pair.gap = [pair.gap[0].min(node.gap), pair.gap[1].max(node.gap)];
        }
        // A corner between two obstacles is a matter of one node; all of a boundary without friction is not.
        for (i, &pair) in pair_of.iter().enumerate() {
            if !contact.keeps_from_sliding(i) {
                continue;
            }
            let node = contact.nodes[i].node;
            let here = &pairs[pair as usize].edges;
            let shared = (pairs.iter().enumerate()).any(|(other, there)| {
                let mut common = there.edges.iter().filter(|edge| here.contains(edge));
                other != pair as usize && common.any(|edge| edge.contains(&node))
            });
            if shared {
                return self.invalid(
                    self.tables.contact[pair as usize].span(),
                    format!(
                        "contact on \"{}\": where the same part of a boundary meets several rigid obstacles there \
                         can be no friction: split the boundary so that each part meets one, or state none",
                        pairs[pair as usize].boundary
                    ),
                );
            }
        }
        for (pair, table) in pairs.iter().zip(&self.tables.contact) {
            if pair.nodes == 0 {
                return self.invalid(
                    table.span(),
                    format!(
                        "contact on \"{}\": supports hold every node of it; if it meets another boundary, name that one first",
                        pair.boundary
                    ),
                );
            }
        }
        Ok(())
    }

    /// What can be said of all load steps before the first: supports that contradict each other, or drive nodes
    /// without any freedom into what they meet.
    fn foresee(&self, mesh: &Mesh, contact: &ContactRows) -> Result<(), CaseError> {
        let supports = &self.tables.support;
        let mut seen = HashSet::new();
        for step in 0..self.n_steps() {
            let factors =
                (supports.iter()).map(|s| self.factor(&s.get_ref().factors, step).to_bits());
            if !seen.insert(factors.collect::<Vec<_>>()) {
                continue;
            }
            let (prescribed, held) = self.prescribed(mesh, step)?;
            let unknowns = Unknowns::new(prescribed);
            if let Err(error) = contact.check(&unknowns) {
                // The support that moves the node most.
                let driving = match error {
                    ContactError::Driven { x, y, .. } => (held.iter())
                        .filter(|(node, ..)| mesh.nodes[*node as usize] == [x, y])
                        .max_by(|a, b| {
                            let by = |&(node, c, _): &(u32, usize, usize)| {
                                unknowns.prescribed(node)[c].unwrap_or(0.0).abs()
                            };
                            by(a).total_cmp(&by(b))
                        }),
                    _ => None,
                };
                let number = driving.map_or(0, |&(_, _, number)| number);
                let span = supports.get(number).map_or(0..0, |s| s.span());
                let when = match self.n_steps() {
                    1 => String::new(),
                    _ => format!("load step {}: ", step + 1),
                };
                return self.invalid(span, format!("{when}{error}"));
            }
        }
        Ok(())
    }
}

/// How large the forces are that act on the nodes.
fn acting(forces: &[[f64; 2]]) -> f64 {
    norm(forces.as_flattened())
}

/// ": did you mean …?", where a name is like a known one.
fn meant<'a>(name: &str, known: impl IntoIterator<Item = &'a String>) -> String {
    nearest(name, known).map_or(String::new(), |known| {
        format!(": did you mean \"{known}\"?")
    })
}

/// "a", "b" and "c".
fn listed<'a>(names: impl Iterator<Item = &'a String>) -> String {
    let names: Vec<String> = names.map(|name| format!("\"{name}\"")).collect();
    match names.split_last() {
        None => "none".to_owned(),
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} and {last}", rest.join(", ")),
    }
}
