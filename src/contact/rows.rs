//! From contact nodes to the rows of N and T over the unknowns.
//!
//! A row measures the relative motion of a node and the other side. The part of it that supports prescribe belongs to the
//! gap and the slide of a step; the rest is the row. Rows may depend on each other: contact forces are unique then,
//! multipliers need not be.

use super::{ContactError, ContactPlace, SlipBound, turn_tangents};
use crate::elasticity::{Body, Unknowns};
use crate::mesh::vector::{dot, length, minus};
use crate::mesh::{ElementKind, Location, Mesh, Topology};
use crate::problem::is_infinite;
use crate::sparse::Csr;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// An entry of a row over the unknowns: column and value.
type Entry = (usize, f64);
/// The contribution of a prescribed displacement to a row: node, component, factor.
type Held = (u32, usize, f64);

/// The cosine of the angle between directions in which supports hold nodes above which they count as one.
const SAME_WAY: f64 = 1.0 - 1e-9;

/// Sums of prescribed displacements below this part of the largest of them are the rounding of their directions, which
/// files state with ten digits.
const ROUNDED: f64 = 1e-9;

/// If supports leave less than this part of a sliding free, it counts as none.
const KEPT: f64 = 0.25;

/// N, T, d, g over the unknowns, with the contact nodes that their rows belong to.
#[derive(Clone, Debug)]
pub struct ContactRows<const D: usize = 2> {
    /// The place of each row of N.
    pub places: Vec<ContactPlace<D>>,
    /// The candidate of each row.
    pub candidate: Vec<usize>,
    /// N: a row per contact place, along ν.
    pub normal: Csr,
    /// T: D − 1 rows per contact place, one after the other, along the tangents of its frame.
    pub tangential: Csr,
    /// Given slip bounds of the places; 0 under Coulomb's law and where one has no friction, infinite where it is tied.
    pub slip_bound: Vec<f64>,
    /// μ of the places; 0 under the other laws and where one has no friction.
    pub coefficient: Vec<f64>,
    /// The diagonal of C, a row of N or T each; empty where all contact is hard.
    pub compliance: Vec<f64>,
    /// The contributions of prescribed displacements to N u and to T u, row by row.
    held: [Vec<Vec<Held>>; 2],
    /// Candidates whose normal motion is entirely prescribed: their number, place, gap, and that motion.
    fixed: Vec<(usize, Location, f64, Vec<Held>)>,
    /// Rows of tied places with an entirely prescribed relative motion of both sides: the row of N or T, the place, and that motion.
    fixed_ties: Vec<([usize; 2], Location, Vec<Held>)>,
    /// In space: nodes with friction along one tangent only, the row of T of the other one, the motion that supports prescribe along
    /// that, and its tolerance.
    along_one: Vec<(Location, usize, Vec<Held>, f64)>,
}

/// Writes the rows of contact places.
///
/// A node may be in several contacts, and supports may hold it, or the other side, in any direction: prescribed motions
/// count in [`ContactRows::gap`] and [`ContactRows::held_motion`]. A place whose normal motion is entirely prescribed
/// has no row and is only checked ([`ContactRows::check`]), unless the contact is compliant. On a rigid obstacle a node
/// gets an empty row in T where supports keep it from sliding along the tangent. It has no friction where no tangent is
/// left. In space the tangents of a place that a support holds in one direction are turned so that one is free of it.
///
/// # Errors
/// If the normals of the hard rigid obstacles that a node meets are not independent.
pub fn contact_rows<const D: usize>(
    body: &Body<D>,
    unknowns: &Unknowns<D>,
    candidates: &[ContactPlace<D>],
) -> Result<ContactRows<D>, ContactError>
where
    ElementKind: Topology<D>,
{
    rows_of(body, unknowns, candidates, |_| true)
}

