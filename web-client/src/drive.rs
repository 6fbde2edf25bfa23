//! A scene in progress. Its steps follow the clock, and the motion between steps is smooth.

use crate::input::{HeldKeys, KeyMap, input_at};
use crate::runtime::Event;
use sidestep::api::{KeyEvent, MAX_KEY_EVENTS, MAX_PAGE_EVENTS, Object, TrialUpload};
use sidestep::picture::Window;
use sidestep::scene::{JointState, Scene, SceneParameters};
use sidestep::trial::{PageEvent, PageEventKind};
use sidestep::vehicle::TurnInput;

/// The robot's turn rate (rad/s) in the step that begins in the last of these states.
pub type RobotTurnRate = Box<dyn Fn(&[JointState]) -> f64>;

/// The turn rate of a robot that drives straight.
#[must_use]
pub fn straight() -> RobotTurnRate {
    Box::new(|_| 0.0)
}

/// A scene in progress.
///
/// Steps follow the clock, never the number of frames. Step i is due i · `step_s` after the start.
/// Its input depends on the keys that are down at that time, according to the time stamps of the
/// key events. So a late call delays the computation of a step, but does not change its result. A
/// key press just before a step counts even if it is reported just after the step.
pub struct Drive {
    parameters: SceneParameters,
    robot_turn_rate: RobotTurnRate,
    keys: KeyMap,
    /// Start time on the page's clock (ms).
    start_ms: f64,
    /// Start time on the participant's clock (ms since 1970).
    started_at_ms: f64,
    inputs: Vec<TurnInput>,
    states: Vec<JointState>,
    sampled_at_ms: Vec<f64>,
    key_events: Vec<KeyEvent>,
    page_events: Vec<PageEvent>,
    frames: FrameTimes,
}

/// Intervals between frames, and the time spent on the work of each frame (ms).
#[derive(Clone, Debug, Default)]
struct FrameTimes {
    last_ms: Option<f64>,
    gaps_ms: Vec<f64>,
    work_ms: Vec<f64>,
}

/// A frame interval counts as a dropped frame if it is longer than this multiple of the median.
const DROPPED: f64 = 1.5;

/// A scene allocates nothing after its start if the frame rate is at most this (Hz).
const USUAL_RATE_HZ: f64 = 250.0;

impl Drive {
    /// Creates a scene, whose robot turns as `robot_turn_rate` says, that starts at `start_ms` on the page's clock. `started_at_ms` is the same
    /// instant in milliseconds since 1970. `held` contains the keys that are already down.
    #[must_use]
    pub fn new(
        parameters: SceneParameters,
        scene: &Scene,
        robot_turn_rate: RobotTurnRate,
        start_ms: f64,
        started_at_ms: f64,
        keys: &KeyMap,
        held: &HeldKeys,
    ) -> Self {
        let steps = parameters.steps;
        let frames = (parameters.step_s * steps as f64 * USUAL_RATE_HZ) as usize;
        let mut states = Vec::with_capacity(steps + 1);
        states.push(scene.start());
        Self {
            parameters,
            robot_turn_rate,
            keys: keys.clone(),
            start_ms,
            started_at_ms,
            inputs: Vec::with_capacity(steps),
            states,
            sampled_at_ms: Vec::with_capacity(steps),
            key_events: held.presses(start_ms),
            page_events: Vec::new(),
            frames: FrameTimes {
                last_ms: None,
                gaps_ms: Vec::with_capacity(frames),
                work_ms: Vec::with_capacity(frames),
            },
        }
    }

    /// Records a key event at `t_ms` on the page's clock.
    pub fn key(&mut self, t_ms: f64, code: &str, down: bool) {
        // Events arrive in order. The maximum only guards against a clock that goes back.
        let last = self.key_events.last().map_or(f64::NEG_INFINITY, |event| event.t_ms);
        if self.key_events.len() < MAX_KEY_EVENTS {
            let t_ms = (t_ms - self.start_ms).max(last);
            self.key_events.push(KeyEvent { t_ms, key: code.to_owned(), down });
            self.correct();
        }
    }

    /// Records a page event at `t_ms` on the page's clock.
    pub fn page_event(&mut self, t_ms: f64, event: &Event) {
        let kind = match event {
            Event::FocusLost { hidden: true } => PageEventKind::Hidden,
            Event::FocusLost { hidden: false } => PageEventKind::FocusLost,
            Event::FocusGained => PageEventKind::FocusGained,
            Event::Shown => PageEventKind::Shown,
            Event::Resized { .. } => PageEventKind::Resized,
            Event::Fullscreen(true) => PageEventKind::FullscreenEntered,
            Event::Fullscreen(false) => PageEventKind::FullscreenLeft,
            _ => return,
        };
        let last = self.page_events.last().map_or(f64::NEG_INFINITY, |event| event.t_ms);
        if self.page_events.len() < MAX_PAGE_EVENTS {
            self.page_events.push(PageEvent { t_ms: (t_ms - self.start_ms).max(last), kind });
        }
    }

