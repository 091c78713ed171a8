//! Springs.

use super::{Result, Translation};
use crate::deck::said::{Kind, SpringCard, What};
use crate::mesh::vector::minus;
use crate::model::Spring;
use std::collections::{BTreeMap, BTreeSet};

impl<const D: usize> Translation<'_, '_, D> {
    /// A spring for each element; an end that no body has is the ground, where it is held.
    pub(super) fn springs(&mut self) -> Result<()> {
        let said = self.said;
        if said.springs.is_empty() {
            return Ok(());
        }
        let held = self.held()?;
        let mut names = BTreeMap::new();
        for card in said.springs.iter().filter(|card| card.stiffness > 0.0) {
            for element in self.index.elements(card.line, card.set)? {
                self.spring(card, element, &held, &mut names)?;
            }
        }
        Ok(())
    }

    fn spring(
        &mut self,
        card: &SpringCard,
        element: u32,
        held: &BTreeSet<(u32, usize)>,
        names: &mut BTreeMap<u32, String>,
    ) -> Result<()> {
        let (line, ends) = (card.line, self.index.ends(element).to_vec());
        if self.index.is_of_body(element) || ends.len() > 2 {
            let text = format!("*SPRING: \"{}\" has elements that are no springs", card.set);
            return Err((line, text));
        }
        let way: [f64; D] = match (card.component, &ends[..]) {
            (Some(c), _) if c >= D => {
                self.refuse(
                    line,
                    "SPRING",
                    "*SPRING: in the plane there is no direction 3",
                );
                return Ok(());
            }
            (Some(c), _) => std::array::from_fn(|i| f64::from(u8::from(i == c))),
            (None, &[a, b]) => {
                let way = minus(self.index.place(b), self.index.place(a));
                std::array::from_fn(|c| way[c])
            }
            (None, _) => {
                return Err((
                    line,
                    "*SPRING: a spring with one node needs a direction".to_owned(),
                ));
            }
        };
        if way == [0.0; D] {
            let text = "*SPRING: both ends of a spring along its line are in one place";
            return Err((line, text.to_owned()));
        }
        let (of_bodies, bare): (Vec<u32>, Vec<u32>) =
            ends.into_iter().partition(|&node| self.used[node as usize]);
        let is_held = |&node: &u32| (0..D).all(|c| way[c] == 0.0 || held.contains(&(node, c)));
        if of_bodies.is_empty() || !bare.iter().all(is_held) {
            let text = "*SPRING: an end that no element of a body has is the ground: hold it at 0 along the spring, in all steps";
            self.refuse(line, "SPRING", text);
            return Ok(());
        }
        if self.said.large.is_some() && card.component.is_none() && !bare.is_empty() {
            let text = "*SPRING: with NLGEOM, a spring along its line needs elements at both ends: hold an element of a body where the ground is";
            self.refuse(line, "SPRING", text);
            return Ok(());
        }
        let mut sets = Vec::new();
        for node in of_bodies {
            let name = match names.get(&node) {
                Some(name) => String::clone(name),
                None => self.set_of(line, "".into(), &[node], "spring")?,
            };
            names.insert(node, name.clone());
            sets.push(name);
        }
        let spring = Spring::at_nodes(&sets[0], card.stiffness);
        let spring = match sets.get(1) {
            Some(other) if card.component.is_none() => spring.to_nodes(other),
            Some(other) => spring.to_nodes(other).along(way),
            None => spring.along(way),
        };
        self.comes_from(line, "spring");
        self.definition.springs.push(spring);
        Ok(())
    }

    /// The displacements along axes that are held at 0.
    fn held(&mut self) -> Result<BTreeSet<(u32, usize)>> {
        let transforms = self.transforms()?;
        let (mut held, mut moved) = (BTreeSet::new(), BTreeSet::new());
        for load in &self.said.loads {
            let What::Boundary {
                target,
                components,
                value,
            } = &load.what
            else {
                continue;
            };
            for node in self.index.nodes(load.line, target)? {
                // In directions of its own all of a node has to be held.
                let axes = || components.iter().filter(|&&c| c < D);
                let is_turned = transforms.contains_key(&node) && axes().count() < D;
                let of_node = axes().map(|&c| (node, c));
                match *value != 0.0 {
                    true => moved.extend(of_node),
                    false if load.step.unwrap_or(0) == 0 && !is_turned => held.extend(of_node),
                    false => {}
                }
            }
        }
        // With OP=NEW held nodes may become free.
        let cleared = |what: &What| matches!(what, What::Clear(Kind::Boundary));
        let mut later = self
            .said
            .loads
            .iter()
            .filter(|load| load.step.unwrap_or(0) > 0);
        if later.any(|load| cleared(&load.what)) {
            held.clear();
        }
        Ok(&held - &moved)
    }
}
