//! Studies whose robots act by rule, from the study file to exports and imports.

use serde_json::{Value, json};
use sidestep::api::{Texts, TrialDetail, routes};
use sidestep::scene::{RobotPolicy, Rule, Scene};
use sidestep::trial::Phase;
use sidestep_tests::{Driver, Folder, Server, driven, run};

const ROBOTS: &str = r#"
phases = [{ phase = "practice", scenes = 3 }, { phase = "task", scenes = 8 }]

[[robots]]
name = "straight"

[[robots]]
name = "detour"
rule = "way_points"
way_points_m = [[6.0, 1.5], [13.0, -1.0]]

[[robots]]
name = "surprise"
rule = "script"
turns = [{ until_s = 3.0, turn_rate_radps = 0.0 }, { until_s = 4.0, turn_rate_radps = 0.4 }]

[[robots]]
name = "careful"
rule = "evades"
threshold_m = 0.5
"#;

/// The names of the robots in these scenes.
fn names(scenes: &[(String, Scene)]) -> Vec<&str> {
    scenes.iter().map(|(_, scene)| scene.robot_name()).collect()
}

fn sorted(mut names: Vec<&str>) -> Vec<&str> {
    names.sort_unstable();
    names
}

async fn page(server: &Server) -> String {
    let answer = server.request(reqwest::Method::GET, "/s/default").send().await.unwrap();
    answer.text().await.unwrap()
}

#[tokio::test]
async fn robots_go_from_the_study_file_to_exports_and_back() {
    let server = Server::with_study(ROBOTS).await;
    assert!(page(&server).await.contains("participant_robots"));
    let mut met = Vec::new();
    for _ in 0..2 {
        let driver = Driver::enrol(&server).await;
        let scenes = driver.scenes();
        let tasks = sorted(names(&scenes[3..]));
        let each = ["careful", "detour", "straight", "surprise"];
        assert_eq!(tasks, each.into_iter().flat_map(|it| [it, it]).collect::<Vec<_>>());
        met.push(names(&scenes).join(" "));
        for (id, trial) in driver.drive(&server, scenes.len()).await {
            let detail: TrialDetail = server.admin(&routes::admin_trial(&id)).await.into(200);
            assert!(detail.replay.exact && detail.summary.flags.is_empty(), "{detail:?}");
            assert_eq!(detail.states, trial.states);
            let (_, scene) = scenes.iter().find(|(known, _)| *known == id).unwrap();
            assert_eq!(detail.scene, *scene);
            let turned = trial.states.iter().any(|state| state.robot.psi != scene.robot.psi);
            let may_turn = scene.policy.as_ref().unwrap().may_turn();
            let reacts = scene.policy.as_ref().unwrap().reacts();
            assert!(turned == may_turn || reacts && !turned, "{}", scene.robot_name());
        }
        assert_eq!(driver.complete(&server).await.status, 200);
    }
    // The next participant meets the robots in another order.
    assert_ne!(met[0], met[1]);

    // The plan survives in a copy and passes the check, and the table of trials names the robots.
    let (folder, database) = (Folder::default(), server.database());
    let report = run(&["check", "--database", &database]).await.json();
    assert_eq!((&report["wrong"], &report["flagged"]), (&json!([]), &json!(0)));
    let out = folder.name("out");
    run(&["export", "--database", &database, "--out", &out]).await.json();
    let trials = folder.text("out/trials.csv");
    let mut lines = trials.lines().map(|line| line.rsplit(',').next().unwrap());
    assert_eq!(lines.next(), Some("robot"));
    assert_eq!(lines.collect::<Vec<_>>().join(" "), met.join(" "));

    // A file does not name the robots. An import into the same study recognises them.
    let study = folder.file("study.toml", format!("slug = \"again\"\n{ROBOTS}"));
    let copy = folder.database("copy.db");
    run(&["design", "--study", &study, "--out", &folder.name("design")]).await.json();
    let scenes = folder.text("design/scenes.csv");
    assert!(scenes.lines().next().unwrap().ends_with(",robot"), "{scenes}");
    assert!(scenes.contains(",careful\n") && scenes.contains(",detour\n"));
    let again = Server::on(copy.clone(), Some(&format!("slug = \"again\"\n{ROBOTS}"))).await;
    let steps = folder.name("out/steps.csv");
    let import = ["import", "--study", "again", "--trials", &steps, "--database", &copy];
    // The ids of the trials are those of the first database, so this is another database.
    let imported = run(&import).await.json();
    assert_eq!((&imported["trials"], &imported["flagged"]), (&json!(22), &json!(0)));
    let out = folder.name("again");
    run(&["export", "--study", "again", "--database", &copy, "--out", &out]).await.json();
    let trials = folder.text("again/trials.csv");
    let lines = trials.lines().skip(1).map(|line| line.rsplit(',').next().unwrap());
    assert_eq!(sorted(lines.collect()), sorted(met.join(" ").split(' ').collect()));
    let report = run(&["check", "--database", &copy]).await.json();
    assert_eq!(report["wrong"], json!([]));
    drop(again);
}

