//! The sentences of one language, from a TOML file with tables of sentences.
//!
//! The key of a sentence consists of the names on its path, joined by dots. A sentence can have
//! placeholders, such as `{seconds}`. A sentence that depends on a number has a form for each
//! plural category of Unicode (`.one`, `.few`, `.other` …). Languages can have different forms, but
//! all have `.other`.

use crate::formats::toml_lines::{Complaint, TomlLines};
use sidestep::invalid::Invalid;
use std::collections::{BTreeMap, BTreeSet};

/// The sentences of one language, by key.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sentences(BTreeMap<String, String>);

/// The plural forms.
const FORMS: [&str; 6] = ["zero", "one", "two", "few", "many", "other"];

/// Pairs of a sentence and a placeholder. A study is allowed to omit the placeholder, because the
/// sentence stays true without it.
const MAY_OMIT: [(&str, &str); 3] =
    [("instructions.zone", "radius"), ("check_zone.right", "radius"), ("ready.how", "seconds")];

impl Sentences {
    /// Parses the sentences of a language file.
    ///
    /// # Errors
    /// [`Complaint`] for text that is not TOML, a value that is not a text, or braces that do not
    /// enclose the name of a placeholder.
    pub fn read(text: &str) -> Result<Self, Complaint> {
        let mut sentences = BTreeMap::new();
        for leaf in TomlLines::parse(text)?.leaves() {
            let complain = |what: String| {
                let field = Some(leaf.key.clone());
                Complaint { line: leaf.line, field, what }
            };
            let key = &leaf.key;
            let sentence = leaf.text.ok_or_else(|| complain(format!("{key}: expected a text")))?;
            places(&sentence).map_err(|what| complain(format!("{key}: expected {what}")))?;
            sentences.insert(leaf.key, sentence);
        }
        Ok(Self(sentences))
    }

    /// The sentence with this key.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<&str> {
        self.0.get(key).map(String::as_str)
    }

    /// Every key with its sentence.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &str)> {
        self.0.iter().map(|(key, text)| (key.as_str(), text.as_str()))
    }

    /// Replaces sentences by the sentences of `above` with the same keys, and adds the sentences
    /// with new keys.
    pub fn lay_over(&mut self, above: Self) {
        self.0.extend(above.0);
    }

    /// Checks that these sentences have the same keys and placeholders as `english`.
    ///
    /// # Errors
    /// One line naming the sentence, with the expected and the found value.
    pub fn check_against(&self, english: &Self) -> Result<(), String> {
        for (key, text) in &english.0 {
            let stem = key.rsplit_once('.').map_or("", |(stem, _)| stem);
            // `.other` is the only plural form that every language must have.
            if english.is_form(key) && !key.ends_with(".other") {
                continue;
            }
            let Some(own) = self.0.get(key) else {
                let form = if english.is_form(key) {
                    format!(" (a form of {stem})")
                } else {
                    String::new()
                };
                return Err(format!("{key}: expected a sentence{form}, as in English; found none"));
            };
            let (wanted, found) = (places(text)?, places(own)?);
            if wanted != found {
                let (wanted, found) = (listed(&wanted), listed(&found));
                return Err(format!("{key}: expected {wanted}, as in English; found {found}"));
            }
        }
        for (key, text) in &self.0 {
            english.check_change(key, text).map_err(|error| error.to_string())?;
        }
        Ok(())
    }

    /// Checks a new text for an existing sentence, or for a further plural form of a sentence. The text
    /// must have the placeholders of that sentence.
    ///
    /// # Errors
    /// [`Invalid`] naming the sentence.
    pub fn check_change(&self, key: &str, text: &str) -> Result<(), Invalid> {
        let like = match self.0.get(key) {
            Some(_) if !self.is_form(key) => key.to_owned(),
            _ => match key.rsplit_once('.') {
                Some((stem, form))
                    if FORMS.contains(&form) && self.is_form(&format!("{stem}.other")) =>
                {
                    format!("{stem}.other")
                }
                _ => {
                    let expected = "the key of a sentence of the page (see `sidestep languages`)";
                    return Err(Invalid::new(key, expected, "no such sentence"));
                }
            },
        };
        let filled = places(self.get(&like).unwrap_or_default()).unwrap_or_default();
        let found = places(text).map_err(|what| Invalid::new(key, what, format!("{text:?}")))?;
        if let Some(place) = found.difference(&filled).next() {
            return Err(Invalid::new(key, listed(&filled), format!("{{{place}}}")));
        }
        // `page.between` joins sentences, so it is allowed to be a space or empty.
        if text.trim().is_empty() && self.get(&like).is_some_and(|own| !own.trim().is_empty()) {
            return Err(Invalid::new(key, "a text", format!("{text:?}")));
        }
        // A plural form such as "One scene" needs no number.
        let may_omit = |place: &&str| like != key || MAY_OMIT.contains(&(key, *place));
        match filled.difference(&found).find(|place| !may_omit(place)) {
            Some(_) => Err(Invalid::new(key, listed(&filled), listed(&found))),
            None => Ok(()),
        }
    }

    /// Whether a key is a plural form: it has a sibling `.other`, and all its siblings are plural
    /// forms.
    fn is_form(&self, key: &str) -> bool {
        let Some((stem, form)) = key.rsplit_once('.') else { return false };
        if !FORMS.contains(&form) || !self.0.contains_key(&format!("{stem}.other")) {
            return false;
        }
        let prefix = format!("{stem}.");
        let siblings = self.0.range(prefix.clone()..).map(|(key, _)| key);
        let mut siblings = siblings.take_while(|key| key.starts_with(&prefix));
        siblings.all(|key| FORMS.contains(&&key[prefix.len()..]))
    }
}

