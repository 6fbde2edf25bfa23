//! The client side of TLS, for databases and for the servers that commands call.

use rustls::{ClientConfig, RootCertStore};
use std::sync::Arc;

/// A configuration that trusts certificates signed by these authorities.
///
/// # Errors
/// If the protocol versions are not supported. This build supports them, so no error is expected.
pub fn config(roots: RootCertStore) -> Result<ClientConfig, rustls::Error> {
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider);
    let config = config.with_safe_default_protocol_versions()?;
    Ok(config.with_root_certificates(roots).with_no_client_auth())
}

/// The certificate authorities of this system, or of the file in SSL_CERT_FILE. If there are none,
/// an error occurs only when a client connects.
#[must_use]
pub fn system_roots() -> RootCertStore {
    let mut roots = RootCertStore::empty();
    roots.add_parsable_certificates(rustls_native_certs::load_native_certs().certs);
    roots
}
