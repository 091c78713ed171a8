//! The algebraic contact problem (1)–(3) of the paper, validated: the door for users with their own
//! discretisation.

mod free;
mod kkt;

pub use free::{FreeBodies, FreeBody};
pub use kkt::Kkt;
pub(crate) use kkt::{ROUNDING, slip_violation};

use crate::sparse::{BlockCsr, Csr, norm, norm_max};
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

/// The data of a [`ContactProblem`], not yet checked.
///
/// The letters are those of the paper: find u ∈ ℝⁿ and λν, λτ ∈ ℝᵐ with
///
/// ```text
/// (1)  K u + Nᵀλν + Tᵀλτ = f
/// (2)  N u − d ≤ 0,   λν ≥ 0,   λνᵀ(N u − d) = 0
/// (3)  |λτ,i| ≤ gᵢ;   |λτ,i| < gᵢ ⇒ (T u)ᵢ = 0;   |λτ,i| = gᵢ ⇒ (T u)ᵢ = cᵢ λτ,i with cᵢ ≥ 0
/// ```
#[derive(Clone, Debug)]
pub struct ContactData {
    /// K, n × n, symmetric positive definite. For odd n, [`BlockCsr::from_triplets`] pads to n + 1.
    pub stiffness: BlockCsr<2>,
    /// f, length n.
    pub load: Vec<f64>,
    /// N, m × n: the displacement of contact node i towards the obstacle is (N u)ᵢ.
    pub normal: Csr,
    /// T, m × n: the displacement of contact node i along the boundary is (T u)ᵢ. A row may be empty
    /// where gᵢ = 0 (a node that cannot move sideways).
    pub tangential: Csr,
    /// d, length m: the initial gap, ≥ 0.
    pub gap: Vec<f64>,
    /// g, length m: the slip bound (a force per contact node), ≥ 0; for Coulomb's law see
    /// [`ContactProblem::with_friction_coefficient`].
    pub slip_bound: Vec<f64>,
    /// One point per pair of unknowns, if they are the displacements of nodes; gives rigid body modes.
    pub coordinates: Option<Vec<[f64; 2]>>,
}

/// A validated contact problem: everything that works on it may trust its claims.
#[derive(Clone, Debug)]
pub struct ContactProblem {
    n: usize,
    n_free: usize,
    /// Shared, since backends on the CPU work on it where it is.
    stiffness: Arc<BlockCsr<2>>,
    load: Vec<f64>,
    normal: Csr,
    tangential: Csr,
    gap: Vec<f64>,
    slip_bound: Vec<f64>,
    /// μ, length m, 0 where the slip bound is given; empty without Coulomb friction.
    friction: Vec<f64>,
    coordinates: Option<Vec<[f64; 2]>>,
    /// Where slip is counted from: T u less this is the slip, length m.
    slip_origin: Vec<f64>,
    /// The areas that turn nodal forces into pressures, length m.
    areas: Arc<Vec<f64>>,
    /// The largest displacement before this load step: what comes out as a difference is rounded accordingly.
    travelled: f64,
    /// ‖forces that act on the bodies‖: ‖f‖, but for what prescribed displacements add to f.
    acting: f64,
    free: Arc<FreeBodies>,
    /// The connected part of K that each node belongs to.
    parts: Arc<Vec<u32>>,
    /// Σⱼ Bᵢⱼ²/Kⱼⱼ, length 2m.
    compliance: Arc<Vec<f64>>,
    /// The same with the share that each row has of the unknowns of several.
    own_compliance: Arc<Vec<f64>>,
}

