//! The OpenAPI document, compared with the server that it describes.

use jsonschema::Validator;
use reqwest::{Method, RequestBuilder};
use serde_json::{Value, json};
use sidestep::api::{AnalysisSummary, Note, routes};
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Answer, Driver, Server, driven};
use std::collections::{BTreeMap, BTreeSet};

/// The document that a server returns.
pub(crate) struct Document(Value);

impl Document {
    pub(crate) async fn of(server: &Server) -> Self {
        Self(server.get(routes::OPENAPI).await.into(200))
    }

    /// The methods and paths in the document, with their descriptions.
    fn operations(&self) -> Vec<(Method, String, &Value)> {
        let paths = self.0["paths"].as_object().unwrap();
        let methods = paths.iter().flat_map(|(path, methods)| {
            let methods = methods.as_object().unwrap().iter();
            methods.map(|(method, it)| (method.to_uppercase().parse().unwrap(), path.clone(), it))
        });
        methods.collect()
    }

    /// A validator for the body of a response. It allows no undocumented fields.
    pub(crate) fn validator(&self, method: &Method, path: &str, status: u16) -> Option<Validator> {
        let operation = &self.0["paths"][path][method.as_str().to_lowercase()];
        let answer = &operation["responses"][status.to_string()];
        assert!(answer.is_object(), "{method} {path}: {status} is not in the document");
        let body = &answer["content"]["application/json"]["schema"];
        let mut components = self.0["components"].clone();
        for schema in components["schemas"].as_object_mut().unwrap().values_mut() {
            if schema.get("properties").is_some() {
                schema["unevaluatedProperties"] = false.into();
            }
        }
        // In addition to the schema of a problem, a response lists the possible values of its field
        // `code`.
        let whole = json!({ "allOf": [body], "components": components });
        body.is_object().then(|| jsonschema::draft202012::new(&whole).unwrap())
    }
}

/// Checks responses, and records which responses it has seen.
struct Checked<'a> {
    server: &'a Server,
    document: Document,
    seen: BTreeSet<String>,
}

impl Checked<'_> {
    /// Sends a request to the route with this path in the document, and checks the response.
    async fn send(
        &mut self,
        method: Method,
        path: &str,
        route: &str,
        finish: impl FnOnce(RequestBuilder) -> RequestBuilder,
    ) -> Answer {
        let answer = Answer::of(finish(self.server.request(method.clone(), route))).await;
        self.seen.insert(format!("{method} {path} {}", answer.status));
        if let Some(validator) = self.document.validator(&method, path, answer.status) {
            let errors: Vec<_> = validator.iter_errors(&answer.body).collect();
            let said = errors.iter().map(|e| format!("{}: {e}", e.instance_path()));
            let said = said.collect::<Vec<_>>().join("\n");
            assert!(
                errors.is_empty(),
                "{method} {route} {}: {said}\n{}",
                answer.status,
                answer.body
            );
        }
        answer
    }

    /// Sends a request with an experimenter's key. `filled` are the path parameters.
    async fn admin(
        &mut self,
        method: Method,
        path: &str,
        filled: &[(&str, &str)],
        body: Option<Value>,
    ) -> Answer {
        let mut route = path.to_owned();
        for (name, value) in filled {
            route = route.replace(&format!("{{{name}}}"), value);
        }
        let key = self.server.key.clone();
        let path = path.split('?').next().unwrap();
        self.send(method, path, &route, |request| {
            let request = request.bearer_auth(key);
            match body {
                Some(body) => request.json(&body),
                None => request,
            }
        })
        .await
    }
}

const GET: Method = Method::GET;
const PUT: Method = Method::PUT;
const POST: Method = Method::POST;
const DELETE: Method = Method::DELETE;

#[tokio::test]
async fn the_document_has_the_routes_of_the_server_and_no_others() {
    let server = Server::with_study(SHORT_STUDY).await;
    let document = Document::of(&server).await;
    let mut methods: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (method, path, _) in document.operations() {
        methods.entry(path).or_default().insert(method.to_string());
    }
    // Compare with the methods that the server reports for each path.
    for (path, documented) in &methods {
        let route = path.replace("{id}", "1").replace(['{', '}'], "");
        let request = server.request(Method::TRACE, &route);
        let answer = request.send().await.unwrap();
        assert_eq!(answer.status(), 405, "{path} is no route");
        let allowed = answer.headers()["allow"].to_str().unwrap().to_owned();
        let allowed = allowed.split(',').map(|it| it.trim().to_owned()).filter(|it| it != "HEAD");
        assert_eq!(allowed.collect::<BTreeSet<_>>(), *documented, "{path}");
    }
    // Compare with the list of routes that clients use.
    let list = include_str!("../../../shared/src/api/routes.rs");
    let listed: BTreeSet<_> = list.split('"').filter(|text| text.starts_with("/api/")).collect();
    assert!(listed.len() > 30, "{listed:?}");
    let shape = |path: &str| {
        let parts = path.split('/').map(|part| if part.starts_with('{') { "{}" } else { part });
        parts.collect::<Vec<_>>().join("/")
    };
    let shapes: BTreeSet<_> = methods.keys().map(|path| shape(path)).collect();
    for path in listed {
        assert!(shapes.contains(&shape(path)), "{path} is not in the document");
    }
}

