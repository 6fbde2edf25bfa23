//! Attacks from other sites.

use reqwest::Method;
use serde_json::json;
use sidestep::api::routes;
use sidestep_tests::{Answer, Server};

const PATHS: [&str; 10] = [
    "/",
    "/s/default",
    "/lab",
    "/lab/replay",
    "/assets/app-0123abcd.js",
    "/assets/none.js",
    "/healthz",
    "/api/v1/studies/default",
    "/api/v1/participants/me",
    "/nothing",
];

pub(super) async fn case_25_framing_and_sniffing(server: &Server) {
    for path in PATHS {
        let answer = server.request(Method::GET, path).send().await.unwrap();
        let header = |name: &str| answer.headers().get(name).map_or("", |it| it.to_str().unwrap());
        let policy = header("content-security-policy");
        let scripts = policy.split(';').find(|rule| rule.contains("script-src")).unwrap();
        assert_eq!(scripts.trim(), "script-src 'self' 'wasm-unsafe-eval'", "{path}");
        assert!(policy.starts_with("default-src 'none';"), "{path}: {policy}");
        assert!(policy.contains("frame-ancestors 'none'"), "{path}: {policy}");
        assert!(!policy.contains("unsafe-inline"), "{path}: {policy}");
        assert_eq!(header("x-frame-options"), "DENY", "{path}");
        assert_eq!(header("x-content-type-options"), "nosniff", "{path}");
        assert_eq!(header("strict-transport-security"), "", "{path}: this came without TLS");
    }
}

pub(super) async fn case_26_requests_from_other_sites(server: &Server) {
    let enrol = |name: &str, value: &str| {
        server
            .request(Method::POST, &routes::participants("default"))
            .header(name, value)
            .json(&json!({ "consent": true }))
    };
    for (name, value) in [
        ("sec-fetch-site", "cross-site"),
        ("sec-fetch-site", "same-site"),
        ("origin", "https://evil.example"),
        ("origin", "null"),
    ] {
        Answer::of(enrol(name, value)).await.problem(403, "cross_site", None);
    }
    for (name, value) in [("sec-fetch-site", "same-origin"), ("origin", server.origin.as_str())] {
        assert_eq!(Answer::of(enrol(name, value)).await.status, 201);
    }
    for path in PATHS {
        let request = server.request(Method::OPTIONS, path);
        let request = request.header("origin", "https://evil.example");
        let answer = request.header("access-control-request-method", "PUT").send().await.unwrap();
        let allowed =
            |name: &reqwest::header::HeaderName| name.as_str().starts_with("access-control-");
        assert!(!answer.headers().keys().any(allowed), "{path}: no other site may read");
    }
    let delete = server.request(Method::DELETE, &routes::study("default"));
    Answer::of(delete).await.problem(405, "method_not_allowed", None);
}
