//! Large displacements: nodal forces, tangents and Cauchy stresses of displaced bodies, total Lagrangian.
//!
//! With F = ∂x/∂X at a point, divided by the stretch 1 + α θ of a point warmer by θ, the strain energies per volume are
//!
//! ```text
//! St. Venant–Kirchhoff   μ E:E + ½ λ ϑ²             E = ½ (FᵀF − I),  ϑ = tr E
//! neo-Hooke              ½ μ (F:F − 3 − 2ϑ) + ½ λ ϑ²                  ϑ = ln det F
//! ```
//!
//! Both are linear elasticity where displacements are small; strains come from F − I, ϑ from det F − 1 and the energy from E, so
//! that small ones keep their digits. Where the dilatation of linear elasticity is projected
//! (`dilatation.rs`), so is ϑ, in the same way: ½ λ ϑ² becomes −⅓ μ ϑ² + ½ κ (π ϑ)², whose tangent at rest is that of
//! linear elasticity. In plane stress the moduli of St. Venant–Kirchhoff are those of plane stress, and neo-Hooke's law
//! finds the stretch of the thickness.
//!
//! Incompatible modes (`modes.rs`) are more functions of the displacements: their amplitudes minimise the strain energy of
//! the element where its nodes are, and its tangent is without them, as at rest.
//!
//! The stresses in a tangent are those that the last of Newton's steps predicted, as if E (ϑ of neo-Hooke's law) had
//! been linear in it. The actual ones have the square of the step times the stiffest modulus of a thin or
//! incompressible body in them, and Newton's method follows that back and forth. The residual has the actual ones.
//! (Magisano, Leonetti and Garcea, Advantages of the mixed format in geometrically nonlinear analysis of beams and
//! shells using solid finite elements, 2017.)

use super::assembly::rows_of;
use super::modes::{Amplitudes, Eliminated, Gradients};
use super::{
    Body, Dilatation, Hyperelastic, Material, Moduli, Plane, Stress, Temperature, Unknowns,
};
use crate::dense::symmetric_eigen;
use crate::mesh::shape::{Point, cofactors, derivatives, sum, tangents};
use crate::mesh::vector::dot;
use crate::mesh::{self, ElementKind, Mesh, ShapeFunctions, Topology, Visit};
use crate::sparse::BlockCsr;
use faer::Mat;
use rayon::prelude::*;
use std::array::from_fn;

/// Bodies where their nodes have moved.
#[derive(Clone, Copy)]
pub struct Deformed<'a, const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    /// The bodies at rest.
    pub body: &'a Body<'a, D>,
    /// Of every node.
    pub displacement: &'a [[f64; D]],
    /// How much warmer they are; None: nowhere.
    pub temperature: Option<Temperature<'a, D>>,
    /// The displacement of every node in the last of Newton's steps, for the stresses in the tangent; None: zero.
    pub step: Option<&'a [[f64; D]]>,
    /// Whether the tangent is made without stresses that soften it.
    pub stiffened: bool,
    /// The kind of each node, by its body; empty: all bodies are held.
    pub loose: &'a [Loose],
}

/// A node of a body that no support holds, or not in every way (ties do not count). The tangent of its elements is made
/// without stresses, so that it does not resist motions as a whole.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Loose {
    /// It is of no such body.
    #[default]
    No,
    /// Its body is free.
    Free,
    /// Supports hold its body in some ways, and the tangent is that of rest. Where the held nodes have moved a little, they resist
    /// every motion a little: a stiffness far smaller than that of contact, which would ruin the condition of A.
    Partly,
}

/// The moduli of an element, of the plane or of space.
#[derive(Clone, Copy)]
struct Law {
    kind: Hyperelastic,
    plane: Plane,
    /// Of St. Venant–Kirchhoff in plane stress that of plane stress; without the part that the projected dilatation has.
    lambda: f64,
    mu: f64,
    /// κ of the projected dilatation; 0 without one.
    bulk: f64,
    thickness: f64,
}

/// A point of a displaced element, with the stresses of the law there.
struct Strained<const D: usize, const N: usize> {
    /// Of the volume at rest, stretched by warmth, times the thickness.
    weight: f64,
    /// Without either, as the projected dilatation is integrated.
    cold: f64,
    /// By how much warmth stretches the volume.
    warm: f64,
    /// Of each node, and of each mode.
    nodes: [Function<D>; N],
    modes: [Function<D>; D],
    f: [[f64; D]; D],
    /// What carries the stresses s to forces: F of St. Venant–Kirchhoff, F⁻ᵀ of neo-Hooke.
    carrier: [[f64; D]; D],
    /// The stretch perpendicular to the plane.
    across: f64,
    /// E, of St. Venant–Kirchhoff as the tangent has it; perpendicular to the plane 0 where the moduli are those of plane stress.
    strain: [[f64; D]; D],
    strain_across: f64,
    theta: f64,
    /// λ as the tangent has it.
    lambda: f64,
    /// λ ϑ + κ π ϑ.
    q: f64,
    /// 2μE + qI.
    s: [[f64; D]; D],
    s_across: f64,
    /// F Fᵀ.
    left: [[f64; D]; D],
    /// Whether the tangent is made without stresses.
    unstressed: bool,
}

