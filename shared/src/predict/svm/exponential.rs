//! eˣ for x ≤ 0 in SIMD lanes. Only additions, multiplications and a shift are used, so results are
//! bit-identical for every SIMD width and in WebAssembly. `libm` cannot be used, because its
//! branches are impossible in SIMD lanes.
//!
//! Let x = n·ln 2 + r with |r| ≤ ½ ln 2. A Taylor polynomial gives eʳ, and adding n to its exponent
//! bits multiplies it by 2ⁿ.

/// eˣ for x ≤ 0, accurate to two ULP. Arguments below −708 are clamped to −708.
#[inline(always)]
pub(crate) fn exp64(x: f64) -> f64 {
    // ln 2 in two parts. The lowest bits of the first part are zero, so its product with n is
    // exact.
    const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    // Adding this number to a value rounds the value to an integer, which is then in the lowest
    // bits of the sum.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    const TAYLOR: [f64; 14] = [
        1.0 / 6_227_020_800.0,
        1.0 / 479_001_600.0,
        1.0 / 39_916_800.0,
        1.0 / 3_628_800.0,
        1.0 / 362_880.0,
        1.0 / 40_320.0,
        1.0 / 5_040.0,
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        0.5,
        1.0,
        1.0,
    ];
    let x = if x > -708.0 { x } else { -708.0 };
    let shifted = x * core::f64::consts::LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = (x - n * LN2_HIGH) - n * LN2_LOW;
    let mut sum = TAYLOR[0];
    for &term in &TAYLOR[1..] {
        sum = sum * r + term;
    }
    f64::from_bits(sum.to_bits().wrapping_add(shifted.to_bits() << 52))
}

/// eˣ for x ≤ 0 in f32. Arguments below −86 are clamped to −86.
#[cfg(feature = "learn")]
#[inline(always)]
pub(crate) fn exp32(x: f32) -> f32 {
    const LN2_HIGH: f32 = 0.693_359_4;
    const LN2_LOW: f32 = -2.121_944_4e-4;
    const ROUND: f32 = 12_582_912.0;
    const TAYLOR: [f32; 8] =
        [1.0 / 5_040.0, 1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0];
    let x = if x > -86.0 { x } else { -86.0 };
    let shifted = x * core::f32::consts::LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = (x - n * LN2_HIGH) - n * LN2_LOW;
    let mut sum = TAYLOR[0];
    for &term in &TAYLOR[1..] {
        sum = sum * r + term;
    }
    f32::from_bits(sum.to_bits().wrapping_add(shifted.to_bits() << 23))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{SeededRng, exp};

    #[test]
    fn agree_with_libm() {
        let mut rng = SeededRng::new(1);
        for _ in 0..200_000 {
            let x = -700.0 * rng.unit() * rng.unit() * rng.unit();
            let expected = exp(x);
            assert!((exp64(x) - expected).abs() <= 4.5e-16 * expected, "{x}");
            let x = -85.0 * rng.unit() * rng.unit();
            let expected = exp(f64::from(x as f32));
            assert!((f64::from(exp32(x as f32)) - expected).abs() <= 2e-7 * expected, "{x}");
        }
    }

    #[test]
    fn zero_and_far_away() {
        assert_eq!((exp64(0.0), exp32(0.0)), (1.0, 1.0));
        for x in [-708.5, -1e4, -1e300, f64::NEG_INFINITY] {
            assert!(exp64(x) > 0.0 && exp64(x) < 1e-307, "{x}");
            assert!(exp32(x as f32) > 0.0 && exp32(x as f32) < 1e-37, "{x}");
        }
    }
}
