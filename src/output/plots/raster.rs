//! Fields as images: the colours and the pixels of triangles.

/// Stops of the colour map viridis (Smith and van der Walt 2015), evenly spaced.
pub(super) const VIRIDIS: [[f64; 3]; 11] = [
    [68.0, 1.0, 84.0],
    [72.0, 36.0, 117.0],
    [65.0, 68.0, 135.0],
    [53.0, 95.0, 141.0],
    [42.0, 120.0, 142.0],
    [33.0, 145.0, 140.0],
    [34.0, 168.0, 132.0],
    [68.0, 191.0, 112.0],
    [122.0, 209.0, 81.0],
    [189.0, 223.0, 38.0],
    [253.0, 231.0, 37.0],
];

/// The colour of a value from 0 to 1.
pub(super) fn viridis(value: f64) -> [u8; 3] {
    let place = value.clamp(0.0, 1.0) * (VIRIDIS.len() - 1) as f64;
    let below = (place as usize).min(VIRIDIS.len() - 2);
    let t = place - below as f64;
    std::array::from_fn(|c| {
        ((1.0 - t) * VIRIDIS[below][c] + t * VIRIDIS[below + 1][c]).round() as u8
    })
}

/// Pixels of scalar values; NaN where there is nothing.
pub(super) struct Raster {
    pub width: usize,
    pub height: usize,
    /// Row by row from the top.
    values: Vec<f64>,
}

impl Raster {
    /// An empty one.
    pub fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            values: vec![f64::NAN; width * height],
        }
    }

    /// A triangle with a linear field; corners in pixels.
    pub fn triangle(&mut self, x: [[f64; 2]; 3], v: [f64; 3]) {
        let values = &mut self.values;
        Self::each_in(self.width, self.height, x, |pixel, weights| {
            values[pixel] = weights.iter().zip(v).map(|(w, v)| w * v).sum();
        });
    }

    /// A triangle where each pixel gets the value of the nearest corner.
    pub fn nearest(&mut self, x: [[f64; 2]; 3], v: [f64; 3]) {
        let values = &mut self.values;
        Self::each_in(self.width, self.height, x, |pixel, weights| {
            values[pixel] = v[largest(weights)];
        });
    }

    /// The pixels of a picture, row by row, that lie in a triangle, and the weights of its corners there.
    pub fn each_in(
        width: usize,
        height: usize,
        x: [[f64; 2]; 3],
        mut put: impl FnMut(usize, [f64; 3]),
    ) {
        let cross = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        let area = cross(x[0], x[1], x[2]);
        if !(area.abs() > 0.0) {
            return;
        }
        let range = |c: usize, end: usize| {
            let low = x.iter().map(|p| p[c]).fold(f64::INFINITY, f64::min);
            let high = x.iter().map(|p| p[c]).fold(f64::NEG_INFINITY, f64::max);
            // Centres of pixels lie at one half.
            let first = (low - 0.5).ceil().max(0.0) as usize;
            let last = (high - 0.5).floor().min(end as f64 - 1.0);
            first..if last < 0.0 { 0 } else { last as usize + 1 }
        };
        for row in range(1, height) {
            for column in range(0, width) {
                let p = [column as f64 + 0.5, row as f64 + 0.5];
                let weights = [
                    cross(p, x[1], x[2]) / area,
                    cross(x[0], p, x[2]) / area,
                    cross(x[0], x[1], p) / area,
                ];
                // A little outside, so that neighbours leave no seam.
                if weights.iter().all(|&w| w >= -1e-9) {
                    put(row * width + column, weights);
                }
            }
        }
    }

    /// As PNG, transparent where there is nothing; `top` has the last of the colours.
    pub fn png(&self, top: f64) -> Vec<u8> {
        self.coloured(|value| viridis(value / top))
    }

    /// As PNG, transparent where there is nothing, in the colours of the values.
    pub fn coloured(&self, colour: impl Fn(f64) -> [u8; 3]) -> Vec<u8> {
        let mut pixels = Vec::with_capacity(4 * self.values.len());
        for &value in &self.values {
            if value.is_nan() {
                pixels.extend([255, 255, 255, 0]);
            } else {
                let [r, g, b] = colour(value);
                pixels.extend([r, g, b, 255]);
            }
        }
        png(self.width, self.height, &pixels)
    }
}

/// The place of the largest of three weights.
pub(super) fn largest(weights: [f64; 3]) -> usize {
    let [a, b, c] = weights;
    if a >= b && a >= c {
        0
    } else if b >= c {
        1
    } else {
        2
    }
}

/// Pixels, row by row, as PNG: red, green, blue and how opaque each is.
pub(super) fn png(width: usize, height: usize, pixels: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let written = encoder
        .write_header()
        .and_then(|mut writer| writer.write_image_data(pixels));
    written.expect("writing to memory cannot fail");
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_fill_the_pixels_whose_centres_they_hold() {
        let mut raster = Raster::new(3, 3);
        raster.triangle([[0.0, 0.0], [3.0, 0.0], [0.0, 3.0]], [0.0, 3.0, 0.0]);
        let is_drawn: Vec<bool> = raster.values.iter().map(|v| !v.is_nan()).collect();
        let [yes, no] = [true, false];
        assert_eq!(is_drawn, [yes, yes, yes, yes, yes, no, yes, no, no]);
        // The field is x.
        assert!((raster.values[1] - 1.5).abs() < 1e-12 && (raster.values[3] - 0.5).abs() < 1e-12);
        // Outside and without area.
        raster.triangle([[-5.0, 1.0], [-4.0, 1.0], [-4.0, 2.0]], [1.0; 3]);
        raster.triangle([[0.0, 0.0], [1.0, 1.0], [3.0, 3.0]], [1.0; 3]);
        assert!(raster.values[8].is_nan());
        assert!(raster.png(3.0).starts_with(b"\x89PNG"));
    }

    #[test]
    fn colours_end_with_the_map() {
        assert_eq!(viridis(-1.0), [68, 1, 84]);
        assert_eq!(viridis(0.5), [33, 145, 140]);
        assert_eq!(viridis(2.0), [253, 231, 37]);
    }
}
