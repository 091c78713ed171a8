//! Elements of space against closed forms, and against those of the plane.

use super::*;
use crate::mesh::structured::{SolidShape, block};
use crate::mesh::{Facet, facet_nodes};
use std::collections::HashMap;

const SHAPES: [SolidShape; 3] = [
    SolidShape::Hexahedron,
    SolidShape::Tetrahedron,
    SolidShape::Wedge,
];

/// A mesh with a boundary "skin" all around it: the facets of exactly one element, listed by their nodes from inside.
fn with_skin(nodes: Vec<[f64; 3]>, elements: Vec<mesh::Element<3>>) -> Mesh<3> {
    let mut owners: HashMap<Vec<u32>, (usize, Facet<3>)> = HashMap::new();
    for facet in elements.iter().flat_map(mesh::Element::facets) {
        let mut key = facet_nodes(&facet).to_vec();
        key.sort_unstable();
        owners.entry(key).or_insert((0, facet)).0 += 1;
    }
    let outside = owners.values().filter(|owner| owner.0 == 1);
    let inward = outside.map(|&(_, facet)| {
        let mut nodes = facet_nodes(&facet).to_vec();
        nodes.reverse();
        mesh::facet::<3>(&nodes)
    });
    let mut skin: Vec<Facet<3>> = inward.collect();
    skin.sort_unstable();
    let boundaries = BTreeMap::from([("skin".to_owned(), skin)]);
    Mesh::new(nodes, elements, vec!["body".to_owned()], boundaries)
        .unwrap_or_else(|error| panic!("{error}"))
}

/// A block of 2 × 3 × 2 cells. All of their faces differ, and no face is flat.
fn distorted(shape: SolidShape) -> Mesh<3> {
    let mut mesh = block([0.0; 3], [2.0, 1.5, 1.0], [2, 3, 2], shape, "body", "");
    for (i, x) in (1..).zip(&mut mesh.nodes) {
        for (c, x) in x.iter_mut().enumerate() {
            *x += 0.07 * (f64::from(i) * [12.9, 78.2, 37.7][c]).sin();
        }
    }
    with_skin(mesh.nodes, mesh.elements)
}

/// A hexahedron, a wedge on one of its sides and two tetrahedra on that, some of them inside out.
fn mixed() -> Mesh<3> {
    let nodes = vec![
        [0.0, 0.0, 0.0],
        [1.0, 0.1, 0.0],
        [1.1, 1.0, -0.1],
        [0.0, 0.9, 0.1],
        [0.1, 0.0, 1.0],
        [0.9, -0.1, 1.1],
        [1.0, 1.2, 1.0],
        [0.0, 1.0, 0.9],
        [1.8, 0.5, 0.1],
        [1.9, 0.6, 1.0],
        [1.3, 0.4, 1.7],
        [1.5, -0.4, 1.5],
    ];
    let elements = vec![
        mesh::Element::hexahedron([4, 5, 6, 7, 0, 1, 2, 3], 0),
        mesh::Element::wedge([1, 2, 8, 5, 6, 9], 0),
        mesh::Element::tetrahedron([5, 6, 9, 10], 0),
        mesh::Element::tetrahedron([5, 10, 9, 11], 0),
    ];
    with_skin(nodes, elements)
}

/// All of the above.
fn solids() -> Vec<Mesh<3>> {
    let mut all: Vec<Mesh<3>> = SHAPES.map(distorted).into();
    all.push(mixed());
    all
}

fn total(forces: &[[f64; 3]]) -> [f64; 3] {
    std::array::from_fn(|c| forces.iter().map(|f| f[c]).sum())
}

