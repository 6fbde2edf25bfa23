use super::*;
use crate::math::SeededRng;
use crate::reach::polygon::signed_distance;
use crate::shfrs::family::Family;
use crate::shfrs::testing::drive;

const KINDS: [EmpiricalFamily; 2] = [EmpiricalFamily::Empirical, EmpiricalFamily::Gaussian];

/// Drives with occasional changes of the input.
fn drives(seed: u64, count: usize) -> Vec<Trajectory> {
    let mut rng = SeededRng::new(seed);
    let mut drive_one = |_| {
        let mut rate = 0.0;
        let rates: Vec<f64> = (0..30)
            .map(|_| {
                if rng.below(5) == 0 {
                    rate = [-0.5, 0.0, 0.0, 0.5][rng.below(4)];
                }
                rate
            })
            .collect();
        drive(&rates)
    };
    (0..count).map(&mut drive_one).collect()
}

fn learned(kind: EmpiricalFamily, steps: usize) -> Fitted {
    Fitted::learn(kind, &SceneParameters::default(), &drives(1, 20), steps).unwrap()
}

fn held_before(window: &Window<'_>) -> TurnInput {
    match window.past_turn_rates().last() {
        Some(&rate) if rate < 0.0 => TurnInput::Right,
        Some(&rate) if rate > 0.0 => TurnInput::Left,
        _ => TurnInput::Straight,
    }
}

/// The family as `sidestep shfrs` learns it, without polygons of its sets.
fn family(kind: EmpiricalFamily, training: &[Trajectory], steps: usize) -> Box<dyn Family> {
    let parameters = SceneParameters::default();
    let windows = WindowChoice::EveryStep.windows(training, steps).concat();
    match kind {
        EmpiricalFamily::Empirical => {
            Box::new(PerModeEmpirical::learn(Mode::<Nobody>::Held, &parameters, &windows).unwrap())
        }
        EmpiricalFamily::Gaussian => {
            Box::new(Gaussian::learn(Nominal::Held, &parameters, &windows).unwrap())
        }
    }
}

/// The smallest distance (m) by which a position of the window's future is inside the set of its
/// step. Negative if a position is outside.
fn inside_by(set: &EmpiricalSet, window: &Window<'_>) -> f64 {
    let positions = window.future().iter().map(|state| state.human.position());
    let inside = set.steps.iter().zip(positions).map(|(step, at)| -signed_distance(step, at));
    inside.fold(f64::INFINITY, f64::min)
}

/// Compares membership in the drawn polygons with the family's scores, on unseen drives. Hulls
/// contain positions with a tolerance of 5 mm. Ellipsoids also limit the heading, but the drawn
/// ellipses contain every position that has an admissible heading.
#[test]
fn what_is_drawn_holds_what_scores_say() {
    let unseen = drives(2, 40);
    for kind in KINDS {
        let mut sets = learned(kind, 10).sets;
        let mut family = family(kind, &drives(1, 20), 10);
        let (mut held, mut left) = (0, 0);
        for window in WindowChoice::EveryStep.windows(&unseen, 10).iter().flatten() {
            let score = family.score(window).unwrap();
            sets.place(window.now().human, held_before(window));
            let most = sets.sets().len() - 1;
            for (j, set) in sets.sets().iter().enumerate() {
                let area = family.area_m2(window, set.level).unwrap();
                assert_eq!(set.area_m2, area, "{kind:?} {}", set.level);
                let inside = inside_by(set, window);
                match kind {
                    // Worst-case polygons are inscribed in their sets, and drives turn at the
                    // maximum rate.
                    _ if j == most => assert!(inside > -0.005, "{inside}"),
                    EmpiricalFamily::Empirical if (inside + 0.005).abs() < 1e-9 => {}
                    EmpiricalFamily::Empirical => {
                        assert_eq!(inside > -0.005, score <= set.level, "{inside} {score}");
                    }
                    EmpiricalFamily::Gaussian => {
                        assert!(score > set.level || inside > -0.005, "{inside} {score}");
                    }
                }
                held += usize::from(score <= set.level);
                left += usize::from(score > set.level);
            }
        }
        assert!(held > 100 && left > 100, "{kind:?}: {held} {left}");
    }
}

