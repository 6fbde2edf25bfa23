//! Settings of predicted sets as a file and as part of a URL.

use crate::bounds::{ActionChoice, BoundsSettings, Rollout, in_proportion};
use crate::document::decimal;
use crate::invalid::Invalid;
use core::cmp::Ordering;
use serde::{Deserialize, Serialize};

/// User-editable settings of predicted sets, `shfrs-settings.json`. The laboratory's explorer saves
/// this file, and `sidestep shfrs --settings` reads it. The settings can be invalid;
/// [`Self::settings`] checks them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShfrsFile {
    format: Format,
    /// Number of steps ahead, T, from 1 to [`MOST_STEPS`].
    pub steps: usize,
    /// The widening ε of each set's bounds (rad/s), ascending; at most [`MOST_SETS`] sets.
    pub epsilon: Vec<f64>,
    /// Number of most probable actions to include at each step ahead, ≥ 1. Exactly one of `k`, `tau` and `q`
    /// must be present.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub k: Option<Vec<usize>>,
    /// Minimum probability of an included action, in (0, 1].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tau: Option<f64>,
    /// Probability of the shortest interval of turn rates to include at each step ahead, in (0, 1].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub q: Option<Vec<f64>>,
    /// Whether the bounds in roll-outs are widened by ε_1.
    #[serde(default = "usual_rollout")]
    pub rollout: Rollout,
}

/// The version of the file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Format {
    #[serde(rename = "sidestep-shfrs/1")]
    V1,
}

/// Maximum number of steps ahead.
pub const MOST_STEPS: usize = 100;

/// Maximum number of sets.
pub const MOST_SETS: usize = 10;

fn usual_rollout() -> Rollout {
    Rollout::Base
}

/// One of the paper's settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Preset {
    /// The panel of the figure in the paper.
    pub name: &'static str,
    /// How this preset differs from the other presets.
    pub meaning: &'static str,
    epsilon: [f64; 5],
    /// Number of initial steps with two actions. Later steps have one action.
    twos: usize,
}

/// The settings of the paper's Figure 3: ten steps, five sets, and one or two actions.
pub const PRESETS: [Preset; 3] = [
    Preset {
        name: "Figure 3, left",
        meaning: "k = 2 in the first two steps, then 1",
        epsilon: [0.0, 0.15, 0.25, 0.4, 1.0],
        twos: 2,
    },
    Preset {
        name: "Figure 3, middle",
        meaning: "as on the left, with larger ε",
        epsilon: [0.2, 0.3, 0.35, 0.45, 1.0],
        twos: 2,
    },
    Preset {
        name: "Figure 3, right",
        meaning: "as on the left, with k = 2 in the first step only",
        epsilon: [0.0, 0.15, 0.25, 0.4, 1.0],
        twos: 1,
    },
];

impl Preset {
    /// The settings of this preset for a model with `actions` actions. k is at most `actions`.
    #[must_use]
    pub fn settings(&self, actions: usize) -> ShfrsFile {
        let k = |i| if i < self.twos { actions.min(2) } else { 1 };
        ShfrsFile {
            format: Format::V1,
            steps: 10,
            epsilon: self.epsilon.to_vec(),
            k: Some((0..10).map(k).collect()),
            tau: None,
            q: None,
            rollout: usual_rollout(),
        }
    }
}

impl ShfrsFile {
    /// Scales the paper's ε to a human with this turn rate (see [`in_proportion`]).
    #[must_use]
    pub fn for_turn_rate(mut self, turn_rate_radps: f64) -> Self {
        self.epsilon = in_proportion(&self.epsilon, turn_rate_radps);
        self
    }
}

impl From<&BoundsSettings> for ShfrsFile {
    fn from(settings: &BoundsSettings) -> Self {
        let (k, tau, q) = settings.choice().in_file();
        Self {
            format: Format::V1,
            steps: settings.steps(),
            epsilon: settings.epsilon().to_vec(),
            k,
            tau,
            q,
            rollout: settings.rollout(),
        }
    }
}

impl ShfrsFile {
    /// Names of the URL parameters that [`Self::set`] accepts.
    pub const NAMES: [&str; 6] = ["T", "eps", "k", "tau", "q", "rollout"];

