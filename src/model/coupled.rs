//! Couplings on a mesh: the motions of the point in displacements of nodes, nodes that follow, and obstacles that move with the point.

use super::contacts::Found;
use super::coupling::{Coupling, Kind, MOTIONS};
use super::driven::{Drive, Term, measured};
use super::entities::{Names, Part as _, Target};
use super::error::{EntityKind, Fault, ModelError, listed};
use super::large::Carried;
use super::loads::{area_shares, outer_facets};
use super::pair::Against;
use super::supports::Way;
use super::{Definition, Pair, PairData, Units};
use crate::contact::{ContactPlace, Space, turned};
use crate::dense::pseudo_inverse;
use crate::elasticity::{Body, Plane, Unknowns};
use crate::mesh::vector::{length, minus};
use crate::mesh::{ElementKind, Location};
use crate::rigid::{self, Frame};
use faer::Mat;
use std::collections::{BTreeSet, HashSet};

/// A displacement is independent of others if this part of its length is left without them: files have six digits at least.
const INDEPENDENT: f64 = 1e-5;
/// Parts of other displacements below this are rounding: displacements far apart lead, so that the largest parts are about one.
const ROUNDING_OF_P: f64 = 1e-13;

/// The rigid motions that a point has.
struct Motions<'m, const D: usize> {
    places: &'m [[f64; D]],
    frame: Frame<D>,
    /// Their numbers.
    ways: Vec<usize>,
}

impl<const D: usize> Motions<'_, D> {
    /// Their values at a node, along each axis.
    fn at(&self, node: u32) -> [Vec<f64>; D] {
        let all = self
            .frame
            .motions::<{ MOTIONS.len() }>(&self.places[node as usize]);
        all.map(|row| self.ways.iter().map(|&k| row[k]).collect())
    }
}

/// How nodes determine motions, and follow them.
struct Determined<const D: usize> {
    /// Each motion in displacements of nodes.
    terms: Vec<Vec<Term<D>>>,
    /// The row of a motion that the nodes determine is that of the identity.
    known: Mat<f64>,
    /// The displacements that follow others: node, axis, and those others with the opposite sign.
    follow: Vec<(u32, usize, Vec<Term<D>>)>,
}

impl<const D: usize> Determined<D> {
    /// Of nodes that move as a rigid body along the axes that are not `free`.
    fn rigid(nodes: &[u32], motions: &Motions<D>, free: [bool; D]) -> Self {
        let count = motions.ways.len();
        let bound: Vec<usize> = (0..D).filter(|&c| !free[c]).collect();
        let all: Vec<(u32, usize, Vec<f64>)> = (nodes.iter())
            .flat_map(|&node| {
                let at = motions.at(node);
                let of_axis = move |&c: &usize| (node, c, at[c].clone());
                bound.iter().map(of_axis)
            })
            .collect();
        let lead = independent(&all, count);
        let p = Mat::from_fn(lead.len(), count, |r, k| all[lead[r]].2[k]);
        let inverse = p.transpose() * pseudo_inverse(&(&p * p.transpose()), ROUNDING_OF_P);
        let term = |i: usize, factor: f64| -> Term<D> {
            let (node, c, _) = all[i];
            (node, Way::<D>::Axis(c).vector().map(|v| factor * v))
        };
        let of_leads = |part: &dyn Fn(usize) -> f64| -> Vec<Term<D>> {
            let parts = lead.iter().enumerate().map(|(r, &i)| (i, part(r)));
            let parts = parts.filter(|(_, part)| part.abs() > ROUNDING_OF_P);
            parts.map(|(i, part)| term(i, part)).collect()
        };
        let follows = all.iter().enumerate().filter(|(i, _)| !lead.contains(i));
        Self {
            terms: (0..count).map(|k| of_leads(&|r| inverse[(k, r)])).collect(),
            follow: follows
                .map(|(_, (node, c, at))| {
                    let part = |r| -(0..count).map(|k| at[k] * inverse[(k, r)]).sum::<f64>();
                    (*node, *c, of_leads(&part))
                })
                .collect(),
            known: &inverse * &p,
        }
    }

