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

/// Without coordinates there is minimum degree alone.
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
