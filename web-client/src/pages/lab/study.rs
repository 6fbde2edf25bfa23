//! Parts that all pages of a study share: its name, its state, and the navigation between the
//! pages.

use crate::pages::parts::{self, count};
use crate::runtime::{Command, Request};
use crate::view::{Node, el};
use sidestep::api::{StudySummary, routes};
use sidestep::study::Status;
use std::rc::Rc;

/// The query of the link to a rehearsal, with the seed of the synthetic participant and the speed.
pub(super) const REHEARSAL: &str = "simulate=1&speed=10";

/// A page of a study.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Tab {
    Participants,
    Trials,
    Analyses,
    Export,
    Configuration,
}

impl Tab {
    const ALL: [Self; 5] =
        [Self::Participants, Self::Trials, Self::Analyses, Self::Export, Self::Configuration];

    fn words(self) -> &'static str {
        match self {
            Self::Participants => "Participants",
            Self::Trials => "Trials",
            Self::Analyses => "Analyses",
            Self::Export => "Export",
            Self::Configuration => "Configuration",
        }
    }

    /// The address of this page for a study.
    pub(super) fn address(self, slug: &str) -> String {
        match self {
            Self::Participants => format!("/lab/studies/{slug}"),
            Self::Trials => format!("/lab/studies/{slug}/trials"),
            Self::Analyses => format!("/lab/studies/{slug}/analyses"),
            Self::Export => format!("/lab/studies/{slug}/export"),
            Self::Configuration => format!("/lab/studies/{slug}/configuration"),
        }
    }
}

/// Sends a message now and whenever data on the server change.
pub(super) fn follow<M>(then: impl Fn() -> M + 'static) -> Command<M> {
    Command::Follow { name: "changes", url: routes::CHANGES, then: Rc::new(then) }
}

/// Requests a study's name, state and counts.
pub(super) fn ask<M>(
    slug: &str,
    then: impl FnOnce(crate::runtime::Answer) -> M + 'static,
) -> Command<M> {
    Command::Send(Request::get("study", routes::admin_study(slug), then))
}

/// A badge with the status of the study.
pub(super) fn status<M>(status: Status) -> Node<M> {
    let class = match status {
        Status::Open => "chip open",
        Status::Closed | Status::Archived => "chip",
    };
    el("span").class(class).test_id("status").text(status.word())
}

/// The top of a study's page: the title and counts of the study, actions, and links to the study's
/// pages.
pub(super) fn head<M>(
    study: &StudySummary,
    current: Tab,
    actions: impl IntoIterator<Item = Node<M>>,
) -> Vec<Node<M>> {
    let counts = [
        count(study.participants, "participant"),
        format!("{} complete", study.complete),
        format!("{} active now", study.active),
        count(study.trials, "stored trial"),
    ];
    let title = el("div")
        .child(
            el("div")
                .class("title")
                .child(parts::heading(&study.title))
                .child(status(study.status)),
        )
        .child(el("p").class("quiet").test_id("counts").text(counts.join(" · ")))
        .children(parts::synthetic(study.synthetic));
    let tabs = Tab::ALL.map(|tab| {
        el("a")
            .attr("href", tab.address(&study.slug))
            .attr_if(tab == current, "aria-current", "page")
            .test_id(&format!("tab-{}", tab.words().to_lowercase()))
            .text(tab.words())
    });
    let actions = el("div").class("actions").children(actions);
    vec![
        el("div").class("page-head").child(title).child(actions),
        el("nav").class("tabs").attr("aria-label", "Study").children(tabs),
    ]
}
