//! `sidestep hash-key`.

use super::{CommandError, print_line};
use crate::support::secrets::chosen;
use std::io::{self, BufRead, IsTerminal, Write};

/// Hash an experimenter's key of your choice.
///
/// On a terminal, asks for the key twice without showing it. Otherwise, reads the key from the
/// first line of stdin. The key needs at least 16 characters. Prints the key's Argon2 hash. Pass
/// the hash to `sidestep serve` as SIDESTEP_ADMIN_KEY, so that no file contains the key itself.
/// Sign in with the key.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct HashKeyArgs {}

/// Prints the hash.
///
/// # Errors
/// [`CommandError`] if the key is too short or the two entries differ (input), or the key cannot be
/// read or hashed (failure).
pub fn run() -> Result<(), CommandError> {
    let (key, origin) = match io::stdin().is_terminal() {
        true => (asked_twice()?, "the key"),
        false => (line(b"\n")?, "the key on stdin"),
    };
    let hash =
        chosen::hashed(&key).map_err(|why| CommandError::Input(format!("{origin}: {why}")))?;
    print_line(&hash)
}

fn asked_twice() -> Result<String, CommandError> {
    let hidden = terminal::Hidden::begin().map_err(CommandError::failure)?;
    let key = asked("Key, at least 16 characters (it is not shown): ")?;
    // Do not ask a second time for a key that is too short.
    chosen::check_length(&key).map_err(|why| CommandError::Input(format!("the key: {why}")))?;
    let again = asked("The same key again: ")?;
    drop(hidden);
    if again != key {
        return Err(CommandError::Input(
            "the key: expected the same key twice, found two keys".to_owned(),
        ));
    }
    Ok(key)
}

/// Prompts on the terminal and returns the typed line. The prompt goes to stderr, because stdout
/// might be redirected to a file.
fn asked(question: &str) -> Result<String, CommandError> {
    eprint!("{question}");
    io::stderr().flush().map_err(CommandError::failure)?;
    let typed = line(&[b'\n', terminal::CTRL_C]);
    eprintln!();
    let typed = typed?;
    match typed.bytes().any(|byte| byte == terminal::CTRL_C) {
        true => Err(CommandError::Failure("stopped".to_owned())),
        false => Ok(typed),
    }
}

/// The next line of stdin. Every byte in `ends` terminates a line.
fn line(ends: &[u8]) -> Result<String, CommandError> {
    let mut stdin = io::stdin().lock();
    let mut line = Vec::new();
    loop {
        let piece = stdin.fill_buf().map_err(CommandError::failure)?;
        let end = piece.iter().position(|byte| ends.contains(byte)).map(|at| at + 1);
        let taken = end.unwrap_or(piece.len());
        line.extend_from_slice(&piece[..taken]);
        stdin.consume(taken);
        if end.is_some() || taken == 0 {
            break;
        }
    }
    let line = String::from_utf8(line).map_err(CommandError::failure)?;
    Ok(line.trim_end_matches(['\r', '\n']).to_owned())
}

#[cfg(unix)]
mod terminal {
    //! A terminal that does not echo typed characters.

    use rustix::io;
    use rustix::termios::{
        LocalModes, OptionalActions, SpecialCodeIndex, Termios, tcgetattr, tcsetattr,
    };

    /// The byte that Ctrl-C sends.
    pub(super) const CTRL_C: u8 = 3;

    /// Disables the terminal's echo until it is dropped. Ctrl-C ends the line instead of sending a
    /// signal, which would kill the program before it could restore the terminal.
    pub(super) struct Hidden {
        before: Termios,
    }

    impl Hidden {
        pub(super) fn begin() -> io::Result<Self> {
            let before = tcgetattr(std::io::stdin())?;
            let mut hidden = before.clone();
            hidden.local_modes -= LocalModes::ECHO | LocalModes::ECHONL | LocalModes::ISIG;
            hidden.special_codes[SpecialCodeIndex::VEOL] = CTRL_C;
            // Discard input typed before the prompt.
            tcsetattr(std::io::stdin(), OptionalActions::Flush, &hidden)?;
            Ok(Self { before })
        }
    }

    impl Drop for Hidden {
        fn drop(&mut self) {
            // An error cannot be handled here.
            let _ = tcsetattr(std::io::stdin(), OptionalActions::Flush, &self.before);
        }
    }
}

#[cfg(not(unix))]
mod terminal {
    //! A terminal whose echo this program cannot disable.

    /// The byte that Ctrl-C sends.
    pub(super) const CTRL_C: u8 = 3;

    /// Does nothing.
    pub(super) struct Hidden;

    impl Hidden {
        pub(super) fn begin() -> std::io::Result<Self> {
            Ok(Self)
        }
    }
}
