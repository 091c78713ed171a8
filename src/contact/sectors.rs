//! Contact between sectors of bodies that repeat themselves about an axis, beyond the sides of the sectors that are meshed.
//!
//! Places are found on a mesh of several sectors, whose sides have common nodes where their meshes match: as in a whole body. Those are
//! kept that begin in the first sector, so that each is there once. Nodes of other sectors are *images*: node b of sector k has the number
//! b + k · (nodes of a sector), and its displacement is that of b, turned by k sectors.

use super::{Centre, ContactError, ContactPlace, PairOptions, Seams, Wall};
use crate::elasticity::Body;
use crate::mesh::vector::{dot, length, minus};
use crate::mesh::{Element, ElementKind, Facet, Mesh, Topology, bounds, facet_nodes};
use std::array::from_fn;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::f64::consts::TAU;
use std::sync::Arc;

/// A facet of the other sectors counts as one beside the first sector up to so many facets from its sides.
const LAYERS: usize = 4;

/// The turn from each sector of a body to the next one.
#[derive(Clone, Debug, PartialEq)]
pub struct Sectors<const D: usize> {
    /// Their number.
    count: u32,
    /// The nodes of one.
    nodes: u32,
    /// The turn of vectors by so many sectors, and what a turn of places adds.
    turns: Vec<([[f64; D]; D], [f64; D])>,
    /// For nodes where a sector ends, the one of the next sector that is the same.
    start_of: HashMap<u32, u32>,
    /// The other way round.
    end_of: HashMap<u32, u32>,
}

impl<const D: usize> Sectors<D> {
    /// So many sectors of so many nodes; None if their nodes are too many to be numbered. `turned` turns a place by an angle.
    pub(crate) fn new(
        count: u32,
        nodes: usize,
        turned: impl Fn([f64; D], f64) -> [f64; D],
    ) -> Option<Self> {
        u32::try_from(nodes as u64 * u64::from(count)).ok()?;
        let turns = (0..count).map(|k| {
            let angle = TAU * f64::from(k) / f64::from(count);
            let start = turned([0.0; D], angle);
            let columns: [[f64; D]; D] = from_fn(|c| {
                let end = turned(from_fn(|d| f64::from(u8::from(c == d))), angle);
                from_fn(|r| end[r] - start[r])
            });
            (from_fn(|r| from_fn(|c| columns[c][r])), start)
        });
        Some(Self {
            count,
            nodes: nodes as u32,
            turns: turns.collect(),
            start_of: HashMap::new(),
            end_of: HashMap::new(),
        })
    }

    /// Their number.
    pub(crate) fn count(&self) -> u32 {
        self.count
    }

    /// States that a turn by one sector, one way or the other, takes the second node to the first.
    pub(crate) fn join(&mut self, one: u32, other: u32, turn: &[[f64; D]; D]) {
        let (end, start) = match self.steps(turn) {
            Some(1) => (one, other),
            _ => (other, one),
        };
        self.start_of.insert(end, start);
        self.end_of.insert(start, end);
    }

    /// For an image on a side of its sector, the one of the sector beside it that is at the same place.
    fn twin(&self, image: u32) -> Option<u32> {
        let (node, k) = self.of(image);
        let (twin, sector) = match (self.start_of.get(&node), self.end_of.get(&node)) {
            (Some(start), _) => (start, k as u32 + 1),
            (_, Some(end)) => (end, k as u32 + self.count - 1),
            _ => return None,
        };
        Some(twin + sector % self.count * self.nodes)
    }

    /// Whether places are all around the axis, rather than in one sector or two.
    pub(crate) fn surrounded(&self, places: impl Iterator<Item = [f64; D]>) -> bool {
        let part = f64::from(self.count).recip();
        let (mut sum, mut size) = ([0.0; D], 0.0);
        for x in places {
            let mut arm = x;
            for k in 0..self.count as usize {
                let turned = self.carried(x, k);
                (0..D).for_each(|c| arm[c] -= part * turned[c]);
            }
            (0..D).for_each(|c| sum[c] += arm[c]);
            size += length(arm);
        }
        length(sum) < 0.3 * size
    }

