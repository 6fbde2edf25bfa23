//! Whether this browser and the server compute the same trials.

use crate::pages::parts;
use crate::runtime::{Answer, Command, Commands, Page, Request, read};
use crate::view::{Node, el};
use sidestep::api::{SelfCheck, routes};
use sidestep::trial::simulation_fingerprint;

/// The page that compares the fingerprints of both.
#[derive(Default)]
pub(super) struct SelfCheckPage {
    /// This browser's fingerprint and the server's, or why there are none.
    compared: Option<Result<(String, SelfCheck), String>>,
}

impl SelfCheckPage {
    /// The page as it opens.
    pub(super) fn open() -> (Self, Commands<Answer>) {
        let ask = Request::get("self-check", routes::SELF_CHECK, |answer| answer);
        (Self::default(), vec![Command::Send(ask)])
    }
}

impl Page for SelfCheckPage {
    /// The server's fingerprint is all that it is ever told.
    type Msg = Answer;

    fn update(&mut self, answer: Answer, _: f64) -> Commands<Answer> {
        let server = read::<SelfCheck>(answer).map_err(|failure| failure.sentence);
        self.compared =
            Some(server.map(|server| (simulation_fingerprint(server.seed, server.trials), server)));
        Vec::new()
    }

    fn view(&self) -> Node<Answer> {
        match &self.compared {
            None => parts::loading(),
            Some(Err(why)) => parts::stuck("No self-check", why),
            Some(Ok((here, server))) => compared(here, server),
        }
    }

    fn title(&self) -> String {
        "Self-check".to_owned()
    }
}

fn compared(here: &str, server: &SelfCheck) -> Node<Answer> {
    let (class, verdict) = if here == server.fingerprint {
        ("saved", "This browser and the server compute the same trials, bit for bit.")
    } else {
        (
            "trouble",
            "This browser and the server compute different trials. Please report both \
             fingerprints.",
        )
    };
    let row = |name: &str, id: &str, value: &str| {
        let value = el("code").test_id(id).text(value);
        el("div").child(el("dt").text(name)).child(el("dd").child(value))
    };
    el("main")
        .class("card wide")
        .child(parts::heading("Self-check"))
        .child(el("p").class(class).test_id("verdict").text(verdict))
        .child(el("p").class("quiet").text(format!(
            "Each fingerprint is the SHA-256 of all states of {} random trials (seed {}).",
            server.trials, server.seed
        )))
        .child(el("dl").class("facts").children([
            row("browser", "fingerprint-here", here),
            row("server", "fingerprint-server", &server.fingerprint),
        ]))
}
