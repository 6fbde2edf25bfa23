//! Paints pictures on a canvas.

use js_sys::Reflect;
use sidestep::chart::{Colour, Ink, Pen};
use sidestep::math::TAU;
use sidestep::picture::{Brush, Picture, Points};
use wasm_bindgen::prelude::*;
use web_sys::{CanvasRenderingContext2d, Document, HtmlCanvasElement, ResizeObserver, Window};

/// A painter with colours for a light or a dark background, as the user prefers. It reuses browser
/// objects, so painting a frame creates none.
#[derive(Default)]
pub(super) struct Painter {
    is_dark: bool,
    /// The colours used so far, with their CSS strings.
    colours: Vec<(Colour, JsValue)>,
    sheet: Option<Sheet>,
}

/// A canvas to paint on.
struct Sheet {
    id: &'static str,
    canvas: HtmlCanvasElement,
    context: CanvasRenderingContext2d,
    /// The attributes that are currently set on the canvas.
    attributes: Vec<(&'static str, String)>,
    /// Width and height (CSS pixels), once measured.
    size_px: Option<[f64; 2]>,
    names: Names,
    /// The dashes that are currently set, as lengths and as a JavaScript array.
    dash: Option<([f64; 2], js_sys::Array)>,
}

/// The names of two properties of a context.
struct Names {
    fill: JsValue,
    stroke: JsValue,
}

impl Painter {
    /// Switches between light and dark background.
    pub(super) fn set_dark(&mut self, is_dark: bool) {
        self.is_dark = is_dark;
        self.colours.clear();
    }

    /// Copies the light or dark setting of the other painter.
    pub(super) fn be_like(&mut self, other: &Self) {
        if self.is_dark != other.is_dark {
            self.set_dark(other.is_dark);
        }
    }

    /// Discards the measured size. Needed after the size of the canvas or the pixel ratio has
    /// changed.
    pub(super) fn measure_again(&mut self) {
        if let Some(sheet) = &mut self.sheet {
            sheet.size_px = None;
        }
    }

    /// Selects the canvas with this id. The painter paints on it from then on.
    pub(super) fn find(
        &mut self,
        document: &Document,
        id: &'static str,
    ) -> Option<&HtmlCanvasElement> {
        if !self.sheet.as_ref().is_some_and(|sheet| sheet.id == id && sheet.canvas.is_connected()) {
            self.sheet = Sheet::of(document, id);
        }
        self.sheet.as_ref().map(|sheet| &sheet.canvas)
    }

    /// Paints a picture if the selected canvas is the picture's canvas.
    pub(super) fn paint(&mut self, window: &Window, picture: &Picture) {
        let Some(mut sheet) = self.sheet.take() else { return };
        if sheet.id == picture.canvas {
            sheet.tell(&picture.attributes);
            let size_px = sheet.cleared(window);
            picture.paint(size_px, &mut Canvas { painter: self, sheet: &mut sheet });
        }
        self.sheet = Some(sheet);
    }

    fn css(&mut self, colour: Colour) -> &JsValue {
        let known = self.colours.iter().position(|(known, _)| *known == colour);
        let place = known.unwrap_or_else(|| {
            let [red, green, blue] = if self.is_dark { colour.dark } else { colour.light };
            self.colours.push((colour, format!("rgb({red} {green} {blue})").into()));
            self.colours.len() - 1
        });
        &self.colours[place].1
    }
}

impl Sheet {
    fn of(document: &Document, id: &'static str) -> Option<Self> {
        let canvas: HtmlCanvasElement = document.get_element_by_id(id)?.dyn_into().ok()?;
        let context = canvas.get_context("2d").ok().flatten()?.dyn_into().ok()?;
        let names = Names { fill: "fillStyle".into(), stroke: "strokeStyle".into() };
        Some(Self { id, canvas, context, attributes: Vec::new(), size_px: None, names, dash: None })
    }

