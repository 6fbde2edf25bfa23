//! What the rest of the server builds on, and knows nothing of studies.

pub mod tls_client;
pub mod clock;
pub mod threads;
pub mod secrets;
pub(crate) mod private;
pub mod bytes;