/// A function of the displacements at a point of a displaced element.
#[derive(Clone, Copy)]
struct Function<const D: usize> {
    /// ∇φ over the stretch of warmth, and φ/X along what goes round.
    gradient: [f64; D],
    hoop: f64,
    /// ∂ϑ/∂u in the plane (in space: all of it), and by what goes round.
    p: [f64; D],
    round: f64,
}

/// The displacements of an element.
#[derive(Clone, Copy)]
struct Motion<const D: usize, const N: usize> {
    nodes: [[f64; D]; N],
    modes: Amplitudes<D>,
}

impl<const D: usize, const N: usize> Motion<D, N> {
    /// Of the nodes alone.
    fn of(nodes: [[f64; D]; N]) -> Self {
        Self {
            nodes,
            modes: [[0.0; D]; D],
        }
    }
}

/// A point of an element at rest, with the gradients of its modes, if it has any.
#[derive(Clone, Copy)]
struct At<const D: usize, const N: usize> {
    point: Point<D, N>,
    modes: Option<[[f64; D]; D]>,
}

fn times<const D: usize>(m: &[[f64; D]; D], v: &[f64; D]) -> [f64; D] {
    m.map(|row| dot(row, *v))
}

fn transposed<const D: usize>(m: &[[f64; D]; D]) -> [[f64; D]; D] {
    from_fn(|i| from_fn(|j| m[j][i]))
}

fn trace<const D: usize>(m: &[[f64; D]; D]) -> f64 {
    (0..D).map(|c| m[c][c]).sum()
}

/// I + M.
fn one_and<const D: usize>(m: &[[f64; D]; D]) -> [[f64; D]; D] {
    from_fn(|i| from_fn(|j| f64::from(u8::from(i == j)) + m[i][j]))
}

/// det (I + M) − 1 − tr M.
fn beyond_trace<const D: usize>(m: &[[f64; D]; D]) -> f64 {
    let (minors, det) = cofactors(*m);
    det + if D == 3 { trace(&minors) } else { 0.0 }
}

/// ln det (I + M).
fn ln_det<const D: usize>(m: &[[f64; D]; D]) -> f64 {
    (trace(m) + beyond_trace(m)).ln_1p()
}

/// x − ln (1 + x), which is about x²/2 where x is small.
fn beyond_ln(x: f64) -> f64 {
    if x.abs() > 0.5 {
        return x - x.ln_1p();
    }
    // ln (1 + x) = 2 artanh y = 2 (y + y³/3 + y⁵/5 + …) with y² ≤ 1/9, where 16 terms reach rounding, and x − 2y = x y.
    let y = x / (2.0 + x);
    let rest = (1..=16)
        .rev()
        .fold(0.0, |sum, k| y * y * (sum + 1.0 / f64::from(2 * k + 1)));
    y * (x - 2.0 * rest)
}

impl Law {
    /// ln s of the stretch of the thickness in plane stress, where that of the plane is e^`plane`: μ (s² − 1) + λ ln(e^plane s) = 0.
    fn thinned(&self, plane: f64) -> f64 {
        let mut ln = 0.0_f64;
        // A convex function of ln s: Newton's method converges from one side after its first step.
        for _ in 0..60 {
            let growth = (2.0 * ln).exp_m1();
            let value = self.mu * growth + self.lambda * (plane + ln);
            let step = value / (2.0 * self.mu * (1.0 + growth) + self.lambda);
            ln -= step;
            // What is left is about the square of the step.
            if step.abs() <= 1e-8 * ln.abs().min(1.0) {
                break;
            }
        }
        ln
    }

