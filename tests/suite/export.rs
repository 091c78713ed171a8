//! Cases written as algebraic ones: each load step has the same solution there.

use crate::common::or_panic::OrPanic as _;
use signorini::case::{Case, CaseProblem};
use signorini::contact::Space;
use signorini::mesh::ElementKind;
use signorini::model::{Analysis, AnyAnalysis};
use signorini::output::export;
use signorini::solve::{Event, SolveOptions};
use signorini::sparse::norm_max;
use signorini::ssnm::Status;
use std::ops::ControlFlow;
use std::path::Path;

/// Solves a case and its exported load steps; how many these are.
fn compare(text: &str) -> usize {
    let case = Case::parse(Path::new("tests/case.toml"), text.to_owned(), &[]);
    let case = case.or_panic();
    match case.build().or_panic().analysis() {
        AnyAnalysis::Plane(analysis) => compare_steps(&case, analysis),
        AnyAnalysis::Space(analysis) => compare_steps(&case, analysis),
    }
}

fn compare_steps<const D: usize>(case: &Case, analysis: Analysis<D>) -> usize
where
    ElementKind: Space<D>,
{
    let directory = tempfile::tempdir().or_panic();
    let files = export(directory.path(), case, analysis, Default::default(), |_| {}).or_panic();
    let exported = files
        .iter()
        .filter(|file| file.extension().is_some_and(|e| e == "toml"));
    let exported: Vec<_> = exported.collect();
    assert_eq!(exported.len(), analysis.n_steps());

    let mut expected = Vec::new();
    let mut engine =
        signorini::engine::Engine::new(analysis.problem, Default::default(), |_| {}).or_panic();
    analysis
        .solve_on(&mut engine, &case.settings(), |event| {
            if let Event::Ends(solved) = event {
                assert_eq!(solved.solution.status, Status::Converged);
                expected.push([
                    solved.solution.u,
                    solved.solution.lambda,
                    solved.solution.slip,
                ]);
            }
            ControlFlow::Continue(())
        })
        .or_panic();
    for (file, expected) in exported.iter().zip(&expected) {
        let case = Case::read(file, &[]).or_panic();
        let made = case.build().or_panic();
        let CaseProblem::Algebraic(problem) = made else {
            panic!("it has matrices");
        };
        let options = SolveOptions {
            settings: case.settings(),
            ..SolveOptions::default()
        };
        let solution = problem.solve(&options).or_panic();
        assert_eq!(solution.status(), Status::Converged);
        let [u, lambda, slip] = expected;
        let moved = norm_max(u);
        let apart = |a: &[f64], b: &[f64]| {
            let off: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
            norm_max(&off)
        };
        // If everything sticks, slip is rounding of displacements.
        for (what, off, size) in [
            ("u", apart(solution.u(), u), moved),
            ("λ", apart(solution.lambda(), lambda), norm_max(lambda)),
            ("slip", apart(solution.slip(), slip), moved),
        ] {
            assert!(
                off < 1e-6 * size,
                "{what} of {}: {off:e} of {size:e}",
                file.display()
            );
        }
    }
    exported.len()
}

const TIGHT: &str = "[solver]\ntolerance = 1e-10\n";

/// Stick and slip reverse with the push: the origin of slip matters in each step.
#[test]
fn load_steps_with_friction_in_the_plane() {
    let text = format!(
        "title = \"Pushed to and fro\"\n[units]\nlength = \"mm\"\nforce = \"N\"\n\
         [mesh]\nrectangle = {{ size = [2, 1], cells = [12, 6] }}\n\
         [[material]]\nyoung = 1e3\npoisson = 0.3\n\
         [[support]]\nboundary = \"top\"\ny = -0.03\n\
         [[support]]\nboundary = \"top\"\nx = 0.02\nfactors = [0, 1, -1, 0.5]\n\
         [[contact]]\nboundary = \"bottom\"\nfriction = {{ coulomb = 0.4 }}\n\
         obstacle = {{ half_plane = {{ point = [0, 0], normal = [0, 1] }} }}\n\
         [steps]\nfactors = [1, 1, 1, 1]\n{TIGHT}"
    );
    assert_eq!(compare(&text), 4);
}

/// Matrices of one cycle are not those of several, nor are those at rest those of large displacements.
#[test]
fn what_has_no_matrices_is_refused() {
    let text = |rest: &str| {
        format!(
            "[mesh]\nrectangle = {{ size = [2, 1], cells = [4, 2] }}\n[[material]]\nyoung = 1\npoisson = 0.3\n\
        [[support]]\nboundary = \"top\"\nx = 0.01\ny = -0.01\nfactors = [1, -1]\n\
        [[contact]]\nboundary = \"bottom\"\nfriction = {{ coulomb = 0.2 }}\n\
        obstacle = {{ half_plane = {{ point = [0, 0], normal = [0, 1] }} }}\n[steps]\nfactors = [1, 1]\n{rest}"
        )
    };
    for (rest, expected) in [
        ("cycles = 3\n", "state cycles = 1"),
        (
            "[analysis]\ngeometry = \"large\"\n",
            "state geometry = \"small\"",
        ),
    ] {
        let case = Case::parse(Path::new("tests/case.toml"), text(rest), &[]).or_panic();
        let built = case.build().or_panic();
        let AnyAnalysis::Plane(analysis) = built.analysis() else {
            panic!("it is in the plane");
        };
        let directory = tempfile::tempdir().or_panic();
        let error = export(
            directory.path(),
            &case,
            analysis,
            Default::default(),
            |_| {},
        );
        let error = error.expect_err(rest).to_string();
        assert!(error.contains(expected), "{error}");
    }
}

