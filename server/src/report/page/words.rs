//! What models, experiments and feature sets are called.

use sidestep::comparison::cell::{
    BODY_FRAME_SETS, Experiment, HISTORY_SET, ModelName, PAPERS_SETS,
};

/// As the paper writes it.
pub(in crate::report) fn model(model: ModelName) -> &'static str {
    match model {
        ModelName::Svm => "SVM",
        ModelName::SvmRbf => "SVM (RBF)",
        ModelName::SvmLinear => "SVM (linear)",
        ModelName::Dt => "DT",
        ModelName::Lr => "LR",
        ModelName::Boosted => "boosted trees",
    }
}

/// "SVM I".
pub(super) fn model_in(of: ModelName, experiment: Experiment) -> String {
    format!("{} {}", model(of), experiment.numeral())
}

/// In a sentence.
pub(super) fn model_in_full(model: ModelName) -> &'static str {
    match model {
        ModelName::Svm => "the support vector machine",
        ModelName::SvmRbf => "the support vector machine with radial basis functions",
        ModelName::SvmLinear => "the linear support vector machine",
        ModelName::Dt => "the decision tree",
        ModelName::Lr => "logistic regression",
        ModelName::Boosted => "gradient-boosted trees",
    }
}

/// What is predicted.
pub(super) fn question(experiment: Experiment) -> &'static str {
    match experiment {
        Experiment::TurnDirection => "right, straight or left",
        Experiment::Avoidance => "turn or not",
    }
}

/// A class.
pub(super) fn class(experiment: Experiment, class: i8) -> &'static str {
    match (experiment, class) {
        (_, 0) => "straight",
        (Experiment::Avoidance, _) => "turn",
        (Experiment::TurnDirection, ..0) => "right",
        (Experiment::TurnDirection, _) => "left",
    }
}

/// "better in 4 of 6 comparisons", or "better in 3 and worse in 1 of 6 comparisons".
pub(super) fn either(first: (usize, &str), second: (usize, &str), of: usize) -> String {
    match (first, second) {
        ((n, way), (0, _)) | ((0, _), (n, way)) => format!("{way} in {n} of {of} comparisons"),
        ((n, way), (m, other)) => format!("{way} in {n} and {other} in {m} of {of} comparisons"),
    }
}

/// A feature set as HTML: B with its letters, or the name that somebody gave it.
pub(super) fn set(name: &str) -> String {
    let known = BODY_FRAME_SETS.map(|(set, _)| set);
    if !PAPERS_SETS.iter().chain(&known).chain(&[HISTORY_SET]).any(|set| *set == name) {
        return format!("<code>{name}</code>");
    }
    let (name, memory) =
        name.strip_suffix("_history").map_or((name, ""), |name| (name, " + memory"));
    let (letters, body) = parts(name);
    let body = if body { " + body" } else { "" };
    format!("<i>B</i><sub>{letters}</sub>{body}{memory}")
}

/// Its letters, and whether the robot's position in the human's body frame is in it.
pub(super) fn parts(name: &str) -> (&str, bool) {
    name.strip_suffix("_body").map_or((name, false), |letters| (letters, true))
}
