//! The scenes of a study's participants, counterbalanced across them.

use super::assigned::Scene;
use super::encounter::{Encounter, no_scene, place as scene_of};
use super::parameters::SceneParameters;
use super::range::EncounterRange;
use super::rules::SceneRules;
use super::strata::{Coordinate, Strata, Stratification};
use super::williams::williams_order;
use crate::invalid::Invalid;
use crate::math::{SeededRng, TAU, wrap_angle};

/// A scene with its cell in the design.
#[derive(Clone, Debug, PartialEq)]
pub struct StratifiedScene {
    /// The start of the trial.
    pub scene: Scene,
    /// The encounter that follows if neither vehicle turns.
    pub encounter: Encounter,
    /// The strata of the encounter.
    pub strata: Strata,
    /// The planned strata. They differ from `strata` if the planned cell has no admissible scene,
    /// or if this scene exchanged a stratum with a scene whose planned cell has none.
    pub planned: Strata,
}

/// Number of draws in a cell before the cell counts as having no admissible scene.
const TRIES_IN_CELL: usize = 4;
/// Maximum number of scenes tried for an exchange.
const PARTNERS: usize = 64;
/// Maximum number of draws in growing neighbourhoods of a cell.
const TRIES: usize = 4000;

/// The `count` scenes, in order, of the participant at `place` (0, 1, 2, …) of a study's phase.
///
/// Within a participant, the scenes are a Latin hypercube: each of the encounter's three
/// coordinates falls once into each of its strata. Across participants, with N scenes in the phase:
///
/// - **Order.** The approach strata follow the rows of a Williams square ([`williams_order`]). Over
///   N participants (2N for odd N), each stratum occurs equally often at each position, and equally
///   often directly after each other stratum. This always holds.
/// - **Pairs.** Over N participants, each pair of an approach and a miss stratum is planned once,
///   and so is each pair of an approach and an entry stratum. To achieve this, the partners of each
///   approach stratum change from one participant to the next: the indices of the miss and entry
///   strata shift by strides that are coprime to N. Pairs of a miss and an entry stratum repeat as
///   rarely as two such shifts allow. After every N participants, the shifts get a new offset.
/// - **Labels.** The assignment of strata to positions in these patterns is drawn once per study,
///   so that neighbouring positions are not neighbouring angles, distances or times.
///
/// Many planned cells have no admissible scene. For example, vehicles that meet head-on after eight
/// seconds would start too far apart, and nearly parallel vehicles that meet after two seconds
/// would start too close. The scene of such a cell exchanges its entry stratum with another scene
/// of the participant, chosen at random among those for which both new cells have an admissible
/// scene. Thus the participant's scenes remain a Latin hypercube, and the pairs of approach and
/// miss strata remain as planned. If no entry strata can be exchanged, the scene exchanges its miss
/// stratum. If that is impossible too, the scene moves to the nearest possible cell, which leaves a
/// stratum empty. Scenes never lose their approach stratum.
///
/// The same seed and place give the same scenes on every platform. Each phase of a study needs its own seed.
///
/// # Errors
/// [`Invalid`] if no admissible scene is found for some approach stratum, which means that these
/// parameters leave the human no escape.
pub fn counterbalanced(
    parameters: &SceneParameters,
    range: &EncounterRange,
    count: usize,
    seed: u64,
    place: u64,
) -> Result<Vec<StratifiedScene>, Invalid> {
    let planned = planned_strata(count, seed, place);
    // The offset of 1 separates place 0 from the stream of the labels, and the odd multiplier gives
    // each participant a different seed.
    let seed = seed.wrapping_add(place.wrapping_add(1).wrapping_mul(0xD1B5_4A32_D192_ED03));
    let mut person = Person {
        parameters,
        rules: SceneRules::new(parameters, range),
        stratification: Stratification::new(parameters, range, count)?,
        rng: SeededRng::new(seed),
        strata: planned.clone(),
        drawn: Vec::with_capacity(count),
    };
    for cell in &planned {
        let drawn = person.draw_in(*cell);
        person.drawn.push(drawn);
    }
    for i in 0..count {
        if person.drawn[i].is_none() {
            let found = person.exchange(i, ENTRY) || person.exchange(i, MISS);
            if !found {
                person.move_near(i)?;
            }
        }
    }
    let Person { strata, drawn, .. } = person;
    let scenes = drawn.into_iter().flatten().zip(strata).zip(planned);
    Ok(scenes
        .map(|(((scene, encounter), strata), planned)| StratifiedScene {
            scene,
            encounter,
            strata,
            planned,
        })
        .collect())
}

