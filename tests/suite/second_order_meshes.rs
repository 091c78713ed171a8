//! Meshes of second order: in every format, raised from those of first order, and compared with those.
//!
//! Files are written here by the lists of nodes in the manuals of Gmsh, VTK and Abaqus: each node by the corners on either
//! side of it. The meshes are bent, so that a node at another edge than its own is noticed.

use crate::common::or_panic::OrPanic as _;
use crate::gmsh::drawing::{CODINGS, Coding, Out};
use signorini::case::Case;
use signorini::mesh::structured::{CellShape, SolidShape, block, rectangle};
use signorini::mesh::{
    AnyMesh, Element, ElementKind, Facet, Mesh, MeshError, Topology, facet_corners, facet_nodes,
    msh, read, read_linear,
};
use signorini::model::AnyAnalysis;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt::Write as _;
use std::path::Path;

/// The source of lists of nodes.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Lists {
    Gmsh,
    Vtk,
    Abaqus,
}

/// The corners on either side of each node after the corners.
fn middles(kind: ElementKind, lists: Lists) -> &'static [&'static [usize]] {
    let all: &'static [&'static [usize]] = match (kind.linear(), lists) {
        (ElementKind::Triangle, _) => &[&[0, 1], &[1, 2], &[2, 0]],
        (ElementKind::Quad, _) => &[&[0, 1], &[1, 2], &[2, 3], &[3, 0], &[0, 1, 2, 3]],
        (ElementKind::Tetrahedron, Lists::Gmsh) => {
            &[&[0, 1], &[1, 2], &[2, 0], &[3, 0], &[2, 3], &[1, 3]]
        }
        (ElementKind::Tetrahedron, _) => &[&[0, 1], &[1, 2], &[2, 0], &[3, 0], &[1, 3], &[2, 3]],
        (ElementKind::Hexahedron, Lists::Gmsh) => &[
            &[0, 1],
            &[0, 3],
            &[0, 4],
            &[1, 2],
            &[1, 5],
            &[2, 3],
            &[2, 6],
            &[3, 7],
            &[4, 5],
            &[4, 7],
            &[5, 6],
            &[6, 7],
            &[0, 3, 2, 1],
            &[0, 1, 5, 4],
            &[0, 4, 7, 3],
            &[1, 2, 6, 5],
            &[2, 3, 7, 6],
            &[4, 5, 6, 7],
            &[0, 1, 2, 3, 4, 5, 6, 7],
        ],
        (ElementKind::Hexahedron, Lists::Vtk) => &[
            &[0, 1],
            &[1, 2],
            &[2, 3],
            &[3, 0],
            &[4, 5],
            &[5, 6],
            &[6, 7],
            &[7, 4],
            &[0, 4],
            &[1, 5],
            &[2, 6],
            &[3, 7],
            &[0, 4, 7, 3],
            &[1, 2, 6, 5],
            &[0, 1, 5, 4],
            &[3, 7, 6, 2],
            &[0, 3, 2, 1],
            &[4, 5, 6, 7],
            &[0, 1, 2, 3, 4, 5, 6, 7],
        ],
        (ElementKind::Hexahedron, Lists::Abaqus) => &[
            &[0, 1],
            &[1, 2],
            &[2, 3],
            &[3, 0],
            &[4, 5],
            &[5, 6],
            &[6, 7],
            &[7, 4],
            &[0, 4],
            &[1, 5],
            &[2, 6],
            &[3, 7],
            &[0, 1, 2, 3, 4, 5, 6, 7],
            &[0, 1, 2, 3],
            &[4, 7, 6, 5],
            &[0, 4, 5, 1],
            &[1, 5, 6, 2],
            &[2, 6, 7, 3],
            &[3, 7, 4, 0],
        ],
        (ElementKind::Wedge, Lists::Gmsh) => &[
            &[0, 1],
            &[0, 2],
            &[0, 3],
            &[1, 2],
            &[1, 4],
            &[2, 5],
            &[3, 4],
            &[3, 5],
            &[4, 5],
            &[0, 1, 4, 3],
            &[0, 3, 5, 2],
            &[1, 2, 5, 4],
        ],
        (ElementKind::Wedge, _) => &[
            &[0, 1],
            &[1, 2],
            &[2, 0],
            &[3, 4],
            &[4, 5],
            &[5, 3],
            &[0, 3],
            &[1, 4],
            &[2, 5],
            &[0, 1, 4, 3],
            &[1, 2, 5, 4],
            &[2, 0, 3, 5],
        ],
        _ => &[],
    };
    &all[..kind.n_nodes() - kind.n_corners()]
}

/// Its number in Gmsh and in VTK, and its name in Abaqus.
fn called(kind: ElementKind) -> (i64, i64, &'static str) {
    match kind {
        ElementKind::Triangle => (2, 5, "CPE3"),
        ElementKind::Triangle6 => (9, 22, "CPE6"),
        ElementKind::Quad => (3, 9, "CPS4"),
        ElementKind::Quad8 => (16, 23, "CPS8R"),
        ElementKind::Quad9 => (10, 28, "CPE9"),
        ElementKind::Tetrahedron => (4, 10, "C3D4"),
        ElementKind::Tetrahedron10 => (11, 24, "C3D10"),
        ElementKind::Hexahedron => (5, 12, "C3D8"),
        ElementKind::Hexahedron20 => (17, 25, "C3D20R"),
        ElementKind::Hexahedron27 => (12, 29, "C3D27"),
        ElementKind::Wedge => (6, 13, "C3D6"),
        ElementKind::Wedge15 => (18, 26, "C3D15"),
        ElementKind::Wedge18 => (13, 32, ""),
        ElementKind::Pyramid => (7, 14, "C3D5"),
    }
}

