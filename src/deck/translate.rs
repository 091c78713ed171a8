//! From what a deck says to the tables of a case.

use super::adjust::{Adjustment, Moved};
use super::cards::{Adjust, Kind, MaterialCard, Refusal, Said, Transform, What};
use super::history::{Times, Tracks};
use super::write::{Number, factors, list, quoted};
use crate::mesh::abaqus::index::{Index, Wrong};
use crate::mesh::abaqus::keyword::key;
use crate::mesh::vector::{cross, minus, unit};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{Display, Write as _};

type Result<T> = std::result::Result<T, Wrong>;

/// The case, and what has no effect in it.
pub(super) struct Translated {
    pub text: String,
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
        notes: translation.notes,
        adjustments: translation.adjustments,
        has_nodal_values: translation.has_nodal_values,
    };
    Ok((made, translation.refusals))
}

/// Nodes of bodies whose displacements along an axis are equal.
struct Equal {
    line: usize,
    component: usize,
    /// Sorted.
    nodes: Vec<u32>,
    /// Whether a support says what these displacements are: then it does so for all of them.
    held: bool,
}

/// Nodes with the same values of one component.
struct Alike {
    line: usize,
    component: usize,
    values: Vec<f64>,
    nodes: Vec<u32>,
    transform: Option<usize>,
    origin: String,
}

/// Faces with the same pressure: the line, the pressure at the end of each load step, elements and their faces.
type Pressed = (usize, Vec<f64>, Vec<(u32, usize)>);

