//! Overlaps in a drawing, refused with all remedies or pressed apart; planes of symmetry.

use crate::common::models::{answer, stacked};
use crate::common::solved::solve_case;
use signorini::contact::{Obstacle, Space};
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::mesh::{ElementKind, Mesh};
use signorini::model::{Model, Pair, Support, Traction};

const YOUNG: f64 = 2e11;
const DEEP: f64 = 1e-4;
/// E for a body that cannot grow sideways, ν = 0.3.
const MODULUS: f64 = YOUNG * 0.7 / (1.3 * 0.4);

fn stack(pair: Pair) -> Model {
    let mesh = stacked(1.0 - DEEP, [5, 3]);
    let sides = ["low-left", "low-right", "up-left", "up-right"].map(str::to_owned);
    Model::on(mesh)
        .material(Material::new(YOUNG, 0.3))
        .support(Support::on(sides.to_vec()).x(0.0))
        .support(Support::on("low-bottom").y(0.0))
        .support(Support::on("up-top").y(0.0))
        .contact(pair)
}

fn base() -> Pair {
    Pair::new("up-bottom", "low-top")
}

#[test]
fn an_overlap_is_refused_with_three_ways_out() {
    let error = stack(base()).build().unwrap_err().to_string();
    for way in ["adjust", "gap", "overlap = \"interference\""] {
        assert!(error.contains(way), "{way}: {error}");
    }
    let floor = Obstacle::HalfSpace {
        point: [0.0, DEEP],
        normal: [0.0, 1.0],
    };
    let mesh = rectangle([0.0, 0.0], [2.0, 1.0], [8, 4], CellShape::Quad, "body", "");
    let model = Model::on(mesh).material(Material::new(YOUNG, 0.3));
    let error = model
        .contact(Pair::obstacle("bottom", floor))
        .build()
        .unwrap_err();
    for way in ["adjust", "gap", "overlap = \"interference\""] {
        assert!(error.to_string().contains(way), "{way}: {error}");
    }
    let twice = stack(base().overlap_as_interference().gap(0.0))
        .build()
        .unwrap_err();
    assert!(twice.to_string().contains("leave out gap"), "{twice}");
}

/// Two blocks, each 1 high, that overlap by δ between fixed plates: the pressure is δ/2 of the modulus. Against a floor all of δ.
#[test]
fn overlaps_are_pressed_apart() {
    for path in [Stiffness::Cholesky, Stiffness::Pcg] {
        let found = answer(stack(base().overlap_as_interference()), 1e-9, path);
        for i in 0..found.m() {
            let part = found.pressure(i) / (0.5 * DEEP * MODULUS);
            assert!((part - 1.0).abs() < 1e-6, "{part}");
        }
        // An overlap within the touching distance counts as none.
        let flat = answer(
            stack(base().overlap_as_interference().adjust(2.0 * DEEP)),
            1e-9,
            path,
        );
        assert!(flat.solution.lambda.iter().all(|&l| l == 0.0));
        let stated = answer(stack(base().interference(DEEP)), 1e-9, path);
        for (a, b) in found.solution.lambda.iter().zip(&stated.solution.lambda) {
            assert!((a - b).abs() < 1e-6 * DEEP * MODULUS);
        }

        let floor = Obstacle::HalfSpace {
            point: [0.0, 0.0, DEEP],
            normal: [0.0, 0.0, 1.0],
        };
        let mesh = block([0.0; 3], [1.0; 3], [3, 3, 3], SolidShape::Wedge, "body", "");
        let model = Model::on(mesh)
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on("left").x(0.0))
            .support(Support::on("right").x(0.0))
            .support(Support::on("front").y(0.0))
            .support(Support::on("back").y(0.0))
            .support(Support::on("top").z(0.0))
            .contact(Pair::obstacle("bottom", floor).overlap_as_interference());
        let found = answer(model, 1e-9, path);
        for i in 0..found.m() {
            let part = found.pressure(i) / (DEEP * MODULUS);
            assert!((part - 1.0).abs() < 1e-6, "{part}");
        }
    }
}