/// The names of the placeholders in a sentence.
///
/// # Errors
/// The expected text, if braces do not enclose a name.
fn places(sentence: &str) -> Result<BTreeSet<&str>, String> {
    let mut found = BTreeSet::new();
    let mut rest = sentence;
    while let Some(at) = rest.find(['{', '}']) {
        let inside = rest[at..].strip_prefix('{').and_then(|inside| inside.split_once('}'));
        let fits = |name: &str| {
            !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        };
        match inside {
            Some((name, after)) if fits(name) => {
                found.insert(name);
                rest = after;
            }
            _ => return Err("braces around names only, such as {seconds}".to_owned()),
        }
    }
    Ok(found)
}

/// The placeholders in words.
fn listed(places: &BTreeSet<&str>) -> String {
    match places.len() {
        0 => "no place to fill".to_owned(),
        _ => {
            let places: Vec<_> = places.iter().map(|place| format!("{{{place}}}")).collect();
            format!("the places {}", places.join(", "))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ENGLISH: &str = "[scene]\ntitle = \"Scene {n}\"\nleft.one = \"one scene left\"\n\
                           left.other = \"{n} scenes left\"\n[page]\nother = \"Other\"\n\
                           title = \"Page\"\n";

    #[test]
    fn languages_have_the_same_sentences_and_places() {
        let english = Sentences::read(ENGLISH).unwrap();
        let check = |changes: &[(&str, &str)]| {
            let text = changes.iter().fold(ENGLISH.to_owned(), |text, (from, to)| {
                assert!(text.contains(from), "{from}");
                text.replace(from, to)
            });
            Sentences::read(&text)
                .map_err(|complaint| complaint.to_string())
                .and_then(|other| other.check_against(&english))
        };
        let refused = |changes: &[(&str, &str)], words: &[&str]| {
            let said = check(changes).unwrap_err();
            assert!(words.iter().all(|word| said.contains(word)), "{said}");
        };
        check(&[("Scene {n}", "{n}. Szene")]).unwrap();
        // Other plural forms, with or without the number, are accepted.
        check(&[("left.one = \"one scene left\"\n", "")]).unwrap();
        check(&[("left.one = \"one", "left.few = \"{n}")]).unwrap();
        refused(&[("Scene {n}", "Szene")], &["scene.title", "{n}", "no place"]);
        refused(&[("Scene {n}", "Szene {m}")], &["scene.title", "{n}", "{m}"]);
        refused(&[("Scene {n}", "Szene {")], &["2: scene.title: expected braces"]);
        refused(&[("Other\"", "\"")], &["page.other: expected a text"]);
        let change = |key: &str, text: &str| english.check_change(key, text);
        assert_eq!(change("scene.left.one", "one"), Ok(()));
        let said = change("scene.left.other", "some").unwrap_err().to_string();
        assert_eq!(said, "scene.left.other: expected the places {n}, found no place to fill");
        let said = change("scene.title", "{").unwrap_err().to_string();
        assert!(said.starts_with("scene.title: expected braces"), "{said}");
        refused(&[("left.other", "left.many")], &["scene.left.other", "expected a sentence"]);
        refused(&[("left.one = \"one", "left.few = \"{m}")], &["scene.left.few", "{n}", "{m}"]);
        refused(&[("left.one", "left.uno")], &["scene.left.uno", "no such sentence"]);
        refused(&[("other = \"Other\"\n", "")], &["page.other", "found none"]);
        refused(&[("title = \"Page\"", "titel = \"Seite\"")], &["page.title", "found none"]);
    }
}
