//! The order of elements: from the first to the second and back, and whether neighbours are of one.

use super::shape::sum;
use super::{
    Element, ElementKind, Location, Mesh, MeshError, ShapeFunctions, Topology, Visit, facet,
    facet_corners, facet_nodes, orient,
};
use rayon::prelude::*;
use std::collections::HashMap;

/// The corners around a node, lowest first; those of an edge followed by u32::MAX.
type Between = [u32; 4];

fn between(corners: impl Iterator<Item = u32>) -> Between {
    let mut key = [u32::MAX; 4];
    key.iter_mut()
        .zip(corners)
        .for_each(|(key, corner)| *key = corner);
    key.sort_unstable();
    key
}

impl<const D: usize> Mesh<D>
where
    ElementKind: Topology<D>,
{
    /// The mesh with elements of second order, as accurate as possible. Those of first order get nodes in the middle of
    /// their straight edges, of their quadrilaterals and of themselves (6-node triangles, 9-node quadrilaterals,
    /// 10-node tetrahedra, 27-node hexahedra, 18-node wedges). These nodes follow the existing ones, and neighbours
    /// share them. Elements of second order stay as they are. A new node between nodes of a set joins the set.
    ///
    /// For curved sides, move the new nodes onto them.
    ///
    /// # Errors
    /// If there is a pyramid, because second-order pyramids are not supported.
    pub fn raised(mut self) -> Result<Self, MeshError> {
        let pyramid = |element: &Element<D>| element.kind().quadratic().is_none();
        if let Some(element) = self.elements.iter().position(pyramid) {
            let first = self.elements[element].nodes()[0];
            return Err(MeshError::NotRaised {
                element,
                place: self.nodes[first as usize].into(),
            });
        }
        let first_order: Vec<bool> = (self.elements.iter())
            .map(|element| element.kind().order() == 1)
            .collect();
        self.add_middles(&first_order);
        self.direct_boundaries();
        Ok(self)
    }

    /// The mesh with elements of first order at the corners of its elements: nodes in the middle of sides are left out.
    /// Curved sides become straight between corners.
    ///
    /// # Errors
    /// If an element has no area (volume) without them.
    pub fn linear(mut self) -> Result<Self, MeshError> {
        for (number, element) in self.elements.iter_mut().enumerate() {
            *element = element.linear();
            let before = *element;
            orient(element, &self.nodes, number)?;
            if *element != before {
                // It was reversed: without its midside nodes it is inside out.
                return Err(MeshError::Degenerate {
                    element: number,
                    place: self.nodes[before.nodes()[0] as usize].into(),
                });
            }
        }
        for one in self.boundaries.values_mut().flatten() {
            *one = facet::<D>(facet_corners(one));
        }
        self.drop_unused_nodes();
        Ok(self)
    }

    /// Raises the chosen elements to second order with all possible nodes, placed where the map of the present element
    /// has the middles. A new node between nodes of a set joins the set.
    fn add_middles(&mut self, chosen: &[bool]) {
        let before = self.nodes.len() as u32;
        let mut known: HashMap<Between, u32> = HashMap::new();
        for element in &self.elements {
            let (corners, middles) = element.nodes().split_at(element.kind().n_corners());
            for (&node, of) in middles.iter().zip(element.kind().middles()) {
                if is_shared(of, corners) {
                    known.insert(between(of.iter().map(|&corner| corners[corner])), node);
                }
            }
        }
        let mut x = [[0.0; D]; 27];
        for (element, _) in self
            .elements
            .iter_mut()
            .zip(chosen)
            .filter(|(_, chosen)| **chosen)
        {
            let kind = element.kind();
            let Some(raised) = kind.quadratic() else {
                continue;
            };
            let mut nodes = element.nodes().to_vec();
            for (x, &node) in x.iter_mut().zip(&nodes) {
                *x = self.nodes[node as usize];
            }
            let had = nodes.len() - kind.n_corners();
            for of in &raised.middles()[had..] {
                let mut add = || {
                    let at = kind.with(Middle { of, x: &x });
                    self.nodes.push(at);
                    (self.nodes.len() - 1) as u32
                };
                let corners = &nodes[..kind.n_corners()];
                let node = if is_shared(of, corners) {
                    let key = between(of.iter().map(|&corner| corners[corner]));
                    *known.entry(key).or_insert_with(add)
                } else {
                    add()
                };
                nodes.push(node);
            }
            *element = Element::new(raised, &nodes, element.region);
        }
        let added = known.iter().filter(|(_, node)| **node >= before);
        let mut added: Vec<(u32, &Between)> = added.map(|(of, &node)| (node, of)).collect();
        added.sort_unstable();
        for set in self.node_sets.values_mut() {
            let is_in = |corner: &u32| *corner == u32::MAX || set.binary_search(corner).is_ok();
            let inside = added.iter().filter(|(_, of)| of.iter().all(is_in));
            let inside: Vec<u32> = inside.map(|(node, _)| *node).collect();
            set.extend(inside);
        }
    }

    /// Checks that neighbours share their midside nodes, and gives serendipity elements mid-face nodes where their
    /// neighbours have them: otherwise displacements would not be continuous.
    pub(super) fn match_neighbours(&mut self) -> Result<(), MeshError> {
        let second_order = |element: &Element<D>| element.kind().order() == 2;
        if !self.elements.iter().any(second_order) {
            return Ok(());
        }
        let edges = (0..self.elements.len())
            .into_par_iter()
            .flat_map_iter(|number| {
                let nodes = self.elements[number].nodes();
                let edges = self.elements[number].kind().edges();
                edges.map(move |(ends, middle)| {
                    let ends = between(ends.iter().map(|&end| nodes[end]));
                    (ends, number, middle.map(|middle| nodes[middle]))
                })
            });
        if let Some(both) = unequal(edges.collect()).first() {
            return Err(self.apart(both));
        }
        // Faces with a node in the middle and without.
        let faces = (0..self.elements.len())
            .into_par_iter()
            .flat_map_iter(|number| {
                let facets = self.elements[number].facets();
                let faces = facets.filter(|facet| facet_corners(facet).len() == 4);
                faces.map(move |facet| {
                    let corners = between(facet_corners(&facet).iter().copied());
                    (corners, number, facet_nodes(&facet).get(8).copied())
                })
            });
        let differing = unequal(faces.collect());
        if differing.is_empty() {
            return Ok(());
        }
        if let Some(both) = differing
            .iter()
            .find(|both| both.middles.iter().all(Option::is_some))
        {
            return Err(self.apart(both));
        }
        let (count, body_of) = self.bodies();
        let body = |number: usize| body_of[self.elements[number].nodes()[0] as usize] as usize;
        let mut mixed = vec![false; count];
        differing
            .iter()
            .for_each(|both| mixed[body(both.elements[0])] = true);
        let chosen: Vec<bool> = (0..self.elements.len())
            .map(|number| second_order(&self.elements[number]) && mixed[body(number)])
            .collect();
        self.add_middles(&chosen);
        Ok(())
    }

    /// The error that two neighbours have different nodes in the middle of a common edge or face.
    fn apart(&self, both: &Differing) -> MeshError {
        let elements = both.elements;
        let corners = both.between.iter().filter(|&&corner| corner != u32::MAX);
        let x: Vec<[f64; D]> = corners.map(|&corner| self.nodes[corner as usize]).collect();
        let place = Location::from(sum(&vec![1.0 / x.len() as f64; x.len()], &x));
        match both.middles {
            [Some(_), Some(_)] => MeshError::TwoMiddles { elements, place },
            [None, _] => MeshError::Hanging {
                linear: elements[0],
                quadratic: elements[1],
                place,
            },
            _ => MeshError::Hanging {
                linear: elements[1],
                quadratic: elements[0],
                place,
            },
        }
    }
}

