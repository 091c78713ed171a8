//! Reference nodes: couplings, rigid bodies, and sections of bolts; sectors.

use super::{Result, component, numbers, value};
use crate::deck::said::{CouplingCard, PretensionCard, Said, SectorCard};
use crate::mesh::abaqus::index::Card;
use crate::mesh::abaqus::keyword::{Keyword, entries, plain};

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
        self.couplings.push(CouplingCard {
            line: k.line,
            keyword: "COUPLING",
            name: k.option("CONSTRAINT NAME"),
            reference: Self::needs(k, "REF NODE")?,
            rotation: None,
            surface: Some(Self::needs(k, "SURFACE")?),
            nodes: Vec::new(),
            distributing: false,
            bound: [false; 3],
        });
        Ok(())
    }

    /// Directions of the last coupling: all without a data line.
    pub(super) fn couple(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        let distributing = k.name == "DISTRIBUTING";
        self.only(k, &[]);
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
        let (mut nodes, mut bounds) = (Vec::new(), Vec::new());
        for &(line, text) in &card.data {
            let all: Vec<&str> = entries(text).map(plain).collect();
            let mut bound = [all.len() < 2; 3];
            range(line, &all[1.min(all.len())..], &mut bound)?;
            nodes.extend(all.first());
            bounds.push(bound);
        }
        bounds.dedup();
        let [bound] = bounds[..] else {
            let text = "*KINEMATIC COUPLING needs nodes, all of them with the same directions";
            self.refuse(k.line, "KINEMATIC COUPLING", text);
            return Ok(());
        };
        self.couplings.push(CouplingCard {
            line: k.line,
            keyword: "KINEMATIC COUPLING",
            name: None,
            reference: Self::needs(k, "REF NODE")?,
            rotation: None,
            surface: None,
            nodes,
            distributing: false,
            bound,
        });
        Ok(())
    }

    pub(super) fn rigid_body(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        self.only(k, &["NSET", "TIE NSET", "REF NODE", "ROT NODE"]);
        let sets = ["NSET", "TIE NSET"].into_iter();
        let nodes: Vec<&str> = sets.filter_map(|name| k.option(name)).collect();
        if nodes.is_empty() {
            let text = "*RIGID BODY: nodes are needed: NSET= or TIE NSET=";
            self.refuse(k.line, "RIGID BODY", text);
            return Ok(());
        }
        self.couplings.push(CouplingCard {
            line: k.line,
            keyword: "RIGID BODY",
            name: None,
            reference: Self::needs(k, "REF NODE")?,
            rotation: k.option("ROT NODE"),
            surface: None,
            nodes,
            distributing: false,
            bound: [true; 3],
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
            surface: Self::needs(k, "SURFACE")?,
            reference: Self::needs(k, "NODE")?,
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
