//! The conditions on the data of a problem.

use super::ContactData;
use crate::sparse::{BlockCsr, Csr};
use rayon::prelude::*;
use std::collections::HashMap;
use std::fmt;

/// A condition of [`ContactProblem`](super::ContactProblem) that the data violates. Rows and columns count from 1, and from 0
/// after [`ProblemError::from_zero`].
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message of each variant names its fields")]
pub enum ProblemError {
    /// K is not square.
    #[error("the stiffness matrix K is {rows} × {cols}: it must be square")]
    NotSquare { rows: usize, cols: usize },
    /// There is nothing to solve.
    #[error("the problem has no unknowns")]
    Empty,
    /// A vector has the wrong length.
    #[error("{name} has length {found}, expected {expected} ({reason})")]
    Length {
        name: &'static str,
        found: usize,
        expected: usize,
        reason: &'static str,
    },
    /// N or T has the wrong shape.
    #[error(
        "{name} is {rows} × {cols}, expected {expected} × {n} ({per} per entry of d, one column per unknown)"
    )]
    Shape {
        name: &'static str,
        rows: usize,
        cols: usize,
        expected: usize,
        n: usize,
        per: &'static str,
    },
    /// A matrix is too large for 32-bit indices.
    #[error("{name} is {rows} × {cols}, and no more than 2³² − 1 rows or columns can be counted")]
    TooLarge {
        name: &'static str,
        rows: usize,
        cols: usize,
    },
    /// The parts of a compressed matrix have lengths that do not fit.
    #[error("{name} has {found} {part}, expected {expected} ({reason})")]
    Parts {
        name: &'static str,
        part: &'static str,
        found: usize,
        expected: usize,
        reason: &'static str,
    },
    /// The pointers of a compressed matrix do not grow from 0 to the number of its entries.
    #[error(
        "{line} {number} of {name} covers the entries from {start} to {end} of {count}: pointers must not decrease, \
         and must run from 0 to the number of entries"
    )]
    Pointers {
        name: &'static str,
        line: &'static str,
        number: usize,
        start: i64,
        end: i64,
        count: usize,
    },
    /// An index of a compressed matrix is out of range.
    #[error(
        "{line} {number} of {name} has an entry with the {across} index {index}, and there are {limit} {across}s: \
         indices count from 0"
    )]
    Index {
        name: &'static str,
        line: &'static str,
        number: usize,
        across: &'static str,
        index: i64,
        limit: usize,
    },
    /// An entry is infinite or not a number.
    #[error("{name}: entry {place} is {value}, not a finite number")]
    NotFinite {
        name: &'static str,
        place: Place,
        value: f64,
    },
    /// K is not symmetric.
    #[error(
        "the stiffness matrix K is not symmetric: K({row}, {col}) = {value:e} but K({col}, {row}) = {mirror:e}. {}",
        if *held {
            "A row that holds an unknown has entries in its column: leave held unknowns out of K and f (scikit-fem's condense in place \
             of enforce), or clear the columns, too"
        } else {
            "Find the cause: (K + Kᵀ)/2 is the same problem only where the difference is far below the least eigenvalue of K"
        }
    )]
    NotSymmetric {
        row: usize,
        col: usize,
        value: f64,
        mirror: f64,
        held: bool,
    },
    /// K or f is so small or so large that derived numbers overflow or vanish.
    #[error("{name}: entry {place} is {value:e}: {SIZES}")]
    Size {
        name: &'static str,
        place: Place,
        value: f64,
    },
    /// A diagonal entry of K is not positive.
    #[error(
        "the stiffness matrix K is not positive definite: its diagonal entry {row} is {value:e}, must be > 0"
    )]
    Diagonal { row: usize, value: f64 },
    /// A diagonal entry of W is negative.
    #[error("W is not positive semidefinite: its diagonal entry {row} is {value:e}, must be ≥ 0")]
    NegativeDelassus { row: usize, value: f64 },
    /// Bodies overlap before they are loaded.
    #[error(
        "the gap d has the negative entry d({row}) = {value:e}: the bodies overlap before loading; move them apart, or set \
         interference to true if the overlap is to be pressed apart"
    )]
    NegativeGap { row: usize, value: f64 },
    /// A contact node has two laws of friction.
    #[error(
        "contact node {row} has the slip bound g = {bound:e} (Tresca) and the coefficient of friction μ = {mu:e} (Coulomb), and \
         only one law can hold there: leave one of them out, or make one of them 0 there"
    )]
    TwoLaws { row: usize, bound: f64, mu: f64 },
    /// A slip bound is negative.
    #[error("the slip bound g has the negative entry g({row}) = {value:e}")]
    NegativeSlipBound { row: usize, value: f64 },
    /// A coefficient of friction is negative.
    #[error("the coefficient of friction μ has the negative entry μ({row}) = {value:e}")]
    NegativeFriction { row: usize, value: f64 },
    /// A compliance is negative.
    #[error("the compliance has the negative entry {row}: {value:e}")]
    NegativeCompliance { row: usize, value: f64 },
    /// The compliance of a node depends on the direction of slip.
    #[error(
        "the compliance of contact node {node} along its first tangent is {first:e} and along the second {second:e}: both need \
         the same"
    )]
    UnequalCompliance {
        node: usize,
        first: f64,
        second: f64,
    },
    /// A contact node has no area.
    #[error("the area of contact node {row} is {value:e}, must be > 0")]
    Area { row: usize, value: f64 },
    /// Nothing can open a gap.
    #[error(
        "row {row} of N has no nonzero entry, so that no motion opens its gap of {gap:e}: that gap must be at least 0"
    )]
    ZeroRow { row: usize, gap: f64 },
    /// A tie has nothing to hold to.
    #[error(
        "entry {row} of the gap d is infinite, which means that contact node {row} has no obstacle, but the node is tied: give it a finite gap (0 where the sides meet), or do not tie it"
    )]
    TiedToNothing { row: usize },
    /// Two multipliers have the same effect.
    #[error(
        "rows {first} and {second} of (N; T) are parallel, so it has no full row rank: {name}. Leave one out, or set \
         dependent_rows to true: then forces on the bodies are unique, multipliers need not be"
    )]
    ParallelRows {
        first: usize,
        second: usize,
        name: &'static str,
    },
    /// There are more multipliers than unknowns.
    #[error(
        "(N; T) has {rows} rows for {n} unknowns, so it has no full row rank: leave rows out, or set dependent_rows to true"
    )]
    TooManyRows { rows: usize, n: usize },
}