// Indices into [`Strata`].
const APPROACH: usize = Coordinate::Approach as usize;
const MISS: usize = Coordinate::Miss as usize;
const ENTRY: usize = Coordinate::Entry as usize;

/// The scenes of one participant while they are drawn.
struct Person<'a> {
    parameters: &'a SceneParameters,
    rules: SceneRules<'a>,
    stratification: Stratification,
    rng: SeededRng,
    /// The cell of each scene.
    strata: Vec<Strata>,
    /// Each scene. `None` while its cell has no admissible scene.
    drawn: Vec<Option<(Scene, Encounter)>>,
}

impl Person<'_> {
    /// A scene in a cell. `None` if the cell seems to have no admissible scene.
    fn draw_in(&mut self, cell: Strata) -> Option<(Scene, Encounter)> {
        let count = self.strata.len() as f64;
        (0..TRIES_IN_CELL).find_map(|_| {
            let shares = cell.map(|stratum| (stratum as f64 + self.rng.unit()) / count);
            self.draw_at(shares)
        })
    }

    /// The scene at these shares of the coordinates' ranges, rotated at random, if it is
    /// admissible.
    fn draw_at(&mut self, shares: [f64; 3]) -> Option<(Scene, Encounter)> {
        let encounter = self.stratification.encounter(shares);
        let turn_rad = wrap_angle(self.rng.uniform(0.0, TAU));
        let scene = scene_of(self.parameters, encounter, turn_rad);
        self.rules.admit(&scene).then_some((scene, encounter))
    }

    /// Exchanges the strata of one coordinate between scene `i` and another scene, if both new
    /// cells have an admissible scene. Returns whether this was possible.
    fn exchange(&mut self, i: usize, coordinate: usize) -> bool {
        let partners = self.rng.permutation(self.strata.len());
        partners.into_iter().filter(|j| *j != i).take(PARTNERS).any(|j| {
            let [mut first, mut second] = [self.strata[i], self.strata[j]];
            std::mem::swap(&mut first[coordinate], &mut second[coordinate]);
            let Some(drawn) = self.draw_in(first) else { return false };
            let Some(partner) = self.draw_in(second) else { return false };
            [self.strata[i], self.strata[j]] = [first, second];
            [self.drawn[i], self.drawn[j]] = [Some(drawn), Some(partner)];
            true
        })
    }

    /// Moves scene `i` to the first admissible encounter in growing neighbourhoods of its miss and
    /// entry strata.
    fn move_near(&mut self, i: usize) -> Result<(), Invalid> {
        let cell = self.strata[i];
        let count = self.strata.len() as f64;
        for attempt in 1..=TRIES {
            let reach = attempt as f64 / TRIES as f64;
            let approach = (cell[APPROACH] as f64 + self.rng.unit()) / count;
            let [miss, entry] = [cell[MISS], cell[ENTRY]].map(|stratum| {
                let middle = (stratum as f64 + 0.5) / count;
                let [low, high] = [(middle - reach).max(0.0), (middle + reach).min(1.0)];
                self.rng.uniform(low, high)
            });
            if let Some(drawn) = self.draw_at([approach, miss, entry]) {
                let stratum = |share: f64| ((share * count) as usize).min(self.strata.len() - 1);
                self.strata[i] = [cell[APPROACH], stratum(miss), stratum(entry)];
                self.drawn[i] = Some(drawn);
                return Ok(());
            }
        }
        Err(no_scene(TRIES))
    }
}

/// The cells planned for the participant at `place`, in the order of the scenes.
fn planned_strata(count: usize, seed: u64, place: u64) -> Vec<Strata> {
    if count == 0 {
        return Vec::new();
    }
    let mut rng = SeededRng::new(seed);
    let labels: [Vec<usize>; 3] = std::array::from_fn(|_| rng.permutation(count));
    let modulus = count as u64;
    let (block, place_in_block) = (place / modulus, place % modulus);
    let [miss, entry] = strides(modulus).map(|stride| place_in_block * stride % modulus);
    // From one block of `count` participants to the next, the offset of the miss strata grows by
    // one. The offset of the entry strata grows by one after every two blocks.
    let [miss, entry] = [miss + block % modulus, entry + block / 2 % modulus];
    let shifted = |part: usize, shift: u64| ((part as u64 + shift) % modulus) as usize;
    williams_order(count, place)
        .into_iter()
        .map(|part| [part, shifted(part, miss), shifted(part, entry)])
        .map(|parts| std::array::from_fn(|coordinate| labels[coordinate][parts[coordinate]]))
        .collect()
}

