//! What pictures of the plane and of space share: how much displacements are magnified, the colours of a field and of
//! contact nodes, and the bar that says what they mean.

use super::chart::{colour, escape, nice};
use super::raster::viridis;
use crate::mesh::vector::{length, minus};
use crate::mesh::{Kind, Topology};
use crate::model::Elastic;
use crate::output::{ContactFields, NodeStatus, put};

/// Displacements are scaled to this part of the size of the mesh.
const SHOWN: f64 = 0.04;
/// Scaled bodies overlap where they have closed a gap: by this part of the size of the mesh at most.
const FALSE_OVERLAP: f64 = 0.003;

/// A factor for the displacements: a round one that shows them, near 1 where bodies would overlap by it.
pub(super) fn magnification<const D: usize>(
    elastic: &Elastic<D>,
    largest: f64,
    contact: &ContactFields<D>,
) -> f64
where
    Kind: Topology<D>,
{
    let (low, high) = elastic.mesh.bounding_box();
    let size = length(minus(high, low));
    if !(largest > 0.0) {
        return 1.0;
    }
    // A gap d that becomes g is drawn as d + s (g − d).
    let room = FALSE_OVERLAP * size;
    // Nor may bodies with an interference come apart.
    let pressed = (elastic.contact.places.iter().zip(&contact.gap))
        .filter(|(place, gap)| place.gap < 0.0 && **gap > place.gap)
        .map(|(place, gap)| 1.0 + room / (gap - place.gap))
        .fold(f64::INFINITY, f64::min);
    let wanted = (elastic.contact.places.iter().zip(&contact.gap))
        .map(|(place, gap)| (place.gap, place.gap - gap))
        .filter(|&(before, closed)| closed > 1e-9 * before)
        .map(|(before, closed)| (before + room) / closed)
        .fold((SHOWN * size / largest).min(pressed), f64::min);
    if wanted < 1.0 {
        return 1.0;
    }
    // The round number at or below.
    let up = nice(wanted);
    if up <= wanted * (1.0 + 1e-9) {
        up
    } else {
        [up / 2.0, up / 2.5]
            .into_iter()
            .find(|&f| (nice(f) / f - 1.0).abs() < 1e-9)
            .unwrap_or(up / 2.0)
            .max(1.0)
    }
}

/// What contact nodes may do in this case, and the colours of it.
pub(super) fn states<const D: usize>(contact: &ContactFields<D>) -> Vec<(NodeStatus, &'static str)>
where
    Kind: Topology<D>,
{
    let mut states = vec![
        (NodeStatus::Frictionless, colour::PURPLE),
        (NodeStatus::Stick, colour::BLUE),
        (NodeStatus::Slip, colour::ORANGE),
        (NodeStatus::Separated, "#ffffff"),
    ];
    // Bodies without friction know no stick and slip, and most with friction nothing else.
    let has_friction = contact.any_friction();
    let mut all = 0..contact.pressure.len();
    let without = all.any(|i| contact.status(i) == NodeStatus::Frictionless);
    states.retain(|&(state, _)| match state {
        NodeStatus::Frictionless => without,
        NodeStatus::Separated => true,
        NodeStatus::Stick | NodeStatus::Slip => has_friction,
    });
    states
}

/// The value that gets the last of the colours: the largest, but a few singular corners must not take all of them.
pub(super) fn top(values: &[f64]) -> f64 {
    let largest = values.iter().copied().fold(0.0, f64::max);
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let usual = (sorted.len().checked_sub(1)).map_or(0.0, |last| sorted[last * 998 / 1000]);
    if largest > 1.3 * usual && usual > 0.0 {
        usual
    } else {
        largest.max(f64::MIN_POSITIVE)
    }
}

/// The same for contact pressures, of those that there are; where these are few, none of them is taken for singular.
pub(super) fn top_pressure(values: &[f64]) -> f64 {
    const FEW: usize = 100;
    let pressed: Vec<f64> = values.iter().copied().filter(|&p| p > 0.0).collect();
    if pressed.len() < FEW {
        pressed.into_iter().fold(f64::MIN_POSITIVE, f64::max)
    } else {
        top(&pressed)
    }
}

/// The bar with the colours of a field from 0 on.
pub(super) struct ColourBar<'a> {
    /// Of its colours: no other on the page may have it.
    pub name: String,
    pub unit: &'a str,
    /// The value with the last of the colours.
    pub top: f64,
    /// The largest one.
    pub largest: f64,
    pub height: f64,
}

