//! Everything that a participant of a study reads, in one language.

use super::Languages;
use super::markdown::html_of;
use sha2::{Digest, Sha256};
use sidestep::api::{CheckForm, Language, Object, QuestionForm, Texts};
use sidestep::math::SeededRng;
use sidestep::scene::RobotPolicy;
use sidestep::study::{Comprehension, Localised, Question, StudyConfig, closest_language};
use std::collections::BTreeMap;

/// Sidestep's own questions of the comprehension check. Their sentences are `check_NAME.text`,
/// `.right`, `.wrong_1` and `.wrong_2`. A study that draws no questions asks the first three.
const STANDARD: [&str; 6] = ["robot", "straight", "zone", "both", "stop", "when"];
const ASKED_OF_ALL: usize = 3;

impl Languages {
    /// The texts of a study in a language that it offers.
    #[must_use]
    pub fn texts(&self, study: &StudyConfig, language: &str) -> Texts {
        let mut sentences = Object::default();
        // Ignore a study file's changes to sentences that this version no longer has.
        let known = self.get(language);
        for (key, text) in known.into_iter().flat_map(|known| known.iter()) {
            sentences.insert(key.to_owned(), text.to_owned());
        }
        let robots = about_robots(study);
        for (key, about) in &robots {
            if let Some(text) = sentences.get(about).cloned() {
                sentences.insert((*key).to_owned(), text);
            }
        }
        for (key, text) in study.texts.get(language).into_iter().flatten() {
            if known.is_some_and(|known| known.check_change(key, text).is_ok()) {
                let about = robots.iter().find(|(_, about)| about == key);
                let key = about.map_or(&**key, |(key, _)| key);
                sentences.insert(key.to_owned(), text.clone());
            }
        }
        let fallback = study.first_language();
        let html = |text: &Localised| {
            let (tag, text) = text.find(language, fallback)?;
            let html = html_of(text);
            // Mark a text in another language for screen readers.
            let is_same = closest_language([tag].into_iter(), language).is_some();
            Some(if is_same { html } else { format!("<div lang=\"{tag}\">{html}</div>") })
        };
        let check = check(study, language, &sentences);
        // Leave out the sentences of Sidestep's own questions, because they are already in the
        // check, and the sentences about robots, because they have replaced others.
        let is_elsewhere = |key: &str| {
            key.starts_with(ROBOTS) || STANDARD.iter().any(|name| key.starts_with(&prefix(name)))
        };
        let said = sentences.iter().filter(|(key, _)| !is_elsewhere(key));
        let sentences = said.map(|(key, text)| (key.to_owned(), text.clone())).collect();
        let mut offered = self.offered(study);
        // If the study does not offer `language`, a participant has begun in it, so offer it too.
        if !offered.contains(&language) {
            offered.push(language);
        }
        let offered = offered
            .into_iter()
            .map(|tag| Language { tag: tag.to_owned(), name: self.name(study, tag).to_owned() });
        let facts = study.consent.facts().map(|(name, fact)| (name, fact.get(language, fallback)));
        let facts = facts.into_iter().filter(|(_, text)| !text.trim().is_empty());
        Texts {
            language: language.to_owned(),
            offered: offered.collect(),
            sentences,
            consent: html(&study.consent.text),
            facts: facts.map(|(name, text)| (name.to_owned(), text.to_owned())).collect(),
            check,
            questions: study.questions.iter().map(|q| form(q, language, fallback)).collect(),
            debrief: html(&study.closing.debrief),
        }
    }

    /// The name of a language in the language itself, such as Deutsch.
    fn name<'a>(&'a self, study: &'a StudyConfig, tag: &'a str) -> &'a str {
        let key = "language.name";
        let own = study.texts.get(tag).and_then(|texts| texts.get(key)).map(String::as_str);
        own.or_else(|| self.get(tag)?.get(key)).unwrap_or(tag)
    }
}

/// The table of the sentences about robots that do more than drive straight.
const ROBOTS: &str = "robots.";

/// The sentences that the study's robots replace, each with the sentence that replaces it. All
/// robots of a study share their sentences, so that these do not reveal which robot comes next.
fn about_robots(study: &StudyConfig) -> Vec<(&'static str, &'static str)> {
    let reacts = study.robots.iter().any(RobotPolicy::reacts);
    let right = if reacts { "robots.right_react" } else { "robots.right_turn" };
    let turn = [
        ("instructions.robot", "robots.turn"),
        ("instructions.when", "robots.when"),
        ("check_robot.right", right),
    ];
    let react = [("instructions.robot_why", "robots.react")];
    let turn = turn.into_iter().filter(|_| study.robots_turn());
    turn.chain(react.into_iter().filter(|_| reacts)).collect()
}

