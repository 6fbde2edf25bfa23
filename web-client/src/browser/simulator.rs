//! A synthetic participant who uses the real page. It is a separate program (`bin/simulator.rs`),
//! which a page loads only in a simulated participation (`?simulate=SEED`). It uses the document as
//! a person does: it reads, answers, presses buttons and steers with keys.

use crate::json;
use crate::runtime::Address;
use js_sys::{Reflect, Uint8Array};
use sidestep::api::{StudyInfo, routes};
use sidestep::scene::{JointState, Scene, SceneParameters};
use sidestep::synthetic::{KeyChange, Keys, SyntheticParticipant};
use sidestep::vehicle::TurnInput;
use std::cell::RefCell;
use std::rc::Rc;
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::JsFuture;
use web_sys::{
    Document, Element, HtmlElement, KeyboardEvent, KeyboardEventInit, MutationObserver,
    MutationObserverInit, NodeList, Response, Window,
};

/// Interval between two checks of the page (ms).
const LOOK_MS: i32 = 25;

/// Starts the synthetic participant with the seed in the address.
pub fn work() {
    wasm_bindgen_futures::spawn_local(async {
        let Some(window) = web_sys::window() else { return };
        if let Err(error) = begin(&window).await {
            web_sys::console::error_2(&"the simulator stopped:".into(), &error);
        }
    });
}

async fn begin(window: &Window) -> Result<(), JsValue> {
    let document = window.document().ok_or("no document")?;
    let address = super::address::current(window);
    let slug = address.path.trim_start_matches("/s/").trim_end_matches('/');
    let study = fetched(window, &routes::study(slug)).await?;
    let study: StudyInfo = json::read(&study).ok_or("the study cannot be read")?;
    let person = SyntheticParticipant::new(seed(&address), 0);
    let user = User { document, person, study, trials: 0, driven: None, held: None };
    let user = Rc::new(RefCell::new(user));

    // The observer runs after every step that the page shows and before the next step is due.
    let watching = Rc::clone(&user);
    let watch = Closure::<dyn FnMut()>::new(move || watching.borrow_mut().steer());
    let observer = MutationObserver::new(watch.as_ref().unchecked_ref())?;
    let what = MutationObserverInit::new();
    what.set_subtree(true);
    what.set_child_list(true);
    what.set_attributes(true);
    let root = user.borrow().document.get_element_by_id("app").ok_or("no page")?;
    observer.observe_with_options(&root, &what)?;
    let look = Closure::<dyn FnMut()>::new(move || {
        // Perform the action only after the borrow of `user` has ended, because the action can
        // immediately trigger the observer, which also borrows `user`.
        let act = user.borrow().next_act();
        act.perform();
    });
    window.set_interval_with_callback_and_timeout_and_arguments_0(
        look.as_ref().unchecked_ref(),
        LOOK_MS,
    )?;
    // Both closures must live until the page is closed.
    watch.forget();
    look.forget();
    Ok(())
}

/// The seed in the address. If it is not a number, its bytes are combined into a number.
fn seed(address: &Address) -> u64 {
    let word = address.parameter("simulate").unwrap_or_default();
    let number = |text: &str| text.bytes().fold(0u64, |n, b| n.wrapping_mul(256) + u64::from(b));
    word.parse().unwrap_or_else(|_| number(word))
}

async fn fetched(window: &Window, url: &str) -> Result<Vec<u8>, JsValue> {
    let response: Response = JsFuture::from(window.fetch_with_str(url)).await?.dyn_into()?;
    let body = JsFuture::from(response.array_buffer()?).await?;
    Ok(Uint8Array::new(&body).to_vec())
}

/// A synthetic person who uses the page.
struct User {
    document: Document,
    person: SyntheticParticipant,
    study: StudyInfo,
    /// Number of scenes driven.
    trials: u64,
    /// The scene on the canvas: the id of its trial, and the planned key changes in reverse order.
    driven: Option<(String, Vec<KeyChange>)>,
    /// The key that is down.
    held: Option<&'static str>,
}

/// The next action on the page.
enum Act {
    Nothing,
    /// Fill these fields, then press this button.
    Press(Vec<(Element, Entry)>, HtmlElement),
    /// Press and release both steering keys.
    TryKeys(Document),
}

/// The value to enter in a field.
enum Entry {
    Choose,
    Text,
}

impl User {
    fn all(&self, selector: &str) -> Vec<Element> {
        let found: Option<NodeList> = self.document.query_selector_all(selector).ok();
        let found = found.iter().flat_map(|list| (0..list.length()).filter_map(|i| list.get(i)));
        found.filter_map(|node| node.dyn_into().ok()).collect()
    }

    fn find(&self, selector: &str) -> Option<Element> {
        self.document.query_selector(selector).ok().flatten()
    }

