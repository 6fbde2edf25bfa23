//! A cache of texts for each configuration and language.

use super::Languages;
use super::page::consent_hash;
use sidestep::api::Texts;
use sidestep::study::{StudyConfig, closest_language};
use std::collections::HashMap;
use std::sync::{Arc, PoisonError, RwLock};

/// Languages, with a cache of the texts made from them.
#[derive(Debug)]
pub struct Library {
    languages: Languages,
    /// The pages, by the hash of the configuration and the language. Cached pages never change while
    /// the server runs.
    made: RwLock<HashMap<(String, String), Arc<Page>>>,
}

/// The texts that a participant reads, with the hash of what they agree to.
#[derive(Debug)]
pub struct Page {
    /// The texts.
    pub texts: Texts,
    /// The hash computed by [`consent_hash`].
    pub consent_hash: String,
}

impl Library {
    /// Starts with an empty cache.
    #[must_use]
    pub fn new(languages: Languages) -> Self {
        Self { languages, made: RwLock::default() }
    }

    /// The languages.
    #[must_use]
    pub fn languages(&self) -> &Languages {
        &self.languages
    }

    /// The texts of the configuration with this hash. They are in the first of the `wanted`
    /// languages that the study offers, or otherwise in the first language of the study. If a
    /// participant has `begun` in a language, they can continue in it even if the study no longer
    /// offers it, unless the study names its languages.
    pub fn page<'a>(
        &self,
        config: &StudyConfig,
        config_hash: &str,
        wanted: impl Iterator<Item = &'a str>,
        begun: Option<&str>,
    ) -> Arc<Page> {
        let mut offered = self.languages.offered(config);
        if let Some(begun) = begun.and_then(|tag| self.languages.tags().find(|known| *known == tag))
            && config.languages.is_empty()
            && !offered.contains(&begun)
        {
            offered.push(begun);
        }
        let first = offered.first().copied().unwrap_or("en");
        let closest = |tag: &str| closest_language(offered.iter().copied(), tag);
        let language = wanted.filter_map(closest).next().unwrap_or(first);
        let key = (config_hash.to_owned(), language.to_owned());
        let made = self.made.read().unwrap_or_else(PoisonError::into_inner).get(&key).cloned();
        made.unwrap_or_else(|| {
            let texts = self.languages.texts(config, language);
            let page = Arc::new(Page { consent_hash: consent_hash(&texts), texts });
            let mut made = self.made.write().unwrap_or_else(PoisonError::into_inner);
            made.insert(key, Arc::clone(&page));
            page
        })
    }
}
