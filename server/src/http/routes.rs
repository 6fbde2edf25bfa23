//! The table of all routes, with descriptions.

use crate::http::openapi::table::{Table, delete, get, post, put};
use crate::http::{
    analyses, changes, configurations, docs, enrolment, exports, keys, laboratory, metrics,
    participants, people, predictors, profiles, session, studies, texts, trials, value_functions,
};
use sidestep::api::{ParticipantPage, Session, Texts, routes};

/// All routes except the pages. The paths come from the module `routes`, which clients also use.
/// Their parameters are in braces.
#[must_use]
pub fn table() -> Table {
    let table = Table::default();
    operator(analysis(data(people_of(setup(access(participation(table)))))))
}

fn participation(table: Table) -> Table {
    let text = "The requests of a participant's page: it reads the study, enrols, stores each trial, and \
                completes the participation.";
    table
        .group("Participation", text)
        .route(
            &routes::study("{slug}"),
            [get("The public part of a study", studies::show)
                .detail(
                    "With a participant's token, the configuration of their enrolment. With an external id, \
                     whether this person can take part, and the return link if they cannot.",
                )
                .problems(["not_found", "busy", "storage"])
                .for_participants_too()],
        )
        .route(
            &routes::texts("{slug}"),
            [get("All texts for participants, in one language", texts::show)
                .detail(
                    "In the language of the query; by default, or if the study does not have it, in \
                     the one that Accept-Language prefers.",
                )
                .sends_json::<Texts>()
                .for_participants_too()
                .compressed()],
        )
        .route(
            &routes::participants("{slug}"),
            [post("Enrols a participant", enrolment::enrol)
                .detail(
                    "The token in the response authenticates all later requests. A known external id, or a \
                     request id that was sent before, resumes the participation.",
                )
                .says(201, "A new participant.")
                .or_200("A participant who has enrolled before: the same plan, and another token.")
                .problems(["closed", "full", "archived", "screened_out", "withdrawn"])],
        )
        .route(
            routes::ME,
            [
                get("The participant's progress: plan, stored trials, next trial", participants::show),
                delete("Withdraws the participant", participants::withdraw)
                    .detail("Idempotent; `keep` can be followed by `delete`.")
                    .problems(["not_yours"]),
            ],
        )
        .route(
            routes::COMPREHENSION,
            [put("Stores the result of the check of understanding", participants::check_understanding)
                .detail("Repeating a request gets the same response.")
                .problems(["withdrawn", "archived"])],
        )
        .route(
            &routes::my_trial("{trial_id}"),
            [put("Stores a trial", trials::store)
                .detail(
                    "The response comes after the commit. The server replays the inputs, and flags the trial \
                     if its states do not follow from them.",
                )
                .or_200("The same trial was stored before.")
                .problems(["different_content", "out_of_order"])],
        )
        .route(
            routes::ANSWERS,
            [put("Stores the answers to the questions after the last scene", participants::answer)
                .detail("Replaces earlier answers until the participation is complete.")
                .problems(["complete", "answered"])],
        )
        .route(
            routes::COMPLETE,
            [post("Completes the participation", participants::complete)
                .detail("The response has the completion code.")
                .problems(["incomplete", "unanswered", "not_yours"])],
        )
        .route(
            &routes::value_function("{id}"),
            [get("An encoded value function", value_functions::show)
                .detail("It never changes: an If-None-Match with its ETag gets a 304.")
                .sends_bytes("application/octet-stream")
                .says(304, "The client has it already.")
                .compressed()],
        )
}

fn access(table: Table) -> Table {
    let text = "Signing in to the laboratory, the keys of experimenters and programs, and the audit trail \
                of their actions.";
    table
        .group("Access", text)
        .route(
            routes::SESSION,
            [
                get("Who is signed in", session::show),
                post("Signs in with a key", session::sign_in)
                    .detail("Sets the session's cookie, which is valid for 30 days.")
                    .sends_json::<Session>()
                    .problems(["unauthorized", "throttled"]),
                delete("Signs out", session::sign_out)
                    .says(204, "The session has ended, if there was one."),
            ],
        )
        .route(
            routes::ADMIN_KEYS,
            [
                get("All keys, including revoked ones", keys::list),
                post("Creates a key", keys::make)
                    .says(201, "The new key, which no later response contains.")
                    .problems(["taken"]),
            ],
        )
        .route(
            &routes::admin_key("{id}"),
            [delete("Revokes a key", keys::revoke)
                .detail("The key and its sessions are invalid at once. Idempotent.")
                .problems(["first_key"])],
        )
        .route(routes::AUDIT, [get("A page of the audit trail, newest first", keys::audit)])
}

