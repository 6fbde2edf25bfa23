//! Parses TOML and keeps the line of each value, so that complaints can name the line.

use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The reason why a text was rejected, and its line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{line}: {what}")]
pub struct Complaint {
    /// The line number, from 1.
    pub line: usize,
    /// The field, such as `phases[0].scenes`. `None` if the text is not TOML.
    pub field: Option<String>,
    /// What was expected and what was found, in one line.
    pub what: String,
}

/// A parsed TOML text.
#[derive(Debug)]
pub struct TomlLines<'a> {
    text: &'a str,
    root: Spanned<DeTable<'a>>,
}

/// A value other than a table, with its path and its line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Leaf {
    /// The names on the path to the value, joined by dots.
    pub key: String,
    /// The line number of the value's name, from 1.
    pub line: usize,
    /// The value, if it is a string.
    pub text: Option<String>,
}

impl<'a> TomlLines<'a> {
    /// Parses a text.
    ///
    /// # Errors
    /// [`Complaint`] if it is not TOML.
    pub fn parse(text: &'a str) -> Result<Self, Complaint> {
        let root = DeTable::parse(text).map_err(|error| {
            let line = line_at(text, &error.span().unwrap_or_default());
            let what = format!("expected TOML: {}", one_line(error.message()));
            Complaint { line, field: None, what }
        })?;
        Ok(Self { text, root })
    }

    /// The line of a field, such as `phases[0].scenes`. If the text does not set the field, returns the
    /// line of the innermost table or list around it.
    #[must_use]
    pub fn line_of(&self, field: &str) -> usize {
        let mut span = 0..0;
        let mut rest = field;
        let Some((entry, after)) = longest(self.root.get_ref(), rest, &mut span) else {
            return 1;
        };
        let mut value = entry;
        rest = after;
        while !rest.is_empty() {
            match value {
                DeValue::Table(table) => match longest(table, rest, &mut span) {
                    Some((entry, after)) => (value, rest) = (entry, after),
                    None => break,
                },
                DeValue::Array(list) => {
                    let Some((index, after)) = index(rest) else { break };
                    let Some(entry) = list.get(index) else { break };
                    span = entry.span();
                    (value, rest) = (entry.get_ref(), after);
                }
                _ => break,
            }
        }
        line_at(self.text, &span)
    }

    /// Every value that is not a table, in line order.
    #[must_use]
    pub fn leaves(&self) -> Vec<Leaf> {
        let mut found = Vec::new();
        self.collect("", self.root.get_ref(), &mut found);
        found.sort_by_key(|leaf| leaf.line);
        found
    }

    /// The first whole number that does not fit in 64 bits. TOML's own error does not name the field.
    #[must_use]
    pub fn too_large(&self) -> Option<Leaf> {
        self.root
            .get_ref()
            .iter()
            .find_map(|(name, value)| self.too_large_in(name.get_ref(), value))
    }

    fn too_large_in(&self, key: &str, value: &Spanned<DeValue<'_>>) -> Option<Leaf> {
        match value.get_ref() {
            DeValue::Integer(number) => {
                i64::from_str_radix(number.as_str(), number.radix()).is_err().then(|| Leaf {
                    key: key.to_owned(),
                    line: line_at(self.text, &value.span()),
                    text: None,
                })
            }
            DeValue::Array(list) => list
                .iter()
                .enumerate()
                .find_map(|(i, value)| self.too_large_in(&format!("{key}[{i}]"), value)),
            DeValue::Table(table) => table.iter().find_map(|(name, value)| {
                self.too_large_in(&format!("{key}.{}", name.get_ref()), value)
            }),
            _ => None,
        }
    }

    fn collect(&self, path: &str, table: &DeTable<'_>, found: &mut Vec<Leaf>) {
        for (name, value) in table {
            let key = match path {
                "" => name.get_ref().to_string(),
                path => format!("{path}.{}", name.get_ref()),
            };
            match value.get_ref() {
                DeValue::Table(table) => self.collect(&key, table, found),
                value => found.push(Leaf {
                    key,
                    line: line_at(self.text, &name.span()),
                    text: value.as_str().map(str::to_owned),
                }),
            }
        }
    }
}

/// The entry of a table with the longest name that is a prefix of `path`, and the rest of the path.
/// Names can contain dots.
fn longest<'t, 'p>(
    table: &'t DeTable<'_>,
    path: &'p str,
    span: &mut Range<usize>,
) -> Option<(&'t DeValue<'t>, &'p str)> {
    let path = path.strip_prefix('.').unwrap_or(path);
    let fits = |name: &str| {
        let rest = path.strip_prefix(name)?;
        (rest.is_empty() || rest.starts_with(['.', '['])).then_some(rest)
    };
    let found = table.iter().filter_map(|(name, value)| {
        let rest = fits(name.get_ref())?;
        Some((name.get_ref().len(), name.span(), value.get_ref(), rest))
    });
    let (_, at, value, rest) = found.max_by_key(|(length, ..)| *length)?;
    *span = at;
    Some((value, rest))
}

/// The number in brackets at the start of `path`, and the rest of the path.
fn index(path: &str) -> Option<(usize, &str)> {
    let (number, rest) = path.strip_prefix('[')?.split_once(']')?;
    Some((number.parse().ok()?, rest))
}

fn line_at(text: &str, span: &Range<usize>) -> usize {
    1 + text.as_bytes().iter().take(span.start).filter(|byte| **byte == b'\n').count()
}

/// Replaces line breaks in a message by spaces.
#[must_use]
pub fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_have_lines() {
        let text = "slug = \"a\"\n\n[parameters.human]\nspeed_mps = 2\n\n[[phases]]\n\
                    phase = \"task\"\nscenes = 3\n\n[texts.en]\n\"welcome.lead\" = \"Hello\"\n\
                    welcome.title = \"Hi\"\nlist = [1,\n 2]\n";
        let lines = TomlLines::parse(text).unwrap();
        for (field, line) in [
            ("slug", 1),
            ("parameters.human.speed_mps", 4),
            ("parameters.human.turn_rate_radps", 3),
            ("phases[0].scenes", 8),
            ("phases[0].feedback", 6),
            ("texts.en.welcome.lead", 11),
            ("texts.en.welcome.title", 12),
            ("texts.en.list[1]", 14),
            ("title", 1),
        ] {
            assert_eq!(lines.line_of(field), line, "{field}");
        }
        let keys: Vec<_> = lines.leaves().into_iter().map(|leaf| (leaf.key, leaf.line)).collect();
        assert!(keys.contains(&("texts.en.welcome.title".to_owned(), 12)), "{keys:?}");
        assert_eq!(TomlLines::parse("a = 1\nb = ").unwrap_err().line, 2);
    }
}
