//! The admissible multipliers of one contact node: the convex sets whose product is Λ, and Coulomb's cone.
//!
//! In D dimensions a node has D multipliers: λν, and D − 1 of λτ along its tangents. ‖λτ‖ ≤ g is a disc in space and an
//! interval in the plane. In the plane all of this gives (4), (5) and Step 2 as printed, to the last bit: the direction
//! λτ/‖λτ‖ is ±1 there.

use crate::rounding::ROUNDING;
use std::array::from_fn;

/// A nearest point and its derivatives with respect to the data.
pub(crate) type Projected<const D: usize> = ([f64; D], [[f64; D]; D]);

/// The row of multiplier a of contact node i (of m) in λ = (λν, λτ). The normal one is for a = 0; then come those along
/// the D − 1 tangents, which are adjacent.
pub(crate) fn row_of<const D: usize>(m: usize, i: usize, a: usize) -> usize {
    match a {
        0 => i,
        _ => m + (D - 1) * i + a - 1,
    }
}

/// The contact node (of m) of a row of λ.
pub(crate) fn node_of<const D: usize>(m: usize, row: usize) -> usize {
    row.checked_sub(m).map_or(row, |row| row / (D - 1))
}

/// The entries of contact node i of a vector as long as λ.
pub(crate) fn at<const D: usize>(x: &[f64], i: usize) -> [f64; D] {
    from_fn(|a| x[row_of::<D>(x.len() / D, i, a)])
}

/// Sets the entries of contact node i.
pub(crate) fn put<const D: usize>(x: &mut [f64], i: usize, entries: [f64; D]) {
    let m = x.len() / D;
    for (a, entry) in entries.into_iter().enumerate() {
        x[row_of::<D>(m, i, a)] = entry;
    }
}

/// The sets of Step 2 that a contact node is in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NodeSets<const D: usize> {
    /// 𝒜ν; ℐν otherwise, where λν = 0.
    pub contact: bool,
    /// ℐτ, where λτ = g times this direction (of length one, without a normal part); None in 𝒜τ.
    pub slip: Option<[f64; D]>,
    /// Whether a λτ in ℐτ can still turn: on a circle, not on the two ends of an interval and not where g = 0.
    pub turns: bool,
}

impl<const D: usize> NodeSets<D> {
    /// In contact and sticking: nothing is held.
    pub const FREE: Self = Self {
        contact: true,
        slip: None,
        turns: false,
    };

    /// The tangents along which λτ is free: all in 𝒜τ; in ℐτ the one across the slip where it turns, along the circle
    /// to first order.
    pub fn tangents(&self) -> impl Iterator<Item = [f64; D]> + use<D> {
        let Self { slip, turns, .. } = *self;
        let axes = (1..D).filter_map(move |axis| {
            let unit = from_fn(|a| f64::from(u8::from(a == axis)));
            slip.is_none().then_some(unit)
        });
        let across = slip.filter(|_| turns && D == 3).map(|s| {
            from_fn(|a| match a {
                1 => -s[2],
                2 => s[1],
                _ => 0.0,
            })
        });
        axes.chain(across)
    }

    /// Holds λτ where its bound will be 0.
    pub fn hold_tangents(&mut self) {
        self.slip = Some(direction([0.0; D], 1.0));
        self.turns = false;
    }

    /// The free part of x: zero on held components.
    pub fn free_part(&self, mut x: [f64; D]) -> [f64; D] {
        if !self.contact {
            x[0] = 0.0;
        }
        if let Some(s) = self.slip {
            let along: f64 = (1..D).map(|a| s[a] * x[a]).sum();
            for a in 1..D {
                x[a] = if self.turns { x[a] - along * s[a] } else { 0.0 };
            }
        }
        x
    }

    /// The number of free multipliers.
    pub fn n_free(&self) -> usize {
        usize::from(self.contact) + self.tangents().count()
    }

    /// The number of differences in the two sets, 𝒜ν or ℐν and 𝒜τ or ℐτ. Slip in the opposite direction is another set,
    /// slip in a direction that has turned is not.
    pub fn differences(&self, other: &Self) -> usize {
        let slips = match (self.slip, other.slip) {
            (None, None) => true,
            (Some(s), Some(o)) => (1..D).map(|a| s[a] * o[a]).sum::<f64>() > 0.0,
            _ => false,
        };
        usize::from(self.contact != other.contact) + usize::from(!slips)
    }

