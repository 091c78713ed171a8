//! Solids whose answers are known from other problems: plane ones, extruded; the same body rotated; other units; and
//! states of constant stress.

use crate::common::models::{Answer, answer};
use crate::common::space::{UPRIGHT, Vector, close, dot, rotation, times};
use crate::common::{Random, distance};
use signorini::contact::{Obstacle, Space};
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::mesh::{ElementKind, Mesh};
use signorini::model::{Model, Pair, Support, Traction};
use signorini::reference::{CASE_C, MATERIAL};
use std::f64::consts::{FRAC_PI_4, PI};

/// The strip of the plane that the solids below extrude: crooked, clamped on the left, pressed down except at its end,
/// which is pulled and lifted, with Tresca friction on its floor.
fn strip<const D: usize>(
    mut mesh: Mesh<D>,
    [bottom, top]: [&str; 2],
    obstacle: Obstacle<D>,
    sides: Option<[&str; 2]>,
) -> Model<D>
where
    ElementKind: Space<D>,
{
    for node in &mut mesh.nodes {
        let (x, y) = (node[0], node[1]);
        node[0] += 0.02 * (2.0 * x).sin() * (6.0 * y).sin();
        node[1] += 0.03 * (5.0 * x).sin() * y * (1.0 - y);
    }
    let top = Traction::on(top)
        .x(1e6)
        .y(|x: [f64; D]| -2e7 * (1.0 - x[0] / 1.5).max(0.0) + 6e6 * (x[0] - 2.0).max(0.0));
    let mut model = Model::on(mesh)
        .material(MATERIAL)
        .support(Support::on("left").x(0.0).y(0.0))
        .traction(top)
        .traction(Traction::on("right").x(4e6))
        .contact(Pair::obstacle(bottom, obstacle).tresca(|x: [f64; D]| 3e6 + 2e5 * x[0]));
    if let Some(sides) = sides {
        model = model.support(Support::on(sides).symmetry());
    }
    model
}

/// The displacement, the forces for a unit of width and the stresses of a strip and of its extrusion by `width` are the
/// same: the discretisation's identity, whatever the size of its elements.
fn extruded_is_plane(shapes: (CellShape, SolidShape), floors: (Obstacle, Obstacle<3>)) {
    let (size, cells, width) = ([3.0, 1.0], [36, 12], 0.1);
    let plane = rectangle([0.0; 2], size, cells, shapes.0, "body", "");
    let plane = strip(plane, ["bottom", "top"], floors.0, None);
    let plane = answer(plane, 1e-11, Stiffness::Cholesky);
    let ([a, b], [nx, ny]) = (size, cells);
    let (size, cells) = ([a, b, width], [nx, ny, 1]);
    let solid = block([0.0; 3], size, cells, shapes.1, "body", "");
    let sides = Some(["bottom", "top"]);
    let solid = strip(solid, ["front", "back"], floors.1, sides);
    let solid = answer(solid, 1e-11, Stiffness::Cholesky);

    let nodes = plane.built.elastic.mesh.nodes.len();
    let (u, v) = (plane.displacement(), solid.displacement());
    let (s, t) = (plane.stresses(), solid.stresses());
    let largest = u.iter().flatten().fold(0.0, |a: f64, v| a.max(v.abs()));
    for node in 0..2 * nodes {
        let [x, y] = u[node % nodes];
        close(v[node], [x, y, 0.0], 1e-8 * largest);
        let (s, t) = (s[node % nodes], t[node]);
        let expected = [s.xx, s.yy, s.zz, s.xy, 0.0, 0.0];
        close([t.xx, t.yy, t.zz, t.xy, t.yz, t.zx], expected, 1.0);
    }
    // A node of the plane is one on either face, with half of the width.
    let m = plane.m();
    assert_eq!(solid.m(), 2 * m);
    let (mut stick, mut slip, mut separated) = (0, 0, 0);
    for i in 0..2 * m {
        let [x, y, _] = solid.place(i);
        let off = |k: usize| (plane.place(k)[0] - x).abs() + (plane.place(k)[1] - y).abs();
        let there = (0..m).find(|&k| off(k) < 1e-9);
        let k = there.unwrap_or_else(|| panic!("({x}, {y}) is none of the plane's places"));
        let [x, y] = plane.contact_force(k);
        let expected = [x, y, 0.0].map(|f| 0.5 * width * f);
        close(solid.contact_force(i), expected, 1e-2);
        close([solid.pressure(i)], [plane.pressure(k)], 1.0);
        let sets = (&solid.solution.sets, &plane.solution.sets);
        assert_eq!(sets.0.is_separated(i), sets.1.is_separated(k));
        assert_eq!(sets.0.slips(i), sets.1.slips(k));
        separated += usize::from(sets.0.is_separated(i));
        slip += usize::from(sets.0.slips(i));
        stick += usize::from(!sets.0.slips(i));
    }
    assert!(
        stick > 4 && slip > 10 && separated > 10,
        "{stick} {slip} {separated}"
    );
    let apart = v
        .iter()
        .zip(u.iter().cycle())
        .map(|(v, u)| (v[0] - u[0]).hypot(v[1] - u[1]));
    println!(
        "{shapes:?}: u off by {:.1e}, {stick} multipliers stick, {slip} slip, {separated} are separated; {} and {} products",
        apart.fold(0.0, f64::max) / largest,
        plane.solution.n_a(),
        solid.solution.n_a(),
    );
}

