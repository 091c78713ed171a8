//! The keywords of a deck, one after another.

mod general;
mod keywords;
mod loads;
mod points;

use super::said::{
    Adjust, Amplitude, Behavior, BehaviorChange, Clearance, EquationCard, FrictionChange,
    Interaction, MaterialCard, PairCard, PairChange, Refusal, Said, Section, SpringCard, StepCard,
    TieCard, Transform,
};
use crate::mesh::abaqus::index::{Card, Deck, Name, Wrong};
use crate::mesh::abaqus::keyword::{Keyword, entries, key, parsed, plain, same};
use crate::mesh::vector::minus;

use keywords::{BEFORE_STEPS, OF_MODEL, OF_PARTS, OPTIONS, PASSED_OVER, REASONS};

type Result<T> = std::result::Result<T, Wrong>;

/// Values of TYPE for materials that are alike in all directions.
const ISOTROPIC: [&str; 3] = ["", "ISO", "ISOTROPIC"];

/// The entries of a data line as numbers, 0 where one is empty.
fn numbers(line: usize, text: &str) -> Result<Vec<f64>> {
    let value = |text: &str| match text {
        "" => Ok(0.0),
        text => value(line, text),
    };
    entries(text).map(value).collect()
}

fn value(line: usize, text: &str) -> Result<f64> {
    let value = parsed(text).filter(|value| value.is_finite());
    value.ok_or_else(|| (line, format!("\"{text}\" is not a number")))
}

/// The fault of a keyword whose name another one has.
fn twice(k: &Keyword, name: &str) -> Wrong {
    let text = format!(
        "*{} \"{name}\" is stated twice: give each a name of its own",
        k.name
    );
    (k.line, text)
}

/// A direction or an axis component "1" to "3" as a number from 0.
fn component(line: usize, text: &str) -> Result<u64> {
    let number = text.parse().ok().filter(|&number: &u64| number > 0);
    number.ok_or_else(|| (line, format!("\"{text}\" is not the number of a direction")))
}

