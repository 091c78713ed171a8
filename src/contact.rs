//! Contact: from boundaries to the rows of N and T, the gaps d and the slip bounds g.
//!
//! A boundary meets a rigid [`Obstacle`] node by node ([`obstacle_contact`]), or the boundary of another body
//! through a mortar coupling of meshes that need not match ([`mortar_contact`]).

mod mortar;
mod rows;

pub use mortar::mortar_contact;
pub use rows::{ContactRows, contact_rows};

use crate::elasticity::{Body, Field};
use crate::mesh::bounds;

/// A rigid obstacle in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Obstacle {
    /// Everything behind the line through `point`; `normal` (any length) points out of the obstacle.
    HalfPlane { point: [f64; 2], normal: [f64; 2] },
    /// A disc; the body lies outside.
    Circle { center: [f64; 2], radius: f64 },
}

impl Obstacle {
    /// Distance of x from the obstacle (negative inside) and the unit direction from x to it.
    ///
    /// The non-penetration condition of a node at x that moves by u is ν·u ≤ distance: exact for a
    /// half-plane, linearised at x for a circle.
    pub fn distance(&self, x: [f64; 2]) -> (f64, [f64; 2]) {
        match *self {
            Self::HalfPlane { point, normal } => {
                let length = normal[0].hypot(normal[1]);
                let [a, b] = normal.map(|v| v / length);
                ((x[0] - point[0]) * a + (x[1] - point[1]) * b, [-a, -b])
            }
            Self::Circle { center, radius } => {
                let (dx, dy) = (center[0] - x[0], center[1] - x[1]);
                let length = dx.hypot(dy);
                (length - radius, [dx / length, dy / length])
            }
        }
    }
}

/// A friction law on a contact boundary.
#[derive(Clone, Copy)]
pub enum Friction<'a> {
    /// No friction.
    None,
    /// A given bound of the tangential traction, in Pa.
    Tresca(Field<'a>),
    /// A coefficient μ: the bound is μ times the contact pressure.
    Coulomb(Field<'a>),
}

impl Friction<'_> {
    /// The slip bound of a node at x, whose share of a Tresca bound is `force`.
    fn at(&self, x: [f64; 2], force: f64) -> Result<SlipBound, ContactError> {
        Ok(match self {
            Self::None => SlipBound::Given(0.0),
            Self::Tresca(tresca) => {
                checked("Tresca bound", x, tresca(x))?;
                SlipBound::Given(checked("Tresca bound", x, force)?)
            }
            Self::Coulomb(mu) => SlipBound::Coulomb(checked("coefficient of friction", x, mu(x))?),
        })
    }
}

/// How the slip bound of a contact node comes about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SlipBound {
    /// A given force (Tresca; 0 without friction).
    Given(f64),
    /// This coefficient times the normal force (Coulomb).
    Coulomb(f64),
}

/// What is said about a contact beside its boundaries.
#[derive(Clone, Copy)]
pub struct PairOptions<'a> {
    /// The friction law.
    pub friction: Friction<'a>,
    /// The initial gap as a function of the place, instead of the distance of the meshes.
    pub gap: Option<Field<'a>>,
    /// Gaps and overlaps up to this distance count as touching.
    pub adjust: f64,
    /// What lies farther apart is no candidate for contact between bodies, and Tresca's bound does not act there
    /// on an obstacle; None: half the diagonal of the box around the smaller boundary.
    pub search_distance: Option<f64>,
}

impl Default for PairOptions<'_> {
    fn default() -> Self {
        Self {
            friction: Friction::None,
            gap: None,
            adjust: 0.0,
            search_distance: None,
        }
    }
}

impl PairOptions<'_> {
    /// The gap that counts at x, where the geometry says `distance`.
    fn gap_at(&self, x: [f64; 2], distance: f64, rounding: f64) -> f64 {
        let gap = self.gap.map_or(distance, |gap| gap(x));
        if gap.abs() <= rounding.max(self.adjust) {
            0.0
        } else {
            gap
        }
    }
}

/// A node of a contact boundary.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactNode {
    /// The node of the mesh.
    pub node: u32,
    /// The nodes of the other body that it meets, with weights that add up to 1; none for a rigid obstacle.
    pub partners: Vec<(u32, f64)>,
    /// ν: the unit direction towards the obstacle or the other body.
    pub normal: [f64; 2],
    /// Initial distance along ν.
    pub gap: f64,
    /// ∫ φ ds times the thickness, over what may come into contact: the area that turns nodal forces into
    /// stresses.
    pub area: f64,
    /// The slip bound as a nodal force.
    pub slip_bound: SlipBound,
}

impl SlipBound {
    /// Whether it allows any friction.
    pub fn is_any(&self) -> bool {
        let (Self::Given(figure) | Self::Coulomb(figure)) = *self;
        figure > 0.0
    }
}

impl ContactNode {
    /// The unit tangent: ν turned counter-clockwise by a right angle.
    pub fn tangent(&self) -> [f64; 2] {
        [-self.normal[1], self.normal[0]]
    }
}