#[test]
fn extruded_plane_strain_is_the_planes_answer() {
    let floors = || {
        (
            Obstacle::HalfSpace {
                point: [0.0; 2],
                normal: [0.02, 1.0],
            },
            Obstacle::HalfSpace {
                point: [0.0; 3],
                normal: [0.02, 1.0, 0.0],
            },
        )
    };
    extruded_is_plane((CellShape::Quad, SolidShape::Hexahedron), floors());
    extruded_is_plane((CellShape::Triangle, SolidShape::Wedge), floors());
}

/// A roller across the body: line contact is the plane's with a disc.
#[test]
fn a_roller_across_a_strip_is_the_planes_disc() {
    let (x, r) = (1.2, 400.0);
    let floors = (
        Obstacle::Sphere {
            center: [x, -r],
            radius: r,
        },
        Obstacle::Cylinder {
            point: [x, -r, 7.0],
            axis: [0.0, 0.0, -2.0],
            radius: r,
        },
    );
    extruded_is_plane((CellShape::Quad, SolidShape::Hexahedron), floors);
    extruded_is_plane((CellShape::Triangle, SolidShape::Wedge), floors);
}

/// Reference case C as a model, turned by a rotation (its columns), lengths and forces in other units.
fn case_c(q: usize, rotation: [Vector; 3], length: f64, force: f64) -> Model<3> {
    let cells = CASE_C.size.map(|edge| (edge * q as f64) as usize);
    let mut mesh = block(
        [0.0; 3],
        CASE_C.size,
        cells,
        SolidShape::Hexahedron,
        "body",
        "",
    );
    for node in &mut mesh.nodes {
        *node = times(&rotation, node.map(|x| x * length));
    }
    let stress = force / (length * length);
    let back = move |x: Vector| rotation.map(|column| dot(column, x) / length);
    let top = move |c: usize| move |x: Vector| times(&rotation, (CASE_C.top)(back(x)))[c] * stress;
    let end = times(&rotation, CASE_C.end).map(|t| t * stress);
    let material = Material {
        young: MATERIAL.young * stress,
        ..MATERIAL
    };
    let floor = Obstacle::HalfSpace {
        point: [0.0; 3],
        normal: rotation[2],
    };
    Model::on(mesh)
        .material(material)
        .support(Support::on("left").fixed())
        .traction(Traction::on("top").x(top(0)).y(top(1)).z(top(2)))
        .traction(Traction::on("right").x(end[0]).y(end[1]).z(end[2]))
        .contact(Pair::obstacle("bottom", floor).tresca(CASE_C.tresca * stress))
}

