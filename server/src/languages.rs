//! The texts that participants read in each language: the sentences of the page, from language
//! files, and the texts of the study.

pub mod sentences;
pub mod markdown;
pub mod page;
pub mod library;

use self::sentences::Sentences;
use crate::formats::study_toml::StudyFile;
use crate::formats::toml_lines::Complaint;
use sidestep::invalid::Invalid;
use sidestep::study::{Localised, StudyConfig, closest_language};
use std::path::{Path, PathBuf};

/// The built-in languages by tag, English first. To add a language, add its file and a line here.
pub const BUILT_IN: &[(&str, &str)] = &[
    ("en", include_str!("../../static/languages/en.toml")),
    ("de", include_str!("../../static/languages/de.toml")),
    ("es", include_str!("../../static/languages/es.toml")),
    ("zh-CN", include_str!("../../static/languages/zh-CN.toml")),
];

/// All languages of the server.
#[derive(Clone, Debug)]
pub struct Languages {
    /// Tags and sentences, English first.
    all: Vec<(String, Sentences)>,
}

impl Languages {
    /// The built-in languages, changed and extended by the files `TAG.toml` of a folder. The file of a
    /// known language replaces some of its sentences. The file of a new language must be complete.
    ///
    /// # Errors
    /// One line naming the file and the line or sentence, with the expected and the found value.
    pub fn load(folder: Option<&Path>) -> Result<Self, String> {
        let mut all = Vec::new();
        for (tag, text) in BUILT_IN {
            let name = format!("{tag}.toml");
            let read = Sentences::read(text).map_err(|complaint| format!("{name}:{complaint}"))?;
            all.push(((*tag).to_owned(), read));
        }
        let mut languages = Self { all };
        for (tag, file) in folder.map(files).transpose()?.unwrap_or_default() {
            languages.add(&tag, &file)?;
        }
        let english = languages.english().clone();
        for (tag, sentences) in &languages.all {
            sentences.check_against(&english).map_err(|what| format!("{tag}.toml: {what}"))?;
        }
        Ok(languages)
    }

    /// Replaces sentences of a language with the sentences of a file, or adds a new language.
    fn add(&mut self, tag: &str, file: &Path) -> Result<(), String> {
        let name = file.display();
        let text = std::fs::read_to_string(file)
            .map_err(|error| format!("{name}: cannot read the language file: {error}"))?;
        let given = Sentences::read(&text).map_err(|complaint| format!("{name}:{complaint}"))?;
        let english = self.english().clone();
        let known = self.all.iter().position(|(known, _)| known == tag);
        let mut whole = known.map(|at| self.all[at].1.clone()).unwrap_or_default();
        whole.lay_over(given);
        whole.check_against(&english).map_err(|what| format!("{name}: {what}"))?;
        match known {
            Some(at) => self.all[at].1 = whole,
            None => self.all.push((tag.to_owned(), whole)),
        }
        Ok(())
    }

    /// The English sentences, which define the sentences that every language must have.
    fn english(&self) -> &Sentences {
        &self.all[0].1
    }

    fn get(&self, tag: &str) -> Option<&Sentences> {
        self.all.iter().find(|(known, _)| known == tag).map(|(_, sentences)| sentences)
    }

    /// The tags of all languages, English first.
    pub fn tags(&self) -> impl Iterator<Item = &str> + Clone {
        self.all.iter().map(|(tag, _)| tag.as_str())
    }

    /// Accepts a study if its languages exist, and if each of its own sentences replaces an existing
    /// sentence.
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn check(&self, study: &StudyConfig) -> Result<(), Invalid> {
        let tags = || self.tags().collect::<Vec<_>>().join(", ");
        for (i, tag) in study.languages.iter().enumerate() {
            if self.get(tag).is_none() {
                let expected = format!(
                    "one of {}; serve a file {tag}.toml with --languages to add it",
                    tags()
                );
                return Err(Invalid::new(format!("languages[{i}]"), expected, tag));
            }
        }
        for (tag, changes) in &study.texts {
            let field = format!("texts.{tag}");
            let Some(known) = self.get(tag) else {
                return Err(Invalid::new(field, format!("one of {}", tags()), tag));
            };
            for (key, text) in changes {
                known.check_change(key, text).map_err(|error| error.within(&field))?;
            }
        }
        Ok(())
    }

