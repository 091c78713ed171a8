//! Rigid obstacles.

use super::{
    ContactError, ContactNode, Friction, PairOptions, SlipBound, checked, frame, rounding,
};
use crate::elasticity::Body;
use crate::mesh::vector::{dot, length, minus, unit};

/// A rigid obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Obstacle<const D: usize = 2> {
    /// Everything behind the line (in space the plane) through `point`; `normal` (any length) points out of the
    /// obstacle.
    HalfPlane {
        /// Any point of the surface.
        point: [f64; D],
        /// The direction out of the obstacle.
        normal: [f64; D],
    },
    /// A disc (in space a ball); the body lies outside.
    Circle {
        /// Its centre.
        center: [f64; D],
        /// Its radius.
        radius: f64,
    },
}

impl<const D: usize> Obstacle<D> {
    /// Distance of x from the obstacle (negative inside) and the unit direction from x to it.
    ///
    /// The non-penetration condition of a node at x that moves by u is ν·u ≤ distance: exact for a
    /// half-plane, linearised at x for a circle.
    pub fn distance(&self, x: [f64; D]) -> (f64, [f64; D]) {
        match *self {
            Self::HalfPlane { point, normal } => {
                let outward = unit(normal);
                (dot(minus(x, point), outward), outward.map(|v| -v))
            }
            Self::Circle { center, radius } => {
                let to = minus(center, x);
                (length(to) - radius, unit(to))
            }
        }
    }

    /// Smallest and largest corner of a box around it.
    pub(super) fn bounds(&self) -> ([f64; D], [f64; D]) {
        match *self {
            Self::HalfPlane { .. } => ([f64::NEG_INFINITY; D], [f64::INFINITY; D]),
            Self::Circle { center, radius } => {
                (center.map(|c| c - radius), center.map(|c| c + radius))
            }
        }
    }
}

/// The contact nodes of a boundary against an obstacle.
///
/// Each node takes its normal and gap from the nearest point of the obstacle; a Tresca bound becomes the
/// nodal force ∫ bound φᵢ ds (times the thickness). Overlaps below 1e-9 of the size of the mesh count as
/// touching. No node can pass through the obstacle, however far it was from it; but where the gap is larger than
/// the search distance there is no friction of Tresca's kind, which would rub without a pressure.
pub fn obstacle_contact(
    body: &Body,
    edges: &[[u32; 2]],
    obstacle: &Obstacle,
    options: &PairOptions,
) -> Result<Vec<ContactNode>, ContactError> {
    let mesh = body.mesh;
    let rounding = rounding(body);
    let mut nodes: Vec<u32> = edges.iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    let faces = |&edge: &[u32; 2]| {
        let (_, outward) = mesh.edge_normal(edge);
        let [p, q] = edge.map(|node| mesh.nodes[node as usize]);
        let (_, towards) = obstacle.distance([0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])]);
        // An undefined direction is an error of its own below.
        !(dot(outward, towards) <= 0.0)
    };
    let inside = |&node: &u32| obstacle.distance(mesh.nodes[node as usize]).0 < -rounding;
    let circle = matches!(obstacle, Obstacle::Circle { .. });
    if circle && nodes.iter().all(inside) {
        return Err(ContactError::InsideCircle);
    }
    if !edges.iter().any(faces) {
        return Err(if circle {
            ContactError::InsideCircle
        } else {
            ContactError::FacesAway
        });
    }
    let near = options.distance_to(body, edges, obstacle);
    let mut area = vec![0.0; mesh.nodes.len()];
    let mut bound = area.clone();
    body.integrate_on_boundary(edges, &|_| 1.0, &mut area);
    if let Friction::Tresca(tresca) = options.friction {
        body.integrate_on_boundary(edges, tresca, &mut bound);
    }
    nodes
        .into_iter()
        .map(|node| {
            let i = node as usize;
            let place = mesh.nodes[i];
            let (distance, normal) = obstacle.distance(place);
            if !normal.iter().all(|v| v.is_finite()) {
                return Err(ContactError::NoNormal {
                    place: place.into(),
                });
            }
            let gap = options.gap_at(place, distance, rounding);
            if options.gap.is_some() {
                checked("gap", place, gap)?;
            } else if gap < 0.0 {
                return Err(ContactError::Overlap {
                    place: place.into(),
                    depth: -gap,
                });
            }
            let slip_bound = match options.friction.at(place, bound[i])? {
                SlipBound::Given(_) if gap > near => SlipBound::Given(0.0),
                slip_bound => slip_bound,
            };
            Ok(ContactNode {
                node,
                partners: Vec::new(),
                frame: frame(normal),
                gap,
                area: area[i],
                slip_bound,
            })
        })
        .collect()
}
