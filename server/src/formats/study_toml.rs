//! Study files: TOML that overrides the paper's protocol.

use super::field_tables::{explained, tables};
use super::text::{self, Encoding};
use super::toml_lines::{Complaint, TomlLines, one_line};
use serde::Deserialize;
use sidestep::document::from_value;
use sidestep::invalid::Invalid;
use sidestep::scene::EncounterRange;
use sidestep::study::StudyConfig;
use std::path::Path;
use toml::{Table, Value};

/// A parsed study file.
#[derive(Clone, Debug)]
pub struct StudyFile {
    name: String,
    text: String,
    encoding: Encoding,
    config: StudyConfig,
}

impl StudyFile {
    /// Reads the study in a file. Fields that the file omits, at any depth, take the paper's values. A list
    /// (such as `phases`) replaces the paper's whole list. Only the slug is required.
    ///
    /// # Errors
    /// One line naming the file, the line and the field, with the expected and the found value.
    pub fn read(file: &Path) -> Result<Self, String> {
        let name = file.display().to_string();
        let bytes =
            std::fs::read(file).map_err(|e| format!("{name}: cannot read the study file: {e}"))?;
        let (text, encoding) = text::whole(&bytes)
            .map_err(|found| format!("{name}: expected UTF-8 text, found {found}"))?;
        let read = Self::of(name.clone(), text);
        read.map(|file| Self { encoding, ..file })
            .map_err(|complaint| format!("{name}:{complaint}"))
    }

    /// A remark for the user if the file is not UTF-8.
    #[must_use]
    pub fn encoding_remark(&self) -> Option<String> {
        let encoding = self.encoding.remark()?;
        Some(format!("{}: warning: read as {encoding}; save it as UTF-8 to be sure", self.name))
    }

    /// Parses the study in a text. Complaints contain `name` as the file name.
    ///
    /// # Errors
    /// [`Complaint`] naming the line and the field, with the expected and the found value.
    pub fn of(name: String, text: String) -> Result<Self, Complaint> {
        let config = parse(&text)?;
        Ok(Self { name, text, encoding: Encoding::Utf8, config })
    }

    /// The line of a field, from 1.
    #[must_use]
    pub fn line_of(&self, field: &str) -> usize {
        TomlLines::parse(&self.text).map_or(1, |lines| lines.line_of(field))
    }

    /// Whether the text gives a value to this field of the study.
    #[must_use]
    pub fn gives(&self, field: &str) -> bool {
        self.text.parse::<Table>().is_ok_and(|given| given.contains_key(field))
    }

    /// The study.
    #[must_use]
    pub fn config(&self) -> &StudyConfig {
        &self.config
    }

    /// A remark about a field of the study, with its file and line.
    #[must_use]
    pub fn warning(&self, field: &str, what: &str) -> String {
        format!("{}:{}: {field}: warning: {what}", self.name, self.line_of(field))
    }

    /// A complaint about a field of the study, with its file and line.
    #[must_use]
    pub fn complaint(&self, invalid: &Invalid) -> String {
        format!("{}:{}", self.name, self.located(invalid))
    }

    /// A complaint about a field of the study, with its line but without its file.
    #[must_use]
    pub fn located(&self, invalid: &Invalid) -> Complaint {
        located(&self.text, invalid)
    }
}

/// A complaint with the line of its field.
fn located(text: &str, invalid: &Invalid) -> Complaint {
    let line = TomlLines::parse(text).map_or(1, |lines| lines.line_of(&invalid.field));
    Complaint { line, field: Some(invalid.field.clone()), what: invalid.to_string() }
}

/// Reads a study from a text without validating it.
///
/// # Errors
/// [`Complaint`] if the text is not TOML, or a field does not have the expected type.
pub fn read_unchecked(text: &str) -> Result<StudyConfig, Complaint> {
    let whole = |what: &str| Complaint { line: 1, field: None, what: one_line(what) };
    let lines = TomlLines::parse(text)?;
    let located = |invalid: Invalid| located(text, &invalid);
    if let Some(leaf) = lines.too_large() {
        let expected = "a whole number from -9223372036854775808 to 9223372036854775807";
        let invalid = Invalid::new(leaf.key, expected, "a number outside that range");
        let field = Some(invalid.field.clone());
        return Err(Complaint { line: leaf.line, field, what: invalid.to_string() });
    }
    let given: Table = toml::from_str(text).map_err(|error| whole(error.message()))?;
    if !given.contains_key("slug") {
        // With a default slug, all files without a slug would describe the same study.
        let expected = "the study's name in addresses, a line such as slug = \"avoidance-2026\"";
        return Err(located(Invalid::new("slug", expected, "none")));
    }
    let mut table = Table::try_from(StudyConfig::default()).map_err(|e| whole(&e.to_string()))?;
    lay_over(&mut table, given);
    StudyConfig::deserialize(Value::Table(table.clone())).or_else(|error| {
        let document = serde_json::to_value(table).map_err(|e| whole(&e.to_string()))?;
        match from_value::<StudyConfig>(&document) {
            Err(invalid) => Err(located(explained(invalid, &tables::<StudyConfig>()))),
            // The document is valid as JSON but not as TOML. TOML has numbers and dates that JSON
            // does not support.
            Ok(_) => {
                let what = one_line(&error.to_string());
                Err(Complaint { line: lines.line_of(""), field: None, what })
            }
        }
    })
}

