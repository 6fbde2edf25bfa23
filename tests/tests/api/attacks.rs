//! The thirty-two attacks that every release must withstand;
//! `docs/decisions/0027-attacks-and-limits.md` gives the reasons. The server answers no request
//! with a status of 500 or more, except if the database fails. A refused request writes nothing,
//! and the server keeps running.
//!
//! Each case is a function of a running server, so it does not depend on the kind of database. The
//! cases 30 and 32, in `faults.rs`, need their own process.

mod bodies;
mod faults;
mod keys;
mod pages;
mod paths;
mod people;
mod sockets;
mod trials;

use sidestep_tests::Server;
use sidestep_tests::server::SHORT_STUDY;

/// Starts the server for a case.
async fn server() -> Server {
    Server::with_study(SHORT_STUDY).await
}

/// Creates a test for each case. The test also checks that the server still works afterwards.
macro_rules! cases {
    ($($file:ident: $($case:ident)+;)+) => {
        $($(
            #[tokio::test]
            async fn $case() {
                let server = server().await;
                $file::$case(&server).await;
                still_serves(&server).await;
            }
        )+)+
    };
}

cases! {
    bodies:
        case_01_malformed_json_bad_utf8_and_other_media_types
        case_02_long_and_chunked_bodies
        case_03_packed_bodies
        case_04_deep_nesting
        case_05_numbers_that_are_none;
    trials:
        case_06_recordings_that_do_not_replay
        case_07_wrong_counts_and_missing_times
        case_08_unknown_inputs_trials_and_fields
        case_09_the_same_trial_again
        case_10_the_same_trial_with_other_content
        case_11_a_hundred_duplicates_at_once
        case_12_skipping_ahead_and_after_withdrawal
        case_13_two_tabs;
    people:
        case_14_guessed_expired_and_revoked_tokens
        case_15_trials_of_other_people
        case_16_participants_in_the_laboratory
        case_17_a_code_before_everything_is_stored
        case_18_forged_external_ids
        case_19_return_links_lead_nowhere_else;
    paths:
        case_20_paths_that_leave_the_folder
        case_21_sql_in_parameters
        case_22_wildcards_in_searches
        case_23_formulas_in_tables
        case_24_scripts_in_texts;
    pages:
        case_25_framing_and_sniffing
        case_26_requests_from_other_sites;
    keys:
        case_27_guessing_keys_and_old_cookies
        case_28_the_right_key_among_wrong_ones;
    sockets:
        case_29_slow_requests_and_long_heads
        case_31_bare_line_feeds_and_other_hosts;
}

/// Checks that a new participant can take part, and that a trial is stored once.
async fn still_serves(server: &Server) {
    let driver = sidestep_tests::Driver::enrol(server).await;
    driver.drive(server, 1).await;
    let me: sidestep::api::Progress = driver.me(server).await.into(200);
    assert_eq!(me.stored.len(), 1);
    assert_eq!(server.get("/readyz").await.status, 200);
}
