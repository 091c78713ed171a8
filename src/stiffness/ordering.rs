//! Fill-reducing orders that put the unknowns of the contact last.
//!
//! The graph of the blocks is ordered, not that of the unknowns: a quarter of the entries in the plane, a ninth in
//! space. Where coordinates are known, nested dissection by coordinates keeps the boundary in contact for the end at no
//! cost in fill. Without them, joining the contact unknowns of a body into a clique makes approximate minimum degree
//! plan for it.

use crate::sparse::BlockCsr;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

/// An order of the unknowns with the contact last.
pub(super) struct Ordering {
    /// `order[position] = unknown`.
    pub order: Vec<u32>,
    /// Positions before the trailing blocks.
    pub n_leading: usize,
    /// Sizes of the trailing blocks, one per body with contact. Empty, with `n_leading = 0`, if a dense
    /// trailing block would be larger than the fill that a free order has.
    pub sizes: Vec<usize>,
}

/// A subgraph with at most this many blocks is ordered by minimum degree, which is as good as dissection in the plane
/// and fills far more in space.
const fn leaf(dimension: usize) -> usize {
    if dimension == 3 { 100 } else { 3000 }
}

/// Whether a dense trailing block of `contact²` blocks pays. It has half as many entries, compared with a fill that is
/// several times the entries of K in the plane, and grows like a power 4/3 of the nodes in space.
fn pays(dimension: usize, contact: usize, n_blocks: usize, n_nodes: usize) -> bool {
    let fill = match dimension {
        3 => 4.0 * (n_nodes as f64).powf(4.0 / 3.0),
        _ => 0.0,
    };
    contact <= 4 * n_blocks || contact <= 1 << 16 || contact as f64 <= fill
}

/// Orders the unknowns of K; `touched` tells which blocks B touches.
pub(super) fn contact_last<const D: usize>(
    k: &BlockCsr<D>,
    coordinates: Option<&[[f64; D]]>,
    touched: &[bool],
) -> Ordering {
    let (n_components, component) = k.components();
    let mut contact: Vec<Vec<u32>> = vec![Vec::new(); n_components];
    let mut interior: Vec<Vec<u32>> = vec![Vec::new(); n_components];
    for i in 0..k.n_block_rows() {
        let body = component[i] as usize;
        let list = if touched[i] {
            &mut contact
        } else {
            &mut interior
        };
        list[body].push(i as u32);
    }
    let dense: usize = contact.iter().map(|c| c.len() * c.len()).sum();
    let trailing = pays(D, dense, k.n_blocks(), k.n_block_rows());
    if !trailing {
        // Nodes of the contact are ordered like others.
        for (interior, contact) in interior.iter_mut().zip(&mut contact) {
            interior.append(contact);
        }
    }

    let mut blocks: Vec<u32> = Vec::with_capacity(k.n_block_rows());
    match coordinates {
        Some(points) if (trailing || D == 3) && points.len() == k.n_block_rows() => {
            let mut part = vec![0u32; k.n_block_rows()];
            for nodes in &mut interior {
                Dissection {
                    k,
                    points,
                    part: &mut part,
                    next_part: 1,
                    order: &mut blocks,
                }
                .dissect(nodes);
                // Parts are counted from the start for the next body: it has no edge to this one.
            }
        }
        _ => {
            let cliques: &[Vec<u32>] = if trailing { &contact } else { &[] };
            let all: Vec<u32> = (0..k.n_block_rows() as u32).collect();
            let order = minimum_degree(k, &all, cliques);
            blocks.extend(
                order
                    .into_iter()
                    .filter(|&block| !(trailing && touched[block as usize])),
            );
        }
    }
    let n_leading = if trailing { D * blocks.len() } else { 0 };
    let mut sizes = Vec::new();
    if trailing {
        for nodes in contact.iter().filter(|nodes| !nodes.is_empty()) {
            sizes.push(D * nodes.len());
            blocks.extend(nodes);
        }
    }
    Ordering {
        order: blocks
            .into_iter()
            .flat_map(|block| (0..D as u32).map(move |c| D as u32 * block + c))
            .collect(),
        n_leading,
        sizes,
    }
}

/// Nested dissection by coordinates.
struct Dissection<'a, const D: usize> {
    k: &'a BlockCsr<D>,
    points: &'a [[f64; D]],
    /// The present part of a block; 0 for those that no longer belong to any.
    part: &'a mut [u32],
    next_part: u32,
    order: &'a mut Vec<u32>,
}

