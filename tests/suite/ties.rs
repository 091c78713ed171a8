//! Ties: boundaries that hold together although their meshes do not match.

use crate::common::distance;
use crate::common::models::{Answer, answer, stacked};
use crate::common::or_panic::OrPanic as _;
use crate::common::solved::{built, case};
use signorini::contact::{Obstacle, Space};
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::mesh::{ElementKind, Mesh};
use signorini::model::{Analysis, Model, Pair, Support, Traction};
use signorini::output::{ContactFields, NodeStatus};
use signorini::problem::{ContactData, ContactProblem, ProblemError};
use signorini::sparse::{BlockCsr, Csr};

const PATHS: [Stiffness; 2] = [Stiffness::Cholesky, Stiffness::Pcg];
const YOUNG: f64 = 2e11;

type Gradient = [[f64; 3]; 3];

/// The displacement along c at x of a gradient.
fn field<const D: usize>(
    g: Gradient,
) -> impl Fn([f64; D], usize) -> f64 + Copy + Send + Sync + 'static {
    move |x, c| (0..D).map(|k| g[c][k] * x[k]).sum()
}

/// Bodies whose outer sides move by a gradient G: a linear field everywhere, in compression, tension and shear. It is the answer
/// of all elements, and non-matching nodes of the tie must not change it.
fn patch<const D: usize>(mesh: &Mesh<D>, tie: &Pair<D>, hold: impl Fn(Gradient) -> Support<D>)
where
    ElementKind: Space<D>,
{
    let gradients = [
        [
            [1e-3, 2e-4, 1e-4],
            [-3e-4, 5e-4, 2e-4],
            [4e-4, -1e-4, -7e-4],
        ],
        [[0.0, 1e-3, -2e-4], [0.0, 0.0, 3e-4], [5e-4, 0.0, 1e-3]],
    ];
    for g in gradients {
        for path in PATHS {
            let field = field(g);
            let model = Model::on(mesh.clone())
                .material(Material::new(YOUNG, 0.3))
                .support(hold(g))
                .tie(tie.clone());
            let found = answer(model, 1e-11, path);
            let (mut off, mut size) = (0.0_f64, 0.0_f64);
            for (x, u) in mesh.nodes.iter().zip(found.displacement()) {
                for c in 0..D {
                    off = off.max((u[c] - field(*x, c)).abs());
                    size = size.max(field(*x, c).abs());
                }
            }
            assert!(off < 1e-9 * size, "{g:?}: {off:e} {size:e}");
            // Uniform stresses, tension as well as pressure.
            let pressures: Vec<f64> = (0..found.m()).map(|i| found.pressure(i)).collect();
            let largest = pressures.iter().fold(0.0_f64, |most, p| most.max(p.abs()));
            let inner = (0..found.m()).filter(|&i| found.solution.lambda[i] != 0.0);
            let inner: Vec<f64> = inner.map(|i| pressures[i]).collect();
            assert!(!inner.is_empty() || largest == 0.0);
        }
    }
}

fn named(part: &str, sides: &[&str]) -> Vec<String> {
    sides.iter().map(|side| format!("{part}-{side}")).collect()
}

#[test]
fn patch_in_the_plane() {
    for (low, up) in [(7, 5), (3, 8)] {
        let mesh = join(
            rectangle(
                [0.0, 0.0],
                [2.0, 1.0],
                [low, 3],
                CellShape::Quad,
                "low",
                "low-",
            ),
            rectangle(
                [0.0, 1.0],
                [2.0, 1.0],
                [up, 4],
                CellShape::Triangle,
                "up",
                "up-",
            ),
        );
        let outer = [
            named("low", &["left", "right", "bottom"]),
            named("up", &["left", "right", "top"]),
        ]
        .concat();
        for mesh in [mesh.clone(), mesh.raised().or_panic()] {
            patch(&mesh, &Pair::tied("up-bottom", "low-top"), |g| {
                let field = field::<2>(g);
                (Support::on(outer.clone()).x(move |x| field(x, 0))).y(move |x| field(x, 1))
            });
        }
    }
}