/// Prescribed motions of the nodes in contact, a press fit, given slip bounds beside a coefficient: in space.
#[test]
fn an_interference_and_two_laws_in_space() {
    let text = format!(
        "[[mesh.part]]\nname = \"low\"\nbox = {{ size = [2, 1, 0.5], cells = [5, 3, 2] }}\n\
         [[mesh.part]]\nname = \"up\"\nbox = {{ origin = [0, 0, 0.5], size = [2, 1, 0.5], cells = [4, 2, 2] }}\n\
         [[material]]\nyoung = 1e3\npoisson = 0.25\n\
         [[support]]\nboundary = \"up-top\"\nx = 0.01\ny = 0\nz = 0\nfactors = [0, 1]\n\
         [[traction]]\nboundary = \"low-left\"\npressure = 1\n\
         [[contact]]\nboundary = \"up-bottom\"\nagainst = \"low-top\"\ninterference = 0.004\n\
         friction = {{ coulomb = 0.2 }}\n\
         [[contact]]\nboundary = \"low-bottom\"\nfriction = {{ tresca = 0.5 }}\n\
         obstacle = {{ half_space = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}\n\
         [steps]\nfactors = [0.5, 1]\n{TIGHT}"
    );
    assert_eq!(compare(&text), 2);
}

/// Contact, friction and a tie that come and go, beside a foundation and a spring.
#[test]
fn what_changes_between_load_steps() {
    let text = format!(
        "[[mesh.part]]\nname = \"low\"\nrectangle = {{ size = [2, 1], cells = [6, 3] }}\n\
         [[mesh.part]]\nname = \"up\"\nrectangle = {{ origin = [0.5, 1], size = [1, 1], cells = [4, 3] }}\n\
         [[material]]\nyoung = 1e3\npoisson = 0.3\n\
         [[foundation]]\nboundary = \"low-bottom\"\nstiffness = {{ normal = 1e3, tangential = 2e2 }}\n\
         [[spring]]\nboundary = \"up-right\"\ndirection = [1, 0]\nstiffness = 20\n\
         [[support]]\nboundary = \"up-top\"\ny = -0.03\nfactors = [1, 1, 1, 1.5]\n\
         [[traction]]\nboundary = \"up-left\"\nx = 1\nfactors = [0.1, 1, 1, -1]\n\
         [[contact]]\nboundary = \"up-bottom\"\nagainst = \"low-top\"\nfriction = {{ coulomb = 0.3 }}\n\
         active = [1, 1, 0, 0]\nfriction_factors = [0, 1, 1, 1]\n\
         [[tie]]\nboundary = \"up-bottom\"\nagainst = \"low-top\"\nactive = [0, 0, 1, 1]\n\
         [steps]\nfactors = [1, 1, 1, 1]\n{TIGHT}"
    );
    assert_eq!(compare(&text), 4);
}

/// One step, and a case that is algebraic already.
#[test]
fn an_algebraic_case_is_written_as_it_is() {
    for name in ["examples/press.toml", "examples/matrices/block.toml"] {
        let case = Case::read(Path::new(name), &["solver.tolerance=1e-10".to_owned()]);
        let case = case.or_panic();
        let made = case.build().or_panic();
        let steps = match made.analysis() {
            AnyAnalysis::Plane(analysis) => compare_steps(&case, analysis),
            AnyAnalysis::Space(analysis) => compare_steps(&case, analysis),
        };
        assert_eq!(steps, 1);
    }
}

/// Compliance of contact and ties are part of the matrices; and the keys of case files have their documented meaning.
#[test]
fn compliant_contact_and_ties() {
    let text = format!(
        "{TIGHT}[mesh]\n\
         [[mesh.part]]\nname = \"low\"\nrectangle = {{ size = [2, 1], cells = [7, 3] }}\n\
         [[mesh.part]]\nname = \"mid\"\nrectangle = {{ size = [2, 1], cells = [5, 3] }}\nshift = [0, 0.9999]\n\
         [[mesh.part]]\nname = \"up\"\nrectangle = {{ size = [1, 0.5], cells = [4, 2], shape = \"triangle\" }}\nshift = [0.5, 1.9999]\n\
         [[material]]\nyoung = 2e11\npoisson = 0.3\n\
         [[support]]\nboundary = \"low-bottom\"\nx = 0\ny = 0\n\
         [[traction]]\nboundary = \"up-top\"\ny = -2e7\nfactors = [1, 1, 1]\n\
         [[traction]]\nboundary = \"up-top\"\nx = 4e6\nfactors = [0, 1, -1]\n\
         [[contact]]\nboundary = \"mid-bottom\"\nagainst = \"low-top\"\noverlap = \"interference\"\n\
         friction = {{ coulomb = 0.3 }}\nstiffness = {{ normal = \"2e12 + 1e12 * x\", tangential = 5e11 }}\n\
         [[tie]]\nname = \"weld\"\nboundary = \"up-bottom\"\nagainst = \"mid-top\"\n[steps]\nfactors = [1, 1, 1]\n"
    );
    assert_eq!(compare(&text), 3);
    for (wrong, said) in [
        ("normal = 0", "contact stiffness is 0"),
        ("normal = -1e9", "contact stiffness is -1000000000"),
        ("across = 1", "across"),
    ] {
        let text = text.replace("normal = \"2e12 + 1e12 * x\"", wrong);
        let built = Case::parse(Path::new("tests/case.toml"), text, &[])
            .map_err(|error| error.to_string())
            .and_then(|case| case.build().map_err(|error| error.to_string()));
        let error = built.err().unwrap_or_default();
        assert!(error.contains(said), "{wrong}: {error}");
    }
}
