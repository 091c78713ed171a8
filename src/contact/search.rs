//! Which facets of a boundary may be near to another one.

use crate::mesh::vector::length;
use crate::mesh::{Facet, Kind, Mesh, Topology, bounds};

/// The box around a facet.
#[derive(Clone, Copy)]
pub(super) struct Bounds<const D: usize> {
    low: [f64; D],
    high: [f64; D],
}

impl<const D: usize> Bounds<D> {
    pub fn around(mesh: &Mesh<D>, facet: &Facet<D>) -> Self
    where
        Kind: Topology<D>,
    {
        let nodes = facet.as_ref().iter();
        let (low, high) = bounds(nodes.map(|&node| mesh.nodes[node as usize]));
        Self { low, high }
    }

    fn distance(&self, other: &Self) -> f64 {
        length(std::array::from_fn::<_, D, _>(|c| {
            (self.low[c] - other.high[c])
                .max(other.low[c] - self.high[c])
                .max(0.0)
        }))
    }
}

/// The facets of a boundary along the axis in which they extend most: what may be near to a place is a range of them.
pub(super) struct Search<const D: usize>
where
    Kind: Topology<D>,
{
    sorted: Vec<(Bounds<D>, Facet<D>)>,
    axis: usize,
    /// The largest extent of a facet along the axis.
    longest: f64,
}

impl<const D: usize> Search<D>
where
    Kind: Topology<D>,
{
    pub fn new(mesh: &Mesh<D>, facets: &[Facet<D>]) -> Self {
        let boxes = facets.iter().map(|facet| Bounds::around(mesh, facet));
        let mut sorted: Vec<_> = boxes.zip(facets.iter().copied()).collect();
        let (low, high) = bounds(sorted.iter().flat_map(|(b, _)| [b.low, b.high]));
        let extent = |c: usize| high[c] - low[c];
        let axis = (1..D).fold(0, |most, c| if extent(c) > extent(most) { c } else { most });
        sorted.sort_by(|a, b| a.0.low[axis].total_cmp(&b.0.low[axis]));
        let longest = (sorted.iter())
            .map(|(b, _)| b.high[axis] - b.low[axis])
            .fold(0.0, f64::max);
        Self {
            sorted,
            axis,
            longest,
        }
    }

    /// The facets whose boxes are within the distance of a box.
    pub fn near(&self, here: Bounds<D>, distance: f64) -> impl Iterator<Item = Facet<D>> {
        let axis = self.axis;
        let begin = here.low[axis] - distance - self.longest;
        let first = self.sorted.partition_point(|(b, _)| b.low[axis] < begin);
        (self.sorted[first..].iter())
            .take_while(move |(b, _)| b.low[axis] <= here.high[axis] + distance)
            .filter(move |(b, _)| b.distance(&here) <= distance)
            .map(|&(_, facet)| facet)
    }

    /// The least distance of the box of a facet from one of some boxes.
    pub fn nearest(&self, boxes: impl Iterator<Item = Bounds<D>>) -> f64 {
        boxes
            .flat_map(|here| (self.sorted.iter()).map(move |(there, _)| here.distance(there)))
            .fold(f64::INFINITY, f64::min)
    }
}
