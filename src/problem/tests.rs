use super::*;
use crate::sparse::norm_max;
use faer::sparse::{SparseColMat, Triplet};

/// Row, column and value of each entry.
type Triplets = Vec<(usize, usize, f64)>;

/// Springs between points along their distances: the stiffness of a truss.
fn springs<const D: usize>(
    points: &[[f64; D]],
    ties: impl IntoIterator<Item = (usize, usize)>,
) -> Triplets {
    let mut triplets = Vec::new();
    for (p, q) in ties {
        let mut way: [f64; D] = std::array::from_fn(|c| points[q][c] - points[p][c]);
        let length = crate::rigid::length(&way);
        way = way.map(|v| v / length);
        for (i, j, sign) in [(p, p, 1.0), (q, q, 1.0), (p, q, -1.0), (q, p, -1.0)] {
            for a in 0..D {
                for b in 0..D {
                    triplets.push((D * i + a, D * j + b, sign * way[a] * way[b]));
                }
            }
        }
    }
    triplets
}

/// The corners of a box, each tied to all others.
fn cube() -> (Vec<[f64; 3]>, Triplets) {
    let points: Vec<[f64; 3]> = (0..8)
        .map(|i| {
            [
                2.0 * (i % 2) as f64,
                (i / 2 % 2) as f64,
                3.0 * (i / 4) as f64,
            ]
        })
        .collect();
    let ties = (0..8).flat_map(|i| (0..i).map(move |j| (i, j)));
    let triplets = springs(&points, ties);
    (points, triplets)
}

fn block<const D: usize>(n: usize, triplets: &[(usize, usize, f64)]) -> BlockCsr<D> {
    BlockCsr::from_triplets(n, n, triplets.iter().copied())
}

/// The triplets without the rows and columns of these unknowns, except for a diagonal.
fn held(triplets: &[(usize, usize, f64)], unknowns: &[usize]) -> Triplets {
    let is_held = |i: &usize| unknowns.contains(i);
    let rest = triplets
        .iter()
        .filter(|(i, j, _)| !is_held(i) && !is_held(j));
    rest.copied()
        .chain(unknowns.iter().map(|&i| (i, i, 1.0)))
        .collect()
}

/// R is orthonormal and in the kernel of K, which with some unknowns fixed is regular.
fn check_motions<const D: usize>(k: &BlockCsr<D>, free: &FloatingBodies<D>) {
    let n = k.n_rows();
    let modes: Vec<Vec<f64>> = (0..free.n_modes())
        .map(|a| {
            let mut mode = vec![0.0; n];
            let alpha: Vec<f64> = (0..free.n_modes()).map(|b| f64::from(a == b)).collect();
            free.add_motion(&alpha, &mut mode);
            mode
        })
        .collect();
    for (a, mode) in modes.iter().enumerate() {
        let mut force = vec![0.0; n];
        k.mul(mode, &mut force);
        assert!(norm_max(&force) < 1e-12, "{a}");
        for (b, product) in free.resultants(mode).into_iter().enumerate() {
            assert!((product - f64::from(a == b)).abs() < 1e-12, "{a} {b}");
        }
    }
    let (grounded, ties) = free.grounded(&Arc::new(k.clone()), |unknown| unknown < D);
    assert_eq!(ties.len(), free.n_modes());
    assert!(ties.iter().all(|&(unknown, _)| unknown as usize >= D));
    let dense = faer::Mat::from_fn(n, n, |i, j| {
        grounded
            .block(i / D, j / D)
            .map_or(0.0, |block| block[i % D][j % D])
    });
    let (values, _) = crate::dense::symmetric_eigen(&dense).expect("finite");
    assert!(values[0] > 1e-3, "{}", values[0]);
}

