//! The view of a value function, as a link encodes it.

use crate::document::decimal;
use crate::invalid::{Invalid, positive};
use crate::reachability::{ACCURACIES, Accuracy, METHODS, Method, Options, PursuitGame};
use crate::vehicle::VehicleModel;

/// What is shown of a value function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// V at one relative heading.
    Value,
    /// Error of a solver against the closed form, at one relative heading.
    Error,
    /// {V ≤ c} over x, y and ψ.
    Tube,
}

impl Shown {
    /// All variants with their words in links.
    pub const ALL: [(&'static str, Self); 3] =
        [("value", Self::Value), ("error", Self::Error), ("tube", Self::Tube)];
}

/// A value function and its view.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The game.
    pub game: PursuitGame,
    /// Solution method; `None` selects the best one.
    pub method: Option<Method>,
    /// Horizon of the game (s); infinite for the converged value.
    pub horizon_s: f64,
    /// The accuracy of the grid.
    pub accuracy: Accuracy,
    /// What is shown of the function.
    pub shown: Shown,
    /// Relative heading of the maps, in whole degrees from 0 to 359.
    pub psi_deg: u16,
    /// The level c of the tube (m).
    pub level_m: f64,
    /// Position of the cross-hair (m).
    pub at_m: [f64; 2],
    /// Whether optimal play from the cross-hair is shown.
    pub plays: bool,
    /// Azimuth and elevation of the view of the tube, in whole degrees.
    pub turned_deg: [i16; 2],
    /// Zoom of the tube, in per cent. At 100, the tube's box just fits into the picture from every
    /// side.
    pub zoom_percent: u16,
}

impl Default for View {
    fn default() -> Self {
        let vehicle = VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.5 };
        Self {
            game: PursuitGame { evader: vehicle, pursuer: vehicle, radius_m: 3.0 },
            method: None,
            horizon_s: f64::INFINITY,
            accuracy: Accuracy::Standard,
            shown: Shown::Value,
            psi_deg: 180,
            level_m: 0.0,
            at_m: [8.0, 2.0],
            plays: false,
            turned_deg: [-52, 26],
            zoom_percent: 125,
        }
    }
}

/// Largest coordinate of the cross-hair (m).
const FARTHEST_M: f64 = 1e4;

/// The smallest and the largest zoom (per cent).
pub const ZOOM_PERCENT: [u16; 2] = [50, 400];

impl View {
    /// The query parameters that [`Self::set`] accepts.
    pub const NAMES: [&str; 16] = [
        "evader-speed",
        "evader-turn-rate",
        "pursuer-speed",
        "pursuer-turn-rate",
        "radius",
        "horizon",
        "method",
        "accuracy",
        "show",
        "psi",
        "level",
        "at",
        "play",
        "around",
        "above",
        "zoom",
    ];

