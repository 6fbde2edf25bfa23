//! Platt scaling: the sigmoid that turns held-out decision values into probabilities.
//!
//! The method is from Lin, Lin and Weng (2007), "A note on Platt's probabilistic outputs for
//! support vector machines". It minimises the cross entropy with Laplace-smoothed targets by
//! Newton's method with step halving. The formulas avoid overflow and cancellation.

use crate::math::{exp, ln};
use crate::predict::svm::Sigmoid;

/// This number is added to the Hessian's diagonal, because the Hessian is singular if all decision
/// values are equal.
const RIDGE: f64 = 1e-12;
/// Newton's method ends when no component of the gradient exceeds this times the number of decision
/// values.
const TOLERANCE: f64 = 1e-12;
/// Maximum number of Newton steps. About six are needed.
const MAX_STEPS: usize = 100;
/// Newton's method ends when a step is halved below this fraction. The loss is then flat up to
/// rounding errors.
const LEAST_SHARE: f64 = 1e-10;

/// Fits the sigmoid to held-out rows. Each row has a decision value, and a flag that is true if its
/// class is the pair's first class. Without rows, all probabilities are ½.
pub(super) fn sigmoid(decisions: &[(f64, bool)]) -> Sigmoid {
    let first = decisions.iter().filter(|&&(_, first)| first).count() as f64;
    let second = decisions.len() as f64 - first;
    let targets = [1.0 / (second + 2.0), (first + 1.0) / (first + 2.0)];
    let target = |is_first: bool| targets[usize::from(is_first)];
    let loss = |a: f64, b: f64| -> f64 {
        let terms = decisions.iter().map(|&(f, is_first)| {
            let (z, t) = (a * f + b, target(is_first));
            if z >= 0.0 { t * z + ln(1.0 + exp(-z)) } else { (t - 1.0) * z + ln(1.0 + exp(z)) }
        });
        terms.sum()
    };
    let (mut a, mut b) = (0.0, ln((second + 1.0) / (first + 1.0)));
    let mut least = loss(a, b);
    for _ in 0..MAX_STEPS {
        let (mut haa, mut hab, mut hbb, mut ga, mut gb) = (RIDGE, 0.0, RIDGE, 0.0, 0.0);
        for &(f, is_first) in decisions {
            let p = Sigmoid { a, b }.probability(f);
            let (hessian, gradient) = (p * (1.0 - p), target(is_first) - p);
            haa += f * f * hessian;
            hab += f * hessian;
            hbb += hessian;
            ga += f * gradient;
            gb += gradient;
        }
        if ga.abs().max(gb.abs()) <= TOLERANCE * decisions.len() as f64 {
            break;
        }
        let determinant = haa * hbb - hab * hab;
        let (da, db) = ((hab * gb - hbb * ga) / determinant, (hab * ga - haa * gb) / determinant);
        let descent = ga * da + gb * db;
        let mut share = 1.0;
        loop {
            let (next_a, next_b) = (a + share * da, b + share * db);
            let next = loss(next_a, next_b);
            if next < least + 1e-4 * share * descent {
                (a, b, least) = (next_a, next_b, next);
                break;
            }
            share *= 0.5;
            if share < LEAST_SHARE {
                return Sigmoid { a, b };
            }
        }
    }
    Sigmoid { a, b }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SeededRng;

    #[test]
    fn finds_the_sigmoid_that_made_the_data() {
        let mut rng = SeededRng::new(3);
        let truth = Sigmoid { a: -1.7, b: 0.4 };
        let mut draw = |_| {
            let f = rng.uniform(-3.0, 3.0);
            (f, rng.unit() < truth.probability(f))
        };
        let data: Vec<(f64, bool)> = (0..100_000).map(&mut draw).collect();
        let found = sigmoid(&data);
        assert!((found.a - truth.a).abs() < 0.03 && (found.b - truth.b).abs() < 0.03, "{found:?}");
    }

    #[test]
    fn no_direction_lowers_the_loss() {
        let mut rng = SeededRng::new(4);
        let data: Vec<(f64, bool)> =
            (0..300).map(|_| (rng.uniform(-3.0, 3.0), rng.unit() < 0.3)).collect();
        let first = data.iter().filter(|d| d.1).count() as f64;
        let second = data.len() as f64 - first;
        let loss = |s: Sigmoid| -> f64 {
            let term = |&(f, is_first): &(f64, bool)| {
                let t = if is_first { (first + 1.0) / (first + 2.0) } else { 1.0 / (second + 2.0) };
                let p = s.probability(f);
                -(t * ln(p) + (1.0 - t) * ln(1.0 - p))
            };
            data.iter().map(term).sum()
        };
        let best = sigmoid(&data);
        for (da, db) in [(1e-4, 0.0), (-1e-4, 0.0), (0.0, 1e-4), (0.0, -1e-4), (1e-4, -1e-4)] {
            assert!(loss(Sigmoid { a: best.a + da, b: best.b + db }) > loss(best));
        }
    }

    #[test]
    fn data_that_leave_it_open() {
        assert_eq!(sigmoid(&[]).probability(3.0), 0.5);
        // With only one class, the probability follows Laplace's rule.
        let p = sigmoid(&[(1.0, true); 8]).probability(1.0);
        assert!((p - 0.9).abs() < 1e-6, "{p}");
        // Even for separated classes, the probability stays below 1.
        let separated: Vec<_> = (0..20).map(|i| (f64::from(i) - 9.5, i >= 10)).collect();
        let p = sigmoid(&separated).probability(9.5);
        assert!(p > 0.9 && p < 1.0, "{p}");
    }
}