/// The same of facets with so many nodes.
fn facet_called<const D: usize>(n_nodes: usize) -> (i64, i64, &'static str) {
    match (D, n_nodes) {
        (2, 2) => (1, 3, "T2D2"),
        (2, _) => (8, 21, "T2D3"),
        (_, 3) => (2, 5, "S3"),
        (_, 4) => (3, 9, "S4R"),
        (_, 6) => (9, 22, "STRI65"),
        (_, 8) => (16, 23, "S8R"),
        _ => (10, 28, "S9R5"),
    }
}

/// A mesh with straight sides, and the same one bent.
struct Bent<const D: usize>
where
    ElementKind: Topology<D>,
{
    straight: Mesh<D>,
    bent: Mesh<D>,
    at: HashMap<[i64; 3], u32>,
}

/// A point for identifying a node.
fn key<const D: usize>(x: [f64; D]) -> [i64; 3] {
    std::array::from_fn(|c| x.get(c).map_or(0, |x| (x * 1e6).round() as i64))
}

fn bend<const D: usize>(x: [f64; D]) -> [f64; D] {
    let z = x.get(2).copied().unwrap_or(0.0);
    let whole = [
        x[0] + 0.15 * x[1] * x[1] + 0.1 * z * z,
        x[1] + 0.1 * x[0] * x[0] + 0.1 * x[0] * z,
        z + 0.1 * x[0] * x[1],
    ];
    std::array::from_fn(|c| whole[c])
}