/// A claim of [`ContactProblem::new`] that the data breaks. Rows and columns count from 1.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProblemError {
    #[error("the stiffness matrix K is {rows} × {cols}: it must be square")]
    NotSquare { rows: usize, cols: usize },
    #[error("the problem has no unknowns")]
    Empty,
    #[error("{name} has length {found}, expected {expected} ({reason})")]
    Length {
        name: &'static str,
        found: usize,
        expected: usize,
        reason: &'static str,
    },
    #[error(
        "{name} is {rows} × {cols}, expected {m} × {n} (one row per entry of d, one column per unknown)"
    )]
    Shape {
        name: &'static str,
        rows: usize,
        cols: usize,
        m: usize,
        n: usize,
    },
    #[error("{name}: entry {place} is {value}, not a finite number")]
    NotFinite {
        name: &'static str,
        place: String,
        value: f64,
    },
    #[error(
        "the stiffness matrix K is not symmetric: K({row}, {col}) = {value:e} but K({col}, {row}) = {mirror:e}"
    )]
    NotSymmetric {
        row: usize,
        col: usize,
        value: f64,
        mirror: f64,
    },
    #[error(
        "the stiffness matrix K is not positive definite: its diagonal entry {row} is {value:e}, must be > 0"
    )]
    Diagonal { row: usize, value: f64 },
    #[error(
        "the gap d has the negative entry d({row}) = {value:e}: the bodies overlap before loading; move them apart"
    )]
    NegativeGap { row: usize, value: f64 },
    #[error("the slip bound g has the negative entry g({row}) = {value:e}")]
    NegativeSlipBound { row: usize, value: f64 },
    #[error("row {row} of {name} has no nonzero entry, so (N; T) has no full row rank{hint}")]
    ZeroRow {
        name: &'static str,
        row: usize,
        hint: &'static str,
    },
    #[error("rows {first} and {second} of (N; T) are parallel, so it has no full row rank: {name}")]
    ParallelRows {
        first: usize,
        second: usize,
        name: &'static str,
    },
    #[error("(N; T) has {rows} rows for {n} unknowns, so it has no full row rank")]
    TooManyRows { rows: usize, n: usize },
}

/// Relative asymmetry of K that counts as rounding.
const SYMMETRY_LIMIT: f64 = 1e-9;