#[tokio::test]
async fn a_robot_that_moves_otherwise_is_flagged() {
    let server = Server::with_study(ROBOTS).await;
    let driver = Driver::enrol(&server).await;
    for (id, scene) in driver.scenes() {
        let straight = Scene { policy: None, ..scene.clone() };
        let answer = driver.send(&server, &id, &driven(&straight)).await;
        assert_eq!(answer.status, 201, "{}", answer.body);
        let flags = server.admin(&routes::admin_trial(&id)).await.body["flags"].clone();
        let same = driven(&straight).states == driven(&scene).states;
        assert_eq!(flags, if same { json!([]) } else { json!(["replay_mismatch"]) });
    }
}

#[tokio::test]
async fn between_participants_each_meets_one_robot() {
    let study = format!("robots_vary = \"between\"\n{ROBOTS}");
    let server = Server::with_study(&study).await;
    let mut met = Vec::new();
    for _ in 0..4 {
        let driver = Driver::enrol(&server).await;
        let scenes = driver.scenes();
        let all = names(&scenes);
        assert!(all.iter().all(|name| *name == all[0]), "{all:?}");
        met.push(all[0].to_owned());
    }
    assert_eq!(met, ["straight", "detour", "surprise", "careful"]);
}

#[tokio::test]
async fn a_study_that_gets_robots_serves_those_who_have_begun_too() {
    let plain = "phases = [{ phase = \"task\", scenes = 2 }]\n";
    let server = Server::with_study(plain).await;
    assert!(!page(&server).await.contains("participant_robots"));
    let before = Driver::enrol(&server).await;
    let robot = "[[robots]]\nname = \"careful\"\nrule = \"evades\"\nthreshold_m = 0.5\n";
    let server = server.restarted_with_study(&format!("{plain}{robot}")).await;
    assert!(page(&server).await.contains("participant_robots"));
    let after = Driver::enrol(&server).await;
    let policy = after.scenes()[0].1.policy.clone().unwrap();
    let careful = RobotPolicy {
        name: "careful".into(),
        rule: Rule::Evades,
        threshold_m: Some(0.5),
        ..RobotPolicy::default()
    };
    assert_eq!(*policy, careful);
    before.drive(&server, 2).await;
    after.drive(&server, 2).await;
    // Whoever enrolled with robots keeps them.
    let server = server.restarted_with_study(plain).await;
    assert!(page(&server).await.contains("participant_robots"));
    let texts: Texts = server.get(&routes::texts("default")).await.into(200);
    let robot = texts.sentences.get("instructions.robot").unwrap();
    assert!(robot.contains("straight"), "{robot}");
    let detail: Value = server.admin(&routes::admin_trial(&after.scenes()[0].0)).await.body;
    assert_eq!(detail["scene"]["policy"]["rule"], "evades");
    assert_eq!(detail["phase"], Phase::Task.word());
}

#[tokio::test]
async fn faults_in_a_robot_name_line_and_field() {
    let folder = Folder::default();
    let refuse = async |robots: &str, words: &[&str]| {
        let study = folder.file("study.toml", format!("slug = \"a\"\n{robots}"));
        run(&["design", "--study", &study, "--out", &folder.name("d")]).await.refused(2, words);
    };
    let robot = |rest: &str| format!("[[robots]]\nname = \"r\"\n{rest}\n");
    refuse(&robot("rule = \"flees\""), &["study.toml:4: robots[0].rule", "evades", "flees"]).await;
    refuse(&robot("rule = \"evades\""), &["robots[0].threshold_m", "a value"]).await;
    let low = robot("rule = \"evades\"\nthreshold_m = -3.0");
    refuse(&low, &["study.toml:5: robots[0].threshold_m", "more than -3", "found -3.0"]).await;
    refuse(&robot("threshold_m = 1.0"), &["study.toml:4: robots[0].threshold_m"]).await;
    let twice = robot("") + &robot("");
    refuse(&twice, &["robots[1].name: expected each name once"]).await;
    let slower =
        robot("rule = \"evades\"\nthreshold_m = 1.0") + "[parameters.robot]\nspeed_mps = 1.5\n";
    refuse(&slower, &["robots[0].rule", "closed form", "1.5 m/s"]).await;
    refuse("robots_vary = \"both\"", &["robots_vary", "within", "between"]).await;
    let colour = robot("colour = \"red\"");
    refuse(&colour, &["study.toml:4: robots[0].colour"]).await;
}