impl<const D: usize> Bent<D>
where
    ElementKind: Topology<D>,
{
    fn new(straight: Mesh<D>) -> Self {
        let at: HashMap<_, _> = (straight.nodes.iter().map(|&x| key(x))).zip(0..).collect();
        assert_eq!(at.len(), straight.nodes.len());
        let nodes = straight.nodes.iter().map(|&x| bend(x)).collect();
        let bent = Mesh::new(
            nodes,
            straight.elements.clone(),
            straight.regions.clone(),
            straight.boundaries.clone(),
        );
        Self {
            bent: bent.or_panic(),
            straight,
            at,
        }
    }

    fn middle(&self, corners: &[u32]) -> u32 {
        let sum = |c: usize| {
            let places = corners
                .iter()
                .map(|&node| self.straight.nodes[node as usize][c]);
            places.sum::<f64>() / corners.len() as f64
        };
        self.at[&key::<D>(std::array::from_fn(sum))]
    }

    /// The nodes of an element in the order of a list.
    fn listed(&self, element: &Element<D>, lists: Lists) -> Vec<u32> {
        let corners = &element.nodes()[..element.kind().n_corners()];
        let middles = middles(element.kind(), lists).iter().map(|of| {
            let of: Vec<u32> = of.iter().map(|&corner| corners[corner]).collect();
            self.middle(&of)
        });
        corners.iter().copied().chain(middles).collect()
    }

    /// The nodes of a facet: corners, midsides, the middle, in any program.
    fn listed_facet(&self, facet: &Facet<D>) -> Vec<u32> {
        let corners = facet_corners(facet);
        let mut nodes = corners.to_vec();
        let ends = |a: usize| [corners[a], corners[(a + 1) % corners.len()]];
        let edges = if D == 2 { 1 } else { corners.len() };
        let more = facet_nodes(facet).len() - corners.len();
        for a in 0..more.min(edges) {
            nodes.push(self.middle(&ends(a)));
        }
        if more > edges {
            nodes.push(self.middle(corners));
        }
        nodes
    }

    /// Checks that the mesh read is the bent mesh, with its nodes at their own edges.
    #[track_caller]
    fn is(&self, found: &Mesh<D>, name: impl Fn(&str) -> String, what: &str) {
        assert_eq!(found.nodes, self.bent.nodes, "{what}");
        assert_eq!(found.elements.len(), self.bent.elements.len(), "{what}");
        for (element, own) in found.elements.iter().zip(&self.bent.elements) {
            assert_eq!(element.kind(), own.kind(), "{what}");
            let (corners, middles) = element.nodes().split_at(element.kind().n_corners());
            for (&node, of) in middles.iter().zip(element.kind().middles()) {
                let of: Vec<u32> = of.iter().map(|&corner| corners[corner]).collect();
                assert_eq!(node, self.middle(&of), "{what}");
            }
        }
        assert!(found.faults.is_empty(), "{what}: {:?}", found.faults);
        assert_eq!(found.boundaries.len(), self.bent.boundaries.len(), "{what}");
        for (boundary, own) in &self.bent.boundaries {
            let named = name(boundary);
            let facets = &found.boundaries[&named];
            assert_eq!(facets.len(), own.len(), "{what}: {boundary}");
            let area = |mesh: &Mesh<D>, facets: &[Facet<D>]| -> f64 {
                facets.iter().map(|facet| mesh.facet_normal(facet).0).sum()
            };
            let ratio = area(found, facets) / area(&self.bent, own);
            assert!((ratio - 1.0).abs() < 1e-14, "{what}: {boundary} {ratio}");
            for facet in facets {
                assert_eq!(
                    facet_nodes(facet),
                    self.listed_facet(facet),
                    "{what}: {boundary}"
                );
            }
        }
        let volume = |mesh: &Mesh<D>| mesh.measures().iter().sum::<f64>();
        let ratio = volume(found) / volume(&self.bent);
        assert!((ratio - 1.0).abs() < 1e-14, "{what}: {ratio}");
    }

    /// The file of Gmsh: the region is group 1, the boundaries are 11 and on.
    fn gmsh(&self, version: &str, coding: Coding) -> Vec<u8> {
        let mut out = Out::new(version, coding);
        let old = version != "4.1";
        let boundaries = || (11i64..).zip(&self.bent.boundaries);
        let mut names = format!(
            "$PhysicalNames\n{}\n{D} 1 \"body\"\n",
            1 + self.bent.boundaries.len()
        );
        for (tag, (name, _)) in boundaries() {
            let _ = writeln!(names, "{} {tag} \"{name}\"", D - 1);
        }
        out.text(&(names + "$EndPhysicalNames\n"));
        let n = self.bent.nodes.len();
        // Entity, dimension, type, nodes; those of one entity and type together.
        let mut rows: Vec<(i64, usize, i64, Vec<u32>)> = Vec::new();
        for (tag, (_, facets)) in boundaries() {
            for facet in facets {
                let nodes = self.listed_facet(facet);
                rows.push((tag, D - 1, facet_called::<D>(nodes.len()).0, nodes));
            }
        }
        for element in &self.bent.elements {
            rows.push((
                1,
                D,
                called(element.kind()).0,
                self.listed(element, Lists::Gmsh),
            ));
        }
        let z = |x: &[f64; D]| x.get(2).copied().unwrap_or(0.0);
        if old {
            out.text(&format!("$Nodes\n{n}\n"));
            for (number, x) in (1..).zip(&self.bent.nodes) {
                out.int(number);
                [x[0], x[1], z(x)].iter().for_each(|&v| out.float(v));
            }
            out.text(&format!("\n$EndNodes\n$Elements\n{}\n", rows.len()));
            for (number, (tag, _, kind, nodes)) in (1..).zip(&rows) {
                let head = match coding {
                    Coding::Ascii => vec![number, *kind, 2, *tag, *tag],
                    _ => vec![*kind, 1, 2, number, *tag, *tag],
                };
                head.iter().for_each(|&v| out.int(v));
                nodes.iter().for_each(|&node| out.int(i64::from(node) + 1));
            }
            out.text("\n$EndElements\n");
            return out.bytes;
        }
        out.text("$Entities\n");
        for dim in 0..4 {
            let of_facets = if dim == D - 1 {
                self.bent.boundaries.len()
            } else {
                0
            };
            out.size((of_facets + usize::from(dim == D)) as u64);
        }
        let tags = boundaries().map(|boundary| boundary.0).chain([1]);
        for tag in tags {
            out.int(tag);
            (0..6).for_each(|_| out.float(0.0));
            out.size(1);
            out.int(tag);
            out.size(0);
        }
        out.text("\n$EndEntities\n$Nodes\n");
        [1, n as u64, 1, n as u64].iter().for_each(|&v| out.size(v));
        [D as i64, 1, 0].iter().for_each(|&v| out.int(v));
        out.size(n as u64);
        (1..=n as u64).for_each(|tag| out.size(tag));
        for x in &self.bent.nodes {
            [x[0], x[1], z(x)].iter().for_each(|&v| out.float(v));
        }
        out.text("\n$EndNodes\n$Elements\n");
        let blocks: Vec<_> = rows.chunk_by(|a, b| (a.0, a.2) == (b.0, b.2)).collect();
        [blocks.len(), rows.len(), 1, rows.len()]
            .iter()
            .for_each(|&v| out.size(v as u64));
        let mut number = 0;
        for rows in blocks {
            let (tag, dim, kind, _) = &rows[0];
            [*dim as i64, *tag, *kind].iter().for_each(|&v| out.int(v));
            out.size(rows.len() as u64);
            for (.., nodes) in rows {
                number += 1;
                out.size(number);
                nodes.iter().for_each(|&node| out.size(u64::from(node) + 1));
            }
        }
        out.text("\n$EndElements\n");
        out.bytes
    }

    /// The grid of VTK: the region is 1, the boundaries are 11 and on.
    fn vtu(&self) -> String {
        let mut cells: Vec<(i64, i64, Vec<u32>)> = Vec::new();
        for (value, (_, facets)) in (11..).zip(&self.bent.boundaries) {
            for facet in facets {
                let nodes = self.listed_facet(facet);
                cells.push((value, facet_called::<D>(nodes.len()).1, nodes));
            }
        }
        for element in &self.bent.elements {
            cells.push((
                1,
                called(element.kind()).1,
                self.listed(element, Lists::Vtk),
            ));
        }
        let array = |name: &str, more: &str, values: Vec<String>| {
            format!(
                "<DataArray type=\"{}\" Name=\"{name}\"{more} format=\"ascii\">{}</DataArray>\n",
                if name == "Points" { "Float64" } else { "Int64" },
                values.join(" ")
            )
        };
        let coordinates =
            self.bent.nodes.iter().flat_map(|x| {
                [x[0], x[1], x.get(2).copied().unwrap_or(0.0)].map(|v| format!("{v:?}"))
            });
        let ends = cells.iter().scan(0, |end, cell| {
            *end += cell.2.len();
            Some(end.to_string())
        });
        let nodes = cells.iter().flat_map(|cell| &cell.2).map(u32::to_string);
        format!(
            "<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\">\n<UnstructuredGrid>\n\
             <Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n<Points>\n{}</Points>\n<Cells>\n{}{}{}</Cells>\n\
             <CellData>\n{}</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n",
            self.bent.nodes.len(),
            cells.len(),
            array("Points", " NumberOfComponents=\"3\"", coordinates.collect()),
            array("connectivity", "", nodes.collect()),
            array("offsets", "", ends.collect()),
            array(
                "types",
                "",
                cells.iter().map(|cell| cell.1.to_string()).collect()
            ),
            array(
                "region",
                "",
                cells.iter().map(|cell| cell.0.to_string()).collect()
            ),
        )
    }

    /// The input file of Abaqus: a boundary is a surface, a set of all nodes, a set of corners or shells (trusses), by turns.
    fn inp(&self) -> String {
        let mut text = "*NODE\n".to_owned();
        let mut put = |line: std::fmt::Arguments| {
            let _ = text.write_fmt(line);
            text.push('\n');
        };
        for (number, x) in (1..).zip(&self.bent.nodes) {
            let x: Vec<String> = x.iter().map(|v| format!("{v:?}")).collect();
            put(format_args!("{number}, {}", x.join(", ")));
        }
        let numbers = |nodes: &[u32]| -> Vec<String> {
            let mut lines: Vec<String> = nodes.iter().map(|node| (node + 1).to_string()).collect();
            // At most 16 entries a line.
            for place in (10..lines.len()).step_by(10) {
                lines[place].insert(0, '\n');
            }
            lines
        };
        for (number, element) in (1..).zip(&self.bent.elements) {
            let name = called(element.kind()).2;
            put(format_args!("*ELEMENT, TYPE={name}, ELSET=body"));
            let nodes = numbers(&self.listed(element, Lists::Abaqus));
            put(format_args!("{number}, {}", nodes.join(", ")));
        }
        let mut number = self.bent.elements.len();
        for (turn, (name, facets)) in self.bent.boundaries.iter().enumerate() {
            if turn % 4 == 0 {
                put(format_args!("*SURFACE, NAME={name}"));
                for facet in facets {
                    let (element, side) = self.side(facet);
                    put(format_args!("{}, S{side}", element + 1));
                }
                continue;
            }
            if turn % 4 == 3 {
                for facet in facets {
                    number += 1;
                    let mut nodes = self.listed_facet(facet);
                    if nodes.len() == 3 && D == 2 {
                        // The middle of a truss is between its ends.
                        nodes.swap(1, 2);
                    }
                    let kind = facet_called::<D>(nodes.len()).2;
                    put(format_args!("*ELEMENT, TYPE={kind}, ELSET={name}"));
                    put(format_args!("{number}, {}", numbers(&nodes).join(", ")));
                }
                continue;
            }
            put(format_args!("*NSET, NSET={name}"));
            for facet in facets {
                let nodes = if turn % 4 == 1 {
                    facet_nodes(facet)
                } else {
                    facet_corners(facet)
                };
                put(format_args!("{}", numbers(nodes).join(", ")));
            }
        }
        text
    }

    /// The element of a facet, and the number of that face, from 1.
    fn side(&self, facet: &Facet<D>) -> (usize, usize) {
        let corners = facet_corners(facet);
        let sides = |kind: ElementKind| -> &'static [&'static [usize]] {
            match kind.linear() {
                ElementKind::Triangle => &[&[0, 1], &[1, 2], &[2, 0]],
                ElementKind::Quad => &[&[0, 1], &[1, 2], &[2, 3], &[3, 0]],
                ElementKind::Tetrahedron => &[&[0, 1, 2], &[0, 3, 1], &[1, 3, 2], &[2, 3, 0]],
                ElementKind::Wedge => &[
                    &[0, 1, 2],
                    &[3, 5, 4],
                    &[0, 3, 4, 1],
                    &[1, 4, 5, 2],
                    &[2, 5, 3, 0],
                ],
                _ => &[
                    &[0, 1, 2, 3],
                    &[4, 7, 6, 5],
                    &[0, 4, 5, 1],
                    &[1, 5, 6, 2],
                    &[2, 6, 7, 3],
                    &[3, 7, 4, 0],
                ],
            }
        };
        for (number, element) in self.bent.elements.iter().enumerate() {
            for (side, places) in (1..).zip(sides(element.kind())) {
                let there = |&place: &usize| corners.contains(&element.nodes()[place]);
                if places.len() == corners.len() && places.iter().all(there) {
                    return (number, side);
                }
            }
        }
        panic!("a facet of no element")
    }
}

