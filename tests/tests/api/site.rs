//! Pages, assets, and the headers of every response.

use reqwest::Method;
use reqwest::header::HeaderMap;
use sidestep_tests::Server;
use sidestep_tests::server::SHORT_STUDY;

async fn head(server: &Server, path: &str, coding: &str) -> (u16, HeaderMap, String) {
    let request = server.request(Method::GET, path).header("accept-encoding", coding);
    let answer = request.send().await.unwrap();
    let (status, headers) = (answer.status().as_u16(), answer.headers().clone());
    let body = answer.bytes().await.unwrap();
    (status, headers, String::from_utf8_lossy(&body).into_owned())
}

#[tokio::test]
async fn every_answer_carries_the_security_headers() {
    let server = Server::with_study(SHORT_STUDY).await;
    for path in [
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
    ] {
        let (_, headers, _) = head(&server, path, "identity").await;
        let header = |name: &str| headers.get(name).map_or("", |v| v.to_str().unwrap());
        let policy = header("content-security-policy");
        assert!(
            policy.starts_with("default-src 'none'; script-src 'self' 'wasm-unsafe-eval';"),
            "{path}"
        );
        assert!(policy.contains("worker-src 'self';"), "{path}");
        assert!(policy.contains("frame-ancestors 'none'"), "{path}");
        assert_eq!(header("x-content-type-options"), "nosniff", "{path}");
        assert_eq!(header("referrer-policy"), "no-referrer", "{path}");
        assert_eq!(header("cross-origin-opener-policy"), "same-origin", "{path}");
        assert_eq!(header("cross-origin-embedder-policy"), "require-corp", "{path}");
        assert_eq!(header("cross-origin-resource-policy"), "same-origin", "{path}");
        assert_eq!(header("access-control-allow-origin"), "", "{path}");
        let cache = match path {
            "/assets/app-0123abcd.js" => "public, max-age=31536000, immutable",
            "/" | "/s/default" | "/lab" | "/lab/replay" => "no-cache",
            _ if path.starts_with("/api") => "no-store",
            _ => continue,
        };
        assert_eq!(header("cache-control"), cache, "{path}");
    }
}

#[tokio::test]
async fn pages_and_compressed_assets() {
    let server = Server::with_study(SHORT_STUDY).await;
    for (path, title) in
        [("/", "index"), ("/s/default", "participant"), ("/lab", "lab"), ("/lab/a/b", "lab")]
    {
        let (status, headers, body) = head(&server, path, "identity").await;
        assert_eq!(status, 200, "{path}");
        assert!(headers["content-type"].to_str().unwrap().starts_with("text/html"), "{path}");
        assert!(body.contains(title), "{path}: {body}");
    }
    let asset = "/assets/app-0123abcd.js";
    let (_, headers, body) = head(&server, asset, "gzip, br").await;
    assert_eq!(headers["content-encoding"], "br");
    assert_eq!(headers["content-type"], "text/javascript");
    assert_eq!(body, "not really brotli");
    assert!(headers["vary"].to_str().unwrap().eq_ignore_ascii_case("accept-encoding"));
    let (_, headers, _) = head(&server, asset, "gzip").await;
    assert_eq!(headers["content-encoding"], "gzip");
    let (_, headers, body) = head(&server, asset, "identity").await;
    assert!(headers.get("content-encoding").is_none());
    assert_eq!(body, "export const plain = 1;");
    for path in [
        "/assets/none.js",
        "/assets/..%2findex.html",
        "/assets/%2e%2e/study.toml",
        "/assets/%00",
        "/assets/",
    ] {
        let (status, headers, _) = head(&server, path, "identity").await;
        assert_eq!(status, 404, "{path}");
        assert!(headers.get("cache-control").is_none(), "{path}");
    }
    assert_eq!(head(&server, "/favicon.ico", "identity").await.0, 204);
}

#[tokio::test]
async fn the_first_page_names_the_open_studies() {
    let server = Server::with_study("slug = \"pilot\"\ntitle = \"Ways & <means>\"").await;
    let home = async || head(&server, "/", "identity").await.2;
    let make = async |text: &str| {
        let request = server.request(Method::POST, "/api/v1/admin/studies");
        let draft = serde_json::json!({ "toml": text });
        let answer = request.bearer_auth(&server.key).json(&draft).send().await.unwrap();
        assert_eq!(answer.status(), 201);
    };
    let set = async |slug: &str, status: &str| {
        let route = format!("/api/v1/admin/studies/{slug}/status");
        let request = server.request(Method::PUT, &route).bearer_auth(&server.key);
        let answer = request.json(&serde_json::json!({ "status": status })).send().await.unwrap();
        assert_eq!(answer.status(), 200);
    };
    let link = |slug: &str, title: &str| format!("href=\"/s/{slug}\">{title}</a>");
    let first = link("pilot", "Ways &amp; &lt;means&gt;");
    assert!(home().await.contains(&first), "{}", home().await);
    make("slug = \"another\"\ntitle = \"Another\"").await;
    make("slug = \"not-yet\"\ntitle = \"Not yet\"\nstatus = \"closed\"").await;
    // This study is not listed, because visitors of the page do not come from a recruiting service
    // with an external id.
    make("slug = \"paid\"\ntitle = \"Paid\"\n[recruitment]\nrequire_external_id = true").await;
    let page = home().await;
    assert!(page.find(&first) < page.find(&link("another", "Another")), "{page}");
    assert_eq!(page.matches("href=\"/s/").count(), 2, "{page}");
    set("pilot", "closed").await;
    set("another", "archived").await;
    let page = home().await;
    assert!(page.contains("No study is open") && !page.contains("/s/"), "{page}");
}

#[tokio::test]
async fn start_leads_to_the_study() {
    let server = Server::with_study("slug = \"pilot\"").await;
    let answer = server.request(Method::GET, "/start").send().await.unwrap();
    assert_eq!(answer.status(), 303);
    assert_eq!(answer.headers()["location"], "/s/pilot");
}
