//! The report: one HTML file that needs nothing else, for whoever wants to know what was found.
//! Same results, same bytes.

mod chart;
mod compare;
mod figures;
mod findings;
mod html;
mod published;
mod tables;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod words;

pub(super) use published::SOURCE;
pub(super) use tables::{both_avoid, penalised};
pub(super) use words::model as model_word;

use super::Analysis;
use html::{count, details, escaped, grouped, listed};
use sidestep::comparison::fit::Grids;

/// The design tokens come first in the program's own style sheet, up to this.
const AFTER_TOKENS: &str = "*, *::before";

/// The document.
pub(super) fn html(analysis: &Analysis) -> String {
    let everything = include_str!("../../../static/style.css");
    let tokens = everything.split_once(AFTER_TOKENS).map_or("", |(tokens, _)| tokens);
    let style = include_str!("report/style.css");
    let body = [
        header(analysis),
        findings(analysis),
        cautions(analysis),
        papers_tables(analysis),
        pictures(analysis),
        numbers(analysis),
        method(analysis),
    ];
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\" xmlns=\"http://www.w3.org/1999/xhtml\">\n<head>\n\
         <meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <title>Do safety levels help to predict people?</title>\n\
         <style>\n{tokens}{style}</style>\n</head>\n<body>\n<main>\n{}</main>\n</body>\n</html>\n",
        body.concat()
    )
}

fn section(id: &str, title: &str, content: &str) -> String {
    format!(
        "<section aria-labelledby=\"{id}\">\n<h2 id=\"{id}\">{title}</h2>\n{content}</section>\n"
    )
}

fn header(analysis: &Analysis) -> String {
    let comparison = &analysis.comparison;
    let tested: usize = comparison.participants.iter().map(|of| of.test_trials.len()).sum();
    let steps: usize =
        comparison.participants.iter().map(|of| of.test_trials.len() * of.steps).sum();
    let who = count(analysis.people(), "person", "people");
    let facts = [
        (who, "each with models of their own".to_owned()),
        (
            count(analysis.context.trials, "trial", "trials"),
            format!("{} of them, each person’s last fifth, to test", grouped(tested)),
        ),
        (
            count(steps, "step", "steps"),
            format!("of {} s predicted by each kind of model", analysis.context.step_s),
        ),
        (
            count(comparison.cells.len(), "model", "models"),
            "of a person, feature set, kind and experiment".to_owned(),
        ),
    ];
    let facts: String = facts
        .iter()
        .map(|(number, what)| format!("<li><b>{number}</b><span>{what}</span></li>\n"))
        .collect();
    let banner = analysis.synthetic.as_deref().map_or_else(String::new, |why| {
        format!(
            "<aside class=\"banner\" role=\"note\"><b>Synthetic data: nothing here is about \
             people.</b> The trials were driven by computed participants (known from: {}). What is \
             found says how well models recover a program’s rules, and can rehearse an analysis, \
             no more.</aside>\n",
            escaped(why)
        )
    });
    let left_out = if analysis.exclusions.is_empty() {
        "<p class=\"quiet\">Nobody was left out.</p>\n".to_owned()
    } else {
        let who = count(analysis.exclusions.len(), "person was", "people were");
        let list = tables::exclusions(analysis);
        format!("<aside class=\"left-out\" role=\"note\"><b>{who} left out:</b>\n{list}</aside>\n")
    };
    format!(
        "<header>\n<p class=\"kicker\">Sidestep · the comparison of Shih (2019) on these data</p>\n\
         <h1>Do safety levels help to predict people?</h1>\n\
         <p class=\"lead\">People steered a vehicle past a robot that does not give way. Models \
         predict from the situation which input a person holds (experiment I: right, straight or \
         left) or whether they turn at all (experiment II). Some know only the distance \
         <i>d</i>; others also the safety levels <i>V</i><sub>HR</sub> (<i>h</i>, the human’s) and \
         <i>V</i><sub>RH</sub> (<i>r</i>, the robot’s): how near a collision would come if the \
         other side forced it.</p>\n{banner}<ul class=\"facts\">\n{facts}</ul>\n{left_out}</header>\n"
    )
}

fn findings(analysis: &Analysis) -> String {
    let one = |finding: &findings::Finding| {
        format!(
            "<li>\n<p class=\"headline\"><span class=\"verdict {}\">{}</span> {}</p>\n\
             <div class=\"body\">{}</div>\n</li>\n",
            finding.verdict.class(),
            finding.verdict.word(),
            finding.headline,
            finding.body
        )
    };
    let all: String = findings::findings(analysis).iter().map(one).collect();
    let note = "<p class=\"quiet\"><b>shown</b>: p &lt; 0.05 in the paired Wilcoxon test over \
                people, two-sided, after Holm’s correction. <b>A hint only</b>: p &lt; 0.05 before \
                correction. “No difference was shown” does not mean that there is none.</p>\n";
    let gains = figures::gains::figure_of(analysis);
    section(
        "found",
        "What was found",
        &format!("{note}<ol class=\"findings\">\n{all}</ol>\n{gains}"),
    )
}

fn papers_tables(analysis: &Analysis) -> String {
    let note = format!(
        "<p>In grey the numbers of the paper: {SOURCE}, Tables I and II, with other people and \
         scenes. <i>B</i><sub>hrd</sub> has both safety levels and the distance beside the \
         geometry, <i>B</i><sub>d</sub> the distance alone, the others what their letters say. \
         SVM: support vector machine with the kernel that did better in cross-validation; DT: \
         decision tree; LR: logistic regression.</p>\n"
    );
    let tables = [tables::accuracy(analysis), tables::distances(analysis)].concat();
    section("tables", "The paper’s tables for these data", &format!("{note}{tables}"))
}

