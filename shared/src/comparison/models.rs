//! The table of models that a comparison trains, and the hyper-parameters that it tries.

use super::sets::BODY_FRAME_SETS;
use crate::chart::Mark;
use crate::features::HISTORY_SET;
use crate::invalid::{Invalid, positive};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A model of the comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum ModelName {
    /// Whichever of the two SVMs below is more accurate in cross-validation. On a tie, the first.
    Svm,
    /// Support vector machine with radial basis functions.
    SvmRbf,
    /// Support vector machine with a linear kernel.
    SvmLinear,
    /// Decision tree.
    Dt,
    /// Multinomial logistic regression.
    Lr,
    /// Gradient-boosted trees, which are not in the paper. They are evaluated by roll-outs only.
    Boosted,
}

/// A row of the table: the names of a model, and its colour and mark in charts.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ModelRow {
    /// Name in files, as Serde writes it.
    pub word: &'static str,
    /// Name in tables, as the paper writes it.
    pub short: &'static str,
    /// Name in lists of models.
    pub label: &'static str,
    /// Name in sentences.
    pub full: &'static str,
    /// The model's hyper-parameters in words. `{name}` is a placeholder for the values of the field
    /// `name` of [`Grids`].
    pub grid: &'static str,
    /// Index of the model's colour among the colours of a chart's series.
    #[serde(skip)]
    pub colour: usize,
    /// The model's mark in charts.
    #[serde(skip)]
    pub mark: Mark,
}

/// One row per model, in the order of [`ModelName`]. [`ModelName::training`] defines how each model
/// is trained.
const MODELS: [ModelRow; 6] = [
    ModelRow {
        word: "svm",
        short: "SVM",
        label: "SVM, the better of two",
        full: "the support vector machine",
        grid: "",
        colour: 0,
        mark: Mark::Circle,
    },
    ModelRow {
        word: "svm_rbf",
        short: "SVM (RBF)",
        label: "SVM, RBF kernel",
        full: "the support vector machine with radial basis functions",
        grid: "SVM with radial basis functions: C {rbf_c} and γ {rbf_gamma}",
        colour: 0,
        mark: Mark::Circle,
    },
    ModelRow {
        word: "svm_linear",
        short: "SVM (linear)",
        label: "SVM, linear",
        full: "the linear support vector machine",
        grid: "linear SVM: C {linear_c}",
        colour: 0,
        mark: Mark::Circle,
    },
    ModelRow {
        word: "dt",
        short: "DT",
        label: "Decision tree",
        full: "the decision tree",
        grid: "decision tree: depth {tree_depth}, at least {tree_leaf} rows a leaf",
        colour: 1,
        mark: Mark::Square,
    },
    ModelRow {
        word: "lr",
        short: "LR",
        label: "Logistic regression",
        full: "logistic regression",
        grid: "logistic regression: C {logistic_c}",
        colour: 2,
        mark: Mark::Triangle,
    },
    ModelRow {
        word: "boosted",
        short: "boosted trees",
        label: "Boosted trees",
        full: "boosted trees",
        grid: "boosted trees, in roll-outs only: depth {boosted_depth}",
        colour: 1,
        mark: Mark::Square,
    },
];

impl ModelName {
    /// Every model of the table.
    pub const EVERY: [Self; MODELS.len()] =
        [Self::Svm, Self::SvmRbf, Self::SvmLinear, Self::Dt, Self::Lr, Self::Boosted];

    /// The models of the comparison, in the order of the tables.
    pub const ALL: [Self; 5] = [Self::Svm, Self::SvmRbf, Self::SvmLinear, Self::Dt, Self::Lr];

    /// The three models of the paper's tables.
    pub const PAPERS: [Self; 3] = [Self::Svm, Self::Dt, Self::Lr];

    /// The models that are trained for the paper's tables.
    pub const TRAINED: [Self; 4] = [Self::SvmRbf, Self::SvmLinear, Self::Dt, Self::Lr];