/// Overlaps of several facets up to sides that are planes of symmetry or free: no part of them counts as something else because the
/// side is nearer than the way out.
#[test]
fn deep_overlaps_reach_to_the_sides() {
    let deep = 0.4;
    let free = YOUNG / (1.0 - 0.3 * 0.3);
    for (right, modulus) in [(Some(["low-right", "up-right"]), MODULUS), (None, free)] {
        for order in [1, 2] {
            let mut mesh = stacked(1.0 - deep, [15, 12]);
            if order == 2 {
                mesh = mesh.raised().unwrap_or_else(|error| panic!("{error}"));
            }
            let held = right.iter().flatten().chain(&["low-left", "up-left"]);
            let held: Vec<String> = held.map(|side| side.to_string()).collect();
            let model = Model::on(mesh)
                .material(Material::new(YOUNG, 0.3))
                .support(Support::on(held).x(0.0))
                .support(Support::on("low-bottom").y(0.0))
                .support(Support::on("up-top").y(0.0))
                .contact(base().overlap_as_interference());
            let found = answer(model, 1e-9, Stiffness::Cholesky);
            for i in 0..found.m() {
                let part = found.pressure(i) / (0.5 * deep * modulus);
                assert!(
                    (part - 1.0).abs() < 1e-6,
                    "order {order}, {right:?}: {part}"
                );
            }
        }
    }
}

/// A block overlaps a wider one, or a part of it, by up to several facets: its pressures are those of a stated interference of blocks
/// that touch, as K does not depend on where a block is.
#[test]
fn an_overlap_is_an_interference_of_that_size() {
    let plane = [
        (0.85, 0.0, 0.3, [5, 11]),
        (1.0, 0.1, 0.45, [14, 6]),
        (0.85, -0.15, 0.15, [10, 12]),
        (1.0, 0.2, 0.3, [13, 12]),
        (0.85, 0.2, 0.05, [9, 13]),
    ];
    for (width, at, deep, [low, up]) in plane {
        let mesh = |height: f64| {
            let one = rectangle([0.0; 2], [1.0; 2], [low; 2], CellShape::Quad, "low", "low-");
            let other = [width, 1.0];
            join(
                one,
                rectangle([at, height], other, [up; 2], CellShape::Quad, "up", "up-"),
            )
        };
        assert_alike(mesh, deep);
    }
    // The lower block is narrower at its top, by sides that lean by 9° and 14°.
    for lean in [0.15, 0.25] {
        let mesh = |height: f64| {
            let mut one = rectangle([0.0; 2], [1.0; 2], [9; 2], CellShape::Quad, "low", "low-");
            for x in &mut one.nodes {
                x[0] = 0.5 + (x[0] - 0.5) * (1.0 - 2.0 * lean * x[1]);
            }
            let other = ([-0.2, height], [1.4, 1.0]);
            join(
                one,
                rectangle(other.0, other.1, [17, 8], CellShape::Quad, "up", "up-"),
            )
        };
        assert_alike(mesh, 0.2);
    }
    // Of the last one a place in the middle is as far from two opposite sides.
    for (width, at, deep, [low, up]) in [(1.0, 0.1, 0.15, [7, 7]), (0.6, 0.1, 0.45, [6, 7])] {
        let mesh = |height: f64| {
            let shape = SolidShape::Hexahedron;
            let one = block([0.0; 3], [1.0; 3], [low; 3], shape, "low", "low-");
            let (begin, other) = ([at, 0.5 * at, height], [width, 1.0, 1.0]);
            join(one, block(begin, other, [up; 3], shape, "up", "up-"))
        };
        assert_alike(mesh, deep);
    }
}

/// The pressures of a block drawn so deep in the other one, and of an interference.
fn assert_alike<const D: usize>(mesh: impl Fn(f64) -> Mesh<D>, deep: f64)
where
    ElementKind: Space<D>,
{
    for sides in [["low-top", "up-bottom"], ["up-bottom", "low-top"]] {
        let pair = || Pair::new(sides[0], sides[1]);
        let [drawn, stated] = [
            (1.0 - deep, pair().overlap_as_interference()),
            (1.0, pair().interference(deep)),
        ]
        .map(|(height, pair)| {
            let model = Model::on(mesh(height))
                .material(Material::new(YOUNG, 0.3))
                .support(Support::on("low-bottom").fixed())
                .support(Support::on("up-top").fixed())
                .contact(pair);
            let found = answer(model, 1e-9, Stiffness::Cholesky);
            let mut pressures: Vec<f64> = (0..found.m()).map(|i| found.pressure(i)).collect();
            pressures.sort_by(f64::total_cmp);
            pressures
        });
        assert_eq!(drawn.len(), stated.len(), "{sides:?} {deep}");
        assert!(drawn.last().is_some_and(|most| *most > 0.0));
        for (a, b) in drawn.iter().zip(&stated) {
            assert!(
                (a - b).abs() < 1e-5 * deep * YOUNG,
                "{sides:?} {deep}: {a} {b}"
            );
        }
    }
}

