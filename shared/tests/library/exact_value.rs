//! Properties of the closed form of the game of two identical vehicles. It solves the game's
//! equation, its derivatives are correct, and both players achieve its value when they play
//! optimally.

use proptest::prelude::*;
use sidestep::math::{PI, SeededRng, TAU, hypot, sin_cos};
use sidestep::reachability::ExactValue;
use sidestep::vehicle::Pose;
use sidestep::vehicle::dubins::{arc, relative_state};

/// The paper's game: v = 2 m/s, ω = 0.5 rad/s, R = 3 m.
fn paper() -> ExactValue {
    ExactValue::new(2.0, 0.5, 3.0).expect("a game")
}

/// v = 5 m/s, ω = 1 rad/s, R = 5 m (Mitchell, Bayen and Tomlin 2005).
fn mitchell() -> ExactValue {
    ExactValue::new(5.0, 1.0, 5.0).expect("a game")
}

fn turning_radius_m(game: &ExactValue) -> f64 {
    game.speed_mps() / game.turn_rate_radps()
}

/// A relative state with the pursuer in a square whose half side is `span` turning radii.
fn random_state(game: &ExactValue, span: f64, rng: &mut SeededRng) -> [f64; 3] {
    let span = span * turning_radius_m(game);
    [rng.uniform(-span, span), rng.uniform(-span, span), rng.uniform(-PI, PI)]
}

// ---- the equation -----------------------------------------------------------

/// The switching functions ∂V/∂x·y − ∂V/∂y·x − ∂V/∂ψ and ∂V/∂ψ, which multiply the evader's and the
/// pursuer's turn rate in dV/dt, and the remaining part of dV/dt.
fn switching(game: &ExactValue, [x, y, psi]: [f64; 3], [p1, p2, p3]: [f64; 3]) -> [f64; 3] {
    let (sin, cos) = sin_cos(psi);
    [p1 * y - p2 * x - p3, p3, game.speed_mps() * (p1 * (cos - 1.0) + p2 * sin)]
}

#[test]
fn solves_the_equation_of_the_game() {
    for (seed, game) in [(1, paper()), (2, mitchell())] {
        let rate = game.turn_rate_radps();
        let mut rng = SeededRng::new(seed);
        let mut closing = 0;
        for _ in 0..100_000 {
            let state = random_state(&game, 6.0, &mut rng);
            let found = game.analyze(state);
            let [evader, pursuer, drift] = switching(&game, state, found.gradient);
            let hamiltonian = drift + rate * evader.abs() - rate * pursuer.abs();
            let gap = hypot(state[0], state[1]) - game.radius_m() - found.value;
            let residual = gap.min(hamiltonian);
            assert!(residual.abs() <= 1e-7, "{residual} at {state:?} {found:?}");
            closing += usize::from(gap > 1e-9);
        }
        assert!(closing > 40_000, "only {closing} states where the equation is H = 0");
    }
}

#[test]
fn the_turns_are_the_best_against_the_gradient() {
    let game = paper();
    let (rate, rho) = (game.turn_rate_radps(), turning_radius_m(&game));
    let mut rng = SeededRng::new(3);
    for _ in 0..100_000 {
        let state = random_state(&game, 6.0, &mut rng);
        let found = game.analyze(state);
        let [evader, pursuer, _] = switching(&game, state, found.gradient);
        assert_eq!(found.evader_turn.abs(), rate);
        assert!(found.evader_turn * evader >= rate * evader.abs() - 1e-12, "{state:?} {found:?}");
        // Driving straight is accepted within 10⁻⁴ rad of the surface on which it is optimal.
        let lost = found.pursuer_turn * pursuer + rate * pursuer.abs();
        assert!(lost <= rate * rho * 5.001e-9, "{lost} at {state:?} {found:?}");
        assert!([-rate, 0.0, rate].contains(&found.pursuer_turn));
    }
}

