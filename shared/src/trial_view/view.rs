//! The view of a trial, as a link to a replay encodes it.

use super::layers::LAYERS;
use super::style::{Palette, Sets, Style};
use crate::chart::number;
use crate::document::decimal;
use crate::invalid::Invalid;

/// The view of a trial.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Time since the start of the trial (s).
    pub time_s: f64,
    /// Playback speed, relative to real time.
    pub speed: f64,
    /// Whether each of [`LAYERS`] is shown.
    pub shown: [bool; LAYERS.len()],
    /// Style of the layers.
    pub style: Style,
}

/// The playback speeds that a page offers.
pub const SPEEDS: [f64; 6] = [0.25, 0.5, 1.0, 2.0, 4.0, 8.0];

/// Maximum number of levels of a value function, and of steps ahead, in a picture.
const MOST_LEVELS: usize = 8;
const MOST_STEPS: usize = 100;

impl Default for View {
    fn default() -> Self {
        Self {
            time_s: 0.0,
            speed: 1.0,
            shown: core::array::from_fn(|place| LAYERS[place].is_usual),
            style: Style::default(),
        }
    }
}

impl View {
    /// The query parameters that [`Self::set`] accepts.
    pub const NAMES: [&str; 7] = ["t", "speed", "show", "hr", "rh", "sets", "colours"];

    /// The query parameters that only the page uses. They say whether it plays trials in a row, and
    /// whether it shows the legend and the numbers.
    pub const PAGE_NAMES: [&str; 3] = ["row", "legend", "numbers"];

    /// The view that a query describes. Missing parameters keep their defaults; unknown names are ignored.
    ///
    /// # Errors
    /// [`Invalid`] with the name of an invalid parameter.
    pub fn of_query<'a>(
        query: impl IntoIterator<Item = (&'a str, &'a str)>,
    ) -> Result<Self, Invalid> {
        let mut view = Self::default();
        for (name, value) in query {
            view.set(name, value)?;
        }
        Ok(view)
    }

    /// Sets one parameter of a query.
    ///
    /// # Errors
    /// The errors of [`Self::of_query`].
    pub fn set(&mut self, name: &str, value: &str) -> Result<(), Invalid> {
        match name {
            "t" => {
                let expected = "a time in s from 0 on, such as 3.4";
                let time = decimal(value).filter(|time| *time >= 0.0);
                self.time_s = time.ok_or_else(|| Invalid::new(name, expected, value))?;
            }
            "speed" => {
                let speed = decimal(value).filter(|speed| SPEEDS.contains(speed));
                let expected = format!("one of {}", listed(&SPEEDS, ", "));
                self.speed = speed.ok_or_else(|| Invalid::new(name, expected, value))?;
            }
            "show" => {
                self.shown = [false; LAYERS.len()];
                for layer in value.split(',').filter(|layer| !layer.is_empty()) {
                    let place = LAYERS.iter().position(|known| known.name == layer);
                    let place = place.ok_or_else(|| {
                        let names: Vec<&str> = LAYERS.iter().map(|layer| layer.name).collect();
                        Invalid::new(name, format!("layers of {}", names.join(", ")), layer)
                    })?;
                    self.shown[place] = true;
                }
            }
            "hr" | "rh" => {
                let levels: Option<Vec<f64>> = value.split(',').map(decimal).collect();
                let levels = levels.filter(|levels| are_levels(levels));
                let expected = format!("1 to {MOST_LEVELS} rising levels in m, such as 0,0.5,1");
                let levels = levels.ok_or_else(|| Invalid::new(name, expected, value))?;
                self.style.levels_m[usize::from(name == "rh")] = levels;
            }
            "sets" => {
                self.style.sets = match value {
                    "tube" => Sets::Tube,
                    "steps" => Sets::EachStep,
                    _ => {
                        let step = value.parse().ok().filter(|k| (1..=MOST_STEPS).contains(k));
                        let expected = "tube, steps or the number of a step from 1";
                        Sets::Step(step.ok_or_else(|| Invalid::new(name, expected, value))?)
                    }
                };
            }
            "colours" => {
                self.style.palette = match value {
                    "paper" => Palette::Paper,
                    "safe" => Palette::Safe,
                    _ => return Err(Invalid::new(name, "paper or safe", value)),
                };
            }
            _ => {}
        }
        Ok(())
    }

    /// The query of the parameters that differ from the defaults, joined by `&`. It needs no escaping.
    #[must_use]
    pub fn query(&self) -> String {
        let usual = Self::default();
        let mut parts = Vec::new();
        if self.time_s > 0.0 {
            // Whole milliseconds, in plain digits. `number` would write 5·10⁷, which cannot be
            // parsed.
            parts.push(format!("t={}", (1000.0 * self.time_s).round() / 1000.0));
        }
        if self.speed != usual.speed {
            parts.push(format!("speed={}", number(self.speed)));
        }
        if self.shown != usual.shown {
            let shown = LAYERS.iter().zip(self.shown).filter(|(_, shown)| *shown);
            let names: Vec<&str> = shown.map(|(layer, _)| layer.name).collect();
            parts.push(format!("show={}", names.join(",")));
        }
        for (name, (levels, usual)) in
            ["hr", "rh"].into_iter().zip(self.style.levels_m.iter().zip(&usual.style.levels_m))
        {
            if levels != usual {
                parts.push(format!("{name}={}", listed(levels, ",")));
            }
        }
        match self.style.sets {
            Sets::Tube => {}
            Sets::EachStep => parts.push("sets=steps".to_owned()),
            Sets::Step(step) => parts.push(format!("sets={step}")),
        }
        if self.style.palette == Palette::Safe {
            parts.push("colours=safe".to_owned());
        }
        parts.join("&")
    }
}

