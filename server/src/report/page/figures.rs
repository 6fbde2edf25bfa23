//! What is drawn.

pub(super) mod accuracy;
pub(super) mod calibration;
pub(super) mod confusion;
pub(super) mod decisions;
pub(super) mod gains;
pub(super) mod rollouts;

use super::chart::Mark;
use sidestep::comparison::cell::ModelName;

/// The mark of a model, besides its colour.
fn mark(model: ModelName) -> Mark {
    match model {
        ModelName::Svm | ModelName::SvmRbf | ModelName::SvmLinear => Mark::Circle,
        ModelName::Dt | ModelName::Boosted => Mark::Square,
        ModelName::Lr => Mark::Triangle,
    }
}

/// Its sign in legends.
fn sign(model: ModelName) -> &'static str {
    match model {
        ModelName::Svm | ModelName::SvmRbf | ModelName::SvmLinear => {
            "<line class=\"curve svm\" x1=\"0\" y1=\"6\" x2=\"26\" y2=\"6\"/>\
             <circle class=\"mark svm\" cx=\"13\" cy=\"6\" r=\"4\"/>"
        }
        ModelName::Dt | ModelName::Boosted => {
            "<line class=\"curve dt\" x1=\"0\" y1=\"6\" x2=\"26\" y2=\"6\"/>\
             <rect class=\"mark dt\" x=\"9.5\" y=\"2.5\" width=\"7\" height=\"7\"/>"
        }
        ModelName::Lr => {
            "<line class=\"curve lr\" x1=\"0\" y1=\"6\" x2=\"26\" y2=\"6\"/>\
             <polygon class=\"mark lr\" points=\"13,1 17.6,9 8.4,9\"/>"
        }
    }
}
