//! The part of each rank in a model for several ranks (feature `mpi`). Rank 0 divides it, and each makes an [`Elastic`]
//! of its own part, with the elements around its nodes.
//!
//! Nodes are numbered rank by rank. Of a rank's nodes the own ones come first, then those of others that its elements
//! reach. Of its elements its own come first, by their first node, then those that it only needs for the rows of its
//! nodes.

use super::analysis::{Holder, held_by, named_by};
use super::build::loose;
use super::contacts::Sliding;
use super::elastic::Elastic;
use super::error::{EntityKind, ModelError};
use super::loads::{StepData, TemperatureField, acting, end_of};
use super::supports::{Prescriptions, SAME, extended};
use super::{Axis, Changes, Definition, Driven, PairData, Quantity, Units};
use crate::contact::{ContactPlace, ContactRows, SlipBound, Space};
use crate::elasticity::{Bedding, Material, Plane, Unknowns, load_vector, stresses_at};
use crate::mesh::{Census, Element, ElementKind, FacetPoint, Groups, Mesh, Topology, facet_nodes};
use crate::problem::{FloatingBodies, Motions};
use crate::quasistatic::Load;
use crate::ranks::{Group, Ranks};
use crate::sparse::{BlockCsr, Csr};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashSet};
use std::sync::{Arc, Mutex};

/// No block, or no node.
const NONE: u32 = u32::MAX;

/// The data that all ranks get.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Common {
    pub n_free: usize,
    /// Unknowns in all, decoupled ones included.
    pub n: usize,
    regions: Vec<String>,
    materials: Vec<Material>,
    plane: Plane,
    thickness: f64,
    /// Of sectors that results show all of: a point of the axis, its direction in space, and their number.
    sectors: Option<(Vec<f64>, Option<[f64; 3]>, u32)>,
    supports: Vec<String>,
    support_centres: Vec<Vec<f64>>,
    length: String,
    force: String,
    units_stated: bool,
    places: Vec<Place>,
    pair_of: Vec<u32>,
    /// The kind of each pair, and its number among its kind.
    kinds: Vec<(EntityKind, usize)>,
    slip_bound: Vec<f64>,
    coefficient: Vec<f64>,
    compliance: Vec<f64>,
    pub areas: Vec<f64>,
    pub bodies: Vec<Body>,
    /// The regions of each temperature; None: all.
    warm_regions: Vec<Option<Vec<u32>>>,
    pub steps: Vec<Step>,
    pub census: Census,
}

/// A contact place without its nodes.
#[derive(Clone, Serialize, Deserialize)]
struct Place {
    place: Vec<f64>,
    frame: Vec<f64>,
    gap: f64,
    area: f64,
    pool: u32,
    slip_bound: SlipBound,
    compliance: [f64; 2],
    is_node: bool,
    is_directed: bool,
}

/// A body that can move as a whole.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Body {
    /// The connected part of K that it is.
    pub part: u32,
    pub motions: Motions,
    pub name: String,
    /// Its possible motions, in words.
    pub freedom: String,
}

/// A load step, without vectors that have an entry per row of K.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Step {
    pub factor: f64,
    total_load: Vec<f64>,
    acting: f64,
    gap: Vec<f64>,
    slide: Vec<f64>,
    /// The factor of each temperature.
    warmth: Vec<f64>,
    changes: Option<Changes>,
    driven: Vec<Driven>,
}

/// The data that only one rank gets.
#[derive(Default, Serialize, Deserialize)]
pub(crate) struct Part {
    /// The first of its nodes, and of its blocks, in the numbering of all ranks.
    pub first: u64,
    pub first_block: u64,
    /// Its own nodes; the rest are those of others.
    pub own: usize,
    /// Their numbers, and those of their blocks where they have any.
    pub ghosts: Vec<u64>,
    pub ghost_blocks: Vec<u64>,
    coordinates: Vec<f64>,
    kinds: Vec<ElementKind>,
    corners: Vec<u32>,
    regions: Vec<u32>,
    /// Elements that are its own.
    pub own_elements: usize,
    /// Prescribed components of its nodes; their values step by step.
    prescribed: Vec<(u32, u32)>,
    values: Vec<Vec<f64>>,
    frames: Vec<(u32, Vec<f64>)>,
    /// Of own nodes: component, support.
    held: Vec<(u32, u32, u32)>,
    /// Blocks of foundations in the rows of own nodes: both nodes, the support that it counts as, the block.
    bedding: Vec<(u32, u32, u32, Vec<f64>)>,
    /// Nodal forces step by step: the nodes that have any, and those.
    forces: Vec<(Vec<u32>, Vec<f64>)>,
    /// Entries of N and T in the columns of own unknowns.
    rows: [Vec<(u32, u32, f64)>; 2],
    /// The nodes of places: place, node, weight; own sides and partners, the same in the rows of each direction where these
    /// are others, and the node that a place is.
    sides: Vec<[Vec<(u32, u32, f64)>; 2]>,
    place_nodes: Vec<(u32, u32)>,
    /// [`Elastic::at_nodes`], where there are sectors, and [`Elastic::turn_to`].
    at_nodes: Vec<(u32, u32, f64)>,
    turns: Vec<(u32, u32, Vec<f64>)>,
    /// Further nodes in rows: place, direction, node, vector.
    further: Vec<(u32, u32, u32, Vec<f64>)>,
    /// The connected part of K of each own block.
    pub parts: Vec<u32>,
    /// Own unknowns that bodies are tied by.
    pub ties: Vec<u32>,
    /// Own nodes on both sides of each contact between bodies.
    pub pair_nodes: Vec<Vec<u32>>,
    /// The body of each own node.
    pub body_of: Vec<u32>,
}