// ---- the gradient -----------------------------------------------------------

#[test]
fn the_gradient_is_that_of_the_value() {
    for (seed, game) in [(4, paper()), (5, mitchell())] {
        let rho = turning_radius_m(&game);
        let steps = [1e-5 * rho, 1e-5 * rho, 1e-5];
        let mut rng = SeededRng::new(seed);
        let mut smooth = 0;
        for _ in 0..50_000 {
            let state = random_state(&game, 6.0, &mut rng);
            let found = game.analyze(state);
            let moved = |axis: usize, by: f64| {
                let mut state = state;
                state[axis] += by;
                game.analyze(state)
            };
            let ends: Vec<_> = (0..3).map(|i| [moved(i, -steps[i]), moved(i, steps[i])]).collect();
            // Skip states where the difference crosses the kink, or where the gradient changes much
            // within a step.
            let is_smooth = ends.iter().flatten().all(|end| {
                let bend = |i: usize| (end.gradient[i] - found.gradient[i]).abs();
                end.evader_turn == found.evader_turn
                    && bend(0).max(bend(1)).max(bend(2) / rho) < 1e-3
            });
            if !is_smooth {
                continue;
            }
            smooth += 1;
            for axis in 0..3 {
                let [low, high] = ends[axis].map(|end| end.value);
                let difference = (high - low) / (2.0 * steps[axis]);
                let scale = if axis == 2 { rho } else { 1.0 };
                let error = (found.gradient[axis] - difference).abs() / scale;
                assert!(error <= 1e-6, "{error} of axis {axis} at {state:?} {found:?}");
            }
        }
        assert!(smooth > 49_500, "{smooth} smooth states");
    }
}

#[test]
fn on_the_kink_the_evader_turns_right() {
    let game = paper();
    for x in [1.0, 6.0, 10.0, 13.0, 20.0, 60.0] {
        let state = [x, 0.0, PI];
        let at = game.analyze(state);
        assert!(at.on_kink && at.evader_turn == -0.5, "{at:?}");
        // Next to the kink, V belongs to one of two sheets, which are mirror images.
        let sides = [1e-7, -1e-7].map(|y| game.analyze([x, y, PI]));
        assert!(sides.iter().all(|side| !side.on_kink));
        let [left] = sides.iter().filter(|s| s.evader_turn > 0.0).collect::<Vec<_>>()[..] else {
            panic!("one side turns left: {sides:?}")
        };
        let [right] = sides.iter().filter(|s| s.evader_turn < 0.0).collect::<Vec<_>>()[..] else {
            panic!("one side turns right: {sides:?}")
        };
        for i in 0..3 {
            assert!((at.gradient[i] - right.gradient[i]).abs() < 1e-6, "{at:?} {right:?}");
            let sign = if i == 0 { 1.0 } else { -1.0 };
            assert!((at.gradient[i] - sign * left.gradient[i]).abs() < 1e-6, "{at:?} {left:?}");
        }
        assert!((at.gradient[1] - left.gradient[1]).abs() > 1e-2, "no kink at {x}");
    }
}

#[test]
fn an_opening_range_is_its_own_value() {
    let game = paper();
    // The pursuer is behind the evader and heads away.
    let found = game.analyze([-6.0, 8.0, 0.75 * PI]);
    assert_eq!(found.value, 7.0);
    assert!((found.gradient[0] + 0.6).abs() < 1e-15 && (found.gradient[1] - 0.8).abs() < 1e-15);
    assert_eq!((found.gradient[2], found.on_kink), (0.0, false));
    // The evader turns away from the pursuer on its left, and the pursuer turns towards the evader.
    assert_eq!((found.evader_turn, found.pursuer_turn), (-0.5, 0.5));
    // If the pursuer faces the evader and both have the same heading, the pursuer drives straight.
    assert_eq!(game.analyze([-6.0, 0.0, 0.0]).pursuer_turn, 0.0);
    // If both are at the same position, there is no direction.
    let found = game.analyze([0.0, 0.0, 1.0]);
    assert_eq!((found.value, found.gradient), (-3.0, [0.0; 3]));
}

