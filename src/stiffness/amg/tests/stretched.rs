//! Meshes whose elements are many times as long as wide.

use super::*;
use crate::mesh::structured::block;
use crate::output::{forget_peak_memory, peak_memory_mib};
use crate::stiffness::amg::aggregation::{Graph, Groups, NONE};
use crate::stiffness::amg::{patches, product};

/// A block of space: K, f and the points of its blocks.
type Solid = (BlockCsr<3>, Vec<f64>, Vec<[f64; 3]>);

/// A block of equal cells, each coordinate then moved by `map`, clamped on a side and loaded on its top (or below, if
/// the top is clamped). `materials` are in layers across z.
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

/// Equal cells of a block clamped on its left.
fn even(size: [f64; 3], cells: [usize; 3], shape: SolidShape, materials: &[Material]) -> Solid {
    solid(size, cells, shape, |x| x, "left", materials)
}

/// The last numbers bound the iterations and the complexity.
#[test]
fn iterations_on_stretched_cells() {
    let hexahedron = SolidShape::Hexahedron;
    for (name, (k, f, points), limit, complexity) in [
        ("graded", graded([32, 16, 16]), 16, 1.8),
        (
            "flat",
            even([1.0, 1.0, 0.5], [10, 10, 100], hexahedron, &[MATERIAL]),
            23,
            2.0,
        ),
        (
            "needles",
            even([0.4, 0.4, 2.0], [40, 40, 10], hexahedron, &[MATERIAL]),
            14,
            1.5,
        ),
    ] {
        let settings = AmgSettings::of_dimension(3);
        let m = Hierarchy::<f32>::new(&k, Some(&points), &settings)
            .unwrap_or_else(|error| panic!("{error}"));
        let patched = |level: &Level<f32>| matches!(level.smoother.inverse, Inverse::Patches(_));
        assert!(patched(&m.levels[0]), "{name}: {m}");
        let solve = pcg(&k, &f, &m);
        println!("{name}: {solve:?}, {:.2}", m.operator_complexity());
        assert!(solve.iterations <= limit, "{name}: {solve:?}");
        assert!(solve.residual < 2e-8, "{name}: {solve:?}");
        assert!(m.operator_complexity() < complexity, "{name}: {m}");
        check_symmetric_definite(&k, &m, 1e-3);
        // Without points the rotations are missing, and distances.
        let without =
            Hierarchy::<f32>::new(&k, None, &settings).unwrap_or_else(|error| panic!("{error}"));
        let solve = pcg(&k, &f, &without);
        println!("{name} without points: {solve:?}");
        assert!(solve.iterations <= 3 * limit, "{name}: {solve:?}");
    }
}

/// Aggregates of a plate may lie along lines, which rounding or displacements bend. The rotation about such a line is no
/// coarse unknown, or a harmless one: there are as many iterations, whether nodes are exactly on it or slightly off.
#[test]
fn nodes_nearly_on_lines() {
    for (shape, limit) in [(SolidShape::Tetrahedron, 25), (SolidShape::Hexahedron, 27)] {
        let (k, f, points) = even([1.0, 1.0, 0.1], [60, 4, 2], shape, &[MATERIAL]);
        for off in [0.0, 1e-16, 1e-10, 1e-8, 1e-6, 1e-5, 1e-4, 1e-3] {
            let coordinates = points.as_flattened().iter().enumerate();
            let moved: Vec<f64> = coordinates
                .map(|(i, x)| x + off * smoother::noise(i))
                .collect();
            let settings = AmgSettings {
                dense_limit: 60,
                ..AmgSettings::of_dimension(3)
            };
            let m = Hierarchy::<f32>::new(&k, Some(moved.as_chunks().0), &settings)
                .unwrap_or_else(|error| panic!("{off:e}: {error}"));
            let solve = pcg(&k, &f, &m);
            println!("{shape:?}, {off:e}: {solve:?}");
            assert!(
                solve.iterations <= limit && solve.residual < 2e-8,
                "{off:e}: {solve:?}"
            );
        }
    }
}

/// Nodes on a line, each tied to the next as strongly as given.
fn chain(ties: &[f32]) -> Graph {
    Graph::collect(ties.len() + 1, |i, row| {
        row.extend(i.checked_sub(1).map(|j| (j as u32, ties[j])));
        row.extend(ties.get(i).map(|&tie| (i as u32 + 1, tie)));
    })
}

