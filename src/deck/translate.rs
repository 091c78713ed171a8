//! From what a deck says to the tables of a case.

mod contacts;
mod loads;
mod nodes;

use super::adjust::Adjustment;
use super::history::Times;
use super::said::{Kind, MaterialCard, Refusal, Said};
use super::write::{Number, list, quoted};
use crate::mesh::abaqus::index::{Index, Wrong};
use nodes::Equal;
use std::collections::BTreeMap;
use std::fmt::{Display, Write as _};

type Result<T> = std::result::Result<T, Wrong>;

/// The case, and what has no effect in it.
pub(super) struct Translated {
    pub text: String,
    /// The tables by their paths, such as `support[0]`, each with the line of the deck that it comes from.
    pub lines: Vec<(String, usize)>,
    pub notes: Vec<String>,
    pub adjustments: Vec<Adjustment>,
    /// Whether there is a quantity with a value for each node.
    pub has_nodal_values: bool,
}

/// Refuses what shows without the mesh.
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
        said.refuse(line, "STEP", "*STEP: it has no *STATIC");
    }
    let planes = PLANES.map(|(begin, _)| said.types.iter().any(|name| name.starts_with(begin)));
    let [_, stress, revolution] = planes;
    if planes.iter().filter(|&&is_there| is_there).count() > 1 {
        let text = "elements of plane strain, of plane stress or of revolution in one deck";
        said.refuse(1, if revolution { "CAX" } else { "CPS" }, text);
    }
    let strain = planes[0];
    let mut thicknesses: Vec<(usize, f64)> = (said.sections.iter())
        .filter_map(|section| Some((section.line, section.thickness?)))
        .collect();
    thicknesses.dedup_by_key(|one| one.1);
    if let ([_, (line, _), ..], true) = (&thicknesses[..], stress || strain) {
        let line = *line;
        said.refuse(
            line,
            "SOLID SECTION",
            "*SOLID SECTION: all bodies have one thickness",
        );
    }
}

/// How the types of elements in the plane begin, and what they are.
const PLANES: [(&str, &str); 3] = [
    ("CPE", "plane_strain"),
    ("CPS", "plane_stress"),
    ("CAX", "axisymmetric"),
];

/// What is known while a deck becomes a case.
struct Translation<'a, 'i> {
    said: &'a Said<'a>,
    index: &'a mut Index<'i>,
    times: Times<'a>,
    place: &'a dyn Fn(usize) -> String,
    text: String,
    lines: Vec<(String, usize)>,
    notes: Vec<String>,
    adjustments: Vec<Adjustment>,
    has_nodal_values: bool,
    refusals: Vec<Refusal>,
    /// 2 or 3.
    dimension: usize,
    /// Nodes that elements of bodies have.
    used: Vec<bool>,
    /// The section of each element.
    section: Vec<Option<usize>>,
    /// The regions of the sections: section, name, elements.
    regions: Vec<(usize, String, Vec<u32>)>,
    /// Displacements that are equal, by direction and node, as numbers of `equal`.
    equal_of: BTreeMap<(usize, u32), usize>,
    equal: Vec<Equal>,
    /// Numbers of the sets that are made here, by what they are called.
    made: BTreeMap<&'static str, usize>,
}

const AXES: [&str; 3] = ["x", "y", "z"];
const AROUND: [&str; 3] = ["radial", "hoop", "axial"];

/// The text of the case on a mesh file, and all that cannot be said in it; `place` names a line of the deck.
pub(super) fn case(
    said: &Said,
    index: &mut Index,
    mesh: &str,
    place: &dyn Fn(usize) -> String,
) -> Result<(Translated, Vec<Refusal>)> {
    let dimension = if index.is_solid() { 3 } else { 2 };
    let mut translation = Translation {
        said,
        times: Times::new(said),
        place,
        text: String::new(),
        lines: vec![("mesh".to_owned(), 1)],
        notes: Vec::new(),
        adjustments: Vec::new(),
        has_nodal_values: false,
        refusals: Vec::new(),
        dimension,
        used: index.used_nodes(),
        section: vec![None; index.n_elements()],
        regions: Vec::new(),
        equal_of: BTreeMap::new(),
        equal: Vec::new(),
        made: BTreeMap::new(),
        index,
    };
    translation.head(mesh);
    translation.materials()?;
    translation.equations()?;
    translation.nodes(Kind::Boundary)?;
    translation.distributed()?;
    translation.nodes(Kind::Force)?;
    translation.put_equal();
    translation.temperatures()?;
    translation.contacts()?;
    translation.steps();
    let made = Translated {
        text: translation.text,
        lines: translation.lines,
        notes: translation.notes,
        adjustments: translation.adjustments,
        has_nodal_values: translation.has_nodal_values,
    };
    Ok((made, translation.refusals))
}