    /// The model's row of the table.
    #[must_use]
    pub const fn row(self) -> &'static ModelRow {
        &MODELS[self as usize]
    }

    /// The model's name in files.
    #[must_use]
    pub fn word(self) -> &'static str {
        self.row().word
    }

    /// Returns the model that has this name in files.
    #[must_use]
    pub fn of_word(word: &str) -> Option<Self> {
        Self::EVERY.into_iter().find(|model| model.word() == word)
    }
}

/// A model beyond the paper that is evaluated by roll-outs.
#[derive(Clone, Copy, Debug)]
pub struct Beyond {
    /// The model.
    pub model: ModelName,
    /// The model's feature set.
    pub features: &'static str,
    /// The model's name in the report.
    pub words: &'static str,
    /// Colour and mark of the model's dashed curve. Set only if another curve already has the
    /// model's own colour and mark.
    pub look: Option<(usize, Mark)>,
}

/// Models that use the body frame, and models that also use earlier inputs.
pub const BEYOND: [Beyond; 4] = {
    let body = BODY_FRAME_SETS[0].0;
    const fn row(model: ModelName, features: &'static str, words: &'static str) -> Beyond {
        Beyond { model, features, words, look: None }
    }
    [
        row(ModelName::Svm, body, "SVM with body frame"),
        row(ModelName::Boosted, body, "boosted trees"),
        row(ModelName::Lr, HISTORY_SET, "LR with memory"),
        Beyond {
            look: Some((3, Mark::Diamond)),
            ..row(ModelName::Boosted, HISTORY_SET, "boosted trees with memory")
        },
    ]
};

/// Models of learning curves. They are also trained on fewer tasks.
pub const CURVE_MODELS: [ModelName; 3] = [ModelName::SvmRbf, ModelName::Dt, ModelName::Lr];

/// Models that are also trained on other people. SVMs are excluded, because their training time
/// grows with the square of the number of rows.
pub const UNSEEN_MODELS: [ModelName; 2] = [ModelName::Dt, ModelName::Lr];

/// The hyper-parameters to try. Settings are ordered by C, then γ, or by depth, then leaf size. On
/// a tie, the first setting is chosen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct Grids {
    /// C of SVMs with radial basis functions.
    pub rbf_c: Vec<f64>,
    /// γ of SVMs with radial basis functions, per squared unit of standardised features.
    pub rbf_gamma: Vec<f64>,
    /// C of linear SVMs.
    pub linear_c: Vec<f64>,
    /// Maximum depth of trees; `None` for no limit.
    pub tree_depth: Vec<Option<usize>>,
    /// Minimum number of rows in a leaf.
    pub tree_leaf: Vec<usize>,
    /// C of logistic regression.
    pub logistic_c: Vec<f64>,
    /// Depth of boosted trees. The number of trees is chosen by the log loss on held-out rows.
    pub boosted_depth: Vec<usize>,
}

impl Default for Grids {
    /// The grids of the protocol.
    fn default() -> Self {
        Self {
            rbf_c: vec![0.1, 1.0, 10.0, 100.0],
            rbf_gamma: vec![0.01, 0.03, 0.1, 0.3],
            linear_c: vec![0.01, 0.1, 1.0, 10.0],
            tree_depth: vec![Some(2), Some(3), Some(4), Some(6), Some(8), None],
            tree_leaf: vec![1, 5, 10, 20],
            logistic_c: vec![1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2],
            boosted_depth: vec![2, 3],
        }
    }
}

/// Valid values of a hyper-parameter.
enum Rule {
    /// From 10⁻⁴ to 10³.
    Strength,
    /// Whole numbers from 1 to this maximum.
    UpTo(u64),
    /// Whole numbers from 1 to this maximum, in ascending order.
    Rising(u64),
}

/// Each field of [`Grids`] and its rule.
const RULES: [(&str, Rule); 7] = [
    ("rbf_c", Rule::Strength),
    ("rbf_gamma", Rule::Strength),
    ("linear_c", Rule::Strength),
    ("tree_depth", Rule::UpTo(64)),
    ("tree_leaf", Rule::Rising(1_000_000)),
    ("logistic_c", Rule::Strength),
    ("boosted_depth", Rule::UpTo(8)),
];