/// Whether a node between some of the corners of an element may also belong to its neighbours.
fn is_shared(of: &[usize], corners: &[u32]) -> bool {
    of.len() < corners.len()
}

/// Two neighbours with an edge or a face in common, but not the node in the middle of it.
struct Differing {
    between: Between,
    elements: [usize; 2],
    middles: [Option<u32>; 2],
}

/// The edges (faces), each with an element that has it and its middle node, that elements do not agree about.
fn unequal(mut all: Vec<(Between, usize, Option<u32>)>) -> Vec<Differing> {
    all.par_sort_unstable();
    let pairs = all
        .windows(2)
        .filter(|pair| pair[0].0 == pair[1].0 && pair[0].2 != pair[1].2);
    let differing = pairs.map(|pair| Differing {
        between: pair[0].0,
        elements: [pair[0].1, pair[1].1],
        middles: [pair[0].2, pair[1].2],
    });
    differing.collect()
}

/// The place of the middle of some corners of an element with its nodes at x.
struct Middle<'a, const D: usize> {
    of: &'a [usize],
    x: &'a [[f64; D]],
}

impl<const D: usize> Visit<D> for Middle<'_, D>
where
    ElementKind: Topology<D>,
{
    type Output = [f64; D];

    fn visit<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(self) -> [f64; D] {
        let mean = 1.0 / self.of.len() as f64;
        let xi = std::array::from_fn(|c| {
            let corners = self.of.iter().map(|&corner| E::NODES[corner][c]);
            mean * corners.sum::<f64>()
        });
        sum(&E::shapes(xi).0, &self.x[..N])
    }
}
