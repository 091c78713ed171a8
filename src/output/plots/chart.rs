//! Line charts as SVG.

mod scale;

pub(super) use scale::{Scale, nice};

use super::svg::{Svg, escape, patch, places};

/// Colours of series and zones that can also be distinguished without colour vision (after Okabe and Ito 2008).
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
    /// The measured quantity.
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

/// The style of a series.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// A line.
    Line,
    /// A thin broken line.
    Dashed,
    /// A line with a dot at each point.
    LineAndDots,
}

impl Mark {
    /// The width of its line.
    fn style(self) -> &'static str {
        match self {
            Self::Dashed => "stroke-width=\"1.3\" stroke-dasharray=\"5 4\"",
            _ => "stroke-width=\"2\"",
        }
    }
}

/// Points that belong together; a NaN interrupts the line.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its entry in the legend; none if empty.
    pub name: String,
    /// One of [`colour`], or any that SVG knows.
    pub colour: &'static str,
    /// Its style.
    pub mark: Mark,
    /// (x, y), in this order.
    pub points: Vec<(f64, f64)>,
}

impl Series {
    /// A series.
    pub fn new(name: &str, colour: &'static str, mark: Mark, points: Vec<(f64, f64)>) -> Self {
        Self {
            name: name.to_owned(),
            colour,
            mark,
            points,
        }
    }

    /// A piece of its line, and a dot of it.
    fn sample(&self) -> String {
        let (colour, style) = (self.colour, self.mark.style());
        let mut sample = format!("<path d=\"M0 -4.5h26\" stroke=\"{colour}\" {style}/>");
        if self.mark == Mark::LineAndDots {
            sample += &format!("<circle cx=\"13\" cy=\"-4.5\" r=\"3\" fill=\"{colour}\"/>");
        }
        sample
    }
}

/// A coloured zone between two abscissas.
#[derive(Clone, Debug)]
pub struct Zone {
    /// Its start.
    pub from: f64,
    /// Its end.
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
    /// In the order of drawing.
    pub series: Vec<Series>,
    /// Behind the series.
    pub zones: Vec<Zone>,
    /// Vertical lines.
    pub rules: Vec<f64>,
}

const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 400.0;
/// The start of the axes.
const LEFT: f64 = 78.0;
const TOP: f64 = 44.0;
/// The margin beyond their ends.
const BESIDE: f64 = 20.0;
const BELOW: f64 = 84.0;
impl Chart {
    /// The picture.
    pub fn svg(&self) -> String {
        self.sized(WIDTH, HEIGHT)
    }

    /// The picture in another size.
    pub(super) fn sized(&self, width: f64, height: f64) -> String {
        let entries = self.legend();
        let lines = places(&entries, LEFT, width).last().map_or(0.0, |at| at[1]);
        let (right, bottom) = (width - BESIDE, height - BELOW - lines);
        let points = || self.series.iter().flat_map(|s| s.points.iter());
        let ends = self.zones.iter().flat_map(|z| [z.from, z.to]);
        let all_x = points().map(|p| p.0).chain(ends);
        let mut drawing = Drawing {
            chart: self,
            xs: Scale::new(&self.x, all_x, LEFT, right, 0.0),
            ys: Scale::new(&self.y, points().map(|p| p.1), bottom, TOP, 0.06),
            right,
            bottom,
            svg: Svg::new(&self.title, [width, height], LEFT),
        };
        drawing.zones();
        drawing.axes();
        for series in &self.series {
            drawing.series(series);
        }
        drawing.labels();
        let first = height - 14.0 - lines;
        drawing.svg.legend(&entries, [LEFT, first], width);
        drawing.svg.finish()
    }

    /// The names of series and zones with samples of them.
    fn legend(&self) -> Vec<(String, String)> {
        let named = self.series.iter().filter(|series| !series.name.is_empty());
        let series = named.map(|series| (series.sample(), series.name.clone()));
        let first = (self.zones.iter().enumerate())
            .filter(|&(i, zone)| self.zones[..i].iter().all(|z| z.name != zone.name));
        let zones = first.map(|(_, zone)| (patch(zone.colour), zone.name.to_owned()));
        series.chain(zones).collect()
    }
}

/// A chart on its way to a picture.
struct Drawing<'a> {
    chart: &'a Chart,
    xs: Scale,
    ys: Scale,
    /// The end of the axes.
    right: f64,
    bottom: f64,
    svg: Svg,
}

impl Drawing<'_> {
    /// The coloured zones, behind everything else.
    fn zones(&mut self) {
        for zone in &self.chart.zones {
            let (a, b) = (self.xs.place(zone.from), self.xs.place(zone.to));
            self.svg.put(format_args!(
                "<rect x=\"{a:.2}\" y=\"{TOP}\" width=\"{:.2}\" height=\"{:.2}\" fill=\"{}\"/>",
                (b - a).max(0.0),
                self.bottom - TOP,
                zone.colour
            ));
        }
    }

    /// Ticks with their numbers, the vertical lines, the two axes.
    fn axes(&mut self) {
        let (right, bottom) = (self.right, self.bottom);
        for (v, label) in self.ys.ticks(6.0) {
            let (y, opacity) = (self.ys.place(v), if v == 0.0 { 0.45 } else { 0.1 });
            self.svg.put(format_args!(
                "<path d=\"M{LEFT} {y:.2}H{right}\" stroke=\"#000000\" stroke-opacity=\"{opacity}\"/><text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
                LEFT - 8.0,
                y + 4.5
            ));
        }
        for (v, label) in self.xs.ticks(9.0 * (right + BESIDE) / WIDTH) {
            let (x, below) = (self.xs.place(v), bottom + 20.0);
            self.svg.put(format_args!(
                "<path d=\"M{x:.2} {bottom}v5\" stroke=\"#222222\"/><text x=\"{x:.2}\" y=\"{below:.1}\" text-anchor=\"middle\">{label}</text>"
            ));
        }
        for &rule in &self.chart.rules {
            let x = self.xs.place(rule);
            self.svg.put(format_args!(
                "<path d=\"M{x:.2} {TOP}V{bottom}\" stroke=\"#000000\" stroke-opacity=\"0.25\" stroke-dasharray=\"2 3\"/>"
            ));
        }
        let axes = format!("M{LEFT} {TOP}V{bottom}H{right}");
        self.svg.path(&axes, "stroke=\"#222222\"");
    }

    /// A line, and dots on it.
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
        let (colour, style) = (series.colour, series.mark.style());
        let style = format!("stroke=\"{colour}\" {style} stroke-linejoin=\"round\"");
        self.svg.path(&path, &style);
        if series.mark == Mark::LineAndDots {
            let dots = format_args!("<g fill=\"{colour}\">{dots}</g>");
            self.svg.put(dots);
        }
    }

    /// The labels of the axes.
    fn labels(&mut self) {
        let x = escape(&self.xs.label(&self.chart.x));
        let y = escape(&self.ys.label(&self.chart.y));
        self.svg.put(format_args!(
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{x}</text>\n<text transform=\"translate(20 {:.1}) rotate(-90)\" text-anchor=\"middle\">{y}</text>",
            0.5 * (LEFT + self.right),
            self.bottom + 42.0,
            0.5 * (TOP + self.bottom)
        ));
    }
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
                series: vec![Series::new("s", colour::BLUE, Mark::LineAndDots, points)],
                zones: vec![],
                rules: vec![],
            };
            let svg = chart.svg();
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
            assert!(svg.contains("&lt;a &amp; b&gt;"));
        }
    }
}
