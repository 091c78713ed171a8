//! The contents of a deck.

use super::history::Stated;
use crate::mesh::abaqus::index::Name;
use std::collections::{BTreeMap, BTreeSet, HashSet};

/// An entry that changes the result and is not supported.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Refusal {
    pub line: usize,
    /// Its name for `--ignore`; empty if ignoring it leaves no valid case.
    pub key: String,
    pub text: String,
}

/// `*MATERIAL` with its subsequent keywords.
#[derive(Clone, Debug, Default)]
pub(super) struct MaterialCard {
    pub line: usize,
    /// In capitals.
    pub name: String,
    pub elastic: Option<[f64; 2]>,
    pub density: Option<f64>,
    pub expansion: f64,
    /// Whether its law has been refused.
    pub is_refused: bool,
}

/// `*SOLID SECTION`.
pub(super) struct Section<'a> {
    pub line: usize,
    pub set: Name<'a>,
    /// In capitals.
    pub material: String,
    pub thickness: Option<f64>,
}

impl Section<'_> {
    /// That of its elements in the plane.
    pub fn thickness(&self) -> f64 {
        self.thickness.unwrap_or(1.0)
    }
}

/// `*AMPLITUDE`: times and factors.
pub(super) struct Amplitude {
    /// In capitals.
    pub name: String,
    /// Whether times count from the beginning of the first step.
    pub total: bool,
    pub points: Vec<[f64; 2]>,
}

impl Amplitude {
    /// Between the points linear, constant before and behind them.
    pub fn at(&self, time: f64) -> f64 {
        let after = self.points.partition_point(|point| point[0] < time);
        let Some(&[t, a]) = self.points.get(after) else {
            return self.points.last().map_or(1.0, |point| point[1]);
        };
        match after.checked_sub(1) {
            None => a,
            Some(before) => {
                let [s, b] = self.points[before];
                b + (a - b) * (time - s) / (t - s)
            }
        }
    }
}

/// `*STEP` with `*STATIC`.
pub(super) struct StepCard {
    pub line: usize,
    pub period: f64,
    /// Loads without an amplitude act at once, instead of growing over the step.
    pub at_once: bool,
    pub is_static: bool,
}

/// The kinds that OP=NEW resets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) enum Kind {
    Boundary,
    Force,
    Distributed,
    Surface,
    Temperature,
}

/// A data line of a load.
#[derive(Clone, Debug)]
pub(super) enum What<'a> {
    /// All earlier ones of the kind are removed.
    Clear(Kind),
    /// Components from 0; those of rotations are 3 to 5.
    Boundary {
        target: &'a str,
        components: Vec<usize>,
        value: f64,
    },
    /// From a step on, displacements keep their values from its beginning.
    Fixed {
        target: &'a str,
        components: Vec<usize>,
    },
    /// Components from 0; those of rotations are 3 to 5.
    Force {
        target: &'a str,
        component: usize,
        value: f64,
    },
    /// On a face of elements.
    Face {
        target: &'a str,
        face: usize,
        value: f64,
    },
    Pressure {
        surface: &'a str,
        value: f64,
    },
    Gravity {
        target: &'a str,
        size: f64,
        direction: [f64; 3],
    },
    /// The square of an angular velocity, a point of the axis and its direction.
    Centrifugal {
        target: &'a str,
        square: f64,
        point: [f64; 3],
        direction: [f64; 3],
    },
    /// Along an axis from 0.
    Volume {
        target: &'a str,
        axis: usize,
        value: f64,
    },
    Temperature {
        target: &'a str,
        value: f64,
    },
}

/// A load or a support.
pub(super) struct Load<'a> {
    pub line: usize,
    /// None: before the first one.
    pub step: Option<usize>,
    pub what: What<'a>,
    /// The number of its amplitude.
    pub amplitude: Option<usize>,
}

impl Load<'_> {
    /// Where it is; entries before the first step act in it.
    pub fn stated(&self) -> Stated {
        Stated {
            step: self.step.unwrap_or(0),
            line: self.line,
            amplitude: self.amplitude,
        }
    }
}

/// `*SURFACE BEHAVIOR`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Behavior {
    /// Pressures per overlap, each starting at an overlap (below 0 a gap), that add up; none: hard.
    pub springs: Vec<[f64; 2]>,
    pub tied: bool,
}

