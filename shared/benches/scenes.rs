//! Drawing the scenes of one participant of the paper's study: `cargo xtask bench scenes`.
//!
//! The baseline draws the same scenes by the plain rules, which simulate every escape step by step.

use std::hint::black_box;

use criterion::{Criterion, SamplingMode};
use fastest::Fastest;
use sidestep::scene::{
    EncounterRange, Scene, counterbalanced, generate, generate_with, is_admissible,
};
use sidestep::study::StudyConfig;

mod fastest;

/// Pairs of a measurement and its baseline.
const RATIOS: &[(&str, &str)] = &[
    ("scenes/of a participant", "scenes/by the plain rules"),
    ("scenes/counterbalanced", "scenes/of a participant"),
];

/// Budgets per participant (s).
const BUDGETS: &[(&str, f64)] =
    &[("scenes/of a participant", 5e-3), ("scenes/counterbalanced", 2e-3)];

/// Participants per call. The time is averaged over several participants, because some of them need
/// far more rejected draws than others.
const PARTICIPANTS: u64 = 20;

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let mut fastest = Fastest::default();
    let StudyConfig { parameters, phases, .. } = StudyConfig::default();
    let range = EncounterRange::default();
    let plain = |scene: &Scene| is_admissible(&parameters, &range, scene);
    let mut group = criterion.benchmark_group("scenes");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    let people = PARTICIPANTS as usize;
    fastest.measure(&mut group, "scenes/of a participant", people, || {
        for seed in 0..PARTICIPANTS {
            for phase in &phases {
                black_box(generate(&parameters, &range, phase.scenes, seed)).expect("scenes");
            }
        }
    });
    fastest.measure(&mut group, "scenes/counterbalanced", people, || {
        for place in 0..PARTICIPANTS {
            for phase in &phases {
                let scenes = counterbalanced(&parameters, &range, phase.scenes, 1, place);
                black_box(scenes).expect("scenes");
            }
        }
    });
    fastest.measure(&mut group, "scenes/by the plain rules", people, || {
        for seed in 0..PARTICIPANTS {
            for phase in &phases {
                let scenes = generate_with(&parameters, &range, phase.scenes, seed, plain);
                black_box(scenes).expect("scenes");
            }
        }
    });
    group.finish();
    criterion.final_summary();
    fastest.print_ratios(RATIOS, BUDGETS);
}
