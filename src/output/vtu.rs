//! VTK unstructured grids (`.vtu`), inline base64, for ParaView (VTK File Formats, docs.vtk.org).

#[cfg(feature = "mpi")]
use super::put;
use super::{ContactFields, NodeStatus, OfBodies, StepFields, shown_at_nodes};
use crate::contact::Space;
use crate::elasticity::Stress;
use crate::mesh::ElementKind;
use crate::model::Elastic;
use base64::Engine as _;
use rayon::prelude::*;
use std::array::from_fn;

/// Bytes that one task turns into text: a multiple of three, so that its text is a part of the whole, and some 100 µs of work.
const PIECE: usize = 3 << 16;

/// The growing text of a file, in pieces: arrays are large, and exist only once.
struct Arrays(Vec<Vec<u8>>);

impl Arrays {
    fn put(&mut self, line: std::fmt::Arguments) {
        self.0.push(line.to_string().into_bytes());
    }

    /// One array: a length in front, then the values, little-endian. `bytes` gives the value of a number.
    fn array<const N: usize>(
        &mut self,
        kind: &str,
        name: &str,
        components: usize,
        count: usize,
        bytes: impl Fn(usize) -> [u8; N] + Sync,
    ) {
        self.put(format_args!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"binary\">"
        ));
        let length = 8 + count * N;
        let head = ((count * N) as u64).to_le_bytes();
        let piece = |number: usize| {
            let from = number * PIECE;
            let to = length.min(from + PIECE);
            let mut raw = Vec::with_capacity(PIECE + 2 * N);
            // From the value that the first byte belongs to; before all values there is the length.
            let first = from.saturating_sub(8) / N;
            raw.extend(if number == 0 { &head[..] } else { &[] });
            let start = if number == 0 { 0 } else { 8 + first * N };
            for i in first..count {
                if start + raw.len() >= to {
                    break;
                }
                raw.extend(bytes(i));
            }
            let text =
                base64::engine::general_purpose::STANDARD.encode(&raw[from - start..to - start]);
            text.into_bytes()
        };
        let pieces = (0..length.div_ceil(PIECE)).into_par_iter().map(piece);
        self.0.par_extend(pieces);
        self.put(format_args!("</DataArray>\n"));
    }

    /// Rows of numbers.
    fn floats<const N: usize>(
        &mut self,
        name: &str,
        count: usize,
        row: impl Fn(usize) -> [f64; N] + Sync,
    ) {
        self.array("Float64", name, N, N * count, |i| {
            row(i / N)[i % N].to_le_bytes()
        });
    }

    fn scalars(&mut self, name: &str, values: &[f64]) {
        self.floats(name, values.len(), |i| [values[i]]);
    }

    /// Places or vectors; those of the plane have z = 0.
    fn vectors<const D: usize>(&mut self, name: &str, vectors: &[[f64; D]]) {
        let spatial = |i: usize| from_fn(|c| vectors[i].get(c).copied().unwrap_or(0.0));
        self.floats::<3>(name, vectors.len(), spatial);
    }

    /// Integers as codes of kinds.
    fn kinds(&mut self, name: &str, count: usize, kind: impl Fn(usize) -> i32 + Sync) {
        self.array("Int32", name, 1, count, |i| kind(i).to_le_bytes());
    }

    fn stresses(&mut self, stresses: &[Stress]) {
        // ParaView's order of a symmetric tensor: xx yy zz xy yz xz.
        let tensor = |i: usize| {
            let s = &stresses[i];
            [s.xx, s.yy, s.zz, s.xy, s.yz, s.zx]
        };
        self.floats("stress", stresses.len(), tensor);
        let von_mises = |i: usize| [stresses[i].von_mises()];
        self.floats("von_mises", stresses.len(), von_mises);
    }
}

