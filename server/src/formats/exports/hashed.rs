//! A writer that counts and hashes its output.

use sha2::{Digest, Sha256};
use std::io::{self, Write};

/// A writer that computes the length and hash of the bytes written to it.
pub(super) struct Hashed<W> {
    out: W,
    hash: Sha256,
    bytes: u64,
}

impl<W> Hashed<W> {
    pub(super) fn new(out: W) -> Self {
        Self { out, hash: Sha256::new(), bytes: 0 }
    }

    /// The inner writer, the number of bytes, and their SHA-256 as hexadecimal digits.
    pub(super) fn finish(self) -> (W, u64, String) {
        (self.out, self.bytes, hex::encode(self.hash.finalize()))
    }
}

impl<W: Write> Write for Hashed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.hash.update(&bytes[..written]);
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}
