//! From where solids are looked at.

use super::surface::Surface;
use crate::mesh::vector::{cross, dot, unit};
use crate::mesh::{Mesh, facet_nodes};

/// A direction to look from, without perspective; z points up where it can.
#[derive(Clone, Copy, Debug)]
pub(super) struct Camera {
    pub right: [f64; 3],
    pub up: [f64; 3],
    /// Towards the viewer.
    pub back: [f64; 3],
}

impl Camera {
    /// The one that looks from a direction, not that of z.
    pub fn from(back: [f64; 3]) -> Self {
        let back = unit(back);
        let right = unit(cross([0.0, 0.0, 1.0], back));
        Self {
            right,
            up: cross(back, right),
            back,
        }
    }

    /// One from above, which sees most of the stresses, and the opposite one.
    pub fn pair(mesh: &Mesh<3>, surface: &Surface, stresses: &[f64]) -> [Self; 2] {
        let (low, high) = mesh.bounding_box();
        let [x, y, z] = [0, 1, 2].map(|c| high[c] - low[c]);
        // The longer side is seen from the front; a flat body, from higher above.
        let (a, b) = if x >= y { (0.55, 0.85) } else { (0.85, 0.55) };
        let height = if z < 0.3 * x.max(y) { 0.75 } else { 0.5 };
        // The first of them stays unless another one shows clearly more.
        let sides = [[1.0, -1.0], [-1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let candidates = sides.map(|[sx, sy]| [sx * a, sy * b, height]);
        let facets: Vec<([f64; 3], f64)> = (surface.facets.iter())
            .map(|facet| {
                let nodes = facet_nodes(&facet.nodes);
                let (area, normal) = facet.normal(mesh);
                let stress: f64 = nodes.iter().map(|&n| stresses[n as usize]).sum();
                (normal, area * stress / nodes.len() as f64)
            })
            .collect();
        let shown = |back: [f64; 3]| -> f64 {
            let seen = facets
                .iter()
                .map(|(n, weight)| weight * dot(*n, back).max(0.0));
            seen.sum()
        };
        let value = |k: usize| shown(candidates[k]) * if k == 0 { 1.1 } else { 1.0 };
        let best = (0..4).max_by(|&a, &b| value(a).total_cmp(&value(b)).then(b.cmp(&a)));
        let best = candidates[best.unwrap_or(0)];
        [best, best.map(|v| -v)].map(Self::from)
    }

    /// A point in the view: to the right and up.
    pub fn flat(&self, x: [f64; 3]) -> [f64; 2] {
        [dot(self.right, x), dot(self.up, x)]
    }

    /// The brightness of a surface with this normal, from 0 to 1, lit from the left above the viewer.
    pub fn shade(&self, normal: [f64; 3]) -> f64 {
        let light = unit(std::array::from_fn(|c| {
            self.back[c] - 0.35 * self.right[c] + 0.45 * self.up[c]
        }));
        dot(normal, light).max(0.0)
    }

    /// The axes that point to the viewer.
    pub fn name(&self) -> String {
        let parts = ["x", "y", "z"].into_iter().zip(self.back);
        let parts: Vec<String> = parts
            .map(|(axis, v)| format!("{}{axis}", if v < 0.0 { '−' } else { '+' }))
            .collect();
        parts.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_upright() {
        let camera = Camera::from([1.0, -1.0, 0.5]);
        let [right, up] = camera.flat([0.0, 0.0, 1.0]);
        assert!(right.abs() < 1e-15 && up > 0.0);
        assert!(dot(cross(camera.right, camera.up), camera.back) > 1.0 - 1e-12);
        assert_eq!(camera.name(), "+x, −y, +z");
        // Faces turned away are dark, and none is brighter than the light.
        assert!(camera.shade(camera.back) > camera.shade(camera.right));
        assert!(camera.shade([0.0, 1.0, 0.0]) >= 0.0 && camera.shade(camera.back) <= 1.0);
    }
}