fn parse(text: &str) -> Result<StudyConfig, Complaint> {
    let study = read_unchecked(text)?;
    let located = |invalid: Invalid| located(text, &invalid);
    study.check().map_err(located)?;
    study.check_plausible().map_err(located)?;
    // A study without scenes would start, but enrol no participants.
    study.stratified(0).map_err(|mut invalid| {
        let usual = StudyConfig { encounters: EncounterRange::default(), ..study.clone() };
        if invalid.field == "parameters" && usual.stratified(0).is_ok() {
            "encounters".clone_into(&mut invalid.field);
        }
        located(invalid)
    })?;
    Ok(study)
}

/// Writes a study file for this configuration. It contains only the differences from the paper's
/// protocol.
///
/// # Errors
/// If TOML cannot express a value of the configuration.
pub fn written(config: &StudyConfig) -> Result<String, toml::ser::Error> {
    let mut table = Table::try_from(config)?;
    take_away(&mut table, &Table::try_from(StudyConfig::default())?);
    // The slug and the title come first, and are written even if they equal the slug and title of the
    // paper's study.
    let mut head = Table::new();
    for (name, value) in [("slug", &config.slug), ("title", &config.title)] {
        table.remove(name);
        head.insert(name.to_owned(), Value::String(value.clone()));
    }
    let (head, rest) = (toml::to_string(&head)?, toml::to_string_pretty(&table)?);
    Ok(if rest.starts_with('[') { head + "\n" + &rest } else { head + &rest })
}

/// Removes entries that are equal in both tables, at any depth.
fn take_away(from: &mut Table, same: &Table) {
    from.retain(|key, value| match (value, same.get(key)) {
        (Value::Table(value), Some(Value::Table(same))) => {
            take_away(value, same);
            !value.is_empty()
        }
        (value, same) => same != Some(value),
    });
}

