//! Structured meshes of rectangles.

use super::{Element, Mesh};
use std::collections::BTreeMap;

/// Which elements fill a structured rectangle.
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
        (format!("{prefix}{name}"), (0..n).map(edge).collect())
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
        faults: BTreeMap::new(),
    }
}

/// Two meshes as one: nodes and elements of `b` follow those of `a`; the parts share no node.
///
/// # Panics
/// If both have a region, a group or a boundary of the same name.
pub fn join(mut a: Mesh, mut b: Mesh) -> Mesh {
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
    for (name, edges) in b.boundaries {
        assert!(a.boundaries.insert(name, edges).is_none());
    }
    a
}
