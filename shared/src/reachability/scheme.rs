//! One-sided first derivatives on a uniform axis: upwind, ENO2, ENO3, WENO5.
//!
//! Osher and Fedkiw, *Level Set Methods and Dynamic Implicit Surfaces* (2003), chapter 3; Jiang and
//! Peng (2000) for WENO5. The kernels have no branches, so that the compiler vectorises a loop over
//! cells.

use crate::real::Real;
use serde::{Deserialize, Serialize};

/// The approximation of the spatial derivatives, with a suitable Runge–Kutta method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Scheme {
    /// First order, Euler.
    Upwind,
    /// Second-order essentially non-oscillatory, TVD-RK2.
    Eno2,
    /// Third-order essentially non-oscillatory, TVD-RK3.
    Eno3,
    /// Fifth-order weighted essentially non-oscillatory, TVD-RK3.
    Weno5,
}

impl Scheme {
    /// Number of ghost nodes that a stencil needs beyond each end of an axis. An axis must have
    /// more nodes than this.
    #[must_use]
    pub fn reach(self) -> usize {
        match self {
            Self::Upwind => Upwind::REACH,
            Self::Eno2 => Eno2::REACH,
            Self::Eno3 => Eno3::REACH,
            Self::Weno5 => Weno5::REACH,
        }
    }

    /// Number of stages of the TVD Runge–Kutta method. It is also the order of the method.
    #[must_use]
    pub fn stages(self) -> usize {
        match self {
            Self::Upwind => 1,
            Self::Eno2 => 2,
            Self::Eno3 | Self::Weno5 => 3,
        }
    }

    /// The default CFL number, with which the scheme keeps its order. It is the time step as a
    /// fraction of the largest stable first-order time step. The one-sided ENO stencils are
    /// linearly stable only up to 0.5 (second order) and 0.377 (third order).
    #[must_use]
    pub fn cfl(self) -> f64 {
        match self {
            Self::Upwind | Self::Weno5 => 0.75,
            Self::Eno2 => 0.5,
            Self::Eno3 => 0.35,
        }
    }

    /// The name in files and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Upwind => "upwind",
            Self::Eno2 => "eno2",
            Self::Eno3 => "eno3",
            Self::Weno5 => "weno5",
        }
    }
}

/// The kernel of a scheme.
///
/// A *face* lies between two neighbouring nodes. The right derivative at the node before the face
/// and the left derivative at the node after it use the same differences. Computing both together
/// saves most of the arithmetic of one of them.
pub(super) trait Stencil: Send + Sync {
    /// Number of nodes used on each side of a node or face.
    const REACH: usize;

    /// The right derivative at node 0 and the left derivative at node 1, for a spacing of 1/`unit`.
    /// `v(k)` is the value at node k, with k from 1 − REACH to REACH. Scaling the data by a power
    /// of two scales the derivatives exactly.
    fn face<T: Real>(v: impl Fn(isize) -> T, unit: T) -> (T, T);
}

/// First order.
pub(super) struct Upwind;
/// ENO, second order.
pub(super) struct Eno2;
/// ENO, third order.
pub(super) struct Eno3;
/// WENO, fifth order.
pub(super) struct Weno5;

#[inline(always)]
fn smaller_magnitude<T: Real>(a: T, b: T) -> T {
    if a.abs() < b.abs() { a } else { b }
}

impl Stencil for Upwind {
    const REACH: usize = 1;

    #[inline(always)]
    fn face<T: Real>(v: impl Fn(isize) -> T, unit: T) -> (T, T) {
        let slope = (v(1) - v(0)) * unit;
        (slope, slope)
    }
}

impl Stencil for Eno2 {
    const REACH: usize = 2;

    #[inline(always)]
    fn face<T: Real>(v: impl Fn(isize) -> T, unit: T) -> (T, T) {
        let d = |k: isize| v(k + 1) - v(k);
        let (d1, d2, d3) = (d(-1), d(0), d(1));
        let bend = T::HALF * smaller_magnitude(d2 - d1, d3 - d2);
        ((d2 - bend) * unit, (d2 + bend) * unit)
    }
}