#[test]
fn a_cube_in_space_has_six_motions_and_supports_take_them() {
    let (points, triplets) = cube();
    let cases: [(&[usize], usize, &str); 7] = [
        (&[], 6, "move in x, y and z and rotate about every axis"),
        // A point held, a hinge along z, a slide along x, the plane of z.
        (&[0, 1, 2], 3, "rotate about every axis"),
        (&[0, 1, 2, 12, 13], 1, "rotate"),
        (&[0, 1, 12, 13], 2, "move in z and rotate"),
        (&[1, 2, 4, 5, 7, 8, 13, 14], 1, "move in x"),
        (&[2, 5, 8], 3, "move in x and y and rotate"),
        (&[0, 1, 2, 4, 5, 8], 0, ""),
    ];
    for (supports, motions, freedom) in cases {
        let k = block::<3>(24, &held(&triplets, supports));
        let free = FloatingBodies::find(&k, &points);
        assert_eq!(free.n_modes(), motions, "{freedom}");
        check_motions(&k, &free);
        for body in free.bodies() {
            assert_eq!(body.freedom(), freedom);
            // A fully held node is a part of its own.
            let first = usize::from(supports.starts_with(&[0, 1, 2]));
            assert!(body.nodes().iter().copied().eq(first as u32..8));
            assert_eq!(body.centre(), [1.0, 0.5, 1.5]);
            assert!((body.size() - 0.5 * 14.0_f64.sqrt()).abs() < 1e-15);
        }
    }
}

#[test]
fn motions_in_words() {
    let (points, triplets) = cube();
    // The coefficients of a motion: its resultants.
    let said = |supports: &[usize], velocity: &dyn Fn(&[f64; 3]) -> [f64; 3]| {
        let free = FloatingBodies::find(&block::<3>(24, &held(&triplets, supports)), &points);
        let mut u: Vec<f64> = points.iter().flat_map(velocity).collect();
        supports.iter().for_each(|&i| u[i] = 0.0);
        free.bodies()[0].describe(&free.resultants(&u))
    };
    assert_eq!(
        said(&[], &|_| [0.0, 3.0, 4.0]),
        "slides along (0.000, 0.600, 0.800)"
    );
    assert_eq!(
        said(&[], &|x| [-(x[1] - 0.5), x[0] - 4.0, 0.0]),
        "rotates about the axis through (4.0000e0, 5.0000e-1, 1.5000e0) along (0.000, 0.000, 1.000)"
    );
    assert_eq!(
        said(&[], &|x| [1.0, -(x[2] - 1.5), x[1] - 0.5]),
        "rotates about the axis through (1.0000e0, 5.0000e-1, 1.5000e0) along (1.000, 0.000, 0.000), and slides \
         along it"
    );
    // The same in the plane.
    let points = [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [2.0, 2.0]];
    let ties = (0..4).flat_map(|i| (0..i).map(move |j| (i, j)));
    let triplets = springs(&points, ties);
    let cases: [(&[usize], &str); 5] = [
        (&[], "move in x and y and rotate"),
        (&[1, 3], "move in x"),
        (&[0, 4], "move in y"),
        (&[1], "move in x and rotate"),
        (&[0, 1], "rotate"),
    ];
    for (supports, freedom) in cases {
        let k = block::<2>(8, &held(&triplets, supports));
        let free = FloatingBodies::find(&k, &points);
        check_motions(&k, &free);
        assert_eq!(free.bodies()[0].freedom(), freedom);
    }
    let free = FloatingBodies::find(&block::<2>(8, &triplets), &points);
    let said = |velocity: &dyn Fn(&[f64; 2]) -> [f64; 2]| {
        let u: Vec<f64> = points.iter().flat_map(velocity).collect();
        free.bodies()[0].describe(&free.resultants(&u))
    };
    assert_eq!(said(&|_| [-1.0, 0.0]), "slides along (-1.000, 0.000)");
    assert_eq!(
        said(&|x| [x[1] - 1.0, 5.0 - x[0]]),
        "rotates clockwise about (5.0000e0, 1.0000e0)"
    );
}

