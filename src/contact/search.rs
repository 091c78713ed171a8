//! The search for facets of a boundary that may be near to another one.

use crate::mesh::vector::{dot, length};
use crate::mesh::{ElementKind, Facet, Mesh, Topology, bounds, facet_corners};
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree, RTreeObject, SelectionFunction};

/// The box around a facet.
#[derive(Clone, Copy)]
pub(super) struct Bounds<const D: usize> {
    low: [f64; D],
    high: [f64; D],
}

impl<const D: usize> Bounds<D> {
    pub fn around(mesh: &Mesh<D>, facet: &Facet<D>) -> Self
    where
        ElementKind: Topology<D>,
    {
        let (x, len) = mesh.places_of(facet);
        let (mut low, mut high) = bounds(x[..len].iter().copied());
        // A curved edge bulges out of the box around its nodes by less than its middle is off the chord.
        let n = facet_corners(facet).len();
        for (k, middle) in x[n..len].iter().take(n).enumerate() {
            for c in 0..D {
                let off = (middle[c] - 0.5 * (x[k][c] + x[(k + 1) % n][c])).abs();
                low[c] -= off;
                high[c] += off;
            }
        }
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

/// A box with its own axes: the region that a facet can meet along its normals.
#[derive(Clone, Copy, Debug)]
pub struct Beam<const D: usize> {
    /// Orthonormal directions.
    pub(super) axes: [[f64; D]; D],
    /// Its start along each.
    pub(super) low: [f64; D],
    /// Its end.
    pub(super) high: [f64; D],
}

impl<const D: usize> Beam<D> {
    /// The smallest box along these axes that holds some points, each with a margin along each axis.
    pub(super) fn around(
        axes: [[f64; D]; D],
        points: impl IntoIterator<Item = [f64; D]>,
        distance: [f64; D],
    ) -> Self {
        let local = |x| axes.map(|axis| dot(axis, x));
        let (low, high) = bounds(points.into_iter().map(local));
        Self {
            axes,
            low: std::array::from_fn(|a| low[a] - distance[a]),
            high: std::array::from_fn(|a| high[a] + distance[a]),
        }
    }

    /// Whether a box along the axes of space may meet it: whether their shadows on all its axes do.
    fn may_meet(&self, low: [f64; D], high: [f64; D]) -> bool {
        (0..D).all(|a| {
            let axis = self.axes[a];
            let [mut from, mut to] = [0.0; 2];
            for c in 0..D {
                let ends = [axis[c] * low[c], axis[c] * high[c]];
                from += ends[0].min(ends[1]);
                to += ends[0].max(ends[1]);
            }
            // In addition only points that rounding cannot distinguish from touching are let in.
            let slack = 1e-12 * (from.abs() + to.abs());
            from <= self.high[a] + slack && to >= self.low[a] - slack
        })
    }
}

/// The facets of a boundary, in an R-tree of the boxes around them.
///
/// They are numbered along the axis in which the boundary extends most, so that the order of results does not depend on
/// the construction of the tree.
pub(super) struct Search<const D: usize>
where
    ElementKind: Topology<D>,
{
    /// With the number of each in the boundary.
    facets: Vec<(Bounds<D>, usize, Facet<D>)>,
    tree: RTree<Numbered<D>>,
}

/// The box around a facet with its number.
type Numbered<const D: usize> = GeomWithData<Rectangle<[f64; D]>, usize>;

impl<const D: usize> Search<D>
where
    ElementKind: Topology<D>,
{
    pub fn new(mesh: &Mesh<D>, facets: &[Facet<D>]) -> Self {
        let boxes = facets.iter().map(|facet| Bounds::around(mesh, facet));
        let facets = boxes.zip(facets).enumerate();
        let mut facets: Vec<_> = facets
            .map(|(number, (b, facet))| (b, number, *facet))
            .collect();
        let (low, high) = bounds(facets.iter().flat_map(|(b, ..)| [b.low, b.high]));
        let extent = |c: usize| high[c] - low[c];
        let axis = (1..D).fold(0, |most, c| if extent(c) > extent(most) { c } else { most });
        facets.sort_by(|a, b| a.0.low[axis].total_cmp(&b.0.low[axis]));
        let numbered = (facets.iter().enumerate())
            .map(|(number, (b, ..))| Numbered::new(Rectangle::from_corners(b.low, b.high), number))
            .collect();
        let tree = RTree::bulk_load(numbered);
        Self { facets, tree }
    }

    /// The facets whose boxes a beam may meet, with their numbers in the boundary.
    pub fn near(&self, beam: Beam<D>) -> impl Iterator<Item = (usize, Facet<D>)> {
        let found = self.tree.locate_with_selection_function(beam);
        let mut numbers: Vec<usize> = found.map(|numbered| numbered.data).collect();
        numbers.sort_unstable();
        numbers.into_iter().map(|place| {
            let (_, number, facet) = self.facets[place];
            (number, facet)
        })
    }

    /// The least distance of the box of a facet from one of some boxes.
    pub fn nearest(&self, boxes: impl Iterator<Item = Bounds<D>>) -> f64 {
        boxes
            .flat_map(|here| (self.facets.iter()).map(move |(there, ..)| here.distance(there)))
            .fold(f64::INFINITY, f64::min)
    }
}

impl<const D: usize> SelectionFunction<Numbered<D>> for Beam<D> {
    fn should_unpack_parent(&self, envelope: &AABB<[f64; D]>) -> bool {
        self.may_meet(envelope.lower(), envelope.upper())
    }

    fn should_unpack_leaf(&self, leaf: &Numbered<D>) -> bool {
        self.should_unpack_parent(&leaf.envelope())
    }
}