#[test]
fn patch_in_space() {
    use SolidShape::{Hexahedron, Tetrahedron};
    for (low, up) in [(Hexahedron, Hexahedron), (Hexahedron, Tetrahedron)] {
        let mesh = join(
            block([0.0; 3], [1.0; 3], [3, 4, 2], low, "low", "low-"),
            block([0.0, 0.0, 1.0], [1.0; 3], [4, 3, 3], up, "up", "up-"),
        );
        let sides = ["left", "right", "front", "back"];
        let mut outer = [named("low", &sides), named("up", &sides)].concat();
        outer.extend(["low-bottom".to_owned(), "up-top".to_owned()]);
        for mesh in [mesh.clone(), mesh.raised().or_panic()] {
            patch(&mesh, &Pair::tied("up-bottom", "low-top"), |g| {
                let field = field::<3>(g);
                (Support::on(outer.clone()).x(move |x| field(x, 0)))
                    .y(move |x| field(x, 1))
                    .z(move |x| field(x, 2))
            });
        }
    }
}

/// Two halves with matching nodes, tied, equal the whole: to the last digits, for a body held by the tie alone, pulled and
/// bent.
#[test]
fn halves_with_nodes_that_meet_are_the_whole() {
    let load = |model: Model, top: &str| {
        model
            .material(Material::new(YOUNG, 0.3))
            .traction(Traction::on(top).y(|x: [f64; 2]| 1e7 * (x[0] - 0.3)).x(4e6))
    };
    let whole = rectangle([0.0, 0.0], [2.0, 2.0], [8, 8], CellShape::Quad, "body", "");
    let whole = load(Model::on(whole), "top").support(Support::on("bottom").fixed());
    let parts = stacked(1.0, [8, 4]);
    let parts = load(Model::on(parts), "up-top")
        .support(Support::on("low-bottom").fixed())
        .tie(Pair::tied("up-bottom", "low-top"));
    let resultants = |found: &Answer<2>| {
        let built = &found.built;
        let [mut force, mut moment] = [[0.0; 2], [0.0; 2]];
        for i in 0..found.m() {
            let f = found.contact_force(i);
            let [x, _] = built.elastic.contact.places[i].place;
            (0..2).for_each(|c| force[c] += f[c]);
            moment[0] += x * f[1];
        }
        (force, moment[0])
    };
    for path in PATHS {
        let expected = answer(whole.clone(), 1e-11, path);
        let found = answer(parts.clone(), 1e-11, path);
        let nodes = |answer: &Answer<2>| answer.built.elastic.mesh.nodes.clone();
        let (here, there) = (nodes(&found), nodes(&expected));
        let of_whole = expected.displacement();
        let mut size = 0.0_f64;
        for (x, u) in here.iter().zip(found.displacement()) {
            let at = (0..there.len())
                .find(|&k| (0..2).all(|c| (there[k][c] - x[c]).abs() < 1e-9))
                .expect("the node of the whole");
            size = size.max(of_whole[at][1].abs());
            let apart = (0..2)
                .map(|c| (u[c] - of_whole[at][c]).abs())
                .fold(0.0, f64::max);
            assert!(apart < 1e-9 * 1e-3, "{x:?}: {apart:e}");
        }
        assert!(size > 1e-5);
        // The tie carries the load: 2 (1e7 · 0.7) up, 8e6 along; and its moment.
        let (force, moment) = resultants(&found);
        assert!(
            (force[1] + 1.4e7).abs() < 1e-2 && (force[0] + 8e6).abs() < 1e-2,
            "{force:?}"
        );
        // ∫ x p dx = 1e7 (8/3 − 0.6), and the shear turns by its height.
        let expected = 1e7 * (8.0 / 3.0 - 0.6) - 8e6;
        assert!((moment + expected).abs() < 1.0, "{moment} {expected}");
        let (data, solution) = (&found.data, &found.solution);
        let fields = ContactFields::new(&found.built.problem, &found.built.elastic, data, solution);
        assert!((0..found.m()).all(|i| fields.status[i] == NodeStatus::Tied));
        assert!(fields.pressure.iter().any(|&p| p < -1e6));
    }
}