/// The graph of the nodes of a mesh: for each node the others of its elements, one after the other, and its work. The
/// work is the blocks of K in its row, and as many as have the numbers that B has in its columns.
pub(crate) struct Graph {
    pub starts: Vec<i32>,
    pub others: Vec<i32>,
    pub work: Vec<i32>,
}

impl Graph {
    /// For a model; None if it exceeds 32-bit numbers.
    pub fn new<const D: usize>(elastic: &Elastic<D>) -> Option<Self>
    where
        ElementKind: Topology<D>,
    {
        let (mesh, unknowns) = (&elastic.mesh, &elastic.unknowns);
        let around = Lists::new(mesh.nodes.len(), mesh.elements.len(), |e| {
            mesh.elements[e].nodes().iter().copied()
        });
        let (mut starts, mut others) = (vec![0], Vec::new());
        let mut work = Vec::with_capacity(mesh.nodes.len());
        let mut near: Vec<u32> = Vec::new();
        for node in 0..mesh.nodes.len() as u32 {
            near.clear();
            let elements = around.of(node as usize).iter();
            near.extend(elements.flat_map(|&e| mesh.elements[e as usize].nodes()));
            near.sort_unstable();
            near.dedup();
            others.extend(
                near.iter()
                    .filter(|&&other| other != node)
                    .map(|&o| o as i32),
            );
            starts.push(i32::try_from(others.len()).ok()?);
            work.push(match unknowns.block(node) {
                Some(_) => near.len() as i32,
                None => 0,
            });
        }
        // An entry of B is one number, a block of K has D².
        let mut entries = vec![0; mesh.nodes.len()];
        for rows in [&elastic.contact.normal, &elastic.contact.tangential] {
            for &column in rows.col_idx() {
                entries[unknowns.node(column as usize / D) as usize] += 1;
            }
        }
        for (work, entries) in work.iter_mut().zip(entries) {
            *work += entries / (D * D) as i32;
        }
        Some(Self {
            starts,
            others,
            work,
        })
    }
}

impl Graph {
    /// For the blocks of K; None if it exceeds 32-bit numbers.
    pub fn of_matrix<const D: usize>(k: &BlockCsr<D>) -> Option<Self> {
        let (mut starts, mut others, mut work) = (vec![0], Vec::new(), Vec::new());
        for i in 0..k.n_block_rows() {
            let columns = k.row(i).0;
            // Zeros may be stored on only one side of the diagonal.
            let ties = columns.iter().zip(k.row(i).1).filter(|&(&j, block)| {
                j as usize != i && block.as_flattened().iter().any(|&v| v != 0.0)
            });
            others.extend(ties.map(|(&j, _)| j as i32));
            starts.push(i32::try_from(others.len()).ok()?);
            work.push(columns.len() as i32);
        }
        Some(Self {
            starts,
            others,
            work,
        })
    }
}

/// For each of some things a list of others.
struct Lists {
    starts: Vec<usize>,
    members: Vec<u32>,
}