/// An entry of a vector or of a matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs, reason = "they say what they are")]
pub enum Place {
    Of(usize),
    OfLargest(usize),
    At(usize, usize),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Of(i) => write!(f, "{i}"),
            Self::OfLargest(i) => write!(f, "{i} (the largest one)"),
            Self::At(i, j) => write!(f, "({i}, {j})"),
        }
    }
}

impl ProblemError {
    /// The same with rows and columns counted from 0.
    pub fn from_zero(mut self) -> Self {
        match &mut self {
            Self::Pointers { number: row, .. }
            | Self::Index { number: row, .. }
            | Self::Diagonal { row, .. }
            | Self::NegativeDelassus { row, .. }
            | Self::NegativeGap { row, .. }
            | Self::TwoLaws { row, .. }
            | Self::NegativeSlipBound { row, .. }
            | Self::NegativeFriction { row, .. }
            | Self::NegativeCompliance { row, .. }
            | Self::UnequalCompliance { node: row, .. }
            | Self::Area { row, .. }
            | Self::TiedToNothing { row }
            | Self::ZeroRow { row, .. } => *row -= 1,
            Self::NotSymmetric {
                row: first,
                col: second,
                ..
            }
            | Self::ParallelRows { first, second, .. } => {
                *first -= 1;
                *second -= 1;
            }
            Self::NotFinite { place, .. } | Self::Size { place, .. } => {
                *place = match *place {
                    Place::Of(i) => Place::Of(i - 1),
                    Place::OfLargest(i) => Place::OfLargest(i - 1),
                    Place::At(i, j) => Place::At(i - 1, j - 1),
                };
            }
            Self::NotSquare { .. }
            | Self::Empty
            | Self::Length { .. }
            | Self::Shape { .. }
            | Self::TooLarge { .. }
            | Self::Parts { .. }
            | Self::TooManyRows { .. } => {}
        }
        self
    }
}

/// Nonzero entries of K and of f, and the numbers they come from, must have a size between these. Displacements are
/// their quotients, within 1e±140. Squares and energies of all these remain within the range of full double precision,
/// 1e±307. No system of units comes near these limits.
const SMALLEST: f64 = 1e-70;
/// See [`SMALLEST`].
pub(crate) const LARGEST: f64 = 1e70;
/// No displacement and no force in a valid computation reaches this: an infinite gap and an infinite slip bound become this.
pub(crate) const UNREACHABLE: f64 = LARGEST / SMALLEST;

