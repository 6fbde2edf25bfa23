//! A value function and its pictures. Each picture is created on first use.

use sidestep::chart::{ColourStyle, Element};
use sidestep::picture::Window;
use sidestep::reachability::{ExactValue, Nodes, ValueFunction};
use sidestep::value_view::{AtHeading, Difference, Map, Mesh, Scale, Shown, Tubes, View, domain};
use std::rc::Rc;

/// The current value function.
pub(super) struct Found {
    function: ValueFunction,
    /// Duration of the solve (s).
    seconds: Option<f64>,
    window: Window,
    scale: Scale,
    /// The current map with its quantity, its heading (degrees), and its view element.
    map: Option<(Shown, u16, Map, Element)>,
    /// The difference from the closed form. `None` if there is no closed form or if this function
    /// is the closed form.
    difference: Option<Difference>,
    /// Maximum and mean error at the current heading (m).
    errors_m: Option<[f64; 2]>,
    /// The values from which the tubes of all levels are computed, and the tube of the current
    /// level.
    tubes: Option<Tubes>,
    tube: Option<(f64, Rc<Mesh>)>,
    /// See [`Self::is_new`].
    is_new: bool,
}

impl Found {
    pub(super) fn new(function: ValueFunction, seconds: Option<f64>) -> Self {
        let window = domain(&function);
        let scale = Scale::of(&function, window);
        Self {
            function,
            seconds,
            window,
            scale,
            map: None,
            difference: None,
            errors_m: None,
            tubes: None,
            tube: None,
            is_new: true,
        }
    }

    pub(super) fn function(&self) -> &ValueFunction {
        &self.function
    }

    pub(super) fn seconds(&self) -> Option<f64> {
        self.seconds
    }

    pub(super) fn window(&self) -> Window {
        self.window
    }

    /// How far one key press moves the cross-hair (m), which is a hundredth of the window's width.
    pub(super) fn key_step_m(&self) -> f64 {
        0.01 * (self.window.high[0] - self.window.low[0])
    }

    /// Whether this is the first call of this method.
    pub(super) fn is_new(&mut self) -> bool {
        std::mem::take(&mut self.is_new)
    }

    /// The closed form for this function's game. `None` if there is no closed form or if this
    /// function is the closed form.
    pub(super) fn closed_form(&self) -> Option<ExactValue> {
        match &self.function {
            ValueFunction::Exact(_) => None,
            ValueFunction::Sampled(samples) if samples.horizon_s().is_finite() => None,
            ValueFunction::Sampled(samples) => samples.game().exact().ok(),
        }
    }

    /// Draws the picture for a view, unless it is already drawn.
    pub(super) fn draw(&mut self, view: &View, width: f64) {
        if view.shown == Shown::Tube {
            self.draw_tube(view.level_m);
        }
        let is_known = self.map.as_ref().is_some_and(|(shown, psi_deg, map, _)| {
            let known_px = map.drawing.size[0];
            (*shown, *psi_deg, known_px) == (view.shown, view.psi_deg, width)
        });
        if is_known || view.shown == Shown::Tube {
            return;
        }
        let map = match (view.shown, self.closed_form()) {
            (Shown::Error, Some(exact)) => {
                let (function, window) = (&self.function, self.window);
                let difference = self
                    .difference
                    .get_or_insert_with(|| Difference::new(function, &exact, window));
                let AtHeading { map, greatest_m, mean_m } =
                    difference.at(function, &exact, view.psi(), width);
                self.errors_m = Some([greatest_m, mean_m]);
                map
            }
            _ => Map::of_value(&self.function, view.psi(), self.window, &self.scale, width),
        };
        let element = map.drawing.element(ColourStyle::Properties);
        self.map = Some((view.shown, view.psi_deg, map, element));
    }

    fn draw_tube(&mut self, level_m: f64) {
        if self.tube.as_ref().is_some_and(|(level, _)| *level == level_m) {
            return;
        }
        let (function, window) = (&self.function, self.window);
        let tubes = self.tubes.get_or_insert_with(|| Tubes::new(function, window));
        let mesh = tubes.mesh(function, level_m);
        self.tube = Some((level_m, Rc::new(mesh)));
    }

    /// The mesh of the last tube drawn.
    pub(super) fn mesh(&self) -> Option<Rc<Mesh>> {
        self.tube.as_ref().map(|(_, mesh)| Rc::clone(mesh))
    }

    /// The last map drawn.
    pub(super) fn map(&self) -> Option<&Map> {
        self.map.as_ref().map(|(.., map, _)| map)
    }

    /// The last map drawn, as an element.
    pub(super) fn element(&self) -> Option<Element> {
        self.map.as_ref().map(|(.., element)| element.clone())
    }

    /// The position (m) at a point of the picture. The point is given in fractions of the picture's
    /// width and height.
    pub(super) fn at(&self, shares: [f64; 2]) -> Option<[f64; 2]> {
        let map = self.map()?;
        map.at_px([0, 1].map(|d| shares[d] * map.drawing.size[d]))
    }

    /// The errors at all headings, and the maximum and mean error at the current heading (m).
    pub(super) fn errors(&self) -> Option<(&Difference, [f64; 2])> {
        Some((self.difference.as_ref()?, self.errors_m?))
    }

    /// How the function was computed, in words.
    pub(super) fn how(&self) -> String {
        match &self.function {
            ValueFunction::Exact(_) => "closed form".to_owned(),
            ValueFunction::Sampled(samples) => {
                let [a, b, c] = match samples.nodes() {
                    Nodes::Polar { range_nodes, angle_nodes, .. } => {
                        [range_nodes, angle_nodes, angle_nodes]
                    }
                    nodes @ Nodes::Cartesian { .. } => nodes.shape(),
                };
                let coordinates = match samples.nodes() {
                    Nodes::Polar { .. } => "polar",
                    Nodes::Cartesian { .. } => "cartesian",
                };
                format!("{coordinates}, {a} × {b} × {c} nodes")
            }
        }
    }
}