impl Lists {
    /// Inverts `count` lists whose members are below `n`: for each member the lists that contain it.
    fn new<I: Iterator<Item = u32>>(n: usize, count: usize, of: impl Fn(usize) -> I) -> Self {
        let mut starts = vec![0; n + 1];
        for thing in 0..count {
            of(thing).for_each(|member| starts[member as usize + 1] += 1);
        }
        for i in 0..n {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut members = vec![0; starts[n]];
        for thing in 0..count {
            for member in of(thing) {
                members[next[member as usize]] = thing as u32;
                next[member as usize] += 1;
            }
        }
        Self { starts, members }
    }

    fn of(&self, i: usize) -> &[u32] {
        &self.members[self.starts[i]..self.starts[i + 1]]
    }
}

/// A model that rank 0 is dividing.
pub(crate) struct Cut<'a, const D: usize>
where
    ElementKind: Topology<D>,
{
    elastic: &'a Elastic<D>,
    owner: &'a [u32],
    /// The nodes of each rank, and the elements around them.
    nodes: Lists,
    elements: Lists,
    /// The number of each node, and of its block, counted rank by rank.
    number: Vec<u32>,
    block: Vec<u32>,
    /// The first block of each rank.
    first_block: Vec<u32>,
    /// The connected part of K of each node that has a block.
    part: Vec<u32>,
    /// The body of each node.
    body_of: Vec<u32>,
    ties: Vec<u32>,
    /// Prescribed components in the order of the nodes, and their values step by step.
    held: Vec<(u32, usize)>,
    values: Vec<Vec<f64>>,
    /// Step by step the nodes that have forces, in their order, and those.
    forces: Vec<(Vec<u32>, Vec<[f64; D]>)>,
    /// [`Elastic::at_nodes`], where there are sectors.
    at_nodes: Vec<(u32, u32, f64)>,
    pub common: Common,
}

impl<'a, const D: usize> Cut<'a, D>
where
    ElementKind: Space<D>,
{
    /// For a model whose nodes have these owners, among so many ranks.
    ///
    /// # Errors
    /// If a load step is inconsistent, or a body can move as a whole and has no contact to hold it.
    pub fn new(
        elastic: &'a Elastic<D>,
        owner: &'a [u32],
        ranks: usize,
    ) -> Result<Self, ModelError> {
        let (mesh, definition) = (&elastic.mesh, &elastic.definition);
        let nodes = Lists::new(ranks, mesh.nodes.len(), |node| std::iter::once(owner[node]));
        let elements = Lists::new(ranks, mesh.elements.len(), |e| {
            let mut around: Vec<u32> = (mesh.elements[e].nodes().iter())
                .map(|&node| owner[node as usize])
                .collect();
            around.sort_unstable();
            around.dedup();
            around.into_iter()
        });
        let (mut number, mut block) = (vec![0; mesh.nodes.len()], vec![NONE; mesh.nodes.len()]);
        let (mut first_block, mut blocks) = (Vec::with_capacity(ranks), 0);
        for rank in 0..ranks {
            first_block.push(blocks);
            for (&node, place) in nodes.of(rank).iter().zip(nodes.starts[rank] as u32..) {
                number[node as usize] = place;
                if elastic.unknowns.block(node).is_some() {
                    block[node as usize] = blocks;
                    blocks += 1;
                }
            }
        }
        let count = mesh.nodes.len() as u32;
        let held: Vec<(u32, usize)> = (0..count)
            .flat_map(|node| {
                let all = elastic.unknowns.prescribed(node);
                (0..D)
                    .filter(move |&c| all[c].is_some())
                    .map(move |c| (node, c))
            })
            .collect();
        let (mut values, mut forces, mut steps) = (Vec::new(), Vec::new(), Vec::new());
        let mut warm_regions = Vec::new();
        for step in 0..definition.n_steps() {
            let temperature = definition.temperature(mesh, end_of(step))?.0;
            let warmth = temperature.iter().map(|(_, factor, _)| *factor).collect();
            warm_regions = temperature
                .into_iter()
                .map(|(regions, ..)| regions)
                .collect();
            let unknowns = definition.unknowns(mesh, &elastic.prescriptions, end_of(step))?;
            let acts = definition.forces(&elastic.body(), end_of(step))?;
            let mut total_load = vec![0.0; D];
            for force in &acts {
                (total_load.iter_mut().zip(force)).for_each(|(sum, force)| *sum += force);
            }
            let (_, slide) = elastic.contact.held_motion(&unknowns);
            let driven = definition.driven(&elastic.pairs, &elastic.pair_of, end_of(step));
            steps.push(Step {
                factor: definition.factor(&None, end_of(step)),
                total_load,
                acting: acting(&acts),
                gap: elastic.gap(&unknowns, &driven),
                slide,
                warmth,
                changes: elastic.changes(step, &driven)?,
                driven,
            });
            let value = |&(node, c): &(u32, usize)| unknowns.prescribed(node)[c].unwrap_or(0.0);
            values.push(held.iter().map(value).collect());
            let acts = (0..count)
                .zip(acts)
                .filter(|(_, force)| force.iter().any(|&f| f != 0.0));
            forces.push(acts.unzip());
        }
        let (count, part) = parts(elastic);
        let touched = touched(elastic);
        let (bodies, ties) = floating(elastic, count, &part, &touched)?;
        let contact = &elastic.contact;
        let common = Common {
            n_free: elastic.unknowns.n_free(),
            n: D * elastic.unknowns.n_blocks(),
            regions: mesh.regions.clone(),
            materials: elastic.materials.clone(),
            plane: elastic.plane,
            thickness: elastic.thickness,
            sectors: elastic.sectors.map(|(axis, number)| {
                let (point, direction) = axis.stated();
                (point.to_vec(), direction, number)
            }),
            supports: elastic.supports.clone(),
            support_centres: elastic.support_centres.iter().map(|x| x.to_vec()).collect(),
            length: elastic.units.length.clone(),
            force: elastic.units.force.clone(),
            units_stated: elastic.units_stated,
            places: contact.places.iter().map(Place::of).collect(),
            pair_of: elastic.pair_of.clone(),
            kinds: (elastic.pairs.iter())
                .map(|pair| (pair.kind, pair.number))
                .collect(),
            slip_bound: contact.slip_bound.clone(),
            coefficient: contact.coefficient.clone(),
            compliance: contact.compliance.clone(),
            areas: contact.pooled_areas(),
            bodies,
            warm_regions,
            steps,
            census: mesh.census(),
        };
        Ok(Self {
            elastic,
            owner,
            nodes,
            elements,
            number,
            block,
            first_block,
            part,
            body_of: mesh.bodies().1,
            ties,
            held,
            values,
            forces,
            at_nodes: match contact.places.iter().any(|place| place.sectors.is_some()) {
                true => elastic.at_nodes(),
                false => Vec::new(),
            },
            common,
        })
    }

    /// The part of a rank. (One function: a paragraph for each of its data.)
    pub fn part(&self, rank: usize) -> Part {
        let (elastic, mesh) = (self.elastic, &self.elastic.mesh);
        let own = self.nodes.of(rank);
        let first = self.nodes.starts[rank] as u32;
        let is_own = |node: u32| self.owner[node as usize] as usize == rank;

        let (mine, others): (Vec<u32>, Vec<u32>) = (self.elements.of(rank).iter())
            .partition(|&&e| is_own(mesh.elements[e as usize].nodes()[0]));
        let elements = || {
            mine.iter()
                .chain(&others)
                .map(|&e| &mesh.elements[e as usize])
        };
        let mut ghosts: Vec<u32> = elements()
            .flat_map(Element::nodes)
            .copied()
            .filter(|&node| !is_own(node))
            .collect();
        ghosts.sort_unstable_by_key(|&node| self.number[node as usize]);
        ghosts.dedup();
        let local = |node: u32| -> Option<u32> {
            let number = self.number[node as usize];
            if is_own(node) {
                return Some(number - first);
            }
            let found = ghosts.binary_search_by_key(&number, |&g| self.number[g as usize]);
            found.ok().map(|place| (own.len() + place) as u32)
        };
        let all = || own.iter().chain(&ghosts).copied().zip(0u32..);
        let at = |node: u32| local(node).expect("a node of its elements");

        let mut part = Part {
            first: first.into(),
            first_block: self.first_block[rank].into(),
            own: own.len(),
            ghosts: ghosts
                .iter()
                .map(|&g| self.number[g as usize].into())
                .collect(),
            ghost_blocks: (ghosts.iter())
                .map(|&g| self.block[g as usize])
                .filter(|&block| block != NONE)
                .map(u64::from)
                .collect(),
            coordinates: all()
                .flat_map(|(node, _)| mesh.nodes[node as usize])
                .collect(),
            kinds: elements().map(Element::kind).collect(),
            corners: elements()
                .flat_map(Element::nodes)
                .map(|&node| at(node))
                .collect(),
            regions: elements().map(|e| e.region).collect(),
            own_elements: mine.len(),
            ..Part::default()
        };

        let mut found = Vec::new();
        for (node, place) in all() {
            let first = self.held.partition_point(|held| held.0 < node);
            let here = self.held[first..].iter().take_while(|held| held.0 == node);
            for (&(_, c), which) in here.zip(first..) {
                part.prescribed.push((place, c as u32));
                found.push(which);
            }
            if let Some(frame) = elastic.unknowns.frame(node) {
                part.frames.push((place, frame.as_flattened().to_vec()));
            }
        }
        for (values, (nodes, forces)) in self.values.iter().zip(&self.forces) {
            part.values
                .push(found.iter().map(|&which| values[which]).collect());
            let acts = own.iter().zip(0u32..).filter_map(|(node, place)| {
                let found = nodes.binary_search(node).ok()?;
                Some((place, forces[found]))
            });
            let (places, values): (Vec<u32>, Vec<[f64; D]>) = acts.unzip();
            part.forces.push((places, values.into_flattened()));
        }
        let held = elastic.held.iter().filter(|&&(node, ..)| is_own(node));
        part.held = held
            .map(|&(node, c, support)| (at(node), c as u32, support as u32))
            .collect();

        for &node in own {
            let row = elastic.unknowns.bedding().row(node);
            part.bedding.extend(row.map(|(&(a, b, support), block)| {
                (at(a), at(b), support as u32, block.as_flattened().to_vec())
            }));
        }

        let own_unknown = |column: usize| -> Option<u32> {
            let node = elastic.unknowns.node(column / D);
            let block = self.block[node as usize] - self.first_block[rank];
            is_own(node).then_some(D as u32 * block + (column % D) as u32)
        };
        let contact = &elastic.contact;
        for (rows, matrix) in part
            .rows
            .iter_mut()
            .zip([&contact.normal, &contact.tangential])
        {
            let entries = matrix.triplets();
            rows.extend(entries.filter_map(|(i, j, v)| {
                let node = elastic.unknowns.node(j / D);
                is_own(node).then(|| (i as u32, own_unknown(j).unwrap_or(NONE), v))
            }));
        }
        for (place, i) in contact.places.iter().zip(0u32..) {
            part.sides.resize(1 + D, Default::default());
            let directed = place.directed.iter().map(|[own, partners]| [own, partners]);
            let all = std::iter::once([&place.own, &place.partners]).chain(directed);
            for (sides, from) in part.sides.iter_mut().zip(all) {
                for (side, nodes) in sides.iter_mut().zip(from) {
                    let here = nodes.iter().filter(|(node, _)| !place.is_image(*node));
                    side.extend(here.filter_map(|&(node, w)| Some((i, local(node)?, w))));
                }
            }
            for a in 0..D as u32 {
                let further = place.beyond(a as usize);
                part.further.extend(
                    further.filter_map(|(node, way)| Some((i, a, local(node)?, way.to_vec()))),
                );
            }
            let node = place.node.and_then(local);
            part.place_nodes.extend(node.map(|node| (i, node)));
        }
        for &(i, node, share) in &self.at_nodes {
            let Some(here) = local(node) else { continue };
            part.at_nodes.push((i, here, share));
            let turn = elastic.turn_to(i as usize, node);
            part.turns
                .extend(turn.map(|turn| (i, here, turn.as_flattened().to_vec())));
        }

        let with_block = || {
            own.iter()
                .filter(|&&node| self.block[node as usize] != NONE)
        };
        part.parts = with_block().map(|&node| self.part[node as usize]).collect();
        let ties = self.ties.iter().map(|&tie| tie as usize);
        part.ties = ties
            .filter(|&tie| is_own(elastic.unknowns.node(tie / D)))
            .filter_map(own_unknown)
            .collect();
        part.body_of = own
            .iter()
            .map(|&node| self.body_of[node as usize])
            .collect();
        part.pair_nodes = (elastic.pairs.iter())
            .map(|pair| {
                let facets = pair.facets.iter().chain(&pair.others);
                let nodes = facets.flat_map(facet_nodes).filter(|&&node| is_own(node));
                let mut nodes: Vec<u32> = nodes.map(|&node| at(node)).collect();
                nodes.sort_unstable();
                nodes.dedup();
                nodes
            })
            .collect();
        part
    }

    /// Unknowns and elements of each rank.
    pub fn sizes(&self) -> Vec<[usize; 2]> {
        let ends = self.first_block.iter().skip(1).copied();
        let all = (self.common.n / D) as u32;
        let blocks = self.first_block.iter().zip(ends.chain([all]));
        (blocks.enumerate())
            .map(|(rank, (&first, end))| [D * (end - first) as usize, self.elements.of(rank).len()])
            .collect()
    }
}

/// The connected parts of K: how many, and that of each node which has a block.
fn parts<const D: usize>(elastic: &Elastic<D>) -> (usize, Vec<u32>)
where
    ElementKind: Topology<D>,
{
    let unknowns = &elastic.unknowns;
    let mut groups = Groups::new(unknowns.n_blocks());
    for element in &elastic.mesh.elements {
        let mut blocks = element
            .nodes()
            .iter()
            .filter_map(|&node| unknowns.block(node));
        if let Some(first) = blocks.next() {
            blocks.for_each(|block| groups.join(first, block));
        }
    }
    let (count, of_block) = groups.numbers();
    let of_node = |node| {
        unknowns
            .block(node)
            .map_or(NONE, |block| of_block[block as usize])
    };
    (
        count,
        (0..elastic.mesh.nodes.len() as u32).map(of_node).collect(),
    )
}

/// Whether B touches each block.
fn touched<const D: usize>(elastic: &Elastic<D>) -> Vec<bool>
where
    ElementKind: Topology<D>,
{
    touched_by(elastic, |_| true)
}

/// Whether the rows of such contact places involve it.
fn touched_by<const D: usize>(elastic: &Elastic<D>, place: impl Fn(usize) -> bool) -> Vec<bool>
where
    ElementKind: Topology<D>,
{
    let mut touched = vec![false; elastic.unknowns.n_blocks()];
    let contact = &elastic.contact;
    for (rows, each) in [(&contact.normal, 1), (&contact.tangential, D - 1)] {
        for (row, column, _) in rows.triplets() {
            touched[column / D] |= place(row / each);
        }
    }
    touched
}

/// The bodies that only contact holds, and how they can move as a whole, in words.
///
/// # Errors
/// If one has no contact to hold it.
pub(crate) fn freedoms<const D: usize>(elastic: &Elastic<D>) -> Result<Vec<String>, ModelError>
where
    ElementKind: Topology<D>,
{
    let (count, part) = parts(elastic);
    let (bodies, _) = floating(elastic, count, &part, &touched(elastic))?;
    Ok(bodies.into_iter().map(|body| body.freedom).collect())
}

/// The bodies that can move as a whole, by the motions that their supports leave free, and the unknowns to tie them by.
fn floating<const D: usize>(
    elastic: &Elastic<D>,
    count: usize,
    part: &[u32],
    touched: &[bool],
) -> Result<(Vec<Body>, Vec<u32>), ModelError>
where
    ElementKind: Topology<D>,
{
    let (mesh, unknowns) = (&elastic.mesh, &elastic.unknowns);
    let mut held: Vec<Vec<([f64; D], [f64; D])>> = vec![Vec::new(); count];
    let ways = |node: u32| {
        let axis = |c: usize| std::array::from_fn(|i| f64::from(u8::from(i == c)));
        let all = unknowns.prescribed(node);
        let some = (0..D).filter(move |&c| all[c].is_some());
        some.map(move |c| {
            let way = unknowns
                .frame(node)
                .map_or_else(|| axis(c), |frame| frame[c]);
            (mesh.nodes[node as usize], way)
        })
    };
    let is_round = D == 2 && elastic.plane == Plane::Axisymmetric;
    for node in 0..mesh.nodes.len() as u32 {
        if part[node as usize] != NONE {
            let held = &mut held[part[node as usize] as usize];
            held.extend(ways(node));
            // A ring moves as a whole only along its axis: its hoop stiffness holds it in radius.
            let radial = std::array::from_fn(|i| f64::from(u8::from(i == 0)));
            held.extend(is_round.then_some((mesh.nodes[node as usize], radial)));
        }
    }
    // Fully held nodes hold the bodies of the elements around them.
    let mut seen = HashSet::new();
    for element in &mesh.elements {
        let of = |&node: &u32| part[node as usize];
        let Some(one) = element.nodes().iter().map(of).find(|&part| part != NONE) else {
            continue;
        };
        for &node in element.nodes() {
            if part[node as usize] == NONE && seen.insert((one, node)) {
                held[one as usize].extend(ways(node));
            }
        }
    }
    // Foundations hold it where they are, along the normal and across it.
    let on_bed = |_, nodes: &[u32], point: &FacetPoint<D>, _, stiffness: [f64; 2]| {
        let of = |&node: &u32| part[node as usize];
        let Some(one) = nodes.iter().map(of).find(|&part| part != NONE) else {
            return;
        };
        let mut ways = vec![point.normal];
        for c in 0..D {
            let axis = std::array::from_fn(|i| f64::from(u8::from(i == c)));
            extended(&mut ways, axis, SAME);
        }
        let across = ways.split_off(1);
        for (ways, _) in [ways, across]
            .iter()
            .zip(stiffness)
            .filter(|(_, k)| *k > 0.0)
        {
            held[one as usize].extend(ways.iter().map(|&way| (point.place, way)));
        }
    };
    elastic.definition.on_foundations(&elastic.body(), on_bed)?;
    let points = unknowns.coordinates(mesh);
    let mut blocks: Vec<Vec<u32>> = vec![Vec::new(); count];
    for block in 0..unknowns.n_blocks() {
        blocks[part[unknowns.node(block) as usize] as usize].push(block as u32);
    }
    let is_tied = elastic.contact.tied();
    let compliance = &elastic.contact.compliance;
    let kinds = Holder::ALL
        .map(|kind| touched_by(elastic, |i| Holder::of(is_tied[i], compliance, i) == kind));
    let (mut bodies, mut floating) = (Vec::new(), Vec::new());
    for ((nodes, held), one) in blocks.into_iter().zip(&held).zip(0u32..) {
        let here: Vec<[f64; D]> = nodes.iter().map(|&block| points[block as usize]).collect();
        let Some(motions) = Motions::left(&here, held) else {
            continue;
        };
        let name = named_by(mesh, unknowns.node(nodes[0] as usize));
        let by = |touched: &[bool]| nodes.iter().any(|&block| touched[block as usize]);
        let (is_touched, holders) = (by(touched), held_by(kinds.each_ref().map(|kind| by(kind))));
        let body = motions.body(nodes, &points, moves(unknowns));
        let freedom = format!("{name} can {} as a whole", body.freedom());
        if !is_touched {
            return Err(loose(&format!(
                "{freedom}, and it has no contact to hold it"
            )));
        }
        floating.push(body);
        bodies.push(Body {
            part: one,
            motions,
            name,
            freedom: format!("{freedom}: {holders}"),
        });
    }
    let floating = FloatingBodies::of_ranks(floating, &Ranks::default());
    let ties = floating.unknowns_to_fix(|unknown| touched[unknown / D]);
    Ok((bodies, ties))
}

/// Whether a block moves in a component: not where a support holds it along an axis.
fn moves<const D: usize>(unknowns: &Unknowns<D>) -> impl Fn(u32, usize) -> bool + '_ {
    |block, c| {
        let node = unknowns.node(block as usize);
        unknowns.frame(node).is_some() || unknowns.prescribed(node)[c].is_none()
    }
}