    /// Takes the node for one that slips this way, if it was not.
    pub fn slide(&mut self, slip: [f64; D]) {
        if self.slip.is_none() {
            self.slip = Some(direction(slip, 1.0));
            self.turns = D > 2;
        }
    }

    /// Puts held components on their bound; `bound` gives the bound of λτ for a λν.
    pub fn hold(&self, mut lambda: [f64; D], bound: impl Fn(f64) -> f64) -> [f64; D] {
        if !self.contact {
            lambda[0] = 0.0;
        }
        if let Some(direction) = self.slip {
            let g = bound(lambda[0]);
            for a in 1..D {
                lambda[a] = g * direction[a];
            }
        }
        lambda
    }
}

/// The bound of a tied node, whose multipliers are free in every direction.
pub(crate) const TIED: f64 = f64::INFINITY;

/// The source of the slip bound of a contact node: its law.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
pub enum SlipBound {
    /// A given force (Tresca; 0 without friction).
    Given(f64),
    /// This coefficient times the normal force (Coulomb).
    Coulomb(f64),
    /// None: the place is tied to the other side.
    Tied,
}

impl SlipBound {
    /// Whether it allows any friction.
    pub fn is_any(&self) -> bool {
        match *self {
            Self::Given(figure) | Self::Coulomb(figure) => figure > 0.0,
            Self::Tied => true,
        }
    }

    /// The law of a node with these entries in the vectors of slip bounds and coefficients: the bound counts where μ is 0.
    pub(crate) fn of(given: f64, mu: f64) -> Self {
        match given {
            _ if mu > 0.0 => Self::Coulomb(mu),
            TIED => Self::Tied,
            bound => Self::Given(bound),
        }
    }

    /// Its entries in these vectors.
    pub(crate) fn entries(self) -> (f64, f64) {
        match self {
            Self::Given(bound) => (bound, 0.0),
            Self::Coulomb(mu) => (0.0, mu),
            Self::Tied => (TIED, 0.0),
        }
    }

    /// μ, 0 where the bound is given.
    pub(crate) fn mu(self) -> f64 {
        self.entries().1
    }

    /// The multipliers that it permits beside the normal one λν.
    pub(crate) fn disc(self, normal: f64) -> Disc {
        Disc {
            g: match self {
                Self::Coulomb(mu) => mu * normal.max(0.0),
                _ => self.entries().0,
            },
        }
    }

    /// The nearest multipliers that obey the law: those of Coulomb's cone, or of a disc.
    pub(crate) fn nearest<const D: usize>(self, z: [f64; D]) -> Projected<D> {
        match self {
            Self::Coulomb(mu) => cone(mu, z),
            _ => self.disc(0.0).nearest(z),
        }
    }

    /// The multipliers that solve the contact problem of a node with the identity for A: λν = max(0, zν), then λτ within its bound
    /// next to zτ; with the derivative.
    pub(crate) fn solve<const D: usize>(self, z: [f64; D]) -> Projected<D> {
        let disc = self.disc(z[0]);
        let (end, mut derivative) = disc.nearest(z);
        let length = tangential(z);
        if self.mu() > 0.0 && z[0] > 0.0 && length > disc.g {
            // λτ = μλν s: the bound moves with λν.
            for a in 1..D {
                derivative[a][0] = self.mu() * z[a] / length;
            }
        }
        (end, derivative)
    }
}

/// λν ≥ 0 and ‖λτ‖ ≤ g, with the bound g given: Λ on one node. With g = [`TIED`] all multipliers are allowed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Disc {
    pub g: f64,
}

impl Disc {
    /// Whether the node is tied.
    pub fn is_tied(self) -> bool {
        self.g == TIED
    }

    /// P_Λ: the projections (4) and (5).
    ///
    /// The sum of max-functions in (5) is the clamp to [−g, g]; a clamp leaves interior points exactly as they are.
    pub fn project<const D: usize>(self, z: [f64; D]) -> [f64; D] {
        self.nearest(z).0
    }

