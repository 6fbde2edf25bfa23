//! Requests to the server.

use crate::runtime::{Answer, Failure, Request, Then, answer};
use js_sys::Uint8Array;
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::JsFuture;
use web_sys::{AbortController, RequestInit, Response, Window};

/// Timeout of a request (ms).
const PATIENCE_MS: i32 = 15_000;

/// A request in progress. Dropping it cancels the request.
pub(super) struct Sent(Option<AbortController>);

impl Drop for Sent {
    fn drop(&mut self) {
        if let Some(controller) = &self.0 {
            // Has no effect once the response has arrived.
            controller.abort();
        }
    }
}

/// Sends a request. Any network failure is reported as an unreachable server.
pub(super) fn send<M: 'static>(
    window: &Window,
    request: Request<M>,
) -> (Sent, impl Future<Output = Answer> + 'static, Then<Answer, M>) {
    let Request { method, url, token, body, then, .. } = request;
    let controller = AbortController::new().ok();
    if let Some(controller) = controller.clone() {
        let give_up = Closure::once_into_js(move || controller.abort());
        let _ = window.set_timeout_with_callback_and_timeout_and_arguments_0(
            give_up.unchecked_ref(),
            PATIENCE_MS,
        );
    }
    let init = RequestInit::new();
    init.set_method(method);
    init.set_signal(controller.as_ref().map(AbortController::signal).as_ref());
    let window = window.clone();
    let answer = async move {
        let response = exchange(&window, &init, &url, token, body).await;
        response.map_or_else(|_| Err(Failure::unreachable()), |(status, body)| answer(status, body))
    };
    (Sent(controller), answer, then)
}

async fn exchange(
    window: &Window,
    init: &RequestInit,
    url: &str,
    token: Option<String>,
    body: Option<String>,
) -> Result<(u16, Vec<u8>), JsValue> {
    if let Some(body) = &body {
        init.set_body(&JsValue::from_str(body));
    }
    let prepared = web_sys::Request::new_with_str_and_init(url, init)?;
    if body.is_some() {
        prepared.headers().set("Content-Type", "application/json")?;
    }
    if let Some(token) = &token {
        prepared.headers().set("Authorization", &format!("Bearer {token}"))?;
    }
    let response: Response =
        JsFuture::from(window.fetch_with_request(&prepared)).await?.dyn_into()?;
    let body = JsFuture::from(response.array_buffer()?).await?;
    Ok((response.status(), Uint8Array::new(&body).to_vec()))
}
