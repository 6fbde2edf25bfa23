//! Target of `cargo xtask fuzz`: runs libFuzzer on the parser that the variable PARSER names.

#![no_main]
#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "a program for developers")]

use libfuzzer_sys::fuzz_target;
use sidestep_tests::parsers::{PARSERS, Parser, named};
use std::sync::OnceLock;

static CHOSEN: OnceLock<Parser> = OnceLock::new();

fuzz_target!(
    init: {
        if std::env::var_os("LIST_PARSERS").is_some() {
            PARSERS.iter().for_each(|(name, _)| println!("{name}"));
            std::process::exit(0);
        }
        let name = std::env::var("PARSER").unwrap_or_default();
        let parser = named(&name).unwrap_or_else(|| panic!("PARSER: no parser \"{name}\""));
        CHOSEN.set(parser).unwrap();
    },
    |bytes: &[u8]| CHOSEN.get().unwrap()(bytes)
);