/// The same where some candidates do not act: they take no friction from others.
pub(crate) fn rows_of<const D: usize>(
    body: &Body<D>,
    unknowns: &Unknowns<D>,
    candidates: &[ContactPlace<D>],
    acts: impl Fn(usize) -> bool,
) -> Result<ContactRows<D>, ContactError>
where
    ElementKind: Topology<D>,
{
    // Nor do those with an infinite gap.
    let acts = |number: usize| acts(number) && !is_infinite(candidates[number].gap);
    let (mut places, mut numbers, mut fixed) = (Vec::new(), Vec::new(), Vec::new());
    let mut fixed_ties = Vec::new();
    let mut rows: [Vec<Vec<Entry>>; 2] = Default::default();
    let mut held: [Vec<Vec<Held>>; 2] = Default::default();
    // The motions that supports prescribe along the tangents of nodes that cannot slide there.
    let mut kept = Vec::new();
    for (number, candidate) in candidates.iter().enumerate() {
        let (entries, motion) = row(unknowns, candidate.terms(0));
        // On an obstacle a place moves with its node, unless the obstacle moves; its other nodes, if any, only weight the prescribed
        // part.
        let left = unknowns.free_part(candidate.own[0].0, candidate.frame[0]);
        let is_alone = candidate.partners.is_empty() && candidate.further.is_empty();
        let is_held = is_alone && length(left) <= 1e-8;
        let is_tied = candidate.slip_bound == SlipBound::Tied;
        if (entries.is_empty() || is_held) && candidate.compliance[0] == 0.0 && !is_tied {
            if acts(number) {
                fixed.push((number, candidate.place.into(), candidate.gap, motion));
            }
            continue;
        }
        let row_number = rows[0].len();
        let mut tie = |along: usize, entries: &[Entry], motion: &[Held]| {
            let gives_way = candidate.compliance[0] > 0.0;
            if is_tied && entries.is_empty() && !gives_way {
                let place = candidate.place.into();
                fixed_ties.push(([row_number, along], place, motion.to_vec()));
            }
        };
        tie(0, &entries, &motion);
        rows[0].push(entries);
        held[0].push(motion);
        let place = turned(candidate, unknowns);
        for (a, &tangent) in place.frame.iter().enumerate().skip(1) {
            let (entries, motion) = row(unknowns, place.terms(a));
            tie(a, &entries, &motion);
            // A tie also follows the deformation of neighbours.
            let is_kept =
                !is_tied && !entries.is_empty() && kept_along(body.mesh, unknowns, &place, tangent);
            let (entries, motion, instead) = match is_kept {
                true => (Vec::new(), Vec::new(), Some(motion)),
                false => (entries, motion, None),
            };
            rows[1].push(entries);
            held[1].push(motion);
            kept.push(instead);
        }
        places.push(place);
        numbers.push(number);
    }
    let acting: Vec<bool> = numbers.iter().map(|&number| acts(number)).collect();
    check_normals(&rows[0], &places, &acting, unknowns)?;
    let [normals, tangentials] = &mut rows;
    let of_places = normals.iter().zip(tangentials.chunks_mut(D - 1));
    for ((normal, tangential), place) in of_places.zip(&places) {
        if is_on_obstacle(place) && place.compliance[1] == 0.0 {
            leave_sliding::<D>(normal, tangential);
        }
    }
    let tangents = places
        .iter()
        .flat_map(|place| vec![place.compliance[1]; D - 1]);
    let mut compliance: Vec<f64> = places.iter().map(|place| place.compliance[0]).collect();
    compliance.extend(tangents);
    if compliance.iter().all(|&c| c == 0.0) {
        compliance.clear();
    }

    let (mut slip_bound, mut coefficient, mut along_one) = (Vec::new(), Vec::new(), Vec::new());
    for (i, (rows, place)) in rows[1].chunks(D - 1).zip(&places).enumerate() {
        let empty: Vec<usize> = (0..D - 1).filter(|&a| rows[a].is_empty()).collect();
        if let (3, [a]) = (D, &empty[..])
            && place.slip_bound.is_any()
            && place.slip_bound != SlipBound::Tied
        {
            let row = (D - 1) * i + a;
            let (motion, rest) = match &kept[row] {
                Some(motion) => (motion, KEPT),
                None => (&held[1][row], 0.0),
            };
            along_one.push((place.place.into(), row, motion.clone(), rest));
        }
        let (given, mu) = match place.slip_bound {
            SlipBound::Tied => SlipBound::Tied,
            _ if rows.iter().all(Vec::is_empty) => SlipBound::Given(0.0),
            law => law,
        }
        .entries();
        slip_bound.push(given);
        coefficient.push(mu);
    }
    let [normal, tangential] = rows.map(|rows| {
        let (n_rows, n) = (rows.len(), D * unknowns.n_blocks());
        let entries = rows.into_iter().enumerate();
        let entries = entries.flat_map(|(i, row)| row.into_iter().map(move |(j, v)| (i, j, v)));
        Csr::from_triplets(n_rows, n, entries.collect::<Vec<_>>())
    });
    Ok(ContactRows {
        normal,
        tangential,
        places,
        candidate: numbers,
        slip_bound,
        coefficient,
        compliance,
        held,
        fixed,
        fixed_ties,
        along_one,
    })
}