/// The same where supports hold nodes of both sides at an end of the tie, across it or along it, of either order.
#[test]
fn halves_with_held_nodes_are_the_whole() {
    fn of<const D: usize>([low, up, whole]: [Mesh<D>; 3], hold: impl Fn(Support<D>) -> Support<D>)
    where
        ElementKind: Space<D>,
    {
        let sides = ["low-left", "up-left", "all-left"];
        let tops = ["up-top", "all-top", "low-top"];
        let bottoms = ["low-bottom", "all-bottom", "up-bottom"];
        let parts = join(low, up);
        for raised in [false, true] {
            let solve = |mesh: &Mesh<D>, is_whole: bool| {
                let mesh = match raised {
                    true => mesh.clone().raised().or_panic(),
                    false => mesh.clone(),
                };
                let held: &[&str] = if is_whole { &sides[2..] } else { &sides[..2] };
                let [top, bottom] = [tops, bottoms].map(|all| all[usize::from(is_whole)]);
                let mut push = [0.0; D];
                (push[0], push[D - 1]) = (300.0, -1000.0);
                let model = Model::on(mesh)
                    .material(Material::new(1e5, 0.3))
                    .support(hold(Support::on(held)))
                    .support(Support::on(bottom).fixed())
                    .traction(Traction::on(top).force(push));
                let model = match is_whole {
                    true => model,
                    false => model.tie(Pair::tied(tops[2], bottoms[2])),
                };
                let found = answer(model, 1e-11, Stiffness::Cholesky);
                (found.built.elastic.mesh.nodes.clone(), found.displacement())
            };
            let (nodes, expected) = solve(&whole, true);
            let size = expected
                .as_flattened()
                .iter()
                .fold(0.0_f64, |most, u| most.max(u.abs()));
            let (here, found) = solve(&parts, false);
            let mut worst = 0.0_f64;
            for (x, u) in here.iter().zip(found) {
                let same = |y: &[f64; D]| (0..D).all(|c| (x[c] - y[c]).abs() < 1e-9);
                let at = nodes.iter().position(same).expect("the node of the whole");
                (0..D).for_each(|c| worst = worst.max((u[c] - expected[at][c]).abs()));
            }
            println!("{D} dimensions, raised {raised}: {:.1e}", worst / size);
            assert!(worst < 1e-8 * size, "{D}, {raised}: {:e}", worst / size);
        }
    }
    let holds: [fn(Support) -> Support; 3] = [|s| s.x(0.0), |s| s.y(0.0), |s| s.x(0.0).y(0.0)];
    for shape in [CellShape::Quad, CellShape::Triangle] {
        let part = |y: f64, height: f64, rows: usize, name: &str| {
            let prefix = format!("{name}-");
            rectangle([0.0, y], [2.0, height], [4, rows], shape, name, &prefix)
        };
        let all = || {
            [
                part(-1.0, 1.0, 2, "low"),
                part(0.0, 1.0, 2, "up"),
                part(-1.0, 2.0, 4, "all"),
            ]
        };
        for hold in holds {
            of(all(), hold);
        }
    }
    let holds: [fn(Support<3>) -> Support<3>; 3] =
        [|s| s.x(0.0), |s| s.z(0.0), |s| s.x(0.0).y(0.0).z(0.0)];
    for shape in [SolidShape::Hexahedron, SolidShape::Tetrahedron] {
        let part = |z: f64, height: f64, rows: usize, name: &str| {
            let prefix = format!("{name}-");
            block(
                [0.0, 0.0, z],
                [2.0, 1.0, height],
                [2, 2, rows],
                shape,
                name,
                &prefix,
            )
        };
        let all = || {
            [
                part(-1.0, 1.0, 1, "low"),
                part(0.0, 1.0, 1, "up"),
                part(-1.0, 2.0, 2, "all"),
            ]
        };
        for hold in holds {
            of(all(), hold);
        }
    }
}

