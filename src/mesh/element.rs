//! Elements and their kinds.

use std::fmt::Debug;

/// The kinds of elements, all of first order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Three nodes in the plane, counter-clockwise.
    Triangle,
    /// A quadrilateral: four nodes in the plane, counter-clockwise.
    Quad,
}

impl Kind {
    /// How many nodes it has: its corners.
    pub const fn n_nodes(self) -> usize {
        match self {
            Self::Triangle => 3,
            Self::Quad => 4,
        }
    }

    /// Its facets, by the places of their nodes among its own: in the plane edges with the element on their left.
    pub const fn facets(self) -> &'static [&'static [usize]] {
        match self {
            Self::Triangle => &[&[0, 1], &[1, 2], &[2, 0]],
            Self::Quad => &[&[0, 1], &[1, 2], &[2, 3], &[3, 0]],
        }
    }
}

/// Room for the node numbers of what meshes of D dimensions consist of.
pub trait Topology<const D: usize> {
    /// The nodes of an element, with zeros behind them where its kind has fewer.
    type Nodes: AsRef<[u32]> + AsMut<[u32]> + Copy + Debug + Default + PartialEq + Send + Sync;
    /// The nodes of a facet of an element, of which boundaries consist.
    type Facet: AsRef<[u32]> + AsMut<[u32]> + Copy + Debug + Ord + Send + Sync;
}

/// The plane: facets are edges, from one node to the other.
impl Topology<2> for Kind {
    type Nodes = [u32; 4];
    type Facet = [u32; 2];
}

/// Space: facets are faces; one with three corners names the last of them twice.
impl Topology<3> for Kind {
    type Nodes = [u32; 8];
    type Facet = [u32; 4];
}

/// The nodes of a facet in D dimensions: `[u32; 2]` in the plane.
pub type Facet<const D: usize = 2> = <Kind as Topology<D>>::Facet;

/// An element of a mesh in D dimensions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Element<const D: usize = 2>
where
    Kind: Topology<D>,
{
    kind: Kind,
    nodes: <Kind as Topology<D>>::Nodes,
    /// Index into [`super::Mesh::regions`].
    pub region: u32,
}

impl<const D: usize> Element<D>
where
    Kind: Topology<D>,
{
    fn new(kind: Kind, nodes: &[u32], region: u32) -> Self {
        let mut element = Self {
            kind,
            nodes: Default::default(),
            region,
        };
        element.nodes_mut().copy_from_slice(nodes);
        element
    }

    /// What it is.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// The node numbers.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes.as_ref()[..self.kind.n_nodes()]
    }

    pub(super) fn nodes_mut(&mut self) -> &mut [u32] {
        &mut self.nodes.as_mut()[..self.kind.n_nodes()]
    }
}

/// The plane.
impl Element {
    /// A 3-node triangle.
    pub fn triangle(nodes: [u32; 3], region: u32) -> Self {
        Self::new(Kind::Triangle, &nodes, region)
    }

    /// A 4-node quadrilateral.
    pub fn quad(nodes: [u32; 4], region: u32) -> Self {
        Self::new(Kind::Quad, &nodes, region)
    }

    /// Its edges, with the element on their left.
    pub fn edges(&self) -> impl Iterator<Item = [u32; 2]> {
        let nodes = self.nodes();
        (self.kind.facets().iter()).map(move |facet| [nodes[facet[0]], nodes[facet[1]]])
    }
}
