//! Structured meshes of rectangles and blocks.

use super::{Element, ElementKind, Facet, Mesh, Topology, facet};
use std::collections::BTreeMap;

/// The elements of a structured rectangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, Default)]
#[serde(rename_all = "lowercase")]
pub enum CellShape {
    /// 4-node quadrilaterals.
    #[default]
    Quad,
    /// Each cell cut into two 3-node triangles, the diagonals alternating.
    Triangle,
}

/// A rectangle of `cells[0] × cells[1]` equal cells with its lower left corner at `origin`.
///
/// One region `region`; the boundaries are `left`, `right`, `bottom` and `top`, with `prefix` in front.
///
/// # Panics
/// If a number of cells is zero or a size is not positive.
pub fn rectangle(
    origin: [f64; 2],
    size: [f64; 2],
    cells: [usize; 2],
    shape: CellShape,
    region: &str,
    prefix: &str,
) -> Mesh {
    let [nx, ny] = cells;
    assert!(nx > 0 && ny > 0 && size[0] > 0.0 && size[1] > 0.0);
    let node = |i: usize, j: usize| (j * (nx + 1) + i) as u32;
    let mut nodes = Vec::with_capacity((nx + 1) * (ny + 1));
    for j in 0..=ny {
        for i in 0..=nx {
            nodes.push([
                origin[0] + size[0] * (i as f64 / nx as f64),
                origin[1] + size[1] * (j as f64 / ny as f64),
            ]);
        }
    }
    let mut elements = Vec::with_capacity(nx * ny);
    for j in 0..ny {
        for i in 0..nx {
            let [a, b, c, d] = [
                node(i, j),
                node(i + 1, j),
                node(i + 1, j + 1),
                node(i, j + 1),
            ];
            match shape {
                CellShape::Quad => elements.push(Element::quad([a, b, c, d], 0)),
                CellShape::Triangle if (i + j) % 2 == 0 => {
                    elements.push(Element::triangle([a, b, c], 0));
                    elements.push(Element::triangle([a, c, d], 0));
                }
                CellShape::Triangle => {
                    elements.push(Element::triangle([a, b, d], 0));
                    elements.push(Element::triangle([b, c, d], 0));
                }
            }
        }
    }
    let side = |name: &str, n: usize, edge: &dyn Fn(usize) -> [u32; 2]| {
        let edges = (0..n).map(|i| facet::<2>(&edge(i)));
        (format!("{prefix}{name}"), edges.collect())
    };
    let boundaries = BTreeMap::from([
        side("bottom", nx, &|i| [node(i, 0), node(i + 1, 0)]),
        side("right", ny, &|j| [node(nx, j), node(nx, j + 1)]),
        side("top", nx, &|i| [node(i + 1, ny), node(i, ny)]),
        side("left", ny, &|j| [node(0, j + 1), node(0, j)]),
    ]);
    Mesh {
        nodes,
        elements,
        regions: vec![region.to_owned()],
        groups: BTreeMap::from([(region.to_owned(), vec![0])]),
        boundaries,
        node_sets: BTreeMap::new(),
        faults: BTreeMap::new(),
        notes: Vec::new(),
        twins: BTreeMap::new(),
        lost: BTreeMap::new(),
    }
}

/// The elements of a structured block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, Default)]
#[serde(rename_all = "lowercase")]
pub enum SolidShape {
    /// 8-node hexahedra.
    #[default]
    Hexahedron,
    /// Each cell cut into six 4-node tetrahedra around the same diagonal.
    Tetrahedron,
    /// Each cell cut into two 6-node wedges along z, the diagonals alternating.
    Wedge,
}

/// The corners of a cell, in the order of the nodes of a hexahedron: steps along x, y and z.
const CELL: [[usize; 3]; 8] = [
    [0, 0, 0],
    [1, 0, 0],
    [1, 1, 0],
    [0, 1, 0],
    [0, 0, 1],
    [1, 0, 1],
    [1, 1, 1],
    [0, 1, 1],
];

/// Six tetrahedra around the diagonal from corner 0 to corner 6 (Kuhn, Freudenthal): the same in all cells, which
/// makes faces of neighbours match.
const TETRAHEDRA: [[usize; 4]; 6] = [
    [0, 1, 2, 6],
    [0, 2, 3, 6],
    [0, 3, 7, 6],
    [0, 7, 4, 6],
    [0, 4, 5, 6],
    [0, 5, 1, 6],
];

/// Two wedges for either diagonal of the cell as seen along z.
const WEDGES: [[[usize; 6]; 2]; 2] = [
    [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]],
    [[0, 1, 3, 4, 5, 7], [1, 2, 3, 5, 6, 7]],
];

