//! Balances of blocks, levers and faces.

use super::*;
use crate::constraint::SlipBound;

/// On Coulomb's cone.
fn cone(mu: f64, z: [f64; 2]) -> Projected<2> {
    SlipBound::Coulomb(mu).nearest(z)
}

/// Within a slip bound.
fn interval(g: f64, z: [f64; 2]) -> Projected<2> {
    SlipBound::Given(g).nearest(z)
}

/// A block on a floor: m nodes along it, λν up and λτ along, motions x, y and a rotation.
fn block(m: usize) -> Csr {
    let mut entries = Vec::new();
    for i in 0..m {
        let x = i as f64 / (m - 1) as f64 - 0.5;
        entries.extend([(i, 1, 1.0), (i, 2, x), (m + i, 0, 1.0), (m + i, 2, 0.3)]);
    }
    Csr::from_triplets(2 * m, 3, entries)
}

#[test]
fn the_nearest_point_is_balanced_and_nearest() {
    let m = 7;
    let g = block(m);
    let e = [0.9, 5.0, 0.4];
    let balance = Balance::from_parts(&g, &e, vec![1.0, 5.0, 1.0], vec![0; 3]);
    let bounds = vec![0.2; m];
    let x: Vec<f64> = (0..2 * m).map(|i| ((i * 37) % 11) as f64 - 5.0).collect();
    for coulomb in [false, true] {
        let project = |i: usize, z| {
            if coulomb {
                cone(0.3, z)
            } else {
                interval(bounds[i], z)
            }
        };
        let near = balance.nearest(&x, project);
        assert!(near.balanced && norm_max(&near.imbalance) < 1e-12);
        // λ − x − Gᵀη is orthogonal to every feasible direction: no feasible point is nearer.
        for seed in 1..20 {
            let y: Vec<f64> = (0..2 * m).map(|i| ((i * seed) % 7) as f64 - 3.0).collect();
            let other = balance.nearest(&y, project).lambda;
            let slope: f64 = (0..2 * m)
                .map(|i| (near.lambda[i] - x[i]) * (other[i] - near.lambda[i]))
                .sum();
            assert!(slope > -1e-10, "{slope}");
        }
    }
}

/// A lever on nodes beyond its pin, except one that is this little on the other side: a large force there holds it.
#[test]
fn a_tiny_arm_is_an_arm() {
    for arm in [1e-3, 1e-4, 1e-5, 0.0, -1e-5] {
        let m = 8;
        let arms = (0..m).map(|i| (i, 0, if i == 0 { -arm } else { i as f64 / m as f64 }));
        let g = Csr::from_triplets(2 * m, 1, arms);
        let mut balance = Balance::from_parts(&g, &[-1e-3], vec![1.0], vec![0]);
        let least = balance.least(|_, z| interval(0.0, z));
        assert_eq!(least.balanced, arm > 0.0, "{arm}: {:?}", least.imbalance);
        if least.balanced {
            assert!((least.lambda[0] * arm / 1e-3 - 1.0).abs() < 1e-6, "{arm}");
            // And so it is from elsewhere.
            assert!(
                balance
                    .nearest(&vec![1.0; 2 * m], |_, z| interval(0.0, z))
                    .balanced
            );
        }
    }
}

/// A frictionless slope of 1e-4 carries a push by forces 1e4 times as large: virtual tangential forces say nothing about their
/// rounding.
#[test]
fn a_gentle_slope_without_friction_holds() {
    for slope in [1e-2, 1e-4, 1e-6] {
        let m = 3;
        let rows = (0..m).flat_map(|i| [(i, 0, slope), (m + i, 0, 1.0)]);
        let g = Csr::from_triplets(2 * m, 1, rows);
        let mut balance = Balance::from_parts(&g, &[0.02], vec![1.0], vec![0]);
        let least = balance.least(|_, z| interval(0.0, z));
        assert!(least.balanced, "{slope}: {:?}", least.imbalance);
        let force = 0.02 / slope / m as f64;
        assert!((least.lambda[0] / force - 1.0).abs() < 1e-6, "{slope}");
    }
}

#[test]
fn an_imbalance_is_reported() {
    let m = 7;
    let g = block(m);
    // Friction carries 0.3 · 5 at most; the block is pushed along x.
    for (push, held) in [(1.499, true), (1.501, false), (-1.6, false)] {
        let e = [push, 5.0, 0.3 * push];
        let balance = Balance::from_parts(&g, &e, vec![1.0, 5.0, 1.0], vec![0; 3]);
        let near = balance.nearest(&vec![0.0; 2 * m], |_, z| cone(0.3, z));
        assert_eq!(near.balanced, held, "{push}: {:?}", near.imbalance);
        if !held {
            assert!(near.imbalance[0] * push > 0.0);
        }
    }
    // Pulled up.
    let balance = Balance::from_parts(&g, &[0.0, -1.0, 0.0], vec![0.0, 1.0, 0.0], vec![0; 3]);
    let near = balance.nearest(&vec![1.0; 2 * m], |_, z| interval(0.1, z));
    assert!(!near.balanced && (near.imbalance[1] + 1.0).abs() < 1e-6);
}