impl Translation<'_, '_> {
    /// Refuses something, unless the user goes on without it.
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

    /// Adds a line.
    fn put(&mut self, line: impl Display) {
        // Nothing is in the way of writing into a text.
        let _ = writeln!(self.text, "{line}");
    }

    /// Begins a table with the place that it comes from.
    fn table(&mut self, line: usize, name: &str) {
        let place = (self.place)(line);
        self.put(format_args!("\n# {place}\n{name}"));
        let key = name.trim_matches(['[', ']']);
        let path = match name.starts_with("[[") {
            true => {
                let alike = |one: &&(String, usize)| one.0.split('[').next() == Some(key);
                format!("{key}[{}]", self.lines.iter().filter(alike).count())
            }
            false => key.to_owned(),
        };
        self.lines.push((path, line));
    }

    fn put_factors(&mut self, factors: &Option<Vec<f64>>) {
        if let Some(factors) = factors {
            self.put(format_args!("factors = {}", list(factors)));
        }
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

    fn head(&mut self, mesh: &str) {
        if !self.said.title.is_empty() {
            self.put(format_args!("title = {}\n", quoted(&self.said.title)));
        }
        self.text.push_str(&format!(
            "# {}\n[mesh]\nfile = {}\n",
            (self.place)(1),
            quoted(mesh)
        ));
        // A deck does not tell its units.
        self.put("\n[units]\nlength = \"\"\nforce = \"\"");
        if self.dimension == 2 {
            let plane = self.plane();
            self.put(format_args!("\n[analysis]\nplane = \"{plane}\""));
            if self.is_of_revolution() {
                return;
            }
            let thickness = self
                .said
                .sections
                .iter()
                .find_map(|section| section.thickness);
            if let Some(thickness) = thickness {
                self.put(format_args!("thickness = {}", Number(thickness)));
            }
        }
    }

    /// What the elements of a deck in the plane are.
    fn plane(&self) -> &'static str {
        let is_there = |begin: &str| self.said.types.iter().any(|name| name.starts_with(begin));
        let known = PLANES.iter().rfind(|(begin, _)| is_there(begin));
        known.map_or("plane_strain", |known| known.1)
    }

    fn is_of_revolution(&self) -> bool {
        self.dimension == 2 && self.plane() == "axisymmetric"
    }

    /// The load steps, if there are several.
    fn steps(&mut self) {
        if self.times.ends.len() > 1 {
            let factors = list(&vec![1.0; self.times.ends.len()]);
            self.table(self.said.steps[0].line, "[steps]");
            self.put(format_args!("factors = {factors}"));
        }
    }

    fn materials(&mut self) -> Result<()> {
        for (number, section) in self.said.sections.iter().enumerate() {
            let found = (self.said.materials.iter()).find(|one| one.name == section.material);
            let Some(material) = found else {
                let text = format!("there is no *MATERIAL \"{}\"", section.material);
                return Err((section.line, text));
            };
            let part = section.part.as_deref();
            for (name, elements) in self
                .index
                .elements_of_part(section.line, part, section.set)?
            {
                let of_bodies = elements.into_iter().filter(|&e| self.index.is_of_body(e));
                let elements: Vec<u32> = of_bodies.collect();
                if elements.is_empty() {
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
                        self.refuse(material.line, "MATERIAL", text);
                    }
                    continue;
                };
                for (name, elements, modes) in self.by_modes(name, elements) {
                    self.index.add_region(&name, &elements);
                    self.regions.push((number, name.clone(), elements));
                    self.table(material.line, "[[material]]");
                    self.put(format_args!("region = {}", quoted(&name)));
                    self.put(format_args!("young = {}", Number(young)));
                    self.put(format_args!("poisson = {}", Number(poisson)));
                    if material.density != 0.0 {
                        self.put(format_args!("density = {}", Number(material.density)));
                    }
                    if material.expansion != 0.0 {
                        self.put(format_args!("expansion = {}", Number(material.expansion)));
                    }
                    if modes {
                        self.put("incompatible_modes = true");
                    }
                }
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

    /// The material of a section; one without anything where there is none.
    fn material(&self, section: usize) -> MaterialCard {
        let name = &self.said.sections[section].material;
        let material = self.said.materials.iter().find(|one| one.name == *name);
        material.cloned().unwrap_or_default()
    }
}
