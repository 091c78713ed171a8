mod finite;
mod solid;

use super::*;
use crate::mesh::{self, ShapeFunctions, Visit};
use approx::assert_relative_eq;
use std::collections::BTreeMap;

const STEEL: Material = Material {
    density: 3.0,
    ..Material::new(2.0, 0.25)
};

/// Checks the points of an element.
struct Check<'a, const D: usize>(&'a Mesh<D>, &'a mesh::Element<D>)
where
    ElementKind: Topology<D>;

impl<const D: usize> Visit<D> for Check<'_, D>
where
    ElementKind: Topology<D>,
{
    type Output = ();

    fn visit<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(self) {
        let x: [[f64; D]; N] = self.0.coordinates(self.1);
        let area = self.0.measure(self.1);
        let (stiffness, loads): (Vec<_>, Vec<_>) = (
            E::stiffness_points(&x).to_vec(),
            E::load_points(&x).collect(),
        );
        for points in [&stiffness, &loads] {
            let weights: f64 = points.iter().map(|point| point.weight).sum();
            assert_relative_eq!(weights, area, max_relative = 1e-14);
        }
        for point in stiffness
            .iter()
            .chain(&loads)
            .chain([&E::at(E::CENTRE, 1.0, &x)])
        {
            assert_relative_eq!(point.shape.iter().sum::<f64>(), 1.0, epsilon = 1e-15);
            // The gradients of 1, x, y (and z).
            for i in 0..D {
                let of = |f: &dyn Fn(usize) -> f64| -> f64 {
                    (0..N).map(|a| f(a) * point.gradient[a][i]).sum()
                };
                assert_relative_eq!(of(&|_| 1.0), 0.0, epsilon = 1e-14);
                for c in 0..D {
                    let delta = f64::from(u8::from(c == i));
                    assert_relative_eq!(of(&|a| x[a][c]), delta, epsilon = 1e-14);
                }
            }
        }
    }
}

/// A patch of both kinds of elements around a node at an arbitrary position.
fn patch() -> Mesh {
    let nodes = vec![[0.0, 0.0], [2.0, 0.1], [2.2, 1.9], [-0.1, 2.0], [0.8, 1.1]];
    let elements = vec![
        mesh::Element::triangle([0, 1, 4], 0),
        mesh::Element::quad([1, 2, 3, 4], 0),
        mesh::Element::triangle([3, 0, 4], 0),
    ];
    Mesh::new(nodes, elements, vec!["body".to_owned()], BTreeMap::new())
        .unwrap_or_else(|error| panic!("{error}"))
}

fn body<const D: usize>(mesh: &Mesh<D>) -> Body<'_, D>
where
    ElementKind: Topology<D>,
{
    Body {
        mesh,
        materials: &[STEEL],
        plane: Plane::PlaneStrain,
        thickness: 0.5,
    }
}

#[test]
fn shape_functions_are_those_of_linear_fields() {
    let mesh = patch();
    for element in &mesh.elements {
        element.kind().with(Check(&mesh, element));
    }
}

#[test]
fn a_quadrilateral_extrapolates_bilinear_fields() {
    struct Corners;
    impl Visit<2> for Corners {
        type Output = ();
        fn visit<E: ShapeFunctions<2, N, Q>, const N: usize, const Q: usize>(self) {
            let x: [[f64; 2]; N] = std::array::from_fn(|a| {
                [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]][a].map(|v| 2.0 * v)
            });
            let field = |[x, y]: [f64; 2]| 3.0 + x - 2.0 * y + 0.5 * x * y;
            for (corner, &at) in x.iter().enumerate() {
                let points = E::stress_points().map(|xi| E::at(xi, 1.0, &x)).enumerate();
                let value: f64 = points
                    .map(|(number, point)| {
                        E::extrapolation(E::NODES[corner], number) * field(point.place(&x))
                    })
                    .sum();
                assert_relative_eq!(value, field(at), epsilon = 1e-14);
            }
        }
    }
    Topology::<2>::with(ElementKind::Quad, Corners);
}

