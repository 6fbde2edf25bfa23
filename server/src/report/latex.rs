//! Tables I and II as LaTeX, laid out as in the paper; nothing but the standard classes is
//! needed.

use super::page::{SOURCE, both_avoid, model_word, penalised};
use sidestep::comparison::Analysis;
use sidestep::comparison::cell::{Experiment, ModelName, PAPERS_SETS};
use sidestep::comparison::tables::{Metric, are_best};
use sidestep::recording::Exclusion;

/// The document's part with both tables.
pub(super) fn tables(analysis: &Analysis) -> String {
    let first = format!(
        "% In the form of Tables I and II of {}; the numbers are of these data.\n",
        escaped(SOURCE)
    );
    let tables = [accuracy(analysis), distances(analysis)].join("\n");
    let own = if tables.contains("\\orcode") { OR_CODE } else { "" };
    format!("{first}{own}\n{tables}")
}

/// A text with everything escaped that LaTeX would read. A character that LaTeX's own fonts lack is
/// shown by an engine that knows Unicode, and by its number elsewhere ([`OR_CODE`]).
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\\' => out.push_str("\\textbackslash{}"),
            '{' | '}' | '$' | '&' | '#' | '_' | '%' => out.extend(['\\', c]),
            '~' => out.push_str("\\textasciitilde{}"),
            '^' => out.push_str("\\textasciicircum{}"),
            // In the standard fonts' first encoding these three are other characters.
            '<' | '>' | '|' => out.extend(['$', c, '$']),
            '≤' => out.push_str("$\\le$"),
            '≥' => out.push_str("$\\ge$"),
            '“' => out.push_str("``"),
            '”' => out.push_str("''"),
            '‘' => out.push('`'),
            '’' => out.push('\''),
            '–' => out.push_str("--"),
            '…' => out.push_str("\\ldots{}"),
            c if c.is_whitespace() || c.is_control() => out.push(' '),
            c if c.is_ascii() || is_accented(c) => out.push(c),
            c => out.push_str(&format!("\\orcode{{{c}}}{{{:04X}}}", u32::from(c))),
        }
    }
    out
}

/// Whether it is a letter of the Latin-1 block that every font has.
fn is_accented(c: char) -> bool {
    ('À'..='ÿ').contains(&c) && !"×÷ÐðÞþ".contains(c)
}

/// A character, or its number where the engine does not know Unicode.
const OR_CODE: &str =
    "\\providecommand{\\orcode}[2]{\\ifdefined\\Umathcode#1\\else\\texttt{U+#2}\\fi}\n";

fn row(name: &str, numbers: &[Option<f64>], less_is_better: bool) -> String {
    let entry = |(number, best): (&Option<f64>, bool)| match number {
        Some(number) if best => format!("\\textbf{{{number:.2}}}"),
        Some(number) => format!("{number:.2}"),
        None => "--".to_owned(),
    };
    let entries = numbers.iter().zip(are_best(numbers, less_is_better)).map(entry);
    let entries: Vec<String> = entries.collect();
    line(name, &entries)
}

fn line(name: &str, entries: &[String]) -> String {
    format!("  {name} & {} \\\\\n  \\hline\n", entries.join(" & "))
}

fn table(caption: &str, label: &str, rows: &str) -> String {
    let sets = PAPERS_SETS.map(|set| format!("$\\mathcal{{B}}_{{{set}}}$"));
    format!(
        "\\begin{{table}}[h]\n\\begin{{center}}\n  \\begin{{tabular}}{{ |c|c|c|c|c|c|c|c| }}\n  \
         \\hline\n{}{rows}  \\end{{tabular}}\n  \\caption{{{caption}}}\n  \\label{{{label}}}\n\
         \\end{{center}}\n\\end{{table}}\n",
        line("", &sets)
    )
}

/// Who it is about.
fn people(analysis: &Analysis) -> String {
    let n = analysis.comparison.participants.len();
    let who = if n == 1 { "1 participant".to_owned() } else { format!("{n} participants") };
    let mut said = format!("{who}, each with models of their own.");
    if let Some(why) = &analysis.data.synthetic {
        said.push_str(&format!(
            " \\textbf{{Synthetic data}} ({}): nothing here is about people.",
            escaped(why)
        ));
    }
    if !analysis.data.exclusions.is_empty() {
        let one =
            |who: &Exclusion| format!("{} ({})", escaped(&who.participant), escaped(&who.why()));
        let all: Vec<String> = analysis.data.exclusions.iter().map(one).collect();
        said.push_str(&format!(" Excluded: {}.", all.join("; ")));
    }
    said
}

fn accuracy(analysis: &Analysis) -> String {
    let mut rows = String::new();
    for experiment in Experiment::ALL {
        for model in ModelName::PAPERS {
            let numbers = analysis.comparison.accuracies(model, experiment, &PAPERS_SETS);
            let numbers: Vec<Option<f64>> = numbers.into_iter().map(Some).collect();
            let name = format!("{} ({})", model_word(model), experiment.numeral());
            rows.push_str(&row(&name, &numbers, false));
        }
    }
    let baseline = Experiment::ALL.map(|experiment| {
        let mean = analysis.baseline_accuracy(experiment);
        format!("{mean:.2} in experiment {}", experiment.numeral())
    });
    let caption = format!(
        "Accuracy on the test trials in per cent, mean over people; the best of each row in bold. \
         Always the person's commonest input: {}. {}",
        baseline.join(", "),
        people(analysis)
    );
    table(&caption, "tab:accuracy", &rows)
}

fn distances(analysis: &Analysis) -> String {
    let mut rows = String::new();
    for (metric, symbol) in [(Metric::Start, "$D_{s}$"), (Metric::End, "$D_{e}$")] {
        for model in ModelName::PAPERS {
            let found = PAPERS_SETS.map(|set| analysis.comparison.distances(model, set));
            let name = model_word(model);
            let all = found.each_ref().map(|of| penalised(of, metric));
            rows.push_str(&row(&format!("{name}, {symbol}"), &all, true));
            let both = found.each_ref().map(|of| both_avoid(of, metric));
            rows.push_str(&row(&format!("{name}, {symbol}, both"), &both, true));
            let n = found.each_ref().map(|of| of.both.to_string());
            rows.push_str(&line("$n$", &n));
        }
    }
    let caption = format!(
        "$D_{{start}}$ ($D_s$) and $D_{{end}}$ ($D_e$) in steps of {} s, mean over test trials; the \
         best of each row in bold. No avoidance counts as one past the last step or as step $-1$; \
         \\emph{{both}}: over the $n$ trials in which human and model avoid. {}",
        analysis.data.scene.step_s,
        people(analysis)
    );
    table(&caption, "tab:se_diff", &rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_of_a_text_is_a_command() {
        let text = escaped("\\input{x} 100% & $a_b^c# ~\n");
        let expected = "\\textbackslash{}input\\{x\\} 100\\% \\& \\$a\\_b\\textasciicircum{}c\\# \
                        \\textasciitilde{} ";
        assert_eq!(text, expected);
        assert_eq!(escaped("a<b|c ≥ 1…"), "a$<$b$|$c $\\ge$ 1\\ldots{}");
        assert_eq!(escaped("Zoë ψ"), "Zoë \\orcode{ψ}{03C8}");
    }
}