    /// Sets [`Self::rollout`], the kind of roll-outs.
    #[must_use]
    pub fn with_rollout(self, rollout: Rollout) -> Self {
        Self { rollout, ..self }
    }

    /// The settings of Algorithm 1 for a model with `actions` actions.
    ///
    /// # Errors
    /// [`Invalid`] that names the field.
    pub fn settings(&self, actions: usize) -> Result<BoundsSettings, Invalid> {
        if !(1..=MOST_STEPS).contains(&self.steps) {
            let expected = format!("a whole number from 1 to {MOST_STEPS}");
            return Err(Invalid::new("steps", expected, self.steps));
        }
        if self.epsilon.len() > MOST_SETS {
            let expected = format!("1 to {MOST_SETS} sets");
            return Err(Invalid::new("epsilon", expected, self.epsilon.len()));
        }
        let Self { steps, k, tau, q, .. } = self;
        let choice = ActionChoice::of_file(*steps, k.as_deref(), *tau, q.as_deref())?;
        BoundsSettings::new(self.epsilon.clone(), choice, self.rollout, actions)
    }

    /// Sets the number of steps ahead. Additional steps repeat the last k or q.
    pub fn look_ahead(&mut self, steps: usize) {
        self.steps = steps;
        if let Some(k) = &mut self.k {
            let last = k.last().copied().unwrap_or(1);
            k.resize(steps.min(MOST_STEPS), last);
        }
        if let Some(q) = &mut self.q {
            let last = q.last().copied().unwrap_or(1.0);
            q.resize(steps.min(MOST_STEPS), last);
        }
    }

    /// Sets the number of sets. The last set is never removed, because it contains everything. New
    /// sets are inserted midway between the last two sets.
    pub fn resize(&mut self, sets: usize) {
        while self.epsilon.len() > sets.max(1) {
            let place = self.epsilon.len() - 2;
            self.epsilon.remove(place);
        }
        while self.epsilon.len() < sets.min(MOST_SETS) {
            let last = self.epsilon.len().saturating_sub(1);
            let before = last.checked_sub(1).map_or(0.0, |place| self.epsilon[place]);
            let after = self.epsilon.last().copied().unwrap_or(0.0);
            // Rounded to 0.01, the step of the sliders.
            self.epsilon.insert(last, (50.0 * (before + after)).round() / 100.0);
        }
    }

    /// Sets the widening of the set at index `place` to `epsilon` (rad/s). Earlier sets get at most
    /// this widening and later sets at least this widening, so that sets stay nested. Does nothing
    /// if the index is out of range.
    pub fn widen(&mut self, place: usize, epsilon: f64) {
        if place >= self.epsilon.len() {
            return;
        }
        for (j, other) in self.epsilon.iter_mut().enumerate() {
            *other = match j.cmp(&place) {
                Ordering::Less => other.min(epsilon),
                Ordering::Equal => epsilon,
                Ordering::Greater => other.max(epsilon),
            };
        }
    }

    /// Copies the steps, actions, roll-outs and first ε from `first`. Sets that are not wider than
    /// the new first set get values of ε that are evenly spaced between the first ε and the next
    /// larger ε.
    pub fn begin_with(&mut self, first: &Self) {
        (self.steps, self.rollout) = (first.steps, first.rollout);
        (self.k, self.tau, self.q) = (first.k.clone(), first.tau, first.q.clone());
        let least = first.epsilon.first().copied().unwrap_or(0.0);
        if self.epsilon.len() < 2 {
            self.epsilon.insert(0, least);
        }
        let wider = self.epsilon.iter().skip(1).position(|&epsilon| epsilon > least);
        let (count, next) = match wider {
            Some(count) => (count, self.epsilon[count + 1]),
            None => (self.epsilon.len() - 1, least),
        };
        for (j, epsilon) in self.epsilon.iter_mut().take(count + 1).enumerate() {
            // Rounded to 0.01, the step of the sliders.
            let between = least + (next - least) * j as f64 / (count + 1) as f64;
            *epsilon = (100.0 * between).round().max(100.0 * least) / 100.0;
        }
        self.epsilon[0] = least;
    }

