//! Requests to the server, and the address.

use crate::runtime::{Answer, Request};
use js_sys::Uint8Array;
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::JsFuture;
use web_sys::{AbortSignal, RequestInit, Response};

/// A request that takes longer is given up, ms.
const PATIENCE_MS: u32 = 15_000;

/// Sends a request; whatever goes wrong on the way counts as unreachable.
pub(super) async fn send(request: Request) -> Answer {
    exchange(request).await.unwrap_or(Answer::Unreachable)
}

async fn exchange(request: Request) -> Result<Answer, JsValue> {
    let window = web_sys::window().ok_or(JsValue::NULL)?;
    let init = RequestInit::new();
    init.set_method(request.method);
    init.set_signal(Some(&AbortSignal::timeout_with_u32(PATIENCE_MS)));
    if let Some(body) = &request.body {
        init.set_body(&JsValue::from_str(body));
    }
    let prepared = web_sys::Request::new_with_str_and_init(&request.url, &init)?;
    if request.body.is_some() {
        prepared.headers().set("Content-Type", "application/json")?;
    }
    if let Some(token) = &request.token {
        prepared.headers().set("Authorization", &format!("Bearer {token}"))?;
    }
    let response: Response =
        JsFuture::from(window.fetch_with_request(&prepared)).await?.dyn_into()?;
    let body = JsFuture::from(response.array_buffer()?).await?;
    Ok(Answer::Received { status: response.status(), body: Uint8Array::new(&body).to_vec() })
}

/// Names and values of an address's query.
pub(super) fn decode_query(query: &str) -> Vec<(String, String)> {
    let decode = |text: &str| {
        let spaced = text.replace('+', " ");
        js_sys::decode_uri_component(&spaced).map(String::from).unwrap_or(spaced)
    };
    let pairs = query.trim_start_matches('?').split('&').filter(|pair| !pair.is_empty());
    pairs
        .map(|pair| {
            let (name, value) = pair.split_once('=').unwrap_or((pair, ""));
            (decode(name), decode(value))
        })
        .collect()
}
