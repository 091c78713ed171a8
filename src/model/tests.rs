mod around;
mod space;

use super::*;
use crate::case::Case;
use crate::contact::Obstacle;
use crate::mesh::structured::{CellShape, join, rectangle};
use std::path::Path;

const STEEL: Material = Material {
    density: 7800.0,
    ..Material::new(2e11, 0.3)
};
const RUBBER: Material = Material::new(5e6, 0.4);

/// Two blocks on each other, the lower one fixed, the upper one 2 wide.
fn blocks() -> Mesh {
    join(
        rectangle(
            [0.0, 0.0],
            [3.0, 1.0],
            [9, 3],
            CellShape::Quad,
            "low",
            "low-",
        ),
        rectangle(
            [0.5, 1.0],
            [2.0, 1.0],
            [7, 4],
            CellShape::Triangle,
            "up",
            "up-",
        ),
    )
}

fn case(text: &str) -> Built {
    let case = Case::parse(Path::new("c.toml"), text.to_owned(), &[]);
    let case = case.unwrap_or_else(|error| panic!("{error}"));
    let made = case.build().unwrap_or_else(|error| panic!("{error}"));
    made.plane().expect("an elastic case in the plane")
}

fn built(model: Model) -> Built {
    model.build().unwrap_or_else(|error| panic!("{error}"))
}

fn refused(model: Model) -> String {
    match model.build() {
        Ok(_) => panic!("this was accepted"),
        Err(error) => error.to_string(),
    }
}

/// K, f, N, T, d, g, μ and the loads of all steps, to the last bit.
#[track_caller]
fn same(model: Model, text: &str) {
    let (build, built) = (case(text), built(model));
    let (a, b) = (&built.problem, &build.problem);
    assert!(a.stiffness().triplets().eq(b.stiffness().triplets()));
    assert!(a.normal().triplets().eq(b.normal().triplets()));
    assert!(a.tangential().triplets().eq(b.tangential().triplets()));
    assert_eq!(a.load(), b.load());
    assert_eq!(a.gap(), b.gap());
    assert_eq!(a.slip_bound(), b.slip_bound());
    assert_eq!(a.friction_coefficient(), b.friction_coefficient());
    assert_eq!(a.areas(), b.areas());
    assert_eq!(a.n_free(), b.n_free());
    let bodies = [&built, &build].map(|built| Analysis::from(built).floating_bodies());
    assert_eq!(bodies[0], bodies[1]);
    let (here, there) = (&built.elastic, &build.elastic);
    assert_eq!((&here.held, &here.supports), (&there.held, &there.supports));
    assert_eq!(here.n_steps(), there.n_steps());
    for step in 0..there.n_steps() {
        let a = built.step(step).unwrap_or_else(|error| panic!("{error}"));
        let b = there.step(step).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!((a.factor, &a.forces), (b.factor, &b.forces));
        assert_eq!((&a.load.force, &a.load.gap), (&b.load.force, &b.load.gap));
        assert_eq!(
            (&a.load.slide, a.load.acting),
            (&b.load.slide, b.load.acting)
        );
    }
    assert!(built.step(there.n_steps()).is_err());
}

const BLOCKS: &str = "[[mesh.part]]\nname = \"low\"\nrectangle = { size = [3, 1], cells = [9, 3] }\n\
    [[mesh.part]]\nname = \"up\"\n\
    rectangle = { origin = [0.5, 1], size = [2, 1], cells = [7, 4], shape = \"triangle\" }\n";

