//! The error for invalid input.

use core::fmt;

/// A rejected value: its field, what was expected and what was found. Every parser of this crate
/// returns this error, so that errors in requests, arguments and files name all three parts.
///
/// The format `{:#}` separates the parts by [`SEPARATOR`], so that a caller can recover them from
/// an error that contains only text, such as Serde's error.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct Invalid {
    /// Path of the field, as in the input: `states[17].human`.
    pub field: String,
    /// The accepted values.
    pub expected: String,
    /// The rejected value.
    pub found: String,
}

/// The ASCII unit separator, which no field name contains.
pub const SEPARATOR: char = '\u{1f}';

impl fmt::Display for Invalid {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { field, expected, found } = self;
        if out.alternate() {
            return write!(out, "{field}{SEPARATOR}{expected}{SEPARATOR}{found}");
        }
        if !field.is_empty() {
            write!(out, "{field}: ")?;
        }
        write!(out, "expected {expected}, found {found}")
    }
}

impl Invalid {
    /// An error about `field`.
    pub fn new(
        field: impl Into<String>,
        expected: impl Into<String>,
        found: impl ToString,
    ) -> Self {
        let (field, found) = (short(field.into()), short(brief(found.to_string())));
        Self { field, expected: expected.into(), found }
    }

    /// The same error, with `parent` prepended to the field's path.
    #[must_use]
    pub fn within(mut self, parent: &str) -> Self {
        let joint = if self.field.is_empty() || self.field.starts_with('[') { "" } else { "." };
        self.field = format!("{parent}{joint}{}", self.field);
        self
    }
}

/// Maximum number of characters of a field or a value. Longer texts, which a file can contain, are
/// truncated.
const MOST_SIGNS: usize = 400;

/// Truncates a long text.
fn short(mut text: String) -> String {
    if let Some((end, _)) = text.char_indices().nth(MOST_SIGNS) {
        text.truncate(end);
        text.push('…');
    }
    text
}

/// Maximum number of characters of a number in plain notation. They suffice for the 17 significant
/// digits of an f64, a sign, a decimal point and some zeros.
const MOST_DIGITS: usize = 24;

/// Writes a number of more than [`MOST_DIGITS`] characters in scientific notation, such as 1e300.
/// Returns any other text unchanged.
fn brief(found: String) -> String {
    if found.len() <= MOST_DIGITS {
        return found;
    }
    match found.parse::<f64>() {
        Ok(number) if number.is_finite() => format!("{number:e}"),
        _ => found,
    }
}

/// Accepts a finite number greater than zero.
///
/// # Errors
/// [`Invalid`] for NaN, an infinity, zero or a negative number.
pub fn positive(field: &str, value: f64) -> Result<f64, Invalid> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(Invalid::new(field, "a finite number > 0", value))
    }
}

/// Accepts a finite number.
///
/// # Errors
/// [`Invalid`] for NaN or an infinity.
pub fn finite(field: &str, value: f64) -> Result<f64, Invalid> {
    if value.is_finite() { Ok(value) } else { Err(Invalid::new(field, "a finite number", value)) }
}

/// Accepts a list of finite numbers.
///
/// # Errors
/// [`Invalid`] naming the first NaN or infinity.
pub fn all_finite(field: &str, values: &[f64]) -> Result<(), Invalid> {
    let wrong = values.iter().position(|value| !value.is_finite());
    wrong.map_or(Ok(()), |i| finite(&format!("{field}[{i}]"), values[i]).map(|_| ()))
}

/// Upper bound on the absolute value of a number in a model. It prevents overflow in sums of
/// products of three such numbers.
const MOST_OF_MODEL: f64 = 1e100;

/// Accepts a number of a model whose magnitude is small enough that products do not overflow.
///
/// # Errors
/// [`Invalid`] for a number beyond ±10¹⁰⁰, and for NaN.
pub fn moderate(field: &str, value: f64) -> Result<(), Invalid> {
    // No range contains NaN.
    if (-MOST_OF_MODEL..=MOST_OF_MODEL).contains(&value) {
        return Ok(());
    }
    Err(Invalid::new(field, "a number from -1e100 to 1e100", value))
}

/// Accepts a list if [`moderate`] accepts each of its numbers.
///
/// # Errors
/// [`Invalid`] naming the first number that [`moderate`] rejects.
pub fn all_moderate(field: &str, values: &[f64]) -> Result<(), Invalid> {
    (0_usize..).zip(values).try_for_each(|(i, &value)| match moderate(field, value) {
        Err(invalid) => Err(Invalid { field: format!("{field}[{i}]"), ..invalid }),
        fine => fine,
    })
}

/// Accepts a divisor of a model that is large enough that quotients do not overflow.
///
/// # Errors
/// [`Invalid`] for a number outside [10⁻¹⁰⁰, 10¹⁰⁰], and for NaN.
pub fn moderate_divisor(field: &str, value: f64) -> Result<(), Invalid> {
    if (MOST_OF_MODEL.recip()..=MOST_OF_MODEL).contains(&value) {
        return Ok(());
    }
    Err(Invalid::new(field, "a number from 1e-100 to 1e100", value))
}

/// Accepts a list of exactly `expected` entries.
///
/// # Errors
/// [`Invalid`] for any other length.
pub fn length(field: &str, expected: usize, found: usize) -> Result<(), Invalid> {
    if expected == found {
        Ok(())
    } else {
        Err(Invalid::new(field, format!("{expected} entries"), format!("{found} entries")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_complaint_names_its_path() {
        let complaint = Invalid::new("[3]", "a finite number", f64::NAN).within("states");
        assert_eq!(complaint.to_string(), "states[3]: expected a finite number, found NaN");
        let complaint = positive("speed_mps", -1.0).unwrap_err().within("human");
        assert_eq!(complaint.field, "human.speed_mps");
        for (number, told) in
            [(1e300, "1e300"), (-2.5e-300, "-2.5e-300"), (1e21, "1000000000000000000000")]
        {
            assert_eq!(Invalid::new("x", "less", number).found, told);
        }
        assert_eq!(Invalid::new("x", "a number", "a word of many letters, 1e300").found.len(), 29);
        let long = Invalid::new("ä".repeat(300_000), "a word", "ß".repeat(300_000)).to_string();
        assert!(
            long.chars().count() < 1000 && long.contains("ä…: expected a word, found ß"),
            "{long}"
        );
        let whole = Invalid::new("", "an object", "a list");
        assert_eq!(whole.to_string(), "expected an object, found a list");
    }
}