#[tokio::test]
async fn what_needs_a_token_or_a_key_is_refused_without() {
    let server = Server::with_study(SHORT_STUDY).await;
    for (method, path, it) in Document::of(&server).await.operations() {
        let schemes = it["security"].as_array().unwrap();
        let needed = schemes.first().is_some_and(|scheme| scheme != &json!({}));
        let answer = Answer::of(server.request(method.clone(), &path)).await;
        let signs_in = path == routes::SESSION && method == POST;
        if needed {
            answer.problem(401, "unauthorized", None);
        } else if !signs_in {
            assert_ne!(answer.status, 401, "{method} {path}");
        }
    }
}

#[tokio::test]
async fn each_operation_says_what_it_is() {
    let server = Server::with_study(SHORT_STUDY).await;
    let document = Document::of(&server).await;
    let mut ids = BTreeSet::new();
    for (method, path, it) in document.operations() {
        let name = format!("{method} {path}");
        assert!(ids.insert(it["operationId"].to_string()), "{name}");
        assert!(it["summary"].as_str().is_some_and(|text| text.len() >= 8), "{name}");
        for parameter in it["parameters"].as_array().unwrap() {
            let said = parameter["description"].as_str().unwrap_or_default();
            assert!(said.len() > 10, "{name}: {parameter}");
        }
        let responses = it["responses"].as_object().unwrap();
        assert!(responses.keys().any(|status| status.starts_with('2')), "{name}");
        for place in path.split('/').filter_map(|part| part.strip_prefix('{')) {
            let place = place.trim_end_matches('}');
            let parameters = it["parameters"].as_array().unwrap();
            assert!(parameters.iter().any(|it| it["name"] == place), "{name}: {place}");
        }
        let is_admin =
            path.starts_with("/api/v1/admin") && it["operationId"] != "post_admin_session";
        let needs_key = it["security"][0].get("key").is_some();
        let signs_out = it["operationId"] == "delete_admin_session";
        assert_eq!(needs_key, is_admin && !signs_out, "{name}");
    }
    for (name, schema) in document.0["components"]["schemas"].as_object().unwrap() {
        assert!(schema["description"].as_str().is_some_and(|text| !text.is_empty()), "{name}");
        assert!(!schema.to_string().contains("[`"), "{name} has a link that leads nowhere");
        for (field, it) in schema["properties"].as_object().into_iter().flatten() {
            assert!(it["description"].is_string(), "{name}.{field}");
        }
    }
}

