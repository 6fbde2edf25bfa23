//! Checks areas of tubes against the closed form, for bounds that always admit straight driving.

use std::error::Error;

use serde_json::json;
use sidestep::bounds::InputBounds;
use sidestep::math::SeededRng;
use sidestep::reach::PolygonSettings;
use sidestep::reach::polygon::signed_area;
use sidestep::scene::SceneParameters;
use sidestep::shfrs::widened::tube_area_m2;
use sidestep::vehicle::Pose;

use crate::drives::{Kind, set};
use crate::{Found, RATE_RADPS};

const BOUNDS: usize = 1000;
/// Maximum number of steps.
const STEPS: usize = 15;
const ACCURACY_M: f64 = 1e-5;

pub(crate) fn check() -> Found {
    let mut rng = SeededRng::new(63);
    let settings = PolygonSettings::new(ACCURACY_M, 4)?;
    let areas = |rates: &(Vec<f64>, Vec<f64>)| -> Result<(f64, f64), Box<dyn Error>> {
        let polygon = set(Pose::new(0.0, 0.0, 0.0), rates)?.tube_polygon(settings);
        let range = (-RATE_RADPS, RATE_RADPS);
        let bounds = InputBounds::new(rates.0.clone(), rates.1.clone(), range)?;
        Ok((signed_area(&polygon), tube_area_m2(&bounds, &SceneParameters::default())?))
    };
    let everything_m2 = areas(&Kind::Everything.bounds(10, &mut rng))?;
    let (mut worst_m2, mut worst_share) = (0.0_f64, 0.0_f64);
    for _ in 0..BOUNDS {
        let (found, exact) = areas(&Kind::Straight.bounds(1 + rng.below(STEPS), &mut rng))?;
        let error = (found - exact).abs();
        worst_m2 = worst_m2.max(error);
        if exact >= 0.1 {
            worst_share = worst_share.max(error / exact);
        }
    }
    Ok(json!({
        "bounds": BOUNDS,
        "steps": STEPS,
        "accuracy_m": ACCURACY_M,
        // Maximum error of the area, and maximum relative error of areas of at least 0.1 m².
        "worst_m2": worst_m2,
        "worst_share": worst_share,
        // Area that is reachable in ten steps with all turn rates: computed from the polygon, and
        // by the closed form.
        "everything_m2": everything_m2,
    }))
}