/// Whether a gap is infinite. A mean of [`UNREACHABLE`] over a place may be rounded down; no other gap comes near it.
pub(crate) fn is_infinite(gap: f64) -> bool {
    gap >= 0.5 * UNREACHABLE
}

/// The remedy for others.
pub(crate) const SIZES: &str =
    "nonzero values must be between 1e-70 and 1e70 in size: use other units";

/// Whether a size is in range, or 0.
pub(crate) fn is_sized(value: f64) -> bool {
    value == 0.0 || (SMALLEST..=LARGEST).contains(&value.abs())
}

/// The largest entry of a load is in range, or all of them are 0.
pub(super) fn sized_load(load: &[f64]) -> Result<(), ProblemError> {
    let all = load.iter().enumerate();
    let largest = all.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    match largest {
        Some((i, &value)) if !is_sized(value) => Err(ProblemError::Size {
            name: "the load f",
            place: Place::OfLargest(i + 1),
            value,
        }),
        _ => Ok(()),
    }
}

/// Relative asymmetry of K that counts as rounding.
const SYMMETRY_LIMIT: f64 = 1e-9;

/// The data, with the last block completed if n is not a multiple of D, after all checks except the rank of B = (N; T).
/// The checks are shapes, finite values, K symmetric with a positive diagonal, d ≥ 0, g ≥ 0.
pub(super) fn checked_but_for_rank<const D: usize>(
    mut data: ContactData<D>,
    softness: &[f64],
) -> Result<ContactData<D>, ProblemError> {
    shapes(&data)?;
    compliance::<D>(softness, data.gap.len())?;
    finite_entries(&mut data)?;
    let n = data.load.len();
    if !n.is_multiple_of(D) {
        data = pad(data);
    }
    let diagonal = data.stiffness.diagonal();
    // Entries that are too small for products would not be found symmetric, either.
    if let Some(i) = diagonal.iter().position(|&v| v > 0.0 && !is_sized(v)) {
        return Err(ProblemError::Size {
            name: "the stiffness matrix K",
            place: Place::At(i + 1, i + 1),
            value: diagonal[i],
        });
    }
    sized_load(&data.load)?;
    symmetric(&data.stiffness)?;
    if let Some(i) = diagonal.iter().position(|&v| !(v > 0.0)) {
        return Err(ProblemError::Diagonal {
            row: i + 1,
            value: diagonal[i],
        });
    }
    let coordinates = data.coordinates.as_deref();
    open_gap(&mut data.gap, coordinates, &data.load, &diagonal)?;
    let m = data.gap.len();
    slip_bound(&mut data.slip_bound, m)?;
    Ok(data)
}

/// d ≥ 0, apart from rounding: of the coordinates that it was measured with, and of the motion of a single unknown under the
/// load. Not of other gaps, because a large one means that there is no obstacle.
pub(super) fn open_gap<const D: usize>(
    gap: &mut [f64],
    coordinates: Option<&[[f64; D]]>,
    load: &[f64],
    diagonal: &[f64],
) -> Result<(), ProblemError> {
    /// For coordinates: sums of some hundred terms have this accuracy.
    const OF_PLACES: f64 = 1e-14;
    /// A part of the largest displacement, far below the resolution of tolerances.
    const OF_MOVED: f64 = 1e-10;
    let largest = |all: &mut dyn Iterator<Item = f64>| {
        all.filter(|x| x.is_finite())
            .fold(0.0, |a: f64, x| a.max(x.abs()))
    };
    let places = largest(&mut coordinates.iter().copied().flatten().flatten().copied());
    let moved = largest(&mut load.iter().zip(diagonal).map(|(f, k)| f / k));
    let touching = (OF_PLACES * places).max(OF_MOVED * moved);
    for gap in gap.iter_mut().filter(|gap| **gap >= -touching) {
        *gap = gap.max(0.0);
    }
    match gap.iter().position(|&v| v < 0.0) {
        Some(i) => Err(ProblemError::NegativeGap {
            row: i + 1,
            value: gap[i],
        }),
        None => Ok(()),
    }
}

