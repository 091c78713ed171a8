//! The subject of a solve: a contact problem and, if a model made it, its bodies.

use super::elastic::Elastic;
use super::error::ModelError;
use super::loads::StepData;
use crate::contact::Space;
use crate::mesh::{ElementKind, Mesh, Topology};
use crate::problem::{AnyProblem, ContactProblem, FloatingBody};

/// A contact problem to be solved in one or more load steps: that of a [`Built`](super::Built) model, with its bodies, or one from matrices.
#[derive(Debug)]
pub struct Analysis<'a, const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    /// The problem with the load of the first step.
    pub problem: &'a ContactProblem<D>,
    /// The bodies; None where the problem was made from matrices.
    pub elastic: Option<&'a Elastic<D>>,
}

impl<const D: usize> Clone for Analysis<'_, D>
where
    ElementKind: Topology<D>,
{
    fn clone(&self) -> Self {
        *self
    }
}

impl<const D: usize> Copy for Analysis<'_, D> where ElementKind: Topology<D> {}

impl<'a, const D: usize> From<&'a ContactProblem<D>> for Analysis<'a, D>
where
    ElementKind: Topology<D>,
{
    fn from(problem: &'a ContactProblem<D>) -> Self {
        Self {
            problem,
            elastic: None,
        }
    }
}

impl<const D: usize> Analysis<'_, D>
where
    ElementKind: Space<D>,
{
    /// Number of load steps; 1 without bodies.
    pub fn n_steps(&self) -> usize {
        self.elastic.map_or(1, Elastic::n_steps)
    }

    /// How often the load steps are made.
    pub fn n_cycles(&self) -> usize {
        self.elastic.map_or(1, |elastic| elastic.cycles().count)
    }

    /// The load at the end of a step, counted from 0; None without bodies, where the load is that of the problem.
    ///
    /// # Errors
    /// As [`Elastic::step`].
    pub fn step(&self, step: usize) -> Result<Option<StepData<D>>, ModelError> {
        self.elastic.map(|elastic| elastic.step(step)).transpose()
    }
}

impl<const D: usize> Analysis<'_, D>
where
    ElementKind: Topology<D>,
{
    /// The name of one of [`System::floating_bodies`](crate::problem::System::floating_bodies): its region and a point
    /// of it, if known.
    pub fn body_name(&self, body: usize) -> String {
        let floating = &self.problem.floating_bodies().bodies()[body];
        let Some(Elastic { mesh, unknowns, .. }) = self.elastic else {
            return format!("the body around ({})", listed(floating.centre()));
        };
        named_by(mesh, unknowns.node(floating.nodes()[0] as usize))
    }

    /// The bodies that no support holds, their possible rigid-body motions, and the contacts or ties that hold them, in
    /// words.
    pub fn floating_bodies(&self) -> Vec<String> {
        let bodies = self.problem.floating_bodies().bodies().iter().enumerate();
        let compliance = self.problem.contact_compliance();
        let kinds = Holder::ALL.map(|kind| {
            let is_kind = |i| Holder::of(self.problem.is_tied(i), compliance, i) == kind;
            self.problem.touched_by(is_kind)
        });
        bodies
            .map(|(number, body)| {
                let by = |touched: &[bool]| body.nodes().iter().any(|&node| touched[node as usize]);
                let held = held_by(kinds.each_ref().map(|kind| by(kind)));
                format!("{}: {held}", self.freedom(number, body))
            })
            .collect()
    }

    fn freedom(&self, number: usize, body: &FloatingBody<D>) -> String {
        let name = self.body_name(number);
        format!("{name} can {} as a whole", body.freedom())
    }

    /// A body that can move as a whole and has no contact to hold it, in words.
    pub fn loose_body(&self) -> Option<String> {
        let touched = self.problem.touched();
        let alone =
            |body: &FloatingBody<D>| !body.nodes().iter().any(|&node| touched[node as usize]);
        let bodies = self.problem.floating_bodies().bodies();
        let number = bodies.iter().position(alone)?;
        let freedom = self.freedom(number, &bodies[number]);
        Some(format!("{freedom}, and it has no contact to hold it"))
    }
}

/// The parts that may hold a body without a support.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Holder {
    Contact,
    Tie,
    Spring,
}

impl Holder {
    pub(super) const ALL: [Self; 3] = [Self::Contact, Self::Tie, Self::Spring];

    /// The kind of contact place i, with the diagonal of C.
    pub(super) fn of(tied: bool, compliance: &[f64], i: usize) -> Self {
        match (tied, compliance.get(i)) {
            (false, _) => Self::Contact,
            (true, Some(c)) if *c > 0.0 => Self::Spring,
            (true, _) => Self::Tie,
        }
    }
}

/// Which of [`Holder::ALL`] hold a body, in words.
pub(super) fn held_by(kinds: [bool; 3]) -> String {
    let names = ["contact", "ties", "springs"].into_iter().zip(kinds);
    let names: Vec<&str> = names
        .filter_map(|(name, holds)| holds.then_some(name))
        .collect();
    match &names[..] {
        [] | ["contact"] => "only contact holds it".to_owned(),
        [one] => format!("only {one} hold it"),
        [some @ .., last] => format!("only {} and {last} hold it", some.join(", ")),
    }
}

/// The name of the body of a node.
pub(super) fn named_by<const D: usize>(mesh: &Mesh<D>, node: u32) -> String
where
    ElementKind: Topology<D>,
{
    let region = (mesh.elements.iter())
        .find(|element| element.nodes().contains(&node))
        .map_or(0, |element| element.region);
    format!(
        "the body with region \"{}\" (at ({}))",
        mesh.regions[region as usize],
        listed(mesh.nodes[node as usize])
    )
}

fn listed<const D: usize>(point: [f64; D]) -> String {
    point.map(|x| format!("{x:.4e}")).join(", ")
}

/// An [`Analysis`] of either dimension.
#[derive(Clone, Copy, Debug)]
pub enum AnyAnalysis<'a> {
    /// Of the plane.
    Plane(Analysis<'a>),
    /// Of space.
    Space(Analysis<'a, 3>),
}

impl<'a> From<&'a AnyProblem> for AnyAnalysis<'a> {
    fn from(problem: &'a AnyProblem) -> Self {
        match problem {
            AnyProblem::Plane(problem) => Self::Plane(problem.into()),
            AnyProblem::Space(problem) => Self::Space(problem.into()),
        }
    }
}