/// A position is in the ellipse if and only if the ellipsoid contains it with at least one heading.
#[test]
fn ellipses_are_ellipsoids_seen_from_above() {
    let Fitted { family, mut sets } = learned(EmpiricalFamily::Gaussian, 1);
    let mut rng = SeededRng::new(5);
    let (mut held, mut left) = (0, 0);
    for _ in 0..300 {
        let held_now = TurnInput::ALL[rng.below(3)];
        let now = Pose::new(rng.uniform(-9.0, 9.0), rng.uniform(-9.0, 9.0), rng.uniform(-3.0, 3.0));
        sets.place(now, held_now);
        // The worst case is not an ellipse. Test points go from the centre of the largest
        // ellipse to beyond its edge.
        let most = family.most();
        let outer = sets.sets().iter().rfind(|set| set.level < most).unwrap();
        let corners = &outer.steps[0];
        let (corner, half) = (rng.below(corners.len()), corners.len() / 2);
        let ([x, y], [a, b]) = (corners[corner], corners[(corner + half) % corners.len()]);
        let along = rng.uniform(0.5, 1.3);
        let at = [a + along * (x - a), b + along * (y - b)];
        let score = |turn: f64| {
            let end = Pose::new(at[0], at[1], now.psi + turn);
            let states = [now, now, end].map(|human| JointState { human, robot: now });
            let inputs = [held_now, TurnInput::Straight];
            let parameters = SceneParameters::default();
            let drive = Trajectory::driven(states.to_vec(), &inputs, &parameters).unwrap();
            family.least_level(&Window::new(&drive, 1, 1).unwrap()).unwrap()
        };
        // As a function of the heading, the score is convex until it reaches its largest value.
        const APART: f64 = 5e-4;
        let turns = (-400..=400).map(|i| f64::from(i) * APART);
        let near = turns.min_by(|&a, &b| score(a).total_cmp(&score(b))).unwrap();
        let (mut low, mut high) = (near - APART, near + APART);
        for _ in 0..40 {
            let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if score(a) < score(b) { high = b } else { low = a }
        }
        let least = score(0.5 * (low + high));
        for set in sets.sets().iter().filter(|set| set.level < most) {
            let inside = -signed_distance(&set.steps[0], at);
            // The polygon is inscribed in the ellipse, so it is 0.2 % smaller.
            if (least / set.level - 1.0).abs() > 0.005 {
                assert_eq!(inside > 0.0, least < set.level, "{least} {} {inside}", set.level);
                held += usize::from(inside > 0.0);
                left += usize::from(inside < 0.0);
            }
        }
    }
    assert!(held > 50 && left > 50, "{held} {left}");
}

/// Monte Carlo check: the share of a box that is inside some polygon of a tube.
#[test]
fn tubes_cover_their_areas() {
    const N: usize = 40_000;
    let mut rng = SeededRng::new(4);
    for kind in KINDS {
        let mut sets = learned(kind, 10).sets;
        sets.place(Pose::new(3.0, -1.0, 0.7), TurnInput::Left);
        for set in sets.sets() {
            let corners = || set.tube.iter().flatten();
            let ends = |axis: usize| {
                let all = corners().map(|corner| corner[axis]);
                all.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)])
            };
            let [x, y] = [ends(0), ends(1)];
            let is_in = |_: &usize| {
                let point = [rng.uniform(x[0], x[1]), rng.uniform(y[0], y[1])];
                set.tube.iter().any(|piece| signed_distance(piece, point) < 0.0)
            };
            let inside = (0..N).filter(is_in).count();
            let all = (x[1] - x[0]) * (y[1] - y[0]);
            let counted = all * inside as f64 / N as f64;
            // Four standard errors of a share are at most 2 / √N. The polygons of the worst-case
            // set are accurate to 1 mm.
            let apart = (set.area_m2 - counted).abs();
            assert!(apart < all * 2.0 / (N as f64).sqrt() + 0.01, "{kind:?} {set:?}");
        }
    }
}

#[test]
fn sets_hold_the_shares_of_what_they_learned_from() {
    let training = drives(1, 20);
    for kind in KINDS {
        let fitted = learned(kind, 10);
        let smallest = fitted.smallest_holding(&training).unwrap().concat();
        let all = smallest.len() as f64;
        for (j, share) in SHARES.into_iter().enumerate() {
            let inside = smallest.iter().filter(|&&place| place <= j).count() as f64 / all;
            assert!(inside >= share, "{kind:?} {j}: {inside}");
        }
        let levels: Vec<f64> = fitted.sets.straight.iter().map(|set| set.level).collect();
        assert!(levels.is_sorted() && levels.len() == 5, "{levels:?}");
    }
}

/// If no recorded window follows a right turn, the set after a right turn is empty.
#[test]
fn what_was_never_recorded_is_empty() {
    let parameters = SceneParameters::default();
    let training = [drive(&[0.0; 20]), drive(&[0.5; 20])];
    let mut sets =
        Fitted::learn(EmpiricalFamily::Empirical, &parameters, &training, 10).unwrap().sets;
    sets.place(Pose::new(1.0, 0.0, 0.0), TurnInput::Right);
    let [smaller @ .., last] = sets.sets() else { panic!("no sets") };
    for set in smaller {
        assert!(set.area_m2 == 0.0 && set.tube.iter().chain(&set.steps).all(Vec::is_empty));
    }
    assert!(last.area_m2 > 5.0 && last.tube.len() == 1 && last.steps.len() == 10);
}

#[test]
fn too_few_windows_are_refused() {
    let parameters = SceneParameters::default();
    let learn = |kind, training: &[Trajectory]| {
        let learned = Fitted::learn(kind, &parameters, training, 10);
        learned.err().map(|invalid| invalid.to_string())
    };
    let nothing =
        "earlier trials: expected at least one of 10 steps or more, to learn from, found none";
    for kind in KINDS {
        for training in [vec![], vec![drive(&[0.0; 9])]] {
            assert_eq!(learn(kind, &training).as_deref(), Some(nothing));
        }
    }
    let one = [drive(&[0.0; 10])];
    assert_eq!(learn(EmpiricalFamily::Empirical, &one), None);
    let found = learn(EmpiricalFamily::Gaussian, &one).unwrap();
    assert_eq!(found, "windows: expected at least 2, found 1");
}