/// A tied foot on a floor with friction, in load steps: contact and ties in one problem, on both paths the same.
#[test]
fn beside_contact_with_friction() {
    let mesh = join(
        block(
            [0.0; 3],
            [1.0, 1.0, 0.4],
            [4, 4, 2],
            SolidShape::Hexahedron,
            "foot",
            "foot-",
        ),
        block(
            [0.2, 0.2, 0.4],
            [0.6, 0.6, 0.8],
            [3, 3, 3],
            SolidShape::Hexahedron,
            "leg",
            "leg-",
        ),
    );
    let floor = Obstacle::HalfSpace {
        point: [0.0; 3],
        normal: [0.0, 0.0, 1.0],
    };
    let model = Model::on(mesh)
        .material(Material::new(YOUNG, 0.3))
        .traction(Traction::on("leg-top").z(-2e7))
        .traction(Traction::on("leg-top").x(3e6).factors([0.0, 1.0, -1.0]))
        .steps([1.0, 1.0, 1.0])
        .contact(Pair::obstacle("foot-bottom", floor).coulomb(0.3))
        .tie(Pair::tied("leg-bottom", "foot-top"));
    let found = PATHS.map(|path| answer(model.clone(), 1e-8, path));
    assert!(distance(&found[0].solution.u, &found[1].solution.u) < 1e-5);
    for found in &found {
        let ties = (0..found.m()).filter(|&i| found.built.problem.is_tied(i));
        let carried: [f64; 3] = ties.fold([0.0; 3], |sum, i| {
            let force = found.contact_force(i);
            std::array::from_fn(|c| sum[c] + force[c])
        });
        // 0.36 of area.
        let expected = [3e6 * 0.36, 0.0, 2e7 * 0.36];
        for c in 0..3 {
            assert!(
                (carried[c] - expected[c]).abs() < 1e-4 * 7.2e6,
                "{carried:?}"
            );
        }
    }
}

#[test]
fn impossible_ties_are_refused() {
    let model = |apart: f64| {
        let mesh = stacked(1.0 + apart, [5, 4]);
        Model::on(mesh)
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on("low-bottom").fixed())
            .traction(Traction::on("up-top").y(1e6))
    };
    let tie = || Pair::tied("up-bottom", "low-top");
    // A quarter of the longest facet, 0.1.
    let built = model(0.09).tie(tie()).build().or_panic();
    assert_eq!(built.elastic.pairs[0].gap, [0.0, 0.0]);
    let error = model(0.11).tie(tie()).build().unwrap_err().to_string();
    assert!(
        error.starts_with("tie 1 on \"up-bottom\"") && error.contains("apart"),
        "{error}"
    );
    assert!(model(0.11).tie(tie().adjust(0.12)).build().is_ok());
    assert!(model(0.0).contact(tie()).build().is_err());
    assert!(
        model(0.0)
            .tie(Pair::new("up-bottom", "low-top"))
            .build()
            .is_err()
    );
    let error = model(0.0)
        .support(Support::on("low-top").x(0.0).y(0.0))
        .support(Support::on("up-bottom").x(0.0).y(1e-3))
        .tie(tie())
        .build()
        .unwrap_err();
    assert!(error.to_string().contains("sides of the tie"), "{error}");
}

