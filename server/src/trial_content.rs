//! The content of a trial and its hash. The hash distinguishes a repeated upload from a different
//! upload, and a sound row from a damaged row.
//!
//! A [`Recipe`] computes the hash, and each row stores the number of its recipe. A recipe never
//! changes and does not use the wire types. So a new field of an upload changes no stored hash. If
//! the hash must cover a new field, add a recipe.

use crate::support::bytes::{pack, pack_inputs, pack_states};
use serde::Deserialize;
use sha2::{Digest, Sha256};
use sidestep::scene::{JointState, Scene, SceneParameters};
use sidestep::trial::{Flag, PageEvent, Record, RecordedKey, flags, page_flags};
use sidestep::vehicle::TurnInput;
use std::io::{self, Write};

/// The stored content of a trial.
#[derive(Clone, Debug)]
pub struct Content {
    /// When the trial started (ms since 1970) by the participant's clock, if known.
    pub started_at_ms: Option<f64>,
    /// The input in each step.
    pub inputs: Vec<TurnInput>,
    /// The joint states before each step and after the last step.
    pub states: Vec<JointState>,
    /// When each input was sampled (ms after the start), if known.
    pub sampled_at_ms: Option<Vec<f64>>,
    /// The key events, as JSON.
    pub key_events: String,
    /// The page's events, as JSON, if recorded.
    pub page_events: Option<String>,
    /// How often the scene was shown, including this time, if recorded.
    pub exposures: Option<u32>,
    /// The record of the display, as JSON.
    pub display: String,
}

impl Content {
    /// When each input was sampled (ms after the start). Empty if unknown.
    #[must_use]
    pub fn sampled_at_ms(&self) -> &[f64] {
        self.sampled_at_ms.as_deref().unwrap_or_default()
    }

    /// The flags of a trial with this content in the assigned `scene`. Flags of the page's events
    /// are included if the events were recorded.
    ///
    /// # Errors
    /// If the key events, the page's events or the display are not valid JSON.
    pub fn flags(
        &self,
        parameters: &SceneParameters,
        scene: &Scene,
    ) -> Result<Vec<Flag>, serde_json::Error> {
        #[derive(Deserialize)]
        struct Frames {
            #[serde(default)]
            frame_gap_median_ms: serde_json::Value,
        }
        #[derive(Deserialize)]
        struct Key {
            t_ms: f64,
            down: bool,
        }
        let times = self.sampled_at_ms();
        let mut found = flags(parameters, scene, &self.inputs, &self.states, times);
        let events = self.page_events.as_deref().unwrap_or("[]");
        let events: Vec<PageEvent> = serde_json::from_str(events)?;
        if let (Some(_), Some(exposures)) = (&self.page_events, self.exposures) {
            let Frames { frame_gap_median_ms } = serde_json::from_str(&self.display)?;
            let gap = frame_gap_median_ms.as_f64();
            let of_page = page_flags(parameters, times, exposures, &events, gap);
            found.retain(|flag| !of_page.contains(flag));
            found.extend(of_page);
        }
        let keys: Vec<Key> = serde_json::from_str(&self.key_events)?;
        let keys: Vec<_> =
            keys.into_iter().map(|Key { t_ms, down }| RecordedKey { t_ms, down }).collect();
        let record = Record {
            started_at_ms: self.started_at_ms,
            sampled_at_ms: times,
            keys: &keys,
            page_events: &events,
            replaced: [&self.key_events, &self.display]
                .iter()
                .any(|json| json.contains('\u{fffd}')),
        };
        found.extend(record.flags());
        Ok(found)
    }
}

/// The way in which a content hash is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Recipe {
    /// Recipe 1, for uploads of earlier versions: the JSON of their fields, in the order of the
    /// first version.
    UploadJson,
    /// Recipe 2, for trials from files: inputs, states and sampling times, as the bytes in the database.
    PackedBytes,
    /// Recipe 3, for uploads: like recipe 1, with two more fields (the page's events and the exposures)
    /// in front of the field `display`.
    UploadWithPage,
}

impl Recipe {
    const ALL: [Self; 3] = [Self::UploadJson, Self::PackedBytes, Self::UploadWithPage];

    /// The number of the recipe in the database.
    #[must_use]
    pub fn number(self) -> i64 {
        match self {
            Self::UploadJson => 1,
            Self::PackedBytes => 2,
            Self::UploadWithPage => 3,
        }
    }

    /// The recipe with this number.
    #[must_use]
    pub fn from_number(number: i64) -> Option<Self> {
        Self::ALL.into_iter().find(|recipe| recipe.number() == number)
    }

    /// SHA-256 of the content.
    #[must_use]
    pub fn hash(self, content: &Content) -> [u8; 32] {
        let mut hash = Hashed(Sha256::new());
        let written = match self {
            Self::UploadJson => upload_json(&mut hash, content, false),
            Self::UploadWithPage => upload_json(&mut hash, content, true),
            Self::PackedBytes => packed_bytes(&mut hash, content),
        };
        debug_assert!(written.is_ok(), "a hash takes every byte");
        hash.0.finalize().into()
    }
}