/// K of a body without supports, times the displacements of its nodes.
fn response(mesh: &Mesh<3>, field: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<[f64; 3]> {
    let unknowns = Unknowns::new(vec![[None; 3]; mesh.nodes.len()]);
    let zero = vec![[0.0; 3]; mesh.nodes.len()];
    let (k, _) = assemble(&body(mesh), &unknowns, &zero);
    let u: Vec<f64> = mesh.nodes.iter().flat_map(|&x| field(x)).collect();
    let mut force = vec![0.0; u.len()];
    k.mul(&u, &mut force);
    force.as_chunks().0.to_vec()
}

#[test]
fn shape_functions_in_space_are_those_of_linear_fields() {
    for mesh in solids() {
        for element in &mesh.elements {
            element.kind().with(Check(&mesh, element));
        }
    }
}

/// Whether the stresses at the corners are those of a field that the points determine.
#[test]
fn solids_extrapolate_fields_linear_along_each_axis() {
    struct Corners;
    impl Visit<3> for Corners {
        type Output = ();
        fn visit<E: ShapeFunctions<3, N, Q>, const N: usize, const Q: usize>(self) {
            let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
            let x: [[f64; 3]; N] = std::array::from_fn(|a| match N {
                4 => [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]][a],
                _ => {
                    let [x, y] = square[[0, 1, if N == 6 { 3 } else { 2 }, 3][a % (N / 2)]];
                    [x, y, if a < N / 2 { 0.0 } else { 2.0 }]
                }
            });
            let field = |[x, y, z]: [f64; 3]| match N {
                4 => 3.0,
                6 => 1.0 + x - 2.0 * y + z + 0.5 * x * z - y * z,
                _ => 1.0 + x - 2.0 * y + z + 0.5 * x * z - y * z + 3.0 * x * y - x * y * z,
            };
            for (corner, &at) in x.iter().enumerate() {
                let points = E::stress_points().map(|xi| E::at(xi, 1.0, &x)).enumerate();
                let parts = points.map(|(number, point)| {
                    E::extrapolation(E::NODES[corner], number) * field(point.place(&x))
                });
                assert_relative_eq!(parts.sum::<f64>(), field(at), epsilon = 1e-13);
            }
        }
    }
    for kind in [
        ElementKind::Tetrahedron,
        ElementKind::Wedge,
        ElementKind::Hexahedron,
    ] {
        Topology::<3>::with(kind, Corners);
    }
}

/// The patch test: under a uniform strain the nodal forces are those of σ n on the skin and of nothing else. Hooke's
/// law is checked by its inverse.
#[test]
fn uniform_strain_takes_the_forces_of_its_stress_on_the_skin() {
    let gradient = [[0.3, -0.1, 0.2], [0.25, -0.4, 0.15], [0.05, 0.35, 0.1]];
    let field = |x: [f64; 3]| gradient.map(|row| (0..3).map(|c| row[c] * x[c]).sum::<f64>());
    for mesh in solids() {
        let u: Vec<[f64; 3]> = mesh.nodes.iter().map(|&x| field(x)).collect();
        let (at_nodes, in_elements) = stresses(&body(&mesh), &u);
        for s in at_nodes.iter().chain(&in_elements) {
            let stress = [[s.xx, s.xy, s.zx], [s.xy, s.yy, s.yz], [s.zx, s.yz, s.zz]];
            let trace = s.xx + s.yy + s.zz;
            for i in 0..3 {
                for j in 0..3 {
                    let delta = f64::from(u8::from(i == j));
                    let strain = ((1.0 + STEEL.poisson) * stress[i][j]
                        - STEEL.poisson * trace * delta)
                        / STEEL.young;
                    let expected = 0.5 * (gradient[i][j] + gradient[j][i]);
                    assert_relative_eq!(strain, expected, epsilon = 1e-13);
                }
            }
        }
        let s = in_elements[0];
        let stress = [[s.xx, s.xy, s.zx], [s.xy, s.yy, s.yz], [s.zx, s.yz, s.zz]];
        let traction = |_, n: [f64; 3]| stress.map(|row| (0..3).map(|c| row[c] * n[c]).sum());
        let mut expected = vec![[0.0; 3]; mesh.nodes.len()];
        let skin = mesh.outer_facets("skin").unwrap_or_default();
        let unit = Body {
            thickness: 1.0,
            ..body(&mesh)
        };
        unit.add_traction(skin, traction, &mut expected);
        let unknowns = Unknowns::new(vec![[None; 3]; mesh.nodes.len()]);
        let (k, _) = assemble(&unit, &unknowns, &expected);
        let mut force = vec![0.0; 3 * u.len()];
        k.mul(u.as_flattened(), &mut force);
        for (force, expected) in force.iter().zip(expected.as_flattened()) {
            assert_relative_eq!(force, expected, epsilon = 1e-13);
        }
    }
}

