//! The link to a view of the explorer: opening the explorer from it, and writing it.

use super::areas::Areas;
use super::predictor::Choice;
use super::tuning::Tuning;
use super::{ACTIONS, Explorer, Msg};
use crate::pages::coverage::Coverage;
use crate::pages::moment::fit;
use crate::pages::parts;
use crate::pages::safety::Sources;
use crate::runtime::{Address, Commands};
use sidestep::api::Drives;
use sidestep::picture::Picture;
use sidestep::shfrs::file::{PRESETS, ShfrsFile};
use sidestep::trial_view::Playback;
use sidestep::trial_view::view::View;

/// The link parameters that only the explorer uses.
const NAMES: [&str; 2] = ["trial", "count"];

impl Explorer {
    /// Opens the tasks in the view that the address describes.
    pub(super) fn open(
        id: &str,
        address: &Address,
        drives: Drives,
        content: Vec<u8>,
    ) -> Result<(Self, Commands<Msg>), String> {
        if drives.data_deleted {
            return Err("The data of this participant were deleted.".to_owned());
        }
        let (choice, unknown) = Choice::of(address);
        let mut misread: Vec<String> = unknown.into_iter().collect();
        let named = address.parameter("trial");
        let task = named.and_then(|id| drives.tasks.iter().position(|it| it.trial_id == id));
        if named.is_some() && task.is_none() {
            misread.push("The trial in the link is not a task of this participant.".to_owned());
        }
        let task = task.unwrap_or(0);
        let Some(drive) = drives.tasks.get(task) else {
            return Err("This participant has no tasks yet.".to_owned());
        };
        let turn_rate = drives.parameters.human.turn_rate_radps;
        let mut wanted = PRESETS[0].settings(ACTIONS).for_turn_rate(turn_rate);
        let mut view = View::default();
        for (name, value) in &address.query {
            if let Err(invalid) = wanted.set(name, value).and_then(|()| view.set(name, value)) {
                misread.push(format!("The link is not valid: {invalid}."));
            }
        }
        misread.extend(fit(&mut view, wanted.steps));
        misread.extend(parts::unknown(
            address,
            &[&NAMES, &ShfrsFile::NAMES, &Choice::NAMES, &View::NAMES],
        ));
        let counts_all = match address.parameter("count") {
            None | Some("unseen") => false,
            Some("all") => true,
            Some(other) => {
                misread.push(format!(
                    "The link has count={other}: expected count=all, or no count for the tasks that did not train the \
                     predictor."
                ));
                false
            }
        };
        let playback = Playback::new(drive.recorded(drives.parameters))
            .map_err(|invalid| invalid.to_string())?;
        let ids = [drives.value_function_hr.as_deref(), drives.value_function_rh.as_deref()];
        let mut explorer = Self {
            participant_id: id.to_owned(),
            task,
            sources: Sources::new(&drives.parameters, ids, Msg::ValueFunction),
            choice,
            complaint: wanted.settings(ACTIONS).err(),
            wanted,
            coverage: Coverage::new(counts_all),
            areas: Areas::default(),
            tuning: Tuning::default(),
            playback,
            view,
            picture: Picture::default(),
            trouble: None,
            misread: (!misread.is_empty()).then(|| misread.join(" ")),
            drives,
            content,
        };
        let mut commands = explorer.sources.begin();
        commands.extend(explorer.choice.begin(&explorer.drives));
        explorer.show();
        Ok((explorer, commands))
    }

    /// The link to the current view.
    pub(super) fn address(&self) -> String {
        let trial = format!("trial={}", self.drives.tasks[self.task].trial_id);
        let all = if self.coverage.counts_all { "count=all" } else { "" };
        let parts =
            [trial, self.wanted.query(), self.choice.query(), self.view.query(), all.to_owned()];
        let parts: Vec<String> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        format!("/lab/explorer/{}?{}", self.participant_id, parts.join("&"))
    }
}
