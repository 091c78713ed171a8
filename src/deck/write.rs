//! Case files as texts.

use std::fmt::{self, Write as _};

/// A number as TOML has it, with a point or an exponent.
pub(super) struct Number(pub f64);

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let size = self.0.abs();
        if size == 0.0 || (1e-3..1e6).contains(&size) {
            write!(f, "{:?}", self.0)
        } else {
            // Shorter, and read back as the same number.
            let text = format!("{:e}", self.0);
            f.write_str(&text)
        }
    }
}

/// Numbers in brackets.
pub(super) fn list(values: &[f64]) -> String {
    let all: Vec<String> = values.iter().map(|&v| Number(v).to_string()).collect();
    format!("[{}]", all.join(", "))
}

/// A text in quotation marks.
pub(super) fn quoted(text: &str) -> String {
    let mut quoted = "\"".to_owned();
    for letter in text.chars() {
        match letter {
            '"' | '\\' => {
                quoted.push('\\');
                quoted.push(letter);
            }
            letter if letter.is_control() => {
                // Nothing is in the way of writing into a text.
                let _ = write!(quoted, "\\u{:04X}", u32::from(letter));
            }
            letter => quoted.push(letter),
        }
    }
    quoted.push('"');
    quoted
}

/// What values over the load steps are multiples of, and the multiples: none where all are the same.
pub(super) fn factors(values: &[f64]) -> (f64, Option<Vec<f64>>) {
    // Of values as large as each other the last.
    let largest = values
        .iter()
        .fold(0.0, |a: f64, &v| if v.abs() >= a.abs() { v } else { a });
    if values.iter().all(|&v| v == largest) {
        return (largest, None);
    }
    (largest, Some(values.iter().map(|v| v / largest).collect()))
}