/// `*SURFACE INTERACTION` with its subsequent keywords.
#[derive(Clone, Debug, Default)]
pub(super) struct Interaction {
    /// In capitals.
    pub name: String,
    pub behavior: Behavior,
    pub friction: Option<f64>,
    pub stick_slope: Option<f64>,
}

/// The value of `ADJUST=`.
#[derive(Clone, Copy)]
pub(super) enum Adjust<'a> {
    Distance(f64),
    Set(&'a str),
}

/// `*CONTACT PAIR`, a line of it.
pub(super) struct PairCard<'a> {
    pub line: usize,
    pub slave: &'a str,
    pub master: &'a str,
    /// In capitals.
    pub interaction: String,
    pub adjust: Option<Adjust<'a>>,
}

/// A line of general contact.
pub(super) struct GeneralCard<'a> {
    pub line: usize,
    /// Two surfaces, or one twice; empty: all of the outside.
    pub sides: [&'a str; 2],
    pub what: General,
}

/// What a line of general contact says of two surfaces.
pub(super) enum General {
    Included,
    Excluded,
    /// The name of their interaction, in capitals.
    Interaction(String),
    /// The name of their initialization, in capitals.
    Initialization(String),
}

/// `*CONTACT INITIALIZATION DATA`.
pub(super) struct Initialization {
    /// In capitals.
    pub name: String,
    /// Overlaps are pressed apart.
    pub pressed: bool,
    /// Gaps up to this distance are closed.
    pub above: f64,
}

/// `*CHANGE FRICTION`: the coefficient of an interaction from a step on.
pub(super) struct FrictionChange {
    pub step: usize,
    /// Its number.
    pub interaction: usize,
    pub friction: f64,
}

/// `*CHANGE SURFACE BEHAVIOR`: the behavior of an interaction from a step on.
pub(super) struct BehaviorChange {
    pub line: usize,
    pub step: usize,
    /// Its number.
    pub interaction: usize,
    pub behavior: Behavior,
}

/// `*MODEL CHANGE, TYPE=CONTACT PAIR`, a line of it: whether a pair acts from a step on.
pub(super) struct PairChange {
    pub line: usize,
    pub step: usize,
    /// Slave and master, in capitals.
    pub surfaces: [String; 2],
    pub acts: bool,
}

/// `*TIE`, a line of it.
pub(super) struct TieCard<'a> {
    pub line: usize,
    /// The sides of a sector.
    pub cyclic: bool,
    pub name: Option<&'a str>,
    pub slave: Name<'a>,
    pub master: Name<'a>,
    pub tolerance: Option<f64>,
}

/// `*CLEARANCE`.
pub(super) struct Clearance {
    pub line: usize,
    /// Slave and master, in capitals.
    pub surfaces: [String; 2],
    pub value: f64,
}

/// `*SPRING`.
pub(super) struct SpringCard<'a> {
    pub line: usize,
    /// Of elements.
    pub set: Name<'a>,
    /// From 0; None: from end to end.
    pub component: Option<usize>,
    pub stiffness: f64,
}

/// Which node leads a coupling.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Reference<'a> {
    Node(Name<'a>),
    /// That of the elements of a set.
    Elements(Name<'a>),
}

/// `*COUPLING`, `*KINEMATIC COUPLING`, `*DISTRIBUTING COUPLING`, `*RIGID BODY` or `*MPC, BEAM`: nodes that move with a reference node.
pub(super) struct CouplingCard<'a> {
    pub line: usize,
    /// The keyword.
    pub keyword: &'static str,
    pub name: Option<&'a str>,
    pub reference: Reference<'a>,
    /// The node whose displacements are the rotations, if it is another one.
    pub rotation: Option<Name<'a>>,
    pub surface: Option<Name<'a>>,
    /// Nodes, or sets of them.
    pub nodes: Vec<Name<'a>>,
    pub distributing: bool,
    /// The directions that are coupled.
    pub bound: [bool; 3],
}

impl<'a> CouplingCard<'a> {
    /// Nodes that move rigidly with a reference.
    pub fn rigid(
        line: usize,
        keyword: &'static str,
        reference: Reference<'a>,
        nodes: Vec<Name<'a>>,
    ) -> Self {
        Self {
            line,
            keyword,
            name: None,
            reference,
            rotation: None,
            surface: None,
            nodes,
            distributing: false,
            bound: [true; 3],
        }
    }
}