fn shapes<const D: usize>(data: &ContactData<D>) -> Result<(), ProblemError> {
    let (rows, cols) = (data.stiffness.n_rows(), data.stiffness.n_cols());
    if rows != cols {
        return Err(ProblemError::NotSquare { rows, cols });
    }
    let (n, m) = (data.load.len(), data.gap.len());
    if n == 0 || rows == 0 {
        return Err(ProblemError::Empty);
    }
    if n.next_multiple_of(D) != rows {
        return Err(ProblemError::Length {
            name: "the load f",
            found: n,
            expected: rows,
            reason: "one entry per row of K",
        });
    }
    length("the slip bound g", &data.slip_bound, m, PER_NODE)?;
    let shape = |matrix: &Csr| (matrix.n_rows(), matrix.n_cols());
    contact_shapes::<D>(shape(&data.normal), shape(&data.tangential), m, n)?;
    match &data.coordinates {
        Some(points) if points.len() * D != n => Err(ProblemError::Length {
            name: "the coordinates",
            found: points.len(),
            expected: n / D,
            reason: if D == 2 {
                "one point per pair of unknowns"
            } else {
                "one point per three unknowns"
            },
        }),
        _ => Ok(()),
    }
}

/// N and T have rows for m contact nodes, and a column per unknown.
pub(super) fn contact_shapes<const D: usize>(
    normal: (usize, usize),
    tangential: (usize, usize),
    m: usize,
    n: usize,
) -> Result<(), ProblemError> {
    let each = super::tangents::<D>();
    for (name, (rows, cols), each) in [("N", normal, 1), ("T", tangential, each)] {
        if rows != each * m || cols != n {
            return Err(ProblemError::Shape {
                name,
                rows,
                cols,
                expected: each * m,
                n,
                per: ["one row", "two rows"][each - 1],
            });
        }
    }
    Ok(())
}

fn finite_entries<const D: usize>(data: &mut ContactData<D>) -> Result<(), ProblemError> {
    finite("the load f", &data.load)?;
    gap(&mut data.gap)?;
    let k = &data.stiffness;
    let values = k.values().par_iter();
    if values.any(|block| block.as_flattened().iter().any(|v| !v.is_finite())) {
        entries_finite("the stiffness matrix K", k.triplets())?;
    }
    rows_finite(&data.normal, &data.tangential)?;
    let points = data.coordinates.iter().flatten().enumerate();
    let places = points.flat_map(|(i, x)| (0..D).map(move |c| (i, c, x[c])));
    entries_finite("the coordinates", places)
}

pub(super) fn rows_finite(normal: &Csr, tangential: &Csr) -> Result<(), ProblemError> {
    entries_finite("N", normal.triplets())?;
    entries_finite("T", tangential.triplets())
}

fn entries_finite(
    name: &'static str,
    mut entries: impl Iterator<Item = (usize, usize, f64)>,
) -> Result<(), ProblemError> {
    match entries.find(|(_, _, v)| !v.is_finite()) {
        Some((i, j, value)) => Err(ProblemError::NotFinite {
            name,
            place: Place::At(i + 1, j + 1),
            value,
        }),
        None => Ok(()),
    }
}

/// One entry per contact node.
pub(super) fn length(
    name: &'static str,
    vector: &[f64],
    expected: usize,
    reason: &'static str,
) -> Result<(), ProblemError> {
    length_of(name, vector.len(), expected, reason)
}

/// A list has the expected number of entries.
pub(super) fn length_of(
    name: &'static str,
    found: usize,
    expected: usize,
    reason: &'static str,
) -> Result<(), ProblemError> {
    if found == expected {
        return Ok(());
    }
    Err(ProblemError::Length {
        name,
        found,
        expected,
        reason,
    })
}

/// The reason why a vector has m entries.
pub(super) const PER_NODE: &str = "one entry per entry of the gap d";

/// No entry is infinite or NaN.
pub(super) fn finite(name: &'static str, vector: &[f64]) -> Result<(), ProblemError> {
    match vector.iter().position(|v| !v.is_finite()) {
        Some(i) => Err(ProblemError::NotFinite {
            name,
            place: Place::Of(i + 1),
            value: vector[i],
        }),
        None => Ok(()),
    }
}

/// No entry is −∞ or NaN. Entries that are infinite, or larger than `most`, become that.
fn bounded(name: &'static str, vector: &mut [f64], most: f64) -> Result<(), ProblemError> {
    vector.iter_mut().for_each(|v| {
        if *v > most {
            *v = most;
        }
    });
    finite(name, vector)
}

