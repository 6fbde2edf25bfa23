//! The effects of pointers and keys on the map and on the tube.

use super::Reachability;
use super::keys::Key;
use crate::form::{Does, Pointing};
use sidestep::value_view::{Shown, ZOOM_PERCENT};

impl Reachability {
    /// Moves the cross-hair to a position, which is limited to the window and rounded to a
    /// millimetre.
    fn aim(&mut self, at_m: [f64; 2]) {
        let Some(found) = &self.found else { return };
        let window = found.window();
        self.view.at_m = [0, 1].map(|d| {
            let metres = at_m[d].clamp(window.low[d], window.high[d]);
            (1000.0 * metres).round() / 1000.0
        });
        self.pointer = None;
    }

    pub(super) fn point(&mut self, pointing: Pointing) {
        let at = self.found.as_ref().and_then(|found| found.at(pointing.at.map(f64::from)));
        match (pointing.does, at) {
            (Does::Hover | Does::Drag, at) => self.pointer = at,
            (Does::Press, Some(at)) => {
                self.aim(at);
                self.view.plays = true;
            }
            (Does::Press | Does::Roll(_), _) => {}
        }
    }

    pub(super) fn press(&mut self, key: Key) {
        let Some(found) = &self.found else { return };
        match key {
            Key::Move([right, up]) if self.view.shown == Shown::Tube => {
                let [around, above] = self.view.turned_deg;
                self.look_from([around - 5 * i16::from(right), above - 5 * i16::from(up)]);
            }
            Key::Zoom(by) => self.zoom(1.1_f64.powi(by.into())),
            Key::Move(by) => {
                let step = found.key_step_m();
                let from = self.at_m();
                self.aim([0, 1].map(|d| from[d] + step * f64::from(by[d])));
            }
            Key::Turn(by) => self.turn(by),
            Key::Play => {
                self.aim(self.at_m());
                self.view.plays = true;
            }
            Key::Forget => self.view.plays = false,
            Key::Show(shown) => self.view.shown = shown,
        }
    }

    /// Rotates the tube with the pointer that has grabbed it, or scales the tube with the wheel.
    pub(super) fn hold(&mut self, Pointing { at, does }: Pointing) {
        match does {
            Does::Press => self.held = Some((at, self.view.turned_deg)),
            Does::Drag => {
                if let Some((from, [around, above])) = self.held {
                    // A drag across the whole width rotates the tube by 360°. A drag across the
                    // whole height rotates it by 180°.
                    let [right, down] = [0, 1].map(|d| at[d] - from[d]);
                    let turned = [around - (360.0 * right) as i16, above + (180.0 * down) as i16];
                    self.look_from(turned);
                }
            }
            Does::Roll(px) => self.zoom(if px > 0.0 { 1.0 / 1.1 } else { 1.1 }),
            Does::Hover => self.held = None,
        }
    }

    fn look_from(&mut self, [around, above]: [i16; 2]) {
        let around = (i32::from(around) + 180).rem_euclid(360) as i16 - 180;
        self.view.turned_deg = [around, above.clamp(-90, 90)];
    }

    fn zoom(&mut self, times: f64) {
        let [low, high] = ZOOM_PERCENT;
        let percent = (times * f64::from(self.view.zoom_percent)).round() as u16;
        self.view.zoom_percent = percent.clamp(low, high);
    }

    /// Changes the relative heading by this number of degrees.
    fn turn(&mut self, by_deg: i16) {
        let psi = (i32::from(self.view.psi_deg) + i32::from(by_deg)).rem_euclid(360);
        self.view.psi_deg = psi as u16;
    }
}
