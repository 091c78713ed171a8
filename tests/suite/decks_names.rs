//! Names in decks: sets and surfaces of one name, parts and their instances. Each problem is stated in two ways.

use crate::common::or_panic::OrPanic as _;
use crate::decks::{STATIC, built, displacements, material, read, squares, strip, written};
use signorini::deck::Deck;
use signorini::mesh::{AnyMesh, Mesh};

fn plane(deck: &Deck) -> &Mesh {
    match &deck.mesh {
        AnyMesh::Plane(mesh) => mesh,
        AnyMesh::Space(_) => panic!("a deck of the plane"),
    }
}

/// The displacements at the end of the last step.
fn moved(text: &str) -> Vec<[f64; 3]> {
    let deck = read(text, &[], &[]).or_panic();
    displacements(&built(&deck)).pop().expect("a step")
}

/// Whether two texts are the same problem, whose bodies move.
fn are_same(one: &str, other: &str) {
    let (one, other) = (moved(one), moved(other));
    let size = |u: &[[f64; 3]]| u.iter().flatten().fold(0.0, |a: f64, v| a.max(v.abs()));
    assert_eq!(one.len(), other.len());
    let pairs = one.iter().zip(&other);
    let off = pairs.flat_map(|(u, v)| (0..3).map(move |c| (u[c] - v[c]).abs()));
    let off = off.fold(0.0, f64::max);
    assert!(size(&one) > 1e-4, "nothing moves");
    assert!(off < 1e-9 * size(&one), "{off:e}: {one:?}\n{other:?}");
}

/// In a flat deck a set of nodes, a set of elements and a surface may have one name: each keyword means its own kind.
#[test]
fn sets_and_surfaces_of_one_name_are_different() {
    let text = |[nodes, elements, faces]: [&str; 3]| {
        strip(&format!(
            "*NSET,NSET={nodes},GENERATE\n1,15\n*ELSET,ELSET={elements}\n1,2\n*SURFACE,NAME={faces}\n4,S2\n{STATIC}\
             *DSLOAD\n{faces},P,-20.\n*DLOAD\n{elements},GRAV,2.,1.,0.,0.\n*CLOAD\n{nodes},1,0.5\n*END STEP\n"
        ))
        .replace("GENERATE\n1,15", "GENERATE\n1,5")
    };
    let (same, other) = (text(["end"; 3]), text(["n", "e", "f"]));
    are_same(&same, &other);
    let deck = read(&same, &[], &[]).or_panic();
    let mesh = plane(&deck);
    assert_eq!(mesh.boundaries["end"].len(), 1, "that of the surface");
    assert_eq!(mesh.node_sets["end"].len(), 5);
    assert_eq!(mesh.groups["end"].len(), 1);
    let case = written(&deck);
    for stated in ["boundary = \"end\"", "nodes = \"end\"", "region = \"end\""] {
        assert!(case.contains(stated), "{case}");
    }
    // A surface of nodes is another set of nodes than that of its name.
    let text = |name: &str| {
        strip(&format!(
            "*NSET,NSET=tip\n1\n*SURFACE,NAME={name},TYPE=NODE\nNright\n*NODE\n50,5.,0.5\n\
             *COUPLING,CONSTRAINT NAME=c,REF NODE=50,SURFACE={name}\n*KINEMATIC\n{STATIC}*BOUNDARY\ntip,1,2\n*CLOAD\n50,1,5.\n\
             *END STEP\n"
        ))
    };
    are_same(&text("tip"), &text("other"));
    let deck = read(&text("tip"), &[], &[]).or_panic();
    assert_eq!(plane(&deck).node_sets["tip-surface"].len(), 2);
}

/// ADJUST= moves nodes of the slave surface, not those of a set with its name.
#[test]
fn a_set_with_the_name_of_a_surface_is_not_adjusted() {
    let text = squares([1.01, 1.03], ", ADJUST=Nright");
    let surface = "*SURFACE, NAME=Supper";
    let both = text.replace(surface, &format!("*NSET, NSET=Supper\n13,14\n{surface}"));
    let nodes = |text: &str| plane(&read(text, &[], &[]).or_panic()).nodes.clone();
    assert_eq!(nodes(&both), nodes(&text));
}

/// A plate 2 by 1 of two squares as a part, with sets of its own, at the instances.
fn assembly(part: &str, instances: &str, rest: &str) -> String {
    format!(
        "*PART,NAME=Plate\n{}{part}*END PART\n*ASSEMBLY,NAME=A\n{instances}{rest}",
        body()
    )
}

