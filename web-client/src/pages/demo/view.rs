//! The parts of the page around the demonstration's canvas.

use super::driver::Driver;
use super::score::Score;
use super::{CANVAS, Demo, Msg, Stage, is_offered, offered};
use crate::pages::moment::{self, metres, select, switch};
use crate::pages::parts::{self, alert, button, cell, fact};
use crate::view::{self, el, subscripted};
use sidestep::trial_view::style::Palette;

type Node = view::Node<Msg>;

/// Shortcut keys of the layers, in order.
const KEYS: [(&str, &str); 9] = [
    ("Digit1", "1"),
    ("Digit2", "2"),
    ("Digit3", "3"),
    ("Digit4", "4"),
    ("Digit5", "5"),
    ("Digit6", "6"),
    ("Digit7", "7"),
    ("Digit8", "8"),
    ("Digit9", "9"),
];

/// The layer that a key shows or hides, if any.
pub(super) fn layer_of(code: &str) -> Option<usize> {
    let place = KEYS.iter().position(|(known, _)| *known == code)?;
    offered().nth(place)
}

fn key_of(layer: usize) -> Option<&'static str> {
    let place = offered().position(|place| place == layer)?;
    KEYS.get(place).map(|(_, printed)| *printed)
}

pub(super) fn page(demo: &Demo) -> Node {
    el("main").class("replay demo").children([scene(demo), panel(demo), course(demo)])
}

fn scene(demo: &Demo) -> Node {
    let canvas = el("canvas")
        .attrs(&[("id", CANVAS), ("role", "img")])
        .attr("aria-label", "The scene seen from above, with the chosen layers")
        .test_id("demo");
    let picture = el("div")
        .class("seen")
        .child(canvas)
        .children(demo.shows_legend.then(|| {
            let mut items = demo.playback.legend(&demo.view);
            items.push(Score::legend());
            moment::legend(items, &demo.view, false)
        }))
        .children(card(demo));
    let switches = moment::switches(&demo.view, is_offered, key_of, Msg::Layer);
    el("section").class("view").attr("aria-label", "Scene").child(switches).child(picture)
}

/// Instructions that are shown before and after a scene.
fn card(demo: &Demo) -> Option<Node> {
    let start = |words: &str| {
        button("start", Msg::Start)
            .class("primary")
            .text(words.to_owned())
            .child(el("kbd").text("Space"))
    };
    let is_first = demo.points.is_empty();
    let card = match (&demo.stage, demo.driver) {
        (Stage::Driving(_), _) => return None,
        (Stage::Ready, Driver::You) if is_first => el("div")
            .child(el("h2").text("Keep clear of the red robot. It will not."))
            .child(
                el("p")
                    .child(el("kbd").text("←"))
                    .child(el("kbd").text("→"))
                    .text(" turn your blue arrow. ")
                    .text("The nearer you pass, the more points. Touch the red disc, and they are gone."),
            )
            .child(el("p").class("touch-only").text(
                "This device has no keyboard to steer with: watch a synthetic driver instead.",
            ))
            .child(start("Drive")),
        (Stage::Ready, Driver::You) => el("div").child(start("Drive")),
        (Stage::Ready, Driver::Synthetic(number)) => el("div")
            .child(el("h2").text(format!("Synthetic driver {number}")))
            .child(el("p").text(
                "A simulated person drives. The model knows nothing about them yet and learns from \
                 every scene.",
            ))
            .child(start("Watch")),
        (Stage::Over(_), driver) => {
            let closest = metres(demo.score.closest_m, 2);
            let (words, how) = if demo.score.is_caught {
                ("Caught".to_owned(), format!("{closest} at the closest, inside the danger zone."))
            } else {
                (parts::count(demo.score.points, "point"), format!("{closest} at the closest."))
            };
            let next = (driver == Driver::You).then(|| start("Next scene"));
            let rest = next.is_none().then(|| el("p").class("quiet").text("The next scene follows."));
            el("div")
                .child(el("h2").text(words))
                .child(el("p").text(how))
                .children(next)
                .children(rest)
        }
    };
    Some(card.class("notice invitation").attr("role", "status").test_id("card"))
}

fn panel(demo: &Demo) -> Node {
    let playback = &demo.playback;
    let now = playback.now();
    let heading = parts::heading(&format!("Scene {}", demo.index + 1))
        .child(el("small").text(format!("t = {:.1} s", now.time_s)));
    let human = demo.safety.human_level(&now.state);
    let named = |words: &str, below: &str, value: String| {
        let name = el("dt").text(words).child(subscripted("span", "V", below));
        el("div").child(name).child(el("dd").text(value))
    };
    let facts = el("dl").class("facts").children([
        fact("points", demo.score.points.to_string()).test_id("points"),
        fact("distance", metres(now.state.distance_m(), 2)),
        fact("closest", metres(demo.score.closest_m, 2)),
        named("safety ", "HR", metres(human, 2)),
    ]);
    let colours = [("paper", "as in the paper"), ("safe", "for all eyes, hatched")]
        .map(|(value, words)| (value.to_owned(), words.to_owned()));
    let palette = match demo.view.style.palette {
        Palette::Paper => "paper",
        Palette::Safe => "safe",
    };
    let probabilities = playback.probabilities();
    // The panel scrolls, so it must be reachable by keyboard.
    el("aside")
        .class("panel")
        .attrs(&[("tabindex", "0"), ("aria-label", "Numbers at this moment")])
        .child(heading)
        .children(demo.misread.as_deref().map(|why| alert("misread", why)))
        .child(facts)
        .child(model(demo))
        .children(probabilities.map(|probabilities| moment::inputs::<Msg>(probabilities)))
        .children(probabilities.map(|_| moment::regions(playback, &demo.view, None)))
        .child(select("colours", "Colours", colours.into(), palette, Msg::Colours))
}