/// Outer steps and products with A.
fn counts(answer: &Answer<3>) -> (usize, usize) {
    (answer.solution.iter(), answer.solution.n_a())
}

#[test]
fn turning_the_problem_turns_the_answer() {
    let upright = answer(case_c(4, UPRIGHT, 1.0, 1.0), 1e-8, Stiffness::Cholesky);
    let sizes = upright.solution.sets.sizes(|_| true);
    assert!(sizes.separated > 5 && sizes.stick > 5, "{sizes:?}");
    let u: Vec<Vector> = upright.displacement();
    for (axis, angle) in [
        ([1.0, 2.0, -0.5], 0.7),
        ([0.0, 0.0, 1.0], 0.25),
        ([-1.0, 0.3, 0.2], 2.9),
        ([0.3, 1.0, 0.1], -1.6),
    ] {
        let turn = rotation(axis, angle);
        let turned = answer(case_c(4, turn, 1.0, 1.0), 1e-8, Stiffness::Cholesky);
        let expected: Vec<f64> = u.iter().flat_map(|&u| times(&turn, u)).collect();
        let off = distance(turned.displacement().as_flattened(), &expected);
        assert!(off < 1e-6, "{off:e}");
        let m = upright.m();
        assert_eq!(turned.m(), m);
        let off_normal = distance(&turned.solution.lambda[..m], &upright.solution.lambda[..m]);
        assert!(off_normal < 1e-5, "{off_normal:e}");
        let friction = |answer: &Answer<3>, turn: &[Vector; 3]| -> Vec<f64> {
            (0..m)
                .flat_map(|i| times(turn, answer.friction(i)))
                .collect()
        };
        let off_friction = distance(&friction(&turned, &UPRIGHT), &friction(&upright, &turn));
        assert!(off_friction < 1e-5, "{off_friction:e}");
        // Other tangents: each node is in the same sets, wherever it slips to.
        let sets = |answer: &Answer<3>, i| {
            let sets = &answer.solution.sets;
            (sets.is_separated(i), sets.slips(i))
        };
        assert!((0..m).all(|i| sets(&turned, i) == sets(&upright, i)));
        println!(
            "turned by {angle} about {axis:?}: u off by {off:.1e}, λν by {off_normal:.1e}, friction by {off_friction:.1e}; \
             steps, products {:?}, upright {:?}",
            counts(&turned),
            counts(&upright)
        );
        let steps = counts(&turned).0.abs_diff(counts(&upright).0);
        assert!(steps <= 2, "{:?} {:?}", counts(&turned), counts(&upright));
    }
}

/// Nodes of a contact boundary that supports hold in one, two or all of three directions, which turn with the bodies: the
/// same places, pressures and displacements.
#[test]
fn directions_of_supports_turn_with_the_bodies() {
    let solve = |turn: &[Vector; 3], ways: &str, path| {
        let box_of = |origin, size, cells, name: &str| {
            let prefix = format!("{name}-");
            block(origin, size, cells, SolidShape::Hexahedron, name, &prefix)
        };
        let mut mesh = join(
            box_of([0.0; 3], [1.5, 1.0, 1.0], [2, 2, 1], "a"),
            box_of([-0.2, -0.1, -0.6], [1.9, 1.2, 0.6], [3, 2, 1], "b"),
        );
        mesh.nodes.iter_mut().for_each(|x| *x = times(turn, *x));
        // The end of the upper body, and one of its sides in one of these directions.
        let held = |name: &str, ways: &str| {
            let held = Support::on(name).directed(*turn);
            ways.chars().fold(held, |held, way| match way {
                'x' => held.x(0.0),
                'y' => held.y(0.0),
                _ => held.z(0.0),
            })
        };
        let model = Model::on(mesh)
            .material(Material::new(1e4, 0.3))
            .support(Support::on("b-bottom").fixed())
            .support(held("a-left", ways))
            .traction(Traction::on("a-top").pressure(10.0))
            .contact(Pair::new("a-bottom", "b-top").coulomb(0.2));
        let model = match &ways[1..] {
            "" => model,
            others => model.support(held("a-front", others)),
        };
        answer(model, 1e-10, path)
    };
    for ways in ["xy", "x", "xz", "yz", "xyz"] {
        let upright = solve(&UPRIGHT, ways, Stiffness::Cholesky);
        let (m, u) = (upright.m(), upright.displacement());
        let z = [0.0, 0.0, 1.0];
        for (axis, angle) in [
            (z, 0.3),
            (z, 0.775),
            (z, 1.2),
            (z, FRAC_PI_4),
            ([1.0, 2.0, -0.5], 0.7),
        ] {
            let turn = rotation(axis, angle);
            let turned = solve(&turn, ways, Stiffness::Cholesky);
            assert_eq!(turned.m(), m, "{ways}, {axis:?}, {angle}");
            let expected: Vec<f64> = u.iter().flat_map(|&u| times(&turn, u)).collect();
            let off = distance(turned.displacement().as_flattened(), &expected);
            let pressures = [&upright, &turned]
                .map(|answer| (0..m).map(|i| answer.pressure(i)).collect::<Vec<f64>>());
            let off_pressure = distance(&pressures[1], &pressures[0]);
            println!("{ways}, {axis:?}, {angle}: {off:.1e} {off_pressure:.1e}");
            assert!(
                off < 1e-7 && off_pressure < 1e-6,
                "{off:e} {off_pressure:e}"
            );
        }
    }
}