    /// Reads and checks a study file for these languages. Every command that takes a study file uses this
    /// function. Prints warnings about forgotten fields and missing translations to stderr.
    ///
    /// # Errors
    /// One line naming the file, the line and the field, with the expected and the found value.
    pub fn read_study(&self, path: &Path) -> Result<StudyFile, String> {
        let file = StudyFile::read(path)?;
        if let Some(remark) = file.encoding_remark() {
            eprintln!("{remark}");
        }
        self.check(file.config()).map_err(|invalid| file.complaint(&invalid))?;
        for (field, what) in self.remarks(file.config()) {
            eprintln!("{}", file.warning(&field, &what));
        }
        Ok(file)
    }

    /// Like [`Self::read_study`], for a text that a user is editing. Also returns the warnings,
    /// with their lines.
    ///
    /// # Errors
    /// [`Complaint`] naming the line and the field, with the expected and the found value.
    pub fn read_draft(&self, text: &str) -> Result<(StudyFile, Vec<Complaint>), Complaint> {
        let file = StudyFile::of("draft".to_owned(), text.to_owned())?;
        self.check(file.config()).map_err(|invalid| file.located(&invalid))?;
        let remark = |(field, what): (String, String)| Complaint {
            line: file.line_of(&field),
            what: format!("{field}: {what}"),
            field: Some(field),
        };
        let remarks = self.remarks(file.config()).into_iter().map(remark).collect();
        Ok((file, remarks))
    }

    /// Warnings about a valid study, each with the field and the consequence. Forgotten fields come
    /// first, because there can be many missing translations.
    fn remarks(&self, study: &StudyConfig) -> Vec<(String, String)> {
        let forgotten = study.forgotten().into_iter();
        let forgotten = forgotten.map(|(field, what)| (field.to_owned(), what));
        forgotten.chain(self.untranslated(study)).collect()
    }

    /// The texts of a study that are missing in a language that it offers. Each has the field, and
    /// a sentence about the text that participants read instead.
    fn untranslated(&self, study: &StudyConfig) -> Vec<(String, String)> {
        let offered = self.offered(study);
        let first = offered.first().copied().unwrap_or("en");
        let mut found = Vec::new();
        for (field, text) in study.localised().into_iter().filter(|(_, text)| !text.is_empty()) {
            let there = || text.0.keys().map(String::as_str);
            let missing: Vec<_> = offered
                .iter()
                .copied()
                .filter(|language| closest_language(there(), language).is_none())
                .collect();
            if missing.is_empty() {
                continue;
            }
            let shown =
                closest_language(there(), first).or_else(|| there().next()).unwrap_or(first);
            let what = format!(
                "no text in {}, which the study offers; participants who read {} see the text in \
                 {shown}",
                missing.join(", "),
                if missing.len() == 1 { "it" } else { "these" },
            );
            found.push((field, what));
        }
        found
    }

    /// The languages that participants can choose in a study. These are the languages that the study
    /// names. If it names none, these are the languages in which all of its texts exist. A named
    /// language that no longer exists is ignored.
    #[must_use]
    pub fn offered<'a>(&'a self, study: &'a StudyConfig) -> Vec<&'a str> {
        let wanted = study.languages.iter().map(String::as_str);
        let there: Vec<_> = wanted.filter(|tag| self.get(tag).is_some()).collect();
        if !there.is_empty() {
            return there;
        }
        // If the texts have no language in common, only the first text counts. This is the consent
        // text, if any.
        let texts = study.localised();
        let texts: Vec<_> = texts.iter().map(|(_, text)| *text).filter(|t| !t.is_empty()).collect();
        let with_all_of = |texts: &[&Localised]| -> Vec<&'a str> {
            let is_in = |text: &&Localised, tag: &str| {
                closest_language(text.0.keys().map(String::as_str), tag).is_some()
            };
            self.tags().filter(|tag| texts.iter().all(|text| is_in(text, tag))).collect()
        };
        let shared = [&texts[..], &texts[..texts.len().min(1)]].map(with_all_of);
        let shared = shared.into_iter().find(|tags| !tags.is_empty());
        shared.unwrap_or_else(|| self.tags().take(1).collect())
    }
}