#[test]
fn a_model_equals_its_case_file() {
    let model = Model::on(blocks())
        .material_in("low", STEEL)
        .material_in("up", RUBBER)
        .plane(Plane::PlaneStress)
        .thickness(0.5)
        .gravity([0.0, -9.81])
        .support(Support::on(["low-bottom", "low-left"]).fixed())
        .support(
            Support::on("up-top")
                .x(|x: [f64; 2]| 1e-3 * x[0])
                .factors([0.0, 1.0]),
        )
        .traction(Traction::on("up-top").pressure(1e4).x(2.0))
        .traction(
            Traction::on("up-right")
                .y(|x: [f64; 2]| -3.0 * x[1])
                .factors([1.0, -1.0]),
        )
        .body_force(BodyForce::within("up").x(5.0).y(|x: [f64; 2]| x[0]))
        .contact(
            Pair::new("up-bottom", "low-top")
                .coulomb(|x: [f64; 2]| 0.1 + 0.05 * x[0])
                .adjust(1e-5)
                .search_distance(0.25),
        )
        .contact(
            Pair::obstacle(
                "up-left",
                Obstacle::HalfSpace {
                    point: [0.25, 0.0],
                    normal: [2.0, 0.0],
                },
            )
            .tresca(7.0),
        )
        .steps([0.5, 1.0]);
    same(
        model,
        &format!(
            "{BLOCKS}[analysis]\nplane = \"plane_stress\"\nthickness = 0.5\ngravity = [0, -9.81]\n\
             [[material]]\nregion = \"low\"\nyoung = 2e11\npoisson = 0.3\ndensity = 7800\n\
             [[material]]\nregion = \"up\"\nyoung = 5e6\npoisson = 0.4\n\
             [[support]]\nboundary = [\"low-bottom\", \"low-left\"]\nx = 0\ny = 0\n\
             [[support]]\nboundary = \"up-top\"\nx = \"1e-3 * x\"\nfactors = [0, 1]\n\
             [[traction]]\nboundary = \"up-top\"\npressure = 1e4\nx = 2\n\
             [[traction]]\nboundary = \"up-right\"\ny = \"-3 * y\"\nfactors = [1, -1]\n\
             [[body_force]]\nregion = \"up\"\nx = 5\ny = \"x\"\n\
             [[contact]]\nboundary = \"up-bottom\"\nagainst = \"low-top\"\n\
             friction = {{ coulomb = \"0.1 + 0.05 * x\" }}\nadjust = 1e-5\nsearch_distance = 0.25\n\
             [[contact]]\nboundary = \"up-left\"\nfriction = {{ tresca = 7 }}\n\
             obstacle = {{ half_plane = {{ point = [0.25, 0], normal = [2, 0] }} }}\n\
             [steps]\nfactors = [0.5, 1]\n"
        ),
    );
    let model = Model::on(blocks())
        .material(STEEL)
        .support(Support::on("low-bottom").symmetry())
        .support(Support::at_point([0.0, 0.0]).x(0.0))
        .traction(Traction::on("up-top").pressure(1e4))
        .contact(Pair::new("up-bottom", "low-top").gap(1e-3));
    same(
        model,
        &format!(
            "{BLOCKS}[[material]]\nyoung = 2e11\npoisson = 0.3\ndensity = 7800\n\
             [[support]]\nboundary = \"low-bottom\"\nsymmetry = true\n[[support]]\npoint = [0, 0]\nx = 0\n\
             [[traction]]\nboundary = \"up-top\"\npressure = 1e4\n\
             [[contact]]\nboundary = \"up-bottom\"\nagainst = \"low-top\"\ngap = 1e-3\n"
        ),
    );
}

#[test]
fn a_body_without_supports_is_found_and_needs_a_contact() {
    let model = Model::on(blocks())
        .material(STEEL)
        .support(Support::on("low-bottom").fixed())
        .traction(Traction::on("up-top").pressure(1e4));
    let held = built(model.clone().contact(Pair::new("up-bottom", "low-top")));
    let bodies = Analysis::from(&held).floating_bodies();
    assert!(
        bodies.len() == 1 && bodies[0].contains("\"up\"") && bodies[0].contains("as a whole"),
        "{bodies:?}"
    );
    assert_eq!(held.problem.floating_bodies().n_modes(), 3);
    let message = refused(model);
    assert!(
        message.starts_with("supports: the body with region \"up\"")
            && message.contains("no contact to hold it: add a support"),
        "{message}"
    );
}