    /// At a point of an element at rest whose nodes have moved by u, the last time by `step`; warmth stretches it by 1 + `growth`.
    fn strained<const D: usize, const N: usize>(
        &self,
        At { point, modes }: &At<D, N>,
        hoop: f64,
        [u, step]: [&Motion<D, N>; 2],
        growth: f64,
    ) -> Strained<D, N> {
        let stretch = 1.0 + growth;
        let gradient = point.gradient.map(|g| g.map(|v| v / stretch));
        let round_axis = point.shape.map(|shape| shape * hoop / stretch);
        let modes = modes.map(|modes| modes.map(|g| g.map(|v| v / stretch)));
        // F − I and its change in the last step, and those of the stretch across.
        let [mut h, mut moved] =
            [u, step].map(|motion| transposed(&tangents(&gradient, &motion.nodes)));
        let [mut h_across, moved_across] =
            [u, step].map(|motion| sum(&round_axis, &motion.nodes)[0]);
        if let Some(modes) = &modes {
            let [own, last] =
                [u, step].map(|motion| derivatives(modes, motion.modes.iter().copied()));
            for i in 0..D {
                for j in 0..D {
                    h[i][j] += own[j][i];
                    moved[i][j] += last[j][i];
                }
            }
        }
        (0..D).for_each(|c| h[c][c] -= growth / stretch);
        h_across -= growth / stretch;
        let f = one_and(&h);
        let (inverse, det) = cofactors(f);
        let of_step = matches!(self.kind, Hyperelastic::StVenantKirchhoff);
        let columns = [h, moved].map(|m| transposed(&m));
        let strain: [[f64; D]; D] = from_fn(|i| {
            from_fn(|j| {
                let [own, last] = columns.map(|of| dot(of[i], of[j]));
                0.5 * (h[i][j] + h[j][i] + own - if of_step { last } else { 0.0 })
            })
        });
        let mut across = 1.0 + h_across;
        let mut strain_across = h_across + 0.5 * h_across * h_across;
        let mut lambda = self.lambda;
        let (theta, carrier);
        let in_plane_stress = D == 2 && self.plane == Plane::PlaneStress;
        match self.kind {
            Hyperelastic::NeoHooke => {
                carrier = inverse.map(|row| row.map(|v| v / det));
                if in_plane_stress {
                    let plane = ln_det(&h);
                    let ln = self.thinned(plane);
                    (across, strain_across) = (ln.exp(), 0.5 * (2.0 * ln).exp_m1());
                    theta = plane + ln;
                    let square = 2.0 * self.mu * across * across;
                    lambda = square * self.lambda / (self.lambda + square);
                } else {
                    // F − I before the last step, and the inverse of F transposed times det F.
                    let before: [[f64; D]; D] = from_fn(|i| from_fn(|j| h[i][j] - moved[i][j]));
                    let (turned, det) = cofactors(one_and(&before));
                    let first: f64 = (0..D).map(|i| dot(turned[i], moved[i])).sum();
                    let mut sum = ln_det(&before) + first / det;
                    if D == 2 {
                        let before = h_across - moved_across;
                        sum += before.ln_1p() + moved_across / (1.0 + before);
                    }
                    theta = sum;
                }
            }
            Hyperelastic::StVenantKirchhoff => {
                carrier = f;
                let in_plane = trace(&strain);
                if in_plane_stress {
                    // From λ₃ (tr E + e) + 2μ e = 0, where the λ of plane stress is 2μ λ₃ / (λ₃ + 2μ).
                    let e_across = -self.lambda / (2.0 * self.mu) * in_plane;
                    across = (1.0 + 2.0 * e_across).max(0.0).sqrt();
                    strain_across = 0.0;
                } else {
                    strain_across -= 0.5 * moved_across * moved_across;
                }
                theta = in_plane + if D == 2 { strain_across } else { 0.0 };
            }
        }
        let function = |gradient: [f64; D], hoop: f64| Function {
            gradient,
            hoop,
            p: times(&carrier, &gradient),
            round: match self.kind {
                Hyperelastic::NeoHooke => hoop / across,
                Hyperelastic::StVenantKirchhoff => hoop * across,
            },
        };
        let warm = stretch * stretch * stretch;
        Strained {
            weight: point.weight * warm * self.thickness,
            cold: point.weight,
            warm,
            nodes: from_fn(|a| function(gradient[a], round_axis[a])),
            modes: modes.map_or([Function::NONE; D], |modes| modes.map(|g| function(g, 0.0))),
            f,
            carrier,
            across,
            strain,
            strain_across,
            theta,
            lambda,
            q: self.lambda * theta,
            s: [[0.0; D]; D],
            s_across: 0.0,
            left: from_fn(|i| from_fn(|j| dot(f[i], f[j]))),
            unstressed: false,
        }
    }
}

impl<const D: usize> Function<D> {
    const NONE: Self = Self {
        gradient: [0.0; D],
        hoop: 0.0,
        p: [0.0; D],
        round: 0.0,
    };

    /// ∂ϑ/∂u.
    fn dilatation(&self) -> [f64; D] {
        let mut part = self.p;
        part[0] += self.round;
        part
    }
}

impl<const D: usize, const N: usize> Strained<D, N> {
    /// Adds κ π ϑ, where the dilatation is projected; then the stresses are known.
    fn close(&mut self, law: &Law, projected: f64) {
        self.q += projected / self.warm;
        self.s = self.strain.map(|row| row.map(|e| 2.0 * law.mu * e));
        (0..D).for_each(|c| self.s[c][c] += self.q);
        self.s_across = 2.0 * law.mu * self.strain_across + self.q;
    }