impl Stencil for Eno3 {
    const REACH: usize = 3;

    #[inline(always)]
    fn face<T: Real>(v: impl Fn(isize) -> T, unit: T) -> (T, T) {
        let d = |k: isize| v(k + 1) - v(k);
        let (d1, d2, d3, d4, d5) = (d(-2), d(-1), d(0), d(1), d(2));
        let (a1, a2, a3, a4) = (d2 - d1, d3 - d2, d4 - d3, d5 - d4);
        let (b1, b2, b3) = ((a2 - a1).abs(), (a3 - a2).abs(), (a4 - a3).abs());
        let sixth = T::from_f64(1.0 / 6.0);
        let two = T::from_f64(2.0);
        let (four, five) = (T::from_f64(4.0), T::from_f64(5.0));
        // The second differences select the side of the stencil, and the third differences select
        // its last node. The left derivative at node 1 and the right derivative at node 0 have the
        // same candidate stencils.
        let (before, behind) = (b1 < b2, b2 < b3);
        let pick = |first: T, middle: T, last: T| {
            let to_left = if before { first } else { middle };
            let to_right = if behind { middle } else { last };
            if a2.abs() < a3.abs() { to_left } else { to_right }
        };
        let left = pick(
            d3 + (five * a2 - two * a1) * sixth,
            d3 + (a2 + two * a3) * sixth,
            d3 + (four * a3 - a4) * sixth,
        );
        let right = pick(
            d3 - (four * a2 - a1) * sixth,
            d3 - (a3 + two * a2) * sixth,
            d3 - (five * a3 - two * a4) * sixth,
        );
        (right * unit, left * unit)
    }
}

impl Stencil for Weno5 {
    const REACH: usize = 3;

    #[inline(always)]
    fn face<T: Real>(v: impl Fn(isize) -> T, unit: T) -> (T, T) {
        let d = |k: isize| v(k + 1) - v(k);
        let (d1, d2, d3, d4, d5) = (d(-2), d(-1), d(0), d(1), d(2));
        // The scale depends only on these five differences. So a kink between slopes of about 1 is
        // still detected if the grid has an obstacle of height 10⁹. The differences are divided by
        // a power of two near the largest one, so that no product overflows or underflows.
        let largest = d1.abs().larger(d2.abs()).larger(d3.abs());
        let largest = largest.larger(d4.abs().larger(d5.abs()));
        let [power, per] = largest.power_of_two();
        let [n1, n2, n3, n4, n5] = [d1, d2, d3, d4, d5].map(|difference| difference * per);
        let (a1, a2, a3, a4) = (n2 - n1, n3 - n2, n4 - n3, n5 - n4);
        // `s1` to `s3` are (3 β + epsilon)², with the smoothness indicators β of Jiang and Shu.
        // Each 3 β is a sum of two squares, so that rounding cannot make it negative: 4a² − 11ab +
        // 10b² = (2a − 11b/4)² + 39b²/16, and 4a² − 5ab + 4b² similarly. The three substencils are
        // the same for both ends of the face.
        let square = |x: T| x * x;
        let rest = T::from_f64(39.0 / 16.0);
        let (outer_slope, inner_slope) = (T::from_f64(2.75), T::from_f64(1.25));
        // The product is below 1 only if all differences are 0 or subnormal, or if `per` is 0.
        let size = (largest * per).larger(T::from_f64(1.0));
        let epsilon = T::from_f64(EPSILON) * square(size);
        let (e1, e2, e3, e4) = (a1 + a1, a2 + a2, a3 + a3, a4 + a4);
        let (r2, r3) = (rest * square(a2) + epsilon, rest * square(a3) + epsilon);
        let s1 = square(square(e1 - outer_slope * a2) + r2);
        let s2 = square(square(e2 - inner_slope * a3) + r3);
        let s3 = square(square(e4 - outer_slope * a3) + r3);
        // The weights γᵢ/sᵢ with γ = (1, 6, 3)/10, times 10 s₁ s₂ s₃. With this common denominator,
        // one division is enough.
        let three = T::from_f64(3.0);
        let (first, last) = (s2 * s3, s1 * s2);
        let middle = T::from_f64(6.0) * (s1 * s3);
        let mean = |first: T, last: T, c1: T, c2: T, c3: T| {
            let sum = first + middle + last;
            (first * c1 + middle * c2 + last * c3) / (T::from_f64(6.0) * sum) * power
        };
        let five = T::from_f64(5.0);
        let left = mean(first, three * last, five * a2 - e1, a2 + e3, e3 + e3 - a4);
        let right = mean(last, three * first, five * a3 - e4, a3 + e2, e2 + e2 - a1);
        ((d3 - right) * unit, (d3 + left) * unit)
    }
}