    /// By how many sectors a turn takes vectors, one or the other way by one.
    fn steps(&self, turn: &[[f64; D]; D]) -> Option<u32> {
        let is_same = |k: &u32| {
            let mut rows = turn.iter().zip(&self.turns[*k as usize].0);
            rows.all(|(a, b)| length(minus(*a, *b)) < 1e-9)
        };
        [1, self.count - 1].into_iter().find(is_same)
    }

    /// The node of the first sector that an image is of, and by how many sectors it is turned.
    fn of(&self, image: u32) -> (u32, usize) {
        (image % self.nodes, (image / self.nodes) as usize)
    }

    /// A vector turned by k sectors.
    fn turned(&self, v: [f64; D], k: usize) -> [f64; D] {
        self.turns[k].0.map(|row| dot(row, v))
    }

    /// The facets of all sectors, on a mesh of their nodes alone.
    pub(crate) fn all_around(
        &self,
        mesh: &Mesh<D>,
        sides: [&[Facet<D>]; 2],
    ) -> (Mesh<D>, [Vec<Facet<D>>; 2])
    where
        ElementKind: Topology<D>,
    {
        let mut whole = mesh.clone();
        whole.elements.clear();
        whole.nodes.clear();
        let mut numbers: HashMap<u32, u32> = HashMap::new();
        let sides = sides.map(|facets| {
            let all = (0..self.count).flat_map(|sector| facets.iter().map(move |f| (sector, *f)));
            let turned = all.map(|(sector, mut facet)| {
                for node in facet.as_mut() {
                    let image = self.image(sector, *node);
                    *node = *numbers.entry(image).or_insert_with(|| {
                        let (node, k) = self.of(image);
                        let x = mesh.nodes[node as usize];
                        whole.nodes.push(self.carried(x, k));
                        whole.nodes.len() as u32 - 1
                    });
                }
                facet
            });
            turned.collect()
        });
        (whole, sides)
    }

    /// A place turned by k sectors.
    fn carried(&self, x: [f64; D], k: usize) -> [f64; D] {
        let (turned, start) = (self.turned(x, k), self.turns[k].1);
        from_fn(|c| turned[c] + start[c])
    }

    /// A vector turned back by k sectors.
    fn back(&self, v: [f64; D], k: usize) -> [f64; D] {
        let turn = &self.turns[k].0;
        from_fn(|c| (0..D).map(|r| turn[r][c] * v[r]).sum())
    }

    /// A place of sector k in the first one.
    pub(super) fn home(&self, x: [f64; D], k: usize) -> [f64; D] {
        self.carried(x, (self.count as usize - k) % self.count as usize)
    }

    /// Which node of which sector node b of sector k is: where one begins rather than where the last one ends.
    fn at(&self, k: u32, b: u32) -> (u32, u32) {
        match self.start_of.get(&b) {
            Some(start) => ((k + 1) % self.count, *start),
            None => (k, b),
        }
    }

    /// The number of an image; of nodes on the sides of the first sector those of its mesh.
    fn image(&self, k: u32, b: u32) -> u32 {
        match (self.at(k, b), self.end_of.get(&self.at(k, b).1)) {
            ((0, b), _) => b,
            ((1, _), Some(end)) => *end,
            ((k, b), _) => k * self.nodes + b,
        }
    }

    /// Whether a place with these nodes begins in the first sector.
    fn begins(&self, own: &[(u32, f64)]) -> bool {
        let own = own.iter().map(|&(image, _)| {
            let (b, k) = self.of(image);
            self.at(k as u32, b)
        });
        let own: Vec<(u32, u32)> = own.collect();
        let is_in = |sector: u32| own.iter().any(|at| at.0 == sector);
        match self.count {
            // Both are on either side of it.
            2 if is_in(1) => is_in(0) && own.iter().any(|at| at.0 == 1 && self.is_start(at.1)),
            count => is_in(0) && !is_in(count - 1),
        }
    }

