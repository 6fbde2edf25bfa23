//! The view of the page.

use super::found::Found;
use super::{CANVAS, Msg, Reachability, keys};
use crate::form::FieldValue;
use crate::pages::parts::{self, alert, button, fact};
use crate::view::{self, drawn, el};
use sidestep::chart::{ColourStyle, fixed, number};
use sidestep::math::hypot;
use sidestep::reachability::{ACCURACIES, METHODS, ValueFunction, ValueState};
use sidestep::value_view::{Play, Shown};

type Node = view::Node<Msg>;

pub(super) fn page(page: &Reachability) -> Node {
    el("main").class("reach").children([seen(page), panel(page)])
}

/// The pictures with their controls.
fn seen(page: &Reachability) -> Node {
    let names = [
        (Shown::Value, "V", "V at one relative heading (key 1)"),
        (Shown::Error, "Error", "Error of the solver against the closed form (key 2)"),
        (Shown::Tube, "Tube", "V ≤ c over x, y and the relative heading (key 3)"),
    ];
    let switch = |(shown, words, title): (Shown, &str, &str)| {
        let word =
            Shown::ALL.iter().find(|(_, known)| *known == shown).map_or("", |(word, _)| word);
        let text = FieldValue::Text(word.to_owned());
        button(&format!("show-{word}"), Msg::Set("show", text))
            .class("switch")
            .attr("aria-pressed", page.view.shown == shown)
            .attr("title", title)
            .text(words)
    };
    let save = |id: &str, words: &str, message| {
        let what = if id == "save-npz" { "value function" } else { "picture" };
        let title = format!("Save the {what} as {words}");
        button(id, message).class("plain").attr("title", title).text(words)
    };
    let is_there = page.solving.is_none() && !matches!(page.writing, Some(Ok(_)));
    let saves = page.found.as_ref().map(|_| {
        el("span")
            .class("end")
            .children([
                save("save-svg", "SVG", Msg::SaveSvg),
                save("save-png", "PNG", Msg::SavePng),
            ])
            .children(is_there.then(|| save("save-npz", "NPZ", Msg::SaveNpz)))
    });
    let switches = el("div")
        .class("switches")
        .attrs(&[("role", "group"), ("aria-label", "What is shown")])
        .children(names.map(switch))
        .children(saves);
    let content = match &page.found {
        Some(found) => shown(page, found),
        None => missing(page),
    };
    el("section")
        .class("view")
        .attr("aria-label", "Pictures")
        .child(switches)
        .child(content)
        .children(progress(page))
}

/// Says why there is no picture, and what the user can do.
fn missing(page: &Reachability) -> Node {
    let empty = el("div").class("empty").test_id("unsolved");
    let Some(why) = &page.missing else {
        return empty.child(el("p").class("quiet").text("Loading the value function."));
    };
    let empty = empty.child(el("p").attr("role", "alert").text(why.clone()));
    match page.view.chosen() {
        Ok(_) => empty.child(button("solve-again", Msg::Again).text("Try again")),
        Err(_) => empty,
    }
}

/// Progress of the solve for the page or for the file.
fn progress(page: &Reachability) -> Option<Node> {
    let share = match (page.solving, &page.writing) {
        (Some((_, share)), _) => share,
        (None, Some(Ok(share))) => *share,
        (None, Some(Err(why))) => return Some(alert("no-file", why)),
        (None, None) => return None,
    };
    let percent = (100.0 * share) as u32;
    let is_file = page.solving.is_none();
    let what = if is_file { "Solving the game for the file" } else { "Solving the game" };
    let stop = button("stop-solving", Msg::Stop).class("plain").text("Stop");
    let words = el("p")
        .child(el("span").attr("role", "status").text(what))
        .child(el("span").test_id("solved-percent").text(format!("{percent} %")))
        .children((!is_file).then_some(stop));
    let bar = el("progress").attrs(&[("max", "100"), ("aria-label", what)]).attr("value", percent);
    Some(el("div").class("notice").test_id("solving").children([words, bar]))
}

