//! The sentences of a page, in the user's language.

mod intl;

use self::intl::{plural, written};
use sidestep::api::Texts;

/// A value for a placeholder in a sentence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fill<'a> {
    /// A number, to be formatted for the language.
    Number(f64),
    /// A text.
    Words(&'a str),
}

impl From<f64> for Fill<'_> {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<usize> for Fill<'_> {
    fn from(number: usize) -> Self {
        Self::Number(number as f64)
    }
}

impl<'a> From<&'a str> for Fill<'a> {
    fn from(words: &'a str) -> Self {
        Self::Words(words)
    }
}

impl<'a> From<&'a String> for Fill<'a> {
    fn from(words: &'a String) -> Self {
        Self::Words(words)
    }
}

/// Looks up the sentences of a page and fills their placeholders.
///
/// A sentence has placeholders such as `{scenes}`. A sentence that depends on a number has one key
/// for each plural form of the language, such as `ready.left.one` and `ready.left.other` (the
/// [categories of Unicode](https://cldr.unicode.org/index/cldr-spec/plural-rules)).
pub trait Sentences {
    /// The sentence with this key, with its placeholders filled. Returns the key itself if there is
    /// no such sentence.
    #[must_use]
    fn get(&self, key: &str, fills: &[(&str, Fill<'_>)]) -> String;

    /// Fills the placeholders of a sentence.
    #[must_use]
    fn fill(&self, sentence: &str, fills: &[(&str, Fill<'_>)]) -> String;

    /// The sentence with this key, in the plural form for `count`. `count` also fills `{n}`.
    #[must_use]
    fn count(&self, key: &str, count: usize, fills: &[(&str, Fill<'_>)]) -> String;

    /// Formats a number for the language.
    #[must_use]
    fn number(&self, number: f64) -> String;
}

impl Sentences for Texts {
    fn get(&self, key: &str, fills: &[(&str, Fill<'_>)]) -> String {
        self.sentences.get(key).map_or_else(|| key.to_owned(), |text| self.fill(text, fills))
    }

    fn fill(&self, sentence: &str, fills: &[(&str, Fill<'_>)]) -> String {
        let mut rest = sentence;
        let mut text = String::new();
        while let Some((before, after)) = rest.split_once('{') {
            text.push_str(before);
            let (place, after) = after.split_once('}').unwrap_or((after, ""));
            match fills.iter().find(|(name, _)| *name == place) {
                Some((_, Fill::Number(number))) => text.push_str(&self.number(*number)),
                Some((_, Fill::Words(words))) => text.push_str(words),
                None => text.extend(["{", place, "}"]),
            }
            rest = after;
        }
        text.push_str(rest);
        text
    }

    fn count(&self, key: &str, count: usize, fills: &[(&str, Fill<'_>)]) -> String {
        let mut fills = fills.to_vec();
        fills.push(("n", count.into()));
        let form = format!("{key}.{}", plural(&self.language, count as f64));
        if self.sentences.get(&form).is_some() {
            return self.get(&form, &fills);
        }
        self.get(&format!("{key}.other"), &fills)
    }

    fn number(&self, number: f64) -> String {
        written(&self.language, number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts() -> Texts {
        let json = br#"{"language":"en","offered":[],"facts":[],"check":[],"questions":[],
            "sentences":{"lead":"{n} scenes of {seconds} s, {name}.",
            "left.one":"One scene is left.","left.other":"{n} scenes are left.",
            "odd":"{unknown} {never closed","all.other":"All {n}"}}"#;
        crate::json::read(json).unwrap()
    }

    #[test]
    fn places_are_filled() {
        let fills = [("n", 60usize.into()), ("seconds", 2.5.into()), ("name", "Ada {n}".into())];
        assert_eq!(texts().get("lead", &fills), "60 scenes of 2.5 s, Ada {n}.");
        assert_eq!(texts().get("odd", &[]), "{unknown} {never closed}");
        assert_eq!(texts().get("no.such.key", &fills), "no.such.key");
    }

    #[test]
    fn the_form_of_the_plural_goes_with_the_number() {
        let texts = texts();
        let left = |n| texts.count("left", n, &[]);
        assert_eq!(
            [left(0), left(1), left(7)],
            ["0 scenes are left.", "One scene is left.", "7 scenes are left."]
        );
        assert_eq!(texts.count("all", 1, &[]), "All 1", "a language without such a form");
        assert_eq!(texts.count("none", 1, &[]), "none.other");
    }
}
