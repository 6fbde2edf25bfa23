//! The replay of one trial: a time slider, the safety levels, the predicted sets
//! and what the participant really did.

mod chart;
mod safety;

use self::safety::Sources;
use crate::overlays::{LAYERS, Moment, stage};
use crate::runtime::{Command, Failure, Solving};
use crate::shape::{Picture, Shape, Window};
use crate::view::{Node, el, subscripted};
use sidestep::api::{TrainedPredictor, TrialDetail};
use sidestep::bounds::ActionModel as _;
use sidestep::invalid::Invalid;
use sidestep::predict::Predictor;
use sidestep::safety::SafetyLevels;
use sidestep::scene::{Evader, JointState};
use sidestep::shfrs::{PredictedHuman, ShfrsPredictor, ShfrsSettings};
use sidestep::vehicle::TurnInput;

/// The state of a replay.
pub struct Replay {
    trial: TrialDetail,
    sources: Sources,
    safety: Option<SafetyLevels>,
    /// V_HR and V_RH of each state, m.
    levels: Vec<(f64, f64)>,
    learned: Option<Learned>,
    /// Time into the trial, s.
    time_s: f64,
    /// Time of the last frame while it plays, ms.
    playing_since: Option<f64>,
    shown: Vec<bool>,
    window: Window,
    /// The states up to now, and whoever predicts from them: kept from frame to frame.
    history: Vec<JointState>,
    predictor: ShfrsPredictor,
    /// How likely each input is at this moment, once that is known; the sets are the
    /// predictor's.
    prediction: Option<Vec<(TurnInput, f64)>>,
    /// Whether sets are drawn for each step instead of for the whole time ahead.
    by_step: bool,
    /// What is wrong, if something is.
    pub trouble: Option<String>,
}

struct Learned {
    predictor: Predictor,
    trials: usize,
    fallback: Option<String>,
    settings: ShfrsSettings,
}

impl Replay {
    /// The replay of a trial, at its start.
    #[must_use]
    pub fn new(trial: TrialDetail) -> Self {
        let everything = trial.states.iter().flat_map(|s| [s.human.position(), s.robot.position()]);
        let window = Window::around(everything.chain([trial.scene.goal]), 3.5)
            .unwrap_or_else(|| Window::square(15.0));
        Self {
            sources: Sources::new(&trial),
            trial,
            safety: None,
            levels: Vec::new(),
            learned: None,
            time_s: 0.0,
            playing_since: None,
            shown: LAYERS.iter().map(|layer| layer.shown).collect(),
            window,
            history: Vec::new(),
            predictor: ShfrsPredictor::default(),
            prediction: None,
            by_step: false,
            trouble: None,
        }
    }

    /// The trial.
    #[must_use]
    pub fn trial(&self) -> &TrialDetail {
        &self.trial
    }

    /// Asks for the value functions, or for their solution.
    pub fn begin(&mut self) -> Vec<Command> {
        self.sources.begin(&self.trial)
    }

    /// Takes what the server sent as the value function of `evader`, or why it did not.
    pub fn take_value_function(&mut self, evader: Evader, answer: Result<&[u8], &Failure>) {
        self.sources.take_answer(evader, answer);
        self.take_safety();
    }

    /// Takes what the solver says of the value function of `evader`.
    pub fn take_solving(&mut self, evader: Evader, solving: Solving) {
        self.sources.take_solving(evader, solving);
        self.take_safety();
    }

    /// Puts the value functions to use, once both are here.
    fn take_safety(&mut self) {
        if self.safety.is_some() {
            return;
        }
        if let Some(safety) = self.sources.functions() {
            let level = |s: &JointState| (safety.human_level(s), safety.robot_level(s));
            self.levels = self.trial.states.iter().map(level).collect();
            self.safety = Some(safety);
            self.update();
        }
    }

    /// Takes the predictor.
    pub fn take_predictor(&mut self, trained: TrainedPredictor) {
        let TrainedPredictor { predictor, trials, fallback } = trained;
        let learned = Predictor::try_from(predictor).and_then(|predictor| {
            let settings = ShfrsSettings::paper(predictor.classes().len())?;
            Ok(Learned { predictor, trials, fallback, settings })
        });
        match learned {
            Ok(learned) => self.learned = Some(learned),
            Err(invalid) => self.trouble = Some(invalid.to_string()),
        }
        self.update();
    }

    /// Length of the trial, s.
    fn duration_s(&self) -> f64 {
        self.trial.inputs.len() as f64 * self.trial.parameters.step_s
    }

