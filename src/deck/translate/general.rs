//! General contact: all of the outside, and surfaces that may meet.

use super::{Result, Translation};
use crate::deck::said::{General, GeneralCard, Initialization, Interaction, PairCard};
use crate::mesh::abaqus::keyword::key;
use crate::model::Pair;

/// Two surfaces, or one twice; empty: all of the outside. With the line that states them.
type Sides<'a> = (usize, [&'a str; 2]);

/// Whether both name the same surfaces, in either order.
fn are_same([a, b]: &[&str; 2], [c, d]: &[&str; 2]) -> bool {
    let [a, b, c, d] = [a, b, c, d].map(|name| key(name));
    (a == c && b == d) || (a == d && b == c)
}

fn meets_itself([a, b]: &[&str; 2]) -> bool {
    key(a) == key(b)
}

impl<'a, const D: usize> Translation<'a, '_, D> {
    pub(super) fn general(&mut self) -> Result<()> {
        let said = self.said;
        let Some(line) = said.general_contact else {
            return match said.general.first() {
                Some(card) => Err((card.line, "*CONTACT is missing before it".to_owned())),
                None => Ok(()),
            };
        };
        let stated = |card: &GeneralCard<'a>| (card.line, card.sides);
        let excluded = said.general.iter();
        let excluded = excluded.filter(|card| matches!(card.what, General::Excluded));
        let mut excluded: Vec<Sides> = excluded.map(stated).collect();
        let mut included: Vec<Sides> = Vec::new();
        for card in &said.general {
            let is_new = !included.iter().any(|one| are_same(&one.1, &card.sides));
            if is_new && matches!(card.what, General::Included) {
                included.push(stated(card));
            }
        }
        if included.is_empty() {
            let text = "*CONTACT: no *CONTACT INCLUSIONS belongs to it, such as ALL EXTERIOR";
            return Err((line, text.to_owned()));
        }
        for (line, [a, b]) in &included {
            if a.is_empty() != b.is_empty() {
                let text = "an inclusion of one surface and all others is not supported: name both surfaces";
                self.refuse(*line, "CONTACT", text);
            }
        }
        let has_all = included.iter().any(|one| one.1 == ["", ""]);
        // Surfaces with an interaction or an initialization of their own are contacts of their own. Those of a *CONTACT PAIR are its.
        for card in &said.general {
            let is_new = !included.iter().any(|one| are_same(&one.1, &card.sides));
            let assigns = matches!(
                card.what,
                General::Interaction(_) | General::Initialization(_)
            );
            let is_pair = |pair: &PairCard| are_same(&[pair.slave, pair.master], &card.sides);
            if !is_new || !assigns || card.sides == ["", ""] || said.pairs.iter().any(is_pair) {
                continue;
            }
            if !has_all {
                let text = "an assignment to surfaces that no *CONTACT INCLUSIONS names: name the same ones in both";
                self.refuse(card.line, "CONTACT", text);
                continue;
            }
            if card.sides.contains(&"") {
                let text = "an assignment to one surface and all others is not supported: name both surfaces";
                self.refuse(card.line, "CONTACT", text);
                continue;
            }
            included.push(stated(card));
        }
        included.retain(|one| !excluded.iter().any(|other| are_same(&one.1, &other.1)));
        // All of the outside has no part of surfaces that meet themselves on their own. (Pairs of two boundaries are left out of it anyway.)
        let own = included
            .iter()
            .filter(|(_, sides)| meets_itself(sides) && !sides[0].is_empty());
        excluded.extend(own.copied().collect::<Vec<_>>());
        for (line, sides) in included {
            self.general_pair(line, sides, &excluded)?;
        }
        Ok(())
    }

    /// The contacts of two surfaces.
    fn general_pair(&mut self, line: usize, sides: [&str; 2], excluded: &[Sides]) -> Result<()> {
        let (interaction, initialization) = self.assigned(&sides)?;
        let names = [self.side(line, sides[0])?, self.side(line, sides[1])?];
        let mut contact = Pair::new(&names[0], &names[1]);
        contact = match initialization {
            Some(Initialization { pressed: true, .. }) => contact.overlap_as_interference(),
            _ => contact.overlap_as_touching(),
        };
        contact = contact.adjust(initialization.map_or(0.0, |one| one.above));
        for (line, others) in excluded.iter().filter(|one| !are_same(&sides, &one.1)) {
            let others = [self.side(*line, others[0])?, self.side(*line, others[1])?];
            if meets_itself(&sides) {
                contact = contact.exclude(&others[0], &others[1]);
                continue;
            }
            let common = |a: usize, b: usize| self.index.have_common_face([&names[a], &others[b]]);
            if (common(0, 0) && common(1, 1)) || (common(0, 1) && common(1, 0)) {
                let text = format!(
                    "*CONTACT EXCLUSIONS: a part of \"{}\" and \"{}\", which meet by themselves, cannot be excluded: state surfaces \
                     without it",
                    names[0], names[1]
                );
                self.refuse(*line, "CONTACT EXCLUSIONS", text);
            }
        }
        let laws = self.behaviors(&interaction, None);
        if laws.iter().any(|law| law.0.tied) {
            let text = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TIED: general contact does not tie: state *TIE";
            self.refuse(line, "CONTACT", text);
        }
        self.put_contacts(line, &interaction, &laws, &contact, None);
        Ok(())
    }

    /// The interaction and the initialization of two surfaces: the last ones of their own, or those of all.
    fn assigned(&self, sides: &[&str; 2]) -> Result<(Interaction, Option<&'a Initialization>)> {
        let said = self.said;
        let (mut interaction, mut initialization) = (Interaction::default(), None);
        for wanted in [&["", ""], sides] {
            for card in said
                .general
                .iter()
                .filter(|card| are_same(&card.sides, wanted))
            {
                let missing =
                    |what: &str, name: &str| (card.line, format!("there is no *{what} \"{name}\""));
                match &card.what {
                    General::Included | General::Excluded => {}
                    General::Interaction(name) => {
                        let found = said.interactions.iter().find(|one| one.name == *name);
                        let found = found.ok_or_else(|| missing("SURFACE INTERACTION", name))?;
                        interaction = found.clone();
                    }
                    General::Initialization(name) => {
                        let found = said.initializations.iter().find(|one| one.name == *name);
                        let none = || missing("CONTACT INITIALIZATION DATA", name);
                        initialization = Some(found.ok_or_else(none)?);
                    }
                }
            }
        }
        Ok((interaction, initialization))
    }

    /// The name of a surface of faces in the mesh; empty: all of the outside.
    fn side(&mut self, line: usize, name: &str) -> Result<String> {
        if name.is_empty() {
            return Ok(self.outside());
        }
        let surface = self.index.surface(line, name)?;
        if surface.nodes.is_some() {
            let text =
                format!("the surface \"{name}\" of general contact must consist of element faces");
            self.refuse(line, "CONTACT", text);
        }
        Ok(surface.name)
    }

    /// The name of the boundary that all of the outside is.
    fn outside(&mut self) -> String {
        if let Some(name) = &self.outside {
            return name.clone();
        }
        let name = self.name("exterior");
        self.index.add_outside(&name);
        self.outside = Some(name.clone());
        name
    }
}
