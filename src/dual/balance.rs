//! Contact forces that balance every floating body: the nearest λ ∈ Λ with Gλ = e, and projections orthogonal to G.
//!
//! With this equality, Λₑ = {λ ∈ Λ: Gλ = e} is convex like Λ. The method needs only the projection onto Λₑ, and that
//! costs no product with A: λ = P_Λ(x + Gᵀη). The few numbers η minimise a convex, piecewise quadratic function φ(η) =
//! ½‖z‖² − ½‖z − P_Λ(z)‖² − ηᵀe with z = x + Gᵀη. Its gradient is Gλ − e. Newton's method with a line search finds them
//! in finitely many steps. If φ has no minimum, no λ ∈ Λ balances the bodies, and the remaining gradient tells which
//! body is pushed in which direction.

use crate::constraint::{NodeSets, Projected, at, put, row_of};
use crate::dense::{pseudo_inverse, symmetric_eigen};
use crate::problem::FloatingBodies;
use crate::rounding::{DEPENDENT, INDEPENDENT, ROUNDING};
use crate::sparse::{Csr, add_times, dot, norm, norm_max};
use faer::Mat;
use std::array::from_fn;
use std::rc::Rc;

/// This curvature is added to φ in every direction (G has columns of length one), around the η of the pass before. So
/// motions without resistance stay as they were. It is reduced where x is far away and the forces are small, and where
/// it hides that the bodies can be balanced, as by forces with a tiny arm.
pub(crate) const CURVATURE: f64 = 1e-8;
/// Steps of Newton's method in a pass at most, and of its line search: random bodies take up to 40 of the former.
const STEPS: usize = 200;
/// Forces that leave less than this part of the acting ones unbalanced count as balanced: loads and normals of meshes
/// are no more accurate.
pub(crate) const BALANCED: f64 = 1e-10;
/// How often a step that a pass repeats is doubled at most: where nothing balances a body, φ falls without end.
const DOUBLINGS: usize = 10;
/// A motion that moves some row by more than this is resisted; columns of G have length one. Eigenvectors of G Gᵀ leave 1e-12.
const RESISTS: f64 = 1e-11;
/// The slope at the end of a line search, relative to that at its start.
const SEARCHED: f64 = 1e-2;

/// G and e of all floating bodies.
#[derive(Clone, Debug)]
pub(crate) struct Balance {
    /// Gᵀ with columns of length one, a row for each multiplier.
    motions: Csr,
    /// The lengths of the columns before; 0 for a motion that no multiplier resists.
    lengths: Vec<f64>,
    /// e, divided by them.
    e: Vec<f64>,
    /// The sum of |R||f|: the scale of an imbalance.
    acting: Vec<f64>,
    /// The body of each motion.
    body: Vec<usize>,
    /// The effect of a unit of each multiplier on the motions of each body, a row for each multiplier.
    shares: Csr,
    /// e where no multiplier resists, unchanged.
    without_contact: Vec<f64>,
    /// [`CURVATURE`], or less if the balance of the bodies requires it.
    curvature: f64,
    /// Whether λ is balanced to rounding on its face, if the balance of the bodies requires that too.
    refines: bool,
}

/// The forces that an imbalance along a motion is measured by.
#[derive(Clone, Copy, Default)]
struct Scale {
    /// Those on its body.
    own: f64,
    /// Those on bodies that share a multiplier with it, as these can pass them on. A multiplier that balances a loaded
    /// body is known up to the rounding of that load, however small the forces on the other body are.
    beside: f64,
}

impl Scale {
    /// Their rounding error.
    fn rounding(self) -> f64 {
        ROUNDING * (self.own + self.beside)
    }
}