/// VTK's number for a cell with so many nodes in D dimensions.
fn cell_type<const D: usize>(n_nodes: usize) -> u8 {
    match (D, n_nodes) {
        (2, 3) => 5,   // VTK_TRIANGLE
        (2, 4) => 9,   // VTK_QUAD
        (2, 6) => 22,  // VTK_QUADRATIC_TRIANGLE
        (2, 8) => 23,  // VTK_QUADRATIC_QUAD
        (2, _) => 28,  // VTK_BIQUADRATIC_QUAD
        (_, 4) => 10,  // VTK_TETRA
        (_, 5) => 14,  // VTK_PYRAMID
        (_, 6) => 13,  // VTK_WEDGE
        (_, 8) => 12,  // VTK_HEXAHEDRON
        (_, 10) => 24, // VTK_QUADRATIC_TETRA
        (_, 15) => 26, // VTK_QUADRATIC_WEDGE
        (_, 18) => 32, // VTK_BIQUADRATIC_QUADRATIC_WEDGE
        (_, 20) => 25, // VTK_QUADRATIC_HEXAHEDRON
        _ => 29,       // VTK_TRIQUADRATIC_HEXAHEDRON
    }
}

/// A grid with the nodes of its cells, and its point and cell data.
fn grid<'a, const D: usize>(
    points: &[[f64; D]],
    n_cells: usize,
    cell: impl Fn(usize) -> &'a [u32] + Sync,
    at_points: impl FnOnce(&mut Arrays),
    in_cells: impl FnOnce(&mut Arrays),
) -> Vec<Vec<u8>> {
    let mut file = Arrays(Vec::new());
    file.put(format_args!(
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
         <UnstructuredGrid>\n\
         <Piece NumberOfPoints=\"{}\" NumberOfCells=\"{n_cells}\">\n\
         <Points>\n",
        points.len(),
    ));
    file.vectors("Points", points);
    file.put(format_args!("</Points>\n<Cells>\n"));
    let nodes: Vec<u32> = (0..n_cells).flat_map(&cell).copied().collect();
    let node = |i: usize| i64::from(nodes[i]).to_le_bytes();
    file.array("Int64", "connectivity", 1, nodes.len(), node);
    let ends = (0..n_cells).scan(0, |end, i| {
        *end += cell(i).len() as i64;
        Some(*end)
    });
    let ends: Vec<i64> = ends.collect();
    file.array("Int64", "offsets", 1, n_cells, |i| ends[i].to_le_bytes());
    let kind = |i: usize| [cell_type::<D>(cell(i).len())];
    file.array("UInt8", "types", 1, n_cells, kind);
    file.put(format_args!(
        "</Cells>\n<PointData Vectors=\"displacement\">\n"
    ));
    at_points(&mut file);
    file.put(format_args!("</PointData>\n<CellData>\n"));
    in_cells(&mut file);
    file.put(format_args!(
        "</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"
    ));
    file.0
}

/// The index of the pieces of several ranks, with this piece among them: its arrays, and the names of all pieces.
#[cfg(feature = "mpi")]
pub(crate) fn whole(piece: &str, names: &[String]) -> String {
    // The arrays of a piece, without the numbers.
    let section = |name: &str| {
        let begin = piece.find(&format!("<{name}")).unwrap_or(piece.len());
        let text = piece[begin..]
            .split_once(&format!("</{name}>"))
            .map_or("", |both| both.0);
        let (head, arrays) = text.split_once('>').unwrap_or((text, ""));
        let mut made = format!("{}>\n", head.replacen('<', "<P", 1));
        for array in arrays.split("<DataArray ").skip(1) {
            let attributes = array.split_once('>').map_or("", |both| both.0);
            put(&mut made, format_args!("<PDataArray {attributes}/>"));
        }
        put(&mut made, format_args!("</P{name}>"));
        made
    };
    let mut text = "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"PUnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
         <PUnstructuredGrid GhostLevel=\"0\">\n"
        .to_owned();
    for name in ["PointData", "CellData", "Points"] {
        text += &section(name);
    }
    for name in names {
        put(&mut text, format_args!("<Piece Source=\"{name}\"/>"));
    }
    text + "</PUnstructuredGrid>\n</VTKFile>\n"
}

/// The file of a step in pieces, with the first so many elements, or all sectors of them.
pub(crate) fn text<const D: usize>(of: &OfBodies<D>, elements: usize) -> Vec<Vec<u8>>
where
    ElementKind: Space<D>,
{
    match of.whole(elements) {
        None => written(of.elastic, &of.fields, &of.contact, elements),
        Some(all) => {
            let elements = all.elastic.mesh.elements.len();
            written(&all.elastic, &all.fields, &all.contact, elements)
        }
    }
}