/// A half of a ring pressed on another one, with friction, which planes of symmetry hold at their ends and below: the same
/// whichever way the axis points, and on both sides of the middle.
#[test]
fn rings_with_friction_turn_with_their_axis() {
    let ring = |name: &str, low: f64, high: f64| {
        let (cells, prefix) = ([1, 8, 1], format!("{name}-"));
        let shape = SolidShape::Hexahedron;
        let mut mesh = block([0.0; 3], [1.0, 1.0, 0.5], cells, shape, name, &prefix);
        for [x, y, _] in &mut mesh.nodes {
            let (r, (sin, cos)) = (low + (high - low) * *x, (PI * *y).sin_cos());
            (*x, *y) = (r * cos, r * sin);
        }
        mesh
    };
    let upright = join(ring("in", 0.5, 1.0), ring("out", 1.0, 1.6));
    let planes = ["front", "back", "bottom"];
    let planes = ["in", "out"].map(|name| planes.map(|plane| format!("{name}-{plane}")));
    let solve = |turn: &[Vector; 3], slave: &str, master: &str| {
        let mut mesh = upright.clone();
        mesh.nodes.iter_mut().for_each(|x| *x = times(turn, *x));
        let model = Model::on(mesh)
            .material(Material::new(1e3, 0.3))
            .support(Support::on("in-left").fixed())
            .support(Support::on(planes.concat()).symmetry())
            .contact(Pair::new(slave, master).interference(0.02).coulomb(0.3));
        answer(model, 1e-10, Stiffness::Cholesky)
    };
    let [x, y, z] = UPRIGHT;
    for (slave, master) in [("out-left", "in-right"), ("in-right", "out-left")] {
        let base = solve(&[y, z, x], slave, master);
        let u: Vec<Vector> = (base.displacement().iter())
            .map(|u| [u[1], u[2], u[0]])
            .collect();
        // Nodes go along the radius, then around, in two layers of each body.
        let across = |i: usize| i / 18 * 18 + (8 - i % 18 / 2) * 2 + i % 2;
        let mirrored = |i: usize| {
            let [x, y, z] = u[across(i)];
            [-x, y, z]
        };
        let mirrored: Vec<f64> = (0..u.len()).flat_map(mirrored).collect();
        let off = distance(&mirrored, u.as_flattened());
        assert!(off < 1e-7, "{slave}: {off:e}");
        for turn in [UPRIGHT, [z, x, y], rotation([1.0, 2.0, -0.5], 0.7)] {
            let turned = solve(&turn, slave, master);
            let expected: Vec<f64> = u.iter().flat_map(|&u| times(&turn, u)).collect();
            let off = distance(turned.displacement().as_flattened(), &expected);
            println!("{turn:?}, {slave}: {off:.1e}");
            assert!(off < 1e-7, "{turn:?}, {slave}: {off:e}");
        }
    }
}

