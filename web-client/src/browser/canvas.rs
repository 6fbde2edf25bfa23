//! Paints pictures.

use crate::shape::{Camera, Picture, Shape, VEHICLE_LENGTH_M};
use sidestep::chart::{Colour, Ink, Pen, colours};
use sidestep::math::{TAU, sin_cos};
use sidestep::vehicle::Pose;
use wasm_bindgen::prelude::*;
use web_sys::{CanvasRenderingContext2d, Document, HtmlCanvasElement, ResizeObserver, Window};

/// Paints in the colours of light or dark ground, as the user prefers.
#[derive(Default)]
pub(super) struct Painter {
    is_dark: bool,
    /// Colours that were used, as CSS writes them.
    colours: Vec<(Colour, String)>,
}

impl Painter {
    /// Changes between light and dark ground.
    pub(super) fn set_dark(&mut self, is_dark: bool) {
        self.is_dark = is_dark;
        self.colours.clear();
    }

    fn css(&mut self, colour: Colour) -> &str {
        let known = self.colours.iter().position(|(known, _)| *known == colour);
        let place = known.unwrap_or_else(|| {
            let [red, green, blue] = if self.is_dark { colour.dark } else { colour.light };
            self.colours.push((colour, format!("rgb({red} {green} {blue})")));
            self.colours.len() - 1
        });
        &self.colours[place].1
    }

    /// Paints a picture on its canvas and returns that, if it is in the document.
    pub(super) fn paint(
        &mut self,
        window: &Window,
        document: &Document,
        picture: &Picture,
    ) -> Option<HtmlCanvasElement> {
        let canvas: HtmlCanvasElement =
            document.get_element_by_id(picture.canvas)?.dyn_into().ok()?;
        let context = canvas.get_context("2d").ok().flatten()?;
        let context: CanvasRenderingContext2d = context.dyn_into().ok()?;
        for (name, value) in &picture.attributes {
            if canvas.get_attribute(name).as_deref() != Some(value) {
                let _ = canvas.set_attribute(name, value);
            }
        }
        let ratio = window.device_pixel_ratio();
        let size = [f64::from(canvas.client_width()), f64::from(canvas.client_height())];
        let device = size.map(|side| (side * ratio).round() as u32);
        if [canvas.width(), canvas.height()] != device {
            canvas.set_width(device[0]);
            canvas.set_height(device[1]);
        }
        let _ = context.set_transform(ratio, 0.0, 0.0, ratio, 0.0, 0.0);
        context.clear_rect(0.0, 0.0, size[0], size[1]);
        let camera = Camera::showing(picture.window, size);
        let mut brush = Brush { painter: self, context, camera };
        for shape in &picture.shapes {
            brush.shape(shape);
        }
        Some(canvas)
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
    context: CanvasRenderingContext2d,
    camera: Camera,
}

impl Brush<'_> {
    fn shape(&mut self, shape: &Shape) {
        match shape {
            Shape::Polygon { points, fill, outline } => {
                self.trace(points);
                self.context.close_path();
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
            Shape::Vehicle { pose, colour } => self.vehicle(*pose, *colour),
            Shape::Square { centre, side_m, colour } => {
                let side = (side_m * self.camera.scale).max(9.0);
                let [x, y] = self.camera.to_px(*centre);
                self.context.begin_path();
                self.context.rect(x - 0.5 * side, y - 0.5 * side, side, side);
                self.fill((*colour).into());
            }
            Shape::Grid { every_m } => self.grid(*every_m),
        }
    }

    fn trace(&self, points: &[[f64; 2]]) {
        self.context.begin_path();
        for &point in points {
            let [x, y] = self.camera.to_px(point);
            self.context.line_to(x, y);
        }
    }

    fn circle(&self, [x, y]: [f64; 2], radius: f64) {
        self.context.begin_path();
        let _ = self.context.arc(x, y, radius, 0.0, TAU);
    }

    fn fill(&mut self, ink: Ink) {
        self.context.set_global_alpha(ink.opacity);
        self.context.set_fill_style_str(self.painter.css(ink.colour));
        self.context.fill();
        self.context.set_global_alpha(1.0);
    }

    fn stroke(&mut self, pen: Pen) {
        let dash = pen.dash.into_iter().flatten().map(JsValue::from).collect::<js_sys::Array>();
        let _ = self.context.set_line_dash(&dash);
        self.context.set_global_alpha(pen.ink.opacity);
        self.context.set_stroke_style_str(self.painter.css(pen.ink.colour));
        self.context.set_line_width(pen.width);
        self.context.set_line_join("round");
        self.context.stroke();
        self.context.set_global_alpha(1.0);
    }

    /// Tail dot, shaft and head.
    fn vehicle(&mut self, pose: Pose, colour: Colour) {
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
        let length = (VEHICLE_LENGTH_M * self.camera.scale).max(26.0);
        let [x, y] = self.camera.to_px(pose.position());
        let (sin, cos) = sin_cos(pose.psi);
        self.circle([x, y], 0.085 * length);
        self.fill(colour.into());
        self.context.begin_path();
        for (along, left) in OUTLINE {
            let right = x + length * (along * cos - left * sin);
            self.context.line_to(right, y - length * (along * sin + left * cos));
        }
        self.context.close_path();
        self.fill(colour.into());
    }

    /// Grid lines, and a bar as long as their distance.
    fn grid(&mut self, every_m: u32) {
        let step_m = f64::from(every_m);
        let [width, height] = self.camera.size_px;
        let low = self.camera.to_world([0.0, height]);
        let high = self.camera.to_world([width, 0.0]);
        self.context.begin_path();
        for axis in [0, 1] {
            let first = (low[axis] / step_m).ceil() as i64;
            let last = (high[axis] / step_m).floor() as i64;
            for line in first..=last {
                let at = line as f64 * step_m;
                // Half a pixel keeps one-pixel lines crisp.
                let px = self.camera.to_px([at, at])[axis].round() + 0.5;
                let (from, to) =
                    if axis == 0 { ((px, 0.0), (px, height)) } else { ((0.0, px), (width, px)) };
                self.context.move_to(from.0, from.1);
                self.context.line_to(to.0, to.1);
            }
        }
        self.stroke(Pen::new(colours::GRID, 1.0));
        let (left, bottom, length) = (22.0, height - 18.0, step_m * self.camera.scale);
        self.context.begin_path();
        self.context.move_to(left, bottom);
        self.context.line_to(left + length, bottom);
        self.stroke(Pen::new(colours::MUTED, 1.5));
        self.context.set_font("12px system-ui, sans-serif");
        self.context.set_text_align("center");
        self.context.set_fill_style_str(self.painter.css(colours::MUTED));
        let _ = self.context.fill_text(&format!("{every_m} m"), left + 0.5 * length, bottom - 6.0);
    }
}
