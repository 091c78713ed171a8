//! Line charts as SVG.

use std::fmt::Write as _;

/// Colours of series and zones that are told apart without colour vision as well (after Okabe and Ito 2008).
pub mod colour {
    pub const BLUE: &str = "#0072b2";
    pub const ORANGE: &str = "#d55e00";
    pub const GREEN: &str = "#009e73";
    pub const PURPLE: &str = "#aa4499";
    pub const GREY: &str = "#777777";
    /// Zones, behind everything else.
    pub const STICK: &str = "#cfe5f5";
    pub const SLIP: &str = "#fbdcc8";
    pub const SEPARATED: &str = "#eeeeee";
}

/// An axis of a chart.
#[derive(Clone, Debug)]
pub struct Axis {
    /// What it measures.
    pub label: String,
    /// The unit, to which a power of ten is added where numbers are large or small; may be empty.
    pub unit: String,
    /// Powers of ten.
    pub logarithmic: bool,
}

impl Axis {
    /// A linear axis.
    pub fn new(label: &str, unit: &str) -> Self {
        Self {
            label: label.to_owned(),
            unit: unit.to_owned(),
            logarithmic: false,
        }
    }

    /// A logarithmic axis.
    pub fn logarithmic(label: &str, unit: &str) -> Self {
        Self {
            logarithmic: true,
            ..Self::new(label, unit)
        }
    }
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    Line,
    Dashed,
    Dots,
    LineAndDots,
}

/// Points that belong together; a NaN interrupts the line.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its entry in the legend; none if empty.
    pub name: String,
    pub colour: &'static str,
    pub mark: Mark,
    pub points: Vec<(f64, f64)>,
}

/// A coloured zone between two abscissas.
#[derive(Clone, Debug)]
pub struct Zone {
    pub from: f64,
    pub to: f64,
    /// Its entry in the legend; zones of one name share it.
    pub name: &'static str,
    pub colour: &'static str,
}

/// A chart.
#[derive(Clone, Debug)]
pub struct Chart {
    pub title: String,
    pub x: Axis,
    pub y: Axis,
    pub series: Vec<Series>,
    pub zones: Vec<Zone>,
    /// Vertical lines.
    pub rules: Vec<f64>,
}

const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 400.0;
const LEFT: f64 = 78.0;
const RIGHT: f64 = 20.0;
const TOP: f64 = 44.0;
const BOTTOM: f64 = 84.0;
/// The style of all pictures.
pub(super) const STYLE: &str = "font-family=\"system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', Arial, sans-serif\" font-size=\"13\" fill=\"#222222\"";

/// From values to places along an axis.
struct Scale {
    low: f64,
    high: f64,
    logarithmic: bool,
    /// What labels are divided by.
    unit: f64,
    start: f64,
    end: f64,
}

impl Scale {
    fn new(
        axis: &Axis,
        values: impl Iterator<Item = f64>,
        start: f64,
        end: f64,
        room: f64,
    ) -> Self {
        let usable = |v: &f64| v.is_finite() && (!axis.logarithmic || *v > 0.0);
        let (mut low, mut high) = values
            .filter(usable)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
                (a.min(v), b.max(v))
            });
        if !(low <= high) {
            (low, high) = if axis.logarithmic {
                (0.1, 1.0)
            } else {
                (0.0, 1.0)
            };
        }
        let mut unit = 1.0;
        if axis.logarithmic {
            // A little around the data.
            let around = (high / low).powf(0.04).clamp(1.2, 10.0);
            (low, high) = (low / around, (high * around).min(f64::MAX));
        } else {
            if high - low <= 1e-12 * high.abs().max(low.abs()) {
                let middle = high.abs().max(1e-300);
                (low, high) = (low - 0.5 * middle, high + 0.5 * middle);
            }
            let margin = room * (high - low);
            (low, high) = (low - margin, high + margin);
            let exponent = high.abs().max(low.abs()).log10().floor();
            if !(-2.0..4.0).contains(&exponent) {
                unit = 10f64.powi(3 * (exponent / 3.0).floor() as i32);
            }
        }
        Self {
            low,
            high,
            logarithmic: axis.logarithmic,
            unit,
            start,
            end,
        }
    }

    fn place(&self, v: f64) -> f64 {
        let part = if self.logarithmic {
            (v / self.low).log10() / (self.high / self.low).log10()
        } else {
            (v - self.low) / (self.high - self.low)
        };
        self.start + part * (self.end - self.start)
    }

    fn ticks(&self, wanted: f64) -> Vec<(f64, String)> {
        if self.logarithmic {
            let (a, b) = (
                self.low.log10().ceil() as i32,
                self.high.log10().floor() as i32,
            );
            if b - a < 2 {
                return (a - 1..=b)
                    .flat_map(|k| [(1, k), (2, k), (5, k)])
                    .map(|(f, k)| (f64::from(f) * 10f64.powi(k), f, k))
                    .filter(|(v, ..)| (self.low..=self.high).contains(v))
                    .map(|(v, f, k)| {
                        let label = match (f, k) {
                            (_, -3..4) => format!("{v:.*}", (-k).max(0) as usize),
                            (1, _) => power_of_ten(k),
                            _ => format!("{f}·{}", power_of_ten(k)),
                        };
                        (v, label)
                    })
                    .collect();
            }
            let step = (f64::from(b - a) / wanted).ceil().max(1.0) as i32;
            return (a..=b)
                .step_by(step as usize)
                .map(|k| (10f64.powi(k), power_of_ten(k)))
                .collect();
        }
        let step = nice((self.high - self.low) / wanted);
        let decimals = (-(step / self.unit).log10().floor()).max(0.0) as usize;
        let first = (self.low / step).ceil() as i64;
        let last = (self.high / step).floor() as i64;
        (first..=last)
            .map(|k| {
                let v = k as f64 * step;
                (
                    v,
                    format!("{:.decimals$}", v / self.unit + 0.0).replace('-', "−"),
                )
            })
            .collect()
    }

    /// The label of the axis with its unit.
    fn label(&self, axis: &Axis) -> String {
        let factor = match self.unit.log10().round() as i32 {
            0 => String::new(),
            k => power_of_ten(k),
        };
        let unit = [factor.as_str(), axis.unit.as_str()].join(" ");
        match unit.trim() {
            "" => axis.label.clone(),
            unit => format!("{} ({unit})", axis.label),
        }
    }
}

