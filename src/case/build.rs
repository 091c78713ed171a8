//! From a case to a contact problem.

use super::{Case, CaseError, FrictionTable, ObstacleTable, Quantity};
use crate::contact::{ContactError, ContactNode, Obstacle, contact_rows, obstacle_contact};
use crate::elasticity::{Body, Material, Plane, Unknowns, assemble};
use crate::matrix_market::{self, MatrixMarketError};
use crate::mesh::gmsh::GmshError;
use crate::mesh::{Mesh, gmsh, structured};
use crate::problem::{ContactData, ContactProblem, ProblemError};
use crate::sparse::{BlockCsr, Csr};
use std::ops::Range;
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
    pub unknowns: Unknowns,
    /// The contact node of each row of N.
    pub contact: Vec<ContactNode>,
    /// The resultant of all loads, in N.
    pub total_load: [f64; 2],
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
    pub problem: ContactProblem,
    /// None for an algebraic case.
    pub elastic: Option<Elastic>,
    /// Seconds for the mesh, or the matrices, to be read or made.
    pub mesh_seconds: f64,
    /// Seconds for K, f and the contact rows.
    pub assembly_seconds: f64,
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
        let csr = |m: matrix_market::Matrix| Csr::from_triplets(m.rows, m.cols, m.entries);
        let data = ContactData {
            stiffness: BlockCsr::from_triplets(rows, cols, stiffness.entries),
            load: vector(&table.load)?,
            normal: csr(matrix(&table.normal)?),
            tangential: csr(matrix(&table.tangential)?),
            gap: vector(&table.gap)?,
            slip_bound: vector(&table.slip_bound)?,
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
        let problem = ContactProblem::new(data).map_err(failed)?;
        Ok(Build {
            problem,
            elastic: None,
            mesh_seconds,
            assembly_seconds: start.elapsed().as_secs_f64() - mesh_seconds,
        })
    }

    fn build_elastic(&self) -> Result<Build, BuildError> {
        let start = Instant::now();
        let table = self
            .tables
            .mesh
            .as_ref()
            .expect("checked when it was read")
            .get_ref();
        let mesh = match (&table.file, &table.rectangle) {
            (Some(file), _) => gmsh::read(&self.beside(file), table.scale.unwrap_or(1.0))?,
            (None, Some(r)) => {
                structured::rectangle(r.origin, r.size, r.cells, r.shape, "body", "")
            }
            (None, None) => unreachable!("checked when it was read"),
        };
        let mesh_seconds = start.elapsed().as_secs_f64();

        let materials = self.materials(&mesh)?;
        let analysis = &self.tables.analysis;
        let body = Body {
            mesh: &mesh,
            materials: &materials,
            plane: analysis.plane,
            thickness: *analysis.thickness.get_ref(),
        };
        let prescribed = self.prescribed(&mesh)?;
        self.check_supported(&mesh, &prescribed)?;
        let unknowns = Unknowns::new(prescribed);
        if unknowns.n_free() == 0 {
            let span = self.tables.support.first().map_or(0..0, |s| s.span());
            return Ok(self.invalid(
                span,
                "the supports hold every node: nothing is left to solve",
            )?);
        }
        let forces = self.forces(&body)?;
        let mut total_load = [0.0; 2];
        for force in &forces {
            total_load[0] += force[0];
            total_load[1] += force[1];
        }
        let candidates = self.contact_nodes(&body)?;
        let (stiffness, load) = assemble(&body, &unknowns, &forces);
        let rows = contact_rows(&body, &unknowns, &candidates).or_else(|error| {
            let span = self.tables.contact.first().map_or(0..0, |c| c.span());
            self.invalid(span, error.to_string())
        })?;
        let n_free = unknowns.n_free();
        let problem = ContactProblem::new(ContactData {
            stiffness,
            load,
            normal: rows.normal,
            tangential: rows.tangential,
            gap: rows.gap,
            slip_bound: rows.slip_bound,
            coordinates: Some(unknowns.coordinates(&mesh)),
        })
        .map_err(|source| BuildError::Problem {
            case: self.path.display().to_string(),
            source,
        })?
        .with_free_unknowns(n_free);
        let (plane, thickness) = (body.plane, body.thickness);
        Ok(Build {
            problem,
            elastic: Some(Elastic {
                mesh,
                materials,
                plane,
                thickness,
                unknowns,
                contact: rows.nodes,
                total_load,
            }),
            mesh_seconds,
            assembly_seconds: start.elapsed().as_secs_f64() - mesh_seconds,
        })
    }

    fn edges<'m>(
        &self,
        mesh: &'m Mesh,
        name: &str,
        span: Range<usize>,
    ) -> Result<&'m [[u32; 2]], CaseError> {
        match mesh.boundaries.get(name) {
            Some(edges) => Ok(edges),
            None => self.invalid(
                span,
                format!(
                    "there is no boundary \"{name}\"; the mesh has {}",
                    listed(mesh.boundaries.keys())
                ),
            ),
        }
    }

    fn region(&self, mesh: &Mesh, name: &str, span: Range<usize>) -> Result<u32, CaseError> {
        match mesh.regions.iter().position(|r| r == name) {
            Some(region) => Ok(region as u32),
            None => self.invalid(
                span,
                format!(
                    "there is no region \"{name}\"; the mesh has {}",
                    listed(mesh.regions.iter())
                ),
            ),
        }
    }

    fn materials(&self, mesh: &Mesh) -> Result<Vec<Material>, CaseError> {
        let tables = &self.tables.material;
        let mut materials = vec![None; mesh.regions.len()];
        for table in tables {
            let m = table.get_ref();
            let material = Material {
                young: m.young,
                poisson: m.poisson,
                density: m.density,
            };
            match &m.region {
                Some(name) => {
                    let place = &mut materials[self.region(mesh, name, table.span())? as usize];
                    if place.replace(material).is_some() {
                        return self
                            .invalid(table.span(), format!("region \"{name}\" has two materials"));
                    }
                }
                None if tables.len() == 1 => materials.fill(Some(material)),
                None => {
                    return self.invalid(
                        table.span(),
                        format!(
                            "with several materials each needs its region: {}",
                            listed(mesh.regions.iter())
                        ),
                    );
                }
            }
        }
        materials
            .iter()
            .zip(&mesh.regions)
            .map(|(material, name)| match material {
                Some(material) => Ok(*material),
                None => self.invalid(
                    tables.last().map_or(0..0, |t| t.span()),
                    format!("region \"{name}\" has no material"),
                ),
            })
            .collect()
    }

    fn prescribed(&self, mesh: &Mesh) -> Result<Vec<[Option<f64>; 2]>, CaseError> {
        let mut prescribed = vec![[None; 2]; mesh.nodes.len()];
        let (low, high) = mesh.bounding_box();
        let size = (high[0] - low[0]).hypot(high[1] - low[1]);
        for table in &self.tables.support {
            let (s, span) = (table.get_ref(), table.span());
            let mut components: [Option<&Quantity>; 2] = [s.x.as_ref(), s.y.as_ref()];
            const ZERO: Quantity = Quantity::Constant(0.0);
            let nodes: Vec<u32> = match (&s.boundary, s.point) {
                (Some(name), _) => {
                    let edges = self.edges(mesh, name, span.clone())?;
                    if s.symmetry {
                        let along = |axis: usize| {
                            edges
                                .iter()
                                .all(|&e| mesh.edge_normal(e).1[axis].abs() > 1.0 - 1e-9)
                        };
                        components = match (along(0), along(1)) {
                            (true, _) => [Some(&ZERO), None],
                            (_, true) => [None, Some(&ZERO)],
                            _ => {
                                return self.invalid(
                                    span,
                                    format!("boundary \"{name}\" is not parallel to an axis: symmetry needs one that is"),
                                );
                            }
                        };
                    }
                    edges.iter().flatten().copied().collect()
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
                    vec![nearest as u32]
                }
                (None, None) => unreachable!("checked when it was read"),
            };
            for node in nodes {
                let x = mesh.nodes[node as usize];
                for (c, quantity) in components.iter().enumerate() {
                    let Some(quantity) = quantity else { continue };
                    let value = quantity.at(x);
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
                    *place = Some(value);
                }
            }
        }
        Ok(prescribed)
    }

    /// Every body needs supports that leave it no motion as a whole: contact alone makes K singular.
    fn check_supported(
        &self,
        mesh: &Mesh,
        prescribed: &[[Option<f64>; 2]],
    ) -> Result<(), CaseError> {
        let (count, body) = mesh.bodies();
        let mut first = vec![usize::MAX; count];
        let mut held: Vec<Vec<(usize, [f64; 2])>> = vec![Vec::new(); count];
        for (node, components) in prescribed.iter().enumerate() {
            let b = body[node] as usize;
            first[b] = first[b].min(node);
            for (c, value) in components.iter().enumerate() {
                if value.is_some() {
                    held[b].push((c, mesh.nodes[node]));
                }
            }
        }
        let (low, high) = mesh.bounding_box();
        let size = (high[0] - low[0]).hypot(high[1] - low[1]);
        for b in 0..count {
            let holds = |c: usize| held[b].iter().any(|h| h.0 == c);
            // With both directions held, only a rotation about a common point of all the
            // constraint lines is left: x-constraints lie at its height, y-constraints at its abscissa.
            let spread = |c: usize| {
                let at = held[b].iter().filter(|h| h.0 == c).map(|h| h.1[1 - c]);
                let (min, max) = at.fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), v| {
                    (min.min(v), max.max(v))
                });
                max - min > 1e-9 * size
            };
            let motion = match (holds(0), holds(1)) {
                (true, true) if spread(0) || spread(1) => continue,
                (true, true) => "rotate",
                (true, false) => "move in y",
                (false, true) => "move in x",
                (false, false) => "move in x and y and rotate",
            };
            let [x, y] = mesh.nodes[first[b]];
            let region = mesh
                .elements
                .iter()
                .find(|e| e.nodes().contains(&(first[b] as u32)))
                .map_or("", |e| mesh.regions[e.region as usize].as_str());
            return self.invalid(
                self.tables.support.first().map_or(0..0, |s| s.span()),
                format!(
                    "the body with region \"{region}\" (at ({x:.4e}, {y:.4e})) can {motion} as a whole: contact alone \
                     does not make its stiffness regular; add a [[support]], symmetry, or hold a point"
                ),
            );
        }
        Ok(())
    }

    fn forces(&self, body: &Body) -> Result<Vec<[f64; 2]>, CaseError> {
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
            let edges = self.edges(body.mesh, &t.boundary, table.span())?;
            body.add_traction(
                edges,
                |x, n| {
                    let p = at(&t.pressure, x);
                    [at(&t.x, x) - p * n[0], at(&t.y, x) - p * n[1]]
                },
                &mut forces,
            );
            finite(&forces, table.span(), "traction")?;
        }
        for table in &self.tables.body_force {
            let t = table.get_ref();
            let region = match &t.region {
                Some(name) => Some(self.region(body.mesh, name, table.span())?),
                None => None,
            };
            body.add_body_force(region, |x, _| [at(&t.x, x), at(&t.y, x)], &mut forces);
            finite(&forces, table.span(), "body force")?;
        }
        if let Some(g) = self.tables.analysis.gravity {
            if body.materials.iter().all(|m| m.density == 0.0) {
                let span = self.tables.material.first().map_or(0..0, |m| m.span());
                return self.invalid(span, "there is gravity, but no material has a density");
            }
            body.add_body_force(None, |_, density| g.map(|g| g * density), &mut forces);
        }
        Ok(forces)
    }

    fn contact_nodes(&self, body: &Body) -> Result<Vec<ContactNode>, CaseError> {
        let mut nodes = Vec::new();
        for table in &self.tables.contact {
            let (t, span) = (table.get_ref(), table.span());
            let edges = self.edges(body.mesh, &t.boundary, span.clone())?;
            let obstacle = match t.obstacle {
                ObstacleTable::HalfPlane { point, normal } => Obstacle::HalfPlane { point, normal },
                ObstacleTable::Circle { center, radius } => Obstacle::Circle { center, radius },
            };
            let tresca = |x| match &t.friction {
                FrictionTable::None => 0.0,
                FrictionTable::Tresca(bound) => bound.at(x),
            };
            match obstacle_contact(body, edges, &obstacle, &tresca) {
                Ok(found) => nodes.extend(found),
                Err(
                    error @ (ContactError::Overlap { .. }
                    | ContactError::SlipBound { .. }
                    | ContactError::NoNormal { .. }
                    | ContactError::Twice { .. }),
                ) => {
                    return self.invalid(span, format!("contact on \"{}\": {error}", t.boundary));
                }
            }
        }
        Ok(nodes)
    }
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