impl ContactProblem {
    /// Checks the data: shapes, finite values, K symmetric with a positive diagonal, d ≥ 0, g ≥ 0, no
    /// zero or parallel rows in B = (N; T). That K is positive definite shows when it is factorised.
    pub fn new(mut data: ContactData) -> Result<Self, ProblemError> {
        let (rows, cols) = (data.stiffness.n_rows(), data.stiffness.n_cols());
        if rows != cols {
            return Err(ProblemError::NotSquare { rows, cols });
        }
        let n = data.load.len();
        if n == 0 || rows == 0 {
            return Err(ProblemError::Empty);
        }
        if n.div_ceil(2) * 2 != rows {
            return Err(ProblemError::Length {
                name: "the load f",
                found: n,
                expected: rows,
                reason: "one entry per row of K",
            });
        }
        let m = data.gap.len();
        if data.slip_bound.len() != m {
            return Err(ProblemError::Length {
                name: "the slip bound g",
                found: data.slip_bound.len(),
                expected: m,
                reason: "one entry per entry of the gap d",
            });
        }
        for (name, matrix) in [("N", &data.normal), ("T", &data.tangential)] {
            let (rows, cols) = (matrix.n_rows(), matrix.n_cols());
            if rows != m || cols != n {
                return Err(ProblemError::Shape {
                    name,
                    rows,
                    cols,
                    m,
                    n,
                });
            }
        }
        if let Some(coordinates) = &data.coordinates
            && coordinates.len() * 2 != n
        {
            return Err(ProblemError::Length {
                name: "the coordinates",
                found: coordinates.len(),
                expected: n / 2,
                reason: "one point per pair of unknowns",
            });
        }

        for (name, vector) in [
            ("the load f", &data.load),
            ("the gap d", &data.gap),
            ("the slip bound g", &data.slip_bound),
        ] {
            if let Some(i) = vector.iter().position(|v| !v.is_finite()) {
                return Err(ProblemError::NotFinite {
                    name,
                    place: format!("{}", i + 1),
                    value: vector[i],
                });
            }
        }
        let matrix_entry = |name, found: Option<(usize, usize, f64)>| match found {
            Some((i, j, value)) => Err(ProblemError::NotFinite {
                name,
                place: format!("({}, {})", i + 1, j + 1),
                value,
            }),
            None => Ok(()),
        };
        if data
            .stiffness
            .values()
            .par_iter()
            .any(|block| block.as_flattened().iter().any(|v| !v.is_finite()))
        {
            matrix_entry(
                "the stiffness matrix K",
                data.stiffness.triplets().find(|(_, _, v)| !v.is_finite()),
            )?;
        }
        matrix_entry("N", data.normal.triplets().find(|(_, _, v)| !v.is_finite()))?;
        matrix_entry(
            "T",
            data.tangential.triplets().find(|(_, _, v)| !v.is_finite()),
        )?;

        if n % 2 == 1 {
            data = pad(data);
        }
        check_symmetric(&data.stiffness)?;
        if let Some((i, &value)) = data
            .stiffness
            .diagonal()
            .iter()
            .enumerate()
            .find(|(_, v)| !(**v > 0.0))
        {
            return Err(ProblemError::Diagonal { row: i + 1, value });
        }
        if let Some(i) = data.gap.iter().position(|&v| v < 0.0) {
            return Err(ProblemError::NegativeGap {
                row: i + 1,
                value: data.gap[i],
            });
        }
        if let Some(i) = data.slip_bound.iter().position(|&v| v < 0.0) {
            return Err(ProblemError::NegativeSlipBound {
                row: i + 1,
                value: data.slip_bound[i],
            });
        }
        check_rows(&data, n)?;
        let (count, parts) = data.stiffness.components();
        let free = match &data.coordinates {
            Some(points) => FreeBodies::among(&data.stiffness, points, count, &parts),
            None => FreeBodies::default(),
        };
        let (compliance, own_compliance) = compliances(&data);
        Ok(Self {
            n,
            n_free: n,
            slip_origin: vec![0.0; m],
            areas: Arc::new(vec![1.0; m]),
            travelled: 0.0,
            acting: norm(&data.load),
            free: Arc::new(free),
            parts: Arc::new(parts),
            compliance: Arc::new(compliance),
            own_compliance: Arc::new(own_compliance),
            stiffness: Arc::new(data.stiffness),
            load: data.load,
            normal: data.normal,
            tangential: data.tangential,
            gap: data.gap,
            slip_bound: data.slip_bound,
            friction: Vec::new(),
            coordinates: data.coordinates,
        })
    }

    /// Gives contact nodes Coulomb's law: where μᵢ > 0 the slip bound is μᵢλν,i and `slip_bound` says nothing.
    ///
    /// # Panics
    /// If the length is not m (or 0: no Coulomb friction), or an entry is negative or NaN.
    pub fn with_friction_coefficient(mut self, mu: Vec<f64>) -> Self {
        assert!(mu.is_empty() || mu.len() == self.m());
        assert!(mu.iter().all(|&mu| mu >= 0.0));
        self.friction = if mu.iter().all(|&mu| mu == 0.0) {
            Vec::new()
        } else {
            mu
        };
        self
    }

    /// The problem with the same K, N and T and another load, gap, origin of slip and slip bound: a load step, or
    /// one of several problems in a row. (3) is then about T u − `slip_origin`. The gap may be negative here,
    /// where a prescribed motion has closed it.
    ///
    /// # Panics
    /// If a length differs, or an entry of the slip bound is negative or NaN.
    pub fn with_data(
        &self,
        load: Vec<f64>,
        gap: Vec<f64>,
        slip_origin: Vec<f64>,
        slip_bound: Vec<f64>,
    ) -> Self {
        assert_eq!(load.len(), self.load.len());
        assert_eq!((gap.len(), slip_bound.len()), (self.m(), self.m()));
        assert_eq!(slip_origin.len(), self.m());
        assert!(slip_bound.iter().all(|&g| g >= 0.0));
        Self {
            acting: norm(&load),
            load,
            gap,
            slip_origin,
            slip_bound,
            ..self.clone()
        }
    }

