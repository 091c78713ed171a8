//! The effect of each number of the method: all problems of a corpus with each of them halved and doubled.
//!
//! The corpus: the templates of `examples/` on both paths, the plane ones also by Algorithm ISSNM as printed; cases A, B and C
//! on both paths; long bars, beams and a plate with Coulomb friction, on the factor, the longest beam by PCG as well; random
//! problems of the campaign on both paths. PCG runs on the CPU. `docs/constants.md` has the table.
//!
//! `cargo test --release --test suite -- --ignored --nocapture campaign::ablation` takes half an hour. Environment:
//!
//! - `ABLATION_ONLY`: names of numbers with commas between (`none`: the first line of the table alone);
//! - `ABLATION_SEEDS`: how many random problems (300);
//! - `ABLATION_CASES`: more case files, with commas between, solved on both paths.

use super::problems::problem;
use super::runs::settings;
use crate::common::cases::Trial;
use crate::common::draw::number;
use crate::common::or_panic::OrPanic as _;
use crate::common::runs::name_of;
use signorini::case::Case;
use signorini::contact::Space;
use signorini::dual::DualOperator as _;
use signorini::engine::{Device, Engine, EngineOptions, Stiffness};
use signorini::mesh::ElementKind;
use signorini::mesh::structured::SolidShape;
use signorini::model::{Analysis, AnyAnalysis};
use signorini::problem::ContactProblem;
use signorini::quasistatic::{self, Load, State, StepSettings};
use signorini::reference::{self, CASE_A, CASE_B, CASE_C, Geometry};
use signorini::ssnm::RecycledSubspace;
use signorini::ssnm::{Method, Numbers, Status};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;

const BOTH: &[Stiffness] = &[Stiffness::Cholesky, Stiffness::Pcg];
const FACTOR: &[Stiffness] = &[Stiffness::Cholesky];

/// A bar on a floor with μ = 1, pulled and pushed at its end.
const BAR: &str = r#"
[mesh.rectangle]
size = [50, 1]
cells = [200, 4]
[[material]]
young = 1e5
poisson = 0.3
[steps]
factors = [1, 1, 1, 1, 1, 1]
[[traction]]
boundary = "top"
pressure = 100
[[support]]
boundary = "left"
x = 0.1
factors = [0.5, 1, 0, -1, 0, 1]
[[contact]]
boundary = "bottom"
obstacle = { half_plane = { point = [0, 0], normal = [0, 1] } }
friction = { coulomb = 1 }
"#;
/// A bar along which slip creeps from end to end.
const LONG_BAR: &str = r#"
[mesh.rectangle]
size = [600, 1]
cells = [600, 1]
[[material]]
young = 1e5
poisson = 0.3
[[traction]]
boundary = "top"
pressure = 100
[[support]]
boundary = "left"
x = 0.05
[[contact]]
boundary = "bottom"
obstacle = { half_plane = { point = [0, 0], normal = [0, 1] } }
friction = { coulomb = 0.5 }
"#;
/// A clamped beam that is bent down to a floor.
const BEAM: &str = r#"
[mesh.rectangle]
size = [50, 1]
cells = [200, 4]
[[material]]
young = 1e5
poisson = 0.3
[[support]]
boundary = "left"
x = 0
y = 0
[[traction]]
boundary = "top"
pressure = 1
[[contact]]
boundary = "bottom"
obstacle = { half_plane = { point = [0, -0.3], normal = [0, 1] } }
friction = { coulomb = 0.5 }
"#;
/// A thin plate, bent down in the same way.
const PLATE: &str = r#"
[mesh.box]
size = [20, 20, 0.2]
cells = [20, 20, 2]
[[material]]
young = 1e5
poisson = 0.3
[[support]]
boundary = "left"
x = 0
y = 0
z = 0
[[traction]]
boundary = "top"
pressure = 0.01
x = 0.002
[[contact]]
boundary = "bottom"
obstacle = { half_space = { point = [0, 0, -0.05], normal = [0, 0, 1] } }
friction = { coulomb = 0.5 }
"#;

/// Solved with this many products and V-cycles, or not, for this reason.
type Outcome = Result<[usize; 2], &'static str>;
/// A problem with its loads, to be solved with other settings.
type Solve = Box<dyn Fn(Stiffness, &StepSettings) -> Outcome>;

struct Entry {
    name: String,
    /// On the factor or by PCG.
    paths: &'static [Stiffness],
    method: Method,
    settings: StepSettings,
    solve: Solve,
}

