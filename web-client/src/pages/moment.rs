//! Parts for pages that show one instant of a trial: switches for layers, the legend, and the
//! numbers of the prediction.

use super::parts::{self, button, cell};
use crate::form::FieldValue;
use crate::view::{Node, drawn, el, subscripted, with_subscripts};
use sidestep::chart::{ColourStyle, LegendItem, fixed};
use sidestep::trial_view::Playback;
use sidestep::trial_view::layers::{LAYERS, Layer};
use sidestep::trial_view::style::{Palette, Sets};
use sidestep::trial_view::view::View;
use sidestep::vehicle::TurnInput;

/// A switch for each layer that `offered` accepts. For a layer's index in [`LAYERS`], `key` returns
/// the label of its key and `switched` returns the message of its switch.
pub(super) fn switches<M>(
    view: &View,
    offered: impl Fn(&Layer) -> bool,
    key: impl Fn(usize) -> Option<&'static str>,
    switched: impl Fn(usize) -> M,
) -> Node<M> {
    let offered = LAYERS.iter().enumerate().filter(|(_, layer)| offered(layer));
    let switches = offered.map(|(place, layer)| {
        let swatch = el("i").class(&format!("swatch {}", layer.swatch));
        let key = key(place).map_or_else(String::new, |key| format!(" (key {key})"));
        let is_on = view.shown[place];
        let button = switch(&format!("layer-{}", layer.name), is_on, switched(place))
            .attr("title", format!("{}{key}", layer.meaning))
            .child(swatch)
            .child(el("span").text(layer.label));
        let Some(below) = layer.level else { return button };
        button.child(subscripted("span", "V", below))
    });
    el("div")
        .class("switches")
        .attrs(&[("role", "group"), ("aria-label", "Layers")])
        .children(switches)
}

/// If the view asks for a step after the last of `steps` steps, shows the last step and returns a
/// notice.
pub(super) fn fit(view: &mut View, steps: usize) -> Option<String> {
    let Sets::Step(wanted) = view.style.sets else { return None };
    (wanted > steps).then(|| {
        view.style.sets = Sets::Step(steps);
        format!(
            "The link asks for the sets after step {wanted}, but predictions cover {steps} steps: showing those after \
             step {steps}."
        )
    })
}

/// A toggle button, which is on or off.
pub(super) fn switch<M>(test_id: &str, is_on: bool, message: M) -> Node<M> {
    button(test_id, message).class("switch").attr("aria-pressed", is_on)
}

/// Maximum number of layers whose legend fits in one column.
const ONE_COLUMN: usize = 6;

/// The legend of the picture. If `both`, it is the legend of two pictures and is placed below them.
/// Its width depends only on which layers are switched on and not on their content, so that the
/// picture beside it keeps its size while a trial loads.
pub(super) fn legend<M>(items: Vec<LegendItem>, view: &View, both: bool) -> Node<M> {
    let layers = view.shown.iter().filter(|shown| **shown).count();
    let place = match (both, layers > ONE_COLUMN) {
        (true, _) => "meaning below",
        (false, true) => "meaning wide",
        (false, false) => "meaning",
    };
    let items = items.into_iter().map(|item| {
        let sign = drawn(item.sign.element(ColourStyle::Properties)).attr("aria-hidden", "true");
        el("li").child(sign).child(with_subscripts("span", &item.text))
    });
    // In a low window the legend scrolls, so it must be reachable by keyboard.
    el("ul")
        .class(place)
        .attrs(&[("aria-label", "Legend"), ("tabindex", "0")])
        .test_id("legend")
        .children(items)
}

/// A selection list with its label. Each option has a value and a text.
pub(super) fn select<M: 'static>(
    id: &'static str,
    label: &str,
    options: Vec<(String, String)>,
    chosen: &str,
    then: fn(FieldValue) -> M,
) -> Node<M> {
    let option = |(value, words): (String, String)| {
        let is_chosen = value == chosen;
        el("option").attr("value", value).attr_if(is_chosen, "selected", "").text(words)
    };
    let select = el("select")
        .attr("id", id)
        .test_id(id)
        .on_input(then)
        .children(options.into_iter().map(option));
    el("div").class("pair").child(el("label").attr("for", id).text(label)).child(select)
}

/// The probabilities of the next inputs.
pub(super) fn inputs<M>(probabilities: &[(TurnInput, f64)]) -> Node<M> {
    let bars = probabilities.iter().map(|(input, p)| {
        let percent = 100.0 * p;
        let bar = el("i").attr("style", format!("width:{percent:.1}%"));
        el("div")
            .child(el("dt").text(input.word()))
            .child(el("dd").class("bar").attr("aria-hidden", "true").child(bar))
            .child(el("dd").text(format!("{percent:.0} %")))
    });
    el("section")
        .test_id("prediction")
        .child(el("h2").text("Next input"))
        .child(el("dl").class("bars").children(bars))
}

/// The predicted sets with their areas. If `chances` is given, its cells show how often the sets
/// contain the future.
pub(super) fn regions<M>(
    playback: &Playback,
    view: &View,
    chances: Option<Vec<Node<M>>>,
) -> Node<M> {
    let level = playback.sets().next().map_or("ε / rad s⁻¹", |set| set.level.column());
    let columns = ["set", level, "tube / m²", "of worst case", "p"];
    let columns = &columns[..if chances.is_some() { 5 } else { 4 }];
    let mut chances = chances.into_iter().flatten();
    let rows = playback.sets().zip(1..).map(|(set, j)| {
        let safe = if view.style.palette == Palette::Safe { "safe-" } else { "" };
        let swatch = el("i").class(&format!("swatch {safe}region-{j}"));
        let name = subscripted("span", "F", &j.to_string());
        el("tr")
            .child(el("th").attr("scope", "row").child(swatch).child(name))
            .child(cell(format!("{:.2}", set.level.value())))
            .child(cell(format!("{:.2}", set.area_m2)))
            .child(cell(format!("{:.0} %", 100.0 * playback.share_of_worst_case(&set))))
            .children(chances.next())
    });
    let table = parts::table(columns.iter().copied(), rows);
    let ahead = format!("next {} s", fixed(playback.seconds_ahead(), 1));
    el("section")
        .child(el("h2").text("Predicted sets").child(el("small").text(ahead)))
        .child(table.class("regions").test_id("regions"))
}

/// Formats a length in metres, with a typographic minus sign.
pub(super) fn metres(value: f64, decimals: usize) -> String {
    format!("{value:.decimals$} m").replace('-', "−")
}
