//! The HTTP interface: a module for each resource, the one table of routes, and the layers around every
//! request.

pub mod error;
pub mod throttle;
pub mod answers;
pub mod bounded;
pub mod lengths;
pub mod app;
pub mod openapi;
pub mod listen;
pub mod json;
pub mod params;
pub mod metrics;
pub mod endings;
pub mod auth;
pub mod experimenters;
pub mod guard;
pub mod studies;
pub mod texts;
pub mod enrolment;
pub mod participants;
pub mod trials;
pub mod value_functions;
pub mod session;
pub mod changes;
pub mod configurations;
pub mod laboratory;
pub mod exports;
pub mod people;
pub mod profiles;
pub mod analyses;
pub mod predictors;
pub mod keys;
pub mod docs;
pub mod interface;
pub mod site;
pub mod routes;