/// The mesh of the plate, with its section.
fn body() -> String {
    let section = material(0.3);
    let section = &section[section.find("*SOLID").expect("a section")..];
    format!(
        "*NODE\n1,0,0\n2,1,0\n3,2,0\n4,0,1\n5,1,1\n6,2,1\n9,3,0.5\n*ELEMENT,TYPE=CPS4\n1,1,2,5,4\n2,2,3,6,5\n\
         *ELSET,ELSET=Eall\n1,2\n*NSET,NSET=End\n3,6\n*SURFACE,NAME=Tip\n2,S2\n{section}"
    )
}

/// The end of an assembly, with a step.
fn end(step: &str) -> String {
    let material = material(0.3);
    let material = &material[..material.find("*SOLID").expect("a section")];
    format!("*END ASSEMBLY\n{material}{STATIC}{step}*END STEP\n")
}

const ONE: &str = "*INSTANCE,NAME=P-1,PART=Plate\n*END INSTANCE\n";

/// Two of them, the second one shifted and turned by a right angle.
const TWO: &str = "*INSTANCE,NAME=P-1,PART=Plate\n*END INSTANCE\n*INSTANCE,NAME=P-2,PART=Plate\n5.,0.\n5.,0.,0.,5.,0.,1.,90.\n\
    *END INSTANCE\n*NSET,NSET=Held,INSTANCE=P-1\n1,4\n*NSET,NSET=Held,INSTANCE=P-2\n1,4\n";

/// Sets and surfaces of a part are others than those of the assembly with their names, with one instance as with several.
#[test]
fn sets_of_parts_are_not_those_of_the_assembly() {
    let text = |[nodes, elements, faces]: [&str; 3]| {
        let part = "*ELSET,ELSET=First\n1\n*SURFACE,NAME=Low\n1,S1\n2,S1\n";
        let sets = format!(
            "*NSET,NSET={nodes},INSTANCE=P-1\n1,4\n*ELSET,ELSET={elements},INSTANCE=P-1\n2\n*ELSET,ELSET=_f,INTERNAL,INSTANCE=P-1\n2\n\
             *SURFACE,NAME={faces}\n_f,S2\n"
        );
        let step = format!(
            "*BOUNDARY\n{nodes},1,2\n*DSLOAD\n{faces},P,-20.\nP-1.Tip,P,-3.\nP-1.Low,P,2.\n*DLOAD\n{elements},GRAV,2.,0.,-1.,0.\n\
             P-1.First,GRAV,1.,1.,0.,0.\n"
        );
        assembly(part, ONE, &(sets + &end(&step)))
    };
    let other = text(["n", "e", "f"]);
    are_same(&text(["End", "First", "Tip"]), &other);
    are_same(&text(["Tip", "Low", "Low"]), &other);
    // Sets that CAE makes for its own use, of the section and of a load.
    let internal = text(["n", "_S", "f"])
        .replace("Eall", "_S")
        .replace("ELSET=_S\n", "ELSET=_S,INTERNAL\n")
        .replace("ELSET=_S,INSTANCE", "ELSET=_S,INTERNAL,INSTANCE");
    are_same(&internal, &other);
    let deck = read(&text(["End", "First", "Tip"]), &[], &[]).or_panic();
    let mesh = plane(&deck);
    assert_eq!(
        (mesh.node_sets["End"].len(), mesh.node_sets["P-1.End"].len()),
        (2, 2)
    );
    assert!(mesh.boundaries.contains_key("P-1.Tip"));
    // Names that one alone has are as written.
    let other = read(&other, &[], &[]).or_panic();
    let names: Vec<&String> = plane(&other).node_sets.keys().collect();
    assert_eq!(names, ["End", "n"]);
}