/// The nearest point of Λₑ.
pub(crate) struct Nearest {
    /// λ.
    pub lambda: Vec<f64>,
    /// η: λ = P_Λ(x + Gᵀη).
    pub eta: Vec<f64>,
    /// e − Gλ; zero up to rounding if the bodies are balanced.
    pub imbalance: Vec<f64>,
    /// The motion of the bodies that this drives and that no forces of Λ resist.
    pub motion: Vec<f64>,
    /// Whether they are.
    pub balanced: bool,
}

/// An intermediate η of the search for the nearest point.
struct Trial<const D: usize> {
    eta: Vec<f64>,
    /// x + Gᵀη.
    z: Vec<f64>,
    /// P_Λ(z).
    lambda: Vec<f64>,
    /// Σ |P'||z|, the terms whose sum is λ. For a node on the edge of its cone far more than λ, where nothing holds a
    /// body.
    terms: Vec<f64>,
    /// P' at z, node by node.
    derivatives: Vec<[[f64; D]; D]>,
}

impl<const D: usize> Trial<D> {
    /// The one after a step t of η, which changes the forces by t `along`.
    fn after(
        &self,
        t: f64,
        step: &[f64],
        along: &[f64],
        project: impl Fn(usize, [f64; D]) -> Projected<D>,
    ) -> Self {
        let (mut eta, mut z) = (self.eta.clone(), self.z.clone());
        add_times(t, step, &mut eta);
        add_times(t, along, &mut z);
        Self::at(eta, z, project)
    }

    fn at(eta: Vec<f64>, z: Vec<f64>, project: impl Fn(usize, [f64; D]) -> Projected<D>) -> Self {
        let (mut lambda, mut terms) = (vec![0.0; z.len()], vec![0.0; z.len()]);
        let derivatives = (0..z.len() / D).map(|i| {
            let here: [f64; D] = at(&z, i);
            let (end, derivative) = project(i, here);
            put(&mut lambda, i, end);
            let sizes = derivative.map(|row| (0..D).map(|a| (row[a] * here[a]).abs()).sum());
            put(&mut terms, i, sizes);
            derivative
        });
        Self {
            derivatives: derivatives.collect(),
            eta,
            lambda,
            terms,
            z,
        }
    }
}

impl Balance {
    /// Of the floating bodies of a problem under the load f, with Gᵀ times `factor` (that of its row).
    pub fn new<const D: usize>(
        free: &FloatingBodies<D>,
        b: &Csr,
        load: &[f64],
        factor: impl Fn(usize) -> f64,
    ) -> Self {
        let motions = free.contact_motions(b);
        let scaled = motions.triplets().map(|(i, j, v)| (i, j, factor(i) * v));
        let transposed = Csr::from_triplets(motions.n_rows(), free.n_modes(), scaled);
        let (mut e, acting) = (free.resultants(load), free.sizes(load));
        // Loads that are in balance, as those of heating are, are so up to rounding: no forces are as small.
        for (e, acting) in e.iter_mut().zip(&acting) {
            if e.abs() <= ROUNDING * acting {
                *e = 0.0;
            }
        }
        Self::from_parts(&transposed, &e, acting, free.body_of_motion())
    }

    fn from_parts(transposed: &Csr, e: &[f64], acting: Vec<f64>, body: Vec<usize>) -> Self {
        let mut lengths = vec![0.0; e.len()];
        for (_, j, v) in transposed.triplets() {
            lengths[j] += v * v;
        }
        lengths.iter_mut().for_each(|l: &mut f64| *l = l.sqrt());
        let bodies = body.iter().max().map_or(0, |&last| last + 1);
        let sizes = (transposed.triplets()).map(|(i, j, v)| (i, body[j], v.abs()));
        let shares = Csr::from_triplets(transposed.n_rows(), bodies, sizes);
        let over = |v: f64, j: usize| {
            if lengths[j] > 0.0 {
                v / lengths[j]
            } else {
                0.0
            }
        };
        let scaled = transposed.triplets().map(|(i, j, v)| (i, j, over(v, j)));
        Self {
            motions: Csr::from_triplets(transposed.n_rows(), e.len(), scaled),
            e: e.iter().enumerate().map(|(j, &v)| over(v, j)).collect(),
            without_contact: (0..e.len())
                .map(|j| {
                    let unresisted = lengths[j] == 0.0 && e[j].abs() > BALANCED * acting[j];
                    if unresisted { e[j] } else { 0.0 }
                })
                .collect(),
            acting,
            body,
            shares,
            lengths,
            curvature: CURVATURE,
            refines: false,
        }
    }