#[test]
fn errors_name_the_part_at_fault() {
    let sound = || {
        Model::on(blocks())
            .material(STEEL)
            .support(Support::on("low-bottom").fixed())
            .support(Support::on("up-top").x(0.0).y(-1e-4))
            .contact(Pair::new("up-bottom", "low-top"))
    };
    built(sound());
    let floor = |normal: [f64; 2]| Obstacle::HalfSpace {
        point: [0.0; 2],
        normal,
    };
    let cases: Vec<(Model, &str)> = vec![
        (Model::on(blocks()), "materials: there is no material"),
        (
            sound().material(STEEL),
            "material 1: with several materials each needs its region: \"low\" and \"up\"",
        ),
        (
            Model::on(blocks()).material_in("upp", STEEL),
            "material 1 of \"upp\": there is no region \"upp\"; the mesh has \"low\" and \"up\": did you mean \"up\"?",
        ),
        (
            Model::on(blocks()).material_in("up", STEEL),
            "materials: region \"low\" has no material",
        ),
        (
            Model::on(blocks()).material(Material {
                young: 0.0,
                ..STEEL
            }),
            "material 1: young is 0: it must be positive",
        ),
        (
            sound().thickness(1e-310),
            "thickness: thickness is 1e-310: nonzero values must be between 1e-70 and 1e70",
        ),
        (
            Model::on(blocks()).material(Material {
                young: 1e-310,
                ..STEEL
            }),
            "material 1: young is 1e-310: nonzero values must be",
        ),
        (
            Model::on(blocks()).material(Material {
                young: 1e300,
                ..STEEL
            }),
            "material 1: young is 1e300: nonzero values must be",
        ),
        (
            sound().traction(Traction::on("up-left").x(1e-310)),
            "traction 1 on \"up-left\": the largest nodal force of load step 1 is ",
        ),
        (
            sound().traction(Traction::on("up-left").x(1e200)),
            "traction 1 on \"up-left\": the traction is a nodal force of ",
        ),
        (
            sound().body_force(BodyForce::everywhere().y(1e-300)),
            "body force 1: the largest nodal force of load step 1 is ",
        ),
        (
            sound().thickness(0.0),
            "thickness: thickness must be positive",
        ),
        (
            sound().support(Support::on("lo-left").fixed()),
            "support 3 on \"lo-left\": there is no boundary \"lo-left\"",
        ),
        (
            sound().support(Support::on("lo-left").fixed()),
            "did you mean \"low-left\"?",
        ),
        (
            sound().support(Support::on("low-left")),
            "support 3 on \"low-left\": a support needs x, y or symmetry (or radial, hoop about an axis): it holds nothing",
        ),
        (
            sound().support(
                Support::on("low-left")
                    .x(0.0)
                    .directed([[0.8, 0.6], [-0.6, 0.8]])
                    .about(Axis::at([0.0, 0.0]))
                    .radial(0.0),
            ),
            "support 3 on \"low-left\": radial, hoop and axial have directions of their own",
        ),
        (
            sound().support(Support::at_point([9.0, 9.0]).fixed()),
            "support 3 at (9, 9): the node nearest to (9, 9) is",
        ),
        (
            sound().support(Support::on("low-left").y(1e-3)),
            "support 3 on \"low-left\": two supports prescribe different displacements in y",
        ),
        (
            sound().support(Support::on("low-left").y(|x: [f64; 2]| (x[0] - 1.0).sqrt())),
            "support 3 on \"low-left\": the displacement is NaN",
        ),
        (
            sound().support(Support::on("up-left").y(1e300)),
            "support 3 on \"up-left\": the displacement is 1e300 at ",
        ),
        (
            sound().traction(Traction::on("up-left")),
            "traction 1 on \"up-left\": a traction needs",
        ),
        (
            sound().traction(Traction::on("up-left").x(f64::INFINITY)),
            "traction 1 on \"up-left\": the traction has no finite value near",
        ),
        (
            sound().body_force(BodyForce::within("upper").x(1.0)),
            "body force 1 in \"upper\": there is no region",
        ),
        (
            sound().material(STEEL).gravity([0.0, 1.0]),
            "material 1: with several",
        ),
        (
            sound().contact(Pair::new("low-top", "up-bottom")),
            "contact 2 on \"low-top\": this pair is already listed above",
        ),
        (
            sound().contact(Pair::new("up-left", ["up-top", "up-left"])),
            "contact 2 on \"up-left\": a boundary is on both sides",
        ),
        (
            sound().contact(Pair::new("up-left", "up-left").gap(1e-3)),
            "contact 2 on \"up-left\": where a boundary meets itself, the gap is that of the mesh",
        ),
        (
            sound().contact(Pair::new("up-left", "up-left")),
            "contact 2 on \"up-left\": no part of it faces another one within the search distance",
        ),
        (
            sound().tie(Pair::tied("up-left", "up-left")),
            "tie 1 on \"up-left\": a boundary is on both sides of this tie",
        ),
        (
            sound().contact(Pair::obstacle("up-left", floor([0.0; 2]))),
            "contact 2 on \"up-left\": half_plane needs a finite point and a normal",
        ),
        (
            sound().contact(Pair::obstacle("low-bottom", floor([0.0, -1.0]))),
            "contact 2 on \"low-bottom\": no part of it faces the obstacle",
        ),
        (
            sound().contact(Pair::obstacle("low-bottom", floor([0.0, 1.0]))),
            "contact 2 on \"low-bottom\": supports hold every node of it",
        ),
        (
            sound().contact(Pair::new("up-left", Vec::<String>::new())),
            "a list of boundaries is empty",
        ),
        (
            sound().steps(Vec::new()),
            "load steps: factors needs at least one",
        ),
        (
            sound().support(Support::on("low-left").x(0.0).factors([1.0, 2.0])),
            "support 3 on \"low-left\": factors apply to load steps",
        ),
        (
            sound()
                .steps([1.0, 2.0, 3.0])
                .traction(Traction::on("up-left").x(0.0).factors([1.0, 2.0])),
            "traction 1 on \"up-left\": factors needs 3 finite numbers",
        ),
        (
            sound().units(Units {
                length: "m m".to_owned(),
                force: "N".to_owned(),
            }),
            "units: length = \"m m\" is not the short name of a unit",
        ),
    ];
    for (model, expected) in cases {
        let message = refused(model);
        assert!(message.contains(expected), "{expected}\n{message}");
    }
    // An error before the first step, which names the support that does it.
    let driven = Model::on(rectangle(
        [0.0; 2],
        [1.0, 1.0],
        [2, 2],
        CellShape::Quad,
        "",
        "",
    ))
    .material(STEEL)
    .support(Support::on("right").x(0.0))
    .support(Support::on("left").y(-1e-3))
    .contact(Pair::obstacle("bottom", floor([0.0, 1.0])))
    .steps([0.0, 1.0]);
    let message = refused(driven);
    assert!(
        message.starts_with("support 2 on \"left\": load step 2: supports drive the node at"),
        "{message}"
    );
}