#[test]
fn stiffness_of_a_triangle_by_hand() {
    let nodes = vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let elements = vec![mesh::Element::triangle([0, 1, 2], 0)];
    let mesh = Mesh::new(nodes, elements, vec!["body".to_owned()], BTreeMap::new())
        .unwrap_or_else(|error| panic!("{error}"));
    let unknowns = Unknowns::new(vec![[None; 2]; 3]);
    let (k, _) = assemble(&body(&mesh), &unknowns, &[[0.0; 2]; 3]);
    // λ = μ = 0.8; area times thickness 1/4. ∇φ₀ = (−1, −1), ∇φ₁ = (1, 0).
    let near = |block: Option<&[[f64; 2]; 2]>, expected: [[f64; 2]; 2]| {
        for (row, expected) in block.expect("stored").iter().zip(expected) {
            for (value, expected) in row.iter().zip(expected) {
                assert_relative_eq!(*value, 0.2 * expected, epsilon = 1e-15);
            }
        }
    };
    near(k.block(0, 0), [[4.0, 2.0], [2.0, 4.0]]);
    near(k.block(0, 1), [[-3.0, -1.0], [-1.0, -1.0]]);
    near(k.block(1, 2), [[0.0, 1.0], [1.0, 0.0]]);
}

#[test]
fn rigid_motions_take_no_force_and_uniform_strain_none_inside() {
    let mesh = patch();
    let body = body(&mesh);
    let unknowns = Unknowns::new(vec![[None; 2]; 5]);
    let (k, f) = assemble(&body, &unknowns, &[[0.0; 2]; 5]);
    assert!(f.iter().all(|&f| f == 0.0));
    let forces = |field: &dyn Fn([f64; 2]) -> [f64; 2]| {
        let u: Vec<f64> = mesh.nodes.iter().flat_map(|&x| field(x)).collect();
        let mut force = vec![0.0; 10];
        k.mul(&u, &mut force);
        force
    };
    for rigid in [
        forces(&|_| [1.0, 0.0]),
        forces(&|_| [0.0, 1.0]),
        forces(&|[x, y]| [-y, x]),
    ] {
        assert!(rigid.iter().all(|f| f.abs() < 1e-14), "{rigid:?}");
    }

    let strained = |[x, y]: [f64; 2]| [0.3 * x - 0.1 * y, 0.2 * x + 0.5 * y];
    let force = forces(&strained);
    assert!(force[8..].iter().all(|f| f.abs() < 1e-14), "{force:?}");
    let u: Vec<[f64; 2]> = mesh.nodes.iter().map(|&x| strained(x)).collect();
    let (at_nodes, in_elements) = stresses(&body, &u);
    for stress in at_nodes.iter().chain(&in_elements) {
        // λ = μ = 0.8, tr ε = 0.8.
        assert_relative_eq!(stress.xx, 0.64 + 1.6 * 0.3, epsilon = 1e-14);
        assert_relative_eq!(stress.yy, 0.64 + 1.6 * 0.5, epsilon = 1e-14);
        assert_relative_eq!(stress.zz, 0.64, epsilon = 1e-14);
        assert_relative_eq!(stress.xy, 0.8 * 0.1, epsilon = 1e-14);
    }
}

#[test]
fn weight_is_shared_out_whole() {
    let mesh = patch();
    let mut forces = vec![[0.0; 2]; 5];
    body(&mesh).add_body_force(None, |_, density| [0.0, -10.0 * density], &mut forces);
    let total: f64 = forces.iter().map(|f| f[1]).sum();
    assert_relative_eq!(
        total,
        -10.0 * 3.0 * 0.5 * mesh.measures()[0],
        max_relative = 1e-14
    );
    // Moments of a linear load: ∫ x dV from the nodal forces and from the corners of the elements.
    let mut moment = vec![[0.0; 2]; 5];
    body(&mesh).add_body_force(Some(&[0]), |x, _| [x[0], x[0]], &mut moment);
    let x: f64 = moment.iter().map(|f| f[0]).sum();
    let outline = [[0.0, 0.0], [2.0, 0.1], [2.2, 1.9], [-0.1, 2.0]];
    let exact: f64 = (0..4)
        .map(|a| (outline[a], outline[(a + 1) % 4]))
        .map(|(a, b)| (a[0] + b[0]) * (a[0] * b[1] - a[1] * b[0]) / 6.0)
        .sum();
    assert_relative_eq!(x, 0.5 * exact, max_relative = 1e-13);
}