/// Whether these levels can be drawn.
fn are_levels(levels: &[f64]) -> bool {
    (1..=MOST_LEVELS).contains(&levels.len())
        && levels.iter().all(|level| level.is_finite())
        && levels.windows(2).all(|pair| pair[0] < pair[1])
}

fn listed(numbers: &[f64], between: &str) -> String {
    let numbers: Vec<String> = numbers.iter().map(|&n| n.to_string()).collect();
    numbers.join(between)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Evader;
    use proptest::prelude::*;

    fn of(query: &str) -> Result<View, Invalid> {
        View::of_query(query.split('&').filter_map(|part| part.split_once('=')))
    }

    #[test]
    fn what_is_usual_needs_no_words() {
        assert_eq!(View::default().query(), "");
        assert_eq!(of("").unwrap(), View::default());
        assert_eq!(of("analysis=a&file=b").unwrap(), View::default());
    }

    #[test]
    fn a_query_names_everything() {
        let query = "t=3.4&speed=0.25&show=v-hr,samples&hr=-1,0,1.5&rh=2&sets=7&colours=safe";
        let view = of(query).unwrap();
        assert_eq!(view.style.levels(Evader::Human), [-1.0, 0.0, 1.5]);
        assert_eq!(view.style.sets, Sets::Step(7));
        assert_eq!(view.query(), query);
        assert_eq!(of("show=").unwrap().shown, [false; LAYERS.len()]);
    }

    #[test]
    fn every_name_is_taken() {
        for name in View::NAMES {
            assert_eq!(View::default().set(name, "?").unwrap_err().field, name);
        }
    }

    #[test]
    fn what_is_not_valid_is_named() {
        for (query, expected) in [
            ("t=-1", "a time in s from 0 on"),
            ("t=NaN", "a time in s from 0 on"),
            ("t=inf", "a time in s from 0 on"),
            ("t=", "a time in s from 0 on"),
            ("speed=3", "one of 0.25, 0.5, 1, 2, 4, 8"),
            ("show=v-hr,none", "layers of"),
            ("hr=", "1 to 8 rising levels"),
            ("hr=1,1", "1 to 8 rising levels"),
            ("rh=1,2,3,4,5,6,7,8,9", "1 to 8 rising levels"),
            ("rh=NaN", "1 to 8 rising levels"),
            ("sets=0", "tube, steps or the number of a step from 1"),
            ("sets=101", "tube, steps or the number of a step from 1"),
            ("colours=red", "paper or safe"),
        ] {
            let invalid = of(query).unwrap_err();
            assert_eq!(invalid.field, query.split_once('=').unwrap().0);
            assert!(invalid.expected.contains(expected), "{query}: {invalid}");
        }
    }

    proptest! {
        #[test]
        fn a_link_brings_the_same_view_back(
            ms in 0u32..100_000, speed in 0..SPEEDS.len(), shown in any::<[bool; LAYERS.len()]>(),
            levels in prop::collection::btree_set(-300i32..900, 1..8), step in 0usize..12, safe: bool,
        ) {
            let view = View {
                time_s: f64::from(ms) / 1000.0,
                speed: SPEEDS[speed],
                shown,
                style: Style {
                    levels_m: [levels.iter().map(|&cm| f64::from(cm) / 100.0).collect(), vec![0.0]],
                    sets: match step {
                        0 => Sets::Tube,
                        1 => Sets::EachStep,
                        _ => Sets::Step(step),
                    },
                    palette: if safe { Palette::Safe } else { Palette::Paper },
                },
            };
            prop_assert_eq!(of(&view.query()).unwrap(), view);
        }
    }
}