/// Maximum number of values of a hyper-parameter.
const MOST_VALUES: usize = 64;

impl Grids {
    /// The names of the hyper-parameters.
    pub fn names() -> impl Iterator<Item = &'static str> {
        RULES.iter().map(|(name, _)| *name)
    }

    fn values(&self) -> Value {
        let Ok(values) = serde_json::to_value(self) else { unreachable!("lists of numbers") };
        values
    }

    /// A copy of these grids in which `name` has the protocol's values.
    #[must_use]
    pub fn with_protocols(&self, name: &str) -> Self {
        let mut values = self.values();
        values[name] = Self::default().values()[name].take();
        let Ok(grids) = serde_json::from_value(values) else { unreachable!("fields of grids") };
        grids
    }

    /// Checks every value.
    ///
    /// # Errors
    /// [`Invalid`] with the name of the hyper-parameter that has no value, too many values, a
    /// repeated value, a value out of range, or values out of order.
    pub(super) fn check(&self) -> Result<(), Invalid> {
        let all = self.values();
        for (name, rule) in &RULES {
            let values = all[*name].as_array().map_or(&[][..], Vec::as_slice);
            if !(1..=MOST_VALUES).contains(&values.len()) {
                let expected = format!("1 to {MOST_VALUES} values");
                return Err(Invalid::new(*name, expected, values.len()));
            }
            if let Some(i) = (1..values.len()).find(|&i| values[..i].contains(&values[i])) {
                let field = format!("{name}[{i}]");
                return Err(Invalid::new(field, "a further value", "one given before"));
            }
            rule.check(name, values)?;
        }
        Ok(())
    }
}

impl Rule {
    fn check(&self, name: &str, values: &[Value]) -> Result<(), Invalid> {
        let counts: Vec<u64> = values.iter().filter_map(Value::as_u64).collect();
        match self {
            Self::Strength => {
                for (i, value) in values.iter().enumerate() {
                    // Infinity and NaN are null in JSON.
                    let (field, value) =
                        (format!("{name}[{i}]"), value.as_f64().unwrap_or(f64::NAN));
                    positive(&field, value)?;
                    if !(1e-4..=1e3).contains(&value) {
                        return Err(Invalid::new(field, "a number from 0.0001 to 1000", value));
                    }
                }
                Ok(())
            }
            Self::UpTo(most) | Self::Rising(most) => {
                if let Some(count) = counts.iter().find(|count| !(1..=*most).contains(*count)) {
                    let expected = format!("whole numbers from 1 to {most}");
                    return Err(Invalid::new(name, expected, count));
                }
                if matches!(self, Self::Rising(_)) && !counts.is_sorted() {
                    let found = format!("{counts:?}");
                    return Err(Invalid::new(name, "whole numbers in rising order", found));
                }
                Ok(())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_model_has_the_row_with_its_word() {
        for model in ModelName::EVERY {
            assert_eq!(serde_json::to_value(model).unwrap(), model.word());
            assert_eq!(ModelName::of_word(model.word()), Some(model));
            assert_eq!(model.training().is_some(), !model.row().grid.is_empty(), "{model:?}");
        }
    }

    #[test]
    fn every_hyper_parameter_has_a_rule_and_is_in_the_methods() {
        let grids = Grids::default().values();
        let fields: Vec<&str> = grids.as_object().unwrap().keys().map(String::as_str).collect();
        let mut names: Vec<&str> = Grids::names().collect();
        names.sort_unstable();
        assert_eq!(names, fields);
        for name in names {
            let is_told = |model: &ModelRow| model.grid.contains(&format!("{{{name}}}"));
            assert!(MODELS.iter().any(is_told), "{name}");
        }
    }

    #[test]
    fn a_grid_is_that_of_the_protocol_again() {
        let asked = Grids { rbf_c: vec![2.0], tree_depth: vec![None], ..Grids::default() };
        let once = asked.with_protocols("tree_depth");
        assert_eq!(once, Grids { rbf_c: vec![2.0], ..Grids::default() });
        assert_eq!(once.with_protocols("rbf_c"), Grids::default());
    }
}
