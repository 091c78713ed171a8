//! Couplings and sections of bolts, with the loads and motions of their reference nodes.

use super::nodes::IDENTITY;
use super::{Result, Translation, with_factors};
use crate::deck::history::{Track, Tracks, factors};
use crate::deck::said::{CouplingCard, Kind, PretensionCard, Reference, What};
use crate::mesh::vector::{length, minus};
use crate::model::{Coupling, Preload};
use std::collections::BTreeMap;

/// A node is beside the middle of others from this part of their distances on: files have six digits, of coordinates that may be large.
const BESIDE: f64 = 1e-4;

/// One component of a reference node: its number in the constraint, and its value at the end of each load step.
pub(super) struct Given {
    pub line: usize,
    pub component: usize,
    pub values: Vec<f64>,
    pub is_motion: bool,
}

/// The line that fixes a reference node, and the step from which on.
pub(super) type Fixed = (usize, usize);

impl<const D: usize> Translation<'_, '_, D> {
    /// Notes the reference nodes, each with the component of its constraint that its first direction is.
    pub(super) fn find_points(&mut self) -> Result<()> {
        let said = self.said;
        let mut all = Vec::new();
        for card in &said.couplings {
            let node = self.reference(card.line, card.reference)?;
            // Any node may be the end of a rigid beam.
            if card.keyword != "MPC" || !self.used[node as usize] {
                all.push((card.line, node, 0));
            }
            if let Some(node) = card.rotation {
                all.push((
                    card.line,
                    self.reference(card.line, Reference::Node(node))?,
                    3,
                ));
            }
        }
        for card in &said.pretensions {
            let reference = Reference::Node(card.reference);
            all.push((card.line, self.reference(card.line, reference)?, 0));
        }
        for (line, node, first) in all {
            if self.used[node as usize] {
                let text = "a reference node must not belong to an element of a body: give the constraint a node of its own";
                return Err((line, text.to_owned()));
            }
            if self.points.insert(node, first).is_some() {
                let text =
                    "two constraints have the same reference node: give each a node of its own";
                return Err((line, text.to_owned()));
            }
        }
        for transform in &said.transforms {
            let nodes = self.index.nodes(transform.line, transform.set)?;
            let is_turned = transform.axes() != Some(IDENTITY);
            if is_turned && nodes.iter().any(|node| self.points.contains_key(node)) {
                let text = "*TRANSFORM: the directions of a reference node are the axes";
                self.refuse(transform.line, "TRANSFORM", text);
            }
        }
        self.find_points_of_equations();
        Ok(())
    }

    /// The node of a reference.
    fn reference(&self, line: usize, reference: Reference) -> Result<u32> {
        let nodes = match reference {
            Reference::Node(node) => self.index.nodes(line, node)?,
            Reference::Elements(set) => self.index.nodes_of(&self.index.elements(line, set)?),
        };
        match nodes[..] {
            [node] => Ok(node),
            _ => Err((line, "a reference is one node".to_owned())),
        }
    }

    /// The couplings and preloads.
    pub(super) fn put_points(&mut self) -> Result<()> {
        let said = self.said;
        for card in &said.pretensions {
            self.pretension(card)?;
        }
        for card in &said.couplings {
            self.coupling(card)?;
        }
        Ok(())
    }