    /// Leaves out stresses that make the tangent softer: of St. Venant–Kirchhoff's law those that press; of neo-Hooke's law what of
    /// q − μ weighs more against tr (F⁻¹ ∂F)² ≥ −|∂F|²/σ² than half of μ |∂F|² for it, σ the least stretch.
    fn stiffen(&mut self, law: &Law) {
        let eigen = |m: &[[f64; D]; D]| symmetric_eigen(&Mat::from_fn(D, D, |i, j| m[i][j]));
        match law.kind {
            Hyperelastic::NeoHooke => {
                let least = eigen(&self.left).map_or(0.0, |(values, _)| values[0]);
                let across = if D == 2 {
                    self.across * self.across
                } else {
                    least
                };
                let most = 0.5 * law.mu * least.min(across).max(0.0);
                self.q = self.q.clamp(law.mu - most, law.mu + most);
            }
            Hyperelastic::StVenantKirchhoff => {
                self.s_across = self.s_across.max(0.0);
                self.s = eigen(&self.s).map_or([[0.0; D]; D], |(values, vectors)| {
                    from_fn(|i| {
                        from_fn(|j| {
                            let part =
                                |k: usize| values[k].max(0.0) * vectors[(i, k)] * vectors[(j, k)];
                            (0..D).map(part).sum()
                        })
                    })
                });
            }
        }
    }

    /// Leaves out all stresses from the tangent.
    fn loosen(&mut self, law: &Law) {
        /// The part of μ that is left where a neo-Hookean material is stretched so far that its moduli would vanish.
        const LEFT: f64 = 0.5;
        self.unstressed = true;
        match law.kind {
            Hyperelastic::NeoHooke => self.q = self.q.min((1.0 - LEFT) * law.mu),
            Hyperelastic::StVenantKirchhoff => (self.s, self.s_across) = ([[0.0; D]; D], 0.0),
        }
    }

    /// The force of the strain energy on a function, per volume at rest.
    fn force(&self, of: &Function<D>) -> [f64; D] {
        let mut force = times(&self.carrier, &times(&self.s, &of.gradient));
        force[0] += self.s_across * of.round;
        force
    }

    /// Adds to entry [i][k] the derivative of the force on function a along axis i by the amplitude of b along k.
    #[inline]
    fn add_tangent(&self, law: &Law, [a, b]: [&Function<D>; 2], block: &mut [[f64; D]; D]) {
        let (mu, w) = (law.mu, self.weight);
        let (pa, pb) = (a.dilatation(), b.dilatation());
        let plain = dot(a.gradient, b.gradient);
        let (along, hoops) = match law.kind {
            Hyperelastic::NeoHooke => {
                let rest = mu - self.q;
                for i in 0..D {
                    for k in 0..D {
                        block[i][k] += w * (rest * b.p[i] * a.p[k] + self.lambda * pa[i] * pb[k]);
                    }
                }
                // The stresses S = μ I + (q − μ) C⁻¹ weigh ∇φ·S ∇φ.
                let (along, round) = match self.unstressed {
                    true => (rest * dot(a.p, b.p), rest * a.round * b.round),
                    false => (mu * plain, mu * a.hoop * b.hoop),
                };
                (along, round + rest * a.round * b.round)
            }
            Hyperelastic::StVenantKirchhoff => {
                for i in 0..D {
                    for k in 0..D {
                        block[i][k] += w
                            * (self.lambda * pa[i] * pb[k]
                                + mu * (plain * self.left[i][k] + b.p[i] * a.p[k]));
                    }
                }
                let hoops = self.s_across * a.hoop * b.hoop + 2.0 * mu * a.round * b.round;
                (dot(a.gradient, times(&self.s, &b.gradient)), hoops)
            }
        };
        (0..D).for_each(|c| block[c][c] += w * along);
        block[0][0] += w * hoops;
    }

    /// The Cauchy stress.
    fn cauchy(&self, law: &Law) -> Stress {
        let (_, det) = cofactors(self.f);
        let j = if D == 2 { det * self.across } else { det };
        let carried = self.carrier.map(|row| times(&self.s, &row));
        let sigma = |i: usize, k: usize| dot(carried[i], self.f[k]) / j;
        let zz = match law.kind {
            _ if D == 3 => sigma(D - 1, D - 1),
            _ if law.plane == Plane::PlaneStress => 0.0,
            Hyperelastic::NeoHooke => self.s_across / j,
            Hyperelastic::StVenantKirchhoff => self.across * self.across * self.s_across / j,
        };
        let in_space = |i: usize, k: usize| if D == 3 { sigma(i, k) } else { 0.0 };
        Stress {
            xx: sigma(0, 0),
            yy: sigma(1, 1),
            zz,
            xy: sigma(0, 1),
            yz: in_space(1, D - 1),
            zx: in_space(D - 1, 0),
        }
    }
}

