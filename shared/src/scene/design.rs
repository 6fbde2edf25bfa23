//! Scenes of a single participant: random, and evenly spread over three coordinates of the encounter.

use super::assigned::Scene;
use super::encounter::{Encounter, no_scene, place};
use super::parameters::SceneParameters;
use super::range::EncounterRange;
use super::rules::SceneRules;
use super::strata::Stratification;
use crate::invalid::Invalid;
use crate::math::{SeededRng, TAU, wrap_angle};

/// `count` scenes from a seed, spread evenly over approach angle, miss distance and entry time.
/// They are a Latin hypercube, in which each of the three coordinates falls once into each of
/// `count` equal strata. If a cell of the hypercube has no admissible scene (such as a head-on
/// encounter two seconds away), the scene keeps the approach stratum and the other two coordinates
/// are redrawn.
///
/// The same seed gives the same scenes on every platform.
///
/// # Errors
/// [`Invalid`] if no admissible scene is found for some stratum, which means that these parameters
/// leave the human no escape.
pub fn generate(
    parameters: &SceneParameters,
    range: &EncounterRange,
    count: usize,
    seed: u64,
) -> Result<Vec<(Scene, Encounter)>, Invalid> {
    let rules = SceneRules::new(parameters, range);
    generate_with(parameters, range, count, seed, |scene| rules.admit(scene))
}

