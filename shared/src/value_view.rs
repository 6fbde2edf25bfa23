//! Views of a value function: their links, maps at one relative heading, and optimal play from a state.
//!
//! Maps are in the evader's frame: the evader is at the origin and heads along +x; the pursuer is
//! at (x, y) (m), and ψ is its heading relative to the evader's heading.

mod view;
mod scale;
mod map;
mod difference;
mod play;
mod world;
mod slices;
mod mesh;
mod orbit;

pub use difference::{AtHeading, Difference};
pub use map::{Map, domain};
pub use mesh::{Mesh, Tubes};
pub use orbit::{Orbit, RING, TONES, tube};
pub use play::{Play, play};
pub use scale::Scale;
pub use slices::{caption, slices};
pub use view::{Shown, View, ZOOM_PERCENT, parameter};
