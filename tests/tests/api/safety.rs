//! Value functions of unequal vehicles, which the server solves in the background, stores and
//! serves.

use reqwest::Method;
use sha2::{Digest, Sha256};
use sidestep::api::{StudyInfo, TrainedPredictor, TrialDetail, routes};
use sidestep::reachability::ValueFunction;
use sidestep::safety::value_function;
use sidestep::scene::{Evader, SceneParameters};
use sidestep::vehicle::TurnInput;
use sidestep_tests::server::{SHORT_STUDY, UNEQUAL_STUDY};
use sidestep_tests::{Driver, Server, behind, upload_with};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

async fn parameters(server: &Server) -> SceneParameters {
    server.get(&routes::study("default")).await.into::<StudyInfo>(200).parameters
}

/// Drives every scene, turning alternately left and right. Returns the trials' ids.
async fn drive(server: &Server) -> Vec<String> {
    let parameters = parameters(server).await;
    let driver = Driver::enrol(server).await;
    let scenes = driver.scenes();
    for (i, (id, scene)) in scenes.iter().enumerate() {
        let mut inputs = vec![TurnInput::Straight; 50];
        inputs[8 + i..20 + i].fill([TurnInput::Left, TurnInput::Right][i % 2]);
        let answer = driver.send(server, id, &upload_with(&parameters, scene, inputs)).await;
        assert_eq!(answer.status, 201, "{}", answer.body);
    }
    scenes.into_iter().map(|(id, _)| id).collect()
}

async fn detail(server: &Server, id: &str) -> TrialDetail {
    server.admin(&routes::admin_trial(id)).await.into(200)
}

/// Waits until both functions are solved, and returns the trial.
async fn solved(server: &Server, id: &str) -> TrialDetail {
    let begun = Instant::now();
    loop {
        let trial = detail(server, id).await;
        if Evader::ALL.iter().all(|&evader| trial.value_function(evader).is_some()) {
            return trial;
        }
        assert!(begun.elapsed() < Duration::from_secs(600), "the server does not solve");
        // Meanwhile, the server answers requests.
        assert_eq!(server.get("/healthz").await.status, 200);
    }
}

async fn predictor(server: &Server, id: &str) -> TrainedPredictor {
    server.admin(&routes::admin_predictor(id)).await.into(200)
}

#[tokio::test]
async fn unequal_vehicles_are_solved_and_served() {
    let server = Server::with_study(UNEQUAL_STUDY).await;
    let ids = drive(&server).await;
    let trial = solved(&server, &ids[0]).await;
    assert!(trial.replay.exact);
    assert_ne!(trial.value_function_hr, trial.value_function_rh);
    for evader in Evader::ALL {
        let id = trial.value_function(evader).unwrap();
        let address = routes::value_function(id);
        let answer = server.request(Method::GET, &address).send().await.unwrap();
        let cache = answer.headers()["cache-control"].to_str().unwrap();
        assert_eq!(cache, "public, max-age=31536000, immutable");
        let bytes = answer.bytes().await.unwrap();
        assert_eq!(hex::encode(Sha256::digest(&bytes)), id);
        let function = ValueFunction::decode(&bytes).unwrap();
        assert_eq!(function.game(), trial.parameters.game(evader));
        // A solve in the browser gives the same function.
        let game = trial.parameters.game(evader);
        let here = value_function(game, &mut |_| ControlFlow::Continue(())).unwrap();
        assert_eq!(here.id(), id);
        for coding in ["br", "gzip"] {
            let request = server.request(Method::GET, &address).header("accept-encoding", coding);
            let answer = request.send().await.unwrap();
            assert_eq!(answer.headers()["content-encoding"], coding);
            let packed = answer.bytes().await.unwrap().len();
            eprintln!("{evader:?}: {} bytes, {coding} {packed}", bytes.len());
            assert!(packed <= 1_500_000, "{coding}: {packed} bytes");
        }
    }
    let learned = predictor(&server, &ids[6]).await;
    assert_eq!((learned.trials, learned.fallback), (6, None));
    assert_eq!(learned.predictor.features.len(), 8);
}

#[tokio::test]
async fn a_server_that_is_not_to_solve_says_so() {
    let server = Server::with_study_and(UNEQUAL_STUDY, |args| args.no_solve = true).await;
    let ids = drive(&server).await;
    let answer = server.admin(&routes::admin_trial(&ids[6])).await;
    for name in ["value_function_hr", "value_function_rh"] {
        assert!(answer.body[name].is_null() && answer.body.get(name).is_some(), "{name}");
    }
    let fallback = predictor(&server, &ids[6]).await.fallback.unwrap();
    assert!(fallback.contains("not solved"), "{fallback}");
    // The next start solves the functions, and a further start finds them solved.
    let server = server.restarted_with(None, |args| args.no_solve = false).await;
    let first = solved(&server, &ids[6]).await;
    assert_eq!(predictor(&server, &ids[6]).await.fallback, None);
    let server = server.restarted_with(None, |args| args.no_solve = true).await;
    assert_eq!(detail(&server, &ids[6]).await, first);
}

#[tokio::test]
async fn a_database_that_lacks_its_functions_gets_them() {
    for study in [SHORT_STUDY, UNEQUAL_STUDY] {
        let server = Server::with_study(study).await;
        let ids = drive(&server).await;
        let before = solved(&server, &ids[0]).await;
        let database = server.database();
        let stopped = server.stop().await;
        behind(&database)
            .execute("DELETE FROM safety_function; DELETE FROM value_function;")
            .await
            .unwrap();
        let server = stopped.start().await;
        assert_eq!(solved(&server, &ids[0]).await, before);
    }
}
