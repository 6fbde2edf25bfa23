//! The strata of encounters: equal parts of the three coordinates over which scenes are spread.

use super::encounter::Encounter;
use super::parameters::SceneParameters;
use super::range::EncounterRange;
use crate::invalid::Invalid;
use crate::math::PI;

/// A coordinate of an encounter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coordinate {
    /// Human's heading minus the robot's heading (rad).
    Approach,
    /// Signed distance of closest approach if neither vehicle turns (m).
    Miss,
    /// Time at which the distance falls to R_c if neither vehicle turns (s).
    Entry,
}

impl Coordinate {
    /// All coordinates, in the order of their strata and shares.
    pub const ALL: [Self; 3] = [Self::Approach, Self::Miss, Self::Entry];

    /// The coordinate's name in tables.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Approach => "approach",
            Self::Miss => "miss",
            Self::Entry => "entry",
        }
    }
}

/// The strata of an encounter, counted from the lowest (0), in the order of [`Coordinate::ALL`].
pub type Strata = [usize; 3];

/// The strata of a phase's encounters: each coordinate is split into `count` equal parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stratification {
    count: usize,
    min_approach_rad: f64,
    max_miss_m: f64,
    entry_s: [f64; 2],
}

impl Stratification {
    /// A stratification for a phase with `count` scenes. The range of entry times ends at the end
    /// of the trial, because a scene that enters the danger zone later is never admitted.
    ///
    /// # Errors
    /// [`Invalid`] if the trial ends before the shortest entry time.
    pub fn new(
        parameters: &SceneParameters,
        range: &EncounterRange,
        count: usize,
    ) -> Result<Self, Invalid> {
        let whole = Self::beyond_the_trial(parameters, range, count);
        let [least, greatest] = whole.entry_s;
        let duration_s = parameters.duration_s();
        if duration_s <= least {
            let expected =
                format!("a duration (steps × step_s) longer than min_entry_s = {least} s");
            return Err(Invalid::new("parameters", expected, format!("{duration_s} s")));
        }
        Ok(Self { entry_s: [least, greatest.min(duration_s)], ..whole })
    }

    /// Like [`Self::new`], but with all entry times of the range, including times after the end of
    /// the trial.
    pub(super) fn beyond_the_trial(
        parameters: &SceneParameters,
        range: &EncounterRange,
        count: usize,
    ) -> Self {
        Self {
            count,
            min_approach_rad: range.min_approach_rad,
            max_miss_m: range.max_miss_share * parameters.danger_radius_m,
            entry_s: [range.min_entry_s, range.max_entry_s],
        }
    }

    /// Number of strata of each coordinate.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// The encounter at these shares of the coordinates' ranges. Each share is in [0, 1).
    #[must_use]
    pub fn encounter(&self, [approach, miss, entry]: [f64; 3]) -> Encounter {
        Encounter {
            approach_rad: self.value(Coordinate::Approach, approach),
            miss_m: self.value(Coordinate::Miss, miss),
            entry_s: self.value(Coordinate::Entry, entry),
        }
    }

    /// Both ends of a stratum (rad, m or s). With an odd number of strata, the middle stratum
    /// contains the approach angles between −`min_approach_rad` and `min_approach_rad`, but these
    /// angles are not drawn.
    #[must_use]
    pub fn ends(&self, coordinate: Coordinate, stratum: usize) -> [f64; 2] {
        let share = |edge: usize| edge as f64 / self.count as f64;
        let low = self.value(coordinate, share(stratum));
        if coordinate == Coordinate::Approach && 2 * (stratum + 1) == self.count {
            // The last negative stratum ends where the gap begins.
            return [low, -self.min_approach_rad];
        }
        [low, self.value(coordinate, share(stratum + 1))]
    }

    /// The value at a share of a coordinate's range (rad, m or s).
    fn value(&self, coordinate: Coordinate, share: f64) -> f64 {
        match coordinate {
            Coordinate::Approach => {
                let signed = 2.0 * share - 1.0;
                let size = self.min_approach_rad + (PI - self.min_approach_rad) * signed.abs();
                if signed < 0.0 { -size } else { size }
            }
            Coordinate::Miss => self.max_miss_m * (2.0 * share - 1.0),
            Coordinate::Entry => self.entry_s[0] + (self.entry_s[1] - self.entry_s[0]) * share,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strata(count: usize) -> Stratification {
        let range = EncounterRange::default();
        Stratification::new(&SceneParameters::default(), &range, count).unwrap()
    }

    #[test]
    fn strata_follow_each_other_from_end_to_end() {
        for count in [1, 2, 3, 50] {
            let strata = strata(count);
            let all = [[-PI, PI], [-2.55, 2.55], [2.0, 8.0]];
            for (coordinate, [low, high]) in Coordinate::ALL.into_iter().zip(all) {
                let ends: Vec<_> = (0..count).map(|k| strata.ends(coordinate, k)).collect();
                assert!((ends[0][0] - low).abs() < 1e-12, "{coordinate:?} {ends:?}");
                assert!((ends[count - 1][1] - high).abs() < 1e-12, "{coordinate:?} {ends:?}");
                for (k, pair) in ends.windows(2).enumerate() {
                    let gap = pair[1][0] - pair[0][1];
                    let is_middle = coordinate == Coordinate::Approach && 2 * (k + 1) == count;
                    let expected = if is_middle { 0.7 } else { 0.0 };
                    assert!((gap - expected).abs() < 1e-12, "{coordinate:?} {ends:?}");
                }
            }
        }
    }

    #[test]
    fn entries_end_with_the_trial() {
        let range = EncounterRange::default();
        let parameters = SceneParameters { steps: 20, ..SceneParameters::default() };
        let strata = Stratification::new(&parameters, &range, 4).unwrap();
        assert_eq!(strata.ends(Coordinate::Entry, 3), [3.5, 4.0]);
        let parameters = SceneParameters { steps: 10, ..SceneParameters::default() };
        let invalid = Stratification::new(&parameters, &range, 4).unwrap_err();
        assert_eq!(invalid.field, "parameters");
        assert!(invalid.to_string().contains("min_entry_s = 2 s, found 2 s"), "{invalid}");
    }
}
