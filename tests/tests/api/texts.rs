//! Participants' texts: their languages, and the study's own texts.

use reqwest::Method;
use reqwest::header::HeaderValue;
use sidestep::api::{Texts, routes};
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Folder, Server, run};

/// The texts for a browser with these languages. Also checks the response's `Vary`.
async fn texts(server: &Server, query: &str, languages: &str) -> Texts {
    let route = format!("{}{query}", routes::texts("default"));
    let request = server.request(Method::GET, &route).header("accept-language", languages);
    let answer = request.send().await.unwrap();
    assert_eq!(answer.status(), 200);
    let vary: Vec<_> = answer.headers().get_all("vary").iter().collect();
    let says =
        |value: &HeaderValue| value.to_str().is_ok_and(|text| text.contains("Accept-Language"));
    assert!(vary.iter().any(|value| says(value)), "{vary:?}");
    answer.json().await.unwrap()
}

#[tokio::test]
async fn texts_come_in_the_language_of_the_browser_or_of_the_link() {
    let folder = Folder::default();
    let out = folder.name("languages");
    run(&["languages", "--out", &out]).await.json();
    run(&["languages", "--out", &out]).await.refused(2, &["--out", "en.toml"]);
    let english = std::fs::read_to_string(folder.path("languages/en.toml")).unwrap();
    let klingon = english.replacen("\"English\"", "\"tlhIngan Hol\"", 1);
    std::fs::write(folder.path("languages/tlh.toml"), klingon).unwrap();
    let study =
        "languages = [\"en\", \"tlh\"]\n[consent.text]\ntlh = \"nuqneH\"\nen = \"**Hi**\"\n";
    let server = Server::with_files(study, &folder.path("languages")).await;
    for (query, browser, expected) in [
        ("", "tlh-KX, en;q=0.9", "tlh"),
        ("", "xx, en;q=0.1, tlh;q=0.7", "tlh"),
        ("", "xx", "en"),
        ("?language=tlh", "en", "tlh"),
        ("?language=xx", "tlh", "tlh"),
    ] {
        assert_eq!(texts(&server, query, browser).await.language, expected, "{query} {browser}");
    }
    let found = texts(&server, "?language=tlh", "").await;
    let names: Vec<_> = found.offered.iter().map(|language| &language.name[..]).collect();
    assert_eq!(names, ["English", "tlhIngan Hol"]);
    assert_eq!(found.consent.as_deref(), Some("<p>nuqneH</p>\n"));
    assert_eq!(found.check.len(), 3);
    let bad = server.get(&format!("{}?language=..%2F", routes::texts("default"))).await;
    bad.problem(422, "invalid", Some("language"));
    server.get(&routes::texts("nothing")).await.problem(404, "not_found", None);
}

#[tokio::test]
async fn a_study_changes_sentences_and_a_bad_one_is_refused_at_the_start() {
    let study = format!("{SHORT_STUDY}[texts.en]\n\"check_zone.right\" = \"The zone.\"\n");
    let server = Server::with_study(&study).await;
    let found = texts(&server, "", "").await;
    let last = &found.check[2];
    assert_eq!(last.options[last.answer], "The zone.");
    let folder = Folder::default();
    let file = folder.path("study.toml");
    for (study, words) in [
        ("languages = [\"xx\"]", ["languages[0]", "--languages"]),
        ("[texts.en]\n\"check_zone.rihgt\" = \"x\"", ["texts.en.check_zone.rihgt", "sentence"]),
        ("[texts.xx]\n\"check_zone.right\" = \"x\"", ["texts.xx", "expected one of en"]),
    ] {
        std::fs::write(&file, format!("slug = \"a\"\n{study}\n")).unwrap();
        let database = folder.database("new.db");
        let args = ["serve", "--listen", "127.0.0.1:0", "--database", &database, "--static"];
        let (site, file) = (server.path("site").display().to_string(), file.display().to_string());
        run(&[&args[..], &[&site, "--study", &file]].concat()).await.refused(2, &words);
        assert!(!folder.path("new.db").exists());
    }
}