/// All load steps.
fn solve<const D: usize>(
    problem: &ContactProblem<D>,
    loads: &[Load],
    stiffness: Stiffness,
    settings: &StepSettings,
) -> Outcome {
    let options = EngineOptions {
        place: Device::Cpu,
        stiffness,
        ..EngineOptions::default()
    };
    let mut engine = Engine::new(problem, options, |_| {}).map_err(|_| "no engine")?;
    let mut recycled = RecycledSubspace::default();
    let mut state = State::at_rest(problem);
    let mut products = 0;
    for load in loads {
        let go_on = |_: quasistatic::Event| ControlFlow::Continue(());
        let made = quasistatic::solve_step(
            problem,
            load,
            &state,
            &mut engine,
            settings,
            &mut recycled,
            go_on,
        )
        .map_err(|_| "error")?;
        products += made.n_a();
        if made.status != Status::Converged {
            return Err(name_of(made.status));
        }
        state = made.state(load);
    }
    let cycles = engine.costs().map_or(0, |costs| costs.solves.iterations);
    Ok([products, cycles])
}

fn plain<const D: usize>(problem: ContactProblem<D>, loads: Vec<Load>) -> Solve {
    Box::new(move |stiffness, settings| solve(&problem, &loads, stiffness, settings))
}

fn loads<const D: usize>(analysis: Analysis<D>) -> Vec<Load>
where
    ElementKind: Space<D>,
{
    let step = |number| {
        let step = analysis.step(number).or_panic();
        step.map_or_else(|| Load::of(analysis.problem), |step| step.load)
    };
    (0..analysis.n_steps()).map(step).collect()
}

fn of_case(case: &Case, name: &str, paths: &'static [Stiffness]) -> Entry {
    let made = case.build().unwrap_or_else(|e| panic!("{name}: {e}"));
    let solve = match made.analysis() {
        AnyAnalysis::Plane(analysis) => plain(analysis.problem.clone(), loads(analysis)),
        AnyAnalysis::Space(analysis) => plain(analysis.problem.clone(), loads(analysis)),
    };
    Entry {
        name: name.to_owned(),
        paths,
        method: Method::Multisecant,
        settings: case.settings(),
        solve,
    }
}

fn corpus() -> Vec<Entry> {
    let read = |file: &str| {
        Case::read(Path::new(file), &[]).unwrap_or_else(|error| panic!("{file}: {error}"))
    };
    let mut all = Vec::new();
    for name in [
        "press",
        "stack",
        "dovetail",
        "shear",
        "roller",
        "cylinder",
        "shrink-fit",
        "brake",
        "ball-joint",
        "bracket-3d",
        "ball",
        "matrices/block",
    ] {
        all.push(of_case(&read(&format!("examples/{name}.toml")), name, BOTH));
    }
    for name in ["press", "stack", "dovetail", "roller", "cylinder"] {
        let mut entry = of_case(&read(&format!("examples/{name}.toml")), name, BOTH);
        entry.name += ", as printed";
        entry.method = Method::Inexact;
        all.push(entry);
    }
    let long = |text: &str| {
        text.replace("[50, 1]", "[100, 1]")
            .replace("[200, 4]", "[400, 4]")
    };
    for (name, text, paths) in [
        ("bar", BAR.to_owned(), FACTOR),
        ("long bar", LONG_BAR.to_owned(), FACTOR),
        ("beam", BEAM.to_owned(), FACTOR),
        ("long beam", long(BEAM), BOTH),
        ("plate", PLATE.to_owned(), FACTOR),
    ] {
        let case = Case::parse(Path::new("tests/case.toml"), text, &[]);
        let case = case.unwrap_or_else(|error| panic!("{name}: {error}"));
        all.push(of_case(&case, name, paths));
    }
    for file in std::env::var("ABLATION_CASES")
        .iter()
        .flat_map(|files| files.split(','))
    {
        all.push(of_case(&read(file), file, BOTH));
    }
    let mut add = |name: &str, solve: Solve| {
        all.push(Entry {
            name: name.to_owned(),
            paths: BOTH,
            method: Method::Multisecant,
            settings: StepSettings::default(),
            solve,
        });
    };
    for (name, geometry, case) in [
        ("case A", Geometry::OneBody, &CASE_A),
        ("case B", Geometry::TwoBodies, &CASE_B),
    ] {
        let mesh = reference::mesh(geometry, 13);
        let made = reference::problem(geometry, &mesh, case);
        let made = made.or_panic();
        let load = Load::of(&made);
        add(name, plain(made, vec![load]));
    }
    let made = CASE_C.problem(8, SolidShape::Hexahedron);
    let made = made.or_panic();
    let load = Load::of(&made);
    add("case C", plain(made, vec![load]));
    all
}

