//! `cargo xtask fuzz`: feeds generated inputs to every parser of external data.
//!
//! The parsers are in `tests/src/parsers.rs`. libFuzzer searches for inputs that reach new code. It is
//! compiled from the package `libfuzzer-sys`. With [`FLAGS`], stable rustc inserts the coverage
//! instrumentation that libFuzzer needs.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};

use anyhow::{Context, Result, bail};
use sha2::{Digest, Sha256};
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

use crate::workspace::{Workspace, output_of, stage};

/// Feed generated inputs to every parser until one panics or hangs, or the time is up.
///
/// Starts with the corpus in tests/data/parsers/NAME.zip. With --keep, inputs that reach new code or make a
/// parser fail are added to the corpus. A test runs the whole corpus.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Fuzz only this parser [default: all, in sequence].
    parser: Option<String>,
    /// Time limit for each parser, in minutes.
    #[arg(long, default_value_t = 10.0)]
    minutes: f64,
    /// Add the inputs found to the corpus.
    #[arg(long)]
    keep: bool,
}

/// Compiler flags that make the branches and comparisons that an input reaches visible to
/// libFuzzer.
const FLAGS: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
                     -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
                     -Cllvm-args=-sanitizer-coverage-pc-table \
                     -Cllvm-args=-sanitizer-coverage-trace-compares \
                     -Ccodegen-units=1 -Cdebug-assertions -Coverflow-checks";

/// Maximum length of an input (bytes).
const LONGEST: usize = 16_384;

/// Timeout for one input (s).
const PATIENCE_S: u32 = 20;

/// Runs the fuzzer. The exit code is 1 if a parser failed, and 2 if no parser has the given name.
///
/// # Errors
/// When the parsers cannot be built, or the corpus cannot be read or written.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<ExitCode> {
    let program = build(workspace)?;
    let names = output_of("the list of parsers", Command::new(&program).env("LIST_PARSERS", "1"))?;
    let names: Vec<&str> = names.lines().collect();
    let chosen: Vec<&str> = match &options.parser {
        None => names,
        Some(name) if names.contains(&name.as_str()) => vec![name],
        Some(name) => {
            eprintln!("expected a parser, found \"{name}\"; there are: {}", names.join(", "));
            return Ok(ExitCode::from(2));
        }
    };
    let mut code = ExitCode::SUCCESS;
    println!("| parser | inputs tried | kept | found |\n|---|---:|---:|---:|");
    for name in chosen {
        let searched = search(workspace, &program, name, options)?;
        println!("| {name} | {} | {} | {} |", searched.tried, searched.kept, searched.found);
        if searched.found > 0 {
            code = ExitCode::FAILURE;
        }
    }
    Ok(code)
}

/// Builds the instrumented parsers in a separate folder.
fn build(workspace: &Workspace) -> Result<std::path::PathBuf> {
    let version = output_of("rustc", Command::new("rustc").args(["--version", "--verbose"]))?;
    let host = version.lines().find_map(|line| line.strip_prefix("host: "));
    let host = host.context("rustc names no host")?;
    let target = workspace.output("fuzz");
    // With an explicit target, cargo does not apply the flags to build scripts and procedural macros.
    let mut cargo = workspace.compile("build");
    cargo.args(["--features", "sidestep-tests/fuzz", "--example", "fuzz", "--target", host]);
    cargo.env("CARGO_TARGET_DIR", &target).env("RUSTFLAGS", FLAGS);
    stage("parsers", &mut cargo)?;
    Ok(target.join(host).join("release/examples/fuzz"))
}

struct Searched {
    tried: String,
    kept: usize,
    found: usize,
}

fn search(
    workspace: &Workspace,
    program: &Path,
    name: &str,
    options: &Options,
) -> Result<Searched> {
    let archive = workspace.path("tests/data/parsers").join(name).with_extension("zip");
    let folder = workspace.output("fuzz").join("inputs").join(name);
    let [corpus, merged, found] = ["corpus", "merged", "found"].map(|part| folder.join(part));
    for part in [&corpus, &merged, &found] {
        fs::create_dir_all(part).with_context(|| format!("cannot make {}", part.display()))?;
    }
    let kept = read(&archive)?;
    for (hash, bytes) in &kept {
        fs::write(corpus.join(hash), bytes)?;
    }
    // Retry the inputs that failed in an earlier search, because the bugs might be fixed by now.
    for (hash, bytes) in read_folder(&found)? {
        fs::write(corpus.join(hash), bytes)?;
    }
    fs::remove_dir_all(&found).and_then(|()| fs::create_dir(&found))?;
    let log = folder.join("log");
    let fuzz = |more: &[&str], folders: &[&Path]| -> Result<bool> {
        let mut command = Command::new(program);
        command.env("PARSER", name).args(more).args(folders);
        let log = File::options().create(true).append(true).open(&log)?;
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(log);
        Ok(command.status().context("cannot start the parsers")?.success())
    };
    fs::write(&log, "")?;
    let seconds = format!("-max_total_time={:.0}", 60.0 * options.minutes);
    let (longest, patience) = (format!("-max_len={LONGEST}"), format!("-timeout={PATIENCE_S}"));
    let prefix = format!("-artifact_prefix={}/", found.display());
    let limits = [&*longest, &patience, "-rss_limit_mb=4096", "-malloc_limit_mb=2048"];
    eprintln!("==> {name}: {} inputs are kept, log in {}", kept.len(), log.display());
    let whole =
        fuzz(&[&limits[..], &[&seconds, &prefix, "-print_final_stats=1"]].concat(), &[&corpus])?;
    let said = fs::read_to_string(&log).unwrap_or_default();
    let mut lines = said.lines().rev();
    let tried = lines.find_map(|line| line.strip_prefix("stat::number_of_executed_units: "));
    let tried = tried.unwrap_or("?").trim().to_owned();
    let failures = read_folder(&found)?;
    if !whole && failures.is_empty() {
        bail!("{name}: the search failed; see {}", log.display());
    }
    let mut all = kept;
    if options.keep {
        fuzz(&[&limits[..], &["-merge=1"]].concat(), &[&merged, &corpus])?;
        all = read_folder(&merged)?;
        all.extend(failures.clone());
        write(&archive, &all)?;
    }
    Ok(Searched { tried, kept: all.len(), found: failures.len() })
}

/// Reads the files of a folder, keyed by the hash of their content.
fn read_folder(folder: &Path) -> Result<BTreeMap<String, Vec<u8>>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder)? {
        let bytes = fs::read(entry?.path())?;
        all.insert(hex::encode(&Sha256::digest(&bytes)[..8]), bytes);
    }
    Ok(all)
}

fn read(archive: &Path) -> Result<BTreeMap<String, Vec<u8>>> {
    let mut all = BTreeMap::new();
    let Ok(file) = File::open(archive) else { return Ok(all) };
    let mut archive = ZipArchive::new(file)?;
    for place in 0..archive.len() {
        let mut entry = archive.by_index(place)?;
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes)?;
        all.insert(entry.name()?.into_owned(), bytes);
    }
    Ok(all)
}

/// Writes a deterministic archive: the same inputs give the same bytes.
fn write(archive: &Path, all: &BTreeMap<String, Vec<u8>>) -> Result<()> {
    let mut archive = ZipWriter::new(File::create(archive)?);
    for (hash, bytes) in all {
        archive.start_file(hash, SimpleFileOptions::default())?;
        archive.write_all(bytes)?;
    }
    archive.finish()?;
    Ok(())
}
