//! Random secrets, the hashes of secrets that the database stores, and keys chosen by people.

pub mod chosen;

use sha2::{Digest, Sha256};

/// A secret of 256 random bits, in hexadecimal digits.
///
/// # Errors
/// If the system provides no random numbers.
pub fn token() -> anyhow::Result<String> {
    random::<32>().map(hex::encode)
}

/// A seed of 64 random bits.
///
/// # Errors
/// If the system provides no random numbers.
pub fn seed() -> anyhow::Result<u64> {
    random().map(u64::from_le_bytes)
}

/// A completion code that participants can copy by hand. It has ten characters from an alphabet of 32,
/// without characters that look alike.
///
/// # Errors
/// If the system provides no random numbers.
pub fn completion_code() -> anyhow::Result<String> {
    const LETTERS: &[u8; 32] = b"ABCDEFGHJKLMNPQRSTUVWXYZ23456789";
    let letter = |byte: u8| char::from(LETTERS[usize::from(byte % 32)]);
    Ok(random::<10>()?.map(letter).iter().collect())
}

/// The hash that the database stores instead of a secret. A fast hash suffices, because all these
/// secrets have 256 random bits. For keys chosen by people, see [`chosen`].
#[must_use]
pub fn hash(secret: &str) -> [u8; 32] {
    Sha256::digest(secret.as_bytes()).into()
}

fn random<const N: usize>() -> anyhow::Result<[u8; N]> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes)
        .map_err(|e| anyhow::anyhow!("the system gives no random numbers: {e}"))?;
    Ok(bytes)
}