#[test]
fn supports_move_to_the_load() {
    let mesh = patch();
    let body = body(&mesh);
    // All of the outside follows a uniform strain, node 1 in x only.
    let strained = |[x, y]: [f64; 2]| [0.3 * x, 0.1 * x - 0.2 * y];
    let mut prescribed: Vec<_> = mesh.nodes.iter().map(|&x| strained(x).map(Some)).collect();
    prescribed[4] = [None; 2];
    prescribed[1][1] = None;
    let unknowns = Unknowns::new(prescribed);
    assert_eq!((unknowns.n_blocks(), unknowns.n_free()), (2, 3));
    let mut forces = vec![[0.0; 2]; 5];
    let all: Vec<[f64; 2]> = mesh.nodes.iter().map(|&x| strained(x)).collect();
    forces[1] = internal_forces(&body, &unknowns, &all)[1];
    let (k, f) = assemble(&body, &unknowns, &forces);
    // The prescribed unknown of node 1 has its own equation.
    let u = [0.0, all[1][1], all[4][0], all[4][1]];
    let mut force = [0.0; 4];
    k.mul(&u, &mut force);
    for (force, f) in force.iter().zip(&f) {
        assert_relative_eq!(force, f, epsilon = 1e-14);
    }
    for (found, expected) in unknowns.displacements(&u).iter().zip(&all) {
        assert_eq!(found, expected);
    }
}

#[test]
fn unknowns_in_space_come_in_threes() {
    let prescribed = vec![
        [Some(1.0), Some(2.0), Some(3.0)],
        [None, Some(-1.0), None],
        [None; 3],
    ];
    let unknowns = Unknowns::new(prescribed);
    assert_eq!((unknowns.n_blocks(), unknowns.n_free()), (2, 5));
    assert_eq!((unknowns.block(0), unknowns.block(2)), (None, Some(1)));
    assert_eq!(unknowns.node(0), 1);
    let u = unknowns.displacements(&[10.0, 11.0, 12.0, 13.0, 14.0, 15.0]);
    assert_eq!(u, [[1.0, 2.0, 3.0], [10.0, -1.0, 12.0], [13.0, 14.0, 15.0]]);
    let points = mesh::tests::in_space(vec![[0.0; 3], [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    assert_eq!(unknowns.coordinates(&points), points.nodes[1..]);
}

/// The tangent is the derivative of the stress: entry [i][j] is the force along i on φ_a of the stress under φ_b along j.
#[test]
fn stress_and_tangent_are_of_one_law() {
    fn check<const D: usize>(plane: Plane, law: super::law::Law) {
        let [ga, gb]: [[f64; D]; 2] = [
            std::array::from_fn(|c| 0.3 + 0.5 * c as f64),
            std::array::from_fn(|c| 0.7 - 0.4 * c as f64),
        ];
        let hoops = (plane == Plane::Axisymmetric).then_some([0.2, -0.9]);
        let mut block = [[0.0; D]; D];
        law.tangent::<D>()
            .times(2.0)
            .add([&ga, &gb], hoops, &mut block);
        for j in 0..D {
            let mut e = [[0.0; D]; D];
            e[j] = gb;
            let hb = hoops.map_or(0.0, |[_, hb]| if j == 0 { hb } else { 0.0 });
            let (s, _) = law.response(&e, hb);
            let rows = [[s.xx, s.xy, s.zx], [s.xy, s.yy, s.yz], [s.zx, s.yz, s.zz]];
            for i in 0..D {
                let round = match (i, hoops) {
                    (0, Some([ha, _])) => s.zz * ha,
                    _ => 0.0,
                };
                let force: f64 = (0..D).map(|k| rows[i][k] * ga[k]).sum::<f64>() + round;
                assert!(
                    (block[i][j] - 2.0 * force).abs() < 1e-13 * 2e3,
                    "{plane:?} {i} {j}"
                );
            }
        }
    }
    let material = Material::new(1e3, 0.3);
    for plane in [Plane::PlaneStrain, Plane::PlaneStress, Plane::Axisymmetric] {
        let law = super::law::Law::new(&material, plane, 1.0);
        check::<2>(plane, law);
        if plane == Plane::PlaneStrain {
            check::<3>(plane, law);
        }
        // Apart from the dilatation and with it again, in the plane x = y = z alike.
        let (left, bulk) = law.without_dilatation();
        let e = [[0.1, 0.4], [0.2, -0.3]];
        let [(all, _), (rest, _)] = [law, left].map(|law| law.response(&e, 0.0));
        let theta = bulk * (0.1 - 0.3);
        assert!((all.xx - rest.xx - theta).abs() < 1e-10 && (all.xy - rest.xy).abs() < 1e-12);
    }
}