/// Merges `above` into `below`, table by table. Values other than tables are replaced.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_says_only_what_differs() {
        let named = |slug: &str| StudyConfig { slug: slug.to_owned(), ..StudyConfig::default() };
        assert_eq!(parse("slug = \"a\"").unwrap(), named("a"));
        let study = parse("slug = \"pilot\"\n[parameters.human]\nspeed_mps = 1.5\n").unwrap();
        assert_eq!(study.slug, "pilot");
        assert_eq!(study.parameters.human.speed_mps, 1.5);
        assert_eq!(study.parameters.human.turn_rate_radps, 0.5);
        let study = parse("slug = \"a\"\nphases = [{ phase = \"task\", scenes = 2 }]").unwrap();
        assert_eq!(study.phases.len(), 1);
    }

    #[test]
    fn what_is_written_says_the_same_study() {
        let guide = include_str!("../../../docs/study.md");
        let (_, guide) = guide.split_once("```toml\n").unwrap();
        let (guide, _) = guide.split_once("```").unwrap();
        let changed = "slug = \"b\"\ntitle = \"Ünequal \\\"robots\\\"\"\nstatus = \"closed\"\n\
                       phases = [{ phase = \"task\", scenes = 2 }]\n\
                       [parameters.human]\nspeed_mps = 1.5\n\
                       [texts.en]\n\"stuck.full\" = \"Full.\"\n";
        for text in ["slug = \"a\"", changed, guide] {
            let study = parse(text).unwrap();
            let again = written(&study).unwrap();
            assert!(again.starts_with("slug = "), "{again}");
            assert_eq!(parse(&again).unwrap(), study, "{again}");
        }
        let short = written(&parse("slug = \"a\"\ntitle = \"A\"").unwrap()).unwrap();
        assert_eq!(short, "slug = \"a\"\ntitle = \"A\"\n");
    }

    #[test]
    fn complaints_name_line_and_field() {
        let check = |line: usize, text: &str, words: &[&str]| {
            let complaint = parse(text).unwrap_err().to_string();
            assert!(!complaint.contains('\n'), "{complaint}");
            assert!(complaint.starts_with(&format!("{line}: ")), "{complaint}");
            for word in words {
                assert!(complaint.contains(word), "{complaint}");
            }
        };
        check(2, "slug = \"a\"\nslug = ", &["TOML"]);
        check(1, "title = \"A\"", &["slug", "slug = \"avoidance-2026\"", "none"]);
        check(1, "slug = 7", &["slug", "string"]);
        check(1, "slug = \"Pilot 2\"", &["slug", "lower-case", "Pilot 2"]);
        // Checks a text after the line of the slug.
        let after = |line: usize, text: &str, words: &[&str]| {
            check(line, &format!("slug = \"a\"\n{text}"), words);
        };
        after(3, "\ncolour = 1", &["colour"]);
        after(3, "[parameters.human]\nspeed_mps = -2.0", &["parameters.human.speed_mps"]);
        after(2, "parameters = 3", &["parameters: expected an object, {…}, found 3"]);
        after(2, "phases = [{ phase = \"nap\", scenes = 2 }]", &["phases[0].phase"]);
        let phases = "[[phases]]\nphase = \"practice\"\nscenes = 1\n\n[[phases]]\n\
                      phase = \"task\"\nscenes = 0";
        after(8, phases, &["phases[1].scenes", "found 0"]);
        let question = "[[questions]]\nname = \"age\"\nkind = \"scale\"\nfrom = 9\n\
                        text = { en = \"How old?\" }";
        after(2, question, &["questions[0].to"]);
        after(3, "[texts.en]\n\"a.b\" = 4", &["texts.en.a.b"]);
        // Likely mistakes. The complaint gives the reason.
        after(3, "[parameters.human]\nturn_rate_radps = 28.6", &["rad/s", "as degrees"]);
        after(3, "[parameters]\nsteps = 5", &["steps", "a scene of 1 s"]);
        after(3, "[recruitment]\nquota = 18446744073709551615", &["recruitment.quota", "range"]);
        let large = "phases = [\n{ phase = \"task\",\nscenes = 99999999999999999999 }]";
        after(4, large, &["phases[0].scenes", "9223372036854775807"]);
        after(2, "seed = 4294967296", &["seed", "0 to 4294967295", "found 4294967296"]);
        after(3, "[trials]\ncountdown_s = 3.0", &["trials.countdown_s", "whole", "found 3.0"]);
        // Settings that would have no effect or would be misleading.
        let question =
            |rest: &str| format!("[[questions]]\nname = \"q\"\ntext = {{ en = \"Q\" }}\n{rest}");
        after(6, &question("kind = \"text\"\nfrom = 2"), &["questions[0].from", "scale"]);
        after(6, &question("kind = \"scale\"\nmax_chars = 9"), &["questions[0].max_chars"]);
        let least = question("kind = \"scale\"\nfrom = -9223372036854775808");
        after(6, &least, &["questions[0].from", "-1000 to 1000"]);
        let equal = "kind = \"choice\"\noptions = [{ value = \"a\", text = { en = \"A\" } },\n\
                     { value = \"b\", text = { en = \" A\" } }]";
        after(7, &question(equal), &["questions[0].options[1].text.en", "a text that differs"]);
        after(
            4,
            "[[questions]]\nname = \"q\"\ntext = { en = \"{zzz}?\" }\nkind = \"text\"",
            &["questions[0].text.en", "{zzz}"],
        );
        let check = "[[comprehension.questions]]\ntext = { en = \"{radius}?\" }\nanswer = 0\n\
                     options = [{ en = \"1\" }, { en = \"1 \" }]";
        after(5, check, &["comprehension.questions[0].options[1].en", "a text that differs"]);
        // Settings for which no scene is admissible.
        let none = "[encounters]\nmin_start_distance_m = 900.0\nmax_start_distance_m = 1000.0";
        after(2, none, &["encounters: "]);
        after(2, "[parameters]\ndanger_radius_m = 30.0", &["danger radius", "duration"]);
    }

    #[test]
    fn a_file_complains_about_what_is_found_later() {
        let folder = tempfile::TempDir::new().unwrap();
        let path = folder.path().join("study.toml");
        std::fs::write(&path, "slug = \"a\"\nlanguages = [\n  \"en\",\n  \"xx\",\n]\n").unwrap();
        let file = StudyFile::read(&path).unwrap();
        let said = file.complaint(&Invalid::new("languages[1]", "en", "xx"));
        assert!(said.ends_with("study.toml:4: languages[1]: expected en, found xx"), "{said}");
    }
}