/// What nodes have in one table.
struct Table {
    line: usize,
    nodes: Vec<u32>,
    transform: Option<usize>,
    origin: String,
    components: Vec<(usize, f64)>,
    factors: Option<Vec<f64>>,
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
                self.index.add_region(&name, &elements);
                self.regions.push((number, name.clone(), elements));
                let Some([young, poisson]) = material.elastic else {
                    if !material.is_refused {
                        let text = format!("*MATERIAL \"{}\" has no *ELASTIC", material.name);
                        self.refuse(material.line, "MATERIAL", text);
                    }
                    continue;
                };
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
            }
        }
        Ok(())
    }

    /// The material of a section; one without anything where there is none.
    fn material(&self, section: usize) -> MaterialCard {
        let name = &self.said.sections[section].material;
        let material = self.said.materials.iter().find(|one| one.name == *name);
        material.cloned().unwrap_or_default()
    }

    /// The number of the transform that turns the directions of a node; the last that names it.
    fn transforms(&mut self) -> Result<BTreeMap<u32, usize>> {
        let mut of_node = BTreeMap::new();
        for (number, transform) in self.said.transforms.iter().enumerate() {
            for node in self.index.nodes(transform.line, transform.set)? {
                match transform.axes() {
                    Some(axes) if axes == IDENTITY => of_node.remove(&node),
                    _ => of_node.insert(node, number),
                };
            }
        }
        Ok(of_node)
    }

    /// Which displacements are equal.
    fn equations(&mut self) -> Result<()> {
        let transforms = self.transforms()?;
        // The groups so far, and which one a displacement is in.
        let mut groups: Vec<(usize, Vec<(usize, u32)>)> = Vec::new();
        for equation in &self.said.equations {
            let (line, component) = (equation.line, equation.component);
            let [first, second] = equation.sides;
            let (first, second) = (
                self.index.nodes(line, first)?,
                self.index.nodes(line, second)?,
            );
            if second.len() != 1 && second.len() != first.len() {
                let text =
                    "*EQUATION: both sets have as many nodes as each other, or the second has one";
                return Err((line, text.to_owned()));
            }
            if component >= self.dimension {
                continue;
            }
            let mut all = first.iter().chain(&second);
            if all.any(|node| transforms.contains_key(node)) {
                let text = "*EQUATION: displacements are equal along the axes, and not in directions of a *TRANSFORM";
                self.refuse(line, "EQUATION", text);
                continue;
            }
            for (node, other) in first.iter().zip(second.iter().cycle()) {
                let ends = [(component, *node), (component, *other)];
                let [a, b] = ends.map(|end| {
                    *self.equal_of.entry(end).or_insert_with(|| {
                        groups.push((line, vec![end]));
                        groups.len() - 1
                    })
                });
                if a != b {
                    let moved = std::mem::take(&mut groups[a.max(b)].1);
                    for &end in &moved {
                        self.equal_of.insert(end, a.min(b));
                    }
                    groups[a.min(b)].1.extend(moved);
                }
            }
        }
        self.equal = (groups.into_iter())
            .map(|(line, ends)| {
                let of_bodies = ends.iter().map(|end| end.1);
                let mut nodes: Vec<u32> =
                    of_bodies.filter(|&node| self.used[node as usize]).collect();
                nodes.sort_unstable();
                Equal {
                    line,
                    component: ends.first().map_or(0, |end| end.0),
                    nodes,
                    held: false,
                }
            })
            .collect();
        Ok(())
    }

    /// The nodes that something said of a node is about: it is equal to others, or no node of a body at all.
    fn meant(&mut self, kind: Kind, node: u32, component: usize) -> Vec<u32> {
        let own = self.used[node as usize];
        match self.equal_of.get(&(component, node)) {
            Some(&number) if kind == Kind::Boundary => {
                self.equal[number].held = true;
                self.equal[number].nodes.clone()
            }
            // A force moves all of them, wherever it acts.
            Some(&number) if !own && self.equal[number].nodes.is_empty() => Vec::new(),
            Some(_) => vec![node],
            None if own => vec![node],
            _ => Vec::new(),
        }
    }

    /// The nodes that move alike, as far as no support says how they move: a table for each choice of axes.
    fn put_equal(&mut self) {
        let mut axes: BTreeMap<Vec<u32>, (usize, BTreeSet<usize>)> = BTreeMap::new();
        for one in std::mem::take(&mut self.equal) {
            if one.nodes.len() > 1 && !one.held {
                let here = axes.entry(one.nodes).or_insert((one.line, BTreeSet::new()));
                here.0 = here.0.min(one.line);
                here.1.insert(one.component);
            }
        }
        let mut tables: BTreeMap<BTreeSet<usize>, (usize, Vec<Vec<u32>>)> = BTreeMap::new();
        for (nodes, (line, axes)) in axes {
            let here = tables.entry(axes).or_insert((line, Vec::new()));
            here.0 = here.0.min(line);
            here.1.push(nodes);
        }
        for (axes, (line, sets)) in tables {
            let names: Vec<String> = (sets.into_iter())
                .map(|nodes| {
                    let name = self.name("equal");
                    self.index.add_nodes(&name, &nodes);
                    quoted(&name)
                })
                .collect();
            self.table(line, "[[equal]]");
            self.put(format_args!("sets = [{}]", names.join(", ")));
            if axes.len() < self.dimension {
                let axes: Vec<String> = axes.iter().map(|&axis| quoted(AXES[axis])).collect();
                self.put(format_args!("directions = [{}]", axes.join(", ")));
            }
        }
    }

    /// Supports or forces of nodes, a table for each set of nodes that have the same.
    fn nodes(&mut self, kind: Kind) -> Result<()> {
        let transforms = self.transforms()?;
        let mut tracks = Tracks::default();
        let mut reported = BTreeSet::new();
        for load in &self.said.loads {
            let step = load.step.unwrap_or(0);
            let (target, components, value): (&str, &[usize], f64) = match &load.what {
                What::Clear(of) if *of == kind => {
                    tracks.clear(step);
                    continue;
                }
                What::Boundary {
                    target,
                    components,
                    value,
                } if kind == Kind::Boundary => (target, components, *value),
                What::Force {
                    target,
                    component,
                    value,
                } if kind == Kind::Force => (target, std::slice::from_ref(component), *value),
                _ => continue,
            };
            let origin = self.index.set_name(true, target).map_or("", |_| target);
            for node in self.index.nodes(load.line, target)? {
                let transform = transforms.get(&node).copied();
                let axes = transform.and_then(|number| self.said.transforms[number].axes());
                if kind == Kind::Boundary && axes.is_some() {
                    let text = "*BOUNDARY: directions are those of the axes, or those of a cylindrical *TRANSFORM (TYPE=C)";
                    if reported.insert(load.line) {
                        self.refuse(load.line, "TRANSFORM", text);
                    }
                    continue;
                }
                for &component in components {
                    if component >= self.dimension {
                        if value != 0.0 && reported.insert(load.line) {
                            let text = "in the plane there is no direction 3";
                            self.refuse(load.line, "BOUNDARY", text);
                        }
                        continue;
                    }
                    let meant = self.meant(kind, node, component);
                    if meant.is_empty() {
                        self.unused(kind, load.line, &mut reported);
                    }
                    for node in meant {
                        let key = (node, component);
                        tracks.set(key, load.line, origin, step, value, load.amplitude);
                    }
                }
            }
        }
        type Same = (String, usize, Option<usize>, Vec<u64>, Option<u32>);
        let mut alike: BTreeMap<Same, Alike> = BTreeMap::new();
        for ((node, component), track) in &tracks.all {
            if kind == Kind::Boundary && (track.begins() > 0 || track.ends()) {
                if reported.insert(track.line) {
                    let text = "*BOUNDARY: a support cannot come or go between steps";
                    self.refuse(track.line, "BOUNDARY", text);
                }
                continue;
            }
            let values = track.values(&self.times, 0.0);
            if kind == Kind::Force && values.iter().all(|&v| v == 0.0) {
                continue;
            }
            let transform = transforms.get(node).copied();
            let bits = values.iter().map(|v| v.to_bits()).collect();
            // A node of no body has its force on one that moves as it does, beside what that one has itself.
            let bare = Some(*node).filter(|&node| !self.used[node as usize]);
            let origin = match bare {
                None => track.origin.clone(),
                Some(_) => String::new(),
            };
            let node = match (bare, self.equal_of.get(&(*component, *node))) {
                (Some(_), Some(&number)) => self.equal[number].nodes[0],
                _ => *node,
            };
            let key = (origin.clone(), *component, transform, bits, bare);
            let here = alike.entry(key).or_insert_with(|| Alike {
                line: track.line,
                component: *component,
                values,
                nodes: Vec::new(),
                transform,
                origin,
            });
            here.line = here.line.min(track.line);
            here.nodes.push(node);
        }
        let mut alike: Vec<Alike> = alike.into_values().collect();
        alike.sort_by_key(|one| (one.line, one.component));
        for table in merged(alike) {
            self.put_nodes(kind, table)?;
        }
        Ok(())
    }

    /// About a node that is none of a body.
    fn unused(&mut self, kind: Kind, line: usize, reported: &mut BTreeSet<usize>) {
        if !reported.insert(line) {
            return;
        }
        match kind {
            Kind::Force => {
                self.refuse(
                    line,
                    "CLOAD",
                    "*CLOAD: a node that no element of a body has",
                );
            }
            _ => {
                let place = (self.place)(line);
                self.notes.push(format!(
                    "{place}: nodes that no element of a body has are left out"
                ));
            }
        }
    }

    /// The name of a set with these nodes: of the deck, if the one that named them has no others.
    fn set_of(
        &mut self,
        line: usize,
        origin: &str,
        nodes: &[u32],
        what: &'static str,
    ) -> Result<String> {
        let mut name = None;
        if !origin.is_empty() {
            let all = self.index.nodes(line, origin)?;
            let of_bodies: Vec<u32> = (all.into_iter())
                .filter(|&node| self.used[node as usize])
                .collect();
            if of_bodies == nodes {
                name = self.index.set_name(true, origin);
            }
        }
        let name = match name {
            Some(name) => name,
            None => self.name(what),
        };
        self.index.add_nodes(&name, nodes);
        Ok(name)
    }

    fn put_nodes(&mut self, kind: Kind, mut table: Table) -> Result<()> {
        table.nodes.sort_unstable();
        let (what, name) = match kind {
            Kind::Boundary => ("support", "[[support]]"),
            _ => ("force", "[[force]]"),
        };
        let set = self.set_of(table.line, &table.origin, &table.nodes, what)?;
        self.table(table.line, name);
        self.put(format_args!("nodes = {}", quoted(&set)));
        table.components.sort_by_key(|component| component.0);
        if let (Kind::Force, Some(number)) = (kind, table.transform) {
            let turned = self.said.transforms[number].turned(&table.components);
            for (axis, component) in AXES.iter().zip(turned).take(self.dimension) {
                if !component.is_empty() {
                    self.put(format_args!("{axis} = {component}"));
                }
            }
            self.put_factors(&table.factors);
            return Ok(());
        }
        let words = match table.transform {
            None => AXES,
            Some(_) => AROUND,
        };
        for (component, value) in table.components {
            self.put(format_args!("{} = {}", words[component], Number(value)));
        }
        if let Some(number) = table.transform {
            let p = &self.said.transforms[number].points;
            let a = [p[0], p[1], p[2]];
            let along = minus([p[3], p[4], p[5]], a);
            self.put(match self.dimension {
                2 => format!("axis = {{ point = {} }}", list(&a[..2])),
                _ => format!(
                    "axis = {{ point = {}, direction = {} }}",
                    list(&a),
                    list(&along)
                ),
            });
        }
        self.put_factors(&table.factors);
        Ok(())
    }

    /// Loads on faces, surfaces and volumes.
    fn distributed(&mut self) -> Result<()> {
        // Faces by their elements and numbers; surfaces by names; volumes by sets, and where the load points.
        let mut faces = Tracks::default();
        let mut surfaces = Tracks::default();
        let mut volumes: Tracks<(String, [u64; 7])> = Tracks::default();
        for load in &self.said.loads {
            let (line, step, amplitude) = (load.line, load.step.unwrap_or(0), load.amplitude);
            let bits = |kind: u64, a: [f64; 3], b: [f64; 3]| {
                let [a, b] = [a, b].map(|v| v.map(f64::to_bits));
                [kind, a[0], a[1], a[2], b[0], b[1], b[2]]
            };
            match &load.what {
                What::Clear(Kind::Distributed) => {
                    faces.clear(step);
                    volumes.clear(step);
                }
                What::Clear(Kind::Surface) => surfaces.clear(step),
                What::Face {
                    target,
                    face,
                    value,
                } => {
                    let origin = match self.index.set_name(false, target) {
                        Some(name) => format!("{name}-P{face}"),
                        None => String::new(),
                    };
                    let elements = self.index.elements(line, target)?;
                    for element in elements {
                        if !self.index.is_of_body(element) || !self.index.has_face(element, *face) {
                            return Err((line, format!("P{face} is no face of such an element")));
                        }
                        faces.set((element, *face), line, &origin, step, *value, amplitude);
                    }
                }
                What::Pressure { surface, value } => {
                    let name = self.index.surface(line, surface)?.name;
                    surfaces.set(name, line, "", step, *value, amplitude);
                }
                What::Gravity {
                    target,
                    size,
                    direction,
                } => {
                    let key = ((*target).to_owned(), bits(0, unit(*direction), [0.0; 3]));
                    volumes.set(key, line, target, step, *size, amplitude);
                }
                What::Centrifugal {
                    target,
                    square,
                    point,
                    direction,
                } => {
                    let key = ((*target).to_owned(), bits(1, *point, unit(*direction)));
                    volumes.set(key, line, target, step, *square, amplitude);
                }
                What::Volume {
                    target,
                    axis,
                    value,
                } => {
                    let mut along = [0.0; 3];
                    along[*axis] = 1.0;
                    let key = ((*target).to_owned(), bits(2, along, [0.0; 3]));
                    volumes.set(key, line, target, step, *value, amplitude);
                }
                _ => {}
            }
        }
        let mut alike: BTreeMap<(String, Vec<u64>), Pressed> = BTreeMap::new();
        for (face, track) in &faces.all {
            let values = track.values(&self.times, 0.0);
            let bits = values.iter().map(|v| v.to_bits()).collect();
            let here = alike.entry((track.origin.clone(), bits));
            let here = here.or_insert_with(|| (track.line, values, Vec::new()));
            here.0 = here.0.min(track.line);
            here.2.push(*face);
        }
        let mut alike: Vec<_> = alike.into_iter().collect();
        alike.sort_by_key(|(_, (line, ..))| *line);
        for ((origin, _), (line, values, faces)) in alike {
            let name = match origin.is_empty() || self.index.is_taken(&origin) {
                true => self.name("pressure"),
                false => origin,
            };
            self.index.add_boundary(&name, &faces);
            self.pressure(line, &name, &values);
        }
        for (name, track) in &surfaces.all {
            let values = track.values(&self.times, 0.0);
            self.pressure(track.line, name, &values);
        }
        for ((target, bits), track) in &volumes.all {
            self.volume(target, bits, track.line, &track.values(&self.times, 0.0))?;
        }
        Ok(())
    }

    fn pressure(&mut self, line: usize, boundary: &str, values: &[f64]) {
        let (size, factors) = factors(values);
        if size == 0.0 {
            return;
        }
        self.table(line, "[[traction]]");
        self.put(format_args!("boundary = {}", quoted(boundary)));
        self.put(format_args!("pressure = {}", Number(size)));
        self.put_factors(&factors);
    }

    /// A load in the volume of a set, region by region, as densities differ.
    fn volume(&mut self, target: &str, bits: &[u64; 7], line: usize, values: &[f64]) -> Result<()> {
        let [a, b] = [[1, 2, 3], [4, 5, 6]].map(|at| at.map(|at| f64::from_bits(bits[at])));
        let (size, factors) = factors(values);
        let elements = self.index.elements(line, target)?;
        let set_name = self.index.set_name(false, target);
        let mut parts: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
        for element in elements.iter().copied() {
            if let Some(section) = self.section[element as usize] {
                parts.entry(section).or_default().push(element);
            }
        }
        for (section, elements) in parts {
            let density = if bits[0] == 2 {
                1.0
            } else {
                self.material(section).density
            };
            if size * density == 0.0 {
                continue;
            }
            // The region of the section, the set that is named, or one of its own.
            let of_section = self.regions.iter().find(|(_, _, all)| *all == elements);
            let region = match (of_section, &set_name) {
                (Some((_, name, _)), _) => name.clone(),
                (None, Some(name)) if self.index.elements(line, target)? == elements => {
                    name.clone()
                }
                _ => self.name("load"),
            };
            self.index.add_region(&region, &elements);
            let components: Vec<String> = match bits[0] {
                1 => centrifugal(size * density, a, b)[..self.dimension].to_vec(),
                _ => (a.iter().take(self.dimension))
                    .map(|&along| match along * size * density {
                        0.0 => String::new(),
                        value => Number(value).to_string(),
                    })
                    .collect(),
            };
            // What acts around a body of revolution, or across its axis, would not leave it one.
            let is_axial = b[0] == 0.0 && b[2] == 0.0 && a[0] == 0.0 && a[2] == 0.0;
            if self.is_of_revolution() && bits[0] == 1 && !is_axial {
                let text =
                    "*DLOAD, CENTRIF: a body of revolution rotates about its axis, which is y";
                self.refuse(line, "DLOAD", text);
            }
            if self.is_of_revolution() && bits[0] == 0 && a[0] * size != 0.0 {
                let text =
                    "*DLOAD, GRAV: gravity of a body of revolution acts along its axis, which is y";
                self.refuse(line, "DLOAD", text);
            }
            if self.dimension == 2 && bits[0] != 1 && a[2] * size != 0.0 {
                self.refuse(line, "DLOAD", "*DLOAD: in the plane no load acts along z");
            }
            if components.iter().all(String::is_empty) {
                continue;
            }
            self.table(line, "[[body_force]]");
            self.put(format_args!("region = {}", quoted(&region)));
            for (axis, component) in AXES.iter().zip(components) {
                if !component.is_empty() {
                    self.put(format_args!("{axis} = {component}"));
                }
            }
            self.put_factors(&factors);
        }
        Ok(())
    }

    /// How much warmer the regions become that expand.
    fn temperatures(&mut self) -> Result<()> {
        let mut tracks = Tracks::default();
        for load in &self.said.loads {
            let step = load.step.unwrap_or(0);
            match load.what {
                What::Clear(Kind::Temperature) => tracks.clear(step),
                What::Temperature { target, value } => {
                    for node in self.index.nodes(load.line, target)? {
                        tracks.set(node, load.line, target, step, value, load.amplitude);
                    }
                }
                _ => {}
            }
        }
        if tracks.all.is_empty() {
            return Ok(());
        }
        let mut start = vec![0.0; self.used.len()];
        for (line, target, value) in &self.said.initial_temperatures {
            for node in self.index.nodes(*line, target)? {
                start[node as usize] = *value;
            }
        }
        let mut warmer = vec![None; self.used.len()];
        for (node, track) in &tracks.all {
            let start = start[*node as usize];
            let values = track.values(&self.times, start);
            let values: Vec<f64> = values.into_iter().map(|value| value - start).collect();
            warmer[*node as usize] = Some((track.line, values));
        }
        // A region that becomes warmer by the same everywhere has a number; if there is any other, all nodes have one each.
        let mut tables = Vec::new();
        for (section, name, elements) in self.regions.clone() {
            if self.material(section).expansion == 0.0 {
                continue;
            }
            let nodes = self.index.nodes_of(&elements);
            let first = nodes
                .first()
                .and_then(|&node| warmer[node as usize].as_ref());
            let values = first.map(|first| &first.1);
            let differs =
                |&&node: &&u32| warmer[node as usize].as_ref().map(|one| &one.1) != values;
            if nodes.iter().any(|node| differs(&node)) {
                self.temperatures_of_nodes(&warmer);
                return Ok(());
            }
            if let Some((line, values)) = first.cloned() {
                tables.push((line, name, values));
            }
        }
        for (line, name, values) in tables {
            let (value, factors) = factors(&values);
            if value != 0.0 {
                self.table(line, "[[temperature]]");
                self.put(format_args!("region = {}", quoted(&name)));
                self.put(format_args!("value = {}", Number(value)));
                self.put_factors(&factors);
            }
        }
        Ok(())
    }

    /// How much warmer each node becomes: one table if the load steps have multiples of the same, else one for each.
    fn temperatures_of_nodes(&mut self, warmer: &[Option<(usize, Vec<f64>)>]) {
        self.has_nodal_values = true;
        let lines = warmer.iter().flatten().map(|one| one.0);
        let line = lines.min().unwrap_or(1);
        let n_steps = self.times.ends.len();
        let at_end: Vec<Vec<f64>> = (0..n_steps)
            .map(|step| {
                let of_bodies = warmer.iter().zip(&self.used).filter(|one| *one.1);
                let value =
                    |one: &Option<(usize, Vec<f64>)>| one.as_ref().map_or(0.0, |one| one.1[step]);
                of_bodies.map(|one| value(one.0)).collect()
            })
            .collect();
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let size = |values: &[f64]| product(values, values);
        let Some(largest) = at_end.iter().max_by(|a, b| size(a).total_cmp(&size(b))) else {
            return;
        };
        let scale = size(largest);
        if scale == 0.0 {
            return;
        }
        let multiples: Vec<f64> = at_end
            .iter()
            .map(|values| product(values, largest) / scale)
            .collect();
        let off = |(values, factor): (&Vec<f64>, &f64)| {
            let mut both = values.iter().zip(largest);
            both.any(|(v, w)| (v - factor * w).abs() > 1e-12 * scale.sqrt())
        };
        let tables: Vec<(Vec<f64>, Vec<f64>)> = match at_end.iter().zip(&multiples).any(off) {
            false => vec![(largest.clone(), multiples)],
            true => (at_end.iter().enumerate())
                .filter(|(_, values)| size(values) > 0.0)
                .map(|(step, values)| {
                    let only = (0..n_steps).map(|other| f64::from(u8::from(other == step)));
                    (values.clone(), only.collect())
                })
                .collect(),
        };
        for (values, factors) in tables {
            self.table(line, "[[temperature]]");
            self.put(format_args!("value = {}", list(&values)));
            let all = factors.iter().all(|&factor| factor == 1.0);
            self.put_factors(&Some(factors).filter(|_| !all));
        }
    }

    fn contacts(&mut self) -> Result<()> {
        for tie in &self.said.ties {
            self.tie(tie.line, tie.name, [tie.slave, tie.master], tie.tolerance)?;
        }
        for pair in &self.said.pairs {
            let found = (self.said.interactions.iter()).find(|one| one.name == pair.interaction);
            let Some(interaction) = found else {
                let text = format!("there is no *SURFACE INTERACTION \"{}\"", pair.interaction);
                return Err((pair.line, text));
            };
            if interaction.tied {
                if let Some([stiffness, _]) = interaction.springs.first() {
                    let place = (self.place)(pair.line);
                    self.notes.push(format!(
                        "{place}: a tie is rigid here: its stiffness of {stiffness:e} is passed over"
                    ));
                }
                self.tie(pair.line, None, [pair.slave, pair.master], None)?;
                continue;
            }
            let slave = self.index.surface(pair.line, pair.slave)?;
            let master = self.index.surface(pair.line, pair.master)?;
            if master.nodes.is_some() {
                let text = "*CONTACT PAIR: the master surface is one of element faces";
                self.refuse(pair.line, "CONTACT PAIR", text);
            }
            // A surface of nodes that make up faces is one of faces.
            let key_of = match &slave.nodes {
                Some(nodes) if !self.index.covers(nodes) => {
                    self.index.add_nodes(&slave.name, nodes);
                    "nodes"
                }
                _ => "boundary",
            };
            let friction = interaction.friction.filter(|&mu| mu > 0.0);
            let slope = interaction.stick_slope.filter(|_| friction.is_some());
            if slope.is_some() && interaction.springs.len() > 1 {
                let text = "*FRICTION: there is no stick slope beside a table of pressures in several pieces";
                self.refuse(pair.line, "FRICTION", text);
            }
            let wanted = [&slave.name, &master.name].map(|name| key(name));
            let mut clearances = self.said.clearances.iter();
            let clearance = clearances.find(|one| one.surfaces == wanted);
            // The gap that is stated, if it is, and what is moved.
            let (mut stated, mut moved) = (clearance.map(|clearance| clearance.value), None);
            match pair.adjust.filter(|_| clearance.is_none()) {
                None => {}
                Some(Adjust::Distance(distance)) => moved = Some(Moved::Within(distance)),
                Some(Adjust::Set(set)) => {
                    let nodes = self.index.nodes(pair.line, set)?;
                    let corners = match &slave.nodes {
                        Some(nodes) => nodes.clone(),
                        None => self.index.corners_of(&slave.name),
                    };
                    let is_moved = |node: &u32| nodes.binary_search(node).is_ok();
                    stated = corners.iter().all(is_moved).then_some(0.0);
                    let of_bodies = nodes.into_iter().filter(|&node| self.used[node as usize]);
                    let nodes: Vec<u32> = of_bodies.collect();
                    let set = self.set_of(pair.line, set, &nodes, "adjusted")?;
                    moved = Some(Moved::Set(set));
                }
            }
            // Contacts side by side, whose pressures add up, for a table in several pieces.
            let springs: Vec<Option<[f64; 2]>> = match interaction.springs.is_empty() {
                true => vec![None],
                false => interaction.springs.iter().copied().map(Some).collect(),
            };
            for spring in springs {
                let begins = spring.map_or(0.0, |spring| spring[1]);
                self.table(pair.line, "[[contact]]");
                self.put(format_args!("{key_of} = {}", quoted(&slave.name)));
                self.put(format_args!("against = {}", quoted(&master.name)));
                if let Some(coefficient) = friction {
                    self.put(format_args!(
                        "friction = {{ coulomb = {} }}",
                        Number(coefficient)
                    ));
                }
                let stiffness = [
                    ("normal", spring.map(|spring| spring[0])),
                    ("tangential", slope),
                ];
                let stiffness: Vec<String> = (stiffness.into_iter())
                    .filter_map(|(way, value)| Some(format!("{way} = {}", Number(value?))))
                    .collect();
                if !stiffness.is_empty() {
                    self.put(format_args!("stiffness = {{ {} }}", stiffness.join(", ")));
                }
                match stated.map(|gap| gap + begins) {
                    Some(gap) if gap >= 0.0 => self.put(format_args!("gap = {}", Number(gap))),
                    Some(gap) => self.put(format_args!("interference = {}", Number(-gap))),
                    None => {
                        if let Some(Moved::Within(distance)) = moved {
                            self.put(format_args!("adjust = {}", Number(distance)));
                        }
                        if begins != 0.0 {
                            self.put(format_args!("offset = {}", Number(begins)));
                        }
                        // What is drawn overlapping is pressed apart.
                        self.put("overlap = \"interference\"");
                    }
                }
            }
            self.adjustments.extend(moved.map(|moved| Adjustment {
                line: pair.line,
                slave: slave.name,
                master: master.name,
                moved,
            }));
        }
        for clearance in &self.said.clearances {
            let is_pair = |pair: &super::cards::PairCard| {
                [pair.slave, pair.master].map(key) == clearance.surfaces
            };
            if !self.said.pairs.iter().any(is_pair) {
                return Err((
                    clearance.line,
                    "*CLEARANCE: there is no such *CONTACT PAIR".to_owned(),
                ));
            }
        }
        Ok(())
    }

    fn tie(
        &mut self,
        line: usize,
        name: Option<&str>,
        sides: [&str; 2],
        tolerance: Option<f64>,
    ) -> Result<()> {
        let mut called = Vec::new();
        for (number, side) in sides.into_iter().enumerate() {
            let surface = self.index.surface(line, side)?;
            if surface
                .nodes
                .is_some_and(|nodes| number == 1 || !self.index.covers(&nodes))
            {
                let text = format!(
                    "*TIE: surface \"{}\" is not one of whole faces",
                    surface.name
                );
                self.refuse(line, "TIE", text);
                return Ok(());
            }
            called.push(surface.name);
        }
        self.table(line, "[[tie]]");
        if let Some(name) = name {
            self.put(format_args!("name = {}", quoted(name)));
        }
        self.put(format_args!("boundary = {}", quoted(&called[0])));
        self.put(format_args!("against = {}", quoted(&called[1])));
        if let Some(tolerance) = tolerance {
            self.put(format_args!("adjust = {}", Number(tolerance)));
        }
        Ok(())
    }
}