#[test]
fn von_mises_of_simple_states() {
    let state = |xx, xy, yz, zx| Stress {
        xx,
        xy,
        yz,
        zx,
        ..Stress::default()
    };
    assert_relative_eq!(state(-7.0, 0.0, 0.0, 0.0).von_mises(), 7.0);
    for shear in [
        state(0.0, 2.0, 0.0, 0.0),
        state(0.0, 0.0, 2.0, 0.0),
        state(0.0, 0.0, 0.0, 2.0),
    ] {
        assert_relative_eq!(shear.von_mises(), 12f64.sqrt(), max_relative = 1e-15);
    }
}

#[test]
fn only_rigid_motions_in_space_take_no_force() {
    for mesh in solids() {
        let motions: [fn([f64; 3]) -> [f64; 3]; 6] = [
            |_| [1.0, 0.0, 0.0],
            |_| [0.0, 1.0, 0.0],
            |_| [0.0, 0.0, 1.0],
            |[_, y, z]| [0.0, -z, y],
            |[x, _, z]| [z, 0.0, -x],
            |[x, y, _]| [-y, x, 0.0],
        ];
        for motion in motions {
            let force = response(&mesh, motion);
            let largest = force
                .as_flattened()
                .iter()
                .fold(0.0_f64, |m, v| m.max(v.abs()));
            assert!(largest < 1e-13, "{largest}");
        }
        // Each element by itself has six zero eigenvalues and no more.
        let Some(first) = mesh.elements.first() else {
            panic!("there are elements")
        };
        let nodes: Vec<[f64; 3]> = (first.nodes().iter())
            .map(|&node| mesh.nodes[node as usize])
            .collect();
        let one = match first.kind() {
            ElementKind::Tetrahedron => mesh::Element::tetrahedron([0, 1, 2, 3], 0),
            ElementKind::Wedge => mesh::Element::wedge([0, 1, 2, 3, 4, 5], 0),
            _ => mesh::Element::hexahedron([0, 1, 2, 3, 4, 5, 6, 7], 0),
        };
        let one = with_skin(nodes, vec![one]);
        let n = 3 * one.nodes.len();
        let unknowns = Unknowns::new(vec![[None; 3]; n / 3]);
        let (k, _) = assemble(&body(&one), &unknowns, &vec![[0.0; 3]; n / 3]);
        let entry = |i: usize, j: usize| {
            let block = k.block(i / 3, j / 3).expect("a full matrix");
            block[i % 3][j % 3]
        };
        let matrix = faer::Mat::from_fn(n, n, |i, j| {
            assert_relative_eq!(entry(i, j), entry(j, i), epsilon = 1e-14);
            entry(i, j)
        });
        let (values, _) = crate::dense::right_singular(&matrix).expect("finite");
        let zero = values.iter().filter(|v| **v < 1e-13).count();
        let stiff = values.iter().filter(|v| **v > 1e-3).count();
        assert_eq!((zero, zero + stiff), (6, n), "{values:?}");
    }
}