fn shown(page: &Reachability, found: &Found) -> Node {
    let is_old = page.solving.is_some();
    let pictures = el("div").class(if is_old { "pictures old" } else { "pictures" });
    if page.view.shown == Shown::Error && found.closed_form().is_none() {
        let why = match found.function() {
            ValueFunction::Exact(_) => {
                "This is the closed form. Solve the game on a grid to see the solver’s error against it."
            }
            ValueFunction::Sampled(samples) if samples.horizon_s().is_finite() => {
                "There is no closed form for a finite horizon, so nothing to compare with."
            }
            ValueFunction::Sampled(_) => {
                "There is no closed form for unequal vehicles, so nothing to compare with. Give \
                 both the same speed and turn rate, and choose the method polar or cartesian."
            }
        };
        let words = el("p").test_id("no-closed-form").text(why);
        // A button solves the game on a grid, so that the solver's error can be shown.
        let solve = matches!(found.function(), ValueFunction::Exact(_)).then(|| {
            let polar = FieldValue::Text("polar".to_owned());
            button("solve-to-compare", Msg::Set("method", polar)).text("Solve on the polar grid")
        });
        let empty = el("div").class("empty").child(words).children(solve);
        return pictures.child(empty);
    }
    if page.view.shown == Shown::Tube {
        return pictures.child(tube(page, found));
    }
    pictures.child(map(page, found)).children(world(page, found))
}

/// Explains how to rotate the tube.
const HINT: &str = "Drag it, or use the arrow keys, to turn it; the wheel, + and − change its size. Its ends at \
                    0° and 360° are the same.";

/// The tube as a solid, or slices of it at eight headings.
fn tube(page: &Reachability, found: &Found) -> Node {
    let level = number(page.view.level_m);
    let words =
        format!("The states with V ≤ {level} m as a solid: x and y of the pursuer, ψ upwards");
    let walls = page.orbit(found).walls("").element(ColourStyle::Properties);
    let canvas = el("canvas").attr("id", CANVAS);
    let solid = el("div")
        .class(if page.shows_solid() { "solid" } else { "solid lost" })
        .attrs(&[("role", "img"), ("aria-label", &words)])
        .test_id("tube")
        .on_point_and_wheel(Msg::Hold)
        .child(drawn(walls).attr("aria-hidden", "true"))
        .child(canvas);
    let instead = (!page.shows_solid()).then(|| {
        let slow = page.frame_ms.filter(|_| page.has_graphics);
        let why = match slow {
            Some(ms) => format!(
                "This browser takes {} ms to draw the solid once, so it would not turn smoothly: here is the \
                 tube cut at eight headings.",
                fixed(ms, 0)
            ),
            None => "This browser cannot draw solids now, because it has no WebGL or has lost it, so here is the tube \
                 cut at eight headings."
                .to_owned(),
        };
        let anyway = slow.map(|_| button("insist", Msg::Insist).text("Show the solid anyway"));
        let picture = drawn(page.small_multiples(found).element(ColourStyle::Properties));
        el("div")
            .class("instead")
            .test_id("no-graphics")
            .child(el("p").attr("role", "status").text(why))
            .children(anyway)
            .child(picture)
    });
    let field = el("input")
        .attrs(&[
            ("id", "level"),
            ("type", "text"),
            ("autocomplete", "off"),
            ("inputmode", "decimal"),
        ])
        .attr("value", page.view.level_m)
        .test_id("level")
        .on_input(|value| Msg::Set("level", value));
    let heading = el("div")
        .class("level")
        .child(el("label").attr("for", "level").text("all states with V ≤"))
        .child(field)
        .child(el("span").text("m"))
        .children(page.shows_solid().then(|| el("span").class("quiet").text(HINT)));
    let is_empty = found.mesh().is_some_and(|mesh| mesh.indices.is_empty());
    let nothing = is_empty
        .then(|| el("p").class("quiet").test_id("no-tube").text("No state has a V this low."));
    el("figure").class("slice").child(solid).children(instead).children(nothing).child(heading)
}