fn pictures(analysis: &Analysis) -> String {
    let figures = [
        figures::accuracy::accuracies(analysis),
        figures::accuracy::distances(analysis),
        figures::decisions::figure_of(analysis),
        figures::rollouts::figure_of(analysis),
        figures::calibration::figure_of(analysis),
        figures::confusion::figure_of(analysis),
    ];
    section("pictures", "Pictures", &figures.concat())
}

fn numbers(analysis: &Analysis) -> String {
    let leakage = tables::leakage(analysis);
    let tests = tables::tests(analysis);
    let ablation = tables::ablation(analysis);
    section("numbers", "Ablation and tests", &format!("{ablation}{leakage}{tests}"))
}

/// What not to conclude.
fn cautions(analysis: &Analysis) -> String {
    let synthetic = if analysis.synthetic.is_some() {
        "<li>Anything about people: the data are synthetic.</li>\n"
    } else {
        ""
    };
    let content = format!(
        "<ul class=\"cautions\">\n{synthetic}\
         <li>That people compute safety levels. A feature that helps a model may stand for \
         something simpler, such as the side on which the robot is: see the body frame.</li>\n\
         <li>That there is no effect, where none was shown: look at the interval, which says what \
         gains are still compatible with the data.</li>\n\
         <li>That a model predicts somebody new: each was trained on the first four fifths of a \
         person’s own trials and tested on the last, so that habits count, and so does what they \
         learned on the way.</li>\n\
         <li>That an accuracy is high or low by itself: most steps are straight ones, and inputs \
         are held for long. Compare with the commonest input and with holding the last one.</li>\n\
         <li>That two sets differ because their tests do: one below 0.05 and the other above is no \
         difference between them.</li>\n</ul>\n"
    );
    section("not", "What not to conclude", &content)
}

fn method(analysis: &Analysis) -> String {
    let grids = Grids::default();
    let depth = |depth: &Option<usize>| depth.map_or("any".to_owned(), |depth| depth.to_string());
    let depths: Vec<String> = grids.tree_depth.iter().map(depth).collect();
    let content = format!(
        "<p><b>Split.</b> Only tasks count. A person’s last fifth of the trials tests; the rest \
         trains. Hyper-parameters are chosen by five-fold cross-validation over whole trials \
         (a person’s trials are dealt to the folds in turn, so that no trial is in two), features are standardised \
         within the fold, the first of equals in the order of the grid is taken, and the model is \
         trained anew on all training trials. Nothing is random: there is no seed.</p>\n\
         <p><b>Grids.</b> SVM with radial basis functions: C {rbf_c} and γ {rbf_gamma}; linear SVM: \
         C {linear_c}; decision tree: depth {depth}, at least {leaf} rows a leaf; logistic \
         regression: C {logistic_c}; boosted trees, in roll-outs only: depth {boosted}. \
         Probabilities of the SVM are calibrated on held-out folds (Platt), those of the tree \
         smoothed (Laplace).</p>\n\
         <p><b>Features.</b> <i>B</i>: |Δx|, |Δy| and Δψ in the world’s frame, cos Δψ and sin Δψ; \
         with <i>V</i><sub>HR</sub> (h), <i>V</i><sub>RH</sub> (r) and the distance (d), m. A safety \
         level is how far the other side can be kept from the danger zone’s edge ({radius} m) when \
         it does its worst; at 0 or below a collision can be forced.</p>\n\
         <p><b>Measures.</b> Accuracy: share of steps where the predicted class was the person’s. \
         <i>D</i><sub>start</sub>, <i>D</i><sub>end</sub>: distance of the first and last step of \
         avoidance of model and person. Log loss: mean −ln of the probability of what was done; 0 \
         is perfect. Expected calibration error: over ten bins of the highest probability, the mean \
         distance of that probability from the share right.</p>\n\
         <p><b>Tests.</b> Two-sided; exact up to 60 numbers. The paired Wilcoxon test over people \
         fits this design. The Mann–Whitney tests are shown because the paper’s claims rest on \
         such; over people it ignores the pairing, over trials it takes trials of a person for \
         independent. Holm’s correction is over all tests of a metric. The interval of a gain holds \
         every shift that the paired test does not reject at 5 % (Hodges and Lehmann), without \
         correction.</p>\n",
        radius = analysis.context.radius_m,
        rbf_c = tried(&grids.rbf_c),
        rbf_gamma = tried(&grids.rbf_gamma),
        linear_c = tried(&grids.linear_c),
        depth = tried(&depths),
        leaf = tried(&grids.tree_leaf),
        logistic_c = tried(&grids.logistic_c),
        boosted = tried(&grids.boosted_depth),
    );
    let files = details(
        "The numbers behind this page",
        "<p>cells.csv (every model), table1.csv, table2.csv, tests.csv, ablation.csv, \
         calibration.csv, rollouts.csv, leakage.csv and predictions.csv beside this file; tables.tex \
         for a paper; models/ has every predictor.</p>\n",
    );
    section("method", "How it was done", &format!("{content}{files}"))
}

/// "0.1, 1 and 10".
fn tried<T: ToString>(values: &[T]) -> String {
    listed(&values.iter().map(T::to_string).collect::<Vec<_>>())
}
