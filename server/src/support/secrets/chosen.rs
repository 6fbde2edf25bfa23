//! A key chosen by an experimenter.

use super::random;
use argon2::password_hash::phc::PasswordHash;
use argon2::password_hash::{Error, PasswordHasher, PasswordVerifier};
use argon2::{Argon2, Params};
use sha2::{Digest, Sha256};
use std::sync::{Arc, OnceLock};
use subtle::ConstantTimeEq;

/// Upper bound on the memory for one comparison with a hash (KiB).
const MOST_MEMORY: u32 = 1 << 18;

/// Upper bound on the number of passes over this memory, and on the number of lanes.
const MOST_PASSES: u32 = 16;

/// The error for a text that begins like a hash, possibly in quotes.
const DAMAGED: &str = "expected an Argon2 hash as `sidestep hash-key` prints it, without quotes around it, found another text";

/// Minimum length of a key (characters).
const SHORTEST: usize = 16;

/// A key chosen by an experimenter, or its Argon2 hash.
///
/// A chosen key might be guessed, so its hash is slow. A server's configuration, such as a unit
/// file, can contain the hash instead of the key. Each comparison with the hash takes processor
/// time and 19 MiB of memory. Once the correct key has been presented, comparisons use a fast
/// digest that includes random bits of this process. The digest is never stored.
#[derive(Clone, Debug)]
pub struct ChosenKey(Arc<Parts>);

#[derive(Debug)]
struct Parts {
    /// The hash in PHC format, if the given text was a hash.
    argon2: Option<String>,
    salt: [u8; 32],
    /// The digest of the correct key, once it is known.
    known: OnceLock<[u8; 32]>,
    /// The digest of the given text. It is never stored in a database.
    given: [u8; 32],
}

impl ChosenKey {
    /// Parses a key or a hash.
    ///
    /// If the text is neither a valid key nor a valid hash, the error contains the expected and the
    /// found text. Also fails if the system provides no random numbers.
    pub fn of(text: &str) -> Result<Self, String> {
        let salt = random().map_err(|error| error.to_string())?;
        // If a hash in quotes were accepted as a key, anyone who can read the unit file could sign
        // in with it.
        let is_hash = text.trim_matches(['"', '\'', ' ']).starts_with('$');
        if is_hash {
            check_costs(text)?;
            check_hash(text)?;
        } else {
            check_length(text)?;
        }
        let key = Self(Arc::new(Parts {
            argon2: is_hash.then(|| text.to_owned()),
            salt,
            known: OnceLock::new(),
            given: Sha256::digest(text).into(),
        }));
        if !is_hash {
            key.remember(text);
        }
        Ok(key)
    }

    /// Whether this is the key. Returns `None` if only [`Self::verify`] can decide this. Takes the same
    /// time for every key.
    #[must_use]
    pub fn compare(&self, key: &str) -> Option<bool> {
        let known = self.0.known.get()?;
        Some(known.ct_eq(&self.digest(key)).into())
    }

    /// Whether this is the key, according to the slow hash.
    #[must_use]
    pub fn verify(&self, key: &str) -> bool {
        let hash = self.0.argon2.as_deref().and_then(|hash| PasswordHash::new(hash).ok());
        let fits = hash
            .is_some_and(|hash| Argon2::default().verify_password(key.as_bytes(), &hash).is_ok());
        if fits {
            self.remember(key);
        }
        fits
    }

    /// The hash under which a session of this key is stored.
    #[must_use]
    pub fn session_hash(&self, cookie: &str) -> [u8; 32] {
        Sha256::new().chain_update(self.0.given).chain_update(cookie).finalize().into()
    }

    fn remember(&self, key: &str) {
        let _ = self.0.known.set(self.digest(key));
    }

    fn digest(&self, key: &str) -> [u8; 32] {
        Sha256::new().chain_update(self.0.salt).chain_update(key).finalize().into()
    }
}

/// The Argon2 hash of a key, with a random salt, in PHC format.
///
/// # Errors
/// If the key is too short, or the system provides no random numbers.
pub fn hashed(key: &str) -> Result<String, String> {
    check_length(key)?;
    let salt = random::<16>().map_err(|error| error.to_string())?;
    let hash: Result<PasswordHash, _> =
        Argon2::default().hash_password_with_salt(key.as_bytes(), &salt);
    hash.map(|hash| hash.to_string()).map_err(|error| error.to_string())
}

