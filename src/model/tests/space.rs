//! Models and cases of solids.

use super::*;
use crate::case::CaseProblem;
use crate::mesh::structured::{SolidShape, block};

/// A box of 2 × 1 × 1 cells of a shape; its boundaries have the names of those of a case file.
fn cube(shape: SolidShape) -> Mesh<3> {
    block([0.0; 3], [2.0, 1.0, 1.5], [4, 2, 3], shape, "body", "")
}

const GROUND: Obstacle<3> = Obstacle::HalfSpace {
    point: [0.0; 3],
    normal: [0.0, 0.0, 2.0],
};

fn refused(model: Model<3>) -> String {
    match model.build() {
        Ok(_) => panic!("this was accepted"),
        Err(error) => error.to_string(),
    }
}

/// The error of a case, from its text alone or with its mesh.
fn error(text: &str) -> String {
    match Case::parse(Path::new("c.toml"), text.to_owned(), &[]) {
        Err(error) => error.to_string(),
        Ok(case) => match case.build() {
            Err(error) => error.to_string(),
            Ok(_) => panic!("accepted:\n{text}"),
        },
    }
}

#[test]
fn a_model_equals_its_case_file() {
    let model = Model::on(cube(SolidShape::Wedge))
        .material(STEEL)
        .gravity([0.0, 1.0, -9.81])
        .support(Support::on("left").fixed())
        .support(
            Support::on("right")
                .z(|x: [f64; 3]| 1e-6 * (x[0] + 2.0 * x[1] - x[2]))
                .factors([0.0, 1.0]),
        )
        .support(Support::on("back").symmetry())
        .traction(
            Traction::on("top")
                .pressure(1e4)
                .z(|x: [f64; 3]| -3.0 * x[2]),
        )
        .body_force(BodyForce::everywhere().x(5.0).z(|x: [f64; 3]| x[1]))
        .contact(Pair::obstacle("bottom", GROUND).tresca(|x: [f64; 3]| 7.0 + x[0] + x[1]))
        .steps([0.5, 1.0]);
    let text = "[mesh.box]\nsize = [2, 1, 1.5]\ncells = [4, 2, 3]\nshape = \"wedge\"\n\
        [analysis]\ngravity = [0, 1, -9.81]\n\
        [[material]]\nyoung = 2e11\npoisson = 0.3\ndensity = 7800\n\
        [[support]]\nboundary = \"left\"\nx = 0\ny = 0\nz = 0\n\
        [[support]]\nboundary = \"right\"\nz = \"1e-6 * (x + 2*y - z)\"\nfactors = [0, 1]\n\
        [[support]]\nboundary = \"back\"\nsymmetry = true\n\
        [[traction]]\nboundary = \"top\"\npressure = 1e4\nz = \"-3*z\"\n\
        [[body_force]]\nx = 5\nz = \"y\"\n\
        [[contact]]\nboundary = \"bottom\"\nfriction = { tresca = \"7 + x + y\" }\n\
        obstacle = { half_space = { point = [0, 0, 0], normal = [0, 0, 2] } }\n\
        [steps]\nfactors = [0.5, 1]\n";
    let case = Case::parse(Path::new("c.toml"), text.to_owned(), &[]);
    let case = case.unwrap_or_else(|error| panic!("{error}"));
    let there = match case.build().map(CaseProblem::space) {
        Ok(Some(build)) => build,
        Ok(None) => panic!("a box is a solid"),
        Err(error) => panic!("{error}"),
    };
    let here = model.build().unwrap_or_else(|error| panic!("{error}"));
    let (a, b) = (&here.problem, &there.problem);
    assert!(a.stiffness().triplets().eq(b.stiffness().triplets()));
    assert!(a.normal().triplets().eq(b.normal().triplets()));
    assert!(a.tangential().triplets().eq(b.tangential().triplets()));
    assert_eq!((a.load(), a.gap()), (b.load(), b.gap()));
    assert_eq!((a.slip_bound(), a.areas()), (b.slip_bound(), b.areas()));
    // The sides hold the normal motion of their nodes; the remaining nodes of the bottom have two tangents each.
    assert_eq!((a.m(), a.tangential().n_rows()), (3 * 3, 2 * 3 * 3));
    let elastic = &there.elastic;
    assert_eq!(elastic.supports, ["left", "right, z", "back"]);
    for step in 0..2 {
        let a = here.step(step).unwrap_or_else(|error| panic!("{error}"));
        let b = elastic.step(step).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!((&a.forces, &a.load.force), (&b.forces, &b.load.force));
        assert_eq!((&a.load.gap, &a.load.slide), (&b.load.gap, &b.load.slide));
    }
}