/// If the sides of a tie are too far apart, its own key is named; tied places are reported as such, and so is the tie
/// that holds a body.
#[test]
fn ties_are_reported_as_ties() {
    let case_with = |gap: f64, more: &str| {
        case(&format!(
            "[[mesh.part]]\nname = \"a\"\nrectangle = {{ size = [1, 1], cells = [2, 2] }}\n\
             [[mesh.part]]\nname = \"b\"\nrectangle = {{ origin = [{}, 0], size = [1, 1], cells = [2, 2] }}\n\
             [[material]]\nregion = [\"a\", \"b\"]\nyoung = 1\npoisson = 0\n[[support]]\nboundary = \"a-left\"\nx = 0\ny = 0\n\
             [[tie]]\nboundary = \"a-right\"\nagainst = \"b-left\"\n{more}",
            1.0 + gap
        ))
    };
    let error = case_with(0.8, "")
        .build()
        .expect_err("they are apart")
        .to_string();
    assert!(
        error.contains("state adjust") && !error.contains("search_distance"),
        "{error}"
    );
    for (gap, more) in [(0.8, "adjust = 0.9\n"), (0.0, "")] {
        let built = built(&case_with(gap, more));
        let told = Analysis::from(&built).floating_bodies();
        assert!(
            told[0].ends_with("as a whole: only ties hold it"),
            "{told:?}"
        );
        let solution = built.solve(&Default::default()).or_panic().remove(0);
        let sizes = solution.sets.sizes_in(&built.problem);
        assert_eq!((sizes.tied, sizes.stick, sizes.total()), (3, 0, 3));
    }
}

/// Where a support holds one side of a tie, the other one follows it, whichever is named first: as one body does.
#[test]
fn sides_follow_where_one_of_them_is_held() {
    let part = |x: f64, [wide, high]: [usize; 2], name: &str| {
        let prefix = format!("{name}-");
        let size = [if wide == high { 1.0 } else { 2.0 }, 1.0];
        let mut mesh = rectangle([x, 0.0], size, [wide, high], CellShape::Quad, name, &prefix);
        let is_held = |x: &[f64; 2]| x[0] < 1.0 + 1e-9 && x[1] < 1e-9;
        let held = (0..).zip(&mesh.nodes).filter(|(_, x)| is_held(x));
        let held: Vec<u32> = held.map(|(node, _)| node).collect();
        if name == "a" {
            mesh.node_sets.insert("held".to_owned(), held);
        }
        mesh
    };
    let tip = |mesh: Mesh, load: &str, tie: Option<Pair>| {
        let mut model = Model::on(mesh)
            .material(Material::new(1e5, 0.3))
            .support(Support::at_nodes("held").fixed())
            .traction(Traction::on(load).x(100.0).y(-200.0));
        if let Some(tie) = tie {
            model = model.tie(tie);
        }
        let found = answer(model, 1e-10, Stiffness::Cholesky);
        let nodes = found.built.elastic.mesh.nodes.clone();
        let at_tip = |(x, u): (&[f64; 2], [f64; 2])| (x[0] + x[1] > 2.999).then_some(u[1]);
        let mut tips = nodes.iter().zip(found.displacement()).filter_map(at_tip);
        tips.next().expect("there is a tip")
    };
    for cells in [1, 2, 4] {
        let expected = tip(part(0.0, [2 * cells, cells], "a"), "a-right", None);
        for [first, other] in [["a-right", "b-left"], ["b-left", "a-right"]] {
            let both = join(part(0.0, [cells; 2], "a"), part(1.0, [cells; 2], "b"));
            let found = tip(both, "b-right", Some(Pair::tied(first, other)));
            assert!(
                (found / expected - 1.0).abs() < 1e-8,
                "{cells} {first}: {found} {expected}"
            );
        }
    }
}