/// Two contact nodes in space, on springs to the ground and between them; f so that u and λ solve (1).
fn two_nodes(u: [f64; 6], lambda: [f64; 6]) -> ContactData<3> {
    let mut triplets = springs(&[[0.0; 3], [1.0, 1.0, 0.0]], [(0, 1)]);
    triplets.extend((0..6).map(|i| (i, i, 2.0 + i as f64)));
    let stiffness = block::<3>(6, &triplets);
    // Down is towards the floor; x and y are along it.
    let normal = Csr::from_triplets(2, 6, [(0, 2, -1.0), (1, 5, -1.0)]);
    let rows = [
        (0, 0, 1.0),
        (1, 1, 1.0),
        (2, 3, 0.6),
        (2, 4, 0.8),
        (3, 3, -0.8),
        (3, 4, 0.6),
    ];
    let tangential = Csr::from_triplets(4, 6, rows);
    let mut load = vec![0.0; 6];
    stiffness.mul(&u, &mut load);
    normal.mul_transpose_add(1.0, &lambda[..2], &mut load);
    tangential.mul_transpose_add(1.0, &lambda[2..], &mut load);
    ContactData {
        stiffness,
        load,
        normal,
        tangential,
        gap: vec![0.1, 0.2],
        slip_bound: vec![5.0, 2.0],
        coordinates: Some(vec![[0.0; 3], [1.0, 1.0, 0.0]]),
    }
}

/// Node 0 slips along (0.6, 0.8) at its bound, node 1 sticks below it.
const U: [f64; 6] = [0.06, 0.08, -0.1, 0.0, 0.0, -0.2];
const LAMBDA: [f64; 6] = [10.0, 4.0, 3.0, 4.0, -1.5, 0.5];

#[test]
fn conditions_in_space_hold_only_for_a_solution() {
    let problem = ContactProblem::new(two_nodes(U, LAMBDA)).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((problem.n(), problem.m()), (6, 2));
    assert_eq!(problem.contact_matrix().n_rows(), 6);
    assert_eq!(problem.compliance().len(), 6);
    assert_eq!(
        problem.load_case().offsets(),
        [0.1, 0.2, 0.0, 0.0, 0.0, 0.0]
    );
    assert_eq!(problem.touched(), [true, true]);
    assert!(problem.floating_bodies().is_empty());
    let kkt = problem.kkt(&U, &LAMBDA);
    assert!(kkt.max() < 1e-14, "{kkt:?}");
    // u or λ, the entry, and its change; equilibrium is lost each time.
    let broken = |of_u: bool, changes: &[(usize, f64)]| {
        let (mut u, mut lambda) = (U, LAMBDA);
        for &(i, by) in changes {
            if of_u {
                u[i] += by;
            } else {
                lambda[i] += by;
            }
        }
        let kkt = problem.kkt(&u, &lambda);
        assert!(kkt.equilibrium > 1e-4);
        kkt
    };
    assert!(broken(true, &[(2, -0.01)]).penetration > 1e-3);
    assert!(broken(true, &[(2, 0.01)]).complementarity > 1e-4);
    assert!(broken(false, &[(0, -11.0)]).tension > 1e-3);
    assert!(broken(false, &[(2, 0.1)]).friction_bound > 1e-3);
    // Sticking nodes that slip, in either direction; slip that turns; a force that turns; a bound not reached.
    assert!(broken(true, &[(3, 0.01)]).slip > 1e-4);
    assert!(broken(true, &[(4, 0.01)]).slip > 1e-4);
    assert!(broken(true, &[(0, -0.04), (1, 0.03)]).slip > 1e-4);
    let turned = broken(false, &[(2, 1.0), (3, -1.0)]);
    assert!(turned.slip > 1e-4 && turned.friction_bound == 0.0);
    assert!(broken(false, &[(2, -0.3), (3, -0.4)]).slip > 1e-4);
    // Faster along the force is a solution of (3) still.
    assert!(broken(true, &[(0, 0.006), (1, 0.008)]).slip < 1e-14);

    // Under Coulomb's law with the same bounds, and counted from elsewhere.
    let coulomb = (problem.clone())
        .with_friction_coefficient(vec![0.5, 0.5])
        .unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(*coulomb.bounds(&LAMBDA), [5.0, 2.0]);
    assert!(coulomb.kkt(&U, &LAMBDA).max() < 1e-14);
    let moved = problem.with_data(
        problem.load().to_vec(),
        problem.gap().to_vec(),
        vec![0.06, 0.08, 0.0, 0.1],
        problem.slip_bound().to_vec(),
    );
    let moved = moved.unwrap_or_else(|e| panic!("{e}"));
    assert!(moved.kkt(&U, &LAMBDA).slip > 1e-4);
}