/// Metres or nanometres, newtons or micronewtons: the same steps, products and sets.
#[test]
fn units_do_not_matter_in_space() {
    for stiffness in [Stiffness::Cholesky, Stiffness::Pcg] {
        let usual = answer(case_c(4, UPRIGHT, 1.0, 1.0), 1e-6, stiffness);
        println!("{stiffness:?}: {:?}", counts(&usual));
        for (length, force) in [
            (1e3, 1.0),
            (1e9, 1e-6),
            (1e-9, 1e6),
            (1e9, 1e6),
            (1e-9, 1e-6),
        ] {
            let other = answer(case_c(4, UPRIGHT, length, force), 1e-6, stiffness);
            assert_eq!(counts(&other), counts(&usual), "{length:e} {force:e}");
            assert_eq!(other.solution.sets.differences(&usual.solution.sets), 0);
            let scaled: Vec<f64> = usual.solution.u.iter().map(|u| u * length).collect();
            let off = distance(&other.solution.u, &scaled);
            assert!(off < 1e-6, "{off:e}");
            let scaled: Vec<f64> = usual.solution.lambda.iter().map(|l| l * force).collect();
            let off = distance(&other.solution.lambda, &scaled);
            assert!(off < 1e-4, "{off:e}");
        }
    }
}

/// A block of distorted elements: nodes on its faces stay there.
fn distorted(shape: SolidShape) -> Mesh<3> {
    let (size, cells) = ([2.0, 1.5, 1.0], [5, 4, 3]);
    let mut mesh = block([0.0; 3], size, cells, shape, "body", "");
    let mut random = Random(0x5eed_0f0b);
    for node in &mut mesh.nodes {
        for c in 0..3 {
            let edge = size[c] / cells[c] as f64;
            let shift = random.between(-0.2, 0.2) * edge;
            if node[c] > 0.0 && node[c] < size[c] {
                node[c] += shift;
            }
        }
    }
    mesh
}

const RUBBER: Material = Material::new(3000.0, 0.4);

/// Constant strain: u = (s + γx z, γy z, −ε z), and its stress on a floor that the block is upright on.
struct Patch {
    shear: [f64; 2],
    slide: [f64; 2],
    strain: f64,
}

impl Patch {
    fn displacement(&self, x: Vector) -> Vector {
        [
            self.slide[0] + self.shear[0] * x[2],
            self.slide[1] + self.shear[1] * x[2],
            -self.strain * x[2],
        ]
    }

    /// The columns of the stress.
    fn stress(&self) -> [Vector; 3] {
        let (e, nu) = (RUBBER.young, RUBBER.poisson);
        let mu = 0.5 * e / (1.0 + nu);
        let lambda = 2.0 * mu * nu / (1.0 - 2.0 * nu);
        let [zx, yz] = self.shear.map(|shear| mu * shear);
        let across = -lambda * self.strain;
        [
            [across, 0.0, zx],
            [0.0, across, yz],
            [zx, yz, across - 2.0 * mu * self.strain],
        ]
    }

    /// Compares an answer on a rotated floor with it: displacement, stress, and the tractions of the contact nodes
    /// without a support, given by `whole`.
    fn compare(&self, answer: &Answer<3>, turn: &[Vector; 3], whole: impl Fn(Vector) -> bool) {
        let back = |x: Vector| turn.map(|column| dot(column, x));
        let nodes = &answer.built.elastic.mesh.nodes;
        for (u, &x) in answer.displacement().iter().zip(nodes) {
            close(back(*u), self.displacement(back(x)), 1e-12);
        }
        let columns = self.stress();
        for s in answer.stresses() {
            let found = [[s.xx, s.xy, s.zx], [s.xy, s.yy, s.yz], [s.zx, s.yz, s.zz]];
            for j in 0..3 {
                // Column j on the axes of the floor.
                close(back(times(&found, turn[j])), columns[j], 1e-9);
            }
        }
        let mut compared = 0;
        for i in 0..answer.m() {
            if whole(back(answer.place(i))) {
                compared += 1;
                let traction = answer.contact_force(i).map(|f| f / answer.area(i));
                // The traction of the floor on the outward normal −z.
                close(back(traction), columns[2].map(|s| -s), 1e-9);
                close([answer.pressure(i)], [-columns[2][2]], 1e-9);
            }
        }
        assert!(compared >= 12, "{compared}");
    }
}