/// The strides by which the miss and the entry strata shift from one participant to the next. Both
/// strides are coprime to `count`, so that each pair with an approach stratum occurs once over
/// `count` participants. Over these participants, a pair of a miss and an entry stratum occurs
/// either never or gcd(`count`, difference of the strides) times. A miss or entry stratum occurs at
/// a position either never or gcd(`count`, its stride + 1) times. These numbers are as small as
/// strides below [`LARGEST_STRIDE`] allow.
fn strides(count: u64) -> [u64; 2] {
    let coprime = |stride: &u64| common_divisor(*stride, count) == 1;
    let candidates = || (1..LARGEST_STRIDE).filter(coprime);
    candidates()
        .flat_map(|miss| candidates().map(move |entry| [miss, entry]))
        .min_by_key(|[miss, entry]| {
            let repeats = [miss.abs_diff(*entry), miss + 1, entry + 1]
                .map(|distance| common_divisor(distance, count));
            (repeats.into_iter().max(), repeats.iter().sum::<u64>(), repeats)
        })
        .unwrap_or([1, 1])
}

/// Exclusive upper bound of the strides.
const LARGEST_STRIDE: u64 = 12;

/// The greatest common divisor. Returns `b` if `a` is 0.
fn common_divisor(a: u64, b: u64) -> u64 {
    if a == 0 { b } else { common_divisor(b % a, a) }
}

#[cfg(test)]
mod tests {
    use super::super::williams::williams_block;
    use super::*;
    use crate::math::PI;
    use sha2::{Digest, Sha256};

    const SEED: u64 = 20_180_918;

    fn scenes(count: usize, place: u64) -> Vec<StratifiedScene> {
        let range = EncounterRange::default();
        counterbalanced(&SceneParameters::default(), &range, count, SEED, place).unwrap()
    }

    /// The number of occurrences of each pair of strata of two coordinates.
    fn pairs(cells: &[Strata], count: usize, [a, b]: [usize; 2]) -> Vec<usize> {
        let mut times = vec![0; count * count];
        for cell in cells {
            times[cell[a] * count + cell[b]] += 1;
        }
        times
    }

    #[test]
    fn each_pair_with_an_approach_is_planned_once_in_as_many_participants_as_scenes() {
        for count in [1, 2, 3, 6, 7, 20, 48, 50] {
            for first in [0, 5 * count] {
                let places = first as u64..(first + count) as u64;
                let cells: Vec<_> =
                    places.flat_map(|place| planned_strata(count, SEED, place)).collect();
                assert!(pairs(&cells, count, [APPROACH, MISS]).iter().all(|&n| n == 1), "{count}");
                assert!(pairs(&cells, count, [APPROACH, ENTRY]).iter().all(|&n| n == 1), "{count}");
            }
        }
    }

    #[test]
    fn pairs_of_miss_and_entry_repeat_as_little_as_they_can() {
        // If the count is even, both strides are odd. The first block then contains half of the
        // pairs, each twice, and the second block contains the other half.
        for (count, blocks, expected) in [(7, 1, 1), (25, 1, 1), (20, 2, 2), (50, 2, 2)] {
            let places = 0..(blocks * count) as u64;
            let cells: Vec<_> =
                places.flat_map(|place| planned_strata(count, SEED, place)).collect();
            let times = pairs(&cells, count, [MISS, ENTRY]);
            assert!(times.iter().all(|&n| n == expected), "{count} {times:?}");
        }
    }

    #[test]
    fn approaches_are_balanced_over_positions_and_successions() {
        for count in [6, 3] {
            let block = williams_block(count);
            let mut positions = vec![0; count * count];
            let mut successions = vec![0; count * count];
            for place in 0..block as u64 {
                let order: Vec<usize> =
                    scenes(count, place).iter().map(|drawn| drawn.strata[APPROACH]).collect();
                for (position, approach) in order.iter().enumerate() {
                    positions[position * count + approach] += 1;
                }
                for pair in order.windows(2) {
                    successions[pair[0] * count + pair[1]] += 1;
                }
            }
            assert!(positions.iter().all(|&n| n == block / count), "{positions:?}");
            for (pair, times) in successions.into_iter().enumerate() {
                let repeats = pair % count == pair / count;
                assert_eq!(times, if repeats { 0 } else { block / count });
            }
        }
    }