impl Place {
    fn of<const D: usize>(place: &ContactPlace<D>) -> Self {
        Self {
            place: place.place.to_vec(),
            frame: place.frame.as_flattened().to_vec(),
            gap: place.gap,
            area: place.area,
            pool: place.pool,
            slip_bound: place.slip_bound,
            compliance: place.compliance,
            is_node: place.node.is_some(),
            is_directed: !place.directed.is_empty(),
        }
    }

    /// The place as before, without its nodes: if it is at a node, that is not one of this rank's.
    fn made<const D: usize>(&self) -> ContactPlace<D> {
        ContactPlace {
            place: fixed(&self.place),
            node: self.is_node.then_some(NONE),
            own: Vec::new(),
            partners: Vec::new(),
            directed: vec![Default::default(); if self.is_directed { D } else { 0 }],
            further: Vec::new(),
            sectors: None,
            frame: rows(&self.frame),
            gap: self.gap,
            area: self.area,
            part: 0,
            pool: self.pool,
            slip_bound: self.slip_bound,
            compliance: self.compliance,
        }
    }
}

fn fixed<const D: usize>(from: &[f64]) -> [f64; D] {
    std::array::from_fn(|c| from[c])
}

fn rows<const D: usize>(from: &[f64]) -> [[f64; D]; D] {
    std::array::from_fn(|r| fixed(&from[D * r..]))
}