#[test]
fn far_neighbours_are_not_strong_and_soft_nodes_follow_stiff_ones() {
    let lengths = |graph: Graph| (0..5).map(|i| graph.of(i).len()).collect::<Vec<_>>();
    let points = [[0.0], [1.0], [2.0], [6.5], [7.5]];
    let even = chain(&[1.0; 4]);
    let of = |ties, weight: &[f32], reach, points: Option<&[[f64; 1]]>| {
        let Strength { strong, pulling } =
            strength(ties, weight, 0.5, reach, points, &Halo::alone(5));
        [strong, pulling].map(lengths)
    };
    // The gap of 4.5 is as many times the distance of the closest on both sides.
    let near = [[1, 2, 1, 1, 1]; 2];
    assert_eq!(of(&even, &[1.0; 5], 4.4, Some(&points)), near);
    assert_eq!(
        of(&even, &[1.0; 5], 4.6, Some(&points)),
        [[1, 2, 2, 2, 1]; 2]
    );
    assert_eq!(of(&even, &[1.0; 5], 4.4, None), [[1, 2, 2, 2, 1]; 2]);
    // Weak to both, but the first two are a thousand times as stiff.
    let uneven = chain(&[1.0, 0.01, 1.0, 1.0]);
    let weight = [1e3, 1e3, 1.0, 1.0, 1.0];
    assert_eq!(
        of(&uneven, &weight, 1.0, None),
        [[1, 1, 1, 2, 1], [1, 1, 2, 2, 1]]
    );
}

#[test]
fn rows_are_aggregated_in_fives_and_pairs_are_joined() {
    let row = chain(&[1.0; 9]);
    let groups = aggregate(&row, &row, false, |_| false);
    assert_eq!(groups.of_node, [0, 0, 0, 1, 1, 1, 1, 1, 1, 1]);
    // Two nodes that are tied weakly to a row, whose strong neighbours they are not, and one without ties.
    let ties = chain(&[1.0, 1.0, 1.0, 0.1, 1.0, 0.01]);
    let strong = ties.filtered(|_, _, tie| tie == 1.0);
    let groups = aggregate(&ties, &strong, false, |i| i == 6);
    assert_eq!(groups.of_node, [0, 0, 0, 0, 0, 0, NONE]);
    assert_eq!(groups.count, 1);
    // Where there is nothing to join.
    let pair = chain(&[1.0]);
    assert_eq!(aggregate(&pair, &pair, false, |_| false).of_node, [0, 0]);
}

#[test]
fn patches_are_inverted() {
    let (k, _, _) = clamped(&quads([1.0, 0.2], [10, 41]), &[MATERIAL]);
    let halo = Halo::alone(k.n_block_rows());
    let ties = ties(&k, &halo);
    let no_points = None::<&[[f64; 2]]>;
    let Strength { strong, .. } =
        strength(&ties, &weights(&k, 1.0, &halo), 0.2, 3.0, no_points, &halo);
    let groups = patches::patches(&ties, &strong, halo.ranks()).expect("cells are flat");
    let inverse_diagonal = smoother::inverse_diagonal(&k).expect("K is positive definite");
    let inverse = patches::inverse(&k, &inverse_diagonal, &groups);
    let (start, members) = groups.members();
    assert!(
        start
            .windows(2)
            .all(|ends| (1..=4).contains(&(ends[1] - ends[0])))
    );
    assert!(groups.count < k.n_block_rows() / 3);
    for ends in start.windows(2) {
        let nodes = &members[ends[0]..ends[1]];
        for (&i, &j) in nodes.iter().flat_map(|i| nodes.iter().map(move |j| (i, j))) {
            assert_eq!(inverse.row(i as usize).0, nodes);
            let mut product = [[0.0; 2]; 2];
            for &l in nodes {
                if let (Some(a), Some(b)) = (
                    inverse.block(i as usize, l as usize),
                    k.block(l as usize, j as usize),
                ) {
                    product::add_product(a, b, &mut product);
                }
            }
            for (p, row) in product.iter().enumerate() {
                for (q, &v) in row.iter().enumerate() {
                    let one = f64::from(i == j && p == q);
                    // The diagonal is raised before.
                    assert!((v - one).abs() < 1e-3, "{v}");
                }
            }
        }
    }
    // The nodes of a patch that is not positive definite keep their own blocks.
    let diagonal = (0..8).map(|i| (i, i, 1.0));
    let tied = [(0, 2, -2.0), (2, 0, -2.0), (4, 6, -0.5), (6, 4, -0.5)];
    let k = BlockCsr::<2>::from_triplets(8, 8, diagonal.chain(tied));
    let groups = Groups {
        of_node: vec![0, 0, 1, 1],
        count: 2,
    };
    let own = vec![[[1.0, 0.0], [0.0, 1.0]]; 4];
    let inverse = patches::inverse(&k, &own, &groups);
    let lengths: Vec<usize> = (0..4).map(|i| inverse.row(i).0.len()).collect();
    assert_eq!(lengths, [1, 1, 2, 2]);
}