/// A displaced element with N nodes, and its projected dilatation.
pub(super) struct Finite<'a, const D: usize, const N: usize> {
    law: Law,
    x: [[f64; D]; N],
    u: Motion<D, N>,
    step: Motion<D, N>,
    modes: Option<Gradients<D>>,
    /// The projection, with κ times the part of ϑ that each of its functions has.
    projected: Option<(Dilatation<D, N>, [f64; 4])>,
    region: u32,
    expansion: f64,
    temperature: Option<Temperature<'a, D>>,
}

impl<'a, const D: usize, const N: usize> Finite<'a, D, N>
where
    ElementKind: Topology<D>,
{
    /// An element, with the points that integrate it.
    fn new<E: ShapeFunctions<D, N, Q>, const Q: usize>(
        of: &Deformed<'a, D>,
        element: &mesh::Element<D>,
        moduli: &Moduli,
    ) -> (Self, [Strained<D, N>; Q]) {
        let body = of.body;
        let x = body.mesh.coordinates(element);
        let material: &Material = &body.materials[element.region as usize];
        let points = body.plane.stiffness_points::<E, D, N, Q>(&x);
        let dilatation = moduli.dilatation::<E, D, N, Q>(element.kind(), &points, &x, body.plane);
        let plane = if D == 3 {
            Plane::PlaneStrain
        } else {
            body.plane
        };
        // Neo-Hooke's law in plane stress has the λ of space, as the stretch of the thickness is an unknown of its own.
        let moduli_of = match material.law {
            Hyperelastic::NeoHooke => Plane::PlaneStrain,
            Hyperelastic::StVenantKirchhoff => plane,
        };
        let (lambda, mu) = material.lame(moduli_of);
        let mut law = Law {
            kind: material.law,
            plane,
            lambda,
            mu,
            bulk: 0.0,
            thickness: body.thickness_of(element.region),
        };
        if dilatation.is_some() {
            (law.lambda, law.bulk) = (-2.0 / 3.0 * mu, lambda + 2.0 / 3.0 * mu);
        }
        let at_nodes = |all: &[[f64; D]]| from_fn(|a| all[element.nodes()[a] as usize]);
        let loose = of.loose_at(element);
        let mut made = Self {
            law,
            u: Motion::of(match loose {
                Loose::Partly => [[0.0; D]; N],
                _ => at_nodes(of.displacement),
            }),
            step: Motion::of(of.step.map_or([[0.0; D]; N], at_nodes)),
            modes: moduli
                .has_modes(element.kind())
                .then(|| Gradients::new::<E, N, Q>(&points, &x)),
            x,
            projected: None,
            region: element.region,
            expansion: material.expansion,
            temperature: of.temperature,
        };
        let at = made.at::<E, Q>(&points);
        if made.modes.is_some() {
            made.relax(&at);
        }
        let mut strained = at.map(|at| made.strained(&at));
        made.projected = dilatation.map(|dilatation| {
            let mut parts = [0.0; 4];
            for (at, point) in strained.iter().zip(&points) {
                let values = dilatation.values(point.place(&x));
                let size = law.bulk * at.cold * at.theta;
                parts
                    .iter_mut()
                    .zip(values)
                    .for_each(|(part, value)| *part += size * value);
            }
            (dilatation, parts)
        });
        for (at, point) in strained.iter_mut().zip(&points) {
            at.close(&law, made.projected_at(point.place(&x)));
            if loose != Loose::No {
                at.loosen(&law);
            } else if of.stiffened {
                at.stiffen(&law);
            }
        }
        (made, strained)
    }

    /// An element.
    pub fn of<E: ShapeFunctions<D, N, Q>, const Q: usize>(
        of: &Deformed<'a, D>,
        element: &mesh::Element<D>,
    ) -> Self {
        let material = of.body.materials[element.region as usize];
        let moduli = material.moduli(of.body.plane, of.body.thickness_of(element.region));
        Self::new::<E, Q>(of, element, &moduli).0
    }

    /// The points that integrate the element.
    fn at<E: ShapeFunctions<D, N, Q>, const Q: usize>(
        &self,
        points: &[Point<D, N>; Q],
    ) -> [At<D, N>; Q] {
        let rule = E::stiffness_rule();
        from_fn(|number| At {
            point: points[number],
            modes: (self.modes.as_ref()).map(|modes| modes.at::<E, N, Q>(rule[number].0, &self.x)),
        })
    }

    /// Lets the modes give way until the energy is least. They begin at rest, so that the result is that of the displacement alone.
    fn relax<const Q: usize>(&mut self, at: &[At<D, N>; Q]) {
        let nodes = self.u.nodes;
        let step = std::mem::replace(&mut self.step, Motion::of([[0.0; D]; N]));
        let moved = step.nodes != [[0.0; D]; N];
        if moved {
            self.u.nodes = from_fn(|a| from_fn(|c| nodes[a][c] - step.nodes[a][c]));
            self.u.modes = self.relaxed(at);
        }
        let before = std::mem::replace(&mut self.u, Motion::of(nodes)).modes;
        self.u.modes = self.relaxed(at);
        self.step.nodes = step.nodes;
        if moved {
            let now = &self.u.modes;
            self.step.modes = from_fn(|k| from_fn(|c| now[k][c] - before[k][c]));
        }
    }

    /// The amplitudes of the modes where the energy is least, by Newton's method with a line search.
    fn relaxed<const Q: usize>(&self, at: &[At<D, N>; Q]) -> Amplitudes<D> {
        /// Iterations; a handful will do.
        const MOST: usize = 50;
        /// Halvings of a step.
        const LEAST: i32 = 30;
        /// The gain of a step in parts of the energy from where on the error after it is its square, and rounding may hide the gain.
        const NEAR: f64 = 1e-12;
        /// The rounding of E where the element has turned.
        const TURNED: f64 = 4.0 * f64::EPSILON;
        /// The gain of the last step; and in parts of λ + 2μ, where there is hardly any energy.
        const LAST: [f64; 2] = [1e-20, 1e-28];
        let mut amplitudes = [[0.0; D]; D];
        let strained = |modes: &Amplitudes<D>| {
            let u = Motion {
                modes: *modes,
                ..self.u
            };
            at.map(|at| {
                let mut here = self.strained_by(&at, &u);
                here.close(&self.law, 0.0);
                here
            })
        };
        let energy = |points: &[Strained<D, N>; Q]| -> f64 {
            points
                .iter()
                .map(|at| at.weight * at.energy(&self.law))
                .sum()
        };
        let mut here = strained(&amplitudes);
        let mut least = energy(&here);
        let volume: f64 = here.iter().map(|at| at.weight).sum();
        let stiffest = (self.law.lambda + 2.0 * self.law.mu) * volume;
        for _ in 0..MOST {
            let mut forces = [[0.0; D]; D];
            for at in &here {
                for (force, mode) in forces.iter_mut().zip(&at.modes) {
                    let part = at.force(mode);
                    (0..D).for_each(|c| force[c] -= at.weight * part[c]);
                }
            }
            let Some(eliminated) = self.eliminated(&mut here) else {
                break;
            };
            let driven = eliminated.driven(&forces);
            let step = eliminated.amplitudes(&driven, &[[0.0; D]; N]);
            let gain: f64 = driven.iter().map(|v| v * v).sum();
            let none = LAST[1] * stiffest;
            let hidden = none + TURNED * (least * stiffest).sqrt();
            let is_near = gain <= NEAR * least + hidden;
            let is_last = gain <= LAST[0] * least + none;
            let found = (0..LEAST).find_map(|halved| {
                let part = 0.5_f64.powi(halved);
                let next = from_fn(|k| from_fn(|c| amplitudes[k][c] + part * step[k][c]));
                let there = strained(&next);
                let energy = energy(&there);
                (energy < least || is_near && energy.is_finite()).then_some((next, there, energy))
            });
            let Some((next, there, energy)) = found else {
                break;
            };
            (amplitudes, here, least) = (next, there, energy);
            if is_last {
                break;
            }
        }
        amplitudes
    }

    /// The stiffness of the modes. Where it is not positive definite, the stresses are left out of the tangent of the element.
    fn eliminated<const Q: usize>(
        &self,
        points: &mut [Strained<D, N>; Q],
    ) -> Option<Eliminated<D, N>> {
        let made = |points: &[Strained<D, N>; Q]| {
            let between = |[k, l]: [usize; 2], block: &mut [[f64; D]; D]| {
                for at in points {
                    at.add_tangent(&self.law, [&at.modes[k], &at.modes[l]], block);
                }
            };
            let coupled = |[k, a]: [usize; 2], block: &mut [[f64; D]; D]| {
                for at in points {
                    at.add_tangent(&self.law, [&at.modes[k], &at.nodes[a]], block);
                }
            };
            Eliminated::new(between, coupled)
        };
        made(points).or_else(|| {
            points.iter_mut().for_each(|at| at.loosen(&self.law));
            made(points)
        })
    }

    fn strained(&self, at: &At<D, N>) -> Strained<D, N> {
        self.strained_by(at, &self.u)
    }

    /// At a point of the element, where it moves by u.
    fn strained_by(&self, at: &At<D, N>, u: &Motion<D, N>) -> Strained<D, N> {
        let place = at.point.place(&self.x);
        let warmth = (self.temperature).map_or(0.0, |at| at(self.region, place));
        let hoop = self.law.plane.hoop(place);
        (self.law).strained(at, hoop, [u, &self.step], self.expansion * warmth)
    }

    /// κ π ϑ at a place.
    fn projected_at(&self, place: [f64; D]) -> f64 {
        self.projected.as_ref().map_or(0.0, |(dilatation, parts)| {
            let values = dilatation.values(place);
            parts
                .iter()
                .zip(values)
                .map(|(part, value)| part * value)
                .sum()
        })
    }

    /// Hands over the blocks of the tangent in the rows that are wanted.
    fn blocks<E: ShapeFunctions<D, N, Q>, const Q: usize>(
        &self,
        strained: &mut [Strained<D, N>; Q],
        wanted: impl Fn(usize) -> bool,
        mut take: impl FnMut(usize, usize, &[[f64; D]; D]),
    ) {
        // ∫ m ∂ϑ/∂u of each node.
        let integrals = self.projected.as_ref().map(|(dilatation, _)| {
            let points = self.law.plane.stiffness_points::<E, D, N, Q>(&self.x);
            let mut all = [[[0.0; D]; 4]; N];
            for (at, point) in strained.iter().zip(&points) {
                let values = dilatation.values(point.place(&self.x));
                for (function, of) in at.nodes.iter().zip(all.iter_mut()) {
                    let part = function.dilatation();
                    for (sum, value) in of.iter_mut().zip(values) {
                        (0..D).for_each(|c| sum[c] += at.cold * value * part[c]);
                    }
                }
            }
            all
        });
        let modes = (self.modes.as_ref()).and_then(|_| self.eliminated(strained));
        let bulk = self.law.bulk * self.law.thickness;
        for a in (0..N).filter(|&a| wanted(a)) {
            for b in 0..N {
                let mut block = [[0.0; D]; D];
                for at in &*strained {
                    at.add_tangent(&self.law, [&at.nodes[a], &at.nodes[b]], &mut block);
                }
                if let Some(modes) = &modes {
                    modes.relieve([a, b], &mut block);
                }
                if let Some(all) = &integrals {
                    for (of_a, of_b) in all[a].iter().zip(&all[b]) {
                        for i in 0..D {
                            (0..D).for_each(|k| block[i][k] += bulk * of_a[i] * of_b[k]);
                        }
                    }
                }
                take(a, b, &block);
            }
        }
    }

    /// The Cauchy stress at a point of the reference element.
    pub fn cauchy_at<E: ShapeFunctions<D, N, Q>, const Q: usize>(&self, xi: [f64; D]) -> Stress {
        let point = E::at(xi, 1.0, &self.x);
        let modes = (self.modes.as_ref()).map(|modes| modes.at::<E, N, Q>(xi, &self.x));
        let mut at = self.strained(&At { point, modes });
        at.close(&self.law, self.projected_at(point.place(&self.x)));
        at.cauchy(&self.law)
    }
}