    /// P_Λ with its derivative.
    pub fn nearest<const D: usize>(self, z: [f64; D]) -> Projected<D> {
        let (mut end, mut derivative) = (z, [[0.0; D]; D]);
        if self.is_tied() {
            (0..D).for_each(|a| derivative[a][a] = 1.0);
            return (end, derivative);
        }
        end[0] = z[0].max(0.0);
        derivative[0][0] = f64::from(u8::from(z[0] > 0.0));
        let length = tangential(z);
        if length < self.g {
            (1..D).for_each(|a| derivative[a][a] = 1.0);
        } else if length >= self.g && length > 0.0 {
            let s = direction(z, 1.0);
            for a in 1..D {
                if length > self.g {
                    end[a] = self.g * s[a];
                }
                for b in 1..D {
                    let identity = f64::from(u8::from(a == b));
                    derivative[a][b] = self.g / length * (identity - s[a] * s[b]);
                }
            }
        }
        (end, derivative)
    }

    /// The sets that z = λ − ρr predicts (Step 2). A λτ with g = 0 has no freedom and is always held.
    pub fn predict<const D: usize>(self, z: [f64; D]) -> NodeSets<D> {
        let slips = tangential(z) > self.g || self.g == 0.0;
        self.sets(z[0] >= 0.0, slips.then(|| direction(z, -1.0)))
    }

    /// The components of λ ∈ Λ that are on a bound and that a step against the gradient r would push out.
    pub fn binding<const D: usize>(self, lambda: [f64; D], r: [f64; D]) -> NodeSets<D> {
        let s = direction(lambda, 1.0);
        let along: f64 = (1..D).map(|a| s[a] * r[a]).sum();
        let pushed = self.at_bound(lambda) && (along <= 0.0 || self.g == 0.0);
        self.sets(!(lambda[0] <= 0.0 && r[0] >= 0.0), pushed.then_some(s))
    }

    /// The sets at a solution λ ∈ Λ with gradient r. Up to the tolerance, points within the disc are as good as those
    /// on its border, so the prediction z = λ − ρr decides the set of λτ. Where g = 0, the direction of slip r = −Tu
    /// does.
    pub fn at_solution<const D: usize>(
        self,
        lambda: [f64; D],
        r: [f64; D],
        z: [f64; D],
    ) -> NodeSets<D> {
        let mut sets = if self.g == 0.0 {
            let slips = tangential(r) > 0.0;
            self.sets(z[0] >= 0.0, slips.then(|| direction(r, -1.0).map(|s| -s)))
        } else {
            self.predict(z)
        };
        sets.contact &= lambda[0] > 0.0 || self.is_tied();
        sets
    }

    fn sets<const D: usize>(self, contact: bool, slip: Option<[f64; D]>) -> NodeSets<D> {
        if self.is_tied() {
            return NodeSets::FREE;
        }
        NodeSets {
            contact,
            slip,
            turns: D > 2 && self.g > 0.0 && slip.is_some(),
        }
    }

    /// Whether λτ is on its bound: in space up to rounding, because its length is a square root.
    pub fn at_bound<const D: usize>(self, lambda: [f64; D]) -> bool {
        let within = if D == 2 { 1.0 } else { 1.0 - ROUNDING };
        !(tangential(lambda) < within * self.g)
    }

    /// The sets of Step 2 with the direction of slip that a λτ on its circle has already, unless it is to reverse.
    /// Newton's step turns it along the tangent; moving it elsewhere first would cost a product.
    pub fn predict_from<const D: usize>(self, lambda: [f64; D], z: [f64; D]) -> NodeSets<D> {
        let mut sets = self.predict(z);
        if let Some(s) = &mut sets.slip
            && sets.turns
            && self.at_bound(lambda)
        {
            let here = direction(lambda, 1.0);
            if (1..D).map(|a| here[a] * s[a]).sum::<f64>() > 0.0 {
                *s = here;
            }
        }
        sets
    }
}