    /// Of nodes that move freely, each with its share. Away from the places of the motions the nodes are deformed: `m` then has the part
    /// by which their arms have become longer or shorter.
    fn distributing(shares: &[(u32, f64)], motions: &Motions<D>, mut m: Mat<f64>) -> Self {
        let count = motions.ways.len();
        for &(node, share) in shares {
            for row in motions.at(node) {
                for (i, a) in row.iter().enumerate() {
                    for (j, b) in row.iter().enumerate() {
                        m[(i, j)] += share * a * b;
                    }
                }
            }
        }
        let inverse = pseudo_inverse(&m, INDEPENDENT * INDEPENDENT);
        let of_motion = |k: usize| {
            let term = |&(node, share): &(u32, f64)| {
                let part = motions.at(node).map(|row| {
                    let parts = row.iter().enumerate();
                    share * parts.map(|(l, v)| inverse[(k, l)] * v).sum::<f64>()
                });
                (node, part)
            };
            shares.iter().map(term).collect()
        };
        Self {
            terms: (0..count).map(of_motion).collect(),
            known: &inverse * &m,
            follow: Vec::new(),
        }
    }

    /// Whether the nodes determine a motion.
    fn is_known(&self, k: usize) -> bool {
        (0..self.terms.len()).all(|l| {
            let off = self.known[(k, l)] - f64::from(u8::from(k == l));
            off.abs() < INDEPENDENT
        })
    }
}

/// A coupling on a mesh.
pub(super) struct Coupled<const D: usize> {
    frame: Frame<D>,
    nodes: Vec<u32>,
    /// By which the nodes determine the motion of the point where it is large.
    shares: Vec<(u32, f64)>,
    /// Whether the nodes move freely.
    distributes: bool,
    /// The motions that the nodes determine.
    drives: Vec<Drive>,
    /// Each motion, in displacements of nodes.
    motions: Vec<Vec<Term<D>>>,
    /// As [`Determined::follow`].
    follow: Vec<(u32, usize, Vec<Term<D>>)>,
}