/// Tables of the nodes that have the same components with the same factors.
fn merged(alike: Vec<Alike>) -> Vec<Table> {
    let mut tables: Vec<Table> = Vec::new();
    // By the nodes and their directions.
    let mut of_nodes: BTreeMap<(Vec<u32>, Option<usize>), Vec<usize>> = BTreeMap::new();
    for one in alike {
        let mut nodes = one.nodes;
        nodes.sort_unstable();
        let (value, factors) = factors(&one.values);
        let key = (nodes, one.transform);
        let here = of_nodes.entry(key.clone()).or_default();
        let fits = |&&number: &&usize| {
            let table: &Table = &tables[number];
            let zero = table.components.iter().all(|component| component.1 == 0.0);
            table.factors == factors || value == 0.0 || zero
        };
        let component = (one.component, value);
        match here.iter().find(fits) {
            Some(&number) => {
                let table = &mut tables[number];
                table.components.push(component);
                if value != 0.0 {
                    table.factors = factors;
                }
            }
            None => {
                here.push(tables.len());
                tables.push(Table {
                    line: one.line,
                    nodes: key.0,
                    transform: one.transform,
                    origin: one.origin,
                    components: vec![component],
                    factors,
                });
            }
        }
    }
    tables
}

/// The axes one by one.
const IDENTITY: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl Transform<'_> {
    /// Its two points.
    fn points(&self) -> [[f64; 3]; 2] {
        [[0, 1, 2], [3, 4, 5]].map(|of| of.map(|at| self.points[at]))
    }

    /// The directions of a rectangular one: the first towards the first point, the second on the side of the second point.
    fn axes(&self) -> Option<[[f64; 3]; 3]> {
        let [a, b] = self.points();
        let first = unit(a);
        let third = unit(cross(first, b));
        (!self.cylindrical).then(|| [first, cross(third, first), third])
    }

    /// A vector along its directions, as quantities along x, y and z; empty where there is none.
    fn turned(&self, components: &[(usize, f64)]) -> [String; 3] {
        let mut along = [0.0; 3];
        components.iter().for_each(|&(c, value)| along[c] += value);
        if let Some(axes) = self.axes() {
            return std::array::from_fn(|g| {
                // What is left of a cosine of a right angle is rounding.
                let terms = (0..3).map(|c| along[c] * axes[c][g]);
                let sum: f64 = terms.clone().sum();
                match sum.abs() > 1e-14 * terms.fold(0.0, |most, term| f64::max(most, term.abs())) {
                    true => Number(sum).to_string(),
                    false => String::new(),
                }
            });
        }
        let [point, end] = self.points();
        let d = unit(minus(end, point));
        // Across the axis, and around it by the right-hand rule.
        let across = |g: usize, k: usize| f64::from(u8::from(g == k)) - d[g] * d[k];
        let around = |g: usize, k: usize| cross(d, IDENTITY[k])[g];
        let matrix = |of: &dyn Fn(usize, usize) -> f64| -> [[f64; 3]; 3] {
            std::array::from_fn(|g| std::array::from_fn(|k| of(g, k)))
        };
        let squares = linear(matrix(&across), point)
            .into_iter()
            .filter(|term| !term.is_empty());
        let squares: Vec<String> = squares.map(|term| format!("({term})^2")).collect();
        let radius = format!("sqrt({})", squares.join(" + "));
        let turned = linear(
            matrix(&|g, k| along[0] * across(g, k) + along[1] * around(g, k)),
            point,
        );
        std::array::from_fn(|g| {
            let mut terms = Vec::new();
            if !turned[g].is_empty() {
                terms.push(format!("({}) / {radius}", turned[g]));
            }
            if along[2] * d[g] != 0.0 {
                terms.push(bracketed(along[2] * d[g]));
            }
            match terms.is_empty() {
                true => String::new(),
                false => format!("\"{}\"", terms.join(" + ")),
            }
        })
    }
}

