//! The browser has no storage left, or denies it to the site.

use super::{QUICK, complete, glide, take_part};
use crate::{start, until_saved};
use sidestep_tests::Tab;

/// All storage functions throw, as in a private window of some browsers.
const DENIED: &str = "for (const name of ['indexedDB', 'localStorage']) \
    Object.defineProperty(window, name, { get() { \
        throw new DOMException('denied', 'SecurityError') } });";

/// Fills the site's storage with another database, first in large and then in small pieces.
const FILL: &str = "new Promise(done => { \
    const opening = indexedDB.open('other'); \
    opening.onupgradeneeded = () => opening.result.createObjectStore('all', {autoIncrement: true}); \
    opening.onsuccess = () => { \
        const put = size => { \
            const writing = opening.result.transaction('all', 'readwrite'); \
            writing.objectStore('all').put('x'.repeat(size)); \
            writing.oncomplete = () => put(size); \
            writing.onabort = () => size > 100 ? put(size / 4) : done(true) }; \
        put(65536) } })";

const KEEP_OPEN: &str = "Keep this page open until you have your completion code.";

/// Checks that a warning in the window gives the reason and says what to do.
async fn warned(tab: &Tab, why: &str) {
    tab.until_says("not-kept", why).await;
    assert!(tab.words("not-kept").await.contains(KEEP_OPEN));
    let inside = format!(
        "(() => {{ const at = {}.getBoundingClientRect(); \
         return at.top >= 0 && at.bottom <= innerHeight }})()",
        Tab::at("not-kept")
    );
    assert!(tab.eval::<bool>(&inside).await, "the warning is in the window");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn storage_that_is_denied_warns_and_leads_to_the_code() {
    let (server, browser, tab) = start(QUICK).await;
    tab.before_pages(DENIED).await;
    take_part(&tab, &format!("{}/s/default", server.origin)).await;
    warned(&tab, "does not let this site store anything").await;
    // The network is also cut, so the scene stays in memory, and the page says so.
    tab.offline(true).await;
    glide(&tab).await;
    tab.until_says("saved", "1 scene not sent yet; keep this page open.").await;
    warned(&tab, "does not let this site store anything").await;
    tab.offline(false).await;
    until_saved(&tab).await;
    glide(&tab).await;
    complete(&tab, &server, 2).await;
    tab.is_well().await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn storage_that_is_full_in_the_middle_warns_and_leads_to_the_code() {
    let (server, browser, tab) = start(QUICK).await;
    tab.limit_storage(&server.origin, 500_000).await;
    take_part(&tab, &format!("{}/s/default", server.origin)).await;
    assert!(tab.eval::<bool>(FILL).await);
    tab.offline(true).await;
    glide(&tab).await;
    tab.until_says("saved", "1 scene not sent yet; keep this page open.").await;
    warned(&tab, "has no storage left").await;
    tab.offline(false).await;
    until_saved(&tab).await;
    glide(&tab).await;
    complete(&tab, &server, 2).await;
    browser.close().await;
}