    /// Gives the area of each contact node, length m: what turns its force into a pressure. Without, forces are
    /// compared as they are.
    ///
    /// # Panics
    /// If the length differs.
    pub fn with_areas(mut self, areas: Vec<f64>) -> Self {
        assert_eq!(areas.len(), self.m());
        self.areas = Arc::new(areas);
        self
    }

    /// Says how large the forces are that act on the bodies (a Euclidean norm), where the load f is larger by
    /// what prescribed displacements add to it.
    pub fn with_acting_forces(mut self, acting: f64) -> Self {
        self.acting = acting;
        self
    }

    /// Says how far bodies have been displaced before this load step (the largest component).
    pub(crate) fn with_travelled(mut self, travelled: f64) -> Self {
        self.travelled = travelled;
        self
    }

    /// The length that displacements, gaps and slips of this problem are differences of, at most.
    pub(crate) fn reach(&self) -> f64 {
        (self.travelled)
            .max(norm_max(&self.gap))
            .max(norm_max(&self.slip_origin))
    }

    /// Says how many of the unknowns are free, where some rows of K only hold a prescribed component.
    pub fn with_free_unknowns(mut self, n_free: usize) -> Self {
        self.n_free = n_free.min(self.n);
        self
    }

    /// The problem without Coulomb's law, with the slip bounds given.
    ///
    /// # Panics
    /// If the length differs.
    pub(crate) fn with_frozen_bounds(mut self, slip_bound: Vec<f64>) -> Self {
        assert_eq!(slip_bound.len(), self.m());
        self.slip_bound = slip_bound;
        self.friction = Vec::new();
        self
    }

    /// Whether a law of friction acts on contact node i: a slip bound, or a coefficient, above 0.
    pub fn has_friction(&self, i: usize) -> bool {
        self.slip_bound[i] > 0.0 || self.friction.get(i).is_some_and(|&mu| mu > 0.0)
    }

    /// Number of unknowns n that the user gave.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Number of unknowns that are free to move.
    pub fn n_free(&self) -> usize {
        self.n_free
    }

    /// Number of contact nodes m.
    pub fn m(&self) -> usize {
        self.gap.len()
    }

    /// K; for odd n with one decoupled unknown more.
    pub fn stiffness(&self) -> &Arc<BlockCsr<2>> {
        &self.stiffness
    }

    /// B = (N; T): 2m rows, and as many columns as K.
    pub fn contact_matrix(&self) -> Csr {
        let m = self.m();
        let tangential = self.tangential.triplets().map(|(i, j, v)| (i + m, j, v));
        Csr::from_triplets(
            2 * m,
            self.stiffness.n_cols(),
            self.normal
                .triplets()
                .chain(tangential)
                .filter(|&(_, _, v)| v != 0.0),
        )
    }

    /// Whether B touches each block row of K.
    pub(crate) fn touched(&self) -> Vec<bool> {
        let mut touched = vec![false; self.stiffness.n_block_rows()];
        for (_, j, v) in self.normal.triplets().chain(self.tangential.triplets()) {
            touched[j / 2] |= v != 0.0;
        }
        touched
    }

    /// f, as long as K has rows.
    pub fn load(&self) -> &[f64] {
        &self.load
    }

    /// Where slip is counted from: (3) is about T u less this.
    pub fn slip_origin(&self) -> &[f64] {
        &self.slip_origin
    }

    /// (d, origin of slip): c in r = c − B u.
    pub fn offsets(&self) -> Vec<f64> {
        [&self.gap[..], &self.slip_origin].concat()
    }

    /// The areas of the contact nodes; ones where they are not known.
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// The bodies that can move as a whole, as far as K and the coordinates tell.
    pub fn free_bodies(&self) -> &FreeBodies {
        &self.free
    }

