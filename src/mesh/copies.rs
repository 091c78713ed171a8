//! Coinciding elements: copies, which count once, and overlapping ones.

use super::element::facet_corners;
use super::file::raw::MOST_NODES;
use super::{Element, ElementKind, Location, Mesh, MeshError, Topology};
use rayon::prelude::*;
use std::collections::HashMap;

/// Copies of elements: how many, and the first node of the first.
#[derive(Default)]
pub(super) struct Copies {
    count: usize,
    node: u32,
}

impl Copies {
    pub fn add<const D: usize>(&mut self, copy: &Element<D>)
    where
        ElementKind: Topology<D>,
    {
        if self.count == 0 {
            self.node = copy.nodes()[0];
        }
        self.count += 1;
    }

    /// The note on them, if there are any.
    pub fn note<const D: usize>(&self, nodes: &[[f64; D]]) -> Option<String> {
        let (copies, are) = match self.count {
            0 => return None,
            1 => ("one element".to_owned(), "is a copy"),
            count => (format!("{count} elements"), "are copies"),
        };
        let place = Location::from(nodes[self.node as usize]);
        Some(format!(
            "{copies} of the mesh {are} of others on the same nodes, near {place}: each element counts once"
        ))
    }
}

/// Keeps one element of each set of copies. `union` gives the region that is in both of an element and a copy of it. Nodes are
/// numbered below `n_nodes`.
pub(super) fn merge<const D: usize, E>(
    elements: &mut Vec<Element<D>>,
    n_nodes: usize,
    mut union: impl FnMut(&Element<D>, &Element<D>) -> Result<u32, E>,
) -> Result<(), E>
where
    ElementKind: Topology<D>,
{
    // The elements by their lowest node: few share that.
    let lowest = |element: &Element<D>| element.nodes().iter().copied().min().unwrap_or(0) as usize;
    let mut begin = vec![0u32; n_nodes + 1];
    for element in &*elements {
        begin[lowest(element) + 1] += 1;
    }
    for node in 0..n_nodes {
        begin[node + 1] += begin[node];
    }
    let mut next = begin.clone();
    let mut order = vec![0u32; elements.len()];
    for (number, element) in (0..).zip(&*elements) {
        let place = &mut next[lowest(element)];
        order[*place as usize] = number;
        *place += 1;
    }
    let key = |element: &Element<D>| {
        let mut nodes = [u32::MAX; MOST_NODES];
        nodes[..element.nodes().len()].copy_from_slice(element.nodes());
        nodes.sort_unstable();
        nodes
    };
    const COPY: u32 = u32::MAX;
    let mut copies = false;
    for node in 0..n_nodes {
        let same = &mut order[begin[node] as usize..begin[node + 1] as usize];
        if same.len() < 2 {
            continue;
        }
        same.sort_unstable_by_key(|&number| (key(&elements[number as usize]), number));
        let mut first = same[0] as usize;
        for &number in &same[1..] {
            let number = number as usize;
            if key(&elements[first]) != key(&elements[number]) {
                first = number;
                continue;
            }
            elements[first].region = union(&elements[first], &elements[number])?;
            elements[number].region = COPY;
            copies = true;
        }
    }
    if copies {
        elements.retain(|element| element.region != COPY);
    }
    Ok(())
}

