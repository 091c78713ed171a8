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

/// The entries that `of` gives for each number below n, in lists that are sorted and follow each other: those with one key are neighbours
/// in one of them. Keys begin with a number below `n_nodes`.
pub(super) fn sorted<R: Copy + Ord + Send + Sync, I: Iterator<Item = ([u32; 4], R)>>(
    n: usize,
    n_nodes: usize,
    of: impl Fn(usize) -> I + Sync,
) -> Vec<Vec<([u32; 4], R)>> {
    // Of small meshes one each; of large ones enough for many threads, and lists that are sorted within the cache.
    let tasks = n.div_ceil(1 << 12).min(64);
    let nodes = n_nodes.div_ceil(512).max(256).next_power_of_two();
    let parts: Vec<Vec<Vec<_>>> = (0..tasks)
        .into_par_iter()
        .map(|task| {
            let mut lists = vec![Vec::new(); n_nodes.div_ceil(nodes)];
            for number in task * n / tasks..(task + 1) * n / tasks {
                for entry in of(number) {
                    lists[entry.0[0] as usize >> nodes.ilog2()].push(entry);
                }
            }
            lists
        })
        .collect();
    // Compares faster than an array.
    let packed = |key: &[u32; 4]| {
        key.iter()
            .fold(0, |all: u128, &k| all << 32 | u128::from(k))
    };
    (0..n_nodes.div_ceil(nodes))
        .into_par_iter()
        .map(|list| {
            let mut all = Vec::with_capacity(parts.iter().map(|part| part[list].len()).sum());
            parts
                .iter()
                .for_each(|part| all.extend_from_slice(&part[list]));
            all.sort_unstable_by_key(|&(key, rest)| (packed(&key), rest));
            all
        })
        .collect()
}

/// Keeps one element of each set of copies. `union` gives the region that is in both of an element and a copy of it.
pub(super) fn merge<const D: usize, E>(
    elements: &mut Vec<Element<D>>,
    n_nodes: usize,
    mut union: impl FnMut(&Element<D>, &Element<D>) -> Result<u32, E>,
) -> Result<(), E>
where
    ElementKind: Topology<D>,
{
    let key = |element: &Element<D>| {
        let mut nodes = [u32::MAX; MOST_NODES];
        nodes[..element.nodes().len()].copy_from_slice(element.nodes());
        nodes[..element.nodes().len()].sort_unstable();
        nodes
    };
    // The elements by their lowest nodes: hardly any two have the first four in common.
    let lowest = |number: usize| {
        let [a, b, c, d, ..] = key(&elements[number]);
        std::iter::once(([a, b, c, d], number as u32))
    };
    let mut order = sorted(elements.len(), n_nodes, lowest);
    const COPY: u32 = u32::MAX;
    let mut copies = false;
    let alike = (order.iter_mut()).flat_map(|list| list.chunk_by_mut(|a, b| a.0 == b.0));
    for same in alike.filter(|same| same.len() > 1) {
        same.sort_unstable_by_key(|&(_, number)| (key(&elements[number as usize]), number));
        let mut first = same[0].1 as usize;
        for &(_, number) in &same[1..] {
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
            (self.elements.par_iter()).any(|element| {
                let mut facets = element.kind().linear().facets().iter();
                facets.any(|facet| facet.len() == wanted)
            })
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
        let sides = sorted(self.elements.len(), self.nodes.len(), |number| {
            self.elements[number].facets().flat_map(move |facet| {
                let quad = facet_corners(&facet).len() == 4;
                let parts = if mixed && quad { 0..4 } else { 0..0 };
                let key = move |out| (seen(facet_corners(&facet), out), number as u32);
                std::iter::once(NONE).chain(parts).map(key)
            })
        });
        let pairs = (sides.par_iter()).flat_map_iter(|list| list.windows(2));
        let same = pairs.filter(|pair| pair[0].0 == pair[1].0);
        let Some(pair) = same.min_by_key(|pair| (pair[1].1, pair[0].0)) else {
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