#[test]
fn data_in_space_is_checked() {
    let rejected = |change: &dyn Fn(&mut ContactData<3>), expected: &str| {
        let mut data = two_nodes(U, LAMBDA);
        change(&mut data);
        match ContactProblem::new(data) {
            Err(error) => assert!(error.to_string().contains(expected), "{error}"),
            Ok(_) => panic!("{expected}"),
        }
    };
    rejected(
        &|data| data.tangential = data.normal.clone(),
        "T is 2 × 6, expected 4 × 6 (two rows per",
    );
    rejected(
        &|data| data.load.truncate(3),
        "the load f has length 3, expected 6",
    );
    rejected(
        &|data| data.coordinates = Some(vec![[0.0; 3]; 3]),
        "the coordinates has length 3, expected 2 (one point per three unknowns)",
    );
    rejected(
        &|data| data.coordinates = Some(vec![[0.0; 3], [0.0, f64::NAN, 0.0]]),
        "the coordinates: entry (2, 2) is NaN",
    );
    rejected(
        &|data| {
            data.tangential = Csr::from_triplets(4, 6, [(0, 0, 1.0), (1, 0, -2.0), (2, 3, 1.0)])
        },
        "rows 3 and 4 of (N; T) are parallel",
    );
    // A node that can slide along a line, and one that cannot and has no bound.
    let mut data = two_nodes(U, LAMBDA);
    data.tangential = Csr::from_triplets(4, 6, [(1, 1, 1.0)]);
    data.slip_bound = vec![5.0, 0.0];
    let problem = ContactProblem::new(data).unwrap_or_else(|e| panic!("{e}"));
    assert!(problem.with_friction_coefficient(vec![0.3, 0.3]).is_ok());
}

#[test]
fn settings_are_checked() {
    let problem = ContactProblem::new(two_nodes(U, LAMBDA)).unwrap_or_else(|e| panic!("{e}"));
    let said = |result: Result<ContactProblem<3>, ProblemError>, expected: &str| match result {
        Err(error) => assert!(error.to_string().contains(expected), "{error}"),
        Ok(_) => panic!("{expected}"),
    };
    let mu = |mu: &[f64]| problem.clone().with_friction_coefficient(mu.to_vec());
    said(mu(&[0.3]), "μ has length 1, expected 2");
    said(mu(&[0.3, -0.1]), "μ(2) = -1e-1");
    said(mu(&[f64::NAN, 0.1]), "entry 1 is NaN");
    assert!(mu(&[]).is_ok_and(|problem| !problem.has_coulomb()));
    let areas = |areas: &[f64]| problem.clone().with_areas(areas.to_vec());
    said(areas(&[1.0]), "areas has length 1, expected 2");
    said(areas(&[1.0, 0.0]), "the area of contact node 2 is 0e0");
    let data = |lengths: [usize; 4], bound: f64| {
        let [f, d, origin, g] = lengths.map(|length| vec![0.5; length]);
        problem.with_data(f, d, origin, g.iter().map(|g| bound * g).collect())
    };
    assert!(data([6, 2, 4, 2], 1.0).is_ok());
    said(data([5, 2, 4, 2], 1.0), "load f has length 5, expected 6");
    said(data([6, 3, 4, 2], 1.0), "gap d has length 3, expected 2");
    said(
        data([6, 2, 2, 2], 1.0),
        "origin of slip has length 2, expected 4",
    );
    said(
        data([6, 2, 4, 1], 1.0),
        "slip bound g has length 1, expected 2",
    );
    said(data([6, 2, 4, 2], -1.0), "g(1) = -5e-1");
    said(data([6, 2, 4, 2], f64::NAN), "entry 1 is NaN");
    assert!(data([6, 2, 4, 2], f64::INFINITY).is_ok());
}

/// K, N and T of [`two_nodes`] in compressed rows.
type Rows<I> = (Vec<I>, Vec<I>, Vec<f64>);

