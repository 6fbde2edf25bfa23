//! A minimal HTTP/1.1 client on a persistent connection.

use std::io::{Error, ErrorKind, Result, Write};

use std::net::{Ipv4Addr, SocketAddr};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream};

/// A connection to the server.
#[derive(Debug)]
pub struct Connection {
    stream: TcpStream,
    /// Buffers, reused for every request and response.
    request: Vec<u8>,
    answer: Vec<u8>,
}

/// A response.
#[derive(Debug)]
pub struct Answer<'a> {
    /// Status.
    pub status: u16,
    /// `Retry-After` (s).
    pub retry_after_s: Option<u64>,
    /// The body, which is left empty for a chunked response.
    pub body: &'a [u8],
}

impl Connection {
    /// Connects to a server on this machine. The source address, by default 127.0.0.1, can be any
    /// of the machine's addresses, so that a crowd has many addresses.
    ///
    /// # Errors
    /// If the server does not accept the connection.
    pub async fn open(server: SocketAddr, from: Option<Ipv4Addr>) -> Result<Self> {
        let socket = TcpSocket::new_v4()?;
        if let Some(from) = from {
            socket.bind((from, 0).into())?;
        }
        let stream = socket.connect(server).await?;
        stream.set_nodelay(true)?;
        Ok(Self { stream, request: Vec::new(), answer: Vec::new() })
    }

    /// Sends a request and closes the connection without waiting for the response.
    ///
    /// # Errors
    /// If the server has already closed the connection.
    pub async fn vanish(
        mut self,
        method: &str,
        route: &str,
        token: Option<&str>,
        body: &[u8],
    ) -> Result<()> {
        self.write(method, route, token, "application/json", body).await
    }

    /// Sends a request with a JSON body and reads the response.
    ///
    /// # Errors
    /// If the connection breaks.
    pub async fn send(
        &mut self,
        method: &str,
        route: &str,
        token: Option<&str>,
        body: &[u8],
    ) -> Result<Answer<'_>> {
        self.write(method, route, token, "application/json", body).await?;
        self.read().await
    }

    /// Posts a form and reads the response.
    ///
    /// # Errors
    /// If the connection breaks.
    pub async fn post_form(&mut self, route: &str, form: &[u8]) -> Result<Answer<'_>> {
        self.write("POST", route, None, "application/x-www-form-urlencoded", form).await?;
        self.read().await
    }

    async fn write(
        &mut self,
        method: &str,
        route: &str,
        token: Option<&str>,
        kind: &str,
        body: &[u8],
    ) -> Result<()> {
        self.request.clear();
        let length = body.len();
        write!(
            self.request,
            "{method} {route} HTTP/1.1\r\nHost: localhost\r\nContent-Type: {kind}\r\n\
             Content-Length: {length}\r\n"
        )?;
        if let Some(token) = token {
            write!(self.request, "Authorization: Bearer {token}\r\n")?;
        }
        self.request.extend_from_slice(b"\r\n");
        self.request.extend_from_slice(body);
        self.stream.write_all(&self.request).await
    }

    async fn read(&mut self) -> Result<Answer<'_>> {
        self.answer.clear();
        let (head, body) = loop {
            if let Some(parts) = whole(&self.answer)? {
                break parts;
            }
            if self.stream.read_buf(&mut self.answer).await? == 0 {
                return Err(ErrorKind::UnexpectedEof.into());
            }
        };
        let head = std::str::from_utf8(&self.answer[..head]).map_err(Error::other)?;
        let status = head.split(' ').nth(1).and_then(|word| word.parse().ok());
        Ok(Answer {
            status: status.ok_or_else(|| Error::other("no status"))?,
            retry_after_s: header(head, "retry-after").and_then(|text| text.parse().ok()),
            body: &self.answer[body.0..body.1],
        })
    }
}

/// Once the response is complete, returns the end of its head and the range of its body.
fn whole(answer: &[u8]) -> Result<Option<(usize, (usize, usize))>> {
    let Some(head) = answer.windows(4).position(|four| four == b"\r\n\r\n") else {
        return Ok(None);
    };
    let text = std::str::from_utf8(&answer[..head]).map_err(Error::other)?;
    if header(text, "transfer-encoding").is_some() {
        // A chunked body ends with an empty chunk.
        let is_whole = answer.ends_with(b"0\r\n\r\n");
        return Ok(is_whole.then_some((head, (answer.len(), answer.len()))));
    }
    // A 204 response has no body.
    if text.split(' ').nth(1) == Some("204") {
        return Ok(Some((head, (head + 4, head + 4))));
    }
    let length: Option<usize> = header(text, "content-length").and_then(|text| text.parse().ok());
    let length = length.ok_or_else(|| Error::other("an answer without Content-Length"))?;
    let end = head + 4 + length;
    Ok((answer.len() >= end).then_some((head, (head + 4, end))))
}

fn header<'a>(head: &'a str, name: &str) -> Option<&'a str> {
    let fields = head.lines().skip(1).filter_map(|line| line.split_once(':'));
    let mut fields = fields.filter(|(key, _)| key.eq_ignore_ascii_case(name));
    fields.next().map(|(_, value)| value.trim())
}