/// Whether a place is one of a node on a rigid obstacle. An obstacle that moves with a point has its own unknowns.
fn is_on_obstacle<const D: usize>(place: &ContactPlace<D>) -> bool {
    let is_alone = place.partners.is_empty() && place.further.is_empty();
    is_alone && place.slip_bound != SlipBound::Tied
}

/// Checks that hard normal rows on rigid obstacles are independent. A compliant row may depend on any: A + C is still definite.
/// Places that never act press nothing.
fn check_normals<const D: usize>(
    rows: &[Vec<Entry>],
    places: &[ContactPlace<D>],
    acting: &[bool],
    unknowns: &Unknowns<D>,
) -> Result<(), ContactError> {
    let mut times: HashMap<u32, usize> = HashMap::new();
    for place in places.iter().filter(|place| is_on_obstacle(place)) {
        *times.entry(place.own[0].0).or_default() += 1;
    }
    let mut independent = Independent::<D>::default();
    // Its own unknowns belong to no other row.
    let own = |place: &ContactPlace<D>| {
        let node = place.own[0].0;
        unknowns.block(node).filter(|_| times[&node] == 1)
    };
    for ((row, place), acts) in rows.iter().zip(places).zip(acting) {
        let is_hard = is_on_obstacle(place) && place.compliance[0] == 0.0;
        if is_hard && *acts && !independent.add(row, own(place)) {
            let place = place.place.into();
            return Err(ContactError::Twice { place });
        }
    }
    Ok(())
}

/// Empties the rows of T of a place on a rigid obstacle along which it cannot slide without lifting off.
fn leave_sliding<const D: usize>(normal: &[Entry], tangential: &mut [Vec<Entry>]) {
    let mut independent = Independent::<D>::default();
    independent.add(normal, None);
    for row in tangential {
        if !independent.add(row, None) {
            row.clear();
        }
    }
}

/// In space: whether supports keep both a place and the other side from sliding along a tangent. Then the row contains
/// only the deformation of partners nearby, as on a plane of symmetry that cuts both bodies. The mean position of
/// partners is on the plane, so that their mean motion across it vanishes, and friction would act on next to nothing.
fn kept_along<const D: usize>(
    mesh: &Mesh<D>,
    unknowns: &Unknowns<D>,
    place: &ContactPlace<D>,
    tangent: [f64; D],
) -> bool
where
    ElementKind: Topology<D>,
{
    let mut kept = tangent;
    // Where the row of a held node contains neighbours, only the node itself counts.
    let at_node = place.node.filter(|_| !place.directed.is_empty());
    let node = at_node.map(|node| [(node, 1.0)]);
    let free_part = |image: u32, way: [f64; D]| {
        let free = unknowns.free_part(place.node_of(image), place.back(image, way));
        place.turned_to(image, free)
    };
    for &(node, weight) in node.as_ref().map_or(&place.own[..], |node| node) {
        let free = free_part(node, tangent);
        (0..D).for_each(|c| kept[c] -= weight * free[c]);
    }
    let size = dot(kept, kept);
    if D == 2 || place.partners.is_empty() || !(size > 0.1) {
        return false;
    }
    let (mut slides, mut ends, mut held) = (0.0_f64, [0.0_f64; 2], Vec::new());
    for &(partner, weight) in &place.partners {
        let free = free_part(partner, kept);
        let part = dot(free, free);
        slides += weight * part;
        let to = minus(place.place_of(partner, &mesh.nodes), place.place);
        let across = dot(to, kept);
        ends = [ends[0].min(across), ends[1].max(across)];
        held.push((across, part <= 1e-9 * size));
    }
    // A body that ends there is held over its whole end, however coarse it is.
    let on_it = 1e-9 * (ends[1] - ends[0]);
    let mut at_end = held.iter().filter(|(across, _)| across.abs() <= on_it);
    let one_sided = ends[0] >= -on_it || ends[1] <= on_it;
    let is_end = one_sided && at_end.clone().count() > 0 && at_end.all(|&(_, held)| held);
    is_end || slides.abs() < KEPT * size
}

