//! Analyses as jobs of the server: requests, progress, cancellation, results, and deletion after a
//! withdrawal.

use crate::analyze::contents;
use reqwest::Method;
use serde_json::json;
use sidestep::api::{AnalysisDetail, AnalysisPage, AnalysisState, AnalysisSummary, routes};
use sidestep::comparison::Request;
use sidestep::safety::SafetyQuality;
use sidestep::scene::{Evader, SceneParameters};
use sidestep::vehicle::{TurnInput, VehicleModel};
use sidestep_tests::{Answer, Driver, Server, behind, sidestep, upload};
use std::time::{Duration, Instant};
use tempfile::TempDir;

const TASKS: usize = 8;

/// A study of eight tasks.
const STUDY: &str = r#"phases = [{ phase = "task", scenes = 8 }]"#;

/// Enrols a participant who drives all scenes with inputs held for up to 1.2 s. The seed `who`
/// determines the inputs.
async fn drive(server: &Server, who: u64) -> Driver {
    drive_with(&SceneParameters::default(), server, who).await
}

/// Like [`drive`], but with the vehicles of `parameters`.
async fn drive_with(parameters: &SceneParameters, server: &Server, who: u64) -> Driver {
    let driver = Driver::enrol(server).await;
    driver.drive_restlessly(server, parameters, who).await;
    driver
}

pub(crate) async fn post(server: &Server, route: &str, body: serde_json::Value) -> Answer {
    let request = server.request(Method::POST, route).bearer_auth(&server.key);
    Answer::of(request.json(&body)).await
}

pub(crate) async fn ask(server: &Server, body: serde_json::Value) -> AnalysisSummary {
    post(server, &routes::admin_analyses("default"), body).await.into(201)
}

pub(crate) async fn show(server: &Server, id: &str) -> AnalysisDetail {
    server.admin(&routes::admin_analysis(id)).await.into(200)
}

