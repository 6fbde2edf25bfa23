//! Malicious paths, parameters and texts.

use reqwest::Method;
use serde_json::json;
use sidestep::api::{Enrolled, ParticipantPage, routes};
use sidestep_tests::{Answer, Driver, Server};

pub(super) async fn case_20_paths_that_leave_the_folder(server: &Server) {
    for path in [
        "/assets/..%2findex.html",
        "/assets/%2e%2e/study.toml",
        "/assets/..%5cstudy.toml",
        "/assets/%00",
        "/assets/app-0123abcd.js%00.css",
        "/assets//etc/passwd",
        "/assets/",
        "/api/v1/studies/a%2fb",
        "/api/v1/studies/%00",
        "/api/v1/studies/%ff",
        "/api/v1/nothing",
        "/api/v2/studies/default",
    ] {
        let answer = server.get(path).await;
        assert_eq!(answer.status, 404, "{path}");
    }
}

pub(super) async fn case_21_sql_in_parameters(server: &Server) {
    let driver = Driver::enrol(server).await;
    driver.drive(server, 1).await;
    let people = routes::admin_participants("default");
    for query in ["sort=number;DROP%20TABLE%20trial", "order=asc--", "stage=x'", "limit=1%20OR%201"]
    {
        let name = query.split('=').next();
        server.admin(&format!("{people}?{query}")).await.problem(422, "invalid", name);
    }
    for search in ["'%20OR%20'1'='1", "1;DROP%20TABLE%20participant", "%22%20OR%201=1--"] {
        let page: ParticipantPage =
            server.admin(&format!("{people}?search={search}")).await.into(200);
        assert_eq!(page.total, 0, "{search}");
    }
    server.get(&routes::study("%27%20OR%201=1")).await.problem(404, "not_found", None);
    let page: ParticipantPage = server.admin(&people).await.into(200);
    assert_eq!(page.total, 1);
}

pub(super) async fn case_22_wildcards_in_searches(server: &Server) {
    let body = json!({ "consent": true, "external_id": "a_b" });
    let _: Enrolled = Driver::ask(server, body).await.into(201);
    let people = routes::admin_participants("default");
    for (search, count) in [("a_b", 1), ("A_B", 1), ("a%25", 0), ("%25", 0), ("_", 0), ("axb", 0)] {
        let page: ParticipantPage =
            server.admin(&format!("{people}?search={search}")).await.into(200);
        assert_eq!(page.total, count, "{search}");
    }
}

pub(super) async fn case_23_formulas_in_tables(server: &Server) {
    for id in ["=1+1", "+1", "-1", "@a"] {
        let body = json!({ "consent": true, "external_id": id });
        assert_eq!(Driver::ask(server, body).await.status, 201);
    }
    let driver = Driver::enrol(server).await;
    driver.drive(server, 1).await;
    let route = format!("{}?format=csv", routes::admin_participants("default"));
    let people = server.admin_text(&route).await;
    for id in ["=1+1", "+1", "-1", "@a"] {
        assert!(people.contains(&format!(",'{id},")), "{id} in {people}");
        assert!(!people.contains(&format!(",{id},")), "{id} in {people}");
    }
    // Negative numbers get no apostrophe, unlike formulas.
    let steps = server.export("default").await;
    assert!(steps.contains(",-") && !steps.contains(",'"), "{steps}");
}

pub(super) async fn case_24_scripts_in_texts(server: &Server) {
    let script = "<script>alert(1)</script>";
    let study = format!(
        "slug = \"scripts\"\ntitle = \"{script}\"\n[consent]\ntext = {{ en = \"{script} \
         [link](javascript:alert(1)) <img src=x onerror=alert(1)>\" }}\n"
    );
    let request = server.request(Method::POST, routes::ADMIN_STUDIES).bearer_auth(&server.key);
    let made = Answer::of(request.json(&json!({ "toml": study }))).await;
    assert_eq!(made.status, 201, "{}", made.body);
    let home = server.request(Method::GET, "/").send().await.unwrap().text().await.unwrap();
    assert!(home.contains("&lt;script&gt;alert(1)&lt;") && !home.contains(script), "{home}");
    let texts = server.get(&format!("{}?language=en", routes::texts("scripts"))).await;
    let consent = texts.body["consent"].as_str().unwrap_or_default();
    assert!(consent.contains("alert(1)"), "{}", texts.body);
    for word in ["<script", "<img", "href=\"javascript:"] {
        assert!(!consent.contains(word), "{word} in {consent}");
    }
}