/// d is valid except for its sign.
pub(super) fn gap(d: &mut [f64]) -> Result<(), ProblemError> {
    bounded("the gap d", d, UNREACHABLE)
}

/// The diagonal of W, whose inverse takes the place of K, is valid.
pub(super) fn delassus(diagonal: &[f64]) -> Result<(), ProblemError> {
    let name = "the diagonal of W";
    finite(name, diagonal)?;
    let at = |wrong: &dyn Fn(f64) -> bool| diagonal.iter().position(|&w| wrong(w));
    if let Some(i) = at(&|w| w < 0.0) {
        return Err(ProblemError::NegativeDelassus {
            row: i + 1,
            value: diagonal[i],
        });
    }
    match at(&|w| !is_sized(w)) {
        Some(i) => Err(ProblemError::Size {
            name,
            place: Place::Of(i + 1),
            value: diagonal[i],
        }),
        None => Ok(()),
    }
}

/// g is as it should be.
pub(super) fn slip_bound(g: &mut [f64], m: usize) -> Result<(), ProblemError> {
    length("the slip bound g", g, m, PER_NODE)?;
    bounded("the slip bound g", g, UNREACHABLE)?;
    match g.iter().position(|&v| v < 0.0) {
        Some(i) => Err(ProblemError::NegativeSlipBound {
            row: i + 1,
            value: g[i],
        }),
        None => Ok(()),
    }
}

/// μ is as it should be.
pub(super) fn friction(mu: &mut [f64], m: usize) -> Result<(), ProblemError> {
    length("the coefficient of friction μ", mu, m, PER_NODE)?;
    bounded("the coefficient of friction μ", mu, LARGEST)?;
    match mu.iter().position(|&v| v < 0.0) {
        Some(i) => Err(ProblemError::NegativeFriction {
            row: i + 1,
            value: mu[i],
        }),
        None => Ok(()),
    }
}

/// C is valid: of length D m or 0, finite, not negative, the same along both tangents of a node.
pub(super) fn compliance<const D: usize>(c: &[f64], m: usize) -> Result<(), ProblemError> {
    if c.is_empty() {
        return Ok(());
    }
    let reason = "one entry per row of N, then one per row of T";
    length("the compliance", c, D * m, reason)?;
    finite("the compliance", c)?;
    if let Some(i) = c.iter().position(|&v| v < 0.0) {
        return Err(ProblemError::NegativeCompliance {
            row: i + 1,
            value: c[i],
        });
    }
    let tangents = c[m..].chunks(super::tangents::<D>());
    let mut differ =
        (tangents.enumerate()).filter(|(_, of_node)| of_node.iter().any(|c| *c != of_node[0]));
    match differ.next() {
        None => Ok(()),
        Some((i, of_node)) => Err(ProblemError::UnequalCompliance {
            node: i + 1,
            first: of_node[0],
            second: of_node[1],
        }),
    }
}

/// Completes the last block if n is not a multiple of D: decoupled unknowns with the equation 1 · u = 0.
fn pad<const D: usize>(data: ContactData<D>) -> ContactData<D> {
    let n = data.load.len();
    let whole = n.next_multiple_of(D);
    let resize = |matrix: &Csr| Csr::from_triplets(matrix.n_rows(), whole, matrix.triplets());
    let mut load = data.load;
    load.resize(whole, 0.0);
    ContactData {
        stiffness: BlockCsr::from_triplets(
            whole,
            whole,
            data.stiffness
                .triplets()
                .filter(|&(i, j, _)| i < n && j < n)
                .chain((n..whole).map(|i| (i, i, 1.0))),
        ),
        load,
        normal: resize(&data.normal),
        tangential: resize(&data.tangential),
        ..data
    }
}

