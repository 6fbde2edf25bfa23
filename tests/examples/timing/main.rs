//! Measures the timing of the participant's page in a real browser: `cargo xtask validate timing`.
//!
//! Prints JSON. `SIDESTEP_BIN` is the path of the server whose site is measured.
#![allow(clippy::print_stdout, reason = "it answers on standard output")]

mod figures;
mod scenes;
mod keys;
mod loading;
mod memory;

use serde_json::json;
use std::fs;

#[tokio::main]
async fn main() {
    let mut cases = Vec::new();
    for case in scenes::CASES {
        eprintln!("scenes: {}", case.name);
        cases.push(scenes::measured(&case).await);
    }
    eprintln!("keys");
    let keys = keys::measured().await;
    eprintln!("loading");
    let loading = loading::measured().await;
    eprintln!("memory");
    let memory = memory::measured().await;
    let found = json!({
        "machine": machine(),
        "scenes": cases,
        "keys": keys,
        "loading": loading,
        "memory": memory,
    });
    println!("{found}");
}

/// The processor's name and the number of its cores.
fn machine() -> serde_json::Value {
    let info = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    let name = name.map_or("an unknown processor", |(_, name)| name);
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    json!({ "processor": name, "cores": cores })
}