/// The resultant of all loads against integrals by hand, on every kind of element.
#[test]
fn loads_have_their_resultants() {
    for shape in [
        SolidShape::Hexahedron,
        SolidShape::Tetrahedron,
        SolidShape::Wedge,
    ] {
        let model = Model::on(cube(shape))
            .material(STEEL)
            .gravity([1.0, 0.0, -10.0])
            .support(Support::on("left").fixed())
            // On 1 × 1.5 at x = 2.
            .traction(Traction::on("right").pressure(8.0).y(|x: [f64; 3]| x[2]))
            // On 2 × 1 at z = 1.5.
            .traction(Traction::on("top").z(|x: [f64; 3]| x[0] * x[1]))
            // In the volume 3.
            .body_force(BodyForce::within("body").y(|x: [f64; 3]| 2.0 * x[0]));
        let built = model.build().unwrap_or_else(|error| panic!("{error}"));
        let total = built.step(0).map(|step| step.total_load);
        let total = total.unwrap_or_else(|error| panic!("{error}"));
        let weight = 7800.0 * 3.0;
        let expected = [
            weight - 8.0 * 1.5,
            // ∫ z = 1.5² / 2 over y; ∫ 2x = 2² · 1.5.
            1.125 + 6.0,
            // ∫∫ x y = 2 · ½.
            -10.0 * weight + 1.0,
        ];
        for (value, expected) in total.into_iter().zip(expected) {
            assert!(
                (value - expected).abs() < 1e-9 * weight,
                "{value} {expected}"
            );
        }
    }
}

/// A free block on the ground can move in three directions and rotate about one axis; above it, in all of them.
#[test]
fn a_solid_without_supports_is_found_and_needs_a_contact() {
    let model = Model::on(cube(SolidShape::Hexahedron)).material(STEEL);
    let message = refused(model.clone());
    assert!(
        message.contains("with region \"body\" (at (0.0000e0, 0.0000e0, 0.0000e0)) can move in x, y and z and rotate about every axis")
            && message.contains("no contact to hold it: add a support"),
        "{message}"
    );
    let held = model
        .contact(Pair::obstacle("bottom", GROUND))
        .support(Support::on("left").x(0.0))
        .build();
    let held = held.unwrap_or_else(|error| panic!("{error}"));
    // The left side leaves two translations and the rotation about x.
    assert_eq!(held.problem.floating_bodies().n_modes(), 3);
    let bodies = Analysis::from(&held).floating_bodies();
    assert!(
        bodies.len() == 1
            && bodies[0]
                .ends_with("can move in y and z and rotate as a whole: only contact holds it"),
        "{bodies:?}"
    );
}

