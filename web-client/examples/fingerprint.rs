//! The fingerprints of learning, as a program of this machine or as WebAssembly in a page:
//! a JSON list of `[stage, SHA-256]`, on standard output or as the text of the page.
//! `tests/tests/webassembly.rs` compares both.

#![allow(clippy::print_stdout, reason = "its answer is what it prints")]

use std::error::Error;

#[cfg(not(target_arch = "wasm32"))]
fn main() -> Result<(), Box<dyn Error>> {
    println!("{}", answer()?);
    Ok(())
}

#[cfg(target_arch = "wasm32")]
fn main() {
    let window = web_sys::window().expect("a page runs this");
    let body = window.document().and_then(|document| document.body()).expect("a body");
    let page = body.clone();
    std::panic::set_hook(Box::new(move |panic| page.set_text_content(Some(&panic.to_string()))));
    body.set_text_content(Some(&answer().unwrap_or_else(|error| error.to_string())));
}

fn answer() -> Result<String, Box<dyn Error>> {
    Ok(serde_json::to_string(&sidestep::comparison::learning_fingerprints()?)?)
}
