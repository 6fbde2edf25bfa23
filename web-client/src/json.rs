//! JSON, parsed and formatted by the browser itself.
//!
//! Exact conversion between digits and numbers is a large part of what serde_json would add to the
//! participant's download, because its tables do not compress. The browser already has both
//! conversions. So the browser parses text into a tree of values, and serde deserializes a wire
//! type from the tree. (In native tests, serde_json parses the text.) For output, serde serializes
//! wire types and the browser formats the digits. Neither parsing nor formatting rounds a number. See
//! `docs/decisions/0006-json-in-the-client.md`.

mod number;
mod read;
mod write;

pub use number::number;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Deserializes a text. Returns `None` if it is not JSON or does not have the expected shape.
#[must_use]
// Not inlined, so that a type that is read in several places is compiled once.
#[inline(never)]
pub fn read<T: DeserializeOwned>(text: &[u8]) -> Option<T> {
    T::deserialize(&read::parse(text)?).ok()
}

/// Serializes a value. A number that is not finite becomes null.
#[must_use]
pub fn write<T: Serialize>(value: &T) -> String {
    let mut text = String::new();
    // This cannot fail, because wire types contain nothing that JSON cannot represent.
    let _ = value.serialize(write::Writer(&mut text));
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use sidestep::api::{Admission, Enrolled, Problem, Progress, StudyInfo, TrialUpload};
    use sidestep::math::SeededRng;
    use sidestep::scene::JointState;
    use sidestep::study::StudyConfig;
    use sidestep::trial::{PageEvent, PageEventKind};
    use sidestep::vehicle::{Pose, TurnInput};

    #[test]
    fn shapes_are_checked() {
        let text = br#"{"code":"x","message":"say \"no\" \u2014 \u00e9","extra":[1,{"a":null}]}"#;
        let problem: Problem = read(text).unwrap();
        assert_eq!(problem.message, "say \"no\" — é");
        assert_eq!(problem.field, None);
        assert_eq!(read::<Problem>(b"{\"code\":"), None);
        assert_eq!(read::<Enrolled>(br#"{"code":"x","message":"m"}"#), None);
        assert_eq!(read::<TurnInput>(b"2"), None);
        assert_eq!(read::<TurnInput>(b"-1"), Some(TurnInput::Right));
        assert_eq!(read::<u32>(b"1.5"), None);
        assert_eq!(read::<Pose>(b"[1,2]"), None);
    }

    #[test]
    fn numbers_survive_bit_for_bit_both_ways() {
        let mut rng = SeededRng::new(1);
        let mut number =
            || f64::from_bits((rng.unit() * 1.8e19) as u64 ^ rng.below(1 << 60) as u64);
        let numbers = std::iter::from_fn(|| Some(number())).filter(|x: &f64| x.is_finite());
        let edges =
            [0.0, -0.0, 5e-324, f64::MAX, f64::MIN_POSITIVE, 0.1, 1.0 / 3.0, 1e21, 123_456_789.0];
        for x in edges.into_iter().chain(numbers.take(20_000)) {
            let pose = Pose { x, y: -x, psi: x };
            let text = write(&pose);
            let here: Pose = read(text.as_bytes()).unwrap();
            let server: Pose = serde_json::from_str(&text).unwrap();
            for other in [here, server] {
                assert_eq!(other.x.to_bits(), x.to_bits(), "{text}");
                assert_eq!(other.y.to_bits(), (-x).to_bits(), "{text}");
            }
        }
    }

    #[test]
    fn what_the_client_writes_the_server_reads() {
        let mut display = sidestep::api::Object::default();
        display.insert("width_px".into(), 1280.5.into());
        display.insert("frames".into(), 600.into());
        let state =
            JointState { human: Pose::new(0.1, -0.2, 3.0), robot: Pose::new(1e-7, 2.0, 0.0) };
        let key = sidestep::api::KeyEvent { t_ms: 1.0, key: "\"\\\n\u{1}ö".into(), down: true };
        let upload = TrialUpload {
            started_at_ms: 1.7e12,
            inputs: TurnInput::ALL.to_vec(),
            states: vec![state; 4],
            sampled_at_ms: vec![0.5; 3],
            key_events: vec![key],
            page_events: vec![PageEvent { t_ms: 2.5, kind: PageEventKind::FocusLost }],
            exposures: 2,
            display,
        };
        assert_eq!(serde_json::from_str::<TrialUpload>(&write(&upload)).unwrap(), upload);
    }

    #[test]
    fn what_the_server_writes_the_client_reads() {
        let study = StudyConfig::default();
        let info = StudyInfo::of(&study, Admission::Open);
        assert_eq!(read::<StudyInfo>(&serde_json::to_vec(&info).unwrap()), Some(info));
        let text = br#"{"participant_id":"p","study":"s","stored":["a"],"next":null,
            "plan":{"phases":[{"phase":"task","show_danger_zone":false,"scenes":[
            {"trial_id":"a","index":0,"human":[1,2,3],"robot":[0.1,-0.0,3],"goal":[4,5]}]}]}}"#;
        assert_eq!(read::<Progress>(text), serde_json::from_slice(text).ok());
    }
}