/// The place with its tangents turned, in space. One is then perpendicular to the only direction in which supports hold
/// all of its nodes: it is the direction left to slide along.
pub(crate) fn turned<const D: usize>(
    place: &ContactPlace<D>,
    unknowns: &Unknowns<D>,
) -> ContactPlace<D> {
    let mut place = place.clone();
    // Its further nodes have vectors for the directions as they are.
    if !place.further.is_empty() {
        return place;
    }
    // The directions in which a node is held.
    let held = |image: u32| -> Vec<[f64; D]> {
        let axis = |c: usize| std::array::from_fn(|i| f64::from(u8::from(i == c)));
        let node = place.node_of(image);
        let all = unknowns.prescribed(node);
        let held = (0..D).filter(|&c| all[c].is_some());
        held.map(|c| {
            let way = (unknowns.frame(node)).map_or_else(|| axis(c), |frame| frame[c]);
            place.turned_to(image, way)
        })
        .collect()
    };
    let first = held(place.own[0].0);
    let everywhere = |way: &[f64; D]| {
        let alike = |other: &[f64; D]| dot(*other, *way).abs() > SAME_WAY;
        let mut others = place.own[1..].iter();
        others.all(|&(node, _)| held(node).iter().any(alike))
    };
    let held = match &first[..] {
        [way] if everywhere(way) => Some(*way),
        _ => None,
    };
    if let Some(way) = held {
        let onto = way.map(|c| way.map(|d| c * d));
        turn_tangents(&mut place.frame, &onto);
    }
    place
}

/// The unknown part and the prescribed part of a row, from its nodes with their vectors.
fn row<const D: usize>(
    unknowns: &Unknowns<D>,
    terms: impl Iterator<Item = (u32, [f64; D])>,
) -> (Vec<Entry>, Vec<Held>) {
    let (mut entries, mut held) = (Vec::new(), Vec::new());
    for (node, v) in terms {
        if let Some(frame) = unknowns.frame(node) {
            // The prescribed part along a node's own directions is removed; the unknowns are along the axes.
            for (c, value) in unknowns.prescribed(node).iter().enumerate() {
                let part = dot(frame[c], v);
                if value.is_some() && part.abs() >= 1e-14 {
                    held.push((node, c, part));
                }
            }
            if let Some(block) = unknowns.block(node) {
                let left = unknowns.free_part(node, v);
                let some = (0..D).filter(|&c| left[c].abs() >= 1e-14);
                entries.extend(some.map(|c| (D * block as usize + c, left[c])));
            }
            continue;
        }
        for c in 0..D {
            // The cosine of a right angle is only rounding.
            if v[c].abs() < 1e-14 {
                continue;
            }
            match (unknowns.prescribed(node)[c], unknowns.block(node)) {
                (None, Some(block)) => entries.push((D * block as usize + c, v[c])),
                _ => held.push((node, c, v[c])),
            }
        }
    }
    // A motion with almost no part in an unknown is a prescribed one.
    if !entries.iter().any(|entry| entry.1.abs() > 1e-8) {
        entries.clear();
    }
    (entries, held)
}

/// Rows with full row rank, by elimination.
#[derive(Default)]
struct Independent<const D: usize> {
    /// Rows without the pivots of those before them; column and value of the pivot first.
    rows: Vec<(Entry, Vec<Entry>)>,
    /// The row whose pivot is in a column.
    of_column: HashMap<usize, usize>,
}

impl<const D: usize> Independent<D> {
    /// A remainder of a row below this part of its largest entry counts as zero. If the normals of two contacts of a
    /// node differ by less, they would press it like a wedge.
    const NOTHING: f64 = 1e-4;
    /// A pivot in the node's own unknowns is taken if it is this part of the largest entry: it causes no fill.
    const OWN: f64 = 0.1;

    /// Adds a row if it does not depend on those before; `own` is the block of its node, if no other node's row has
    /// it first.
    fn add(&mut self, row: &[Entry], own: Option<u32>) -> bool {
        let size = |entries: &BTreeMap<usize, f64>| {
            entries.values().fold(0.0_f64, |max, v| max.max(v.abs()))
        };
        let mut left: BTreeMap<usize, f64> = BTreeMap::new();
        for &(column, value) in row {
            *left.entry(column).or_default() += value;
        }
        let before = size(&left);
        let mut pivots: BTreeSet<usize> = (left.keys())
            .filter_map(|column| self.of_column.get(column).copied())
            .collect();
        while let Some(next) = pivots.pop_first() {
            let ((column, pivot), others) = &self.rows[next];
            let Some(value) = left.remove(column) else {
                continue;
            };
            for &(column, entry) in others {
                *left.entry(column).or_default() -= value / pivot * entry;
                // Rows have no pivots of earlier ones: only later ones are added.
                pivots.extend(self.of_column.get(&column));
            }
        }
        let after = size(&left);
        if !(after > Self::NOTHING * before) {
            return false;
        }
        let is_own = |column: usize| own.is_some_and(|block| column / D == block as usize);
        let largest = |own: bool| {
            (left.iter())
                .filter(|&(&column, value)| {
                    (!own || is_own(column))
                        && value.abs() >= if own { Self::OWN * after } else { 0.0 }
                })
                .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
                .map(|(&column, &value)| (column, value))
        };
        let pivot = (largest(true).or_else(|| largest(false))).expect("something is left");
        self.of_column.insert(pivot.0, self.rows.len());
        left.remove(&pivot.0);
        self.rows.push((pivot, left.into_iter().collect()));
        true
    }
}

