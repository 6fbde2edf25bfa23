//! The one shape of a complaint about input.

use core::fmt;

/// A value that cannot be accepted: which field, what was expected there and
/// what was found instead. Every parser of this crate answers with it, so that
/// each edge (HTTP, command line, files) can say the same three things.
///
/// Written with `{:#}` its parts are divided by [`SEPARATOR`], so that they come whole through
/// errors that only carry text, such as serde's.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct Invalid {
    /// Path of the field, as its author wrote it: `states[17].human`.
    pub field: String,
    /// What would have been accepted.
    pub expected: String,
    /// What was there.
    pub found: String,
}

/// The unit separator of ASCII, which no field has in its name.
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
    /// A complaint about `field`.
    pub fn new(
        field: impl Into<String>,
        expected: impl Into<String>,
        found: impl ToString,
    ) -> Self {
        Self { field: field.into(), expected: expected.into(), found: found.to_string() }
    }

    /// The same complaint, seen from the structure that holds the field.
    #[must_use]
    pub fn within(mut self, parent: &str) -> Self {
        let joint = if self.field.is_empty() || self.field.starts_with('[') { "" } else { "." };
        self.field = format!("{parent}{joint}{}", self.field);
        self
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
        let whole = Invalid::new("", "an object", "a list");
        assert_eq!(whole.to_string(), "expected an object, found a list");
    }
}