/// The kinds of second order without the nodes in the middle of faces.
fn serendipity(kind: ElementKind) -> ElementKind {
    match kind {
        ElementKind::Quad9 => ElementKind::Quad8,
        ElementKind::Hexahedron27 => ElementKind::Hexahedron20,
        ElementKind::Wedge18 => ElementKind::Wedge15,
        other => other,
    }
}

fn without_middles<const D: usize>(mesh: &Mesh<D>, which: impl Fn(usize) -> bool) -> Mesh<D>
where
    ElementKind: Topology<D>,
{
    let elements = mesh.elements.iter().enumerate().map(|(number, element)| {
        let kind = match which(number) {
            true => serendipity(element.kind()),
            false => element.kind(),
        };
        Element::new(kind, &element.nodes()[..kind.n_nodes()], element.region)
    });
    let (regions, boundaries) = (mesh.regions.clone(), mesh.boundaries.clone());
    Mesh::new(mesh.nodes.clone(), elements.collect(), regions, boundaries).or_panic()
}

fn flat(shape: CellShape) -> Mesh {
    rectangle([0.0; 2], [2.0, 1.0], [3, 2], shape, "body", "")
}

fn solid(shape: SolidShape) -> Mesh<3> {
    block([0.0; 3], [1.0, 1.0, 0.5], [2, 2, 1], shape, "body", "")
}

/// Meshes of all kinds of the plane.
fn flats() -> Vec<Mesh> {
    let mut all = Vec::new();
    for shape in [CellShape::Triangle, CellShape::Quad] {
        let raised = flat(shape).raised().or_panic();
        if shape == CellShape::Quad {
            all.push(without_middles(&raised, |_| true));
        }
        all.extend([flat(shape), raised]);
    }
    all
}

/// Meshes of all kinds of space, but pyramids.
fn solids() -> Vec<Mesh<3>> {
    let mut all = Vec::new();
    for shape in [
        SolidShape::Tetrahedron,
        SolidShape::Hexahedron,
        SolidShape::Wedge,
    ] {
        let raised = solid(shape).raised().or_panic();
        if shape != SolidShape::Tetrahedron {
            all.push(without_middles(&raised, |_| true));
        }
        all.extend([solid(shape), raised]);
    }
    all
}

/// The result of a file with this name and content.
fn parsed(name: &str, bytes: &[u8], linear: bool) -> Result<AnyMesh, String> {
    let place = tempfile::tempdir().or_panic();
    let path = place.path().join(name);
    std::fs::write(&path, bytes).or_panic();
    let mesh = match linear {
        true => read_linear(&path, 1.0, None),
        false => read(&path, 1.0, None),
    };
    mesh.map_err(|error| error.to_string())
}

/// Meshes of either dimension, as one.
trait Any: Sized {
    fn of(mesh: AnyMesh) -> Self;
    fn any(self) -> AnyMesh;
}

impl Any for Mesh {
    fn of(mesh: AnyMesh) -> Self {
        match mesh {
            AnyMesh::Plane(mesh) => mesh,
            AnyMesh::Space(_) => panic!("no mesh of the plane"),
        }
    }