    /// The components of reference nodes, each with the number of its first direction, that have loads or motions, and where they are
    /// fixed.
    pub(super) fn given(
        &mut self,
        nodes: &BTreeMap<u32, usize>,
    ) -> Result<(Vec<Given>, Option<Fixed>)> {
        let (mut motions, mut loads) = (Tracks::default(), Tracks::default());
        let mut fixed = None;
        for load in &self.said.loads {
            let (line, step) = (load.line, load.step.unwrap_or(0));
            let (target, components, value, is_motion): (&str, &[usize], f64, bool) =
                match &load.what {
                    What::Clear(Kind::Boundary) => {
                        if fixed.is_some_and(|(_, since)| step > since) {
                            let text = "*BOUNDARY, OP=NEW: a section that has been fixed stays so";
                            self.refuse(line, "BOUNDARY", text);
                        }
                        motions.clear(step, line);
                        continue;
                    }
                    What::Clear(Kind::Force) => {
                        loads.clear(step, line);
                        continue;
                    }
                    What::Boundary {
                        target,
                        components,
                        value,
                    } => (target, components, *value, true),
                    What::Force {
                        target,
                        component,
                        value,
                    } => (target, std::slice::from_ref(component), *value, false),
                    What::Fixed { target, .. } => {
                        let here = self.index.nodes(line, target)?;
                        if here.iter().any(|node| nodes.contains_key(node)) {
                            fixed.get_or_insert((line, step));
                        }
                        continue;
                    }
                    _ => continue,
                };
            for node in self.index.nodes(line, target)? {
                let Some(first) = nodes.get(&node) else {
                    continue;
                };
                for component in components {
                    match is_motion {
                        true => motions.set(first + component, "", value, load.stated()),
                        false => loads.load(first + component, "", value, load.stated()),
                    }
                }
            }
        }
        let mut all = Vec::new();
        let tracks = (motions.all.iter().map(|track| (track, true)))
            .chain(loads.all.iter().map(|track| (track, false)));
        for ((component, track), is_motion) in tracks {
            let values = Track::values(track, &self.times, 0.0);
            if !is_motion && values.iter().all(|&v| v == 0.0) {
                continue;
            }
            if let (true, Some(line)) = (is_motion, track.changes()) {
                let text = "*BOUNDARY: those of reference nodes cannot be added or removed between steps; with OP=NEW repeat all earlier ones";
                self.refuse(line, "BOUNDARY", text);
            }
            all.push(Given {
                line: track.line,
                component: *component,
                values,
                is_motion,
            });
        }
        Ok((all, fixed))
    }

    fn pretension(&mut self, card: &PretensionCard) -> Result<()> {
        let surface = self.index.surface(card.line, card.surface)?;
        if surface.nodes.is_some() {
            let text = "*PRE-TENSION SECTION: its surface must consist of element faces";
            self.refuse(card.line, "PRE-TENSION SECTION", text);
            return Ok(());
        }
        let reference = self.reference(card.line, Reference::Node(card.reference))?;
        let (given, fixed) = self.given(&BTreeMap::from([(reference, 0)]))?;
        if let Some(other) = given.iter().find(|given| given.component > 0) {
            let text = "the node of a *PRE-TENSION SECTION has one direction, 1";
            return Err((other.line, text.to_owned()));
        }
        let preload = Preload::on(&surface.name);
        // A force above 0 is a tension where the normal points out of the elements of the surface.
        let (preload, sign) = match card.normal {
            Some(normal) => {
                let outward = self.index.outward(card.line, card.surface)?;
                let along: f64 = outward.iter().zip(normal).map(|(o, n)| o * n).sum();
                let preload = preload.along(std::array::from_fn(|c| normal[c]));
                (preload, if along < 0.0 { -1.0 } else { 1.0 })
            }
            None => (preload, 1.0),
        };
        let preload = match &given[..] {
            [one] if one.is_motion => {
                let (length, factors) = factors(&one.values);
                with_factors(preload.shortening(sign * length), factors, Preload::factors)
            }
            // Without any load it is loose.
            [] => preload.force(0.0),
            [one] => {
                let (force, factors) = factors(&one.values);
                with_factors(preload.force(sign * force), factors, Preload::factors)
            }
            [first, ..] => {
                let text = "*PRE-TENSION SECTION: its node has a force or a displacement, not both; to hold what a force has made, state \
                            *BOUNDARY, FIXED in a later step";
                self.refuse(first.line, "PRE-TENSION SECTION", text);
                return Ok(());
            }
        };
        let preload = match fixed {
            None => preload,
            Some((line, 0)) => {
                let text = "*BOUNDARY, FIXED holds what earlier steps have made: state it in a later step than the first";
                return Err((line, text.to_owned()));
            }
            Some((_, step)) => {
                let ends = self.times.ends.iter();
                let locked = ends.map(|end| f64::from(u8::from(end.0 >= step)));
                preload.locked_in(locked.collect::<Vec<_>>())
            }
        };
        self.comes_from(card.line, "preload");
        self.definition.preloads.push(preload.named(&surface.name));
        Ok(())
    }

    /// Refuses to fix a node that is no section of a bolt.
    pub(super) fn refuse_fixed(&mut self, fixed: Option<Fixed>) {
        if let Some((line, _)) = fixed {
            let text = "*BOUNDARY, FIXED: of reference nodes only that of a *PRE-TENSION SECTION can be fixed where it is";
            self.refuse(line, "BOUNDARY", text);
        }
    }