impl<const D: usize> Coupling<D>
where
    ElementKind: Space<D>,
{
    /// On a mesh; `carrier` has the nodes that were added for it, if it consists of obstacles alone.
    pub(super) fn on_mesh(&self, body: &Body<D>, carrier: &[u32]) -> Result<Coupled<D>, Fault> {
        let (mesh, target) = (body.mesh, self.target());
        let nodes = match target {
            Some(target) => target.nodes(mesh)?,
            None => carrier.to_vec(),
        };
        let away = |&node: &u32| length(minus(mesh.nodes[node as usize], self.point));
        let frame = Frame {
            centre: self.point,
            size: match nodes.iter().map(away).fold(0.0, f64::max) {
                0.0 => 1.0,
                size => size,
            },
        };
        let mut motions = Motions {
            places: &mesh.nodes,
            frame,
            // A ring moves along its axis.
            ways: match body.plane {
                Plane::Axisymmetric if D == 2 => vec![1],
                _ => (0..rigid::count(D)).collect(),
            },
        };
        let alike = |nodes: &[u32]| -> Vec<(u32, f64)> {
            let share = (nodes.len() as f64).recip();
            nodes.iter().map(|&node| (node, share)).collect()
        };
        let distributes = self.kind == Kind::Distributing || target.is_none();
        let shares = match (self.kind, target) {
            (Kind::Distributing, Some(Target::Boundary(names))) => {
                area_shares(body, &outer_facets(mesh, names.all())?).0
            }
            (Kind::Distributing, Some(target)) => alike(&target.uncut_nodes(mesh)?),
            _ => alike(&nodes),
        };
        let determined = |motions: &Motions<D>| match distributes {
            false => Determined::rigid(&nodes, motions, self.free),
            true => {
                let count = motions.ways.len();
                Determined::distributing(&shares, motions, Mat::zeros(count, count))
            }
        };
        let mut found = determined(&motions);
        // The nodes may determine a sum of motions alone. One that is held at 0 is no part of it.
        let is_held = |way: usize| self.motion(way) == Some(0.0);
        let loose = |found: &Determined<D>, ways: &[usize]| {
            (0..ways.len()).rfind(|&k| !found.is_known(k) && is_held(ways[k]))
        };
        while let Some(k) = loose(&found, &motions.ways) {
            motions.ways.remove(k);
            found = determined(&motions);
        }
        let known: Vec<usize> = (0..motions.ways.len())
            .filter(|&k| found.is_known(k))
            .collect();
        let drives: Vec<Drive> = (known.iter().map(|&k| motions.ways[k]))
            .map(|component| Drive {
                component,
                size: if component < D { 1.0 } else { frame.size },
                motion: self.motion(component),
                force: self.load(component),
            })
            .collect();
        let wanted = (0..rigid::count(D)).find(|&k| {
            // Holding something still that nothing moves is no error.
            let is_stated = self.motion(k).unwrap_or(0.0) != 0.0 || self.load(k) != 0.0;
            is_stated && drives.iter().all(|drive| drive.component != k)
        });
        if let Some(k) = wanted {
            let name = MOTIONS[Self::in_space(k)];
            return Err(Fault::Stated(match motions.ways.len() {
                1 => format!(
                    "a body of revolution moves along y alone: leave out {name} and loads along it"
                ),
                _ if self.motion(k) == Some(0.0) => format!(
                    "its nodes do not determine the motion {name} of the point, which is held at 0: a load along it would act on nothing: \
                     leave the load out"
                ),
                _ => format!(
                    "its nodes do not determine the motion {name} of the point: couple nodes that are farther apart and in all directions, or leave out {name} and loads along it"
                ),
            }));
        }
        if drives.is_empty() {
            let text = "its nodes determine no motion of the point: couple more nodes, or leave fewer directions free";
            return Err(Fault::Stated(text.to_owned()));
        }
        if self.contacts.is_some() && drives.len() < motions.ways.len() {
            let text = "its nodes do not determine how the obstacles move: couple nodes that are farther apart and in all directions";
            return Err(Fault::Stated(text.to_owned()));
        }
        Ok(Coupled {
            frame,
            nodes,
            shares,
            distributes,
            drives,
            motions: known.iter().map(|&k| found.terms[k].clone()).collect(),
            follow: found.follow,
        })
    }

    /// Adds its loads times a factor.
    pub(super) fn push(
        &self,
        body: &Body<D>,
        carrier: &[u32],
        factor: f64,
        forces: &mut [[f64; D]],
    ) -> Result<(), Fault> {
        if (0..rigid::count(D)).all(|k| self.load(k) == 0.0) {
            return Ok(());
        }
        let coupled = self.on_mesh(body, carrier)?;
        for (drive, terms) in coupled.drives.iter().zip(&coupled.motions) {
            let load = factor * drive.force / drive.size;
            for (node, way) in terms {
                (0..D).for_each(|c| forces[*node as usize][c] += load * way[c]);
            }
        }
        Ok(())
    }

    /// Its places: first the motions of the point, then the nodes that follow.
    pub(super) fn find(
        &self,
        body: &Body<D>,
        coupled: &Coupled<D>,
        units: &Units,
    ) -> Result<Found<D>, Fault> {
        let mut places: Vec<ContactPlace<D>> = Vec::new();
        for (drive, terms) in coupled.drives.iter().zip(&coupled.motions) {
            let mut frame = [[0.0; D]; D];
            if drive.component < D {
                frame[0] = Way::Axis(drive.component).vector();
            }
            let pool = places.len() as u32;
            let own = coupled.nodes[0];
            places.push(measured((self.point, pool), own, frame, terms.clone()));
        }
        for rows in coupled.follow.chunk_by(|a, b| a.0 == b.0) {
            let node = rows[0].0;
            let mut frame = [[0.0; D]; D];
            for (way, (_, c, _)) in frame.iter_mut().zip(rows) {
                *way = Way::Axis(*c).vector();
            }
            let at = (body.mesh.nodes[node as usize], places.len() as u32);
            places.push(ContactPlace {
                node: Some(node),
                directed: Vec::new(),
                further: rows.iter().map(|(.., others)| others.clone()).collect(),
                sectors: None,
                ..measured(at, node, frame, Vec::new())
            });
        }
        let mut what = vec![match self.kind {
            Kind::Rigid => "rigid".to_owned(),
            Kind::Distributing => "distributing".to_owned(),
        }];
        for k in 0..rigid::count(D) {
            let name = MOTIONS[Self::in_space(k)];
            what.extend(self.motion(k).map(|motion| format!("{name} = {motion}")));
            let unit = match k < D {
                true => units.force.clone(),
                false => units.moment(),
            };
            if self.load(k) != 0.0 {
                let (load, of) = (self.load(k), if k < D { "force" } else { "moment" });
                what.push(format!("{of} {load}{} along {name}", Units::behind(&unit)));
            }
        }
        let data = PairData {
            tied: true,
            drives: coupled.drives.clone(),
            ..PairData::between(
                EntityKind::Coupling,
                &self.name,
                self.sides(),
                format!("the point {}", Location::from(self.point)),
                what.join(", "),
            )
        };
        Ok((places, data))
    }
}

