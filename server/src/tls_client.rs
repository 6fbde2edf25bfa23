//! The client's side of TLS: to a database, and to the servers that commands ask.

use rustls::{ClientConfig, RootCertStore};
use std::sync::Arc;

/// Trusts what these authorities have signed.
///
/// # Errors
/// None that is known: this build has the protocol versions that it asks for.
pub fn config(roots: RootCertStore) -> Result<ClientConfig, rustls::Error> {
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider);
    let config = config.with_safe_default_protocol_versions()?;
    Ok(config.with_root_certificates(roots).with_no_client_auth())
}

/// The authorities of this system, or those in the file that SSL_CERT_FILE names. Without any, a connection
/// is refused with its own message.
#[must_use]
pub fn system_roots() -> RootCertStore {
    let mut roots = RootCertStore::empty();
    roots.add_parsable_certificates(rustls_native_certs::load_native_certs().certs);
    roots
}
