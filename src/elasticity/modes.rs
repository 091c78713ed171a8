//! Incompatible modes: quadrilaterals and hexahedra of first order that bend without being too stiff.
//!
//! The displacements along each axis gain the modes 1 − ξₖ² for each reference coordinate, internal to the element
//! (Taylor, Beresford and Wilson). Their gradients are those of the middle of the element, (det J₀/det J) J₀⁻ᵀ ∇(1 −
//! ξₖ²), minus their mean. Constant stresses do no work on them, so that elements of any shape pass the patch test.
//! Around an axis they cause no hoop strain. Their amplitudes minimise the strain energy and are eliminated: with H the
//! stiffness of the modes and L their coupling to the nodes, K becomes K − L H⁻¹ Lᵀ.

use super::{Law, Plane};
use crate::mesh::ShapeFunctions;
use crate::mesh::shape::Point;

/// Most modes of an element: three functions along three axes. Mode D k + c is function k along axis c.
const MOST: usize = 9;

/// The gradients of the functions of an element.
pub(super) struct Gradients<const D: usize> {
    /// det J₀ ∂ξₖ/∂x in the middle.
    rows: [[f64; D]; D],
    /// The mean of each gradient, to be subtracted.
    mean: [[f64; D]; D],
}

impl<const D: usize> Gradients<D> {
    /// Of an element with its nodes at x and these points of integration.
    pub fn new<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(
        points: &[Point<D, N>; Q],
        x: &[[f64; D]; N],
    ) -> Self {
        let middle = E::at(E::CENTRE, 1.0, x);
        let rows = std::array::from_fn(|k| {
            // ξₖ is the sum of its values at the nodes times the shape functions.
            let mut row = [0.0; D];
            for (node, gradient) in E::NODES.iter().zip(&middle.gradient) {
                (0..D).for_each(|c| row[c] += middle.weight * node[k] * gradient[c]);
            }
            row
        });
        let mut made = Self {
            rows,
            mean: [[0.0; D]; D],
        };
        let volume: f64 = points.iter().map(|point| point.weight).sum();
        let mut mean = [[0.0; D]; D];
        for (point, (xi, _)) in points.iter().zip(E::stiffness_rule()) {
            let here = made.at::<E, N, Q>(xi, x);
            for (mean, here) in mean.as_flattened_mut().iter_mut().zip(here.as_flattened()) {
                *mean += point.weight / volume * here;
            }
        }
        made.mean = mean;
        made
    }

    /// At a point of the reference element.
    pub fn at<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(
        &self,
        xi: [f64; D],
        x: &[[f64; D]; N],
    ) -> [[f64; D]; D] {
        let det = E::at(xi, 1.0, x).weight;
        std::array::from_fn(|k| {
            let slope = -2.0 * xi[k] / det;
            std::array::from_fn(|c| slope * self.rows[k][c] - self.mean[k][c])
        })
    }
}

/// The amplitude of each function of an element along each axis.
pub(super) type Amplitudes<const D: usize> = [[f64; D]; D];

/// The stiffness of the modes of an element with N nodes, to be eliminated.
pub(super) struct Eliminated<const D: usize, const N: usize> {
    /// H; once it is factored, H = R Rᵀ.
    factor: [[f64; MOST]; MOST],
    /// The columns of L; once H is factored, of L R⁻ᵀ, whose squares are subtracted from K.
    columns: [[[f64; D]; N]; MOST],
}

impl<const D: usize, const N: usize> Eliminated<D, N> {
    const COUNT: usize = D * D;

    /// From a function that adds up H (of two functions of modes) and another for L (of a function and a node); None where H is
    /// not positive definite.
    pub fn new(
        mut between: impl FnMut([usize; 2], &mut [[f64; D]; D]),
        mut coupled: impl FnMut([usize; 2], &mut [[f64; D]; D]),
    ) -> Option<Self> {
        let mut made = Self {
            factor: [[0.0; MOST]; MOST],
            columns: [[[0.0; D]; N]; MOST],
        };
        for k in 0..D {
            for l in 0..=k {
                let mut block = [[0.0; D]; D];
                between([k, l], &mut block);
                for (c, row) in block.iter().enumerate() {
                    made.factor[D * k + c][D * l..][..D].copy_from_slice(row);
                }
            }
            for a in 0..N {
                let mut block = [[0.0; D]; D];
                coupled([k, a], &mut block);
                for (c, row) in block.iter().enumerate() {
                    made.columns[D * k + c][a] = *row;
                }
            }
        }
        made.condense().then_some(made)
    }

