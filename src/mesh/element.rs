//! Elements and their kinds.

use super::shape::{FacetPoint, Visit};
use std::fmt::Debug;
use std::hash::Hash;

/// The kinds of elements. Their nodes are in VTK's order: the corners, then a node in the middle of each edge, then those in
/// the middle of faces and of the element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum ElementKind {
    /// Three nodes in the plane, counter-clockwise.
    Triangle,
    /// The triangle of second order.
    Triangle6,
    /// A quadrilateral: four nodes in the plane, counter-clockwise.
    Quad,
    /// The quadrilateral of second order without a node in the middle (serendipity).
    Quad8,
    /// The quadrilateral of second order with a node in the middle (Lagrange).
    Quad9,
    /// Four nodes in space: a triangle, counter-clockwise as seen from the fourth node, and that.
    Tetrahedron,
    /// The tetrahedron of second order.
    Tetrahedron10,
    /// Eight nodes in space: a quadrilateral, counter-clockwise as seen from the other four, and those above its
    /// corners.
    Hexahedron,
    /// The hexahedron of second order without nodes in the middle of faces (serendipity).
    Hexahedron20,
    /// The hexahedron of second order with nodes in the middle of faces and of itself (Lagrange).
    Hexahedron27,
    /// Six nodes in space: a triangle, counter-clockwise as seen from the other three, and those above its corners.
    Wedge,
    /// The wedge of second order without nodes in the middle of faces (serendipity).
    Wedge15,
    /// The wedge of second order with nodes in the middle of its quadrilaterals (Lagrange).
    Wedge18,
    /// Five nodes in space: a quadrilateral, counter-clockwise as seen from the fifth node, and that.
    Pyramid,
}

impl ElementKind {
    /// All kinds.
    pub const ALL: [Self; 14] = [
        Self::Triangle,
        Self::Triangle6,
        Self::Quad,
        Self::Quad8,
        Self::Quad9,
        Self::Tetrahedron,
        Self::Tetrahedron10,
        Self::Hexahedron,
        Self::Hexahedron20,
        Self::Hexahedron27,
        Self::Wedge,
        Self::Wedge15,
        Self::Wedge18,
        Self::Pyramid,
    ];

    /// The number of its nodes.
    pub const fn n_nodes(self) -> usize {
        match self {
            Self::Triangle => 3,
            Self::Quad | Self::Tetrahedron => 4,
            Self::Pyramid => 5,
            Self::Triangle6 | Self::Wedge => 6,
            Self::Quad8 | Self::Hexahedron => 8,
            Self::Quad9 => 9,
            Self::Tetrahedron10 => 10,
            Self::Wedge15 => 15,
            Self::Wedge18 => 18,
            Self::Hexahedron20 => 20,
            Self::Hexahedron27 => 27,
        }
    }

