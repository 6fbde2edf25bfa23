//! Analyses in separate processes: how the processes end, and how the server reacts.

use crate::analyses::{ask, post};
use reqwest::Method;
use serde_json::json;
use sidestep::api::{AnalysisDetail, AnalysisState, AnalysisSummary, routes};
use sidestep::comparison::Request;
use sidestep::safety::SafetyLevels;
use sidestep::scene::{Evader, SceneParameters};
use sidestep::synthetic::{Keys, SyntheticParticipant};
use sidestep_server::jobs::children::{Children, Ended};
use sidestep_server::jobs::frames::{FromChild, ToChild};
use sidestep_tests::postgres::{Cluster, Fsync};
use sidestep_tests::process::binary;
use sidestep_tests::{Answer, Database, Driver, Folder, Process, Server, run};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// A server with a study whose analysis takes half a minute.
async fn with_people(folder: &Folder) -> Process {
    with_people_in(folder, &Database::file(folder.root(), "sidestep.db")).await
}

async fn with_people_in(folder: &Folder, database: &Database) -> Process {
    let (trials, url) = (folder.name("trials.csv"), database.url());
    let people = ["--participants", "6", "--tasks", "40", "--seed", "3", "--out", &trials];
    run(&[&["simulate"], &people[..]].concat()).await.json();
    run(&["import", "--study", "default", "--trials", &trials, "--database", &url]).await.json();
    let mut server = Process::start_on(folder, database).await;
    let key = server.key().await;
    server.announcement.push(format!("#key={key}"));
    server
}

/// The experimenter's key, which the server printed when it created the database.
fn key(server: &Process) -> String {
    let said = server.announcement.concat();
    let (_, key) = said.split_once("#key=").expect("a key");
    key.split_whitespace().next().expect("a key").to_owned()
}

async fn asked(server: &Process, method: Method, route: &str) -> Answer {
    Answer::of(server.request(method, route).bearer_auth(key(server)).json(&json!({}))).await
}

async fn asked_for(server: &Process) -> AnalysisSummary {
    asked(server, Method::POST, &routes::admin_analyses("default")).await.into(201)
}

