//! The section of the form about how people come to the study and where they go afterwards.

use super::{Form, Section};
use crate::pages::lab::configuration::document::number;
use crate::pages::lab::configuration::edit::Edit;
use crate::pages::parts::count;
use crate::view::el;
use serde_json::{Value, json};

impl Form<'_> {
    pub(super) fn recruitment(&self) -> Section {
        let fields = &self.fields;
        let preset = |service: &str, name: &str, edit: Edit| {
            let button_name = format!("fill-{service}");
            fields.button(&button_name, edit, &button_name).class("choice").text(name)
        };
        let fill = |external: Value, required: bool, record: Value, hosts: Value| {
            Edit::Fill(vec![
                ("recruitment.external_id", external),
                ("recruitment.require_external_id", required.into()),
                ("recruitment.record", record),
                ("recruitment.return_hosts", hosts),
            ])
        };
        let presets = el("div")
            .class("choices field wide")
            .attrs(&[("role", "group"), ("aria-label", "Fill in for a service")])
            .child(el("span").class("quiet").text("Fill in for"))
            .children([
                preset(
                    "prolific",
                    "Prolific",
                    fill(
                        json!(["PROLIFIC_PID"]),
                        true,
                        json!(["STUDY_ID", "SESSION_ID"]),
                        json!(["app.prolific.com"]),
                    ),
                ),
                preset("sona", "SONA", fill(json!(["survey_code"]), true, json!([]), json!([]))),
                preset(
                    "mturk",
                    "MTurk",
                    fill(json!(["workerId"]), true, json!(["assignmentId", "hitId"]), json!([])),
                ),
                preset(
                    "own",
                    "links of your own",
                    fill(json!(["external_id"]), false, json!([]), json!([])),
                ),
            ]);
        let quota = number(self.study(), "recruitment.quota").unwrap_or_default();
        Section {
            name: "Recruitment",
            path: "recruitment",
            said: if quota > 0.0 {
                format!("up to {}", count(quota, "participant"))
            } else {
                "no limit".to_owned()
            },
            is_open: false,
            fields: std::iter::once(presets).chain(self.settings("recruitment")).collect(),
        }
    }
}