#[test]
fn errors_speak_of_space() {
    let sound = || {
        Model::on(cube(SolidShape::Tetrahedron))
            .material(STEEL)
            .support(Support::on("left").fixed())
            .contact(Pair::obstacle("bottom", GROUND))
    };
    assert!(sound().build().is_ok());
    let on = |obstacle: Obstacle<3>| sound().contact(Pair::obstacle("right", obstacle));
    let cases: Vec<(Model<3>, &str)> = vec![
        (
            sound().support(Support::on("right")),
            "support 2 on \"right\": a support needs x, y, z or symmetry",
        ),
        (
            sound().support(Support::on("right").symmetry().z(1.0)),
            "leave out x, y, z, nodes and point",
        ),
        (
            sound().support(Support::on(["right", "bottom"]).symmetry().x(0.0)),
            "symmetry takes a boundary and nothing else",
        ),
        (
            sound().support(Support::at_point([9.0, 9.0, 0.5]).z(0.0)),
            "support 2 at (9, 9, 0.5): the node nearest to (9, 9, 0.5) is",
        ),
        (
            sound().support(Support::on("front").z(|x: [f64; 3]| (x[2] - 1.0).sqrt())),
            "the displacement is NaN at (",
        ),
        (
            sound().support(Support::on("bottom").z(1e-3)),
            "two supports prescribe different displacements in z at (0.000000e0, ",
        ),
        (
            sound().traction(Traction::on("top")),
            "a traction needs x, y, z, pressure or force",
        ),
        (
            sound().body_force(BodyForce::everywhere()),
            "a body force needs x, y or z",
        ),
        (
            on(Obstacle::HalfSpace {
                point: [3.0, 0.0, 0.0],
                normal: [0.0; 3],
            }),
            "contact 2 on \"right\": half_space needs a finite point and a normal",
        ),
        (
            on(Obstacle::Sphere {
                center: [3.0, 0.0, 0.0],
                radius: 0.0,
            }),
            "sphere needs a finite center and a positive radius",
        ),
        (
            on(Obstacle::Cylinder {
                point: [3.0, 0.0, 0.0],
                axis: [0.0; 3],
                radius: 1.0,
            }),
            "cylinder needs a finite point, an axis that is not zero",
        ),
        (
            sound().contact(Pair::new("right", "top")),
            "belongs to both boundaries of the contact",
        ),
        (
            sound().support(Support::on("rihgt").fixed()),
            "did you mean \"right\"?",
        ),
    ];
    for (model, expected) in cases {
        let message = refused(model);
        assert!(message.contains(expected), "{expected}\n{message}");
    }
}

/// A boundary that is not plane has no symmetry; a plane one is held only perpendicular to it, whatever its direction.
#[test]
fn symmetry_is_across_the_boundary() {
    let mut mesh = cube(SolidShape::Hexahedron);
    let with = |mesh: &Mesh<3>, name: &str| {
        Model::on(mesh.clone())
            .material(STEEL)
            .support(Support::on(name).symmetry())
            .support(Support::at_point([0.0; 3]).fixed())
            .contact(Pair::obstacle(
                "right",
                Obstacle::Sphere {
                    center: [9.0, 0.5, 0.7],
                    radius: 6.5,
                },
            ))
            .build()
    };
    for (name, axis) in [("left", 0), ("front", 1), ("back", 1), ("top", 2)] {
        let built = with(&mesh, name).unwrap_or_else(|error| panic!("{error}"));
        let held = built.elastic.held.iter().filter(|held| held.2 == 0);
        let components: Vec<usize> = held.map(|held| held.1).collect();
        assert!(!components.is_empty() && components.iter().all(|&c| c == axis));
    }
    for x in &mut mesh.nodes {
        x[2] += 0.1 * x[0];
    }
    let built = with(&mesh, "top").unwrap_or_else(|error| panic!("{error}"));
    let slope = 1.01_f64.sqrt();
    for &(node, component, _) in built.elastic.held.iter().filter(|held| held.2 == 0) {
        let frame = built.elastic.unknowns.frame(node);
        let across = frame.map(|frame| frame[component]);
        let expected = [-0.1 / slope, 0.0, 1.0 / slope];
        assert!(
            across.is_some_and(|n| (0..3).all(|c| (n[c] - expected[c]).abs() < 1e-12)),
            "{across:?}"
        );
    }
    for x in &mut mesh.nodes {
        x[2] += 0.1 * x[0] * x[0];
    }
    let message = with(&mesh, "top").err().map(|error| error.to_string());
    assert!(
        message.as_ref().is_some_and(|text| text.contains(
            "boundary \"top\" is not plane: symmetry needs a plane one; around an axis hold it by radial"
        )),
        "{message:?}"
    );
}

const SOLID: &str = "[mesh.box]\nsize = [1, 1, 1]\ncells = [2, 2, 2]\n\
    [[material]]\nyoung = 1\npoisson = 0\n\
    [[support]]\nboundary = \"top\"\nx = 0\ny = 0\nz = 0\n\
    [[traction]]\nboundary = \"left\"\nx = \"1 + x\"\n\
    [[contact]]\nboundary = \"bottom\"\n\
    obstacle = { half_space = { point = [0, 0, 0], normal = [0, 0, 1] } }\n";