/// Refuses a text that Argon2 cannot compare with a key.
fn check_hash(text: &str) -> Result<(), String> {
    let damaged = || DAMAGED.to_owned();
    let hash = PasswordHash::new(text).map_err(|_| damaged())?;
    if hash.salt.is_none() || hash.hash.is_none() {
        return Err(damaged());
    }
    match Argon2::default().verify_password(b"", &hash) {
        Ok(()) | Err(Error::PasswordInvalid) => Ok(()),
        Err(error) => Err(format!("{DAMAGED} ({error})")),
    }
}

/// Refuses a hash whose cost parameters are too high for the server.
fn check_costs(hash: &str) -> Result<(), String> {
    let parsed = PasswordHash::new(hash).ok();
    let costs = parsed.as_ref().and_then(|hash| Params::try_from(hash).ok());
    let costs = costs.ok_or(DAMAGED)?;
    let (memory, passes, lanes) = (costs.m_cost(), costs.t_cost(), costs.p_cost());
    if memory <= MOST_MEMORY && passes <= MOST_PASSES && lanes <= MOST_PASSES {
        return Ok(());
    }
    Err(format!(
        "expected an Argon2 hash with at most m={MOST_MEMORY} (KiB), t={MOST_PASSES} and p={MOST_PASSES}, found \
         m={memory}, t={passes} and p={lanes}"
    ))
}

/// Refuses a key that is too short.
///
/// # Errors
/// The minimum and the actual length.
pub fn check_length(key: &str) -> Result<(), String> {
    match key.trim().chars().count() {
        count if count < SHORTEST => {
            Err(format!("expected {SHORTEST} characters or more, found {count}"))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: &str = "a key of sixteen or more";

    #[test]
    fn a_plain_key_is_known_at_once() {
        let key = ChosenKey::of(KEY).unwrap();
        assert_eq!((key.compare(KEY), key.compare("another")), (Some(true), Some(false)));
        assert!(!key.verify(KEY), "there is no slow hash");
    }

    #[test]
    fn a_hashed_key_is_known_once_it_came() {
        let hash = hashed(KEY).unwrap();
        assert!(hash.starts_with("$argon2id$v=19$m=19456,t=2,p=1$"), "{hash}");
        assert_ne!(hash, hashed(KEY).unwrap(), "salted");
        let key = ChosenKey::of(&hash).unwrap();
        assert_eq!(key.compare(KEY), None);
        assert!(!key.verify(&hash) && key.compare(KEY).is_none(), "the hash is not the key");
        assert!(key.verify(KEY));
        assert_eq!((key.compare(KEY), key.compare("another")), (Some(true), Some(false)));
    }

    /// A hash that another program computed keeps its own cost parameters.
    #[test]
    fn hashes_keep_their_costs() {
        let hash = "$argon2id$v=19$m=65536,t=2,p=1$c29tZXNhbHQ$CTFhFdXPJO1aFaMaO6Mm5c8y7cJHAph8ArZWb2GRPPc";
        assert!(ChosenKey::of(hash).unwrap().verify("password"));
    }

    #[test]
    fn what_is_neither_is_refused() {
        assert!(ChosenKey::of("short").unwrap_err().ends_with("16 characters or more, found 5"));
        assert!(ChosenKey::of("$argon2id$v=19$m=1").unwrap_err().contains("hash-key"));
        assert!(hashed("short").is_err());
        let hash = hashed(KEY).unwrap();
        for damaged in [
            format!("'{hash}'"),
            format!("\"{hash}\""),
            hash.replace("argon2id", "argon2zz"),
            hash.replace("v=19", "v=18"),
            "$2b$12$R9h/cIPz0gi.URNNX3kh2OPST9/PgBkqquzi.Ss7KIUgO2t0jWMUW".to_owned(),
        ] {
            assert!(ChosenKey::of(&damaged).unwrap_err().contains("hash-key"), "{damaged}");
        }
        assert!(ChosenKey::of(&" ".repeat(20)).unwrap_err().ends_with("found 0"));
        let dear = "$argon2id$v=19$m=10485760,t=2,p=1$c29tZXNhbHQ$CTFhFdXPJO1aFaMaO6Mm5c8y7cJHAph8ArZWb2GRPPc";
        assert!(ChosenKey::of(dear).unwrap_err().ends_with("found m=10485760, t=2 and p=1"));
    }

    #[test]
    fn sessions_belong_to_what_was_given() {
        let [one, other] = [KEY, "another key of a server"].map(|key| ChosenKey::of(key).unwrap());
        let again = ChosenKey::of(KEY).unwrap();
        assert_eq!(one.session_hash("cookie"), again.session_hash("cookie"));
        assert_ne!(one.session_hash("cookie"), other.session_hash("cookie"));
    }
}
