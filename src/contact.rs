//! Contact with a rigid obstacle: from a boundary to the rows of N and T, the gaps d and the slip bounds g.

use crate::elasticity::{Body, Field, Unknowns};
use crate::sparse::Csr;

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

/// A node of a contact boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactNode {
    /// The node of the mesh.
    pub node: u32,
    /// The node of the other body that it meets; None for a rigid obstacle.
    pub partner: Option<u32>,
    /// ν: the unit direction towards the obstacle or the other body.
    pub normal: [f64; 2],
    /// Initial distance along ν.
    pub gap: f64,
    /// ∫ φ ds times the thickness: the area that turns nodal forces into stresses.
    pub area: f64,
    /// Tresca bound as a nodal force.
    pub slip_bound: f64,
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
        "the node at ({x:.6e}, {y:.6e}) lies {depth:.3e} inside the obstacle: move the body or the obstacle apart"
    )]
    Overlap { x: f64, y: f64, depth: f64 },
    #[error(
        "the node at ({x:.6e}, {y:.6e}) belongs to two contacts: let their boundaries share no node"
    )]
    Twice { x: f64, y: f64 },
    #[error(
        "the node at ({x:.6e}, {y:.6e}) lies at the centre of the circle, so its normal is undefined"
    )]
    NoNormal { x: f64, y: f64 },
    #[error("the Tresca bound is {value} at ({x:.6e}, {y:.6e}): it must be a finite number ≥ 0")]
    SlipBound { x: f64, y: f64, value: f64 },
}

/// The contact nodes of a boundary against an obstacle; `tresca` is the slip bound in Pa.
///
/// Each node takes its normal and gap from the nearest point of the obstacle, and its slip bound is
/// ∫ tresca φᵢ ds over the boundary (times the thickness). Overlaps below 1e-9 of the size of the mesh
/// count as touching.
pub fn obstacle_contact(
    body: &Body,
    edges: &[[u32; 2]],
    obstacle: &Obstacle,
    tresca: Field,
) -> Result<Vec<ContactNode>, ContactError> {
    let mesh = body.mesh;
    let (low, high) = mesh.bounding_box();
    let rounding = 1e-9 * (high[0] - low[0]).hypot(high[1] - low[1]);
    boundary_shares(body, edges, tresca)?
        .into_iter()
        .map(|(node, area, slip_bound)| {
            let [x, y] = mesh.nodes[node as usize];
            let (gap, normal) = obstacle.distance([x, y]);
            if !normal.iter().all(|v| v.is_finite()) {
                return Err(ContactError::NoNormal { x, y });
            }
            if gap < -rounding {
                return Err(ContactError::Overlap { x, y, depth: -gap });
            }
            Ok(ContactNode {
                node,
                partner: None,
                normal,
                gap: if gap.abs() <= rounding { 0.0 } else { gap },
                area,
                slip_bound,
            })
        })
        .collect()
}

/// The contact nodes where two bodies meet node by node: `edges` of the one, and for each of its nodes
/// the partner with the same coordinates on the other; ν is the outward normal of the first body, which
/// must be straight there.
pub fn matching_contact(
    body: &Body,
    edges: &[[u32; 2]],
    normal: [f64; 2],
    partner: impl Fn(u32) -> u32,
    tresca: Field,
) -> Result<Vec<ContactNode>, ContactError> {
    Ok(boundary_shares(body, edges, tresca)?
        .into_iter()
        .map(|(node, area, slip_bound)| ContactNode {
            node,
            partner: Some(partner(node)),
            normal,
            gap: 0.0,
            area,
            slip_bound,
        })
        .collect())
}