fn symmetric<const D: usize>(k: &BlockCsr<D>) -> Result<(), ProblemError> {
    let diagonal = k.diagonal();
    let rows = || (0..k.n_block_rows()).into_par_iter().with_min_len(1024);
    // The number of blocks of a row, in its columns from `first` on, that have a mirror; or the first one that differs from it.
    let mirrored = |i: usize, first: usize| {
        let (cols, blocks) = k.row(i);
        let mut count = 0;
        for (&j, block) in (cols.iter().zip(blocks)).filter(|&(&j, _)| j as usize >= first) {
            let j = j as usize;
            let mirror = if i == j { Some(block) } else { k.block(j, i) };
            count += usize::from(mirror.is_some());
            for a in 0..D {
                for b in 0..D {
                    let value = block[a][b];
                    let other = mirror.map_or(0.0, |block| block[b][a]);
                    let scale = (diagonal[D * i + a] * diagonal[D * j + b]).abs();
                    let limit = SYMMETRY_LIMIT.powi(2) * scale.max(value * value);
                    if (value - other).powi(2) > limit {
                        return Err(ProblemError::NotSymmetric {
                            row: D * i + a + 1,
                            col: D * j + b + 1,
                            value,
                            mirror: other,
                            held: [(D * i + a, value), (D * j + b, other)]
                                .iter()
                                .any(|&(row, v)| v == 0.0 && holds(k, row)),
                        });
                    }
                }
            }
        }
        Ok(count)
    };
    let above = rows().map(|i| mirrored(i, i));
    match above.try_reduce(|| 0, |a, b| Ok(a + b)) {
        // They mirror all blocks below the diagonal.
        Ok(count) if 2 * count == k.n_blocks() + k.n_block_rows() => Ok(()),
        _ => (rows().find_map_first(|i| mirrored(i, 0).err())).map_or(Ok(()), Err),
    }
}

/// Whether a row has only its diagonal entry.
fn holds<const D: usize>(k: &BlockCsr<D>, row: usize) -> bool {
    let (cols, blocks) = k.row(row / D);
    let mut all = (cols.iter().zip(blocks)).flat_map(|(&j, block)| {
        let entries = (D * j as usize..).zip(block[row % D]);
        entries.filter(|&(_, v)| v != 0.0)
    });
    all.all(|(col, _)| col == row)
}

/// The nonzero entries of a row.
fn entries(matrix: &Csr, row: usize) -> impl Iterator<Item = (u32, f64)> {
    let (cols, values) = matrix.row(row);
    let entries = cols.iter().zip(values).map(|(&j, v)| (j, v[0][0]));
    entries.filter(|&(_, v)| v != 0.0)
}

/// Where a row of N has no entries, nothing can open an overlap, except compliant contact.
pub(super) fn no_overlap_of_nothing(
    gap: &[f64],
    normal: &Csr,
    compliance: &[f64],
    tied: &[bool],
) -> Result<(), ProblemError> {
    let gives_way = |i: usize| {
        compliance.get(i).is_some_and(|&c| c > 0.0) || tied.get(i).is_some_and(|&tied| tied)
    };
    let overlaps = |&i: &usize| gap[i] < 0.0 && entries(normal, i).next().is_none();
    match (0..gap.len()).filter(|&i| !gives_way(i)).find(overlaps) {
        None => Ok(()),
        Some(i) => Err(ProblemError::ZeroRow {
            row: i + 1,
            gap: gap[i],
        }),
    }
}

/// Cheap checks of the row rank of B: parallel rows, too many rows. Compliant rows may depend on all others.
pub(super) fn rank(
    normal: &Csr,
    tangential: &Csr,
    n: usize,
    compliance: &[f64],
) -> Result<(), ProblemError> {
    let m = normal.n_rows();
    let mut seen: HashMap<Vec<(u32, u64)>, usize> = HashMap::new();
    let mut count = 0;
    for (matrix, offset) in [(normal, 0), (tangential, m)] {
        for i in 0..matrix.n_rows() {
            if compliance.get(offset + i).is_some_and(|&c| c > 0.0) {
                continue;
            }
            let entries: Vec<(u32, f64)> = entries(matrix, i).collect();
            let largest = entries
                .iter()
                .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
            let Some(&(_, lead)) = largest else {
                continue;
            };
            count += 1;
            // Equal up to a factor and rounding: compare eight digits of the entries over the largest.
            let key = entries
                .iter()
                .map(|&(j, v)| (j, (v / lead * 1e8).round() as i64 as u64))
                .collect();
            if let Some(first) = seen.insert(key, offset + i) {
                let both_normal = first < m && offset == 0;
                return Err(ProblemError::ParallelRows {
                    first: first + 1,
                    second: offset + i + 1,
                    name: match (both_normal, first < m) {
                        (true, _) => "two rows of N (the same node is listed twice in the contact)",
                        (_, true) => "a row of N and a row of T (normal and tangent are the same)",
                        _ => "two rows of T (the same node is listed twice in the contact)",
                    },
                });
            }
        }
    }
    if count > n {
        return Err(ProblemError::TooManyRows { rows: count, n });
    }
    Ok(())
}
