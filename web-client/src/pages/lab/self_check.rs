//! Checks whether this browser computes the same trials as the server, and shows the server's check
//! of its data.

use super::data_check;
use crate::pages::parts::{self, alert};
use crate::runtime::{Answer, Command, Commands, Page, Request, read};
use crate::view::{Node, el};
use sidestep::api::{DataCheck, SelfCheck, routes};
use sidestep::trial::simulation_fingerprint;

/// The page that compares the browser's fingerprint with the server's.
#[derive(Default)]
pub(super) struct SelfCheckPage {
    /// This browser's fingerprint and the server's, or an error.
    compared: Option<Result<(String, SelfCheck), String>>,
    /// The result of the server's check of its data.
    data: Option<DataCheck>,
}

/// Messages to the page.
#[derive(Clone)]
pub(super) enum Msg {
    /// The server sent its fingerprint.
    Fingerprint(Answer),
    /// The server sent the result of its data check.
    Data(Answer),
}

impl SelfCheckPage {
    /// Creates the page and its first commands.
    pub(super) fn open() -> (Self, Commands<Msg>) {
        let ask = Request::get("self-check", routes::SELF_CHECK, Msg::Fingerprint);
        (Self::default(), vec![Command::Send(ask), data_check::ask(Msg::Data)])
    }
}

impl Page for SelfCheckPage {
    type Msg = Msg;

    fn update(&mut self, message: Msg, _: f64) -> Commands<Msg> {
        match message {
            Msg::Fingerprint(answer) => {
                let server = read::<SelfCheck>(answer).map_err(|failure| failure.sentence);
                let compared = |it: SelfCheck| (simulation_fingerprint(it.seed, it.trials), it);
                self.compared = Some(server.map(compared));
            }
            // If the result is missing, the rest of the page is still shown.
            Msg::Data(answer) => self.data = read(answer).ok(),
        }
        Vec::new()
    }

    fn view(&self) -> Node<Msg> {
        let simulation = match &self.compared {
            None => return parts::loading(),
            Some(Err(why)) => vec![alert("uncompared", why)],
            Some(Ok((here, server))) => compared(here, server),
        };
        el("main")
            .class("card wide")
            .child(parts::heading("Self-check"))
            .child(el("section").child(el("h2").text("Simulation")).children(simulation))
            .children(self.data.as_ref().map(data_check::section))
    }

    fn title(&self) -> String {
        "Self-check".to_owned()
    }
}

fn compared(here: &str, server: &SelfCheck) -> Vec<Node<Msg>> {
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
    let about = format!(
        "Each fingerprint is the SHA-256 of all states of {} random trials (seed {}).",
        server.trials, server.seed
    );
    vec![
        el("p").class(class).test_id("verdict").text(verdict),
        el("p").class("quiet").text(about),
        el("dl").class("facts").children([
            row("browser", "fingerprint-here", here),
            row("server", "fingerprint-server", &server.fingerprint),
        ]),
    ]
}
