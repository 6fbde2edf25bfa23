//! A program that returns one text, on standard output or as the text of a page.

use std::error::Error;

/// Computes a text from a request. `clock` returns the time (s).
type Answer = fn(asked: &str, clock: &dyn Fn() -> f64) -> Result<String, Box<dyn Error>>;

/// Passes the program's first argument to `answer` and prints the result.
///
/// # Errors
/// The errors of `answer`.
#[cfg(not(target_arch = "wasm32"))]
#[allow(clippy::print_stdout, reason = "its answer is what it prints")]
pub(crate) fn run(answer: Answer) -> Result<(), Box<dyn Error>> {
    let start = std::time::Instant::now();
    let asked = std::env::args().nth(1).unwrap_or_default();
    println!("{}", answer(&asked, &|| start.elapsed().as_secs_f64())?);
    Ok(())
}

/// Passes the fragment of the page's address to `answer` and shows the result as the text of the
/// page. An error is shown in the same way.
///
/// # Errors
/// None.
#[cfg(target_arch = "wasm32")]
pub(crate) fn run(answer: Answer) -> Result<(), Box<dyn Error>> {
    let window = web_sys::window().expect("a page runs this");
    let body = window.document().and_then(|document| document.body()).expect("a body");
    let page = body.clone();
    std::panic::set_hook(Box::new(move |panic| page.set_text_content(Some(&panic.to_string()))));
    let clock = window.performance().expect("a clock");
    let address = window.location().hash().expect("an address");
    let text = answer(address.trim_start_matches('#'), &|| clock.now() / 1000.0);
    body.set_text_content(Some(&text.unwrap_or_else(|error| error.to_string())));
    Ok(())
}