impl<const D: usize> ContactRows<D> {
    /// The known rows of known places: prescribed motions are passed separately.
    #[cfg(feature = "mpi")]
    pub(crate) fn of_places(
        places: Vec<ContactPlace<D>>,
        rows: [Csr; 2],
        slip_bound: Vec<f64>,
        coefficient: Vec<f64>,
        compliance: Vec<f64>,
    ) -> Self {
        let [normal, tangential] = rows;
        Self {
            candidate: (0..places.len()).collect(),
            places,
            normal,
            tangential,
            slip_bound,
            coefficient,
            compliance,
            held: Default::default(),
            fixed: Vec::new(),
            fixed_ties: Vec::new(),
            along_one: Vec::new(),
        }
    }

    /// The contribution of the prescribed displacements of `unknowns` to N u (m values) and to T u ((D − 1) m).
    pub fn held_motion(&self, unknowns: &Unknowns<D>) -> (Vec<f64>, Vec<f64>) {
        let [normal, tangential] = [0, 1].map(|of: usize| {
            let rows = self.held[of].iter();
            rows.map(|held| motion(held, unknowns)).collect()
        });
        (normal, tangential)
    }

    /// d: the initial gaps, minus the part that the prescribed displacements of `unknowns` close. Negative where a
    /// prescribed motion pushes the bodies into each other.
    pub fn gap(&self, unknowns: &Unknowns<D>) -> Vec<f64> {
        let (moved, _) = self.held_motion(unknowns);
        (self.places.iter())
            .zip(moved)
            .map(|(place, moved)| place.gap - moved)
            .collect()
    }

    /// Checks the nodes without a row, whose normal motion supports prescribe, and those that can slide along one
    /// direction only.
    ///
    /// # Errors
    /// [`ContactError::Driven`] if the prescribed displacements of `unknowns` push one of them into the other side,
    /// [`ContactError::DrivenAlong`] if they drive one across the direction in which it can slide,
    /// [`ContactError::DrivenApart`] if they move the sides of a tie against each other.
    pub fn check(&self, unknowns: &Unknowns<D>) -> Result<(), ContactError> {
        self.check_stated(unknowns, |_| true, |_| Some(0.0))
    }

    /// The same of candidates that act, where the motion of a row of N is the one stated for it, or is free.
    pub(crate) fn check_stated(
        &self,
        unknowns: &Unknowns<D>,
        acts: impl Fn(usize) -> bool,
        stated: impl Fn(usize) -> Option<f64>,
    ) -> Result<(), ContactError> {
        self.check_fixed(unknowns, acts, |gap, size| ROUNDED * gap.max(size))?;
        for ([row, along], place, held) in &self.fixed_ties {
            let wanted = match along {
                0 => stated(*row),
                _ => Some(0.0),
            };
            let Some(wanted) = wanted else { continue };
            let apart = (motion(held, unknowns) - wanted).abs();
            if apart > ROUNDED * size_of(held, unknowns).max(wanted.abs()) {
                let place = place.clone();
                return Err(ContactError::DrivenApart { place, apart });
            }
        }
        self.check_along_one(|_, held, rest| {
            motion(held, unknowns).abs() > rest.max(ROUNDED) * size_of(held, unknowns)
        })
    }

    /// The same after the prescribed motions `moves`, where those `left` are hardly more than rounding: distances below `least` count as
    /// zero. `slides` says which rows of T slide under pressure.
    pub(crate) fn check_moved(
        &self,
        [moves, left]: [&Unknowns<D>; 2],
        slides: impl Fn(usize) -> bool,
        least: f64,
    ) -> Result<(), ContactError> {
        self.check_fixed(left, |_| true, |_, _| least)?;
        self.check_along_one(|row, held, rest| {
            rest == 0.0 && motion(held, moves).abs() > least && slides(row)
        })
    }

