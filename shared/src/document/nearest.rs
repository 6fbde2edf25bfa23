//! Suggestions for unknown names.

/// Returns the known names that are most similar to an unknown name, if any is similar enough.
///
/// These are the names with the fewest typing errors (Damerau–Levenshtein distance). The accepted
/// number of errors depends on the longer of the two names: one error up to 5 characters, two up to
/// 11, and three above. Differences in case, hyphens and spaces do not count. If every name has too
/// many errors, returns the names that contain the given words, as `danger_radius_m` contains
/// `radius`. If more than three names match equally well, returns none.
#[must_use]
pub fn nearest<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str>) -> Vec<&'a str> {
    const MOST: usize = 3;
    let fits = known.into_iter().filter_map(|name| Some((misfit(wrong, name)?, name)));
    let mut fits: Vec<_> = fits.collect();
    let least = fits.iter().map(|(misfit, _)| *misfit).min();
    fits.retain(|(misfit, _)| Some(*misfit) == least);
    let mut names: Vec<_> = fits.into_iter().map(|(_, name)| name).collect();
    names.sort_unstable();
    names.dedup();
    if names.len() > MOST { Vec::new() } else { names }
}

/// Formats the suggestions as the end of an error message, such as `; did you mean kind?`. Returns
/// an empty string if there are no suggestions.
#[must_use]
pub fn did_you_mean<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    match &nearest(wrong, known)[..] {
        [] => String::new(),
        names => format!("; did you mean {}?", names.join(" or ")),
    }
}

/// Returns the number of typing errors between both names. If this number is too large, but `name`
/// contains the words of `wrong`, returns `usize::MAX`. Returns `None` if `name` does not match.
fn misfit(wrong: &str, name: &str) -> Option<usize> {
    const HAS_THE_WORDS: usize = usize::MAX;
    let [wrong, name] = [words(wrong), words(name)];
    if wrong == name {
        return Some(0);
    }
    let [one, other] = [wrong.concat(), name.concat()];
    let length = one.chars().count().max(other.chars().count());
    let most = match length {
        0..=5 => 1,
        6..=11 => 2,
        _ => 3,
    };
    let errors = strsim::damerau_levenshtein(&one, &other);
    if errors <= most && errors < length {
        return Some(errors);
    }
    let is_long = wrong.iter().any(|word| word.chars().count() >= 3);
    let has_them = name.windows(wrong.len().max(1)).any(|part| part == wrong);
    (is_long && has_them).then_some(HAS_THE_WORDS)
}

/// The words of a name, in lower case.
fn words(name: &str) -> Vec<String> {
    let parts = name.split(['_', '-', ' ', '.']).filter(|part| !part.is_empty());
    parts.map(str::to_lowercase).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIELDS: [&str; 9] = [
        "name",
        "kind",
        "text",
        "required",
        "options",
        "from",
        "to",
        "max_chars",
        "danger_radius_m",
    ];

    #[test]
    fn a_name_with_a_typing_error_is_proposed_and_no_other() {
        for (wrong, expected) in [
            ("knid", "kind"),
            ("opt", ""),
            ("txt", "text"),
            ("form", "from"),
            ("o", "to"),
            ("Max-Chars", "max_chars"),
            ("maxchars", "max_chars"),
            ("radius", "danger_radius_m"),
            ("danger_radius", "danger_radius_m"),
            // No name is similar enough, not even "kind".
            ("id", ""),
            ("answer", ""),
            ("x", ""),
            ("", ""),
            ("colour", ""),
        ] {
            assert_eq!(nearest(wrong, FIELDS).join(" "), expected, "{wrong}");
        }
    }

    #[test]
    fn names_that_fit_equally_are_all_proposed_unless_they_are_many() {
        assert_eq!(nearest("hp", ["hx", "hy", "rx"]), ["hx", "hy"]);
        assert_eq!(did_you_mean("hp", ["hx", "hy"]), "; did you mean hx or hy?");
        assert_eq!(nearest("hp", ["hx", "hy", "ha", "hb"]), [""; 0]);
        // A name with fewer errors is a better match, regardless of the order.
        assert_eq!(
            nearest("steps", ["strops", "step", "steps2", "stepps"]),
            ["step", "stepps", "steps2"]
        );
        assert_eq!(
            nearest("start", ["max_start_m", "min_start_m"]),
            ["max_start_m", "min_start_m"]
        );
    }
}