    /// Its short name: its shape and the number of its nodes.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Triangle => "tri3",
            Self::Triangle6 => "tri6",
            Self::Quad => "quad4",
            Self::Quad8 => "quad8",
            Self::Quad9 => "quad9",
            Self::Tetrahedron => "tet4",
            Self::Tetrahedron10 => "tet10",
            Self::Hexahedron => "hex8",
            Self::Hexahedron20 => "hex20",
            Self::Hexahedron27 => "hex27",
            Self::Wedge => "wedge6",
            Self::Wedge15 => "wedge15",
            Self::Wedge18 => "wedge18",
            Self::Pyramid => "pyramid5",
        }
    }

    /// The kind of first order with the same corners.
    pub const fn linear(self) -> Self {
        match self {
            Self::Triangle | Self::Triangle6 => Self::Triangle,
            Self::Quad | Self::Quad8 | Self::Quad9 => Self::Quad,
            Self::Tetrahedron | Self::Tetrahedron10 => Self::Tetrahedron,
            Self::Hexahedron | Self::Hexahedron20 | Self::Hexahedron27 => Self::Hexahedron,
            Self::Wedge | Self::Wedge15 | Self::Wedge18 => Self::Wedge,
            Self::Pyramid => Self::Pyramid,
        }
    }

    /// The kind of second order with the same corners and all nodes that there are (Lagrange); None for the pyramid.
    pub const fn quadratic(self) -> Option<Self> {
        match self.linear() {
            Self::Triangle => Some(Self::Triangle6),
            Self::Quad => Some(Self::Quad9),
            Self::Tetrahedron => Some(Self::Tetrahedron10),
            Self::Hexahedron => Some(Self::Hexahedron27),
            Self::Wedge => Some(Self::Wedge18),
            _ => None,
        }
    }

    /// The number of its corners, which are the first of its nodes.
    pub const fn n_corners(self) -> usize {
        self.linear().n_nodes()
    }

    /// The degree of its shape functions along edges: 1 or 2.
    pub const fn order(self) -> usize {
        if self.n_nodes() == self.n_corners() {
            1
        } else {
            2
        }
    }

    /// Whether incompatible modes make it bend better.
    pub const fn may_have_modes(self) -> bool {
        matches!(self, Self::Quad | Self::Hexahedron)
    }

    /// The corners around each of the nodes after the corners: two for an edge, three or four for a face, all for the
    /// element.
    pub fn middles(self) -> &'static [&'static [usize]] {
        let all: &'static [&'static [usize]] = match self.linear() {
            Self::Triangle => &[&[0, 1], &[1, 2], &[2, 0]],
            Self::Quad => &[&[0, 1], &[1, 2], &[2, 3], &[3, 0], &[0, 1, 2, 3]],
            Self::Tetrahedron => &[&[0, 1], &[1, 2], &[2, 0], &[0, 3], &[1, 3], &[2, 3]],
            Self::Hexahedron => &[
                &[0, 1],
                &[1, 2],
                &[2, 3],
                &[3, 0],
                &[4, 5],
                &[5, 6],
                &[6, 7],
                &[7, 4],
                &[0, 4],
                &[1, 5],
                &[2, 6],
                &[3, 7],
                &[3, 0, 4, 7],
                &[1, 2, 6, 5],
                &[0, 1, 5, 4],
                &[2, 3, 7, 6],
                &[0, 3, 2, 1],
                &[4, 5, 6, 7],
                &[0, 1, 2, 3, 4, 5, 6, 7],
            ],
            Self::Wedge => &[
                &[0, 1],
                &[1, 2],
                &[2, 0],
                &[3, 4],
                &[4, 5],
                &[5, 3],
                &[0, 3],
                &[1, 4],
                &[2, 5],
                &[0, 1, 4, 3],
                &[1, 2, 5, 4],
                &[2, 0, 3, 5],
            ],
            _ => &[],
        };
        &all[..self.n_nodes() - self.n_corners()]
    }

    /// Its edges, by the places of their ends, and of the node in the middle where there is one.
    pub(super) fn edges(self) -> impl Iterator<Item = (&'static [usize], Option<usize>)> {
        const OF_PYRAMID: &[&[usize]] = &[
            &[0, 1],
            &[1, 2],
            &[2, 3],
            &[3, 0],
            &[0, 4],
            &[1, 4],
            &[2, 4],
            &[3, 4],
        ];
        let middles = (self.quadratic()).map_or(OF_PYRAMID, Self::middles);
        let edges = middles.iter().filter(|of| of.len() == 2);
        (self.n_corners()..)
            .zip(edges)
            .map(move |(place, ends)| (*ends, (self.order() == 2).then_some(place)))
    }

    /// Its facets, by the places of their nodes among its own: corners first, then midsides, the first between the
    /// first two corners, then the middle. In the plane they are edges with the element on their left, in space faces
    /// with corners counter-clockwise as seen from outside.
    pub const fn facets(self) -> &'static [&'static [usize]] {
        match self {
            Self::Triangle => &[&[0, 1], &[1, 2], &[2, 0]],
            Self::Triangle6 => &[&[0, 1, 3], &[1, 2, 4], &[2, 0, 5]],
            Self::Quad => &[&[0, 1], &[1, 2], &[2, 3], &[3, 0]],
            Self::Quad8 | Self::Quad9 => &[&[0, 1, 4], &[1, 2, 5], &[2, 3, 6], &[3, 0, 7]],
            Self::Tetrahedron => &[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]],
            Self::Tetrahedron10 => &[
                &[0, 2, 1, 6, 5, 4],
                &[0, 1, 3, 4, 8, 7],
                &[1, 2, 3, 5, 9, 8],
                &[2, 0, 3, 6, 7, 9],
            ],
            Self::Hexahedron => &[
                &[0, 3, 2, 1],
                &[4, 5, 6, 7],
                &[0, 1, 5, 4],
                &[1, 2, 6, 5],
                &[2, 3, 7, 6],
                &[3, 0, 4, 7],
            ],
            Self::Hexahedron20 => &[
                &[0, 3, 2, 1, 11, 10, 9, 8],
                &[4, 5, 6, 7, 12, 13, 14, 15],
                &[0, 1, 5, 4, 8, 17, 12, 16],
                &[1, 2, 6, 5, 9, 18, 13, 17],
                &[2, 3, 7, 6, 10, 19, 14, 18],
                &[3, 0, 4, 7, 11, 16, 15, 19],
            ],
            Self::Hexahedron27 => &[
                &[0, 3, 2, 1, 11, 10, 9, 8, 24],
                &[4, 5, 6, 7, 12, 13, 14, 15, 25],
                &[0, 1, 5, 4, 8, 17, 12, 16, 22],
                &[1, 2, 6, 5, 9, 18, 13, 17, 21],
                &[2, 3, 7, 6, 10, 19, 14, 18, 23],
                &[3, 0, 4, 7, 11, 16, 15, 19, 20],
            ],
            Self::Wedge => &[
                &[0, 2, 1],
                &[3, 4, 5],
                &[0, 1, 4, 3],
                &[1, 2, 5, 4],
                &[2, 0, 3, 5],
            ],
            Self::Wedge15 => &[
                &[0, 2, 1, 8, 7, 6],
                &[3, 4, 5, 9, 10, 11],
                &[0, 1, 4, 3, 6, 13, 9, 12],
                &[1, 2, 5, 4, 7, 14, 10, 13],
                &[2, 0, 3, 5, 8, 12, 11, 14],
            ],
            Self::Wedge18 => &[
                &[0, 2, 1, 8, 7, 6],
                &[3, 4, 5, 9, 10, 11],
                &[0, 1, 4, 3, 6, 13, 9, 12, 15],
                &[1, 2, 5, 4, 7, 14, 10, 13, 16],
                &[2, 0, 3, 5, 8, 12, 11, 14, 17],
            ],
            Self::Pyramid => &[
                &[0, 3, 2, 1],
                &[0, 1, 4],
                &[1, 2, 4],
                &[2, 3, 4],
                &[3, 0, 4],
            ],
        }
    }

    /// The order of the corners after a reversal.
    const fn turned_corners(self) -> &'static [usize] {
        match self.linear() {
            Self::Triangle => &[2, 1, 0],
            Self::Quad => &[3, 2, 1, 0],
            Self::Tetrahedron => &[0, 2, 1, 3],
            // Bottom and top change places.
            Self::Hexahedron => &[4, 5, 6, 7, 0, 1, 2, 3],
            Self::Wedge => &[3, 4, 5, 0, 1, 2],
            _ => &[3, 2, 1, 0, 4],
        }
    }

    /// Reverses the orientation of an element's nodes.
    pub fn turn(self, nodes: &mut [u32]) {
        let corners = self.turned_corners();
        let before = nodes.to_vec();
        for (node, &from) in nodes.iter_mut().zip(corners) {
            *node = before[from];
        }
        let middles = self.middles();
        for (k, of) in middles.iter().enumerate() {
            let same = |other: &&&[usize]| {
                other.len() == of.len() && of.iter().all(|&corner| other.contains(&corners[corner]))
            };
            let from = middles
                .iter()
                .position(|other| same(&other))
                .expect("the same kind");
            nodes[corners.len() + k] = before[corners.len() + from];
        }
    }
}

