//! The parameters of a synthetic person.

use super::stream::Stream;

/// The parameters of a person, each with its range. They are drawn uniformly unless stated
/// otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Person {
    /// Lag of perception, s: 0.2–0.4.
    pub lag_s: f64,
    /// Times to closest approach beyond this matter little, s: 4.2–7.
    pub horizon_s: f64,
    /// How far the predicted distance should exceed the danger radius, m: 0.6–2.2.
    pub margin_m: f64,
    /// Factor of the threshold of bearing rates, rad·s^0.5: 1.2–2.2.
    pub bearing_threshold: f64,
    /// Decay of the repeller with the angle off the danger zone, 1/rad: 1.5–4.
    pub repeller_angle_decay: f64,
    /// Decay of the repeller with the distance to the danger zone, 1/m: 0.06–0.11.
    pub repeller_distance_decay: f64,
    /// Gain of the repeller: 2–3.
    pub repeller_gain: f64,
    /// Standard deviation of perceived headings, rad: 0.03–0.08.
    pub heading_noise_rad: f64,
    /// Standard deviation of the logarithm of perceived times: 0.08–0.25.
    pub time_noise: f64,
    /// Activation above which a key goes down: 0.4–0.6.
    pub press_above: f64,
    /// Activation below which the key is released: 0.35–0.7 of [`Self::press_above`].
    pub release_below: f64,
    /// Noise of the activation, 1/√s: 0.15–0.35.
    pub activation_noise: f64,
    /// Mean time by which a key is held longer than needed, s: 0.1–0.7.
    pub overhold_s: f64,
    /// Preference for the side that passes at the larger distance, 1/m: 0.8–2.5.
    pub side_by_distance: f64,
    /// Preference for turning away from where the robot is seen: 0–1.5.
    pub side_by_bearing: f64,
    /// Rate of turns without a reason, 1/s: 0–0.02.
    pub lapses_per_s: f64,
    /// Rate of side changes while the predicted distance falls, 1/s: 0–0.25.
    pub reversals_per_s: f64,
    /// Weights of the three drives (predicted distance, bearing, repeller), which add up to 1:
    /// exponential, of means in the proportion 1.2 : 1.2 : 0.8.
    pub weights: [f64; 3],
    /// Preference for the left: normal, mean 0, standard deviation 0.5.
    pub side_bias: f64,
}

impl Person {
    pub(super) fn draw(stream: &mut Stream) -> Self {
        // The order of the fields is the order of the draws.
        let mut uniform = |low, high| stream.uniform(low, high);
        let lag_s = uniform(0.20, 0.40);
        let horizon_s = uniform(4.2, 7.0);
        let margin_m = uniform(0.6, 2.2);
        let bearing_threshold = uniform(1.2, 2.2);
        let repeller_angle_decay = uniform(1.5, 4.0);
        let repeller_distance_decay = uniform(0.06, 0.11);
        let repeller_gain = uniform(2.0, 3.0);
        let heading_noise_rad = uniform(0.03, 0.08);
        let time_noise = uniform(0.08, 0.25);
        let press_above = uniform(0.40, 0.60);
        let release_below = uniform(0.35, 0.70) * press_above;
        let activation_noise = uniform(0.15, 0.35);
        let overhold_s = uniform(0.1, 0.7);
        let side_by_distance = uniform(0.8, 2.5);
        let side_by_bearing = uniform(0.0, 1.5);
        let lapses_per_s = uniform(0.0, 0.02);
        let reversals_per_s = uniform(0.0, 0.25);
        let shares = [1.2, 1.2, 0.8].map(|mean| mean * stream.exponential(1.0));
        let sum: f64 = shares.iter().sum();
        Self {
            lag_s,
            horizon_s,
            margin_m,
            bearing_threshold,
            repeller_angle_decay,
            repeller_distance_decay,
            repeller_gain,
            heading_noise_rad,
            time_noise,
            press_above,
            release_below,
            activation_noise,
            overhold_s,
            side_by_distance,
            side_by_bearing,
            lapses_per_s,
            reversals_per_s,
            weights: shares.map(|share| share / sum),
            side_bias: 0.5 * stream.normal(),
        }
    }
}
