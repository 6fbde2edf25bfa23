//! The result of the server's last check of its data.

use crate::pages::parts::{count, size};
use crate::runtime::{Answer, Command, Request};
use crate::view::{Node, el};
use sidestep::api::{DataCheck, DataCheckState, routes};

/// Requests the result.
pub(super) fn ask<M: 'static>(then: fn(Answer) -> M) -> Command<M> {
    Command::Send(Request::get("data-check", routes::DATA_CHECK, then))
}

/// An error message, if the check found any errors.
pub(super) fn trouble(check: &DataCheck) -> Option<String> {
    if check.fault_count > 0 {
        let faults = count(check.fault_count, "fault");
        return Some(format!(
            "The server found {faults} in its stored data. Run sidestep check, and keep your backups."
        ));
    }
    let message = check.message.as_ref().filter(|_| check.state == DataCheckState::Failed)?;
    Some(format!("The server could not check its data, or write a backup: {message}."))
}

/// All results of the check.
pub(super) fn section<M>(check: &DataCheck) -> Node<M> {
    let p = || el("p");
    let trouble = trouble(check);
    let found = match (check.at_ms, check.trials) {
        (Some(at_ms), Some(trials)) if check.fault_count == 0 => Some(
            p().class("saved")
                .text(format!(
                    "Each of the {trials} stored trials replays as it was stored. Checked "
                ))
                .child(el("time").moment(at_ms)),
        ),
        (Some(at_ms), _) => Some(p().text("Checked ").child(el("time").moment(at_ms))),
        _ => None,
    };
    let progress = match check.state {
        DataCheckState::Running => Some("The server is checking its data now."),
        DataCheckState::Waiting => Some(
            "The server has not checked its data since it was started. It does so after a minute and then \
             every day, unless it was started with another --check-every.",
        ),
        DataCheckState::Done | DataCheckState::Failed => None,
    };
    let backup = check.backup.as_ref().map(|backup| {
        p().class("quiet")
            .text(format!("Last backup: {} ({}), ", backup.name, size(backup.bytes)))
            .child(el("time").moment(backup.at_ms))
    });
    let faults = check.faults.iter().map(|fault| el("li").text(fault));
    el("section")
        .test_id("data")
        .child(el("h2").text("Stored data"))
        .children(trouble.map(|what| p().class("trouble").text(what)))
        .children((!check.faults.is_empty()).then(|| el("ul").children(faults)))
        .children(found)
        .children(progress.map(|words| p().class("quiet").text(words)))
        .children(backup)
}
