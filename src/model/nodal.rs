//! Quantities with values at nodes, as functions of the position on their boundaries or regions.

use super::entities::{Part as _, Target};
use super::error::{Fault, ModelError};
use super::loads::region;
use super::pair::Law;
use super::quantity::NODAL;
use super::{Definition, Quantity};
use crate::mesh::foot::{Foot, in_element, on_facet};
use crate::mesh::vector::{length, minus};
use crate::mesh::{Element, ElementKind, Facet, Mesh, Topology, bounds, facet_nodes};
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};
use std::collections::HashMap;
use std::sync::Arc;

/// A facet or an element with its box; in the plane a box is flat.
type Boxed<P> = GeomWithData<Rectangle<[f64; 3]>, P>;

/// A point in space, wherever it is.
fn in_space<const D: usize>(x: [f64; D]) -> [f64; 3] {
    std::array::from_fn(|c| x.get(c).copied().unwrap_or(0.0))
}

/// Facets or elements that values at nodes are interpolated on.
struct Pieces<const D: usize, P> {
    /// By position, for values at a node itself.
    nodes: HashMap<[u64; 3], u32>,
    tree: RTree<Boxed<P>>,
    places: Vec<[f64; D]>,
    /// The size of the mesh.
    size: f64,
}

/// A facet or an element.
trait Piece<const D: usize>: Copy + Send + Sync + 'static {
    fn nodes(&self) -> &[u32];
    fn foot(&self, nodes: &[[f64; D]], x: [f64; D]) -> Foot;
}

/// A facet, distinguished from other arrays.
#[derive(Clone, Copy)]
struct OfFacet<F>(F);

impl<const D: usize, F: AsRef<[u32]> + Copy + Send + Sync + 'static> Piece<D> for OfFacet<F> {
    fn nodes(&self) -> &[u32] {
        facet_nodes(&self.0)
    }

    fn foot(&self, nodes: &[[f64; D]], x: [f64; D]) -> Foot {
        on_facet(&self.0, nodes, x)
    }
}

impl<const D: usize> Piece<D> for Element<D>
where
    ElementKind: Topology<D>,
    Element<D>: Copy + Send + Sync + 'static,
{
    fn nodes(&self) -> &[u32] {
        self.nodes()
    }

    fn foot(&self, nodes: &[[f64; D]], x: [f64; D]) -> Foot {
        in_element(self.kind(), nodes, x)
    }
}

/// A point by its bits, +0 and −0 as one.
fn key<const D: usize>(x: [f64; D]) -> [u64; 3] {
    in_space(x).map(|v| (v + 0.0).to_bits())
}

impl<const D: usize, P: Piece<D>> Pieces<D, P> {
    fn new(mesh: &Mesh<D>, pieces: impl Iterator<Item = P>) -> Self
    where
        ElementKind: Topology<D>,
    {
        let mut nodes = HashMap::new();
        let boxed = |piece: P| {
            let of_piece = piece.nodes().iter().map(|&node| mesh.nodes[node as usize]);
            let (low, high) = bounds(of_piece);
            nodes
                .extend((piece.nodes().iter()).map(|&node| (key(mesh.nodes[node as usize]), node)));
            GeomWithData::new(
                Rectangle::from_corners(in_space(low), in_space(high)),
                piece,
            )
        };
        let boxed: Vec<_> = pieces.map(boxed).collect();
        let (low, high) = mesh.bounding_box();
        Self {
            nodes,
            tree: RTree::bulk_load(boxed),
            places: mesh.nodes.clone(),
            size: length(minus(high, low)),
        }
    }

