//! Loads on faces and in elements, and temperatures.

use super::nodes::linear;
use super::{Result, Translation, quantities, with_factors};
use crate::deck::history::{Tracks, factors};
use crate::deck::said::{Kind, Load, What};
use crate::mesh::vector::unit;
use crate::model::{BodyForce, Number, Quantity, Temperature, Traction};
use std::collections::{BTreeMap, HashSet};

/// Faces with the same pressure: the line, the pressure at the end of each load step, elements and their faces.
type Pressed = (usize, Vec<f64>, Vec<(u32, usize)>);

/// A rotation: the line, the square of its speed at the end of each load step, and elements.
type Rotation = (usize, Vec<f64>, HashSet<u32>);

impl<const D: usize> Translation<'_, '_, D> {
    /// Loads on faces, surfaces and volumes.
    pub(super) fn distributed(&mut self) -> Result<()> {
        // Faces by their elements and numbers; surfaces by names; volumes by sets, and where the load points.
        let mut faces = Tracks::default();
        let mut surfaces = Tracks::default();
        let mut volumes: Tracks<(String, [u64; 7])> = Tracks::default();
        // The first name of the same elements.
        let mut bodies: BTreeMap<Vec<u32>, String> = BTreeMap::new();
        let on_faces = |load: &Load| matches!(load.what, What::Face { .. });
        let outside: HashSet<(u32, usize)> = match self.said.loads.iter().any(on_faces) {
            true => self.index.outside(|_| true).into_iter().collect(),
            false => HashSet::new(),
        };
        for load in &self.said.loads {
            let by = load.stated();
            let (line, step) = (by.line, by.step);
            let mut body = |target: &str| -> Result<String> {
                let mut elements = self.loaded(line, target)?;
                elements.sort_unstable();
                Ok(bodies
                    .entry(elements)
                    .or_insert_with(|| target.to_owned())
                    .clone())
            };
            let bits = |kind: u64, a: [f64; 3], b: [f64; 3]| {
                let [a, b] = [a, b].map(|v| v.map(f64::to_bits));
                [kind, a[0], a[1], a[2], b[0], b[1], b[2]]
            };
            match &load.what {
                What::Clear(Kind::Distributed) => {
                    faces.clear(step, load.line);
                    volumes.clear(step, load.line);
                }
                What::Clear(Kind::Surface) => surfaces.clear(step, load.line),
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
                            return Err((line, format!("P{face} is not a face of this element")));
                        }
                        if !outside.contains(&(element, *face)) {
                            let text = format!(
                                "*DLOAD, P{face}: a face of \"{target}\" lies between elements, and pressures act on the outside of a body: \
                                 name elements with that face outside"
                            );
                            return Err((line, text));
                        }
                        faces.load((element, *face), &origin, *value, by);
                    }
                }
                What::Pressure { surface, value } => {
                    let name = self.index.surface(line, surface)?.name;
                    surfaces.load(name, "", *value, by);
                }
                What::Gravity {
                    target,
                    size,
                    direction,
                } => {
                    let key = (body(target)?, bits(0, unit(*direction), [0.0; 3]));
                    volumes.load(key, target, *size, by);
                }
                What::Centrifugal {
                    target,
                    square,
                    point,
                    direction,
                } => {
                    let key = (body(target)?, bits(1, *point, unit(*direction)));
                    volumes.load(key, target, *square, by);
                }
                What::Volume {
                    target,
                    axis,
                    value,
                } => {
                    let mut along = [0.0; 3];
                    along[*axis] = 1.0;
                    let key = (body(target)?, bits(2, along, [0.0; 3]));
                    volumes.load(key, target, *value, by);
                }
                _ => {}
            }
        }
        self.one_axis(&volumes)?;
        for load in &self.said.loads {
            let step = load.step.unwrap_or(0);
            let (name, other, stays) = match load.what {
                What::Clear(Kind::Distributed) => {
                    let stays = surfaces.all.iter().any(|(_, track)| track.lasts(step));
                    ("DLOAD", "DSLOAD", stays)
                }
                What::Clear(Kind::Surface) => {
                    let on_faces = faces.all.iter().any(|(_, track)| track.lasts(step));
                    let stays = on_faces || volumes.all.iter().any(|(_, track)| track.lasts(step));
                    ("DSLOAD", "DLOAD", stays)
                }
                _ => continue,
            };
            if stays {
                let text = format!(
                    "*{name}, OP=NEW while loads of *{other} go on: Abaqus keeps these and CalculiX removes them; add *{other}, OP=NEW and state in this step what stays"
                );
                self.refuse(load.line, "OP", text);
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

    /// Elements have one rotation at a time.
    fn one_axis(&mut self, volumes: &Tracks<(String, [u64; 7])>) -> Result<()> {
        let mut earlier: Vec<Rotation> = Vec::new();
        for ((target, _), track) in volumes.all.iter().filter(|((_, bits), _)| bits[0] == 1) {
            let values = track.values(&self.times, 0.0);
            let elements: HashSet<u32> = self.loaded(track.line, target)?.into_iter().collect();
            let meets = |(_, before, on): &&Rotation| {
                let mut both = before.iter().zip(&values);
                both.any(|(a, b)| a * b != 0.0) && !on.is_disjoint(&elements)
            };
            if let Some((line, ..)) = earlier.iter().find(meets) {
                let text = format!(
                    "*DLOAD, CENTRIF: some of its elements rotate by {} as well, and CalculiX takes the first one alone; state the same \
                     set, point and direction, or end that rotation by OP=NEW",
                    (self.place)(*line)
                );
                self.refuse(track.line, "CENTRIF", text);
            }
            earlier.push((track.line, values, elements));
        }
        Ok(())
    }

    /// The elements of a load in the volume: of the whole model where no set is named.
    fn loaded(&self, line: usize, target: &str) -> Result<Vec<u32>> {
        if !target.is_empty() {
            return self.index.elements(line, target);
        }
        let all = 0..self.index.n_elements() as u32;
        Ok(all
            .filter(|&element| self.index.is_of_body(element))
            .collect())
    }

    fn pressure(&mut self, line: usize, boundary: &str, values: &[f64]) {
        let (size, factors) = factors(values);
        if size == 0.0 {
            return;
        }
        self.comes_from(line, "traction");
        let traction = Traction::on(boundary).pressure(size);
        let traction = with_factors(traction, factors, Traction::factors);
        self.definition.tractions.push(traction);
    }

    /// A load in the volume of a set, region by region, as densities differ.
    fn volume(&mut self, target: &str, bits: &[u64; 7], line: usize, values: &[f64]) -> Result<()> {
        let [a, b] = [[1, 2, 3], [4, 5, 6]].map(|at| at.map(|at| f64::from_bits(bits[at])));
        let (size, factors) = factors(values);
        let all = self.loaded(line, target)?;
        let set_name = self.index.set_name(false, target);
        let mut parts: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
        for element in all.iter().copied() {
            if let Some(section) = self.section[element as usize] {
                parts.entry(section).or_default().push(element);
            }
        }
        if parts.is_empty() && size != 0.0 {
            let text =
                format!("*DLOAD: \"{target}\" has no elements of bodies that it could act in");
            self.refuse(line, "DLOAD", text);
        }
        for (section, elements) in parts {
            let material = self.material(section);
            let density = match (bits[0], material.density) {
                (2, _) => 1.0,
                (_, Some(density)) => density,
                (_, None) if size == 0.0 => 0.0,
                (_, None) => {
                    let text = format!(
                        "*DLOAD, GRAV or CENTRIF acts on mass: state the *DENSITY of *MATERIAL \"{}\"",
                        material.name
                    );
                    self.refuse(line, "DLOAD", text);
                    continue;
                }
            };
            if size * density == 0.0 {
                continue;
            }
            // The region of the section, the named set, or a new one.
            let of_section = self.regions.iter().find(|region| region.2 == elements);
            let region = match (of_section, &set_name) {
                (Some((_, name, _)), _) => name.clone(),
                (None, Some(name)) if all == elements => name.clone(),
                _ => self.name("load"),
            };
            self.index.add_region(&region, &elements);
            let components = match bits[0] {
                1 => centrifugal(size * density, a, b),
                _ => a.map(|along| match along * size * density {
                    0.0 => String::new(),
                    value => Number(value).to_string(),
                }),
            };
            // Loads around the axis of a body of revolution, or across it, would break its symmetry.
            let is_axial = b[0] == 0.0 && b[2] == 0.0 && a[0] == 0.0 && a[2] == 0.0;
            if self.is_of_revolution() && bits[0] == 1 && !is_axial {
                let text = "*DLOAD, CENTRIF: a body of revolution rotates about its axis, y";
                self.refuse(line, "DLOAD", text);
            }
            if self.is_of_revolution() && bits[0] == 0 && a[0] * size != 0.0 {
                let text = "*DLOAD, GRAV: gravity of a body of revolution acts along its axis, y";
                self.refuse(line, "DLOAD", text);
            }
            if D == 2 && bits[0] != 1 && a[2] * size != 0.0 {
                self.refuse(line, "DLOAD", "*DLOAD: in the plane no load acts along z");
            }
            if components.iter().take(D).all(String::is_empty) {
                continue;
            }
            let force = quantities(line, &components)?
                .fold(BodyForce::within(&region), |force, (axis, value)| {
                    force.along(axis, value)
                });
            // The force of a rotation is that of where the body is.
            let follows = bits[0] == 1 && self.said.large.is_some();
            let force = if follows { force.displaced() } else { force };
            self.comes_from(line, "body_force");
            let force = with_factors(force, factors.clone(), BodyForce::factors);
            self.definition.body_forces.push(force);
        }
        Ok(())
    }

    /// The temperatures of the regions that expand.
    pub(super) fn temperatures(&mut self) -> Result<()> {
        let mut tracks = Tracks::default();
        for load in &self.said.loads {
            let step = load.step.unwrap_or(0);
            match load.what {
                What::Clear(Kind::Temperature) => tracks.clear(step, load.line),
                What::Temperature { target, value } => {
                    for node in self.index.nodes(load.line, target)? {
                        tracks.set(node, target, value, load.stated());
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
                self.temperature(line, Temperature::within(&name, value), factors);
            }
        }
        Ok(())
    }

    /// The temperature of each node: one table if the load steps have multiples of the same, otherwise one for each.
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
            let all = factors.iter().all(|&factor| factor == 1.0);
            let of_nodes = Temperature::everywhere(Quantity::at_nodes(values));
            self.temperature(line, of_nodes, Some(factors).filter(|_| !all));
        }
    }

    fn temperature(&mut self, line: usize, stated: Temperature<D>, factors: Option<Vec<f64>>) {
        self.comes_from(line, "temperature");
        let temperature = with_factors(stated, factors, Temperature::factors);
        self.definition.temperatures.push(temperature);
    }
}

/// ρ ω² times the way from the axis, as expressions of x, y and z.
fn centrifugal(size: f64, point: [f64; 3], direction: [f64; 3]) -> [String; 3] {
    // Perpendicular to the unit vector a of the axis, the rotated part is (1 − a aᵀ) (x − p).
    let square = |c: usize, d: usize| f64::from(u8::from(c == d)) - direction[c] * direction[d];
    let matrix = std::array::from_fn(|c| std::array::from_fn(|d| size * square(c, d)));
    linear(matrix, point)
}
