//! A frame of a scene, including the steps in it, allocates no memory. The test counts allocations
//! of the whole process. Therefore it runs without the test harness and its threads.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use peak_alloc::PeakAlloc;
use serde_json::{Value, json};
use sidestep::picture::Picture;
use sidestep::study::StudyConfig;
use sidestep_web::pages::participant::{Msg, Part, Participant};
use sidestep_web::runtime::{Address, Answer, Event, Page, PageContext};

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Time between two frames (ms).
const FRAME_MS: f64 = 1000.0 / 60.0;

/// A page, its clock and the last picture that it drew.
struct Screen {
    page: Participant,
    now_ms: f64,
    picture: Picture,
}

impl Screen {
    fn tell(&mut self, message: Msg) {
        // The test itself sends the messages with which a browser would respond.
        drop(self.page.update(message, self.now_ms));
    }

    fn hear(&mut self, code: &str, down: bool) {
        let event = Event::Key { code: code.into(), key: code.into(), down };
        let message = self.page.hear(&event).expect("the page wants to know of a key that steers");
        self.tell(message);
    }

    /// Shows a frame. Returns whether anything but the picture has changed.
    fn frame(&mut self) -> bool {
        self.now_ms += FRAME_MS;
        let message = self.page.tick(self.now_ms);
        let changes = message.is_some();
        message.into_iter().for_each(|message| self.tell(message));
        self.page.draw(self.now_ms, &mut self.picture);
        self.page.frame_shown(self.now_ms, 0.5);
        changes
    }

    fn step(&self) -> usize {
        let step = self.picture.attributes.iter().find(|(name, _)| *name == "data-step");
        step.map_or(0, |(_, step)| step.parse().expect("a number"))
    }
}

fn answer(value: &Value) -> Answer {
    Ok(serde_json::to_vec(value).expect("JSON"))
}

/// The page at the start of a scene.
fn begun() -> Screen {
    let scene = json!({ "trial_id": "t0", "index": 0, "human": [-10.0, 0.0, 0.0],
        "robot": [10.0, 1.0, 3.1], "goal": [-10.0, 1.0] });
    let phase = json!({ "phase": "task", "show_danger_zone": true, "scenes": [scene] });
    let plan = json!({ "phases": [phase] });
    let config = StudyConfig::default();
    let study = json!({ "schema_version": sidestep::api::SCHEMA_VERSION, "slug": "default",
        "title": "Test", "parameters": config.parameters, "phases": config.phases,
        "admission": "open", "trials": config.trials, "comprehension_attempts": 0,
        "external_id_parameters": [], "recorded_parameters": [], "requires_external_id": false });
    let texts = json!({ "language": "en", "offered": [], "sentences": {}, "facts": [],
        "check": [], "questions": [] });
    let enrolled = json!({ "participant_id": "p", "token": "secret", "plan": plan });
    let progress = json!({ "participant_id": "p", "study": "default", "plan": plan, "stored": [],
        "next": "t0", "understood": true });

    let address = Address { path: "/s/default".into(), ..Address::default() };
    let (page, _) = Participant::open(PageContext { address, ..PageContext::default() });
    let mut screen = Screen { page, now_ms: 0.0, picture: Picture::default() };
    screen.tell(Msg::Study(answer(&study)));
    screen.tell(Msg::Texts(answer(&texts)));
    screen.tell(Msg::Go(Part::Equipment));
    for code in ["ArrowLeft", "ArrowRight"] {
        screen.hear(code, true);
        screen.hear(code, false);
    }
    for _ in 0..100 {
        screen.frame();
    }
    screen.tell(Msg::Go(Part::Enrolment));
    screen.tell(Msg::Enrolled(answer(&enrolled)));
    screen.tell(Msg::Progress(answer(&progress)));
    screen.tell(Msg::Go(Part::Understanding));
    screen.tell(Msg::Start);
    screen
}

fn main() {
    let mut screen = begun();
    // Show some frames first, so that one-time allocations are done.
    while screen.step() < 2 {
        screen.frame();
        assert!(screen.now_ms < 20_000.0, "the scene does not start");
    }
    screen.hear("ArrowLeft", true);
    screen.frame();
    MEMORY.reset_peak_usage();
    let before = MEMORY.peak_usage();
    assert!(before > 0, "is anything counted?");
    let mut frames = 0;
    while screen.step() < 49 {
        assert!(!screen.frame(), "nothing but the picture changes");
        frames += 1;
    }
    assert_eq!(MEMORY.peak_usage(), before);
    assert!(frames > 500, "{frames} frames of nearly ten seconds");
}