    /// How far a multiplier moves its own contact node at least, per force: Σⱼ Bᵢⱼ²/Kⱼⱼ ≤ Aᵢᵢ, length 2m; 0 for
    /// an empty row.
    pub(crate) fn compliance(&self) -> &[f64] {
        &self.compliance
    }

    /// Σⱼ Bᵢⱼ²/Kⱼⱼ with what each row has of the unknowns that several share: by about so much a force of its own closes a
    /// gap that is the difference of neighbours, length 2m.
    pub(crate) fn own_compliance(&self) -> &[f64] {
        &self.own_compliance
    }

    /// N.
    pub fn normal(&self) -> &Csr {
        &self.normal
    }

    /// T.
    pub fn tangential(&self) -> &Csr {
        &self.tangential
    }

    /// d.
    pub fn gap(&self) -> &[f64] {
        &self.gap
    }

    /// g, as far as it is given: [`ContactProblem::bounds`] has all of it.
    pub fn slip_bound(&self) -> &[f64] {
        &self.slip_bound
    }

    /// μ of each contact node, 0 where the slip bound is given; empty without Coulomb friction.
    pub fn friction_coefficient(&self) -> &[f64] {
        &self.friction
    }

    /// Whether there is Coulomb friction.
    pub fn has_coulomb(&self) -> bool {
        !self.friction.is_empty()
    }

    /// g under Coulomb's law: μλν of the multipliers given, and the given bounds elsewhere.
    pub fn bounds(&self, lambda: &[f64]) -> Cow<'_, [f64]> {
        coulomb_bounds(&self.slip_bound, &self.friction, lambda)
    }

    /// The points that the pairs of unknowns belong to, if known.
    pub fn coordinates(&self) -> Option<&[[f64; 2]]> {
        self.coordinates.as_deref()
    }

    /// Whether K ties an unknown to another one; those it does not are held where they are.
    pub(crate) fn is_coupled(&self, unknown: usize) -> bool {
        is_coupled(&self.stiffness, unknown)
    }

    /// " at (x, y)" for an unknown whose place is known.
    pub(crate) fn place_of(&self, unknown: usize) -> String {
        match &self.coordinates {
            Some(points) if unknown / 2 < points.len() => {
                let [x, y] = points[unknown / 2];
                format!(" at ({x:.6e}, {y:.6e})")
            }
            _ => String::new(),
        }
    }
}

/// The slip bound of a node with the normal multiplier λν: μλν where μ > 0, the given one elsewhere.
pub(crate) fn coulomb_bound(given: f64, mu: f64, normal: f64) -> f64 {
    if mu > 0.0 {
        mu * normal.max(0.0)
    } else {
        given
    }
}

/// The slip bounds at λ: μλν where μ > 0, the given ones elsewhere (everywhere if μ is empty).
pub(crate) fn coulomb_bounds<'a>(given: &'a [f64], mu: &[f64], lambda: &[f64]) -> Cow<'a, [f64]> {
    if mu.is_empty() {
        return Cow::Borrowed(given);
    }
    let all = given.iter().zip(mu).zip(lambda);
    Cow::Owned(all.map(|((&g, &mu), &l)| coulomb_bound(g, mu, l)).collect())
}

/// Whether K ties an unknown to another one.
fn is_coupled(k: &BlockCsr<2>, unknown: usize) -> bool {
    let (i, a) = (unknown / 2, unknown % 2);
    let (cols, blocks) = k.row(i);
    (cols.iter().zip(blocks))
        .any(|(&j, block)| (0..2).any(|b| 2 * j as usize + b != unknown && block[a][b] != 0.0))
}