    fn any(self) -> AnyMesh {
        AnyMesh::Plane(self)
    }
}

impl Any for Mesh<3> {
    fn of(mesh: AnyMesh) -> Self {
        match mesh {
            AnyMesh::Plane(_) => panic!("no solid"),
            AnyMesh::Space(mesh) => mesh,
        }
    }

    fn any(self) -> AnyMesh {
        AnyMesh::Space(self)
    }
}

fn every_format<const D: usize>(straight: Mesh<D>)
where
    ElementKind: Topology<D>,
    Mesh<D>: Any,
{
    let kind = straight.elements[0].kind();
    let order = kind.order();
    let bent = Bent::new(straight);
    let same = |name: &str| name.to_owned();
    for version in ["2.2", "4.1"] {
        for coding in CODINGS {
            let what = format!("{kind:?}, MSH {version} {coding:?}");
            let bytes = bent.gmsh(version, coding);
            let mesh = Mesh::<D>::of(parsed("a.msh", &bytes, false).or_panic());
            bent.is(&mesh, same, &what);
        }
    }
    let mesh = Mesh::<D>::of(parsed("a.vtu", bent.vtu().as_bytes(), false).or_panic());
    let values: BTreeMap<&String, String> = (bent.bent.boundaries.keys())
        .zip((11..).map(|value: i32| value.to_string()))
        .collect();
    bent.is(
        &mesh,
        |name| values[&name.to_owned()].clone(),
        &format!("{kind:?}, vtu"),
    );
    if !called(kind).2.is_empty() {
        let mesh = Mesh::<D>::of(parsed("a.inp", bent.inp().as_bytes(), false).or_panic());
        bent.is(&mesh, same, &format!("{kind:?}, inp"));
        let reduced = ["CPS8R", "C3D20R"].contains(&called(kind).2);
        assert_eq!(mesh.notes.len(), usize::from(reduced));
    }
    // The output for Gmsh is read back.
    let written = msh(&bent.bent.clone().any());
    let again = Mesh::<D>::of(parsed("a.msh", written.as_bytes(), false).or_panic());
    bent.is(&again, same, &format!("{kind:?}, written"));
    assert_eq!(again.elements, bent.bent.elements);
    // Without its midsides it is the linear mesh, by either way.
    let corners = Mesh::<D>::of(parsed("a.msh", written.as_bytes(), true).or_panic());
    let linear = bent.bent.linear().or_panic();
    assert_eq!(linear.elements[0].kind(), kind.linear());
    assert_eq!(
        (corners.nodes, corners.elements),
        (linear.nodes, linear.elements)
    );
    assert_eq!(corners.boundaries, linear.boundaries);
    assert!(order == 1 || corners.groups == again.groups);
}

#[test]
fn each_kind_is_read_from_each_format() {
    flats().into_iter().for_each(every_format);
    solids().into_iter().for_each(every_format);
}

#[test]
fn raised_meshes_share_the_nodes_between_neighbours() {
    fn of<const D: usize>(linear: &Mesh<D>, kind: ElementKind, nodes: usize)
    where
        ElementKind: Topology<D>,
    {
        let raised = linear.clone().raised().or_panic();
        assert_eq!(raised.nodes.len(), nodes, "{kind:?}");
        assert!(raised.elements.iter().all(|element| element.kind() == kind));
        assert_eq!(raised.nodes[..linear.nodes.len()], linear.nodes);
        for (element, before) in raised.elements.iter().zip(&linear.elements) {
            assert_eq!(element.nodes()[..before.nodes().len()], *before.nodes());
        }
        let (measure, before) = (raised.measures()[0], linear.measures()[0]);
        assert!((measure - before).abs() < 1e-14 * before);
        for (name, facets) in &linear.boundaries {
            // Facets of boundaries are those of elements.
            let mut corners = Vec::new();
            for facet in raised.outer_facets(name).or_panic() {
                let nodes = facet_nodes(facet);
                assert!(nodes.len() > facet_corners(facet).len());
                assert!(
                    raised
                        .elements
                        .iter()
                        .any(|element| element.facets().any(|f| f == *facet))
                );
                corners.push(facet_corners(facet).to_vec());
            }
            // Corners from the lowest on, in the order of the boundary or not.
            let all = |facets: Vec<Vec<u32>>| {
                let turned = facets.into_iter().map(|mut nodes| {
                    let lowest = (0..nodes.len()).min_by_key(|&a| nodes[a]).unwrap_or(0);
                    nodes.rotate_left(lowest);
                    nodes
                });
                turned.collect::<BTreeSet<_>>()
            };
            let before = facets.iter().map(|f| facet_corners(f).to_vec());
            assert_eq!(all(corners), all(before.collect()), "{name}");
        }
        // Nothing is left to raise, and nothing lost by going back.
        assert_eq!(raised.clone().raised().or_panic().elements, raised.elements);
        let back = raised.linear().or_panic();
        assert_eq!(
            (&back.nodes, &back.elements),
            (&linear.nodes, &linear.elements)
        );
        assert_eq!(back.boundaries.len(), linear.boundaries.len());
    }
    of(&flat(CellShape::Triangle), ElementKind::Triangle6, 7 * 5);
    of(&flat(CellShape::Quad), ElementKind::Quad9, 7 * 5);
    of(
        &solid(SolidShape::Tetrahedron),
        ElementKind::Tetrahedron10,
        5 * 5 * 3,
    );
    of(
        &solid(SolidShape::Hexahedron),
        ElementKind::Hexahedron27,
        5 * 5 * 3,
    );
    // All nodes of the hexahedra, without those in the middle of cells, which are in no face of four corners there.
    of(&solid(SolidShape::Wedge), ElementKind::Wedge18, 5 * 5 * 3);
}