// ---- the reference ----------------------------------------------------------

/// The rows of a file of `tests/data`, as numbers.
fn rows<const N: usize>(text: &str) -> Vec<[f64; N]>
where
    [f64; N]: serde::de::DeserializeOwned,
{
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    reader.deserialize().map(|row| row.expect("a row of numbers")).collect()
}

fn check_states(game: ExactValue, text: &str) {
    let rows = rows::<4>(text);
    assert_eq!(rows.len(), 2000);
    for [x, y, psi, expected] in rows {
        let found = game.value([x, y, psi]);
        assert!((found - expected).abs() <= 1e-9, "V({x}, {y}, {psi}) = {found}, not {expected}");
    }
}

#[test]
fn values_of_the_reference() {
    check_states(paper(), include_str!("../data/states_paper.csv"));
    check_states(mitchell(), include_str!("../data/states_mitchell.csv"));
}

fn check_barrier(game: ExactValue, text: &str) {
    let states = rows::<3>(text);
    assert!(states.len() > 500);
    for state in states {
        let value = game.value(state);
        assert!(value.abs() <= 1e-6 * turning_radius_m(&game), "V{state:?} = {value}");
    }
}

#[test]
fn zero_on_the_barriers_of_the_reference() {
    check_barrier(paper(), include_str!("../data/barrier_paper.csv"));
    check_barrier(mitchell(), include_str!("../data/barrier_mitchell.csv"));
}

// ---- play -------------------------------------------------------------------

/// The angle by which a vehicle turns between two decisions (rad). On the kink, a pursuer that
/// decides first can choose the wrong side for one step. This costs the pursuer up to 2·|∂V/∂ψ|
/// times this angle. On the kink, |∂V/∂ψ| ≤ ρ, so the cost is less than the allowed 10⁻³ ρ.
const TURN_OF_A_STEP: f64 = 4e-4;

/// Allowed difference by which the outcome of a play is worse than V (turning radii).
const SLACK: f64 = 1e-3;

/// Number of plays against each habit.
const PLAYS: usize = 120;

/// Duration of a play, in units of the time for a half circle. Optimal play ends within one half
/// circle.
const HALF_CIRCLES: f64 = 1.5;

/// The vehicle that a driver controls.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Role {
    Evader,
    Pursuer,
}

/// The rule by which a driver chooses the turn rate.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Habit {
    /// Optimal according to the analysis.
    Optimal,
    /// The opposite of the optimal turn.
    Mirrored,
    /// A constant fraction of the maximum turn rate.
    Constant(f64),
    /// One bound and then the other, each for a random time.
    BangBang,
    /// Any turn rate, which changes at random times.
    Restless,
    /// The pursuer turns towards the evader, and the evader turns away from the pursuer.
    PointBlank,
    /// The pursuer turns towards the position that the evader will have if it drives straight for
    /// the time of a quarter circle. The evader turns away from the corresponding position of the
    /// pursuer.
    Lead,
    /// The turn that leads to the best value if it is held for a while, given the other vehicle's
    /// turn.
    Greedy,
    /// Optimal, but delayed.
    Late,
    /// One constant bound until a random time, and then another.
    OneSwitch,
}

const HABITS: [Habit; 13] = [
    Habit::Optimal,
    Habit::Mirrored,
    Habit::Constant(-1.0),
    Habit::Constant(0.0),
    Habit::Constant(1.0),
    Habit::Constant(0.4),
    Habit::BangBang,
    Habit::Restless,
    Habit::PointBlank,
    Habit::Lead,
    Habit::Greedy,
    Habit::Late,
    Habit::OneSwitch,
];

