//! The names of lengths, forces and stresses: labels, no conversion.

use serde::{Deserialize, Serialize, Serializer};

/// The units that the numbers of a model are in; `[units]` of a case file. Stresses and areas follow.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Units {
    /// Of coordinates, displacements and gaps.
    pub length: String,
    /// Of forces.
    pub force: String,
}

impl Default for Units {
    fn default() -> Self {
        Self {
            length: "m".to_owned(),
            force: "N".to_owned(),
        }
    }
}

impl Units {
    /// Labels for numbers without stated units.
    pub fn untold() -> Self {
        Self {
            length: String::new(),
            force: String::new(),
        }
    }

    /// A unit behind a number, with a space between them if there is one.
    pub fn behind(unit: &str) -> String {
        match unit {
            "" => String::new(),
            unit => format!(" {unit}"),
        }
    }

    /// A unit after its quantity, in brackets if there is one.
    pub fn named(what: &str, unit: &str) -> String {
        match unit {
            "" => what.to_owned(),
            unit => format!("{what} ({unit})"),
        }
    }

    /// A length with its unit, in short.
    pub fn long(&self, length: f64) -> String {
        format!("{length:.3e}{}", Self::behind(&self.length))
    }

    /// The unit of stresses, moduli and pressures: the name of force per area if it has one; empty if one of the two is not
    /// stated.
    pub fn stress(&self) -> String {
        let name = match (self.force.as_str(), self.length.as_str()) {
            ("N", "m") => "Pa",
            ("N", "mm") | ("MN", "m") => "MPa",
            ("kN", "m") => "kPa",
            ("kN", "mm") | ("GN", "m") => "GPa",
            ("N", "µm" | "um" | "μm") => "TPa",
            ("lbf", "in") => "psi",
            ("kip" | "kips", "in") => "ksi",
            ("", _) | (_, "") => "",
            _ => return format!("{}/{}", self.force, self.area()),
        };
        name.to_owned()
    }

    /// That of areas.
    pub fn area(&self) -> String {
        self.power("²")
    }

    /// That of lengths with an exponent.
    pub fn power(&self, exponent: &str) -> String {
        match self.length.as_str() {
            "" => String::new(),
            length => format!("{length}{exponent}"),
        }
    }

    /// That of moments and of work.
    pub fn moment(&self) -> String {
        match (self.force.as_str(), self.length.as_str()) {
            ("", _) | (_, "") => String::new(),
            (force, length) => format!("{force} {length}"),
        }
    }

    /// The fault of the labels, if any.
    pub(crate) fn fault(&self) -> Option<String> {
        [("length", &self.length), ("force", &self.force)]
            .into_iter()
            .find(|(_, label)| {
                label.chars().count() > 12
                    || label.contains(|c: char| {
                        c.is_control()
                            || c.is_whitespace()
                            || matches!(c, ',' | '"' | '<' | '>' | '&' | '[' | ']')
                    })
            })
            .map(|(name, label)| {
                format!(
                    "{name} = {label:?} is not the short name of a unit, such as \"mm\" or \"kN\""
                )
            })
    }
}

impl Serialize for Units {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Labels<'a> {
            length: &'a str,
            force: &'a str,
            stress: String,
        }
        let labels = Labels {
            length: &self.length,
            force: &self.force,
            stress: self.stress(),
        };
        labels.serialize(serializer)
    }
}

/// The labels as they were read, without derived ones.
pub(super) fn labels<S: Serializer>(units: &Option<Units>, to: S) -> Result<S::Ok, S::Error> {
    match units {
        Some(units) => to.collect_map([("length", &units.length), ("force", &units.force)]),
        None => to.serialize_none(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stresses_follow() {
        let stress = |force: &str, length: &str| {
            let (force, length) = (force.to_owned(), length.to_owned());
            Units { length, force }.stress()
        };
        assert_eq!(Units::default().stress(), "Pa");
        assert_eq!(stress("N", "mm"), "MPa");
        assert_eq!(stress("kN", "m"), "kPa");
        assert_eq!(stress("kgf", "cm"), "kgf/cm²");
        assert_eq!(stress("", "mm"), "");
        let untold = Units::untold();
        let all = [untold.stress(), untold.area(), untold.moment()];
        assert!(all.iter().all(String::is_empty) && untold.long(2.0) == "2.000e0");
    }
}
