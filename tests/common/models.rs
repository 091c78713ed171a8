//! Models of either dimension made in code, with their answers for the comparisons of tests.

use crate::common::or_panic::OrPanic as _;
use signorini::contact::Space;
use signorini::elasticity::{Stress, internal_forces, stresses};
use signorini::engine::{Device, Engine, Stiffness};
use signorini::mesh::structured::{CellShape, join, rectangle};
use signorini::mesh::{ElementKind, Mesh};
use signorini::model::{Analysis, Built, Model, StepData};
use signorini::output::{Report, StepReport, StepResults};
use signorini::quasistatic::{self, State, StepSolution};
use signorini::solve::{SolveOptions, Solved};
use signorini::ssnm::Status;
use std::ops::ControlFlow;

/// A model, solved: its last load step, and those before it.
pub struct Answer<const D: usize>
where
    ElementKind: Space<D>,
{
    pub built: Built<D>,
    pub data: StepData<D>,
    pub solution: StepSolution<D>,
    pub before: Vec<StepSolution<D>>,
}

/// Solves all steps of a model on the CPU, by factors or by iterations.
pub fn answer<const D: usize>(model: Model<D>, tolerance: f64, stiffness: Stiffness) -> Answer<D>
where
    ElementKind: Space<D>,
{
    answer_by(model, &on_the_cpu(tolerance, stiffness))
}

pub fn on_the_cpu(tolerance: f64, stiffness: Stiffness) -> SolveOptions {
    let mut options = SolveOptions::default();
    options.engine.place = Device::Cpu;
    options.engine.stiffness = stiffness;
    options.settings.ssnm.tolerance = tolerance;
    options
}

/// Solves all steps of a model.
pub fn answer_by<const D: usize>(model: Model<D>, options: &SolveOptions) -> Answer<D>
where
    ElementKind: Space<D>,
{
    let built = model.build().or_panic();
    let mut steps = built.solve(options).or_panic();
    for (number, step) in steps.iter().enumerate() {
        let (status, kkt) = (step.status, &step.kkt);
        assert_eq!(status, Status::Converged, "step {}: {kkt:?}", number + 1);
    }
    let solution = steps.pop().expect("there is a step");
    let data = built.step(steps.len() % built.n_steps()).or_panic();
    Answer {
        built,
        data,
        solution,
        before: steps,
    }
}

/// Solves load steps, each with its own model, which differs from the first one only in loads and in the values of
/// supports.
pub fn answer_in_turn<const D: usize>(models: Vec<Model<D>>, options: &SolveOptions) -> Answer<D>
where
    ElementKind: Space<D>,
{
    let build = |model: Model<D>| model.build().or_panic();
    let mut all: Vec<Built<D>> = models.into_iter().map(build).collect();
    let mut data: Vec<StepData<D>> = (all.iter()).map(|built| built.step(0).or_panic()).collect();
    let built = all.swap_remove(0);
    let mut engine = Engine::new(&built.problem, options.engine.clone(), |_| {}).or_panic();
    let mut state = State::at_rest(&built.problem);
    let mut steps = Vec::new();
    for step in &data {
        let go_on = |_: quasistatic::Event| ControlFlow::Continue(());
        let (problem, settings) = (&built.problem, &options.settings);
        let solution = quasistatic::solve_step(
            problem,
            &step.load,
            &state,
            &mut engine,
            settings,
            &mut Default::default(),
            go_on,
        )
        .or_panic();
        assert_eq!(solution.status, Status::Converged, "{:?}", solution.kkt);
        state = solution.state(&step.load);
        steps.push(solution);
    }
    drop(engine);
    Answer {
        built,
        data: data.pop().expect("there is a step"),
        solution: steps.pop().expect("there is a step"),
        before: steps,
    }
}

/// A block of 2 × 1, `low-…`, of 8 × 4 cells, and another one, `up-…`, whose lower side is at this height.
pub fn stacked(height: f64, cells: [usize; 2]) -> Mesh {
    let block = |name: &str, height: f64, cells| {
        let prefix = format!("{name}-");
        rectangle(
            [0.0, height],
            [2.0, 1.0],
            cells,
            CellShape::Quad,
            name,
            &prefix,
        )
    };
    join(block("low", 0.0, [8, 4]), block("up", height, cells))
}

