//! The page's address. It contains the study, the source of the referral, and whether this is a
//! pilot.

use crate::runtime::Address;
use sidestep::api::{Object, StudyInfo};
use sidestep::study::is_id;

/// The information in the page's address.
#[derive(Clone, Debug, Default)]
pub(super) struct Link {
    address: Address,
    /// The study's slug.
    pub(super) slug: String,
    /// The secret of a personal link, with which a participant continues on another computer.
    pub(super) token: Option<String>,
}

/// The part of a personal link's fragment that precedes the secret.
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

    /// Whether the simulator operates the page. If so, the page exposes its scenes in attributes of
    /// the canvas.
    pub(super) fn simulates(&self) -> bool {
        self.address.parameter("simulate").is_some()
    }

    /// Whether the data are stored separately from the study's data.
    pub(super) fn is_pilot(&self) -> bool {
        self.simulates() || self.address.parameter("pilot").is_some()
    }

    /// The person's id at the recruiting service, if the address contains one. In a pilot's link,
    /// an unfilled placeholder is ignored.
    pub(super) fn external_id(&self, study: &StudyInfo) -> Option<&str> {
        let given = |name: &String| self.address.parameter(name).map(str::trim);
        study
            .external_id_parameters
            .iter()
            .filter_map(given)
            .find(|id| !id.is_empty() && (!self.is_pilot() || is_id(id)))
    }

    /// Whether the external id is missing although the study requires one, or is invalid (for
    /// example, an unfilled placeholder of the recruiting service). The server applies the same
    /// rule.
    pub(super) fn is_incomplete(&self, study: &StudyInfo) -> bool {
        let needs_one = study.requires_external_id && !self.is_pilot();
        self.external_id(study).map_or(needs_one, |id| !is_id(id))
    }

    /// The query parameters that the study records.
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

    /// The page's address with its query and without its fragment.
    pub(super) fn url(&self) -> String {
        self.address.path.clone() + &self.address.search
    }

    /// The page's full address, to open it on another computer.
    pub(super) fn here(&self) -> String {
        self.address.origin.clone() + &self.url()
    }

    /// A personal link. Anyone who has it can act as this participant.
    pub(super) fn personal(&self, token: &str) -> String {
        format!("{}{}#{CONTINUE}{token}", self.address.origin, self.address.path)
    }

    /// The storage name of the participant's session. Several people can use the same browser, so
    /// the name contains the external id. Pilots and simulated participants have separate sessions.
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
