//! Checks for forbidden dependencies between packages and modules, and checks promises of the
//! documents.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

#[path = "architecture/source.rs"]
mod source;

use source::{Source, backward, modules};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: impl AsRef<Path>) -> String {
    let path = root().join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Files with this extension in a folder and its subfolders, as paths from the root.
fn files(folder: &str, ending: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut folders = vec![root().join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() && name != "target" && !name.starts_with('.') {
                folders.push(path);
            } else if name.ends_with(ending) {
                let from_root = path.strip_prefix(root()).unwrap();
                found.push(from_root.to_string_lossy().into_owned());
            }
        }
    }
    assert!(!found.is_empty(), "no {ending} in {folder}");
    found.sort();
    found
}

/// Asserts that no path in the code in `folder` contains one of `words`.
fn never(folder: &str, words: &[&str], except: impl Fn(&str) -> bool) {
    for path in files(folder, ".rs").into_iter().filter(|path| !except(path)) {
        let source = Source::new(&read(&path));
        for word in words {
            let word: Vec<&str> = word.split("::").collect();
            let has = |path: &Vec<String>| path.windows(word.len()).any(|part| part == word);
            assert!(!source.paths.iter().any(has), "{path} must not use {}", word.join("::"));
        }
    }
}

/// Names in a manifest's `[dependencies]` tables, including tables for single targets.
fn dependencies(manifest: &str) -> BTreeSet<String> {
    let manifest: toml::Table = read(manifest).parse().unwrap();
    let targets = manifest.get("target").and_then(toml::Value::as_table);
    let tables = targets
        .into_iter()
        .flat_map(|targets| targets.values())
        .chain([&toml::Value::Table(manifest.clone())])
        .filter_map(|holder| holder.get("dependencies")?.as_table().cloned())
        .collect::<Vec<_>>();
    tables.into_iter().flat_map(|table| table.into_iter().map(|(name, _)| name)).collect()
}

#[test]
fn the_library_is_pure() {
    let impure = [
        "std::fs",
        "std::net",
        "std::time",
        "std::env",
        "std::process",
        "std::thread",
        "tokio",
        "sqlx",
        "web_sys",
        "js_sys",
        "wasm_bindgen",
        "SystemTime",
        "Instant",
    ];
    never("shared/src", &impure, |_| false);
    let allowed = [
        "hex",
        "libm",
        "nalgebra",
        "pulp",
        "rand_chacha",
        "rand_core",
        "rayon",
        "schemars",
        "serde",
        "serde_json",
        "serde_path_to_error",
        "sha2",
        "special",
        "strsim",
        "thiserror",
    ];
    let unknown: Vec<_> = dependencies("shared/Cargo.toml")
        .into_iter()
        .filter(|name| !allowed.contains(&name.as_str()))
        .collect();
    assert!(unknown.is_empty(), "is {unknown:?} pure? then say so here");
}

#[test]
fn client_and_server_do_not_know_each_other() {
    let server = dependencies("server/Cargo.toml");
    let client = dependencies("web-client/Cargo.toml");
    assert!(!server.contains("sidestep-web") && !client.contains("sidestep-server"));
    never("server/src", &["sidestep_web", "web_sys", "js_sys"], |_| false);
    never("web-client/src", &["sidestep_server", "tokio", "sqlx"], |_| false);
}

#[test]
fn the_python_package_is_the_library_alone() {
    let needs = dependencies("python/Cargo.toml");
    assert_eq!(
        needs.iter().collect::<Vec<_>>(),
        ["numpy", "pyo3", "serde", "serde_json", "sidestep"]
    );
    for package in ["shared", "server", "web-client"] {
        let needs = dependencies(&format!("{package}/Cargo.toml"));
        assert!(!needs.contains("pyo3") && !needs.contains("numpy"), "{package} needs no Python");
    }
}

/// Checks a promise of CONTRIBUTING about adding a model to `analyze`: only these files name a
/// model, so no other code has to be found and changed for a new model. `Boosted` is not in the
/// paper, so no other code has a reason to name it.
#[test]
fn a_model_is_named_in_its_tables_alone() {
    let named = |path: &String| {
        let text = read(path);
        let product = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        ["ModelName::Boosted", "Model::Boosted", "\"boosted\""]
            .iter()
            .any(|name| product.contains(name))
    };
    let found = ["shared/src", "server/src", "web-client/src", "python/src"]
        .map(|folder| files(folder, ".rs"))
        .concat();
    let found: Vec<_> =
        found.into_iter().filter(|path| !path.ends_with("/tests.rs")).filter(named).collect();
    assert_eq!(
        found,
        [
            "shared/src/comparison/models.rs",
            "shared/src/predict.rs",
            "shared/src/predict/boosting.rs"
        ]
    );
}

#[test]
fn the_container_is_built_from_every_package() {
    let recipe = read("docs/deploy/Containerfile");
    let manifest: toml::Table = read("Cargo.toml").parse().unwrap();
    let packages = manifest["workspace"]["members"].as_array().unwrap();
    for package in packages.iter().map(|package| package.as_str().unwrap()) {
        // Cargo does not build a workspace if one of its packages is missing.
        assert!(recipe.contains(&format!("\nCOPY {package} {package}\n")), "{package}");
    }
}

#[test]
fn modules_use_only_those_above() {
    for package in ["shared", "server", "web-client", "python", "xtask"] {
        let uses = backward(&modules(&root().join(package).join("src")));
        assert!(uses.is_empty(), "{package}: uses of modules that are declared below: {uses:#?}");
    }
}