/// Pressed and sheared by tractions all around and held only by contact and friction below its bound, on floors of any
/// direction: everything is constant, to rounding.
#[test]
fn patch_test_with_friction_that_sticks() {
    let patch = Patch {
        shear: [1e-3, -2e-3],
        slide: [0.0; 2],
        strain: 4e-3,
    };
    let [x, y, z] = patch.stress();
    let bound = 1.3 * x[2].hypot(y[2]);
    for shape in [
        SolidShape::Hexahedron,
        SolidShape::Tetrahedron,
        SolidShape::Wedge,
    ] {
        for turn in [UPRIGHT, rotation([1.0, -0.4, 2.0], 1.1)] {
            let mut mesh = distorted(shape);
            for node in &mut mesh.nodes {
                *node = times(&turn, *node);
            }
            let floor = Obstacle::HalfSpace {
                point: [0.0; 3],
                normal: turn[2],
            };
            let mut model = Model::on(mesh)
                .material(RUBBER)
                .contact(Pair::obstacle("bottom", floor).tresca(bound));
            for (sides, column) in [(["left", "right"], x), (["front", "back"], y)] {
                for (side, sign) in sides.into_iter().zip([-1.0, 1.0]) {
                    let [x, y, z] = times(&turn, column.map(|s| sign * s));
                    model = model.traction(Traction::on(side).x(x).y(y).z(z));
                }
            }
            let [tx, ty, tz] = times(&turn, z);
            model = model.traction(Traction::on("top").x(tx).y(ty).z(tz));
            let answer = answer(model, 1e-12, Stiffness::Cholesky);
            assert_eq!(answer.built.problem.floating_bodies().n_modes(), 6);
            let sets = answer.solution.sets.sizes(|_| true);
            assert_eq!((sets.stick, sets.separated), (answer.m(), 0), "{sets:?}");
            patch.compare(&answer, &turn, |_| true);
        }
    }
}

const SLIPPING: Patch = Patch {
    shear: [3e-3, 1e-3],
    slide: [6e-3, 2e-3],
    strain: 4e-3,
};

/// Driven along the floor: every node slips, and friction is the bound against the motion, whatever its direction.
#[test]
fn patch_test_with_friction_that_slips() {
    let [x, y, _] = SLIPPING.stress();
    let bound = x[2].hypot(y[2]);
    for shape in [
        SolidShape::Hexahedron,
        SolidShape::Tetrahedron,
        SolidShape::Wedge,
    ] {
        let floor = Obstacle::HalfSpace {
            point: [0.0; 3],
            normal: [0.0, 0.0, 1.0],
        };
        let along = |c: usize| move |x: Vector| SLIPPING.displacement(x)[c];
        let held = ["left", "right", "front", "back", "top"];
        let model = Model::on(distorted(shape))
            .material(RUBBER)
            .support(Support::on(held).x(along(0)).y(along(1)).z(along(2)))
            .contact(Pair::obstacle("bottom", floor).tresca(bound));
        let answer = answer(model, 1e-13, Stiffness::Cholesky);
        let inside = |[x, y, _]: Vector| x > 0.0 && x < 2.0 && y > 0.0 && y < 1.5;
        let slipping = (0..answer.m()).filter(|&i| answer.solution.sets.slips(i));
        assert_eq!(slipping.filter(|&i| inside(answer.place(i))).count(), 12);
        SLIPPING.compare(&answer, &UPRIGHT, inside);
    }
}