/// Bodies that are tied at a seam move on a floor with friction as one body does, load step by load step, although the
/// forces of the floor on either side of the seam and those of the tie are not unique.
fn on_a_floor<const D: usize>(bodies: [Mesh<D>; 2], hold: impl Fn(Support<D>) -> Support<D>)
where
    ElementKind: Space<D>,
{
    let up = std::array::from_fn(|c| f64::from(u8::from(c == D - 1)));
    let floor = Obstacle::HalfSpace {
        point: [0.0; D],
        normal: up,
    };
    for path in PATHS {
        let [one, two] = [0, 1].map(|tied: usize| {
            let mesh = bodies[tied].clone();
            let of = |side: &str| match tied {
                0 => named("one", &[side]),
                _ => [named("a", &[side]), named("b", &[side])].concat(),
            };
            let mut model = Model::on(mesh)
                .material(Material::new(1e5, 0.3))
                .steps([1.0, 2.0, 3.0, 1.0])
                .support(hold(Support::on(of("top"))))
                .contact(Pair::obstacle(of("bottom"), floor).coulomb(0.2));
            if tied > 0 {
                model = model.tie(Pair::tied("a-right", "b-left"));
            }
            answer(model, 1e-9, path)
        });
        for (step, (one, two)) in one.reports().iter().zip(two.reports()).enumerate() {
            let [one, two] = [one, &two].map(|report| &report.contacts[0].force);
            assert!(
                one.iter().zip(two).all(|(a, b)| (a - b).abs() < 1e-3),
                "step {step}: {one:?} {two:?}"
            );
        }
        let (there, moved) = (&two.built.elastic.mesh.nodes, two.displacement());
        let size = 0.03;
        for (x, u) in one.built.elastic.mesh.nodes.iter().zip(one.displacement()) {
            let same = |at: &[f64; D]| (0..D).all(|c| (at[c] - x[c]).abs() < 1e-9);
            for i in (0..there.len()).filter(|&i| same(&there[i])) {
                for c in 0..D {
                    assert!(
                        (u[c] - moved[i][c]).abs() < 1e-6 * size,
                        "{x:?}: {u:?} {:?}",
                        moved[i]
                    );
                }
            }
        }
    }
}

#[test]
fn seams_on_a_floor_with_friction() {
    let part = |name: &str, from: f64, wide: usize| {
        let (size, prefix) = ([wide as f64 / 3.0, 1.0], format!("{name}-"));
        rectangle([from, 0.0], size, [wide, 3], CellShape::Quad, name, &prefix)
    };
    let bodies = [
        part("one", 0.0, 6),
        join(part("a", 0.0, 3), part("b", 1.0, 3)),
    ];
    on_a_floor(bodies, |top| top.x(1e-4).y(-1e-2));
    let part = |name: &str, from: f64, wide: usize| {
        let (size, prefix) = ([wide as f64 / 3.0, 1.0, 1.0], format!("{name}-"));
        let cells = [wide, 2, 2];
        block(
            [from, 0.0, 0.0],
            size,
            cells,
            SolidShape::Hexahedron,
            name,
            &prefix,
        )
    };
    let bodies = [
        part("one", 0.0, 6),
        join(part("a", 0.0, 3), part("b", 1.0, 3)),
    ];
    on_a_floor(bodies, |top| top.x(1e-4).y(-3e-4).z(-1e-2));
}

/// With matrices a tie has to hold to something, whichever of the two is stated first.
#[test]
fn a_tied_node_needs_a_finite_gap() {
    let problem = |gap: f64| {
        let row = |column: usize| Csr::from_triplets(1, 2, [(0, column, 1.0)]);
        ContactProblem::<2>::new(ContactData {
            stiffness: BlockCsr::from_triplets(2, 2, [(0, 0, 2.0), (1, 1, 2.0)]),
            load: vec![1.0, 0.0],
            normal: row(0),
            tangential: row(1),
            gap: vec![gap],
            slip_bound: vec![0.0],
            coordinates: None,
        })
        .or_panic()
    };
    let far = problem(f64::INFINITY);
    let error = far
        .clone()
        .with_ties(&[true])
        .expect_err("it has no obstacle");
    assert_eq!(error, ProblemError::TiedToNothing { row: 1 });
    let message = error.from_zero().to_string();
    assert!(
        message.contains("entry 0 of the gap d is infinite"),
        "{message}"
    );
    let tied = problem(0.0).with_ties(&[true]).or_panic();
    let error = tied
        .with_gap(vec![f64::INFINITY])
        .expect_err("it has no obstacle");
    assert_eq!(error, ProblemError::TiedToNothing { row: 1 });
    far.with_ties(&[false]).or_panic();
}