/// ρ ω² times the way from the axis, as quantities of x, y and z.
fn centrifugal(size: f64, point: [f64; 3], direction: [f64; 3]) -> [String; 3] {
    // The part across a unit vector a of what is rotated is (1 − a aᵀ) (x − p).
    let square = |c: usize, d: usize| f64::from(u8::from(c == d)) - direction[c] * direction[d];
    let matrix = std::array::from_fn(|c| std::array::from_fn(|d| size * square(c, d)));
    linear(matrix, point).map(|component| match component.is_empty() {
        true => component,
        false => format!("\"{component}\""),
    })
}

/// A matrix times the way from a point, in terms of x, y and z; empty where a row is zero.
fn linear(matrix: [[f64; 3]; 3], point: [f64; 3]) -> [String; 3] {
    let largest = matrix
        .as_flattened()
        .iter()
        .fold(0.0, |most: f64, v| most.max(v.abs()));
    std::array::from_fn(|c| {
        let terms: Vec<String> = (0..3)
            .filter(|&d| matrix[c][d].abs() > 1e-15 * largest)
            .map(|d| {
                let factor = Number(matrix[c][d]);
                match point[d] {
                    0.0 => format!("{factor} * {}", AXES[d]),
                    p => format!("{factor} * ({} - {})", AXES[d], bracketed(p)),
                }
            })
            .collect();
        terms.join(" + ")
    })
}

fn bracketed(value: f64) -> String {
    match value < 0.0 {
        true => format!("({})", Number(value)),
        false => Number(value).to_string(),
    }
}
