//! Newton steps of the deviance, in integers.

/// Gradients and Hessians are rounded to multiples of this.
const QUANTUM: f64 = 1.0 / (1u64 << 40) as f64;

/// A sum of gradients and a sum of Hessians, in quanta.
pub(super) type Sums = [i64; 2];

/// Rounds to a whole number of quanta. With at most 2²¹ rows and gradients from −1 to 1, the
/// magnitude of a sum is at most 2⁶¹, so sums do not overflow.
pub(super) fn in_quanta(value: f64) -> i64 {
    (value / QUANTUM).round() as i64
}

/// Second-order approximation of the deviance. It gives the gains of splits and the values of
/// leaves.
pub(super) struct Newton {
    /// Gradient and Hessian of each row's deviance with respect to the score.
    pub(super) derivatives: Vec<Sums>,
    pub(super) penalty: f64,
}

impl Newton {
    /// The sums over these rows.
    pub(super) fn total(&self, rows: impl Iterator<Item = usize>) -> Sums {
        rows.fold([0; 2], |[g, h], row| {
            [g + self.derivatives[row][0], h + self.derivatives[row][1]]
        })
    }

    /// G² / (H + λ): twice the gain of a leaf.
    pub(super) fn gain(&self, [gradient, hessian]: Sums) -> f64 {
        let gradient = gradient as f64 * QUANTUM;
        let whole = hessian as f64 * QUANTUM + self.penalty;
        if whole > 0.0 { gradient * gradient / whole } else { 0.0 }
    }

    /// −G / (H + λ): the Newton step of a leaf.
    pub(super) fn step(&self, [gradient, hessian]: Sums) -> f64 {
        let whole = hessian as f64 * QUANTUM + self.penalty;
        if whole > 0.0 { -(gradient as f64 * QUANTUM) / whole } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_leaf_takes_the_newton_step() {
        let newton =
            Newton { derivatives: vec![[in_quanta(0.25), in_quanta(0.5)]; 4], penalty: 1.0 };
        let total = newton.total(0..4);
        assert_eq!(newton.step(total), -1.0 / 3.0);
        assert_eq!(newton.gain(total), 1.0 / 3.0);
    }
}
