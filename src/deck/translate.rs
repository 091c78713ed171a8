//! From the contents of a deck to the model on its mesh.

mod contacts;
mod equations;
mod general;
mod loads;
mod nodes;
mod points;
mod springs;

use super::AnyDefinition;
use super::adjust::Adjustment;
use super::history::Times;
use super::said::{Kind, Load, MaterialCard, Refusal, Said, Section, What};
use crate::elasticity::{Material, Plane};
use crate::mesh::abaqus::index::{Index, Wrong};
use crate::model::{Definition, Filling, Geometry, Quantity, Steps, Units};
use equations::{Alike, Row};
use std::collections::BTreeMap;

type Result<T> = std::result::Result<T, Wrong>;

/// The model of a deck, and entries without effect.
pub(super) struct Translated {
    pub definition: AnyDefinition,
    /// Its parts by their paths, such as `support[0]`, each with its line of the deck.
    pub lines: Vec<(String, usize)>,
    pub notes: Vec<String>,
    pub adjustments: Vec<Adjustment>,
    /// Whether there is a quantity with a value for each node.
    pub has_nodal_values: bool,
}

/// Refuses entries that are wrong whatever the mesh.
pub(super) fn check(said: &mut Said) {
    if said.steps.is_empty() {
        said.refuse(
            1,
            "STEP",
            "there is no *STEP: this is a mesh; name it in a case file",
        );
    }
    let ignored = said.passed.keys().any(|key| key.ends_with("(ignored)"));
    let procedure = said.refusals.is_empty() && !ignored;
    let none: Vec<usize> = (said.steps.iter())
        .filter(|step| procedure && !step.is_static)
        .map(|step| step.line)
        .collect();
    for line in none {
        said.refuse(line, "STEP", "*STEP: *STATIC is missing");
    }
    let is_on_mass =
        |load: &Load| matches!(load.what, What::Gravity { .. } | What::Centrifugal { .. });
    match said.masses {
        Some(line) if said.loads.iter().any(is_on_mass) => {
            let text =
                "*MASS: GRAV and CENTRIF act in bodies only: state the force on a mass by *CLOAD";
            said.refuse(line, "MASS", text);
        }
        // Nothing accelerates.
        Some(line) => {
            said.passed.insert("MASS".to_owned(), line);
        }
        None => {}
    }
    let springs = said.types.iter().any(|name| name.starts_with("SPRING"));
    let is_refused = |one: &Refusal| one.key == "SPRING";
    if springs && said.springs.is_empty() && !said.refusals.iter().any(is_refused) {
        said.refuse(1, "SPRING", "there are elements of springs, but no *SPRING");
    }
    let planes = PLANES.map(|(begin, _)| said.types.iter().any(|name| name.starts_with(begin)));
    let [_, _, revolution] = planes;
    if planes.iter().filter(|&&is_there| is_there).count() > 1 {
        let text = "elements of plane strain, of plane stress or of revolution in one deck";
        said.refuse(1, if revolution { "CAX" } else { "CPS" }, text);
    }
}

/// The first letters of plane element types, and their states.
const PLANES: [(&str, Plane); 3] = [
    ("CPE", Plane::PlaneStrain),
    ("CPS", Plane::PlaneStress),
    ("CAX", Plane::Axisymmetric),
];

/// The state of a translation.
struct Translation<'a, 'i, const D: usize> {
    said: &'a Said<'a>,
    index: &'a mut Index<'i>,
    times: Times<'a>,
    place: &'a dyn Fn(usize) -> String,
    definition: Definition<D>,
    lines: Vec<(String, usize)>,
    notes: Vec<String>,
    adjustments: Vec<Adjustment>,
    has_nodal_values: bool,
    refusals: Vec<Refusal>,
    /// Nodes that elements of bodies have.
    used: Vec<bool>,
    /// The section of each element.
    section: Vec<Option<usize>>,
    /// The regions of the sections: section, name, elements.
    regions: Vec<(usize, String, Vec<u32>)>,
    /// Displacements that are equal, by direction and node, as numbers of `equal`.
    equal_of: BTreeMap<(usize, u32), usize>,
    equal: Vec<Alike>,
    /// All other equations.
    rows: Vec<Row<D>>,
    /// Reference nodes, each with the component of its constraint that its first direction is.
    points: BTreeMap<u32, usize>,
    /// Numbers of the sets that are made here, by their names.
    made: BTreeMap<&'static str, usize>,
    /// The name of the boundary that all of the outside is, once it has been made.
    outside: Option<String>,
}

