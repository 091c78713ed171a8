//! Supports and loads.

use super::{Result, component, value};
use crate::deck::said::{Kind, Load, Said, What};
use crate::mesh::abaqus::index::Card;
use crate::mesh::abaqus::keyword::{entries, key, plain};

impl<'a> Said<'a> {
    /// Supports and loads, line by line.
    pub(super) fn loads(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        let kind = match k.name.as_str() {
            "BOUNDARY" => Kind::Boundary,
            "CLOAD" => Kind::Force,
            "DLOAD" => Kind::Distributed,
            "DSLOAD" => Kind::Surface,
            _ => Kind::Temperature,
        };
        self.only(
            k,
            &[
                "OP=NEW",
                "OP=MOD",
                "AMPLITUDE",
                "LOAD CASE=1",
                "TYPE=DISPLACEMENT",
                "FIXED",
            ],
        );
        let is_fixed = k.option("FIXED").is_some();
        if is_fixed && kind != Kind::Boundary {
            let text = format!("*{}, FIXED: this option belongs to *BOUNDARY", k.name);
            return Err((k.line, text));
        }
        let step = self.steps.len().checked_sub(1);
        let amplitude = match k.option("AMPLITUDE").map(key) {
            None => None,
            Some(name) => match self.amplitudes.iter().position(|one| one.name == name) {
                Some(number) => Some(number),
                None => return Err((k.line, format!("there is no *AMPLITUDE \"{name}\""))),
            },
        };
        // Of several cards of a kind in a step the first one says whether those of earlier steps go.
        let is_first = self.load_cards.insert((step, kind));
        if is_first && k.option("OP").is_some_and(|op| key(op) == "NEW") {
            let what = What::Clear(kind);
            self.loads.push(Load {
                line: k.line,
                step,
                what,
                amplitude: None,
            });
        }
        for &(line, text) in &card.data {
            let all: Vec<&str> = entries(text).map(plain).collect();
            let made = match kind {
                Kind::Boundary => match (self.boundary(line, &all)?, is_fixed) {
                    (
                        Some(What::Boundary {
                            target, components, ..
                        }),
                        true,
                    ) => Some(What::Fixed { target, components }),
                    (made, _) => made,
                },
                Kind::Force => self.force(line, &all)?,
                Kind::Distributed => self.distributed(line, &all)?,
                Kind::Surface => self.pressure(line, &all)?,
                Kind::Temperature => match all[..] {
                    [target, of_target, ..] => {
                        let value = value(line, of_target)?;
                        Some(What::Temperature { target, value })
                    }
                    _ => {
                        return Err((
                            line,
                            "each temperature needs a node or set and a value".to_owned(),
                        ));
                    }
                },
            };
            let load = made.map(|what| Load {
                line,
                step,
                what,
                amplitude,
            });
            self.loads.extend(load);
        }
        Ok(())
    }