/// Number of nodes on each side of a face that [`has_jump`] reads.
pub(super) const JUMP_REACH: usize = 3;

/// Whether V jumps within the stencil of the face between nodes 0 and 1, for example beside an
/// indicator obstacle. The slope must then come from these two nodes alone. Polynomials through a
/// jump oscillate. Between two jumps, even the smoothest polynomial does. V would then decrease in
/// a passage of a few nodes, although nothing can leave the passage. The first-order scheme is
/// monotone.
///
/// Let q be a quarter of the largest difference between neighbours among the six nodes. At a jump,
/// second differences larger than q occur with both signs. At a kink, they all have the same sign.
/// Where V is smooth, second differences are small. If the jumps on both sides of a passage are
/// blurred, they look like a kink. Near the obstacle's jumps (`near`), a face therefore also counts
/// as a jump if its difference is below q but a third difference exceeds q.
#[inline(always)]
pub(super) fn has_jump<T: Real>(v: impl Fn(isize) -> T, near: bool) -> bool {
    let d = |k: isize| v(k + 1) - v(k);
    let (d1, d2, d3, d4, d5) = (d(-2), d(-1), d(0), d(1), d(2));
    let (a1, a2, a3, a4) = (d2 - d1, d3 - d2, d4 - d3, d5 - d4);
    let largest = d1.abs().larger(d2.abs()).larger(d3.abs());
    let largest = largest.larger(d4.abs().larger(d5.abs()));
    let quarter = T::from_f64(0.25) * largest;
    let most = a1.larger(a2).larger(a3.larger(a4));
    let least = a1.smaller(a2).smaller(a3.smaller(a4));
    let third = (a2 - a1).abs().larger((a3 - a2).abs()).larger((a4 - a3).abs());
    let turns = (most > quarter) & (least < -quarter);
    let is_flat = (d3.abs() < quarter) & (third > quarter);
    turns | (near & is_flat)
}

