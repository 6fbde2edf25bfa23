//! Paints pictures.

use crate::shape::{Camera, Picture, Shape, Tail, VEHICLE_LENGTH_M};
use js_sys::Reflect;
use sidestep::chart::{Colour, Ink, Pen, colours};
use sidestep::math::{TAU, sin_cos};
use sidestep::vehicle::Pose;
use wasm_bindgen::prelude::*;
use web_sys::{CanvasRenderingContext2d, Document, HtmlCanvasElement, ResizeObserver, Window};

/// Paints in the colours of light or dark ground, as the user prefers. What it needs of the
/// browser it asks for once, so that a frame makes no new object there.
#[derive(Default)]
pub(super) struct Painter {
    is_dark: bool,
    /// Colours that were used, as CSS writes them.
    colours: Vec<(Colour, JsValue)>,
    sheet: Option<Sheet>,
}

/// A canvas to paint on.
struct Sheet {
    id: &'static str,
    canvas: HtmlCanvasElement,
    context: CanvasRenderingContext2d,
    /// Its attributes as they are.
    attributes: Vec<(&'static str, String)>,
    /// Width and height, CSS pixels, once they are measured.
    size_px: Option<[f64; 2]>,
    names: Names,
    /// Dashes of the last line, as lengths and as a list of the browser's.
    dash: Option<([f64; 2], js_sys::Array)>,
}

/// Names of a context's properties.
struct Names {
    fill: JsValue,
    stroke: JsValue,
}

impl Painter {
    /// Changes between light and dark ground.
    pub(super) fn set_dark(&mut self, is_dark: bool) {
        self.is_dark = is_dark;
        self.colours.clear();
    }

    /// The canvas has another size, or its pixels have.
    pub(super) fn measure_again(&mut self) {
        if let Some(sheet) = &mut self.sheet {
            sheet.size_px = None;
        }
    }

    /// Finds the canvas with this id and paints there from now on.
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