/// A mesh of these elements, with unit cells.
fn cells(nodes: &[[f64; 3]], elements: &[(ElementKind, &[u32])]) -> Result<Mesh<3>, MeshError> {
    let elements = elements
        .iter()
        .map(|(kind, nodes)| Element::new(*kind, nodes, 0));
    Mesh::new(
        nodes.to_vec(),
        elements.collect(),
        vec!["body".to_owned()],
        BTreeMap::new(),
    )
}

#[test]
fn neighbours_of_two_orders_are_distinguished() {
    // Two triangles, one with midsides.
    let nodes = vec![
        [0.0, 0.0],
        [1.0, 0.0],
        [1.0, 1.0],
        [0.0, 1.0],
        [0.5, 0.0],
        [1.0, 0.5],
        [0.5, 0.5],
        [0.5, 0.5],
    ];
    let of = |elements: Vec<Element>| {
        Mesh::new(
            nodes.clone(),
            elements,
            vec!["body".to_owned()],
            BTreeMap::new(),
        )
    };
    let curved = || Element::new(ElementKind::Triangle6, &[0, 1, 2, 4, 5, 6], 0);
    let told = of(vec![Element::triangle([0, 2, 3], 0), curved()])
        .map(drop)
        .unwrap_err();
    assert!(
        matches!(
            told,
            MeshError::Hanging {
                linear: 0,
                quadratic: 1,
                ..
            }
        ),
        "{told}"
    );
    let text = told.to_string();
    assert!(
        text.contains("element 1 has a midside node on the edge near (5.000000e-1, 5.000000e-1), but its neighbour 0 \
                       has none"),
        "{text}"
    );
    // A node each in one place.
    let mut all = nodes.clone();
    all.extend([[0.5, 1.0], [0.0, 0.5]]);
    let twin = Element::new(ElementKind::Triangle6, &[0, 2, 3, 7, 8, 9], 0);
    let apart = Mesh::new(
        all.clone(),
        vec![curved(), twin],
        vec!["body".to_owned()],
        BTreeMap::new(),
    );
    let told = apart.map(drop).unwrap_err().to_string();
    assert!(
        told.contains("elements 0 and 1 share the edge or face near (5.000000e-1, 5.000000e-1), but not the node"),
        "{told}"
    );
    let both = Element::new(ElementKind::Triangle6, &[0, 2, 3, 6, 8, 9], 0);
    assert!(
        Mesh::new(
            all,
            vec![curved(), both],
            vec!["body".to_owned()],
            BTreeMap::new()
        )
        .is_ok()
    );
    // Bodies of either order beside each other.
    let apart = Element::triangle([4, 5, 3], 0);
    assert!(of(vec![curved(), apart]).is_ok());

    // A pyramid on a hexahedron of second order.
    let mut raised = block(
        [0.0; 3],
        [1.0; 3],
        [1; 3],
        SolidShape::Hexahedron,
        "body",
        "",
    )
    .raised()
    .or_panic();
    raised.nodes.push([0.5, 0.5, 1.5]);
    let tip = raised.nodes.len() as u32 - 1;
    let [.., a, b, c, d] = *raised.elements[0]
        .nodes()
        .first_chunk::<8>()
        .expect("27 nodes");
    raised
        .elements
        .push(Element::new(ElementKind::Pyramid, &[a, b, c, d, tip], 0));
    let mixed = Mesh::new(
        raised.nodes,
        raised.elements,
        raised.regions,
        BTreeMap::new(),
    );
    assert!(matches!(
        mixed,
        Err(MeshError::Hanging {
            linear: 1,
            quadratic: 0,
            ..
        })
    ));
}

#[test]
fn serendipity_elements_beside_others_get_their_middles() {
    for shape in [SolidShape::Hexahedron, SolidShape::Wedge] {
        let whole = solid(shape).raised().or_panic();
        let volume = whole.measures()[0];
        // The first of the elements are Lagrange ones: all become so, with the existing nodes and new ones.
        let mut bent = without_middles(&whole, |number| number > 0);
        assert_eq!(bent.nodes.len(), whole.nodes.len());
        assert!(
            bent.elements
                .iter()
                .all(|element| element.kind() == whole.elements[0].kind())
        );
        assert!((bent.measures()[0] - volume).abs() < 1e-14);
        let facets = bent.elements.iter().flat_map(Element::facets);
        let nodes: BTreeSet<u32> = facets.flat_map(|f| facet_nodes(&f).to_vec()).collect();
        let inside = if shape == SolidShape::Hexahedron {
            bent.elements.len()
        } else {
            0
        };
        assert_eq!(nodes.len(), bent.nodes.len() - inside);
        // On curved cells the new nodes are where the map of the serendipity element has them.
        let serendipity = without_middles(&whole, |_| true);
        let curved = Bent::new(serendipity).bent;
        let measure = curved.measures()[0];
        let mut elements = curved.elements.clone();
        let mut nodes = curved.nodes.clone();
        let raised = bent.elements[0].kind();
        // The first element by hand: its middles, new at serendipity positions, from a mesh of it alone.
        let alone = Mesh::new(
            nodes.clone(),
            vec![elements[0]],
            curved.regions.clone(),
            BTreeMap::new(),
        )
        .or_panic();
        let mut own = elements[0].nodes().to_vec();
        let x: Vec<[f64; 3]> = alone.elements[0]
            .nodes()
            .iter()
            .map(|&node| alone.nodes[node as usize])
            .collect();
        for of in &raised.middles()[own.len() - raised.n_corners()..] {
            own.push(nodes.len() as u32);
            nodes.push(serendipity_middle(alone.elements[0].kind(), of, &x));
        }
        elements[0] = Element::new(raised, &own, 0);
        bent = Mesh::new(nodes, elements, curved.regions, curved.boundaries).or_panic();
        assert!(bent.elements.iter().all(|element| element.kind() == raised));
        assert_eq!(bent.nodes.len(), whole.nodes.len());
        assert!((bent.measures()[0] / measure - 1.0).abs() < 1e-14);
    }
}

