//! Figures of value functions, as SVG or PNG.
//!
//! The SVG is drawn with plotters; the PNG is that SVG rendered by resvg with the fonts
//! in `fonts/`, so that both show the same and neither needs a font on the machine.

mod canvas;
mod pareto;
mod regions;
mod label_position;
mod slices;
mod tube;

use resvg::{tiny_skia, usvg};
use sidestep::reachability::ValueFunction;
use std::sync::Arc;

pub use canvas::DrawError;
pub use pareto::pareto;
pub use regions::{DangerZone, DrawnSet, RegionsPanel, regions, shown_steps};
pub use slices::slices;
pub use tube::tube;

/// Pixels of a PNG for each one of the SVG.
const PNG_SCALE: f32 = 2.0;

/// An SVG as a PNG of twice its size.
///
/// # Errors
/// [`DrawError`] if the SVG cannot be read or the picture is too large.
pub fn png(svg: &str) -> Result<Vec<u8>, DrawError> {
    let mut options = usvg::Options::default();
    let fonts = Arc::make_mut(&mut options.fontdb);
    fonts.load_font_data(include_bytes!("figure/fonts/DejaVuSans.ttf").to_vec());
    fonts.load_font_data(include_bytes!("figure/fonts/DejaVuSans-Bold.ttf").to_vec());
    let tree = usvg::Tree::from_str(svg, &options).map_err(|e| DrawError(e.to_string()))?;
    let size = tree.size();
    let pixels = |length: f32| (length * PNG_SCALE).ceil() as u32;
    let mut pixmap = tiny_skia::Pixmap::new(pixels(size.width()), pixels(size.height()))
        .ok_or_else(|| DrawError("the picture is too large".to_owned()))?;
    let scale = tiny_skia::Transform::from_scale(PNG_SCALE, PNG_SCALE);
    resvg::render(&tree, scale, &mut pixmap.as_mut());
    pixmap.encode_png().map_err(|e| DrawError(e.to_string()))
}

/// One line that says which function it is.
fn caption(function: &ValueFunction) -> String {
    let game = function.game();
    let (how, horizon) = match function {
        ValueFunction::Exact(_) => ("closed form", f64::INFINITY),
        ValueFunction::Sampled(samples) => ("solved on a grid", samples.horizon_s()),
    };
    let horizon = if horizon.is_finite() { format!("{horizon} s") } else { "∞".to_owned() };
    format!(
        "evader {} m/s, {} rad/s  ·  pursuer {} m/s, {} rad/s  ·  radius {} m  ·  horizon {horizon}  ·  {how}",
        game.evader.speed_mps,
        game.evader.turn_rate_radps,
        game.pursuer.speed_mps,
        game.pursuer.turn_rate_radps,
        game.radius_m,
    )
}