/// A driver with its state.
struct Driver {
    role: Role,
    habit: Habit,
    /// The current fraction of the maximum turn rate, for habits that hold it for a while.
    share: f64,
    /// Time of the next decision (rad of turning).
    next: f64,
}

impl Driver {
    fn new(role: Role, habit: Habit) -> Self {
        Self { role, habit, share: 0.0, next: 0.0 }
    }

    fn own(&self, game: &ExactValue, state: [f64; 3]) -> f64 {
        let found = game.analyze(state);
        match self.role {
            Role::Evader => found.evader_turn,
            Role::Pursuer => found.pursuer_turn,
        }
    }

    /// A pursuer turns towards (`x`, `y`) in its own frame, and an evader turns away from this
    /// point.
    fn towards(&self, x: f64, y: f64) -> f64 {
        let (x, y) = if self.role == Role::Pursuer { (x, y) } else { (-x, -y) };
        if x > 0.0 && y.abs() < TURN_OF_A_STEP * x { 0.0 } else { y.signum() }
    }

    /// The current turn rate. `other` is the turn rate of the other vehicle, if known.
    fn decide(
        &mut self,
        game: &ExactValue,
        poses: [Pose; 2],
        turned: f64,
        other: f64,
        rng: &mut SeededRng,
    ) -> f64 {
        let rate = game.turn_rate_radps();
        let state = relative_state(poses[0], poses[1]);
        let thinks = turned >= self.next;
        let share = match self.habit {
            Habit::Optimal => return self.own(game, state),
            Habit::Mirrored => return -self.own(game, state),
            Habit::Constant(share) => share,
            Habit::BangBang | Habit::Restless | Habit::OneSwitch => {
                if thinks {
                    let any = rng.uniform(-1.0, 1.0);
                    self.share = if self.habit == Habit::Restless { any } else { any.signum() };
                    let long = if self.habit == Habit::OneSwitch { PI } else { 0.5 };
                    self.next = turned + rng.uniform(0.0, long);
                    if self.habit == Habit::OneSwitch && turned > 0.0 {
                        self.next = f64::INFINITY;
                    }
                }
                self.share
            }
            Habit::PointBlank | Habit::Lead => {
                let [me, mut it] = match self.role {
                    Role::Evader => poses,
                    Role::Pursuer => [poses[1], poses[0]],
                };
                if self.habit == Habit::Lead {
                    it = arc(it, game.speed_mps(), 0.0, 0.5 * PI / rate);
                }
                let [x, y, _] = relative_state(me, it);
                self.towards(x, y)
            }
            Habit::Greedy => {
                if thinks {
                    self.next = turned + 0.02;
                    let after = |share: f64| {
                        let turns = match self.role {
                            Role::Evader => [share * rate, other],
                            Role::Pursuer => [other, share * rate],
                        };
                        let seconds = 0.02 / rate;
                        let [e, p] =
                            [0, 1].map(|i| arc(poses[i], game.speed_mps(), turns[i], seconds));
                        let value = game.value(relative_state(e, p));
                        if self.role == Role::Evader { -value } else { value }
                    };
                    let choices = [-1.0, 0.0, 1.0].map(|share| (after(share), share));
                    let best = |a: (f64, f64), b: (f64, f64)| if b.0 < a.0 { b } else { a };
                    self.share = choices.into_iter().fold((f64::INFINITY, 0.0), best).1;
                }
                self.share
            }
            Habit::Late => {
                if thinks {
                    self.next = turned + 0.3;
                    self.share = self.own(game, state) / rate;
                }
                self.share
            }
        };
        share * rate
    }
}

/// Distance of the origin from the line segment between two positions.
fn nearest_of_segment([ax, ay]: [f64; 2], [bx, by]: [f64; 2]) -> f64 {
    let (ux, uy) = (bx - ax, by - ay);
    let square = ux * ux + uy * uy;
    let share = if square > 0.0 { (-(ax * ux + ay * uy) / square).clamp(0.0, 1.0) } else { 0.0 };
    hypot(ax + share * ux, ay + share * uy)
}