/// Recipe 1, or recipe 3 if `with_page`. Numbers have the format of `serde_json`: the shortest decimal
/// that parses to the same bits, with a point or an exponent. Key events and display are the texts
/// stored in the row.
fn upload_json(out: &mut impl Write, content: &Content, with_page: bool) -> io::Result<()> {
    out.write_all(b"{\"started_at_ms\":")?;
    number(out, content.started_at_ms.unwrap_or_default())?;
    out.write_all(b",\"inputs\":")?;
    list(out, &content.inputs, |out, input| write!(out, "{}", input.sign()))?;
    out.write_all(b",\"states\":")?;
    list(out, &content.states, |out, state| {
        out.write_all(b"{\"human\":")?;
        list(out, &<[f64; 3]>::from(state.human), |out, x| number(out, *x))?;
        out.write_all(b",\"robot\":")?;
        list(out, &<[f64; 3]>::from(state.robot), |out, x| number(out, *x))?;
        out.write_all(b"}")
    })?;
    out.write_all(b",\"sampled_at_ms\":")?;
    list(out, content.sampled_at_ms(), |out, t| number(out, *t))?;
    write!(out, ",\"key_events\":{}", content.key_events)?;
    if with_page {
        let events = content.page_events.as_deref().unwrap_or("[]");
        let exposures = content.exposures.unwrap_or(1);
        write!(out, ",\"page_events\":{events},\"exposures\":{exposures}")?;
    }
    write!(out, ",\"display\":{}}}", content.display)
}

/// Recipe 2.
fn packed_bytes(out: &mut impl Write, content: &Content) -> io::Result<()> {
    out.write_all(&pack_inputs(&content.inputs))?;
    out.write_all(&pack_states(&content.states))?;
    out.write_all(&pack(content.sampled_at_ms().iter().copied()))
}

fn number(out: &mut impl Write, number: f64) -> io::Result<()> {
    Ok(serde_json::to_writer(out, &number)?)
}

fn list<W: Write, T>(
    out: &mut W,
    items: &[T],
    mut write: impl FnMut(&mut W, &T) -> io::Result<()>,
) -> io::Result<()> {
    out.write_all(b"[")?;
    for (i, item) in items.iter().enumerate() {
        if i > 0 {
            out.write_all(b",")?;
        }
        write(out, item)?;
    }
    out.write_all(b"]")
}

/// A hash with a writer interface.
struct Hashed(Sha256);

impl Write for Hashed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sidestep::vehicle::Pose;

    fn content() -> Content {
        let states = [[0.1, -2.5, 3.0, 1e21, -0.0, 2.0], [1.0 / 3.0, 1e-7, 2.0, 5e-324, 7.5, -3.0]];
        let states = states.map(|[a, b, c, d, e, f]| JointState {
            human: Pose::from([a, b, c]),
            robot: Pose::from([d, e, f]),
        });
        Content {
            started_at_ms: Some(1_760_000_000_123.25),
            inputs: vec![TurnInput::Right],
            states: states.into(),
            sampled_at_ms: Some(vec![3.7]),
            key_events: r#"[{"t_ms":-1.0,"key":"ArrowLeft","down":true}]"#.to_owned(),
            page_events: Some(r#"[{"t_ms":2.5,"kind":"hidden"}]"#.to_owned()),
            exposures: Some(2),
            display: r#"{"refresh_hz":60.0}"#.to_owned(),
        }
    }

    #[test]
    fn recipes_never_change() {
        // The text that the first version hashed for this upload. Databases contain such hashes.
        let text = concat!(
            r#"{"started_at_ms":1760000000123.25,"inputs":[-1],"#,
            r#""states":[{"human":[0.1,-2.5,3.0],"robot":[1e+21,-0.0,2.0]},"#,
            r#"{"human":[0.3333333333333333,1e-7,2.0],"robot":[5e-324,7.5,-3.0]}],"#,
            r#""sampled_at_ms":[3.7],"key_events":[{"t_ms":-1.0,"key":"ArrowLeft","down":true}],"#,
            r#""display":{"refresh_hz":60.0}}"#,
        );
        let mut written = Vec::new();
        upload_json(&mut written, &content(), false).unwrap();
        assert_eq!(String::from_utf8(written).unwrap(), text);
        let hash = <[u8; 32]>::from(Sha256::digest(text));
        assert_eq!(Recipe::UploadJson.hash(&content()), hash);
        let display = r#","display":{"refresh_hz":60.0}}"#;
        let page = r#","page_events":[{"t_ms":2.5,"kind":"hidden"}],"exposures":2"#;
        let with_page = text.replacen(display, &format!("{page}{display}"), 1);
        let hash = <[u8; 32]>::from(Sha256::digest(with_page));
        assert_eq!(Recipe::UploadWithPage.hash(&content()), hash);
        let packed = hex::encode(Recipe::PackedBytes.hash(&content()));
        assert_eq!(packed, "b3eb326cd883b3f94eaef5ad88718566b10ff35e91f85931c9a55e235c3f1cf5");
    }

    #[test]
    fn a_hash_covers_what_its_recipe_says() {
        type Change = fn(&mut Content);
        let changes: [(Change, [bool; 3]); 7] = [
            (|content| content.started_at_ms = Some(0.0), [true, false, true]),
            (|content| content.display = "{}".to_owned(), [true, false, true]),
            (|content| content.key_events = "[]".to_owned(), [true, false, true]),
            (|content| content.page_events = Some("[]".to_owned()), [false, false, true]),
            (|content| content.exposures = Some(1), [false, false, true]),
            (|content| content.inputs = vec![TurnInput::Left], [true; 3]),
            (|content| content.sampled_at_ms = None, [true; 3]),
        ];
        for (change, covered) in changes {
            let mut other = content();
            change(&mut other);
            let differs = |recipe: Recipe| recipe.hash(&other) != recipe.hash(&content());
            assert_eq!(Recipe::ALL.map(differs), covered);
        }
    }
}
