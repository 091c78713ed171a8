//! Models of either dimension that are made in code: their answers, from which tests take what they compare.

use signorini::contact::Space;
use signorini::elasticity::{Stress, internal_forces, stresses};
use signorini::engine::{Place, Stiffness};
use signorini::mesh::Kind;
use signorini::model::{Built, Model, StepData};
use signorini::quasistatic::StepSolution;
use signorini::solve::Options;
use signorini::ssnm::Status;

/// A model and its one load step, solved.
pub struct Answer<const D: usize>
where
    Kind: Space<D>,
{
    pub built: Built<D>,
    pub data: StepData<D>,
    pub solution: StepSolution<D>,
}

/// Solves a model on the CPU, by factors or by iterations.
pub fn answer<const D: usize>(model: Model<D>, tolerance: f64, stiffness: Stiffness) -> Answer<D>
where
    Kind: Space<D>,
{
    let built = model.build().unwrap_or_else(|error| panic!("{error}"));
    let mut options = Options::default();
    options.engine.place = Place::Cpu;
    options.engine.stiffness = stiffness;
    options.settings.ssnm.tolerance = tolerance;
    let mut steps = built
        .solve(&options)
        .unwrap_or_else(|error| panic!("{error}"));
    let solution = steps.pop().expect("there is one step");
    assert_eq!(solution.status, Status::Converged, "{:?}", solution.kkt);
    let data = built.step(0).unwrap_or_else(|error| panic!("{error}"));
    Answer {
        built,
        data,
        solution,
    }
}

impl<const D: usize> Answer<D>
where
    Kind: Space<D>,
{
    pub fn m(&self) -> usize {
        self.built.problem.m()
    }

    /// Displacement of every node.
    pub fn displacement(&self) -> Vec<[f64; D]> {
        self.data.unknowns.displacements(&self.solution.u)
    }

    /// Stresses at the nodes.
    pub fn stresses(&self) -> Vec<Stress> {
        stresses(&self.built.elastic.body(), &self.displacement()).0
    }

    /// Where contact node i lies.
    pub fn place(&self, i: usize) -> [f64; D] {
        self.built.elastic.mesh.nodes[self.node(i) as usize]
    }

    /// The node of the mesh that contact node i is.
    pub fn node(&self, i: usize) -> u32 {
        self.built.elastic.contact.nodes[i].node
    }

    pub fn area(&self, i: usize) -> f64 {
        self.built.elastic.contact.nodes[i].area
    }

    /// λν over the area of contact node i.
    pub fn pressure(&self, i: usize) -> f64 {
        self.solution.lambda[i] / self.area(i)
    }

    /// λτ of contact node i as a vector along the axes: friction's force on the obstacle.
    pub fn friction(&self, i: usize) -> [f64; D] {
        let frame = &self.built.elastic.contact.nodes[i].frame;
        let along = &self.solution.lambda[self.m() + (D - 1) * i..][..D - 1];
        std::array::from_fn(|c| (0..D - 1).map(|k| along[k] * frame[1 + k][c]).sum())
    }

    /// The force of the obstacle on contact node i.
    pub fn contact_force(&self, i: usize) -> [f64; D] {
        let (normal, friction) = (
            self.built.elastic.contact.nodes[i].frame[0],
            self.friction(i),
        );
        std::array::from_fn(|c| -self.solution.lambda[i] * normal[c] - friction[c])
    }

    /// The resultants of the loads, of the contact forces on the body and of what supports hold it with: forces inside
    /// the body less loads and contact, where a component of a node is held.
    pub fn resultants(&self) -> [[f64; D]; 3] {
        let (body, unknowns) = (self.built.elastic.body(), &self.data.unknowns);
        let mut forces = internal_forces(&body, unknowns, &self.displacement());
        let mut contact = [0.0; D];
        for i in 0..self.m() {
            let (node, force) = (self.node(i) as usize, self.contact_force(i));
            (0..D).for_each(|c| forces[node][c] -= force[c]);
            (0..D).for_each(|c| contact[c] += force[c]);
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