fn rows<I: TryFrom<usize>, const B: usize>(matrix: &BlockCsr<B>) -> Rows<I> {
    let number = |i: usize| I::try_from(i).unwrap_or_else(|_| panic!("too large"));
    let (mut starts, mut cols, mut values) = (vec![], vec![], vec![]);
    let mut entries: Vec<_> = matrix.triplets().filter(|&(_, _, v)| v != 0.0).collect();
    for i in 0..matrix.n_rows() {
        starts.push(number(values.len()));
        // In any order, and in two parts each.
        entries.reverse();
        for &(_, j, v) in entries.iter().filter(|entry| entry.0 == i) {
            for part in [0.25, 0.75] {
                cols.push(number(j));
                values.push(part * v);
            }
        }
    }
    starts.push(number(values.len()));
    (starts, cols, values)
}

#[test]
fn the_diagonal_of_w_is_checked() {
    for (diagonal, expected) in [
        ([1.0, 1e-100, 1.0], "the diagonal of W: entry 2 is 1e-100"),
        ([1.0, 1.0, f64::NAN], "the diagonal of W: entry 3 is NaN"),
        (
            [-1.0, 1.0, 1.0],
            "W is not positive semidefinite: its diagonal entry 1",
        ),
    ] {
        let made = ContactProblem::<3>::from_delassus(&diagonal, &[-1.0, 0.0, 0.0], &[0.3]);
        let said = made.map(|_| ()).expect_err("it is wrong").to_string();
        assert!(said.starts_with(expected), "{said}");
    }
}

#[test]
fn matrices_of_others_make_the_same_problem() {
    let data = two_nodes(U, LAMBDA);
    let k = rows::<u32, 3>(&data.stiffness);
    let (normal, tangential) = (
        rows::<usize, 1>(&data.normal),
        rows::<i32, 1>(&data.tangential),
    );
    let matrices = Matrices {
        stiffness: SparseRef::from_rows(6, 6, &k.0, &k.1, &k.2),
        load: &data.load,
        normal: SparseRef::from_rows(2, 6, &normal.0, &normal.1, &normal.2),
        tangential: SparseRef::from_rows(4, 6, &tangential.0, &tangential.1, &tangential.2),
        gap: &data.gap,
        slip_bound: &data.slip_bound,
        coordinates: data.coordinates.as_deref(),
        ..Matrices::default()
    };
    let made = ContactProblem::from_matrices(matrices).unwrap_or_else(|e| panic!("{e}"));
    assert!(made.kkt(&U, &LAMBDA).max() < 1e-14);
    assert_eq!(made.stiffness().n_blocks(), 4);
    assert_eq!(made.normal(), &data.normal);
    // K is symmetric: by columns it is the same.
    let by_columns = SparseRef::from_columns(6, 6, &k.0, &k.1, &k.2);
    let triplets: Vec<_> = (data.stiffness.triplets())
        .map(|(i, j, val)| Triplet {
            row: i as u32,
            col: j as u32,
            val,
        })
        .collect();
    let faer = SparseColMat::try_new_from_triplets(6, 6, &triplets).expect("in range");
    for stiffness in [by_columns, faer.as_ref().into()] {
        let coulomb = ContactProblem::from_matrices(Matrices {
            stiffness,
            slip_bound: &[],
            friction_coefficient: &[0.5, 0.5],
            ..matrices
        });
        let coulomb = coulomb.unwrap_or_else(|e| panic!("{e}"));
        assert!(coulomb.has_coulomb() && coulomb.kkt(&U, &LAMBDA).max() < 1e-14);
    }
    // One law a node: the first has Tresca's, the second both.
    let both = ContactProblem::from_matrices(Matrices {
        friction_coefficient: &[0.0, 0.5],
        ..matrices
    });
    let said = both.expect_err("two laws").to_string();
    let expected = "contact node 2 has the slip bound g = 2e0 (Tresca) and the coefficient of friction μ = 5e-1 (Coulomb)";
    assert!(said.starts_with(expected), "{said}");
    // Not a whole number of blocks.
    let diagonal = |n: usize| ((0..=n).collect::<Vec<_>>(), vec![2.0; n]);
    for n in [3, 4, 5] {
        let (starts, values) = diagonal(n);
        let odd = ContactProblem::<3>::from_matrices(Matrices {
            stiffness: SparseRef::from_rows(n, n, &starts, &starts[..n], &values),
            load: &vec![1.0; n],
            normal: SparseRef::from_rows(1, n, &[0, 1], &[n - 1], &[1.0]),
            tangential: SparseRef::from_rows(2, n, &[0, 1, 2], &[0, 1], &[1.0, 1.0]),
            gap: &[0.5],
            slip_bound: &[0.0],
            ..Matrices::default()
        });
        let odd = odd.unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(
            (odd.n(), odd.stiffness().n_rows()),
            (n, n.next_multiple_of(3))
        );
        let mut u = vec![0.5; n];
        u.resize(n.next_multiple_of(3), 0.0);
        assert!(odd.kkt(&u, &[0.0; 3]).max() < 1e-14);
    }
}

