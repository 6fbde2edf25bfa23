//! Checks the dependencies: licences, sources, bans and advisories.
//!
//! The rules are in `deny.toml`, in the format of cargo-deny. This module itself checks licences, sources and
//! bans, which takes a second and needs no network. cargo-deny reads the same file and reports more. Checking
//! advisories needs a local copy of the RustSec database and a program that reads it.

use std::env;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};
use serde::Deserialize;
use spdx::{Expression, Licensee};

use crate::workspace::{Workspace, stage};

/// The part of `deny.toml` that this module checks.
#[derive(Deserialize)]
struct Rules {
    licenses: Licences,
    bans: Bans,
    sources: Sources,
}

#[derive(Deserialize)]
struct Licences {
    allow: Vec<String>,
}

#[derive(Deserialize)]
struct Bans {
    deny: Vec<Ban>,
}

#[derive(Deserialize)]
struct Ban {
    name: String,
    reason: String,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
struct Sources {
    allow_registry: Vec<String>,
}

/// The fields of a package in `cargo metadata` that are used here.
#[derive(Deserialize)]
struct Package {
    name: String,
    version: String,
    license: Option<String>,
    /// Where the package comes from. `None` for packages of this workspace.
    source: Option<String>,
}

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

/// Checks every package in `Cargo.lock` that some build uses.
///
/// # Errors
/// If `deny.toml` does not allow a package, or if an advisory affects a package. Prints each package that is
/// not allowed.
pub(super) fn run(workspace: &Workspace) -> Result<()> {
    eprintln!("==> dependencies");
    let rules = std::fs::read_to_string(workspace.path("deny.toml")).context("deny.toml")?;
    let rules: Rules = toml::from_str(&rules).context("deny.toml")?;
    let output =
        workspace.metadata().stderr(Stdio::inherit()).output().context("cargo metadata")?;
    let Metadata { packages } =
        serde_json::from_slice(&output.stdout).context("the answer of cargo metadata")?;
    let complaints = complaints(&rules, &packages)?;
    for complaint in &complaints {
        eprintln!("{complaint}");
    }
    if !complaints.is_empty() {
        bail!("dependencies: deny.toml does not allow {}", complaints.len());
    }
    eprintln!("    {} packages: licences, sources and bans as deny.toml says", packages.len());
    advisories(workspace)
}

fn complaints(rules: &Rules, packages: &[Package]) -> Result<Vec<String>> {
    let allowed = rules.licenses.allow.iter().map(|text| {
        Licensee::parse(text).with_context(|| format!("deny.toml: licenses.allow: {text}"))
    });
    let allowed = allowed.collect::<Result<Vec<_>>>()?;
    let mut complaints = Vec::new();
    for Package { name, version, license, source } in packages {
        let mut complain = |what: String| complaints.push(format!("{name} {version}: {what}"));
        if let Some(ban) = rules.bans.deny.iter().find(|ban| ban.name == *name) {
            complain(format!("banned, since {}", ban.reason));
        }
        // The packages of this workspace have their own licence and no source.
        let Some(source) = source else { continue };
        let registry = source.strip_prefix("registry+");
        if !registry.is_some_and(|it| rules.sources.allow_registry.iter().any(|ok| ok == it)) {
            complain(format!("expected a source of sources.allow-registry, found {source}"));
        }
        let text = license.as_deref().unwrap_or_default();
        let is_allowed = Expression::parse_mode(text, spdx::ParseMode::LAX)
            .is_ok_and(|it| it.evaluate(|req| allowed.iter().any(|one| one.satisfies(req))));
        if !is_allowed {
            complain(format!("expected a licence of licenses.allow, found {text:?}"));
        }
    }
    Ok(complaints)
}

/// Checks advisories, if this machine has the database and a program that reads it.
fn advisories(workspace: &Workspace) -> Result<()> {
    let home = env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| Some(PathBuf::from(env::var_os("HOME")?).join(".cargo")));
    // For each program that reads the database: its name, the folder of its copy and its offline command.
    let readers: [(&str, &str, &[&str]); 2] = [
        ("cargo-deny", "advisory-dbs", &["deny", "--offline", "check", "advisories"]),
        ("cargo-audit", "advisory-db", &["audit", "--no-fetch", "--stale"]),
    ];
    for (program, copy, arguments) in readers {
        let copies = home.as_ref().and_then(|home| std::fs::read_dir(home.join(copy)).ok());
        let has_copy = copies.is_some_and(|mut copies| copies.next().is_some());
        let mut ask = Command::new(program);
        ask.arg("--version").stdout(Stdio::null()).stderr(Stdio::null());
        if has_copy && ask.status().is_ok_and(|status| status.success()) {
            let mut read = Command::new("cargo");
            return stage("advisories", read.args(arguments).current_dir(workspace.path("")))
                .map(drop);
        }
    }
    eprintln!(
        "    advisories not checked: no copy of the database (`cargo deny fetch` or `cargo audit` makes one)"
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(name: &str, license: Option<&str>, source: Option<&str>) -> Vec<String> {
        let rules = r#"
            licenses.allow = ["MIT", "Apache-2.0 WITH LLVM-exception"]
            bans.deny = [{ name = "bad", reason = "it is bad" }]
            sources.allow-registry = ["https://example.org/index"]
        "#;
        let text = |text: Option<&str>| text.map(str::to_owned);
        let (license, source) = (text(license), text(source));
        let package =
            Package { name: name.to_owned(), version: "1.0.0".to_owned(), license, source };
        complaints(&toml::from_str(rules).unwrap(), &[package]).unwrap()
    }

    #[test]
    fn packages_that_are_not_allowed_are_named() {
        let index = Some("registry+https://example.org/index");
        for license in ["MIT", "MIT OR GPL-3.0", "MIT/Apache-2.0", "Apache-2.0 WITH LLVM-exception"]
        {
            assert_eq!(found("good", Some(license), index), [""; 0], "{license}");
        }
        assert_eq!(found("ours", None, None), [""; 0]);
        for license in
            [None, Some("GPL-3.0"), Some("MIT AND GPL-3.0"), Some("Apache-2.0"), Some("x")]
        {
            assert_eq!(found("other", license, index).len(), 1, "{license:?}");
        }
        assert_eq!(found("bad", Some("MIT"), index), ["bad 1.0.0: banned, since it is bad"]);
        let elsewhere = found("good", Some("MIT"), Some("git+https://example.org/good"));
        assert!(elsewhere[0].contains("found git+https"), "{elsewhere:?}");
    }
}
