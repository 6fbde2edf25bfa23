//! Tests of exporting a study's data.

use super::studies::study;
use super::*;
use sidestep::api::{Configuration, ConfigurationVersion};

fn configuration() -> Configuration {
    let version = |number: u32, hash: &str| ConfigurationVersion {
        number,
        hash: hash.into(),
        label: "1".into(),
        since_ms: 0,
        participants: number.into(),
        toml: String::new(),
        changed: Vec::new(),
    };
    Configuration {
        study: "pilot".into(),
        hash: "0123".into(),
        toml: String::new(),
        participants: 2,
        versions: vec![version(3, "0123"), version(2, "4567"), version(1, "0123")],
    }
}

#[test]
fn format_and_filters_are_chosen_in_a_form_for_the_browser() {
    let mut session = signed_in_to("/lab/studies/pilot/export", Access::Export);
    session.send("study", 200, &study("pilot", 2));
    session.send("configuration", 200, &configuration());
    let view = session.page.view();
    let form = view.find("export-form").unwrap();
    assert_eq!(form.attribute("method"), Some("get"));
    assert_eq!(form.attribute("action"), Some("/api/v1/admin/studies/pilot/export"));
    for format in ["csv", "jsonl", "parquet", "psych-ds", "sqlite"] {
        let choice = view.find(&format!("format-{format}")).unwrap();
        assert_eq!(choice.attribute("value"), Some(format));
        assert_eq!(choice.attribute("checked").is_some(), format == "csv");
    }
    for field in ["phase", "quality", "configuration", "pilots"] {
        assert_eq!(view.find(field).unwrap().attribute("name"), Some(field));
    }
    let versions = view.find("configuration").unwrap().words();
    let expected = "all participants version 3 (current): 3 participants version 2: 2 participants";
    assert_eq!(versions, expected);
    assert_eq!(view.find("tab-export").unwrap().attribute("aria-current"), Some("page"));
    assert!(view.find("no-trials").is_none());
}

#[test]
fn whoever_may_only_look_and_whoever_has_no_trials_is_told() {
    let mut session = signed_in_to("/lab/studies/pilot/export", Access::Read);
    let empty = sidestep::api::StudySummary { trials: 0, ..study("pilot", 2) };
    session.send("study", 200, &empty);
    assert!(session.words("no-right").unwrap().contains("right to export"));
    assert!(session.words("no-trials").unwrap().contains("empty"));
    assert!(session.page.view().find("export-form").is_none());
    session.changed();
    session.unreachable("study");
    assert!(session.words("old").unwrap().contains("cannot be reached"));
}