/// Σⱼ Bᵢⱼ²/Kⱼⱼ for each row i of B, and Σⱼ sᵢⱼ Bᵢⱼ²/Kⱼⱼ with the share sᵢⱼ = Bᵢⱼ²/Σₖ Bₖⱼ² of row i among those of N,
/// or of T, that have an entry in column j.
fn compliances(data: &ContactData) -> (Vec<f64>, Vec<f64>) {
    let diagonal = data.stiffness.diagonal();
    let (mut whole, mut own) = (Vec::new(), Vec::new());
    for matrix in [&data.normal, &data.tangential] {
        let mut columns = vec![0.0; diagonal.len()];
        for (_, j, v) in matrix.triplets() {
            columns[j] += v * v;
        }
        for i in 0..data.gap.len() {
            let (cols, values) = matrix.row(i);
            let (mut sum, mut shared) = (0.0, 0.0);
            for (&j, v) in cols.iter().zip(values) {
                let (j, square) = (j as usize, v[0][0] * v[0][0]);
                if square > 0.0 {
                    sum += square / diagonal[j];
                    shared += square / diagonal[j] * (square / columns[j]);
                }
            }
            whole.push(sum);
            own.push(shared);
        }
    }
    (whole, own)
}

/// Completes the last block for odd n: a decoupled unknown with the equation 1 · u = 0.
fn pad(data: ContactData) -> ContactData {
    let n = data.load.len();
    let resize = |matrix: &Csr| Csr::from_triplets(matrix.n_rows(), n + 1, matrix.triplets());
    let mut load = data.load;
    load.push(0.0);
    ContactData {
        stiffness: BlockCsr::from_triplets(
            n + 1,
            n + 1,
            data.stiffness
                .triplets()
                .filter(|&(i, j, _)| i < n && j < n)
                .chain([(n, n, 1.0)]),
        ),
        load,
        normal: resize(&data.normal),
        tangential: resize(&data.tangential),
        ..data
    }
}

fn check_symmetric(k: &BlockCsr<2>) -> Result<(), ProblemError> {
    let diagonal = k.diagonal();
    let bad = (0..k.n_block_rows())
        .into_par_iter()
        .with_min_len(1024)
        .find_map_first(|i| {
            let (cols, blocks) = k.row(i);
            for (&j, block) in cols.iter().zip(blocks) {
                let j = j as usize;
                let mirror = if i == j { Some(block) } else { k.block(j, i) };
                for a in 0..2 {
                    for b in 0..2 {
                        let value = block[a][b];
                        let other = mirror.map_or(0.0, |block| block[b][a]);
                        let scale = (diagonal[2 * i + a].abs() * diagonal[2 * j + b].abs()).sqrt();
                        if (value - other).abs() > SYMMETRY_LIMIT * scale.max(value.abs()) {
                            return Some(ProblemError::NotSymmetric {
                                row: 2 * i + a + 1,
                                col: 2 * j + b + 1,
                                value,
                                mirror: other,
                            });
                        }
                    }
                }
            }
            None
        });
    bad.map_or(Ok(()), Err)
}

/// What can be seen cheaply of the row rank of B: zero rows, parallel rows, too many rows.
fn check_rows(data: &ContactData, n: usize) -> Result<(), ProblemError> {
    let m = data.gap.len();
    let mut seen: HashMap<Vec<(u32, u64)>, usize> = HashMap::new();
    let mut count = 0;
    for (name, matrix, offset) in [("N", &data.normal, 0), ("T", &data.tangential, m)] {
        for i in 0..m {
            let (cols, values) = matrix.row(i);
            let entries: Vec<(u32, f64)> = cols
                .iter()
                .zip(values)
                .map(|(&j, v)| (j, v[0][0]))
                .filter(|&(_, v)| v != 0.0)
                .collect();
            let Some(&(_, lead)) = entries
                .iter()
                .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
            else {
                let tangential = offset > 0;
                if tangential && data.slip_bound[i] == 0.0 {
                    continue;
                }
                return Err(ProblemError::ZeroRow {
                    name,
                    row: i + 1,
                    hint: if tangential {
                        " (a node that cannot move sideways needs the slip bound 0)"
                    } else {
                        ""
                    },
                });
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
                        (true, _) => "two rows of N (the same node stands twice in the contact)",
                        (_, true) => "a row of N and a row of T (normal and tangent are the same)",
                        _ => "two rows of T (the same node stands twice in the contact)",
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