    /// The value at a point on them, or near them.
    fn value(&self, values: &[f64], x: [f64; D]) -> f64 {
        if let Some(&node) = self.nodes.get(&key(x)) {
            return values[node as usize];
        }
        let at = in_space(x);
        let mut best: Option<(f64, f64)> = None;
        let consider = |piece: &P, best: &mut Option<(f64, f64)>| {
            let mut places = [[0.0; D]; 27];
            for (place, &node) in places.iter_mut().zip(piece.nodes()) {
                *place = self.places[node as usize];
            }
            let foot = piece.foot(&places[..piece.nodes().len()], x);
            if best.is_none_or(|(miss, _)| foot.miss < miss) {
                let nodes = piece.nodes().iter().zip(foot.shape);
                let value = nodes
                    .map(|(&node, shape)| shape * values[node as usize])
                    .sum();
                *best = Some((foot.miss, value));
            }
        };
        // Facets whose boxes contain it; where it is off them, or they bulge out of their boxes, the nearest ones as
        // well.
        let here = self
            .tree
            .locate_in_envelope_intersecting(AABB::from_point(at));
        here.for_each(|boxed| consider(&boxed.data, &mut best));
        if best.is_some_and(|(miss, _)| miss <= ON * self.size) {
            return best.map_or(f64::NAN, |(_, value)| value);
        }
        self.tree
            .nearest_neighbor_iter(at)
            .take(NEAREST)
            .for_each(|boxed| consider(&boxed.data, &mut best));
        best.map_or(f64::NAN, |(_, value)| value)
    }
}

/// A point off a piece by at most this part of the mesh is on it: integration points are, up to rounding.
const ON: f64 = 1e-12;

/// The number of pieces nearest to a point to check: as many as may meet at a node of a regular mesh.
const NEAREST: usize = 8;

/// Turns values at nodes into a function of the place.
fn placed<const D: usize, P: Piece<D>>(
    quantity: &mut Quantity<D>,
    pieces: &mut Option<Arc<Pieces<D, P>>>,
    make: impl FnOnce() -> Result<Pieces<D, P>, Fault>,
    n_nodes: usize,
) -> Result<(), Fault> {
    let Some(values) = quantity.nodal() else {
        return Ok(());
    };
    if values.len() != n_nodes {
        return Err(Fault::Stated(format!(
            "a quantity has {} values, and the mesh {n_nodes} nodes: it needs one for each",
            values.len()
        )));
    }
    let values = values.to_vec();
    let pieces = match pieces {
        Some(pieces) => Arc::clone(pieces),
        None => {
            let made = Arc::new(make()?);
            *pieces = Some(Arc::clone(&made));
            made
        }
    };
    *quantity = Quantity::described(NODAL, move |x| pieces.value(&values, x));
    Ok(())
}

/// The facets of several boundaries; errors in a name are reported where it is used.
fn facets_of<const D: usize>(mesh: &Mesh<D>, names: &[String]) -> Vec<OfFacet<Facet<D>>>
where
    ElementKind: Topology<D>,
{
    let all = names.iter().filter_map(|name| mesh.boundaries.get(name));
    all.flatten().copied().map(OfFacet).collect()
}

/// The facets of all elements, which contain every node, if a quantity has values at nodes.
fn around_nodes<'q, const D: usize>(
    mesh: &Mesh<D>,
    mut quantities: impl Iterator<Item = &'q Quantity<D>>,
) -> Vec<OfFacet<Facet<D>>>
where
    ElementKind: Topology<D>,
{
    let any = quantities.any(|quantity| quantity.nodal().is_some());
    let elements = mesh.elements.iter().filter(|_| any);
    elements.flat_map(Element::facets).map(OfFacet).collect()
}

/// The elements of a region, or all.
fn elements_of<const D: usize>(
    mesh: &Mesh<D>,
    name: &Option<String>,
) -> Result<Pieces<D, Element<D>>, Fault>
where
    ElementKind: Topology<D>,
    Element<D>: 'static,
{
    let inside = match name {
        Some(name) => Some(region(mesh, name)?),
        None => None,
    };
    let elements = mesh.elements.iter().copied();
    let inside = |e: &Element<D>| inside.is_none_or(|regions| regions.contains(&e.region));
    Ok(Pieces::new(mesh, elements.filter(inside)))
}

