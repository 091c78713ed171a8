//! The constitutive law: stiffness, nodal forces and stresses all come from here.

use super::{Material, Plane, Stress};
use crate::mesh::vector::dot;

/// σ = λ tr(ε) I + 2μ ε; the moduli may be times a thickness.
#[derive(Clone, Copy)]
pub(super) struct Law {
    plane: Plane,
    lambda: f64,
    mu: f64,
}

/// ∂σ/∂ε at a strain, which is constant for this law, times the size of the integration domain.
#[derive(Clone, Copy)]
pub(super) struct Tangent {
    lambda: f64,
    mu: f64,
}

impl Law {
    /// Of a material of this thickness.
    pub fn new(material: &Material, plane: Plane, thickness: f64) -> Self {
        let (lambda, mu) = material.lame(plane);
        Self {
            plane,
            lambda: lambda * thickness,
            mu: mu * thickness,
        }
    }

    /// The law without its dilatation term, and κ: σ is its value plus κ θ I, with the dilatation θ from elsewhere.
    pub fn without_dilatation(self) -> (Self, f64) {
        let third = 2.0 / 3.0 * self.mu;
        let left = Self {
            lambda: -2.0 / 3.0 * self.mu,
            ..self
        };
        (left, self.lambda + third)
    }

    /// Stress and tangent under the displacement gradient ∂uᵢ/∂xⱼ and the hoop strain around an axis.
    #[inline(always)]
    pub fn response<const D: usize>(&self, e: &[[f64; D]; D], hoop: f64) -> (Stress, Tangent) {
        let &Self { plane, lambda, mu } = self;
        let trace = lambda * ((0..D).map(|c| e[c][c]).sum::<f64>() + hoop);
        let normal = |c: usize| trace + 2.0 * mu * e[c][c];
        let shear = |i: usize, j: usize| mu * (e[i][j] + e[j][i]);
        let space = D == 3;
        let stress = Stress {
            xx: normal(0),
            yy: normal(1),
            zz: match plane {
                _ if space => normal(D - 1),
                Plane::PlaneStrain => trace,
                Plane::PlaneStress => 0.0,
                Plane::Axisymmetric => trace + 2.0 * mu * hoop,
            },
            xy: shear(0, 1),
            yz: if space { shear(1, D - 1) } else { 0.0 },
            zx: if space { shear(D - 1, 0) } else { 0.0 },
        };
        (stress, Tangent { lambda, mu })
    }

    /// The tangent where nothing is strained.
    #[inline(always)]
    pub fn tangent<const D: usize>(&self) -> Tangent {
        self.response(&[[0.0; D]; D], 0.0).1
    }
}

impl Tangent {
    #[inline(always)]
    pub fn times(self, size: f64) -> Self {
        Self {
            lambda: self.lambda * size,
            mu: self.mu * size,
        }
    }

    /// Adds to entry [i][j] the work that a displacement by φ_b along axis j does on one by φ_a along i. From the
    /// gradients it is λ ∇φ_a ∇φ_bᵀ + μ ∇φ_b ∇φ_aᵀ + μ (∇φ_a·∇φ_b) I. Around an axis div also contains φ/x along x, and
    /// the hoop strain adds its 2μ: `hoops` are the φ/x.
    #[inline(always)]
    pub fn add<const D: usize>(
        self,
        [ga, gb]: [&[f64; D]; 2],
        hoops: Option<[f64; 2]>,
        block: &mut [[f64; D]; D],
    ) {
        let (l, m) = (self.lambda, self.mu);
        let dot = m * dot(*ga, *gb);
        for i in 0..D {
            for j in 0..D {
                block[i][j] += if i == j {
                    (l + m) * ga[i] * gb[i] + dot
                } else {
                    l * ga[i] * gb[j] + m * gb[i] * ga[j]
                };
            }
        }
        if let Some([ha, hb]) = hoops {
            block[0][0] += l * (ga[0] * hb + ha * gb[0]) + (l + 2.0 * m) * ha * hb;
            for c in 1..D {
                block[0][c] += l * ha * gb[c];
                block[c][0] += l * ga[c] * hb;
            }
        }
    }
}
