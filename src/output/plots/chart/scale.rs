//! Round numbers along an axis, and their positions.

use super::Axis;
use crate::mesh::vector::bounds;

/// From values to places along an axis.
pub struct Scale {
    low: f64,
    high: f64,
    logarithmic: bool,
    /// The divisor of labels.
    unit: f64,
    start: f64,
    end: f64,
}

impl Scale {
    pub fn new(
        axis: &Axis,
        values: impl Iterator<Item = f64>,
        start: f64,
        end: f64,
        room: f64,
    ) -> Self {
        let usable = |v: &f64| v.is_finite() && (!axis.logarithmic || *v > 0.0);
        let ([mut low], [mut high]) = bounds(values.filter(usable).map(|v| [v]));
        if !(low <= high) {
            (low, high) = (if axis.logarithmic { 0.1 } else { 0.0 }, 1.0);
        }
        let mut unit = 1.0;
        if axis.logarithmic {
            // A little around the data.
            let around = (high / low).powf(0.04).clamp(1.2, 10.0);
            (low, high) = (low / around, (high * around).min(f64::MAX));
        } else {
            if high - low <= 1e-12 * high.abs().max(low.abs()) {
                let middle = if high == 0.0 { 2.0 } else { high.abs() };
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

    pub fn place(&self, v: f64) -> f64 {
        let part = if self.logarithmic {
            (v / self.low).log10() / (self.high / self.low).log10()
        } else {
            (v - self.low) / (self.high - self.low)
        };
        self.start + part * (self.end - self.start)
    }

    pub fn ticks(&self, wanted: f64) -> Vec<(f64, String)> {
        if self.logarithmic {
            let a = self.low.log10().ceil() as i32;
            let b = self.high.log10().floor() as i32;
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
        let tick = |k: i64| {
            let v = k as f64 * step;
            let label = format!("{:.decimals$}", v / self.unit + 0.0);
            (v, label.replace('-', "−"))
        };
        (first..=last).map(tick).collect()
    }

    /// The label of the axis with its unit.
    pub fn label(&self, axis: &Axis) -> String {
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
pub fn nice(step: f64) -> f64 {
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
    fn nice_numbers_are_the_next_of_1_2_and_5() {
        let steps = [1.0, 1.1, 2.0, 2.1, 5.1, 0.03, 7e-9, 340.0];
        let round = [1.0, 2.0, 2.0, 5.0, 10.0, 0.05, 1e-8, 500.0];
        for (step, round) in steps.into_iter().zip(round) {
            let found = nice(step);
            assert!((found / round - 1.0).abs() < 1e-12, "{step}: {found}");
        }
        // A number that exceeds a round number only by rounding is that number.
        assert!((nice(0.1 + 0.2 - 0.1) - 0.2).abs() < 1e-15);
        assert_eq!([6, -12].map(power_of_ten), ["10⁶", "10⁻¹²"]);
    }
}
