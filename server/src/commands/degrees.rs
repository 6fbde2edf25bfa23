//! Warns of headings that might be in degrees. Such headings are valid but unlikely in radians.

use core::f64::consts::TAU;

/// Detects headings of a file that might be in degrees, and prints one warning on stderr for all of
/// them.
pub(super) struct Degrees {
    /// The file's name in errors.
    name: String,
    /// Place and value of the first heading that might be in degrees, and the number of further
    /// such headings.
    found: Option<(String, f64, u64)>,
}

impl Degrees {
    /// A detector for the headings of the file with this name.
    pub(super) fn of(name: impl Into<String>) -> Self {
        Self { name: name.into(), found: None }
    }

    /// Checks a heading (rad) at this place.
    pub(super) fn look(&mut self, psi: f64, place: impl FnOnce() -> String) {
        // A heading of exactly 2π is plausible in radians.
        if psi.abs() <= TAU * (1.0 + 1e-9) {
            return;
        }
        match &mut self.found {
            Some((.., count)) => *count += 1,
            None => self.found = Some((place(), psi, 1)),
        }
    }

    /// The warning, if any heading needs one.
    fn warning(&self) -> Option<String> {
        let (place, psi, count) = self.found.as_ref()?;
        let others = match count - 1 {
            0 => String::new(),
            1 => " (and one more)".to_owned(),
            others => format!(" (and {others} more)"),
        };
        Some(format!(
            "{}: {place}: {psi} is more than a full turn{others}; headings are in radians ({psi}° are {:.4})",
            self.name,
            psi.to_radians()
        ))
    }

    /// Writes the warning to standard error.
    #[allow(clippy::print_stderr, reason = "a command warns on standard error")]
    pub(super) fn warn(self) {
        if let Some(warning) = self.warning() {
            eprintln!("sidestep: {warning}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_heading_beyond_a_full_turn_is_named() {
        let mut degrees = Degrees::of("states.csv");
        for (line, psi) in [(2, TAU), (3, -TAU), (4, 0.0)] {
            degrees.look(psi, || format!("line {line}, psi"));
        }
        assert_eq!(degrees.warning(), None);
        degrees.look(-180.0, || "line 5, psi".to_owned());
        let said = "states.csv: line 5, psi: -180 is more than a full turn; headings are in radians \
                    (-180° are -3.1416)";
        assert_eq!(degrees.warning().as_deref(), Some(said));
        degrees.look(90.0, || "line 6, psi".to_owned());
        assert!(degrees.warning().is_some_and(|said| said.contains("turn (and one more);")));
    }
}