    /// The largest of the first m multipliers, the normal ones, on each body.
    pub fn pressed(&self, lambda: &[f64], m: usize) -> Vec<f64> {
        let mut most = vec![0.0_f64; self.shares.n_cols()];
        for (i, &normal) in lambda[..m].iter().enumerate() {
            for &body in self.shares.row(i).0 {
                most[body as usize] = most[body as usize].max(normal);
            }
        }
        most
    }

    /// Motions.
    pub fn count(&self) -> usize {
        self.e.len()
    }

    /// Gᵀη as a change of forces; η as in [`Nearest::eta`].
    pub fn spread(&self, eta: &[f64]) -> Vec<f64> {
        self.motions.product(eta)
    }

    /// The entries of Gᵀ in the row of a multiplier.
    pub fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> {
        let (cols, values) = self.motions.row(i);
        cols.iter().zip(values).map(|(&j, v)| (j as usize, v[0][0]))
    }

    /// The coefficients of the motions for an η, so that B R times them is [`Balance::spread`].
    pub fn coefficients(&self, eta: &[f64]) -> Vec<f64> {
        let lengths = eta.iter().zip(&self.lengths);
        lengths
            .map(|(v, &l)| if l > 0.0 { v / l } else { 0.0 })
            .collect()
    }

    /// The η of coefficients: [`Balance::coefficients`] backwards.
    pub fn eta(&self, coefficients: &[f64]) -> Vec<f64> {
        (coefficients.iter().zip(&self.lengths))
            .map(|(v, l)| v * l)
            .collect()
    }

    /// The forces that act on each motion, if the contact forces are λ. They are those of its body, because a motion
    /// without a share in any of them has to be balanced too, and those of bodies beside it.
    fn scales(&self, lambda: &[f64]) -> Vec<Scale> {
        let mut sums = vec![0.0_f64; self.shares.n_cols()];
        for (&body, &acting) in self.body.iter().zip(&self.acting) {
            sums[body] = sums[body].max(acting);
        }
        let sizes: Vec<f64> = lambda.iter().map(|l| l.abs()).collect();
        self.shares.mul_transpose_add(1.0, &sizes, &mut sums);
        let mut beside = vec![0.0_f64; sums.len()];
        for i in 0..self.shares.n_rows() {
            let (bodies, shares) = self.shares.row(i);
            let shares: Vec<f64> = shares.iter().map(|v| v[0][0]).collect();
            let least = INDEPENDENT * norm_max(&shares);
            let all = || bodies.iter().zip(&shares).filter(|(_, s)| **s > least);
            // The multiplier is as large as the forces on either body allow.
            let most = all().fold(0.0_f64, |most, (&b, s)| most.max(sums[b as usize] / s));
            for (&b, s) in all().filter(|_| bodies.len() > 1) {
                beside[b as usize] = beside[b as usize].max(s * most);
            }
        }
        (self.body.iter().zip(&self.lengths))
            .map(|(&body, &l)| match l > 0.0 {
                true => Scale {
                    own: sums[body] / l,
                    beside: beside[body] / l,
                },
                false => Scale::default(),
            })
            .collect()
    }

    /// Gᵀ is `motions`, so this is Gλ − e.
    pub fn excess(&self, lambda: &[f64]) -> Vec<f64> {
        let mut sums: Vec<f64> = self.e.iter().map(|e| -e).collect();
        self.motions.mul_transpose_add(1.0, lambda, &mut sums);
        sums
    }

