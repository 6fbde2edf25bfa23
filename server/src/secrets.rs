//! Random secrets, and the hashes that are kept of them.

use sha2::{Digest, Sha256};

/// A secret of 256 random bits, in hexadecimal digits.
///
/// # Errors
/// If the system has no randomness to give.
pub fn token() -> anyhow::Result<String> {
    random::<32>().map(hex::encode)
}

/// A seed of 64 random bits.
///
/// # Errors
/// If the system has no randomness to give.
pub fn seed() -> anyhow::Result<u64> {
    random().map(u64::from_le_bytes)
}

/// A code that people can copy by hand: ten characters out of 32, none of which
/// is easily taken for another.
///
/// # Errors
/// If the system has no randomness to give.
pub fn completion_code() -> anyhow::Result<String> {
    const LETTERS: &[u8; 32] = b"ABCDEFGHJKLMNPQRSTUVWXYZ23456789";
    let letter = |octet: u8| char::from(LETTERS[usize::from(octet % 32)]);
    Ok(random::<10>()?.map(letter).iter().collect())
}

/// What is stored of a secret. The secrets have 256 random bits (or are keys of
/// at least 16 characters behind a throttle), so a fast hash will do.
#[must_use]
pub fn hash(secret: &str) -> [u8; 32] {
    Sha256::digest(secret.as_bytes()).into()
}

fn random<const N: usize>() -> anyhow::Result<[u8; N]> {
    let mut octets = [0; N];
    getrandom::fill(&mut octets)
        .map_err(|e| anyhow::anyhow!("the system gives no random numbers: {e}"))?;
    Ok(octets)
}