    /// Sets the attributes that have changed.
    fn tell(&mut self, attributes: &[(&'static str, String)]) {
        for (place, (name, value)) in attributes.iter().enumerate() {
            match self.attributes.get_mut(place) {
                Some((known, shown)) if known == name => {
                    if shown == value {
                        continue;
                    }
                    shown.clone_from(value);
                }
                _ => self.attributes.insert(place, (name, value.clone())),
            }
            let _ = self.canvas.set_attribute(name, value);
        }
    }

    /// Clears the canvas and returns its width and height (CSS pixels).
    fn cleared(&mut self, window: &Window) -> [f64; 2] {
        let size_px = *self.size_px.get_or_insert_with(|| {
            let canvas = &self.canvas;
            let size = [f64::from(canvas.client_width()), f64::from(canvas.client_height())];
            let ratio = window.device_pixel_ratio();
            let [width, height] = size.map(|side| (side * ratio).round() as u32);
            // Setting the size also resets all other state of the context.
            canvas.set_width(width);
            canvas.set_height(height);
            let _ = self.context.set_transform(ratio, 0.0, 0.0, ratio, 0.0, 0.0);
            self.context.set_line_join("round");
            self.context.set_font("12px system-ui, sans-serif");
            self.context.set_text_align("center");
            self.dash = None;
            size
        });
        self.context.clear_rect(0.0, 0.0, size_px[0], size_px[1]);
        size_px
    }

    /// Sets the dashes for the lines that are drawn from now on.
    fn set_dash(&mut self, dash: Option<[f64; 2]>) {
        // Lengths of 0 represent a solid line.
        let wanted = dash.unwrap_or([0.0; 2]);
        let is_set = self.dash.as_ref().map_or(dash.is_none(), |(lengths, _)| *lengths == wanted);
        if !is_set {
            let list: js_sys::Array = dash.into_iter().flatten().map(JsValue::from).collect();
            let _ = self.context.set_line_dash(&list);
            self.dash = Some((wanted, list));
        }
    }
}

/// Calls back whenever the watched canvas changes its size.
pub(super) struct SizeWatcher {
    observer: ResizeObserver,
    watched: Option<HtmlCanvasElement>,
    _callback: Closure<dyn FnMut()>,
}

impl SizeWatcher {
    /// Creates a watcher that does not watch a canvas yet.
    pub(super) fn new(callback: impl FnMut() + 'static) -> Option<Self> {
        let callback = Closure::<dyn FnMut()>::new(callback);
        let observer = ResizeObserver::new(callback.as_ref().unchecked_ref()).ok()?;
        Some(Self { observer, watched: None, _callback: callback })
    }

    /// Watches this canvas instead of the previous one.
    pub(super) fn watch(&mut self, canvas: &HtmlCanvasElement) {
        if self.watched.as_ref() != Some(canvas) {
            self.observer.disconnect();
            self.observer.observe(canvas);
            self.watched = Some(canvas.clone());
        }
    }
}

/// Implements the drawing operations on a canvas.
struct Canvas<'a> {
    painter: &'a mut Painter,
    sheet: &'a mut Sheet,
}

impl Canvas<'_> {
    fn filled(&mut self, ink: Option<Ink>) {
        let Some(ink) = ink else { return };
        let sheet = &*self.sheet;
        sheet.context.set_global_alpha(ink.opacity);
        let _ = Reflect::set(&sheet.context, &sheet.names.fill, self.painter.css(ink.colour));
        sheet.context.fill();
    }

    fn stroked(&mut self, pen: Option<Pen>) {
        let Some(pen) = pen else { return };
        self.sheet.set_dash(pen.dash);
        let sheet = &*self.sheet;
        sheet.context.set_global_alpha(pen.ink.opacity);
        let _ = Reflect::set(&sheet.context, &sheet.names.stroke, self.painter.css(pen.ink.colour));
        sheet.context.set_line_width(pen.width);
        sheet.context.stroke();
    }
}

impl Brush for Canvas<'_> {
    fn path(&mut self, points: Points<'_>, closed: bool, fill: Option<Ink>, pen: Option<Pen>) {
        let context = &self.sheet.context;
        context.begin_path();
        let mut is_lifted = true;
        for [x, y] in points {
            match is_lifted {
                // The browser ignores a point with a NaN coordinate. The next point starts a new
                // line.
                false => context.line_to(x, y),
                true => context.move_to(x, y),
            }
            is_lifted = x.is_nan();
        }
        if closed {
            context.close_path();
        }
        self.filled(fill);
        self.stroked(pen);
    }

    fn circle(&mut self, [x, y]: [f64; 2], radius: f64, fill: Option<Ink>, outline: Option<Pen>) {
        self.sheet.context.begin_path();
        let _ = self.sheet.context.arc(x, y, radius, 0.0, TAU);
        self.filled(fill);
        self.stroked(outline);
    }

    fn words(&mut self, text: &str, [x, y]: [f64; 2], colour: Colour) {
        let css = self.painter.css(colour);
        self.sheet.context.set_global_alpha(1.0);
        let _ = Reflect::set(&self.sheet.context, &self.sheet.names.fill, css);
        let _ = self.sheet.context.fill_text(text, x, y);
    }
}