/// The model on the mesh, and all entries that it cannot express; `place` names a line of the deck.
pub(super) fn definition(
    said: &Said,
    index: &mut Index,
    place: &dyn Fn(usize) -> String,
) -> Result<(Translated, Vec<Refusal>)> {
    match index.is_solid() {
        true => translated(said, index, place, AnyDefinition::Space),
        false => translated(said, index, place, AnyDefinition::Plane),
    }
}

fn translated<const D: usize>(
    said: &Said,
    index: &mut Index,
    place: &dyn Fn(usize) -> String,
    any: fn(Definition<D>) -> AnyDefinition,
) -> Result<(Translated, Vec<Refusal>)> {
    let mut translation = Translation {
        said,
        times: Times::new(said),
        place,
        definition: Definition::default(),
        lines: vec![("mesh".to_owned(), 1)],
        notes: Vec::new(),
        adjustments: Vec::new(),
        has_nodal_values: false,
        refusals: Vec::new(),
        used: index.used_nodes(),
        section: vec![None; index.n_elements()],
        regions: Vec::new(),
        equal_of: BTreeMap::new(),
        equal: Vec::new(),
        rows: Vec::new(),
        points: BTreeMap::new(),
        made: BTreeMap::new(),
        outside: None,
        index,
    };
    translation.whole();
    translation.materials()?;
    translation.equations()?;
    translation.find_points()?;
    translation.nodes(Kind::Boundary)?;
    translation.distributed()?;
    translation.nodes(Kind::Force)?;
    translation.put_equal();
    translation.put_equations()?;
    translation.put_points()?;
    translation.springs()?;
    translation.temperatures()?;
    translation.contacts()?;
    translation.general()?;
    translation.steps();
    let made = Translated {
        definition: any(translation.definition),
        lines: translation.lines,
        notes: translation.notes,
        adjustments: translation.adjustments,
        has_nodal_values: translation.has_nodal_values,
    };
    Ok((made, translation.refusals))
}

impl<const D: usize> Translation<'_, '_, D> {
    /// Refuses something, unless the user ignores it.
    fn refuse(&mut self, line: usize, key: &str, text: impl Into<String>) {
        if self.said.ignores(key) {
            let place = (self.place)(line);
            self.notes.push(format!("{place}: {key} is ignored"));
            return;
        }
        self.refusals.push(Refusal {
            line,
            key: key.to_owned(),
            text: text.into(),
        });
    }

    /// Records the line of a part: the next one of a kind, by the key of its table.
    fn comes_from(&mut self, line: usize, key: &str) {
        let alike = |one: &&(String, usize)| one.0.split('[').next() == Some(key);
        let number = self.lines.iter().filter(alike).count();
        self.lines.push((format!("{key}[{number}]"), line));
    }

    /// A name that nothing has.
    fn name(&mut self, what: &'static str) -> String {
        loop {
            let number = self.made.entry(what).or_default();
            *number += 1;
            let name = format!("{what}-{number}");
            if !self.index.is_taken(&name) {
                return name;
            }
        }
    }

    /// The properties of the whole model.
    fn whole(&mut self) {
        // A deck does not state its units.
        self.definition.units = Some(Units::untold());
        if let Some(line) = self.said.large {
            self.definition.analysis.geometry = Geometry::Large;
            if self.said.steps.first().is_some_and(|step| step.line < line) {
                self.notes.push(format!(
                    "line {line}: *STEP, NLGEOM: displacements are large in the steps before it as well"
                ));
            }
        }
        if D == 2 {
            let is_there = |begin: &str| self.said.types.iter().any(|name| name.starts_with(begin));
            let plane = PLANES.iter().rfind(|(begin, _)| is_there(begin));
            let plane = plane.map_or(Plane::PlaneStrain, |known| known.1);
            self.definition.analysis.plane = Some(plane);
            if plane != Plane::Axisymmetric && !self.thickness_differs() {
                let mut sections = self.said.sections.iter();
                self.definition.analysis.thickness = sections.find_map(|section| section.thickness);
            }
        }
    }

    /// Whether bodies of the plane have more than one thickness: without a statement it is 1.
    fn thickness_differs(&self) -> bool {
        let mut all = self.said.sections.iter().map(Section::thickness);
        let first = all.next();
        D == 2 && !self.is_of_revolution() && all.any(|thickness| Some(thickness) != first)
    }

    fn is_of_revolution(&self) -> bool {
        self.definition.plane() == Plane::Axisymmetric
    }