/// The map with its marks, and the slider for the heading.
fn map(page: &Reachability, found: &Found) -> Node {
    let base =
        found.element().map(|element| drawn(element).attr("aria-hidden", "true").class("base"));
    let over = found.map().map(|map| {
        let marks = map.over(page.marks()).element(ColourStyle::Properties);
        drawn(marks).attr("aria-hidden", "true").class("over")
    });
    let what = match page.view.shown {
        Shown::Error => "Error of the solver against the closed form",
        _ => "V over the pursuer’s position, seen from the evader, with labelled levels",
    };
    let picture = el("div")
        .class("map")
        .attrs(&[("role", "img"), ("aria-label", what)])
        .test_id("map")
        .on_point(Msg::Point)
        .children(base)
        .children(over);
    let psi = page.view.psi_deg;
    let slider = el("input")
        .attrs(&[("id", "psi"), ("type", "range"), ("min", "0"), ("max", "359"), ("step", "1")])
        .attr("data-own-keys", "")
        .attr("value", psi)
        .attr("aria-valuetext", format!("{psi} degrees"))
        .test_id("psi")
        .on_input(|value| Msg::Set("psi", value));
    let heading = el("div")
        .class("heading")
        .child(el("label").attr("for", "psi").text("relative heading ψ"))
        .child(slider)
        .child(el("output").attr("for", "psi").text(format!("{psi}°")));
    el("figure").class("slice").child(picture).child(heading).child(legend(page))
}

/// The legend of the map.
fn legend(page: &Reachability) -> Node {
    let item = |sign: &str, words: &str| {
        el("li").child(el("i").class(&format!("swatch {sign}"))).child(el("span").text(words))
    };
    let mut items = vec![item("evader", "evader, at the origin"), item("pursuer", "pursuer")];
    if page.view.shown != Shown::Error {
        items.push(item("zero", "V = 0: inside, the pursuer can force a collision"));
        items.push(item("disc", "danger disc"));
    }
    if page.game.as_ref().is_some_and(Result::is_ok) {
        items.push(item("path", "optimal play until both are closest"));
    }
    el("ul").class("signs").attr("aria-label", "Legend").children(items)
}

/// The paths of both vehicles in the world frame.
fn world(page: &Reachability, found: &Found) -> Option<Node> {
    let game = page.game.as_ref()?.as_ref().ok()?;
    let drawing = game.world(found.function().game().radius_m, page.widths()[1]);
    let picture = drawn(drawing.element(ColourStyle::Properties));
    let caption = "The same game in the world, with a dot at every second";
    Some(
        el("figure")
            .class("world")
            .test_id("world")
            .child(picture)
            .child(el("figcaption").class("quiet").text(caption)),
    )
}

fn panel(page: &Reachability) -> Node {
    let misread = page.misread.iter().map(|(_, why)| alert("misread", why));
    el("aside")
        .class("panel")
        .attrs(&[("tabindex", "0"), ("aria-label", "Game and numbers")])
        .child(parts::heading("Reachability"))
        .children(misread)
        .child(parameters(page))
        .children(page.found.as_ref().map(|found| origin(page, found)))
        .children(page.found.as_ref().map(|found| numbers(page, found)))
        .children(page.found.as_ref().and_then(|found| errors(page, found)))
        .child(keys::list())
}

