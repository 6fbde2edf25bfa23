//! Study files: TOML that overrides the paper's protocol.

use serde::Deserialize;
use sidestep::document::from_value;
use sidestep::study::StudyConfig;
use std::path::Path;
use toml::{Table, Value};

/// The study in a file. Fields that the file omits, at any depth, have the paper's values; a list (such as
/// `phases`) replaces the paper's list as a whole.
///
/// # Errors
/// One line naming the file, the field (or line), what was expected and found.
pub fn read_study(file: &Path) -> Result<StudyConfig, String> {
    let name = file.display();
    let text = std::fs::read_to_string(file)
        .map_err(|e| format!("{name}: cannot read the study file: {e}"))?;
    parse_study(&text).map_err(|complaint| format!("{name}: {complaint}"))
}

fn parse_study(text: &str) -> Result<StudyConfig, String> {
    let given: Table = toml::from_str(text).map_err(|error: toml::de::Error| {
        let before = error.span().map_or(0, |span| span.start);
        let line = 1 + text[..before].matches('\n').count();
        format!("line {line}: expected TOML: {}", one_line(error.message()))
    })?;
    let mut whole =
        Table::try_from(StudyConfig::default()).map_err(|e| one_line(&e.to_string()))?;
    lay_over(&mut whole, given);
    let study = StudyConfig::deserialize(Value::Table(whole.clone())).or_else(|error| {
        let document = serde_json::to_value(whole).map_err(|e| one_line(&e.to_string()))?;
        match from_value::<StudyConfig>(&document) {
            Err(invalid) => Err(invalid.to_string()),
            // TOML has numbers and dates that JSON does not have.
            Ok(_) => Err(one_line(&error.to_string())),
        }
    })?;
    study.check().map_err(|invalid| invalid.to_string())?;
    // A study without scenes would start, and then enrol nobody.
    study.plan(0).map_err(|invalid| invalid.to_string())?;
    Ok(study)
}

/// Merges tables; other values are replaced.
fn lay_over(below: &mut Table, above: Table) {
    for (key, value) in above {
        match (below.get_mut(&key), value) {
            (Some(Value::Table(below)), Value::Table(above)) => lay_over(below, above),
            (_, value) => {
                below.insert(key, value);
            }
        }
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_says_only_what_differs() {
        assert_eq!(parse_study("").unwrap(), StudyConfig::default());
        let study = parse_study("slug = \"pilot\"\n[parameters.human]\nspeed_mps = 1.5\n").unwrap();
        assert_eq!(study.slug, "pilot");
        assert_eq!(study.parameters.human.speed_mps, 1.5);
        assert_eq!(study.parameters.human.turn_rate_radps, 0.5);
        let study = parse_study("phases = [{ phase = \"task\", scenes = 2 }]").unwrap();
        assert_eq!(study.phases.len(), 1);
    }

    #[test]
    fn complaints_name_line_or_field() {
        let check = |text: &str, words: &[&str]| {
            let complaint = parse_study(text).unwrap_err();
            assert!(!complaint.contains('\n'), "{complaint}");
            for word in words {
                assert!(complaint.contains(word), "{complaint}");
            }
        };
        check("slug = \"a\"\nslug = ", &["line 2"]);
        check("colour = 1", &["colour"]);
        check("slug = 7", &["slug", "string"]);
        check("slug = \"Pilot 2\"", &["slug", "lower-case", "Pilot 2"]);
        check("[parameters.human]\nspeed_mps = -2.0", &["parameters.human.speed_mps"]);
        check("parameters = 3", &["parameters: expected an object, {…}, found 3"]);
        check("phases = [{ phase = \"nap\", scenes = 2 }]", &["phases[0].phase"]);
        for parameters in ["danger_radius_m = 30.0", "steps = 1", "step_s = 200.0", "step_s = 0.02"]
        {
            let text = format!("[parameters]\n{parameters}");
            check(&text, &["parameters", "danger radius", "duration"]);
        }
    }
}
