//! The robots of a study in the form.

use super::document::{list, number, text};
use super::edit::{new_robot, new_turn, new_way_point};
use super::fields::Fields;
use super::{Edit, Msg};
use crate::view::{self, el};
use serde_json::Value;
use sidestep::scene::RobotsVary;

type Node = view::Node<Msg>;

/// The rules, with their descriptions.
const RULES: [(&str, &str); 4] = [
    ("straight", "drives straight to its goal"),
    ("way_points", "drives over way points to its goal"),
    ("script", "turns at given times"),
    ("evades", "evades the participant, then returns to its goal"),
];

/// How the robots are divided.
const WAYS: [(&str, &str); 2] = [
    (RobotsVary::Within.word(), "every participant meets every robot"),
    (RobotsVary::Between.word(), "each participant meets one robot"),
];

/// The fields of all robots, and the button that adds a robot.
pub(super) fn all(fields: &Fields<'_>) -> Vec<Node> {
    let robots = list(fields.given, "robots");
    let mut nodes: Vec<Node> = Vec::new();
    if robots.len() > 1 {
        let label = "Several robots are divided so that";
        nodes.push(fields.choice("robots_vary", label, "", &WAYS).class("field wide"));
    }
    nodes.extend(robots.iter().enumerate().map(|(i, robot)| one(fields, i, robot)));
    let taken = |name: &String| robots.iter().any(|robot| text(robot, "name") == name);
    let name = (1..).map(|n| format!("robot-{n}")).find(|name| !taken(name)).unwrap_or_default();
    nodes.push(fields.add("robots", "Add a robot", new_robot(&name, "straight"), ".name"));
    nodes
}

fn one(fields: &Fields<'_>, i: usize, robot: &Value) -> Node {
    let path = format!("robots[{i}]");
    let of = |field: &str| format!("{path}.{field}");
    let at = path.clone();
    let renew = move |rule: &str| Edit::Rule(at.clone(), rule.to_owned());
    let mut inside = vec![
        fields.line(&of("name"), "Name in exports and reports", ""),
        fields.kind(&of("rule"), "This robot", &RULES, renew),
    ];
    match text(robot, "rule") {
        "way_points" => {
            let points = of("way_points_m");
            let count = list(robot, "way_points_m").len();
            inside.extend((0..count).map(|k| {
                let point = format!("{points}[{k}]");
                el("div")
                    .class("row")
                    .child(fields.number(
                        &format!("{point}[0]"),
                        &format!("Way point {}: ahead", k + 1),
                        "m",
                        "",
                    ))
                    .child(fields.number(&format!("{point}[1]"), "To the left", "m", ""))
                    .child(fields.entry_buttons(&points, k, "way point"))
            }));
            // Halfway between the last point and the goal.
            let last = number(fields.study, &format!("{points}[{}][0]", count.saturating_sub(1)));
            let of = |field: &str| number(fields.study, field).unwrap_or_default();
            let goal_m = ["robot.speed_mps", "step_s", "steps"]
                .map(|field| of(&format!("parameters.{field}")))
                .iter()
                .product::<f64>();
            let halfway_m = (0.5 * (last.unwrap_or_default() + goal_m) * 100.0).round() / 100.0;
            let new = new_way_point(halfway_m);
            inside.push(fields.add(&points, "Add a way point", new, "[0]"));
        }
        "script" => {
            let turns = of("turns");
            let count = list(robot, "turns").len();
            inside.extend((0..count).map(|k| {
                let of = |field: &str| format!("{turns}[{k}].{field}");
                el("div")
                    .class("row")
                    .child(fields.number(
                        &of("until_s"),
                        &format!("Turn {}: until", k + 1),
                        "s",
                        "",
                    ))
                    .child(fields.number(
                        &of("turn_rate_radps"),
                        "Turn rate, left > 0",
                        "rad/s",
                        "",
                    ))
                    .child(fields.entry_buttons(&turns, k, "turn"))
            }));
            let last =
                number(fields.study, &format!("{turns}[{}].until_s", count.saturating_sub(1)));
            let new = new_turn(last.unwrap_or_default() + 1.0);
            inside.push(fields.add(&turns, "Add a turn", new, ".until_s"));
        }
        "evades" => {
            let hint = "The robot keeps its safety level V_RH above this value if it can.";
            inside.push(fields.number(&of("threshold_m"), "Least safety level", "m", hint));
        }
        _ => {}
    }
    el("fieldset")
        .class("question field wide")
        .child(el("legend").text(format!("Robot {}", i + 1)))
        .child(el("div").class("fields").children(inside))
        .child(fields.entry_buttons("robots", i, "robot"))
}