    /// Recomputes the current step, because a key event may arrive after the step was computed.
    fn correct(&mut self) {
        let Some(step) = self.inputs.len().checked_sub(1) else { return };
        let due = step as f64 * self.step_ms();
        let input = input_at(&self.key_events, due, &self.keys);
        if self.inputs[step] != input {
            self.inputs[step] = input;
            self.states.truncate(step + 1);
            self.advance(input);
        }
    }

    /// Appends the state after the last state and a step with this input.
    fn advance(&mut self, input: TurnInput) {
        let robot_radps = (self.robot_turn_rate)(&self.states);
        let state = self.states[self.states.len() - 1];
        self.states.push(state.advance(
            &self.parameters,
            input,
            robot_radps,
            self.parameters.step_s,
        ));
    }

    /// The input of each step that has begun.
    #[must_use]
    pub fn inputs(&self) -> &[TurnInput] {
        &self.inputs
    }

    /// The state before each step that has begun, and the state after the last of these steps.
    #[must_use]
    pub fn states(&self) -> &[JointState] {
        &self.states
    }

    fn step_ms(&self) -> f64 {
        self.parameters.step_s * 1000.0
    }

    /// The time on the page's clock (ms) at which the next step is due or the scene is over.
    #[must_use]
    pub fn due_ms(&self) -> f64 {
        self.start_ms + self.inputs.len() as f64 * self.step_ms()
    }

    /// Computes every step that is due by `now_ms`. Returns whether the scene is over.
    pub fn tick(&mut self, now_ms: f64) -> bool {
        while now_ms >= self.due_ms() {
            let step = self.inputs.len();
            if step == self.parameters.steps {
                return true;
            }
            let input = input_at(&self.key_events, step as f64 * self.step_ms(), &self.keys);
            self.advance(input);
            self.inputs.push(input);
            self.sampled_at_ms.push(now_ms - self.start_ms);
        }
        false
    }

    /// Poses of both vehicles at `at_ms`, on the arc of the step at that time. If that step is not
    /// computed yet, returns the end of the last computed arc.
    #[must_use]
    pub fn state_at(&self, at_ms: f64) -> JointState {
        let step = self.step_at(at_ms).min(self.inputs.len().saturating_sub(1));
        let Some(&input) = self.inputs.get(step) else {
            return self.states[0];
        };
        let begun = self.start_ms + step as f64 * self.step_ms();
        // `clamp` would add code that formats both bounds, which is a tenth of the page's download.
        let into = ((at_ms - begun) / 1000.0).max(0.0).min(self.parameters.step_s);
        self.states[step].within_step(&self.parameters, input, &self.states[step + 1], into)
    }

    /// Time since the start (s).
    #[must_use]
    pub fn time_s(&self, at_ms: f64) -> f64 {
        (at_ms - self.start_ms).max(0.0) / 1000.0
    }

    /// The index of the step at `at_ms`, from 0. Equals the number of steps when the scene is over.
    #[must_use]
    pub fn step_at(&self, at_ms: f64) -> usize {
        // With this tolerance, rounding errors cannot assign the start of a step to the step before
        // it.
        let step = (at_ms - self.start_ms) / self.step_ms() + 1e-9;
        (step.max(0.0) as usize).min(self.parameters.steps)
    }

    /// Records a frame shown at `at_ms` on the page's clock, and the time spent on its work.
    pub fn frame_shown(&mut self, at_ms: f64, work_ms: f64) {
        if let Some(last) = self.frames.last_ms.replace(at_ms) {
            self.frames.gaps_ms.push(at_ms - last);
        }
        self.frames.work_ms.push(work_ms);
    }