#[test]
fn cases_say_which_line_does_not_fit_the_dimension() {
    let solid = Case::parse(Path::new("c.toml"), SOLID.to_owned(), &[]);
    assert!(solid.is_ok_and(|case| case.build().is_ok()));
    for (old, new, expected) in [
        (
            "half_space = { point = [0, 0, 0], normal = [0, 0, 1] }",
            "half_plane = { point = [0, 0], normal = [0, 1] }",
            "c.toml, line 17: half_plane is not an obstacle in space, where the mesh is: write half_space, sphere or \
             cylinder",
        ),
        (
            "half_space = { point = [0, 0, 0], normal = [0, 0, 1] }",
            "circle = { center = [0, 0], radius = 1 }",
            "line 17: circle is not an obstacle in space",
        ),
        (
            "normal = [0, 0, 1]",
            "normal = [0, 1]",
            "expected 3 entries, found 2",
        ),
        (
            "cells = [2, 2, 2]",
            "cells = [2, 2]",
            "expected 3 entries, found 2",
        ),
        (
            "[[material]]",
            "[analysis]\nthickness = 2\n[[material]]",
            "c.toml, line 5: thickness has no meaning for a solid",
        ),
        (
            "[[material]]",
            "[analysis]\nplane = \"plane_strain\"\n[[material]]",
            "c.toml, line 5: plane has no meaning for a solid",
        ),
        (
            "[[material]]",
            "[analysis]\ngravity = [0, -1]\n[[material]]",
            "c.toml, line 5: expected 3 entries, found 2: the mesh is in space",
        ),
        (
            "boundary = \"top\"",
            "point = [0, 0]",
            "c.toml, line 8: expected 3 entries, found 2",
        ),
        (
            "x = \"1 + x\"",
            "x = \"1 + w\"",
            "c.toml, line 14: cannot understand \"1 + w\", column 5: unknown name \"w\": only the coordinates x, y and \
             z vary",
        ),
        (
            "size = [1, 1, 1]",
            "size = [1, 0, 1]",
            "line 1: the box needs positive sizes and numbers of cells",
        ),
        (
            "cells = [2, 2, 2]",
            "cells = [2000, 2000, 2000]",
            "the box has more than 4e8 nodes",
        ),
        (
            "cells = [2, 2, 2]",
            "cells = [2, 2, 2]\nshape = \"quad\"",
            "unknown variant `quad`",
        ),
        (
            "cells = [2, 2, 2]",
            "cells = [2, 2, 2]\nmap = [\"x\", \"y\", \"(z - 0.4)^2\"]",
            "line 1: map folds the box over itself",
        ),
        (
            "cells = [2, 2, 2]",
            "cells = [2, 2, 2]\nmap = [\"x\", \"y\", \"0\"]",
            "line 1: map: element 0 near (0.000000e0, 0.000000e0, 0.000000e0) has no volume",
        ),
        (
            "cells = [2, 2, 2]",
            "cells = [2, 2, 2]\nmap = [\"x\", \"y\", \"sin(\"]",
            "line 4: cannot understand",
        ),
        (
            "[mesh.box]",
            "[mesh]\nscale = 2\n[mesh.box]",
            "give the box its size in metres",
        ),
        (
            "[mesh.box]\nsize = [1, 1, 1]\ncells = [2, 2, 2]\n",
            "[[mesh.part]]\nname = \"a\"\nbox = { size = [1, 1, 1], cells = [2, 2, 2] }\n\
             [[mesh.part]]\nname = \"b\"\nrectangle = { size = [1, 1], cells = [2, 2] }\n",
            "c.toml, line 4: the parts of a mesh must all be plane",
        ),
        (
            "[mesh.box]\nsize = [1, 1, 1]\ncells = [2, 2, 2]\n",
            "[[mesh.part]]\nname = \"a\"\nshift = [1, 2]\nbox = { size = [1, 1, 1], cells = [2, 2, 2] }\n",
            "c.toml, line 3: expected 3 entries, found 2",
        ),
        (
            "[mesh.box]\nsize = [1, 1, 1]\ncells = [2, 2, 2]\n",
            "[mesh]\n",
            "[mesh] describes no bodies: give it file, rectangle or, for a solid, box",
        ),
        (
            "\"bottom\"",
            "\"botom\"",
            "c.toml, line 15: there is no boundary \"botom\"; the mesh has",
        ),
        (
            "poisson = 0",
            "poisson = 0.5",
            "c.toml, line 4: poisson is 0.5",
        ),
    ] {
        assert!(SOLID.contains(old), "{old}");
        let message = error(&SOLID.replacen(old, new, 1));
        assert!(message.contains(expected), "{expected}\n{message}");
    }
}

