//! Reads a study from a damaged file.

use super::super::{StudyCopy, study_copy, versions};
use super::Reader;
use crate::store::StoreError;
use crate::store::sql::OptionalExtension;
use crate::store::studies::key_of;
use sidestep::study::StudyConfig;
use std::collections::{BTreeMap, BTreeSet};

impl Reader<'_> {
    /// A study, with its configurations and value functions as far as they can be read.
    pub(super) fn study(&mut self, slug: &str) -> Result<Option<StudyCopy>, StoreError> {
        let read = match study_copy(self.db, slug) {
            Err(StoreError::Corrupt(_)) => self.parts_of_study(slug)?,
            found => found?,
        };
        let Some(mut study) = read else { return Ok(None) };
        // The versions are ordered by number.
        let mut before = 0;
        for &(number, ..) in &study.versions {
            if number > before + 1 {
                let key = format!("{} to {} of {slug}", before + 1, number - 1);
                self.lose("study_version", key, "it cannot be read")?;
            }
            before = number;
        }
        if study.versions.is_empty() {
            self.lose("study_version", format!("of {slug}"), "it cannot be read")?;
        }
        if study.versions.is_empty() {
            // A study always has a version, so the configuration in the study's row becomes version 1.
            study.versions.push((1, study.config_hash.clone(), study.created_at_ms, false));
        }
        for (hash, json) in std::mem::take(&mut study.configs) {
            if let Err(error) = serde_json::from_str::<StudyConfig>(&json) {
                self.lose("study_config", hash, &format!("it is damaged: {error}"))?;
                continue;
            }
            let saved = key_of(json.as_bytes());
            if saved != hash && !self.configs.contains_key(&hash) {
                let why = format!("it was altered, and is saved as {saved}");
                self.lose("study_config", &*hash, &why)?;
            }
            self.configs.insert(hash, saved.clone());
            study.configs.push((saved, json));
        }
        let saved = |hash: &mut String| match self.configs.get(hash) {
            Some(saved) => {
                hash.clone_from(saved);
                true
            }
            None => false,
        };
        study.versions.retain_mut(|(_, hash, ..)| saved(hash));
        // Value functions of an altered configuration may belong to other parameters.
        study.safety.retain(|(hash, ..)| self.configs.get(hash) == Some(hash));
        if !saved(&mut study.config_hash) {
            let Some((_, hash, ..)) = study.versions.last() else {
                return self.lose("study", slug, "its configuration is lost").map(|()| None);
            };
            study.config_hash.clone_from(hash);
            let why = "its last configuration is lost; an earlier one takes its place";
            self.lose("study", slug, why)?;
        }
        for (id, bytes) in std::mem::take(&mut study.functions) {
            match key_of(&bytes) == id {
                true => drop(study.functions.insert(id, bytes)),
                false => self.lose("value_function", id, "it was altered")?,
            }
        }
        study.safety.retain(|(.., id)| study.functions.contains_key(id));
        Ok(Some(study))
    }

    /// Assembles a study from its readable rows, because some of its rows cannot be read.
    fn parts_of_study(&mut self, slug: &str) -> Result<Option<StudyCopy>, StoreError> {
        let db = self.db;
        let Some(&(study_id, _)) = self.rowids("study", slug)?.first() else { return Ok(None) };
        let own = "SELECT config_hash, created_at_ms FROM study WHERE id = $1";
        let own = db.query_row(own, [study_id], |row| {
            Ok((row.get::<_, String>(0)?, row.get::<_, i64>(1)?))
        });
        let versions = self.unless_lost("study_version", slug, versions(db, study_id))?;
        let versions = versions.unwrap_or_default();
        let (config_hash, created_at_ms) = match (own.map_err(StoreError::from), &versions[..]) {
            // The versions repeat the data of the study's row.
            (Err(StoreError::Corrupt(_)), [(_, _, created_at_ms, _), ..]) => {
                (versions[versions.len() - 1].1.clone(), *created_at_ms)
            }
            (own, _) => match self.unless_lost("study", slug, own)? {
                Some(own) => own,
                None => return Ok(None),
            },
        };
        let mut configs = Vec::new();
        for hash in self.ids("study_config")? {
            let query = "SELECT json FROM study_config WHERE hash = $1";
            let json = db.query_row(query, [&hash], |row| row.get::<_, String>(0));
            let json = self.unless_lost("study_config", &hash, json.map_err(StoreError::from))?;
            configs.extend(json.map(|json| (hash, json)));
        }
        let (mut functions, mut safety) = (BTreeMap::new(), Vec::new());
        for (hash, _) in &configs {
            let query =
                "SELECT evader, value_function_id FROM safety_function WHERE config_hash = $1";
            let of = || {
                let mut statement = db.prepare_cached(query)?;
                let rows = statement.query_map([hash], |row| {
                    Ok((row.get::<_, String>(0)?, row.get::<_, String>(1)?))
                })?;
                Ok(rows.collect::<Result<Vec<_>, _>>()?)
            };
            let key = format!("of configuration {hash}");
            for (evader, id) in
                self.unless_lost("safety_function", &key, of())?.into_iter().flatten()
            {
                safety.push((hash.clone(), evader, id));
            }
        }
        let ids: BTreeSet<&String> = safety.iter().map(|(.., id)| id).collect();
        for id in ids {
            let query = "SELECT octets FROM value_function WHERE id = $1";
            let bytes = db.query_row(query, [id], |row| row.get::<_, Vec<u8>>(0)).optional();
            let bytes = bytes.map_err(StoreError::from).and_then(|bytes| {
                bytes.ok_or_else(|| StoreError::corrupt("there is only a reference to it"))
            });
            let bytes = self.unless_lost("value_function", id, bytes)?;
            functions.extend(bytes.map(|bytes| (id.clone(), bytes)));
        }
        let last_trial = match self.last("trial") {
            i64::MAX => 0,
            last => last,
        };
        let slug = slug.to_owned();
        Ok(Some(StudyCopy {
            slug,
            study_id,
            config_hash,
            created_at_ms,
            configs,
            versions,
            functions,
            safety,
            last_trial,
        }))
    }
}
