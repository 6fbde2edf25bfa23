//! A fingerprint to check that two machines simulate identically.

use super::simulate;
use crate::math::SeededRng;
use crate::scene::{Scene, SceneParameters};
use crate::vehicle::{Pose, TurnInput};
use sha2::{Digest, Sha256};

/// SHA-256 of the states of `count` random trials, in hexadecimal digits. Two machines with the
/// same hash simulate identically, bit for bit.
#[must_use]
pub fn simulation_fingerprint(seed: u64, count: usize) -> String {
    let parameters = SceneParameters::default();
    let mut rng = SeededRng::new(seed);
    let mut hash = Sha256::new();
    for _ in 0..count {
        let mut pose = || {
            Pose::new(rng.uniform(-20.0, 20.0), rng.uniform(-20.0, 20.0), rng.uniform(-4.0, 4.0))
        };
        let scene = Scene::new(&parameters, pose(), pose());
        let inputs: Vec<_> = (0..parameters.steps).map(|_| TurnInput::ALL[rng.below(3)]).collect();
        for state in simulate(&parameters, &scene, &inputs) {
            for pose in [state.human, state.robot] {
                for number in <[f64; 3]>::from(pose) {
                    hash.update(number.to_le_bytes());
                }
            }
        }
    }
    hex::encode(hash.finalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fingerprints_follow_the_seed() {
        assert_eq!(simulation_fingerprint(1, 10), simulation_fingerprint(1, 10));
        assert_ne!(simulation_fingerprint(1, 10), simulation_fingerprint(2, 10));
    }
}