/// The result of each problem, and its path.
#[derive(Default)]
struct Outcomes(Vec<(Stiffness, String, Outcome)>);

impl Outcomes {
    /// Products on the factor, by PCG, and V-cycles: of problems solved in both runs, here and there.
    fn sums(&self, base: &Self) -> [[usize; 3]; 2] {
        let mut sums = [[0; 3]; 2];
        for ((path, _, here), (_, _, there)) in self.0.iter().zip(&base.0) {
            let (Ok(here), Ok(there)) = (here, there) else {
                continue;
            };
            for (sums, [products, cycles]) in sums.iter_mut().zip([here, there]) {
                sums[usize::from(*path == Stiffness::Pcg)] += products;
                sums[2] += cycles;
            }
        }
        sums
    }

    /// A cell for each sum, as it is or as a change in percent.
    fn cells(&self, base: Option<&Self>) -> String {
        let [here, there] = self.sums(base.unwrap_or(self));
        let cells = here.iter().zip(there).map(|(&now, before)| match base {
            None => format!("{now} | "),
            Some(_) => {
                let change = 100.0 * (now as f64 / before as f64 - 1.0);
                format!("{change:+.1} | ")
            }
        });
        cells.collect()
    }

    /// The problems that are not solved, each with its number; only those solved in `base`, if given, and the other way
    /// round.
    fn words(&self, base: Option<&Self>) -> String {
        let mut counts: BTreeMap<String, usize> = BTreeMap::new();
        for (i, (path, name, outcome)) in self.0.iter().enumerate() {
            let path = ["factor", "PCG"][usize::from(*path == Stiffness::Pcg)];
            let word = match (outcome, base.map(|base| &base.0[i].2)) {
                (Err(reason), None | Some(Ok(_))) => *reason,
                (Ok(_), Some(Err(_))) => "is solved",
                _ => continue,
            };
            *counts.entry(format!("{name} {word} ({path})")).or_default() += 1;
        }
        let words: Vec<String> = (counts.into_iter())
            .map(|(what, count)| match count {
                1 => what,
                count => format!("{count} {what}"),
            })
            .collect();
        words.join("; ")
    }
}

fn run(corpus: &[Entry], trials: &[Trial], numbers: Numbers) -> [Outcomes; 2] {
    let with = |settings: &StepSettings, method: Method| {
        let mut settings = settings.clone();
        settings.ssnm.numbers = numbers;
        settings.ssnm.method = method;
        settings
    };
    let [mut cases, mut random] = [Outcomes::default(), Outcomes::default()];
    for entry in corpus {
        for &path in entry.paths {
            let outcome = (entry.solve)(path, &with(&entry.settings, entry.method));
            cases.0.push((path, entry.name.clone(), outcome));
        }
    }
    for trial in trials {
        for &path in BOTH {
            let settings = with(
                &settings(crate::common::oracle::TOLERANCE),
                Method::Multisecant,
            );
            let outcome = solve(&trial.problem, &trial.loads, path, &settings);
            random.0.push((path, "random".to_owned(), outcome));
        }
    }
    [cases, random]
}

#[test]
#[ignore = "half an hour"]
fn ablation() {
    let corpus = corpus();
    let seeds = number("ABLATION_SEEDS").unwrap_or(300);
    let trials: Vec<Trial> = (1..=seeds)
        .filter_map(|seed| problem(seed).ok())
        .map(|problem| problem.trial)
        .collect();
    let only = std::env::var("ABLATION_ONLY").ok();
    let chosen = |name: &&&str| {
        only.as_ref()
            .is_none_or(|only| only.split(',').any(|o| o == **name))
    };
    let base = run(&corpus, &trials, Numbers::default());
    println!(
        "| number | times | factor | PCG | V-cycles | random, factor | PCG | V-cycles | unsolved |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let line = |name: &str, factor: &str, sums: &[Outcomes; 2], base: Option<&[Outcomes; 2]>| {
        let [cases, random] = sums;
        let words = [
            cases.words(base.map(|b| &b[0])),
            random.words(base.map(|b| &b[1])),
        ];
        println!(
            "| {name} | {factor} | {}{}{} |",
            cases.cells(base.map(|b| &b[0])),
            random.cells(base.map(|b| &b[1])),
            words.join(" ").trim()
        );
    };
    line("as they are", "1", &base, None);
    for name in Numbers::NAMES.iter().filter(chosen) {
        for factor in [0.5, 2.0] {
            let made = run(&corpus, &trials, Numbers::default().times(name, factor));
            line(name, &factor.to_string(), &made, Some(&base));
        }
    }
}
