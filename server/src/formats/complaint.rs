//! What serde complains of, in words of the document instead of Rust's.

use std::borrow::Cow;

/// A complaint of serde_json or toml in the order of every other one: expected, found.
/// `invalid type: string "x", expected struct Pose at line 1 column 3` becomes
/// `expected an object, {…}, found string "x" (line 1 column 3)`; what has no such form stays
/// as it is.
#[must_use]
pub fn plain(message: &str) -> String {
    let kinds = [
        "invalid type: ",
        "invalid value: ",
        "invalid length ",
        "unknown variant ",
        "unknown field ",
    ];
    let told = kinds.iter().find_map(|kind| message.strip_prefix(kind)?.split_once(", expected "));
    let Some((found, expected)) = told else {
        return message.to_owned();
    };
    let (expected, place) = expected.rsplit_once(" at line ").unwrap_or((expected, ""));
    let place = if place.is_empty() { String::new() } else { format!(" (line {place})") };
    format!("expected {}, found {}{place}", expectation(expected), finding(found))
}

/// The names of Rust's types as what is to be written.
fn expectation(expected: &str) -> Cow<'_, str> {
    let entries = ["an array of length ", "a tuple of size "];
    if let Some(count) = entries.iter().find_map(|kind| expected.strip_prefix(kind)) {
        return format!("a list of {count}").into();
    }
    Cow::Borrowed(match expected {
        "f64" => "a number",
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number ≥ 0",
        "i8" | "i16" | "i32" | "i64" => "a whole number",
        "a sequence" => "a list, […]",
        "a map" => "an object, {…}",
        other if other.starts_with("struct ") => "an object, {…}",
        other => other,
    })
}

fn finding(found: &str) -> &str {
    match found {
        "map" => "an object",
        "sequence" => "a list",
        "null" => "nothing",
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::plain;
    use sidestep::scene::JointState;

    #[test]
    fn types_are_said_plainly() {
        fn said<T: serde::de::DeserializeOwned>(text: &str) -> String {
            let whole = plain(&serde_json::from_str::<T>(text).err().unwrap().to_string());
            // Which column it is depends on how serde_json was built.
            whole.split(" column ").next().unwrap().to_owned()
        }
        assert_eq!(
            said::<JointState>("\"x.json\""),
            "expected an object, {…}, found string \"x.json\" (line 1"
        );
        assert_eq!(said::<f64>("\"x\""), "expected a number, found string \"x\" (line 1");
        assert_eq!(
            said::<Vec<usize>>("[-1]"),
            "expected a whole number ≥ 0, found integer `-1` (line 1"
        );
        assert_eq!(said::<Vec<f64>>("{}"), "expected a list, […], found an object (line 1");
        assert_eq!(said::<bool>("[1]"), "expected a boolean, found a list (line 1");
        let toml = toml::from_str::<JointState>("human = 1").unwrap_err();
        assert_eq!(plain(toml.message()), "expected a list of 3, found integer `1`");
        assert_eq!(plain("missing field `speed`"), "missing field `speed`");
    }
}
