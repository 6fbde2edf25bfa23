//! The encoded value functions, and which of them give a configuration's safety levels.

use super::sql::{OptionalExtension, params};
use super::{Store, StoreError};
use sidestep::scene::Evader;
use sidestep::study::StudyConfig;
use std::sync::Arc;

/// A value function to be stored.
#[derive(Clone, Debug)]
pub struct NewValueFunction {
    /// The vehicle whose safety level it gives.
    pub evader: Evader,
    /// SHA-256 of the bytes.
    pub id: String,
    /// The encoded function.
    pub bytes: Vec<u8>,
}

impl Store {
    /// Stores value functions under their ids, and records for which safety levels of a
    /// configuration they are used. An existing function is never replaced.
    ///
    /// # Errors
    /// [`StoreError`], also if the configuration does not exist.
    pub async fn put_value_functions(
        &self,
        config_hash: &str,
        functions: Vec<NewValueFunction>,
    ) -> Result<(), StoreError> {
        let config_hash = config_hash.to_owned();
        self.write_behind([], move |db| {
            for NewValueFunction { evader, id, bytes } in &functions {
                db.execute(
                    "INSERT INTO value_function (id, octets) VALUES ($1, $2) \
                     ON CONFLICT (id) DO NOTHING",
                    params![id, bytes],
                )?;
                db.execute(
                    "INSERT INTO safety_function (config_hash, evader, value_function_id) \
                     VALUES ($1, $2, $3) ON CONFLICT (config_hash, evader) DO NOTHING",
                    params![config_hash, evader.word(), id],
                )?;
            }
            Ok(())
        })
        .await
    }

    /// The encoded function with this id.
    pub async fn value_function(&self, id: &str) -> Result<Option<Vec<u8>>, StoreError> {
        let id = id.to_owned();
        self.read_long(move |db| {
            let query = "SELECT octets FROM value_function WHERE id = $1";
            Ok(db.prepare_cached(query)?.query_row([id], |row| row.get(0)).optional()?)
        })
        .await
    }

    /// The id of the function that gives the safety level of `evader`.
    pub async fn value_function_id(
        &self,
        config_hash: &str,
        evader: Evader,
    ) -> Result<Option<String>, StoreError> {
        let config_hash = config_hash.to_owned();
        self.read(move |db| {
            let mut statement = db.prepare_cached(
                "SELECT value_function_id FROM safety_function \
                 WHERE config_hash = $1 AND evader = $2",
            )?;
            let found =
                statement.query_row([config_hash.as_str(), evader.word()], |row| row.get(0));
            Ok(found.optional()?)
        })
        .await
    }

    /// Every configuration that lacks a value function, with its hash.
    pub async fn unsolved(&self) -> Result<Vec<(String, Arc<StudyConfig>)>, StoreError> {
        let store = self.clone();
        self.read(move |db| {
            let mut statement = db.prepare_cached(
                "SELECT hash FROM study_config WHERE \
                     (SELECT count(*) FROM safety_function WHERE config_hash = hash) < 2",
            )?;
            let hashes = statement.query_map([], |row| row.get::<_, String>(0))?;
            let hashes = hashes.collect::<Result<Vec<_>, _>>()?;
            hashes.into_iter().map(|hash| Ok((hash.clone(), store.config_in(db, &hash)?))).collect()
        })
        .await
    }
}