/// The minimum range during a play from `state`, minus R (m). The driver under test decides first,
/// and the other driver knows this decision.
fn play(
    game: &ExactValue,
    state: [f64; 3],
    tested: Role,
    habit: Habit,
    rng: &mut SeededRng,
) -> f64 {
    let rate = game.turn_rate_radps();
    let seconds = TURN_OF_A_STEP / rate;
    let mut poses = [Pose::new(0.0, 0.0, 0.0), Pose::from(state)];
    let (us, them, theirs) = match tested {
        Role::Evader => (0, 1, Role::Pursuer),
        Role::Pursuer => (1, 0, Role::Evader),
    };
    let mut optimal = Driver::new(tested, Habit::Optimal);
    let mut adversary = Driver::new(theirs, habit);
    let offset = |poses: [Pose; 2]| [poses[1].x - poses[0].x, poses[1].y - poses[0].y];
    let mut nearest = f64::INFINITY;
    for step in 0..(HALF_CIRCLES * PI / TURN_OF_A_STEP) as usize {
        let turned = step as f64 * TURN_OF_A_STEP;
        let mut turns = [0.0; 2];
        turns[us] = optimal.decide(game, poses, turned, 0.0, rng);
        turns[them] = adversary.decide(game, poses, turned, turns[us], rng);
        let moved = [0, 1].map(|i| arc(poses[i], game.speed_mps(), turns[i], seconds));
        nearest = nearest.min(nearest_of_segment(offset(poses), offset(moved)));
        poses = moved;
    }
    nearest - game.radius_m()
}

/// Finds a state on the kink near the given state, by bisection in y. Returns the given state if
/// there is no kink.
fn kink(game: &ExactValue, [x, y, psi]: [f64; 3]) -> [f64; 3] {
    let mut ends = [-2.0, 2.0].map(|by| y + by * turning_radius_m(game));
    let turns_right = |y: f64| game.analyze([x, y, psi]).evader_turn < 0.0;
    let below = turns_right(ends[0]);
    if below == turns_right(ends[1]) {
        return [x, y, psi];
    }
    for _ in 0..60 {
        let middle = 0.5 * (ends[0] + ends[1]);
        ends[usize::from(turns_right(middle) != below)] = middle;
    }
    [x, ends[0], psi]
}

/// The start of a play: any state, or a state on a surface where the optimal turns jump.
fn start(game: &ExactValue, index: usize, rng: &mut SeededRng) -> [f64; 3] {
    let [x, y, psi] = random_state(game, 4.0, rng);
    match index % 8 {
        0 => [x.abs(), 0.0, PI], // head-on
        1 => kink(game, [x.abs(), 0.3 * y, psi]),
        2 => [x, y, 0.0],               // parallel
        3 => [x, 1e-3 * y, 1e-3 * psi], // in line
        _ => [x, y, psi],
    }
}

/// Makes `tested` play optimally against every habit of the other driver. `loss` converts the
/// outcome minus V (m) to the loss of `tested`, which must be at most [`SLACK`].
fn check_play(tested: Role, seed: u64, loss: impl Fn(f64) -> f64) {
    for habit in HABITS {
        let mut rng = SeededRng::new(seed);
        for index in 0..PLAYS {
            let game = if index / 8 % 2 == 0 { paper() } else { mitchell() };
            let state = start(&game, index, &mut rng);
            let (value, outcome) = (game.value(state), play(&game, state, tested, habit, &mut rng));
            let loss = loss(outcome - value) / turning_radius_m(&game);
            assert!(loss <= SLACK, "{habit:?} from {state:?}: {outcome} m, V = {value} m");
        }
    }
}

#[test]
fn the_evader_gets_at_least_the_value() {
    check_play(Role::Evader, 21, |gain| -gain);
}

#[test]
fn the_pursuer_concedes_at_most_the_value() {
    check_play(Role::Pursuer, 22, |gain| gain);
}