    /// H to its factor R, and L to L R⁻ᵀ; false where H is not positive definite.
    fn condense(&mut self) -> bool {
        for p in 0..Self::COUNT {
            for q in 0..=p {
                let known: f64 = (0..q).map(|k| self.factor[p][k] * self.factor[q][k]).sum();
                let rest = self.factor[p][q] - known;
                self.factor[p][q] = if p == q {
                    if !(rest > 0.0) {
                        return false;
                    }
                    rest.sqrt()
                } else {
                    rest / self.factor[q][q]
                };
            }
            let (before, from) = self.columns.split_at_mut(p);
            for (column, factor) in before.iter().zip(self.factor[p]) {
                let entries = from[0].as_flattened_mut().iter_mut();
                entries
                    .zip(column.as_flattened())
                    .for_each(|(own, other)| *own -= factor * other);
            }
            let scale = self.factor[p][p].recip();
            let own = from[0].as_flattened_mut();
            own.iter_mut().for_each(|entry| *entry *= scale);
        }
        true
    }

    /// Subtracts the modes' part of the stiffness between nodes a and b from a block of K.
    pub fn relieve(&self, [a, b]: [usize; 2], block: &mut [[f64; D]; D]) {
        for column in &self.columns[..Self::COUNT] {
            for i in 0..D {
                for j in 0..D {
                    block[i][j] -= column[a][i] * column[b][j];
                }
            }
        }
    }

    /// R⁻¹ f for the force f on the modes: entry [k][c] along axis c for function k.
    pub fn driven(&self, f: &[[f64; D]; D]) -> [f64; MOST] {
        let mut y = [0.0; MOST];
        for (p, &f) in f.as_flattened().iter().enumerate() {
            let known: f64 = (0..p).map(|q| self.factor[p][q] * y[q]).sum();
            y[p] = (f - known) / self.factor[p][p];
        }
        y
    }

    /// The nodal force at a of a force on the modes from [`Self::driven`].
    pub fn handed_on(&self, driven: &[f64; MOST], a: usize) -> [f64; D] {
        let mut force = [0.0; D];
        for (column, y) in self.columns.iter().zip(driven) {
            (0..D).for_each(|c| force[c] -= y * column[a][c]);
        }
        force
    }

    /// The amplitudes of the modes where the nodes move by u.
    pub fn amplitudes(&self, driven: &[f64; MOST], u: &[[f64; D]; N]) -> Amplitudes<D> {
        let mut y = *driven;
        for (y, column) in y.iter_mut().zip(&self.columns) {
            let all = column.as_flattened().iter().zip(u.as_flattened());
            *y -= all.map(|(column, u)| column * u).sum::<f64>();
        }
        for p in (0..Self::COUNT).rev() {
            let known: f64 = (p + 1..Self::COUNT).map(|q| self.factor[q][p] * y[q]).sum();
            y[p] = (y[p] - known) / self.factor[p][p];
        }
        std::array::from_fn(|k| std::array::from_fn(|c| y[D * k + c]))
    }
}

/// The modes of an element with N nodes where displacements are small.
pub(super) struct Modes<const D: usize, const N: usize> {
    /// Of their functions.
    pub gradients: Gradients<D>,
    /// Their stiffness.
    pub eliminated: Eliminated<D, N>,
}

impl<const D: usize, const N: usize> Modes<D, N> {
    /// Of an element with its nodes at x and these points of integration; `plane` is for the plane. None where it is so distorted that
    /// it does not resist them.
    pub fn new<E: ShapeFunctions<D, N, Q>, const Q: usize>(
        points: &[Point<D, N>; Q],
        x: &[[f64; D]; N],
        plane: Plane,
        law: &Law,
    ) -> Option<Self> {
        let gradients = Gradients::new::<E, N, Q>(points, x);
        let rule = E::stiffness_rule();
        let of_points = rule.map(|(xi, _)| gradients.at::<E, N, Q>(xi, x));
        let tangent = |point: &Point<D, N>| law.tangent::<D>().times(point.weight);
        let between = |[k, l]: [usize; 2], block: &mut [[f64; D]; D]| {
            for (point, modes) in points.iter().zip(&of_points) {
                tangent(point).add([&modes[k], &modes[l]], None, block);
            }
        };
        let coupled = |[k, a]: [usize; 2], block: &mut [[f64; D]; D]| {
            for (point, modes) in points.iter().zip(&of_points) {
                let hoops = Some([0.0, plane.hoop(point.place(x)) * point.shape[a]]);
                tangent(point).add([&modes[k], &point.gradient[a]], hoops, block);
            }
        };
        Eliminated::new(between, coupled).map(|eliminated| Self {
            gradients,
            eliminated,
        })
    }
}