/// Directions on a face stay on it and move no body: circles in space, with and without Coulomb's law.
#[test]
fn faces_of_space_are_kept_in_balance() {
    use crate::constraint::{Disc, NodeSets};
    let m = 9;
    let arms = (0..3 * m).flat_map(|i| {
        (0..3).map(move |j| (i, j, (1.0 + 0.7 * i as f64 + (i * (j + 2)) as f64).sin()))
    });
    let transposed = Csr::from_triplets(3 * m, 3, arms);
    let balance = Balance::from_parts(&transposed, &[0.3, -0.2, 0.1], vec![1.0; 3], vec![0; 3]);
    let balance = Rc::new(balance);
    let nodes: Vec<NodeSets<3>> = (0..m)
        .map(|i| {
            let z = [
                0.5 - (i % 4 == 3) as u8 as f64,
                (i as f64).cos(),
                (i as f64).sin(),
            ];
            Disc {
                g: [0.5, 2.0, 0.0][i % 3],
            }
            .predict(z)
        })
        .collect();
    for mu in [0.0, 0.4] {
        let slides = |i: usize| mu > 0.0 && nodes[i].contact && nodes[i].turns;
        let follows: Vec<f64> = (0..m).map(|i| if slides(i) { mu } else { 0.0 }).collect();
        let follows = if mu > 0.0 { follows } else { Vec::new() };
        let face = balance.on_face(&nodes, &follows);
        let lift = |y: &[f64]| {
            let mut lifted = vec![0.0; 3 * m];
            for i in 0..m {
                let mut free = nodes[i].free_part(at::<3>(y, i));
                if slides(i) {
                    let s = nodes[i].slip.expect("it slides");
                    (1..3).for_each(|a| free[a] += mu * s[a] * free[0]);
                }
                put(&mut lifted, i, free);
            }
            lifted
        };
        let y: Vec<f64> = (0..3 * m).map(|i| (1.3 * i as f64).cos()).collect();
        let mut p = lift(&y);
        face.project(&mut p);
        let mut moved = vec![0.0; face.balance.count()];
        face.balance.motions.mul_transpose_add(1.0, &p, &mut moved);
        assert!(moved.iter().all(|v| v.abs() < 1e-12));
        let again = lift(&p);
        assert!(
            (p.iter().zip(&again)).all(|(a, b)| (a - b).abs() < 1e-12),
            "off the face"
        );
        assert!(norm_max(&p) > 0.1);
        // From anywhere, forces are balanced without leaving the face.
        let (mut lambda, start) = (vec![0.1; 3 * m], vec![0.1; 3 * m]);
        assert!(face.balance(&mut lambda));
        assert!(balance.holds(&lambda));
        let moved: Vec<f64> = lambda.iter().zip(&start).map(|(l, s)| l - s).collect();
        let again = lift(&moved);
        assert!((moved.iter().zip(&again)).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}

/// A block that slides on a floor until a spring holds it, whose multiplier counts by this factor: that of a soft one is small.
#[test]
fn a_soft_spring_holds() {
    for exponent in 6..=16 {
        let spring = 0.5_f64.powi(exponent);
        let x = [-0.5, 0.0, 0.5];
        let mut entries = vec![(3, 0, spring), (3, 2, -0.5 * spring)];
        for (i, x) in x.into_iter().enumerate() {
            entries.extend([(i, 1, 1.0), (i, 2, x), (4 + i, 0, 1.0), (4 + i, 2, 0.5)]);
        }
        let g = Csr::from_triplets(8, 3, entries);
        let acting = vec![1.0, 1.0, 1.0];
        let mut balance = Balance::from_parts(&g, &[-1.0, 1.0, 0.5], acting, vec![0; 3]);
        let least = balance.least(|i, z| match i {
            3 => SlipBound::Tied.nearest(z),
            _ => cone(0.4, z),
        });
        assert!(
            least.balanced,
            "{spring}: {:?} {:?}",
            least.imbalance, least.lambda
        );
        let force = least.lambda[3] * spring;
        assert!((force + 0.6).abs() < 1e-9, "{spring}: {force}");
    }
}