    /// The load steps, if there are several.
    fn steps(&mut self) {
        let number = self.times.ends.len();
        let parts = self.definition.parts();
        let states_steps = parts
            .map(|(_, part)| part.facts().factors)
            .any(|all| !all.is_empty());
        if number > 1 || states_steps {
            let line = self.said.steps[0].line;
            self.lines.push(("steps".to_owned(), line));
            let factors = vec![1.0; number];
            self.definition.steps = Some(Steps {
                factors,
                ..Steps::default()
            });
        }
    }

    fn materials(&mut self) -> Result<()> {
        let differs = self.thickness_differs();
        for (number, section) in self.said.sections.iter().enumerate() {
            let found = (self.said.materials.iter()).find(|one| one.name == section.material);
            let Some(material) = found else {
                let text = format!("there is no *MATERIAL \"{}\"", section.material);
                return Err((section.line, text));
            };
            let elements = self.index.elements(section.line, section.set)?;
            let name = self.index.set_name(false, section.set);
            let name = name.unwrap_or_else(|| section.set.text.to_owned());
            // Elements of one node lead others, as those of couplings do.
            let is_stiff = elements.iter().any(|&e| self.index.ends(e).len() > 1);
            let of_bodies = elements.into_iter().filter(|&e| self.index.is_of_body(e));
            let elements: Vec<u32> = of_bodies.collect();
            if elements.is_empty() {
                if is_stiff {
                    let text = format!(
                        "*SOLID SECTION: \"{}\" has no elements of bodies; trusses, shells, beams and, among solids, elements of the plane are not supported",
                        section.set
                    );
                    self.refuse(section.line, "SOLID SECTION", text);
                }
                continue;
            }
            for &element in &elements {
                self.section[element as usize] = Some(number);
            }
            let Some([young, poisson]) = material.elastic else {
                self.index.add_region(&name, &elements);
                self.regions.push((number, name, elements));
                if !material.is_refused {
                    let text = format!("*MATERIAL \"{}\" has no *ELASTIC", material.name);
                    self.refuse(material.line, "", text);
                }
                continue;
            };
            for (name, elements, modes) in self.by_modes(name, elements) {
                self.index.add_region(&name, &elements);
                self.regions.push((number, name.clone(), elements));
                self.comes_from(material.line, "material");
                let stated = Material {
                    density: material.density.unwrap_or_default(),
                    expansion: material.expansion,
                    incompatible_modes: modes,
                    thickness: differs.then(|| section.thickness()),
                    ..Material::new(young, poisson)
                };
                let filling = Filling::of(Some(name.into()), stated);
                self.definition.materials.push(filling);
            }
        }
        Ok(())
    }

    /// The elements of a section, those with incompatible modes apart from others that could have some: each with the name of
    /// their region.
    fn by_modes(&mut self, name: String, elements: Vec<u32>) -> Vec<(String, Vec<u32>, bool)> {
        let (with, rest): (Vec<u32>, Vec<u32>) =
            (elements.iter()).partition(|&&element| self.index.has_modes(element));
        let without = |&element: &u32| self.index.may_have_modes(element);
        if with.is_empty() || !rest.iter().any(without) {
            return vec![(name, elements, !with.is_empty())];
        }
        let parts = [(with, true), (rest, false)];
        (parts.into_iter())
            .map(|(elements, modes)| (self.name("section"), elements, modes))
            .collect()
    }

    /// The material of a section; an empty one if it is missing.
    fn material(&self, section: usize) -> MaterialCard {
        let name = &self.said.sections[section].material;
        let material = self.said.materials.iter().find(|one| one.name == *name);
        material.cloned().unwrap_or_default()
    }
}

/// A part with its own load factors, if there are any; `add` sets them.
fn with_factors<P>(part: P, factors: Option<Vec<f64>>, add: fn(P, Vec<f64>) -> P) -> P {
    match factors {
        Some(factors) => add(part, factors),
        None => part,
    }
}

/// Numbers or expressions along the axes as quantities, without empty ones.
fn quantities<const D: usize>(
    line: usize,
    texts: &[String; 3],
) -> Result<impl Iterator<Item = (usize, Quantity<D>)>> {
    let mut all = Vec::new();
    for (axis, text) in texts.iter().enumerate().take(D) {
        match text.parse::<f64>() {
            _ if text.is_empty() => {}
            Ok(value) => all.push((axis, value.into())),
            Err(_) => all.push((axis, Quantity::parse(text).map_err(|text| (line, text))?)),
        }
    }
    Ok(all.into_iter())
}