/// The parts of meshes in D dimensions: room for the node numbers, and the geometry that differs between the plane and
/// space.
pub trait Topology<const D: usize> {
    /// The nodes of an element, with zeros behind them where its kind has fewer.
    type Nodes: AsRef<[u32]> + AsMut<[u32]> + Copy + Debug + Default + PartialEq + Send + Sync;
    /// The nodes of a facet of an element, the part of a boundary; the last of them is repeated where there is room for
    /// more.
    type Facet: AsRef<[u32]> + AsMut<[u32]> + Copy + Debug + Default + Hash + Ord + Send + Sync;

    /// Turns a kind into its type: the only place that does.
    ///
    /// # Panics
    /// If the kind belongs to another dimension, which no [`Element`] can have.
    fn with<V: Visit<D>>(self, visit: V) -> V::Output;

    /// Passes `take` the points of a facet with nodes at x that integrate the product of a shape function and a load
    /// quadratic in the coordinates.
    fn facet_points(x: &[[f64; D]], take: impl FnMut(&FacetPoint<D>));

    /// The outward unit normal of a facet with its nodes at x, at each of these.
    fn normals_at_nodes(x: &[[f64; D]]) -> Vec<[f64; D]>;

    /// At each node of a facet with its nodes at x, the derivatives of all its shape functions along the surface.
    fn slopes_at_nodes(x: &[[f64; D]]) -> Vec<Vec<[f64; D]>>;

