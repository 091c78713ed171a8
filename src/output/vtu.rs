//! VTK unstructured grids (`.vtu`), inline base64: what ParaView opens.

use super::{ContactFields, StepFields};
use crate::case::Elastic;
use crate::elasticity::Stress;
use base64::Engine as _;
use std::collections::HashMap;
use std::fmt::Write as _;

/// One array: a length in front, then the values, little-endian.
fn data_array<T: Copy, const N: usize>(
    text: &mut String,
    kind: &str,
    name: &str,
    components: usize,
    values: &[T],
    bytes: impl Fn(T) -> [u8; N],
) {
    let mut raw = Vec::with_capacity(8 + values.len() * N);
    raw.extend(((values.len() * N) as u64).to_le_bytes());
    for &value in values {
        raw.extend(bytes(value));
    }
    let encoded = base64::engine::general_purpose::STANDARD.encode(raw);
    writeln!(
        text,
        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"binary\">{encoded}</DataArray>"
    )
    .expect("writing to a string cannot fail");
}

fn floats(text: &mut String, name: &str, components: usize, values: &[f64]) {
    data_array(text, "Float64", name, components, values, f64::to_le_bytes);
}

fn stress_arrays(text: &mut String, stresses: &[Stress]) {
    // ParaView's order of a symmetric tensor: xx yy zz xy yz xz.
    let tensor: Vec<f64> = stresses
        .iter()
        .flat_map(|s| [s.xx, s.yy, s.zz, s.xy, 0.0, 0.0])
        .collect();
    floats(text, "stress", 6, &tensor);
    let von_mises: Vec<f64> = stresses.iter().map(Stress::von_mises).collect();
    floats(text, "von_mises", 1, &von_mises);
}

/// The file.
pub(super) fn text(elastic: &Elastic, fields: &StepFields, contact: &ContactFields) -> String {
    let mesh = &elastic.mesh;
    let flat = |values: &[[f64; 2]]| -> Vec<f64> {
        values.iter().flat_map(|v| [v[0], v[1], 0.0]).collect()
    };
    let mut text = String::new();
    let t = &mut text;
    t.push_str("<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<UnstructuredGrid>\n");
    writeln!(
        t,
        "<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">",
        mesh.nodes.len(),
        mesh.elements.len()
    )
    .expect("writing to a string cannot fail");

    t.push_str("<Points>\n");
    floats(t, "Points", 3, &flat(&mesh.nodes));
    t.push_str("</Points>\n<Cells>\n");
    let connectivity: Vec<i64> = mesh
        .elements
        .iter()
        .flat_map(|e| e.nodes().iter().map(|&node| i64::from(node)))
        .collect();
    data_array(
        t,
        "Int64",
        "connectivity",
        1,
        &connectivity,
        i64::to_le_bytes,
    );
    let mut end = 0;
    let offsets: Vec<i64> = mesh
        .elements
        .iter()
        .map(|e| {
            end += e.nodes().len() as i64;
            end
        })
        .collect();
    data_array(t, "Int64", "offsets", 1, &offsets, i64::to_le_bytes);
    // VTK_TRIANGLE and VTK_QUAD.
    let types: Vec<u8> = mesh
        .elements
        .iter()
        .map(|e| if e.nodes().len() == 3 { 5 } else { 9 })
        .collect();
    data_array(t, "UInt8", "types", 1, &types, u8::to_le_bytes);

    t.push_str("</Cells>\n<PointData Vectors=\"displacement\">\n");
    floats(t, "displacement", 3, &flat(&fields.displacement));
    stress_arrays(t, &fields.at_nodes);
    // A node that stands in several contacts shows the one that presses it most.
    let mut shown: HashMap<u32, usize> = HashMap::new();
    for (i, node) in elastic.contact.nodes.iter().enumerate() {
        let row = shown.entry(node.node).or_insert(i);
        if contact.pressure[i] > contact.pressure[*row] {
            *row = i;
        }
    }
    let scattered = |values: &[f64]| {
        let mut field = vec![0.0; mesh.nodes.len()];
        for (&node, &i) in &shown {
            field[node as usize] = values[i];
        }
        field
    };
    floats(t, "contact_pressure", 1, &scattered(&contact.pressure));
    floats(t, "tangential_traction", 1, &scattered(&contact.traction));
    // 0 no contact boundary, 1 separated, 2 stick, 3 slip, 4 in contact without friction.
    let mut status = vec![0i32; mesh.nodes.len()];
    for (&node, &i) in &shown {
        status[node as usize] = match contact.status(i) {
            "separated" => 1,
            "stick" => 2,
            "slip" => 3,
            _ => 4,
        };
    }
    data_array(t, "Int32", "contact_status", 1, &status, i32::to_le_bytes);

    t.push_str("</PointData>\n<CellData>\n");
    stress_arrays(t, &fields.in_elements);
    let regions: Vec<i32> = mesh.elements.iter().map(|e| e.region as i32).collect();
    data_array(t, "Int32", "region", 1, &regions, i32::to_le_bytes);
    t.push_str("</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n");
    text
}