#[test]
fn predictors_do_not_know_what_features_mean() {
    let meaning = ["crate::scene", "crate::vehicle", "crate::reachability", "crate::trial"];
    never("shared/src/predict", &meaning, |_| false);
}

#[test]
fn sql_is_spoken_in_the_store_alone() {
    let in_store = |path: &str| path.starts_with("server/src/store");
    never("server/src", &["sqlx"], in_store);
    for path in files("server/src", ".rs").into_iter().filter(|path| !in_store(path)) {
        for text in Source::new(&read(&path)).strings {
            for word in ["SELECT ", "INSERT ", "UPDATE ", "DELETE FROM"] {
                assert!(!text.contains(word), "{path} must not say {word} to the database");
            }
        }
    }
}

#[test]
fn the_browser_is_touched_in_its_adapters_alone() {
    let adapters = ["src/browser", "src/json/", "src/texts/"];
    let adapter = |path: &str| adapters.iter().any(|adapter| path.contains(adapter));
    never("web-client/src", &["web_sys", "js_sys", "wasm_bindgen"], adapter);
}

#[test]
fn every_layer_is_in_the_table() {
    let table = read("shared/src/trial_view/layers.rs");
    for path in files("shared/src/trial_view", ".rs") {
        if !read(&path).contains("fn paint(playback: &mut Playback") {
            continue;
        }
        let name = Path::new(&path).file_stem().unwrap().to_str().unwrap();
        for function in ["paint", "legend"] {
            let entry = format!("{function}: {name}::");
            assert!(table.contains(&entry), "{name} has no {function} in LAYERS");
        }
    }
}

/// Each layer's switch has a colour in the style sheet.
#[test]
fn every_layer_has_a_swatch() {
    let style = read("static/lab.css");
    let table = read("shared/src/trial_view/layers.rs");
    let swatches: Vec<_> = table.split("swatch: \"").skip(1).collect();
    assert!(swatches.len() > 5, "{} swatches", swatches.len());
    for swatch in swatches {
        let classes = swatch.split('"').next().unwrap();
        for class in classes.split(' ') {
            let known = style.lines().any(|line| {
                let line = line.split('{').next().unwrap_or_default();
                line.contains(".swatch") && line.split(['.', ',', ' ', ':']).any(|it| it == class)
            });
            assert!(known, "static/lab.css has no rule .swatch.{class}");
        }
    }
}

#[test]
fn documents_name_files_that_exist() {
    for document in files(".", ".md") {
        let text = read(&document);
        let folder = root().join(&document).parent().unwrap().to_path_buf();
        let links = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
        for link in links.filter(|link| !link.contains("://")) {
            let path = link.split('#').next().unwrap();
            assert!(path.is_empty() || folder.join(path).exists(), "{document} links to {link}");
        }
        // Paths in backquotes that begin with one of the project's folders.
        for name in text.split('`').skip(1).step_by(2) {
            let ours = [
                "shared/",
                "server/",
                "web-client/",
                "python/",
                "tests/",
                "xtask/",
                "migrations/",
                "static/",
                "docs/",
            ];
            let plain = !name.contains(['*', '{', '<', ' ', '…', '\n']);
            if plain && ours.iter().any(|folder| name.starts_with(folder)) {
                assert!(root().join(name).exists(), "{document} names {name}");
            }
        }
    }
}

/// The lines of the `sh` blocks, without here-documents for `cat`, which end with a line `END`.
fn commands(document: &str) -> Vec<&str> {
    let blocks = document.split("```sh\n").skip(1).filter_map(|rest| rest.split("```").next());
    let mut lines = blocks.flat_map(str::lines);
    let mut commands = Vec::new();
    while let Some(line) = lines.next() {
        if line.starts_with("cat > ") && line.ends_with(" <<'END'") {
            assert!(lines.any(|line| line == "END"), "{line}: no END");
        } else {
            commands.push(line);
        }
    }
    commands
}

#[test]
fn commands_of_the_readme_exist() {
    // A command can continue on the next line.
    let readme = read("README.md").replace("\\\n", " ");
    let lines = commands(&readme);
    assert!(lines.contains(&"cargo xtask serve"));
    assert!(lines.contains(&"cargo xtask test"));
    let xtask = read("xtask/src/main.rs");
    let binary = sidestep_tests::process::binary();
    for line in lines {
        let mut words = line.split('#').next().unwrap().split_whitespace();
        match words.next() {
            Some("cargo") => {
                assert_eq!(words.next(), Some("xtask"), "{line}");
                let name = words.next().unwrap();
                let variant = format!("{}{}", name[..1].to_uppercase(), &name[1..]);
                assert!(xtask.contains(&variant), "{line}: xtask has no {name}");
            }
            Some(command) if command.ends_with("/sidestep") => {
                let (names, flags): (Vec<_>, Vec<_>) =
                    words.partition(|word| !word.starts_with("--"));
                let mut help = Command::new(binary);
                if flags != ["--help"] {
                    help.arg(names[0]);
                }
                let output = help.arg("--help").output().unwrap();
                let text = String::from_utf8(output.stdout).unwrap();
                assert!(output.status.success(), "{line}");
                for flag in flags {
                    assert!(text.contains(flag), "{line}: no {flag} in\n{text}");
                }
            }
            Some(other) => panic!("{line}: is {other} there on a fresh machine?"),
            None => {}
        }
    }
}
