//! Problems whose solution is chosen first, in the plane and in space (validation by construction).

use super::Random;
use crate::common::or_panic::OrPanic as _;
use signorini::problem::{ContactData, ContactProblem};
use signorini::sparse::{BlockCsr, Csr};
use signorini::ssnm::Solution;

/// The friction state of a contact node. An angle is a direction within the tangent plane; in two dimensions its cosine
/// has the sign of the one tangent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Friction {
    /// ‖λτ‖ < g.
    Sticks,
    /// ‖λτ‖ = g, in the direction of this angle, as the slip.
    Slips(f64),
    /// ‖λτ‖ = g in this direction, without any slip.
    OnTheVerge(f64),
    /// λτ = 0 without slip, g > 0.
    Idle,
    /// g = 0.
    None,
}

impl Friction {
    /// Sticks or slips, forwards or backwards.
    pub const WAYS: [Self; 3] = [
        Self::Sticks,
        Self::Slips(0.0),
        Self::Slips(std::f64::consts::PI),
    ];

    /// Whether strict complementarity determines its set.
    fn is_clear(self) -> bool {
        !matches!(self, Self::OnTheVerge(_) | Self::None)
    }
}

/// The state of a contact node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    pub separated: bool,
    pub friction: Friction,
}

impl Node {
    /// Any of those with strict complementarity: one of three is separated, two of three slip.
    pub fn any(random: &mut Random) -> Self {
        Self {
            separated: random.below(3) == 0,
            friction: Friction::WAYS[random.below(3)],
        }
    }
}

/// A contact problem with its solution.
pub struct Manufactured<const D: usize = 2> {
    pub problem: ContactProblem<D>,
    pub u: Vec<f64>,
    pub lambda: Vec<f64>,
    pub nodes: Vec<Node>,
}

type Row = Vec<(usize, f64)>;

fn times(row: &Row, u: &[f64]) -> f64 {
    row.iter().map(|&(j, v)| v * u[j]).sum()
}

fn matrix(rows: &[Row], n: usize) -> Csr {
    let all = rows.iter().enumerate();
    let entries = all.flat_map(|(i, row)| row.iter().map(move |&(j, v)| (i, j, v)));
    Csr::from_triplets(rows.len(), n, entries)
}

