//! Rigid obstacles.

use super::nodes::shares;
use super::transformed::Transformed;
use super::{
    ContactError, ContactPlace, Friction, PairOptions, SlipBound, checked, frame, rounding,
};
use crate::elasticity::Body;
use crate::mesh::vector::{dot, length, minus, unit};
use crate::mesh::{ElementKind, Facet, Topology, nodes_of_facets};

/// A rigid obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Obstacle<const D: usize = 2> {
    /// Everything behind the plane (in the plane the line) through `point`; `normal` (any length) points out of the
    /// obstacle.
    HalfSpace {
        /// Any point of the surface.
        point: [f64; D],
        /// The direction out of the obstacle.
        normal: [f64; D],
    },
    /// A ball (in the plane a disc); the body is outside.
    Sphere {
        /// Its centre.
        center: [f64; D],
        /// Its radius.
        radius: f64,
    },
    /// An endless cylinder in space; the body is outside.
    Cylinder {
        /// Any point of its axis.
        point: [f64; D],
        /// The direction of its axis (any length).
        axis: [f64; D],
        /// Its radius.
        radius: f64,
    },
}

/// The component of a vector along a unit vector, and the rest perpendicular to it.
fn split<const D: usize>(v: [f64; D], along: [f64; D]) -> (f64, [f64; D]) {
    let part = dot(v, along);
    (part, std::array::from_fn(|c| v[c] - part * along[c]))
}

impl<const D: usize> Obstacle<D> {
    /// Distance of x from the obstacle (negative inside) and the unit direction from x to it.
    ///
    /// The non-penetration condition of a node at x that moves by u is ν·u ≤ distance: exact for a
    /// half-plane, linearised at x for a circle or a cylinder.
    pub fn distance(&self, x: [f64; D]) -> (f64, [f64; D]) {
        match *self {
            Self::HalfSpace { point, normal } => {
                let outward = unit(normal);
                (dot(minus(x, point), outward), outward.map(|v| -v))
            }
            Self::Sphere { center, radius } => {
                let to = minus(center, x);
                (length(to) - radius, unit(to))
            }
            Self::Cylinder {
                point,
                axis,
                radius,
            } => {
                let (_, across) = split(minus(point, x), unit(axis));
                (length(across) - radius, unit(across))
            }
        }
    }

    /// The change of the direction away from it as x moves by v: ∇∇φ v, with the distance φ.
    pub(crate) fn bend(&self, x: [f64; D], v: [f64; D]) -> [f64; D] {
        let (to, along) = match *self {
            Self::HalfSpace { .. } => return [0.0; D],
            Self::Sphere { center, .. } => (minus(center, x), None),
            Self::Cylinder { point, axis, .. } => {
                let axis = unit(axis);
                (split(minus(point, x), axis).1, Some(axis))
            }
        };
        let (far, way) = (length(to), unit(to));
        let ways = [Some(way), along].into_iter().flatten();
        let left = ways.fold(v, |left, way| split(left, way).1);
        left.map(|v| v / far)
    }

    /// The way along its surface from one of its points to another, as a vector there.
    pub(crate) fn way(&self, from: [f64; D], to: [f64; D]) -> [f64; D] {
        // Round a circle about an axis or a centre.
        let round = |from: [f64; D], to: [f64; D], radius: f64| {
            let (from, to) = (unit(from), unit(to));
            let (cos, back) = split(from, to);
            let sin = length(back);
            match sin > 0.0 {
                true => back.map(|v| -radius * sin.atan2(cos) / sin * v),
                false => [0.0; D],
            }
        };
        match *self {
            Self::HalfSpace { .. } => minus(to, from),
            Self::Sphere { center, radius } => {
                round(minus(from, center), minus(to, center), radius)
            }
            Self::Cylinder {
                point,
                axis,
                radius,
            } => {
                let axis = unit(axis);
                let parts = [from, to].map(|x| split(minus(x, point), axis));
                let turned = round(parts[0].1, parts[1].1, radius);
                let along = parts[1].0 - parts[0].0;
                std::array::from_fn(|c| turned[c] + along * axis[c])
            }
        }
    }

    /// Smallest and largest corner of a box around it.
    pub(super) fn bounds(&self) -> ([f64; D], [f64; D]) {
        match *self {
            Self::HalfSpace { .. } => ([f64::NEG_INFINITY; D], [f64::INFINITY; D]),
            Self::Sphere { center, radius } => {
                (center.map(|c| c - radius), center.map(|c| c + radius))
            }
            Self::Cylinder {
                point,
                axis,
                radius,
            } => {
                let reach = axis.map(|a| if a == 0.0 { radius } else { f64::INFINITY });
                (
                    std::array::from_fn(|c| point[c] - reach[c]),
                    std::array::from_fn(|c| point[c] + reach[c]),
                )
            }
        }
    }

