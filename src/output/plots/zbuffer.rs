//! Pictures of surfaces in space without hidden parts: each sample keeps the surface nearest to the viewer.

use super::raster::{area, each_in, mean, png, viridis};
use rayon::prelude::*;

/// Samples per pixel in each direction.
const SAMPLES: usize = 2;
/// A point is hidden where all samples around it are nearer to the viewer by more than this many samples.
const BEHIND: f32 = 2.0;
/// The grey of obstacles around the bodies, and its opacity in front of them and beside them.
const VEIL: [f32; 3] = [205.0, 208.0, 212.0];
const IN_FRONT: f32 = 0.22;
const BESIDE: f32 = 0.62;
/// The brightening of the best lit faces, and the darkening of those without light.
const BRIGHT: f32 = 0.2;
const DARK: f32 = 0.33;
/// Colours between the first and the last: neighbouring ones differ by less than the step of a byte.
const LEVELS: usize = 1000;

/// The surface at a sample.
#[derive(Clone, Copy)]
struct Sample {
    /// Towards the viewer.
    depth: f32,
    value: f32,
    shade: f32,
    /// The depth of the obstacle that veils the bodies.
    veil: f32,
}

/// A picture of surfaces on its way.
pub(super) struct ZBuffer {
    /// In pixels.
    pub width: usize,
    pub height: usize,
    samples: Vec<Sample>,
}

/// A corner of a triangle: its position in pixels, to the right, down and towards the viewer, its value, and its
/// brightness: 0.5 leaves the colour of the value unchanged.
#[derive(Clone, Copy)]
pub(super) struct Corner {
    pub at: [f64; 3],
    pub value: f64,
    pub shade: f64,
}

impl ZBuffer {
    /// An empty one.
    pub fn new(width: usize, height: usize) -> Self {
        let nothing = Sample {
            depth: f32::NEG_INFINITY,
            value: 0.0,
            shade: 0.0,
            veil: f32::NEG_INFINITY,
        };
        Self {
            width,
            height,
            samples: vec![nothing; width * height * SAMPLES * SAMPLES],
        }
    }

    /// A triangle of a body, with its corners counter-clockwise seen from outside: triangles turned away are always
    /// hidden by something nearer.
    pub fn triangle(&mut self, corners: [Corner; 3]) {
        if area(corners.map(|corner| [corner.at[0], corner.at[1]])) > 0.0 {
            return;
        }
        let (values, shades) = (corners.map(|c| c.value), corners.map(|c| c.shade));
        self.each(corners.map(|corner| corner.at), |sample, weights, depth| {
            if depth > sample.depth {
                sample.depth = depth;
                sample.value = mean(weights, values) as f32;
                sample.shade = mean(weights, shades) as f32;
            }
        });
    }

    /// A triangle of a transparent surface in front of bodies.
    pub fn veil(&mut self, at: [[f64; 3]; 3]) {
        self.each(at, |sample, _, depth| sample.veil = sample.veil.max(depth));
    }

    /// The samples in a triangle, with the weights of its corners and the depth there.
    fn each(&mut self, at: [[f64; 3]; 3], mut put: impl FnMut(&mut Sample, [f64; 3], f32)) {
        let size = [self.width * SAMPLES, self.height * SAMPLES];
        let x = at.map(|p| [0, 1].map(|c| SAMPLES as f64 * p[c]));
        let depths = at.map(|p| p[2]);
        each_in(size, x, |place, weights| {
            let depth = mean(weights, depths) as f32;
            put(&mut self.samples[place], weights, depth);
        });
    }

    /// Whether bodies hide a point (in pixels, and towards the viewer).
    pub fn hides(&self, at: [f64; 3]) -> bool {
        let fine = SAMPLES as f64;
        let [x, y] = [at[0], at[1]].map(|v| (fine * v).floor() as i64);
        let depth = at[2] as f32 + BEHIND / SAMPLES as f32;
        let (columns, rows) = (self.width * SAMPLES, self.height * SAMPLES);
        let nearer = |column: i64, row: i64| {
            let inside = (0..columns as i64).contains(&column) && (0..rows as i64).contains(&row);
            inside && self.samples[row as usize * columns + column as usize].depth > depth
        };
        (y - 1..=y + 1).all(|row| (x - 1..=x + 1).all(|column| nearer(column, row)))
    }