    /// Whether an imbalance is no more than the rounding of contact forces with these terms.
    fn is_rounding(&self, imbalance: &[f64], terms: &[f64]) -> bool {
        let scales = self.scales(terms);
        (imbalance.iter().zip(&scales)).all(|(v, scale)| v.abs() <= scale.rounding())
    }

    /// The point of Λₑ nearest to x, or the one of Λ with the least imbalance; `project` is P_Λ on a contact node.
    pub fn nearest<const D: usize>(
        &self,
        x: &[f64],
        project: impl Fn(usize, [f64; D]) -> Projected<D>,
    ) -> Nearest {
        let k = self.count();
        let mut now = Trial::at(vec![0.0; k], x.to_vec(), &project);
        let without = self.scales(&vec![0.0; x.len()]);
        let acting = without
            .iter()
            .fold(0.0_f64, |most, scale| most.max(scale.own));
        // A motion without resistance takes up the rounding of the slope divided by this, which must not come back larger.
        let least = self.curvature.min(100.0 * ROUNDING);
        let curvature = (self.curvature * acting / norm_max(x).max(acting)).max(least);
        let mut before = f64::INFINITY;
        loop {
            let start = now.eta.clone();
            now = self.pass(now, curvature, &project);
            let left = self.excess(&now.lambda);
            if self.is_rounding(&left, &now.lambda) {
                break;
            }
            // The imbalance of a body that nothing holds stays, pass by pass; that of a slab on a foot of 1e-5 of it falls, but
            // not by a half. There, and where only λ = 0 balances a ring on a polygon, the passes would go on in the same
            // direction for a long time.
            let size = norm_max(&left);
            if !(size < 0.9 * before) {
                break;
            }
            if before < f64::INFINITY {
                now = self.farther(now, &start, &project);
            }
            before = size;
        }
        if self.refines {
            self.refine(&mut now, &project);
        }
        let Trial {
            eta, mut lambda, ..
        } = now;
        // Without a load, forces below the rounding of x count as zero. Open nodes have no part in it, however far apart.
        let m = x.len() / D;
        let is_apart = |i: usize| i < m && x[i] < 0.0 && lambda[i] == 0.0;
        let near = x.iter().enumerate().filter(|&(i, _)| !is_apart(i));
        let left_of = near.fold(0.0_f64, |most, (_, x)| most.max(x.abs()));
        if self.e.iter().all(|&e| e == 0.0) && norm_max(&lambda) <= ROUNDING * left_of {
            lambda.fill(0.0);
        }
        let balanced =
            self.is_met(&lambda, BALANCED) && self.without_contact.iter().all(|&e| e == 0.0);
        let imbalance = (self.excess(&lambda).iter().zip(&self.lengths))
            .zip(&self.without_contact)
            .map(|((v, l), alone)| -v * l + alone)
            .collect();
        Nearest {
            imbalance,
            motion: self.mechanism(&lambda),
            lambda,
            eta,
            balanced,
        }
    }

    /// The minimum of φ with that much more curvature around the initial η.
    fn pass<const D: usize>(
        &self,
        mut now: Trial<D>,
        curvature: f64,
        project: impl Fn(usize, [f64; D]) -> Projected<D>,
    ) -> Trial<D> {
        let anchor = now.eta.clone();
        let slope_at = |trial: &Trial<D>| {
            let mut slope = self.excess(&trial.lambda);
            for ((slope, eta), anchor) in slope.iter_mut().zip(&trial.eta).zip(&anchor) {
                *slope += curvature * (eta - anchor);
            }
            slope
        };
        let mut slope = slope_at(&now);
        for _ in 0..STEPS {
            if self.is_rounding(&slope, &now.terms) {
                break;
            }
            let direction = self.newton_direction(&now.derivatives, &slope, curvature);
            let along = self.spread(&direction);
            let mut trial = None;
            let t = where_it_turns(dot(&direction, &slope), |t| {
                let there = trial.insert(now.after(t, &direction, &along, &project));
                slope = slope_at(there);
                dot(&direction, &slope)
            });
            match trial {
                Some(there) if t > 0.0 => now = there,
                _ => break,
            }
        }
        now
    }

