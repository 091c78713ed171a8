//! Boundaries: the direction of their facets, and which of them are on the outside of the body.

use super::element::{facet_corners, facet_nodes, unsided};
use super::{BoundaryError, ElementKind, Facet, FacetFault, FaultKind, Mesh, Topology};
use rayon::prelude::*;
use std::collections::HashMap;

impl<const D: usize> Mesh<D>
where
    ElementKind: Topology<D>,
{
    /// Orients the facets of boundaries, notes those that are not outer ones, and drops those of no element.
    pub(super) fn direct_boundaries(&mut self) {
        let mut on_boundary = vec![false; self.nodes.len()];
        for &node in self.boundaries.values().flatten().flat_map(facet_corners) {
            on_boundary[node as usize] = true;
        }
        let owners = match self.boundaries.is_empty() {
            true => HashMap::new(),
            false => self.owners(|facet| {
                (facet_corners(facet).iter()).all(|&node| on_boundary[node as usize])
            }),
        };
        for (name, facets) in &mut self.boundaries {
            if facets.is_empty() {
                let fault = FacetFault {
                    kind: FaultKind::Empty,
                    ends: [[0.0; D]; 2],
                };
                self.faults.insert(name.clone(), fault);
            }
            facets.retain_mut(|facet| {
                // A facet without an outside must not be listed twice if a file has it from both sides: one of its
                // elements gives its orientation.
                let corners = facet_corners(facet);
                let ends = [corners[0], corners[corners.len() / 2]];
                let ends = ends.map(|node| self.nodes[node as usize]);
                let kind = match owners.get(&unsided(facet)) {
                    Some(&(1, outward)) => {
                        *facet = outward;
                        return true;
                    }
                    None => FaultKind::Stray,
                    Some(&(_, one_side)) => {
                        *facet = one_side;
                        FaultKind::Inside
                    }
                };
                let fault = FacetFault { kind, ends };
                let worst = self.faults.entry(name.clone()).or_insert(fault);
                if worst.kind < kind {
                    *worst = fault;
                }
                kind == FaultKind::Inside
            });
            facets.sort_unstable();
            facets.dedup();
        }
    }

    /// The number of elements with each facet of some, and its orientation seen from outside the first of them; an outer facet has one
    /// owner. Corners identify facets, because a file may leave out the nodes between them.
    fn owners(
        &self,
        is_there: impl Fn(&Facet<D>) -> bool + Sync,
    ) -> HashMap<[u32; 4], (u32, Facet<D>)> {
        let facets: Vec<Facet<D>> = (self.elements.par_iter())
            .flat_map_iter(|element| element.facets().filter(&is_there))
            .collect();
        let mut owners = HashMap::new();
        for facet in facets {
            owners.entry(unsided(&facet)).or_insert((0, facet)).0 += 1;
        }
        owners
    }

    /// The facets of a boundary, all on the outside of the body: for loads and contact.
    pub fn outer_facets(&self, name: &str) -> Result<&[Facet<D>], BoundaryError> {
        self.facets_with(name, None)
    }

    /// The facets of a boundary, perhaps inside the body: for conditions on its nodes.
    pub fn facets(&self, name: &str) -> Result<&[Facet<D>], BoundaryError> {
        self.facets_with(name, Some(FaultKind::Inside))
    }

    /// The outer facets with all corners, or any corner, among some nodes.
    pub fn outer_facets_at(&self, nodes: &[u32], all: bool) -> Vec<Facet<D>> {
        let mut is_one = vec![false; self.nodes.len()];
        nodes.iter().for_each(|&node| is_one[node as usize] = true);
        let is_there = |facet: &Facet<D>| {
            let mut corners = facet_corners(facet)
                .iter()
                .map(|&node| is_one[node as usize]);
            if all {
                corners.all(|is| is)
            } else {
                corners.any(|is| is)
            }
        };
        let outer = (self.owners(is_there).into_values()).filter(|(count, _)| *count == 1);
        let mut facets: Vec<Facet<D>> = outer.map(|(_, facet)| facet).collect();
        facets.sort_unstable();
        facets
    }

    fn facets_with(
        &self,
        name: &str,
        allowed: Option<FaultKind>,
    ) -> Result<&[Facet<D>], BoundaryError> {
        match (self.boundaries.get(name), self.faults.get(name)) {
            (_, Some(fault)) if allowed != Some(fault.kind) => Err(BoundaryError::Faulty {
                name: name.to_owned(),
                kind: fault.kind,
                fault: format!("{fault}: {}", fault.remedy()),
            }),
            (Some(facets), _) => Ok(facets),
            (None, _) => Err(BoundaryError::Unknown(name.to_owned())),
        }
    }

    /// The length (area) of a boundary facet and its outward unit normal: of a curved one the mean.
    pub fn facet_normal(&self, facet: &Facet<D>) -> (f64, [f64; D]) {
        let (x, len) = self.places_of(facet);
        <ElementKind as Topology<D>>::facet_normal(&x[..len])
    }

    /// The mean of the corners of a facet.
    pub(crate) fn facet_middle(&self, facet: &Facet<D>) -> [f64; D] {
        let (x, len) = self.corners_of(facet);
        let sum = |c: usize| x[..len].iter().map(|x| x[c]).sum::<f64>();
        std::array::from_fn(|c| sum(c) / len as f64)
    }

    /// The coordinates of the corners of a facet, and how many these are.
    pub(crate) fn corners_of(&self, facet: &Facet<D>) -> ([[f64; D]; 4], usize) {
        let (x, _) = self.places_of(facet);
        (std::array::from_fn(|a| x[a]), facet_corners(facet).len())
    }

    /// The coordinates of the nodes of a facet, and how many these are.
    pub(crate) fn places_of(&self, facet: &Facet<D>) -> ([[f64; D]; 9], usize) {
        let mut x = [[0.0; D]; 9];
        let nodes = facet_nodes(facet);
        for (x, &node) in x.iter_mut().zip(nodes) {
            *x = self.nodes[node as usize];
        }
        (x, nodes.len())
    }
}

impl<const D: usize> FacetFault<D> {
    fn remedy(&self) -> String {
        let part = if D == 2 { "curve" } else { "surface" };
        let otherwise = match self.kind {
            FaultKind::Inside => " or, where two bodies touch, draw it once for each",
            FaultKind::Stray => "",
            FaultKind::Empty => {
                return format!(
                    "look at what selects its {part}s (coordinates are rounded), or leave it out"
                );
            }
            FaultKind::NoFacet => {
                return format!("name a {part} of the body or, for a support, its point");
            }
        };
        format!("take that {part} out of the physical group{otherwise}")
    }
}
