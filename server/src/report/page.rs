//! The report: one HTML file that needs nothing else, for whoever wants to know what was found.
//! Same results, same bytes.

mod html;
mod method;
mod published;
mod words;
mod figures;
mod findings;
mod levels;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod tables;

pub(super) use published::SOURCE;
pub(super) use tables::{both_avoid, penalised};
pub(super) use words::model as model_word;

use html::{count, escaped, grouped, listed};
use sidestep::comparison::Analysis;

/// The design tokens come first in the program's own style sheet, up to this.
const AFTER_TOKENS: &str = "*, *::before";

/// The document.
pub(super) fn html(analysis: &Analysis) -> String {
    let everything = include_str!("../../../static/style.css");
    let tokens = everything.split_once(AFTER_TOKENS).map_or("", |(tokens, _)| tokens);
    let style = include_str!("page/style.css");
    let body = [
        header(analysis),
        findings(analysis),
        cautions(analysis),
        papers_tables(analysis),
        pictures(analysis),
        numbers(analysis),
        method::section_of(analysis),
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
    let counts = analysis.counts();
    let who = count(counts.participants, "person", "people");
    let facts = [
        (who, "each with models of their own".to_owned()),
        (
            count(analysis.data.trials, "trial", "trials"),
            format!("{} of them, each person’s last fifth, to test", grouped(counts.test_trials)),
        ),
        (
            count(counts.test_steps, "step", "steps"),
            format!("of {} s predicted by each kind of model", analysis.data.scene.step_s),
        ),
        (
            count(counts.models, "model", "models"),
            "of a person, feature set, kind and experiment".to_owned(),
        ),
    ];
    let facts: String = facts
        .iter()
        .map(|(number, what)| format!("<li><b>{number}</b><span>{what}</span></li>\n"))
        .collect();
    let banner = analysis.data.synthetic.as_deref().map_or_else(String::new, |why| {
        format!(
            "<aside class=\"banner\" role=\"note\"><b>Synthetic data: nothing here is about \
             people.</b> Trials were driven by computed participants ({}). What is \
             found says how well models recover a program’s rules, and can rehearse an analysis, \
             no more.</aside>\n",
            escaped(why)
        )
    });
    let doubts = levels::banner_of(analysis);
    let left_out = if analysis.data.exclusions.is_empty() {
        "<p class=\"quiet\">Nobody was excluded.</p>\n".to_owned()
    } else {
        let who = count(analysis.data.exclusions.len(), "person was", "people were");
        let list = tables::exclusions(analysis);
        format!("<aside class=\"left-out\" role=\"note\"><b>{who} excluded:</b>\n{list}</aside>\n")
    };
    let same = analysis.data.same_trials.iter().map(|name| escaped(name)).collect::<Vec<_>>();
    let same = if same.is_empty() {
        String::new()
    } else {
        format!(
            "<aside class=\"banner\" role=\"note\"><b>{} have the same trials as somebody \
             else</b>: {}. Where one person is in the data under several names, p-values and \
             intervals take them for several, and say too much.</aside>\n",
            count(same.len(), "person", "people"),
            listed(&same)
        )
    };
    let flagged = analysis.data.flagged.iter().map(|(flag, n)| format!("{n} {flag}"));
    let flagged = flagged.collect::<Vec<_>>();
    let flagged = if flagged.is_empty() {
        String::new()
    } else {
        format!(
            "<p class=\"quiet\">Among the trials that are compared some are flagged: {}.</p>\n",
            listed(&flagged)
        )
    };
    format!(
        "<header>\n<p class=\"kicker\">Sidestep · the comparison of Shih (2019) on these data</p>\n\
         <h1>Do safety levels help to predict people?</h1>\n\
         <p class=\"lead\">People steered a vehicle past a robot that does not give way. Models \
         predict from the situation which input a person holds (experiment I: right, straight or \
         left) or whether they turn at all (experiment II). All know the geometry: how far \
         apart the two are along each axis of the world, and the difference of their headings. \
         Some add only the distance <i>d</i> (“distance alone” below), others also the safety levels <i>V</i><sub>HR</sub> (<i>h</i>, the human’s) and \
         <i>V</i><sub>RH</sub> (<i>r</i>, the robot’s): how near a \
         collision would come if the other side forced it, in metres; at 0 or below it can. Beside \
         the paper, models are also told where the robot is in the human’s <i>body frame</i>: how \
         far ahead and how far to the left.</p>\n{banner}{doubts}{same}<ul class=\"facts\">\n{facts}</ul>\n{left_out}{flagged}</header>\n"
    )
}

fn findings(analysis: &Analysis) -> String {
    let one = |finding: &findings::Finding| {
        format!(
            "<li>\n<p class=\"headline\"><span class=\"verdict {}\">{}</span> {}</p>\n\
             <div class=\"body\">{}</div>\n</li>\n",
            findings::verdict_class(finding.verdict),
            findings::verdict_word(finding.verdict),
            finding.headline,
            finding.body
        )
    };
    let all: String = findings::findings(analysis).iter().map(one).collect();
    let note = "<p class=\"quiet\"><b>Shown</b>: p &lt; 0.05 in the paired Wilcoxon test over \
                people, two-sided, after Holm’s correction, in at least one of \
                the comparisons below the sentence. <b>A hint only</b>: in none after correction, \
                but in at least one before, which of six tests chance alone often gives. <b>No difference shown</b>: in none; that does not mean \
                that there is none. <b>Too few people</b>: with fewer than six the test cannot give \
                p &lt; 0.05, so that no p-values are shown.</p>\n";
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
    let synthetic = if analysis.data.synthetic.is_some() {
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