/// Where the map of a serendipity element has the middle of a face (a quarter less of the corners, half of the midsides) or of
/// itself.
fn serendipity_middle(kind: ElementKind, of: &[usize], x: &[[f64; 3]]) -> [f64; 3] {
    let midside = if of.len() == 4 { 0.5 } else { 0.25 };
    let mut at = [0.0; 3];
    let mut add = |weight: f64, place: usize| (0..3).for_each(|c| at[c] += weight * x[place][c]);
    of.iter().for_each(|&corner| add(-0.25, corner));
    for (place, ends) in (kind.n_corners()..).zip(kind.middles()) {
        if ends.iter().all(|end| of.contains(end)) {
            add(midside, place);
        }
    }
    at
}

#[test]
fn folded_elements_are_reported_with_the_probable_order() {
    let bent = |shape, serendipity: bool| {
        let raised = solid(shape).raised().or_panic();
        Bent::new(without_middles(&raised, |_| serendipity)).bent
    };
    let of = |mesh: &Mesh<3>, orders: &dyn Fn(ElementKind) -> &'static [&'static [usize]]| {
        // The nodes of every element as another program lists them.
        let elements = mesh.elements.iter().map(|element| {
            let kind = element.kind();
            let (corners, own) = element.nodes().split_at(kind.n_corners());
            let sorted = |of: &[usize]| {
                let mut of = of.to_vec();
                of.sort_unstable();
                of
            };
            let node = |of: &&[usize]| {
                let place = kind
                    .middles()
                    .iter()
                    .position(|own| sorted(own) == sorted(of));
                own[place.expect("the same corners")]
            };
            let nodes: Vec<u32> = corners
                .iter()
                .copied()
                .chain(orders(kind).iter().map(node))
                .collect();
            Element::new(kind, &nodes, 0)
        });
        Mesh::new(
            mesh.nodes.clone(),
            elements.collect(),
            mesh.regions.clone(),
            BTreeMap::new(),
        )
    };
    for shape in [
        SolidShape::Tetrahedron,
        SolidShape::Hexahedron,
        SolidShape::Wedge,
    ] {
        for serendipity in [true, false] {
            let mesh = bent(shape, serendipity);
            let told = of(&mesh, &|kind| middles(kind, Lists::Gmsh))
                .map(drop)
                .unwrap_err();
            assert!(
                matches!(
                    told,
                    MeshError::Folded {
                        other_order: true,
                        ..
                    }
                ),
                "{told}"
            );
            assert!(
                told.to_string()
                    .contains("order of another program (Gmsh and VTK differ)")
            );
            assert!(of(&mesh, &|kind| middles(kind, Lists::Vtk)).is_ok());
        }
    }
    // One midside node far off is not a matter of order, and without it the element is valid.
    let mesh = bent(SolidShape::Tetrahedron, true);
    let node = mesh.elements[3].nodes()[5] as usize;
    let mut nodes = mesh.nodes.clone();
    nodes[node] = [9.0; 3];
    let told = Mesh::new(
        nodes,
        mesh.elements.clone(),
        mesh.regions.clone(),
        BTreeMap::new(),
    );
    let told = told.map(drop).unwrap_err();
    assert!(
        matches!(
            told,
            MeshError::Folded {
                other_order: false,
                ..
            }
        ),
        "{told}"
    );
    assert!(told.to_string().contains("(order = 1)"), "{told}");
}

#[test]
fn pyramids_are_read_and_not_raised() {
    let nodes = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.5, 0.5, 1.0],
        [0.0, 0.0, 1.0],
    ];
    let mesh = cells(
        &nodes,
        &[
            (ElementKind::Pyramid, &[0, 1, 2, 3, 4]),
            (ElementKind::Tetrahedron, &[0, 3, 4, 5]),
        ],
    )
    .or_panic();
    let mut straight = mesh.clone();
    let faces = straight.elements[0].facets().take(1).collect();
    straight.boundaries = BTreeMap::from([("low".to_owned(), faces)]);
    every_format(straight);
    let told = mesh.raised().map(drop).unwrap_err().to_string();
    assert!(
        told.contains("element 0 near (0.000000e0, 0.000000e0, 0.000000e0) is a pyramid, and pyramids of second order \
                       are not supported"),
        "{told}"
    );
}

/// The mesh of a case, with settings as the command line has them.
fn of_case(text: &str, settings: &[&str]) -> Result<AnyMesh, String> {
    let place = tempfile::tempdir().or_panic();
    let file = Bent::new(solid(SolidShape::Tetrahedron).raised().or_panic());
    std::fs::write(
        place.path().join("curved.msh"),
        file.gmsh("4.1", Coding::Ascii),
    )
    .or_panic();
    let pyramid = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 0 0 1\n$EndNodes\n\
                   $Elements\n1\n1 7 2 0 1 1 2 3 4 5\n$EndElements\n";
    std::fs::write(place.path().join("pyramid.msh"), pyramid).or_panic();
    let settings: Vec<String> = settings.iter().map(|&setting| setting.to_owned()).collect();
    let path = place.path().join("case.toml");
    let text = format!("{text}\n[[material]]\nyoung = 1\npoisson = 0.3\n");
    let case = Case::parse(&path, text, &settings).map_err(|error| error.to_string())?;
    let made = case.build().map_err(|error| error.to_string())?;
    let mesh = match made.analysis() {
        AnyAnalysis::Plane(analysis) => analysis.elastic.expect("bodies").mesh.clone().any(),
        AnyAnalysis::Space(analysis) => analysis.elastic.expect("bodies").mesh.clone().any(),
    };
    Ok(mesh)
}