/// `*CYCLIC SYMMETRY MODEL`: sectors of a tie.
pub(super) struct SectorCard<'a> {
    pub line: usize,
    pub sectors: u32,
    /// The name of the tie; None: all.
    pub tie: Option<&'a str>,
    /// Two points of the axis.
    pub axis: [f64; 6],
}

/// `*PRE-TENSION SECTION`.
pub(super) struct PretensionCard<'a> {
    pub line: usize,
    pub surface: Name<'a>,
    pub reference: Name<'a>,
    pub normal: Option<[f64; 3]>,
}

/// An equation: the sum of its terms is zero.
pub(super) struct EquationCard<'a> {
    pub line: usize,
    /// Nodes, or sets of them, each with a component, from 0, and its factor.
    pub terms: Vec<(Name<'a>, usize, f64)>,
}

/// How nodes of a `*MPC` depend on each other.
pub(super) enum MpcKind {
    /// Two nodes keep their distance.
    Link,
    /// They stay on the line through the first two.
    Straight,
    /// They stay in the plane of the first three.
    Plane,
}

/// `*MPC`.
pub(super) struct MpcCard<'a> {
    pub line: usize,
    pub name: &'a str,
    pub kind: MpcKind,
    /// Nodes, or sets of them.
    pub nodes: Vec<Name<'a>>,
}

/// `*TRANSFORM`.
pub(super) struct Transform<'a> {
    pub set: Name<'a>,
    pub line: usize,
    pub cylindrical: bool,
    pub points: [f64; 6],
}

/// The whole contents of a deck.
#[derive(Default)]
pub(super) struct Said<'a> {
    pub title: String,
    pub materials: Vec<MaterialCard>,
    pub sections: Vec<Section<'a>>,
    pub amplitudes: Vec<Amplitude>,
    pub steps: Vec<StepCard>,
    /// The kinds of loads with cards in each step; None before the first.
    pub load_cards: BTreeSet<(Option<usize>, Kind)>,
    /// The sets of nodes that keep the order in which they are listed.
    pub unsorted: Vec<String>,
    /// The line of the first step with large displacements.
    pub large: Option<usize>,
    pub loads: Vec<Load<'a>>,
    /// Node or set and value, with the line.
    pub initial_temperatures: Vec<(usize, &'a str, f64)>,
    pub interactions: Vec<Interaction>,
    pub pairs: Vec<PairCard<'a>>,
    /// The line of `*CONTACT`.
    pub general_contact: Option<usize>,
    pub general: Vec<GeneralCard<'a>>,
    pub initializations: Vec<Initialization>,
    pub friction_changes: Vec<FrictionChange>,
    pub behavior_changes: Vec<BehaviorChange>,
    pub pair_changes: Vec<PairChange>,
    pub ties: Vec<TieCard<'a>>,
    pub clearances: Vec<Clearance>,
    pub transforms: Vec<Transform<'a>>,
    pub equations: Vec<EquationCard<'a>>,
    pub multi_point: Vec<MpcCard<'a>>,
    pub springs: Vec<SpringCard<'a>>,
    pub couplings: Vec<CouplingCard<'a>>,
    pub pretensions: Vec<PretensionCard<'a>>,
    pub sectors: Vec<SectorCard<'a>>,
    /// The line of the first masses at nodes.
    pub masses: Option<usize>,
    /// The types of the elements of bodies, in capitals.
    pub types: BTreeSet<String>,
    pub refusals: Vec<Refusal>,
    /// Skipped keywords, with the first line of each.
    pub passed: BTreeMap<String, usize>,
    /// Names that the user ignores, in capitals.
    pub ignored: HashSet<String>,
    /// The place of the part whose keywords are read.
    pub place: Option<usize>,
    /// The current material and interaction of keywords.
    pub material: Option<usize>,
    pub interaction: Option<usize>,
    /// Whether the next `*FRICTION` is about a step.
    pub changes_friction: bool,
    /// Whether the next `*SURFACE BEHAVIOR` is.
    pub changes_behavior: bool,
}