/// The controls for the game and for how it is solved.
fn parameters(page: &Reachability) -> Node {
    let values = page.view.parameters();
    let value = move |name: &str| {
        let found = values.iter().find(|(known, _)| *known == name);
        found.map_or_else(String::new, |(_, value)| value.clone())
    };
    let is_bad = |name: &str| page.misread.iter().any(|(known, _)| known == name);
    let field = |name: &'static str, label: &str, unit: &str| {
        let input = el("input")
            .attrs(&[("id", name), ("type", "text"), ("autocomplete", "off")])
            .attr("inputmode", if name == "horizon" { "text" } else { "decimal" })
            .attr("value", value(name))
            .attr_if(is_bad(name), "aria-invalid", "true")
            .test_id(name)
            .on_input(move |value| Msg::Set(name, value));
        let unit = el("span").class("unit").text(unit);
        el("div")
            .class("pair")
            .child(el("label").attr("for", name).text(label))
            .child(el("span").class("entry").children([input, unit]))
    };
    let select = |name: &'static str, label: &str, options: Vec<(&str, String)>| {
        let chosen = value(name);
        let option = |(word, words): (&str, String)| {
            el("option").attr("value", word).attr_if(word == chosen, "selected", "").text(words)
        };
        let select = el("select")
            .attr("id", name)
            .test_id(name)
            .on_input(move |value| Msg::Set(name, value))
            .children(options.into_iter().map(option));
        el("div").class("pair").child(el("label").attr("for", name).text(label)).child(select)
    };
    let best = page.view.chosen().map_or("best", |method| method.name());
    let automatic = match page.view.method {
        None => format!("best: {best}"),
        Some(_) => "best".to_owned(),
    };
    let mut methods = vec![("best", automatic)];
    methods.extend(METHODS.iter().map(|(word, ..)| (*word, (*word).to_owned())));
    let accuracies = ACCURACIES.iter().map(|(word, ..)| (*word, (*word).to_owned())).collect();
    el("section").class("drawing").child(el("h2").text("Game")).children([
        field("evader-speed", "evader’s speed", "m/s"),
        field("evader-turn-rate", "its turn rate", "rad/s"),
        field("pursuer-speed", "pursuer’s speed", "m/s"),
        field("pursuer-turn-rate", "its turn rate", "rad/s"),
        field("radius", "danger radius", "m"),
        field("horizon", "horizon (or inf)", "s"),
        select("method", "method", methods),
        select("accuracy", "accuracy", accuracies),
    ])
}

/// How the function was computed, and whether it can be trusted.
fn origin(page: &Reachability, found: &Found) -> Node {
    let how = match found.seconds() {
        Some(seconds) => format!("{}, solved here in {} s", found.how(), fixed(seconds, 2)),
        None => found.how(),
    };
    let game = found.function().game();
    let why = match game.pursuer.speed_mps > game.evader.speed_mps {
        true => " This is expected when the pursuer is faster.",
        false => "",
    };
    let doubt = found.function().unsettled_m().map(|moved| {
        let moved = number(moved);
        el("p").class("waiting").attr("role", "note").test_id("not-converged").text(format!(
            "This value function did not converge: the solver stopped while it still changed by \
             {moved} m, so V may be too high, above all far away.{why}"
        ))
    });
    let state = if page.solving.is_some() { "of the previous game" } else { "" };
    el("section")
        .child(el("p").class("quiet").test_id("origin").text(how))
        .children((!state.is_empty()).then(|| el("p").class("quiet").text(state)))
        .children(doubt)
}

