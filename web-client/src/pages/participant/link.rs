//! What the address of the page says: which study, who sent the person, and whether this is a pilot.

use crate::runtime::Address;
use sidestep::api::{Object, StudyInfo};
use sidestep::study::is_id;

/// What the address of the page says.
#[derive(Clone, Debug, Default)]
pub(super) struct Link {
    address: Address,
    /// The study's name in addresses.
    pub(super) slug: String,
    /// The secret of a personal link, with which a person continues on another computer.
    pub(super) token: Option<String>,
}

/// The part of a personal link before its secret.
const CONTINUE: &str = "continue=";

impl Link {
    pub(super) fn of(address: &Address) -> Self {
        let path = address.path.strip_suffix('/').unwrap_or(&address.path);
        let slug = path.strip_prefix("/s/").unwrap_or_default();
        let token = address.fragment.strip_prefix(CONTINUE).map(str::to_owned);
        Self {
            address: address.clone(),
            slug: slug.to_owned(),
            token: token.filter(|token| !token.is_empty()),
        }
    }

    /// Whether a simulated participant operates the page; its scenes are then told to programs.
    pub(super) fn simulates(&self) -> bool {
        self.address.parameter("simulate").is_some()
    }

    /// Whether what happens is kept apart from the study's data.
    pub(super) fn is_pilot(&self) -> bool {
        self.simulates() || self.address.parameter("pilot").is_some()
    }

    /// The recruiting service's id of the person, if the address has one. A pilot may have a link whose
    /// places are not filled in.
    pub(super) fn external_id(&self, study: &StudyInfo) -> Option<&str> {
        let given = |name: &String| self.address.parameter(name).map(str::trim);
        study
            .external_id_parameters
            .iter()
            .filter_map(given)
            .find(|id| !id.is_empty() && (!self.is_pilot() || is_id(id)))
    }

    /// Whether the address lacks the id that the study needs, or has one that is none, such as a place that
    /// the recruiting service has not filled in. The server refuses the same.
    pub(super) fn is_incomplete(&self, study: &StudyInfo) -> bool {
        let needs_one = study.requires_external_id && !self.is_pilot();
        self.external_id(study).map_or(needs_one, |id| !is_id(id))
    }

    /// The parameters that the study stores.
    pub(super) fn recorded(&self, study: &StudyInfo) -> Object<String> {
        let mut recorded = Object::default();
        for name in &study.recorded_parameters {
            let value = self.address.parameter(name).map_or("", str::trim);
            if !value.is_empty() {
                recorded.insert(name.clone(), value.to_owned());
            }
        }
        recorded
    }

    /// The address of the page with its query, without its fragment.
    pub(super) fn url(&self) -> String {
        self.address.path.clone() + &self.address.search
    }

    /// The whole address of the page, for another computer.
    pub(super) fn here(&self) -> String {
        self.address.origin.clone() + &self.url()
    }

    /// A personal link: whoever has it is this participant.
    pub(super) fn personal(&self, token: &str) -> String {
        format!("{}{}#{CONTINUE}{token}", self.address.origin, self.address.path)
    }

    /// Under which name the browser keeps who the participant is. Several people may use one browser,
    /// and a pilot is nobody's participation; each simulated participant is one of its own.
    pub(super) fn session_name(&self, study: &StudyInfo) -> String {
        let mut name = format!("sidestep.session.{}", self.slug);
        if self.is_pilot() {
            name += ".pilot";
        }
        if let Some(seed) = self.address.parameter("simulate") {
            name.extend([".simulate=", seed]);
        }
        if let Some(id) = self.external_id(study) {
            name.extend([".", &id.to_ascii_lowercase()]);
        }
        name
    }
}