    /// Balances the bodies to rounding with the sets as they are. Where only a soft spring stops a body that slides, z is so far beyond
    /// the edges of cones that its projections are only known to its own rounding; small changes of λ are known better.
    fn refine<const D: usize>(
        &self,
        now: &mut Trial<D>,
        project: impl Fn(usize, [f64; D]) -> Projected<D>,
    ) {
        /// Steps: each leaves the rounding of z as a part of the imbalance before.
        const STEPS: usize = 3;
        for _ in 0..STEPS {
            let left = self.excess(&now.lambda);
            if self.is_rounding(&left, &now.lambda) {
                break;
            }
            let along = self.spread(&self.newton_direction(&now.derivatives, &left, 0.0));
            let mut lambda = now.lambda.clone();
            let stays = now.derivatives.iter().enumerate().all(|(i, derivative)| {
                let (before, along): ([f64; D], [f64; D]) = (at(&now.lambda, i), at(&along, i));
                let change = derivative.map(|row| (0..D).map(|a| row[a] * along[a]).sum::<f64>());
                let new = from_fn(|a| before[a] + change[a]);
                let (nearest, _) = project(i, new);
                put(&mut lambda, i, nearest);
                let size = norm_max(&new) + norm_max(&before);
                (0..D).all(|a| (nearest[a] - new[a]).abs() <= ROUNDING * size)
            });
            if !stays || !(norm_max(&self.excess(&lambda)) < norm_max(&left)) {
                break;
            }
            now.lambda = lambda;
        }
    }

    /// The way from `start` to here again, twice, four times as far, as long as φ falls.
    fn farther<const D: usize>(
        &self,
        mut now: Trial<D>,
        start: &[f64],
        project: impl Fn(usize, [f64; D]) -> Projected<D>,
    ) -> Trial<D> {
        let step: Vec<f64> = now.eta.iter().zip(start).map(|(a, b)| a - b).collect();
        let along = self.spread(&step);
        for doubled in 0..DOUBLINGS {
            let there = now.after((1_u64 << doubled) as f64, &step, &along, &project);
            if dot(&step, &self.excess(&there.lambda)) > 0.0 {
                break;
            }
            now = there;
        }
        now
    }

    /// The remaining imbalance of the nearest forces, as a motion that larger forces would resist if they could. For a
    /// body that moves without touching anything, only that body's motion.
    fn mechanism(&self, lambda: &[f64]) -> Vec<f64> {
        let left: Vec<f64> = self.excess(lambda).iter().map(|v| -v).collect();
        let mut motion = self.coefficients(&left);
        for (j, &alone) in self.without_contact.iter().enumerate() {
            let others = || (0..self.count()).filter(|&k| self.body[k] == self.body[j]);
            if others().any(|k| self.without_contact[k] != 0.0) {
                motion[j] = alone;
            }
        }
        motion
    }

