//! Killing the server while people upload, and looking for what it acknowledged.

use std::collections::HashMap;
use std::path::Path;
use std::rc::Rc;
use std::time::Duration;

use rusqlite::{Connection, OpenFlags, Row};
use serde_json::Value;
use sidestep::math::SeededRng;
use sidestep::scene::Scene;

use crate::figures::Milliseconds;
use crate::load::Load;
use crate::participant::drive;
use crate::server::{Server, database};

/// What came of the kills.
pub(crate) struct Kills {
    /// Uploads that were acknowledged between them.
    pub(crate) acknowledged: usize,
    /// How soon the server was ready again each time.
    pub(crate) ready: Milliseconds,
}

/// What came of the comparison with the database.
#[derive(Default)]
pub(crate) struct Comparison {
    pub(crate) acknowledged: usize,
    /// Acknowledged, and not there.
    pub(crate) missing: usize,
    /// Acknowledged, and there with another content.
    pub(crate) different: usize,
    /// There, though no answer said so: the server was killed between commit and answer.
    pub(crate) unacknowledged: usize,
}

/// Starts the server and kills it in the middle of uploads, so many times.
pub(crate) async fn kill(
    load: &Rc<Load>,
    folder: &Path,
    kills: u32,
    connections: usize,
) -> anyhow::Result<Kills> {
    let mut result = Kills { acknowledged: 0, ready: Milliseconds::default() };
    let mut rng = SeededRng::new(1);
    load.mortal.set(true);
    for _ in 0..kills {
        let server = Server::start(folder).await?;
        result.ready.push(server.ready_ms);
        load.address.set(server.address);
        if load.waiting() < 2 * connections {
            load.enrol(2 * connections, connections, Duration::from_secs(5)).await;
        }
        let alive = Duration::from_secs_f64(rng.uniform(0.2, 0.7));
        let death = async {
            tokio::time::sleep(alive).await;
            server.kill().await
        };
        let (killed, uploaded) = tokio::join!(death, load.upload(connections, 2 * alive));
        killed?;
        result.acknowledged += uploaded.0;
    }
    Ok(result)
}

/// Compares every trial that the server acknowledged with its row.
pub(crate) fn compare(load: &Load, folder: &Path) -> anyhow::Result<Comparison> {
    let mut expected: HashMap<String, Scene> = HashMap::new();
    load.everybody(|participant| expected.extend(participant.acknowledged().iter().cloned()));
    let mut found = Comparison { acknowledged: expected.len(), ..Comparison::default() };
    let db = Connection::open_with_flags(database(folder), OpenFlags::SQLITE_OPEN_READ_WRITE)?;
    let mut query = db.prepare(
        "SELECT trial_id, started_at_ms, inputs, states, sampled_at_ms, key_events, display \
         FROM trial",
    )?;
    let mut rows = query.query([])?;
    while let Some(row) = rows.next()? {
        let trial_id: String = row.get("trial_id")?;
        match expected.remove(&trial_id) {
            Some(scene) if !is_as_sent(row, &trial_id, &scene)? => found.different += 1,
            Some(_) => {}
            None => found.unacknowledged += 1,
        }
    }
    found.missing = expected.len();
    Ok(found)
}

/// Whether a row holds what was sent, bit for bit.
fn is_as_sent(row: &Row<'_>, trial_id: &str, scene: &Scene) -> anyhow::Result<bool> {
    let sent = drive(trial_id, scene);
    let doubles = |numbers: &[f64]| -> Vec<u8> {
        numbers.iter().copied().flat_map(f64::to_le_bytes).collect()
    };
    let states: Vec<f64> = sent
        .states
        .iter()
        .flat_map(|state| [state.human, state.robot])
        .flat_map(|pose| [pose.x, pose.y, pose.psi])
        .collect();
    let inputs: Vec<u8> = sent.inputs.iter().map(|input| input.sign().cast_unsigned()).collect();
    let blob = |column| -> anyhow::Result<&[u8]> { Ok(row.get_ref(column)?.as_blob()?) };
    let json = |column| -> anyhow::Result<Value> {
        Ok(serde_json::from_str(row.get_ref(column)?.as_str()?)?)
    };
    Ok(row.get::<_, f64>("started_at_ms")?.to_bits() == sent.started_at_ms.to_bits()
        && blob("inputs")? == inputs
        && blob("states")? == doubles(&states)
        && blob("sampled_at_ms")? == doubles(&sent.sampled_at_ms)
        && json("key_events")? == serde_json::to_value(&sent.key_events)?
        && json("display")? == serde_json::to_value(&sent.display)?)
}
