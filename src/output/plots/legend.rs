//! The meaning of colours in pictures: of contact nodes and of fields.

use super::chart::{colour, nice};
use super::raster::viridis;
use super::svg::{Svg, escape};
use crate::mesh::{ElementKind, Topology};
use crate::output::{ContactFields, NodeStatus};

/// A state of a contact node, its name, the colour of such zones and that of such nodes.
pub(super) type State = (NodeStatus, &'static str, &'static str, &'static str);

/// All states.
const STATES: [State; 5] = {
    use NodeStatus::{Frictionless, Separated, Slip, Stick, Tied};
    [
        (Tied, "tied", colour::STICK, colour::BLUE),
        (Frictionless, "in contact", colour::STICK, colour::PURPLE),
        (Stick, "stick", colour::STICK, colour::BLUE),
        (Slip, "slip", colour::SLIP, colour::ORANGE),
        (Separated, "separated", colour::SEPARATED, "#ffffff"),
    ]
};

/// The state of a contact node.
pub(super) fn state<const D: usize>(contact: &ContactFields<D>, i: usize) -> State
where
    ElementKind: Topology<D>,
{
    let status = contact.status[i];
    let of = STATES.into_iter().find(|state| state.0 == status);
    of.unwrap_or(STATES[4])
}

/// The possible states of contact nodes in this case.
pub(super) fn states<const D: usize>(contact: &ContactFields<D>) -> Vec<State>
where
    ElementKind: Topology<D>,
{
    // Bodies without friction have no stick and slip, and most with friction have nothing else.
    let has_friction = contact.any_friction;
    let mut all = 0..contact.pressure.len();
    let without = all.any(|i| contact.status[i] == NodeStatus::Frictionless);
    let tied = (0..contact.pressure.len()).any(|i| contact.status[i] == NodeStatus::Tied);
    let may = |state: &State| match state.0 {
        NodeStatus::Tied => tied,
        NodeStatus::Frictionless => without,
        NodeStatus::Separated => true,
        NodeStatus::Stick | NodeStatus::Slip => has_friction,
    };
    STATES.into_iter().filter(may).collect()
}

/// The value of the last colour: the largest, except that a few singular corners must not determine it.
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

/// The same for contact pressures, among those that exist; if these are few, none of them counts as singular.
pub(super) fn top_pressure(values: &[f64]) -> f64 {
    const FEW: usize = 100;
    let pressed: Vec<f64> = values.iter().copied().filter(|&p| p > 0.0).collect();
    if pressed.len() < FEW {
        pressed.into_iter().fold(f64::MIN_POSITIVE, f64::max)
    } else {
        top(&pressed)
    }
}

/// The values of a colour bar, round ones from 0 to `top`; only 0 if all values vanish.
pub(super) fn ticks(top: f64, largest: f64) -> impl Iterator<Item = f64> {
    let step = nice(top / 8.0);
    let ticks = (0..).map(move |k| f64::from(k) * step);
    ticks.take_while(move |&v| v == 0.0 || largest > 0.0 && v <= top * (1.0 + 1e-9))
}

/// The bar with the colours of a field from 0 on.
pub(super) struct ColourBar<'a> {
    /// The name of its colours: no other on the page may have it.
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
    pub fn draw(&self, svg: &mut Svg, at: [f64; 2]) {
        let (name, top, bar, unit) = (&self.name, self.top, self.height, escape(self.unit));
        let stop = |k: u8| {
            let [r, g, b] = viridis(f64::from(k) / 10.0);
            format!(
                "<stop offset=\"{}%\" stop-color=\"rgb({r},{g},{b})\"/>",
                10 * k
            )
        };
        let stops: String = (0..=10).map(stop).collect();
        svg.open(at);
        svg.put(format_args!(
            "<defs><linearGradient id=\"{name}\" x1=\"0\" y1=\"1\" x2=\"0\" y2=\"0\">{stops}</linearGradient></defs>\n<rect width=\"16\" height=\"{bar:.0}\" fill=\"url(#{name})\" stroke=\"#222222\" stroke-width=\"0.6\"/><text y=\"-8\">{unit}</text>"
        ));
        for value in ticks(top, self.largest) {
            let y = bar * (1.0 - value / top);
            let (below, text) = (y + 4.5, short(value));
            svg.put(format_args!(
                "<path d=\"M16 {y:.1}h5\" stroke=\"#222222\"/><text x=\"25\" y=\"{below:.1}\">{text}</text>"
            ));
        }
        if self.largest > top {
            let (y, largest) = (bar + 18.0, short(self.largest));
            svg.put(format_args!(
                "<text y=\"{y:.1}\" font-size=\"12\">largest {largest}</text>"
            ));
        }
        svg.close();
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
        let values = [0.0, 0.5, -1.25, 123.4, 9999.4, 2e4, 1.234e-5];
        let texts = ["0", "0.5", "-1.25", "123", "9999", "2e4", "1.23e-5"];
        assert_eq!(values.map(short), texts);
    }
}