/// The costs and benefits of a hierarchy, as a line of a table.
fn measured<const D: usize>(name: &str, k: &BlockCsr<D>, f: &[f64], points: Option<&[[f64; D]]>) {
    forget_peak_memory();
    let before = peak_memory_mib().unwrap_or(0.0);
    let start = Instant::now();
    let m = Hierarchy::<f32>::new(k, points, &AmgSettings::of_dimension(D))
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
    let tetrahedron = SolidShape::Tetrahedron;
    let [one, layers] = [&[MATERIAL][..], &[MATERIAL, soft, MATERIAL, soft]];
    let graded_cells = [
        ("graded S1", [32, 16, 16]),
        ("graded S2", [54, 27, 27]),
        ("graded S3", [90, 44, 44]),
    ];
    let (bar, slab, rod) = ([3.0, 1.0, 1.0], [2.0, 1.0, 0.5], [0.5, 0.5, 2.0]);
    let boxes = [
        ("uniform S1", bar, [48, 16, 16], hexahedron, "left", one),
        ("uniform S2", bar, [84, 28, 28], hexahedron, "left", one),
        ("tet4", bar, [48, 16, 16], tetrahedron, "left", one),
        ("layers 1e4", bar, [48, 16, 16], hexahedron, "left", layers),
        ("flat 20", slab, [20, 10, 100], hexahedron, "left", one),
        (
            "flat 20 below",
            slab,
            [40, 20, 100],
            hexahedron,
            "bottom",
            one,
        ),
        ("needles 20", rod, [50, 50, 10], hexahedron, "left", one),
    ];
    let measure_solid = |name: &str, make: &dyn Fn() -> Solid| {
        if name.contains(&only) {
            let (k, f, points) = make();
            measured(name, &k, &f, Some(&points));
            if name.ends_with("S1") {
                measured(&format!("{name}, no points"), &k, &f, None);
            }
        }
    };
    for (name, cells) in graded_cells {
        measure_solid(name, &|| graded(cells));
    }
    for (name, size, cells, shape, clamped, materials) in boxes {
        measure_solid(name, &|| {
            solid(size, cells, shape, straight, clamped, materials)
        });
    }
    let checkers = |x: [f64; 2]| ((x[0] * 8.0) as i32 + (x[1] * 8.0) as i32) % 2 == 0;
    let disc = |x: [f64; 2]| (x[0] - 1.5).powi(2) + (x[1] - 0.5).powi(2) < 0.09;
    let hard = Material {
        young: 1e4 * MATERIAL.young,
        ..MATERIAL
    };
    let quads: [(&str, Mesh); 10] = [
        (
            "plane checkers",
            second_region(quads([3.0, 1.0], [300, 100]), checkers),
        ),
        (
            "plane soft disc",
            second_region(shaken([3.0, 1.0], [300, 100]), disc),
        ),
        (
            "plane hard disc",
            second_region(shaken([3.0, 1.0], [300, 100]), disc),
        ),
        ("plane beam", quads([30.0, 1.0], [600, 20])),
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
            let second = if name.contains("hard") { hard } else { soft };
            let (k, f, points) = clamped(&mesh, &[MATERIAL, second][..mesh.regions.len()]);
            measured(name, &k, &f, Some(&points));
        }
    }
}