    /// −H⁻¹ slope, with H = G P' Gᵀ and the added curvature.
    fn newton_direction<const D: usize>(
        &self,
        derivatives: &[[[f64; D]; D]],
        slope: &[f64],
        curvature: f64,
    ) -> Vec<f64> {
        let (k, m) = (self.count(), derivatives.len());
        let mut hessian = Mat::<f64>::zeros(k, k);
        for (i, derivative) in derivatives.iter().enumerate() {
            for (a, row) in derivative.iter().enumerate() {
                for (b, &d) in row.iter().enumerate() {
                    if d == 0.0 {
                        continue;
                    }
                    let [left, right] = [a, b].map(|a| self.motions.row(row_of::<D>(m, i, a)));
                    for (&p, v) in left.0.iter().zip(left.1) {
                        for (&q, w) in right.0.iter().zip(right.1) {
                            hessian[(p as usize, q as usize)] += d * v[0][0] * w[0][0];
                        }
                    }
                }
            }
        }
        // By eigenvectors: along motions without resistance only the added curvature acts, and rounding of the other
        // ones must not count as resistance.
        let Some((values, vectors)) = symmetric_eigen(&hessian) else {
            return slope.iter().map(|s| -s).collect();
        };
        let largest = values.iter().copied().fold(0.0, f64::max);
        let mut direction = vec![0.0; k];
        for (c, &value) in values.iter().enumerate() {
            let resists = if value > DEPENDENT * largest {
                value
            } else {
                0.0
            };
            if resists + curvature == 0.0 {
                continue;
            }
            let along: f64 = (0..k).map(|j| vectors[(j, c)] * slope[j]).sum();
            for (j, d) in direction.iter_mut().enumerate() {
                *d -= vectors[(j, c)] * along / (resists + curvature);
            }
        }
        direction
    }

    /// Whether λ balances the bodies up to rounding.
    pub fn holds(&self, lambda: &[f64]) -> bool {
        self.is_met(lambda, 100.0 * ROUNDING)
    }

    /// Whether no imbalance of λ is more than this part of the forces that act, or than the rounding of forces on bodies beside.
    pub fn is_met(&self, lambda: &[f64], part: f64) -> bool {
        let excess = self.excess(lambda);
        let most = |scale: Scale| part * scale.own + 100.0 * ROUNDING * scale.beside;
        (excess.iter().zip(self.scales(lambda))).all(|(v, scale)| v.abs() <= most(scale))
    }

    /// The least forces that balance the bodies. An imbalance that no forces can remove is given up: from here on only
    /// the rest is balanced.
    pub fn least<const D: usize>(
        &mut self,
        project: impl Fn(usize, [f64; D]) -> Projected<D>,
    ) -> Nearest {
        let zero = vec![0.0; self.motions.n_rows()];
        let near = self.nearest(&zero, &project);
        if near.balanced {
            return near;
        }
        self.curvature = ROUNDING;
        for refines in [false, true] {
            self.refines = refines;
            let closer = self.nearest(&zero, &project);
            if closer.balanced {
                return closer;
            }
        }
        (self.curvature, self.refines) = (CURVATURE, false);
        self.give_up(&near.imbalance);
        near
    }

    fn give_up(&mut self, imbalance: &[f64]) {
        for ((e, l), v) in self.e.iter_mut().zip(&self.lengths).zip(imbalance) {
            if *l > 0.0 {
                *e -= v / l;
            }
        }
        self.without_contact.fill(0.0);
    }

    /// G on the free directions of each contact node. The tangential multipliers of node i follow the normal one by
    /// `follows[i]` times the direction of slip where that is not 0 (empty: nowhere).
    pub fn on_face<const D: usize>(
        self: &Rc<Self>,
        nodes: &[NodeSets<D>],
        follows: &[f64],
    ) -> FaceBalance<D> {
        let none = Vec::new();
        let own = |follows: &[f64]| -> Vec<Vec<[f64; D]>> {
            let all = nodes.iter().enumerate();
            all.map(|(i, node)| unknowns(node, follows.get(i).copied().unwrap_or(0.0)))
                .collect()
        };
        let moving = own(follows);
        let free = (!follows.is_empty()).then(|| own(&none));
        FaceBalance {
            balance: Rc::clone(self),
            inverse: self.inverse_gram(&moving),
            residuals: free.map(|free| (self.inverse_gram(&free), free)),
            moving,
        }
    }

    /// (G F Fᵀ Gᵀ)⁺.
    fn inverse_gram<const D: usize>(&self, moving: &[Vec<[f64; D]>]) -> Mat<f64> {
        pseudo_inverse(&self.gram(moving), DEPENDENT)
    }

