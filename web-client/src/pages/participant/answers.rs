//! The comprehension check, the questions after the last scene, and withdrawal.

use super::state::{Quiz, Stage};
use super::{Msg, Participant, lifted};
use crate::form::Form;
use crate::json;
use crate::runtime::{Answer, Command, Commands, read};
use crate::texts::Sentences as _;
use sidestep::api::{
    Answers, CheckForm, ComprehensionResult, ComprehensionStored, Object, Withdrawn, routes,
};
use sidestep::study::{AfterWrong, QuestionKind};

/// The answer to a question.
#[derive(serde::Serialize)]
#[serde(untagged)]
enum Given {
    Text(String),
    Number(i64),
}

impl Participant {
    pub(super) fn checked(&mut self, form: &Form) -> Commands<Msg> {
        let Stage::Comprehension(quiz) = &mut self.stage else { return Vec::new() };
        // Ignore answers while new questions are being loaded.
        if self.renews.is_some() {
            return Vec::new();
        }
        self.hint = None;
        let check = &self.texts.check;
        let answer = |place: usize| form.text(&format!("check-{place}")).parse().ok();
        quiz.chosen = (0..check.len()).map(answer).collect();
        quiz.is_incomplete = quiz.chosen.contains(&None);
        quiz.is_marked = false;
        if quiz.is_incomplete {
            return Vec::new();
        }
        quiz.attempts += 1;
        if let Some(progress) = &mut self.progress {
            progress.comprehension_attempts = quiz.attempts;
        }
        let right = |(form, chosen): (&CheckForm, &Option<usize>)| *chosen == Some(form.answer);
        let passed = check.iter().zip(&quiz.chosen).all(right);
        quiz.is_passed = passed;
        self.submitted = json::write(&ComprehensionResult { attempts: quiz.attempts, passed });
        vec![self.ask_check()]
    }

    pub(super) fn ask_check(&self) -> Command<Msg> {
        let body = Some(self.submitted.clone());
        self.ask("check", "PUT", routes::COMPREHENSION, body, Msg::Understood)
    }

    pub(super) fn understood(&mut self, stored: ComprehensionStored) -> Commands<Msg> {
        if stored.screened_out {
            let url = stored.return_url;
            self.stage = Stage::Ended("stuck.screened_out", "stuck.screened_out_why", url);
            return Vec::new();
        }
        if let Stage::Comprehension(quiz) = &mut self.stage {
            if quiz.is_passed {
                if let Some(progress) = &mut self.progress {
                    progress.understood = true;
                }
                return Vec::new();
            }
            quiz.is_marked = stored.after_wrong == AfterWrong::Mark;
        }
        if stored.after_wrong == AfterWrong::Mark {
            return Vec::new();
        }
        // A participant who has returned to the instructions in the meantime gets new questions as
        // well.
        self.renews = Some(stored.after_wrong);
        vec![self.ask_texts()]
    }

    /// Continues with the new questions that have arrived after a wrong answer.
    pub(super) fn renewed(&mut self, after_wrong: AfterWrong) {
        let Stage::Comprehension(quiz) = &self.stage else { return };
        let attempts = quiz.attempts;
        if after_wrong == AfterWrong::Reread {
            self.hint = Some("comprehension.reread");
            self.show_instructions();
        } else {
            self.hint = Some("comprehension.renewed");
            let drawn_at = attempts;
            self.stage = Stage::Comprehension(Quiz { attempts, drawn_at, ..Quiz::default() });
        }
    }

    pub(super) fn questions(&mut self, form: &Form) -> Commands<Msg> {
        let mut answers = Answers { answers: Object::default() };
        let mut missing = Vec::new();
        for (place, question) in self.texts.questions.iter().enumerate() {
            let text = form.text(&question.name).trim();
            if text.is_empty() {
                if question.required {
                    missing.push(place);
                }
                continue;
            }
            let number = match question.kind {
                QuestionKind::Scale => text.parse().ok(),
                _ => None,
            };
            let given = number.map_or_else(|| Given::Text(text.to_owned()), Given::Number);
            answers.answers.insert(question.name.clone(), given);
        }
        let is_incomplete = !missing.is_empty();
        self.stage = Stage::Questions(missing);
        if is_incomplete {
            return Vec::new();
        }
        self.submitted = json::write(&answers);
        vec![self.ask_answers()]
    }

    fn ask_answers(&self) -> Command<Msg> {
        let body = Some(self.submitted.clone());
        self.ask("answers", "PUT", routes::ANSWERS, body, Msg::Answered)
    }

    pub(super) fn answered(&mut self, answer: Answer) -> Commands<Msg> {
        if let Err(failure) = answer {
            if failure.is_temporary() {
                return self.failed(&failure, Self::ask_answers, "stuck.ended");
            }
            let why = self.words(&failure);
            self.trouble = Some(self.texts.get("trouble.answers", &[("why", why.as_str().into())]));
            return Vec::new();
        }
        if let Some(progress) = &mut self.progress {
            progress.answered = true;
        }
        self.trouble = None;
        self.stage = Stage::Finishing;
        self.go_on()
    }

    pub(super) fn ask_withdrawal(&self) -> Command<Msg> {
        // The participant may have returned to the study in the meantime. Even then, an earlier
        // request may have withdrawn them, so ask the server.
        if !self.is_withdrawing {
            return self.ask_progress();
        }
        let url = routes::ME.to_owned() + if self.deletes { "?data=delete" } else { "?data=keep" };
        self.ask("withdraw", "DELETE", url, None, Msg::Withdrawn)
    }

    pub(super) fn withdrawn(&mut self, answer: Answer) -> Commands<Msg> {
        let stored: Withdrawn = match read(answer) {
            Ok(stored) => stored,
            Err(failure) if failure.is_temporary() => {
                return self.failed(&failure, Self::ask_withdrawal, "stuck.ended");
            }
            Err(failure) => {
                self.is_withdrawing = false;
                self.trouble = Some(self.words(&failure));
                return Vec::new();
            }
        };
        let why = if self.deletes { "withdraw.deleted" } else { "withdraw.kept" };
        self.stage = Stage::Ended("withdraw.done_heading", why, stored.return_url);
        let mut commands: Vec<_> = lifted(self.outbox.forget_all()).collect();
        if self.deletes {
            commands.push(Command::Forget(self.session_name()));
        }
        let exposures = self.exposures.iter().map(|(id, _)| self.exposure_name(id));
        commands.extend(exposures.map(Command::Forget));
        commands
    }
}