fn written<const D: usize>(
    elastic: &Elastic<D>,
    fields: &StepFields<D>,
    contact: &ContactFields<D>,
    elements: usize,
) -> Vec<Vec<u8>>
where
    ElementKind: Space<D>,
{
    let mesh = &elastic.mesh;
    let shown_elements = &mesh.elements[..elements];
    let shown = shown_at_nodes(elastic, contact, None);
    let scattered = |values: &[f64]| {
        let mut field = vec![0.0; mesh.nodes.len()];
        for (&node, &i) in &shown {
            field[node as usize] = values[i];
        }
        field
    };
    // 0: on no contact boundary.
    let status = |node: u32| {
        shown.get(&node).map_or(0, |&i| match contact.status[i] {
            NodeStatus::Separated => 1,
            NodeStatus::Stick => 2,
            NodeStatus::Slip => 3,
            NodeStatus::Frictionless => 4,
            NodeStatus::Tied => 5,
        })
    };
    let at_points = |at_nodes: &mut Arrays| {
        at_nodes.vectors("displacement", &fields.displacement);
        at_nodes.stresses(&fields.at_nodes);
        at_nodes.scalars("contact_pressure", &scattered(&contact.pressure));
        if D == 2 {
            at_nodes.scalars("tangential_traction", &scattered(&contact.traction));
        } else {
            // Along the axes: the tangents of each node are its own.
            let (mut whole, mut tangential) = (
                vec![[0.0; D]; mesh.nodes.len()],
                vec![[0.0; D]; mesh.nodes.len()],
            );
            for (&node, &i) in &shown {
                let both = contact.traction_vectors(i);
                let [pressed, rubbed] = both.map(|v| elastic.turned_to(i, node, v));
                tangential[node as usize] = rubbed;
                whole[node as usize] = std::array::from_fn(|c| pressed[c] + rubbed[c]);
            }
            at_nodes.vectors("tangential_traction", &tangential);
            at_nodes.vectors("contact_traction", &whole);
        }
        for (k, name) in ["sliding_distance", "friction_work"]
            .into_iter()
            .enumerate()
        {
            if let Some(rubbed) = &fields.rubbed {
                at_nodes.floats(name, rubbed.len(), |i| [rubbed[i][k]]);
            }
        }
        if !contact.worn.is_empty() {
            at_nodes.scalars("wear", &scattered(&contact.worn));
        }
        let status = |node: usize| status(node as u32);
        at_nodes.kinds("contact_status", mesh.nodes.len(), status);
    };
    let in_cells = |in_elements: &mut Arrays| {
        in_elements.stresses(&fields.in_elements[..elements]);
        let region = |i: usize| shown_elements[i].region as i32;
        in_elements.kinds("region", elements, region);
    };
    let cell = |i: usize| shown_elements[i].nodes();
    grid(&mesh.nodes, elements, cell, at_points, in_cells)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The values of the array of this name, eight bytes each.
    fn values<T>(file: &str, name: &str, from: impl Fn([u8; 8]) -> T) -> Vec<T> {
        let (_, rest) = file
            .split_once(&format!("Name=\"{name}\""))
            .unwrap_or_else(|| panic!("no {name}"));
        let encoded = rest.split(['>', '<']).nth(1).unwrap_or_default();
        let raw = base64::engine::general_purpose::STANDARD
            .decode(encoded)
            .unwrap_or_else(|error| panic!("{error}"));
        let words: Vec<[u8; 8]> = raw.as_chunks().0.to_vec();
        assert_eq!(u64::from_le_bytes(words[0]), raw.len() as u64 - 8);
        words[1..].iter().map(|&word| from(word)).collect()
    }

    #[test]
    fn two_triangles_give_the_file_by_hand() {
        let points = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let cells: [&[u32]; 2] = [&[0, 1, 2], &[0, 2, 3]];
        let file = grid(
            &points,
            2,
            |i| cells[i],
            |at_points| at_points.scalars("contact_pressure", &[0.0, 0.0, 1.0, 1.0]),
            |in_cells| in_cells.kinds("region", 2, |i| i as i32),
        );
        let file = String::from_utf8(file.concat()).expect("a text");
        // The arrays by Python: base64.b64encode(struct.pack("<Q12d", 96, 0, 0, 0, 1, …)).
        assert_eq!(
            file,
            r#"<?xml version="1.0"?>
<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">
<UnstructuredGrid>
<Piece NumberOfPoints="4" NumberOfCells="2">
<Points>
<DataArray type="Float64" Name="Points" NumberOfComponents="3" format="binary">YAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAADwPwAAAAAAAAAAAAAAAAAAAAAAAAAAAADwPwAAAAAAAPA/AAAAAAAAAAAAAAAAAAAAAAAAAAAAAPA/AAAAAAAAAAA=</DataArray>
</Points>
<Cells>
<DataArray type="Int64" Name="connectivity" NumberOfComponents="1" format="binary">MAAAAAAAAAAAAAAAAAAAAAEAAAAAAAAAAgAAAAAAAAAAAAAAAAAAAAIAAAAAAAAAAwAAAAAAAAA=</DataArray>
<DataArray type="Int64" Name="offsets" NumberOfComponents="1" format="binary">EAAAAAAAAAADAAAAAAAAAAYAAAAAAAAA</DataArray>
<DataArray type="UInt8" Name="types" NumberOfComponents="1" format="binary">AgAAAAAAAAAFBQ==</DataArray>
</Cells>
<PointData Vectors="displacement">
<DataArray type="Float64" Name="contact_pressure" NumberOfComponents="1" format="binary">IAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA8D8AAAAAAADwPw==</DataArray>
</PointData>
<CellData>
<DataArray type="Int32" Name="region" NumberOfComponents="1" format="binary">CAAAAAAAAAAAAAAAAQAAAA==</DataArray>
</CellData>
</Piece>
</UnstructuredGrid>
</VTKFile>
"#
        );
    }

    #[test]
    fn space_has_its_third_coordinate_and_its_cells() {
        let points = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.5, 0.5, 2.0],
        ];
        let cells: [&[u32]; 2] = [&[0, 1, 2, 3], &[1, 2, 3, 4]];
        let doubled = points.map(|p| p.map(|x| 2.0 * x));
        let at_points = |at_points: &mut Arrays| at_points.vectors("displacement", &doubled);
        let file = grid(&points, 2, |i| cells[i], at_points, |_| {});
        let file = String::from_utf8(file.concat()).expect("a text");
        assert_eq!(values(&file, "Points", f64::from_le_bytes), points.concat());
        let displacement = values(&file, "displacement", f64::from_le_bytes);
        assert_eq!(displacement[12..], [1.0, 1.0, 4.0]);
        let connectivity = values(&file, "connectivity", i64::from_le_bytes);
        assert_eq!(connectivity, [0, 1, 2, 3, 1, 2, 3, 4]);
        assert_eq!(values(&file, "offsets", i64::from_le_bytes), [4, 8]);
        // Two bytes after the length: VTK_TETRA twice.
        assert!(file.contains(
            "Name=\"types\" NumberOfComponents=\"1\" format=\"binary\">AgAAAAAAAAAKCg==<"
        ));
    }

    /// Arrays of several pieces, at lengths around the ends of these.
    #[test]
    fn arrays_in_pieces_are_whole() {
        fn check<const N: usize>(count: usize) {
            let bytes = |i: usize| -> [u8; N] { from_fn(|k| (i * 7 + k * 31 + i / 256) as u8) };
            let mut file = Arrays(Vec::new());
            file.array("Any", "values", 1, count, bytes);
            let text = String::from_utf8(file.0.concat()).expect("a text");
            let mut raw = ((count * N) as u64).to_le_bytes().to_vec();
            raw.extend((0..count).flat_map(bytes));
            let expected = base64::engine::general_purpose::STANDARD.encode(raw);
            assert_eq!(
                text.split(['>', '<']).nth(2),
                Some(expected.as_str()),
                "{N} {count}"
            );
        }
        for around in [0, 3, PIECE, 2 * PIECE] {
            for off in 0..20 {
                check::<1>((around + off).saturating_sub(10));
                check::<4>((around / 4 + off).saturating_sub(10));
                check::<8>((around / 8 + off).saturating_sub(10));
            }
        }
    }

    #[test]
    fn nodes_tell_the_kind_of_a_cell() {
        assert_eq!([3, 4, 6, 8, 9].map(cell_type::<2>), [5, 9, 22, 23, 28]);
        assert_eq!([4, 5, 6, 8].map(cell_type::<3>), [10, 14, 13, 12]);
        let second_order = [10, 15, 18, 20, 27].map(cell_type::<3>);
        assert_eq!(second_order, [24, 26, 32, 25, 29]);
    }
}
