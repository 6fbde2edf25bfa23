//! How evenly the scenes of a phase are spread.

use super::PhaseDesign;
use serde::Serialize;
use sidestep::scene::{Coordinate, StratifiedScene, williams_block};

/// How evenly the scenes of a phase are spread over all participants.
#[derive(Clone, Debug, Serialize)]
pub struct Balance {
    phase: &'static str,
    scenes: usize,
    /// The number of participants after which the orders repeat.
    block: usize,
    /// The number of scenes of all participants.
    pub drawn: usize,
    /// The number of scenes whose strata differ from the planned strata.
    pub exchanged: usize,
    /// The number of strata without a scene, counted for each participant and added up.
    pub unfilled: usize,
    /// How often each approach stratum occurs at each position.
    approach_at_position: Option<Range>,
    /// How often each approach stratum directly follows each of the other approach strata. `None`
    /// if there is only one stratum.
    approach_after_approach: Option<Range>,
    /// How often each pair of strata occurs.
    approach_with_miss: Option<Range>,
    approach_with_entry: Option<Range>,
    miss_with_entry: Option<Range>,
}

/// The smallest and the greatest count.
#[derive(Clone, Copy, Debug, Serialize)]
struct Range {
    least: usize,
    most: usize,
}

impl Range {
    fn of(times: impl IntoIterator<Item = usize>) -> Option<Self> {
        times.into_iter().fold(None, |range, times| {
            let Self { least, most } = range.unwrap_or(Self { least: times, most: times });
            Some(Self { least: least.min(times), most: most.max(times) })
        })
    }
}

impl Balance {
    /// Explains the counts on stderr, for people. Programs read the JSON.
    pub fn explain(&self) {
        let Self { phase, drawn, exchanged, unfilled, .. } = self;
        let strata = 3 * drawn;
        let exchanged = match exchanged {
            0 => "every scene has the planned strata".to_owned(),
            _ => format!(
                "{exchanged} of {drawn} scenes have another miss or entry stratum than planned, because \
                 no admissible scene has the planned ones"
            ),
        };
        eprintln!(
            "{phase}: {exchanged}; {unfilled} of {strata} strata (three for each scene of a participant) \
             have no scene"
        );
    }

    /// How evenly these scenes are spread.
    #[must_use]
    pub fn of(design: &PhaseDesign) -> Self {
        let scenes = design.phase.scenes;
        let all = || design.people.iter().flatten();
        let unfilled = |person: &Vec<_>| {
            Coordinate::ALL
                .into_iter()
                .map(|coordinate| {
                    times(scenes, person, |scene: &StratifiedScene| {
                        scene.strata[coordinate as usize]
                    })
                })
                .map(|times| times.into_iter().filter(|times| *times == 0).count())
                .sum::<usize>()
        };
        let pairs = |first: Coordinate, second: Coordinate| {
            let pair = |scene: &StratifiedScene| {
                scene.strata[first as usize] * scenes + scene.strata[second as usize]
            };
            Range::of(times(scenes * scenes, all(), pair))
        };
        let approaches = |person: &[StratifiedScene]| -> Vec<usize> {
            person.iter().map(|scene| scene.strata[Coordinate::Approach as usize]).collect()
        };
        let people: Vec<Vec<usize>> =
            design.people.iter().map(|person| approaches(person)).collect();
        let positions = people.iter().flat_map(|order| order.iter().enumerate());
        let successions = people.iter().flat_map(|order| order.windows(2));
        let after = times(scenes * scenes, successions, |pair| pair[0] * scenes + pair[1]);
        let others = after.into_iter().enumerate();
        let others = others.filter(|(pair, _)| pair / scenes != pair % scenes);
        Self {
            phase: design.phase.phase.word(),
            scenes,
            block: williams_block(scenes),
            drawn: all().count(),
            exchanged: all().filter(|scene| scene.strata != scene.planned).count(),
            unfilled: design.people.iter().map(unfilled).sum(),
            approach_at_position: Range::of(times(
                scenes * scenes,
                positions,
                |(position, approach)| position * scenes + approach,
            )),
            approach_after_approach: Range::of(others.map(|(_, times)| times)),
            approach_with_miss: pairs(Coordinate::Approach, Coordinate::Miss),
            approach_with_entry: pairs(Coordinate::Approach, Coordinate::Entry),
            miss_with_entry: pairs(Coordinate::Miss, Coordinate::Entry),
        }
    }
}

/// How often each of the numbers 0 … `count` − 1 occurs.
pub fn times<T>(
    count: usize,
    items: impl IntoIterator<Item = T>,
    number: impl Fn(T) -> usize,
) -> Vec<usize> {
    let mut times = vec![0; count];
    for item in items {
        times[number(item)] += 1;
    }
    times
}
