//! Rate limits that several servers of one database share.

use super::sql::{Connection, OptionalExtension, params};
use super::{Store, StoreError};

/// A rate limit (token bucket). A bucket holds at most `burst_ms / pause_ms` tokens, and regains
/// one token after each `pause_ms`.
#[derive(Clone, Copy, Debug)]
pub struct Allowance {
    /// The kind of action.
    pub kind: &'static str,
    /// Refill time of one token (ms).
    pub pause_ms: i64,
    /// Refill time of an empty bucket (ms).
    pub burst_ms: i64,
}

/// The database's clock (ms). It is used because the servers' clocks may differ.
const NOW: &str = "CAST(extract(epoch FROM clock_timestamp()) * 1000 AS BIGINT)";

impl Store {
    /// Takes a token of `who`, a hash. If no token is left, takes nothing and returns how long to
    /// wait (ms). Only for a shared database. Watchers are not notified.
    pub async fn take_turn(
        &self,
        allowed: Allowance,
        who: [u8; 32],
    ) -> Result<Result<(), i64>, StoreError> {
        let Allowance { kind, pause_ms, burst_ms } = allowed;
        self.read(move |db| {
            // This does not wait for the disk, so a client can get a few extra tokens after a power
            // failure.
            let take = format!(
                "INSERT INTO throttle (kind, who, full_at_ms) SELECT $1, $2, {NOW} + $3 \
                     FROM set_config('synchronous_commit', 'off', TRUE) \
                 ON CONFLICT (kind, who) DO UPDATE \
                 SET full_at_ms = greatest(throttle.full_at_ms, {NOW}) + $3 \
                 WHERE greatest(throttle.full_at_ms, {NOW}) + $3 <= {NOW} + $4"
            );
            let taken = db.execute(&take, params![kind, who, pause_ms, burst_ms])?;
            if taken > 0 {
                forget(db)?;
                return Ok(Ok(()));
            }
            Ok(Err(spent_ms(db, kind, who)?.map_or(1, |spent| spent + pause_ms - burst_ms).max(1)))
        })
        .await
    }

    /// Whether `who`, a hash, has no token left. Only for a shared database.
    pub async fn has_no_turn(&self, allowed: Allowance, who: [u8; 32]) -> Result<bool, StoreError> {
        let Allowance { kind, pause_ms, burst_ms } = allowed;
        self.read(move |db| {
            let spent = spent_ms(db, kind, who)?;
            Ok(spent.is_some_and(|spent| spent + pause_ms > burst_ms))
        })
        .await
    }
}

/// Time until the bucket is full again (ms).
fn spent_ms(db: &Connection, kind: &str, who: [u8; 32]) -> Result<Option<i64>, StoreError> {
    let query = format!("SELECT full_at_ms - {NOW} FROM throttle WHERE kind = $1 AND who = $2");
    let spent = db.prepare_cached(&query)?.query_row(params![kind, who], |row| row.get(0));
    Ok(spent.optional()?)
}

/// Deletes at most two expired rows. Each call of [`Store::take_turn`] adds at most one row.
fn forget(db: &Connection) -> Result<(), StoreError> {
    let old = format!(
        "DELETE FROM throttle WHERE (kind, who) IN \
             (SELECT kind, who FROM throttle WHERE full_at_ms < {NOW} LIMIT 2 FOR UPDATE SKIP LOCKED)"
    );
    db.execute(&old, params![])?;
    Ok(())
}