/// The blocks of the tangent of an element, as `assembly.rs` takes them.
pub(super) struct TangentBlocks<'a, const D: usize, W, F>
where
    ElementKind: Topology<D>,
{
    pub of: Deformed<'a, D>,
    pub element: &'a mesh::Element<D>,
    /// Of each region.
    pub moduli: &'a [Moduli],
    pub wanted: W,
    pub take: F,
}

impl<const D: usize, W, F> Visit<D> for TangentBlocks<'_, D, W, F>
where
    ElementKind: Topology<D>,
    W: Fn(usize) -> bool,
    F: FnMut(usize, usize, &[[f64; D]; D]),
{
    type Output = ();

    fn visit<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(self) {
        let moduli = &self.moduli[self.element.region as usize];
        let (finite, mut strained) = Finite::new::<E, Q>(&self.of, self.element, moduli);
        finite.blocks::<E, Q>(&mut strained, self.wanted, self.take);
    }
}

/// The nodal forces of an element, and det ∂x/∂X where it is least.
struct Forces<'a, const D: usize>
where
    ElementKind: Topology<D>,
{
    of: &'a Deformed<'a, D>,
    element: &'a mesh::Element<D>,
    moduli: &'a [Moduli],
}

/// The resistance of an element.
struct Resisting<const D: usize> {
    forces: Vec<[f64; D]>,
    energy: f64,
}