    /// Whether `self` and `first` agree in everything except the ε of later sets. Returns `false`
    /// if either has no sets.
    #[must_use]
    pub fn begins_with(&self, first: &Self) -> bool {
        let of = |file: &Self| Self { epsilon: file.epsilon[..1].to_vec(), ..file.clone() };
        let some = |file: &Self| !file.epsilon.is_empty();
        some(self) && some(first) && of(self) == of(first)
    }

    /// The settings as URL parameters, such as `T=10&eps=0,0.4,1&k=2,2,1,…`. An adaptive choice has
    /// `tau=0.1` instead of `k`, and the shortest interval has `q=0.9,0.8,…`. Roll-outs that are not the default add `rollout=paper`.
    #[must_use]
    pub fn query(&self) -> String {
        let listed = |numbers: Vec<String>| numbers.join(",");
        let epsilon = self.epsilon.iter().map(|&epsilon| written(epsilon)).collect();
        let mut parts = vec![format!("T={}", self.steps), format!("eps={}", listed(epsilon))];
        if let Some(k) = &self.k {
            parts.push(format!("k={}", listed(k.iter().map(usize::to_string).collect())));
        }
        parts.extend(self.tau.map(|tau| format!("tau={}", written(tau))));
        if let Some(q) = &self.q {
            parts.push(format!("q={}", listed(q.iter().map(|&q| written(q)).collect())));
        }
        if self.rollout != usual_rollout() {
            parts.push(format!("rollout={}", self.rollout.word()));
        }
        parts.join("&")
    }

    /// Sets one URL parameter. Ignores unknown names.
    ///
    /// # Errors
    /// [`Invalid`] that names the parameter, if its value cannot be parsed or `T` is out of range.
    /// Other parsed values may still be invalid.
    pub fn set(&mut self, name: &str, value: &str) -> Result<(), Invalid> {
        match name {
            "T" => {
                let expected = format!("a whole number from 1 to {MOST_STEPS}");
                let steps = whole(value).filter(|steps| (1..=MOST_STEPS).contains(steps));
                self.look_ahead(steps.ok_or_else(|| Invalid::new(name, expected, value))?);
            }
            "eps" => {
                let epsilon: Option<Vec<f64>> = value.split(',').map(decimal).collect();
                let expected = "numbers in rad/s, such as 0,0.4,1";
                self.epsilon = epsilon.ok_or_else(|| Invalid::new(name, expected, value))?;
            }
            "k" => {
                let numbers = value.split([',', ' ']).filter(|k| !k.is_empty());
                let k: Option<Vec<usize>> = numbers.map(whole).collect();
                let expected = "whole numbers from 1, one for each step, separated by commas";
                let k = k.ok_or_else(|| Invalid::new(name, expected, value))?;
                (self.k, self.tau, self.q) = (Some(k), None, None);
            }
            "tau" => {
                let tau =
                    decimal(value).ok_or_else(|| Invalid::new(name, "a number in (0, 1]", value));
                (self.k, self.tau, self.q) = (None, Some(tau?), None);
            }
            "q" => {
                let q: Option<Vec<f64>> = value.split(',').map(decimal).collect();
                let expected = "a number in (0, 1], or one for each step, separated by commas";
                let mut q = q.ok_or_else(|| Invalid::new(name, expected, value))?;
                if let [same] = q[..] {
                    q.resize(self.steps.min(MOST_STEPS), same);
                }
                (self.k, self.tau, self.q) = (None, None, Some(q));
            }
            "rollout" => {
                self.rollout = match value {
                    "paper" => Rollout::Paper,
                    "base" => Rollout::Base,
                    _ => return Err(Invalid::new(name, "paper or base", value)),
                };
            }
            _ => {}
        }
        Ok(())
    }
}

/// Formats a number ≥ 0 so that [`decimal`] can parse it. Writes all digits if the text then has at
/// most 16 characters, and twelve decimal places otherwise.
fn written(value: f64) -> String {
    let text = value.to_string();
    if text.len() > 16 { format!("{value:.12}") } else { text }
}

