//! A connection that reports its state, and that rejects ambiguous lines in the head of a request.

use crate::http::connections::{Admitted, Connections, Watch};
use axum::body::{Body, HttpBody};
use hyper::body::{Bytes, Frame, Incoming, SizeHint};
use std::io::{IoSlice, Result};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};

/// A stream that reports to the watch of its connection.
#[derive(Debug)]
pub struct Watched<S> {
    stream: S,
    watch: Arc<Watch>,
    head: Head,
}

impl<S> Watched<S> {
    /// Wraps a stream.
    pub fn new(stream: S, watch: Arc<Watch>) -> Self {
        Self { stream, watch, head: Head::default() }
    }

    fn note<T>(&self, poll: Poll<Result<T>>) -> Poll<Result<T>> {
        self.watch.sent(poll.is_ready());
        poll
    }
}

/// Checks the lines of a request's head as they arrive.
///
/// Two ambiguities would allow request smuggling past a proxy in front of this server: a line that ends
/// without a carriage return, and a head with both a content length and a transfer encoding. The HTTP
/// parser accepts both. So the end of such a line is overwritten with a byte that the parser rejects,
/// and the response is 400.
#[derive(Debug, Default)]
struct Head {
    last: u8,
    /// Number of bytes of the current line, without the line feed.
    length: usize,
    /// The start of the current line, in lower case.
    begin: [u8; 18],
    lines: usize,
    has_length: bool,
    is_chunked: bool,
    is_over: bool,
}

impl Head {
    fn read(&mut self, bytes: &mut [u8]) {
        for byte in bytes {
            if self.is_over {
                return;
            }
            if *byte != b'\n' {
                if self.length < self.begin.len() {
                    self.begin[self.length] = byte.to_ascii_lowercase();
                }
                self.length += 1;
            } else if self.last != b'\r' {
                *byte = 0;
            } else {
                let begin = &self.begin[..self.length.min(self.begin.len())];
                self.has_length |= begin.starts_with(b"content-length:");
                self.is_chunked |= begin.starts_with(b"transfer-encoding:");
                if self.has_length && self.is_chunked {
                    *byte = 0;
                }
                // Skip an empty line before the first line, as the parser does.
                let is_empty = self.length == 1;
                self.is_over = is_empty && self.lines > 0;
                self.lines += usize::from(!is_empty);
                self.length = 0;
            }
            self.last = *byte;
        }
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Watched<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<Result<()>> {
        let before = buffer.filled().len();
        ready!(Pin::new(&mut self.stream).poll_read(context, buffer))?;
        if buffer.filled().len() > before {
            let (is_head, begins) = self.watch.received();
            if begins {
                self.head = Head::default();
            }
            if is_head {
                self.head.read(&mut buffer.filled_mut()[before..]);
            }
        }
        Poll::Ready(Ok(()))
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Watched<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<Result<usize>> {
        let poll = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.note(poll)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[IoSlice<'_>],
    ) -> Poll<Result<usize>> {
        let poll = Pin::new(&mut self.stream).poll_write_vectored(context, bytes);
        self.note(poll)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Result<()>> {
        let poll = Pin::new(&mut self.stream).poll_flush(context);
        self.note(poll)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Result<()>> {
        let poll = Pin::new(&mut self.stream).poll_shutdown(context);
        self.note(poll)
    }
}

/// The body of a request. It reports to the watch how many bytes have arrived.
#[derive(Debug)]
pub struct Received {
    body: Incoming,
    watch: Arc<Watch>,
    connections: Arc<Connections>,
}

impl Received {
    /// The body of a request whose head has just arrived.
    #[must_use]
    pub fn new(body: Incoming, admitted: &Admitted) -> Self {
        let watch = Arc::clone(&admitted.watch);
        watch.has_head(!body.is_end_stream());
        Self { body, watch, connections: admitted.connections() }
    }
}

impl Drop for Received {
    fn drop(&mut self) {
        self.watch.body_ended();
    }
}

impl HttpBody for Received {
    type Data = Bytes;
    type Error = hyper::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<std::result::Result<Frame<Bytes>, hyper::Error>>> {
        let frame = ready!(Pin::new(&mut self.body).poll_frame(context));
        if let Some(Ok(frame)) = &frame
            && let Some(bytes) = frame.data_ref()
        {
            let held = self.watch.has_body(bytes.len());
            self.connections.relieve(held);
        }
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// The body of a response. When it is dropped, the watch records that the response was sent.
#[derive(Debug)]
pub struct Sent {
    body: Body,
    watch: Arc<Watch>,
}

impl Sent {
    /// The body of a response on this connection.
    #[must_use]
    pub fn new(body: Body, watch: Arc<Watch>) -> Self {
        Self { body, watch }
    }
}

impl Drop for Sent {
    fn drop(&mut self) {
        self.watch.answered();
    }
}

impl HttpBody for Sent {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<std::result::Result<Frame<Bytes>, axum::Error>>> {
        Pin::new(&mut self.body).poll_frame(context)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the head as the parser receives it if it arrives in pieces of this length.
    fn read(text: &str, piece: usize) -> String {
        let mut bytes = text.as_bytes().to_vec();
        let mut head = Head::default();
        bytes.chunks_mut(piece).for_each(|piece| head.read(piece));
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn only_ambiguous_line_ends_are_overwritten() {
        let plain = "\r\nPUT / HTTP/1.1\r\nHost: a\r\nContent-Length: 3\r\n\r\na\nb";
        let bare = "GET / HTTP/1.1\nHost: a\r\n\r\n";
        let both = "GET / HTTP/1.1\r\nContent-Length: 3\r\ntransfer-encoding: chunked\r\n\r\n";
        let other = "GET / HTTP/1.1\r\nTransfer-Encoding: chunked\r\nCONTENT-LENGTH:3\r\n\r\n";
        for piece in [1, 2, 5, 1000] {
            assert_eq!(read(plain, piece), plain, "{piece}");
            assert_eq!(read(bare, piece), bare.replacen("1.1\n", "1.1\0", 1), "{piece}");
            assert!(read(both, piece).contains("chunked\r\0"), "{piece}");
            assert!(read(other, piece).contains(":3\r\0"), "{piece}");
        }
    }
}