    #[test]
    fn each_participant_meets_every_stratum_once() {
        let mut emptied = 0;
        let mut moved = 0;
        for place in 0..100 {
            let drawn = scenes(50, place);
            for coordinate in [APPROACH, MISS, ENTRY] {
                let mut met = vec![false; 50];
                drawn.iter().for_each(|scene| met[scene.strata[coordinate]] = true);
                let empty = met.into_iter().filter(|met| !met).count();
                assert!(coordinate != APPROACH || empty == 0);
                emptied += empty;
            }
            assert!(drawn.iter().all(|scene| scene.strata[APPROACH] == scene.planned[APPROACH]));
            moved += drawn.iter().filter(|scene| scene.strata[MISS] != scene.planned[MISS]).count();
        }
        // The limits are for 15 000 strata and 5000 scenes.
        assert!(emptied <= 30, "{emptied}");
        assert!(moved <= 50, "{moved}");
    }

    #[test]
    fn scenes_are_admissible_and_within_their_strata() {
        let parameters = SceneParameters::default();
        let range = EncounterRange::default();
        let strata = Stratification::new(&parameters, &range, 50).unwrap();
        for StratifiedScene { scene, encounter, strata: cell, .. } in scenes(50, 3) {
            assert!(super::super::is_admissible(&parameters, &range, &scene));
            let values = [encounter.approach_rad, encounter.miss_m, encounter.entry_s];
            for (k, coordinate) in Coordinate::ALL.into_iter().enumerate() {
                let [low, high] = strata.ends(coordinate, cell[k]);
                assert!((low..=high).contains(&values[k]), "{coordinate:?} {cell:?} {encounter:?}");
            }
        }
    }

    /// In the map of approach and entry strata, no part with admissible scenes is empty or crowded.
    #[test]
    fn exchanged_entries_are_spread_evenly() {
        let mut map = [[0; 5]; 5];
        for place in 0..100 {
            for scene in scenes(50, place) {
                map[scene.strata[APPROACH] / 10][scene.strata[ENTRY] / 10] += 1;
            }
        }
        // If all cells had admissible scenes, 5000 scenes would give 200 per cell.
        for (approach, row) in map.iter().enumerate() {
            for (entry, times) in row.iter().enumerate() {
                let too_far = matches!(approach, 0 | 4) && entry >= 3;
                let expected = if too_far { 0..=100 } else { 25..=500 };
                assert!(expected.contains(times), "{map:?}");
            }
        }
    }

    #[test]
    fn a_seed_and_a_place_name_their_scenes() {
        assert_eq!(scenes(5, 9), scenes(5, 9));
        assert_ne!(scenes(5, 9), scenes(5, 10));
        assert_ne!(scenes(1, 0)[0].encounter, scenes(1, 1)[0].encounter);
        assert_eq!(scenes(3, u64::MAX).len(), 3);
        assert!(scenes(0, 0).is_empty());
        let angle = scenes(1, 0)[0].encounter.approach_rad.abs();
        assert!((0.35..=PI).contains(&angle));
    }

    /// The scenes of a place are still the scenes of the first version of this method.
    #[test]
    fn scenes_of_a_place_never_change() {
        let mut hash = Sha256::new();
        for place in [0, 1, 49, 50, 1000] {
            for StratifiedScene { scene, strata, .. } in scenes(50, place) {
                let Scene { human, robot, goal, .. } = scene;
                let numbers = [human.into(), robot.into(), [goal[0], goal[1], 0.0]];
                let strata = strata.map(|stratum| stratum as f64);
                let numbers = numbers.concat().into_iter().chain(strata);
                hash.update(numbers.flat_map(f64::to_le_bytes).collect::<Vec<_>>());
            }
        }
        let hash: String = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(hash, "b0203263e47749fb1d47939690e0b4bc0547756c253ada8eefaaec5e0c618b54");
    }

    #[test]
    fn hopeless_parameters_are_refused() {
        let range = EncounterRange::default();
        let hopeless = [
            SceneParameters { danger_radius_m: 30.0, ..SceneParameters::default() },
            SceneParameters { steps: 1, ..SceneParameters::default() },
        ];
        for parameters in hopeless {
            let invalid = counterbalanced(&parameters, &range, 1000, 0, 0).unwrap_err();
            assert_eq!(invalid.field, "parameters");
            assert!(invalid.expected.contains("duration"), "{invalid}");
        }
    }
}