impl<const D: usize> Mesh<D>
where
    ElementKind: Topology<D>,
{
    /// Keeps one element of each set of copies, in the regions of all of them, and notes that.
    pub(super) fn merge_copies(&mut self) {
        let mut copies = Copies::default();
        let mut unions: HashMap<[u32; 2], u32> = HashMap::new();
        let mut elements = std::mem::take(&mut self.elements);
        let merged = merge(&mut elements, self.nodes.len(), |first, copy| {
            copies.add(copy);
            let regions = [first.region, copy.region];
            let union = unions.entry(regions).or_insert_with(|| self.union(regions));
            Ok::<_, std::convert::Infallible>(*union)
        });
        merged.unwrap_or_else(|never| match never {});
        self.elements = elements;
        self.notes.extend(copies.note(&self.nodes));
        if !unions.is_empty() {
            self.drop_empty_regions();
        }
    }

    /// The region that belongs to all groups of two regions.
    fn union(&mut self, [a, b]: [u32; 2]) -> u32 {
        let covers = |one: u32, other: u32| {
            (self.groups.values()).all(|of| !of.contains(&other) || of.contains(&one))
        };
        if covers(a, b) {
            return a;
        }
        if covers(b, a) {
            return b;
        }
        let union = self.regions.len() as u32;
        let name = format!(
            "{} & {}",
            self.regions[a as usize], self.regions[b as usize]
        );
        for of in self.groups.values_mut() {
            if of.contains(&a) || of.contains(&b) {
                of.push(union);
            }
        }
        self.groups.entry(name.clone()).or_insert(vec![union]);
        self.regions.push(name);
        union
    }

    /// Drops regions whose elements are all in a union.
    fn drop_empty_regions(&mut self) {
        let mut number = vec![u32::MAX; self.regions.len()];
        for element in &self.elements {
            number[element.region as usize] = 0;
        }
        let kept = number.iter_mut().filter(|number| **number == 0);
        (0..).zip(kept).for_each(|(new, number)| *number = new);
        let of = |region: u32| number[region as usize];
        for element in &mut self.elements {
            element.region = of(element.region);
        }
        for members in self.groups.values_mut() {
            members.retain(|&region| of(region) != u32::MAX);
            members.iter_mut().for_each(|region| *region = of(*region));
        }
        let mut regions = 0..;
        self.regions
            .retain(|_| regions.next().is_some_and(|region| of(region) != u32::MAX));
    }

    /// Checks that no two elements are on the same side of a common facet, whatever their kinds and orders. A
    /// quadrilateral is also identified by the triangles of its corners, where there are facets with three.
    pub(super) fn check_overlaps(&self) -> Result<(), MeshError> {
        let corners = |wanted: usize| {
            let mut facets =
                (self.elements.iter()).flat_map(|element| element.kind().linear().facets());
            facets.any(|facet| facet.len() == wanted)
        };
        let mixed = corners(3) && corners(4);
        // The corners as seen from outside, the lowest first, without that at `out`; an edge has a first and a last one.
        let seen = |corners: &[u32], out: usize| {
            let mut key = [u32::MAX; 4];
            let kept = (0..).zip(corners).filter(|&(at, _)| at != out);
            let len = (key.iter_mut().zip(kept))
                .map(|(key, (_, &corner))| *key = corner)
                .count();
            if D == 3 {
                let lowest = (0..len).min_by_key(|&at| key[at]).unwrap_or(0);
                key[..len].rotate_left(lowest);
            }
            key
        };
        const NONE: usize = usize::MAX;
        let mut sides: Vec<([u32; 4], u32)> = (0..self.elements.len())
            .into_par_iter()
            .flat_map_iter(|number| {
                self.elements[number].facets().flat_map(move |facet| {
                    let quad = facet_corners(&facet).len() == 4;
                    let parts = if mixed && quad { 0..4 } else { 0..0 };
                    let key = move |out| (seen(facet_corners(&facet), out), number as u32);
                    std::iter::once(NONE).chain(parts).map(key)
                })
            })
            .collect();
        sides.par_sort_unstable();
        let pairs = sides.windows(2).filter(|pair| pair[0].0 == pair[1].0);
        let Some(pair) = pairs.min_by_key(|pair| pair[1].1) else {
            return Ok(());
        };
        let corners = pair[0].0.iter().filter(|&&node| node != u32::MAX);
        let places: Vec<[f64; D]> = corners.map(|&node| self.nodes[node as usize]).collect();
        let mean = |c: usize| places.iter().map(|x| x[c]).sum::<f64>() / places.len() as f64;
        Err(MeshError::Overlap {
            elements: [pair[0].1 as usize, pair[1].1 as usize],
            place: Location::from(std::array::from_fn::<f64, D, _>(mean)),
        })
    }
}