    fn is_start(&self, node: u32) -> bool {
        self.end_of.contains_key(&node)
    }
}

/// Values of nodes at a place, whose nodes may be images.
impl<const D: usize> ContactPlace<D> {
    /// The node of the mesh that one of its nodes is an image of, or that node itself.
    pub fn node_of(&self, image: u32) -> u32 {
        self.sectors.as_ref().map_or(image, |all| all.of(image).0)
    }

    /// The displacement of one of its nodes along a direction, times a factor: the node of the mesh, and the vector that its displacement is
    /// multiplied by.
    pub(super) fn term(&self, image: u32, factor: f64, way: [f64; D]) -> (u32, [f64; D]) {
        let way = self.back(image, way.map(|v| factor * v));
        (self.node_of(image), way)
    }

    /// Whether one of its nodes is an image.
    pub(crate) fn is_image(&self, node: u32) -> bool {
        (self.sectors.as_ref()).is_some_and(|all| node >= all.nodes)
    }

    /// The terms of images in the row along direction `a` of its frame, and of further nodes.
    #[cfg(feature = "mpi")]
    pub(crate) fn beyond(&self, a: usize) -> impl Iterator<Item = (u32, [f64; D])> {
        let (way, sides) = (self.frame[a], self.sides(a));
        let images = sides
            .into_iter()
            .zip([1.0, -1.0])
            .flat_map(move |(side, sign)| {
                let images = side.iter().filter(|(node, _)| self.is_image(*node));
                images.map(move |&(node, weight)| self.term(node, sign * weight, way))
            });
        images.chain(self.further.get(a).into_iter().flatten().copied())
    }

    /// The nodes that one of its nodes is, two on the sides of sectors: those of the mesh of one sector, or of one with all images.
    pub(crate) fn nodes_of(&self, image: u32, mesh: usize) -> impl Iterator<Item = u32> {
        (self.with_twin(image)).map(move |image| self.node_in(image, mesh))
    }

    fn with_twin(&self, image: u32) -> impl Iterator<Item = u32> {
        let twin = self.sectors.as_ref().and_then(|all| all.twin(image));
        std::iter::once(image).chain(twin)
    }

    /// The turn of its vectors to a node of its own side in a mesh of so many nodes, if that is elsewhere: of an image, or on the
    /// other side of its sector.
    pub(crate) fn turn_to(&self, node: u32, mesh: usize) -> Option<[[f64; D]; D]> {
        let all = self.sectors.as_ref()?;
        let mut images = self.own.iter().flat_map(|own| self.with_twin(own.0));
        let image = images.find(|&image| self.node_in(image, mesh) == node)?;
        let axis = |c: usize| from_fn(|d| f64::from(u8::from(c == d)));
        let columns: [[f64; D]; D] = from_fn(|c| all.back(axis(c), all.of(image).1));
        ((image as usize) >= mesh).then(|| from_fn(|r| from_fn(|c| columns[c][r])))
    }

    /// The node that one of its nodes is in a mesh of so many nodes: one of all images, or of one sector.
    pub(crate) fn node_in(&self, image: u32, mesh: usize) -> u32 {
        match (image as usize) < mesh {
            true => image,
            false => self.node_of(image),
        }
    }

    /// A vector at one of its nodes, turned back to the node of the mesh.
    pub(crate) fn back(&self, image: u32, v: [f64; D]) -> [f64; D] {
        match &self.sectors {
            Some(all) if image >= all.nodes => all.back(v, all.of(image).1),
            _ => v,
        }
    }

    /// A vector of the mesh, turned to one of its nodes.
    pub(crate) fn turned_to(&self, image: u32, v: [f64; D]) -> [f64; D] {
        match &self.sectors {
            Some(all) if image >= all.nodes => all.turned(v, all.of(image).1),
            _ => v,
        }
    }

    /// Where one of its nodes is, from the places of the nodes of the mesh.
    pub(crate) fn place_of(&self, image: u32, nodes: &[[f64; D]]) -> [f64; D] {
        self.place_at(image, |node| nodes[node as usize])
    }