impl<'a> Said<'a> {
    /// Reads all keywords; the user accepts the loss of those that are `ignored`.
    pub fn read(deck: &Deck, cards: &[Card<'a>], ignored: &[String]) -> Result<Self> {
        let mut said = Self {
            ignored: ignored
                .iter()
                .map(|name| key(name.trim_start_matches('*')))
                .collect(),
            ..Self::default()
        };
        for card in cards.iter().filter(|card| card.keyword.name == "AMPLITUDE") {
            said.amplitude(card)?;
        }
        // What a part says holds for it wherever it is placed; what it says of materials holds once.
        for run in cards.chunk_by(|a, b| a.places == b.places) {
            let places = run[0].places.as_deref();
            let of_part =
                |card: &&Card| places.is_some() && OF_PARTS.contains(&card.keyword.name.as_str());
            said.place = None;
            for card in run.iter().filter(|card| !of_part(card)) {
                let name = card.keyword.name.as_str();
                if places.is_some() && OF_MODEL.contains(&name) {
                    let text =
                        format!("*{name} within a part or an instance: state it after these");
                    return Err((card.keyword.line, text));
                }
                said.card(card)?;
            }
            for &place in places.unwrap_or_default() {
                said.place = Some(place);
                for card in run.iter().filter(of_part) {
                    said.card(card)?;
                }
            }
        }
        // Directions turn with the part.
        for transform in &mut said.transforms {
            let Some(place) = transform.set.place else {
                continue;
            };
            let origin = match transform.cylindrical {
                true => [0.0; 3],
                false => deck.moved(place, [0.0; 3]),
            };
            let points = transform
                .points()
                .map(|x| minus(deck.moved(place, x), origin));
            transform.points = std::array::from_fn(|i| points[i / 3][i % 3]);
        }
        Ok(said)
    }

    /// A name or a number, in the part whose keywords are read.
    fn here(&self, text: &'a str) -> Name<'a> {
        Name {
            text,
            place: self.place,
        }
    }

    /// Refuses something, unless the user ignores it.
    pub fn refuse(&mut self, line: usize, key: &str, text: impl Into<String>) {
        let key = key.to_uppercase();
        if self.passes(line, &key) {
            return;
        }
        self.refusals.push(Refusal {
            line,
            key,
            text: text.into(),
        });
    }

    /// Whether the user ignores it: then it is listed among the skipped keywords.
    fn passes(&mut self, line: usize, key: &str) -> bool {
        let is_ignored = self.ignores(key);
        if is_ignored {
            let passed = self.passed.entry(format!("{key} (ignored)"));
            passed.or_insert(line);
        }
        is_ignored
    }

    /// Whether the user ignores it.
    pub fn ignores(&self, key: &str) -> bool {
        self.ignored.contains(key)
    }

    /// Refuses all options of a keyword except these.
    fn only(&mut self, k: &Keyword<'a>, known: &[&str]) {
        for (name, text) in k.unknown(known) {
            self.refuse(k.line, name, text);
        }
    }

    fn card(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        let table = OPTIONS.iter().find(|known| known.0 == k.name);
        if let Some(known) = k.of_mesh().or(table.map(|known| known.1)) {
            self.only(k, known);
        }
        let mut before_steps = OF_PARTS.iter().chain(&BEFORE_STEPS);
        if !self.steps.is_empty() && before_steps.any(|name| k.name == *name) {
            let text = format!("*{} in a step: it belongs before the first *STEP", k.name);
            return Err((k.line, text));
        }
        let first = card.data.first().copied();
        let needed = || first.ok_or_else(|| (k.line, format!("*{} needs a data line", k.name)));
        match k.name.as_str() {
            "HEADING" => {
                if let (true, Some((_, text))) = (self.title.is_empty(), first) {
                    self.title = text.to_owned();
                }
            }
            "NODE" | "ELSET" | "SURFACE" | "AMPLITUDE" => {}
            "ELEMENT" => {
                self.types.extend(k.option("TYPE").map(str::to_uppercase));
            }
            "SOLID SECTION" => self.section(card)?,
            "MATERIAL" => {
                self.material = Some(self.materials.len());
                let name = k.option("NAME").map(key).unwrap_or_default();
                if self.materials.iter().any(|one| one.name == name) {
                    return Err(twice(k, &name));
                }
                self.materials.push(MaterialCard {
                    line: k.line,
                    name,
                    ..Default::default()
                });
            }
            "ELASTIC" => {
                let Some(material) = self.current_material(k)? else {
                    return Ok(());
                };
                let kind = k.option("TYPE").map(key).unwrap_or_default();
                if !ISOTROPIC.contains(&kind.as_str()) {
                    let text = format!("*ELASTIC, TYPE={kind}: materials are isotropic");
                    // Without it the material has no stiffness.
                    self.refuse(k.line, "", text);
                    self.materials[material].is_refused = true;
                    return Ok(());
                }
                if card.data.len() > 1 {
                    self.refuse(
                        k.line,
                        "ELASTIC",
                        "*ELASTIC: moduli cannot depend on the temperature",
                    );
                }
                let (line, text) = needed()?;
                match numbers(line, text)?[..] {
                    [young, poisson] | [young, poisson, _] => {
                        self.materials[material].elastic = Some([young, poisson]);
                    }
                    _ => return Err((line, "*ELASTIC needs E and ν in its data line".to_owned())),
                }
            }
            "DENSITY" => {
                let Some(material) = self.current_material(k)? else {
                    return Ok(());
                };
                let (line, text) = needed()?;
                let all = numbers(line, text)?;
                if card.data.len() > 1 {
                    self.refuse(
                        k.line,
                        "DENSITY",
                        "*DENSITY: it cannot depend on the temperature",
                    );
                }
                self.materials[material].density = Some(all[0]);
            }
            "EXPANSION" => {
                let Some(material) = self.current_material(k)? else {
                    return Ok(());
                };
                let kind = k.option("TYPE").map(key).unwrap_or_default();
                if !ISOTROPIC.contains(&kind.as_str()) {
                    let text = format!("*EXPANSION, TYPE={kind}: materials are isotropic");
                    self.refuse(k.line, "EXPANSION", text);
                    return Ok(());
                }
                if card.data.len() > 1 {
                    self.refuse(
                        k.line,
                        "EXPANSION",
                        "*EXPANSION: it cannot depend on the temperature",
                    );
                }
                let (line, text) = needed()?;
                self.materials[material].expansion = numbers(line, text)?[0];
            }
            "TRANSFORM" => self.transform(card)?,
            "STEP" => self.step(card),
            "STATIC" => {
                // Increments, solvers, damping and inelastic material leave the equilibrium of elastic bodies as it is.
                let known = [
                    "DIRECT",
                    "NO STOP",
                    "SOLVER",
                    "STABILIZE",
                    "ALLSDTOL",
                    "CONTINUE",
                    "FACTOR",
                    "LONG TERM",
                    "FULLY PLASTIC",
                    "ADIABATIC",
                ];
                // The total time counts in amplitudes alone.
                let times = ["TIME RESET", "TOTAL TIME AT START"];
                let counts = self.amplitudes.iter().any(|amplitude| amplitude.total);
                let times = if counts { &[][..] } else { &times[..] };
                self.only(k, &[&known[..], times].concat());
                let period = match first {
                    Some((line, text)) => numbers(line, text)?.get(1).copied(),
                    None => None,
                };
                if let Some(step) = self.steps.last_mut() {
                    step.is_static = true;
                    step.period = period.filter(|&period| period > 0.0).unwrap_or(1.0);
                }
            }
            "BOUNDARY" | "CLOAD" | "DLOAD" | "DSLOAD" | "TEMPERATURE" => self.loads(card)?,
            "INITIAL CONDITIONS" => self.initial(card)?,
            "SURFACE INTERACTION" => {
                self.only(k, &["NAME"]);
                self.interaction = Some(self.interactions.len());
                let name = k.option("NAME").map(key).unwrap_or_default();
                if self.interactions.iter().any(|one| one.name == name) {
                    return Err(twice(k, &name));
                }
                self.interactions.push(Interaction {
                    name,
                    ..Default::default()
                });
            }
            "SURFACE BEHAVIOR" => self.behavior(card)?,
            "FRICTION" => self.friction(card)?,
            "CHANGE FRICTION" => {
                self.changed_interaction(k)?;
                self.changes_friction = true;
            }
            "CHANGE SURFACE BEHAVIOR" => {
                self.changed_interaction(k)?;
                self.changes_behavior = true;
            }
            "MODEL CHANGE" => self.change_pairs(card)?,
            "CONTACT PAIR" => self.pairs(card)?,
            "CONTACT"
            | "CONTACT INCLUSIONS"
            | "CONTACT EXCLUSIONS"
            | "CONTACT PROPERTY ASSIGNMENT"
            | "CONTACT INITIALIZATION ASSIGNMENT"
            | "CONTACT INITIALIZATION DATA" => self.general(card)?,
            "TIE" => self.ties(card)?,
            "EQUATION" => self.equations(card)?,
            "SPRING" => self.spring(card)?,
            "COUPLING" => self.coupling(card)?,
            "KINEMATIC" | "DISTRIBUTING" => self.couple(card)?,
            "KINEMATIC COUPLING" => self.kinematic(card)?,
            "DISTRIBUTING COUPLING" => self.spread(card)?,
            "MPC" => self.multi_point(card)?,
            "RIGID BODY" => self.rigid_body(card)?,
            "CYCLIC SYMMETRY MODEL" => self.sectors(card)?,
            "PRE-TENSION SECTION" => self.pretension(card)?,
            "MASS" | "ROTARY INERTIA" => {
                self.masses.get_or_insert(k.line);
            }
            "CLEARANCE" => {
                let option = |name| {
                    k.option(name)
                        .ok_or_else(|| (k.line, format!("*CLEARANCE needs {name}=")))
                };
                self.only(k, &["MASTER", "SLAVE", "VALUE"]);
                let surfaces = [key(option("SLAVE")?), key(option("MASTER")?)];
                let value = value(k.line, option("VALUE")?)?;
                self.clearances.push(Clearance {
                    line: k.line,
                    surfaces,
                    value,
                });
            }
            "NSET" if k.option("UNSORTED").is_some() => {
                self.unsorted.extend(k.option("NSET").map(key));
            }
            name if PASSED_OVER.iter().any(|known| same(known, name)) => {
                // Keywords of the mesh need no note.
                let of_mesh = ["NSET", "INCLUDE", "ASSEMBLY", "INSTANCE", "PART"];
                if !of_mesh.contains(&name) && !name.starts_with("END") {
                    self.passed.entry(name.to_owned()).or_insert(k.line);
                }
            }
            name => {
                let reason = REASONS.iter().find(|known| same(known.0, name));
                let reason = reason.map_or("this keyword is not understood", |known| known.1);
                self.refuse(k.line, name, format!("*{name}: {reason}"));
            }
        }
        Ok(())
    }

    /// The material that a keyword belongs to; None where that is refused.
    fn current_material(&mut self, k: &Keyword) -> Result<Option<usize>> {
        match self.material {
            Some(material) => Ok(Some(material)),
            None => Err((k.line, format!("*{} comes before any *MATERIAL", k.name))),
        }
    }

    fn section(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        self.only(
            k,
            &["ELSET", "MATERIAL", "ORIENTATION", "OFFSET", "CONTROLS"],
        );
        let option = |name| {
            k.option(name)
                .ok_or_else(|| (k.line, format!("*SOLID SECTION needs {name}=")))
        };
        let thickness = match card.data.first() {
            Some(&(line, text)) => numbers(line, text)?.first().copied(),
            None => None,
        };
        self.sections.push(Section {
            line: k.line,
            set: self.here(option("ELSET")?),
            material: key(option("MATERIAL")?),
            thickness: thickness.filter(|&thickness| thickness > 0.0),
        });
        Ok(())
    }

    fn amplitude(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        self.only(
            k,
            &[
                "NAME",
                "TIME=TOTAL TIME",
                "TIME=TOTALTIME",
                "TIME=STEP TIME",
                "DEFINITION=TABULAR",
                "VALUE=RELATIVE",
            ],
        );
        let mut all = Vec::new();
        for &(line, text) in &card.data {
            all.extend(numbers(line, text)?);
        }
        let points: Vec<[f64; 2]> = all.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect();
        let grows = points.windows(2).all(|pair| pair[0][0] < pair[1][0]);
        if points.is_empty() || all.len() % 2 == 1 || !grows {
            return Err((
                k.line,
                "*AMPLITUDE needs pairs of increasing times and factors".to_owned(),
            ));
        }
        let name = k.option("NAME").map(key).unwrap_or_default();
        if self.amplitudes.iter().any(|one| one.name == name) {
            return Err(twice(k, &name));
        }
        self.amplitudes.push(Amplitude {
            name,
            total: k
                .option("TIME")
                .is_some_and(|time| key(time).starts_with("TOTAL")),
            points,
        });
        Ok(())
    }

    fn transform(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        let set = k
            .option("NSET")
            .ok_or_else(|| (k.line, "*TRANSFORM needs NSET=".to_owned()))?;
        let cylindrical = match k.option("TYPE").map(key).as_deref() {
            None | Some("R") => false,
            Some("C") => true,
            Some(other) => {
                let text = format!(
                    "*TRANSFORM, TYPE={other}: only rectangular and cylindrical ones are understood"
                );
                self.refuse(k.line, "TRANSFORM", text);
                return Ok(());
            }
        };
        let Some(&(line, text)) = card.data.first() else {
            return Err((k.line, "*TRANSFORM needs a data line".to_owned()));
        };
        let all = numbers(line, text)?;
        let Ok(points) = <[f64; 6]>::try_from(all) else {
            return Err((
                line,
                "*TRANSFORM needs the coordinates of two points".to_owned(),
            ));
        };
        self.transforms.push(Transform {
            set: self.here(set),
            line: k.line,
            cylindrical,
            points,
        });
        Ok(())
    }

    fn step(&mut self, card: &Card<'a>) {
        let k = &card.keyword;
        for (name, value) in &k.options {
            let no = value.eq_ignore_ascii_case("no");
            match name.as_str() {
                "NLGEOM" if !no && !self.passes(k.line, "NLGEOM") => {
                    self.large.get_or_insert(k.line);
                }
                "PERTURBATION" => self.refuse(
                    k.line,
                    "PERTURBATION",
                    "*STEP, PERTURBATION: every step starts where the previous one ended",
                ),
                _ => {}
            }
        }
        self.steps.push(StepCard {
            line: k.line,
            period: 1.0,
            at_once: k
                .option("AMPLITUDE")
                .is_some_and(|kind| key(kind) == "STEP"),
            is_static: false,
        });
    }

    fn behavior(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        let Some(interaction) = self.interaction else {
            return Err((
                k.line,
                "*SURFACE BEHAVIOR comes before any *SURFACE INTERACTION".to_owned(),
            ));
        };
        let changes = std::mem::take(&mut self.changes_behavior);
        self.belongs_before_steps(k, changes)?;
        let Some(behavior) = self.stated_behavior(card)? else {
            return Ok(());
        };
        if changes {
            // *CHANGE SURFACE BEHAVIOR has seen a step.
            self.behavior_changes.push(BehaviorChange {
                line: k.line,
                step: self.steps.len() - 1,
                interaction,
                behavior,
            });
        } else {
            self.interactions[interaction].behavior = behavior;
        }
        Ok(())
    }

    /// The law of pressures and overlaps that a card states; None where it is refused.
    fn stated_behavior(&mut self, card: &Card<'a>) -> Result<Option<Behavior>> {
        let k = &card.keyword;
        // Ways to enforce hard contact, which is enforced exactly here.
        let ways = ["PENALTY", "AUGMENTED LAGRANGE", "DIRECT"];
        self.only(k, &[&["PRESSURE-OVERCLOSURE"], &ways[..]].concat());
        let kind = k
            .option("PRESSURE-OVERCLOSURE")
            .map(key)
            .unwrap_or_else(|| "HARD".to_owned());
        let numbers = match card.data.first() {
            Some(&(line, text)) => numbers(line, text)?,
            None => Vec::new(),
        };
        let stiffness = numbers
            .first()
            .copied()
            .filter(|&stiffness| stiffness > 0.0);
        // A blank entry is the stiffness that the program chooses: hard contact here.
        let softer =
            stiffness.is_some() || numbers.get(1).is_some_and(|&clearance| clearance != 0.0);
        if k.option("PENALTY").is_some() && kind == "HARD" && softer {
            let text = "*SURFACE BEHAVIOR, PENALTY with a stiffness or a clearance: state PRESSURE-OVERCLOSURE=LINEAR, or leave them out for hard contact";
            self.refuse(k.line, "PENALTY", text);
        }
        let tied = kind == "TIED";
        let springs = match (kind.as_str(), stiffness) {
            ("HARD", _) => Some(Vec::new()),
            ("TIED", _) => Some(Vec::from_iter(stiffness.map(|k| [k, 0.0]))),
            ("LINEAR", Some(stiffness)) => Some(vec![[stiffness, 0.0]]),
            ("LINEAR", None) => {
                return Err((
                    k.line,
                    "*SURFACE BEHAVIOR needs a stiffness above 0".to_owned(),
                ));
            }
            ("EXPONENTIAL", _) => match numbers[..] {
                [c, p, ..] if c > 0.0 && p > 0.0 => self.springs(k.line, &exponential(c, p)),
                _ => {
                    let text = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=EXPONENTIAL needs a distance and a pressure above 0";
                    return Err((k.line, text.to_owned()));
                }
            },
            ("TABULAR", _) => self.table(card)?,
            _ => {
                let text = format!(
                    "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE={kind}: contact is hard, linear, exponential, or a table"
                );
                self.refuse(k.line, "SURFACE BEHAVIOR", text);
                None
            }
        };
        Ok(springs.map(|springs| Behavior { springs, tied }))
    }

    /// A law of pressures and overlaps, line by line.
    fn table(&mut self, card: &Card<'a>) -> Result<Option<Vec<[f64; 2]>>> {
        let line = card.keyword.line;
        let mut points = Vec::new();
        for &(line, text) in &card.data {
            match numbers(line, text)?[..] {
                [pressure, overlap, ..] => points.push([pressure, overlap]),
                _ => {
                    return Err((
                        line,
                        "each line of a table needs a pressure and an overclosure".to_owned(),
                    ));
                }
            }
        }
        let grows = |pair: &[[f64; 2]]| pair[0][0] <= pair[1][0] && pair[0][1] < pair[1][1];
        let zeros = points.iter().take_while(|point| point[0] == 0.0).count();
        if !points.windows(2).all(grows) || zeros == 0 || zeros == points.len() {
            let text = "*SURFACE BEHAVIOR: pressures of a table must increase with the overclosure, from 0 on";
            return Err((line, text.to_owned()));
        }
        Ok(self.springs(line, &points[zeros - 1..]))
    }

    /// The linear laws whose sum has these corners, each a pressure and an overlap, and its last slope beyond them.
    /// None where it is refused, because a sum of these becomes stiffer.
    fn springs(&mut self, line: usize, points: &[[f64; 2]]) -> Option<Vec<[f64; 2]>> {
        let mut springs: Vec<[f64; 2]> = Vec::new();
        let mut before = 0.0;
        for pair in points.windows(2) {
            let slope = (pair[1][0] - pair[0][0]) / (pair[1][1] - pair[0][1]);
            let more = slope - before;
            // Numbers of tables are rounded.
            if more.abs() <= 1e-4 * slope.max(before) {
                continue;
            }
            if more < 0.0 {
                let text = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR: a table must not become softer as the \
                            overclosure grows";
                self.refuse(line, "SURFACE BEHAVIOR", text);
                return None;
            }
            springs.push([more, pair[0][1]]);
            before = slope;
        }
        Some(springs)
    }

    /// The interaction that the next keyword changes from this step on.
    fn changed_interaction(&mut self, k: &Keyword<'a>) -> Result<()> {
        self.only(k, &["INTERACTION"]);
        let name = k.option("INTERACTION").map(key).unwrap_or_default();
        self.interaction = self.interactions.iter().position(|one| one.name == name);
        if self.interaction.is_none() {
            let text = format!("there is no *SURFACE INTERACTION \"{name}\"");
            return Err((k.line, text));
        }
        if self.steps.is_empty() {
            return Err((k.line, format!("*{} comes before any *STEP", k.name)));
        }
        Ok(())
    }

    /// Checks that a law in a step is one that a keyword of the step has announced.
    fn belongs_before_steps(&self, k: &Keyword<'a>, changes: bool) -> Result<()> {
        if changes || self.steps.is_empty() {
            return Ok(());
        }
        let text = format!(
            "*{name} in a step needs a *CHANGE {name}, INTERACTION= before it",
            name = k.name
        );
        Err((k.line, text))
    }

    fn friction(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        let Some(interaction) = self.interaction else {
            return Err((
                k.line,
                "*FRICTION comes before any *SURFACE INTERACTION".to_owned(),
            ));
        };
        self.only(k, &["ELASTIC SLIP", "SLIP TOLERANCE"]);
        if card.data.len() > 1 {
            let text = "*FRICTION: the coefficient cannot depend on slip rate, pressure or temperature: state one line";
            self.refuse(k.line, "FRICTION", text);
        }
        let changes = std::mem::take(&mut self.changes_friction);
        self.belongs_before_steps(k, changes)?;
        let Some(&(line, text)) = card.data.first() else {
            return Ok(());
        };
        let all = numbers(line, text)?;
        let slope = all.get(1).copied().filter(|&slope| slope > 0.0);
        let here = &mut self.interactions[interaction];
        if !changes {
            here.friction = all.first().copied();
            here.stick_slope = slope;
            return Ok(());
        }
        if slope != here.stick_slope && here.stick_slope.or(slope).is_some() {
            let text = "*CHANGE FRICTION: the stick slope stays the same over the steps";
            self.refuse(k.line, "CHANGE FRICTION", text);
        }
        self.friction_changes.push(FrictionChange {
            step: self.steps.len().saturating_sub(1),
            interaction,
            friction: all[0],
        });
        Ok(())
    }

    /// Pairs that come or go.
    fn change_pairs(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        if k.option("TYPE").map(key).as_deref() != Some("CONTACT PAIR") {
            let text = "*MODEL CHANGE: elements cannot come and go (TYPE=CONTACT PAIR can)";
            self.refuse(k.line, "MODEL CHANGE", text);
            return Ok(());
        }
        self.only(k, &["TYPE", "ADD", "REMOVE"]);
        let acts = k.option("ADD").is_some();
        if acts == k.option("REMOVE").is_some() {
            return Err((k.line, "*MODEL CHANGE has either ADD or REMOVE".to_owned()));
        }
        let Some(step) = self.steps.len().checked_sub(1) else {
            return Err((k.line, "*MODEL CHANGE comes before any *STEP".to_owned()));
        };
        for &(line, text) in &card.data {
            let all: Vec<&str> = entries(text).map(plain).collect();
            let [slave, master, ..] = all[..] else {
                let text = "*MODEL CHANGE has the slave and the master surface in a line";
                return Err((line, text.to_owned()));
            };
            self.pair_changes.push(PairChange {
                line,
                step,
                surfaces: [key(slave), key(master)],
                acts,
            });
        }
        Ok(())
    }

    fn pairs(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        self.only(
            k,
            &[
                "INTERACTION",
                "TYPE=NODE TO SURFACE",
                "TYPE=SURFACE TO SURFACE",
                "TYPE=MORTAR",
                "TYPE=LINMORTAR",
                "TYPE=PGLINMORTAR",
                "SMALL SLIDING",
                "ADJUST",
                "EXTENSION ZONE",
                "SMOOTH",
                "HCRIT",
            ],
        );
        let adjust = k.option("ADJUST").map(|text| match parsed(text) {
            Some(distance) => Adjust::Distance(distance),
            None => Adjust::Set(text),
        });
        for &(line, text) in &card.data {
            let all: Vec<&str> = entries(text).map(plain).collect();
            let (slave, master) = match all[..] {
                [slave, master, ..] if !master.is_empty() => (slave, master),
                // A surface that meets itself.
                [one] | [one, ..] => (one, one),
                [] => {
                    let text = "*CONTACT PAIR needs the slave and the master surface in each line";
                    return Err((line, text.to_owned()));
                }
            };
            self.pairs.push(PairCard {
                line,
                slave,
                master,
                interaction: k.option("INTERACTION").map(key).unwrap_or_default(),
                adjust,
            });
        }
        Ok(())
    }

    fn ties(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        if k.option("MULTISTAGE").is_some() {
            let text =
                "*TIE, MULTISTAGE: sectors of several numbers in one model are not supported";
            self.refuse(k.line, "MULTISTAGE", text);
            return Ok(());
        }
        self.only(
            k,
            &[
                "NAME",
                "CYCLIC SYMMETRY",
                "POSITION TOLERANCE",
                "ADJUST=YES",
                "ADJUST=NO",
                "TYPE=SURFACE TO SURFACE",
                "TYPE=NODE TO SURFACE",
            ],
        );
        let tolerance = match k.option("POSITION TOLERANCE") {
            Some(text) => Some(value(k.line, text)?),
            None => None,
        };
        for &(line, text) in &card.data {
            let all: Vec<&str> = entries(text).map(plain).collect();
            let [slave, master, ..] = all[..] else {
                return Err((
                    line,
                    "*TIE needs the slave and the master surface in each line".to_owned(),
                ));
            };
            let name = k.option("NAME").filter(|name| !name.is_empty());
            self.ties.push(TieCard {
                line,
                cyclic: k.option("CYCLIC SYMMETRY").is_some(),
                name,
                slave: self.here(slave),
                master: self.here(master),
                tolerance,
            });
        }
        Ok(())
    }

    /// The equations of a keyword: a line with the number of terms, and terms in lines below it.
    fn equations(&mut self, card: &Card<'a>) -> Result<()> {
        self.only(&card.keyword, &[]);
        let mut lines = card.data.iter();
        while let Some(&(line, text)) = lines.next() {
            let count = entries(text).next().unwrap_or_default();
            let Some(count) = count.parse().ok().filter(|&count: &usize| count > 0) else {
                let text = format!("*EQUATION: \"{count}\" is not a number of terms");
                return Err((line, text));
            };
            let mut terms: Vec<(&str, u64, f64)> = Vec::new();
            while terms.len() < count {
                let few = || {
                    (
                        line,
                        "*EQUATION has fewer terms than it announces".to_owned(),
                    )
                };
                let &(line, text) = lines.next().ok_or_else(few)?;
                let mut all: Vec<&str> = entries(text).map(plain).collect();
                while all.last().is_some_and(|last| last.is_empty()) {
                    all.pop();
                }
                for term in all.chunks(3) {
                    let [target, direction, factor] = *term else {
                        let text =
                            "*EQUATION needs a node or set, a direction and a factor for each term";
                        return Err((line, text.to_owned()));
                    };
                    terms.push((target, component(line, direction)?, value(line, factor)?));
                }
            }
            if terms.iter().any(|&(_, c, _)| c > 3) {
                self.refuse(
                    line,
                    "EQUATION",
                    "*EQUATION: nodes have displacements along x, y and z only (directions 1 to 3)",
                );
                continue;
            }
            let terms = terms.into_iter();
            let terms =
                terms.map(|(target, c, factor)| (self.here(target), c as usize - 1, factor));
            let terms = terms.collect();
            self.equations.push(EquationCard { line, terms });
        }
        Ok(())
    }

    /// Linear springs: the direction, where they have one, is in a line above the stiffness.
    fn spring(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        if k.option("NONLINEAR").is_some() {
            self.refuse(k.line, "SPRING", "*SPRING, NONLINEAR: springs are linear");
            return Ok(());
        }
        self.only(k, &["ELSET"]);
        let set = k.option("ELSET");
        let set = set.ok_or_else(|| (k.line, "*SPRING needs ELSET=".to_owned()))?;
        let (directions, (line, text)) = match card.data[..] {
            [stiffness] => (None, stiffness),
            [directions, stiffness] if !directions.1.contains(['.', 'e', 'E']) => {
                (Some(directions), stiffness)
            }
            [] => return Err((k.line, "*SPRING needs a data line".to_owned())),
            _ => {
                let text = "*SPRING: the stiffness cannot depend on the temperature";
                self.refuse(k.line, "SPRING", text);
                return Ok(());
            }
        };
        let stiffness = numbers(line, text)?[0];
        let mut components = Vec::new();
        if let Some((line, text)) = directions {
            for text in entries(text).filter(|text| !text.is_empty()) {
                components.push(component(line, text)? as usize - 1);
            }
        }
        let component = components.first().copied();
        let text = match component {
            _ if components.iter().any(|&c| Some(c) != component) => {
                "*SPRING: both ends of a spring have one direction"
            }
            Some(3..) => "*SPRING: nodes have no rotations",
            _ if stiffness < 0.0 => "*SPRING: the stiffness is below 0",
            _ => {
                self.springs.push(SpringCard {
                    line: k.line,
                    set: self.here(set),
                    component,
                    stiffness,
                });
                return Ok(());
            }
        };
        self.refuse(k.line, "SPRING", text);
        Ok(())
    }

    fn initial(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        match k.option("TYPE").map(key).as_deref() {
            Some("TEMPERATURE") => {
                for &(line, text) in &card.data {
                    let all: Vec<&str> = entries(text).map(plain).collect();
                    let [target, of_target, ..] = all[..] else {
                        return Err((
                            line,
                            "each temperature needs a node or set and a value".to_owned(),
                        ));
                    };
                    self.initial_temperatures
                        .push((line, target, value(line, of_target)?));
                }
            }
            kind => {
                let kind = kind.unwrap_or("none");
                let text = format!(
                    "*INITIAL CONDITIONS, TYPE={kind}: bodies are initially at rest and free of stress"
                );
                self.refuse(k.line, "INITIAL CONDITIONS", text);
            }
        }
        Ok(())
    }
}

/// Pressures and overlaps along CalculiX's exponential law p = p₀ 100^(δ/c₀): 1 % of p₀ at a gap of c₀, nothing beyond it.
///
/// Pressures grow by √10 from corner to corner, so that chords are within 3.5 % of c₀ beside the curve, up to 1e4 p₀.
/// Beyond, the law goes on with its last slope.
fn exponential(c: f64, p: f64) -> Vec<[f64; 2]> {
    let corners = (-4..=8).map(|i| [p * 10_f64.powf(0.5 * f64::from(i)), 0.25 * f64::from(i) * c]);
    std::iter::once([0.0, -c]).chain(corners.skip(1)).collect()
}