#[test]
fn the_plane_has_no_z() {
    let plane = "[mesh.rectangle]\nsize = [1, 1]\ncells = [2, 2]\n\
        [[material]]\nyoung = 1\npoisson = 0\n\
        [[support]]\nboundary = \"top\"\nx = 0\ny = 0\n\
        [[traction]]\nboundary = \"left\"\nx = 1\n\
        [[contact]]\nboundary = \"bottom\"\n\
        obstacle = { half_plane = { point = [0, 0], normal = [0, 1] } }\n";
    for (old, new, expected) in [
        (
            "x = 1\n",
            "x = \"2 * z\"\n",
            "c.toml, line 13: cannot understand \"2 * z\", column 5: unknown name \"z\": only the coordinates x and y vary",
        ),
        (
            "y = 0\n[[traction]]",
            "y = 0\nz = 0\n[[traction]]",
            "c.toml, line 11: z has no meaning here: the mesh is in the plane",
        ),
        (
            "half_plane = { point = [0, 0], normal = [0, 1] }",
            "sphere = { center = [0, 0, -1], radius = 1 }",
            "c.toml, line 16: sphere is not an obstacle in the plane, where the mesh is: write half_plane or circle",
        ),
        (
            "half_plane = { point = [0, 0], normal = [0, 1] }",
            "cylinder = { point = [0, 0, -1], axis = [1, 0, 0], radius = 1 }",
            "cylinder is not an obstacle in the plane",
        ),
        (
            "[[material]]",
            "[analysis]\ngravity = [0, 0, -1]\n[[material]]",
            "c.toml, line 5: expected 2 entries, found 3: the mesh is in the plane",
        ),
    ] {
        assert!(plane.contains(old), "{old}");
        let message = error(&plane.replacen(old, new, 1));
        assert!(message.contains(expected), "{expected}\n{message}");
    }
}

/// The dimension of a file is known only after reading: entries that are wrong in both dimensions are reported before.
#[test]
fn a_mesh_file_chooses_the_dimension() {
    let of_file = |mesh: &str, figure: &str| {
        format!(
            "[mesh]\nfile = \"tests/meshes/{mesh}\"\n[[material]]\nyoung = 1\npoisson = 0\n\
             [[body_force]]\nx = \"{figure}\"\n"
        )
    };
    let message = |mesh: &str, figure: &str| error(&of_file(mesh, figure));
    assert!(message("s41a.msh", "z + w").contains("line 7: cannot understand \"z + w\", column 5"));
    assert!(message("b41a.msh", "z + w").contains("line 7: cannot understand \"z + w\", column 1"));
    assert!(message("b41a.msh", "z").contains("only the coordinates x and y vary"));
    // The solid has nothing else to complain of than its supports.
    assert!(
        message("s41a.msh", "z").contains("add a support"),
        "{}",
        message("s41a.msh", "z")
    );
    assert!(message("none.msh", "z").contains("none.msh"));
}

#[test]
fn settings_and_units_are_checked_with_their_line() {
    let algebraic = "[algebraic]\nstiffness = \"K\"\nload = \"f\"\nnormal = \"N\"\ntangential = \"T\"\ngap = \"d\"\n\
        slip_bound = \"g\"\n";
    let units = format!("{algebraic}[units]\nlength = \"a long name of a unit\"\n");
    let message = error(&units);
    assert!(message.contains("c.toml, line 8: length = "), "{message}");
    for (line, field) in [
        ("tolerance = 1", "tolerance must lie between 0 and 1"),
        ("r_tol = 0", "r_tol must lie between 0 and 1"),
        ("c_fact = -1", "c_fact must lie between 0 and 1"),
        ("beta = 0", "beta must be positive"),
    ] {
        let message = error(&format!("{SOLID}[solver]\nmethod = \"exact\"\n{line}\n"));
        assert!(
            message.contains(&format!("c.toml, line 20: {field}")),
            "{message}"
        );
    }
}