    /// The same, from a function of the nodes of the mesh.
    pub(crate) fn place_at(&self, image: u32, at: impl Fn(u32) -> [f64; D]) -> [f64; D] {
        match &self.sectors {
            Some(all) if image >= all.nodes => {
                let (node, k) = all.of(image);
                all.carried(at(node), k)
            }
            _ => at(image),
        }
    }

    /// The image in the same sector as another one.
    pub(crate) fn beside(&self, image: u32, node: u32) -> u32 {
        node + image - self.node_of(image)
    }
}

/// Both boundaries of a contact in all sectors that matter, on one mesh.
pub(super) struct Around<'s, const D: usize>
where
    ElementKind: Topology<D>,
{
    sectors: &'s Sectors<D>,
    pub mesh: Mesh<D>,
    pub rest: Option<Mesh<D>>,
    pub facets: Vec<Facet<D>>,
    pub others: Vec<Facet<D>>,
    /// The sector of each of the facets, and its number in its boundary.
    of_facets: Vec<(usize, usize)>,
    of_others: Vec<(usize, usize)>,
    /// Of each sector, the numbers of its nodes on the mesh.
    numbers: BTreeMap<u32, Vec<u32>>,
    /// Of each node of the mesh, the image that it is.
    images: Vec<u32>,
}