#[test]
fn matrices_of_others_are_checked() {
    let identity = SparseRef::from_rows(2, 2, &[0, 1, 2], &[0, 1], &[1.0, 1.0]);
    let unit = |j: usize| {
        let cols: &[usize] = if j == 0 { &[0] } else { &[1] };
        SparseRef::from_rows(1, 2, &[0, 1], cols, &[1.0])
    };
    let sound = Matrices::<2> {
        stiffness: identity,
        load: &[0.0, 0.0],
        normal: unit(0),
        tangential: unit(1),
        gap: &[0.0],
        slip_bound: &[1.0],
        ..Matrices::default()
    };
    assert!(ContactProblem::from_matrices(sound).is_ok());
    let said = |matrices: Matrices, expected: &str| match ContactProblem::from_matrices(matrices) {
        Err(error) => assert!(error.to_string().contains(expected), "{error}"),
        Ok(_) => panic!("{expected}"),
    };
    let k = |stiffness| Matrices { stiffness, ..sound };
    let t = |tangential| Matrices {
        tangential,
        ..sound
    };
    let three = &[1.0; 3][..];
    said(Matrices::default(), "no unknowns");
    said(k(unit(0)), "K is 1 × 2");
    said(
        Matrices {
            load: &[0.0],
            ..sound
        },
        "load f has length 1, expected 2",
    );
    said(
        Matrices {
            slip_bound: &[],
            ..sound
        },
        "slip bound g has length 0, expected 1",
    );
    said(t(identity), "T is 2 × 2, expected 1 × 2");
    said(
        t(SparseRef::from_rows(
            1,
            1 << 40,
            &[0, 0],
            &[0_usize; 0],
            &[],
        )),
        "T is 1 × 1099511627776, expected 1 × 2",
    );
    said(
        t(SparseRef::from_rows(
            1 << 40,
            2,
            &[0, 0],
            &[0_usize; 0],
            &[],
        )),
        "T is 1099511627776 × 2, expected 1 × 2",
    );
    said(
        k(SparseRef::from_rows(2, 2, &[0, 3], &[0, 1, 1], three)),
        "K has 2 row pointers, expected 3",
    );
    said(
        k(SparseRef::from_columns(2, 2, &[0, 1, 3], &[0, 1], three)),
        "K has 2 row indices, expected 3",
    );
    for starts in &[[0, 3, 2], [1, 2, 3], [0, 1, 2], [0, -1, 3], [0, 2, 4]] {
        said(
            k(SparseRef::from_rows(2, 2, starts, &[0, 1, 1], three)),
            "pointers must not decrease",
        );
    }
    said(
        k(SparseRef::from_rows(2, 2, &[0, 2, 3], &[0, 1, 2], three)),
        "row 2 of K has an entry with the column index 2, and there are 2 columns",
    );
    said(
        k(SparseRef::from_columns(
            2,
            2,
            &[0, 2, 3],
            &[0, -1, 1],
            three,
        )),
        "column 1 of K has an entry with the row index -1",
    );
    said(
        k(SparseRef::from_rows(2, 2, &[0, 1, 3], &[0, 0, 1], three)),
        "not symmetric: K(1, 2) = 0e0",
    );
}
