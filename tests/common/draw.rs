//! Random choices.

use super::random::Random;

/// Neighbouring seeds make unrelated numbers (the finaliser of SplitMix64).
pub fn generator(seed: u64) -> Random {
    let mut z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    Random((z ^ (z >> 31)) | 1)
}

/// 10 to a power between these.
pub fn decade(random: &mut Random, low: f64, high: f64) -> f64 {
    10f64.powf(random.between(low, high))
}

pub fn chance(random: &mut Random, probability: f64) -> bool {
    random.unit() < probability
}

pub fn pick<T: Copy>(random: &mut Random, from: &[T]) -> T {
    from[random.below(from.len())]
}

/// A number in the environment: which seeds to try, and how many.
pub fn number(name: &str) -> Option<u64> {
    let value = std::env::var(name).ok()?;
    Some(
        value
            .parse()
            .unwrap_or_else(|_| panic!("{name} = {value} is no number")),
    )
}