/// The bodies on a rank, with the data for the load of each step.
pub(crate) struct Received<const D: usize>
where
    ElementKind: Topology<D>,
{
    pub elastic: Elastic<D>,
    pub common: Common,
    pub part: Part,
    /// Each temperature, where stresses are asked for.
    warmth: Vec<Quantity<D>>,
}

impl<const D: usize> Received<D>
where
    ElementKind: Space<D>,
{
    /// From the data that rank 0 sent.
    pub fn new(common: Common, mut part: Part) -> Self {
        let mesh = Mesh {
            nodes: part.coordinates.chunks(D).map(fixed).collect(),
            elements: part.elements(),
            regions: common.regions.clone(),
            groups: BTreeMap::new(),
            boundaries: BTreeMap::new(),
            node_sets: BTreeMap::new(),
            faults: BTreeMap::new(),
            notes: Vec::new(),
            twins: BTreeMap::new(),
            lost: BTreeMap::new(),
        };
        part.coordinates = Vec::new();
        let unknowns = part.unknowns(mesh.nodes.len(), 0);
        let mut places: Vec<ContactPlace<D>> = common.places.iter().map(Place::made).collect();
        for (a, sides) in std::mem::take(&mut part.sides).into_iter().enumerate() {
            for (side, nodes) in sides.into_iter().enumerate() {
                for (i, node, weight) in nodes {
                    let place = &mut places[i as usize];
                    let to = match a {
                        0 => [&mut place.own, &mut place.partners],
                        _ => place.directed[a - 1].each_mut(),
                    };
                    to.into_iter()
                        .nth(side)
                        .expect("two sides")
                        .push((node, weight));
                }
            }
        }
        for (i, a, node, way) in std::mem::take(&mut part.further) {
            let rows = &mut places[i as usize].further;
            rows.resize(D, Vec::new());
            rows[a as usize].push((node, fixed(&way)));
        }
        for &(i, node) in &part.place_nodes {
            places[i as usize].node = Some(node);
        }
        let m = places.len();
        let n = D * part.parts.len();
        let [normal, tangential] = std::mem::take(&mut part.rows);
        let matrix = |rows: usize, entries: Vec<(u32, u32, f64)>| {
            let entries = entries.into_iter();
            Csr::from_triplets(
                rows,
                n,
                entries.map(|(i, j, v)| (i as usize, j as usize, v)),
            )
        };
        let matrices = [matrix(m, normal), matrix((D - 1) * m, tangential)];
        let contact = ContactRows::of_places(
            places,
            matrices,
            common.slip_bound.clone(),
            common.coefficient.clone(),
            common.compliance.clone(),
        );
        let held = part
            .held
            .iter()
            .map(|&(node, c, s)| (node, c as usize, s as usize));
        let elastic = Elastic {
            materials: common.materials.clone(),
            plane: common.plane,
            thickness: common.thickness,
            sectors: (common.sectors.as_ref()).map(|(point, direction, number)| {
                (Axis::through(fixed(point), *direction), *number)
            }),
            unknowns,
            held: held.collect(),
            supports: common.supports.clone(),
            support_centres: common.support_centres.iter().map(|x| fixed(x)).collect(),
            contact,
            candidates: Vec::new(),
            sliding: Sliding::default(),
            loose: Vec::new(),
            glued: Vec::new(),
            at_nodes: std::mem::take(&mut part.at_nodes),
            turns: (std::mem::take(&mut part.turns).into_iter())
                .map(|(i, node, turn)| ((i, node), rows(&turn)))
                .collect(),
            // Rank 0 keeps the others and puts them here.
            pairs: common.kinds.iter().map(PairData::known).collect(),
            pair_of: common.pair_of.clone(),
            units: Units {
                length: common.length.clone(),
                force: common.force.clone(),
            },
            units_stated: common.units_stated,
            assembly_seconds: 0.0,
            pairing_seconds: 0.0,
            mesh,
            definition: Definition::default(),
            prescriptions: Prescriptions::default(),
        };
        Self {
            elastic,
            common,
            part,
            warmth: Vec::new(),
        }
    }

    /// Learns the temperatures of the model, which rank 0 has, at the points where the stresses of this rank's elements
    /// are computed. They may be functions of the place, or have values at the nodes of the whole mesh. Collective.
    pub fn learn_temperatures(&mut self, group: &Group, of_model: &[Quantity<D>]) {
        if self.common.warm_regions.is_empty() {
            return;
        }
        let body = self.elastic.body();
        let asked = Mutex::new(Vec::new());
        let ask = |_: u32, x: [f64; D]| {
            asked.lock().expect("nobody panics here").push(x);
            0.0
        };
        stresses_at(&body, &vec![[0.0; D]; body.mesh.nodes.len()], Some(&ask));
        let mut points = asked.into_inner().expect("nobody panics here");
        points.sort_unstable_by_key(|x| x.map(f64::to_bits));
        points.dedup_by_key(|x| x.map(f64::to_bits));
        let values = |points: &[f64]| -> Vec<Vec<f64>> {
            let points = points.chunks(D);
            (of_model.iter())
                .map(|value| points.clone().map(|x| value.at(fixed(x))).collect())
                .collect()
        };
        let here: Vec<Vec<f64>> = match group.rank() {
            0 => {
                for rank in 1..group.size() {
                    let points: Vec<f64> = group.receive(rank);
                    group.send(rank, &values(&points));
                }
                values(points.as_flattened())
            }
            _ => {
                group.send(0, &points.as_flattened().to_vec());
                group.receive(0)
            }
        };
        let points = Arc::new(points);
        self.warmth = (here.into_iter())
            .map(|values| {
                let points = Arc::clone(&points);
                let bits = |x: [f64; D]| x.map(f64::to_bits);
                Quantity::from(move |x: [f64; D]| {
                    let found = points.binary_search_by_key(&bits(x), |&point| bits(point));
                    found.map_or(f64::NAN, |place| values[place])
                })
            })
            .collect();
    }

    /// This rank's part of the bodies that can move as a whole.
    pub fn floating_bodies(&self, points: &[[f64; D]], ranks: &Ranks) -> FloatingBodies<D> {
        let bodies = self.common.bodies.iter().map(|body| {
            let here = (self.part.parts.iter().zip(0u32..)).filter(|&(&part, _)| part == body.part);
            let nodes = here.map(|(_, block)| block).collect();
            body.motions
                .body(nodes, points, moves(&self.elastic.unknowns))
        });
        FloatingBodies::of_ranks(bodies.collect(), ranks)
    }

    /// The load at the end of a step, counted from 0.
    pub fn step(&self, step: usize) -> StepData<D> {
        let (elastic, of_all) = (&self.elastic, &self.common.steps[step]);
        let unknowns = self.part.unknowns(elastic.mesh.nodes.len(), step);
        let mut forces = vec![[0.0; D]; elastic.mesh.nodes.len()];
        let (nodes, values) = &self.part.forces[step];
        for (&node, force) in nodes.iter().zip(values.chunks(D)) {
            forces[node as usize] = fixed(force);
        }
        let mut force = load_vector(&elastic.body(), &unknowns, &forces);
        // Rows of others are not complete here.
        force.truncate(D * self.part.parts.len());
        StepData {
            factor: of_all.factor,
            total_load: fixed(&of_all.total_load),
            load: Load {
                force,
                acting: of_all.acting,
                gap: of_all.gap.clone(),
                slide: of_all.slide.clone(),
            },
            changes: of_all.changes.clone(),
            driven: of_all.driven.clone(),
            unknowns,
            forces,
            temperature: TemperatureField(
                (self.common.warm_regions.iter().cloned())
                    .zip(&of_all.warmth)
                    .zip(&self.warmth)
                    .map(|((regions, &factor), value)| (regions, factor, value.clone()))
                    .collect(),
            ),
        }
    }
}

