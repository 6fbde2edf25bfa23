//! The warning where a safety level cannot tell states apart.

use super::html::{fixed, listed};
use super::words;
use sidestep::comparison::Analysis;
use sidestep::safety::LevelQuality;
use sidestep::scene::Evader;

/// A warning for each level that is not sound; nothing where both are.
pub(super) fn banner_of(analysis: &Analysis) -> String {
    let Some(quality) = &analysis.data.safety else { return String::new() };
    let unsound = Evader::ALL.into_iter().filter(|evader| !quality.level(*evader).is_sound());
    unsound.map(|evader| banner(analysis, evader, quality.level(evader))).collect()
}

fn banner(analysis: &Analysis, evader: Evader, level: &LevelQuality) -> String {
    let name = match evader {
        Evader::Human => "<i>V</i><sub>HR</sub>",
        Evader::Robot => "<i>V</i><sub>RH</sub>",
    };
    let spread = if level.is_nearly_constant() {
        format!("{} mm", fixed(1e3 * level.spread_m, 1))
    } else {
        format!("{} m", fixed(level.spread_m, 2))
    };
    let what = match level.last_change_m {
        Some(moved) => format!(
            "<b>{name} did not converge.</b> Its solve gave up while it still moved by {} mm in \
             the last 16 sweeps over the grid, so that it may be too high by decimetres. That \
             happens where one vehicle is faster but turns worse: it can chase for as long as it \
             takes, and the true level is low and nearly the same in most states. Over the steps \
             that are compared it has a standard deviation of {spread}; how much of it is the \
             game’s and how much the solver’s is not known.",
            fixed(1e3 * moved, 1)
        ),
        None => format!(
            "<b>{name} is nearly the same in all steps.</b> Its standard deviation over the steps \
             that are compared is {spread}, less than its error may be ({} mm).",
            fixed(1e3 * level.accuracy_m, 0)
        ),
    };
    let settings = &analysis.settings;
    let sets = settings.sets.iter().chain(std::iter::once(&settings.history));
    let sets: Vec<String> = sets
        .filter(|set| set.features.has_level(evader))
        .map(|set| words::set(&set.name))
        .collect();
    format!(
        "<aside class=\"banner\" role=\"note\">{what} Models see every feature brought to the same \
         spread, and with it what is left of errors. The sets with it: {}. Do not take what they \
         gain or lose for an effect of safety levels.</aside>\n",
        listed(&sets)
    )
}