#[test]
fn the_order_of_a_case_is_that_of_its_mesh() {
    // A quarter of a ring: all nodes of its inner side are on the circle, and its area is right to the fourth order.
    let ring = "[[support]]\nboundary = \"left\"\nx = 0\ny = 0\n[mesh]\norder = ORDER\n[mesh.rectangle]\norigin = [1, 0]\n\
                size = [1, 1]\ncells = [2, CELLS]\nmap = [\"x*cos(pi/2*y)\", \"x*sin(pi/2*y)\"]\n";
    let error_of = |order: &str, cells: usize, settings: &[&str]| {
        let text = ring
            .replace("ORDER", order)
            .replace("CELLS", &cells.to_string());
        let mesh = Mesh::<2>::of(of_case(&text, settings).or_panic());
        let inner = mesh.outer_facets("left").or_panic();
        let off = inner.iter().flat_map(facet_nodes).map(|&node| {
            let [x, y] = mesh.nodes[node as usize];
            (x.hypot(y) - 1.0).abs()
        });
        assert!(off.fold(0.0, f64::max) < 1e-14);
        let kinds = mesh.kinds();
        let area = mesh.measures()[0];
        (kinds, (area / (0.75 * std::f64::consts::PI) - 1.0).abs())
    };
    let (kinds, coarse) = error_of("2", 4, &[]);
    assert_eq!(kinds, [(ElementKind::Quad9, 8)]);
    let (_, fine) = error_of("2", 8, &[]);
    assert!(fine < 1e-5 && coarse / fine > 15.0, "{coarse} {fine}");
    assert_eq!(error_of("1", 4, &["mesh.order=2"]), (kinds, coarse));
    let (kinds, straight) = error_of("1", 8, &[]);
    assert_eq!(kinds, [(ElementKind::Quad, 16)]);
    assert!(straight > 100.0 * fine);

    // A file of second order, and parts of either.
    let file = "[[support]]\nboundary = \"NAME\"\nx = 0\ny = 0\nz = 0\n[mesh]\n";
    let single = file.replace("NAME", "left") + "file = \"curved.msh\"\n";
    for (settings, kind) in [
        (&[][..], ElementKind::Tetrahedron10),
        (&["mesh.order=2"], ElementKind::Tetrahedron10),
        (&["mesh.order=1"], ElementKind::Tetrahedron),
    ] {
        let mesh = Mesh::<3>::of(of_case(&single, settings).or_panic());
        assert_eq!(mesh.kinds(), [(kind, 24)], "{settings:?}");
    }
    let parts = file.replace("NAME", "a-left")
        + "order = 2\n[[mesh.part]]\nname = \"a\"\nbox = { size = [1, 1, 1], cells = [1, 1, 1] }\n[[mesh.part]]\nname = \"b\"\n\
           box = { size = [1, 1, 1], cells = [1, 1, 1], shape = \"wedge\" }\nshift = [2, 0, 0]\norder = 1\n[[support]]\n\
           boundary = \"b-left\"\nx = 0\ny = 0\nz = 0\n";
    let mesh = Mesh::<3>::of(of_case(&parts, &[]).or_panic());
    assert_eq!(
        mesh.kinds(),
        [(ElementKind::Hexahedron27, 1), (ElementKind::Wedge, 2)]
    );

    for (text, told) in [
        (
            ring.replace("ORDER", "3").replace("CELLS", "2"),
            "order is the order of the elements: 1 or 2",
        ),
        (
            single.replace("curved", "pyramid") + "order = 2\n",
            "is a pyramid, and pyramids of second order are not supported",
        ),
    ] {
        let error = of_case(&text, &[]).map(drop).unwrap_err();
        assert!(error.contains(told), "{error}");
    }
}

/// A ring as written by Gmsh itself: every kind has its name, and its midside nodes on the circles.
#[test]
fn gmsh_writes_rings_with_curved_sides() {
    fn is<const D: usize>(name: &str, mesh: &Mesh<D>, kind: ElementKind)
    where
        ElementKind: Topology<D>,
    {
        let kinds = mesh.kinds();
        assert!(kinds.len() == 1 && kinds[0].0 == kind, "{name}: {kinds:?}");
        let deep = if D == 2 { 1.0 } else { 0.5 };
        let exact = |value: f64, expected: f64| (value / expected - 1.0).abs();
        let area = |name: &str| -> f64 {
            let facets = mesh.outer_facets(name).or_panic();
            facets.iter().map(|facet| mesh.facet_normal(facet).0).sum()
        };
        assert!(exact(area("low"), deep) < 1e-9, "{name}: {}", area("low"));
        // Two sides for a quarter of a circle: parabolas are 4e-4 too short, straight ones 3e-2.
        let bore = area("bore");
        assert!(
            exact(bore, deep * std::f64::consts::FRAC_PI_2) < 5e-4,
            "{name}: {bore}"
        );
        let volume = mesh.measures().iter().sum::<f64>();
        let ratio = exact(volume, deep * 0.75 * std::f64::consts::PI);
        assert!(ratio < 1e-3, "{name}: {ratio}");
        for facet in mesh.outer_facets("bore").or_panic() {
            let nodes = facet_nodes(facet);
            assert!(nodes.len() > facet_corners(facet).len());
            let off = nodes.iter().map(|&node| {
                let x = mesh.nodes[node as usize];
                (x[0].hypot(x[1]) - 1.0).abs()
            });
            assert!(off.fold(0.0, f64::max) < 1e-6, "{name}");
        }
    }
    for (name, kind) in [
        ("ring-tri6.msh", ElementKind::Triangle6),
        ("ring-tri6.inp", ElementKind::Triangle6),
        ("ring-quad8.msh", ElementKind::Quad8),
        ("ring-quad9.msh", ElementKind::Quad9),
        ("ring-tet10.msh", ElementKind::Tetrahedron10),
        ("ring-tet10.inp", ElementKind::Tetrahedron10),
        ("ring-hex20.msh", ElementKind::Hexahedron20),
        ("ring-hex27.msh", ElementKind::Hexahedron27),
        ("ring-wedge15.msh", ElementKind::Wedge15),
        ("ring-wedge18.msh", ElementKind::Wedge18),
    ] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("tests/meshes")
            .join(name);
        match read(&path, 1.0, None).or_panic() {
            AnyMesh::Plane(mesh) => is(name, &mesh, kind),
            AnyMesh::Space(mesh) => is(name, &mesh, kind),
        }
    }
}