/// ∮ n ds = 0 and ∮ x·n ds = 3 V, ∮ ½ x² n_x ds = ∫ x dV, ∮ ⅓ z³ n_z ds = ∫ z² dV. So normals look outward, and faces,
/// elements and measures agree on warped faces. The last is the work of the nodal shares of a linear load on linear
/// displacements.
#[test]
fn closed_surfaces_hold_their_volume() {
    for mesh in solids() {
        let unit = Body {
            thickness: 1.0,
            ..body(&mesh)
        };
        let skin = mesh.outer_facets("skin").unwrap_or_default();
        let mut shares = vec![[0.0; 3]; mesh.nodes.len()];
        unit.add_traction(skin, |_, n| n, &mut shares);
        let vector = total(&shares);
        assert!(vector.iter().all(|v| v.abs() < 1e-13), "{vector:?}");
        let mut fluxes = vec![[0.0; 3]; mesh.nodes.len()];
        let flux = |x: [f64; 3], n: [f64; 3]| {
            let through = x[0] * n[0] + x[1] * n[1] + x[2] * n[2];
            [
                through,
                x[0].powi(2) / 2.0 * n[0],
                x[2].powi(3) / 3.0 * n[2],
            ]
        };
        unit.add_traction(skin, flux, &mut fluxes);
        let [three_volumes, moment, work] = total(&fluxes);
        let volume: f64 = mesh.measures().iter().sum();
        assert_relative_eq!(three_volumes, 3.0 * volume, max_relative = 1e-13);

        let mut moments = vec![[0.0; 3]; mesh.nodes.len()];
        unit.add_body_force(None, |x, density| [x[0], x[2], density], &mut moments);
        let [x, _, mass] = total(&moments);
        assert_relative_eq!(x, moment, max_relative = 1e-13);
        let loads = moments.iter().zip(&mesh.nodes);
        let done: f64 = loads.map(|(load, x)| load[1] * x[2]).sum();
        assert_relative_eq!(done, work, max_relative = 1e-13);
        assert_relative_eq!(mass, 3.0 * volume, max_relative = 1e-13);
    }
}

/// Loads of degree 2 on a triangle and a rectangle, to the shares of their corners.
#[test]
fn shares_of_faces_in_closed_form() {
    let cube = |shape| block([0.0; 3], [3.0, 2.0, 1.0], [1, 1, 1], shape, "body", "");
    let mesh = cube(SolidShape::Hexahedron);
    let unit = Body {
        thickness: 1.0,
        ..body(&mesh)
    };
    let mut shares = vec![0.0; 8];
    unit.integrate_on_boundary(&mesh.boundaries["top"], &|[x, y, _]| x * x * y, &mut shares);
    // ∫ φ x² dx over (0, 3): 9/4 and 27/4; ∫ φ y dy over (0, 2): 2/3 and 4/3.
    for (share, expected) in shares[4..].iter().zip([
        9.0 / 4.0 * 2.0 / 3.0,
        27.0 / 4.0 * 2.0 / 3.0,
        9.0 / 4.0 * 4.0 / 3.0,
        27.0 / 4.0 * 4.0 / 3.0,
    ]) {
        assert_relative_eq!(*share, expected, max_relative = 1e-14);
    }
    assert!(shares[..4].iter().all(|&share| share == 0.0));

    let nodes = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.2, 0.3, 1.0]];
    let mesh = with_skin(nodes, vec![mesh::Element::tetrahedron([0, 1, 2, 3], 0)]);
    let unit = Body {
        thickness: 1.0,
        ..body(&mesh)
    };
    let base = (mesh.boundaries["skin"].iter()).find(|face| !face.contains(&3));
    let mut shares = vec![0.0; 4];
    unit.integrate_on_boundary(
        &[*base.expect("the base")],
        &|[x, ..]| x * x * x,
        &mut shares,
    );
    // ∫ xᵃ yᵇ over the reference triangle is a! b!/(a + b + 2)!.
    for (share, expected) in shares
        .iter()
        .zip([1.0 / 120.0, 1.0 / 30.0, 1.0 / 120.0, 0.0])
    {
        assert_relative_eq!(*share, expected, max_relative = 1e-13);
    }
}