#[test]
fn a_case_names_the_line() {
    let error = |text: &str| match Case::parse(Path::new("c.toml"), text.to_owned(), &[]) {
        Err(error) => error.to_string(),
        Ok(case) => match case.build() {
            Err(error) => error.to_string(),
            Ok(_) => panic!("accepted:\n{text}"),
        },
    };
    let text = "[mesh.rectangle]\nsize = [1, 1]\ncells = [2, 2]\n[[material]]\nyoung = 1\npoisson = 0\n\
        [[support]]\nboundary = \"top\"\nx = 0\ny = 0\n[[support]]\nboundary = \"left\"\nx = 0\n\
        [[contact]]\nboundary = \"bottom\"\nobstacle = { half_plane = { point = [0, 0], normal = [0, 1] } }\n";
    for (old, new, expected) in [
        (
            "\"left\"\nx = 0",
            "\"left\"\nx = 1",
            "c.toml, line 11: two supports",
        ),
        (
            "normal = [0, 1]",
            "normal = [0, -1]",
            "c.toml, line 14: contact on \"bottom\": no part",
        ),
        (
            "\"bottom\"",
            "\"botom\"",
            "c.toml, line 14: there is no boundary \"botom\"; the mesh has",
        ),
        ("young = 1", "young = -1", "c.toml, line 4: young is -1"),
        (
            "[[material]]",
            "[analysis]\nthickness = -1\n[[material]]",
            "c.toml, line 5: thickness must",
        ),
        (
            "[[material]]\nyoung = 1\npoisson = 0\n",
            "",
            "line 1: there is no material",
        ),
    ] {
        assert!(text.contains(old));
        let message = error(&text.replacen(old, new, 1));
        assert!(message.contains(expected), "{expected}\n{message}");
    }
}