/// Waits until the analysis satisfies a condition.
async fn until(
    server: &Process,
    id: &str,
    wanted: impl Fn(&AnalysisSummary) -> bool,
) -> AnalysisSummary {
    let begun = Instant::now();
    loop {
        let route = routes::admin_analysis(id);
        let now: AnalysisDetail = asked(server, Method::GET, &route).await.into(200);
        if wanted(&now.summary) {
            return now.summary;
        }
        assert!(begun.elapsed() < Duration::from_secs(600), "{now:?}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

/// Starts an analysis and waits until it is running. Returns the analysis id and the process id.
async fn under_way(server: &Process) -> (String, u32) {
    let id = asked_for(server).await.id;
    until(server, &id, |now| now.progress.is_some_and(|progress| progress.done >= 3)).await;
    let children = children(server.id());
    assert_eq!(children.len(), 1, "one analysis at a time");
    (id, children[0])
}

/// The child processes of a process, according to Linux.
fn children(process: u32) -> Vec<u32> {
    let tasks = std::fs::read_dir(format!("/proc/{process}/task")).expect("its threads");
    let of_thread = |thread: std::io::Result<std::fs::DirEntry>| {
        let children = thread.expect("a thread").path().join("children");
        std::fs::read_to_string(children).unwrap_or_default()
    };
    let all: Vec<String> = tasks.map(of_thread).collect();
    all.iter().flat_map(|list| list.split_whitespace()).map(|id| id.parse().unwrap()).collect()
}

/// Waits until a process has exited or is a zombie.
async fn gone(process: u32) -> Duration {
    let begun = Instant::now();
    let lives = || {
        let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
        stat.rsplit_once(')').is_some_and(|(_, fields)| !fields.starts_with(" Z"))
    };
    while lives() {
        assert!(begun.elapsed() < Duration::from_secs(20), "{process} goes on");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    begun.elapsed()
}

fn signal(name: &str, process: u32) {
    let kill = std::process::Command::new("kill").args([name, &process.to_string()]).status();
    assert!(kill.expect("kill").success());
}

#[tokio::test]
async fn a_process_that_is_killed_fails_its_analysis_alone() {
    let folder = Folder::default();
    let server = with_people(&folder).await;
    let (id, process) = under_way(&server).await;
    signal("-KILL", process);
    let failed = until(&server, &id, |now| now.state.is_over()).await;
    assert_eq!(failed.state, AnalysisState::Failed);
    let message = failed.message.unwrap();
    for words in ["killed", "short of memory", "fewer sets", "paper_only"] {
        assert!(message.contains(words), "{message}");
    }
    // A process that crashes.
    let (id, process) = under_way(&server).await;
    signal("-ABRT", process);
    let failed = until(&server, &id, |now| now.state.is_over()).await;
    assert_eq!(failed.state, AnalysisState::Failed);
    assert!(failed.message.unwrap().contains("crashed"));
    // The server reaps the process, and can run the next analysis.
    let someone = Driver::enrol(&server).await;
    someone.drive(&server, 1).await;
    let (_, process) = under_way(&server).await;
    // The process ends with the server, however the server ends.
    server.kill().await;
    eprintln!("gone {:?} after the server was killed", gone(process).await);
}

#[tokio::test]
async fn a_cancelled_analysis_stops_within_a_second() {
    let folder = Folder::default();
    let server = with_people(&folder).await;
    let (id, process) = under_way(&server).await;
    // The process has the lowest priority and yields to all other processes, above all to the
    // server and the database.
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap();
    let fields: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_whitespace().collect();
    assert_eq!(fields[16], "19", "its priority: {stat}");
    for thread in std::fs::read_dir(format!("/proc/{process}/task")).unwrap() {
        let stat = std::fs::read_to_string(thread.unwrap().path().join("stat")).unwrap();
        let fields = stat.rsplit_once(')').unwrap().1;
        assert_eq!(fields.split_whitespace().nth(16), Some("19"), "{stat}");
    }
    let score = std::fs::read_to_string(format!("/proc/{process}/oom_score_adj")).unwrap();
    assert_eq!(score.trim(), "1000");
    // The process has no key, no database and no socket.
    assert_eq!(std::fs::read(format!("/proc/{process}/environ")).unwrap(), b"");
    for file in std::fs::read_dir(format!("/proc/{process}/fd")).unwrap() {
        let open = std::fs::read_link(file.unwrap().path()).unwrap_or_default();
        let open = open.to_string_lossy().into_owned();
        assert!(!open.contains("socket") && !open.contains(".db"), "{open}");
    }

    let cancel = async |id: &str, process| {
        let cancelled = asked(&server, Method::POST, &routes::cancel_analysis(id)).await;
        let now: AnalysisSummary = cancelled.into(200);
        assert_eq!(now.state, AnalysisState::Cancelled);
        let took = gone(process).await;
        eprintln!("stopped {took:?} after it was cancelled");
        took
    };
    // Measure up to three times, because a low-priority process exits slowly on a busy machine.
    let mut took = vec![cancel(&id, process).await];
    while took.len() < 3 && took.iter().all(|&took| took >= Duration::from_secs(2)) {
        let (id, process) = under_way(&server).await;
        took.push(cancel(&id, process).await);
    }
    assert!(took.iter().any(|&took| took < Duration::from_secs(2)), "{took:?}");

    // A server that is asked to stop does not wait for an analysis. The analysis continues at the
    // next start.
    let (_, process) = under_way(&server).await;
    let server_id = server.id();
    signal("-TERM", server_id);
    let took = gone(server_id).await;
    eprintln!("the server stopped {took:?} after it was asked to");
    assert!(took < Duration::from_secs(5), "{took:?}");
    gone(process).await;
}

/// At a system shutdown, every process is asked to exit.
#[tokio::test]
async fn a_process_that_is_asked_to_end_with_the_server_goes_on_at_the_next_start() {
    let folder = Folder::default();
    let server = with_people(&folder).await;
    let (id, process) = under_way(&server).await;
    let (key, server_id) = (key(&server), server.id());
    signal("-TERM", process);
    signal("-TERM", server_id);
    gone(server_id).await;
    drop(server);
    let server = Process::start(&folder).await;
    let request = server.request(Method::GET, &routes::admin_analysis(&id)).bearer_auth(key);
    let now: AnalysisDetail = Answer::of(request).await.into(200);
    // The server might have restarted the analysis by now.
    assert!(!now.summary.state.is_over() && now.summary.message.is_none(), "{now:?}");
}

fn child(memory_mib: u64) -> Children {
    Children { program: Some(binary().to_owned()), memory_mib, threads: 1, nice: 0 }
}

/// Sends a child process an analysis of `people` participants with `tasks` tasks each, and returns
/// all its messages.
async fn analysed(memory_mib: u64, people: u64, tasks: u64) -> Result<Vec<FromChild>, Ended> {
    let mut child = child(memory_mib).start().unwrap();
    let scene = SceneParameters::default();
    let safety = SafetyLevels::solve(&scene, &mut |_| ControlFlow::Continue(())).unwrap();
    let [human, robot] = Evader::ALL.map(|evader| safety.of(evader).encode());
    let request = Request { paper_only: true, ..Request::default() };
    let study = "default".to_owned();
    let first = ToChild::Analyse { request: Box::new(request), study, scene, human: human.len() };
    child.tell(&first, &[human, robot].concat()).await.unwrap();
    for number in 0..people {
        let person = SyntheticParticipant::new(3, number).recorded(tasks, Keys::Clock);
        let (message, beside) = ToChild::participant(&person);
        if child.tell(&message, &beside).await.is_err() {
            break;
        }
    }
    let _ = child.tell(&ToChild::Begin, &[]).await;
    let mut said = Vec::new();
    while let Ok((message, _)) = child.hear().await {
        let is_question = matches!(message, FromChild::Wanted(_));
        let is_over = matches!(message, FromChild::Done { .. } | FromChild::Failed(_));
        said.push(message);
        if is_over {
            return Ok(said);
        }
        if is_question {
            let _ = child.tell(&ToChild::Cells { kept: false }, &[]).await;
        }
    }
    Err(child.ended().await)
}

#[tokio::test]
async fn too_little_memory_is_a_sentence() {
    let said = analysed(256, 2, 10).await.unwrap();
    assert!(matches!(said.last(), Some(FromChild::Done { .. })), "{:?}", said.last());
    let ended = analysed(40, 30, 100).await.unwrap_err();
    let Ended::Failed(why) = ended else { panic!("{ended:?}") };
    for words in ["more memory than the 40 MiB", "--analysis-memory", "fewer sets"] {
        assert!(why.contains(words), "{why}");
    }
}

#[tokio::test]
async fn what_would_cost_too_much_is_refused_with_figures() {
    let server = Server::with_study_and(r#"phases = [{ phase = "task", scenes = 8 }]"#, |args| {
        args.analysis.hours = 1e-6;
    })
    .await;
    let route = routes::admin_analyses("default");
    // There are no trials yet.
    ask(&server, json!({})).await;
    let driver = Driver::enrol(&server).await;
    driver.drive_restlessly(&server, &SceneParameters::default(), 1).await;
    let grids = json!({ "grids": { "rbf_gamma": (1..=64).collect::<Vec<_>>() } });
    let refused = post(&server, &route, grids).await;
    let message = refused.problem(422, "invalid", Some("grids.rbf_gamma"));
    for words in ["at most 0.000001 hours", "2048 MiB", "estimated to take", "--analysis-hours"] {
        assert!(message.contains(words), "{message}");
    }
    let refused = post(&server, &route, json!({})).await;
    refused.problem(422, "invalid", Some("paper_only"));
}

#[tokio::test]
#[ignore = "needs PostgreSQL"]
async fn the_analysis_of_a_killed_server_is_taken_over() {
    let cluster = Cluster::new(Fsync::Off).await;
    let database = cluster.create();
    let (one, two) = (Folder::default(), Folder::default());
    let first = with_people_in(&one, &database).await;
    let (id, process) = under_way(&first).await;
    let mut second = Process::start_on(&two, &database).await;
    second.announcement.clone_from(&first.announcement);
    first.kill().await;
    gone(process).await;
    // The lease of the dead server expires after a minute.
    let attempts = async || database.number("SELECT attempts FROM analysis").await;
    let begun = Instant::now();
    while attempts().await == 1 {
        assert!(begun.elapsed() < Duration::from_secs(90), "nobody takes it over");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    let over = until(&second, &id, |now| now.state.is_over()).await;
    assert_eq!((over.state, attempts().await), (AnalysisState::Done, 2));
}
