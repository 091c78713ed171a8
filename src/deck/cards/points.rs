//! Reference nodes: couplings, rigid bodies, and sections of bolts; sectors.

use super::{Result, component, numbers, value};
use crate::deck::said::{
    CouplingCard, EquationCard, MpcCard, MpcKind, PretensionCard, Reference, Said, SectorCard,
};
use crate::mesh::abaqus::index::{Card, Name};
use crate::mesh::abaqus::keyword::{Keyword, entries, key, plain};

impl<'a> Said<'a> {
    /// An option with a value that a keyword must have.
    fn needs(k: &Keyword<'a>, name: &str) -> Result<&'a str> {
        let missing = || (k.line, format!("*{} needs {name}=", k.name));
        k.option(name).ok_or_else(missing)
    }

    /// The following data say how the nodes move.
    pub(super) fn coupling(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        self.only(k, &["CONSTRAINT NAME", "REF NODE", "SURFACE"]);
        let reference = Reference::Node(self.here(Self::needs(k, "REF NODE")?));
        self.couplings.push(CouplingCard {
            name: k.option("CONSTRAINT NAME"),
            surface: Some(self.here(Self::needs(k, "SURFACE")?)),
            bound: [false; 3],
            ..CouplingCard::rigid(k.line, "COUPLING", reference, Vec::new())
        });
        Ok(())
    }

    /// Directions of the last coupling: all without a data line.
    pub(super) fn couple(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        let distributing = k.name == "DISTRIBUTING";
        // The defaults.
        let uniform = ["WEIGHTING METHOD=UNIFORM", "COUPLING=CONTINUUM"];
        self.only(k, if distributing { &uniform[..] } else { &[] });
        let mut bound = [card.data.is_empty() || distributing; 3];
        for &(line, text) in &card.data {
            let all: Vec<&str> = entries(text).map(plain).collect();
            range(line, &all, &mut bound)?;
        }
        match self.couplings.last_mut() {
            Some(last) if last.keyword == "COUPLING" && last.bound == [false; 3] => {
                (last.distributing, last.bound) = (distributing, bound);
                Ok(())
            }
            _ => Err((k.line, format!("*{} follows a *COUPLING", k.name))),
        }
    }

    /// A coupling of nodes or sets, each with its directions: here the same for all.
    pub(super) fn kinematic(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        self.only(k, &["REF NODE"]);
        let (nodes, bounds) = self.nodes_with(card, |line, rest| {
            let mut bound = [rest.is_empty(); 3];
            range(line, rest, &mut bound)?;
            Ok(bound)
        })?;
        let [bound] = bounds[..] else {
            let text = "*KINEMATIC COUPLING needs nodes, all of them with the same directions";
            self.refuse(k.line, "KINEMATIC COUPLING", text);
            return Ok(());
        };
        let reference = Reference::Node(self.here(Self::needs(k, "REF NODE")?));
        self.couplings.push(CouplingCard {
            bound,
            ..CouplingCard::rigid(k.line, "KINEMATIC COUPLING", reference, nodes)
        });
        Ok(())
    }

    /// A load on a node, that of an element, is spread over nodes or sets, each with its weight: here the same for all.
    pub(super) fn spread(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        self.only(k, &["ELSET"]);
        let (nodes, weights) = self.nodes_with(card, |line, rest| match rest.first() {
            Some(weight) => value(line, weight),
            None => Ok(1.0),
        })?;
        if !matches!(weights[..], [weight] if weight > 0.0) {
            let text =
                "*DISTRIBUTING COUPLING needs nodes, all of them with the same weight above 0";
            self.refuse(k.line, "DISTRIBUTING COUPLING", text);
            return Ok(());
        }
        let reference = Reference::Elements(self.here(Self::needs(k, "ELSET")?));
        self.couplings.push(CouplingCard {
            distributing: true,
            ..CouplingCard::rigid(k.line, "DISTRIBUTING COUPLING", reference, nodes)
        });
        Ok(())
    }

    /// Nodes that depend on each other: lines with a type and nodes or sets; a line without a type goes on with the one above.
    pub(super) fn multi_point(&mut self, card: &Card<'a>) -> Result<()> {
        self.only(&card.keyword, &[]);
        let mut all: Vec<(usize, &str, Vec<Name>)> = Vec::new();
        for &(line, text) in &card.data {
            let mut parts = entries(text).map(plain);
            let name = parts.next().unwrap_or_default();
            // Zeros are no nodes.
            let nodes = parts.filter(|part| !part.is_empty() && *part != "0");
            let nodes = nodes.map(|part| self.here(part));
            match (name, all.last_mut()) {
                ("" | "0", Some((.., last))) => last.extend(nodes),
                _ => all.push((line, name, nodes.collect())),
            }
        }
        for (line, name, nodes) in all {
            let mut link = |kind, nodes| {
                self.multi_point.push(MpcCard {
                    line,
                    name,
                    kind,
                    nodes,
                });
            };
            match (key(name).as_str(), &nodes[..]) {
                ("PLANE", _) => link(MpcKind::Plane, nodes),
                ("STRAIGHT", _) => link(MpcKind::Straight, nodes),
                ("LINK", _) => link(MpcKind::Link, nodes),
                ("SLIDER", &[own, a, b]) => link(MpcKind::Straight, vec![a, b, own]),
                ("TIE" | "PIN", &[own, other]) => {
                    self.equations.extend((0..3).map(|c| EquationCard {
                        line,
                        terms: vec![(own, c, 1.0), (other, c, -1.0)],
                    }));
                }
                ("BEAM", &[own, other]) => {
                    let reference = Reference::Node(other);
                    let same = |known: &&mut CouplingCard| {
                        known.keyword == "MPC" && known.reference == reference
                    };
                    match self.couplings.iter_mut().find(same) {
                        Some(known) => known.nodes.push(own),
                        None => {
                            let card = CouplingCard::rigid(line, "MPC", reference, vec![own]);
                            self.couplings.push(card);
                        }
                    }
                }
                ("TIE" | "PIN" | "BEAM" | "SLIDER", _) => {
                    let text = format!("*MPC, {name} needs its two nodes in a line (SLIDER three)");
                    return Err((line, text));
                }
                _ => self.refuse(
                    line,
                    "MPC",
                    format!("*MPC, {name}: BEAM, LINK, PIN, PLANE, SLIDER, STRAIGHT and TIE are understood"),
                ),
            }
        }
        Ok(())
    }

    pub(super) fn rigid_body(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        self.only(k, &["NSET", "TIE NSET", "REF NODE", "ROT NODE"]);
        let sets = ["NSET", "TIE NSET"].into_iter();
        let nodes: Vec<Name> = sets
            .filter_map(|name| k.option(name))
            .map(|name| self.here(name))
            .collect();
        if nodes.is_empty() {
            let text = "*RIGID BODY: nodes are needed: NSET= or TIE NSET=";
            self.refuse(k.line, "RIGID BODY", text);
            return Ok(());
        }
        let reference = Reference::Node(self.here(Self::needs(k, "REF NODE")?));
        self.couplings.push(CouplingCard {
            rotation: k.option("ROT NODE").map(|name| self.here(name)),
            ..CouplingCard::rigid(k.line, "RIGID BODY", reference, nodes)
        });
        Ok(())
    }

    pub(super) fn pretension(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        if k.option("SURFACE").is_none() {
            let text =
                "*PRE-TENSION SECTION: only sections of solids are understood, with SURFACE=";
            self.refuse(k.line, "PRE-TENSION SECTION", text);
            return Ok(());
        }
        self.only(k, &["SURFACE", "NODE"]);
        let normal = match card.data.first() {
            None => None,
            Some(&(line, text)) => {
                let mut all = numbers(line, text)?;
                all.resize(3, 0.0);
                Some([all[0], all[1], all[2]])
            }
        };
        self.pretensions.push(PretensionCard {
            line: k.line,
            surface: self.here(Self::needs(k, "SURFACE")?),
            reference: self.here(Self::needs(k, "NODE")?),
            normal,
        });
        Ok(())
    }

    /// The axis and the number of sectors of a tie.
    pub(super) fn sectors(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        self.only(k, &["N", "TIE", "ELSET", "NGRAPH", "CHECK"]);
        let sectors = value(k.line, Self::needs(k, "N")?)?;
        if !(sectors >= 2.0 && sectors.fract() == 0.0 && sectors < 1e9) {
            let text =
                format!("*CYCLIC SYMMETRY MODEL: N is {sectors}: it must be a whole number from 2");
            return Err((k.line, text));
        }
        let axis = match card.data.first() {
            Some(&(line, text)) => <[f64; 6]>::try_from(numbers(line, text)?).ok(),
            None => None,
        };
        let Some(axis) = axis else {
            let text = "*CYCLIC SYMMETRY MODEL needs two points of the axis";
            return Err((k.line, text.to_owned()));
        };
        self.sectors.push(SectorCard {
            line: k.line,
            sectors: sectors as u32,
            tie: k.option("TIE"),
            axis,
        });
        Ok(())
    }

    /// The nodes or sets that data lines begin with, and what the rest of each line gives: once where it is the same in lines in a row.
    fn nodes_with<T: PartialEq>(
        &self,
        card: &Card<'a>,
        of_rest: impl Fn(usize, &[&'a str]) -> Result<T>,
    ) -> Result<(Vec<Name<'a>>, Vec<T>)> {
        let (mut nodes, mut given) = (Vec::new(), Vec::new());
        for &(line, text) in &card.data {
            let mut all = entries(text).map(plain);
            nodes.extend(all.next().map(|name| self.here(name)));
            given.push(of_rest(line, &all.collect::<Vec<&str>>())?);
        }
        given.dedup();
        Ok((nodes, given))
    }
}

/// Marks the directions of a data line that are along axes: from the first number to the second one.
fn range(line: usize, all: &[&str], bound: &mut [bool; 3]) -> Result<()> {
    let mut given = all.iter().filter(|text| !text.is_empty());
    let Some(first) = given.next() else {
        return Ok(());
    };
    let first = component(line, first)?;
    let last = match given.next() {
        None => first,
        Some(text) => component(line, text)?,
    };
    if last < first || last > 6 {
        let text = format!("{first} to {last} is no range of directions");
        return Err((line, text));
    }
    for c in first..=last.min(3) {
        bound[c as usize - 1] = true;
    }
    Ok(())
}