impl<const D: usize> Definition<D>
where
    ElementKind: Space<D>,
{
    /// The couplings on a mesh.
    pub(super) fn coupled(&self, body: &Body<D>) -> Result<Vec<Coupled<D>>, ModelError> {
        (self.couplings.iter().enumerate())
            .map(|(number, coupling)| {
                let coupled = coupling.on_mesh(body, self.carrier(number));
                let coupled = coupled.map_err(|fault| coupling.entity(number).error(fault))?;
                let known = coupled.drives.len();
                // A single node that is the point has no rotation.
                let is_whole = known == rigid::count(D) || (coupled.nodes.len() == 1 && known == D);
                if self.is_large() && body.plane != Plane::Axisymmetric && !is_whole {
                    return Err(coupling.entity(number).error(
                        "where displacements are large its nodes have to determine all motions of the point: couple nodes that are farther apart and in all directions, or the node at the point alone",
                    ));
                }
                Ok(coupled)
            })
            .collect()
    }

    /// The numbers of the contacts whose obstacles move with each coupling.
    pub(super) fn obstacles_of(&self) -> Result<Vec<HashSet<u32>>, ModelError> {
        let mut taken: HashSet<u32> = HashSet::new();
        let of = |(number, coupling): (usize, &Coupling<D>)| {
            let mut of = HashSet::new();
            let names = coupling.contacts.iter().flat_map(Names::all);
            for name in names.collect::<BTreeSet<_>>() {
                let is_it = |pair: &Pair<D>| pair.name.as_ref() == Some(name);
                let before = of.len();
                for (i, pair) in self
                    .pairs
                    .iter()
                    .enumerate()
                    .filter(|(_, pair)| is_it(pair))
                {
                    let text = match pair.meets() {
                        Against::Boundary(_) => {
                            format!(
                                "contact \"{name}\" is with a boundary: obstacles alone move with a point"
                            )
                        }
                        Against::Obstacle(_) if !taken.insert(i as u32) => {
                            format!(
                                "the obstacle of contact \"{name}\" moves with another point already"
                            )
                        }
                        Against::Obstacle(_) => {
                            of.insert(i as u32);
                            continue;
                        }
                    };
                    return Err(coupling.entity(number).at("contacts").error(text));
                }
                if of.len() == before {
                    let known = self.pairs.iter().filter_map(|pair| pair.name.as_ref());
                    let text = format!(
                        "there is no contact named \"{name}\": write name = \"{name}\" in its table, or take one of {}",
                        listed(known)
                    );
                    return Err(coupling.entity(number).at("contacts").error(text));
                }
            }
            Ok(of)
        };
        self.couplings.iter().enumerate().map(of).collect()
    }
}

impl<const D: usize> Coupled<D> {
    /// The point at rest.
    pub(super) fn point(&self) -> [f64; D] {
        self.frame.centre
    }

    /// The motions that the nodes determine.
    pub(super) fn drives(&self) -> &[Drive] {
        &self.drives
    }

    /// How the nodes have moved as a whole.
    pub(super) fn carried(&self, rest: &[[f64; D]], now: &[[f64; D]]) -> Carried<D> {
        Carried::of(&self.shares, rest, now, &[])
    }

    /// Each motion of the point, along the axes and about them, in displacements of nodes from where they are now.
    pub(super) fn rows(
        &self,
        carried: &Carried<D>,
        rest: &[[f64; D]],
        now: &[[f64; D]],
    ) -> Vec<Vec<Term<D>>> {
        if self.distributes {
            let places: Vec<[f64; D]> = rest.iter().map(|x| carried.place(*x)).collect();
            let frame = Frame {
                centre: carried.place(self.frame.centre),
                ..self.frame
            };
            let ways: Vec<usize> = self.drives.iter().map(|drive| drive.component).collect();
            let longer = self.longer(&ways, &frame, &places, now);
            let motions = Motions {
                places: &places,
                frame,
                ways,
            };
            return Determined::distributing(&self.shares, &motions, longer).terms;
        }
        // The motions of a rigid set are those at rest, turned.
        let axes: [[f64; D]; D] =
            std::array::from_fn(|c| carried.turn.of(Way::<D>::Axis(c).vector()));
        let turned = |row: &Vec<Term<D>>| -> Vec<Term<D>> {
            let terms = row.iter().map(|(node, way)| (*node, carried.turn.of(*way)));
            terms.collect()
        };
        let local: Vec<Vec<Term<D>>> = self.motions.iter().map(turned).collect();
        let row = |drive: &Drive| -> Vec<Term<D>> {
            let (first, c) = match drive.component.checked_sub(D) {
                None => (0, drive.component),
                Some(_) if D == 2 => return local[drive.component].clone(),
                Some(about) => (D, about),
            };
            let parts = axes.iter().map(|axis| axis[c]).zip(&local[first..]);
            let terms = parts.flat_map(|(part, row)| {
                row.iter()
                    .map(move |(node, way)| (*node, way.map(|v| part * v)))
            });
            terms.collect()
        };
        self.drives.iter().map(row).collect()
    }