fn prefix(name: &str) -> String {
    format!("check_{name}.")
}

/// All questions of the comprehension check: Sidestep's own, followed by the study's.
fn check(study: &StudyConfig, language: &str, sentences: &Object<String>) -> Vec<CheckForm> {
    let count = if study.comprehension.draw > 0 { STANDARD.len() } else { ASKED_OF_ALL };
    let standard = (0..).zip(STANDARD).take(count).map(|(i, name)| {
        let sentence = |part: &str| {
            sentences.get(&format!("{}{part}", prefix(name))).cloned().unwrap_or_default()
        };
        let mut options = vec![sentence("wrong_1"), sentence("wrong_2")];
        // The place of the right answer rotates: second, first, third.
        let answer = [1, 0, 2][i % 3];
        options.insert(answer, sentence("right"));
        CheckForm { text: sentence("text"), options, answer }
    });
    let fallback = study.first_language();
    let own = study.comprehension.questions.iter().map(|question| CheckForm {
        text: question.text.get(language, fallback).to_owned(),
        options: question
            .options
            .iter()
            .map(|option| option.get(language, fallback).to_owned())
            .collect(),
        answer: question.answer,
    });
    let standard = study.comprehension.standard.then_some(standard);
    standard.into_iter().flatten().chain(own).collect()
}

/// Draws the questions for one participant, and shuffles their options. Without a seed, there is no
/// participant yet, and the result is the first questions in order.
#[must_use]
pub fn drawn(check: &[CheckForm], settings: &Comprehension, seed: Option<u64>) -> Vec<CheckForm> {
    let count = if settings.draw > 0 { settings.draw } else { check.len() };
    let Some(seed) = seed else { return check.iter().take(count).cloned().collect() };
    let mut rng = SeededRng::new(seed);
    let order = rng.permutation(check.len());
    let forms = order.into_iter().take(count).map(|place| &check[place]);
    forms
        .map(|form| {
            let order = rng.permutation(form.options.len());
            CheckForm {
                text: form.text.clone(),
                options: order.iter().map(|&option| form.options[option].clone()).collect(),
                answer: order.iter().position(|&option| option == form.answer).unwrap_or_default(),
            }
        })
        .collect()
}

fn form(question: &Question, language: &str, fallback: &str) -> QuestionForm {
    let text = |text: &Localised| text.get(language, fallback).to_owned();
    QuestionForm {
        name: question.name.clone(),
        kind: question.kind,
        text: text(&question.text),
        required: question.required,
        options: question.options.iter().map(|o| (o.value.clone(), text(&o.text))).collect(),
        range: (question.from, question.to),
        ends: (text(&question.low), text(&question.high)),
        max_chars: question.max_chars,
    }
}

