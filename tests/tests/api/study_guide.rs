//! The guide to study files. Its examples and the README's example are valid, its complete file has
//! every field, and its tables name every field.

use serde_json::Value;
use sidestep::study::StudyConfig;
use sidestep_server::formats::study_toml::StudyFile;
use sidestep_server::languages::Languages;
use sidestep_tests::Folder;
use std::collections::BTreeSet;
use std::path::Path;

const GUIDE: &str = include_str!("../../../docs/study.md");
const README: &str = include_str!("../../../README.md");
const SETTINGS: &str = include_str!("../../../web-client/src/pages/lab/configuration/settings.rs");

/// Fields that the form shows with controls of their own, or not at all (`texts`).
const NO_SETTINGS: [&str; 6] =
    ["languages", "phases", "robots", "questions", "comprehension.questions", "texts"];

/// The study files in a document.
fn examples(document: &'static str) -> Vec<&'static str> {
    let blocks = document.split("```toml\n").skip(1);
    blocks.map(|rest| rest.split_once("```").unwrap().0).collect()
}

/// Adds the paths of all fields below a value, such as `.questions.options.text`.
fn add_fields(value: &Value, above: &str, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(object) => {
            for (name, value) in object {
                let path = format!("{above}.{name}");
                add_fields(value, &path, found);
                found.insert(path);
            }
        }
        Value::Array(items) => items.iter().for_each(|item| add_fields(item, above, found)),
        _ => {}
    }
}

fn fields(value: &Value) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    add_fields(value, "", &mut found);
    found
}

#[test]
fn study_files_in_documents_are_valid() {
    let folder = Folder::default();
    let languages = Languages::load(None).unwrap();
    assert_eq!([GUIDE, README].map(|document| examples(document).len()), [2, 1]);
    for text in [GUIDE, README].into_iter().flat_map(examples) {
        let path = folder.file("study.toml", text);
        let file = StudyFile::read(Path::new(&path)).unwrap();
        languages.check(file.config()).unwrap();
    }
}

#[test]
fn its_whole_file_has_every_field_and_its_tables_name_them() {
    let is_whole = |text: &&str| text.starts_with("# A whole study file");
    let text = examples(GUIDE).into_iter().find(is_whole).unwrap();
    let folder = Folder::default();
    let path = folder.file("study.toml", text);
    let file = StudyFile::read(Path::new(&path)).unwrap();
    // A parsed configuration has all fields, including those that the file does not give.
    let wanted = fields(&serde_json::to_value(file.config()).unwrap());
    let given = fields(&toml::from_str::<Value>(text).unwrap());
    let missing: Vec<_> = wanted.difference(&given).collect();
    assert!(missing.is_empty(), "the whole file lacks {missing:?}");

    let (_, rest) = GUIDE.split_once("## Every field").unwrap();
    let (section, _) = rest.split_once("\n## ").unwrap();
    let is_other = |c: char| !(c.is_ascii_alphanumeric() || c == '_');
    let code = section.split('`').skip(1).step_by(2);
    let named: BTreeSet<&str> = code.flat_map(|code| code.split(is_other)).collect();
    for path in wanted.iter().filter(|path| !path.starts_with(".texts.")) {
        let name = path.rsplit('.').next().unwrap();
        let is_language = file.config().languages.iter().any(|tag| tag == name);
        assert!(is_language || named.contains(name), "no table of the guide names {path}");
    }
}

/// The paths of all numbers in a value, as JSON pointers.
fn add_numbers(value: &Value, above: &str, found: &mut Vec<String>) {
    match value {
        Value::Number(_) => found.push(above.to_owned()),
        Value::Object(object) => {
            object
                .iter()
                .for_each(|(name, value)| add_numbers(value, &format!("{above}/{name}"), found));
        }
        Value::Array(items) => {
            let items = items.iter().enumerate();
            items.for_each(|(i, value)| add_numbers(value, &format!("{above}/{i}"), found));
        }
        _ => {}
    }
}

/// No number of a study is unlimited: the check or the parser refuses at least one of two very large
/// values, and names the field.
#[test]
fn every_number_has_a_range() {
    let is_whole = |text: &&str| text.starts_with("# A whole study file");
    let text = examples(GUIDE).into_iter().find(is_whole).unwrap();
    let folder = Folder::default();
    let file = StudyFile::read(Path::new(&folder.file("study.toml", text))).unwrap();
    let whole = serde_json::to_value(file.config()).unwrap();
    let mut numbers = Vec::new();
    add_numbers(&whole, "", &mut numbers);
    assert!(numbers.len() > 20, "{numbers:?}");
    for pointer in numbers {
        let name = pointer.rsplit('/').find(|part| part.parse::<usize>().is_err()).unwrap();
        let is_refused = [-1e12, 1e12].into_iter().any(|number| {
            let mut changed = whole.clone();
            *changed.pointer_mut(&pointer).unwrap() =
                match whole.pointer(&pointer).unwrap().is_f64() {
                    true => number.into(),
                    false => (number as i64).into(),
                };
            match serde_json::from_value::<StudyConfig>(changed) {
                Ok(config) => config.check().is_err_and(|error| error.field.contains(name)),
                Err(_) => true,
            }
        });
        assert!(is_refused, "{pointer} has no range in StudyConfig::check");
    }
}

#[test]
fn the_form_has_every_setting() {
    let is_whole = |text: &&str| text.starts_with("# A whole study file");
    let text = examples(GUIDE).into_iter().find(is_whole).unwrap();
    let folder = Folder::default();
    let file = StudyFile::read(Path::new(&folder.file("study.toml", text))).unwrap();
    let all = fields(&serde_json::to_value(file.config()).unwrap());
    let mut known = Vec::new();
    for path in all.iter().map(|path| path.trim_start_matches('.')) {
        let is_row = |path: &str| SETTINGS.contains(&format!("row(\"{path}\","));
        let has_children = all.iter().any(|other| other.starts_with(&format!(".{path}.")));
        let parent = path.rsplit_once('.').map_or("", |(parent, _)| parent);
        let is_other = NO_SETTINGS.iter().any(|of| path.starts_with(of));
        let is_known = is_row(path) || is_row(parent) || has_children || is_other;
        assert!(is_known, "expected a row of {path} in configuration/settings.rs, found none");
        known.extend(is_row(path).then(|| path.to_owned()));
    }
    let rows = SETTINGS.matches("row(\"").count();
    assert_eq!(known.len(), rows, "rows without a field of a study: {known:?}");
}
