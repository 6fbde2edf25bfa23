//! Guesses of experimenters' keys, and misuse of cookies.

use futures_util::future::join_all;
use reqwest::{Method, Response};
use serde_json::json;
use sidestep::api::routes;
use sidestep_tests::{Answer, Driver, Server};

async fn sign_in(server: &Server, key: &str) -> Response {
    let request = server.request(Method::POST, routes::SESSION);
    request.json(&json!({ "key": key })).send().await.unwrap()
}

fn cookie(answer: &Response) -> String {
    let cookie = answer.headers()["set-cookie"].to_str().unwrap();
    cookie.split(';').next().unwrap().to_owned()
}

async fn with_cookie(server: &Server, method: Method, cookie: &str) -> Answer {
    Answer::of(server.request(method, routes::SESSION).header("cookie", cookie)).await
}

pub(super) async fn case_27_guessing_keys_and_old_cookies(server: &Server) {
    for _ in 0..10 {
        assert_eq!(sign_in(server, "guess").await.status(), 401);
    }
    let throttled = sign_in(server, "guess").await;
    assert_eq!(throttled.status(), 429);
    let wait: u64 = throttled.headers()["retry-after"].to_str().unwrap().parse().unwrap();
    assert!((1..=60).contains(&wait));
    // Participants are not affected.
    assert_eq!(Driver::enrol(server).await.scenes().len(), 5);

    // The server does not adopt a cookie that someone else has set, and each session gets its own
    // cookie.
    let fixed = "sidestep_session=fixed";
    let request = server.request(Method::POST, routes::SESSION).header("cookie", fixed);
    let first = request.json(&json!({ "key": server.key })).send().await.unwrap();
    let second = sign_in(server, &server.key).await;
    let (first, second) = (cookie(&first), cookie(&second));
    assert!(first != fixed && first != second);
    assert_eq!(with_cookie(server, Method::GET, fixed).await.status, 401);
    assert_eq!(with_cookie(server, Method::GET, &first).await.status, 200);
    // After sign-out, a copy of the cookie is worthless.
    assert_eq!(with_cookie(server, Method::DELETE, &first).await.status, 204);
    assert_eq!(with_cookie(server, Method::GET, &first).await.status, 401);
    assert_eq!(with_cookie(server, Method::GET, &second).await.status, 200);
}

/// All guesses and the right key come from the same address, as behind a proxy. Comparison times
/// leak nothing, because keys are looked up by their hashes.
pub(super) async fn case_28_the_right_key_among_wrong_ones(server: &Server) {
    let guess = async |i: usize| sign_in(server, &format!("guess {i}")).await;
    let guesses = join_all((0..100).map(guess)).await;
    let throttled = guesses.iter().filter(|answer| answer.status() == 429).count();
    assert_eq!(throttled, 90);
    for _ in 0..3 {
        assert_eq!(server.admin(routes::ADMIN_STUDIES).await.status, 200);
        assert_eq!(sign_in(server, &server.key).await.status(), 200);
    }
    assert_eq!(sign_in(server, "guess").await.status(), 429);
}