    /// Paints a picture on its canvas, if that was found.
    pub(super) fn paint(&mut self, window: &Window, picture: &Picture) {
        let Some(mut sheet) = self.sheet.take() else { return };
        if sheet.id == picture.canvas {
            sheet.tell(&picture.attributes);
            let size_px = sheet.cleared(window);
            let camera = Camera::showing(picture.window, size_px);
            let mut brush = Brush { painter: self, sheet: &mut sheet, camera };
            for shape in &picture.shapes {
                brush.shape(shape);
            }
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

    /// Clears it; its width and height, CSS pixels.
    fn cleared(&mut self, window: &Window) -> [f64; 2] {
        let size_px = *self.size_px.get_or_insert_with(|| {
            let canvas = &self.canvas;
            let size = [f64::from(canvas.client_width()), f64::from(canvas.client_height())];
            let ratio = window.device_pixel_ratio();
            let [width, height] = size.map(|side| (side * ratio).round() as u32);
            // This also makes everything else about the context as it was at first.
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

    /// Draws lines with these dashes from now on.
    fn set_dash(&mut self, dash: Option<[f64; 2]>) {
        // No dashes are dashes without gaps.
        let wanted = dash.unwrap_or([0.0; 2]);
        let is_set = self.dash.as_ref().map_or(dash.is_none(), |(lengths, _)| *lengths == wanted);
        if !is_set {
            let list: js_sys::Array = dash.into_iter().flatten().map(JsValue::from).collect();
            let _ = self.context.set_line_dash(&list);
            self.dash = Some((wanted, list));
        }
    }
}

/// Calls back when the canvas that it watches has another size, whatever the reason.
pub(super) struct SizeWatcher {
    observer: ResizeObserver,
    watched: Option<HtmlCanvasElement>,
    _callback: Closure<dyn FnMut()>,
}

impl SizeWatcher {
    /// Watches nothing yet.
    pub(super) fn new(callback: impl FnMut() + 'static) -> Option<Self> {
        let callback = Closure::<dyn FnMut()>::new(callback);
        let observer = ResizeObserver::new(callback.as_ref().unchecked_ref()).ok()?;
        Some(Self { observer, watched: None, _callback: callback })
    }

    /// Watches this canvas alone from now on.
    pub(super) fn watch(&mut self, canvas: &HtmlCanvasElement) {
        if self.watched.as_ref() != Some(canvas) {
            self.observer.disconnect();
            self.observer.observe(canvas);
            self.watched = Some(canvas.clone());
        }
    }
}

struct Brush<'a> {
    painter: &'a mut Painter,
    sheet: &'a mut Sheet,
    camera: Camera,
}

impl Brush<'_> {
    fn shape(&mut self, shape: &Shape) {
        match shape {
            Shape::Polygon { points, fill, outline } => {
                self.trace(points);
                self.sheet.context.close_path();
                self.fill(*fill);
                self.stroke(*outline);
            }
            Shape::Polyline { points, pen } => {
                self.trace(points);
                self.stroke(*pen);
            }
            Shape::Disc { centre, radius_m, fill, outline } => {
                self.circle(self.camera.to_px(*centre), radius_m * self.camera.scale);
                self.fill(*fill);
                self.stroke(*outline);
            }
            Shape::Vehicle { tail, pose, colour } => self.vehicle(*tail, *pose, *colour),
            Shape::Label { at, text, colour } => self.label(*at, text, *colour),
            Shape::Square { centre, side_m, colour } => {
                let side = (side_m * self.camera.scale).max(9.0);
                let [x, y] = self.camera.to_px(*centre);
                self.sheet.context.begin_path();
                self.sheet.context.rect(x - 0.5 * side, y - 0.5 * side, side, side);
                self.fill((*colour).into());
            }
            Shape::Grid { every_m } => self.grid(*every_m),
        }
    }

    fn trace(&self, points: &[[f64; 2]]) {
        self.sheet.context.begin_path();
        for &point in points {
            let [x, y] = self.camera.to_px(point);
            self.sheet.context.line_to(x, y);
        }
    }

    fn circle(&self, [x, y]: [f64; 2], radius: f64) {
        self.sheet.context.begin_path();
        let _ = self.sheet.context.arc(x, y, radius, 0.0, TAU);
    }

    fn fill(&mut self, ink: Ink) {
        let sheet = &*self.sheet;
        sheet.context.set_global_alpha(ink.opacity);
        let _ = Reflect::set(&sheet.context, &sheet.names.fill, self.painter.css(ink.colour));
        sheet.context.fill();
    }

    fn stroke(&mut self, pen: Pen) {
        self.sheet.set_dash(pen.dash);
        let sheet = &*self.sheet;
        sheet.context.set_global_alpha(pen.ink.opacity);
        let _ = Reflect::set(&sheet.context, &sheet.names.stroke, self.painter.css(pen.ink.colour));
        sheet.context.set_line_width(pen.width);
        sheet.context.stroke();
    }

    /// Tail, shaft and head.
    fn vehicle(&mut self, tail: Tail, pose: Pose, colour: Colour) {
        // Along the heading and to its left, in lengths of the arrow.
        const OUTLINE: [(f64, f64); 7] = [
            (0.0, 0.036),
            (0.72, 0.036),
            (0.72, 0.15),
            (1.0, 0.0),
            (0.72, -0.15),
            (0.72, -0.036),
            (0.0, -0.036),
        ];
        const SQUARE: [(f64, f64); 4] =
            [(0.085, 0.085), (0.085, -0.085), (-0.085, -0.085), (-0.085, 0.085)];
        let length = (VEHICLE_LENGTH_M * self.camera.scale).max(26.0);
        let [x, y] = self.camera.to_px(pose.position());
        let (sin, cos) = sin_cos(pose.psi);
        let trace = |context: &CanvasRenderingContext2d, outline: &[(f64, f64)]| {
            context.begin_path();
            for (along, left) in outline {
                let right = x + length * (along * cos - left * sin);
                context.line_to(right, y - length * (along * sin + left * cos));
            }
            context.close_path();
        };
        match tail {
            Tail::Dot => self.circle([x, y], 0.085 * length),
            Tail::Square => trace(&self.sheet.context, &SQUARE),
        }
        self.fill(colour.into());
        trace(&self.sheet.context, &OUTLINE);
        self.fill(colour.into());
    }

    /// Words below a position.
    fn label(&mut self, at: [f64; 2], text: &str, colour: Colour) {
        const BELOW_PX: f64 = 24.0;
        let [x, y] = self.camera.to_px(at);
        let css = self.painter.css(colour);
        let _ = Reflect::set(&self.sheet.context, &self.sheet.names.fill, css);
        let _ = self.sheet.context.fill_text(text, x, y + BELOW_PX);
    }

    /// Grid lines, and a bar as long as their distance.
    fn grid(&mut self, every_m: u32) {
        let step_m = f64::from(every_m);
        let [width, height] = self.camera.size_px;
        let low = self.camera.to_world([0.0, height]);
        let high = self.camera.to_world([width, 0.0]);
        self.sheet.context.begin_path();
        for axis in [0, 1] {
            let first = (low[axis] / step_m).ceil() as i64;
            let last = (high[axis] / step_m).floor() as i64;
            for line in first..=last {
                let at = line as f64 * step_m;
                // Half a pixel keeps one-pixel lines crisp.
                let px = self.camera.to_px([at, at])[axis].round() + 0.5;
                let (from, to) =
                    if axis == 0 { ((px, 0.0), (px, height)) } else { ((0.0, px), (width, px)) };
                self.sheet.context.move_to(from.0, from.1);
                self.sheet.context.line_to(to.0, to.1);
            }
        }
        self.stroke(Pen::new(colours::GRID, 1.0));
        let (left, bottom, length) = (22.0, height - 18.0, step_m * self.camera.scale);
        self.sheet.context.begin_path();
        self.sheet.context.move_to(left, bottom);
        self.sheet.context.line_to(left + length, bottom);
        self.stroke(Pen::new(colours::MUTED, 1.5));
        let css = self.painter.css(colours::MUTED);
        let _ = Reflect::set(&self.sheet.context, &self.sheet.names.fill, css);
        let _ = self.sheet.context.fill_text(
            &format!("{every_m} m"),
            left + 0.5 * length,
            bottom - 6.0,
        );
    }
}
