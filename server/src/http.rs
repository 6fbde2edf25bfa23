//! The server's face: one module a resource, the one table of routes, and what every
//! request passes on its way in and out.

pub mod error;
pub mod json;
pub mod params;
pub mod throttle;
pub mod answers;
pub mod bounded;
pub mod listen;
pub mod app;
pub mod metrics;
pub mod auth;
pub mod guard;
pub mod studies;
pub mod participants;
pub mod trials;
pub mod value_functions;
pub mod session;
pub mod laboratory;
pub mod analyses;
pub mod site;
pub mod routes;
