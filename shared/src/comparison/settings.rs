//! Settings of a comparison: feature sets, grids, and whether to show leakage.

use super::models::{BEYOND, Beyond, Grids, ModelName};
use super::sets::NamedSet;
use crate::features::FeatureSet;
use crate::invalid::Invalid;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a comparison fits and reports.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Feature sets, including the paper's seven.
    pub sets: Vec<NamedSet>,
    /// Hyper-parameters to try.
    pub grids: Grids,
    /// Whether to also fit models with a split by time step, which demonstrates leakage.
    pub leakage: bool,
    /// Whether to skip everything that is not in the paper: learning curves, models for unseen
    /// people and the importance of features.
    pub paper_only: bool,
    /// Number of steps of roll-outs, at least 1.
    pub horizon: usize,
    /// The feature set of models with history.
    pub history: NamedSet,
}

impl Settings {
    /// The protocol's settings: the paper's sets, two of these sets extended by the body frame, the
    /// protocol's grids, and roll-outs of ten steps.
    ///
    /// # Errors
    /// Never, because all names are valid.
    pub fn new() -> Result<Self, Invalid> {
        let mut sets = NamedSet::papers()?;
        sets.extend(NamedSet::with_body_frame()?);
        let history = NamedSet::with_history()?;
        Ok(Self {
            sets,
            grids: Grids::default(),
            leakage: false,
            paper_only: false,
            horizon: 10,
            history,
        })
    }

    /// The models beyond the paper, which are not trained for the tables, with their feature sets.
    pub(super) fn beyond(&self) -> impl Iterator<Item = (&NamedSet, ModelName)> {
        let set = |name| self.sets.iter().chain([&self.history]).find(|set| set.name == name);
        let trained = |of: &Beyond| of.model.training().is_some();
        BEYOND.into_iter().filter(trained).filter_map(move |of| Some((set(of.features)?, of.model)))
    }
}

/// The request for a comparison, as JSON. All fields are optional.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Whether to also fit models with a split by time step. This shows how much such a split
    /// overstates accuracy.
    pub leakage: bool,
    /// Whether to skip learning curves, models for unseen people and the importance of features.
    /// Skipping them saves a third of the time.
    #[serde(skip_serializing_if = "core::ops::Not::not")]
    pub paper_only: bool,
    /// Whether the report should state that the data are synthetic. Files of `sidestep simulate`
    /// already state this.
    pub synthetic: bool,
    /// Feature sets in addition to the paper's sets. Each key is the name of a set, and its value
    /// lists the names of the features.
    pub sets: BTreeMap<String, Vec<String>>,
    /// Hyper-parameters to try. Omitted grids default to the protocol's grids.
    pub grids: Grids,
}

/// Maximum number of additional sets.
const MOST_SETS: usize = 32;

impl Request {
    /// The requested settings. Omitted fields default to the protocol's settings.
    ///
    /// # Errors
    /// [`Invalid`] with the name of the invalid set or grid.
    pub fn settings(&self) -> Result<Settings, Invalid> {
        let protocol = Settings::new()?;
        if self.sets.len() > MOST_SETS {
            let expected = format!("at most {MOST_SETS}");
            return Err(Invalid::new("sets", expected, self.sets.len()));
        }
        let mut sets = protocol.sets.clone();
        for (name, features) in &self.sets {
            let field = format!("sets.{name}");
            let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
            if !(1..=40).contains(&name.len()) || !name.chars().all(plain) {
                let expected = "names of 1 to 40 of a to z, 0 to 9 and _";
                return Err(Invalid::new("sets", expected, format!("{name:?}")));
            }
            if sets.iter().chain([&protocol.history]).any(|set| set.name == *name) {
                let expected = "a name that no set of the protocol has";
                return Err(Invalid::new(field, expected, name));
            }
            let features = FeatureSet::of(features).map_err(|e| e.within(&field))?;
            sets.push(NamedSet { name: name.clone(), features });
        }
        self.grids.check().map_err(|e| e.within("grids"))?;
        let Self { leakage, paper_only, .. } = *self;
        Ok(Settings { sets, grids: self.grids.clone(), leakage, paper_only, ..protocol })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(json: &str) -> Result<Settings, Invalid> {
        serde_json::from_str::<Request>(json).unwrap().settings()
    }

    #[test]
    fn nothing_asks_for_the_protocol() {
        assert_eq!(settings("{}").unwrap(), Settings::new().unwrap());
        assert_eq!(serde_json::from_str::<Request>("{}").unwrap(), Request::default());
    }

    #[test]
    fn sets_are_added_and_grids_replaced() {
        assert!(settings(r#"{"paper_only": true}"#).unwrap().paper_only);
        let asked = r#"{"sets": {"slopes": ["v_h", "dv_h_ahead"], "far": ["distance"]},
                        "grids": {"rbf_c": [2], "tree_depth": [3, null]}, "leakage": true}"#;
        let (found, protocol) = (settings(asked).unwrap(), Settings::new().unwrap());
        let names: Vec<&str> = found.sets.iter().map(|set| set.name.as_str()).collect();
        assert_eq!(names[protocol.sets.len()..], ["far", "slopes"]);
        assert_eq!(found.sets[..protocol.sets.len()], protocol.sets);
        assert_eq!((&found.grids.rbf_c[..], found.leakage), (&[2.0][..], true));
        assert_eq!(found.grids.tree_depth, [Some(3), None]);
        assert_eq!(found.grids.rbf_gamma, protocol.grids.rbf_gamma);
    }

    #[test]
    fn what_cannot_be_is_named() {
        for (asked, field) in [
            (r#"{"sets": {"hrd": ["v_h"]}}"#, "sets.hrd"),
            (r#"{"sets": {"hrd_body_history": ["v_h"]}}"#, "sets.hrd_body_history"),
            (r#"{"sets": {"../x": ["v_h"]}}"#, "sets"),
            (r#"{"sets": {"": ["v_h"]}}"#, "sets"),
            (r#"{"grids": {"rbf_c": []}}"#, "grids.rbf_c"),
            (r#"{"grids": {"linear_c": [1, 0]}}"#, "grids.linear_c[1]"),
            (r#"{"grids": {"rbf_gamma": [1e9]}}"#, "grids.rbf_gamma[0]"),
            (r#"{"grids": {"logistic_c": [1, 2, 1]}}"#, "grids.logistic_c[2]"),
            (r#"{"grids": {"tree_depth": [null, 0]}}"#, "grids.tree_depth"),
            (r#"{"grids": {"tree_leaf": [0]}}"#, "grids.tree_leaf"),
            (r#"{"grids": {"tree_leaf": [8, 7]}}"#, "grids.tree_leaf"),
            (r#"{"grids": {"boosted_depth": [9]}}"#, "grids.boosted_depth"),
        ] {
            assert_eq!(settings(asked).unwrap_err().field, field, "{asked}");
        }
        for (asked, field) in [
            (r#"{"sets": {"mine": []}}"#, "sets.mine"),
            (r#"{"sets": {"mine": ["v_h", "speed"]}}"#, "sets.mine"),
        ] {
            assert!(settings(asked).unwrap_err().field.starts_with(field), "{asked}");
        }
    }
}
