//! The predicted sets, one per row, with widening, area, and how often the set contains the future.

use super::controls::said;
use super::{Explorer, Msg};
use crate::pages::coverage::{chance, worded};
use crate::pages::moment::select;
use crate::pages::parts::{alert, cell, count};
use crate::view::{self, drawn, el, subscripted};
use sidestep::chart::{ColourStyle, LegendItem, fixed, number};
use sidestep::trial_view::layers::{LAYERS, place};

type Node = view::Node<Msg>;

/// The table of sets, with an explanation of its numbers.
pub(super) fn section(explorer: &Explorer) -> Node {
    let sets = explorer.wanted.epsilon.len();
    let signs =
        place("shfrs").map(|it| (LAYERS[it].legend)(&explorer.playback, &explorer.view.style));
    let signs: Vec<LegendItem> = signs.unwrap_or_default();
    let rows = (0..sets).map(|j| row(explorer, j, signs.get(j)));
    let columns = ["set", "ε / rad s⁻¹", "here / m²", "mean / m²", "p"];
    let old = explorer.coverage.regions(sets).is_some_and(|(_, is_old)| is_old);
    let heads = columns.map(|words| el("th").attr("scope", "col").text(words));
    let table = el("table")
        .class(if old { "sets old" } else { "sets" })
        .test_id("sets-table")
        .child(el("thead").child(el("tr").children(heads)))
        .child(el("tbody").children(rows));
    el("section")
        .child(table)
        .children(said(explorer, &["eps", "epsilon"]))
        .child(counted(explorer))
}

fn row(explorer: &Explorer, j: usize, sign: Option<&LegendItem>) -> Node {
    let epsilon = explorer.wanted.epsilon[j];
    // A larger widening has no additional effect, because the prediction already admits every turn
    // rate.
    let most = 2.0 * explorer.drives.parameters.human.turn_rate_radps;
    let most = number(most.max(explorer.wanted.epsilon.iter().copied().fold(0.0, f64::max)));
    let name = format!("ε of set {}", j + 1);
    let is_wrong =
        explorer.complaint.as_ref().is_some_and(|it| it.field == format!("epsilon[{j}]"));
    let slider = el("input")
        .attrs(&[("type", "range"), ("min", "0"), ("max", &most), ("step", "0.01")])
        .attr("data-own-keys", "")
        .attr("value", epsilon)
        .attr("aria-label", name)
        .attr("aria-valuetext", format!("{} rad/s", number(epsilon)))
        .attr_if(is_wrong, "aria-invalid", "true")
        .test_id(&format!("epsilon-{j}"))
        .on_input(move |value| Msg::Epsilon(j, value));
    let shown = explorer.playback.sets().nth(j);
    let is_valid = explorer.is_valid() && !explorer.choice.is_refused();
    let wait = if is_valid { "…" } else { "—" };
    let area = shown.map_or_else(|| wait.to_owned(), |set| fixed(set.area_m2, 2));
    let regions = explorer.coverage.regions(explorer.wanted.epsilon.len());
    let (mean, p) = match regions {
        Some((regions, _)) => {
            let share = fixed(100.0 * regions.share_of_worst_case[j], 0);
            let worst = el("small").class("worst").text(format!("{share} % of worst"));
            let mean = cell(fixed(regions.mean_area_m2[j], 2)).child(worst);
            (mean, chance(regions.probabilities.inside[j]))
        }
        None if explorer.coverage.trouble.is_some() => (cell("—"), cell("—")),
        None => (cell(wait), cell(wait)),
    };
    let sign = sign
        .map(|item| drawn(item.sign.element(ColourStyle::Properties)).attr("aria-hidden", "true"));
    let head = el("th").attr("scope", "row").children(sign).child(subscripted(
        "span",
        "F",
        &(j + 1).to_string(),
    ));
    let widening =
        el("td").class("widening").child(slider).child(el("output").text(fixed(epsilon, 2)));
    el("tr")
        .child(head)
        .child(widening)
        .child(cell(area).test_id(&format!("area-{j}")))
        .child(mean)
        .child(p.test_id(&format!("p-{j}")))
}

/// The choice of the tasks over which p is counted, with the progress and a warning.
fn counted(explorer: &Explorer) -> Node {
    let coverage = &explorer.coverage;
    let all = explorer.drives.tasks.len();
    let unseen = explorer.choice.unseen(&explorer.drives).len();
    let options = vec![
        (
            "unseen".to_owned(),
            format!("the {} that did not train the predictor", count(unseen, "task")),
        ),
        ("all".to_owned(), format!("all {}", count(all, "task"))),
    ];
    let chosen = if coverage.counts_all { "all" } else { "unseen" };
    let regions = coverage.regions(explorer.wanted.epsilon.len());
    let words = match regions {
        Some((regions, _)) => {
            let p = &regions.probabilities;
            format!(
                "p is the share of {} windows of {} whose true future stays inside at every step, \
                 with {} % intervals.",
                p.windows,
                count(p.trajectories, "task"),
                number(100.0 * p.confidence)
            )
        }
        None if coverage.trouble.is_some() => String::new(),
        None if !explorer.is_valid() => "Nothing is predicted with these settings.".to_owned(),
        None => "Counting how often the true future stays inside…".to_owned(),
    };
    let is_done = coverage.done >= 1.0 || coverage.trouble.is_some() || !explorer.is_valid();
    let bar = el("progress")
        .attrs(&[("max", "1"), ("aria-label", "Tasks counted")])
        .attr("value", fixed(coverage.done, 3))
        .attr_if(is_done, "class", "done")
        .test_id("counted");
    let warning = (coverage.counts_all && unseen < all).then(|| {
        el("p").class("waiting").attr("role", "note").test_id("seen").text(
            "Some of these tasks trained the predictor: on them, its predictions look better than \
             they are.",
        )
    });
    el("div")
        .class("counted")
        .child(bar)
        .child(select("count", "p counts", options, chosen, Msg::Counted))
        .child(el("p").class("quiet").test_id("counted-words").text(words))
        .children(warning)
        .children(coverage.trouble.as_deref().map(|why| alert("not-counted", &worded(why))))
}