#[tokio::test]
async fn real_answers_are_as_the_document_says() {
    let study = format!(
        "{SHORT_STUDY}\n[[questions]]\nname = \"age\"\nkind = \"scale\"\nfrom = 1\nto = 9\n\
         text = {{ en = \"How?\" }}\nrequired = true\n"
    );
    let server = Server::with_study(&study).await;
    let document = Document::of(&server).await;
    let mut it = Checked { server: &server, document, seen: BTreeSet::new() };
    let own = routes::ME;

    // A participation, with the errors that can occur.
    let study = "/api/v1/studies/{slug}";
    it.admin(GET, study, &[("slug", "default")], None).await;
    it.admin(GET, study, &[("slug", "none")], None).await.problem(404, "not_found", None);
    let texts = "/api/v1/studies/{slug}/texts";
    it.admin(GET, texts, &[("slug", "default")], None).await;
    let enrol = "/api/v1/studies/{slug}/participants";
    let default = [("slug", "default")];
    let body = json!({ "consent": true, "external_id": "p-17", "request_id": "0123456789abcdef" });
    let enrolled = it.admin(POST, enrol, &default, Some(body.clone())).await.into(201);
    it.admin(POST, enrol, &default, Some(body)).await;
    it.admin(POST, enrol, &default, Some(json!({ "consent": 1 }))).await;
    it.admin(POST, enrol, &default, Some(json!({ "consent": false }))).await;
    let driver = Driver { enrolled };
    let token = driver.enrolled.token.clone();
    let me = |request: RequestBuilder| request.bearer_auth(&token);
    let trial = "/api/v1/participants/me/trials/{trial_id}";
    for (i, (id, scene)) in driver.scenes().into_iter().enumerate() {
        let (route, upload) = (routes::my_trial(&id), driven(&scene));
        it.send(PUT, trial, &route, |request| me(request).json(&upload)).await;
        if i == 0 {
            it.send(PUT, trial, &route, |request| me(request).json(&upload)).await;
            it.send(PUT, trial, &route, |request| me(request).body("{")).await;
            it.send(PUT, trial, &route, |request| request.json(&upload)).await;
            it.send(GET, own, own, me).await;
            it.send(POST, routes::COMPLETE, routes::COMPLETE, me).await;
        }
    }
    let check = json!({ "attempts": 1, "passed": true });
    it.send(PUT, routes::COMPREHENSION, routes::COMPREHENSION, |r| me(r).json(&check)).await;
    it.send(POST, routes::COMPLETE, routes::COMPLETE, me).await.problem(409, "unanswered", None);
    let answers = json!({ "answers": { "age": 3 } });
    it.send(PUT, routes::ANSWERS, routes::ANSWERS, |r| me(r).json(&answers)).await;
    it.send(POST, routes::COMPLETE, routes::COMPLETE, me).await;
    it.send(GET, own, own, me).await;

    // The laboratory.
    for path in [
        routes::SESSION,
        routes::ADMIN_KEYS,
        routes::AUDIT,
        routes::ADMIN_STUDIES,
        routes::SELF_CHECK,
        routes::DATA_CHECK,
        "/healthz",
        "/readyz",
        "/metrics",
        routes::OPENAPI,
        routes::DOCS,
    ] {
        it.admin(GET, path, &[], None).await;
        if path.starts_with("/api/v1/admin") {
            it.send(GET, path, path, |request| request).await.problem(401, "unauthorized", None);
        }
    }
    let new = json!({ "name": "a reader", "access": "read" });
    let made = it.admin(POST, routes::ADMIN_KEYS, &[], Some(new.clone())).await;
    it.admin(POST, routes::ADMIN_KEYS, &[], Some(new)).await.problem(409, "taken", None);
    let secret = made.body["secret"].as_str().unwrap().to_owned();
    let sign_in = json!({ "key": secret });
    it.send(POST, routes::SESSION, routes::SESSION, |r| r.json(&sign_in)).await;
    it.send(DELETE, routes::SESSION, routes::SESSION, |request| request).await;
    it.send(GET, routes::AUDIT, routes::AUDIT, |request| request.bearer_auth(&secret)).await;
    let key = made.body["key"]["id"].to_string();
    it.admin(DELETE, "/api/v1/admin/keys/{id}", &[("id", &key)], None).await;
    let of_study = "/api/v1/admin/studies/{slug}";
    for rest in ["", "/configuration", "/participants", "/trials", "/analyses"] {
        it.admin(GET, &format!("{of_study}{rest}"), &default, None).await;
        it.admin(GET, &format!("{of_study}{rest}"), &[("slug", "none")], None).await;
    }
    it.admin(GET, &format!("{of_study}/trials?limit=0"), &default, None).await;
    it.admin(GET, &format!("{of_study}/export?format=jsonl"), &default, None).await;
    let part = it.admin(GET, &format!("{of_study}/export?phase=task"), &default, None).await;
    part.problem(422, "invalid", Some("format"));
    let configuration = format!("{of_study}/configuration");
    let now = it.admin(GET, &configuration, &default, None).await.body;
    let draft = json!({ "toml": now["toml"], "base": now["hash"] });
    it.admin(POST, routes::ADMIN_DRAFTS, &[], Some(draft.clone())).await;
    it.admin(POST, routes::ADMIN_DRAFTS, &[], Some(json!({ "toml": "slug =" }))).await;
    for config in [json!({ "slug": "entered" }), json!({ "slug": "entered", "phases": 3 })] {
        let draft = json!({ "config": config });
        it.admin(POST, routes::ADMIN_FORM_DRAFTS, &[], Some(draft)).await;
    }
    it.admin(PUT, &configuration, &default, Some(draft)).await;
    it.admin(PUT, &configuration, &default, Some(json!({ "toml": now["toml"], "base": "" }))).await;
    let other = json!({ "toml": "slug = \"other\"\ntitle = \"Other\"" });
    it.admin(POST, routes::ADMIN_STUDIES, &[], Some(other.clone())).await;
    it.admin(POST, routes::ADMIN_STUDIES, &[], Some(other)).await.problem(409, "taken", None);
    let status = json!({ "status": "closed" });
    it.admin(PUT, &format!("{of_study}/status"), &[("slug", "other")], Some(status)).await;

    let person = "/api/v1/admin/participants/{id}";
    let id = driver.enrolled.participant_id.clone();
    let id = [("id", id.as_str())];
    let note =
        it.admin(POST, &format!("{person}/notes"), &id, Some(json!({ "text": "late" }))).await;
    let note = note.into::<Note>(201).id.to_string();
    let exclusion = format!("{person}/exclusion");
    it.admin(PUT, &exclusion, &id, Some(json!({ "reason": "asleep" }))).await;
    it.admin(GET, person, &id, None).await;
    it.admin(GET, &format!("{person}/drives"), &id, None).await;
    it.admin(DELETE, &exclusion, &id, None).await;
    let of_note = [id[0], ("note", &note)];
    it.admin(DELETE, &format!("{person}/notes/{{note}}"), &of_note, None).await;
    let (trial, _) = driver.scenes().pop().unwrap();
    let trial = [("trial_id", trial.as_str())];
    it.admin(GET, "/api/v1/admin/trials/{trial_id}", &trial, None).await;
    let predictor = "/api/v1/admin/trials/{trial_id}/predictor";
    it.admin(GET, predictor, &trial, None).await;
    for (query, status) in [("analysis=none", 422), ("analysis=none&file=none", 404)] {
        let answer = it.admin(GET, &format!("{predictor}?{query}"), &trial, None).await;
        assert_eq!(answer.status, status, "{query}");
    }
    let sets = "/api/v1/admin/trials/{trial_id}/sets";
    it.admin(GET, &format!("{sets}?family=empirical"), &trial, None).await;
    let analyses = format!("{of_study}/analyses");
    let asked = it.admin(POST, &analyses, &default, Some(json!({}))).await;
    let asked = asked.into::<AnalysisSummary>(201).id;
    let analysis = [("id", asked.as_str())];
    let path = "/api/v1/admin/analyses/{id}";
    // Cancel immediately, because the analysis of a small study is fast.
    it.admin(POST, &format!("{path}/cancel"), &analysis, None).await;
    it.admin(GET, path, &analysis, None).await;
    let models = format!("{path}/predictors");
    it.admin(GET, &models, &analysis, None).await;
    it.admin(GET, &format!("{models}?experiment=3"), &analysis, None).await;
    it.admin(GET, &models, &[("id", "none")], None).await.problem(404, "not_found", None);
    it.admin(GET, &analyses, &default, None).await;
    it.admin(DELETE, path, &analysis, None).await;
    it.admin(DELETE, path, &analysis, None).await.problem(404, "not_found", None);
    it.admin(DELETE, &format!("{of_study}/pilots"), &default, None).await;
    it.send(DELETE, own, &format!("{own}?data=delete"), me).await;
    it.send(GET, own, own, me).await.problem(410, "withdrawn", None);
    it.admin(DELETE, person, &id, None).await;

    // Every operation with a JSON response has succeeded, except two that need a long computation.
    let excused = ["/api/v1/value-functions/{id}", "/api/v1/admin/analyses/{id}/files/{name}"];
    for (method, path, operation) in it.document.operations() {
        let statuses = operation["responses"].as_object().unwrap();
        let succeeded = statuses.iter().any(|(status, answer)| {
            let is_json = answer["content"].get("application/json").is_some();
            !is_json
                || status.starts_with('2') && it.seen.contains(&format!("{method} {path} {status}"))
        });
        assert!(succeeded || excused.contains(&path.as_str()), "{method} {path}: {:?}", it.seen);
    }
}

#[tokio::test]
async fn the_page_shows_every_operation_and_asks_nobody_else() {
    let server = Server::with_study(SHORT_STUDY).await;
    let document = Document::of(&server).await;
    let page = server.request(GET, routes::DOCS).send().await.unwrap();
    assert_eq!(page.headers()["content-type"], "text/html; charset=utf-8");
    let page = page.text().await.unwrap();
    for (_, _, it) in document.operations() {
        let id = it["operationId"].as_str().unwrap();
        assert_eq!(page.matches(&format!(" id=\"{id}\"")).count(), 1, "{id}");
    }
    for name in document.0["components"]["schemas"].as_object().unwrap().keys() {
        assert_eq!(page.matches(&format!(" id=\"{name}\"")).count(), 1, "{name}");
    }
    let targets = page.split("href=\"#").skip(1).map(|rest| rest.split('"').next().unwrap());
    for target in targets {
        assert!(page.contains(&format!("id=\"{target}\"")), "{target}");
    }
    for word in ["<script", "style=", "https://", "src="] {
        assert!(!page.contains(word), "{word}");
    }
}
