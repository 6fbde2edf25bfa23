//! The cache of a comparison. Cached parts are not computed again, but changed parts are.
//! Cancelling stops the computation. People who cannot be compared are left out.

// Clippy permits `unwrap` in `#[test]` functions. Helpers outside them are also test code.
#![allow(clippy::unwrap_used)]

use sidestep::comparison::cell::Cell;
use sidestep::comparison::sets::NamedSet;
use sidestep::comparison::{
    AnalysisError, Cache, ParticipantData, Progress, Results, Settings, run,
};
use sidestep::features::FeatureSet;
use sidestep::safety::SafetyLevels;
use sidestep::scene::SceneParameters;
use sidestep::synthetic::{Keys, SyntheticParticipant};
use sidestep::vehicle::TurnInput;
use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A cache that stores everything, and counts the entries that were added since the last query.
#[derive(Default)]
struct Counting {
    kept: Mutex<HashMap<String, Vec<Cell>>>,
    computed: AtomicUsize,
}

impl Counting {
    fn computed(&self) -> usize {
        self.computed.swap(0, Ordering::Relaxed)
    }
}

impl Cache for Counting {
    fn get(&self, key: &str) -> Option<Vec<Cell>> {
        self.kept.lock().unwrap().get(key).cloned()
    }

    fn put(&self, key: &str, cells: &[Cell]) {
        self.kept.lock().unwrap().insert(key.to_owned(), cells.to_vec());
        self.computed.fetch_add(1, Ordering::Relaxed);
    }
}

struct Study {
    scene: SceneParameters,
    safety: SafetyLevels,
    people: Vec<ParticipantData>,
}

impl Study {
    /// Two people with five tasks each.
    fn new() -> Self {
        let scene = SceneParameters::default();
        let safety = SafetyLevels::solve(&scene, &mut |_| ControlFlow::Continue(())).unwrap();
        let person = |number: u64| {
            let recorded = SyntheticParticipant::new(7, number).recorded(5, Keys::Clock);
            ParticipantData::of(&recorded, &scene, &safety, None).unwrap()
        };
        let people = vec![person(0), person(1)];
        Self { scene, safety, people }
    }

    fn run(
        &self,
        settings: &Settings,
        cache: &Counting,
        progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
    ) -> Result<Results, AnalysisError> {
        run(&self.people, &self.scene, &self.safety, settings, Some(cache), progress)
    }
}

const fn go_on(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

#[test]
fn only_what_changed_is_computed_again() {
    let study = Study::new();
    let cache = Counting::default();
    let mut settings = Settings::new().unwrap();
    let first = study.run(&settings, &cache, &go_on).unwrap();
    // For each person: four families on nine sets, three models beyond the paper, and two models on
    // three sets trained on the other person.
    assert_eq!(cache.computed(), 2 * (4 * 9 + 3 + 2 * 3));
    assert_eq!(study.run(&settings, &cache, &go_on).unwrap(), first);
    assert_eq!(cache.computed(), 0);

    // Without the parts beyond the paper, nothing new is computed.
    settings.paper_only = true;
    let papers = study.run(&settings, &cache, &go_on).unwrap();
    assert_eq!(cache.computed(), 0);
    assert_eq!(papers.comparison, first.comparison);
    assert!(papers.unseen.is_empty() && papers.importance.is_empty());
    settings.paper_only = false;

    // Another grid affects one model family, on every feature set.
    settings.grids.tree_depth.pop();
    study.run(&settings, &cache, &go_on).unwrap();
    assert_eq!(cache.computed(), 2 * (9 + 3));

    // An additional feature set is computed once per family, and nothing else is computed.
    let features = FeatureSet::of(&["distance", "robot_ahead", "robot_left"]).unwrap();
    settings.sets.push(NamedSet { name: "place".into(), features });
    let further = study.run(&settings, &cache, &go_on).unwrap();
    assert_eq!(cache.computed(), 2 * 4);
    assert_eq!(further.comparison.cells.len(), 2 * 2 * 5 * 10);

    // The leakage check adds a split by time step, for one feature set.
    settings.leakage = true;
    study.run(&settings, &cache, &go_on).unwrap();
    assert_eq!(cache.computed(), 2 * 4);

    // One label of one person changes. This affects the person's models, and the models that are
    // trained on one person and tested on the other.
    let mut other = Study::new();
    let label = &mut other.people[1].data.labels[0];
    *label = if *label == TurnInput::Left { TurnInput::Right } else { TurnInput::Left };
    other.run(&settings, &cache, &go_on).unwrap();
    assert_eq!(cache.computed(), 4 * 10 + 3 + 4 + 2 * 2 * 3);

    // All earlier results are still cached.
    assert_eq!(study.run(&Settings::new().unwrap(), &cache, &go_on).unwrap(), first);
    assert_eq!(cache.computed(), 0);
}

#[test]
fn who_cannot_be_fitted_is_left_out_and_the_others_are_compared() {
    let mut study = Study::new();
    let settings = Settings::new().unwrap();
    // The second person always turns. The first person has a feature that is not a number.
    let mut third = study.people[1].clone();
    third.name = "2".to_owned();
    study.people.push(third);
    for label in &mut study.people[1].data.labels {
        *label = if *label == TurnInput::Straight { TurnInput::Right } else { *label };
    }
    let distance = study.people[0].data.features.features().position(|f| f.name == "distance");
    study.people[0].data.values[distance.unwrap()] = f64::NAN;
    let found = study.run(&settings, &Counting::default(), &go_on).unwrap();
    let reasons: Vec<_> =
        found.exclusions.iter().map(|e| (&e.participant[..], &e.reason[..])).collect();
    let [("0", no_number), ("1", turns)] = reasons[..] else { panic!("{reasons:?}") };
    assert!(no_number.starts_with("svm_rbf on hrd: rows[0]"), "{no_number}");
    assert_eq!(turns, "a turn in every step of the training tasks");

    study.people.drain(..2);
    let alone = study.run(&settings, &Counting::default(), &go_on).unwrap();
    assert_eq!(found, Results { exclusions: found.exclusions.clone(), ..alone });

    study.people[0].data.values.fill(f64::NAN);
    let nobody = study.run(&settings, &Counting::default(), &go_on).unwrap_err().to_string();
    assert!(
        nobody.contains("a participant with usable data") && nobody.contains("2: svm_rbf on hrd"),
        "{nobody}"
    );
}

#[test]
fn what_is_broken_off_computes_no_more_than_had_begun() {
    let study = Study::new();
    let cache = Counting::default();
    let settings = Settings::new().unwrap();
    let enough = |progress: Progress| {
        if progress.done >= 5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    assert_eq!(study.run(&settings, &cache, &enough), Err(AnalysisError::Stopped));
    // Each thread can have finished one more part after the cancellation.
    let computed = cache.computed();
    let threads = std::thread::available_parallelism().unwrap().get();
    assert!((5..5 + threads).contains(&computed), "{computed}");
    // The computed part is reused.
    study.run(&settings, &cache, &go_on).unwrap();
    assert_eq!(cache.computed(), 90 - computed);
}
