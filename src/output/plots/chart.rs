//! Line charts as SVG.

mod scale;

pub(super) use scale::{Scale, nice};

use crate::output::put;

/// Colours of series and zones that are told apart without colour vision as well (after Okabe and Ito 2008).
pub mod colour {
    /// Of a series.
    pub const BLUE: &str = "#0072b2";
    /// Of a series.
    pub const ORANGE: &str = "#d55e00";
    /// Of a series.
    pub const GREEN: &str = "#009e73";
    /// Of a series.
    pub const PURPLE: &str = "#aa4499";
    /// Of a series beside others.
    pub const GREY: &str = "#777777";
    /// Of a zone in contact.
    pub const STICK: &str = "#cfe5f5";
    /// Of a zone that slips.
    pub const SLIP: &str = "#fbdcc8";
    /// Of a zone without contact.
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
    /// A line.
    Line,
    /// A thin broken line.
    Dashed,
    /// A dot at each point.
    Dots,
    /// A line with a dot at each point.
    LineAndDots,
}

impl Mark {
    fn has_dots(self) -> bool {
        matches!(self, Self::Dots | Self::LineAndDots)
    }
}

/// Points that belong together; a NaN interrupts the line.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its entry in the legend; none if empty.
    pub name: String,
    /// One of [`colour`], or any that SVG knows.
    pub colour: &'static str,
    /// How it is drawn.
    pub mark: Mark,
    /// (x, y), in this order.
    pub points: Vec<(f64, f64)>,
}

/// A coloured zone between two abscissas.
#[derive(Clone, Debug)]
pub struct Zone {
    /// Where it begins.
    pub from: f64,
    /// Where it ends.
    pub to: f64,
    /// Its entry in the legend; zones of one name share it.
    pub name: &'static str,
    /// One of [`colour`], or any that SVG knows.
    pub colour: &'static str,
}

/// A chart.
#[derive(Clone, Debug)]
pub struct Chart {
    /// Above it.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// In the order in which they are drawn.
    pub series: Vec<Series>,
    /// Behind the series.
    pub zones: Vec<Zone>,
    /// Vertical lines.
    pub rules: Vec<f64>,
}

const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 400.0;
/// Where the axes begin.
const LEFT: f64 = 78.0;
const TOP: f64 = 44.0;
/// What lies behind their ends.
const BESIDE: f64 = 20.0;
const BELOW: f64 = 84.0;
/// Between the lines of the legend.
const LINE: f64 = 20.0;
const DASHES: &str = " stroke-dasharray=\"5 4\"";
/// The style of all pictures.
pub(super) const STYLE: &str = "font-family=\"system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', Arial, sans-serif\" font-size=\"13\" fill=\"#222222\"";

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
        self.sized(WIDTH, HEIGHT)
    }

    /// The picture in another size.
    pub(super) fn sized(&self, width: f64, height: f64) -> String {
        let entries = self.legend(width);
        let lines = entries.last().map_or(0, |entry| entry.line) as f64;
        let below = BELOW + LINE * lines;
        let points = || self.series.iter().flat_map(|s| s.points.iter());
        let ends = self.zones.iter().flat_map(|z| [z.from, z.to]);
        let all_x = points().map(|p| p.0).chain(ends);
        let mut drawing = Drawing {
            chart: self,
            xs: Scale::new(&self.x, all_x, LEFT, width - BESIDE, 0.0),
            ys: Scale::new(&self.y, points().map(|p| p.1), height - below, TOP, 0.06),
            width,
            height,
            below,
            svg: String::new(),
        };
        drawing.head();
        drawing.zones();
        drawing.axes();
        for series in &self.series {
            drawing.series(series);
        }
        drawing.labels();
        drawing.legend(&entries);
        drawing.svg + "</svg>\n"
    }
}

/// A chart on its way to a picture.
struct Drawing<'a> {
    chart: &'a Chart,
    xs: Scale,
    ys: Scale,
    width: f64,
    height: f64,
    /// What lies below the axes.
    below: f64,
    svg: String,
}