impl<const D: usize> Definition<D>
where
    ElementKind: Topology<D>,
    Facet<D>: 'static,
    Element<D>: 'static,
{
    /// Turns all values at nodes into functions of the place.
    pub(super) fn place_values(&mut self, mesh: &Mesh<D>) -> Result<(), ModelError> {
        let n = mesh.nodes.len();
        for (number, support) in self.supports.iter_mut().enumerate() {
            let entity = support.entity(number);
            let facets = match support.target() {
                Target::Boundary(names) => facets_of(mesh, names.all()),
                Target::Point(_) | Target::Nodes(_) => {
                    around_nodes(mesh, support.components().into_iter().flatten())
                }
            };
            let mut pieces = None;
            for quantity in support.quantities_mut() {
                placed(
                    quantity,
                    &mut pieces,
                    || Ok(Pieces::new(mesh, facets.iter().copied())),
                    n,
                )
                .map_err(|fault| entity.clone().error(fault))?;
            }
        }
        for (number, traction) in self.tractions.iter_mut().enumerate() {
            let entity = traction.entity(number);
            let facets = facets_of(mesh, traction.boundary.all());
            let mut pieces = None;
            for quantity in traction.quantities_mut() {
                placed(
                    quantity,
                    &mut pieces,
                    || Ok(Pieces::new(mesh, facets.iter().copied())),
                    n,
                )
                .map_err(|fault| entity.clone().error(fault))?;
            }
        }
        for (number, foundation) in self.foundations.iter_mut().enumerate() {
            let entity = foundation.entity(number);
            let facets = facets_of(mesh, foundation.boundary.all());
            let mut pieces = None;
            for quantity in (foundation.stiffness.both_mut().into_iter()).flatten() {
                let made = || Ok(Pieces::new(mesh, facets.iter().copied()));
                placed(quantity, &mut pieces, made, n)
                    .map_err(|fault| entity.clone().error(fault))?;
            }
        }
        for (number, force) in self.body_forces.iter_mut().enumerate() {
            let entity = force.entity(number);
            let name = force.region.clone();
            let mut pieces = None;
            for quantity in force.components_mut().into_iter().flatten() {
                placed(quantity, &mut pieces, || elements_of(mesh, &name), n)
                    .map_err(|fault| entity.clone().error(fault))?;
            }
        }
        for (number, temperature) in self.temperatures.iter_mut().enumerate() {
            let entity = temperature.entity(number);
            let name = temperature.region.clone();
            let value = &mut temperature.value;
            placed(value, &mut None, || elements_of(mesh, &name), n)
                .map_err(|fault| entity.error(fault))?;
        }
        for (number, force) in self.forces.iter_mut().enumerate() {
            let entity = force.entity(number);
            let facets = match force.target() {
                Target::Boundary(names) => facets_of(mesh, names.all()),
                Target::Point(_) | Target::Nodes(_) => {
                    around_nodes(mesh, force.components().into_iter().flatten())
                }
            };
            let mut pieces = None;
            for quantity in force.components_mut().into_iter().flatten() {
                let made = || Ok(Pieces::new(mesh, facets.iter().copied()));
                placed(quantity, &mut pieces, made, n)
                    .map_err(|fault| entity.clone().error(fault))?;
            }
        }
        for (number, pair) in self.pairs.iter_mut().enumerate() {
            let entity = pair.entity(number);
            let facets = facets_of(mesh, pair.side().all());
            let law = match &mut pair.law {
                Law::None | Law::Tied => None,
                Law::Tresca(value) | Law::Coulomb(value) => Some(value),
            };
            let mut pieces = None;
            for quantity in law
                .into_iter()
                .chain(&mut pair.gap)
                .chain(&mut pair.interference)
                .chain(pair.stiffness.both_mut().into_iter().flatten())
            {
                placed(
                    quantity,
                    &mut pieces,
                    || Ok(Pieces::new(mesh, facets.iter().copied())),
                    n,
                )
                .map_err(|fault| entity.clone().error(fault))?;
            }
        }
        Ok(())
    }
}
