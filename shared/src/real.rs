//! The two floating-point types that a solve on a grid can use.

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// f32 or f64, with the operations that the kernels need. Every operation is a correctly rounded
/// IEEE operation, and no two operations are fused. Results are therefore bit-identical for every
/// lane width, thread count and machine.
pub trait Real:
    Copy
    + PartialOrd
    + Debug
    + Send
    + Sync
    + Add<Output = Self>
    + AddAssign
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + 'static
{
    /// 0.
    const ZERO: Self;
    /// ½.
    const HALF: Self;
    /// The number of this type that is nearest to `value`.
    fn from_f64(value: f64) -> Self;
    /// The same number as an f64, without rounding.
    fn to_f64(self) -> f64;
    /// |self|.
    #[must_use]
    fn abs(self) -> Self;
    /// Returns the largest power of two ≤ `self`, and its reciprocal, for `self` ≥ 0.
    /// Multiplication by either number has no rounding error. A number that would be below the
    /// smallest normal number is replaced by 0.
    #[must_use]
    fn power_of_two(self) -> [Self; 2];
    /// The larger of the two numbers. This is a plain comparison, which is one instruction in any
    /// lane width. Unlike `f64::max`, it returns `other` if either number is NaN.
    #[must_use]
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    /// The smaller of the two numbers.
    #[must_use]
    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
}

macro_rules! real {
    ($type:ty) => {
        impl Real for $type {
            const ZERO: Self = 0.0;
            const HALF: Self = 0.5;
            #[inline(always)]
            #[allow(clippy::cast_possible_truncation, reason = "its purpose is to round")]
            fn from_f64(value: f64) -> Self {
                value as $type
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                <$type>::abs(self)
            }
            #[inline(always)]
            fn power_of_two(self) -> [Self; 2] {
                // Keep only the exponent bits. The exponent bits of a power of two and of its
                // reciprocal add up to twice the exponent bits of 1.
                let power = self.to_bits() & <$type>::INFINITY.to_bits();
                let reciprocal = (2 * <$type>::to_bits(1.0)).wrapping_sub(power);
                [power, reciprocal].map(<$type>::from_bits)
            }
        }
    };
}

real!(f32);
real!(f64);

#[cfg(test)]
mod tests {
    use super::*;

    fn check<T: Real>(exponents: core::ops::RangeInclusive<i32>) {
        let two = T::from_f64(2.0);
        for exponent in exponents {
            let expected = (0..exponent.abs())
                .fold(1.0, |power, _| if exponent > 0 { 2.0 * power } else { 0.5 * power });
            for share in [1.0, 1.37, 1.999] {
                let [power, reciprocal] = T::from_f64(share * expected).power_of_two();
                assert_eq!([power.to_f64(), (power * reciprocal).to_f64()], [expected, 1.0]);
            }
        }
        let [power, reciprocal] = T::ZERO.power_of_two();
        assert!(power == T::ZERO && reciprocal > two && reciprocal.to_f64().is_finite());
    }

    #[test]
    fn powers_of_two_are_exact_and_have_exact_reciprocals() {
        check::<f32>(-126..=126);
        check::<f64>(-1022..=1022);
        assert_eq!(f32::MAX.power_of_two(), [1.701_411_8e38, 0.0]);
    }
}
