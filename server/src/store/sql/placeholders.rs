//! SQLite's parameters as PostgreSQL writes them: `?2` and `:name` become `$2` and `$1`, `$2`, …

/// A statement for PostgreSQL.
#[derive(Debug, PartialEq, Eq)]
pub(in crate::store) struct Translated {
    /// As the store wrote it.
    pub(super) source: String,
    /// Its text.
    pub(super) text: String,
    /// Its named parameters, with the colon, in the order of their numbers.
    pub(super) names: Vec<String>,
}

impl Translated {
    /// Translates a statement; what stands between quotes stays as it is.
    pub(super) fn of(source: &str) -> Self {
        let (mut text, mut names) = (String::with_capacity(source.len()), Vec::<String>::new());
        let (mut rest, mut quoted) = (source, false);
        while let Some(c) = rest.chars().next() {
            let after = &rest[c.len_utf8()..];
            let word = |is_part: fn(char) -> bool| {
                after.split_once(|c| !is_part(c)).map_or(after, |(word, _)| word)
            };
            quoted ^= c == '\'';
            rest = match c {
                '?' if !quoted => {
                    let number = word(|c| c.is_ascii_digit());
                    text.push('$');
                    text.push_str(number);
                    &after[number.len()..]
                }
                ':' if !quoted && after.starts_with(|c: char| c.is_ascii_alphabetic()) => {
                    let name = word(|c| c.is_ascii_alphanumeric() || c == '_');
                    let name = format!(":{name}");
                    let known = names.iter().position(|known| *known == name);
                    let number = known.unwrap_or(names.len()) + 1;
                    text.push_str(&format!("${number}"));
                    let rest = &after[name.len() - 1..];
                    if known.is_none() {
                        names.push(name);
                    }
                    rest
                }
                other => {
                    text.push(other);
                    after
                }
            };
        }
        Self { source: source.to_owned(), text, names }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(source: &str, text: &str, names: &[&str]) {
        let found = Translated::of(source);
        assert_eq!(
            (found.text.as_str(), found.names),
            (text, names.iter().map(|&n| n.into()).collect())
        );
    }

    #[test]
    fn numbers_and_names_become_postgres_numbers() {
        check("SELECT ?12, ?1 FROM t WHERE a = ?1", "SELECT $12, $1 FROM t WHERE a = $1", &[]);
        let named = "SELECT :b WHERE a = :a_1 OR b = :b";
        check(named, "SELECT $1 WHERE a = $2 OR b = $1", &[":b", ":a_1"]);
    }

    #[test]
    fn quoted_text_stays() {
        check("SELECT 'it''s ?1 :x', ?1", "SELECT 'it''s ?1 :x', $1", &[]);
    }
}