/// A hash of the content to which a participant agreed: the SHA-256, in hexadecimal digits, of a JSON
/// list. The list contains the study's consent text (HTML or null), its facts, and the page's sentences
/// whose keys begin with `welcome.`, as in [`Texts`].
#[must_use]
pub fn consent_hash(texts: &Texts) -> String {
    let shown: BTreeMap<_, _> =
        texts.sentences.iter().filter(|(key, _)| key.starts_with("welcome.")).collect();
    let agreed = serde_json::json!([texts.consent, texts.facts, shown]);
    hex::encode(Sha256::digest(agreed.to_string().as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sidestep::scene::Rule;
    use sidestep::study::CheckQuestion;

    #[test]
    fn a_participant_is_asked_some_of_the_questions_in_any_order() {
        let languages = Languages::load(None).unwrap();
        let mut study = StudyConfig::default();
        assert_eq!(languages.texts(&study, "en").check.len(), 3);
        study.comprehension.draw = 2;
        let all = languages.texts(&study, "en").check;
        assert_eq!(all.len(), 6);
        let right = |form: &CheckForm| (form.text.clone(), form.options[form.answer].clone());
        let known: Vec<_> = all.iter().map(right).collect();
        let mut asked = [0; 6];
        let mut places = [0; 3];
        for seed in 0..6000 {
            let forms = drawn(&all, &study.comprehension, Some(seed));
            assert_eq!(forms.len(), 2);
            assert_ne!(forms[0].text, forms[1].text);
            for form in &forms {
                let place = known.iter().position(|known| *known == right(form)).unwrap();
                asked[place] += 1;
                places[form.answer] += 1;
            }
        }
        // 12,000 questions are drawn. The expected count is 2000 for each of the 6 questions, and 4000
        // for each of the 3 places. The standard deviations are at most 41 and 52.
        assert!(asked.iter().all(|count| (1800..2200).contains(count)), "{asked:?}");
        assert!(places.iter().all(|count| (3740..4260).contains(count)), "{places:?}");
        assert_eq!(drawn(&all, &study.comprehension, None), all[..2]);
    }

    #[test]
    fn texts_say_what_the_robots_do() {
        let languages = Languages::load(None).unwrap();
        let mut study = StudyConfig::default();
        let of = |study: &StudyConfig| {
            let texts = languages.texts(study, "en");
            assert!(texts.sentences.iter().all(|(key, _)| !key.starts_with(ROBOTS)));
            let say = |key: &str| texts.sentences.get(key).cloned().unwrap();
            let [robot, why, when] =
                ["robot", "robot_why", "when"].map(|key| say(&format!("instructions.{key}")));
            let CheckForm { options, answer, .. } = &texts.check[0];
            [robot, why, when, options[*answer].clone()]
        };
        let usual = of(&study);
        study.robots = vec![RobotPolicy::straight()];
        assert_eq!(of(&study), usual);
        study.robots.push(RobotPolicy { rule: Rule::Script, ..RobotPolicy::straight() });
        let [robot, why, when, right] = of(&study);
        assert!(robot.contains("not always drive straight") && right.contains("does not avoid me"));
        assert_eq!(why, usual[1]);
        assert!(!when.contains("you will enter"), "{when}");
        study.robots.push(RobotPolicy { rule: Rule::Evades, ..RobotPolicy::straight() });
        let reacts = of(&study);
        assert!((0..4).all(|i| reacts[i] != usual[i]), "{reacts:?}");
        assert!(!reacts[2].contains("you will enter"), "{reacts:?}");
        // The study's own sentence stays.
        let own = ("instructions.robot".to_owned(), "It dances.".to_owned());
        study.texts.insert("en".to_owned(), [own].into());
        assert_eq!(of(&study)[0], "It dances.");
        let own = ("robots.turn".to_owned(), "It sings.".to_owned());
        study.texts.insert("en".to_owned(), [own].into());
        assert_eq!(of(&study)[0], "It sings.");
    }

    #[test]
    fn texts_of_a_study_in_its_languages() {
        let languages = Languages::load(None).unwrap();
        let mut study = StudyConfig::default();
        study.consent.contact = "ada@example.org".into();
        study.consent.text = Localised::of("en", "# You agree\n<b>freely</b>");
        let change = ("check_robot.right".to_owned(), "On and on.".to_owned());
        study.texts.insert("en".to_owned(), [change].into());
        let option = |text: &str| Localised::of("en", text);
        study.comprehension.questions.push(CheckQuestion {
            text: option("Which?"),
            options: vec![option("this"), option("that")],
            answer: 1,
        });
        let texts = languages.texts(&study, "en");
        let html = "<h2>You agree</h2>\n<p>&lt;b&gt;freely&lt;/b&gt;</p>\n";
        assert_eq!(texts.consent.as_deref(), Some(html));
        assert_eq!(texts.facts, [("contact".to_owned(), "ada@example.org".to_owned())]);
        let right: Vec<_> = texts.check.iter().map(|form| &*form.options[form.answer]).collect();
        assert_eq!((right.len(), right[0], right[3]), (4, "On and on.", "that"));
        assert!(texts.check.iter().any(|form| form.answer > 0));
        assert!(texts.sentences.iter().all(|(key, _)| !key.starts_with("check_robot.")));
        assert_eq!(texts.offered[0].name, "English");
        study.comprehension.standard = false;
        assert_eq!(languages.texts(&study, "en").check.len(), 1);

        // A changed fact changes the agreement. A change of the offered languages does not.
        let hash = consent_hash(&texts);
        let mut other = texts.clone();
        other.offered.clear();
        assert_eq!(consent_hash(&other), hash);
        other.facts[0].1.push('!');
        assert_ne!(consent_hash(&other), hash);
    }
}