/// Waits until the analysis satisfies a condition.
async fn until(
    server: &Server,
    id: &str,
    wanted: impl Fn(&AnalysisSummary) -> bool,
) -> AnalysisDetail {
    let begun = Instant::now();
    loop {
        let now = show(server, id).await;
        if wanted(&now.summary) {
            return now;
        }
        assert!(begun.elapsed() < Duration::from_secs(600), "{now:?}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

pub(crate) async fn done(server: &Server, id: &str) -> AnalysisDetail {
    let detail = until(server, id, |now| now.state.is_over()).await;
    assert_eq!(detail.summary.state, AnalysisState::Done, "{:?}", detail.summary.message);
    detail
}

async fn file(server: &Server, id: &str, name: &str) -> reqwest::Response {
    let request = server.request(Method::GET, &routes::analysis_file(id, name));
    request.bearer_auth(&server.key).send().await.unwrap()
}

/// The number of rows of a table, read directly from the database.
async fn count(server: &Server, table: &str) -> i64 {
    let query = format!("SELECT count(*) FROM {table}");
    behind(&server.database()).row(&query, |row| row.get(0)).await.unwrap()
}

#[tokio::test]
async fn a_study_is_analysed_as_by_the_command() {
    let server = Server::with_study(STUDY).await;
    for who in 1..=2 {
        drive(&server, who).await;
    }
    let asked = ask(&server, json!({ "leakage": true })).await;
    assert_eq!(asked.study, "default");
    assert_eq!(asked.request, Request { leakage: true, ..Request::default() });
    let mut progress = Vec::new();
    loop {
        let now = show(&server, &asked.id).await;
        if now.summary.state.is_over() {
            break;
        }
        assert!(now.files.is_empty());
        progress.extend(now.summary.progress.filter(|progress| progress.done > 0));
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    assert!(!progress.is_empty(), "it takes seconds, and never tells how far it is");
    assert!(progress.iter().all(|now| now.done <= now.of && now.left_s.unwrap() >= 0.0));
    assert!(progress.is_sorted_by_key(|now| now.done), "{progress:?}");
    let detail = done(&server, &asked.id).await;
    let result = detail.summary.result.as_ref().unwrap();
    assert_eq!((result.participants, &result.synthetic), (2, &None));
    assert!(result.flagged.is_empty());
    assert_eq!(detail.summary.progress, None);

    // The command writes the same files, from the database and from the export.
    let folder = TempDir::new().unwrap();
    let trials = folder.path().join("trials.csv");
    std::fs::write(&trials, server.export("default").await).unwrap();
    let database = server.database();
    let sources = [["--database", &database], ["--trials", trials.to_str().unwrap()]];
    for (i, source) in sources.into_iter().enumerate() {
        let out = folder.path().join(format!("out{i}"));
        let args = [&["analyze", "--leakage"], &source[..], &["--out", out.to_str().unwrap()]];
        let output = sidestep(&args.concat()).await;
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let files = contents(&out);
        let named: Vec<_> = detail.files.iter().map(|file| file.name.clone()).collect();
        assert_eq!(named, files.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>());
        for (kept, (name, bytes)) in detail.files.iter().zip(&files) {
            assert_eq!(kept.octets, bytes.len() as u64, "{name}");
            let fetched = file(&server, &asked.id, name).await.bytes().await.unwrap();
            assert!(fetched == bytes[..], "{name}");
        }
    }

    // Reports can be viewed, but their content security policy permits no scripts and loads
    // nothing. Other files are downloads.
    let report = file(&server, &asked.id, "report.html").await;
    let policy = report.headers()["content-security-policy"].to_str().unwrap().to_owned();
    assert!(policy.contains("default-src 'none'") && !policy.contains("script"), "{policy}");
    assert_eq!(report.headers()["cache-control"], "no-store");
    let table = file(&server, &asked.id, "table1.csv").await;
    assert_eq!(table.headers()["content-disposition"], "attachment; filename=\"table1.csv\"");
    assert_eq!(table.headers()["content-type"], "text/csv; charset=utf-8");
    let plain = table.bytes().await.unwrap();
    let request = server.request(Method::GET, &routes::analysis_file(&asked.id, "table1.csv"));
    let request = request.bearer_auth(&server.key).header("accept-encoding", "gzip");
    let packed = request.send().await.unwrap();
    assert_eq!(packed.headers()["content-encoding"], "gzip");
    assert_ne!(packed.bytes().await.unwrap(), plain);
    for name in ["nothing.csv", "../../etc/passwd", "models", "models%2f..%2ftable1.csv"] {
        assert_eq!(file(&server, &asked.id, name).await.status(), 404, "{name}");
    }

    // A second analysis of the same data finds every cell in the cache, with the same result.
    let cells = count(&server, "analysis_cell").await;
    assert!(cells > 0);
    let again = ask(&server, json!({ "leakage": true })).await;
    assert_ne!(again.id, asked.id);
    let second = done(&server, &again.id).await;
    assert_eq!(second.files, detail.files);
    assert_eq!(count(&server, "analysis_cell").await, cells);

    // With another feature set and another grid, only new models are computed. The tables and the
    // report list them together with the other models.
    let slopes = json!({ "slopes": ["v_h", "dv_h_ahead", "dv_h_left"] });
    let wider = ask(&server, json!({ "sets": slopes, "grids": { "tree_leaf": [7] } })).await;
    let wider = done(&server, &wider.id).await.summary;
    assert_eq!(wider.request.sets["slopes"].len(), 3);
    let cells_csv = file(&server, &wider.id, "cells.csv").await.text().await.unwrap();
    for part in ["lr,1,slopes,1,", "dt,2,slopes,2,", "\"\"min_samples_leaf\"\":7"] {
        assert!(cells_csv.contains(part), "{part}");
    }
    assert!(!cells_csv.contains("\"\"min_samples_leaf\"\":5"));
    let ablation = file(&server, &wider.id, "ablation.csv").await.text().await.unwrap();
    assert!(ablation.contains("slopes"));
    let report = file(&server, &wider.id, "report.html").await.text().await.unwrap();
    assert!(report.contains("<code>slopes</code>"));

    // The list of analyses, newest first, in pages.
    let route = routes::admin_analyses("default");
    let page: AnalysisPage = server.admin(&format!("{route}?limit=1")).await.into(200);
    let brief = |mut summary: AnalysisSummary| {
        let accuracies = &mut summary.result.as_mut().unwrap().accuracies;
        // The protocol has nine sets, and the wider analysis has one more.
        assert!([6 * 9, 6 * 10].contains(&accuracies.len()), "{accuracies:?}");
        accuracies.clear();
        summary
    };
    assert_eq!(page.analyses[0], brief(wider.clone()));
    let before = page.next_before.unwrap();
    let page: AnalysisPage = server.admin(&format!("{route}?before={before}")).await.into(200);
    let earlier = [second.summary.clone(), detail.summary.clone()].map(brief);
    assert_eq!((page.analyses, page.next_before), (earlier.to_vec(), None));

    // An analysis survives a restart of the server, and can be deleted.
    let server = server.restarted().await;
    assert_eq!(show(&server, &asked.id).await, detail);
    let request = server.request(Method::DELETE, &routes::admin_analysis(&asked.id));
    assert_eq!(Answer::of(request.bearer_auth(&server.key)).await.status, 204);
    server.admin(&routes::admin_analysis(&asked.id)).await.problem(404, "not_found", None);
    assert_eq!(file(&server, &asked.id, "table1.csv").await.status(), 404);
    let files = show(&server, &second.summary.id).await.files.len()
        + show(&server, &wider.id).await.files.len();
    assert_eq!(count(&server, "analysis_file").await, files as i64);
}

#[tokio::test]
async fn a_queue_that_can_be_cancelled_and_outlives_the_server() {
    let server = Server::with_study_and(STUDY, |args| args.analysis.threads = Some(1)).await;
    for who in 1..=4 {
        drive(&server, who).await;
    }
    let first = ask(&server, json!({})).await;
    until(&server, &first.id, |now| now.progress.is_some_and(|p| p.done >= 10)).await;
    // Two more requests with the same settings add only one analysis to the queue.
    let second = ask(&server, json!({ "leakage": true })).await;
    assert_eq!((second.state, second.progress), (AnalysisState::Queued, None));
    let route = routes::admin_analyses("default");
    let same: AnalysisSummary =
        post(&server, &route, json!({ "leakage": true, "synthetic": false })).await.into(200);
    assert_eq!(same.id, second.id);
    let third = ask(&server, json!({ "synthetic": true })).await;

    // After a restart of the server, the first analysis continues with its finished cells.
    let kept = count(&server, "analysis_cell").await;
    assert!(kept >= 10, "{kept}");
    let server = server.restarted().await;
    assert!(count(&server, "analysis_cell").await >= kept);
    until(&server, &first.id, |now| now.state == AnalysisState::Running).await;

    // A queued and a running analysis can be cancelled, even twice.
    for id in [&second.id, &first.id] {
        for _ in 0..2 {
            let now: AnalysisSummary =
                post(&server, &routes::cancel_analysis(id), json!({})).await.into(200);
            assert_eq!((now.state, now.ended_at_ms.is_some()), (AnalysisState::Cancelled, true));
        }
    }
    // The next analysis runs, and reuses the cells that the first one stored.
    let detail = done(&server, &third.id).await;
    let told = detail.summary.result.unwrap().synthetic.unwrap();
    assert!(told.contains("experimenter"), "{told}");
    let late = post(&server, &routes::cancel_analysis(&third.id), json!({})).await;
    assert!(late.problem(409, "over", None).contains("done"));
    assert_eq!(show(&server, &first.id).await.files, []);
}

#[tokio::test]
async fn who_withdraws_their_data_withdraws_them_from_analyses_too() {
    let server = Server::with_study(STUDY).await;
    let stays = drive(&server, 1).await;
    let leaves = drive(&server, 2).await;
    let before = ask(&server, json!({})).await;
    assert_eq!(done(&server, &before.id).await.summary.result.unwrap().participants, 2);
    let during = ask(&server, json!({ "leakage": true })).await;
    until(&server, &during.id, |now| now.state != AnalysisState::Queued).await;

    // The withdrawal of a participant without trials deletes nothing.
    let passing = Driver::enrol(&server).await;
    let cells = count(&server, "analysis_cell").await;
    assert_eq!(passing.withdraw(&server, "delete").await.status, 200);
    assert_eq!(show(&server, &before.id).await.summary.state, AnalysisState::Done);
    assert!(count(&server, "analysis_cell").await >= cells);
    // A withdrawal that keeps the data changes nothing.
    assert_eq!(stays.withdraw(&server, "keep").await.status, 200);
    assert_eq!(show(&server, &before.id).await.summary.state, AnalysisState::Done);
    assert_eq!(leaves.withdraw(&server, "delete").await.status, 200);
    let gone = show(&server, &before.id).await;
    assert_eq!((gone.summary.state, gone.summary.result), (AnalysisState::Withdrawn, None));
    assert_eq!(gone.files, []);
    assert_eq!(file(&server, &before.id, "predictions.csv").await.status(), 404);
    // The analysis that was running was restarted without the participant, or had finished and was
    // deleted.
    let found = until(&server, &during.id, |now| now.state.is_over()).await;
    match found.summary.state {
        AnalysisState::Done => assert_eq!(found.summary.result.unwrap().participants, 1),
        other => assert_eq!(other, AnalysisState::Withdrawn),
    }
    let after = ask(&server, json!({})).await;
    assert_eq!(done(&server, &after.id).await.summary.result.unwrap().participants, 1);
    assert_eq!(count(&server, "analysis_file WHERE analysis = 1").await, 0);
}

#[tokio::test]
async fn people_who_cannot_be_compared_are_named() {
    let server = Server::with_study(STUDY).await;
    let nobody = ask(&server, json!({})).await;
    let failed = until(&server, &nobody.id, |now| now.state.is_over()).await.summary;
    assert_eq!(failed.state, AnalysisState::Failed);
    assert!(failed.message.unwrap().contains("nobody"));

    // One participant drove with another radius, one has too few tasks, and one never turned.
    drive(&server, 1).await;
    let changed = format!("{STUDY}\n[parameters]\ndanger_radius_m = 2.5\n");
    let server = server.restarted_with_study(&changed).await;
    drive(&server, 2).await;
    Driver::enrol(&server).await.drive(&server, 4).await;
    let straight = Driver::enrol(&server).await;
    for (id, scene) in straight.scenes() {
        let trial = upload(&scene, vec![TurnInput::Straight; 50]);
        assert_eq!(straight.send(&server, &id, &trial).await.status, 201);
    }
    assert_eq!(straight.scenes().len(), TASKS);
    // One trial was not driven in the planned scene. The comparison includes the participant, and
    // reports the trial.
    let elsewhere = Driver::enrol(&server).await;
    for (i, (id, mut scene)) in elsewhere.scenes().into_iter().enumerate() {
        scene.human.x += if i == 3 { 1.0 } else { 0.0 };
        let mut inputs = vec![TurnInput::Straight; 50];
        inputs[5 + i..20 + i].fill(TurnInput::Left);
        let answer = elsewhere.send(&server, &id, &upload(&scene, inputs)).await;
        assert_eq!(answer.status, 201);
    }
    let result = ask(&server, json!({})).await;
    let result = done(&server, &result.id).await.summary.result.unwrap();
    assert_eq!(result.participants, 2);
    assert_eq!(result.flagged.get("start_mismatch"), Some(&1), "{:?}", result.flagged);
    assert_eq!(result.study_versions, [2]);
    let reasons = ["other parameters", "4 tasks", "one kind of input"];
    assert_eq!(result.excluded.len(), reasons.len());
    for ((who, exclusion), reason) in ["1", "3", "4"].iter().zip(&result.excluded).zip(reasons) {
        assert_eq!(exclusion.participant, *who);
        assert!(exclusion.reason.contains(reason), "{exclusion:?}");
    }
}

#[tokio::test]
async fn bad_requests_are_explained() {
    let server = Server::with_study(STUDY).await;
    let route = routes::admin_analyses("default");
    let wrong = |body| post(&server, &route, body);
    wrong(json!({ "leakage": 1 })).await.problem(422, "invalid", Some("leakage"));
    wrong(json!({ "grid": [] })).await.problem(422, "invalid", Some("grid"));
    let grids = json!({ "grids": { "tree_leaf": [0] } });
    wrong(grids).await.problem(422, "invalid", Some("grids.tree_leaf"));
    let sets = json!({ "sets": { "mine": ["v_h", "v_x"] } });
    wrong(sets).await.problem(422, "invalid", Some("sets.mine.features[1]"));
    wrong(json!([])).await.problem(422, "invalid", Some(""));
    let absent = routes::admin_analyses("absent");
    post(&server, &absent, json!({})).await.problem(404, "not_found", None);
    server.admin(&absent).await.problem(404, "not_found", None);
    for query in ["limit=0", "limit=501"] {
        let answer = server.admin(&format!("{route}?{query}")).await;
        answer.problem(422, "invalid", Some("limit"));
    }
    let id = "8a4e6f1c-0000-4000-8000-000000000000";
    for gone in [id, "%2e%2e", "x"] {
        server.admin(&routes::admin_analysis(gone)).await.problem(404, "not_found", None);
        let cancelled = post(&server, &routes::cancel_analysis(gone), json!({})).await;
        cancelled.problem(404, "not_found", None);
        let request = server.request(Method::DELETE, &routes::admin_analysis(gone));
        let deleted = Answer::of(request.bearer_auth(&server.key)).await;
        deleted.problem(404, "not_found", None);
    }
    // Requests without a key are refused.
    for (method, route) in [
        (Method::GET, route.clone()),
        (Method::POST, route),
        (Method::GET, routes::admin_analysis(id)),
        (Method::DELETE, routes::admin_analysis(id)),
        (Method::POST, routes::cancel_analysis(id)),
        (Method::GET, routes::analysis_file(id, "report.html")),
    ] {
        let answer = Answer::of(server.request(method, &route).json(&json!({}))).await;
        answer.problem(401, "unauthorized", None);
    }
}

/// If the human is faster than the robot, the game of V_RH is a chase, and its solve does not
/// converge.
#[tokio::test]
async fn a_level_that_did_not_converge_is_said_everywhere() {
    let robot = "robot = { speed_mps = 1.5, turn_rate_radps = 0.8 }";
    let server = Server::with_study(&format!("{STUDY}\n[parameters]\n{robot}\n")).await;
    let slower = VehicleModel { speed_mps: 1.5, turn_rate_radps: 0.8 };
    let parameters = SceneParameters { robot: slower, ..SceneParameters::default() };
    for who in 1..=2 {
        drive_with(&parameters, &server, who).await;
    }
    let asked = ask(&server, json!({})).await;
    let result = done(&server, &asked.id).await.summary.result.unwrap();
    let safety = result.safety.unwrap();
    assert!(safety.v_hr.is_sound() && safety.v_hr.spread_m > 0.5, "{safety:?}");
    assert!(!safety.v_rh.converged && safety.v_rh.spread_m < 0.3, "{safety:?}");
    assert!(safety.v_rh.last_change_m.unwrap() > 1e-4, "{safety:?}");
    let report = file(&server, &asked.id, "report.html").await.text().await.unwrap();

    // `sidestep analyze` reports the same for this study as the server's analysis.
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("out");
    let args = ["analyze", "--database", &server.database(), "--out", out.to_str().unwrap()];
    let output = sidestep(&args).await;
    let complaints = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{complaints}");
    let game = "V_RH did not converge (the robot evades with 1.5 m/s and 0.8 rad/s, the human \
                pursues with 2 m/s and 0.5 rad/s)";
    assert!(complaints.contains(game) && !complaints.contains("V_HR"), "{complaints}");
    let mut printed: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let printed: SafetyQuality = serde_json::from_value(printed["safety"].take()).unwrap();
    assert_eq!(printed.v_rh.last_change_m, safety.v_rh.last_change_m);
    for evader in Evader::ALL {
        // The server stores values rounded to millimetres.
        let [kept, own] = [&safety, &printed].map(|of| of.level(evader).spread_m);
        assert!((kept - own).abs() < 1e-3, "{kept} {own}");
    }
    let own = std::fs::read_to_string(out.join("report.html")).unwrap();
    for report in [report, own] {
        assert!(report.contains("<i>V</i><sub>RH</sub> did not converge."));
        assert!(!report.contains("<i>V</i><sub>HR</sub> did not converge."));
    }
}