/// The next of 1, 2, 5, 10 … at or above a step.
pub(super) fn nice(step: f64) -> f64 {
    let power = 10f64.powf(step.log10().floor());
    let factor = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|f| f * power >= step * (1.0 - 1e-9))
        .unwrap_or(10.0);
    factor * power
}

/// 10ᵏ.
fn power_of_ten(k: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raised: String = k
        .to_string()
        .chars()
        .map(|c| c.to_digit(10).map_or('⁻', |d| DIGITS[d as usize]))
        .collect();
    format!("10{raised}")
}

/// A text with the characters that SVG and HTML reserve replaced.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

impl Chart {
    /// The picture.
    pub fn svg(&self) -> String {
        let points = || self.series.iter().flat_map(|s| s.points.iter());
        let (right, bottom) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
        let zone_ends = self.zones.iter().flat_map(|z| [z.from, z.to]);
        let xs = Scale::new(
            &self.x,
            points().map(|p| p.0).chain(zone_ends),
            LEFT,
            right,
            0.0,
        );
        let ys = Scale::new(&self.y, points().map(|p| p.1), bottom, TOP, 0.06);
        let mut svg = String::new();
        let out = &mut svg;
        let mut put = |text: std::fmt::Arguments| {
            out.write_fmt(text)
                .expect("writing to a string cannot fail");
            out.push('\n');
        };
        put(format_args!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" role=\"img\" {STYLE}>"
        ));
        put(format_args!(
            "<title>{}</title><rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#ffffff\"/>",
            escape(&self.title)
        ));
        put(format_args!(
            "<text x=\"{LEFT}\" y=\"26\" font-size=\"16\" font-weight=\"600\">{}</text>",
            escape(&self.title)
        ));
        for zone in &self.zones {
            let (a, b) = (xs.place(zone.from), xs.place(zone.to));
            put(format_args!(
                "<rect x=\"{a:.2}\" y=\"{TOP}\" width=\"{:.2}\" height=\"{:.2}\" fill=\"{}\"/>",
                (b - a).max(0.0),
                bottom - TOP,
                zone.colour
            ));
        }
        for (v, label) in ys.ticks(6.0) {
            let y = ys.place(v);
            put(format_args!(
                "<path d=\"M{LEFT} {y:.2}H{right}\" stroke=\"#000000\" stroke-opacity=\"{}\"/><text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
                if v == 0.0 { 0.45 } else { 0.1 },
                LEFT - 8.0,
                y + 4.5
            ));
        }
        for (v, label) in xs.ticks(9.0) {
            let x = xs.place(v);
            put(format_args!(
                "<path d=\"M{x:.2} {bottom}v5\" stroke=\"#222222\"/><text x=\"{x:.2}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
                bottom + 20.0
            ));
        }
        for &rule in &self.rules {
            put(format_args!(
                "<path d=\"M{:.2} {TOP}V{bottom}\" stroke=\"#000000\" stroke-opacity=\"0.25\" stroke-dasharray=\"2 3\"/>",
                xs.place(rule)
            ));
        }
        put(format_args!(
            "<path d=\"M{LEFT} {TOP}V{bottom}H{right}\" fill=\"none\" stroke=\"#222222\"/>"
        ));
        for series in &self.series {
            let mut path = String::new();
            let mut dots = String::new();
            let mut drawing = false;
            for &(x, y) in &series.points {
                let (px, py) = (xs.place(x), ys.place(y));
                if !(px.is_finite() && py.is_finite()) {
                    drawing = false;
                    continue;
                }
                let command = if drawing { 'L' } else { 'M' };
                write!(path, "{command}{px:.2} {py:.2}").expect("writing to a string cannot fail");
                drawing = true;
                write!(dots, "<circle cx=\"{px:.2}\" cy=\"{py:.2}\" r=\"3\"/>")
                    .expect("writing to a string cannot fail");
            }
            if series.mark != Mark::Dots {
                put(format_args!(
                    "<path d=\"{path}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\"{}/>",
                    series.colour,
                    if series.mark == Mark::Dashed {
                        1.3
                    } else {
                        2.0
                    },
                    if series.mark == Mark::Dashed {
                        " stroke-dasharray=\"5 4\""
                    } else {
                        ""
                    }
                ));
            }
            if matches!(series.mark, Mark::Dots | Mark::LineAndDots) {
                put(format_args!("<g fill=\"{}\">{dots}</g>", series.colour));
            }
        }
        put(format_args!(
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
            0.5 * (LEFT + right),
            bottom + 42.0,
            escape(&xs.label(&self.x))
        ));
        put(format_args!(
            "<text transform=\"translate(20 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            0.5 * (TOP + bottom),
            escape(&ys.label(&self.y))
        ));
        let mut x = LEFT;
        let y = HEIGHT - 14.0;
        let mut seen: Vec<&str> = Vec::new();
        let mut entry = |sample: String, name: &str| {
            put(format_args!(
                "<g transform=\"translate({x:.1} {y})\">{sample}<text x=\"32\">{}</text></g>",
                escape(name)
            ));
            // About the width of a text in these fonts.
            x += 52.0 + 7.0 * name.chars().count() as f64;
        };
        for series in self.series.iter().filter(|s| !s.name.is_empty()) {
            let line = match series.mark {
                Mark::Dots => String::new(),
                Mark::Dashed => format!(
                    "<path d=\"M0 -4.5h26\" stroke=\"{}\" stroke-width=\"1.3\" stroke-dasharray=\"5 4\"/>",
                    series.colour
                ),
                _ => format!(
                    "<path d=\"M0 -4.5h26\" stroke=\"{}\" stroke-width=\"2\"/>",
                    series.colour
                ),
            };
            let dot = if matches!(series.mark, Mark::Dots | Mark::LineAndDots) {
                format!(
                    "<circle cx=\"13\" cy=\"-4.5\" r=\"3\" fill=\"{}\"/>",
                    series.colour
                )
            } else {
                String::new()
            };
            entry(line + &dot, &series.name);
        }
        for zone in &self.zones {
            if !seen.contains(&zone.name) {
                seen.push(zone.name);
                let sample = format!(
                    "<rect y=\"-11\" width=\"26\" height=\"13\" fill=\"{}\" stroke=\"#bbbbbb\"/>",
                    zone.colour
                );
                entry(sample, zone.name);
            }
        }
        svg.push_str("</svg>\n");
        svg
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_in_range() {
        let axis = Axis::new("p", "Pa");
        let scale = Scale::new(&axis, [0.0, 8.3877e7].into_iter(), 0.0, 1.0, 0.0);
        let ticks: Vec<String> = scale.ticks(6.0).into_iter().map(|t| t.1).collect();
        assert_eq!(ticks, ["0", "20", "40", "60", "80"]);
        assert_eq!(scale.label(&axis), "p (10⁶ Pa)");
        let scale = Scale::new(&axis, [-0.02, 0.013].into_iter(), 0.0, 1.0, 0.0);
        assert_eq!(scale.ticks(6.0)[1].1, "−0.01");
        let axis = Axis::logarithmic("err", "");
        let scale = Scale::new(&axis, [3e-9, 1.0, 0.0].into_iter(), 0.0, 1.0, 0.0);
        assert_eq!(scale.ticks(20.0).len(), 9);
        assert_eq!(scale.ticks(20.0)[0].1, "10⁻⁸");
    }

    #[test]
    fn odd_data_gives_a_picture_without_nan() {
        for points in [
            vec![],
            vec![(0.0, 0.0)],
            vec![(1.0, f64::NAN), (2.0, 5.0)],
            vec![(0.0, 1e-300), (1e300, 1e300)],
        ] {
            let chart = Chart {
                title: "<a & b>".to_owned(),
                x: Axis::new("x", "m"),
                y: Axis::new("y", ""),
                series: vec![Series {
                    name: "s".to_owned(),
                    colour: colour::BLUE,
                    mark: Mark::LineAndDots,
                    points,
                }],
                zones: vec![],
                rules: vec![],
            };
            let svg = chart.svg();
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
            assert!(svg.contains("&lt;a &amp; b&gt;"));
        }
    }
}