/// Chooses u*, λ* and the sets, then f, d and g so that (1)–(3) hold, with strict complementarity except for nodes that
/// are on the verge or idle.
///
/// K is the matrix of a random network of springs, held to the ground here and there, on `n` unknowns; the rows of N and
/// T select unknowns, or are general sparse ones.
pub fn manufactured<const D: usize>(
    n: usize,
    nodes: &[Node],
    general: bool,
    random: &mut Random,
) -> Manufactured<D> {
    let (m, tangents) = (nodes.len(), D - 1);
    assert!(D * m <= n);
    let mut entries = Vec::new();
    for i in 0..n {
        entries.push((i, i, if random.unit() < 0.1 { 1.0 } else { 1e-2 }));
        for _ in 0..3 {
            let j = random.below(n);
            if i != j {
                let k = random.between(0.1, 2.0);
                entries.extend([(i, i, k), (j, j, k), (i, j, -k), (j, i, -k)]);
            }
        }
    }
    let k = BlockCsr::<D>::from_triplets(n, n, entries);
    // Any D m different unknowns are the pivots of the rows.
    let mut order: Vec<usize> = (0..n).collect();
    for i in 0..n {
        order.swap(i, i + random.below(n - i));
    }
    let mut row = |pivot: usize| -> Row {
        let mut row = vec![(pivot, 1.0)];
        // The pivots are dominant, so that B has full row rank.
        for _ in 0..if general { 3 } else { 0 } {
            let j = random.below(n);
            if row.iter().all(|&(i, _)| i != j) {
                row.push((j, random.between(-0.2, 0.2)));
            }
        }
        row
    };
    let normal: Vec<Row> = (0..m).map(|i| row(order[i])).collect();
    let tangential: Vec<Row> = (m..D * m).map(|i| row(order[i])).collect();
    let mut u: Vec<f64> = (0..n).map(|_| random.between(-1.0, 1.0)).collect();
    let mut slips = vec![0.0; tangents * m];
    let (mut lambda, mut d, mut g) = (vec![0.0; D * m], vec![0.0; m], vec![0.0; m]);
    for (i, node) in nodes.iter().enumerate() {
        g[i] = random.between(0.2, 2.0);
        let (part, angle, slip) = match node.friction {
            Friction::Sticks => (random.between(0.0, 0.9), random.between(0.0, 6.0), 0.0),
            Friction::Slips(angle) => (1.0, angle, random.between(0.1, 1.0)),
            Friction::OnTheVerge(angle) => (1.0, angle, 0.0),
            Friction::Idle => (0.0, 0.0, 0.0),
            Friction::None => {
                g[i] = 0.0;
                (0.0, random.between(0.0, 6.0), random.between(0.0, 1.0))
            }
        };
        let (sin, cos) = angle.sin_cos();
        let direction = if D == 2 {
            [cos.signum(), 0.0]
        } else {
            [cos, sin]
        };
        for (a, s) in direction.into_iter().take(tangents).enumerate() {
            lambda[m + tangents * i + a] = part * g[i] * s;
            slips[tangents * i + a] = slip * s;
        }
    }
    // d ≥ 0 asks for N u* ≥ 0 in contact: sweeps over the pivots arrange that, and T u* as it was chosen.
    for _ in 0..300 {
        for i in 0..m {
            let now = times(&normal[i], &u);
            if now < 0.1 {
                u[order[i]] += 0.1 + 0.5 * (i % 3) as f64 - now;
            }
        }
        for i in 0..tangents * m {
            u[order[m + i]] += slips[i] - times(&tangential[i], &u);
        }
    }
    for (i, node) in nodes.iter().enumerate() {
        d[i] = times(&normal[i], &u);
        if node.separated {
            d[i] += random.between(0.1, 1.0);
        } else {
            lambda[i] = random.between(0.2, 2.0);
        }
    }
    let mut f = vec![0.0; k.n_rows()];
    let mut padded = u.clone();
    padded.resize(k.n_rows(), 0.0);
    k.mul(&padded, &mut f);
    f.truncate(n);
    for (i, row) in normal.iter().chain(&tangential).enumerate() {
        for &(j, v) in row {
            f[j] += v * lambda[i];
        }
    }
    let problem = ContactProblem::new(ContactData {
        stiffness: k,
        load: f,
        normal: matrix(&normal, n),
        tangential: matrix(&tangential, n),
        gap: d,
        slip_bound: g,
        coordinates: None,
    })
    .or_panic();
    Manufactured {
        problem,
        u,
        lambda,
        nodes: nodes.to_vec(),
    }
}

impl<const D: usize> Manufactured<D> {
    /// The differences of an answer from the chosen one: displacements and forces to 1e-5, and the sets where they are
    /// clear.
    pub fn wrong(&self, found: &Solution<D>) -> Result<(), String> {
        let right = |what: &str, holds: bool| match holds {
            true => Ok(()),
            false => Err(what.to_owned()),
        };
        // u and the forces of these problems are about one, unless they vanish.
        for (what, found, chosen) in [
            ("u", &found.u[..self.u.len()], &self.u),
            ("λ", &found.lambda[..], &self.lambda),
        ] {
            let off = found.iter().zip(chosen);
            let off = off.fold(0.0, |off: f64, (a, b)| off.max((a - b).abs()));
            right(&format!("{what} is off by {off:e}"), off < 1e-5)?;
        }
        for (i, node) in self.nodes.iter().enumerate() {
            let separated = found.sets.is_separated(i) == node.separated;
            right(&format!("whether {i} is separated"), separated)?;
            if node.friction.is_clear() {
                let slips = matches!(node.friction, Friction::Slips(_));
                let as_chosen = found.sets.slips(i) == slips;
                right(&format!("whether {i} slips"), as_chosen)?;
            }
        }
        Ok(())
    }
}