    /// The view that a query describes, and the error for its first invalid value, if any. Missing
    /// and invalid parameters keep their defaults; unknown names are ignored.
    pub fn of_query<'a>(
        query: impl IntoIterator<Item = (&'a str, &'a str)>,
    ) -> (Self, Option<Invalid>) {
        let mut view = Self::default();
        let mut refused = None;
        for (name, value) in query {
            if let Err(invalid) = view.set(name, value) {
                refused = refused.or(Some(invalid));
            }
        }
        (view, refused)
    }

    /// Sets one parameter of a query. The parameters are named like the command line's flags.
    ///
    /// # Errors
    /// [`Invalid`] with the name of an invalid parameter.
    pub fn set(&mut self, name: &str, value: &str) -> Result<(), Invalid> {
        let refuse = |expected: &str| Invalid::new(name, expected, found(value));
        let above_zero = || match decimal(value) {
            Some(number) => positive(name, number),
            None => Err(refuse("a finite number > 0")),
        };
        let whole = |low: i16, high: i16, expected: &str| {
            let number: Option<i16> = value.trim().replace('−', "-").parse().ok();
            number.filter(|n| (low..=high).contains(n)).ok_or_else(|| refuse(expected))
        };
        match name {
            "evader-speed" => self.game.evader.speed_mps = above_zero()?,
            "evader-turn-rate" => self.game.evader.turn_rate_radps = above_zero()?,
            "pursuer-speed" => self.game.pursuer.speed_mps = above_zero()?,
            "pursuer-turn-rate" => self.game.pursuer.turn_rate_radps = above_zero()?,
            "radius" => self.game.radius_m = above_zero()?,
            "horizon" => {
                let number = match value.trim() {
                    "inf" | "∞" => Some(f64::INFINITY),
                    text => decimal(text).filter(|seconds| *seconds > 0.0),
                };
                self.horizon_s = number.ok_or_else(|| refuse("a number > 0, or inf"))?;
            }
            "method" => {
                let known = METHODS.iter().find(|(word, ..)| *word == value);
                self.method = match (known, value) {
                    (Some((_, method, _)), _) => Some(*method),
                    (None, "best") => None,
                    (None, _) => return Err(refuse("best, exact, polar or cartesian")),
                };
            }
            "accuracy" => {
                let known = ACCURACIES.iter().find(|(word, ..)| *word == value);
                self.accuracy = known.ok_or_else(|| refuse("draft, standard or fine"))?.1;
            }
            "show" => {
                let known = Shown::ALL.iter().find(|(word, _)| *word == value);
                self.shown = known.ok_or_else(|| refuse("value, error or tube"))?.1;
            }
            "psi" => self.psi_deg = whole(0, 359, "whole degrees, 0 to 359")? as u16,
            "level" => {
                let level = decimal(value).filter(|level| level.abs() <= FARTHEST_M);
                self.level_m = level.ok_or_else(|| refuse("a level of V, m"))?;
            }
            "at" => {
                let at = value.split_once(',').and_then(|(x, y)| Some([decimal(x)?, decimal(y)?]));
                let at = at.filter(|at| at.iter().all(|metres| metres.abs() <= FARTHEST_M));
                self.at_m = at.ok_or_else(|| refuse("x,y of the pursuer, m"))?;
            }
            "play" => {
                self.plays = match value {
                    "yes" => true,
                    "no" => false,
                    _ => return Err(refuse("yes or no")),
                };
            }
            "around" => self.turned_deg[0] = whole(-180, 180, "whole degrees, −180 to 180")?,
            "above" => self.turned_deg[1] = whole(-90, 90, "whole degrees, −90 to 90")?,
            "zoom" => {
                let [low, high] = ZOOM_PERCENT.map(|percent| percent as i16);
                let expected = format!("whole per cent, {low} to {high}");
                self.zoom_percent = whole(low, high, &expected)? as u16;
            }
            _ => {}
        }
        Ok(())
    }

    /// The query with all parameters that differ from the defaults, joined by `&`. It needs no
    /// escaping.
    #[must_use]
    pub fn query(&self) -> String {
        let usual = Self::default();
        let mut parts = Vec::new();
        let mut add = |name: &str, value: String, usual: String| {
            if value != usual {
                parts.push(format!("{name}={value}"));
            }
        };
        for ((name, value), (_, usual)) in self.parameters().iter().zip(usual.parameters()) {
            add(name, value.clone(), usual);
        }
        let word = |shown: Shown| {
            let known = Shown::ALL.iter().find(|(_, known)| *known == shown);
            known.map_or_else(String::new, |(word, _)| (*word).to_owned())
        };
        add("show", word(self.shown), word(usual.shown));
        add("psi", self.psi_deg.to_string(), usual.psi_deg.to_string());
        add("level", plain(self.level_m), plain(usual.level_m));
        let at = |[x, y]: [f64; 2]| format!("{},{}", plain(x), plain(y));
        add("at", at(self.at_m), at(usual.at_m));
        let play = |plays: bool| if plays { "yes" } else { "no" }.to_owned();
        add("play", play(self.plays), play(usual.plays));
        add("around", self.turned_deg[0].to_string(), usual.turned_deg[0].to_string());
        add("above", self.turned_deg[1].to_string(), usual.turned_deg[1].to_string());
        add("zoom", self.zoom_percent.to_string(), usual.zoom_percent.to_string());
        parts.join("&")
    }

    /// The parameters that determine the value function, named as in links.
    #[must_use]
    pub fn parameters(&self) -> [(&'static str, String); 8] {
        let PursuitGame { evader, pursuer, radius_m } = self.game;
        let method = self.method.map_or("best", Method::name);
        let accuracy = ACCURACIES.iter().find(|(_, known, _)| *known == self.accuracy);
        let horizon =
            if self.horizon_s.is_finite() { plain(self.horizon_s) } else { "inf".to_owned() };
        [
            ("evader-speed", plain(evader.speed_mps)),
            ("evader-turn-rate", plain(evader.turn_rate_radps)),
            ("pursuer-speed", plain(pursuer.speed_mps)),
            ("pursuer-turn-rate", plain(pursuer.turn_rate_radps)),
            ("radius", plain(radius_m)),
            ("horizon", horizon),
            ("method", method.to_owned()),
            ("accuracy", accuracy.map_or("standard", |(word, ..)| word).to_owned()),
        ]
    }

    /// The method that solves this game.
    ///
    /// # Errors
    /// [`Invalid`] with the name of a parameter that is incompatible with the others.
    pub fn chosen(&self) -> Result<Method, Invalid> {
        let options =
            Options { method: self.method, horizon_s: self.horizon_s, ..Options::default() };
        options
            .method_for(&self.game)
            .map_err(|invalid| Invalid { field: parameter(&invalid.field).to_owned(), ..invalid })
    }

    /// The relative heading (rad).
    #[must_use]
    pub fn psi(&self) -> f64 {
        f64::from(self.psi_deg).to_radians()
    }
}

/// The name of a field of a game or solver on the command line and in links. Other fields keep
/// their names.
#[must_use]
pub fn parameter(field: &str) -> &str {
    match field {
        "evader.speed_mps" => "evader-speed",
        "evader.turn_rate_radps" => "evader-turn-rate",
        "pursuer.speed_mps" => "pursuer-speed",
        "pursuer.turn_rate_radps" => "pursuer-turn-rate",
        "radius_m" => "radius",
        "horizon_s" => "horizon",
        "range_m" => "range",
        other => other,
    }
}