    fn boundary(&mut self, line: usize, all: &[&'a str]) -> Result<Option<What<'a>>> {
        let [target, first, ..] = *all else {
            return Err((
                line,
                "*BOUNDARY needs a node or set and directions in each line".to_owned(),
            ));
        };
        let held = |components: &[usize]| {
            Ok(Some(What::Boundary {
                target,
                components: components.to_vec(),
                value: 0.0,
            }))
        };
        match first.to_uppercase().as_str() {
            // Only reference nodes have rotations.
            "ENCASTRE" => return held(&[0, 1, 2, 3, 4, 5]),
            "PINNED" => return held(&[0, 1, 2]),
            "XSYMM" => return held(&[0, 4, 5]),
            "YSYMM" => return held(&[1, 3, 5]),
            "ZSYMM" => return held(&[2, 3, 4]),
            _ => {}
        }
        let first = component(line, first)?;
        let last = match all.get(2) {
            None | Some(&"") => first,
            Some(text) => component(line, text)?,
        };
        let value = match all.get(3) {
            None | Some(&"") => 0.0,
            Some(text) => value(line, text)?,
        };
        if last < first || last > 11 {
            return Err((line, format!("{first} to {last} is no range of directions")));
        }
        if first == 11 || last == 11 {
            self.refuse(
                line,
                "BOUNDARY",
                "*BOUNDARY, direction 11: heat conduction is not supported",
            );
            return Ok(None);
        }
        if first > 6 {
            self.refuse(
                line,
                "BOUNDARY",
                format!("*BOUNDARY, direction {first}: nodes have no such direction"),
            );
            return Ok(None);
        }
        Ok(Some(What::Boundary {
            target,
            components: (first..=last.min(6)).map(|c| c as usize - 1).collect(),
            value,
        }))
    }

    fn force(&mut self, line: usize, all: &[&'a str]) -> Result<Option<What<'a>>> {
        let [target, direction, of_target, ..] = *all else {
            return Err((
                line,
                "*CLOAD needs a node or set, a direction and a force in each line".to_owned(),
            ));
        };
        let (direction, value) = (component(line, direction)?, value(line, of_target)?);
        if direction > 6 {
            self.refuse(
                line,
                "CLOAD",
                format!("*CLOAD, direction {direction}: nodes have no such direction"),
            );
            return Ok(None);
        }
        Ok(Some(What::Force {
            target,
            component: direction as usize - 1,
            value,
        }))
    }

    fn distributed(&mut self, line: usize, all: &[&'a str]) -> Result<Option<What<'a>>> {
        let [target, kind, ref rest @ ..] = *all else {
            return Err((
                line,
                "*DLOAD needs an element or set, a kind of load and its size in each line"
                    .to_owned(),
            ));
        };
        let rest = rest.iter().map(|text| {
            if text.is_empty() {
                Ok(0.0)
            } else {
                value(line, text)
            }
        });
        let rest: Vec<f64> = rest.collect::<Result<_>>()?;
        let kind = kind.to_uppercase();
        let few = || (line, format!("*DLOAD, {kind} has too few numbers"));
        let size = *rest.first().ok_or_else(few)?;
        let three = |from: usize| -> Result<[f64; 3]> {
            let all = rest.get(from..from + 3).ok_or_else(few)?;
            Ok([all[0], all[1], all[2]])
        };
        let direction = |from: usize, what: &str| match three(from)? {
            [0.0, 0.0, 0.0] if size != 0.0 => {
                let text = format!("*DLOAD, {kind}: {what} is zero: state its three components");
                Err((line, text))
            }
            direction => Ok(direction),
        };
        Ok(Some(match kind.as_str() {
            "GRAV" => What::Gravity {
                target,
                size,
                direction: direction(1, "the direction")?,
            },
            "CENTRIF" => What::Centrifugal {
                target,
                square: size,
                point: three(1)?,
                direction: direction(4, "the axis")?,
            },
            "BX" => What::Volume {
                target,
                axis: 0,
                value: size,
            },
            "BY" => What::Volume {
                target,
                axis: 1,
                value: size,
            },
            "BZ" => What::Volume {
                target,
                axis: 2,
                value: size,
            },
            other => match other
                .strip_prefix('P')
                .and_then(|number| number.parse().ok())
            {
                Some(face) => What::Face {
                    target,
                    face,
                    value: size,
                },
                None => {
                    self.refuse(
                        line,
                        "DLOAD",
                        format!("*DLOAD, {other}: this kind of load is not understood"),
                    );
                    return Ok(None);
                }
            },
        }))
    }

    fn pressure(&mut self, line: usize, all: &[&'a str]) -> Result<Option<What<'a>>> {
        match *all {
            [surface, kind, size, ..] if kind.eq_ignore_ascii_case("P") => {
                Ok(Some(What::Pressure {
                    surface,
                    value: value(line, size)?,
                }))
            }
            [_, kind, ..] => {
                self.refuse(
                    line,
                    "DSLOAD",
                    format!("*DSLOAD, {kind}: only pressures (P) are understood"),
                );
                Ok(None)
            }
            _ => Err((
                line,
                "*DSLOAD needs a surface, P and a pressure in each line".to_owned(),
            )),
        }
    }
}