    /// The part of the matrix of a distributing coupling by nodes that are away from their places.
    fn longer(
        &self,
        ways: &[usize],
        frame: &Frame<D>,
        places: &[[f64; D]],
        now: &[[f64; D]],
    ) -> Mat<f64> {
        let mut sum = [[0.0; D]; D];
        for &(node, share) in &self.shares {
            let at = node as usize;
            let (off, arm) = (minus(now[at], places[at]), minus(places[at], frame.centre));
            for i in 0..D {
                for j in 0..D {
                    sum[i][j] += share * off[i] * arm[j] / (frame.size * frame.size);
                }
            }
        }
        let trace: f64 = (0..D).map(|c| sum[c][c]).sum();
        Mat::from_fn(ways.len(), ways.len(), |k, l| {
            match (ways[k].checked_sub(D), ways[l].checked_sub(D)) {
                (Some(_), Some(_)) if D == 2 => trace,
                (Some(i), Some(j)) => {
                    let one = f64::from(u8::from(i == j));
                    one * trace - 0.5 * (sum[i][j] + sum[j][i])
                }
                _ => 0.0,
            }
        })
    }

    /// Lets the obstacle at a contact place move with the point. Along a tangent along which neither the node nor the obstacle moves,
    /// there is no friction.
    pub(super) fn carry(&self, place: &mut ContactPlace<D>, unknowns: &Unknowns<D>) {
        *place = turned(place, unknowns);
        // Where the obstacle is touched.
        let x = std::array::from_fn(|c| place.place[c] + place.gap.max(0.0) * place.frame[0][c]);
        let all = self.frame.motions::<{ MOTIONS.len() }>(&x);
        place.further = (place.frame.iter().enumerate())
            .map(|(a, &way)| {
                let parts = self.drives.iter().map(|drive| {
                    let axis = |c: usize| way[c] * all[c][drive.component];
                    (0..D).map(axis).sum::<f64>()
                });
                let moves = parts.clone().zip(&self.drives);
                let moves = moves.filter(|(part, _)| part.abs() > ROUNDING_OF_P);
                let is_held = |node: u32| length(unknowns.free_part(node, way)) < ROUNDING_OF_P;
                let is_still = moves.clone().all(|(_, drive)| drive.motion == Some(0.0));
                if a > 0 && is_still && place.own.iter().all(|&(node, _)| is_held(node)) {
                    return Vec::new();
                }
                let of_motions = parts.zip(&self.motions);
                of_motions
                    .flat_map(|(part, terms)| {
                        terms
                            .iter()
                            .map(move |(node, of)| (*node, of.map(|v| -part * v)))
                    })
                    .collect()
            })
            .collect();
    }
}

/// As many displacements as there are independent motions, one after the other that with the most left of it.
fn independent(all: &[(u32, usize, Vec<f64>)], most: usize) -> Vec<usize> {
    let mut left: Vec<Vec<f64>> = all.iter().map(|(.., at)| at.clone()).collect();
    let mut chosen = Vec::new();
    let mut largest = 0.0;
    while chosen.len() < most {
        let sizes = left.iter().map(|row| rigid::length(row)).enumerate();
        let Some((next, size)) =
            sizes.reduce(|best, next| if next.1 > best.1 { next } else { best })
        else {
            break;
        };
        largest = f64::max(largest, size);
        if !(size > INDEPENDENT * largest) {
            break;
        }
        chosen.push(next);
        let way: Vec<f64> = left[next].iter().map(|v| v / size).collect();
        for row in &mut left {
            let along: f64 = row.iter().zip(&way).map(|(v, w)| v * w).sum();
            row.iter_mut().zip(&way).for_each(|(v, w)| *v -= along * w);
        }
    }
    chosen
}