/// Formats a number so that [`decimal`] parses it back exactly.
fn plain(number: f64) -> String {
    number.to_string()
}

/// The entered value; "nothing" if it is blank.
fn found(value: &str) -> &str {
    if value.trim().is_empty() { "nothing" } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn of(query: &str) -> (View, Option<Invalid>) {
        View::of_query(query.split('&').filter_map(|part| part.split_once('=')))
    }

    #[test]
    fn what_is_usual_needs_no_words() {
        assert_eq!(View::default().query(), "");
        assert_eq!(of(""), (View::default(), None));
        assert_eq!(of("row=yes&t=4"), (View::default(), None));
        assert_eq!(View::default().chosen(), Ok(Method::Exact));
    }

    #[test]
    fn a_query_names_everything() {
        let query = "evader-speed=1.5&evader-turn-rate=0.8&pursuer-speed=3&pursuer-turn-rate=0.35&\
                     radius=2.5&horizon=4&method=cartesian&accuracy=draft&show=tube&psi=90&\
                     level=-0.5&at=-3.25,4&play=yes&around=10&above=-40&zoom=200";
        let (view, refused) = of(query);
        assert_eq!(refused, None);
        assert_eq!(view.game.pursuer, VehicleModel { speed_mps: 3.0, turn_rate_radps: 0.35 });
        assert_eq!((view.horizon_s, view.method), (4.0, Some(Method::Cartesian)));
        assert_eq!(view.query(), query);
    }

    #[test]
    fn what_is_not_valid_is_named_and_as_usual() {
        for (query, expected) in [
            ("evader-speed=0", "a finite number > 0, found 0"),
            ("pursuer-turn-rate=-1", "a finite number > 0, found -1"),
            ("radius=", "a finite number > 0, found nothing"),
            ("radius=NaN", "a finite number > 0, found NaN"),
            ("horizon=0", "a number > 0, or inf, found 0"),
            ("method=fast", "best, exact, polar or cartesian"),
            ("accuracy=good", "draft, standard or fine"),
            ("show=all", "value, error or tube"),
            ("psi=360", "whole degrees, 0 to 359"),
            ("psi=1.5", "whole degrees, 0 to 359"),
            ("level=low", "a level of V, m"),
            ("at=3", "x,y of the pursuer, m"),
            ("at=1e9,0", "x,y of the pursuer, m"),
            ("play=maybe", "yes or no"),
            ("above=91", "whole degrees, −90 to 90"),
            ("zoom=10", "whole per cent, 50 to 400"),
        ] {
            let (view, refused) = of(&format!("{query}&psi=45"));
            let refused = refused.unwrap();
            assert_eq!(refused.field, query.split_once('=').unwrap().0);
            assert!(refused.to_string().contains(expected), "{query}: {refused}");
            assert_eq!(view.psi_deg, 45, "what comes after it counts");
        }
    }

    #[test]
    fn parameters_that_do_not_go_together_are_named_as_in_a_link() {
        let complaint = |query: &str| of(query).0.chosen().unwrap_err();
        let unequal = complaint("method=exact&evader-speed=1");
        assert_eq!(unequal.field, "method");
        assert!(unequal.expected.starts_with("polar or cartesian"), "{unequal}");
        let finite = complaint("method=exact&horizon=3");
        assert_eq!(
            finite.to_string(),
            "horizon: expected inf with method exact, or method polar, found 3"
        );
        assert_eq!(of("evader-speed=1").0.chosen(), Ok(Method::Polar));
        assert_eq!(of("horizon=3").0.chosen(), Ok(Method::Polar));
    }

    proptest! {
        #[test]
        fn a_link_brings_the_same_view_back(
            sizes in prop::array::uniform5(1u32..100_000), horizon in 0u32..1000, method in 0usize..4,
            accuracy in 0usize..3, shown in 0usize..3, psi in 0u16..360, level in -500i32..500,
            at in prop::array::uniform2(-100_000i32..100_000), plays: bool,
            turned in (-180i16..=180, -90i16..=90), zoom_percent in 50u16..=400,
        ) {
            let [a, b, c, d, radius_m] = sizes.map(|size| f64::from(size) / 1000.0);
            let vehicle = |speed_mps, turn_rate_radps| VehicleModel { speed_mps, turn_rate_radps };
            let view = View {
                game: PursuitGame { evader: vehicle(a, b), pursuer: vehicle(c, d), radius_m },
                method: METHODS.get(method).map(|(_, method, _)| *method),
                horizon_s: if horizon == 0 { f64::INFINITY } else { f64::from(horizon) / 10.0 },
                accuracy: ACCURACIES[accuracy].1,
                shown: Shown::ALL[shown].1,
                psi_deg: psi,
                level_m: f64::from(level) / 100.0,
                at_m: at.map(|mm| f64::from(mm) / 1000.0),
                plays,
                turned_deg: [turned.0, turned.1],
                zoom_percent,
            };
            prop_assert_eq!(of(&view.query()), (view, None));
        }
    }
}