#[test]
fn plays_begin_on_the_kink() {
    let mut rng = SeededRng::new(23);
    let game = paper();
    let on_kink = |index: usize, rng: &mut SeededRng| {
        let state = start(&game, index, rng);
        // The state is not on the axis of symmetry, which is only a part of the kink.
        state[1].abs() > 1e-3 && game.analyze(state).on_kink
    };
    let found = (0..100).filter(|_| on_kink(1, &mut rng)).count();
    assert!(found >= 20, "{found} of 100");
}

// ---- batches and bits -------------------------------------------------------

#[test]
fn a_batch_gives_the_same_bits() {
    let game = paper();
    let mut rng = SeededRng::new(31);
    let states: Vec<_> = (0..10_000).map(|_| random_state(&game, 6.0, &mut rng)).collect();
    let mut values = vec![0.0; states.len()];
    game.values_into(&states, &mut values).unwrap();
    let mut parallel = vec![0.0; states.len()];
    game.parallel_values_into(&states, &mut parallel).unwrap();
    for ((&state, value), parallel) in states.iter().zip(values).zip(parallel) {
        assert_eq!(value.to_bits(), game.value(state).to_bits());
        assert_eq!(value.to_bits(), parallel.to_bits());
    }
    game.values_into(&[], &mut []).unwrap();
    game.parallel_values_into(&[], &mut []).unwrap();
}

#[test]
fn a_bad_batch_names_the_row() {
    let game = paper();
    let mut states = vec![[10.0, 0.0, 1.0]; 20];
    let mut values = vec![7.0; 20];
    states[17][1] = f64::NAN;
    states[18][0] = f64::INFINITY;
    for parallel in [false, true] {
        let refused = if parallel {
            game.parallel_values_into(&states, &mut values)
        } else {
            game.values_into(&states, &mut values)
        };
        let complaint = refused.unwrap_err();
        assert_eq!(complaint.to_string(), "states[17].y: expected a finite number, found NaN");
        assert_eq!(values, vec![7.0; 20]);
    }
    let complaint = game.values_into(&states, &mut values[1..]).unwrap_err();
    assert_eq!(complaint.to_string(), "out: expected 20 entries, found 19 entries");
}

#[test]
fn the_same_bits_everywhere() {
    // FNV-1a over the bits. The constant was computed natively on x86-64 and in WebAssembly. A
    // change of the formula can change this constant, but the hash must be the same on every
    // machine.
    let mut hash: u64 = 0xcbf2_9ce4_8422_2325;
    let mut rng = SeededRng::new(32);
    for _ in 0..10_000 {
        let found = mitchell().analyze(random_state(&mitchell(), 6.0, &mut rng));
        let turns = [found.value, found.evader_turn, found.pursuer_turn];
        for number in turns.into_iter().chain(found.gradient) {
            hash = (hash ^ number.to_bits()).wrapping_mul(0x0100_0000_01b3);
        }
    }
    assert_eq!(format!("{hash:016x}"), "a1b1c2555b511805");
}

// ---- properties -------------------------------------------------------------

/// Relative states of the paper's game, with x and y in m.
fn any_state() -> impl Strategy<Value = [f64; 3]> {
    (-25.0..25.0f64, -25.0..25.0f64, -10.0..10.0f64).prop_map(|(x, y, psi)| [x, y, psi])
}

/// A heading at or near a heading where a formula changes, and a position on or near an axis.
fn special_state() -> impl Strategy<Value = [f64; 3]> {
    let near = |places: [f64; 5]| {
        (prop::sample::select(places.to_vec()), prop::sample::select(vec![0.0, 1e-12, -1e-9, 1e-4]))
            .prop_map(|(place, by)| place + by)
    };
    let place = [-8.0, -4.0, 0.0, 4.0, 8.0];
    (near(place), near(place), near([-PI, -0.5 * PI, 0.0, PI, TAU])).prop_map(<[f64; 3]>::from)
}

