//! Tests of starting, watching and reading analyses.

use super::studies::study;
use super::*;
use sidestep::api::{
    AnalysisDetail, AnalysisFile, AnalysisPage, AnalysisProgress, AnalysisResult, AnalysisState,
    AnalysisSummary, ExcludedParticipant, MeanAccuracy,
};
use sidestep::comparison::Request;

pub(super) fn analysis(id: &str, state: AnalysisState) -> AnalysisSummary {
    let progress = AnalysisProgress { done: 30, of: 120, left_s: Some(200.0) };
    let excluded = ExcludedParticipant { participant: "4".into(), reason: "too few tasks".into() };
    let result = AnalysisResult {
        participants: 7,
        excluded: vec![excluded],
        flagged: [("late_sample".to_owned(), 3)].into(),
        same_trials: Vec::new(),
        safety: None,
        cells: 84,
        models: Some(70),
        version: Some("1.2.3".into()),
        study_versions: vec![1, 3],
        data_sha256: Some("0123456789abcdef".into()),
        accuracies: vec![MeanAccuracy {
            model: "svm".into(),
            experiment: 2,
            features: "hrd".into(),
            percent: 81.25,
        }],
        synthetic: None,
    };
    AnalysisSummary {
        id: id.into(),
        study: "pilot".into(),
        request: Request { leakage: true, ..Request::default() },
        state,
        progress: (state == AnalysisState::Running).then_some(progress),
        created_at_ms: 1,
        started_at_ms: Some(2),
        ended_at_ms: None,
        message: (state == AnalysisState::Failed).then(|| "too few participants".into()),
        result: (state == AnalysisState::Done).then_some(result),
        stale: false,
    }
}

pub(super) fn list(analyses: Vec<AnalysisSummary>) -> AnalysisPage {
    AnalysisPage { analyses, next_before: None }
}

pub(super) fn detail(state: AnalysisState) -> AnalysisDetail {
    let files = match state {
        AnalysisState::Done => vec![
            AnalysisFile { name: "report.html".into(), octets: 1_234_567 },
            AnalysisFile { name: "models/lr-1.json".into(), octets: 900 },
            AnalysisFile { name: "figures/gains.svg".into(), octets: 900 },
        ],
        _ => Vec::new(),
    };
    AnalysisDetail { summary: analysis("a1", state), files }
}

#[test]
fn an_analysis_is_started_watched_and_cancelled() {
    let mut session = signed_in("/lab/studies/pilot/analyses");
    session.send("study", 200, &study("pilot", 7));
    session.send("analyses", 200, &list(Vec::new()));
    assert!(session.text().contains("7 participants took part"));
    let text = |name: &str, text: &str| (name.to_owned(), FieldValue::Text(text.into()));
    let form = Form::new(vec![
        ("leakage".into(), FieldValue::Checked(true)),
        text("set", " mine "),
        text("features", "v_hr, distance"),
    ]);
    session.tell(session.page.view().submit("new-analysis", form).unwrap());
    let body = session.asked.last().unwrap().body.clone().unwrap();
    let asked: Request = serde_json::from_str(&body).unwrap();
    assert!(asked.leakage && !asked.synthetic);
    assert_eq!(asked.sets["mine"], ["v_hr", "distance"]);
    let unknown =
        br#"{"code":"invalid","message":"expected a feature, found v_hr","field":"sets"}"#;
    session.answer("ask", 422, unknown);
    assert!(session.words("trouble").unwrap().contains("found v_hr"));
    session.tell(session.page.view().submit("new-analysis", Form::default()).unwrap());
    assert_eq!(session.words("trouble"), None);
    session.send("ask", 201, &analysis("a1", AnalysisState::Queued));
    session.send("analyses", 200, &list(vec![analysis("a1", AnalysisState::Queued)]));
    session.changed();
    session.send("analyses", 200, &list(vec![analysis("a1", AnalysisState::Running)]));
    let words = session.words("analyses").unwrap();
    assert!(words.contains("25 %, about 3 min left"), "{words}");
    session.press("cancel-a1");
    assert_eq!(session.asked.last().unwrap().url, routes::cancel_analysis("a1"));
    session.send("cancel", 200, &analysis("a1", AnalysisState::Cancelled));
    session.send("analyses", 200, &list(vec![analysis("a1", AnalysisState::Cancelled)]));
    assert!(session.words("cancel-a1").is_none());
    assert!(!session.words("analyses").unwrap().contains("Action"));
}

#[test]
fn two_analyses_that_are_done_can_be_compared() {
    let mut session = signed_in("/lab/studies/pilot/analyses");
    session.send("study", 200, &study("pilot", 7));
    let (done, running) = (AnalysisState::Done, AnalysisState::Running);
    session.send("analyses", 200, &list(vec![analysis("a2", running), analysis("a1", done)]));
    assert!(session.words("comparable").is_none());
    assert!(session.words("analyses").unwrap().contains("Action"));
    session.changed();
    session.send("analyses", 200, &list(vec![analysis("a2", done), analysis("a1", done)]));
    assert!(session.words("comparable").unwrap().contains("can be compared"));
    assert!(!session.words("analyses").unwrap().contains("Action"));
}

