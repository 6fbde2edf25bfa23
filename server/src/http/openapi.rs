//! The OpenAPI document: each route says, by the types of its handler, what it takes and what it answers.

pub mod problems;
pub mod schemas;
pub mod operation;
pub mod handler;
pub mod document;
pub mod table;