impl<const D: usize> Answer<D>
where
    ElementKind: Space<D>,
{
    pub fn m(&self) -> usize {
        self.built.problem.m()
    }

    /// Displacement of every node.
    pub fn displacement(&self) -> Vec<[f64; D]> {
        self.data.unknowns.displacements(&self.solution.u)
    }

    /// What the report says of the last step, as if there were no others.
    pub fn report(&self) -> StepReport {
        self.report_on(&self.data, &self.solution)
    }

    /// The same of all steps.
    pub fn reports(&self) -> Vec<StepReport> {
        let steps = self.before.iter().chain([&self.solution]).enumerate();
        steps
            .map(|(step, solution)| {
                self.report_on(
                    &self.built.step(step % self.built.n_steps()).or_panic(),
                    solution,
                )
            })
            .collect()
    }

    /// The hints about the last step.
    pub fn hints(&self) -> Vec<String> {
        self.whole_report(&self.data, &self.solution).hints
    }

    fn report_on(&self, data: &StepData<D>, solution: &StepSolution<D>) -> StepReport {
        self.whole_report(data, solution).steps.remove(0)
    }

    fn whole_report(&self, data: &StepData<D>, solution: &StepSolution<D>) -> Report {
        let mut report = Report::new("", &self.built);
        let solved = Solved {
            number: 1,
            data: Some(data),
            solution: solution.clone(),
            displaced: None,
            parts: 1,
        };
        report.add_step(&StepResults::new(Analysis::from(&self.built), &solved));
        report
    }

    /// Stresses at the nodes.
    pub fn stresses(&self) -> Vec<Stress> {
        stresses(&self.built.elastic.body(), &self.displacement()).0
    }

    /// The position of contact place i.
    pub fn place(&self, i: usize) -> [f64; D] {
        self.built.elastic.contact.places[i].place
    }

    /// The nodes that the force of contact place i goes to, with their parts of it: positive on its own body.
    pub fn hands_on(&self, i: usize) -> Vec<(u32, f64)> {
        let place = &self.built.elastic.contact.places[i];
        let partners = place.partners.iter().map(|&(node, weight)| (node, -weight));
        place.own.iter().copied().chain(partners).collect()
    }

    pub fn area(&self, i: usize) -> f64 {
        self.built.elastic.contact.places[i].area
    }

    /// λν over the area of contact place i.
    pub fn pressure(&self, i: usize) -> f64 {
        self.solution.lambda[i] / self.area(i)
    }

    /// λτ of contact place i as a vector along the axes: friction's force on the obstacle.
    pub fn friction(&self, i: usize) -> [f64; D] {
        let frame = &self.built.elastic.contact.places[i].frame;
        let along = &self.solution.lambda[self.m() + (D - 1) * i..][..D - 1];
        std::array::from_fn(|c| (0..D - 1).map(|k| along[k] * frame[1 + k][c]).sum())
    }

    /// The force of the obstacle on contact place i.
    pub fn contact_force(&self, i: usize) -> [f64; D] {
        let (normal, friction) = (
            self.built.elastic.contact.places[i].frame[0],
            self.friction(i),
        );
        std::array::from_fn(|c| -self.solution.lambda[i] * normal[c] - friction[c])
    }

    /// The resultants of the loads, of the contact forces (of obstacles: those between bodies cancel) and of the support forces:
    /// forces inside the body minus loads and contact, where a component of a node is held.
    pub fn resultants(&self) -> [[f64; D]; 3] {
        let (body, unknowns) = (self.built.elastic.body(), &self.data.unknowns);
        let mut forces = internal_forces(&body, unknowns, &self.displacement());
        let mut contact = [0.0; D];
        for i in 0..self.m() {
            let place = &self.built.elastic.contact.places[i];
            let tangential = &self.solution.lambda[self.m() + (D - 1) * i..][..D - 1];
            let all = std::iter::once(&self.solution.lambda[i]).chain(tangential);
            for (a, (way, force)) in place.frame.iter().zip(all).enumerate() {
                for (side, sign) in place.sides(a).into_iter().zip([-1.0, 1.0]) {
                    for (c, &(node, weight)) in
                        (0..D).flat_map(|c| side.iter().map(move |s| (c, s)))
                    {
                        forces[node as usize][c] -= sign * weight * force * way[c];
                        contact[c] += sign * weight * force * way[c];
                    }
                }
            }
        }
        let mut support = [0.0; D];
        for (node, (force, load)) in (0..).zip(forces.iter().zip(&self.data.forces)) {
            let held = unknowns.prescribed(node);
            for c in (0..D).filter(|&c| held[c].is_some()) {
                support[c] += force[c] - load[c];
            }
        }
        [self.data.total_load, contact, support]
    }
}