    /// The present step; the number of steps at the end.
    #[must_use]
    pub fn step(&self) -> usize {
        // The tolerance keeps a time that is a whole number of steps in its own step.
        ((self.time_s / self.trial.parameters.step_s + 1e-9) as usize).min(self.trial.inputs.len())
    }

    fn state(&self) -> JointState {
        let step = self.step();
        let state = self.trial.states[step];
        match self.trial.inputs.get(step) {
            None => state,
            Some(&input) => {
                let begun = step as f64 * self.trial.parameters.step_s;
                state.advance(&self.trial.parameters, input, (self.time_s - begun).max(0.0))
            }
        }
    }

    fn seek(&mut self, time_s: f64) {
        self.time_s = time_s.clamp(0.0, self.duration_s());
        self.update();
    }

    /// Whether it plays.
    #[must_use]
    pub fn is_playing(&self) -> bool {
        self.playing_since.is_some()
    }

    /// Plays on to `now_ms` on the page's clock.
    pub fn frame(&mut self, now_ms: f64) {
        let Some(last) = self.playing_since.replace(now_ms) else {
            self.playing_since = None;
            return;
        };
        self.seek(self.time_s + (now_ms - last).max(0.0) / 1000.0);
        if self.time_s >= self.duration_s() {
            self.playing_since = None;
        }
    }

    /// Takes a press.
    pub fn act(&mut self, word: &str, value: &str, now_ms: f64) -> Vec<Command> {
        let step_s = self.trial.parameters.step_s;
        match word {
            "stop-solving" => return self.sources.stop(),
            "solve-again" => return self.sources.retry(&self.trial),
            "play" if self.is_playing() => self.playing_since = None,
            "play" => {
                if self.time_s >= self.duration_s() {
                    self.seek(0.0);
                }
                self.playing_since = Some(now_ms);
            }
            "seek" => {
                self.playing_since = None;
                if let Ok(step) = value.parse::<f64>() {
                    self.seek(step * step_s);
                }
            }
            "by-step" => {
                self.by_step = !self.by_step;
                self.update();
            }
            layer => {
                let at = LAYERS.iter().position(|known| known.name == layer);
                if let Some(shown) = at.and_then(|at| self.shown.get_mut(at)) {
                    *shown = !*shown;
                }
            }
        }
        Vec::new()
    }

    /// Predicts anew for the present moment.
    fn update(&mut self) {
        match self.predict() {
            Ok(prediction) => self.prediction = prediction,
            Err(invalid) => {
                self.prediction = None;
                self.trouble = Some(invalid.to_string());
            }
        }
    }

    /// How likely each input is; also predicts the sets.
    fn predict(&mut self) -> Result<Option<Vec<(TurnInput, f64)>>, Invalid> {
        let state = self.state();
        let step = self.step();
        let (Some(learned), Some(safety)) = (&mut self.learned, &self.safety) else {
            return Ok(None);
        };
        let parameters = &self.trial.parameters;
        let human = PredictedHuman::new(&learned.predictor, safety, parameters)?;
        self.history.clear();
        self.history.extend_from_slice(&self.trial.states[..step]);
        self.history.push(state);
        let mut p = vec![0.0; learned.predictor.classes().len()];
        human.probabilities(&self.history, &mut p);
        let of_class = |input: TurnInput| {
            let class = learned.predictor.classes().iter().position(|&c| c == input.sign());
            (input, class.map_or(0.0, |class| p[class]))
        };
        let probabilities = TurnInput::ALL.into_iter().rev().map(of_class).collect();
        learned.settings.by_step = self.by_step;
        self.predictor.predict(&self.history, parameters, &human, &learned.settings)?;
        Ok(Some(probabilities))
    }

    /// What is drawn.
    #[must_use]
    pub fn picture(&self) -> Picture {
        let moment = Moment {
            trial: &self.trial,
            step: self.step(),
            state: self.state(),
            safety: self.safety.as_ref(),
            shfrs: self.prediction.as_ref().map(|_| self.predictor.shfrs()),
            by_step: self.by_step,
        };
        let mut shapes = vec![Shape::Grid { every_m: 5 }];
        for (layer, shown) in LAYERS.iter().zip(&self.shown) {
            if *shown {
                shapes.extend((layer.shapes)(&moment));
            }
        }
        shapes.extend(stage::vehicles_and_goal(&self.trial.scene, moment.state));
        Picture {
            canvas: "replay",
            window: self.window,
            shapes,
            attributes: vec![
                ("data-step", self.step().to_string()),
                ("data-trial", self.trial.summary.trial_id.clone()),
            ],
        }
    }

