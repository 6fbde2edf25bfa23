//! Polygons of reachable sets as a frame of the replay draws them: five nested sets, each
//! with its ten steps and its tube, at 2 mm (chords then leave the curves by 1 mm at most,
//! less than a pixel). Each beside the same with fresh memory for every polygon.
//! `cargo xtask bench shfrs`.
//!
//! What a frame may take natively: 0.1 ms where straight is always admissible, 1.5 ms in
//! general. Both are means over a fixed mix of 20 predictions.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use sidestep::bounds::InputBounds;
use sidestep::math::SeededRng;
use sidestep::reach::{PolygonSettings, ReachableSet, Workspace};
use sidestep::vehicle::Pose;

const RATE_RADPS: f64 = 0.5;
const STEPS: usize = 10;
const PREDICTIONS: usize = 20;

/// The paper's widths, rad/s, of the five sets.
const EPSILON: [f64; 5] = [0.0, 0.15, 0.25, 0.4, 1.0];

/// The bounds of five nested sets.
fn nested(raw: &[(f64, f64)]) -> Vec<InputBounds> {
    let widened = |epsilon: f64| {
        let lo = raw.iter().map(|bounds| (bounds.0 - epsilon).max(-RATE_RADPS)).collect();
        let hi = raw.iter().map(|bounds| (bounds.1 + epsilon).min(RATE_RADPS)).collect();
        InputBounds::new(lo, hi, (-RATE_RADPS, RATE_RADPS)).expect("bounds")
    };
    EPSILON.map(widened).to_vec()
}

/// Any widths, straight always among them.
fn straight_inside(rng: &mut SeededRng) -> Vec<(f64, f64)> {
    (0..STEPS).map(|_| (-RATE_RADPS * rng.unit(), RATE_RADPS * rng.unit())).collect()
}

/// As Algorithm 1 gives them with k = 2, 2, 1, 1 …: a single likely turn from the third
/// step on, another one in each step, which is harder than what people do.
fn in_general(rng: &mut SeededRng) -> Vec<(f64, f64)> {
    (0..STEPS)
        .map(|i| {
            let turn = [-RATE_RADPS, 0.0, RATE_RADPS][rng.below(3)];
            if i < 2 { (turn.min(0.0), turn.max(0.0)) } else { (turn, turn) }
        })
        .collect()
}

fn polygons(criterion: &mut Criterion) {
    let settings = PolygonSettings::new(2e-3, 1).expect("settings");
    let start = Pose::new(1.0, 2.0, 0.3);
    type Kind = fn(&mut SeededRng) -> Vec<(f64, f64)>;
    let kinds: [(&str, Kind); 2] =
        [("polygons, straight inside", straight_inside), ("polygons, general", in_general)];
    for (name, raw) in kinds {
        let mut rng = SeededRng::new(5);
        let frames: Vec<_> = (0..PREDICTIONS).map(|_| nested(&raw(&mut rng))).collect();
        let mut group = criterion.benchmark_group(name);
        group.measurement_time(Duration::from_secs(2)).warm_up_time(Duration::from_millis(300));
        group.sample_size(20).throughput(Throughput::Elements(PREDICTIONS as u64));
        let mut set = ReachableSet::new(start, &frames[0][0], 2.0, 0.2).expect("a set");
        let (mut workspace, mut polygon) = (Workspace::default(), Vec::new());
        group.bench_function("memory kept", |bencher| {
            bencher.iter(|| {
                for bounds in frames.iter().flatten() {
                    set.reset(start, black_box(bounds)).expect("a set");
                    for step in 1..=STEPS {
                        set.step_polygon_into(step, settings, &mut workspace, &mut polygon);
                        black_box(&polygon);
                    }
                    set.tube_polygon_into(settings, &mut workspace, &mut polygon);
                    black_box(&polygon);
                }
            });
        });
        group.bench_function("memory fresh", |bencher| {
            bencher.iter(|| {
                for bounds in frames.iter().flatten() {
                    let set = ReachableSet::new(start, black_box(bounds), 2.0, 0.2);
                    let set = set.expect("a set");
                    for step in 1..=STEPS {
                        black_box(set.step_polygon(step, settings));
                    }
                    black_box(set.tube_polygon(settings));
                }
            });
        });
        group.finish();
    }
}

criterion_group!(benches, polygons);
criterion_main!(benches);