impl<'s, const D: usize> Around<'s, D>
where
    ElementKind: Topology<D>,
{
    /// With the sectors that may be met within a distance.
    pub fn new(
        sectors: &'s Sectors<D>,
        body: &Body<D>,
        [facets, others]: [&[Facet<D>]; 2],
        distance: f64,
        (seams, rest): (Option<&Seams<D>>, Option<&Mesh<D>>),
    ) -> Self {
        let count = sectors.count;
        // The facets near the sides, which matter of both sectors beside the first.
        let mut near: BTreeSet<u32> = seams
            .iter()
            .flat_map(|seams| seams.keys().copied())
            .collect();
        let mut beside = BTreeSet::new();
        for _ in 0..LAYERS {
            let is_near = |k: &usize| facet_nodes(&facets[*k]).iter().any(|n| near.contains(n));
            beside.extend((0..facets.len()).filter(is_near));
            near.extend(beside.iter().flat_map(|&k| facet_nodes(&facets[k])));
        }
        let mut of_facets: BTreeSet<(usize, usize)> = (0..facets.len()).map(|k| (0, k)).collect();
        let last = count as usize - 1;
        of_facets.extend(beside.into_iter().flat_map(|k| [(1, k), (last, k)]));
        let of_facets: Vec<(usize, usize)> = of_facets.into_iter().collect();

        let place =
            |sector: usize, node: &u32| sectors.carried(body.mesh.nodes[*node as usize], sector);
        let here = of_facets.iter().flat_map(|&(sector, k)| {
            facet_nodes(&facets[k])
                .iter()
                .map(move |node| place(sector, node))
        });
        let (low, high) = bounds(here);
        let may_meet = |sector: &usize| {
            let there = others.iter().flat_map(facet_nodes);
            let there = bounds(there.map(|node| place(*sector, node)));
            (0..D).all(|c| there.0[c] <= high[c] + distance && there.1[c] >= low[c] - distance)
        };
        let near: Vec<usize> = (0..count as usize).filter(may_meet).collect();
        // Their neighbours make the normals at their sides whole.
        let mut used: BTreeSet<u32> = [0, 1, count - 1].into();
        for sector in near {
            let sector = sector as u32;
            used.extend([sector, (sector + 1) % count, (sector + count - 1) % count]);
        }

        let mut images: Vec<u32> = (0..sectors.nodes).collect();
        let mut known: HashMap<u32, u32> = HashMap::new();
        let mut numbers: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for &sector in &used {
            let of_sector = (0..sectors.nodes).map(|node| {
                let image = sectors.image(sector, node);
                if image < sectors.nodes {
                    return image;
                }
                *known.entry(image).or_insert_with(|| {
                    images.push(image);
                    images.len() as u32 - 1
                })
            });
            numbers.insert(sector, of_sector.collect());
        }
        let mut around = Self {
            sectors,
            mesh: body.mesh.clone(),
            rest: rest.cloned(),
            facets: Vec::new(),
            others: Vec::new(),
            of_facets,
            of_others: (used.iter())
                .flat_map(|&sector| (0..others.len()).map(move |k| (sector as usize, k)))
                .collect(),
            numbers,
            images,
        };
        for mesh in [Some(&mut around.mesh), around.rest.as_mut()]
            .into_iter()
            .flatten()
        {
            let beyond = around.images[mesh.nodes.len()..].iter().map(|&image| {
                let (node, k) = sectors.of(image);
                sectors.carried(mesh.nodes[node as usize], k)
            });
            let beyond: Vec<[f64; D]> = beyond.collect();
            mesh.nodes.extend(beyond);
            let own = mesh.elements.len();
            for numbers in around.numbers.range(1..).map(|sector| sector.1) {
                for e in 0..own {
                    let element = mesh.elements[e];
                    let nodes: Vec<u32> = (element.nodes().iter())
                        .map(|&node| numbers[node as usize])
                        .collect();
                    mesh.elements
                        .push(Element::new(element.kind(), &nodes, element.region));
                }
            }
        }
        let of = |all: &[(usize, usize)], facets: &[Facet<D>]| -> Vec<Facet<D>> {
            let turned = all.iter().map(|&(sector, k)| {
                let mut facet = facets[k];
                let nodes = facet.as_mut().iter_mut();
                nodes.for_each(|node| *node = around.numbers[&(sector as u32)][*node as usize]);
                facet
            });
            turned.collect()
        };
        let both = [of(&around.of_facets, facets), of(&around.of_others, others)];
        [around.facets, around.others] = both;
        around
    }

    /// The options for its mesh, without what they borrow from it: unit vectors of nodes, and walls.
    pub fn vectors(
        &self,
        of_nodes: Option<&HashMap<u32, Vec<[f64; D]>>>,
    ) -> Option<HashMap<u32, Vec<[f64; D]>>> {
        let of_nodes = of_nodes?;
        let mut all = HashMap::new();
        for (&sector, numbers) in &self.numbers {
            for (&node, ways) in of_nodes {
                let turned = ways
                    .iter()
                    .map(|way| self.sectors.turned(*way, sector as usize));
                all.entry(numbers[node as usize])
                    .or_insert_with(|| turned.collect());
            }
        }
        Some(all)
    }

    /// What each of its facets is round about.
    pub fn centres(&self, sides: [&[Option<Centre<D>>]; 2]) -> [Vec<Option<Centre<D>>>; 2] {
        let turned = |centre: &Centre<D>, sector: usize| Centre {
            point: self.sectors.carried(centre.point, sector),
            across: (centre.across.iter())
                .map(|way| self.sectors.turned(*way, sector))
                .collect(),
            radius: centre.radius,
        };
        let of = |all: &[(usize, usize)], centres: &[Option<Centre<D>>]| {
            let each = all.iter().map(|&(sector, k)| {
                let centre = centres.get(k)?.as_ref()?;
                Some(turned(centre, sector))
            });
            each.collect()
        };
        [of(&self.of_facets, sides[0]), of(&self.of_others, sides[1])]
    }

    /// Where boundaries go on beyond sides of sectors that have no nodes in common: at nodes of the sector beside, if that is there.
    pub fn seams(&self, options: &PairOptions<D>) -> Option<Seams<D>> {
        let (seams, sectors) = (options.seams?, self.sectors);
        let mut all = Seams::new();
        for (&sector, numbers) in &self.numbers {
            let apart = seams.iter().filter(|seam| sectors.twin(*seam.0).is_none());
            for (&node, beyond) in apart {
                let beyond = beyond.iter().map(|&(other, weight, turn)| {
                    let beside = (sectors.steps(&turn).filter(|_| other != node))
                        .and_then(|k| self.numbers.get(&((sector + k) % sectors.count)));
                    match beside {
                        Some(beside) => (beside[other as usize], weight, sectors.turns[0].0),
                        None => (numbers[other as usize], weight, turn),
                    }
                });
                all.insert(numbers[node as usize], beyond.collect());
            }
        }
        Some(all)
    }

    /// What is behind each facet.
    pub fn walls(&self, walls: &[Wall<D>], own: usize) -> Vec<Wall<D>> {
        if walls.is_empty() {
            return Vec::new();
        }
        let turned = |k: usize, sector: usize| {
            walls[k].turned(
                |x| self.sectors.carried(x, sector),
                |v| self.sectors.turned(v, sector),
            )
        };
        let facets = self.of_facets.iter().map(|&(sector, k)| turned(k, sector));
        let others = (self.of_others.iter()).map(|&(sector, k)| turned(own + k, sector));
        facets.chain(others).collect()
    }

    /// The sector of each of the facets.
    pub fn sectors_of_facets(&self) -> Vec<usize> {
        self.of_facets.iter().map(|of| of.0).collect()
    }

    /// Nodes of the first sector that begin in it.
    pub fn beginning_nodes(&self, nodes: &[u32]) -> Vec<u32> {
        let begins = |node: &&u32| self.sectors.begins(&[(**node, 1.0)]);
        nodes.iter().filter(begins).copied().collect()
    }

    /// The places that begin in the first sector, with images for nodes of the others.
    pub fn beginning(
        &self,
        sectors: &Arc<Sectors<D>>,
        places: Vec<ContactPlace<D>>,
    ) -> Vec<ContactPlace<D>> {
        let renumber = |side: &mut Vec<(u32, f64)>| {
            let entries = side.iter_mut();
            entries.for_each(|entry| entry.0 = self.images[entry.0 as usize]);
            side.sort_unstable_by_key(|entry| entry.0);
        };
        let mut pools: HashMap<u32, u32> = HashMap::new();
        let mut kept = Vec::new();
        for mut place in places {
            renumber(&mut place.own);
            if !sectors.begins(&place.own) {
                continue;
            }
            renumber(&mut place.partners);
            place.directed.iter_mut().flatten().for_each(renumber);
            place.node = (place.node.map(|node| self.images[node as usize]))
                .filter(|node| *node < sectors.nodes);
            let pool = pools.len() as u32;
            place.pool = *pools.entry(place.pool).or_insert(pool);
            place.sectors = Some(sectors.clone());
            kept.push(place);
        }
        kept
    }
}