    /// What is shown around the canvas.
    #[must_use]
    pub fn view(&self) -> Node {
        el("main")
            .class("replay")
            .child(self.scene_view())
            .child(self.panel())
            .child(self.timeline())
    }

    fn scene_view(&self) -> Node {
        let layers = LAYERS.iter().zip(&self.shown).map(|(layer, shown)| {
            let (letter, below, rest) = layer.label;
            let label = if below.is_empty() {
                el("span").text(letter)
            } else {
                subscripted("span", letter, below)
            };
            switch(layer.name, layer.meaning, *shown)
                .test_id(&format!("layer-{}", layer.name))
                .child(label.text(rest))
        });
        let meaning =
            "SHFRS: where the human may be after each step, instead of within all of them";
        let by_step = switch("by-step", meaning, self.by_step).test_id("by-step").text("per step");
        let switches = layers.chain([by_step]);
        el("section")
            .class("view")
            .child(
                el("div")
                    .class("switches")
                    .attr("role", "group")
                    .attr("aria-label", "Layers")
                    .children(switches),
            )
            .child(
                el("canvas")
                    .attr("id", "replay")
                    .test_id("replay")
                    .attr("role", "img")
                    .attr("aria-label", "The trial seen from above, with the chosen layers"),
            )
            .children(self.sources.notice())
    }

    fn panel(&self) -> Node {
        let step = self.step();
        let state = self.state();
        let metres = |value: f64| format!("{value:.2} m").replace('-', "−");
        let level = |read: fn(&SafetyLevels, &JointState) -> f64| match &self.safety {
            Some(safety) => metres(read(safety, &state)),
            None if self.sources.missing().is_some() => "—".to_owned(),
            None => "…".to_owned(),
        };
        let input = self.trial.inputs.get(step).map_or("—", |input| input.word());
        let row = |name: Node, value: String| el("div").child(name).child(el("dd").text(value));
        let facts = el("dl").class("facts").children([
            row(subscripted("dt", "V", "HR"), level(SafetyLevels::human_level)),
            row(subscripted("dt", "V", "RH"), level(SafetyLevels::robot_level)),
            row(el("dt").text("distance"), metres(state.distance_m())),
            row(el("dt").text("input"), input.to_owned()),
        ]);
        el("aside")
            .class("panel")
            .child(
                el("h1")
                    .text(format!("Step {step}"))
                    .child(el("small").text(format!("t = {:.1} s", self.time_s))),
            )
            .child(facts)
            .children(self.prediction.as_ref().map(|probabilities| self.next_input(probabilities)))
            .children(self.prediction.as_ref().map(|_| self.regions()))
            .child(self.evidence())
            .children(
                self.trouble
                    .as_ref()
                    .map(|text| el("p").class("trouble").attr("role", "alert").text(text)),
            )
    }

    fn next_input(&self, probabilities: &[(TurnInput, f64)]) -> Node {
        let source =
            self.learned.as_ref().map_or_else(String::new, |learned| match &learned.fallback {
                None => format!("logistic, B_hrd, trained on the {} trials before", learned.trials),
                Some(why) => format!("{why}: frequencies of the inputs so far"),
            });
        let bars = probabilities.iter().map(|(input, p)| {
            let percent = 100.0 * p;
            el("div")
                .child(el("dt").text(input.word()))
                .child(
                    el("dd")
                        .class("bar")
                        .attr("aria-hidden", "true")
                        .child(el("i").attr("style", format!("width:{percent:.1}%"))),
                )
                .child(el("dd").text(format!("{percent:.0} %")))
        });
        el("section")
            .test_id("prediction")
            .child(el("h2").text("Next input"))
            .child(el("p").class("quiet").test_id("predictor").text(source))
            .child(el("dl").class("bars").children(bars))
    }

    fn regions(&self) -> Node {
        let head = ["set", "ε / rad s⁻¹", "tube / m²"]
            .map(|words| el("th").attr("scope", "col").text(words));
        let rows = self.predictor.shfrs().sets.iter().enumerate().map(|(j, set)| {
            let name = subscripted("th", "F", &(j + 1).to_string()).attr("scope", "row");
            let name = Node {
                children: [crate::view::Child::Node(
                    el("i").class(&format!("swatch region-{}", j + 1)),
                )]
                .into_iter()
                .chain(name.children)
                .collect(),
                ..name
            };
            el("tr")
                .child(name)
                .child(el("td").text(format!("{:.2}", set.epsilon)))
                .child(el("td").text(format!("{:.2}", set.area_m2)))
        });
        let ahead = if self.by_step { "next 2 s, per step" } else { "next 2 s" };
        el("section").child(el("h2").text("Predicted sets").child(el("small").text(ahead))).child(
            el("table")
                .class("regions")
                .test_id("regions")
                .child(el("thead").child(el("tr").children(head)))
                .child(el("tbody").children(rows)),
        )
    }