/// The nodal forces of a pressure on a warped face, against many small flat pieces of it.
#[test]
fn a_pressure_on_a_warped_face_follows_its_normal() {
    let mut cube = block(
        [0.0; 3],
        [1.0; 3],
        [1, 1, 1],
        SolidShape::Hexahedron,
        "body",
        "",
    );
    cube.nodes[7] = [1.1, 0.9, 1.6];
    let unit = Body {
        thickness: 1.0,
        ..body(&cube)
    };
    let top = &cube.boundaries["top"];
    let mut forces = vec![[0.0; 3]; 8];
    unit.add_traction(top, |_, n| n.map(|n| -2.0 * n), &mut forces);
    let corners = facet_nodes(&top[0]);
    let x: Vec<[f64; 3]> = corners
        .iter()
        .map(|&node| cube.nodes[node as usize])
        .collect();
    let shape = |s: f64, t: f64| [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t];
    let place = |s, t| -> [f64; 3] {
        std::array::from_fn(|c| (0..4).map(|a| shape(s, t)[a] * x[a][c]).sum())
    };
    const PIECES: usize = 200;
    let mut expected = [[0.0; 3]; 4];
    let h = 1.0 / PIECES as f64;
    for i in 0..PIECES {
        for j in 0..PIECES {
            let (s, t) = (h * i as f64, h * j as f64);
            let [a, b, c, d] = [
                place(s, t),
                place(s + h, t),
                place(s + h, t + h),
                place(s, t + h),
            ];
            let phi = shape(s + 0.5 * h, t + 0.5 * h);
            for (k, (p, q)) in [(1, 2), (2, 0), (0, 1)].into_iter().enumerate() {
                let area = 0.5 * ((c[p] - a[p]) * (d[q] - b[q]) - (c[q] - a[q]) * (d[p] - b[p]));
                for node in 0..4 {
                    expected[node][k] -= 2.0 * phi[node] * area;
                }
            }
        }
    }
    for (&node, expected) in corners.iter().zip(expected) {
        for c in 0..3 {
            assert_relative_eq!(forces[node as usize][c], expected[c], epsilon = 1e-5);
        }
    }
    // The mesh has the mean normal, and the area to the accuracy of four points.
    let (area, normal) = cube.facet_normal(&top[0]);
    let whole = total(&forces).map(|f| -0.5 * f);
    let length = whole.iter().map(|v| v * v).sum::<f64>().sqrt();
    for c in 0..3 {
        assert_relative_eq!(normal[c], whole[c] / length, epsilon = 1e-14);
    }
    let mut share = vec![0.0; 8];
    unit.integrate_on_boundary(top, &|_| 1.0, &mut share);
    assert_relative_eq!(area, share.iter().sum::<f64>(), max_relative = 0.01);
    assert!(area > length);
}

