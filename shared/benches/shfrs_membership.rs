//! Membership of full states after ten steps: how long a test takes.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use sidestep::bounds::InputBounds;
use sidestep::math::SeededRng;
use sidestep::reach::{ReachableSet, Tolerance};
use sidestep::vehicle::{Pose, dubins};

const STEPS: usize = 10;

/// Lowest and highest rate, rad/s.
type Rates = (f64, f64);

/// Name, and the rates of the steps up to the third, up to the fifth, and later. The last
/// three are as Algorithm 1 finds them: three inputs, two, then one, widened.
const BOUNDS: &[(&str, [Rates; 3])] = &[
    ("both ways", [(-0.5, 0.5), (-0.5, 0.5), (-0.3, 0.4)]),
    ("left", [(0.1, 0.5), (0.1, 0.5), (0.3, 0.5)]),
    ("straight admissible", [(-0.5, 0.5), (-0.5, 0.5), (0.0, 0.5)]),
    ("mixed", [(-0.5, 0.5), (-0.5, 0.5), (0.3, 0.5)]),
    ("predicted", [(-0.5, 0.5), (-0.5, 0.0), (-0.5, -0.5)]),
    ("predicted, 0.15 wider", [(-0.5, 0.5), (-0.5, 0.15), (-0.5, -0.35)]),
    ("predicted, 0.4 wider", [(-0.5, 0.5), (-0.5, 0.4), (-0.5, -0.1)]),
];

fn membership(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("state membership");
    group.measurement_time(Duration::from_secs(2)).warm_up_time(Duration::from_millis(300));
    for &(name, [first, second, third]) in BOUNDS {
        let of = |step: usize| match step {
            0..3 => first,
            3..5 => second,
            _ => third,
        };
        let (lo, hi): (Vec<f64>, Vec<f64>) = (0..STEPS).map(of).unzip();
        let start = Pose::new(1.0, 2.0, 0.7);
        let bounds = InputBounds::new(lo, hi, (-0.5, 0.5)).expect("bounds");
        let set = ReachableSet::new(start, &bounds, 2.0, 0.2).expect("a set");
        let mut rng = SeededRng::new(1);
        let drives: Vec<Pose> = (0..256)
            .map(|_| {
                (0..STEPS).fold(start, |pose, step| {
                    let (lo, hi) = of(step);
                    dubins::arc(pose, 2.0, rng.uniform(lo, hi), 0.2)
                })
            })
            .collect();
        let shifted = |by: f64| -> Vec<Pose> {
            drives.iter().map(|pose| Pose { x: pose.x + by, y: pose.y - by, ..*pose }).collect()
        };
        for (what, states) in
            [("inside", drives.clone()), ("near", shifted(0.1)), ("far", shifted(0.7))]
        {
            let mut next = states.iter().cycle();
            group.bench_function(format!("{name}/{what}"), |bencher| {
                bencher.iter(|| {
                    let state = *next.next().expect("a state");
                    set.contains_state(STEPS, black_box(state), Tolerance::default())
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, membership);
criterion_main!(benches);
