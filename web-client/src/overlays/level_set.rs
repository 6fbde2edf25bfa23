//! The zero level sets of V_HR and V_RH for the present headings, in the world.

use super::Moment;
use crate::shape::Shape;
use sidestep::chart::{Colour, Pen, colours};
use sidestep::math::sin_cos;
use sidestep::reachability::{CurveSettings, ValueFunction};
use sidestep::vehicle::Pose;

/// {V_HR ≤ 0}: where a robot of the present heading could force a collision.
#[must_use]
pub fn human(moment: &Moment<'_>) -> Vec<Shape> {
    let [_, _, heading] = moment.state.robot_seen_by_human();
    let value = moment.safety.map(|safety| &safety.human);
    outlines(value, moment.state.human, heading, colours::HUMAN)
}

/// {V_RH ≤ 0}: where a human of the present heading could force a collision.
#[must_use]
pub fn robot(moment: &Moment<'_>) -> Vec<Shape> {
    let [_, _, heading] = moment.state.human_seen_by_robot();
    let value = moment.safety.map(|safety| &safety.robot);
    outlines(value, moment.state.robot, heading, colours::ROBOT)
}

/// The curves V = 0 where the other vehicle has the heading `psi` in the evader's frame.
fn outlines(value: Option<&ValueFunction>, evader: Pose, psi: f64, colour: Colour) -> Vec<Shape> {
    let Some(value) = value else { return Vec::new() };
    let (sin, cos) = sin_cos(evader.psi);
    let to_world = |[x, y]: [f64; 2]| [evader.x + cos * x - sin * y, evader.y + sin * x + cos * y];
    // A solve that did not converge proves nothing: its set is drawn without the vehicle's colour.
    let colour = if value.unsettled_m().is_some() { colours::MUTED } else { colour };
    let outline = |curve: Vec<[f64; 2]>| Shape::Polygon {
        points: curve.into_iter().map(to_world).collect(),
        fill: colour.at(0.05),
        outline: Pen::new(colour, 1.5).dashed(5.0, 4.0),
    };
    value.level_curves(psi, 0.0, CurveSettings::default()).into_iter().map(outline).collect()
}
