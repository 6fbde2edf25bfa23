//! This server's certificate, and its renewal while the server runs.

use crate::support::clock::date_time;
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::{Duration, SystemTime};
use tokio::sync::Notify;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::{self, PemObject};
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer, UnixTime};
use tokio_rustls::rustls::server::{ClientHello, ResolvesServerCert};
use tokio_rustls::rustls::sign::CertifiedKey;
use tokio_rustls::rustls::{ServerConfig, version};
use webpki::{EndEntityCert, KeyUsage};

/// Interval at which the files are polled.
const LOOK: Duration = Duration::from_secs(1);

/// A certificate with its key, in two PEM files.
#[derive(Debug)]
pub struct Certificates {
    files: Files,
    config: Arc<ServerConfig>,
    present: Arc<Present>,
}

/// The certificate that is used for new connections.
#[derive(Debug)]
struct Present(RwLock<Arc<CertifiedKey>>);

impl ResolvesServerCert for Present {
    fn resolve(&self, _: ClientHello<'_>) -> Option<Arc<CertifiedKey>> {
        Some(Arc::clone(&self.0.read().unwrap_or_else(PoisonError::into_inner)))
    }
}

impl Certificates {
    /// Reads the certificate and the key from these files.
    ///
    /// # Errors
    /// One line that names the file and states what was expected and what was found.
    pub fn open(certificate: &Path, key: &Path) -> Result<Self, String> {
        let files = Files { certificate: certificate.to_owned(), key: key.to_owned() };
        let present = Arc::new(Present(RwLock::new(Arc::new(files.read()?))));
        let provider = Arc::new(ring::default_provider());
        let config = ServerConfig::builder_with_provider(provider)
            .with_protocol_versions(&[&version::TLS13, &version::TLS12])
            .map_err(|error| error.to_string())?;
        let resolver = Arc::clone(&present);
        let mut config = config.with_no_client_auth().with_cert_resolver(resolver);
        config.alpn_protocols = vec![b"http/1.1".to_vec()];
        Ok(Self { files, config: Arc::new(config), present })
    }

    /// An acceptor of encrypted connections.
    #[must_use]
    pub fn acceptor(&self) -> TlsAcceptor {
        TlsAcceptor::from(Arc::clone(&self.config))
    }

    /// Reloads the files when they change, or when `asked` is notified. Open connections are kept,
    /// and new connections get the new certificate. If the files are invalid, the current
    /// certificate stays in use.
    pub async fn renew(&self, asked: &Notify) {
        let mut known = self.files.state();
        loop {
            let is_asked = tokio::select! {
                () = tokio::time::sleep(LOOK) => false,
                () = asked.notified() => true,
            };
            let state = self.files.state();
            if state == known && !is_asked {
                continue;
            }
            known = state;
            match self.files.read() {
                Ok(new) => {
                    let mut present =
                        self.present.0.write().unwrap_or_else(PoisonError::into_inner);
                    *present = Arc::new(new);
                    tracing::info!("new connections get the certificate that is in the file now");
                }
                // The two files do not change at the same instant, so the next change can repair
                // this error.
                Err(error) => tracing::warn!("the certificate stays as it was: {error}"),
            }
        }
    }
}

#[derive(Debug)]
struct Files {
    certificate: PathBuf,
    key: PathBuf,
}

impl Files {
    /// Modification times and lengths of the files, to detect changes.
    fn state(&self) -> [Option<(SystemTime, u64)>; 2] {
        [&self.certificate, &self.key].map(|path| {
            let file = std::fs::metadata(path).ok()?;
            Some((file.modified().ok()?, file.len()))
        })
    }

    fn read(&self) -> Result<CertifiedKey, String> {
        let complaint = |flag: &str, path: &Path, expected: &str, found: String| {
            format!("{flag} {}: expected {expected}, found {found}", path.display())
        };
        let cert = |found: String| {
            let expected =
                "a certificate that is valid now, in PEM, followed by those of its issuers";
            complaint("--tls-cert", &self.certificate, expected, found)
        };
        let key = |found: String| {
            complaint("--tls-key", &self.key, "a private key in PEM, without a password", found)
        };
        let chain = CertificateDer::pem_file_iter(&self.certificate)
            .and_then(Iterator::collect::<Result<Vec<_>, _>>)
            .map_err(|error| cert(found(&error)))?;
        let first = chain.first().ok_or_else(|| cert("no certificate".to_owned()))?;
        if let Some(found) = damage(first) {
            return Err(cert(found));
        }
        let private =
            PrivateKeyDer::from_pem_file(&self.key).map_err(|error| key(found(&error)))?;
        let signing =
            ring::sign::any_supported_type(&private).map_err(|error| key(error.to_string()))?;
        let certified = CertifiedKey::new(chain, signing);
        certified.keys_match().map_err(|_| {
            let expected = format!("the key of the certificate in {}", self.certificate.display());
            complaint("--tls-key", &self.key, &expected, "another key".to_owned())
        })?;
        Ok(certified)
    }
}

/// A description of the content that was found instead of valid PEM.
fn found(error: &pem::Error) -> String {
    match error {
        pem::Error::Io(error) => error.to_string(),
        pem::Error::NoItemsFound => "nothing of that kind".to_owned(),
        error => error.to_string(),
    }
}

/// The fault of a certificate, regardless of its issuers. Clients decide whether they trust the
/// issuers.
fn damage(certificate: &CertificateDer<'_>) -> Option<String> {
    let Ok(parsed) = EndEntityCert::try_from(certificate) else {
        return Some("a damaged one".to_owned());
    };
    let (usage, now) = (KeyUsage::server_auth(), UnixTime::now());
    let at = |time: UnixTime| date_time(i64::try_from(time.as_secs()).unwrap_or(i64::MAX) * 1000);
    // `verify_for_usage` checks the dates before the issuers. Errors about issuers are ignored,
    // because no trusted issuer is passed to it.
    match parsed.verify_for_usage(&[], &[], &[], now, usage, None, None) {
        Err(webpki::Error::CertExpired { not_after, .. }) => {
            Some(format!("one that was valid until {}", at(not_after)))
        }
        Err(webpki::Error::CertNotValidYet { not_before, .. }) => {
            Some(format!("one that is valid from {}", at(not_before)))
        }
        _ => None,
    }
}