/// What a part says holds for each of its instances, with nodes and sets of its own, and turns with them.
#[test]
fn keywords_of_parts_hold_for_their_instances() {
    let of_two = |stated: &str| {
        let of = |name: &str| stated.replace('@', &format!("{name}."));
        of("P-1") + &of("P-2")
    };
    let step = "*BOUNDARY\nHeld,1,2\n*CLOAD\nP-1.End,1,5.\nP-2.End,1,3.\nP-1.6,2,1.\n";
    let step_of_points = "*BOUNDARY\nHeld,1,2\n*CLOAD\nP-1.9,1,5.\nP-2.9,2,3.\n";
    for (stated, step) in [
        ("*EQUATION\n2\n@3,1,1.,@6,1,-2.\n", step),
        ("*EQUATION\n2\n@3,1,1.,@6,1,-1.\n", step),
        ("*MPC\nLINK,@3,@6\n", step),
        ("*MPC\nTIE,@3,@6\n", step),
        (
            "*COUPLING,CONSTRAINT NAME=c,REF NODE=@9,SURFACE=@Tip\n*KINEMATIC\n1,2\n",
            step_of_points,
        ),
        (
            "*COUPLING,CONSTRAINT NAME=c,REF NODE=@9,SURFACE=@Tip\n*DISTRIBUTING,WEIGHTING METHOD=UNIFORM\n",
            step_of_points,
        ),
        ("*RIGID BODY,NSET=@End,REF NODE=@9\n", step_of_points),
        ("*KINEMATIC COUPLING,REF NODE=@9\n@End\n", step_of_points),
    ] {
        // Names of the assembly that mean something else there.
        let others = "*NODE\n3,7,7\n6,8,8\n9,9,9\n";
        let in_part = assembly(
            &stated.replace('@', ""),
            TWO,
            &(others.to_owned() + &end(step)),
        );
        let outside = assembly("", TWO, &(of_two(stated) + &end(step)));
        are_same(&in_part, &outside);
    }
    // Directions of a transform: those of the second instance are turned by a right angle.
    let in_part = assembly("*TRANSFORM,NSET=End\n1.,1.,0.,-1.,1.,0.\n", TWO, &end(step));
    let turned = "*TRANSFORM,NSET=P-1.End\n1.,1.,0.,-1.,1.,0.\n*TRANSFORM,NSET=P-2.End\n-1.,1.,0.,-1.,-1.,0.\n";
    are_same(
        &in_part,
        &assembly("", TWO, &(turned.to_owned() + &end(step))),
    );
    let axis = |at: &str, z: &str| format!("{at},{z}");
    let in_part = assembly(
        &format!(
            "*TRANSFORM,NSET=End,TYPE=C\n{},{}\n",
            axis("1,-1", "0"),
            axis("1,-1", "1")
        ),
        TWO,
        &end(step),
    );
    // (1, −1) is moved to (6, −1) and then to (6, 1).
    let turned = "*TRANSFORM,NSET=P-1.End,TYPE=C\n1,-1,0,1,-1,1\n*TRANSFORM,NSET=P-2.End,TYPE=C\n6,1,0,6,1,1\n";
    are_same(
        &in_part,
        &assembly("", TWO, &(turned.to_owned() + &end(step))),
    );
}

/// Instances with meshes of their own state their sections.
#[test]
fn instances_with_meshes_have_sections() {
    let step = "*BOUNDARY\nHeld,1,2\n*CLOAD\nP-1.End,1,5.\nP-2.End,1,3.\n";
    let equation = "*EQUATION\n2\n3,2,1.,6,2,-2.\n";
    let of_part = assembly(equation, TWO, &end(step));
    let own = format!("{}{equation}*END INSTANCE\n", body());
    let of_instances = format!(
        "*PART,NAME=Plate\n*END PART\n*ASSEMBLY,NAME=A\n{}{}",
        TWO.replace("*END INSTANCE\n", &own),
        end(step)
    );
    are_same(&of_part, &of_instances);
}

/// A spring of the assembly between a node of an instance and a point: as stiff as the plate, E A / L = 50.
#[test]
fn springs_of_the_assembly_join_nodes_of_instances() {
    let spring = "*NODE\n1,5.,0.\n*ELEMENT,TYPE=SPRINGA,ELSET=Springs/Dashpots-1\n1,P-1.3,1\n*SPRING,ELSET=Springs/Dashpots-1\n\n50.\n\
        *EQUATION\n2\nP-1.3,1,1.,P-1.6,1,-1.\n*NSET,NSET=All,INSTANCE=P-1,GENERATE\n1,6\n*NSET,NSET=Held,INSTANCE=P-1\n1,4\n";
    let step = "*BOUNDARY\nHeld,1\nAll,2\n1,1,2\n*CLOAD\nP-1.3,1,10.\n";
    let text = assembly("", ONE, &(spring.to_owned() + &end(step)));
    let u = moved(&text.replace("200., 0.3", "200., 0.0"));
    assert!(
        (u[2][0] - 0.1).abs() < 1e-9 && (u[5][0] - 0.1).abs() < 1e-9,
        "{u:?}"
    );
    // So have masses, which only gravity and rotation move.
    let mass = "*ELEMENT,TYPE=MASS,ELSET=m\n2,P-1.6\n*MASS,ELSET=m\n3.\n*END ASSEMBLY\n";
    let with_mass = text.replace("*END ASSEMBLY\n", mass);
    are_same(&with_mass, &text);
    let heavy = with_mass.replace("*CLOAD", "*DLOAD\n,GRAV,9.81,0.,-1.,0.\n*CLOAD");
    let error = read(&heavy, &[], &[]).expect_err("a weight");
    assert!(
        error.contains("*MASS: GRAV and CENTRIF act in bodies only"),
        "{error}"
    );
    let error = read(&text.replace("1,P-1.3,1\n", "1,P-7.3,1\n"), &[], &[]).expect_err("nowhere");
    assert!(error.contains("there is no instance \"P-7\""), "{error}");
}
