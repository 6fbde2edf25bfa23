//! The cells that differ, with what each setting gets right, and why.

use super::report::{Choice, Different, Right};
use crate::validate::words::head;

/// Why a cell differs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Why {
    /// One setting, and the reference's solver stops before its optimum; taken to the end it
    /// predicts as many test rows right as we do.
    StopsEarly,
    /// Two settings that, taken to the end, are equally good in cross-validation: the first in
    /// the grid's order is taken.
    Tie,
    /// The same, but ours comes later in the grid: the mean of its folds is the higher one in the
    /// last digit.
    Rounding,
    /// Two settings, and taken to the end ours is the better one in cross-validation.
    OursIsBetter,
    /// Trees: splits that are equally good. Ours lies within what random choices among them give,
    /// in cross-validation and in the test.
    EqualSplits,
    /// None of these.
    Open,
}

impl Why {
    const ALL: [Self; 6] = [
        Self::StopsEarly,
        Self::Tie,
        Self::Rounding,
        Self::OursIsBetter,
        Self::EqualSplits,
        Self::Open,
    ];

    pub(super) fn of(cell: &Different) -> Self {
        let (theirs, ours) = (&cell.reference, &cell.ours);
        if cell.model == "dt" {
            let within = |choice: &Choice| {
                let [least, most] = choice.to_the_end;
                (least.cv..=most.cv).contains(&choice.ours.cv)
                    && (least.test..=most.test).contains(&choice.ours.test)
            };
            return if within(theirs) && within(ours) { Self::EqualSplits } else { Self::Open };
        }
        // The solver at its end gets what we get, under our setting.
        if ours.to_the_end[0].test != ours.ours.test {
            return Self::Open;
        }
        match ours.to_the_end[0].cv.cmp(&theirs.to_the_end[0].cv) {
            _ if same_setting(cell) => Self::StopsEarly,
            _ if ours.to_the_end[0].cv != ours.ours.cv => Self::Open,
            std::cmp::Ordering::Equal if first_in_grid(ours, theirs) => Self::Tie,
            std::cmp::Ordering::Equal => Self::Rounding,
            std::cmp::Ordering::Greater => Self::OursIsBetter,
            std::cmp::Ordering::Less => Self::Open,
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::StopsEarly => "stops early",
            Self::Tie => "tie",
            Self::Rounding => "tie, rounding",
            Self::OursIsBetter => "ours is better",
            Self::EqualSplits => "equal splits",
            Self::Open => "open",
        }
    }

    fn meaning(self) -> &'static str {
        match self {
            Self::StopsEarly => {
                "the same setting; the reference's solver stops before its optimum, and taken to the \
                 end it gets exactly as many test rows right as we do"
            }
            Self::Tie => {
                "two settings that are equally good in cross-validation once the solver is taken to \
                 the end; then the first of the grid counts. Under our setting it gets exactly as \
                 many rows right as we do"
            }
            Self::Rounding => {
                "the same, but ours comes later in the grid: of the means over folds, equal but for \
                 the order of their sum, it has the higher last digit. scikit-learn compares such \
                 means likewise"
            }
            Self::OursIsBetter => {
                "two settings, and taken to the end the solver finds ours the better one in \
                 cross-validation, and gets exactly as many rows right as we do"
            }
            Self::EqualSplits => {
                "trees: some splits are equally good, and the reference chooses among them by a \
                 random state. Under both settings our rows lie within what 50 random states give"
            }
            Self::Open => {
                "none of these explains it: our numbers are not quite the solver's at its end"
            }
        }
    }
}

/// Whether the one comes before the other in the order of the grid, in which C, then γ rise.
fn first_in_grid(one: &Choice, other: &Choice) -> bool {
    let place = |choice: &Choice| ["C", "gamma"].map(|name| choice.hyperparameters[name].as_f64());
    place(one) < place(other)
}

fn same_setting(cell: &Different) -> bool {
    setting(&cell.reference) == setting(&cell.ours)
}

/// How many cells differ for each reason, and what that means.
pub(super) fn reasons(cells: &[Different]) -> String {
    let mut rows = vec![head("why | meaning | cells", 2)];
    for why in Why::ALL {
        let count = cells.iter().filter(|cell| Why::of(cell) == why).count();
        if count > 0 {
            rows.push(format!("| {} | {} | {count} |", why.words(), why.meaning()));
        }
    }
    rows.join("\n")
}