    /// The length (area) of a facet with its nodes at x, and its mean outward unit normal.
    fn facet_normal(x: &[[f64; D]]) -> (f64, [f64; D]);
}

/// The nodes of a facet in D dimensions, corners first, then the middles ([`facet_nodes`]). `[u32; 3]` in the plane are
/// the ends of an edge and its middle, `[u32; 9]` in space those of a face. If there are fewer nodes, the last is
/// repeated.
pub type Facet<const D: usize = 2> = <ElementKind as Topology<D>>::Facet;

/// The nodes of a facet, each once.
pub fn facet_nodes<F: AsRef<[u32]>>(facet: &F) -> &[u32] {
    let all = facet.as_ref();
    let last = all[all.len() - 1];
    let len = all
        .iter()
        .position(|&node| node == last)
        .map_or(0, |at| at + 1);
    &all[..len]
}

/// The nodes of facets, each once, in increasing order.
pub(crate) fn nodes_of_facets<F: AsRef<[u32]>>(facets: &[F]) -> Vec<u32> {
    let mut nodes: Vec<u32> = facets.iter().flat_map(facet_nodes).copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    nodes
}

/// The corners of a facet: the ends of an edge.
pub fn facet_corners<F: AsRef<[u32]>>(facet: &F) -> &[u32] {
    let nodes = facet_nodes(facet);
    let corners = match (facet.as_ref().len(), nodes.len()) {
        (3, _) => 2,
        (_, 6) => 3,
        (_, 8 | 9) => 4,
        (_, len) => len,
    };
    &nodes[..corners]
}

/// The straight parts of an edge of the plane: from one node to the next.
#[cfg(feature = "plots")]
pub(crate) fn edge_parts(edge: &Facet) -> impl Iterator<Item = [u32; 2]> + use<> {
    let [a, b, middle] = *edge;
    let parts = if middle == b {
        [Some([a, b]), None]
    } else {
        [Some([a, middle]), Some([middle, b])]
    };
    parts.into_iter().flatten()
}

/// The border of a face or of an element of the plane with so many nodes, by the places of those: corners and midsides in
/// turn.
pub(crate) fn face_ring(n_nodes: usize) -> &'static [usize] {
    match n_nodes {
        3 => &[0, 1, 2],
        6 => &[0, 3, 1, 4, 2, 5],
        8 | 9 => &[0, 4, 1, 5, 2, 6, 3, 7],
        _ => &[0, 1, 2, 3],
    }
}

/// The places of the nodes of a facet, from one to the next along its border; of an edge from end to end.
pub(crate) fn border<F: AsRef<[u32]>>(facet: &F) -> &'static [usize] {
    match (facet.as_ref().len(), facet_nodes(facet).len()) {
        (3, 2) => &[0, 1],
        (3, _) => &[0, 2, 1],
        (_, len) => face_ring(len),
    }
}

/// The straight parts of a facet between its nodes: segments, or triangles and quadrilaterals.
pub(crate) fn facet_parts<F: AsRef<[u32]>>(facet: &F) -> Vec<Vec<u32>> {
    let nodes = facet_nodes(facet);
    let parts: &[&[usize]] = match (facet.as_ref().len(), nodes.len()) {
        (3, 2) => &[&[0, 1]],
        (3, _) => &[&[0, 2], &[2, 1]],
        (_, len) => face_parts(len),
    };
    let of_part = |part: &&[usize]| part.iter().map(|&k| nodes[k]).collect();
    parts.iter().map(of_part).collect()
}

/// The triangles and quadrilaterals between the nodes of a face or of an element of the plane, by the places of those.
pub(crate) fn face_parts(n_nodes: usize) -> &'static [&'static [usize]] {
    match n_nodes {
        3 => &[&[0, 1, 2]],
        6 => &[&[0, 3, 5], &[3, 1, 4], &[5, 4, 2], &[3, 4, 5]],
        8 => &[
            &[0, 4, 7],
            &[4, 1, 5],
            &[5, 2, 6],
            &[6, 3, 7],
            &[4, 5, 6, 7],
        ],
        9 => &[&[0, 4, 8, 7], &[4, 1, 5, 8], &[8, 5, 2, 6], &[7, 8, 6, 3]],
        _ => &[&[0, 1, 2, 3]],
    }
}