impl ColourBar<'_> {
    /// Adds it to a picture, with its left upper corner at a place.
    pub fn draw(&self, svg: &mut String, [x, y]: [f64; 2]) {
        let (name, top, bar) = (&self.name, self.top, self.height);
        put(svg, format_args!("<g transform=\"translate({x:.1} {y})\">"));
        let stops: String = (0..=10)
            .map(|k| {
                let [r, g, b] = viridis(f64::from(k) / 10.0);
                let offset = 10 * k;
                format!("<stop offset=\"{offset}%\" stop-color=\"rgb({r},{g},{b})\"/>")
            })
            .collect();
        put(
            svg,
            format_args!(
                "<defs><linearGradient id=\"{name}\" x1=\"0\" y1=\"1\" x2=\"0\" y2=\"0\">{stops}</linearGradient></defs>"
            ),
        );
        let unit = escape(self.unit);
        put(
            svg,
            format_args!(
                "<rect width=\"16\" height=\"{bar:.0}\" fill=\"url(#{name})\" stroke=\"#222222\" stroke-width=\"0.6\"/><text y=\"-8\">{unit}</text>"
            ),
        );
        let step = nice(top / 8.0);
        let mut value = 0.0;
        while value <= top * (1.0 + 1e-9) {
            let at = bar * (1.0 - value / top);
            put(
                svg,
                format_args!(
                    "<path d=\"M16 {at:.1}h5\" stroke=\"#222222\"/><text x=\"25\" y=\"{:.1}\">{}</text>",
                    at + 4.5,
                    short(value)
                ),
            );
            if !(self.largest > 0.0) {
                break;
            }
            value += step;
        }
        put(svg, format_args!("</g>"));
        if self.largest > top {
            let largest = short(self.largest);
            put(
                svg,
                format_args!(
                    "<text x=\"{x:.1}\" y=\"{:.1}\" font-size=\"12\">largest {largest}</text>",
                    y + bar + 18.0
                ),
            );
        }
    }
}

/// A number of three digits.
pub(super) fn short(value: f64) -> String {
    if value == 0.0 {
        "0".to_owned()
    } else if (0.01..1e4).contains(&value.abs()) {
        let digits = (2 - value.abs().log10().floor() as i32).max(0) as usize;
        let text = format!("{value:.digits$}");
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        }
    } else {
        let text = format!("{value:.2e}");
        let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        let digits = digits.trim_end_matches('0').trim_end_matches('.');
        format!("{digits}e{exponent}")
    }
}

#[cfg(test)]
mod tests {
    use super::{short, top, top_pressure};

    #[test]
    fn a_singular_value_does_not_take_all_colours_but_one_of_few_does() {
        let mut values = vec![1.0; 1000];
        values[3] = 9.0;
        assert_eq!((top(&values), top_pressure(&values)), (1.0, 1.0));
        values[..990].fill(0.0);
        values[3] = 9.0;
        assert_eq!(top_pressure(&values), 9.0);
        assert!(top_pressure(&[]) > 0.0 && top(&[]) > 0.0);
    }

    #[test]
    fn numbers_have_three_digits() {
        for (value, text) in [
            (0.0, "0"),
            (0.5, "0.5"),
            (-1.25, "-1.25"),
            (123.4, "123"),
            (9999.4, "9999"),
            (2e4, "2e4"),
            (1.234e-5, "1.23e-5"),
        ] {
            assert_eq!(short(value), text);
        }
    }
}