/// For every node of the edges: (node, ∫ φ ds, ∫ tresca φ ds), times the thickness.
fn boundary_shares(
    body: &Body,
    edges: &[[u32; 2]],
    tresca: Field,
) -> Result<Vec<(u32, f64, f64)>, ContactError> {
    let mut nodes: Vec<u32> = edges.iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    let mut area = vec![0.0; body.mesh.nodes.len()];
    let mut bound = area.clone();
    body.integrate_on_boundary(edges, &|_| 1.0, &mut area);
    body.integrate_on_boundary(edges, tresca, &mut bound);
    nodes
        .into_iter()
        .map(|node| {
            let i = node as usize;
            let [x, y] = body.mesh.nodes[i];
            let value = tresca([x, y]);
            if !(value >= 0.0 && value.is_finite() && bound[i] >= 0.0 && bound[i].is_finite()) {
                return Err(ContactError::SlipBound { x, y, value });
            }
            Ok((node, area[i], bound[i]))
        })
        .collect()
}

/// N, T, d, g over the unknowns, with the contact nodes that their rows belong to.
#[derive(Clone, Debug)]
pub struct ContactRows {
    /// The contact node of each row.
    pub nodes: Vec<ContactNode>,
    pub normal: Csr,
    pub tangential: Csr,
    pub gap: Vec<f64>,
    pub slip_bound: Vec<f64>,
}

/// Writes the rows of the contact nodes.
///
/// Prescribed displacements move into the gap. A node whose normal displacement is prescribed drops
/// out; one that cannot move sideways gets an empty row in T and the slip bound 0.
pub fn contact_rows(
    body: &Body,
    unknowns: &Unknowns,
    candidates: &[ContactNode],
) -> Result<ContactRows, ContactError> {
    let place = |node: u32| body.mesh.nodes[node as usize];
    let mut seen = std::collections::HashSet::new();
    let (mut nodes, mut gap, mut slip_bound) = (Vec::new(), Vec::new(), Vec::new());
    let (mut n_entries, mut t_entries) = (Vec::new(), Vec::new());
    for candidate in candidates {
        let [x, y] = place(candidate.node);
        if !seen.insert(candidate.node) {
            return Err(ContactError::Twice { x, y });
        }
        let i = nodes.len();
        let mut d = candidate.gap;
        // The entries of a row for direction v: v at the node, −v at its partner.
        let row = |v: [f64; 2], moved: &mut f64| {
            let mut entries = Vec::with_capacity(4);
            let ends = [(Some(candidate.node), 1.0), (candidate.partner, -1.0)];
            for (node, sign) in ends {
                let Some(node) = node else { continue };
                for c in 0..2 {
                    let value = sign * v[c];
                    // What is left of a cosine of a right angle is rounding.
                    if value.abs() < 1e-14 {
                        continue;
                    }
                    match unknowns.prescribed(node)[c] {
                        Some(given) => *moved += value * given,
                        None => {
                            let block = unknowns.block(node).expect("it has a free component");
                            entries.push((i, 2 * block as usize + c, value));
                        }
                    }
                }
            }
            entries
        };
        let mut moved = 0.0;
        let normal_row = row(candidate.normal, &mut moved);
        d -= moved;
        let tangential_row = row(candidate.tangent(), &mut 0.0);
        let parallel = normal_row.len() == 1
            && tangential_row.len() == 1
            && normal_row[0].1 == tangential_row[0].1;
        if d < 0.0 {
            return Err(ContactError::Overlap { x, y, depth: -d });
        }
        if normal_row.is_empty() {
            continue;
        }
        n_entries.extend(normal_row);
        let can_slide = !tangential_row.is_empty() && !parallel;
        if can_slide {
            t_entries.extend(tangential_row);
        }
        gap.push(d);
        slip_bound.push(if can_slide { candidate.slip_bound } else { 0.0 });
        nodes.push(*candidate);
    }
    let (m, n) = (nodes.len(), 2 * unknowns.n_blocks());
    Ok(ContactRows {
        normal: Csr::from_triplets(m, n, n_entries),
        tangential: Csr::from_triplets(m, n, t_entries),
        nodes,
        gap,
        slip_bound,
    })
}