impl<const D: usize> Visit<D> for Forces<'_, D>
where
    ElementKind: Topology<D>,
{
    type Output = Resisting<D>;

    fn visit<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(self) -> Resisting<D> {
        let moduli = &self.moduli[self.element.region as usize];
        let (finite, strained) = Finite::new::<E, Q>(self.of, self.element, moduli);
        let (law, mut forces) = (&finite.law, vec![[0.0; D]; N]);
        let mut energy = finite.projected.as_ref().map_or(0.0, |(_, parts)| {
            0.5 * law.thickness / law.bulk * parts.iter().map(|part| part * part).sum::<f64>()
        });
        for at in &strained {
            for (function, force) in at.nodes.iter().zip(&mut forces) {
                let part = at.force(function);
                (0..D).for_each(|c| force[c] += at.weight * part[c]);
            }
            energy += at.weight * at.energy(law);
        }
        Resisting { forces, energy }
    }
}

impl<const D: usize, const N: usize> Strained<D, N> {
    /// The strain energy without that of the projected dilatation, per volume at rest.
    fn energy(&self, law: &Law) -> f64 {
        let volume = 0.5 * law.lambda * self.theta * self.theta;
        let across = if D == 2 { self.strain_across } else { 0.0 };
        match law.kind {
            Hyperelastic::NeoHooke => {
                // C = I + A, and tr A − ln det C, of which the first order cancels.
                let (a, a_across) = (self.strain.map(|row| row.map(|e| 2.0 * e)), 2.0 * across);
                let (first, more) = (trace(&a), beyond_trace(&a));
                let more = more + (first + more) * a_across;
                volume + 0.5 * law.mu * (beyond_ln(first + a_across + more) - more)
            }
            Hyperelastic::StVenantKirchhoff => {
                let of = self.strain.as_flattened();
                volume + law.mu * (of.iter().map(|e| e * e).sum::<f64>() + across * across)
            }
        }
    }
}