/// The model of the driver, and how well it predicted.
fn model(demo: &Demo) -> Node {
    let whose = if demo.driver == Driver::You { "Your model" } else { "Their model" };
    let scenes = demo.model.scenes();
    let words = match (demo.model.is_fitted, scenes) {
        (true, _) => {
            format!("Logistic regression (B_hrd), trained on {}.", parts::count(scenes, "scene"))
        }
        (false, 0) => {
            "No scene to learn from yet: it expects three straight steps in five.".to_owned()
        }
        (false, _) => format!(
            "Frequencies of the inputs of {}: there was only one kind of input.",
            parts::count(scenes, "scene")
        ),
    };
    let mut section = el("section")
        .test_id("model")
        .child(el("h2").text(whose))
        .child(el("p").class("quiet").text(words));
    if let Some(last) = demo.model.foreseen.last() {
        let foreseen = format!("{:.0} %", 100.0 * last.inputs);
        section = section.child(
            el("dl")
                .class("facts")
                .child(fact("inputs predicted right in the last scene", foreseen)),
        );
    }
    let inside = demo.model.inside();
    if !inside.is_empty() {
        let cells = inside.iter().map(|share| cell(format!("{:.0} %", 100.0 * share)));
        let names = (1..=inside.len()).map(|set| {
            el("th").attr("scope", "col").child(subscripted("span", "F", &set.to_string()))
        });
        let table = el("table")
            .class("inside")
            .test_id("inside")
            .child(el("thead").child(el("tr").children(names)))
            .child(el("tbody").child(el("tr").children(cells)));
        let ahead = format!("Futures that stayed inside, in {}:", parts::count(scenes, "scene"));
        section = section.child(el("p").class("quiet").text(ahead)).child(table);
    }
    section
}

/// The choice of the driver, and the points of every scene.
fn course(demo: &Demo) -> Node {
    let is_you = demo.driver == Driver::You;
    let other = demo.driver.another();
    let watch = switch("watch", !is_you, Msg::Drive(if is_you { other } else { demo.driver }));
    let mut controls = el("div")
        .class("controls")
        .child(switch("drive", is_you, Msg::Drive(Driver::You)).text("Drive yourself"))
        .child(watch.text("Watch a synthetic driver"));
    if !is_you {
        controls = controls
            .child(button("another", Msg::Drive(other)).class("plain").text("Another driver"));
    }
    if let Stage::Driving(driving) = &demo.stage {
        let (id, words, message) = match (is_you, driving.is_paused()) {
            (true, _) => ("give-up", "Give up", Msg::GiveUp),
            (false, true) => ("pause", "Go on", Msg::Pause),
            (false, false) => ("pause", "Pause", Msg::Pause),
        };
        controls = controls.child(button(id, message).class("plain").text(words));
    }
    controls =
        controls.child(switch("legend-switch", demo.shows_legend, Msg::Legend).text("legend"));
    let most = demo.points.iter().copied().max().unwrap_or(0).max(1);
    let bars = demo.points.iter().zip(1..).map(|(points, scene)| {
        let height = 100.0 * f64::from(*points) / f64::from(most);
        let words = format!("scene {scene}: {}", parts::count(points, "point"));
        let bar = el("i").class(if *points == 0 { "none" } else { "some" });
        el("li")
            .attr("title", words)
            .child(bar.attr("style", format!("height:{height:.0}%")))
            .child(el("span").text(points.to_string()))
    });
    let total: u32 = demo.points.iter().sum();
    let words = match demo.points.len() {
        0 => "No scene is over yet.".to_owned(),
        n => format!("{} in {}", parts::count(total, "point"), parts::count(n, "scene")),
    };
    el("section")
        .class("timeline")
        .attr("aria-label", "Scenes")
        .child(controls.child(el("span").class("legend").test_id("total").text(words)))
        .children((!demo.points.is_empty()).then(|| {
            el("ol")
                .class("points")
                .attrs(&[("aria-label", "Points of each scene"), ("tabindex", "0")])
                .children(bars)
        }))
        .child(
            el("p")
                .class("quiet")
                .text("Nothing is stored or sent. The model is lost when you leave."),
        )
}