#[test]
fn settings_say_what_is_computed() {
    use crate::pages::lab::analyses::settings;
    let paper_only = Request { paper_only: true, ..Request::default() };
    assert_eq!(settings(&paper_only), "only the paper’s comparison");
    let words = settings(&Request::default());
    assert!(words.starts_with("the paper’s comparison, learning curves"), "{words}");
}

#[test]
fn a_done_analysis_shows_its_data_report_and_files() {
    let mut session = signed_in("/lab/analyses/a1");
    session.send("analysis", 200, &detail(AnalysisState::Running));
    assert!(session.words("report").is_none());
    session.changed();
    session.send("analysis", 200, &detail(AnalysisState::Done));
    let view = session.page.view();
    let report = view.find("report").unwrap();
    assert_eq!(report.attribute("src"), Some("/api/v1/admin/analyses/a1/files/report.html"));
    assert_eq!(report.attribute("sandbox"), Some(""), "it can do nothing");
    assert!(view.find("excluded").unwrap().words().contains("Participant 4: too few tasks"));
    for words in [
        "7",
        "Models trained 70",
        "have 84 entries for 70 models",
        "late sample",
        "3 trials",
        "1.2 MB",
        "1 model file for sidestep shfrs",
        "1 figure as SVG",
        "Computed by Sidestep 1.2.3. The participants had versions 1, 3 of the study. SHA-256 of the \
         analysed data:  0123456789ab … Test runs are never part",
    ] {
        assert!(view.words().contains(words), "{words}: {}", view.words());
    }
    session.press("delete");
    session.press("keep");
    session.press("delete");
    session.press("sure");
    assert_eq!(session.asked.last().unwrap().method, "DELETE");
    session.answer("delete", 204, b"");
    assert_eq!(session.visited.last().unwrap(), "/lab/studies/pilot/analyses");
}

#[test]
fn an_analysis_without_a_report_says_why() {
    for (state, words) in [
        (AnalysisState::Queued, "waits for other"),
        (AnalysisState::Failed, "too few participants"),
        (AnalysisState::Withdrawn, "a participant who withdrew"),
    ] {
        let mut session = signed_in("/lab/analyses/a1");
        session.send("analysis", 200, &detail(state));
        assert!(session.words("words").unwrap().contains(words), "{state:?}");
    }
    let mut session = signed_in("/lab/analyses/none");
    session.answer(
        "analysis",
        404,
        br#"{"code":"not_found","message":"there is no such analysis"}"#,
    );
    assert!(session.words("stuck").unwrap().contains("no such analysis"));
}

#[test]
fn who_may_not_manage_starts_and_deletes_nothing() {
    let mut session = signed_in_to("/lab/studies/pilot/analyses", Access::Export);
    session.send("study", 200, &study("pilot", 7));
    session.send("analyses", 200, &list(vec![analysis("a1", AnalysisState::Running)]));
    assert!(session.words("new-analysis").is_none() && session.words("cancel-a1").is_none());
    session.go("/lab/analyses/a1");
    session.send("analysis", 200, &detail(AnalysisState::Done));
    assert!(session.words("delete").is_none() && session.words("report").is_some());
}

#[test]
fn two_analyses_are_compared() {
    let mut session = signed_in("/lab/analyses/a1");
    session.send("analysis", 200, &detail(AnalysisState::Done));
    session.send("others", 200, &list(vec![analysis("a1", AnalysisState::Done)]));
    assert!(session.words("compare").is_none(), "there is no other one");

    let mut session = signed_in("/lab/analyses/a1");
    session.send("analysis", 200, &detail(AnalysisState::Done));
    let all = ["a2", "a1"].map(|id| analysis(id, AnalysisState::Done));
    session.send(
        "others",
        200,
        &list([&all[..], &[analysis("a3", AnalysisState::Queued)]].concat()),
    );
    assert_eq!(session.words("compare").unwrap().matches("7 participants").count(), 1);
    let choose = |id: &str| FieldValue::Text(id.to_owned());
    session.tell(session.page.view().enter("compare", choose("a2")).unwrap());
    assert_eq!(session.asked.last().unwrap().url, routes::admin_analysis("a2"));
    let mut other = analysis("a2", AnalysisState::Done);
    other.request.leakage = false;
    if let Some(result) = &mut other.result {
        result.participants = 9;
        result.accuracies[0].percent = 79.0;
    }
    session.send("other", 200, &AnalysisDetail { summary: other, files: Vec::new() });
    let words = session.text();
    for expected in ["split by time step too", "Participants 7 9 differs", "Excluded 1 1 same"] {
        assert!(words.contains(expected), "{expected}: {words}");
    }
    assert!(session.words("accuracies").unwrap().contains("SVM II on hrd 81.25 79.00 +2.25"));
    session.tell(session.page.view().enter("compare", choose("")).unwrap());
    assert!(session.words("accuracies").is_none());
}
