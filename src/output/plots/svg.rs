//! Writing SVG: the parts of all pictures.

use crate::output::put;
use base64::Engine as _;
use std::fmt::Arguments;

/// The style of all pictures.
const STYLE: &str = "font-family=\"system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', Arial, sans-serif\" font-size=\"13\" fill=\"#222222\"";
/// Between the lines of a legend.
pub(super) const LINE: f64 = 20.0;

/// A text with the characters that SVG and HTML reserve replaced.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// A picture, or a part of one, on its way.
#[derive(Default)]
pub(super) struct Svg {
    pub text: String,
}

impl Svg {
    /// The beginning of a file of this width and height, with its title from `left` on.
    pub fn new(title: &str, [width, height]: [f64; 2], left: f64) -> Self {
        let (title, mut svg) = (escape(title), Self::default());
        svg.put(format_args!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" height=\"{height:.0}\" role=\"img\" {STYLE}>\n<title>{title}</title><rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/><text x=\"{left}\" y=\"26\" font-size=\"16\" font-weight=\"600\">{title}</text>"
        ));
        svg
    }

    pub fn put(&mut self, line: Arguments) {
        put(&mut self.text, line);
    }

    /// Lines with a `style`.
    pub fn path(&mut self, path: &str, style: &str) {
        if !path.is_empty() {
            self.put(format_args!("<path d=\"{path}\" fill=\"none\" {style}/>"));
        }
    }

    /// Coordinates up to `close` are relative to this point.
    pub fn open(&mut self, [x, y]: [f64; 2]) {
        self.put(format_args!("<g transform=\"translate({x:.1} {y:.1})\">"));
    }

    pub fn close(&mut self) {
        self.put(format_args!("</g>"));
    }

    /// A PNG of this size with its left upper corner at a place.
    pub fn image(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], png: &[u8]) {
        let data = base64::engine::general_purpose::STANDARD.encode(png);
        self.put(format_args!(
            "<image x=\"{x}\" y=\"{y}\" width=\"{width:.1}\" height=\"{height:.1}\" preserveAspectRatio=\"none\" href=\"data:image/png;base64,{data}\"/>"
        ));
    }

    /// Samples, each with its name, from left to right and on more lines if necessary.
    pub fn legend(&mut self, entries: &[(String, String)], [left, top]: [f64; 2], right: f64) {
        for ((sample, name), [x, y]) in entries.iter().zip(places(entries, left, right)) {
            let (y, name) = (top + y, escape(name));
            self.put(format_args!(
                "<g transform=\"translate({x:.1} {y:.1})\">{sample}<text x=\"32\">{name}</text></g>"
            ));
        }
    }

    /// The file.
    pub fn finish(self) -> String {
        self.text + "</svg>\n"
    }
}

/// The positions of the entries of a legend, counted down from its first line.
pub(super) fn places(entries: &[(String, String)], left: f64, right: f64) -> Vec<[f64; 2]> {
    let (mut x, mut y) = (left, 0.0);
    let place = |(_, name): &(String, String)| {
        // About the width of a text in these fonts.
        let wide = 52.0 + 7.0 * name.chars().count() as f64;
        if x > left && x + wide > right {
            (x, y) = (left, y + LINE);
        }
        let here = [x, y];
        x += wide;
        here
    };
    entries.iter().map(place).collect()
}

/// The sample of an area in a legend.
pub(super) fn patch(colour: &str) -> String {
    format!("<rect y=\"-11\" width=\"26\" height=\"13\" fill=\"{colour}\" stroke=\"#bbbbbb\"/>")
}

/// A piece of a path, from one place to another.
pub(super) fn line([[a, b], [c, d]]: [[f64; 2]; 2]) -> String {
    format!("M{a:.1} {b:.1}L{c:.1} {d:.1}")
}
