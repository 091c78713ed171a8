//! Fields as images: their colours, the pixels of triangles, PNG.

/// Stops of the colour map viridis (Smith and van der Walt 2015), evenly spaced.
pub(super) const VIRIDIS: [[u8; 3]; 11] = [
    [68, 1, 84],
    [72, 36, 117],
    [65, 68, 135],
    [53, 95, 141],
    [42, 120, 142],
    [33, 145, 140],
    [34, 168, 132],
    [68, 191, 112],
    [122, 209, 81],
    [189, 223, 38],
    [253, 231, 37],
];
/// Pixels per unit of the picture, so that it may be drawn larger.
pub(super) const FINE: f64 = 2.0;
/// Levels of the colour map: those of a byte, minus some for the background and for fixed colours.
const LEVELS: u8 = 248;

/// The colour of a value from 0 to 1.
pub(super) fn viridis(value: f64) -> [u8; 3] {
    let place = value.clamp(0.0, 1.0) * (VIRIDIS.len() - 1) as f64;
    let below = (place as usize).min(VIRIDIS.len() - 2);
    let t = place - below as f64;
    std::array::from_fn(|c| {
        let [a, b] = [below, below + 1].map(|k| f64::from(VIRIDIS[k][c]));
        ((1.0 - t) * a + t * b).round() as u8
    })
}

/// The pixels of a length in the picture.
pub(super) fn pixels(length: f64) -> usize {
    (FINE * length).ceil().max(1.0) as usize
}

/// An image in a few colours: a byte for each pixel is a third of the time that three take.
pub(super) struct Raster {
    width: usize,
    height: usize,
    /// Row by row from the top, as places in the palette.
    pixels: Vec<u8>,
    /// The background, the levels of the map, and added colours.
    palette: Vec<[u8; 3]>,
}

impl Raster {
    /// An empty one for a field of this width and height in the picture.
    pub fn new(size: [f64; 2]) -> Self {
        let [width, height] = size.map(pixels);
        let levels = (0..LEVELS).map(|k| viridis(f64::from(k) / f64::from(LEVELS - 1)));
        Self {
            width,
            height,
            pixels: vec![0; width * height],
            palette: std::iter::once([255; 3]).chain(levels).collect(),
        }
    }

    /// The index of a value from 0 to 1.
    pub fn level(value: f64) -> u8 {
        // Half of one more rounds.
        (value.clamp(0.0, 1.0) * f64::from(LEVELS - 1) + 1.5) as u8
    }

    /// The index of a fixed colour, `#rrggbb`.
    pub fn add(&mut self, colour: &str) -> u8 {
        let part = |k| {
            colour
                .get(k..k + 2)
                .and_then(|c| u8::from_str_radix(c, 16).ok())
        };
        self.palette.push([1, 3, 5].map(|k| part(k).unwrap_or(0)));
        (self.palette.len() - 1) as u8
    }

    /// A triangle with its corners in units of the picture, in the colours that weights of the corners have.
    pub fn fill(&mut self, corners: [[f64; 2]; 3], colour: impl Fn([f64; 3]) -> u8) {
        let corners = corners.map(|x| x.map(|v| FINE * v));
        each_in([self.width, self.height], corners, |pixel, weights| {
            self.pixels[pixel] = colour(weights);
        });
    }

    /// In units of the picture.
    pub fn size(&self) -> [f64; 2] {
        [self.width, self.height].map(|v| v as f64 / FINE)
    }

    /// As PNG, transparent where there is nothing.
    pub fn png(&self) -> Vec<u8> {
        png([self.width, self.height], &self.pixels, |encoder| {
            encoder.set_color(png::ColorType::Indexed);
            encoder.set_palette(self.palette.concat());
            encoder.set_trns(&[0][..]);
            // Differences of places in a palette mean nothing.
            encoder.set_filter(png::Filter::NoFilter);
        })
    }
}

