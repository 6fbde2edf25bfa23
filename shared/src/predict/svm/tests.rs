use super::*;
use crate::math::SeededRng;

fn random_svm(classes: usize, width: usize, count: usize) -> Svm {
    let mut rng = SeededRng::new(5);
    let mut rows = |n: usize, width: usize| -> Vec<Vec<f64>> {
        (0..n).map(|_| (0..width).map(|_| rng.uniform(-2.0, 2.0)).collect()).collect()
    };
    let (vectors, dual) = (rows(count, width), rows(pair_count(classes), count));
    let intercepts = rows(1, pair_count(classes)).remove(0);
    let sigmoids = intercepts.iter().map(|&b| Sigmoid { a: -1.5, b: 0.1 * b }).collect();
    Svm::rbf(width, classes, 0.3, &vectors, &dual, intercepts, sigmoids).unwrap()
}

#[test]
fn decisions_are_the_plain_sums() {
    for (classes, width, count) in [(2, 1, 1), (3, 8, 21), (4, 3, 16), (3, 2, 0)] {
        let svm = random_svm(classes, width, count);
        let scale = Scale::new(vec![0.5; width], vec![2.0; width]).unwrap();
        let row: Vec<f64> = (0..width).map(|j| j as f64 - 1.2).collect();
        let decisions = svm.decisions(&scale, &row);
        assert_eq!(decisions.len(), pair_count(classes));
        let Pairwise::Rbf(support) = &svm.pairwise else { panic!("a radial kernel") };
        let (vectors, dual) = (support.vectors(), support.dual());
        for (pair, &decision) in decisions.iter().enumerate() {
            let term = |(vector, dual): (&Vec<f64>, &f64)| {
                let square = |(x, v): (&f64, &f64)| ((x - 0.5) / 2.0 - v) * ((x - 0.5) / 2.0 - v);
                dual * exp(-0.3 * row.iter().zip(vector).map(square).sum::<f64>())
            };
            let sum: f64 = vectors.iter().zip(&dual[pair]).map(term).sum();
            let plain = sum + svm.intercepts[pair];
            assert!((decision - plain).abs() < 1e-13, "{decision} {plain}");
        }
    }
}

#[test]
fn votes_prefer_the_first_class() {
    assert_eq!(vote(2, [0.1]), 0);
    assert_eq!(vote(2, [-0.1]), 1);
    assert_eq!(vote(2, [0.0]), 1);
    assert_eq!(vote(3, [1.0, 1.0, -1.0]), 0);
    assert_eq!(vote(3, [-1.0, 1.0, 1.0]), 1);
    // Each class gets one vote: 0 beats 1, 1 beats 2, 2 beats 0.
    assert_eq!(vote(3, [1.0, -1.0, 1.0]), 0);
    assert_eq!(vote(3, [-1.0, 1.0, -1.0]), 0);
}

#[test]
fn coupling_returns_probabilities_that_agree_with_their_pairs() {
    let mut rng = SeededRng::new(9);
    for classes in 2..6 {
        for _ in 0..200 {
            let mut p: Vec<f64> = (0..classes).map(|_| rng.uniform(0.01, 1.0)).collect();
            let total: f64 = p.iter().sum();
            p.iter_mut().for_each(|p| *p /= total);
            let pairwise: Vec<f64> = pairs(classes).map(|(a, b)| p[a] / (p[a] + p[b])).collect();
            let mut coupled = vec![0.0; classes];
            coupling::couple(&pairwise, &mut coupled);
            for (a, b) in p.iter().zip(&coupled) {
                assert!((a - b).abs() < 1e-12, "{p:?} {coupled:?}");
            }
        }
    }
}

/// The sum of squares that coupling minimises.
fn cost(pairwise: &[f64], p: &[f64]) -> f64 {
    let terms = pairs(p.len()).zip(pairwise).map(|((a, b), &r)| (1.0 - r) * p[a] - r * p[b]);
    terms.map(|term| term * term).sum()
}

#[test]
fn coupling_of_contradictory_pairs_has_the_least_cost() {
    let mut rng = SeededRng::new(10);
    for _ in 0..300 {
        let pairwise: Vec<f64> = (0..6).map(|_| rng.unit()).collect();
        let mut p = vec![0.0; 4];
        coupling::couple(&pairwise, &mut p);
        assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        assert!(p.iter().all(|&p| p >= 0.0));
        let least = cost(&pairwise, &p);
        for _ in 0..50 {
            let mut other: Vec<f64> =
                p.iter().map(|p| (p + rng.uniform(-0.1, 0.1)).max(0.0)).collect();
            let total: f64 = other.iter().sum();
            other.iter_mut().for_each(|p| *p /= total);
            assert!(cost(&pairwise, &other) >= least - 1e-12);
        }
    }
    // Pairwise probabilities of 0 and 1, including a cycle.
    for pairwise in [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 0.0]] {
        let mut p = vec![0.0; 3];
        coupling::couple(&pairwise, &mut p);
        assert!(p.iter().all(|&p| (0.0..=1.0).contains(&p)), "{p:?}");
    }
}

#[test]
fn probabilities_sum_to_one() {
    let svm = random_svm(3, 4, 30);
    let scale = Scale::new(vec![0.0; 4], vec![1.0; 4]).unwrap();
    let mut p = [0.0; 3];
    svm.probabilities_into(&scale, &[0.3, -1.0, 0.2, 1.0], &mut p);
    assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-15);
}

#[test]
fn a_sigmoid_is_exact_far_out() {
    let sigmoid = Sigmoid { a: -1.0, b: 0.0 };
    assert_eq!(sigmoid.probability(0.0), 0.5);
    assert_eq!(sigmoid.probability(1e4), 1.0);
    assert_eq!(sigmoid.probability(-1e4), 0.0);
    assert!((sigmoid.probability(2.0) + sigmoid.probability(-2.0) - 1.0).abs() < 1e-15);
}
