//! Elements and their kinds.

use std::fmt::Debug;
use std::hash::Hash;

/// The kinds of elements, all of first order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ElementKind {
    /// Three nodes in the plane, counter-clockwise.
    Triangle,
    /// A quadrilateral: four nodes in the plane, counter-clockwise.
    Quad,
    /// Four nodes in space: a triangle, counter-clockwise as seen from the fourth node, and that.
    Tetrahedron,
    /// Eight nodes in space: a quadrilateral, counter-clockwise as seen from the other four, and those above its
    /// corners.
    Hexahedron,
    /// Six nodes in space: a triangle, counter-clockwise as seen from the other three, and those above its corners.
    Wedge,
}

impl ElementKind {
    /// How many nodes it has: its corners.
    pub const fn n_nodes(self) -> usize {
        match self {
            Self::Triangle => 3,
            Self::Quad | Self::Tetrahedron => 4,
            Self::Hexahedron => 8,
            Self::Wedge => 6,
        }
    }

    /// Its facets, by the places of their nodes among its own: in the plane edges with the element on their left, in
    /// space faces that go round counter-clockwise as seen from outside.
    pub const fn facets(self) -> &'static [&'static [usize]] {
        match self {
            Self::Triangle => &[&[0, 1], &[1, 2], &[2, 0]],
            Self::Quad => &[&[0, 1], &[1, 2], &[2, 3], &[3, 0]],
            Self::Tetrahedron => &[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]],
            Self::Hexahedron => &[
                &[0, 3, 2, 1],
                &[4, 5, 6, 7],
                &[0, 1, 5, 4],
                &[1, 2, 6, 5],
                &[2, 3, 7, 6],
                &[3, 0, 4, 7],
            ],
            Self::Wedge => &[
                &[0, 2, 1],
                &[3, 4, 5],
                &[0, 1, 4, 3],
                &[1, 2, 5, 4],
                &[2, 0, 3, 5],
            ],
        }
    }
}

/// What meshes of D dimensions consist of: room for the node numbers, and the geometry that is another one in the
/// plane and in space.
pub trait Topology<const D: usize> {
    /// The nodes of an element, with zeros behind them where its kind has fewer.
    type Nodes: AsRef<[u32]> + AsMut<[u32]> + Copy + Debug + Default + PartialEq + Send + Sync;
    /// The nodes of a facet of an element, of which boundaries consist; the last of them again where there is room
    /// for more.
    type Facet: AsRef<[u32]> + AsMut<[u32]> + Copy + Debug + Default + Hash + Ord + Send + Sync;

    /// The area (volume) of an element with its corners at x; negative where they go round the wrong way.
    fn signed_measure(self, x: &[[f64; D]]) -> f64;

    /// The areas (volumes) of the parallelograms (parallelepipeds) that the edges span at the corners, in space also in
    /// between: all positive in an element that is not folded.
    fn determinants(self, x: &[[f64; D]]) -> impl Iterator<Item = f64>;

    /// Numbers the nodes of an element the other way round.
    fn turn(self, nodes: &mut [u32]);

    /// The length (area) of a facet with its corners at x, and its outward unit normal: of a warped quadrilateral
    /// the mean.
    fn facet_normal(x: &[[f64; D]]) -> (f64, [f64; D]);
}

/// The nodes of a facet in D dimensions: `[u32; 2]` in the plane, the ends of an edge; `[u32; 4]` in space, the
/// corners of a face, where a triangle names its last corner twice ([`facet_nodes`]).
pub type Facet<const D: usize = 2> = <ElementKind as Topology<D>>::Facet;

/// The nodes of a facet, each once.
pub fn facet_nodes<F: AsRef<[u32]>>(facet: &F) -> &[u32] {
    match facet.as_ref() {
        [rest @ .., a, b] if a == b => &facet.as_ref()[..rest.len() + 1],
        nodes => nodes,
    }
}

/// The facet with these nodes.
///
/// # Panics
/// If there are none, or too many for the dimension.
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

/// The same facet for whichever of its sides it was named from: the lowest node first, then the lower of its
/// neighbours.
pub(super) fn unsided<const D: usize>(of: &Facet<D>) -> Facet<D>
where
    ElementKind: Topology<D>,
{
    let mut copy = *of;
    let len = facet_nodes(of).len();
    let nodes = &mut copy.as_mut()[..len];
    let lowest = (0..len).min_by_key(|&a| nodes[a]).unwrap_or(0);
    nodes.rotate_left(lowest);
    if len > 2 && nodes[1] > nodes[len - 1] {
        nodes[1..].reverse();
    }
    facet::<D>(&copy.as_ref()[..len])
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
    fn new(kind: ElementKind, nodes: &[u32], region: u32) -> Self {
        let mut element = Self {
            kind,
            nodes: Default::default(),
            region,
        };
        element.nodes_mut().copy_from_slice(nodes);
        element
    }

    /// What it is.
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

    /// Its facets, named from outside: edges with the element on their left, faces that go round counter-clockwise.
    pub fn facets(&self) -> impl Iterator<Item = Facet<D>> {
        let nodes = self.nodes();
        self.kind.facets().iter().map(move |places| {
            let mut corners = [0; 4];
            for (corner, &place) in corners.iter_mut().zip(*places) {
                *corner = nodes[place];
            }
            facet::<D>(&corners[..places.len()])
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
