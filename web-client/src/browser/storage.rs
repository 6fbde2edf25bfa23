//! Storage in this browser for the pages of this origin. It has one record per name, in the object
//! store `kept` of the database `sidestep`. Earlier versions stored their records in local storage
//! under the same names. Such records are still read and can be deleted.

use crate::runtime::NotKept;
use js_sys::{Array, Function, Object, Promise, Reflect};
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::JsFuture;
use web_sys::{DomException, IdbDatabase, IdbOpenDbRequest, IdbRequest, IdbTransaction, Window};

/// Name of the database, and prefix of this program's names in the local storage.
const DATABASE: &str = "sidestep";
const STORE: &str = "kept";

/// Timeout for a database request (ms). If the database does not answer in time, it counts as
/// unavailable.
const PATIENCE_MS: i32 = 2_000;

/// The database, or the reason why it cannot be used.
pub(super) struct Storage {
    window: Window,
    database: Result<IdbDatabase, NotKept>,
    /// Whether the browser was already asked not to evict the records when it runs out of space.
    is_persistent: bool,
}

/// The stored texts by name.
type Records = Vec<(String, String)>;

impl Storage {
    /// Opens the database and reads all records.
    pub(super) async fn open(window: &Window) -> (Self, Records) {
        let mut records = earlier(window).unwrap_or_default();
        let database = match open(window).await {
            Ok(database) => match all(window, &database).await {
                Ok(kept) => {
                    // A record in the database takes precedence over a record of an earlier
                    // version.
                    records.retain(|(name, _)| kept.iter().all(|(known, _)| known != name));
                    records.extend(kept);
                    Ok(database)
                }
                Err(error) => Err(reason(&error)),
            },
            Err(error) => Err(reason(&error)),
        };
        (Self { window: window.clone(), database, is_persistent: false }, records)
    }

    /// A storage that stores nothing, for pages without records.
    pub(super) fn none(window: &Window) -> Self {
        let database = Err(NotKept::Denied);
        Self { window: window.clone(), database, is_persistent: false }
    }

    /// Returns why nothing can be stored, if that is the case.
    pub(super) fn failure(&self) -> Option<NotKept> {
        self.database.as_ref().err().copied()
    }

    /// Stores a text under a name. The text is stored once the future has resolved successfully.
    pub(super) fn keep(
        &mut self,
        name: &str,
        text: &str,
    ) -> impl Future<Output = Result<(), NotKept>> + use<> {
        if !std::mem::replace(&mut self.is_persistent, true) {
            // A page loaded without encryption has no storage manager.
            let navigator = self.window.navigator();
            let manager = Reflect::get(&navigator, &"storage".into()).unwrap_or_default();
            super::wish(&manager, "persist");
        }
        // The database executes the requests for a name in order.
        let written = self.database.as_ref().map_err(|reason| *reason).and_then(|database| {
            let put = || {
                let transaction = write(database)?;
                transaction.object_store(STORE)?.put_with_key(&text.into(), &name.into())?;
                Ok(committed(&transaction))
            };
            put().map_err(|error| reason(&error))
        });
        let window = self.window.clone();
        async move { settled(&window, &written?).await.map(drop).map_err(|error| reason(&error)) }
    }

    /// Deletes the record of a name.
    pub(super) fn forget(&self, name: &str) {
        // If the record does not exist or cannot be reached, nothing needs to be deleted.
        if let Ok(database) = &self.database {
            let _ = write(database).and_then(|all| all.object_store(STORE)?.delete(&name.into()));
        }
        if let Ok(Some(storage)) = self.window.local_storage() {
            let _ = storage.remove_item(name);
        }
    }
}

/// All records of this program in the local storage. A private window may have no local storage or
/// deny access.
fn earlier(window: &Window) -> Option<Records> {
    let storage = window.local_storage().ok()??;
    let names = (0..storage.length().ok()?).filter_map(|i| storage.key(i).ok()?);
    let ours = names.filter(|name| name.starts_with(DATABASE));
    Some(ours.filter_map(|name| Some((name.clone(), storage.get_item(&name).ok()??))).collect())
}

async fn open(window: &Window) -> Result<IdbDatabase, JsValue> {
    let factory = window.indexed_db()?.ok_or(JsValue::NULL)?;
    let request = factory.open(DATABASE)?;
    let fresh = request.clone();
    let create = Closure::once_into_js(move || {
        let database: IdbDatabase = fresh.result().unwrap_or_default().unchecked_into();
        let _ = database.create_object_store(STORE);
    });
    IdbOpenDbRequest::set_onupgradeneeded(&request, Some(create.unchecked_ref()));
    settled(window, &answered(&request)).await?;
    Ok(request.result()?.unchecked_into())
}

async fn all(window: &Window, database: &IdbDatabase) -> Result<Records, JsValue> {
    let store = database.transaction_with_str(STORE)?.object_store(STORE)?;
    // Both requests belong to one transaction, so they return the same records in the same order.
    let (names, texts) = (store.get_all_keys()?, store.get_all()?);
    settled(window, &answered(&texts)).await?;
    let (names, texts) = (Array::from(&names.result()?), Array::from(&texts.result()?));
    Ok(names
        .iter()
        .zip(texts.iter())
        .filter_map(|(n, t)| n.as_string().zip(t.as_string()))
        .collect())
}

/// Begins a transaction that completes only when the records are on disk.
fn write(database: &IdbDatabase) -> Result<IdbTransaction, JsValue> {
    let options = Object::new();
    Reflect::set(&options, &"durability".into(), &"strict".into())?;
    let begin: Function = Reflect::get(database, &"transaction".into())?.unchecked_into();
    let begun = begin.call3(database, &STORE.into(), &"readwrite".into(), &options)?;
    Ok(begun.unchecked_into())
}

/// A promise that settles when the request succeeds or fails.
fn answered(request: &IdbRequest) -> Promise {
    Promise::new(&mut |done, failed| {
        request.set_onsuccess(Some(&done));
        request.set_onerror(Some(&failed));
    })
}

/// A promise that settles when the transaction completes or aborts.
fn committed(transaction: &IdbTransaction) -> Promise {
    Promise::new(&mut |done, failed| {
        transaction.set_oncomplete(Some(&done));
        transaction.set_onabort(Some(&failed));
    })
}

/// Waits for a promise, with a timeout.
async fn settled(window: &Window, promise: &Promise) -> Result<JsValue, JsValue> {
    let late = Promise::new(&mut |_, failed| {
        let _ = window.set_timeout_with_callback_and_timeout_and_arguments_0(&failed, PATIENCE_MS);
    });
    JsFuture::from(Promise::race(&Array::of2(promise, &late))).await
}

/// The reason for a failure. `error` is an exception, or the event that reports one.
fn reason(error: &JsValue) -> NotKept {
    let target = Reflect::get(error, &"target".into()).unwrap_or_default();
    let inside = Reflect::get(&target, &"error".into()).unwrap_or_default();
    let error = inside.dyn_ref::<DomException>().or_else(|| error.dyn_ref());
    let is_full = error.is_some_and(|error| error.name() == "QuotaExceededError");
    if is_full { NotKept::Full } else { NotKept::Denied }
}