impl Drawing<'_> {
    fn put(&mut self, line: std::fmt::Arguments) {
        put(&mut self.svg, line);
    }

    fn right(&self) -> f64 {
        self.width - BESIDE
    }

    fn bottom(&self) -> f64 {
        self.height - self.below
    }

    /// The beginning of the file, and the title.
    fn head(&mut self) {
        let title = escape(&self.chart.title);
        let (width, height) = (self.width, self.height);
        self.put(format_args!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" role=\"img\" {STYLE}>"
        ));
        self.put(format_args!(
            "<title>{title}</title><rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>"
        ));
        self.put(format_args!(
            "<text x=\"{LEFT}\" y=\"26\" font-size=\"16\" font-weight=\"600\">{title}</text>"
        ));
    }

    /// The coloured zones, behind everything else.
    fn zones(&mut self) {
        let bottom = self.bottom();
        for zone in &self.chart.zones {
            let (a, b) = (self.xs.place(zone.from), self.xs.place(zone.to));
            self.put(format_args!(
                "<rect x=\"{a:.2}\" y=\"{TOP}\" width=\"{:.2}\" height=\"{:.2}\" fill=\"{}\"/>",
                (b - a).max(0.0),
                bottom - TOP,
                zone.colour
            ));
        }
    }

    /// Ticks with their numbers, the vertical lines, the two axes.
    fn axes(&mut self) {
        let (right, bottom) = (self.right(), self.bottom());
        for (v, label) in self.ys.ticks(6.0) {
            let y = self.ys.place(v);
            self.put(format_args!(
                "<path d=\"M{LEFT} {y:.2}H{right}\" stroke=\"#000000\" stroke-opacity=\"{}\"/><text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
                if v == 0.0 { 0.45 } else { 0.1 },
                LEFT - 8.0,
                y + 4.5
            ));
        }
        for (v, label) in self.xs.ticks(9.0 * self.width / WIDTH) {
            let x = self.xs.place(v);
            self.put(format_args!(
                "<path d=\"M{x:.2} {bottom}v5\" stroke=\"#222222\"/><text x=\"{x:.2}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
                bottom + 20.0
            ));
        }
        for &rule in &self.chart.rules {
            let x = self.xs.place(rule);
            self.put(format_args!(
                "<path d=\"M{x:.2} {TOP}V{bottom}\" stroke=\"#000000\" stroke-opacity=\"0.25\" stroke-dasharray=\"2 3\"/>"
            ));
        }
        self.put(format_args!(
            "<path d=\"M{LEFT} {TOP}V{bottom}H{right}\" fill=\"none\" stroke=\"#222222\"/>"
        ));
    }

    /// A line, dots, or both.
    fn series(&mut self, series: &Series) {
        let (mut path, mut dots) = (String::new(), String::new());
        let mut command = 'M';
        for &(x, y) in &series.points {
            let (px, py) = (self.xs.place(x), self.ys.place(y));
            if !(px.is_finite() && py.is_finite()) {
                command = 'M';
                continue;
            }
            path += &format!("{command}{px:.2} {py:.2}");
            dots += &format!("<circle cx=\"{px:.2}\" cy=\"{py:.2}\" r=\"3\"/>");
            command = 'L';
        }
        let colour = series.colour;
        if series.mark != Mark::Dots {
            let (width, dashes) = match series.mark {
                Mark::Dashed => (1.3, DASHES),
                _ => (2.0, ""),
            };
            self.put(format_args!(
                "<path d=\"{path}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" stroke-linejoin=\"round\"{dashes}/>"
            ));
        }
        if series.mark.has_dots() {
            self.put(format_args!("<g fill=\"{colour}\">{dots}</g>"));
        }
    }

    /// What the axes measure.
    fn labels(&mut self) {
        let x = escape(&self.xs.label(&self.chart.x));
        let y = escape(&self.ys.label(&self.chart.y));
        self.put(format_args!(
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{x}</text>",
            0.5 * (LEFT + self.right()),
            self.bottom() + 42.0
        ));
        self.put(format_args!(
            "<text transform=\"translate(20 {:.1}) rotate(-90)\" text-anchor=\"middle\">{y}</text>",
            0.5 * (TOP + self.bottom())
        ));
    }

    /// The names of series and zones with samples of them.
    fn legend(&mut self, entries: &[Entry]) {
        let lines = (self.below - BELOW) / LINE;
        for Entry {
            sample,
            name,
            x,
            line,
        } in entries
        {
            let y = self.height - 14.0 - LINE * (lines - *line as f64);
            self.put(format_args!(
                "<g transform=\"translate({x:.1} {y})\">{sample}<text x=\"32\">{}</text></g>",
                escape(name)
            ));
        }
    }
}

/// A name in the legend, with a sample of what it stands for, and its place.
struct Entry<'a> {
    sample: String,
    name: &'a str,
    x: f64,
    line: usize,
}

impl Chart {
    /// The names of series and zones from left to right; in narrow pictures in several lines.
    fn legend(&self, width: f64) -> Vec<Entry<'_>> {
        let mut named: Vec<(String, &str)> = (self.series.iter())
            .filter(|series| !series.name.is_empty())
            .map(|series| (sample(series), series.name.as_str()))
            .collect();
        for (i, zone) in self.zones.iter().enumerate() {
            if self.zones[..i].iter().all(|z| z.name != zone.name) {
                let colour = zone.colour;
                let sample = format!(
                    "<rect y=\"-11\" width=\"26\" height=\"13\" fill=\"{colour}\" stroke=\"#bbbbbb\"/>"
                );
                named.push((sample, zone.name));
            }
        }
        let (mut x, mut line) = (LEFT, 0);
        let mut entries = Vec::new();
        for (sample, name) in named {
            // About the width of a text in these fonts.
            let wide = 52.0 + 7.0 * name.chars().count() as f64;
            if x > LEFT && x + wide > width && width < WIDTH {
                (x, line) = (LEFT, line + 1);
            }
            entries.push(Entry {
                sample,
                name,
                x,
                line,
            });
            x += wide;
        }
        entries
    }
}

/// A piece of the line of a series, and a dot of it.
fn sample(series: &Series) -> String {
    let colour = series.colour;
    let line = match series.mark {
        Mark::Dots => String::new(),
        Mark::Dashed => {
            format!("<path d=\"M0 -4.5h26\" stroke=\"{colour}\" stroke-width=\"1.3\"{DASHES}/>")
        }
        _ => format!("<path d=\"M0 -4.5h26\" stroke=\"{colour}\" stroke-width=\"2\"/>"),
    };
    let dot = if series.mark.has_dots() {
        format!("<circle cx=\"13\" cy=\"-4.5\" r=\"3\" fill=\"{colour}\"/>")
    } else {
        String::new()
    };
    line + &dot
}

#[cfg(test)]
mod tests {
    use super::*;

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
