//! Bodies that ties hold together turn and bend as one.

use super::{End, solved, solved_in_space};
use signorini::elasticity::Material;
use signorini::engine::Stiffness::{self, Cholesky, Pcg};
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::mesh::{ElementKind, Mesh, Topology};
use signorini::model::{Model, Pair, Support, Traction};
use signorini::ssnm::Status;
use std::collections::HashMap;

const LENGTH: f64 = 10.0;
const THICKNESS: f64 = 0.5;

/// The displacements by places at rest; nodes of two bodies at one place count once.
fn by_place<const D: usize>(mesh: &Mesh<D>, end: &End<D>) -> HashMap<[i64; D], [f64; D]>
where
    ElementKind: Topology<D>,
{
    let key = |x: &[f64; D]| x.map(|x| (x * 1e6).round() as i64);
    (mesh
        .nodes
        .iter()
        .map(key)
        .zip(end.displacement.iter().copied()))
    .collect()
}

fn compare<const D: usize>(
    [whole, tied]: [&Mesh<D>; 2],
    [of_whole, of_tied]: [&[End<D>]; 2],
    what: &str,
) where
    ElementKind: Topology<D>,
{
    assert_eq!(of_whole.len(), of_tied.len(), "{what}");
    for (one, other) in of_whole.iter().zip(of_tied) {
        assert_eq!([one.status, other.status], [Status::Converged; 2], "{what}");
        assert!(
            other.iterations <= one.iterations + 1,
            "{what}: {} iterations in place of {}",
            other.iterations,
            one.iterations
        );
        let (one, other) = (by_place(whole, one), by_place(tied, other));
        let size = one
            .values()
            .flatten()
            .fold(0.0, |most: f64, u| most.max(u.abs()));
        assert_eq!(one.len(), other.len());
        for (place, u) in &one {
            for (u, v) in u.iter().zip(&other[place]) {
                assert!((u - v).abs() < 1e-6 * size, "{what} at {place:?}: {u} {v}");
            }
        }
    }
}

/// Loads that turn the tip by more than 60°.
const FACTORS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];
const FORCE: f64 = 0.01 / THICKNESS;

fn material() -> Material {
    Material::new(12.0 / THICKNESS.powi(3), 0.3)
}

/// A cantilever of three pieces whose meshes match; only the first one is held.
#[test]
fn pieces_of_a_cantilever_bend_as_one() {
    let piece = |from: usize, to: usize, name: &str| {
        let low = [from as f64 * LENGTH / 12.0, 0.0];
        let size = [(to - from) as f64 * LENGTH / 12.0, THICKNESS];
        let mesh = rectangle(low, size, [to - from, 2], CellShape::Quad, name, name);
        mesh.raised().unwrap_or_else(|error| panic!("{error}"))
    };
    let whole = piece(0, 12, "c-");
    let tied = join(
        join(piece(0, 5, "a-"), piece(5, 8, "b-")),
        piece(8, 12, "c-"),
    );
    let model = |mesh: &Mesh, held: &str| {
        Model::on(mesh.clone())
            .large_displacements()
            .material(material())
            .support(Support::on(held).fixed())
            .traction(Traction::on("c-right").y(FORCE))
            .steps(FACTORS)
    };
    for stiffness in [Cholesky, Pcg] {
        let of_tied = |ties: [[&str; 2]; 2]| {
            let [one, other] = ties.map(|[side, against]| Pair::tied(side, against));
            solved(model(&tied, "a-left").tie(one).tie(other), 1e-9, stiffness)
        };
        let of_whole = solved(model(&whole, "c-left"), 1e-9, stiffness);
        for ties in [
            [["a-right", "b-left"], ["b-right", "c-left"]],
            [["c-left", "b-right"], ["b-left", "a-right"]],
        ] {
            compare(
                [&whole, &tied],
                [&of_whole, &of_tied(ties)],
                &format!("{stiffness:?}"),
            );
        }
    }
}

/// The same in space, with two pieces.
#[test]
fn pieces_of_a_block_bend_as_one() {
    let piece = |from: usize, to: usize, name: &str| {
        let low = [from as f64 * LENGTH / 8.0, 0.0, 0.0];
        let size = [(to - from) as f64 * LENGTH / 8.0, 0.6, THICKNESS];
        let mesh = block(
            low,
            size,
            [to - from, 1, 1],
            SolidShape::Hexahedron,
            name,
            name,
        );
        mesh.raised().unwrap_or_else(|error| panic!("{error}"))
    };
    let (whole, tied) = (
        piece(0, 8, "b-"),
        join(piece(0, 3, "a-"), piece(3, 8, "b-")),
    );
    let model = |mesh: &Mesh<3>, held: &str| {
        Model::on(mesh.clone())
            .large_displacements()
            .material(material())
            .support(Support::on(held).fixed())
            .traction(Traction::on("b-right").z(FORCE).y(0.3 * FORCE))
            .steps(FACTORS)
    };
    let of = |stiffness: Stiffness| {
        let tie = Pair::tied("b-left", "a-right");
        let of_whole = solved_in_space(model(&whole, "b-left"), 1e-9, stiffness);
        let of_tied = solved_in_space(model(&tied, "a-left").tie(tie), 1e-9, stiffness);
        compare(
            [&whole, &tied],
            [&of_whole, &of_tied],
            &format!("{stiffness:?}"),
        );
    };
    of(Cholesky);
    of(Pcg);
}

/// A cantilever of two tied halves whose meshes do not match takes as few iterations as one whose meshes match.
#[test]
fn halves_that_do_not_match_bend_as_fast() {
    let half = |from: f64, cells: [usize; 2], name: &str| {
        rectangle(
            [from, 0.0],
            [0.5 * LENGTH, THICKNESS],
            cells,
            CellShape::Quad,
            name,
            name,
        )
        .raised()
        .unwrap_or_else(|error| panic!("{error}"))
    };
    let model = |cells: usize| {
        let mesh = join(
            half(0.0, [8, 2], "a-"),
            half(0.5 * LENGTH, [9, cells], "b-"),
        );
        Model::on(mesh)
            .large_displacements()
            .material(material())
            .support(Support::on("a-left").fixed())
            .traction(Traction::on("b-right").y(FORCE))
            .tie(Pair::tied("b-left", "a-right"))
            .steps(FACTORS)
    };
    let matched = solved(model(2), 1e-9, Cholesky);
    let other = solved(model(3), 1e-9, Cholesky);
    let tip = |ends: &[End<2>]| {
        ends[3]
            .displacement
            .iter()
            .fold(0.0, |most: f64, u| most.max(u[1]))
    };
    for (one, other) in matched.iter().zip(&other) {
        assert_eq!([one.status, other.status], [Status::Converged; 2]);
        assert!(
            other.iterations <= one.iterations + 1,
            "{} {}",
            one.iterations,
            other.iterations
        );
    }
    assert!(
        (tip(&other) / tip(&matched) - 1.0).abs() < 1e-3,
        "{} {}",
        tip(&other),
        tip(&matched)
    );
}
