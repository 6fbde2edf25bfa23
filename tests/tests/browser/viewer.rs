//! Pages with heavy drawing and computing. Tests run in the order of their names, so these tests
//! run last, after the tests that measure the timing of steps.

mod beside;
mod demo;
mod explorer;
mod figures;
mod reachability;
mod tour;
