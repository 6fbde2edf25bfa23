//! The OpenAPI document. The types of each route's handler describe its requests and responses.

pub mod problems;
pub mod schemas;
pub mod operation;
pub mod handler;
pub mod document;
pub mod table;