/// The pixels of an image of this width and height, row by row, inside a triangle, and the weights of its corners.
pub(super) fn each_in(
    [width, height]: [usize; 2],
    x: [[f64; 2]; 3],
    mut put: impl FnMut(usize, [f64; 3]),
) {
    let doubled = area(x);
    if !(doubled.abs() > 0.0) {
        return;
    }
    let range = |c: usize, end: usize| {
        let low = x.iter().map(|p| p[c]).fold(f64::INFINITY, f64::min);
        let high = x.iter().map(|p| p[c]).fold(f64::NEG_INFINITY, f64::max);
        // Centres of pixels are at one half.
        let first = (low - 0.5).ceil().max(0.0) as usize;
        let last = (high - 0.5).floor().min(end as f64 - 1.0);
        first..if last < 0.0 { 0 } else { last as usize + 1 }
    };
    let columns = range(0, width);
    // The change of weights from one column to the next.
    let slopes = [[1, 2], [2, 0], [0, 1]].map(|[p, q]| (x[p][1] - x[q][1]) / doubled);
    for row in range(1, height) {
        let p = [columns.start as f64 + 0.5, row as f64 + 0.5];
        let first = [[p, x[1], x[2]], [x[0], p, x[2]], [x[0], x[1], p]].map(|t| area(t) / doubled);
        // From the first column with no weight below zero to the last; a little outside, so that neighbours leave no seam.
        let (mut from, mut to) = (0.0_f64, columns.len() as f64 - 1.0);
        for (first, slope) in first.into_iter().zip(slopes) {
            let end = (-1e-9 - first) / slope;
            if slope > 0.0 {
                from = from.max(end.ceil());
            } else if slope < 0.0 {
                to = to.min(end.floor());
            } else if first < -1e-9 {
                to = -1.0;
            }
        }
        let mut along = from;
        while along <= to {
            let weights = std::array::from_fn(|k| first[k] + along * slopes[k]);
            put(row * width + columns.start + along as usize, weights);
            along += 1.0;
        }
    }
}

/// Twice the area of a triangle, negative if its corners are counter-clockwise in a picture.
pub(super) fn area([a, b, c]: [[f64; 2]; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The mean of values with these weights.
pub(super) fn mean(weights: [f64; 3], values: [f64; 3]) -> f64 {
    weights.iter().zip(values).map(|(w, v)| w * v).sum()
}

/// The place of the largest of three weights.
pub(super) fn largest([a, b, c]: [f64; 3]) -> usize {
    if a >= b && a >= c {
        0
    } else if b >= c {
        1
    } else {
        2
    }
}

/// Pixels, row by row, as PNG with a palette.
pub(super) fn png(
    [width, height]: [usize; 2],
    pixels: &[u8],
    colours: impl FnOnce(&mut png::Encoder<&mut Vec<u8>>),
) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    // A tenth larger than the smallest, in half the time.
    encoder.set_compression(png::Compression::Balanced);
    encoder.set_depth(png::BitDepth::Eight);
    colours(&mut encoder);
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
        let mut raster = Raster::new([1.5; 2]);
        let corners = [[0.0, 0.0], [1.5, 0.0], [0.0, 1.5]];
        // The field is x.
        raster.fill(corners, |w| Raster::level(mean(w, [0.0, 1.0, 0.0])));
        let [a, b, c] = [1.0, 3.0, 5.0].map(|x| Raster::level(x / 6.0));
        assert_eq!(raster.pixels, [a, b, c, a, b, 0, a, 0, 0]);
        // Outside and without area.
        raster.fill([[-5.0, 1.0], [-4.0, 1.0], [-4.0, 2.0]], |_| 1);
        raster.fill([[0.0, 0.0], [1.0, 1.0], [3.0, 3.0]], |_| 1);
        assert_eq!(raster.pixels[8], 0);
        assert!(raster.png().starts_with(b"\x89PNG"));
    }

    #[test]
    fn colours_end_with_the_map() {
        let colours = [-1.0, 0.5, 2.0].map(viridis);
        assert_eq!(colours, [[68, 1, 84], [33, 145, 140], [253, 231, 37]]);
        let mut raster = Raster::new([1.0; 2]);
        let own = raster.add("#0a0b0c");
        assert_eq!(raster.palette[usize::from(own)], [10, 11, 12]);
        assert_eq!(raster.palette[usize::from(Raster::level(2.0))], colours[2]);
    }
}