/// What is wrong with a contact definition.
#[derive(Debug, thiserror::Error)]
pub enum ContactError {
    #[error(
        "the node at ({x:.6e}, {y:.6e}) lies {depth:.3e} inside the obstacle: move the body or the obstacle apart, \
         or let overlaps up to that count as touching (adjust)"
    )]
    Overlap { x: f64, y: f64, depth: f64 },
    #[error(
        "the boundaries overlap by {depth:.3e} at ({x:.6e}, {y:.6e}): move the bodies apart, let overlaps up to \
         that count as touching (adjust), or give the gap"
    )]
    BodiesOverlap { x: f64, y: f64, depth: f64 },
    #[error(
        "the node at ({x:.6e}, {y:.6e}) would belong to several contacts whose normals are not independent in what \
         supports leave it of its freedom (on rigid obstacles two directions at most, clearly different): name the \
         boundary in fewer contacts, let what it meets there differ in direction, or free the node"
    )]
    Twice { x: f64, y: f64 },
    #[error(
        "the node at ({x:.6e}, {y:.6e}) is held by a support, and what it meets has too few unknowns of its own left \
         for a contact force or friction there: name the other boundary first"
    )]
    Dependent { x: f64, y: f64 },
    #[error(
        "supports drive the node at ({x:.6e}, {y:.6e}) {depth:.3e} into what it is in contact with, and leave it no \
         freedom to give way: change the prescribed displacement, or free the node"
    )]
    Driven { x: f64, y: f64, depth: f64 },
    #[error("the node at ({x:.6e}, {y:.6e}) belongs to both boundaries of the contact")]
    Shared { x: f64, y: f64 },
    #[error(
        "no part of it faces the obstacle: the normal of a half-plane points out of the obstacle, towards the body"
    )]
    FacesAway,
    #[error(
        "no part of it faces the circle from outside: the obstacle is the disc itself, which the body must lie \
         outside of; a hole around a body is no obstacle of this kind (mesh its wall, hold it, and let the body meet that boundary)"
    )]
    InsideCircle,
    #[error(
        "the node at ({x:.6e}, {y:.6e}) lies at the centre of the circle, so its normal is undefined"
    )]
    NoNormal { x: f64, y: f64 },
    #[error("the boundary turns back on itself at ({x:.6e}, {y:.6e}), so its normal is undefined")]
    Folded { x: f64, y: f64 },
    #[error(
        "no part of it faces the other boundary within the search distance {distance:.3e}; they are at least {nearest:.3e} \
         apart: check the boundaries, or set search_distance"
    )]
    Apart { distance: f64, nearest: f64 },
    #[error("the {what} is {value} at ({x:.6e}, {y:.6e}): it must be a finite number ≥ 0")]
    NotPositive {
        what: &'static str,
        x: f64,
        y: f64,
        value: f64,
    },
}

/// The rounding of coordinates: what this distance and less means touching.
fn rounding(body: &Body) -> f64 {
    let (low, high) = body.mesh.bounding_box();
    1e-9 * (high[0] - low[0]).hypot(high[1] - low[1])
}

/// A value that must be finite and not negative.
fn checked(what: &'static str, [x, y]: [f64; 2], value: f64) -> Result<f64, ContactError> {
    if value >= 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(ContactError::NotPositive { what, x, y, value })
    }
}

/// How far apart two boundaries may be where nobody has said it: half the diagonal of the smaller of the boxes around
/// them.
fn reach(boxes: [([f64; 2], [f64; 2]); 2]) -> f64 {
    let diagonal = |(low, high): ([f64; 2], [f64; 2])| (high[0] - low[0]).hypot(high[1] - low[1]);
    0.5 * diagonal(boxes[0]).min(diagonal(boxes[1]))
}

/// The box around the nodes of some edges.
fn around(body: &Body, edges: &[[u32; 2]]) -> ([f64; 2], [f64; 2]) {
    let nodes = edges.iter().flatten();
    bounds(nodes.map(|&node| body.mesh.nodes[node as usize]))
}

impl PairOptions<'_> {
    /// The search distance between the boundary `edges` and another one.
    pub fn distance_between(&self, body: &Body, edges: &[[u32; 2]], others: &[[u32; 2]]) -> f64 {
        self.search_distance
            .unwrap_or_else(|| reach([around(body, edges), around(body, others)]))
    }

    /// The search distance between the boundary `edges` and an obstacle.
    pub fn distance_to(&self, body: &Body, edges: &[[u32; 2]], obstacle: &Obstacle) -> f64 {
        self.search_distance.unwrap_or_else(|| {
            let there = match *obstacle {
                Obstacle::HalfPlane { .. } => ([f64::NEG_INFINITY; 2], [f64::INFINITY; 2]),
                Obstacle::Circle { center, radius } => {
                    (center.map(|c| c - radius), center.map(|c| c + radius))
                }
            };
            reach([around(body, edges), there])
        })
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
        !(outward[0] * towards[0] + outward[1] * towards[1] <= 0.0)
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
            let [x, y] = place;
            let (distance, normal) = obstacle.distance(place);
            if !normal.iter().all(|v| v.is_finite()) {
                return Err(ContactError::NoNormal { x, y });
            }
            let gap = options.gap_at(place, distance, rounding);
            if options.gap.is_some() {
                checked("gap", place, gap)?;
            } else if gap < 0.0 {
                return Err(ContactError::Overlap { x, y, depth: -gap });
            }
            let slip_bound = match options.friction.at(place, bound[i])? {
                SlipBound::Given(_) if gap > near => SlipBound::Given(0.0),
                slip_bound => slip_bound,
            };
            Ok(ContactNode {
                node,
                partners: Vec::new(),
                normal,
                gap,
                area: area[i],
                slip_bound,
            })
        })
        .collect()
}
