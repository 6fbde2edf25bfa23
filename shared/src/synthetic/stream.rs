//! Random numbers of one person or one trial.

use crate::math::{TAU, cos, ln};

/// SplitMix64 (Steele, Lea and Flood 2014).
#[derive(Clone, Copy, Debug)]
pub(super) struct Stream(u64);

/// Multipliers that separate the streams of people and trials. They are odd, so that no two streams
/// coincide.
const OF_PERSON: u64 = 0xD134_2543_DE82_EF95;
const OF_TRIAL: u64 = 0xAF25_1AF3_B0F0_25B5;

impl Stream {
    /// The stream for a person's parameters.
    pub(super) fn of_person(seed: u64, person: u64) -> Self {
        Self::of(seed, person, 1)
    }

    /// The stream for everything in a trial. Both indices start at 0.
    pub(super) fn of_trial(seed: u64, person: u64, trial: u64) -> Self {
        Self::of(seed, person, trial.wrapping_add(2))
    }

    fn of(seed: u64, person: u64, place: u64) -> Self {
        let first = Self(seed).next();
        let second = Self(first ^ person.wrapping_add(1).wrapping_mul(OF_PERSON)).next();
        let mut stream = Self(second ^ place.wrapping_mul(OF_TRIAL));
        stream.next();
        stream
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    /// Uniform in [0, 1), a multiple of 2⁻⁵³.
    pub(super) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in [low, high).
    pub(super) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Exponentially distributed with mean `mean`.
    pub(super) fn exponential(&mut self, mean: f64) -> f64 {
        -mean * ln(1.0 - self.unit())
    }

    /// Standard normal, from one branch of the Box–Muller transform.
    pub(super) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * ln(1.0 - self.unit())).sqrt();
        radius * cos(TAU * self.unit())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_numbers_of_splitmix64() {
        // Seed 1234567, from the generator's reference implementation (Vigna 2015).
        let mut stream = Stream(1_234_567);
        let first = [(); 3].map(|()| stream.next());
        assert_eq!(first, [6457827717110365317, 3203168211198807973, 9817491932198370423]);
    }

    #[test]
    fn moments() {
        let mut stream = Stream::of_trial(1, 2, 3);
        let n = 200_000;
        let normals: Vec<f64> = (0..n).map(|_| stream.normal()).collect();
        let mean = normals.iter().sum::<f64>() / f64::from(n);
        let variance = normals.iter().map(|x| x * x).sum::<f64>() / f64::from(n);
        let waits = (0..n).map(|_| stream.exponential(0.4)).sum::<f64>() / f64::from(n);
        assert!(mean.abs() < 0.01 && (variance - 1.0).abs() < 0.015, "{mean} {variance}");
        assert!((waits - 0.4).abs() < 0.004, "{waits}");
    }
}