/// A disc drawn 1e-4 larger than the cylinder inside its ring: all of the ring's nodes are inside. And if a drawing overlaps only
/// in a part, gaps elsewhere stay gaps.
#[test]
fn all_of_a_boundary_or_a_part_of_it() {
    let ring = |map: fn([f64; 2]) -> [f64; 2]| {
        let mut mesh = rectangle([0.0, 0.0], [1.0, 1.0], [4, 24], CellShape::Quad, "ring", "");
        for x in &mut mesh.nodes {
            *x = map(*x);
        }
        Model::on(mesh).material(Material::new(YOUNG, 0.3))
    };
    // A quarter of a ring from 1 to 2.
    let quarter = |[r, t]: [f64; 2]| {
        let (sin, cos) = (t * std::f64::consts::FRAC_PI_2).sin_cos();
        [(1.0 + r) * cos, (1.0 + r) * sin]
    };
    let shaft = Obstacle::Sphere {
        center: [0.0, 0.0],
        radius: 1.0 + DEEP,
    };
    let model = ring(quarter)
        .support(Support::on("bottom").y(0.0))
        .support(Support::on("top").x(0.0))
        .contact(Pair::obstacle("left", shaft).overlap_as_interference());
    let found = answer(model, 1e-9, Stiffness::Cholesky);
    // Lamé, plane strain, δ = 1e-4 at a = 1, b = 2.
    let lame = DEEP * YOUNG / (1.3 * (4.0 + 0.4) / 3.0);
    for i in 1..found.m() - 1 {
        let part = found.pressure(i) / lame;
        assert!((part - 1.0).abs() < 3e-2, "{part}");
    }

    let slope = |[x, y]: [f64; 2]| [x, y + 2e-4 * (1.0 - y) * (x - 0.5)];
    let floor = Obstacle::HalfSpace {
        point: [0.0, 0.0],
        normal: [0.0, 1.0],
    };
    let model = ring(slope)
        .support(Support::on("top").fixed())
        .contact(Pair::obstacle("bottom", floor).overlap_as_interference());
    let found = answer(model, 1e-9, Stiffness::Cholesky);
    let [low, high] = found.built.elastic.pairs[0].gap;
    assert!((low + 1e-4).abs() < 1e-12 && (high - 1e-4).abs() < 1e-12);
    let first = (0..found.m())
        .find(|&i| found.place(i)[0] == 0.0)
        .expect("a corner");
    let last = (0..found.m())
        .find(|&i| found.place(i)[0] == 1.0)
        .expect("a corner");
    assert!(found.solution.lambda[first] > 0.0 && found.solution.lambda[last] == 0.0);
}

/// One boundary of several planes is held perpendicular to each of them, like separate planes; a curved one is refused.
#[test]
fn symmetry_of_a_boundary_of_several_planes() {
    let mut mesh = block(
        [0.0; 3],
        [1.0; 3],
        [3, 2, 2],
        SolidShape::Hexahedron,
        "body",
        "",
    );
    let corner: Vec<_> = (["left", "front", "bottom"].iter())
        .flat_map(|side| mesh.boundaries[*side].clone())
        .collect();
    mesh.boundaries.insert("corner".to_owned(), corner);
    let model = |names: &[&str]| {
        Model::on(mesh.clone())
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on(names).symmetry())
            .traction(Traction::on("top").z(-1e7))
            .contact(Pair::obstacle(
                "right",
                Obstacle::HalfSpace {
                    point: [1.0 + 1e-5, 0.0, 0.0],
                    normal: [-1.0, 0.0, 0.0],
                },
            ))
    };
    let found = answer(model(&["corner"]), 1e-9, Stiffness::Cholesky);
    let expected = answer(
        model(&["left", "front", "bottom"]),
        1e-9,
        Stiffness::Cholesky,
    );
    assert_eq!(found.solution.u, expected.solution.u);
    let mut bent = mesh.clone();
    for x in &mut bent.nodes {
        x[2] += 0.3 * x[0] * x[0];
    }
    let error = (Model::on(bent).material(Material::new(YOUNG, 0.3)))
        .support(Support::on(["top"]).symmetry())
        .build()
        .unwrap_err();
    assert!(error.to_string().contains("is not plane"), "{error}");
}

