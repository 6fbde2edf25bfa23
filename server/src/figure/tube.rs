//! Draws {V ≤ 0} as a solid, like the laboratory's reachability page.

use sidestep::chart::Drawing;
use sidestep::reachability::ValueFunction;
use sidestep::value_view::{Orbit, Tubes, View, domain};

/// Width and height of the solid's box (px), and the zoom. At zoom 1, the solid fits from every
/// viewpoint.
const SIZE: [f64; 2] = [900.0, 820.0];
const ZOOM: f64 = 1.08;

/// The solid {V ≤ 0}, from the page's initial viewpoint.
#[must_use]
pub fn tube(function: &ValueFunction) -> Drawing {
    let window = domain(function);
    let mesh = Tubes::new(function, window).mesh(function, 0.0);
    let orbit = Orbit::new(window, View::default().turned_deg, ZOOM, SIZE);
    sidestep::value_view::tube(function, 0.0, &mesh, &orbit)
}