/// A regularization that keeps the weights finite where the data are linear, relative to the square
/// of the stencil's largest difference (Osher and Fedkiw, (3.38)). Its fourth power must be a
/// normal number in f32.
const EPSILON: f64 = 3e-6;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{cos, sin};

    /// The left and the right derivative at node 0.
    fn pair<S: Stencil>(v: impl Fn(isize) -> f64, unit: f64) -> (f64, f64) {
        (S::face(|k| v(k - 1), unit).1, S::face(v, unit).0)
    }

    /// The observed order of accuracy of both derivatives of sin at 1, for the spacings h and h/2.
    fn order<S: Stencil>(h: f64) -> f64 {
        let error = |h: f64| {
            let (l, r) = pair::<S>(|k| sin(1.0 + k as f64 * h), 1.0 / h);
            (l - cos(1.0)).abs().max((r - cos(1.0)).abs())
        };
        crate::math::ln(error(h) / error(0.5 * h)) / crate::math::ln(2.0)
    }

    #[test]
    fn each_scheme_has_its_order() {
        assert!((order::<Upwind>(0.02) - 1.0).abs() < 0.05);
        assert!((order::<Eno2>(0.02) - 2.0).abs() < 0.1);
        assert!((order::<Eno3>(0.02) - 3.0).abs() < 0.1);
        assert!(order::<Weno5>(0.05) > 4.7, "{}", order::<Weno5>(0.05));
    }

    /// Jiang and Peng's formulas as printed.
    fn weno5_as_printed(d: [f64; 5]) -> f64 {
        let [a, b, c, d, e] = d;
        let square = |x: f64| x * x;
        let bend = |x: f64, y: f64| 13.0 / 12.0 * square(x) + 0.25 * square(y);
        let s1 = bend(a - 2.0 * b + c, a - 4.0 * b + 3.0 * c);
        let s2 = bend(b - 2.0 * c + d, b - d);
        let s3 = bend(c - 2.0 * d + e, 3.0 * c - 4.0 * d + e);
        let largest = [a, b, c, d, e].into_iter().fold(0.0, |largest: f64, v| largest.max(v.abs()));
        let epsilon = 1e-6 * square(largest);
        let w = [(0.1, s1), (0.6, s2), (0.3, s3)].map(|(g, s)| g / square(s + epsilon));
        let q = [
            a / 3.0 - 7.0 * b / 6.0 + 11.0 * c / 6.0,
            -b / 6.0 + 5.0 * c / 6.0 + d / 3.0,
            c / 3.0 + 5.0 * d / 6.0 - e / 6.0,
        ];
        w.iter().zip(q).map(|(w, q)| w * q).sum::<f64>() / w.iter().sum::<f64>()
    }

    #[test]
    fn weno5_is_the_printed_formula() {
        let mut rng = crate::math::SeededRng::new(3);
        for _ in 0..1000 {
            let v: Vec<f64> = (0..7).map(|_| rng.uniform(-1.0, 1.0)).collect();
            let d: Vec<f64> = v.windows(2).map(|w| w[1] - w[0]).collect();
            let (l, r) = pair::<Weno5>(|k| v[(k + 3) as usize], 1.0);
            assert!((l - weno5_as_printed([d[0], d[1], d[2], d[3], d[4]])).abs() < 1e-12);
            assert!((r - weno5_as_printed([d[5], d[4], d[3], d[2], d[1]])).abs() < 1e-12);
        }
    }

    /// Stencils that contain both large and small differences, in both number types, without a
    /// global scale of the data.
    #[test]
    fn scales_within_one_stencil_do_no_harm() {
        fn check<T: Real>(exponents: core::ops::RangeInclusive<i32>) {
            let mut rng = crate::math::SeededRng::new(5);
            for _ in 0..1000 {
                let v: [f64; 6] = core::array::from_fn(|_| {
                    f64::from(rng.uniform(-1.0, 1.0) as f32)
                        * libm::exp10(rng.below(19) as f64 - 9.0)
                });
                let v = v.map(|v| f64::from(v as f32));
                let of = |factor: f64| {
                    let face = Weno5::face(
                        |k| T::from_f64(factor * v[(k + 2) as usize]),
                        T::from_f64(1.0),
                    );
                    [face.0.to_f64() / factor, face.1.to_f64() / factor]
                };
                let [right, left] = of(1.0);
                let d: [f64; 5] = core::array::from_fn(|k| v[k + 1] - v[k]);
                let largest = d.iter().fold(0.0_f64, |largest, d| largest.max(d.abs()));
                let [a, b, c, e, f] = d;
                let expected = [weno5_as_printed([f, e, c, b, a]), weno5_as_printed(d)];
                for (found, expected) in [right, left].into_iter().zip(expected) {
                    assert!(
                        (found - expected).abs() <= 1e-5 * largest,
                        "{v:?}: {found} {expected}"
                    );
                }
                for exponent in exponents.clone() {
                    let factor = libm::ldexp(1.0, exponent);
                    assert_eq!(of(factor), [right, left], "times 2^{exponent}");
                }
            }
        }
        check::<f32>(-40..=90);
        check::<f64>(-900..=900);
        // Zero differences, the smallest ones and the largest ones.
        for v in [0.0, f32::from_bits(1), f32::MIN_POSITIVE, 1.6e38] {
            let (right, left) = Weno5::face(|k| if k % 2 == 0 { v } else { -v }, 1.0);
            assert!(right.is_finite() && left.is_finite(), "{v:e}: {right:e} {left:e}");
        }
    }

    /// Whether each face whose stencil is within `v` has a jump. The first face lies between nodes
    /// 2 and 3.
    fn jumps<const N: usize>(v: [f64; N], near: bool) -> Vec<bool> {
        v.windows(6).map(|v| has_jump(|k| v[(k + 2) as usize], near)).collect()
    }

    /// Passages of one to four nodes, starting at node 8, between walls on a slope. In a passage of
    /// four nodes, the middle face has no jump.
    #[test]
    fn jumps_are_found_in_passages() {
        for height in [1e-3_f64, 0.5, 1e9] {
            for (thick, free) in (1..=3).flat_map(|thick| (1..=4).map(move |free| (thick, free))) {
                let is_wall = |i: usize| (8 - thick..8 + free + thick).contains(&i);
                let is_free = |i: usize| (8..8 + free).contains(&i);
                let floor = |i: usize| if is_wall(i) && !is_free(i) { height } else { 0.0 };
                let found =
                    jumps::<20>(core::array::from_fn(|i| floor(i).max(1e-5 * i as f64)), true);
                for face in 7..8 + free {
                    let is_middle = free == 4 && face == 9;
                    assert!(found[face - 2] || is_middle, "{height} {thick} {free} {face}");
                }
            }
        }
    }

    /// Slopes, extrema, inflections and kinks, away from walls.
    #[test]
    fn kinks_are_no_jumps() {
        let shapes: [fn(f64) -> f64; 6] = [
            |_| 4.0,
            |x| 3.0 * x - 2.0,
            |x| 0.1 * x * x,
            |x| sin(0.3 * x),
            |x| (2.0 * x).max(-x),
            |x| (2.0 * x).min(-x),
        ];
        for (which, shape) in shapes.into_iter().enumerate() {
            let found = jumps::<21>(core::array::from_fn(|i| shape(i as f64 - 10.3)), false);
            assert!(!found.contains(&true), "{which}: {found:?}");
        }
    }

    /// ENO as defined: the stencil grows towards the smaller divided difference.
    fn eno_as_defined(v: &[f64; 7], order: usize, right: bool) -> f64 {
        // Table of undivided differences on nodes −3 … 3; position 3 is the centre.
        let mut table = vec![v.to_vec()];
        for _ in 0..order {
            let next: Vec<f64> = table[table.len() - 1].windows(2).map(|w| w[1] - w[0]).collect();
            table.push(next);
        }
        let mut start = if right { 3 } else { 2 };
        let mut slope = table[1][start];
        for (k, differences) in table.iter().enumerate().skip(2) {
            let (left, here) = (differences[start - 1], differences[start]);
            let previous = start;
            let coefficient = if left.abs() < here.abs() {
                start -= 1;
                left
            } else {
                here
            };
            // The derivative at the centre of Π (x − x_j) over the k nodes so far, divided by k!.
            let nodes = previous..previous + k;
            let product: f64 = nodes.filter(|j| *j != 3).map(|j| 3.0 - j as f64).product();
            let factorial: f64 = (1..=k).map(|i| i as f64).product();
            slope += coefficient * product / factorial;
        }
        slope
    }

    #[test]
    fn eno_is_the_definition() {
        let mut rng = crate::math::SeededRng::new(4);
        for _ in 0..1000 {
            let v: [f64; 7] = core::array::from_fn(|_| rng.uniform(-1.0, 1.0));
            let at = |k: isize| v[(k + 3) as usize];
            for (order, (l, r)) in [(2, pair::<Eno2>(at, 1.0)), (3, pair::<Eno3>(at, 1.0))] {
                assert!((l - eno_as_defined(&v, order, false)).abs() < 1e-12, "{order} left");
                assert!((r - eno_as_defined(&v, order, true)).abs() < 1e-12, "{order} right");
            }
        }
    }
}