    fn coupling(&mut self, card: &CouplingCard) -> Result<()> {
        let keyword = card.keyword;
        if card.bound == [false; 3] {
            let text = format!(
                "*{keyword}: it couples no direction along an axis: *KINEMATIC or *DISTRIBUTING follows it, with 1 to 3"
            );
            return Err((card.line, text));
        }
        let reference = self.reference(card.line, card.reference)?;
        let at = self.index.place(reference);
        let point: [f64; D] = std::array::from_fn(|c| at[c]);
        let free: [bool; D] = std::array::from_fn(|c| !card.bound[c]);
        let coupling = match card.surface {
            Some(surface) => {
                let surface = self.index.surface(card.line, surface)?;
                match surface.nodes {
                    None => Coupling::on(&surface.name, point),
                    Some(nodes) => {
                        self.index.add_nodes(&surface.name, &nodes);
                        Coupling::at_nodes(&surface.name, point)
                    }
                }
            }
            None => {
                let mut nodes = Vec::new();
                for set in &card.nodes {
                    nodes.extend(self.index.nodes(card.line, *set)?);
                }
                nodes.push(reference);
                nodes.retain(|&node| self.used[node as usize]);
                nodes.sort_unstable();
                nodes.dedup();
                let origin = match card.nodes[..] {
                    [one] if self.index.set_name(true, one).is_some() => one,
                    _ => "".into(),
                };
                let places = nodes.iter().map(|&node| minus(self.index.place(node), at));
                let sum = places.clone().fold([0.0; 3], |sum, way| {
                    std::array::from_fn(|c| sum[c] + way[c])
                });
                let size = places.map(length).fold(0.0, f64::max);
                if card.distributing && length(sum) > BESIDE * size * nodes.len() as f64 {
                    let place = (self.place)(card.line);
                    self.notes.push(format!(
                        "{place}: *{keyword}: its node is not in the middle of those that share its load: a force on it has a lever arm, as in \
                         Abaqus; CalculiX leaves that moment out"
                    ));
                }
                let set = self.set_of(card.line, origin, &nodes, "coupled")?;
                Coupling::at_nodes(set, point)
            }
        };
        let spread = coupling.clone().distributing();
        let coupling = match card.distributing {
            true => spread.clone(),
            false => coupling.free(free),
        };
        let mut references = BTreeMap::new();
        if !self.used[reference as usize] {
            references.insert(reference, 0);
        }
        if let Some(node) = card.rotation {
            references.insert(self.reference(card.line, Reference::Node(node))?, 3);
        }
        let (given, fixed) = self.given(&references)?;
        self.refuse_fixed(fixed);
        // Zeros fit any history.
        let mut given = given;
        given.sort_by_key(|one| one.values.iter().all(|&v| v == 0.0));
        // Entries with the same history are one part; nodes that move rigidly carry others as spread ones.
        let mut parts: Vec<(Option<Vec<f64>>, Coupling<D>)> = Vec::new();
        let mut first = Some(coupling);
        for one in given {
            let (component, line) = (one.component, one.line);
            let (size, history) = factors(&one.values);
            if (D == 2 && (2..5).contains(&component)) || component > 5 {
                if size != 0.0 {
                    let text = match D {
                        2 => format!("in the plane there is no direction {}", component + 1),
                        _ => "a node of rotations has the directions 1 to 3".to_owned(),
                    };
                    self.refuse(line, keyword, text);
                }
                continue;
            }
            let same =
                |part: &&mut (Option<Vec<f64>>, Coupling<D>)| size == 0.0 || part.0 == history;
            let part = match parts.iter_mut().find(same) {
                Some(part) => part,
                None => {
                    if first.is_none() && !card.distributing && card.bound != [true; 3] {
                        let text = format!(
                            "*{keyword} with free directions: loads and motions of its node must follow one history"
                        );
                        self.refuse(line, keyword, text);
                        continue;
                    }
                    let next = first.take().unwrap_or_else(|| spread.clone());
                    let history = history.filter(|_| size != 0.0);
                    parts.push((history, next));
                    parts.last_mut().expect("just pushed")
                }
            };
            part.1 = part.1.clone().given(component, size, one.is_motion);
        }
        parts.extend(first.map(|alone| (None, alone)));
        for (history, part) in parts {
            let part = match card.name {
                Some(name) => part.named(name),
                None => part,
            };
            self.comes_from(card.line, "coupling");
            let part = with_factors(part, history, Coupling::factors);
            self.definition.couplings.push(part);
        }
        Ok(())
    }
}
