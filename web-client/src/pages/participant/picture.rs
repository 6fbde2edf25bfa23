//! The picture of a scene or of the instructions, as the participant sees it.

use super::Participant;
use super::state::Stage;
use crate::drive;
use crate::json;
use sidestep::chart::colours;
use sidestep::picture::stage;
use sidestep::picture::{Picture, Shape};
use sidestep::scene::JointState;
use sidestep::trial::Phase;
use sidestep::vehicle::Pose;
use std::rc::Rc;

impl Participant {
    pub(super) fn draw_stage(&self, at_ms: f64, picture: &mut Picture) -> bool {
        let (trial, state, step) = match &self.stage {
            Stage::Instructions(arena) => {
                arena.draw(picture);
                picture.extend(self.labels(arena.state()));
                return true;
            }
            Stage::Countdown(trial, ..) => (trial, trial.scene.straight_scene().start(), 0),
            Stage::Driving(trial, drive) => (trial, drive.state_at(at_ms), drive.step_at(at_ms)),
            Stage::Over(trial, state, ..) => {
                (trial, *state, self.study.as_ref().map_or(0, |study| study.parameters.steps))
            }
            _ => return false,
        };
        let scene = trial.scene.straight_scene();
        picture.begin("scene", drive::window(&scene, state));
        picture.tell("data-step", step);
        picture.tell("data-phase", trial.phase.word());
        picture.tell("data-trial", trial.id());
        // The danger zone is drawn only in some phases.
        if let (true, Some(study)) = (trial.show_danger_zone, &self.study) {
            let radius_m = study.parameters.danger_radius_m;
            picture.push(stage::danger_zone(state.robot, radius_m));
        }
        picture.extend(stage::vehicles_and_goal(&scene, state));
        if self.link.simulates() {
            // The goal follows from the start.
            picture.tell("data-scene", json::write(&scene.start()));
            if let Some(rule) = self.rules.as_ref().and_then(|rules| rules.told(trial.id())) {
                picture.tell("data-policy", rule);
            }
        }
        // In later phases, names beside moving vehicles would distract.
        if matches!(self.stage, Stage::Countdown(..)) || trial.phase == Phase::Familiarisation {
            picture.extend(self.labels(state));
        }
        true
    }

    /// Labels with the names of both vehicles, beside the vehicles.
    fn labels(&self, state: JointState) -> [Shape; 2] {
        let label = |pose: Pose, name: &Rc<str>, colour| Shape::Label {
            at: pose.position(),
            text: Rc::clone(name),
            colour,
        };
        [
            label(state.human, &self.names[0], colours::HUMAN),
            label(state.robot, &self.names[1], colours::ROBOT),
        ]
    }
}
