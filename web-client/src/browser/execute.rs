//! How each command of a page is executed.

use super::{
    Pump, Underway, address, background, evaluator, files, film, follow, listen, net, solver, tabs,
    wish,
};
use crate::runtime::{
    Command, Commands, Evaluate, Event, Failure, Offer, PNG_OF_SVG, Page, Solving,
};
use std::rc::Rc;
use wasm_bindgen::prelude::*;
use web_sys::Blob;

impl<P: Page + 'static> Pump<P> {
    pub(super) fn apply(&self, commands: Commands<P::Msg>) {
        for command in commands {
            self.apply_one(command);
        }
    }

    fn apply_one(&self, command: Command<P::Msg>) {
        let mut shell = self.shell.borrow_mut();
        match command {
            Command::Send(request) => {
                let name = request.name;
                let number = shell.begin(name);
                let (sent, answer, then) = net::send(&shell.window, request);
                shell.underway.push(Underway { name, number, _work: Box::new(sent) });
                let pump = self.clone();
                background(async move {
                    let answer = answer.await;
                    pump.finish(number, || then(answer));
                });
            }
            Command::Wake { timer, after_ms, message } => {
                let number = shell.begin(timer);
                shell.underway.push(Underway { name: timer, number, _work: Box::new(()) });
                let pump = self.clone();
                let wake = Closure::once_into_js(move || pump.finish(number, || message));
                let _ = shell.window.set_timeout_with_callback_and_timeout_and_arguments_0(
                    wake.unchecked_ref(),
                    shell.clock.browser_ms(after_ms),
                );
            }
            // With this arm, the compiler removes the next arm from pages that never solve.
            Command::Solve { .. } if !P::solves() => {}
            Command::Solve { name, task, then } => {
                let number = shell.begin(name);
                let address = shell.root.get_attribute("data-solver").unwrap_or_default();
                let (pump, report) = (self.clone(), Rc::clone(&then));
                let report = move |solving| {
                    let is_over = !matches!(solving, Solving::Done(_));
                    if is_over {
                        pump.finish(number, || report(solving));
                    } else if pump.shell.borrow().holds(number) {
                        pump.dispatch_now(report(solving));
                    }
                };
                match solver::Solver::start(&address, &task, report) {
                    Ok(solver) => {
                        let _work = Box::new(solver);
                        shell.underway.push(Underway { name, number, _work });
                    }
                    Err(_) => {
                        let why = "This browser cannot start the solver.".to_owned();
                        let message = then(Solving::Failed(why));
                        self.queue.borrow_mut().push_back((message, shell.clock.now_ms()));
                    }
                }
            }
            Command::Evaluate(_) if !P::solves() => {}
            Command::Evaluate(evaluate) => {
                let Evaluate { name, part, content, then } = evaluate();
                let known = shell.underway.iter().find(|underway| underway.name == name);
                let known = known.and_then(|it| it._work.downcast_ref::<evaluator::Evaluator>());
                if let Some(evaluator) = known {
                    evaluator.tell(part, &content);
                    return;
                }
                let number = shell.begin(name);
                let address = shell.root.get_attribute("data-evaluator").unwrap_or_default();
                let (pump, report) = (self.clone(), Rc::clone(&then));
                let report = move |answer| {
                    if pump.shell.borrow().holds(number) {
                        pump.dispatch_now(report(answer));
                    }
                };
                match evaluator::Evaluator::start(&address, report) {
                    Ok(evaluator) => {
                        evaluator.tell(part, &content);
                        let _work = Box::new(evaluator);
                        shell.underway.push(Underway { name, number, _work });
                    }
                    Err(_) => {
                        let sentence = "This browser cannot start the evaluator.".to_owned();
                        let message = then(Err(Failure { sentence, ..Failure::unreachable() }));
                        self.queue.borrow_mut().push_back((message, shell.clock.now_ms()));
                    }
                }
            }
            Command::Follow { .. } if !P::follows() => {}
            Command::Follow { name, url, then } => {
                let number = shell.begin(name);
                let pump = self.clone();
                let hear = move || {
                    if pump.shell.borrow().holds(number) {
                        pump.dispatch_now(then());
                    }
                };
                let _work = Box::new(follow::Follower::start(&shell.document, url, hear));
                shell.underway.push(Underway { name, number, _work });
            }
            Command::Cancel(name) => shell.underway.retain(|underway| underway.name != name),
            // A user who leaves during a recording still gets the film so far: ending the recording
            // offers the film for download.
            Command::CancelAll if P::offers_files() => {
                shell.underway.retain(|underway| {
                    underway._work.downcast_ref::<film::Film>().map(film::Film::end).is_some()
                });
            }
            Command::CancelAll => shell.underway.clear(),
            Command::Keep { .. } if !P::keeps() => {}
            Command::Keep { name, text, then } => {
                let kept = shell.storage.keep(&name, &text);
                let pump = self.clone();
                background(async move {
                    let kept = kept.await;
                    pump.dispatch_now(then(kept));
                });
            }
            Command::Forget(_) if !P::keeps() => {}
            Command::Forget(name) => shell.storage.forget(&name),
            Command::Language(tag) => {
                if let Some(element) = shell.document.document_element() {
                    let _ = element.set_attribute("lang", &tag);
                }
            }
            Command::TakeOver(name) => {
                let pump = self.clone();
                let lost = move || {
                    let now_ms = pump.shell.borrow().clock.now_ms();
                    pump.report(&Event::TakenOver, now_ms);
                };
                shell.claims.retain(|claim| claim.name() != name);
                shell.claims.extend(tabs::Claim::new(&name, lost));
            }
            Command::GuardLeaving(on) => {
                let guard = on.then(|| listen::Listener::guard(&shell.window)).flatten();
                shell.guard = guard;
            }
            Command::Fullscreen(true) => {
                if let Some(all) = shell.document.document_element() {
                    wish(&all, "requestFullscreen");
                }
            }
            Command::Fullscreen(false) => wish(&shell.document, "exitFullscreen"),
            Command::Offer(_) if !P::offers_files() => {}
            Command::Offer(offer) => match offer() {
                Offer::File { name, media_type: PNG_OF_SVG, content } => {
                    files::offer_picture(&shell.document, &content, name);
                }
                Offer::File { name, media_type, content } => {
                    files::offer(&shell.document, &name, media_type, &content);
                }
                Offer::Film { name, canvas, file, then } => {
                    let number = shell.begin(name);
                    let (pump, document, then_ended) =
                        (self.clone(), shell.document.clone(), Rc::clone(&then));
                    let ended = move |film: Result<Blob, String>| {
                        let offered = film.and_then(|film| {
                            files::offer_blob(&document, &file, &film)
                                .map_err(|_| "The browser did not accept the film.".to_owned())
                        });
                        // `finish` drops the film. It runs in the background, because this listener
                        // belongs to the film and must return first.
                        let (pump, then) = (pump.clone(), Rc::clone(&then_ended));
                        background(async move { pump.finish(number, || then(offered)) });
                    };
                    match film::Film::begin(&shell.document, canvas, ended) {
                        Ok(film) => {
                            shell.underway.push(Underway { name, number, _work: Box::new(film) });
                        }
                        Err(why) => {
                            let message = then(Err(why));
                            self.queue.borrow_mut().push_back((message, shell.clock.now_ms()));
                        }
                    }
                }
                Offer::EndOfFilm(name) => {
                    let films = shell.underway.iter().filter(|underway| underway.name == name);
                    let film = films.filter_map(|it| it._work.downcast_ref::<film::Film>()).next();
                    film.map(film::Film::end).unwrap_or_default();
                }
            },
            Command::ReplaceAddress(url) => address::replace(&shell.window, &url),
            Command::Visit(url) => {
                let (now_ms, window) = (shell.clock.now_ms(), shell.window.clone());
                drop(shell);
                if !self.visit(&url, now_ms) {
                    let _ = window.location().assign(&url);
                }
            }
            Command::Leave(url) => {
                let _ = shell.window.location().assign(&url);
            }
        }
    }

    /// Completes a request, timer or solve: delivers its message, unless the work was cancelled.
    fn finish(&self, number: u32, message: impl FnOnce() -> P::Msg) {
        {
            let mut shell = self.shell.borrow_mut();
            if !shell.holds(number) {
                return;
            }
            shell.end(number);
        }
        self.dispatch_now(message());
    }
}