fn setup(table: Table) -> Table {
    let text = "Studies and their configurations. A configuration in use is never edited: enrolled \
                participants keep theirs, and new participants get the new one.";
    table
        .group("Studies", text)
        .route(
            routes::ADMIN_STUDIES,
            [
                get("All studies, with their state", laboratory::studies),
                post("Creates a study", configurations::make).problems(["taken", "busy"]),
            ],
        )
        .route(
            &routes::admin_study("{slug}"),
            [get("A study, with its state", laboratory::study)],
        )
        .route(
            &routes::admin_configuration("{slug}"),
            [
                get("A study's configuration, as the text of a study file", configurations::show),
                put("Gives new participants another configuration", configurations::change)
                    .detail("`base` is the hash of the configuration that the draft is based on.")
                    .problems(["changed"]),
            ],
        )
        .route(
            &routes::admin_status("{slug}"),
            [put("Opens, closes or archives a study", configurations::set_status)
                .problems(["changed"])],
        )
        .route(
            routes::ADMIN_DRAFTS,
            [post("Checks a draft of a study file", configurations::check)
                .detail("200 even for an invalid draft, with the error.")],
        )
        .route(
            routes::ADMIN_FORM_DRAFTS,
            [post("Checks the values of a form, and writes them as a study file", configurations::check_form)
                .detail("As the check of a draft; the response has the text of the study file.")],
        )
        .route(
            routes::CHANGES,
            [get("Server-sent events: something has changed", changes::follow).detail(
                "An event `change` immediately and after every commit, at most one a second; its data are \
                 the number of commits since the server started. The response ends after five minutes; \
                 browsers reconnect.",
            )],
        )
}

fn people_of(table: Table) -> Table {
    let text = "Participants, with notes and exclusions by experimenters.";
    table
        .group("Participants", text)
        .route(
            &routes::admin_participants("{slug}"),
            [get("A page of participants, or the whole table as a file", people::list)
                .detail(
                    "External ids and codes are included if the key may export. With `format=csv`, the \
                     whole table, for which the key needs the right to export.",
                )
                .sends_json::<ParticipantPage>()
                .sends("text/csv")
                .problems(["access"])],
        )
        .route(
            &routes::admin_participant("{id}"),
            [
                get("A participant's complete record", profiles::show).detail(
                    "External id, code, answers and parameters are included if the key may export.",
                ),
                delete("Deletes a participant's data, on their request", profiles::delete)
                    .detail("Idempotent."),
            ],
        )
        .route(
            &routes::admin_drives("{id}"),
            [get("A participant's tasks, in compact form", profiles::drives)
                .detail(
                    "One attempt at each scene, as analyses use them: inputs and states of every step. \
                     With the ids of the value functions, this is all that predicted sets need.",
                )
                .compressed()],
        )
        .route(&routes::admin_notes("{id}"), [post("Adds a note", profiles::add_note)])
        .route(
            &routes::admin_note("{id}", "{note}"),
            [delete("Deletes a note", profiles::delete_note)],
        )
        .route(
            &routes::admin_exclusion("{id}"),
            [
                put("Excludes the participant from analyses", profiles::exclude),
                delete("Includes the participant in analyses again", profiles::include)
                    .detail("Idempotent."),
            ],
        )
        .route(
            &routes::admin_pilots("{slug}"),
            [delete("Deletes all pilots of a study", laboratory::delete_pilots)],
        )
}