    /// Those without a row, where penetration beyond a tolerance counts: of the gap and the size of the prescribed motions.
    fn check_fixed(
        &self,
        unknowns: &Unknowns<D>,
        acts: impl Fn(usize) -> bool,
        tolerance: impl Fn(f64, f64) -> f64,
    ) -> Result<(), ContactError> {
        for (_, place, gap, held) in self.fixed.iter().filter(|fixed| acts(fixed.0)) {
            let moved = motion(held, unknowns);
            let depth = moved - gap;
            if depth > tolerance(*gap, size_of(held, unknowns)) {
                let place = place.clone();
                return Err(ContactError::Driven { place, depth });
            }
        }
        Ok(())
    }

    /// Those that can slide along one direction only, where `is_driven` says of the other row of T, its motion and its tolerance whether
    /// supports drive the node along it.
    fn check_along_one(
        &self,
        is_driven: impl Fn(usize, &[Held], f64) -> bool,
    ) -> Result<(), ContactError> {
        let mut all = self.along_one.iter();
        match all.find(|(_, row, held, rest)| is_driven(*row, held, *rest)) {
            Some((place, ..)) => Err(ContactError::DrivenAlong {
                place: place.clone(),
            }),
            None => Ok(()),
        }
    }

    /// The places of the rows, each with its number and that of its candidate.
    pub(crate) fn numbered(&self) -> impl Iterator<Item = (usize, usize, &ContactPlace<D>)> {
        let each = self.candidate.iter().zip(&self.places).enumerate();
        each.map(|(row, (&candidate, place))| (row, candidate, place))
    }

    /// The tied places.
    pub fn tied(&self) -> Vec<bool> {
        let places = self.places.iter();
        places
            .map(|place| place.slip_bound == SlipBound::Tied)
            .collect()
    }

    /// The area for the displayed pressure of each place, and for its checks: that of its pool.
    pub fn pooled_areas(&self) -> Vec<f64> {
        let areas: Vec<f64> = self.places.iter().map(|place| place.area).collect();
        pooled(&self.places, &areas)
    }

    /// Whether a law of friction is stated for a contact place that supports keep from sliding.
    pub fn keeps_from_sliding(&self, row: usize) -> bool {
        self.places[row].slip_bound.is_any()
            && self.slip_bound[row] == 0.0
            && self.coefficient[row] == 0.0
    }
}

/// The largest prescribed displacement in a row: that of its rounding.
fn size_of<const D: usize>(held: &[Held], unknowns: &Unknowns<D>) -> f64 {
    let prescribed = |&(node, c, _): &Held| unknowns.prescribed(node)[c].unwrap_or(0.0).abs();
    held.iter().map(prescribed).fold(0.0, f64::max)
}

/// The contribution of prescribed displacements to a row.
fn motion<const D: usize>(held: &[Held], unknowns: &Unknowns<D>) -> f64 {
    let prescribed = |node, c: usize| unknowns.prescribed(node)[c].unwrap_or(0.0);
    (held.iter())
        .map(|&(node, c, factor)| factor * prescribed(node, c))
        .sum()
}

/// The forces of each place and of those in its pressure pool, along its own directions, one or D − 1 for each place.
/// Areas add up in the same way.
pub(crate) fn pooled<const D: usize>(places: &[ContactPlace<D>], forces: &[f64]) -> Vec<f64> {
    let mut pools: HashMap<u32, Vec<usize>> = HashMap::new();
    for (i, place) in places.iter().enumerate() {
        pools.entry(place.pool).or_default().push(i);
    }
    let each = forces.len() / places.len().max(1);
    let directions = |i: usize| match each == D - 1 && D > 2 {
        true => &places[i].frame[1..],
        // Normal forces, bounds, and tangents in the plane follow the boundary: along these they are numbers.
        false => &[],
    };
    let mut sums = forces.to_vec();
    for pool in pools.values().filter(|pool| pool.len() > 1) {
        for &i in pool {
            for a in 0..each {
                sums[each * i + a] = (pool.iter())
                    .map(|&j| match directions(i).get(a) {
                        None => forces[each * j + a],
                        Some(&along) => (directions(j).iter().zip(&forces[each * j..]))
                            .map(|(&tangent, force)| force * dot(tangent, along))
                            .sum(),
                    })
                    .sum();
            }
        }
    }
    sums
}
