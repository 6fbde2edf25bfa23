//! A proxy between a browser and a server that can cut connections.

use std::sync::{Arc, Mutex};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinHandle;

/// Point at which a connection is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// Before any part of the request is forwarded.
    Before,
    /// After half of the request's first packet has been forwarded.
    During,
    /// After the server has responded. No part of the response is forwarded.
    After,
}

/// The current fault: where to cut, and the text that marks the requests to cut.
type Fault = Arc<Mutex<Option<(Cut, &'static str)>>>;

/// A proxy. Dropping it ends the proxy.
pub struct Proxy {
    /// `http://127.0.0.1:PORT`.
    pub origin: String,
    fault: Fault,
    accepting: JoinHandle<()>,
}

impl Drop for Proxy {
    fn drop(&mut self) {
        self.accepting.abort();
    }
}

impl Proxy {
    /// Starts a proxy for the server at this origin.
    ///
    /// # Panics
    /// If there is no free port.
    pub async fn start(server: &str) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let origin = format!("http://{}", listener.local_addr().expect("an address"));
        let server = server.trim_start_matches("http://").to_owned();
        let fault = Fault::default();
        let present = Arc::clone(&fault);
        let accepting = tokio::spawn(async move {
            while let Ok((browser, _)) = listener.accept().await {
                let (server, fault) = (server.clone(), Arc::clone(&present));
                tokio::spawn(async move {
                    // Errors are ignored, because this proxy breaks connections on purpose.
                    let _ = relay(browser, &server, &fault).await;
                });
            }
        });
        Self { origin, fault, accepting }
    }

    /// From now on, cuts every connection on which a request contains this text.
    ///
    /// # Panics
    /// If a connection panicked.
    pub fn cut(&self, cut: Cut, words: &'static str) {
        *self.fault.lock().expect("the fault") = Some((cut, words));
    }

    /// Stops cutting connections.
    ///
    /// # Panics
    /// If a connection panicked.
    pub fn mend(&self) {
        *self.fault.lock().expect("the fault") = None;
    }
}

async fn relay(mut browser: TcpStream, server: &str, fault: &Fault) -> std::io::Result<()> {
    let mut server = TcpStream::connect(server).await?;
    let (mut asked, mut answered) = (vec![0; 1 << 16], vec![0; 1 << 16]);
    let mut is_answer_lost = false;
    loop {
        tokio::select! {
            length = browser.read(&mut asked) => {
                let request = &asked[..length?];
                let present = *fault.lock().expect("the fault");
                let is_meant = |words: &str| String::from_utf8_lossy(request).contains(words);
                match present.filter(|(_, words)| is_meant(words)) {
                    _ if request.is_empty() => return Ok(()),
                    None => server.write_all(request).await?,
                    Some((Cut::Before, _)) => return Ok(()),
                    Some((Cut::During, _)) => {
                        return server.write_all(&request[..request.len() / 2]).await;
                    }
                    Some((Cut::After, _)) => {
                        is_answer_lost = true;
                        server.write_all(request).await?;
                    }
                }
            }
            length = server.read(&mut answered) => {
                let answer = &answered[..length?];
                if answer.is_empty() || is_answer_lost {
                    return Ok(());
                }
                browser.write_all(answer).await?;
            }
        }
    }
}