/// A hollow shaft of radius 40 that is drawn 0.02 too large for its hub, a quarter in plane stress: facets of 12 and of 24 cells
/// are 0.09 and 0.02 off their arcs. Lamé's pressure, whichever side is named first; and no force where the arcs are apart.
#[test]
fn arcs_overlap_as_drawn() {
    let arc = |x: &str| format!("[\"({x})*cos(pi/2*y)\", \"({x})*sin(pi/2*y)\"]");
    let fit = |shaft: f64, cells: [usize; 2], sides: [&str; 2]| {
        solve_case(
            &format!(
                "[analysis]\nplane = \"plane_stress\"\nthickness = 10\n\
                 [[mesh.part]]\nname = \"shaft\"\nrectangle = {{ size = [1, 1], cells = [8, {}], map = {} }}\n\
                 [[mesh.part]]\nname = \"hub\"\nrectangle = {{ size = [1, 1], cells = [9, {}], map = {} }}\n\
                 [[material]]\nyoung = 2.1e5\npoisson = 0.3\n\
                 [[support]]\nboundary = [\"shaft-bottom\", \"shaft-top\", \"hub-bottom\", \"hub-top\"]\nsymmetry = true\n\
                 [[contact]]\nboundary = \"{}\"\nagainst = \"{}\"\noverlap = \"interference\"\nfriction = \"none\"\n",
                cells[0],
                arc(&format!("8 + {}*x", shaft - 8.0)),
                cells[1],
                arc("40 + 40*x"),
                sides[0],
                sides[1],
            ),
            1e-9,
        )
    };
    let lame = 0.02 / 40.0 * 2.1e5 / (1664.0 / 1536.0 + 8000.0 / 4800.0);
    for (cells, limit) in [([12, 16], 0.03), ([24, 32], 0.01), ([24, 24], 0.01)] {
        for sides in [["shaft-right", "hub-left"], ["hub-left", "shaft-right"]] {
            let solved = fit(40.02, cells, sides);
            let places = &solved.elastic().contact.places;
            let area: f64 = places.iter().map(|place| place.area).sum();
            let force: f64 = solved.solution().lambda[..places.len()].iter().sum();
            println!(
                "shaft in a hub, {cells:?} cells, {}: {:.2} for {lame:.2}",
                sides[0],
                force / area
            );
            assert!(
                (force / area / lame - 1.0).abs() < limit,
                "{}",
                force / area
            );
        }
        let apart = fit(39.99, cells, ["shaft-right", "hub-left"]);
        assert!(apart.solution().lambda.iter().all(|&l| l == 0.0));
    }
    // For an ellipse it is only known that its facets are coarse compared with the overlap.
    let text = "[[mesh.part]]\nname = \"in\"\nrectangle = { size = [1, 1], cells = [2, 12], map = [\"(0.5 + 0.501*x)*cos(pi/2*y)\", \"0.8*(0.5 + 0.501*x)*sin(pi/2*y)\"] }\n\
                [[mesh.part]]\nname = \"out\"\nrectangle = { size = [1, 1], cells = [2, 12], map = [\"(1 + x)*cos(pi/2*y)\", \"0.8*(1 + x)*sin(pi/2*y)\"] }\n\
                [[material]]\nyoung = 1\npoisson = 0.3\n[[support]]\nboundary = [\"in-bottom\", \"in-top\", \"out-bottom\", \"out-top\"]\nsymmetry = true\n\
                [[contact]]\nboundary = \"in-right\"\nagainst = \"out-left\"\noverlap = \"interference\"\n";
    let elliptic = solve_case(text, 1e-8);
    let pair = &elliptic.elastic().pairs[0];
    let told = pair
        .sagitta_text(&elliptic.elastic().units)
        .expect("a hint");
    assert!(told.contains("state the gap or the interference"), "{told}");
}

/// A coating that fills the gap of the drawing exactly, in any direction: rounding is no overlap.
#[test]
fn an_offset_may_close_the_gap() {
    for turn in 0..20 {
        let (sin, cos) = (0.17 * f64::from(turn)).sin_cos();
        let way = |[x, y]: [f64; 2]| [cos * x - sin * y, sin * x + cos * y];
        let part = |low: [f64; 2], cells: [usize; 2], name: &str| {
            rectangle(
                low,
                [1.0, 0.5],
                cells,
                CellShape::Quad,
                name,
                &format!("{name}-"),
            )
        };
        let mut mesh = join(
            part([0.0; 2], [3, 2], "low"),
            part([0.0, 0.55], [4, 2], "up"),
        );
        mesh.nodes.iter_mut().for_each(|x| *x = way(*x));
        let floor = Obstacle::HalfSpace {
            point: way([0.0, -0.05]),
            normal: way([0.0, 1.0]),
        };
        let model = Model::on(mesh)
            .material(Material::new(1e3, 0.3))
            .contact(base().offset(-0.05))
            .contact(Pair::obstacle("low-bottom", floor).offset(-0.05))
            .traction(Traction::on("up-top").pressure(1.0));
        for model in [model.clone(), model.large_displacements()] {
            let built = model
                .build()
                .unwrap_or_else(|error| panic!("{turn}: {error}"));
            let places = &built.elastic.contact.places;
            assert!(places.iter().all(|place| place.gap == 0.0), "{turn}");
        }
    }
}