/// Finds the places of a contact among all sectors that matter.
pub(super) fn around<const D: usize, T>(
    sectors: &Sectors<D>,
    body: &Body<D>,
    sides: [&[Facet<D>]; 2],
    options: &PairOptions<D>,
    find: impl FnOnce(&Around<D>, &Body<D>, &PairOptions<D>) -> Result<T, ContactError>,
) -> Result<T, ContactError>
where
    ElementKind: Topology<D>,
{
    let distance = options.distance_between(body, sides[0], sides[1]);
    let around = Around::new(
        sectors,
        body,
        sides,
        distance,
        (options.seams, options.rest),
    );
    let [symmetry, held] = [options.symmetry, options.held].map(|of| around.vectors(of));
    let (seams, of_facets) = (around.seams(options), around.sectors_of_facets());
    let walls = around.walls(options.walls, sides[0].len());
    let centres = around.centres(options.centres);
    let body = Body {
        mesh: &around.mesh,
        ..*body
    };
    let options = PairOptions {
        symmetry: symmetry.as_ref(),
        held: held.as_ref(),
        seams: seams.as_ref(),
        search_distance: Some(distance),
        rest: around.rest.as_ref(),
        walls: &walls,
        centres: centres.each_ref().map(Vec::as_slice),
        sectors: None,
        around: Some((sectors, &of_facets)),
        ..*options
    };
    find(&around, &body, &options)
}
