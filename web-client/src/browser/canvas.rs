//! Paints pictures.

use crate::shape::{Camera, ColourToken, Picture, Shape, Stroke, VEHICLE_LENGTH_M};
use sidestep::math::{TAU, sin_cos};
use sidestep::vehicle::Pose;
use wasm_bindgen::prelude::*;
use web_sys::{CanvasRenderingContext2d, Document, HtmlCanvasElement, ResizeObserver, Window};

/// Paints, with the colours of the style sheet.
#[derive(Default)]
pub(super) struct Painter {
    colours: Vec<(ColourToken, String)>,
    font: String,
}

impl Painter {
    /// The style sheet has changed, from light to dark say.
    pub(super) fn forget_style(&mut self) {
        self.colours.clear();
    }

    fn read_style(&mut self, window: &Window, document: &Document) {
        let style = document.document_element().and_then(|e| window.get_computed_style(&e).ok()?);
        let Some(style) = style else { return };
        let read =
            |name: &str| style.get_property_value(name).unwrap_or_default().trim().to_owned();
        self.colours = ColourToken::ALL.map(|colour| (colour, read(colour.property()))).to_vec();
        self.font = format!("12px {}", read("font-family"));
    }

    fn colour(&self, colour: ColourToken) -> &str {
        self.colours.iter().find(|(known, _)| *known == colour).map_or("", |(_, colour)| colour)
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
        if self.colours.is_empty() {
            self.read_style(window, document);
        }
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
        let brush = Brush {
            painter: self,
            context: &context,
            camera: Camera::showing(picture.window, size),
        };
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
    painter: &'a Painter,
    context: &'a CanvasRenderingContext2d,
    camera: Camera,
}

impl Brush<'_> {
    fn shape(&self, shape: &Shape) {
        match shape {
            Shape::Polygon { points, fill, stroke } => {
                self.trace(points);
                self.context.close_path();
                self.fill_and_stroke(*fill, *stroke);
            }
            Shape::Polyline { points, stroke } => {
                self.trace(points);
                self.fill_and_stroke(None, Some(*stroke));
            }
            Shape::Disc { centre, radius_m, fill, stroke } => {
                self.circle(self.camera.to_px(*centre), radius_m * self.camera.scale);
                self.fill_and_stroke(*fill, *stroke);
            }
            Shape::Vehicle { pose, colour } => self.vehicle(*pose, *colour),
            Shape::Square { centre, side_m, colour } => {
                let side = (side_m * self.camera.scale).max(9.0);
                let [x, y] = self.camera.to_px(*centre);
                self.context.set_fill_style_str(self.painter.colour(*colour));
                self.context.fill_rect(x - 0.5 * side, y - 0.5 * side, side, side);
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

    fn fill_and_stroke(&self, fill: Option<(ColourToken, f64)>, stroke: Option<Stroke>) {
        if let Some((colour, opacity)) = fill {
            self.context.set_global_alpha(opacity);
            self.context.set_fill_style_str(self.painter.colour(colour));
            self.context.fill();
            self.context.set_global_alpha(1.0);
        }
        if let Some(stroke) = stroke {
            let dash = js_sys::Array::new();
            if let Some((line, gap)) = stroke.dash_px {
                dash.push(&line.into());
                dash.push(&gap.into());
            }
            let _ = self.context.set_line_dash(&dash);
            self.context.set_stroke_style_str(self.painter.colour(stroke.colour));
            self.context.set_line_width(stroke.width_px);
            self.context.set_line_join("round");
            self.context.stroke();
        }
    }

    /// Tail dot, shaft and head.
    fn vehicle(&self, pose: Pose, colour: ColourToken) {
        let length = (VEHICLE_LENGTH_M * self.camera.scale).max(26.0);
        let [x, y] = self.camera.to_px(pose.position());
        let (sin, cos) = sin_cos(pose.psi);
        // Along the heading and to its left, in pixels (y down).
        let at = |along: f64, left: f64| {
            (x + length * (along * cos - left * sin), y - length * (along * sin + left * cos))
        };
        self.context.set_fill_style_str(self.painter.colour(colour));
        self.circle([x, y], 0.085 * length);
        self.context.fill();
        self.context.begin_path();
        let outline = [
            (0.0, 0.036),
            (0.72, 0.036),
            (0.72, 0.15),
            (1.0, 0.0),
            (0.72, -0.15),
            (0.72, -0.036),
            (0.0, -0.036),
        ];
        for (along, left) in outline {
            let (x, y) = at(along, left);
            self.context.line_to(x, y);
        }
        self.context.close_path();
        self.context.fill();
    }

    /// Lines every so many metres, and a bar that tells how many.
    fn grid(&self, every_m: u32) {
        let step_m = f64::from(every_m);
        let [width, height] = self.camera.size_px;
        let low = self.camera.to_world([0.0, height]);
        let high = self.camera.to_world([width, 0.0]);
        self.context.begin_path();
        for (axis, extent) in [(0, height), (1, width)] {
            let first = (low[axis] / step_m).ceil() as i64;
            let last = (high[axis] / step_m).floor() as i64;
            for line in first..=last {
                let at = line as f64 * step_m;
                // Half a pixel keeps one-pixel lines crisp.
                let px = self.camera.to_px([at, at])[axis].round() + 0.5;
                let (from, to) =
                    if axis == 0 { ((px, 0.0), (px, extent)) } else { ((0.0, px), (extent, px)) };
                self.context.move_to(from.0, from.1);
                self.context.line_to(to.0, to.1);
            }
        }
        self.fill_and_stroke(None, Some(Stroke::solid(ColourToken::Grid, 1.0)));
        let (left, bottom, length) = (22.0, height - 18.0, step_m * self.camera.scale);
        self.context.begin_path();
        self.context.move_to(left, bottom);
        self.context.line_to(left + length, bottom);
        self.fill_and_stroke(None, Some(Stroke::solid(ColourToken::Muted, 1.5)));
        self.context.set_font(&self.painter.font);
        self.context.set_text_align("center");
        self.context.set_fill_style_str(self.painter.colour(ColourToken::Muted));
        let _ = self.context.fill_text(&format!("{every_m} m"), left + 0.5 * length, bottom - 6.0);
    }
}