/// The numbers at the cross-hair or under the pointer, and the result of optimal play from the
/// cross-hair.
fn numbers(page: &Reachability, found: &Found) -> Node {
    let [x, y] = page.at_m();
    let state = found.function().state(page.state([x, y]));
    let ValueState { value, gradient: [gx, gy, gpsi], .. } = state;
    let doubtful = if found.function().unsettled_m().is_some() { "≈ " } else { "" };
    let turn = |rate: f64| {
        let side = match rate {
            rate if rate > 0.0 => "left",
            rate if rate < 0.0 => "right",
            _ => return "straight".to_owned(),
        };
        format!("{side}, {} rad/s", number(rate.abs()))
    };
    let place = if page.pointer.is_some() { "under the pointer" } else { "at the cross-hair" };
    let heading = el("h2").text("Numbers ").child(el("small").text(place));
    let facts = el("dl").class("facts").test_id("numbers").children([
        fact("x, y", format!("{} m, {} m", fixed(x, 2), fixed(y, 2))),
        fact("V", format!("{doubtful}{} m", fixed(value, 3))),
        fact("∂V/∂x, ∂V/∂y", format!("{}, {}", fixed(gx, 3), fixed(gy, 3))),
        fact("∂V/∂ψ", format!("{} m/rad", fixed(gpsi, 3))),
        fact("evader’s best turn", turn(state.evader_turn)),
        fact("pursuer’s best turn", turn(state.pursuer_turn)),
    ]);
    let outside = (!state.inside)
        .then(|| el("p").class("quiet").text("Outside the solved grid: V is extrapolated."));
    let radius_m = found.function().game().radius_m;
    // The value for a finite horizon says nothing about later times.
    let within = match found.function() {
        ValueFunction::Sampled(samples) if samples.horizon_s().is_finite() => {
            format!(" for {} s", number(samples.horizon_s()))
        }
        _ => String::new(),
    };
    let verdict = if hypot(x, y) <= radius_m {
        "The pursuer is within the danger radius: the evader is caught already.".to_owned()
    } else if value <= 0.0 {
        let within = within.replace(" for ", " within ");
        format!("Not safe: the pursuer can force a collision{within}.")
    } else {
        let kept = fixed(value + radius_m, 2);
        format!("Safe{within}: the evader can keep the pursuer at least {kept} m away.")
    };
    let words = if page.view.plays { "Forget the game" } else { "Play from here" };
    let action = button("play", Msg::Play)
        .attr("title", "Both play optimally from the cross-hair (Enter, or a click in the map)")
        .text(words);
    let game = page.game.as_ref().map(|game| match game {
        Ok(game) => played(game, radius_m, doubtful),
        Err(why) => alert("no-play", why),
    });
    el("section")
        .child(heading)
        .child(facts)
        .children(outside)
        .children(state.inside.then(|| el("p").test_id("verdict").text(verdict)))
        .child(action)
        .children(game)
}

/// The result of optimal play, compared with V.
fn played(game: &Play, radius_m: f64, doubtful: &str) -> Node {
    let least = game.least_distance_m();
    let promised = game.value_m + radius_m;
    let end = match game.caught_s() {
        Some(0.0) => "It begins within the danger radius.".to_owned(),
        Some(seconds) => format!("Caught after {} s.", fixed(seconds, 1)),
        None if game.goes_on => "The pursuer still came closer when the game was stopped.".into(),
        None => format!("The pursuer passes after {} s.", fixed(game.closest_s(), 1)),
    };
    el("div")
        .test_id("played")
        .child(el("h2").text("Optimal play ").child(el("small").text("from the cross-hair")))
        .child(el("p").text(end))
        .child(el("dl").class("facts").children([
            fact("closest distance", format!("{} m", fixed(least, 3))),
            fact("V + radius", format!("{doubtful}{} m", fixed(promised, 3))),
            fact("difference", format!("{} m", fixed(least - promised, 3))),
        ]))
}

/// The solver's error compared with the closed form.
fn errors(page: &Reachability, found: &Found) -> Option<Node> {
    if page.view.shown != Shown::Error {
        return None;
    }
    let (all, [greatest, mean]) = found.errors()?;
    let [x, y, psi] = all.greatest_at;
    let place = format!("{} m, {} m, {}°", fixed(x, 1), fixed(y, 1), fixed(psi.to_degrees(), 0));
    let metres = |value: f64| format!("{} m", fixed(value, 4));
    Some(
        el("section")
            .test_id("errors")
            .child(el("h2").text("Against the closed form"))
            .child(el("dl").class("facts").children([
                fact("greatest at this ψ", metres(greatest)),
                fact("mean at this ψ", metres(mean)),
                fact("greatest at 24 headings", metres(all.greatest_m)),
                fact("there x, y, ψ", place),
                fact("mean at 24 headings", metres(all.mean_m)),
            ]))
            .child(el("p").class("quiet").text(
                "Sizes of the error over the map, at this heading and at every 15°. The solver’s values are \
                 rounded to a millimetre on their way to this page.",
            )),
    )
}