    /// G F Fᵀ Gᵀ.
    fn gram<const D: usize>(&self, moving: &[Vec<[f64; D]>]) -> Mat<f64> {
        let (k, m) = (self.count(), moving.len());
        let mut gram = Mat::<f64>::zeros(k, k);
        for normal in [true, false] {
            for (i, directions) in moving.iter().enumerate() {
                for v in directions.iter().filter(|v| (v[0] != 0.0) == normal) {
                    let entries = (0..D).filter(|&a| v[a] != 0.0).flat_map(|a| {
                        let (cols, values) = self.motions.row(row_of::<D>(m, i, a));
                        let row = cols.iter().zip(values);
                        row.map(move |(&j, g)| (j as usize, v[a] * g[0][0]))
                    });
                    let row: Vec<(usize, f64)> = entries.collect();
                    for &(p, v) in &row {
                        for &(q, w) in &row {
                            gram[(p, q)] += v * w;
                        }
                    }
                }
            }
        }
        gram
    }
}

/// The motion of a node's multipliers for each of its unknowns: the columns of F.
fn unknowns<const D: usize>(node: &NodeSets<D>, follows: f64) -> Vec<[f64; D]> {
    let s = node.slip.unwrap_or([0.0; D]);
    let normal = node.contact.then(|| {
        from_fn(|a| match a {
            0 => 1.0,
            _ => follows * s[a],
        })
    });
    normal.into_iter().chain(node.tangents()).collect()
}

/// The columns of F or of Z, node by node.
type Columns<const D: usize> = Vec<Vec<[f64; D]>>;

/// G on the free multipliers of a face of Λ.
///
/// A multiplier moves as F y for free y: Z y, except at slipping nodes under Coulomb's law, whose tangential
/// multipliers follow the normal one.
pub(crate) struct FaceBalance<const D: usize> {
    balance: Rc<Balance>,
    /// The columns of F.
    moving: Columns<D>,
    /// (G F Fᵀ Gᵀ)⁺.
    inverse: Mat<f64>,
    /// (G Z Zᵀ Gᵀ)⁺, with the columns of Z, where Z differs from F.
    residuals: Option<(Mat<f64>, Columns<D>)>,
}

impl<const D: usize> FaceBalance<D> {
    /// Orthonormal coefficients of the motions that none of the multipliers resists.
    pub fn free(&self) -> Vec<Vec<f64>> {
        let mut free: Vec<Vec<f64>> = Vec::new();
        let Some((values, vectors)) = symmetric_eigen(&self.balance.gram(&self.moving)) else {
            return free;
        };
        let largest = values.iter().copied().fold(0.0, f64::max);
        for (c, _) in (values.iter().enumerate()).filter(|at| !(*at.1 > DEPENDENT * largest)) {
            let eta: Vec<f64> = (0..values.len()).map(|j| vectors[(j, c)]).collect();
            // A weak resistance is one.
            let moved = self.balance.spread(&eta);
            let m = self.moving.len();
            let along = |i: usize, way: &[f64; D]| {
                let terms = (0..D).map(|a| way[a] * moved[row_of::<D>(m, i, a)]);
                terms.sum::<f64>().abs()
            };
            let each = self.moving.iter().enumerate();
            let mut each = each.flat_map(|(i, ways)| ways.iter().map(move |way| (i, way)));
            if each.any(|(i, way)| along(i, way) > RESISTS) {
                continue;
            }
            let mut way = self.balance.coefficients(&eta);
            let size = norm(&way);
            for _ in 0..2 {
                for other in &free {
                    add_times(-dot(other, &way), other, &mut way);
                }
            }
            let left = norm(&way);
            // Motions without any entry have no coefficient.
            if left > INDEPENDENT * size {
                way.iter_mut().for_each(|v| *v /= left);
                free.push(way);
            }
        }
        free
    }