/// det ∂x/∂X at the points that integrate an element, where it is least: NaN is least of all.
struct Least<'a, const D: usize>
where
    ElementKind: Topology<D>,
{
    mesh: &'a Mesh<D>,
    element: &'a mesh::Element<D>,
    displacement: &'a [[f64; D]],
    plane: Plane,
}

impl<const D: usize> Visit<D> for Least<'_, D>
where
    ElementKind: Topology<D>,
{
    type Output = f64;

    fn visit<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(self) -> f64 {
        let x = self.mesh.coordinates(self.element);
        let u: [[f64; D]; N] = from_fn(|a| self.displacement[self.element.nodes()[a] as usize]);
        let mut least = f64::INFINITY;
        for point in E::stiffness_points(&x) {
            let across = 1.0 + self.plane.hoop(point.place(&x)) * sum(&point.shape, &u)[0];
            let (_, det) = cofactors(one_and(&tangents(&point.gradient, &u)));
            let det = det.min(across);
            if !(det >= least) {
                least = det;
            }
        }
        least
    }
}

/// The resistance of displaced bodies.
#[derive(Clone, Debug)]
pub struct Resistance<const D: usize = 2> {
    /// The nodal forces that hold them where they are.
    pub forces: Vec<[f64; D]>,
    /// The strain energy.
    pub energy: f64,
}

impl<'a, const D: usize> Deformed<'a, D>
where
    ElementKind: Topology<D>,
{
    /// Bodies whose nodes have moved.
    pub fn new(
        body: &'a Body<'a, D>,
        displacement: &'a [[f64; D]],
        temperature: Option<Temperature<'a, D>>,
    ) -> Self {
        Self {
            body,
            displacement,
            temperature,
            step: None,
            stiffened: false,
            loose: &[],
        }
    }

    /// The kind of an element's body, by those of its nodes that supports do not hold.
    fn loose_at(&self, element: &mesh::Element<D>) -> Loose {
        let of_nodes = element.nodes().iter();
        let mut of_nodes = of_nodes.filter_map(|&node| self.loose.get(node as usize));
        *of_nodes.find(|is| **is != Loose::No).unwrap_or(&Loose::No)
    }

    /// The nodal forces that hold the bodies where they are, and their strain energy.
    pub fn resistance(&self) -> Resistance<D> {
        let moduli = self.body.moduli();
        let elements = &self.body.mesh.elements;
        let of = Self::new(self.body, self.displacement, self.temperature);
        let each: Vec<Resisting<D>> = (elements.par_iter())
            .map(|element| {
                element.kind().with(Forces {
                    of: &of,
                    element,
                    moduli: &moduli,
                })
            })
            .collect();
        let mut sum = Resistance {
            forces: vec![[0.0; D]; self.body.mesh.nodes.len()],
            energy: 0.0,
        };
        for (element, own) in elements.iter().zip(each) {
            sum.energy += own.energy;
            for (&node, force) in element.nodes().iter().zip(own.forces) {
                (0..D).for_each(|c| sum.forces[node as usize][c] += force[c]);
            }
        }
        sum
    }

    /// The derivative of these forces by the displacements of the unknowns, as [`assemble`](super::assemble) makes K at rest.
    pub fn tangent(&self, unknowns: &Unknowns<D>) -> BlockCsr<D> {
        rows_of(self.body, unknowns, unknowns.n_blocks(), Some(self))
    }

    /// det ∂x/∂X where it is least, of all points that integrate elements: at 0 an element has been pressed flat.
    pub fn least_volume(&self) -> f64 {
        let of = |element| {
            mesh::Element::kind(element).with(Least {
                mesh: self.body.mesh,
                element,
                displacement: self.displacement,
                plane: self.body.plane,
            })
        };
        let least = |a: f64, b: f64| if b >= a { a } else { b };
        (self.body.mesh.elements.par_iter().map(of)).reduce(|| f64::INFINITY, least)
    }
}