/// The language files of a folder, with their tags.
fn files(folder: &Path) -> Result<Vec<(String, PathBuf)>, String> {
    let unread = |error: std::io::Error| {
        format!("--languages {}: cannot read the folder: {error}", folder.display())
    };
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unread)? {
        let file = entry.map_err(unread)?.path();
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        // Editors write such files beside the edited file.
        if name.starts_with(['.', '#']) || name.ends_with(['~', '#']) {
            continue;
        }
        let Some((tag, ending)) = name.rsplit_once('.') else { continue };
        if !ending.eq_ignore_ascii_case("toml") {
            continue;
        }
        if !sidestep::study::is_language(tag) {
            let file = file.display();
            return Err(format!(
                "{file}: expected a file with the name of a language, such as de.toml or \
                 zh-CN.toml, found {name}"
            ));
        }
        found.push((canonical(tag), file));
    }
    if found.is_empty() {
        let folder = folder.display();
        return Err(format!("--languages {folder}: expected files such as de.toml, found none"));
    }
    found.sort();
    if let Some(pair) = found.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        let (tag, first, second) = (&pair[0].0, pair[0].1.display(), pair[1].1.display());
        return Err(format!("{second}: expected one file for {tag}, found {first} too"));
    }
    Ok(found)
}

/// A language tag with the capitalisation that BCP 47 recommends: `zh-CN`, `sr-Latn-RS`.
fn canonical(tag: &str) -> String {
    let part = |(i, part): (usize, &str)| match (i, part.len()) {
        (1.., 2) => part.to_ascii_uppercase(),
        (1.., 4) if part.starts_with(|c: char| c.is_ascii_alphabetic()) => {
            part[..1].to_ascii_uppercase() + &part[1..].to_ascii_lowercase()
        }
        _ => part.to_ascii_lowercase(),
    };
    tag.split('-').enumerate().map(part).collect::<Vec<_>>().join("-")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(files: &[(&str, &str)]) -> Result<Languages, String> {
        let folder = tempfile::TempDir::new().unwrap();
        for (name, text) in files {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        Languages::load(Some(folder.path()))
    }

    /// The English file, with some parts replaced.
    fn english_but(changes: &[(&str, &str)]) -> String {
        changes.iter().fold(BUILT_IN[0].1.to_owned(), |text, (from, to)| {
            assert!(text.contains(from), "{from}");
            text.replacen(from, to, 1)
        })
    }

    #[test]
    fn built_in_languages_are_complete() {
        let languages = Languages::load(None).unwrap();
        assert_eq!(languages.tags().next(), Some("en"));
        for tag in languages.tags() {
            let name = languages.get(tag).unwrap().get("language.name").unwrap();
            assert!(!name.is_empty(), "{tag}");
        }
        // Chinese has one form for all numbers.
        let english = languages.get("en").unwrap();
        for tag in languages.tags().filter(|tag| !tag.starts_with("zh")) {
            for (key, _) in english.iter().filter(|(key, _)| key.ends_with(".one")) {
                let found = languages.get(tag).unwrap().get(key);
                assert!(found.is_some(), "{tag}.toml lacks the form {key}");
            }
        }
    }

    #[test]
    fn a_folder_changes_and_adds_languages() {
        let changed = "[language]\nname = \"Plain English\"\n";
        let french = english_but(&[("\"English\"", "\"Français\"")]);
        let languages = with(&[("en.toml", changed), ("fr.toml", &french)]).unwrap();
        let name = |tag: &str| languages.get(tag).unwrap().get("language.name");
        assert_eq!((name("en"), name("fr")), (Some("Plain English"), Some("Français")));
        let mut study = StudyConfig { languages: vec!["fr".into()], ..StudyConfig::default() };
        assert_eq!(languages.check(&study), Ok(()));
        assert_eq!(languages.offered(&study), ["fr"]);
        study.languages = vec!["en".into(), "pt".into()];
        assert_eq!(languages.check(&study).unwrap_err().field, "languages[1]");
        assert_eq!(languages.offered(&study), ["en"]);
    }

    #[test]
    fn file_names_are_read_as_tags_in_any_letters() {
        let name = |text: &str| format!("[language]\nname = \"{text}\"\n");
        let (chinese, german) = (name("Chinese"), name("German"));
        let files = [("zh-cn.TOML", &*chinese), ("DE.toml", &german), (".#de.toml", "?")];
        let languages = with(&files).unwrap();
        assert_eq!(languages.tags().collect::<Vec<_>>(), ["en", "de", "es", "zh-CN"]);
        let found = |tag: &str| languages.get(tag).unwrap().get("language.name");
        assert_eq!((found("zh-CN"), found("de")), (Some("Chinese"), Some("German")));
        assert_eq!(canonical("SR-latn-rs"), "sr-Latn-RS");
        let said = with(&[("EN.toml", ""), ("en.toml", "")]).unwrap_err();
        assert!(said.contains("EN.toml") && said.contains("en.toml"), "{said}");
    }

    #[test]
    fn a_study_offers_the_languages_of_its_texts() {
        let languages = Languages::load(None).unwrap();
        let mut study = StudyConfig::default();
        assert_eq!(languages.offered(&study), ["en", "de", "es", "zh-CN"]);
        study.consent.investigator = "Ada Example".into();
        assert_eq!(languages.offered(&study).len(), 4, "one text for everybody");
        study.consent.text = Localised::of("en", "Hello");
        assert_eq!(languages.offered(&study), ["en"]);
        study.consent.text.0.insert("zh".into(), "你好".into());
        study.consent.text.0.insert("de".into(), "Hallo".into());
        assert_eq!(languages.offered(&study), ["en", "de", "zh-CN"]);
        study.closing.debrief = Localised::of("de-AT", "Danke");
        assert_eq!(languages.offered(&study), ["de"]);
        assert_eq!(languages.untranslated(&study), []);
        // No language has both texts, so the consent text decides which languages are offered, and
        // missing texts are reported.
        study.closing.debrief = Localised::of("es", "Gracias");
        assert_eq!(languages.offered(&study), ["en", "de", "zh-CN"]);
        assert_eq!(languages.untranslated(&study)[0].0, "closing.debrief");
        study.consent.text = Localised::of("fr", "Bonjour");
        assert_eq!(languages.offered(&study), ["en"]);
        // A study that names its languages offers these languages.
        study.languages = vec!["es".into()];
        assert_eq!(languages.offered(&study), ["es"]);
        assert_eq!(languages.untranslated(&study)[0].0, "consent.text");
        let consent = languages.texts(&study, "es").consent.unwrap();
        assert!(consent.starts_with("<div lang=\"fr\"><p>Bonjour"), "{consent}");
        study.consent.text = Localised::of("es", "Hola");
        assert!(!languages.texts(&study, "es").consent.unwrap().contains("lang="));
    }

    #[test]
    fn missing_translations_are_named() {
        let languages = Languages::load(None).unwrap();
        let mut study = StudyConfig {
            languages: vec!["en".into(), "de".into(), "es".into()],
            ..StudyConfig::default()
        };
        assert_eq!(languages.untranslated(&study), []);
        study.closing.debrief = Localised::of("en", "Thank you");
        let found = languages.untranslated(&study);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].0, "closing.debrief");
        assert!(found[0].1.starts_with("no text in de, es,"), "{found:?}");
    }

    #[test]
    fn complaints_name_file_and_sentence() {
        let check = |files: &[(&str, &str)], words: &[&str]| {
            let said = with(files).unwrap_err();
            assert!(words.iter().all(|word| said.contains(word)), "{said}");
        };
        check(&[], &["--languages", "de.toml"]);
        check(&[("english.toml", "")], &["english.toml", "zh-CN.toml"]);
        check(&[("fr.toml", "[language]\nname = \"Français\"")], &["fr.toml: ", "as in English"]);
        check(&[("en.toml", "\n[language]\nname = 3")], &["en.toml:3: language.name", "text"]);
        check(&[("en.toml", "[language]\nnom = \"x\"")], &["en.toml: language.nom", "no such"]);
        check(&[("en.toml", "[language]\nname = \"\"")], &["en.toml: language.name", "a text"]);
        check(&[("en.toml", "[language")], &["en.toml:1: expected TOML"]);
    }

    #[test]
    fn a_study_changes_sentences_that_exist() {
        let languages = Languages::load(None).unwrap();
        let complain = |tag: &str, key: &str, text: &str| {
            let mut study = StudyConfig::default();
            let changes = [(key.to_owned(), text.to_owned())].into();
            study.texts.insert(tag.to_owned(), changes);
            languages.check(&study).map_err(|error| error.field)
        };
        assert_eq!(complain("en", "check_robot.text", "Will it?"), Ok(()));
        let field = |text: &str| Err(text.to_owned());
        assert_eq!(complain("en", "check_robot.txt", "x"), field("texts.en.check_robot.txt"));
        assert_eq!(complain("en", "check_robot.text", "{x}?"), field("texts.en.check_robot.text"));
        assert_eq!(complain("pt", "check_robot.text", "x"), field("texts.pt"));
    }
}