/// A block of `cells[0] × cells[1] × cells[2]` equal cells with its lowest corner at `origin`.
///
/// One region `region`; the boundaries are `left` and `right` across x, `front` and `back` across y, `bottom` and
/// `top` across z, the lower coordinate first, with `prefix` in front.
///
/// # Panics
/// If a number of cells is zero or a size is not positive.
pub fn block(
    origin: [f64; 3],
    size: [f64; 3],
    cells: [usize; 3],
    shape: SolidShape,
    region: &str,
    prefix: &str,
) -> Mesh<3> {
    assert!(cells.iter().all(|&c| c > 0) && size.iter().all(|&s| s > 0.0));
    let [nx, ny, nz] = cells;
    let number = |[i, j, k]: [usize; 3]| {
        u32::try_from((k * (ny + 1) + j) * (nx + 1) + i).expect("few nodes")
    };
    let grid = |[nx, ny, nz]: [usize; 3]| {
        (0..nz).flat_map(move |k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k])))
    };
    let place = |at: [usize; 3]| {
        std::array::from_fn(|c| origin[c] + size[c] * (at[c] as f64 / cells[c] as f64))
    };
    let nodes = grid([nx + 1, ny + 1, nz + 1]).map(place).collect();
    let mut elements = Vec::new();
    // The facets of the elements on each side; a boundary consists of those of whole sides of cells.
    let names = [["left", "right"], ["front", "back"], ["bottom", "top"]];
    let mut sides: [[Vec<Facet<3>>; 2]; 3] = Default::default();
    for cell in grid(cells) {
        let corner = CELL.map(|step| number(std::array::from_fn(|c| cell[c] + step[c])));
        let first = elements.len();
        match shape {
            SolidShape::Hexahedron => elements.push(Element::hexahedron(corner, 0)),
            SolidShape::Tetrahedron => elements
                .extend(TETRAHEDRA.map(|nodes| Element::tetrahedron(nodes.map(|a| corner[a]), 0))),
            SolidShape::Wedge => elements.extend(
                WEDGES[(cell[0] + cell[1]) % 2]
                    .map(|nodes| Element::wedge(nodes.map(|a| corner[a]), 0)),
            ),
        }
        for c in 0..3 {
            for (end, step) in [(0, 0), (1, 1)] {
                if cell[c] + step != [0, cells[c]][end] {
                    continue;
                }
                let there = |node: &u32| (0..8).any(|a| corner[a] == *node && CELL[a][c] == step);
                let facets = elements[first..].iter().flat_map(Element::facets);
                sides[c][end].extend(facets.filter(|facet| facet.iter().all(there)));
            }
        }
    }
    let sides = names.into_iter().zip(sides).flat_map(|(names, sides)| {
        (names.into_iter().zip(sides)).map(|(name, facets)| (format!("{prefix}{name}"), facets))
    });
    Mesh {
        nodes,
        elements,
        regions: vec![region.to_owned()],
        groups: BTreeMap::from([(region.to_owned(), vec![0])]),
        boundaries: sides.collect(),
        node_sets: BTreeMap::new(),
        faults: BTreeMap::new(),
        notes: Vec::new(),
        twins: BTreeMap::new(),
        lost: BTreeMap::new(),
    }
}

/// A name that both meshes have: of a region or a group, or of a boundary or a set of nodes.
pub fn shared_name<'a, const D: usize>(a: &Mesh<D>, b: &'a Mesh<D>) -> Option<&'a str>
where
    ElementKind: Topology<D>,
{
    let group = b.groups.keys().find(|&name| a.groups.contains_key(name));
    let mut places = b.boundaries.keys().chain(b.node_sets.keys());
    let is_place =
        |name: &&String| a.boundaries.contains_key(*name) || a.node_sets.contains_key(*name);
    group.or_else(|| places.find(is_place)).map(String::as_str)
}

/// Two meshes as one: nodes and elements of `b` follow those of `a`; the parts share no node.
///
/// # Panics
/// If both have a [name in common](shared_name).
pub fn join<const D: usize>(mut a: Mesh<D>, mut b: Mesh<D>) -> Mesh<D>
where
    ElementKind: Topology<D>,
{
    let (nodes, regions) = (a.nodes.len() as u32, a.regions.len() as u32);
    b.renumber(|node| node + nodes);
    a.nodes.extend(b.nodes);
    a.regions.extend(b.regions);
    a.elements.extend(b.elements.into_iter().map(|mut element| {
        element.region += regions;
        element
    }));
    for (name, members) in b.groups {
        let members = members.into_iter().map(|region| region + regions).collect();
        assert!(a.groups.insert(name, members).is_none());
    }
    a.faults.extend(b.faults);
    a.lost.extend(b.lost);
    for note in b.notes {
        if !a.notes.contains(&note) {
            a.notes.push(note);
        }
    }
    for (name, facets) in b.boundaries {
        assert!(a.boundaries.insert(name, facets).is_none());
    }
    for (name, nodes) in b.node_sets {
        assert!(a.node_sets.insert(name, nodes).is_none());
    }
    a
}
