//! Pages that draw and compute much. Tests run in the order of their names, so that these come last, after
//! those that watch the time of steps.

mod beside;
mod demo;
mod explorer;
mod figures;
mod reachability;
mod tour;