    /// What came of the trial, and whether it can be trusted.
    fn evidence(&self) -> Node {
        let summary = &self.trial.summary;
        let closest = format!("{:.2} m", summary.outcome.closest_m);
        let danger = summary
            .outcome
            .first_step_in_danger
            .map_or_else(|| "never".to_owned(), |step| format!("from step {step}"));
        let replay = if self.trial.replay.exact {
            "exact".to_owned()
        } else {
            format!("off by up to {:.2e} m", self.trial.replay.max_position_error_m)
        };
        let flags: Vec<_> =
            summary.flags.iter().map(|flag| flag.word().replace('_', " ")).collect();
        let flags = if flags.is_empty() { "none".to_owned() } else { flags.join(", ") };
        let row = |name: &str, value: String| {
            el("div").child(el("dt").text(name)).child(el("dd").text(value))
        };
        el("section").child(el("h2").text("Trial")).child(el("dl").class("facts").children([
            row("closest", closest),
            row("in danger zone", danger),
            row("replay", replay),
            row("safety levels", self.sources.words().to_owned()).test_id("safety-levels"),
            row("flags", flags),
        ]))
    }

    fn timeline(&self) -> Node {
        let steps = self.trial.inputs.len();
        let words = if self.is_playing() { "Pause" } else { "Play" };
        let icon = if self.is_playing() { "M6 5h4v14H6zM14 5h4v14h-4z" } else { "M8 5v14l11-7z" };
        let legend = [("human", "V", "HR"), ("robot", "V", "RH"), ("range", "distance − R", "c")];
        let legend = legend.into_iter().map(|(class, letter, below)| {
            el("span").class(&format!("key {class}")).child(subscripted("span", letter, below))
        });
        el("section")
            .class("timeline")
            .child(
                el("div")
                    .class("controls")
                    .child(
                        el("button")
                            .class("play")
                            .attr("type", "button")
                            .attr("aria-label", words)
                            .action("play")
                            .test_id("play")
                            .child(
                                el("svg")
                                    .attr("viewBox", "0 0 24 24")
                                    .attr("aria-hidden", "true")
                                    .child(el("path").attr("d", icon)),
                            ),
                    )
                    .child(el("span").class("time").text(format!("{:.1} s", self.time_s)))
                    .child(
                        el("span")
                            .class("legend")
                            .children(legend)
                            .child(el("span").class("key input").text("turning")),
                    ),
            )
            .child(
                el("div").class("chart").child(self.chart()).child(
                    el("input")
                        .attr("type", "range")
                        .attr("min", 0)
                        .attr("max", steps)
                        .attr("step", 1)
                        .attr("value", self.step())
                        .attr("aria-label", "Step")
                        .attr("data-action", "seek")
                        .test_id("slider"),
                ),
            )
            .child(self.table())
    }

    /// Safety levels, range and input over time.
    fn chart(&self) -> Node {
        chart::draw(&self.trial, &self.levels, self.time_s)
    }

    /// The chart's numbers.
    fn table(&self) -> Node {
        let head = ["step", "t / s", "V_HR / m", "V_RH / m", "distance / m", "input"];
        let head = head.map(|words| el("th").attr("scope", "col").text(words));
        let rows = self.trial.inputs.iter().zip(&self.trial.states).enumerate().map(
            |(i, (input, state))| {
                let level = |pick: fn(&(f64, f64)) -> f64| {
                    self.levels.get(i).map_or_else(String::new, |v| format!("{:.3}", pick(v)))
                };
                let cells = [
                    i.to_string(),
                    format!("{:.1}", i as f64 * self.trial.parameters.step_s),
                    level(|v| v.0),
                    level(|v| v.1),
                    format!("{:.3}", state.distance_m()),
                    input.word().to_owned(),
                ];
                el("tr").children(cells.map(|words| el("td").text(words)))
            },
        );
        el("details").class("table-twin").child(el("summary").text("Numbers")).child(
            el("div").class("scroll").child(
                el("table")
                    .child(el("thead").child(el("tr").children(head)))
                    .child(el("tbody").children(rows)),
            ),
        )
    }
}

/// A button that stays down: `action` is its word.
fn switch(action: &str, meaning: &str, is_on: bool) -> Node {
    el("button")
        .class("switch")
        .attr("type", "button")
        .attr("aria-pressed", is_on)
        .attr("title", meaning)
        .action(action)
}
