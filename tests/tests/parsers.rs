//! All stored fuzz inputs: seeds, inputs that reach new code, and inputs that once failed. Each
//! input must be parsed or rejected (`cargo xtask fuzz` finds more inputs).

#![allow(clippy::unwrap_used)]

use sidestep_tests::parsers::PARSERS;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use zip::ZipArchive;

#[test]
fn every_kept_input_is_read_or_refused() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/parsers");
    for (name, parser) in PARSERS {
        let file = File::open(folder.join(name).with_extension("zip")).expect(name);
        let mut archive = ZipArchive::new(file).expect(name);
        assert!(archive.len() > 3, "{name} has inputs");
        for place in 0..archive.len() {
            let mut bytes = Vec::new();
            let mut entry = archive.by_index(place).unwrap();
            entry.read_to_end(&mut bytes).unwrap();
            let input = entry.name().unwrap().into_owned();
            let done = std::panic::catch_unwind(|| parser(&bytes));
            assert!(done.is_ok(), "{name} fails on {input} of data/parsers/{name}.zip");
        }
    }
}