/// The nearest point of Coulomb's cone, ‖λτ‖ ≤ μλν.
fn cone<const D: usize>(mu: f64, z: [f64; D]) -> Projected<D> {
    let length = tangential(z);
    if z[0] > 0.0 && length <= mu * z[0] {
        let identity = from_fn(|a| from_fn(|b| f64::from(u8::from(a == b))));
        return (z, identity);
    }
    if z[0] <= -mu * length {
        return ([0.0; D], [[0.0; D]; D]);
    }
    let s = direction(z, 1.0);
    let mut edge = s.map(|s| mu * s);
    edge[0] = 1.0;
    let square = 1.0 + mu * mu;
    let along = (1..D).fold(z[0], |sum, a| sum + edge[a] * z[a]) / square;
    let turn = mu * along / length;
    let derivative = from_fn(|a| {
        from_fn(|b| {
            let own = edge[a] * edge[b] / square;
            if D == 2 || a == 0 || b == 0 {
                return own;
            }
            // The edge turns with z.
            let identity = f64::from(u8::from(a == b));
            own + turn * (identity - s[a] * s[b])
        })
    });
    (edge.map(|e| e * along), derivative)
}

/// ‖λτ‖.
pub(crate) fn tangential<const D: usize>(z: [f64; D]) -> f64 {
    match D {
        2 => z[1].abs(),
        // hypot takes several times as long, and this runs for every disc.
        _ => match z[1..].iter().map(|t| t * t).sum::<f64>() {
            square if square.is_normal() => square.sqrt(),
            _ => z[1..].iter().fold(0.0, |sum: f64, t| sum.hypot(*t)),
        },
    }
}

