//! Recordings of a canvas, as WebM files.

use super::files;
use js_sys::{Array, Promise, Reflect, Uint8Array};
use std::cell::Cell;
use std::rc::Rc;
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::JsFuture;
use web_sys::{
    Blob, BlobEvent, BlobPropertyBag, Document, HtmlCanvasElement, MediaRecorder,
    MediaRecorderOptions, RecordingState, Window,
};

/// Media type of the recordings.
const WEBM: &str = "video/webm";

/// Whether this browser can record WebM.
fn can_film(window: &Window) -> bool {
    let has = |object: &JsValue, name: &str| Reflect::has(object, &name.into()).unwrap_or(false);
    has(window, "MediaRecorder") && MediaRecorder::is_type_supported(WEBM)
}

/// A recording of a canvas. Dropping it before it has ended discards the film.
pub(super) struct Film {
    recorder: MediaRecorder,
    goes_on: Rc<Cell<bool>>,
    _listeners: [Closure<dyn FnMut(BlobEvent)>; 2],
}

impl Film {
    /// Starts recording the canvas with this id. When the recording stops, through [`Self::end`] or
    /// because the browser stops it, `ended` is called with the film or with an error message.
    pub(super) fn begin(
        document: &Document,
        canvas: &str,
        ended: impl Fn(Result<Blob, String>) + 'static,
    ) -> Result<Self, String> {
        let begun = Self::try_begin(document, canvas, ended);
        begun.map_err(|_| "This browser cannot record films: it does not support WebM.".to_owned())
    }

    fn try_begin(
        document: &Document,
        canvas: &str,
        ended: impl Fn(Result<Blob, String>) + 'static,
    ) -> Result<Self, JsValue> {
        let window = document.default_view().filter(can_film).ok_or(JsValue::NULL)?;
        let canvas = document.get_element_by_id(canvas).ok_or(JsValue::NULL)?;
        let canvas: HtmlCanvasElement = canvas.dyn_into()?;
        let copy: HtmlCanvasElement = document.create_element("canvas")?.dyn_into()?;
        files::paint_on_ground(&canvas, &copy)?;
        let options = MediaRecorderOptions::new();
        options.set_mime_type(WEBM);
        // Four times the default bit rate of browsers keeps thin lines sharp.
        options.set_video_bits_per_second(10_000_000);
        let stream = copy.capture_stream()?;
        let recorder =
            MediaRecorder::new_with_media_stream_and_media_recorder_options(&stream, &options)?;

        let ended = Rc::new(ended);
        let parts = Array::new();
        let kept = parts.clone();
        let take = Closure::<dyn FnMut(BlobEvent)>::new(move |event: BlobEvent| {
            if let Some(part) = event.data() {
                kept.push(&part);
            }
        });
        let end = Closure::<dyn FnMut(BlobEvent)>::new(move |_| {
            let kind = BlobPropertyBag::new();
            kind.set_type(WEBM);
            let film = Blob::new_with_blob_sequence_and_options(&parts, &kind);
            let ended = Rc::clone(&ended);
            super::background(async move {
                ended(match film {
                    Ok(film) if has_frames(&film).await => Ok(film),
                    _ => {
                        Err("The browser was too busy to record a frame. Record again.".to_owned())
                    }
                });
            });
        });
        recorder.set_ondataavailable(Some(take.as_ref().unchecked_ref()));
        recorder.set_onstop(Some(end.as_ref().unchecked_ref()));
        recorder.start()?;
        let goes_on = Rc::new(Cell::new(true));
        super::background(copy_frames(window, canvas, copy, Rc::clone(&goes_on)));
        Ok(Self { recorder, goes_on, _listeners: [take, end] })
    }

    /// Ends the recording.
    pub(super) fn end(&self) {
        self.goes_on.set(false);
        if self.recorder.state() != RecordingState::Inactive {
            let _ = self.recorder.stop();
        }
    }
}

/// The element of a WebM file that contains frames.
const CLUSTER: [u8; 4] = [0x1f, 0x43, 0xb6, 0x75];

/// Length of the beginning of a file that contains the head of the first cluster (bytes). Before it, a
/// recording has only its description, which is shorter than a kilobyte.
const HEAD: f64 = 16_384.0;

/// Whether a WebM file contains frames. A busy browser can encode none in a second, and then writes a file
/// without them.
async fn has_frames(film: &Blob) -> bool {
    let Ok(head) = film.slice_with_f64_and_f64(0.0, HEAD) else { return false };
    let Ok(bytes) = JsFuture::from(head.array_buffer()).await else { return false };
    Uint8Array::new(&bytes).to_vec().windows(CLUSTER.len()).any(|id| id == CLUSTER)
}

impl Drop for Film {
    fn drop(&mut self) {
        self.recorder.set_ondataavailable(None);
        self.recorder.set_onstop(None);
        self.end();
    }
}

/// Copies a canvas in every animation frame while `goes_on` is true. The copy is recorded instead
/// of the canvas itself, because unpainted parts of a canvas are transparent and would be black in
/// the film.
async fn copy_frames(
    window: Window,
    canvas: HtmlCanvasElement,
    copy: HtmlCanvasElement,
    goes_on: Rc<Cell<bool>>,
) {
    while goes_on.get() {
        let _ = files::paint_on_ground(&canvas, &copy);
        let frame = Promise::new(&mut |resolve, _| {
            let _ = window.request_animation_frame(&resolve);
        });
        let _ = JsFuture::from(frame).await;
    }
}
