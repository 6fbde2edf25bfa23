//! Researchers' texts in several languages.

use crate::invalid::Invalid;
use core::fmt;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A text by language: `{ en = "Hello", de = "Hallo" }`. Languages are tags such as `en` or `zh-CN`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Localised(pub BTreeMap<String, String>);

/// A fact about the study: one text for all languages, such as a name, or a text by language.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum Fact {
    /// The same text in every language.
    Same(String),
    /// One text for each language.
    ByLanguage(Localised),
}

impl Default for Fact {
    fn default() -> Self {
        Self::Same(String::new())
    }
}

impl From<&str> for Fact {
    fn from(text: &str) -> Self {
        Self::Same(text.to_owned())
    }
}

impl<'de> Deserialize<'de> for Fact {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;

        impl<'de> Visitor<'de> for Either {
            type Value = Fact;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a text, or texts by language")
            }

            fn visit_str<E>(self, text: &str) -> Result<Fact, E> {
                Ok(text.into())
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Fact, A::Error> {
                Localised::deserialize(MapAccessDeserializer::new(map)).map(Fact::ByLanguage)
            }
        }

        deserializer.deserialize_any(Either)
    }
}

impl Fact {
    /// The text in `language`, otherwise in `fallback`, otherwise in any language.
    #[must_use]
    pub fn get(&self, language: &str, fallback: &str) -> &str {
        match self {
            Self::Same(text) => text,
            Self::ByLanguage(texts) => texts.get(language, fallback),
        }
    }

    /// The texts by language. Returns `None` if one text is used for every language.
    #[must_use]
    pub fn by_language(&self) -> Option<&Localised> {
        match self {
            Self::Same(_) => None,
            Self::ByLanguage(texts) => Some(texts),
        }
    }

    /// Checks that every text has at most `most` characters and no hidden characters.
    ///
    /// # Errors
    /// [`Invalid`] naming the field or the language.
    pub(super) fn check(&self, field: &str, most: usize) -> Result<(), Invalid> {
        match self {
            Self::Same(text) => check_length(field, text, most),
            Self::ByLanguage(texts) => texts.check_given(field, most),
        }
    }
}

/// Checks that a text has at most `most` characters and no hidden characters.
pub(super) fn check_length(field: &str, text: &str, most: usize) -> Result<(), Invalid> {
    check_visible(field, text)?;
    let count = text.chars().count();
    if count > most {
        return Err(Invalid::new(field, format!("at most {most} characters"), count));
    }
    Ok(())
}

/// Whether `tag` can name a language: two or three letters, then parts of letters and digits, such as
/// `de` or `zh-CN` (BCP 47).
#[must_use]
pub fn is_language(tag: &str) -> bool {
    let mut parts = tag.split('-');
    let letters = |part: &str| part.chars().all(|c| c.is_ascii_alphabetic());
    parts.next().is_some_and(|first| matches!(first.len(), 2 | 3) && letters(first))
        && parts.all(|part| {
            (1..=8).contains(&part.len()) && part.chars().all(|c| c.is_ascii_alphanumeric())
        })
}

/// The best of the `offered` languages for `wanted`: the language with the same tag, otherwise a
/// language with the same primary subtag (`de` for `de-AT`, `zh-CN` for `zh-TW`).
#[must_use]
pub fn closest_language<'a>(
    offered: impl Iterator<Item = &'a str> + Clone,
    wanted: &str,
) -> Option<&'a str> {
    let first = |tag: &str| tag.split('-').next().unwrap_or_default().to_ascii_lowercase();
    let same = offered.clone().find(|tag| tag.eq_ignore_ascii_case(wanted));
    same.or_else(|| offered.clone().find(|tag| first(tag) == first(wanted)))
}