/// λτ/‖λτ‖ without a normal part, and `otherwise` (±1) along the first tangent where λτ = 0.
fn direction<const D: usize>(z: [f64; D], otherwise: f64) -> [f64; D] {
    let length = tangential(z);
    from_fn(|a| match a {
        0 => 0.0,
        1 if !(length > 0.0) => otherwise,
        _ if !(length > 0.0) => 0.0,
        // In the plane always.
        _ if z[a].abs() == length => 1.0_f64.copysign(z[a]),
        _ => z[a] / length,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers without any pattern, between −2 and 2.
    fn arbitrary<const D: usize>(seed: usize) -> [f64; D] {
        from_fn(|a| 2.0 * ((7 * seed + 13 * a + seed * a + 1) as f64).sin())
    }

    /// Nearest, idempotent, and with the right derivative.
    fn check_projection<const D: usize>(project: impl Fn([f64; D]) -> Projected<D>) {
        const STEP: f64 = 1e-6;
        for seed in 0..200 {
            let z = arbitrary::<D>(seed);
            let (p, derivative) = project(z);
            let again = project(p).0;
            for a in 0..D {
                assert!((again[a] - p[a]).abs() < 1e-14, "{z:?}");
            }
            for other in 200..240 {
                // (z − p)ᵀ(x − p) ≤ 0 for all x of the set: no point of it is nearer.
                let x = project(arbitrary::<D>(other)).0;
                let slope: f64 = (0..D).map(|a| (z[a] - p[a]) * (x[a] - p[a])).sum();
                assert!(slope < 1e-12, "{z:?}: {slope}");
            }
            for b in 0..D {
                let moved = |step: f64| {
                    let mut there = z;
                    there[b] += step;
                    project(there)
                };
                let (ahead, behind) = (moved(STEP), moved(-STEP));
                for a in 0..D {
                    let difference = (ahead.0[a] - behind.0[a]) / (2.0 * STEP);
                    // Except at kinks.
                    let kink = (ahead.1[a][b] - behind.1[a][b]).abs() > 1e-3;
                    let off = (derivative[a][b] - difference).abs();
                    assert!(off < 1e-6 || kink, "{z:?}: {a}, {b}: {off}");
                }
            }
        }
    }

    #[test]
    fn projections_are_nearest_and_have_their_derivative() {
        for g in [0.0, 0.3, 1.2, TIED] {
            check_projection::<2>(|z| Disc { g }.nearest(z));
            check_projection::<3>(|z| Disc { g }.nearest(z));
        }
        for mu in [0.1, 0.6, 2.0] {
            check_projection::<2>(|z| cone(mu, z));
            check_projection::<3>(|z| cone(mu, z));
        }
    }

    /// (4) and (5) and the sets of Step 2 as they are printed.
    #[test]
    fn in_the_plane_it_agrees_with_the_paper() {
        let printed = |t: f64, g: f64| 0.0_f64.max(t + g) - 0.0_f64.max(t - g) - g;
        for seed in 0..200 {
            let z = arbitrary::<2>(seed);
            for g in [0.0, 0.5, 1.0] {
                let disc = Disc { g };
                let [n, t] = disc.project(z);
                assert_eq!((n, t), (z[0].max(0.0), z[1].clamp(-g, g)));
                assert!((t - printed(z[1], g)).abs() < 1e-15);
                let sets = disc.predict(z);
                assert_eq!(sets.contact, z[0] >= 0.0);
                let slip = [z[1] > g, z[1] < -g];
                let expected = (slip[0] || slip[1]).then(|| [0.0, z[1].signum()]);
                assert_eq!(sets.slip, expected);
                if sets.slip.is_some() {
                    assert_eq!(sets.hold(z, |_| g)[1], t);
                }
            }
        }
    }

    /// The free directions of a node are orthonormal, and no held direction is among them.
    #[test]
    fn free_directions_make_a_frame() {
        fn check<const D: usize>() {
            let dot = |x: [f64; D], y: [f64; D]| (0..D).map(|a| x[a] * y[a]).sum::<f64>();
            for seed in 0..100 {
                let z = arbitrary::<D>(seed);
                for g in [0.0, 0.4, 9.0] {
                    let sets = Disc { g }.predict(z);
                    assert_eq!(sets.turns, D == 3 && g == 0.4 && sets.slip.is_some());
                    let mut free: Vec<[f64; D]> = sets.tangents().collect();
                    for t in &free {
                        let across = sets.slip.filter(|_| sets.turns).map_or(0.0, |s| dot(s, *t));
                        assert!(t[0] == 0.0 && across.abs() < 1e-15);
                    }
                    if sets.contact {
                        free.push(from_fn(|a| f64::from(u8::from(a == 0))));
                    }
                    assert_eq!(sets.n_free(), free.len());
                    for (i, a) in free.iter().enumerate() {
                        for (j, b) in free.iter().enumerate() {
                            let expected = f64::from(u8::from(i == j));
                            assert!((dot(*a, *b) - expected).abs() < 1e-15);
                        }
                    }
                    let x = arbitrary::<D>(seed + 500);
                    let part: [f64; D] = from_fn(|a| free.iter().map(|v| v[a] * dot(*v, x)).sum());
                    let found = sets.free_part(x);
                    assert!((0..D).all(|a| (found[a] - part[a]).abs() < 1e-15));
                }
            }
        }
        check::<2>();
        check::<3>();
    }

    #[test]
    fn slip_continues_in_its_direction_until_it_reverses() {
        let disc = Disc { g: 2.0 };
        let on_circle = [1.0, 2.0 * 0.6, 2.0 * 0.8];
        let slip = |lambda: [f64; 3], z: [f64; 3]| {
            let s = disc.predict_from(lambda, z).slip.expect("z is outside");
            [s[1], s[2]]
        };
        assert_eq!(slip(on_circle, [1.0, 3.0, 0.0]), [0.6, 0.8]);
        assert_eq!(slip(on_circle, [1.0, -3.0, 0.0]), [-1.0, 0.0]);
        assert_eq!(slip([1.0, 1.0, 0.0], [1.0, 0.0, 3.0]), [0.0, 1.0]);
        // Slip in a direction that has turned is the same set, slip back is another one.
        let of = |z: [f64; 3]| disc.predict(z);
        let ahead = of([1.0, 3.0, 0.0]);
        assert_eq!(ahead.differences(&of([1.0, 2.0, 2.0])), 0);
        assert_eq!(ahead.differences(&of([1.0, -2.0, 2.0])), 1);
        assert_eq!(ahead.differences(&of([-1.0, 0.0, 1.0])), 2);
    }

    #[test]
    fn tangents_of_a_node_lie_side_by_side() {
        let mut x: Vec<f64> = (0..6).map(f64::from).collect();
        assert_eq!(at::<3>(&x, 1), [1.0, 4.0, 5.0]);
        assert_eq!(at::<2>(&x, 1), [1.0, 4.0]);
        put(&mut x, 0, [9.0, 8.0, 7.0]);
        assert_eq!(x, [9.0, 1.0, 8.0, 7.0, 4.0, 5.0]);
    }
}