    /// The colour of each pixel, red, green, blue and how opaque it is; `top` has the last of the colours.
    fn pixels(&self, top: f64) -> Vec<u8> {
        let levels = (0..=LEVELS).map(|k| k as f64 / LEVELS as f64);
        let colours: Vec<[u8; 3]> = levels.map(viridis).collect();
        let columns = self.width * SAMPLES;
        let mut pixels = vec![0; 4 * self.width * self.height];
        let rows = pixels.par_chunks_mut(4 * self.width);
        rows.enumerate().for_each(|(row, pixels)| {
            for (column, pixel) in pixels.chunks_exact_mut(4).enumerate() {
                let mut sum = [0.0; 4];
                for k in 0..SAMPLES * SAMPLES {
                    let (x, y) = (column * SAMPLES + k % SAMPLES, row * SAMPLES + k / SAMPLES);
                    let colour = self.samples[y * columns + x].colour(&colours, top);
                    (0..4).for_each(|c| sum[c] += colour[c]);
                }
                if sum[3] > 0.0 {
                    let [r, g, b] = [0, 1, 2].map(|c| sum[c] / sum[3]);
                    let opaque = 255.0 / (SAMPLES * SAMPLES) as f32 * sum[3];
                    // Half of one more rounds.
                    pixel.copy_from_slice(&[r, g, b, opaque].map(|v| (v + 0.5) as u8));
                }
            }
        });
        pixels
    }

    /// As PNG.
    pub fn png(&self, top: f64) -> Vec<u8> {
        png([self.width, self.height], &self.pixels(top), |encoder| {
            encoder.set_color(png::ColorType::Rgba);
            // The file is half as large again, in a third of the time, which is most of the time of a picture.
            encoder.set_compression(png::Compression::Fast);
        })
    }
}

impl Sample {
    /// Its red, green and blue, times how opaque it is, and that.
    fn colour(&self, colours: &[[u8; 3]], top: f64) -> [f32; 4] {
        if self.depth == f32::NEG_INFINITY {
            let beside = self.veil > f32::NEG_INFINITY;
            let [r, g, b] = VEIL;
            return [r, g, b, 1.0].map(|v| if beside { BESIDE * v } else { 0.0 });
        }
        let level = f64::from(self.value) / top * LEVELS as f64 + 0.5;
        let full = colours[(level as usize).min(LEVELS)];
        // An obstacle that touches the bodies does not veil them.
        let is_veiled = self.veil > self.depth + BEHIND / SAMPLES as f32;
        let veiled = if is_veiled { IN_FRONT } else { 0.0 };
        // Towards white or black, so that dark colours are lit, too.
        let (to, part) = match 2.0 * self.shade - 1.0 {
            bright if bright > 0.0 => (255.0, BRIGHT * bright),
            dark => (0.0, DARK * -dark),
        };
        let [r, g, b] = std::array::from_fn(|c| {
            let plain = f32::from(full[c]);
            let lit = plain + part * (to - plain);
            lit + veiled * (VEIL[c] - lit)
        });
        [r, g, b, 1.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(corners: [[f64; 2]; 3], depth: f64, value: f64) -> [Corner; 3] {
        corners.map(|[x, y]| Corner {
            at: [x, y, depth],
            value,
            shade: 0.5,
        })
    }

    #[test]
    fn nearer_surfaces_hide_farther_ones_in_any_order() {
        let left = [[0.0, 0.0], [0.0, 4.0], [4.0, 0.0]];
        let all = [[-9.0, -9.0], [-9.0, 20.0], [20.0, -9.0]];
        let [near, far] = [flat(left, 9.0, 1.0), flat(all, 1.0, 0.0)];
        for triangles in [[near, far], [far, near]] {
            let mut picture = ZBuffer::new(4, 4);
            triangles.into_iter().for_each(|t| picture.triangle(t));
            let pixels = picture.pixels(1.0);
            // The last and the first colour of viridis.
            assert_eq!(pixels[..4], [253, 231, 37, 255]);
            assert_eq!(pixels[4 * 15..], [68, 1, 84, 255]);
            assert!(picture.hides([1.0, 1.0, 1.0]) && !picture.hides([1.0, 1.0, 9.0]));
            assert!(!picture.hides([3.5, 3.5, 1.0]) && picture.hides([3.0, 3.0, -5.0]));
        }
    }

    #[test]
    fn bodies_shine_through_a_veil() {
        let all = [[-9.0, -9.0], [20.0, -9.0], [-9.0, 20.0]];
        let mut picture = ZBuffer::new(2, 1);
        picture.triangle(flat([[0.0, -4.0], [0.0, 4.0], [1.0, 0.0]], 1.0, 1.0));
        picture.veil(all.map(|[x, y]| [x, y, 5.0]));
        let pixels = picture.pixels(1.0);
        assert_eq!((pixels[3], pixels[7]), (255, 158));
        assert!(pixels[2] > 37 && pixels[2] < 100, "{pixels:?}");
    }
}
