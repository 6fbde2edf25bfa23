//! Commands on a terminal, emulated by util-linux's `script`.

use sidestep_tests::Folder;
use sidestep_tests::process::binary;
use std::io::{Read, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

const KEY: &str = "correct horse battery staple";

/// A shell command on a terminal, and its output so far.
struct Terminal {
    child: Child,
    keyboard: ChildStdin,
    screen: ChildStdout,
    shown: String,
}

impl Terminal {
    fn run(command: &str) -> Self {
        let mut script = Command::new("script");
        script.args(["--quiet", "--return", "--command", command, "/dev/null"]);
        let mut child =
            script.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("script");
        let (keyboard, screen) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        Self { child, keyboard, screen, shown: String::new() }
    }

    /// Waits until the screen ends with these words, and types.
    fn answer(&mut self, words: &str, typed: &str) {
        let mut byte = [0];
        while !self.shown.ends_with(words) {
            assert_eq!(self.screen.read(&mut byte).unwrap(), 1, "it ended: {}", self.shown);
            self.shown.push(char::from(byte[0]));
        }
        self.keyboard.write_all(typed.as_bytes()).unwrap();
        self.keyboard.flush().unwrap();
    }

    /// The exit code, and all output.
    fn end(mut self) -> (Option<i32>, String) {
        let mut rest = Vec::new();
        self.screen.read_to_end(&mut rest).unwrap();
        self.shown += &String::from_utf8_lossy(&rest);
        (self.child.wait().unwrap().code(), self.shown)
    }
}

const FIRST: &str = "(it is not shown): ";
const AGAIN: &str = "The same key again: ";

#[test]
fn a_key_is_asked_for_twice_and_not_shown() {
    let hash_key = format!("{} hash-key", binary().display());
    let mut terminal = Terminal::run(&hash_key);
    terminal.answer(FIRST, &format!("{KEY}\n"));
    terminal.answer(AGAIN, &format!("{KEY}\n"));
    let (code, shown) = terminal.end();
    assert_eq!(code, Some(0), "{shown}");
    assert!(shown.contains("$argon2id$") && !shown.contains("horse"), "{shown}");

    let mut terminal = Terminal::run(&hash_key);
    terminal.answer(FIRST, &format!("{KEY}\n"));
    terminal.answer(AGAIN, "another key that was typed\n");
    let (code, shown) = terminal.end();
    assert_eq!(code, Some(2), "{shown}");
    assert!(shown.contains("expected the same key twice, found two keys"), "{shown}");
    assert!(!shown.contains("$argon2id$") && !shown.contains("another key that"), "{shown}");

    // A key that is too short is rejected immediately. The user is not asked to type it again.
    let mut terminal = Terminal::run(&hash_key);
    terminal.answer(FIRST, "short\n");
    let (code, shown) = terminal.end();
    assert_eq!(code, Some(2), "{shown}");
    assert!(shown.contains("expected 16 characters or more, found 5"), "{shown}");
    assert!(!shown.contains(AGAIN), "{shown}");
}

/// The terminal's settings are restored after an answer, an error and Ctrl-C. The hash goes to
/// stdout.
#[test]
fn the_terminal_is_left_as_it_was() {
    let folder = Folder::default();
    let file = folder.name("hash");
    let command = format!("{} hash-key > {file}; echo code $?; stty -a", binary().display());
    for (typed, code) in [(&[KEY, "\n"][..], 0), (&["short\n"], 2), (&["half a key\u{3}"], 1)] {
        let mut terminal = Terminal::run(&command);
        terminal.answer(FIRST, &typed.concat());
        if code == 0 {
            terminal.answer(AGAIN, &typed.concat());
        }
        let (_, shown) = terminal.end();
        assert!(shown.contains(&format!("code {code}")), "{shown}");
        let (_, settings) = shown.split_once("code").unwrap();
        assert!(settings.contains("eol = <undef>"), "{settings}");
        for setting in ["echo", "isig", "icanon"] {
            assert!(
                settings.split_whitespace().any(|word| word == setting),
                "{setting}: {settings}"
            );
        }
        assert!(!shown.contains("horse") && !shown.contains("half"), "{shown}");
        assert!(!shown.contains("$argon2id$"), "{shown}");
        assert_eq!(folder.text("hash").starts_with("$argon2id$"), code == 0);
    }
}
