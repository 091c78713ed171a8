//! Cuts through bodies: along facets between elements, one side gets nodes of its own.

use super::element::{facet_nodes, unsided};
use super::groups::Groups;
use super::{Element, ElementKind, Facet, Location, Mesh, Topology};
use std::collections::{HashMap, HashSet};

/// A facet between two elements.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Between<const D: usize>
where
    ElementKind: Topology<D>,
{
    /// As the element behind it has it, seen from outside that element.
    pub facet: Facet<D>,
    /// The elements behind it and in front of it.
    pub elements: [u32; 2],
}

impl<const D: usize> Between<D>
where
    ElementKind: Topology<D>,
{
    /// The parts of these facets that are connected by common nodes.
    pub fn parts(all: &[Self]) -> Vec<Vec<Self>> {
        let mut groups = Groups::new(all.len());
        let mut first: HashMap<u32, u32> = HashMap::new();
        for (number, one) in (0..).zip(all) {
            for &node in facet_nodes(&one.facet) {
                groups.join(number, *first.entry(node).or_insert(number));
            }
        }
        let (count, numbers) = groups.numbers();
        let mut parts = vec![Vec::new(); count];
        for (one, number) in all.iter().zip(numbers) {
            parts[number as usize].push(*one);
        }
        parts
    }
}

/// A mesh after a cut.
#[derive(Clone, Debug)]
pub(crate) struct Cut<const D: usize>
where
    ElementKind: Topology<D>,
{
    /// The facets of the side that has kept its nodes.
    pub facets: Vec<Facet<D>>,
    /// Each of its nodes, and the new one of the other side.
    pub nodes: Vec<[u32; 2]>,
}

impl<const D: usize> Mesh<D>
where
    ElementKind: Topology<D>,
{
    /// The facets between two elements for which `wanted` is true, each once. Of every facet, `in_front` tells which of its elements,
    /// with the facet as that element has it, is in front.
    pub(crate) fn between(
        &self,
        wanted: impl Fn(&Element<D>, &Facet<D>) -> bool,
        in_front: impl Fn(&Element<D>, &Facet<D>) -> bool,
    ) -> Vec<Between<D>> {
        let mut first: HashMap<[u32; 4], (u32, Facet<D>)> = HashMap::new();
        let mut found = Vec::new();
        for (number, element) in (0..).zip(&self.elements) {
            for facet in element.facets().filter(|facet| wanted(element, facet)) {
                let Some((other, seen)) = first.insert(unsided(&facet), (number, facet)) else {
                    continue;
                };
                let sides = [(other, seen), (number, facet)];
                let is_front = |&(number, facet): &(u32, Facet<D>)| {
                    in_front(&self.elements[number as usize], &facet)
                };
                match sides.each_ref().map(is_front) {
                    [false, true] => found.push(Between {
                        facet: seen,
                        elements: [other, number],
                    }),
                    [true, false] => found.push(Between {
                        facet,
                        elements: [number, other],
                    }),
                    _ => {}
                }
            }
        }
        found
    }

    /// Cuts the mesh along facets between elements. The elements in front of them get nodes of their own, which come after all
    /// others; boundaries and sets of nodes have those of both sides.
    ///
    /// # Errors
    /// A node at which both sides stay connected: there the cut ends within the body.
    pub(crate) fn cut(&mut self, along: &[Between<D>]) -> Result<Cut<D>, Location> {
        let keys: HashMap<[u32; 4], Facet<D>> = along
            .iter()
            .map(|one| (unsided(&one.facet), one.facet))
            .collect();
        let mut nodes: Vec<u32> = along
            .iter()
            .flat_map(|one| facet_nodes(&one.facet).to_vec())
            .collect();
        nodes.sort_unstable();
        nodes.dedup();
        let is_cut = |node: &u32| nodes.binary_search(node).is_ok();
        // Around each node of the cut, the elements that are connected by facets at it.
        let mut number_of: HashMap<(u32, u32), u32> = HashMap::new();
        for (element, one) in (0..).zip(&self.elements) {
            for &node in one.nodes().iter().filter(|node| is_cut(node)) {
                let next = number_of.len() as u32;
                number_of.insert((node, element), next);
            }
        }
        let mut near: Vec<u32> = number_of.keys().map(|&(_, element)| element).collect();
        near.sort_unstable();
        near.dedup();
        let mut groups = Groups::new(number_of.len());
        let mut owner: HashMap<[u32; 4], u32> = HashMap::new();
        for &element in &near {
            for facet in self.elements[element as usize].facets() {
                let key = unsided(&facet);
                if let Some(&other) = owner.get(&key)
                    && !keys.contains_key(&key)
                {
                    for &node in facet_nodes(&facet).iter().filter(|node| is_cut(node)) {
                        groups.join(number_of[&(node, element)], number_of[&(node, other)]);
                    }
                }
                owner.entry(key).or_insert(element);
            }
        }
        let mut sides = [HashSet::new(), HashSet::new()];
        for one in along {
            for &node in facet_nodes(&one.facet) {
                for (side, &element) in sides.iter_mut().zip(&one.elements) {
                    side.insert(groups.of(number_of[&(node, element)]));
                }
            }
        }
        let [behind, front] = sides;
        let mut moved: HashSet<(u32, u32)> = HashSet::new();
        for (&at, &number) in &number_of {
            let group = groups.of(number);
            if !front.contains(&group) {
                continue;
            }
            if behind.contains(&group) {
                return Err(self.nodes[at.0 as usize].into());
            }
            moved.insert(at);
        }

        let before = self.nodes.len() as u32;
        let copy = |node: u32| nodes.binary_search(&node).ok().map(|i| before + i as u32);
        let renumber = |all: &mut [u32], element: u32| {
            for node in all.iter_mut() {
                if moved.contains(&(*node, element)) {
                    *node = copy(*node).expect("it is a node of the cut");
                }
            }
        };
        for (name, facets) in &mut self.boundaries {
            let mut is_along = false;
            for facet in facets.iter_mut() {
                let key = unsided(facet);
                match owner.get(&key) {
                    _ if keys.contains_key(&key) => is_along = true,
                    Some(&element) => renumber(facet.as_mut(), element),
                    None => {}
                }
            }
            // It is on the outside now: of the side that keeps its nodes.
            if is_along {
                for facet in facets.iter_mut() {
                    if let Some(behind) = keys.get(&unsided(facet)) {
                        *facet = *behind;
                    }
                }
                if facets
                    .iter()
                    .all(|facet| keys.contains_key(&unsided(facet)))
                {
                    self.faults.remove(name);
                }
            }
            facets.sort_unstable();
        }
        for &element in &near {
            renumber(self.elements[element as usize].nodes_mut(), element);
        }
        for set in self.node_sets.values_mut() {
            let copies: Vec<u32> = set.iter().filter_map(|&node| copy(node)).collect();
            // New numbers are higher than all others.
            set.extend(copies);
        }
        for &node in &nodes {
            self.twins.insert(self.nodes.len() as u32, node);
            self.nodes.push(self.nodes[node as usize]);
        }
        Ok(Cut {
            facets: along.iter().map(|one| one.facet).collect(),
            nodes: nodes
                .iter()
                .map(|&node| [node, copy(node).expect("it is a node of the cut")])
                .collect(),
        })
    }
}