    /// Converts the finished scene to an upload. The scene was shown `exposures` times. `screen`
    /// describes the display.
    #[must_use]
    pub fn into_upload(self, screen: &[(&'static str, f64)], exposures: u32) -> TrialUpload<f64> {
        let frames = &self.frames;
        let gap_ms = quantile(&frames.gaps_ms, 0.5);
        let dropped = frames.gaps_ms.iter().filter(|&&gap| gap > DROPPED * gap_ms).count();
        let measured = [
            ("frames", frames.work_ms.len() as f64),
            ("frames_dropped", dropped as f64),
            ("frame_gap_median_ms", gap_ms),
            ("frame_gap_max_ms", quantile(&frames.gaps_ms, 1.0)),
            ("frame_work_p99_ms", quantile(&frames.work_ms, 0.99)),
        ];
        let display = facts(screen.iter().chain(&measured));
        TrialUpload {
            started_at_ms: self.started_at_ms,
            inputs: self.inputs,
            states: self.states,
            sampled_at_ms: self.sampled_at_ms,
            key_events: self.key_events,
            page_events: self.page_events,
            exposures,
            display,
        }
    }
}

/// Half the side length of the part of the world that is always visible (m).
const WINDOW_HALF_M: f64 = 15.0;

/// The visible part of the world: a fixed square, widened to include both starts, the goal and both
/// vehicles.
#[must_use]
pub fn window(scene: &Scene, state: JointState) -> Window {
    let [human, robot] = [state.human, state.robot].map(|pose| pose.position());
    let fixed = [scene.human.position(), scene.robot.position(), scene.goal, human, robot];
    fixed.into_iter().fold(Window::square(WINDOW_HALF_M), |window, p| window.including(p, 2.5))
}

/// Converts named numbers to an object for the server.
pub fn facts<'a>(numbers: impl IntoIterator<Item = &'a (&'static str, f64)>) -> Object<f64> {
    numbers.into_iter().map(|&(name, value)| (name.to_owned(), value)).collect()
}

/// The quantile of `values` at `share`. 0 if there are no values.
fn quantile(values: &[f64], share: f64) -> f64 {
    // For a few hundred values, insertion needs less code than sorting, so the download is smaller.
    let mut sorted: Vec<f64> = Vec::with_capacity(values.len());
    for &value in values {
        sorted.insert(sorted.partition_point(|&other| other < value), value);
    }
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.saturating_sub(1)).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sidestep::scene::{EncounterRange, generate};
    use sidestep::trial::{flags, verify};

    fn scene() -> Scene {
        generate(&SceneParameters::default(), &EncounterRange::default(), 1, 4).unwrap()[0]
            .0
            .clone()
    }

    fn held(key: &str, since_ms: f64) -> HeldKeys {
        let mut held = HeldKeys::default();
        held.change(since_ms, key, true);
        held
    }

    fn begin(start_ms: f64, held: &HeldKeys) -> Drive {
        let (parameters, keys) = (SceneParameters::default(), KeyMap::default());
        Drive::new(parameters, &scene(), straight(), start_ms, 1.7e12, &keys, held)
    }

    /// Drives a scene with frames and key events at the given times.
    fn drive(frames: impl Iterator<Item = f64>, keys: &[(f64, &str, bool)]) -> TrialUpload<f64> {
        let mut drive = begin(1000.0, &HeldKeys::default());
        let mut keys = keys.iter().peekable();
        for now in frames {
            while let Some((t, key, down)) = keys.next_if(|(t, ..)| *t <= now) {
                drive.key(*t, key, *down);
            }
            let over = drive.tick(now);
            drive.frame_shown(now, 0.5);
            if over {
                return drive.into_upload(&[("width_px", 1280.0)], 1);
            }
        }
        panic!("the scene did not end");
    }

    const KEYS: &[(f64, &str, bool)] = &[
        (3050.0, "ArrowLeft", true),
        (5210.0, "KeyD", true),
        (6000.0, "KeyD", false),
        (7000.0, "ArrowLeft", false),
    ];

    #[test]
    fn a_scene_is_a_valid_trial_that_replays_exactly() {
        let parameters = SceneParameters::default();
        let trial = drive((0..).map(|i| 1000.0 + f64::from(i) * 16.7), KEYS);
        trial.check(&parameters).unwrap();
        assert_eq!((trial.inputs.len(), trial.states.len()), (50, 51));
        assert!(verify(&parameters, &scene(), &trial.inputs, &trial.states).exact);
        assert_eq!(
            flags(&parameters, &scene(), &trial.inputs, &trial.states, &trial.sampled_at_ms),
            []
        );
        // The input is left from 2.05 s (effective at step 11), right from 4.21 s to 5.0 s, and
        // left again until 6.0 s.
        let signs: Vec<i8> = trial.inputs.iter().map(|input| input.sign()).collect();
        let expected: Vec<i8> = (0..50)
            .map(|step| match step {
                11..=21 => 1,
                22..=24 => -1,
                25..=29 => 1,
                _ => 0,
            })
            .collect();
        assert_eq!(signs, expected);
    }

    #[test]
    fn a_key_pressed_before_the_first_frame_waits_for_the_second_step() {
        let mut drive = begin(1000.0, &held("KeyD", 1005.0));
        drive.tick(1012.0);
        drive.tick(1212.0);
        assert_eq!(drive.inputs, [TurnInput::Straight, TurnInput::Right]);
    }

    #[test]
    fn a_press_that_is_reported_after_its_step_still_counts() {
        let mut drive = begin(1000.0, &HeldKeys::default());
        drive.tick(1000.0);
        drive.tick(1200.3);
        drive.key(1199.0, "KeyA", true);
        assert_eq!(drive.inputs, [TurnInput::Straight, TurnInput::Left]);
        drive.key(1250.0, "KeyA", false);
        drive.tick(1400.0);
        let inputs = [TurnInput::Straight, TurnInput::Left, TurnInput::Straight];
        assert_eq!(drive.inputs, inputs);
        assert!(verify(&drive.parameters, &scene(), &drive.inputs, &drive.states).exact);
    }

    #[test]
    fn each_step_is_due_at_its_time_and_so_is_the_end() {
        for start_ms in [0.1, 1234.567, 987_654.321] {
            let mut drive = begin(start_ms, &HeldKeys::default());
            for step in 0..50 {
                let due_ms = drive.due_ms();
                assert_eq!(due_ms, start_ms + 200.0 * step as f64);
                assert!(!drive.tick(due_ms));
                assert_eq!(
                    (drive.step_at(due_ms), drive.state_at(due_ms)),
                    (step, drive.states[step])
                );
            }
        }
        let mut drive = begin(1000.0, &HeldKeys::default());
        (0..50).for_each(|_| assert!(!drive.tick(drive.due_ms())));
        assert_eq!(drive.due_ms(), 11_000.0);
        assert!(!drive.tick(10_999.9));
        assert!(drive.tick(drive.due_ms()));
    }

    #[test]
    fn what_happens_to_the_page_is_recorded() {
        let mut drive = begin(1000.0, &HeldKeys::default());
        let events = [
            (900.0, Event::Shown),
            (1500.0, Event::FocusLost { hidden: false }),
            (1501.0, Event::FocusLost { hidden: true }),
            (1600.0, Event::FocusGained),
            (1700.0, Event::Online),
            // A clock that goes back does not change the order of events.
            (1650.0, Event::Fullscreen(false)),
            (1650.0, Event::Resized { width_px: 800.0, height_px: 600.0, ratio: 1.0 }),
        ];
        for (t_ms, event) in events {
            drive.page_event(t_ms, &event);
        }
        drive.tick(11_000.0);
        let trial = drive.into_upload(&[], 2);
        trial.check(&SceneParameters::default()).unwrap();
        let recorded: Vec<_> = trial.page_events.iter().map(|e| (e.t_ms, e.kind)).collect();
        use PageEventKind::{FocusGained, FocusLost, FullscreenLeft, Hidden, Resized, Shown};
        let expected = [
            (-100.0, Shown),
            (500.0, FocusLost),
            (501.0, Hidden),
            (600.0, FocusGained),
            (650.0, FullscreenLeft),
            (650.0, Resized),
        ];
        assert_eq!(recorded, expected);
        assert_eq!(trial.exposures, 2);
    }

    #[test]
    fn dropped_frames_are_counted() {
        let frames = (0..700).filter(|i| i % 100 != 99).map(|i| 1000.0 + f64::from(i) * 16.0);
        let display = drive(frames, &[]).display;
        assert_eq!(display.get("frame_gap_median_ms"), Some(&16.0));
        assert_eq!(display.get("frames_dropped"), Some(&6.0));
    }

    #[test]
    fn the_rate_of_frames_changes_nothing() {
        let smooth = drive((0..).map(|i| 1000.0 + f64::from(i) * 6.9), KEYS);
        let rough = drive((0..).map(|i| 1000.0 + f64::from(i) * 143.0), KEYS);
        assert_eq!(smooth.inputs, rough.inputs);
        assert_eq!(smooth.states, rough.states);
        assert!(rough.sampled_at_ms.iter().zip(0..).all(|(t, i)| *t >= f64::from(i) * 200.0));
    }

    #[test]
    fn a_stalled_page_is_flagged_not_hidden() {
        let frames = [1000.0, 1200.0, 4000.0, 10_990.0, 11_010.0];
        let trial = drive(frames.into_iter(), &[]);
        let parameters = SceneParameters::default();
        let flags =
            flags(&parameters, &scene(), &trial.inputs, &trial.states, &trial.sampled_at_ms);
        assert_eq!(flags, [sidestep::trial::Flag::LateSample]);
    }

    #[test]
    fn motion_between_steps_is_continuous() {
        let mut drive = begin(0.0, &held("KeyA", -50.0));
        drive.tick(200.0);
        let (before, after) = (drive.states[1], drive.state_at(200.0));
        assert_eq!(before, after);
        // A picture for a time before the current step shows the state at that time.
        assert_eq!(drive.state_at(199.9).human.x, {
            let mut earlier = begin(0.0, &held("KeyA", -50.0));
            earlier.tick(199.9);
            earlier.state_at(199.9).human.x
        });
        let mut earlier = begin(0.0, &held("KeyA", -50.0));
        earlier.tick(199.9);
        let almost = earlier.state_at(199.9);
        assert!(almost.distance_m() - before.distance_m() < 1e-3);
        assert_eq!(drive.inputs[0], TurnInput::Left, "a key held before the start counts");
    }
}