/// Plane strain is a slice of a long body: extruded by one element, with no motion along z, both layers together
/// answer as the plane does.
#[test]
fn an_extruded_plane_answers_as_the_plane() {
    let flat = patch();
    let n = flat.nodes.len() as u32;
    let long = 0.7;
    let nodes = [0.0, long].map(|z| flat.nodes.iter().map(move |&[x, y]| [x, y, z]));
    let elements = flat.elements.iter().map(|element| match *element.nodes() {
        [a, b, c] => mesh::Element::wedge([a, b, c, a + n, b + n, c + n], 0),
        [a, b, c, d] => mesh::Element::hexahedron([a, b, c, d, a + n, b + n, c + n, d + n], 0),
        _ => panic!("of the plane"),
    });
    let solid = with_skin(nodes.into_iter().flatten().collect(), elements.collect());
    let motion = |[x, y]: [f64; 2]| [0.3 * x * y - y, x * x + 0.2 * y];
    let whole = Body {
        thickness: long,
        ..body(&flat)
    };
    let unknowns = Unknowns::new(vec![[None; 2]; flat.nodes.len()]);
    let (k, _) = assemble(&whole, &unknowns, &vec![[0.0; 2]; flat.nodes.len()]);
    let u: Vec<f64> = flat.nodes.iter().flat_map(|&x| motion(x)).collect();
    let mut expected = vec![0.0; u.len()];
    k.mul(&u, &mut expected);

    let unit = Body {
        thickness: 1.0,
        ..body(&solid)
    };
    let displacement: Vec<[f64; 3]> = (solid.nodes.iter())
        .map(|&[x, y, _]| motion([x, y]))
        .map(|[x, y]| [x, y, 0.0])
        .collect();
    let held = Unknowns::new(displacement.iter().map(|u| u.map(Some)).collect());
    let forces = internal_forces(&unit, &held, &displacement);
    for node in 0..n as usize {
        for c in 0..2 {
            let both = forces[node][c] + forces[node + n as usize][c];
            assert_relative_eq!(both, expected[2 * node + c], epsilon = 1e-13);
        }
    }
    // The stresses, too, σzz among them.
    let u: Vec<[f64; 2]> = flat.nodes.iter().map(|&x| motion(x)).collect();
    let (at_nodes, in_elements) = stresses(&whole, &u);
    let (in_space, middle) = stresses(&unit, &displacement);
    for (flat, solid) in at_nodes
        .iter()
        .zip(&in_space)
        .chain(in_elements.iter().zip(&middle))
    {
        assert_relative_eq!(flat.xx, solid.xx, epsilon = 1e-13);
        assert_relative_eq!(flat.yy, solid.yy, epsilon = 1e-13);
        assert_relative_eq!(flat.zz, solid.zz, epsilon = 1e-13);
        assert_relative_eq!(flat.xy, solid.xy, epsilon = 1e-13);
        assert!(solid.yz.abs() < 1e-13 && solid.zx.abs() < 1e-13);
    }
}

/// Rows of nodes that are partly or altogether held, from several chunks of rows.
#[test]
fn supports_in_space_move_to_the_load() {
    for shape in SHAPES {
        let mesh = distorted(shape);
        let all: Vec<[f64; 3]> = (mesh.nodes.iter())
            .map(|&[x, y, z]| [0.1 * x * y, 0.2 * z - y * y, x * z + 0.3 * y])
            .collect();
        let full = response(&mesh, |x| {
            let node = mesh.nodes.iter().position(|&y| y == x).expect("a node");
            all[node]
        });
        let prescribed = (all.iter().enumerate()).map(|(node, u)| {
            std::array::from_fn(|c| ((node + c) % 3 == 0 || node % 5 == 0).then_some(u[c]))
        });
        let unknowns = Unknowns::new(prescribed.collect());
        let forces = internal_forces(&body(&mesh), &unknowns, &all);
        for (node, (force, full)) in forces.iter().zip(&full).enumerate() {
            if unknowns.prescribed(node as u32).iter().any(Option::is_some) {
                for c in 0..3 {
                    assert_relative_eq!(force[c], full[c], epsilon = 1e-13);
                }
            }
        }
        let (k, f) = assemble(&body(&mesh), &unknowns, &full);
        let mut u = vec![0.0; f.len()];
        for (row, u) in u.chunks_mut(3).enumerate() {
            let node = unknowns.node(row);
            for c in 0..3 {
                if unknowns.prescribed(node)[c].is_none() {
                    u[c] = all[node as usize][c];
                }
            }
        }
        let mut force = vec![0.0; f.len()];
        k.mul(&u, &mut force);
        for (force, f) in force.iter().zip(&f) {
            assert_relative_eq!(force, f, epsilon = 1e-12);
        }
    }
}
