//! Contacts and ties.

use super::{Result, Translation, with_factors};
use crate::deck::adjust::{Adjustment, Moved};
use crate::deck::history::factors;
use crate::deck::said::{Adjust, Behavior, Interaction, PairCard, Said, SectorCard, TieCard};
use crate::mesh::abaqus::index::{Name, Surface};
use crate::mesh::abaqus::keyword::key;
use crate::model::{Axis, Cyclic, Pair};
use std::array::from_fn;

/// A behavior, with the load steps in which a pair has it, if not in all.
pub(super) type Law = (Behavior, Option<Vec<f64>>);

impl<const D: usize> Translation<'_, '_, D> {
    pub(super) fn contacts(&mut self) -> Result<()> {
        for tie in &self.said.ties {
            if tie.cyclic {
                self.sector(tie)?;
                continue;
            }
            self.tie(tie.line, tie.name, [tie.slave, tie.master], tie.tolerance)?;
        }
        let said = self.said;
        for card in &said.sectors {
            let mut cyclic = said.ties.iter().filter(|tie| tie.cyclic);
            if !cyclic.any(|tie| sectors_of(said, tie).is_some_and(|one| one.line == card.line)) {
                let text = "*CYCLIC SYMMETRY MODEL: no *TIE, CYCLIC SYMMETRY belongs to it";
                self.refuse(card.line, "CYCLIC SYMMETRY MODEL", text);
            }
        }
        for pair in &self.said.pairs {
            let found = (self.said.interactions.iter()).find(|one| one.name == pair.interaction);
            let Some(interaction) = found else {
                let text = format!("there is no *SURFACE INTERACTION \"{}\"", pair.interaction);
                return Err((pair.line, text));
            };
            let laws = self.behaviors(interaction, self.active(pair));
            for (behavior, active) in laws.iter().filter(|law| law.0.tied) {
                if let Some([stiffness, _]) = behavior.springs.first() {
                    let place = (self.place)(pair.line);
                    self.notes.push(format!(
                        "{place}: ties are rigid here: the stiffness of {stiffness:e} is skipped"
                    ));
                }
                let before = self.definition.ties.len();
                let sides = [pair.slave, pair.master].map(Name::from);
                self.tie(pair.line, None, sides, None)?;
                if let Some(tie) = self.definition.ties.get_mut(before) {
                    *tie = with_factors(tie.clone(), active.clone(), Pair::active);
                }
            }
            if laws.iter().all(|law| law.0.tied) {
                continue;
            }
            self.refuse_added_springs(pair, interaction);
            let slave = self.index.surface(pair.line, pair.slave)?;
            let master = self.index.surface(pair.line, pair.master)?;
            if master.nodes.is_some() {
                let text = "*CONTACT PAIR: the master surface must consist of element faces";
                self.refuse(pair.line, "CONTACT PAIR", text);
            }
            let wanted = [pair.slave, pair.master].map(key);
            let mut clearances = self.said.clearances.iter();
            let clearance = clearances.find(|one| one.surfaces == wanted);
            // The stated gap, if any, and the nodes to move.
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
                    let set = self.set_of(pair.line, set.into(), &nodes, "adjusted")?;
                    moved = Some(Moved::Set(set));
                }
            }
            let mut contact = Pair::new(&slave.name, &master.name);
            if self.adds_nodes(&slave) {
                contact = contact.by_nodes();
            }
            match (stated, &moved) {
                // Overlaps in the drawing are pressed apart.
                (None, Some(Moved::Within(distance))) => {
                    contact = contact.adjust(*distance).overlap_as_interference();
                }
                (None, _) => contact = contact.overlap_as_interference(),
                (Some(_), _) => {}
            }
            self.put_contacts(pair.line, interaction, &laws, &contact, stated);
            self.adjustments.extend(moved.map(|moved| Adjustment {
                line: pair.line,
                of_nodes: slave.nodes.is_some(),
                slave: slave.name,
                master: master.name,
                moved,
            }));
        }
        let clearances = self.said.clearances.iter();
        let clearances = clearances.map(|one| (one.line, &one.surfaces, "CLEARANCE"));
        let changes = self.said.pair_changes.iter();
        let changes = changes.map(|one| (one.line, &one.surfaces, "MODEL CHANGE"));
        for (line, surfaces, keyword) in clearances.chain(changes) {
            let is_pair = |pair: &PairCard| [pair.slave, pair.master].map(key) == *surfaces;
            if !self.said.pairs.iter().any(is_pair) {
                let text = format!("*{keyword}: there is no such *CONTACT PAIR");
                return Err((line, text));
            }
        }
        Ok(())
    }

    /// Makes a contact of each part of the laws of an interaction that slide, parallel ones, whose pressures add up, for a table in
    /// several pieces.
    pub(super) fn put_contacts(
        &mut self,
        line: usize,
        interaction: &Interaction,
        laws: &[Law],
        like: &Pair<D>,
        stated: Option<f64>,
    ) {
        let (friction, factors) = self.friction(interaction);
        let slope = interaction.stick_slope.filter(|_| friction.is_some());
        let mut pieces = laws.iter().map(|law| law.0.springs.len());
        if slope.is_some() && pieces.any(|pieces| pieces > 1) {
            let text = "*FRICTION: a stick slope cannot be combined with a table of pressures in several pieces";
            self.refuse(line, "FRICTION", text);
        }
        if slope.is_some() {
            self.refuse_new_springs(interaction);
        }
        let sliding = laws.iter().filter(|law| !law.0.tied);
        let springs = sliding.flat_map(|(behavior, active)| {
            let all = behavior.springs.iter().copied().map(Some);
            let hard = behavior.springs.is_empty().then_some(None);
            all.chain(hard).map(move |spring| (spring, active))
        });
        for (spring, active) in springs {
            let begins = spring.map_or(0.0, |spring| spring[1]);
            let mut contact = like.clone();
            if let Some(coefficient) = friction {
                contact = contact.coulomb(coefficient);
                contact = with_factors(contact, factors.clone(), Pair::friction_factors);
            }
            contact = with_factors(contact, active.clone(), Pair::active);
            if let Some([stiffness, _]) = spring {
                contact = contact.normal_stiffness(stiffness);
            }
            if let Some(slope) = slope {
                contact = contact.tangential_stiffness(slope);
            }
            contact = match stated.map(|gap| gap + begins) {
                Some(gap) if gap >= 0.0 => contact.gap(gap),
                Some(gap) => contact.interference(-gap),
                None => contact.offset(begins),
            };
            self.comes_from(line, "contact");
            self.definition.pairs.push(contact);
        }
    }

    /// Refuses another behavior in place of one with a stick slope, whose springs would begin again without force. Behind a tie,
    /// which is rigid, they have none.
    fn refuse_new_springs(&mut self, interaction: &Interaction) {
        let said = self.said;
        let is_own = |number: usize| said.interactions[number].name == interaction.name;
        let (mut since, mut before) = (0, &interaction.behavior);
        for change in &said.behavior_changes {
            if !is_own(change.interaction) {
                continue;
            }
            if change.step > since && !before.tied && change.behavior != *before {
                let text = "*CHANGE SURFACE BEHAVIOR: the force that the stick slope of *FRICTION has made would be lost: leave the slope \
                            out, or keep the behavior";
                self.refuse(change.line, "CHANGE SURFACE BEHAVIOR", text);
            }
            (since, before) = (change.step, &change.behavior);
        }
    }

    /// Refuses a pair with a stick slope that a later step adds: the programs differ in where its springs begin.
    fn refuse_added_springs(&mut self, pair: &PairCard, interaction: &Interaction) {
        if interaction.stick_slope.is_none() || self.friction(interaction).0.is_none() {
            return;
        }
        let surfaces = [pair.slave, pair.master].map(key);
        let mut acts = true;
        for change in &self.said.pair_changes {
            if change.surfaces != surfaces {
                continue;
            }
            if change.acts && !acts && change.step > 0 {
                let text = "*MODEL CHANGE, ADD: the springs of the stick slope of *FRICTION begin without force in Abaqus, and in CalculiX with \
                            that of the way the sides have gone since the beginning: leave the slope out";
                self.refuse(change.line, "MODEL CHANGE", text);
            }
            acts = change.acts;
        }
    }

    /// Whether a surface becomes a set of nodes: one of nodes that make up faces counts as one of faces.
    fn adds_nodes(&mut self, surface: &Surface) -> bool {
        match &surface.nodes {
            Some(nodes) if !self.index.covers(nodes) => {
                self.index.add_nodes(&surface.name, nodes);
                true
            }
            _ => false,
        }
    }

    /// The contacts at the end of each load step, where a keyword may change them from a step on.
    fn by_step<T: Copy>(&self, first: T, changes: &[(usize, T)]) -> Vec<T> {
        let at = |&(step, _): &(usize, f64)| {
            let last = changes.iter().rfind(|change| change.0 <= step);
            last.map_or(first, |change| change.1)
        };
        self.times.ends.iter().map(at).collect()
    }

    /// In which load steps a pair acts, if not in all.
    fn active(&self, pair: &PairCard) -> Option<Vec<f64>> {
        let surfaces = [pair.slave, pair.master].map(key);
        let changes = self.said.pair_changes.iter();
        let changes: Vec<(usize, f64)> = changes
            .filter(|change| change.surfaces == surfaces)
            .map(|change| (change.step, f64::from(u8::from(change.acts))))
            .collect();
        let steps = self.by_step(1.0, &changes);
        steps.contains(&0.0).then_some(steps)
    }

    /// The behaviors of an interaction for a pair that is `active` in some load steps.
    pub(super) fn behaviors(
        &self,
        interaction: &Interaction,
        active: Option<Vec<f64>>,
    ) -> Vec<Law> {
        let changes = self.said.behavior_changes.iter();
        let changes = changes
            .filter(|change| self.said.interactions[change.interaction].name == interaction.name);
        let mut all = vec![interaction.behavior.clone()];
        let mut changed = Vec::new();
        for change in changes {
            changed.push((change.step, all.len()));
            all.push(change.behavior.clone());
        }
        let number = self.by_step(0, &changed);
        let active = active.unwrap_or_else(|| vec![1.0; number.len()]);
        let mut found: Vec<(Behavior, Vec<f64>)> = Vec::new();
        for (own, behavior) in all.into_iter().enumerate() {
            let here = |(number, acts): (&usize, &f64)| f64::from(u8::from(*number == own)) * acts;
            let steps: Vec<f64> = number.iter().zip(&active).map(here).collect();
            // One that is stated again is the same contact.
            match found
                .iter_mut()
                .find(|law: &&mut (Behavior, Vec<f64>)| law.0 == behavior)
            {
                Some((_, all)) => all
                    .iter_mut()
                    .zip(steps)
                    .for_each(|(all, here)| *all += here),
                None => found.push((behavior, steps)),
            }
        }
        found.retain(|law| law.1.contains(&1.0));
        let laws = found.into_iter();
        laws.map(|(behavior, steps)| (behavior, steps.contains(&0.0).then_some(steps)))
            .collect()
    }

    /// The largest coefficient of an interaction, and its factor in each load step.
    fn friction(&self, interaction: &Interaction) -> (Option<f64>, Option<Vec<f64>>) {
        let changes = self.said.friction_changes.iter();
        let changes: Vec<(usize, f64)> = changes
            .filter(|change| self.said.interactions[change.interaction].name == interaction.name)
            .map(|change| (change.step, change.friction))
            .collect();
        let values = self.by_step(interaction.friction.unwrap_or(0.0), &changes);
        let (largest, of_steps) = factors(&values);
        (Some(largest).filter(|&mu| mu > 0.0), of_steps)
    }

    /// The sides of a sector.
    fn sector(&mut self, tie: &TieCard) -> Result<()> {
        let Some(card) = sectors_of(self.said, tie) else {
            let text = "*TIE, CYCLIC SYMMETRY: no *CYCLIC SYMMETRY MODEL belongs to it";
            return Err((tie.line, text.to_owned()));
        };
        let mut sides = Vec::new();
        for side in [tie.master, tie.slave] {
            let surface = self.index.surface(tie.line, side)?;
            if let Some(nodes) = &surface.nodes {
                self.index.add_nodes(&surface.name, nodes);
            }
            sides.push(surface.name);
        }
        let [low, high] = &sides[..] else {
            unreachable!("there are two sides");
        };
        let (from, to) = card.axis.split_at(3);
        let direction = from_fn(|c| to[c] - from[c]);
        if D == 2 && direction[..2] != [0.0; 2] {
            let text = "*CYCLIC SYMMETRY MODEL: in the plane the axis is along z";
            return Err((card.line, text.to_owned()));
        }
        let axis = Axis::through(from_fn(|c| from[c]), (D == 3).then_some(direction));
        let cyclic = Cyclic::between(low, high, axis, card.sectors);
        let cyclic = match tie.name {
            Some(name) => cyclic.named(name),
            None => cyclic,
        };
        self.comes_from(tie.line, "cyclic");
        self.definition.cyclics.push(cyclic);
        Ok(())
    }

    fn tie(
        &mut self,
        line: usize,
        name: Option<&str>,
        sides: [Name; 2],
        tolerance: Option<f64>,
    ) -> Result<()> {
        let [slave, master] = [
            self.index.surface(line, sides[0])?,
            self.index.surface(line, sides[1])?,
        ];
        if master.nodes.is_some() {
            let text = format!(
                "*TIE: the master surface \"{}\" must consist of element faces",
                master.name
            );
            self.refuse(line, "TIE", text);
            return Ok(());
        }
        let mut tie = Pair::tied(&slave.name, &master.name).adjust(tolerance.unwrap_or_default());
        if self.adds_nodes(&slave) {
            tie = tie.by_nodes();
        }
        if let Some(name) = name {
            tie = tie.named(name);
        }
        self.comes_from(line, "tie");
        self.definition.ties.push(tie);
        Ok(())
    }
}

/// The sectors that a tie belongs to.
fn sectors_of<'s, 'a>(said: &'s Said<'a>, tie: &TieCard) -> Option<&'s SectorCard<'a>> {
    let same = |name: &str| tie.name.is_some_and(|own| key(own) == key(name));
    let mut cards = said.sectors.iter();
    cards.find(|card| card.tie.is_none_or(same))
}
