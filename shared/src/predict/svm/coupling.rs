//! Pairwise coupling: class probabilities from pairwise probabilities.
//!
//! This is the second method of Wu, Lin and Weng (2004), "Probability estimates for multi-class
//! classification by pairwise coupling". It finds the p with Σ p = 1 that minimises the sum over
//! pairs of (r_ba p_a − r_ab p_b)². Here, r_ab is the probability of class a if only classes a and
//! b are possible. The optimality conditions are linear: Q p = λ 1 and Σ p = 1.

use super::pairs::pairs;

/// Pairwise probabilities r are clamped to stay at least this far from 0 and 1, as in libsvm. If
/// all r are inside (0, 1), the system has exactly one solution, and this solution is positive.
const EDGE: f64 = 1e-7;

/// Writes the class probabilities to `out`. `pairwise` contains P(first class) of each pair.
pub(super) fn couple(pairwise: &[f64], out: &mut [f64]) {
    let k = out.len();
    if let ([r], [first, second]) = (pairwise, &mut *out) {
        let r = r.clamp(EDGE, 1.0 - EDGE);
        (*first, *second) = (r, 1.0 - r);
        return;
    }
    // Each row of Q is followed by the coefficient of −λ and the right-hand side. The last row is
    // Σ p = 1.
    let stride = k + 2;
    let mut system = vec![0.0; (k + 1) * stride];
    for ((a, b), &r) in pairs(k).zip(pairwise) {
        let r = r.clamp(EDGE, 1.0 - EDGE);
        let (ab, ba) = (r, 1.0 - r);
        system[a * stride + a] += ba * ba;
        system[b * stride + b] += ab * ab;
        system[a * stride + b] = -ab * ba;
        system[b * stride + a] = -ab * ba;
    }
    for class in 0..k {
        system[class * stride + k] = -1.0;
        system[k * stride + class] = 1.0;
    }
    system[k * stride + k + 1] = 1.0;
    solve(&mut system, k + 1);
    let mut total = 0.0;
    for (class, p) in out.iter_mut().enumerate() {
        // Rounding errors can make the probability of an impossible class slightly negative.
        *p = system[class * stride + k + 1].max(0.0);
        total += *p;
    }
    for p in out {
        *p /= total;
    }
}

/// Gauss–Jordan elimination with partial pivoting. Each of the n rows of `system` has n
/// coefficients and a right-hand side. The solution replaces the right-hand sides.
fn solve(system: &mut [f64], n: usize) {
    let stride = n + 1;
    for column in 0..n {
        let size = |row: usize| system[row * stride + column].abs();
        let pivot =
            (column + 1..n).fold(column, |best, r| if size(r) > size(best) { r } else { best });
        for j in 0..stride {
            system.swap(column * stride + j, pivot * stride + j);
        }
        for row in (0..n).filter(|&row| row != column) {
            let factor = system[row * stride + column] / system[column * stride + column];
            for j in column..stride {
                system[row * stride + j] -= factor * system[column * stride + j];
            }
        }
    }
    for row in 0..n {
        system[row * stride + n] /= system[row * stride + row];
    }
}