    /// Its name: "half-plane", "circle"; in space "half-space", "sphere", "cylinder".
    pub const fn name(&self) -> &'static str {
        match self {
            Self::HalfSpace { .. } if D == 2 => "half-plane",
            Self::HalfSpace { .. } => "half-space",
            Self::Sphere { .. } if D == 2 => "circle",
            Self::Sphere { .. } => "sphere",
            Self::Cylinder { .. } => "cylinder",
        }
    }

    /// The error about a boundary that does not face it.
    fn unseen(&self) -> ContactError {
        let (obstacle, solid) = match self {
            Self::HalfSpace { .. } => {
                return ContactError::FacesAway {
                    obstacle: self.name(),
                };
            }
            Self::Sphere { .. } if D == 2 => (self.name(), "disc"),
            Self::Sphere { .. } => (self.name(), "ball"),
            Self::Cylinder { .. } => (self.name(), "solid cylinder"),
        };
        ContactError::Inside { obstacle, solid }
    }
}

/// The contact nodes of a boundary against an obstacle.
///
/// Each node takes its normal and gap from the nearest point of the obstacle; a Tresca bound becomes the nodal force ∫
/// bound φᵢ ds (times the thickness). On facets of second order φ are not the shape functions but those of
/// `contact/transformed.rs`. The integrals of shape functions vanish at the corners of six-node triangles and are
/// negative at those of eight-node quadrilaterals. Overlaps below 1e-9 of the size of the mesh count as touching. No
/// node can pass through the obstacle, however far it was from it. But where the gap is larger than the search distance
/// there is no Tresca friction, which would act without a pressure.
pub fn obstacle_contact<const D: usize>(
    body: &Body<D>,
    facets: &[Facet<D>],
    obstacle: &Obstacle<D>,
    options: &PairOptions<D>,
) -> Result<Vec<ContactPlace<D>>, ContactError>
where
    ElementKind: Topology<D>,
{
    let mesh = body.mesh;
    let rounding = rounding(body);
    let nodes = nodes_of_facets(facets);
    let faces = |facet: &Facet<D>| {
        let (_, outward) = mesh.facet_normal(facet);
        let (_, towards) = obstacle.distance(mesh.facet_middle(facet));
        // An undefined direction is a separate error below.
        !(dot(outward, towards) <= 0.0)
    };
    let inside = |&node: &u32| obstacle.distance(mesh.nodes[node as usize]).0 < -rounding;
    let round = !matches!(obstacle, Obstacle::HalfSpace { .. });
    let within = round && !options.overlap && nodes.iter().all(inside);
    if within || !facets.iter().any(faces) {
        return Err(obstacle.unseen());
    }
    let near = options.distance_to(body, facets, obstacle);
    let transformed = Transformed::new(body.plane, facets);
    let area = shares(body, facets);
    let mut bound = vec![0.0; mesh.nodes.len()];
    if let Friction::Tresca(tresca) = options.friction {
        body.integrate_on_boundary(facets, tresca, &mut bound);
        transformed.share(&mut bound);
    }
    // The distance is interpolated from all nodes of a facet, as the place of a node sees it.
    let felt = |node: u32, distance: &dyn Fn(u32) -> f64| -> f64 {
        let own = transformed.own(node);
        own.iter()
            .map(|&(other, weight)| weight * distance(other))
            .sum()
    };
    (0..)
        .zip(nodes)
        .map(|(number, node)| {
            let i = node as usize;
            let place = mesh.nodes[i];
            let (_, normal) = obstacle.distance(place);
            if !normal.iter().all(|v| v.is_finite()) {
                return Err(ContactError::NoNormal {
                    place: place.into(),
                    obstacle: obstacle.name(),
                });
            }
            let gap_of = |node: u32| {
                let x = mesh.nodes[node as usize];
                options.gap_at(x, obstacle.distance(x).0, rounding)
            };
            let gap = gap_of(node);
            if options.interference.is_some() {
                checked("interference", place, -gap)?;
            } else if options.gap.is_some() {
                checked("gap", place, gap)?;
            } else if gap < 0.0 && !options.overlap {
                return Err(ContactError::Overlap {
                    place: place.into(),
                    depth: -gap,
                });
            }
            let slip_bound = match options.friction.at(place, bound[i])? {
                SlipBound::Given(_) if gap > near => SlipBound::Given(0.0),
                slip_bound => slip_bound,
            };
            Ok(ContactPlace {
                place,
                node: Some(node),
                own: transformed.own(node),
                partners: Vec::new(),
                directed: Vec::new(),
                further: Vec::new(),
                sectors: None,
                frame: frame(normal),
                gap: felt(node, &gap_of),
                area: area[i],
                part: 0,
                pool: number,
                slip_bound,
                compliance: options.compliance_at(place, area[i])?,
            })
        })
        .collect()
}
