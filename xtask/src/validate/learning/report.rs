//! What the library's example `validate_learning` prints. Units and meanings are stated there.

use serde::Deserialize;
use serde_json::Value;

#[derive(Deserialize)]
pub(super) struct Report {
    pub(super) logistic: [Logistic; 2],
    pub(super) machines: [Machines; 2],
    pub(super) trees: [Trees; 2],
    pub(super) cells: Cells,
    pub(super) tables: Vec<Table>,
    pub(super) ranks: Ranks,
    pub(super) fingerprints: Fingerprints,
}

#[derive(Deserialize)]
pub(super) struct Logistic {
    pub(super) scale: f64,
    pub(super) newton: f64,
    pub(super) lbfgs: f64,
    pub(super) probability: f64,
    pub(super) probabilities: usize,
}

#[derive(Deserialize)]
pub(super) struct Machines {
    pub(super) rows: usize,
    pub(super) different: usize,
    pub(super) decision: f64,
}

#[derive(Deserialize)]
pub(super) struct Trees {
    pub(super) rows: usize,
    pub(super) flagged: usize,
    pub(super) ties: usize,
    pub(super) different_ties: usize,
    pub(super) different: usize,
    pub(super) share: f64,
}

#[derive(Deserialize)]
pub(super) struct Cells {
    pub(super) models: Vec<OfModel>,
    pub(super) different: Vec<Different>,
}

#[derive(Deserialize)]
pub(super) struct OfModel {
    pub(super) model: String,
    pub(super) cells: usize,
    pub(super) equal: usize,
}

#[derive(Deserialize)]
pub(super) struct Different {
    pub(super) model: String,
    pub(super) experiment: u8,
    pub(super) features: String,
    pub(super) participant: usize,
    pub(super) reference: Choice,
    pub(super) ours: Choice,
}

#[derive(Deserialize)]
pub(super) struct Choice {
    pub(super) hyperparameters: Value,
    pub(super) ours: Right,
    pub(super) scikit_learn: Right,
    pub(super) to_the_end: [Right; 2],
}

#[derive(Clone, Copy, Deserialize, PartialEq)]
pub(super) struct Right {
    pub(super) cv: usize,
    pub(super) test: usize,
}

#[derive(Deserialize)]
pub(super) struct Table {
    pub(super) name: String,
    pub(super) rows: Vec<Row>,
}

#[derive(Deserialize)]
pub(super) struct Row {
    pub(super) model: String,
    pub(super) experiment: u8,
    pub(super) ours: Vec<f64>,
    pub(super) reference: Vec<f64>,
}

#[derive(Deserialize)]
pub(super) struct Ranks {
    pub(super) compared: usize,
    pub(super) mann_whitney: f64,
    pub(super) wilcoxon: f64,
}

#[derive(Deserialize)]
pub(super) struct Fingerprints {
    pub(super) training: usize,
    pub(super) inference: usize,
    pub(super) features: usize,
}
