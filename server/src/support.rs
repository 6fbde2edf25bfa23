//! Basic modules for the rest of the server. They do not depend on studies.

pub mod tls_client;
pub mod clock;
pub mod threads;
pub mod secrets;
pub(crate) mod private;
pub mod bytes;