fn state() -> impl Strategy<Value = [f64; 3]> {
    prop_oneof![3 => any_state(), 1 => special_state()]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn symmetric_in_the_evaders_axis(s in state()) {
        let [x, y, psi] = s;
        let (here, there) = (paper().analyze(s), paper().analyze([x, -y, -psi]));
        prop_assert!((here.value - there.value).abs() < 1e-12);
        // On the kink and straight ahead, both mirror images turn right.
        if !here.on_kink && !there.on_kink && y != 0.0 {
            prop_assert_eq!(here.evader_turn, -there.evader_turn);
        }
    }

    #[test]
    fn never_above_the_present_range(s in state()) {
        prop_assert!(paper().value(s) <= hypot(s[0], s[1]) - 3.0 + 1e-12);
        prop_assert!(paper().value(s) >= -3.0 - 1e-12);
    }

    #[test]
    fn scales_with_lengths_and_times(s in state(), length in 0.2..5.0f64, pace in 0.2..5.0f64) {
        let [x, y, psi] = s;
        let scaled = ExactValue::new(2.0 * length * pace, 0.5 * pace, 3.0 * length).unwrap();
        let value = scaled.value([x * length, y * length, psi]);
        prop_assert!((value - length * paper().value(s)).abs() < 1e-11);
    }

    #[test]
    fn falls_with_the_radius_one_for_one(s in state(), wider in 0.0..5.0f64) {
        let game = ExactValue::new(2.0, 0.5, 3.0 + wider).unwrap();
        prop_assert!((paper().value(s) - game.value(s) - wider).abs() < 1e-12);
        prop_assert!(game.value(s) <= paper().value(s));
    }

    /// |∂V/∂(x, y)| = 1 and |∂V/∂ψ| ≤ 2ρ. In particular, V has no jump anywhere, neither between
    /// its branches nor where the heading wraps.
    #[test]
    fn changes_no_faster_than_its_gradient(
        s in state(),
        by in (-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64),
        exponent in -9.0..0.0f64,
    ) {
        let scale = sidestep::math::exp(exponent * 2.3);
        let by = [by.0 * scale, by.1 * scale, by.2 * scale];
        let moved = [s[0] + by[0], s[1] + by[1], s[2] + by[2]];
        let change = (paper().value(moved) - paper().value(s)).abs();
        prop_assert!(change <= hypot(by[0], by[1]) + 8.0 * by[2].abs() + 1e-12);
        let [p1, p2, p3] = paper().analyze(s).gradient;
        let at_origin = s[0] == 0.0 && s[1] == 0.0;
        prop_assert!(at_origin || (hypot(p1, p2) - 1.0).abs() < 1e-12);
        prop_assert!(p3.abs() <= 8.0 + 1e-12);
    }

    #[test]
    fn positive_beyond_the_range_bound(bearing in -PI..PI, psi in -PI..PI, level in 0.0..5.0f64) {
        let range = paper().range_bound_m(level) + 1e-9;
        let (sin, cos) = sin_cos(bearing);
        prop_assert!(paper().value([range * cos, range * sin, psi]) > level);
    }

    #[test]
    fn the_range_itself_from_far_away(bearing in -PI..PI, psi in -PI..PI, exponent in 40.0..340.0f64) {
        let range = sidestep::math::exp(exponent);
        let (sin, cos) = sin_cos(bearing);
        let found = paper().analyze([range * cos, range * sin, psi]);
        prop_assert!((found.value - range).abs() <= 1e-15 * range);
        prop_assert!(found.gradient.iter().all(|p| p.is_finite()));
        // V is also correct where the square of the range overflows.
        let (x, y) = (1e300 * cos, 1e300 * sin);
        prop_assert!((paper().value([x, y, psi]) / 1e300 - 1.0).abs() <= 1e-15);
    }
}
