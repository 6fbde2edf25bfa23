//! `sidestep hash-key`.

use super::{CommandError, print_line};
use crate::secrets::chosen;

/// Hash an experimenter's key that you chose.
///
/// Reads the key, at least 16 characters, from the first line of stdin and prints its Argon2 hash. Give the hash to
/// `sidestep serve` as SIDESTEP_ADMIN_KEY, so that no file holds the key itself; sign in with the key.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct HashKeyArgs {}

/// Prints the hash.
///
/// # Errors
/// [`CommandError`] if the key is too short (input), or cannot be read or hashed (failure).
pub fn run() -> Result<(), CommandError> {
    let mut line = String::new();
    std::io::stdin().read_line(&mut line).map_err(CommandError::failure)?;
    let key = line.trim_end_matches(['\r', '\n']);
    let hash = chosen::hashed(key)
        .map_err(|why| CommandError::Input(format!("the key on stdin: {why}")))?;
    print_line(&hash)
}