fn data(table: Table) -> Table {
    let text = "Stored trials, predictors, and exports.";
    table
        .group("Data", text)
        .route(
            &routes::admin_trials("{slug}"),
            [get("A page of the stored trials, newest first", laboratory::trials)],
        )
        .route(
            &routes::admin_trial("{trial_id}"),
            [get("A stored trial with its content", laboratory::trial)],
        )
        .route(
            &routes::admin_predictor("{trial_id}"),
            [get("A predictor for the replay of a trial", predictors::predictor).detail(
                "Without a query, it is trained on the participant's earlier trials; `features` selects the \
                 feature set. With `analysis` and `file`, it is a model of an analysis, and the response says whether this \
                 trial trained it.",
            )],
        )
        .route(
            &routes::admin_sets("{trial_id}"),
            [get("Learned sets for the replay of a trial", predictors::sets)
                .detail(
                    "The sets of a family that is learned from the positions of the participant's earlier \
                     trials, as polygons in the human's frame, and how often they contain the future of \
                     the participant's other tasks.",
                )
                .compressed()],
        )
        .route(
            &routes::exports("{slug}"),
            [get("A study's data as a file", exports::export)
                .detail(
                    "An archive with the files of `sidestep export`, sent while it is being written. The \
                     same data give the same bytes and the same ETag: `Range` and `If-Range` resume \
                     an interrupted download. Without a format, the steps as one CSV file.",
                )
                .sends_bytes("application/zip")
                .sends("text/csv")
                .says(206, "The requested part of the archive.")
                .says(304, "The client has it already.")
                .says(416, "The archive ends before the requested part.")
                .problems(["measuring", "storage"])
                .problem_with(412, "changed")],
        )
        .route(
            routes::SELF_CHECK,
            [get("The fingerprint of the server's own simulation", laboratory::self_check)],
        )
        .route(
            routes::DATA_CHECK,
            [get(
                "Findings of the last data check, and the last backup",
                laboratory::data_check,
            )],
        )
}

fn analysis(table: Table) -> Table {
    let text = "Comparisons of models on a study's trials, which the server computes one by one.";
    table
        .group("Analyses", text)
        .route(
            &routes::admin_analyses("{slug}"),
            [
                get("A page of analyses, newest first", analyses::list),
                post("Requests an analysis", analyses::ask)
                    .or_200("An identical request is queued already.")
                    .problems(["queue_full"]),
            ],
        )
        .route(
            &routes::admin_analysis("{id}"),
            [
                get("An analysis, with the names of its files", analyses::show),
                delete("Deletes an analysis with its files", analyses::delete),
            ],
        )
        .route(
            &routes::cancel_analysis("{id}"),
            [post("Cancels an analysis", analyses::cancel)
                .detail("Idempotent.")
                .problems(["over"])],
        )
        .route(
            &routes::analysis_predictors("{id}"),
            [get("A page of the models of an analysis", predictors::list).detail(
                "With the kinds of model, experiments, feature sets and participants of the analysis. An \
                 unfinished analysis has none.",
            )],
        )
        .route(
            &routes::analysis_file("{id}", "{*name}"),
            [get("A file of an analysis", analyses::file)
                .detail("A slash in the name may be sent unescaped or as `%2F`.")
                .sends("text/html")
                .sends("text/csv")
                .sends("text/x-tex")
                .sends_bytes("application/octet-stream")
                .sends_any_json()],
        )
}

fn operator(table: Table) -> Table {
    let text = "For operators of the server, and for programs that use it.";
    table
        .group("Server", text)
        .route("/healthz", [get("Whether the process answers", metrics::healthz)])
        .route(
            "/readyz",
            [get("Whether a trial can be stored now", metrics::readyz).problems(["not_ready"])],
        )
        .route(
            "/metrics",
            [get("Metrics for Prometheus, in the OpenMetrics text format", metrics::show)
                .detail("Programs on the server's own machine need no key; others need one with read access.")
                .sends("application/openmetrics-text")],
        )
        .route(
            routes::OPENAPI,
            [get("This document", docs::document).sends_any_json().compressed()],
        )
        .route(
            routes::DOCS,
            [get("This document as a page", docs::page).sends("text/html").compressed()],
        )
}
