//! Files that a page offers for download, and files that a user opens.

use crate::runtime::encoded;
use js_sys::{Array, Reflect, Uint8Array};
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::JsFuture;
use web_sys::{
    Blob, BlobPropertyBag, CanvasRenderingContext2d, Document, Element, HtmlAnchorElement,
    HtmlCanvasElement, HtmlElement, HtmlImageElement, Url,
};

/// Whether a field selects a file.
pub(super) fn is_field(field: &Element) -> bool {
    field.matches("input[type=file]").unwrap_or(false)
}

/// The text of the file that is selected in a field. Returns `None` if no file is selected, and an
/// empty text if the file cannot be read. Clears the field, so that the same file can be selected
/// again.
pub(super) async fn opened(field: &Element) -> Option<String> {
    let files = Reflect::get(field, &"files".into()).ok()?;
    let file = Reflect::get_u32(&files, 0).ok()?.dyn_into::<Blob>().ok()?;
    let text = JsFuture::from(file.text()).await;
    let _ = Reflect::set(field, &"value".into(), &"".into());
    Some(text.ok().and_then(|text| text.as_string()).unwrap_or_default())
}

/// Offers bytes for download under this file name.
pub(super) fn offer(document: &Document, name: &str, media_type: &str, content: &[u8]) {
    let parts = Array::of1(&Uint8Array::from(content));
    let kind = BlobPropertyBag::new();
    kind.set_type(media_type);
    if let Ok(blob) = Blob::new_with_u8_array_sequence_and_options(&parts, &kind) {
        let _ = offer_blob(document, name, &blob);
    }
}

/// Resizes the canvas `image` to the size of `canvas` and copies `canvas` onto it. Unpainted parts
/// of a canvas are transparent, so the copy gets the page's background colour.
pub(super) fn paint_on_ground(
    canvas: &HtmlCanvasElement,
    image: &HtmlCanvasElement,
) -> Result<(), JsValue> {
    let missing = || JsValue::from_str("no canvas");
    let (width, height) = (canvas.width(), canvas.height());
    if (image.width(), image.height()) != (width, height) {
        image.set_width(width);
        image.set_height(height);
    }
    let context: CanvasRenderingContext2d =
        image.get_context("2d")?.ok_or_else(missing)?.dyn_into()?;
    let document = canvas.owner_document().ok_or_else(missing)?;
    let window = document.default_view().ok_or_else(missing)?;
    let ground = match document.body() {
        Some(body) => window
            .get_computed_style(&body)?
            .map(|style| style.get_property_value("background-color")),
        None => None,
    };
    if let Some(Ok(ground)) = ground {
        context.set_fill_style_str(&ground);
        context.fill_rect(0.0, 0.0, width.into(), height.into());
    }
    context.draw_image_with_html_canvas_element(canvas, 0.0, 0.0)
}

/// Renders an SVG file at twice its nominal size and offers it as a PNG image.
pub(super) fn offer_picture(document: &Document, svg: &[u8], name: String) {
    const TIMES: u32 = 2;
    let Ok(image) = HtmlImageElement::new() else { return };
    let (document, shown) = (document.clone(), image.clone());
    let paint = Closure::once_into_js(move || {
        let (width, height) = (TIMES * shown.natural_width(), TIMES * shown.natural_height());
        let canvas = document.create_element("canvas").ok();
        let canvas = canvas.and_then(|canvas| canvas.dyn_into::<HtmlCanvasElement>().ok());
        let Some(canvas) = canvas else { return };
        canvas.set_width(width);
        canvas.set_height(height);
        let context = canvas.get_context("2d").ok().flatten();
        let context = context.and_then(|it| it.dyn_into::<CanvasRenderingContext2d>().ok());
        let Some(context) = context else { return };
        let _ = context.draw_image_with_html_image_element_and_dw_and_dh(
            &shown,
            0.0,
            0.0,
            width.into(),
            height.into(),
        );
        let _ = offer_canvas_blob(&document, &canvas, name);
    });
    image.set_onload(Some(paint.unchecked_ref()));
    let svg = encoded(&String::from_utf8_lossy(svg));
    image.set_src(&format!("data:image/svg+xml,{svg}"));
}

fn offer_canvas_blob(
    document: &Document,
    canvas: &HtmlCanvasElement,
    name: String,
) -> Result<(), JsValue> {
    let document = document.clone();
    let offer = Closure::once_into_js(move |blob: Option<Blob>| {
        if let Some(blob) = blob {
            let _ = offer_blob(&document, &name, &blob);
        }
    });
    canvas.to_blob(offer.unchecked_ref())
}

pub(super) fn offer_blob(document: &Document, name: &str, blob: &Blob) -> Result<(), JsValue> {
    let url = Url::create_object_url_with_blob(blob)?;
    let link: HtmlAnchorElement = document.create_element("a")?.dyn_into()?;
    link.set_href(&url);
    link.set_download(name);
    link.unchecked_ref::<HtmlElement>().click();
    // Revoke the URL only after this delay, when the browser has certainly begun to read it.
    let forget = Closure::once_into_js(move || {
        let _ = Url::revoke_object_url(&url);
    });
    if let Some(window) = document.default_view() {
        window.set_timeout_with_callback_and_timeout_and_arguments_0(
            forget.unchecked_ref(),
            10_000,
        )?;
    }
    Ok(())
}