/// Like [`generate`], but `admit` decides whether a scene is admissible. With
/// [`is_admissible`](super::is_admissible), it returns the same scenes as [`generate`], but more
/// slowly.
///
/// # Errors
/// The errors of [`generate`].
pub fn generate_with(
    parameters: &SceneParameters,
    range: &EncounterRange,
    count: usize,
    seed: u64,
    admit: impl Fn(&Scene) -> bool,
) -> Result<Vec<(Scene, Encounter)>, Invalid> {
    const TRIES_IN_CELL: usize = 40;
    const TRIES: usize = 4000;
    let mut rng = SeededRng::new(seed);
    let approach = rng.permutation(count);
    let miss = rng.permutation(count);
    let entry = rng.permutation(count);
    let stratum = |rng: &mut SeededRng, cell: usize| (cell as f64 + rng.unit()) / count as f64;
    let strata = Stratification::beyond_the_trial(parameters, range, count);
    (0..count)
        .map(|i| {
            for attempt in 0..TRIES {
                let in_cell = attempt < TRIES_IN_CELL;
                let a = stratum(&mut rng, approach[i]);
                let m = if in_cell { stratum(&mut rng, miss[i]) } else { rng.unit() };
                let e = if in_cell { stratum(&mut rng, entry[i]) } else { rng.unit() };
                let encounter = strata.encounter([a, m, e]);
                let scene = place(parameters, encounter, wrap_angle(rng.uniform(0.0, TAU)));
                if admit(&scene) {
                    return Ok((scene, encounter));
                }
            }
            Err(no_scene(TRIES))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{PI, hypot, sin_cos};
    use crate::scene::{Evader, is_admissible};
    use crate::vehicle::{TurnInput, VehicleModel};
    use sha2::{Digest, Sha256};

    fn scenes(count: usize, seed: u64) -> Vec<(Scene, Encounter)> {
        generate(&SceneParameters::default(), &EncounterRange::default(), count, seed).unwrap()
    }

    /// The encounter of a scene: the inverse of [`place`].
    fn encounter_of(parameters: &SceneParameters, scene: &Scene) -> Option<Encounter> {
        let (rs, rc) = sin_cos(scene.robot.psi);
        let (hs, hc) = sin_cos(scene.human.psi);
        let wx = parameters.robot.speed_mps * rc - parameters.human.speed_mps * hc;
        let wy = parameters.robot.speed_mps * rs - parameters.human.speed_mps * hs;
        let w = hypot(wx, wy);
        let (dx, dy) = (scene.robot.x - scene.human.x, scene.robot.y - scene.human.y);
        let miss_m = (wx * dy - wy * dx) / w;
        let radius = parameters.danger_radius_m;
        if w < 1e-9 || miss_m.abs() > radius {
            return None;
        }
        let entry_s = (-(dx * wx + dy * wy) / w - (radius * radius - miss_m * miss_m).sqrt()) / w;
        Some(Encounter {
            approach_rad: wrap_angle(scene.human.psi - scene.robot.psi),
            miss_m,
            entry_s,
        })
    }

    #[test]
    fn the_robot_reaches_its_goal_as_the_trial_ends() {
        let parameters = SceneParameters::default();
        for (scene, _) in scenes(20, 1) {
            let start = scene.robot.position();
            assert!(
                (hypot(scene.goal[0] - start[0], scene.goal[1] - start[1]) - 20.0).abs() < 1e-12
            );
            let end = (0..50).fold(scene.start(), |state, _| {
                state.advance(&parameters, TurnInput::Right, 0.0, 0.2)
            });
            assert!(hypot(end.robot.x - scene.goal[0], end.robot.y - scene.goal[1]) < 1e-12);
        }
    }

    #[test]
    fn scenes_keep_the_rules() {
        let parameters = SceneParameters::default();
        let value = parameters.game(Evader::Human).exact().unwrap();
        for (scene, planned) in scenes(150, 20_180_918) {
            let start = scene.start();
            assert!(start.distance_m() > 3.0);
            assert!(value.value(start.robot_seen_by_human()) > 0.0);
            // If neither vehicle turns, the human enters the zone between two and ten seconds after
            // the start.
            let mut state = start;
            let mut entry = None;
            for tick in 0..10_000 {
                if state.distance_m() <= 3.0 {
                    entry = Some(f64::from(tick) * 1e-3);
                    break;
                }
                state = state.advance(&parameters, TurnInput::Straight, 0.0, 1e-3);
            }
            let entry = entry.expect("the human must have to avoid the robot");
            assert!((2.0..=8.01).contains(&entry), "{entry}");
            assert!((entry - planned.entry_s).abs() < 2e-3, "{entry} {planned:?}");
            let seen = encounter_of(&parameters, &scene).unwrap();
            assert!((seen.miss_m - planned.miss_m).abs() < 1e-9);
            assert!((seen.entry_s - planned.entry_s).abs() < 1e-9);
        }
    }

    #[test]
    fn encounters_are_spread_evenly() {
        let design = scenes(240, 3);
        let mut counts = [[0; 8]; 3];
        for (_, e) in &design {
            let angle = (e.approach_rad + PI) / TAU;
            let shares = [angle, (e.miss_m / 2.55 + 1.0) / 2.0, (e.entry_s - 2.0) / 6.0];
            for (coordinate, share) in shares.into_iter().enumerate() {
                counts[coordinate][((share * 8.0) as usize).min(7)] += 1;
            }
        }
        // Approach angles are exactly stratified except for the gap around parallel headings.
        assert!(counts[0].iter().all(|&n| (18..=36).contains(&n)), "{counts:?}");
        // The other two coordinates are stratified where the cell has an admissible scene.
        assert!(counts[1].iter().all(|&n| n >= 15), "{counts:?}");
        assert!(counts[2].iter().skip(1).all(|&n| n >= 15), "{counts:?}");
    }

    #[test]
    fn a_seed_names_its_scenes() {
        assert_eq!(scenes(5, 9), scenes(5, 9));
        assert_ne!(scenes(5, 9), scenes(5, 10));
    }

    /// The scenes of a seed are still the scenes of the first version of this method.
    #[test]
    fn scenes_of_a_seed_never_change() {
        let mut hash = Sha256::new();
        for (Scene { human, robot, goal, .. }, _) in scenes(59, 20_180_918) {
            let numbers = [human.into(), robot.into(), [goal[0], goal[1], 0.0]];
            hash.update(
                numbers.concat().into_iter().flat_map(f64::to_le_bytes).collect::<Vec<_>>(),
            );
        }
        let hash: String = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(hash, "840f9ef14559ecb9a1dd777415ad6fc74fbf58eb2a62bf5c3b6575b8e9b1232c");
    }

    #[test]
    fn hopeless_parameters_are_refused() {
        let parameters = SceneParameters { danger_radius_m: 30.0, ..SceneParameters::default() };
        assert!(generate(&parameters, &EncounterRange::default(), 1, 0).is_err());
    }

    /// [`is_admissible`] and the faster rules admit the same scenes, bit for bit.
    #[test]
    fn the_plain_rules_draw_the_same_scenes() {
        let default = SceneParameters::default();
        let vehicle = |speed_mps, turn_rate_radps| VehicleModel { speed_mps, turn_rate_radps };
        let studies = [
            (default, 59),
            // V_HR has no closed form, and the steps do not divide a second.
            (SceneParameters { robot: vehicle(2.4, 0.4), step_s: 0.3, steps: 33, ..default }, 12),
            (SceneParameters { human: vehicle(3.0, 0.8), step_s: 1.5, steps: 8, ..default }, 12),
            // The end of the trial truncates escapes.
            (SceneParameters { steps: 14, danger_radius_m: 2.0, ..default }, 3),
        ];
        let range = EncounterRange::default();
        for (study, (parameters, count)) in studies.into_iter().enumerate() {
            let plain = |scene: &Scene| is_admissible(&parameters, &range, scene);
            let fast = generate(&parameters, &range, count, 7).unwrap();
            let slow = generate_with(&parameters, &range, count, 7, plain).unwrap();
            let bits = |drawn: &[(Scene, Encounter)]| format!("{drawn:?}");
            assert_eq!(bits(&fast), bits(&slow), "study {study}");
        }
    }
}
