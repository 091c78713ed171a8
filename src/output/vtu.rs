//! VTK unstructured grids (`.vtu`), inline base64, for ParaView (VTK File Formats, docs.vtk.org).

use super::{ContactFields, NodeStatus, OfBodies, StepFields, put, shown_at_nodes};
use crate::contact::Space;
use crate::elasticity::Stress;
use crate::mesh::ElementKind;
use crate::model::Elastic;
use base64::Engine as _;

/// The growing text of a file: arrays are large, and exist only once.
struct Arrays(String);

impl Arrays {
    /// One array: a length in front, then the values, little-endian.
    fn array<T, const N: usize>(
        &mut self,
        kind: &str,
        name: &str,
        components: usize,
        values: impl IntoIterator<Item = T>,
        bytes: impl Fn(T) -> [u8; N],
    ) {
        let mut raw = vec![0; 8];
        raw.extend(values.into_iter().flat_map(bytes));
        let length = (raw.len() - 8) as u64;
        raw[..8].copy_from_slice(&length.to_le_bytes());
        let encoded = base64::engine::general_purpose::STANDARD.encode(raw);
        put(
            &mut self.0,
            format_args!(
                "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"binary\">{encoded}</DataArray>"
            ),
        );
    }

    /// Rows of numbers.
    fn floats<const N: usize>(&mut self, name: &str, rows: impl IntoIterator<Item = [f64; N]>) {
        let values = rows.into_iter().flatten();
        self.array("Float64", name, N, values, f64::to_le_bytes);
    }

    fn scalars(&mut self, name: &str, values: &[f64]) {
        self.floats(name, values.iter().map(|&v| [v]));
    }

    /// Places or vectors; those of the plane have z = 0.
    fn vectors<const D: usize>(&mut self, name: &str, vectors: &[[f64; D]]) {
        let spatial = |v: &[f64; D]| std::array::from_fn(|c| v.get(c).copied().unwrap_or(0.0));
        self.floats::<3>(name, vectors.iter().map(spatial));
    }

    /// Integers as codes of kinds.
    fn kinds(&mut self, name: &str, values: impl IntoIterator<Item = i32>) {
        self.array("Int32", name, 1, values, i32::to_le_bytes);
    }

    fn stresses(&mut self, stresses: &[Stress]) {
        // ParaView's order of a symmetric tensor: xx yy zz xy yz xz.
        let tensor = |s: &Stress| [s.xx, s.yy, s.zz, s.xy, s.yz, s.zx];
        self.floats("stress", stresses.iter().map(tensor));
        self.floats("von_mises", stresses.iter().map(|s| [s.von_mises()]));
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
    cells: impl ExactSizeIterator<Item = &'a [u32]> + Clone,
    at_points: impl FnOnce(&mut Arrays),
    in_cells: impl FnOnce(&mut Arrays),
) -> String {
    let mut file = Arrays(format!(
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
         <UnstructuredGrid>\n\
         <Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n\
         <Points>\n",
        points.len(),
        cells.len(),
    ));
    file.vectors("Points", points);
    file.0 += "</Points>\n<Cells>\n";
    let connectivity = cells.clone().flatten().map(|&node| i64::from(node));
    file.array("Int64", "connectivity", 1, connectivity, i64::to_le_bytes);
    let ends = cells.clone().scan(0, |end, nodes| {
        *end += nodes.len() as i64;
        Some(*end)
    });
    file.array("Int64", "offsets", 1, ends, i64::to_le_bytes);
    let types = cells.map(|nodes| cell_type::<D>(nodes.len()));
    file.array("UInt8", "types", 1, types, u8::to_le_bytes);
    file.0 += "</Cells>\n<PointData Vectors=\"displacement\">\n";
    at_points(&mut file);
    file.0 += "</PointData>\n<CellData>\n";
    in_cells(&mut file);
    file.0 += "</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
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

/// The file of a step, with the first so many elements, or all sectors of them.
pub(crate) fn text<const D: usize>(of: &OfBodies<D>, elements: usize) -> String
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
) -> String
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
                let [pressed, rubbed] = contact.traction_vectors(i);
                tangential[node as usize] = rubbed;
                whole[node as usize] = std::array::from_fn(|c| pressed[c] + rubbed[c]);
            }
            at_nodes.vectors("tangential_traction", &tangential);
            at_nodes.vectors("contact_traction", &whole);
        }
        if !contact.worn.is_empty() {
            at_nodes.scalars("wear", &scattered(&contact.worn));
        }
        at_nodes.kinds("contact_status", (0..mesh.nodes.len() as u32).map(status));
    };
    let in_cells = |in_elements: &mut Arrays| {
        in_elements.stresses(&fields.in_elements[..elements]);
        in_elements.kinds("region", shown_elements.iter().map(|e| e.region as i32));
    };
    let cells = shown_elements.iter().map(|element| element.nodes());
    grid(&mesh.nodes, cells, at_points, in_cells)
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
            cells.into_iter(),
            |at_points| at_points.scalars("contact_pressure", &[0.0, 0.0, 1.0, 1.0]),
            |in_cells| in_cells.kinds("region", [0, 1]),
        );
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
        let file = grid(&points, cells.into_iter(), at_points, |_| {});
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

    #[test]
    fn nodes_tell_the_kind_of_a_cell() {
        assert_eq!([3, 4, 6, 8, 9].map(cell_type::<2>), [5, 9, 22, 23, 28]);
        assert_eq!([4, 5, 6, 8].map(cell_type::<3>), [10, 14, 13, 12]);
        let second_order = [10, 15, 18, 20, 27].map(cell_type::<3>);
        assert_eq!(second_order, [24, 26, 32, 25, 29]);
    }
}