    /// Adds the shortest F y that changes Gλ by `change`.
    fn shift(&self, change: &[f64], lambda: &mut [f64]) {
        let forces = self.balance.spread(&times(&self.inverse, change));
        add_allowed(&self.moving, &forces, lambda);
    }

    /// Removes the part of p = F y that changes Gλ.
    pub fn project(&self, p: &mut [f64]) {
        for _ in 0..2 {
            let mut moved = vec![0.0; self.balance.count()];
            (self.balance.motions).mul_transpose_add(-1.0, p, &mut moved);
            self.shift(&moved, p);
        }
    }

    /// Removes the part of r, zero on the held multipliers, that motions of the bodies can cancel.
    pub fn project_residual(&self, r: &mut [f64]) {
        let (inverse, free) = match &self.residuals {
            Some((inverse, free)) => (inverse, free),
            None => (&self.inverse, &self.moving),
        };
        for _ in 0..2 {
            let mut moved = vec![0.0; self.balance.count()];
            (self.balance.motions).mul_transpose_add(-1.0, r, &mut moved);
            let forces = self.balance.spread(&times(inverse, &moved));
            add_allowed(free, &forces, r);
        }
    }

    /// Balances λ by its free multipliers; false if they cannot. A balanced λ stays unchanged.
    pub fn balance(&self, lambda: &mut [f64]) -> bool {
        for _ in 0..3 {
            if self.balance.holds(lambda) {
                return true;
            }
            let missing: Vec<f64> = self.balance.excess(lambda).iter().map(|v| -v).collect();
            self.shift(&missing, lambda);
        }
        self.balance.is_met(lambda, BALANCED)
    }
}

/// λ += F Fᵀ f.
fn add_allowed<const D: usize>(moving: &[Vec<[f64; D]>], forces: &[f64], lambda: &mut [f64]) {
    for (i, directions) in moving.iter().enumerate() {
        let force: [f64; D] = at(forces, i);
        let mut sum: [f64; D] = at(lambda, i);
        for v in directions {
            let y = (1..D).fold(v[0] * force[0], |sum, a| sum + v[a] * force[a]);
            (0..D).for_each(|a| sum[a] += v[a] * y);
        }
        put(lambda, i, sum);
    }
}

fn times(matrix: &Mat<f64>, x: &[f64]) -> Vec<f64> {
    (0..matrix.nrows())
        .map(|p| (0..x.len()).map(|q| matrix[(p, q)] * x[q]).sum())
        .collect()
}

/// A point near the zero of a function that rises from `first` < 0 at 0; the function is evaluated there last.
fn where_it_turns(first: f64, mut rise: impl FnMut(f64) -> f64) -> f64 {
    if !(first < 0.0) {
        return 0.0;
    }
    let small = SEARCHED * -first;
    let (mut low, mut at_low) = (0.0, first);
    let (mut high, mut at_high) = (1.0, rise(1.0));
    for _ in 0..STEPS {
        if !(at_high < -small) {
            break;
        }
        (low, at_low) = (high, at_high);
        high *= 2.0;
        at_high = rise(high);
    }
    // False position with the Illinois rule.
    let mut t = high;
    let mut at = at_high;
    let mut last = 0;
    for _ in 0..STEPS {
        if at.abs() <= small || !(low < high) {
            break;
        }
        t = (low * at_high - high * at_low) / (at_high - at_low);
        if !(t > low && t < high) {
            t = 0.5 * (low + high);
        }
        at = rise(t);
        if at < 0.0 {
            (low, at_low) = (t, at);
            if last == -1 {
                at_high *= 0.5;
            }
            last = -1;
        } else {
            (high, at_high) = (t, at);
            if last == 1 {
                at_low *= 0.5;
            }
            last = 1;
        }
    }
    t
}

#[cfg(test)]
mod tests;
