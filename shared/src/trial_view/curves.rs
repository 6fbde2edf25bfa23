//! Level curves for the current headings. They are cached while the headings stay the same, because
//! both vehicles drive straight on in two of three steps of a scene.

use crate::math::sin_cos;
use crate::reachability::CurveSettings;
use crate::safety::SafetyLevels;
use crate::scene::{Evader, JointState};

/// Cache of the last level curves of V.
#[derive(Clone, Debug, Default)]
pub(super) struct Curves(Vec<Kept>);

#[derive(Clone, Debug)]
struct Kept {
    evader: Evader,
    level_m: f64,
    /// The relative heading (rad).
    psi: f64,
    /// The curves, in the evader's frame (m).
    curves: Vec<Vec<[f64; 2]>>,
}

impl Curves {
    /// The level set {V = `level_m`} of this vehicle for the current headings, as closed curves in
    /// the evader's frame (m), with {V ≤ `level_m`} on their left.
    pub(super) fn of(
        &mut self,
        safety: &SafetyLevels,
        evader: Evader,
        level_m: f64,
        state: &JointState,
    ) -> &[Vec<[f64; 2]>] {
        let [_, _, psi] = match evader {
            Evader::Human => state.robot_seen_by_human(),
            Evader::Robot => state.human_seen_by_robot(),
        };
        let is_it = |kept: &Kept| kept.evader == evader && kept.level_m == level_m;
        let place = self.0.iter().position(is_it).unwrap_or_else(|| {
            self.0.push(Kept { evader, level_m, psi: f64::NAN, curves: Vec::new() });
            self.0.len() - 1
        });
        let kept = &mut self.0[place];
        // Unchanged headings have the same bits. After a turn and a turn back the bits may differ,
        // which costs one recomputation.
        if kept.psi.to_bits() != psi.to_bits() {
            kept.psi = psi;
            let (function, curves) = (safety.of(evader), &mut kept.curves);
            let drawn = function.level_curves_into(psi, level_m, CurveSettings::default(), curves);
            if drawn.is_err() {
                // A level that no state attains has no curve; the legend then says "nowhere".
                curves.clear();
            }
        }
        &kept.curves
    }

    /// Whether the cached curve of a level is empty.
    pub(super) fn is_nowhere(&self, evader: Evader, level_m: f64) -> bool {
        let known = self.0.iter().find(|kept| kept.evader == evader && kept.level_m == level_m);
        known.is_some_and(|kept| kept.curves.is_empty())
    }
}

/// Maps points from the evader's frame to the world.
pub(super) fn to_world(evader: Evader, state: &JointState) -> impl Fn([f64; 2]) -> [f64; 2] {
    let pose = match evader {
        Evader::Human => state.human,
        Evader::Robot => state.robot,
    };
    let (sin, cos) = sin_cos(pose.psi);
    move |[x, y]| [pose.x + cos * x - sin * y, pose.y + sin * x + cos * y]
}
