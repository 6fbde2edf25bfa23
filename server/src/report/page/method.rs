//! How the comparison was done.

use super::html::{details, listed};
use super::section;
use sidestep::comparison::Analysis;
use sidestep::comparison::cell::{BODY_FRAME_SETS, ModelName, PAPERS_SETS};
use sidestep::comparison::fit::Grids;
use sidestep::vehicle::VehicleModel;

/// The section.
pub(super) fn section_of(analysis: &Analysis) -> String {
    let content = format!(
        "<p><b>Split.</b> Only tasks count. Each person’s last 20 % of trials is the test set; the rest is the \
         training set. Hyper-parameters are chosen by five-fold cross-validation over whole trials \
         (a person’s trials are dealt to the folds in turn, so that no trial is in two), features are standardised \
         within the fold, the first of equals in the order of the grid is taken, and the model is \
         trained anew on all training trials. Nothing is random: there is no seed.</p>\n\
         {grids}\
         <p><b>Features.</b> <i>B</i>: |Δx|, |Δy| and Δψ in the world’s frame, cos Δψ and sin Δψ; \
         with <i>V</i><sub>HR</sub> (h), <i>V</i><sub>RH</sub> (r) and the distance (d), m. A safety \
         level is the distance from the danger zone’s edge ({radius} m from the robot’s centre) that \
         can be kept against the worst the other side can do; at 0 or below a collision can be forced. They are those of these vehicles: \
         {vehicles}.</p>\n\
         {own}\
         <p><b>Measures.</b> Accuracy: share of steps where the predicted class was the person’s. \
         <i>D</i><sub>start</sub>, <i>D</i><sub>end</sub>: distance of the first and last step of \
         avoidance of model and person. Log loss: mean −ln of the probability of what was done; 0 \
         is perfect. Expected calibration error: over ten bins of the highest probability, the mean \
         distance of that probability from the share right.</p>\n\
         <p><b>Tests.</b> Two-sided; exact up to 60 numbers. The paired Wilcoxon test over people \
         fits this design. The Mann–Whitney tests are shown because the paper’s claims rest on \
         such; over people it ignores the pairing, over trials it takes trials of a person for \
         independent. Holm’s correction is over all tests of a metric that are in tests.csv. Three \
         comparisons are in beside.csv, each a family of six tests of its own with its own \
         correction: body frame over safety levels, safety levels added to the body frame, and \
         models over the commonest input. The typical gain is the median of the means of all pairs of people’s gains (Hodges and Lehmann); its interval holds every shift that the paired test does not \
         reject at 5 %, without correction.</p>\n",
        grids = grids(&analysis.settings.grids) + &at_the_end(analysis),
        radius = analysis.data.scene.danger_radius_m,
        vehicles = vehicles(analysis),
        own = own_sets(analysis),
    );
    section("method", "How it was done", &format!("{content}{}", files(analysis)))
}

/// Whose safety levels are computed.
fn vehicles(analysis: &Analysis) -> String {
    let one = |who: &str, vehicle: &VehicleModel| {
        format!("the {who} {} m/s and ±{} rad/s", vehicle.speed_mps, vehicle.turn_rate_radps)
    };
    let scene = &analysis.data.scene;
    [one("human", &scene.human), one("robot", &scene.robot)].join(", ")
}

/// The grids that were tried; what is not the protocol's is marked.
fn grids(used: &Grids) -> String {
    let protocol = Grids::default();
    let depths = |grids: &Grids| -> Vec<String> {
        let one = |depth: &Option<usize>| depth.map_or("any".to_owned(), |depth| depth.to_string());
        grids.tree_depth.iter().map(one).collect()
    };
    format!(
        "<p><b>Grids.</b> SVM with radial basis functions: C {rbf_c} and γ {rbf_gamma}; linear SVM: \
         C {linear_c}; decision tree: depth {depth}, at least {leaf} rows a leaf; logistic \
         regression: C {logistic_c}; boosted trees, in roll-outs only: depth {boosted}. {whose} \
         Probabilities of the SVM are calibrated on held-out folds (Platt), those of the tree \
         smoothed (Laplace).</p>\n",
        rbf_c = tried(&used.rbf_c, &protocol.rbf_c),
        rbf_gamma = tried(&used.rbf_gamma, &protocol.rbf_gamma),
        linear_c = tried(&used.linear_c, &protocol.linear_c),
        depth = tried(&depths(used), &depths(&protocol)),
        leaf = tried(&used.tree_leaf, &protocol.tree_leaf),
        logistic_c = tried(&used.logistic_c, &protocol.logistic_c),
        boosted = tried(&used.boosted_depth, &protocol.boosted_depth),
        whose = if *used == protocol {
            "These are the protocol’s."
        } else {
            "<b>Not all are the protocol’s</b>: numbers are not to be compared with those of other \
             grids."
        },
    )
}

/// The models whose C is often the greatest that was tried, so that a greater one may do better.
fn at_the_end(analysis: &Analysis) -> String {
    let edges = analysis.findings.grid_edges.iter().map(|edge| {
        let name = match edge.model {
            ModelName::SvmRbf => "SVMs with radial basis functions",
            ModelName::SvmLinear => "linear SVMs",
            _ => "logistic regressions",
        };
        format!("C = {} for {} of {} {name}", edge.greatest, edge.chosen, edge.of)
    });
    let edges: Vec<String> = edges.collect();
    if edges.is_empty() {
        return String::new();
    }
    format!(
        "<p>Often the greatest C did best: {}. A grid that goes further may do better still.</p>\n",
        listed(&edges)
    )
}

/// "0.1, 1 and 10", and the protocol's where these are others.
fn tried<T: ToString + PartialEq>(used: &[T], protocol: &[T]) -> String {
    let said = |values: &[T]| listed(&values.iter().map(T::to_string).collect::<Vec<_>>());
    if used == protocol {
        return said(used);
    }
    format!("<b>{}</b> (the protocol: {})", said(used), said(protocol))
}

/// What is in the sets that somebody added.
fn own_sets(analysis: &Analysis) -> String {
    let known = |name: &str| {
        PAPERS_SETS.contains(&name) || BODY_FRAME_SETS.iter().any(|(set, _)| *set == name)
    };
    let own = analysis.settings.sets.iter().filter(|set| !known(&set.name));
    let one = |name: &str, features: Vec<&str>| {
        let features: Vec<String> =
            features.iter().map(|feature| format!("<code>{feature}</code>")).collect();
        format!("<li><code>{name}</code>: {}</li>\n", listed(&features))
    };
    let all: String = own
        .map(|set| one(&set.name, set.features.features().map(|feature| feature.name).collect()))
        .collect();
    if all.is_empty() {
        return all;
    }
    format!(
        "<p>Sets that were added for this analysis; each is the whole list, <i>B</i> is not added to \
         it. They are described (ablation, dots for each feature set), and are in no family of \
         tests.</p>\n<ul>\n{all}</ul>\n"
    )
}

/// Which files lie beside the report.
fn files(analysis: &Analysis) -> String {
    let leakage = if analysis.leakage.is_empty() { "" } else { ", leakage.csv" };
    details(
        "The numbers behind this page",
        &format!(
            "<p>cells.csv (every model of the comparison), table1.csv, table2.csv, tests.csv, \
             beside.csv, ablation.csv, calibration.csv, rollouts.csv{leakage} and predictions.csv beside this \
             file; tables.tex for a paper; models/ has every predictor of the comparison. Boosted \
             trees and models with a memory, which are in the roll-outs only, are not kept.</p>\n"
        ),
    )
}
