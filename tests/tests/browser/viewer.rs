//! Pages with heavy drawing and computing. Tests run in the order of their names, so that these
//! come last, after those that measure the timing of steps.

mod beside;
mod demo;
mod explorer;
mod figures;
mod reachability;
mod tour;