/// The facet with these nodes.
///
/// # Panics
/// If the list is empty, or too long for the dimension.
pub fn facet<const D: usize>(nodes: &[u32]) -> Facet<D>
where
    ElementKind: Topology<D>,
{
    let mut facet = Facet::<D>::default();
    let last = *nodes.last().expect("a facet has nodes");
    facet.as_mut().fill(last);
    facet.as_mut()[..nodes.len()].copy_from_slice(nodes);
    facet
}

/// The corners of a facet, the same for whichever of its sides it was named from. The lowest comes first, then the
/// lower of its neighbours; the last again where there is room for more.
pub(crate) fn unsided<F: AsRef<[u32]>>(of: &F) -> [u32; 4] {
    let corners = facet_corners(of);
    let mut key = [corners[corners.len() - 1]; 4];
    let nodes = &mut key[..corners.len()];
    nodes.copy_from_slice(corners);
    let lowest = (0..nodes.len()).min_by_key(|&a| nodes[a]).unwrap_or(0);
    nodes.rotate_left(lowest);
    if nodes.len() > 2 && nodes[1] > nodes[nodes.len() - 1] {
        nodes[1..].reverse();
    }
    let last = nodes[nodes.len() - 1];
    key[corners.len()..].fill(last);
    key
}

/// An element of a mesh in D dimensions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Element<const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    kind: ElementKind,
    nodes: <ElementKind as Topology<D>>::Nodes,
    /// Index into [`super::Mesh::regions`].
    pub region: u32,
}

impl<const D: usize> Element<D>
where
    ElementKind: Topology<D>,
{
    /// An element with these nodes, as many as its kind has.
    ///
    /// # Panics
    /// If there are fewer or more, or the kind is of another dimension.
    pub fn new(kind: ElementKind, nodes: &[u32], region: u32) -> Self {
        let mut element = Self {
            kind,
            nodes: Default::default(),
            region,
        };
        element.nodes_mut().copy_from_slice(nodes);
        element
    }

    /// The element of first order with the same corners.
    pub fn linear(&self) -> Self {
        let kind = self.kind.linear();
        Self::new(kind, &self.nodes()[..kind.n_nodes()], self.region)
    }

    /// Its kind.
    pub fn kind(&self) -> ElementKind {
        self.kind
    }

    /// The node numbers.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes.as_ref()[..self.kind.n_nodes()]
    }

    pub(super) fn nodes_mut(&mut self) -> &mut [u32] {
        &mut self.nodes.as_mut()[..self.kind.n_nodes()]
    }

    pub(super) fn turn(&mut self) {
        let kind = self.kind;
        kind.turn(self.nodes_mut());
    }

    /// Its facets, seen from outside: edges with the element on their left, faces counter-clockwise.
    pub fn facets(&self) -> impl Iterator<Item = Facet<D>> {
        let nodes = self.nodes();
        self.kind.facets().iter().map(move |places| {
            let mut of_facet = [0; 9];
            for (node, &place) in of_facet.iter_mut().zip(*places) {
                *node = nodes[place];
            }
            facet::<D>(&of_facet[..places.len()])
        })
    }
}

/// The plane.
impl Element {
    /// A 3-node triangle.
    pub fn triangle(nodes: [u32; 3], region: u32) -> Self {
        Self::new(ElementKind::Triangle, &nodes, region)
    }

    /// A 4-node quadrilateral.
    pub fn quad(nodes: [u32; 4], region: u32) -> Self {
        Self::new(ElementKind::Quad, &nodes, region)
    }
}

/// Space.
impl Element<3> {
    /// A 4-node tetrahedron.
    pub fn tetrahedron(nodes: [u32; 4], region: u32) -> Self {
        Self::new(ElementKind::Tetrahedron, &nodes, region)
    }

    /// An 8-node hexahedron.
    pub fn hexahedron(nodes: [u32; 8], region: u32) -> Self {
        Self::new(ElementKind::Hexahedron, &nodes, region)
    }

    /// A 6-node wedge.
    pub fn wedge(nodes: [u32; 6], region: u32) -> Self {
        Self::new(ElementKind::Wedge, &nodes, region)
    }
}
