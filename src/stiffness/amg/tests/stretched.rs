//! Meshes whose elements are many times as long as wide.

use super::*;
use crate::mesh::structured::block;
use crate::output::{forget_peak_memory, peak_memory_mib};

/// A block of space: K, f and the points of its blocks.
type Solid = (BlockCsr<3>, Vec<f64>, Vec<[f64; 3]>);

/// A block of equal cells, each coordinate then moved by `map`, clamped on a side and loaded on its top (below where that
/// is clamped); `materials` lie in layers across z.
fn solid(
    size: [f64; 3],
    cells: [usize; 3],
    shape: SolidShape,
    map: impl Fn(f64) -> f64,
    clamped: &str,
    materials: &[Material],
) -> Solid {
    let [x, _, _] = size;
    let mut mesh = block([-0.5 * x, 0.0, 0.0], size, cells, shape, "body", "");
    mesh.nodes
        .iter_mut()
        .for_each(|point| *point = point.map(&map));
    for layer in 1..materials.len() {
        mesh.regions.push(layer.to_string());
    }
    for e in 0..mesh.elements.len() {
        let node = mesh.elements[e].nodes()[0] as usize;
        let row = node / ((cells[0] + 1) * (cells[1] + 1)) * materials.len() / cells[2];
        mesh.elements[e].region = (row % materials.len()) as u32;
    }
    let body = Body {
        mesh: &mesh,
        materials,
        plane: Plane::PlaneStrain,
        thickness: 1.0,
    };
    let mut prescribed = vec![[None; 3]; mesh.nodes.len()];
    for &node in mesh.boundaries[clamped].iter().flatten() {
        prescribed[node as usize] = [Some(0.0); 3];
    }
    let unknowns = Unknowns::new(prescribed);
    let mut forces = vec![[0.0; 3]; mesh.nodes.len()];
    let loaded = if clamped == "top" { "bottom" } else { "top" };
    body.add_traction(
        &mesh.boundaries[loaded],
        |_, _| [1e6, 2e6, -1e7],
        &mut forces,
    );
    let (k, f) = assemble(&body, &unknowns, &forces);
    (k, f, unknowns.coordinates(&mesh))
}

/// Graded towards its middle in every direction, as in the half-space problems: aspect ratios up to 60.
fn graded(cells: [usize; 3]) -> Solid {
    let map = |x: f64| 0.12 * x + 0.88 * x * x * x;
    solid(
        [2.0, 1.0, 1.0],
        cells,
        SolidShape::Hexahedron,
        map,
        "top",
        &[MATERIAL],
    )
}

/// What a hierarchy costs and brings, as a line of a table.
fn measured<const D: usize>(name: &str, k: &BlockCsr<D>, f: &[f64], points: Option<&[[f64; D]]>) {
    forget_peak_memory();
    let before = peak_memory_mib().unwrap_or(0.0);
    let start = Instant::now();
    let m = Hierarchy::<f32>::new(k, points, &Settings::of_dimension(D))
        .unwrap_or_else(|error| panic!("{error}"));
    let set_up = start.elapsed().as_secs_f64();
    let peak = peak_memory_mib().unwrap_or(0.0) - before;
    let solve = pcg(k, f, &m);
    let bytes = 4 * (D * D + 1) * k.n_blocks();
    let stored: usize = m.sizes().iter().map(|size| size.bytes).sum();
    println!(
        "{name:22} {:8} {:4} x {:5.1}  complexity {:.2}  stored {:.2}  set-up {set_up:6.2} s  iteration {:6.1} ms  \
         solve {:6.2} s  peak {peak:5.0} MiB  {} levels {:.0e}",
        k.n_rows(),
        solve.iterations,
        (m.cycle_bytes() as f64) / bytes as f64,
        m.operator_complexity(),
        stored as f64 / bytes as f64,
        1e3 * solve.seconds,
        solve.seconds * solve.iterations as f64,
        m.sizes().len(),
        solve.residual,
    );
}

#[test]
#[ignore = "measures; run it alone in the release profile"]
fn table() {
    let only = std::env::var("ONLY").unwrap_or_default();
    let hexahedron = SolidShape::Hexahedron;
    let straight = |x: f64| x;
    let soft = Material {
        young: 1e-4 * MATERIAL.young,
        ..MATERIAL
    };
    let cases: [(&str, &dyn Fn() -> Solid); 10] = [
        ("graded S1", &|| graded([32, 16, 16])),
        ("graded S2", &|| graded([54, 27, 27])),
        ("graded S3", &|| graded([90, 44, 44])),
        ("uniform S1", &|| {
            solid(
                [3.0, 1.0, 1.0],
                [48, 16, 16],
                hexahedron,
                straight,
                "left",
                &[MATERIAL],
            )
        }),
        ("uniform S2", &|| {
            solid(
                [3.0, 1.0, 1.0],
                [84, 28, 28],
                hexahedron,
                straight,
                "left",
                &[MATERIAL],
            )
        }),
        ("tet4", &|| {
            solid(
                [3.0, 1.0, 1.0],
                [48, 16, 16],
                SolidShape::Tetrahedron,
                straight,
                "left",
                &[MATERIAL],
            )
        }),
        ("layers 1e4", &|| {
            solid(
                [3.0, 1.0, 1.0],
                [48, 16, 16],
                hexahedron,
                straight,
                "left",
                &[MATERIAL, soft, MATERIAL, soft],
            )
        }),
        ("flat 20", &|| {
            solid(
                [2.0, 1.0, 0.5],
                [20, 10, 100],
                hexahedron,
                straight,
                "left",
                &[MATERIAL],
            )
        }),
        ("flat 20 below", &|| {
            solid(
                [2.0, 1.0, 0.5],
                [40, 20, 100],
                hexahedron,
                straight,
                "bottom",
                &[MATERIAL],
            )
        }),
        ("needles 20", &|| {
            solid(
                [0.5, 0.5, 2.0],
                [50, 50, 10],
                hexahedron,
                straight,
                "left",
                &[MATERIAL],
            )
        }),
    ];
    for (name, make) in cases {
        if name.contains(&only) {
            let (k, f, points) = make();
            measured(name, &k, &f, Some(&points));
            if name.ends_with("S1") {
                measured(&format!("{name}, no points"), &k, &f, None);
            }
        }
    }
    let quads: [(&str, Mesh); 6] = [
        ("plane uniform", quads([3.0, 1.0], [300, 100])),
        ("plane shaken", shaken([3.0, 1.0], [300, 100])),
        ("plane flat", quads([3.0, 0.1], [60, 200])),
        ("plane tall", quads([0.1, 3.0], [200, 60])),
        ("plane flat triangles", shaken([3.0, 0.3], [100, 100])),
        ("plane graded", {
            let mut mesh = quads([2.0, 1.0], [240, 120]);
            let map = |x: f64| 0.12 * x + 0.88 * x * x * x;
            mesh.nodes
                .iter_mut()
                .for_each(|x| *x = [map(x[0] - 1.0), map(x[1])]);
            mesh
        }),
    ];
    for (name, mesh) in quads {
        if name.contains(&only) {
            let (k, f, points) = clamped(&mesh, &[MATERIAL]);
            measured(name, &k, &f, Some(&points));
        }
    }
}
