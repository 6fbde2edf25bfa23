//! The parameters of a synthetic person.

use super::stream::Stream;

/// The parameters of a person, each with its range. They are drawn uniformly unless stated
/// otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Person {
    /// Lag of perception (s): 0.2–0.4.
    pub lag_s: f64,
    /// Time horizon (s): 4.2–7. Closest approaches after this time have little effect.
    pub horizon_s: f64,
    /// Desired excess of the predicted distance over the danger radius (m): 0.6–2.2.
    pub margin_m: f64,
    /// Scale factor of the bearing-rate threshold (rad·s^0.5): 1.2–2.2.
    pub bearing_threshold: f64,
    /// Decay of the repeller with the angle off the danger zone (1/rad): 1.5–4.
    pub repeller_angle_decay: f64,
    /// Decay of the repeller with the distance to the danger zone (1/m): 0.06–0.11.
    pub repeller_distance_decay: f64,
    /// Gain of the repeller: 2–3.
    pub repeller_gain: f64,
    /// Standard deviation of the errors of perceived headings (rad): 0.03–0.08.
    pub heading_noise_rad: f64,
    /// Standard deviation of the logarithm of perceived times: 0.08–0.25.
    pub time_noise: f64,
    /// Activation above which a key goes down: 0.4–0.6.
    pub press_above: f64,
    /// Activation below which the key is released: 0.35–0.7 times [`Self::press_above`].
    pub release_below: f64,
    /// Noise of the activation (1/√s): 0.15–0.35.
    pub activation_noise: f64,
    /// Mean extra time that a key is held after it is no longer needed (s): 0.1–0.7.
    pub overhold_s: f64,
    /// Preference for the side that passes at the larger distance (1/m): 0.8–2.5.
    pub side_by_distance: f64,
    /// Preference for turning away from the robot's direction: 0–1.5.
    pub side_by_bearing: f64,
    /// Rate of turns without a reason (1/s): 0–0.02.
    pub lapses_per_s: f64,
    /// Rate of side changes while the predicted distance falls (1/s): 0–0.25.
    pub reversals_per_s: f64,
    /// Weights of the three input signals (predicted distance, bearing, repeller). They are drawn
    /// from exponential distributions with means in the ratio 1.2 : 1.2 : 0.8 and normalised to sum
    /// to 1.
    pub weights: [f64; 3],
    /// Preference for the left: normally distributed, mean 0, standard deviation 0.5.
    pub side_bias: f64,
}

impl Person {
    /// Draws the parameters in the order of the fields.
    pub(super) fn draw(stream: &mut Stream) -> Self {
        let mut person = Self {
            lag_s: stream.uniform(0.20, 0.40),
            horizon_s: stream.uniform(4.2, 7.0),
            margin_m: stream.uniform(0.6, 2.2),
            bearing_threshold: stream.uniform(1.2, 2.2),
            repeller_angle_decay: stream.uniform(1.5, 4.0),
            repeller_distance_decay: stream.uniform(0.06, 0.11),
            repeller_gain: stream.uniform(2.0, 3.0),
            heading_noise_rad: stream.uniform(0.03, 0.08),
            time_noise: stream.uniform(0.08, 0.25),
            press_above: stream.uniform(0.40, 0.60),
            release_below: stream.uniform(0.35, 0.70),
            activation_noise: stream.uniform(0.15, 0.35),
            overhold_s: stream.uniform(0.1, 0.7),
            side_by_distance: stream.uniform(0.8, 2.5),
            side_by_bearing: stream.uniform(0.0, 1.5),
            lapses_per_s: stream.uniform(0.0, 0.02),
            reversals_per_s: stream.uniform(0.0, 0.25),
            weights: [1.2, 1.2, 0.8].map(|mean| mean * stream.exponential(1.0)),
            side_bias: 0.5 * stream.normal(),
        };
        person.release_below *= person.press_above;
        let sum: f64 = person.weights.iter().sum();
        person.weights = person.weights.map(|weight| weight / sum);
        person
    }
}