/// Every cell that differs: a line for the setting that the reference chose and one for ours,
/// where they are not the same.
pub(super) fn list(cells: &[Different]) -> String {
    let titles = "cell | setting | chosen by | cv: reference | to the end | ours | test: reference \
                  | to the end | ours | why";
    let mut rows = vec![head(titles, 3)];
    for cell in cells {
        let name = format!(
            "{} {} {} {}",
            cell.model,
            if cell.experiment == 1 { "I" } else { "II" },
            cell.features,
            cell.participant
        );
        let why = Why::of(cell).words();
        let line = |name: &str, choice: &Choice, who: &str, why: &str| {
            let Choice { ours, scikit_learn, to_the_end: [least, most], .. } = choice;
            let range = |of: fn(&Right) -> usize| match (of(least), of(most)) {
                (least, most) if least == most => least.to_string(),
                (least, most) => format!("{least}–{most}"),
            };
            format!(
                "| {name} | {} | {who} | {} | {} | {} | {} | {} | {} | {why} |",
                setting(choice),
                scikit_learn.cv,
                range(|right| right.cv),
                ours.cv,
                scikit_learn.test,
                range(|right| right.test),
                ours.test,
            )
        };
        if same_setting(cell) {
            rows.push(line(&name, &cell.ours, "both", why));
        } else {
            rows.push(line(&name, &cell.reference, "reference", why));
            rows.push(line("", &cell.ours, "ours", ""));
        }
    }
    rows.join("\n")
}

/// `C 10, γ 0.03`.
fn setting(choice: &Choice) -> String {
    let words = |(name, value): (&String, &serde_json::Value)| {
        let name = match name.as_str() {
            "gamma" => "γ",
            "max_depth" => "depth",
            "min_samples_leaf" => "leaf",
            other => other,
        };
        // 1 and 1.0 are the same.
        let value = value.as_f64().map_or_else(|| "any".to_owned(), |number| number.to_string());
        format!("{name} {value}")
    };
    let entries = choice.hyperparameters.as_object().into_iter().flatten();
    entries.map(words).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn choice(c: f64, ours: [usize; 2], least: [usize; 2], most: [usize; 2]) -> Choice {
        let right = |[cv, test]: [usize; 2]| Right { cv, test };
        Choice {
            hyperparameters: json!({ "C": c }),
            ours: right(ours),
            scikit_learn: right([9, 9]),
            to_the_end: [right(least), right(most)],
        }
    }

    fn why(model: &str, reference: Choice, ours: Choice) -> Why {
        let (experiment, features, participant) = (1, "hrd".to_owned(), 0);
        Why::of(&Different {
            model: model.to_owned(),
            experiment,
            features,
            participant,
            reference,
            ours,
        })
    }

    #[test]
    fn reasons_follow_from_the_rows() {
        let of = |c, rows| choice(c, rows, rows, rows);
        assert_eq!(why("lr", of(1.0, [8, 4]), of(1.0, [8, 4])), Why::StopsEarly);
        assert_eq!(why("lr", of(10.0, [8, 5]), of(1.0, [8, 4])), Why::Tie);
        assert_eq!(why("lr", of(0.1, [8, 5]), of(1.0, [8, 4])), Why::Rounding);
        assert_eq!(why("lr", of(10.0, [7, 5]), of(1.0, [8, 4])), Why::OursIsBetter);
        assert_eq!(why("lr", of(10.0, [9, 5]), of(1.0, [8, 4])), Why::Open);
        let short = choice(1.0, [8, 4], [8, 5], [8, 5]);
        assert_eq!(why("lr", of(1.0, [8, 4]), short), Why::Open);
        let tree = || choice(1.0, [8, 4], [7, 4], [9, 5]);
        assert_eq!(why("dt", tree(), tree()), Why::EqualSplits);
        let outside = choice(1.0, [8, 6], [7, 4], [9, 5]);
        assert_eq!(why("dt", tree(), outside), Why::Open);
    }

    #[test]
    fn settings_are_short() {
        let mut choice = choice(10.0, [0, 0], [0, 0], [0, 0]);
        assert_eq!(setting(&choice), "C 10");
        choice.hyperparameters = json!({ "max_depth": null, "min_samples_leaf": 5 });
        assert_eq!(setting(&choice), "depth any, leaf 5");
    }
}
