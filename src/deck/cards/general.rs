//! General contact: `*CONTACT` and the keywords that follow it.

use super::{Card, Result, Said, entries, key, plain, value};
use crate::deck::said::{General, GeneralCard, Initialization};

impl<'a> Said<'a> {
    pub(super) fn general(&mut self, card: &Card<'a>) -> Result<()> {
        let k = &card.keyword;
        if self.steps.len() > 1 {
            let text = format!("*{}: general contact begins before the second step", k.name);
            self.refuse(k.line, "CONTACT", text);
            return Ok(());
        }
        match k.name.as_str() {
            "CONTACT" => {
                self.only(k, &["OP"]);
                self.general_contact.get_or_insert(k.line);
                if k.option("OP").map(key).as_deref() == Some("NEW") {
                    self.general.clear();
                }
            }
            "CONTACT INCLUSIONS" => {
                // Bodies have the same outside by either word.
                let all = ["ALL EXTERIOR", "ALL ELEMENT BASED"];
                self.only(k, &all);
                if all.iter().any(|name| k.option(name).is_some()) {
                    self.add(k.line, ["", ""], General::Included);
                }
                for (line, sides, _) in sides(card) {
                    self.add(line, sides, General::Included);
                }
            }
            "CONTACT EXCLUSIONS" => {
                self.only(k, &[]);
                for (line, sides, _) in sides(card) {
                    self.add(line, sides, General::Excluded);
                }
            }
            "CONTACT PROPERTY ASSIGNMENT" => {
                self.only(k, &[]);
                for (line, sides, name) in sides(card) {
                    self.add(line, sides, General::Interaction(key(name)));
                }
            }
            "CONTACT INITIALIZATION ASSIGNMENT" => {
                self.only(k, &[]);
                for (line, sides, name) in sides(card) {
                    self.add(line, sides, General::Initialization(key(name)));
                }
            }
            _ => {
                self.only(
                    k,
                    &["NAME", "INTERFERENCE FIT", "SEARCH ABOVE", "SEARCH BELOW"],
                );
                if k.option("INTERFERENCE FIT")
                    .is_some_and(|size| !size.is_empty())
                {
                    let text = "*CONTACT INITIALIZATION DATA, INTERFERENCE FIT: general contact has the overlaps of the mesh; state \
                                others by *CONTACT PAIR with *CLEARANCE";
                    self.refuse(k.line, "INTERFERENCE FIT", text);
                }
                let above = k.option("SEARCH ABOVE").map(|text| value(k.line, text));
                let pressed = k.option("INTERFERENCE FIT").is_some();
                self.initializations.push(Initialization {
                    name: k.option("NAME").map(key).unwrap_or_default(),
                    pressed,
                    // Overlaps up to the same distance would be closed as well.
                    above: if pressed {
                        0.0
                    } else {
                        above.transpose()?.unwrap_or_default()
                    },
                });
            }
        }
        Ok(())
    }

    fn add(&mut self, line: usize, sides: [&'a str; 2], what: General) {
        self.general.push(GeneralCard { line, sides, what });
    }
}

/// The lines of a keyword: two surfaces, the first one again where the second is left out, and a name.
fn sides<'a>(card: &Card<'a>) -> Vec<(usize, [&'a str; 2], &'a str)> {
    let of_line = |&(line, text): &(usize, &'a str)| {
        let mut all = entries(text).map(plain);
        let [first, second, name] = [0; 3].map(|_| all.next().unwrap_or_default());
        let second = if second.is_empty() { first } else { second };
        (line, [first, second], name)
    };
    card.data.iter().map(of_line).collect()
}
