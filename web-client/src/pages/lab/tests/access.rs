//! Tests of the keys and the audit trail.

use super::*;
use sidestep::api::{Action, AuditEntry, AuditPage, KeyMade, KeySummary};

fn key(id: i64, name: &str) -> KeySummary {
    KeySummary {
        id,
        name: name.into(),
        access: Access::Export,
        created_at_ms: 1,
        last_used_at_ms: None,
        revoked_at_ms: None,
    }
}

fn audit(sequences: &[i64], next_before: Option<i64>) -> AuditPage {
    let entry = |&sequence: &i64| AuditEntry {
        sequence,
        at_ms: sequence,
        who: "Ada".into(),
        action: Action::KeyRevoked,
        study: None,
        subject: Some(format!("subject {sequence}")),
    };
    AuditPage { entries: sequences.iter().map(entry).collect(), next_before }
}

fn opened() -> Session {
    let mut session = signed_in("/lab/access");
    session.send("keys", 200, &vec![key(1, "first key"), key(2, "script")]);
    session.send("audit", 200, &audit(&[9], Some(9)));
    session
}

#[test]
fn a_key_is_shown_once_with_its_link() {
    let mut session = opened();
    let fields = [("name", " Zoë "), ("access", "manage")];
    let text = |(name, text): (&str, &str)| (name.to_owned(), FieldValue::Text(text.into()));
    let form = Form::new(fields.map(text).into());
    session.tell(session.page.view().submit("new-key", form).unwrap());
    let request = session.asked.last().unwrap();
    assert_eq!(request.body.as_deref(), Some(r#"{"name":"Zoë","access":"manage"}"#));
    session.send("make", 201, &KeyMade { key: key(3, "Zoë"), secret: "s3cret".into() });
    assert_eq!(session.words("secret").unwrap(), "s3cret");
    let link = "https://lab.example/lab#key=s3cret";
    assert_eq!(session.words("sign-in-link").unwrap(), link);
    session.send("keys", 200, &vec![key(3, "Zoë")]);
    session.send("audit", 200, &audit(&[10], None));
    assert!(session.words("keys").unwrap().contains("Zoë"));
    assert_eq!(session.words("audit").unwrap().matches("subject").count(), 1);
    session.go("/lab/access");
    session.go("/lab");
    session.go("/lab/access");
    assert_eq!(session.words("secret"), None);
}

#[test]
fn a_name_that_is_taken_is_refused_in_words() {
    let mut session = opened();
    session.tell(session.page.view().submit("new-key", Form::default()).unwrap());
    let taken = br#"{"code":"invalid","message":"expected another name","field":"name"}"#;
    session.answer("make", 422, taken);
    assert_eq!(session.words("trouble").unwrap(), "Expected another name.");
    assert!(session.words("keys").is_some());
}

#[test]
fn a_key_is_revoked_at_the_second_press() {
    let mut session = opened();
    session.press("revoke-2");
    assert!(session.asked.is_empty());
    session.press("keep-2");
    session.press("revoke-2");
    session.press("sure-2");
    let request = session.asked.last().unwrap();
    assert_eq!((request.method, request.url.as_str()), ("DELETE", "/api/v1/admin/keys/2"));
    session.answer("revoke", 204, b"");
    let revoked = KeySummary { revoked_at_ms: Some(5), ..key(2, "script") };
    session.send("keys", 200, &vec![key(1, "first key"), revoked]);
    session.send("audit", 200, &audit(&[10, 9], None));
    assert!(session.words("revoke-1").is_some() && session.words("revoke-2").is_none());
}

#[test]
fn the_audit_trail_goes_on_with_older_entries() {
    let mut session = opened();
    session.press("more");
    assert!(session.urls()[0].ends_with("before=9"), "{:?}", session.urls());
    session.send("audit", 200, &audit(&[8, 7], None));
    let words = session.words("audit").unwrap();
    assert_eq!(words.matches("subject").count(), 3, "{words}");
    assert!(words.contains("key revoked") && session.words("more").is_none());
}

#[test]
fn who_may_not_manage_sees_only_their_own_right() {
    let session = signed_in_to("/lab/access", Access::Export);
    assert!(session.asked.is_empty());
    assert!(session.words("mine").unwrap().contains("download all data"));
    assert!(session.words("new-key").is_none());
}
