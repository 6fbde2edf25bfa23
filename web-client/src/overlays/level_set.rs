//! The zero level sets of V_HR and V_RH for the present headings, in the world.

use super::Moment;
use crate::shape::{ColourToken, Shape, Stroke};
use sidestep::math::sin_cos;
use sidestep::reachability::CurveSettings;
use sidestep::reachability::ValueFunction;
use sidestep::vehicle::Pose;

/// {V_HR ≤ 0}: where a robot of the present heading could force a collision.
#[must_use]
pub fn human(moment: &Moment<'_>) -> Vec<Shape> {
    let heading = moment.state.robot_seen_by_human()[2];
    let value = moment.safety.map(|safety| &safety.human);
    value.map_or_else(Vec::new, |value| {
        outlines(value, moment.state.human, heading, ColourToken::Human)
    })
}

/// {V_RH ≤ 0}: where a human of the present heading could force a collision.
#[must_use]
pub fn robot(moment: &Moment<'_>) -> Vec<Shape> {
    let heading = moment.state.human_seen_by_robot()[2];
    let value = moment.safety.map(|safety| &safety.robot);
    value.map_or_else(Vec::new, |value| {
        outlines(value, moment.state.robot, heading, ColourToken::Robot)
    })
}

fn outlines(value: &ValueFunction, evader: Pose, psi: f64, colour: ColourToken) -> Vec<Shape> {
    let (sin, cos) = sin_cos(evader.psi);
    let to_world = |[x, y]: [f64; 2]| [evader.x + cos * x - sin * y, evader.y + sin * x + cos * y];
    let curves = value.level_curves(psi, 0.0, CurveSettings::default());
    // A set whose solve had not settled proves nothing: it is drawn without its colour.
    let colour = if value.unsettled_m().is_some() { ColourToken::Muted } else { colour };
    let outline = |curve: Vec<[f64; 2]>| Shape::Polygon {
        points: curve.into_iter().map(to_world).collect(),
        fill: Some((colour, 0.05)),
        stroke: Some(Stroke::dashed(colour, 1.5, (5.0, 4.0))),
    };
    curves.into_iter().map(outline).collect()
}