impl Part {
    fn elements<const D: usize>(&mut self) -> Vec<Element<D>>
    where
        ElementKind: Topology<D>,
    {
        let mut corners = &self.corners[..];
        let elements = self
            .kinds
            .iter()
            .zip(&self.regions)
            .map(|(&kind, &region)| {
                let (nodes, rest) = corners.split_at(kind.n_nodes());
                corners = rest;
                Element::new(kind, nodes, region)
            });
        let elements = elements.collect();
        (self.kinds, self.corners, self.regions) = Default::default();
        elements
    }

    /// The numbering of its nodes, with the prescribed components of a step.
    fn unknowns<const D: usize>(&self, nodes: usize, step: usize) -> Unknowns<D> {
        let mut prescribed = vec![[None; D]; nodes];
        for (&(node, c), &value) in self.prescribed.iter().zip(&self.values[step]) {
            prescribed[node as usize][c as usize] = Some(value);
        }
        let frames = self.frames.iter().map(|(node, frame)| (*node, rows(frame)));
        let blocks = self.bedding.iter();
        let bedding = Bedding::of(
            blocks.map(|(a, b, support, block)| ((*a, *b, *support as usize), rows(block))),
        );
        Unknowns::new(prescribed)
            .along(frames.collect())
            .bedded(Arc::new(bedding))
    }
}