    /// Steers the scene on the canvas. In each step, it presses the key that must be down when the
    /// next step begins.
    fn steer(&mut self) {
        let Some(canvas) = self.find("canvas[data-scene]") else { return self.rest() };
        if self.find("[data-testid=countdown], [data-testid=over]").is_some() {
            return self.rest();
        }
        let attribute = |name: &str| canvas.get_attribute(name).unwrap_or_default();
        let trial = attribute("data-trial");
        if self.driven.as_ref().is_none_or(|(known, _)| *known != trial) {
            let parameters = &self.study.parameters;
            let Some(scene) =
                scene(parameters, &attribute("data-scene"), &attribute("data-policy"))
            else {
                return;
            };
            let drive = self.person.drive(self.trials, parameters, &scene, Keys::Clock);
            let mut changes = drive.key_changes;
            changes.reverse();
            self.trials += 1;
            self.driven = Some((trial, changes));
        }
        let step_ms = 1000.0 * self.study.parameters.step_s;
        let step: f64 = attribute("data-step").parse().unwrap_or(0.0);
        // The margin of 1 ms ensures that a key change exactly at the start of the next step counts
        // despite rounding errors.
        let next_ms = (step + 1.0) * step_ms + 1.0;
        while let Some((_, changes)) = &mut self.driven
            && let Some(change) = changes.pop_if(|change| change.at_ms <= next_ms)
        {
            self.hold(change.input);
        }
    }

    /// Releases the keys after a scene.
    fn rest(&mut self) {
        if self.driven.is_some() {
            self.hold(TurnInput::Straight);
        }
    }

    /// Acts as one finger does: releases the held key before it presses another.
    fn hold(&mut self, input: TurnInput) {
        let wanted = match input {
            TurnInput::Left => Some("ArrowLeft"),
            TurnInput::Right => Some("ArrowRight"),
            TurnInput::Straight => None,
        };
        let held = std::mem::replace(&mut self.held, wanted);
        if held != wanted {
            held.into_iter().for_each(|code| key(&self.document, code, "keyup"));
            wanted.into_iter().for_each(|code| key(&self.document, code, "keydown"));
        }
    }

    /// The action that a person would take next in the current state of the page.
    fn next_act(&self) -> Act {
        if self.find("canvas[data-scene], [data-testid=completion-code]").is_some() {
            return Act::Nothing;
        }
        let button = self.find("button.primary:not([disabled])");
        match button.and_then(|button| button.dyn_into().ok()) {
            Some(button) => Act::Press(self.entries(), button),
            None if self.find("button.primary").is_some() => Act::TryKeys(self.document.clone()),
            None => Act::Nothing,
        }
    }

    /// Values to enter in the fields of the page's forms.
    fn entries(&self) -> Vec<(Element, Entry)> {
        let mut entries = Vec::new();
        let mut groups: Vec<String> = Vec::new();
        for field in self.all("form [name]") {
            let name = field.get_attribute("name").unwrap_or_default();
            let kind = property(&field, "type");
            if kind == "radio" {
                // For the simulator, the page marks the right answers to the comprehension check.
                let is_right = !name.starts_with("check-") || field.has_attribute("data-right");
                if is_right && !groups.contains(&name) {
                    groups.push(name);
                    entries.push((field, Entry::Choose));
                }
            } else if kind == "text" || kind == "textarea" {
                entries.push((field, Entry::Text));
            }
        }
        entries
    }
}

impl Act {
    fn perform(self) {
        match self {
            Self::Nothing => {}
            Self::Press(entries, button) => {
                for (field, entry) in entries {
                    let (name, value) = match entry {
                        Entry::Choose => ("checked", JsValue::TRUE),
                        Entry::Text => ("value", "Simulated answer".into()),
                    };
                    let _ = Reflect::set(&field, &name.into(), &value);
                    if let Ok(event) = bubbling("input") {
                        let _ = field.dispatch_event(&event);
                    }
                }
                button.click();
            }
            Self::TryKeys(document) => {
                for code in ["ArrowLeft", "ArrowRight"] {
                    key(&document, code, "keydown");
                    key(&document, code, "keyup");
                }
            }
        }
    }
}

fn bubbling(name: &str) -> Result<web_sys::Event, JsValue> {
    let options = web_sys::EventInit::new();
    options.set_bubbles(true);
    web_sys::Event::new_with_event_init_dict(name, &options)
}

fn key(document: &Document, code: &str, name: &str) {
    let options = KeyboardEventInit::new();
    options.set_bubbles(true);
    options.set_cancelable(true);
    options.set_code(code);
    options.set_key(code);
    if let (Ok(event), Some(body)) =
        (KeyboardEvent::new_with_keyboard_event_init_dict(name, &options), document.body())
    {
        let _ = body.dispatch_event(&event);
    }
}

fn property(element: &Element, name: &str) -> String {
    let value = Reflect::get(element, &name.into()).unwrap_or_default();
    value.as_string().unwrap_or_default()
}

/// The scene that the page exposes: both vehicles at the start, and the rule that moves the robot,
/// unless it drives straight.
fn scene(parameters: &SceneParameters, start: &str, policy: &str) -> Option<Scene> {
    let JointState { human, robot } = json::read(start.as_bytes())?;
    let policy = if policy.is_empty() { None } else { Some(json::read(policy.as_bytes())?) };
    Some(Scene { policy, ..Scene::new(parameters, human, robot) })
}