impl<const D: usize> Dissection<'_, D> {
    /// Appends an order of `nodes`: one half, the other half, then the blocks between them.
    fn dissect(&mut self, nodes: &mut [u32]) {
        if nodes.len() <= leaf(D) {
            let order = minimum_degree(self.k, nodes, &[]);
            self.order.extend(order);
            return;
        }
        let (mut low, mut high) = ([f64::INFINITY; D], [f64::NEG_INFINITY; D]);
        for &node in nodes.iter() {
            for c in 0..D {
                low[c] = low[c].min(self.points[node as usize][c]);
                high[c] = high[c].max(self.points[node as usize][c]);
            }
        }
        let extent = |c: usize| high[c] - low[c];
        let axis = (1..D).fold(0, |axis, c| if extent(c) > extent(axis) { c } else { axis });
        let middle = nodes.len() / 2;
        let points = self.points;
        nodes.select_nth_unstable_by(middle, |&a, &b| {
            let (p, q) = (points[a as usize], points[b as usize]);
            let others = (0..D).filter(|&c| c != axis);
            (std::iter::once(axis).chain(others))
                .map(|c| p[c].total_cmp(&q[c]))
                .find(|order| order.is_ne())
                .unwrap_or_else(|| a.cmp(&b))
        });
        let (left, right) = (self.next_part, self.next_part + 1);
        self.next_part += 2;
        for (i, &node) in nodes.iter().enumerate() {
            self.part[node as usize] = if i < middle { left } else { right };
        }
        // Those of the left half with a neighbour in the right half separate the two.
        let k = self.k;
        let part = &*self.part;
        let (kept, between): (Vec<u32>, Vec<u32>) = nodes[..middle].iter().partition(|&&node| {
            k.row(node as usize)
                .0
                .iter()
                .all(|&j| part[j as usize] != right)
        });
        for &node in &between {
            self.part[node as usize] = 0;
        }
        let mut kept = kept;
        self.dissect(&mut kept);
        self.dissect(&mut nodes[middle..]);
        self.order.extend(between);
    }
}

/// Approximate minimum degree on the subgraph of `nodes`, with the given cliques added (lists of
/// sorted node numbers; only with all nodes).
fn minimum_degree<const D: usize>(
    k: &BlockCsr<D>,
    nodes: &[u32],
    cliques: &[Vec<u32>],
) -> Vec<u32> {
    let n = nodes.len();
    if n < 3 {
        return nodes.to_vec();
    }
    let mut sorted = nodes.to_vec();
    sorted.sort_unstable();
    let mut col_ptr = Vec::with_capacity(n + 1);
    let mut row_idx: Vec<u32> = Vec::with_capacity(5 * n);
    col_ptr.push(0u32);
    let mut clique_of = vec![usize::MAX; if cliques.is_empty() { 0 } else { n }];
    for (c, clique) in cliques.iter().enumerate() {
        for &node in clique {
            clique_of[node as usize] = c;
        }
    }
    let all = sorted.len() == k.n_block_rows();
    for (i, &node) in sorted.iter().enumerate() {
        let first = row_idx.len();
        // One triangle is enough for the ordering.
        for &j in k.row(node as usize).0.iter().take_while(|&&j| j < node) {
            if all {
                row_idx.push(j);
            } else if let Ok(place) = sorted[..i].binary_search(&j) {
                row_idx.push(place as u32);
            }
        }
        if let Some(clique) = clique_of.get(i).and_then(|&c| cliques.get(c)) {
            row_idx.extend(clique.iter().take_while(|&&j| (j as usize) < i));
            row_idx[first..].sort_unstable();
            let mut kept = first;
            for r in first..row_idx.len() {
                if kept == first || row_idx[kept - 1] != row_idx[r] {
                    row_idx[kept] = row_idx[r];
                    kept += 1;
                }
            }
            row_idx.truncate(kept);
        }
        col_ptr.push(row_idx.len() as u32);
    }
    let pattern = SymbolicSparseColMatRef::new_unsorted_checked(n, n, &col_ptr, None, &row_idx);
    let mut perm = vec![0u32; n];
    let mut perm_inverse = vec![0u32; n];
    let scratch = amd::order_maybe_unsorted_scratch::<u32>(n, row_idx.len());
    let ordered = MemBuffer::try_new(scratch).ok().and_then(|mut memory| {
        amd::order_maybe_unsorted(
            &mut perm,
            &mut perm_inverse,
            pattern,
            amd::Control::default(),
            MemStack::new(&mut memory),
        )
        .ok()
    });
    match ordered {
        Some(_) => perm.into_iter().map(|i| sorted[i as usize]).collect(),
        // Any order is correct; this one only fills more.
        None => sorted,
    }
}