/// Parses an integer of at most four digits.
fn whole(text: &str) -> Option<usize> {
    let digits = text.trim();
    let is_short = (1..=4).contains(&digits.len());
    let digit = |number: Option<usize>, byte: u8| {
        Some(10 * number? + usize::from(byte.checked_sub(b'0').filter(|digit| *digit < 10)?))
    };
    if is_short { digits.bytes().fold(Some(0), digit) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::{Unread, object_from_json};
    use crate::shfrs::ShfrsSettings;
    use proptest::prelude::*;

    fn paper() -> ShfrsFile {
        PRESETS[0].settings(3)
    }

    #[test]
    fn the_first_preset_is_what_replays_show() {
        for actions in 1..=5 {
            let settings = PRESETS[0].settings(actions).settings(actions).unwrap();
            assert_eq!(settings, ShfrsSettings::paper(actions).unwrap().bounds);
        }
    }

    #[test]
    fn presets_are_those_of_the_paper() {
        let of = |preset: Preset| {
            let settings = preset.settings(3);
            (settings.epsilon, settings.k.unwrap().iter().sum::<usize>())
        };
        assert_eq!(of(PRESETS[1]), (vec![0.2, 0.3, 0.35, 0.45, 1.0], 12));
        assert_eq!(of(PRESETS[2]), (vec![0.0, 0.15, 0.25, 0.4, 1.0], 11));
    }

    #[test]
    fn a_file_says_what_is_wrong() {
        let read = |text: &str| match object_from_json::<ShfrsFile>(text) {
            Ok(file) => file.settings(3).err(),
            Err(Unread::Invalid(invalid)) => Some(invalid),
            Err(unread) => panic!("{unread}"),
        };
        let whole = |rest: &str| format!(r#"{{"format":"sidestep-shfrs/1",{rest}}}"#);
        assert_eq!(read(&whole(r#""steps":2,"epsilon":[0,1],"k":[2,1]"#)), None);
        assert_eq!(read(&whole(r#""steps":2,"epsilon":[0,1],"tau":0.1,"rollout":"paper""#)), None);
        for (rest, field) in [
            (r#""steps":0,"epsilon":[0],"tau":0.1"#, "steps"),
            (r#""steps":101,"epsilon":[0],"tau":0.1"#, "steps"),
            (r#""steps":2,"epsilon":[0],"k":[1]"#, "k"),
            (r#""steps":2,"epsilon":[0],"k":[1,4]"#, "k[1]"),
            (r#""steps":2,"epsilon":[0.2,0.1],"k":[1,1]"#, "epsilon[1]"),
            (r#""steps":1,"epsilon":[0,0,0,0,0,0,0,0,0,0,0],"k":[1]"#, "epsilon"),
            (r#""steps":2,"epsilon":[0]"#, "k"),
            (r#""steps":2,"epsilon":[0],"k":[1,1],"tau":0.5"#, "tau"),
            (r#""steps":2,"epsilon":[0],"tau":1.5"#, "tau"),
            (r#""steps":2,"epsilon":[0],"tau":0.5,"rollout":"other""#, "rollout"),
            (r#""steps":2,"epsilon":[0],"tau":0.5,"colour":"red""#, "colour"),
        ] {
            assert_eq!(read(&whole(rest)).unwrap().field, field, "{rest}");
        }
        assert_eq!(read(r#"{"format":"other","steps":2,"epsilon":[0]}"#).unwrap().field, "format");
    }

    #[test]
    fn every_name_of_a_link_is_taken() {
        for name in ShfrsFile::NAMES {
            assert_eq!(paper().set(name, "?").unwrap_err().field, name);
        }
    }

    #[test]
    fn a_set_that_is_widened_moves_its_neighbours() {
        let widened = |place, epsilon| {
            let mut file = paper();
            file.widen(place, epsilon);
            assert_eq!(file.settings(3).err(), None);
            file.epsilon
        };
        assert_eq!(widened(1, 0.2), [0.0, 0.2, 0.25, 0.4, 1.0]);
        assert_eq!(widened(1, 0.6), [0.0, 0.6, 0.6, 0.6, 1.0]);
        assert_eq!(widened(3, 0.1), [0.0, 0.1, 0.1, 0.1, 1.0]);
        assert_eq!(widened(4, 0.0), [0.0; 5]);
        assert_eq!(widened(9, 0.3), paper().epsilon);
    }

    #[test]
    fn sets_and_steps_come_and_go() {
        let mut file = paper();
        file.resize(6);
        assert_eq!(file.epsilon, [0.0, 0.15, 0.25, 0.4, 0.7, 1.0]);
        file.resize(2);
        assert_eq!(file.epsilon, [0.0, 1.0]);
        file.resize(1);
        assert_eq!(file.epsilon, [1.0]);
        file.resize(2);
        assert_eq!(file.epsilon, [0.5, 1.0]);
        file.look_ahead(12);
        assert_eq!(file.k.as_deref().unwrap()[9..], [1, 1, 1]);
        file.look_ahead(1);
        assert_eq!(file.k.as_deref(), Some(&[2][..]));
        assert!(file.settings(3).is_ok());
    }

    #[test]
    fn a_link_can_always_be_read() {
        let mut file = paper();
        file.epsilon = vec![1.0 / 3.0, 1e-7, 12.5, 1.0];
        file.set("eps", file.query().split('&').nth(1).unwrap().strip_prefix("eps=").unwrap())
            .unwrap();
        assert_eq!(file.epsilon, [0.333333333333, 1e-7, 12.5, 1.0]);
    }

    #[test]
    fn the_first_set_of_other_settings_is_taken_over() {
        let mut first = PRESETS[2].settings(3);
        (first.epsilon, first.k, first.tau, first.steps) = (vec![0.3], None, Some(0.2), 7);
        for (epsilon, expected) in [
            (vec![0.0, 0.15, 0.4, 1.0], vec![0.3, 0.35, 0.4, 1.0]),
            (vec![0.0, 0.1, 0.2, 0.2, 1.0], vec![0.3, 0.48, 0.65, 0.83, 1.0]),
            (vec![0.5, 1.0], vec![0.3, 1.0]),
            (vec![1.0], vec![0.3, 1.0]),
            (vec![0.1], vec![0.3, 0.3]),
        ] {
            let mut file = ShfrsFile { epsilon, ..paper() };
            assert!(!file.begins_with(&first));
            file.begin_with(&first);
            assert!(file.begins_with(&first));
            assert_eq!((&file.epsilon, file.steps, file.tau), (&expected, 7, Some(0.2)));
            file.settings(3).unwrap();
        }
    }

    #[test]
    fn what_a_link_cannot_mean_is_named() {
        for (name, value) in [
            ("T", "0"),
            ("T", "101"),
            ("T", "1.5"),
            ("eps", "0,,1"),
            ("eps", "NaN"),
            ("k", "1,x"),
            ("k", "-1"),
            ("q", "0.9,x"),
            ("tau", "much"),
            ("rollout", "other"),
        ] {
            let mut file = paper();
            let invalid = file.set(name, value).unwrap_err();
            assert_eq!((invalid.field.as_str(), invalid.found.as_str()), (name, value));
            assert_eq!(file, paper());
        }
    }

    proptest! {
        #[test]
        fn links_and_files_bring_the_same_settings_back(
            steps in 1..=MOST_STEPS, epsilon in prop::collection::vec(0u32..100, 1..=MOST_SETS),
            k in prop::collection::vec(1usize..=3, MOST_STEPS), tau in 1u32..=1000, rule in 0..3,
            as_printed: bool,
        ) {
            let mut epsilon: Vec<f64> = epsilon.iter().map(|&e| f64::from(e) / 100.0).collect();
            epsilon.sort_by(f64::total_cmp);
            let file = ShfrsFile {
                format: Format::V1,
                steps,
                epsilon,
                k: (rule == 0).then(|| k[..steps].to_vec()),
                tau: (rule == 1).then_some(f64::from(tau) / 1000.0),
                q: (rule == 2).then(|| k[..steps].iter().map(|&k| k as f64 / 4.0).collect()),
                rollout: if as_printed { Rollout::Paper } else { Rollout::Base },
            };
            let mut read = paper();
            for (name, value) in file.query().split('&').filter_map(|part| part.split_once('=')) {
                read.set(name, value).unwrap();
            }
            prop_assert_eq!(&read, &file);
            let text = serde_json::to_string(&file).unwrap();
            prop_assert_eq!(&object_from_json::<ShfrsFile>(&text).unwrap(), &file);
            prop_assert_eq!(ShfrsFile::from(&file.settings(3).unwrap()), file);
        }
    }
}
