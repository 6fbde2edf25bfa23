//! The range of encounters that a study draws.

use crate::invalid::Invalid;
use serde::{Deserialize, Serialize};

/// Bounds of the drawn encounters: the table `[encounters]` of a study file.
///
/// | field | unit | default | accepted |
/// |---|---|---|---|
/// | `min_approach_rad` | rad | 0.35 (20°) | 0.05 to 3 |
/// | `max_miss_share` | – | 0.85 | above 0, at most 1 |
/// | `min_entry_s` | s | 2 | 0 to 600 |
/// | `max_entry_s` | s | 8 | above `min_entry_s`, at most 600 |
/// | `min_start_distance_m` | m | 7 | 0 to 1000 |
/// | `max_start_distance_m` | m | 24 | above `min_start_distance_m`, at most 1000 |
/// | `escape_clearance_m` | m | 0.3 | 0 to 100 |
/// | `escape_delay_s` | s | 1 | 0 to 60 |
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EncounterRange {
    /// Smallest angle between the headings (rad). Nearly parallel headings are excluded, because
    /// their closing speed is small and the vehicles would have to start too close to each other.
    pub min_approach_rad: f64,
    /// Largest |miss distance| as a share of R_c.
    pub max_miss_share: f64,
    /// Shortest time to the danger zone if neither vehicle turns (s).
    pub min_entry_s: f64,
    /// Longest time to the danger zone if neither vehicle turns (s). Scenes that reach the zone
    /// only after the end of the trial are never admitted.
    pub max_entry_s: f64,
    /// Smallest distance at the start (m).
    pub min_start_distance_m: f64,
    /// Largest distance at the start (m).
    pub max_start_distance_m: f64,
    /// Distance by which an escape must clear the danger zone (m).
    pub escape_clearance_m: f64,
    /// Earliest start of an escape (s), because a participant needs time to react.
    pub escape_delay_s: f64,
}

impl Default for EncounterRange {
    fn default() -> Self {
        Self {
            min_approach_rad: 0.35,
            max_miss_share: 0.85,
            min_entry_s: 2.0,
            max_entry_s: 8.0,
            min_start_distance_m: 7.0,
            max_start_distance_m: 24.0,
            escape_clearance_m: 0.3,
            escape_delay_s: 1.0,
        }
    }
}

impl EncounterRange {
    /// Checks that all bounds are valid.
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn check(&self) -> Result<(), Invalid> {
        let within = |field: &str, value: f64, [low, high]: [f64; 2], what: &str| {
            if (low..=high).contains(&value) {
                return Ok(());
            }
            Err(Invalid::new(field, format!("{what} from {low} to {high}"), value))
        };
        let above = |field: &str, value: f64, least: (&str, f64), most: f64, unit: &str| {
            if value > least.1 && value <= most {
                return Ok(());
            }
            let (name, low) = least;
            let expected = format!("{unit} above {name} = {low} and at most {most}");
            Err(Invalid::new(field, expected, value))
        };
        within("min_approach_rad", self.min_approach_rad, [0.05, 3.0], "radians (20° are 0.35)")?;
        if !(self.max_miss_share > 0.0 && self.max_miss_share <= 1.0) {
            let expected = "a share of the danger radius above 0 and at most 1";
            return Err(Invalid::new("max_miss_share", expected, self.max_miss_share));
        }
        within("min_entry_s", self.min_entry_s, [0.0, 600.0], "seconds")?;
        let least = ("min_entry_s", self.min_entry_s);
        above("max_entry_s", self.max_entry_s, least, 600.0, "seconds")?;
        within("min_start_distance_m", self.min_start_distance_m, [0.0, 1000.0], "metres")?;
        let least = ("min_start_distance_m", self.min_start_distance_m);
        above("max_start_distance_m", self.max_start_distance_m, least, 1000.0, "metres")?;
        within("escape_clearance_m", self.escape_clearance_m, [0.0, 100.0], "metres")?;
        within("escape_delay_s", self.escape_delay_s, [0.0, 60.0], "seconds")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn omitted_fields_take_their_defaults() {
        let range: EncounterRange = serde_json::from_str(r#"{"max_entry_s": 6}"#).unwrap();
        assert_eq!(range, EncounterRange { max_entry_s: 6.0, ..EncounterRange::default() });
        range.check().unwrap();
        assert!(serde_json::from_str::<EncounterRange>(r#"{"max_entry": 6}"#).is_err());
    }

    #[test]
    fn complaints_name_the_field_and_its_unit() {
        type Change = fn(&mut EncounterRange);
        let cases: [(Change, &str, &str); 12] = [
            // Degrees instead of radians, and milliseconds instead of seconds.
            (|r| r.min_approach_rad = 20.0, "min_approach_rad", "radians"),
            (|r| r.max_entry_s = 8000.0, "max_entry_s", "seconds"),
            (|r| r.min_approach_rad = 0.0, "min_approach_rad", "radians"),
            (|r| r.min_approach_rad = f64::NAN, "min_approach_rad", "radians"),
            (|r| r.max_miss_share = 0.0, "max_miss_share", "above 0"),
            (|r| r.max_miss_share = 2.55, "max_miss_share", "share"),
            (|r| r.min_entry_s = -1.0, "min_entry_s", "seconds"),
            (|r| r.min_entry_s = 8.0, "max_entry_s", "above min_entry_s = 8"),
            (|r| r.min_start_distance_m = 24.0, "max_start_distance_m", "metres"),
            (|r| r.max_start_distance_m = f64::INFINITY, "max_start_distance_m", "at most 1000"),
            (|r| r.escape_clearance_m = -0.3, "escape_clearance_m", "metres"),
            (|r| r.escape_delay_s = 1000.0, "escape_delay_s", "seconds"),
        ];
        for (change, field, words) in cases {
            let mut range = EncounterRange::default();
            change(&mut range);
            let invalid = range.check().unwrap_err();
            assert_eq!(invalid.field, field);
            assert!(invalid.expected.contains(words), "{invalid}");
        }
    }
}
