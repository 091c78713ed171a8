//! Tests of the factor in space.

use super::*;
use crate::mesh::structured::SolidShape;
use crate::problem::ContactProblem;
use crate::reference::CASE_C;

fn case_c(q: usize, shape: SolidShape) -> ContactProblem<3> {
    (CASE_C.problem(q, shape)).unwrap_or_else(|error| panic!("{error}"))
}

fn plan(problem: &ContactProblem<3>, with_coordinates: bool) -> Plan {
    let points = problem.coordinates().filter(|_| with_coordinates);
    let touched = problem.touched();
    Plan::new(problem.stiffness(), points, &touched, Vec::new())
        .unwrap_or_else(|error| panic!("{error}"))
}

/// Without coordinates only minimum degree is possible.
#[test]
fn dissection_saves_work_in_space() {
    for (q, shape, part) in [
        (12, SolidShape::Hexahedron, 0.6),
        (12, SolidShape::Tetrahedron, 0.8),
    ] {
        let problem = case_c(q, shape);
        let (plan, other) = (plan(&problem, true), plan(&problem, false));
        let operations = [&plan, &other].map(Plan::operations);
        println!("{shape:?} {q}: {operations:?}");
        assert!(operations[0] < part * operations[1], "{operations:?}");
        assert!(plan.bytes() < other.bytes());
    }
}

#[test]
fn threads_make_the_same_factor() {
    let problem = case_c(8, SolidShape::Hexahedron);
    let threads = rayon::current_num_threads().min(4);
    let [one, more] = [Par::Seq, Par::rayon(threads)].map(|threads| {
        Factor::on_threads(problem.stiffness(), plan(&problem, true), threads)
            .unwrap_or_else(|error| panic!("{error}"))
    });
    let bits =
        |factor: &Factor| -> Vec<u64> { factor.values.iter().map(|v| v.to_bits()).collect() };
    assert!(bits(&one) == bits(&more));
}

/// K with every stored value times a factor of its position, symmetric and definite as before. A block that couples
/// nodes i and j, both away from held ones, gets Q(i) K Q(j) with diagonal Q.
fn stretched<const D: usize>(k: &BlockCsr<D>) -> BlockCsr<D> {
    let q = |i: usize| 1.0 + 0.3 * ((i * 7) % 5) as f64;
    BlockCsr::from_triplets(
        k.n_rows(),
        k.n_rows(),
        k.triplets().map(|(i, j, v)| (i, j, q(i) * v * q(j))),
    )
}

/// A factor made in the order of another K gives the same result as its own: in the plane, and in space with and without trailing
/// blocks.
#[test]
fn another_k_in_the_same_order() {
    fn check<const D: usize>(k: &BlockCsr<D>, points: Option<&[[f64; D]]>, touched: &[bool]) {
        let other = stretched(k);
        let plan =
            |k| Plan::new(k, points, touched, Vec::new()).unwrap_or_else(|error| panic!("{error}"));
        let made =
            |k| Factor::new(k, plan(k)).unwrap_or_else(|error: FactorError| panic!("{error}"));
        let mut factor = made(k);
        factor
            .refactor(&other)
            .unwrap_or_else(|error| panic!("{error}"));
        let fresh = made(&other);
        // The same order and pattern, to the last bit.
        assert!(factor.values == fresh.values);
        let f: Vec<f64> = (0..k.n_rows())
            .map(|i| ((i * 3) % 7) as f64 - 3.0)
            .collect();
        let u = factor.finish(&mut factor.reduce(&f));
        let mut rest = f.clone();
        other.for_rows(&u, &mut rest, |rest, _, sum| {
            rest.iter_mut().zip(sum).for_each(|(r, v)| *r -= v);
            0.0
        });
        assert!(crate::sparse::norm(&rest) < 1e-11 * crate::sparse::norm(&f));
        // And back.
        factor.refactor(k).unwrap_or_else(|error| panic!("{error}"));
        assert!(factor.values == made(k).values);
    }
    let problem = case_c(6, SolidShape::Hexahedron);
    let all = vec![true; problem.touched().len()];
    for touched in [&problem.touched(), &all] {
        check(problem.stiffness(), problem.coordinates(), touched);
    }
    let mesh = crate::reference::mesh(crate::reference::Geometry::TwoBodies, 2);
    let plane = crate::reference::problem(
        crate::reference::Geometry::TwoBodies,
        &mesh,
        &crate::reference::CASE_B,
    )
    .unwrap_or_else(|error| panic!("{error}"));
    check(plane.stiffness(), plane.coordinates(), &plane.touched());
}

#[test]
fn another_pattern_is_refused() {
    let springs = |n: usize, ties: &[(usize, usize)]| {
        let diagonal = (0..n).map(|i| (i, i, 4.0));
        let ties = ties.iter().flat_map(|&(i, j)| [(i, j, -1.0), (j, i, -1.0)]);
        BlockCsr::<1>::from_triplets(n, n, diagonal.chain(ties))
    };
    let chain = [(0, 1), (1, 2), (3, 4), (4, 5)];
    let made = |ends: &[usize]| {
        let k = springs(6, &chain);
        let touched: Vec<bool> = (0..6).map(|i| ends.contains(&i)).collect();
        let plan =
            Plan::new(&k, None, &touched, Vec::new()).unwrap_or_else(|error| panic!("{error}"));
        Factor::new(&k, plan).unwrap_or_else(|error| panic!("{error}"))
    };
    let mut factor = made(&[2]);
    let before = factor.values.clone();
    let error = factor
        .refactor(&springs(7, &chain))
        .map_err(|e| e.to_string());
    assert!(error.is_err_and(|why| why.contains("7 rows") && why.contains("made for 6")));
    let far = [&chain[..], &[(0, 5)]].concat();
    let error = factor
        .refactor(&springs(6, &far))
        .map_err(|e| e.to_string());
    assert!(error.is_err_and(|why| why.contains("unknowns 6 and 1")));
    assert_eq!(factor.values, before);
    // A value within rounding is not an entry.
    let diagonal = (0..6).map(|i| (i, i, 4.0));
    let ties = (chain.iter()).flat_map(|&(i, j)| [(i, j, -1.0), (j, i, -1.0)]);
    let rounding = [(0, 5, 1e-16), (5, 0, 1e-16)];
    let rounded = BlockCsr::<1>::from_triplets(6, 6, diagonal.chain(ties).chain(rounding));
    factor
        .refactor(&rounded)
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(factor.values, before);
    // Two bodies that were apart, each with a trailing block: whether the pattern has a place for their tie by chance or not.
    let tied = [&chain[..], &[(2, 5)]].concat();
    let refused = made(&[2, 5]).refactor(&springs(6, &tied));
    assert!(matches!(refused, Err(FactorError::OtherPattern { .. })));
    // Fewer entries are not another pattern.
    let mut factor = made(&[2]);
    factor
        .refactor(&springs(6, &chain[1..]))
        .unwrap_or_else(|error| panic!("{error}"));
    let u = factor.finish(&mut factor.reduce(&[4.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
    assert_eq!(u, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
}