/// Checks that a text has no control characters (except line breaks and tabs) and no bidirectional
/// overrides, which would make the displayed text differ from the stored text.
///
/// # Errors
/// [`Invalid`] naming the character.
pub(super) fn check_visible(field: &str, text: &str) -> Result<(), Invalid> {
    let is_hidden = |c: char| {
        (c.is_control() && !"\n\r\t".contains(c))
            || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    text.chars().find(|c| is_hidden(*c)).map_or(Ok(()), |found| {
        let expected = "a text without control characters";
        Err(Invalid::new(field, expected, format!("U+{:04X}", u32::from(found))))
    })
}

/// The first name in braces, such as `radius` in `{radius} m`.
pub(super) fn first_place(text: &str) -> Option<&str> {
    let names = text.split('{').skip(1).filter_map(|rest| rest.split_once('}'));
    names.map(|(name, _)| name).find(|name| {
        !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
    })
}

impl Localised {
    /// A text in one language.
    #[must_use]
    pub fn of(language: &str, text: &str) -> Self {
        Self(BTreeMap::from([(language.to_owned(), text.to_owned())]))
    }

    /// Whether there is no text in any language.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The text in `language`, otherwise in `fallback`, otherwise in any language.
    #[must_use]
    pub fn get(&self, language: &str, fallback: &str) -> &str {
        self.find(language, fallback).map_or("", |(_, text)| text)
    }

    /// The text of [`Self::get`] with its language, if there is any.
    #[must_use]
    pub fn find(&self, language: &str, fallback: &str) -> Option<(&str, &str)> {
        let languages = || self.0.keys().map(String::as_str);
        let found = closest_language(languages(), language)
            .or_else(|| closest_language(languages(), fallback))
            .or_else(|| languages().next());
        found.and_then(|tag| Some((tag, self.0.get(tag)?.as_str())))
    }

    /// Checks that every language tag is valid, and that no text is blank, exceeds `most`
    /// characters or contains hidden characters.
    ///
    /// # Errors
    /// [`Invalid`] naming the language.
    pub fn check(&self, field: &str, most: usize) -> Result<(), Invalid> {
        for (language, text) in &self.0 {
            let field = format!("{field}.{language}");
            if !is_language(language) {
                return Err(Invalid::new(field, "a language tag such as en or zh-CN", language));
            }
            let count = text.chars().count();
            if count > most {
                let expected = format!("at most {most} characters");
                return Err(Invalid::new(field, expected, format!("{count}")));
            }
            if text.trim().is_empty() {
                return Err(Invalid::new(field, "a text", "white space only"));
            }
            check_visible(&field, text)?;
        }
        Ok(())
    }

    /// Checks that the text differs from each of the `others` in every language, because
    /// participants could not distinguish equal options.
    ///
    /// # Errors
    /// [`Invalid`] naming the language.
    pub(super) fn check_new<'a>(
        &self,
        field: &str,
        others: impl IntoIterator<Item = &'a Self>,
    ) -> Result<(), Invalid> {
        for other in others {
            for (language, text) in &self.0 {
                if other.0.get(language).is_some_and(|known| known.trim() == text.trim()) {
                    let expected = "a text that differs from the options before";
                    return Err(Invalid::new(
                        format!("{field}.{language}"),
                        expected,
                        format!("{text:?}"),
                    ));
                }
            }
        }
        Ok(())
    }

    /// Like [`Self::check`], but also requires a text in at least one language.
    ///
    /// # Errors
    /// [`Invalid`] naming the field or the language.
    pub fn check_given(&self, field: &str, most: usize) -> Result<(), Invalid> {
        if self.is_empty() {
            return Err(Invalid::new(field, "a text in at least one language", "none"));
        }
        self.check(field, most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closest_language_is_found() {
        let offered = ["en", "de", "zh-CN"];
        let find = |wanted| closest_language(offered.into_iter(), wanted);
        let cases = [("de", Some("de")), ("de-AT", Some("de")), ("ZH-tw", Some("zh-CN"))];
        for (wanted, found) in cases {
            assert_eq!(find(wanted), found);
        }
        assert_eq!(find("fr"), None);
        let text = Localised(BTreeMap::from([("de".into(), "Hallo".into())]));
        assert_eq!(text.get("fr", "en"), "Hallo");
        assert_eq!(Localised::default().get("fr", "en"), "");
    }

    #[test]
    fn a_fact_is_one_text_or_one_by_language() {
        let read = |json: &str| crate::document::from_json::<Fact>(json);
        let same = read(r#""Ten years""#).unwrap();
        assert_eq!((&same, same.get("de", "en")), (&"Ten years".into(), "Ten years"));
        assert_eq!(serde_json::to_string(&same).unwrap(), r#""Ten years""#);
        let both = r#"{"de":"Zehn Jahre","en":"Ten years"}"#;
        let fact = read(both).unwrap();
        assert_eq!([fact.get("de-AT", "en"), fact.get("es", "en")], ["Zehn Jahre", "Ten years"]);
        assert_eq!(serde_json::to_string(&fact).unwrap(), both);
        let said = read("3").unwrap_err().to_string();
        assert_eq!(said, "expected a text, or texts by language, found 3");
        for (json, field) in
            [("{}", "fact"), (r#"{"de":" "}"#, "fact.de"), (r#""a\u0000""#, "fact")]
        {
            assert_eq!(read(json).unwrap().check("fact", 9).unwrap_err().field, field);
        }
    }

    #[test]
    fn tags_have_letters_first() {
        for tag in ["en", "zh-CN", "sr-Latn-RS", "de-1996"] {
            assert!(is_language(tag), "{tag}");
        }
        for tag in ["", "e", "english", "1e", "en_GB", "en-", "../x"] {
            assert!(!is_language(tag), "{tag}");
        }
    }
}
