//! The explorer of predicted sets, with real keys and sliders.

use crate::{sign_in, start, take};
use sidestep::chart::fixed;
use sidestep::scene::SceneParameters;
use sidestep_tests::folder::{number, rows};
use sidestep_tests::{Browser, Driver, Folder, Server, Tab, run};

/// Eleven tasks are enough to learn from some of them.
const STUDY: &str = "title = \"Sets\"\nphases = [{ phase = \"task\", scenes = 11 }]\n";

/// Opens the explorer for a participant who has driven all tasks.
async fn explorer() -> (Server, Browser, Tab, String) {
    let (server, browser, tab) = start(STUDY).await;
    let driver = Driver::enrol(&server).await;
    driver.drive(&server, 11).await;
    sign_in(&tab, &server).await;
    let participant = driver.enrolled.participant_id.clone();
    // Users get to the explorer from the participant's page.
    tab.go(&format!("{}/lab/participants/{participant}", server.origin)).await;
    tab.press("explorer-link").await;
    tab.until_says("p-4", "1.000").await;
    until_counted(&tab).await;
    (server, browser, tab, participant)
}

/// Waits until all tasks are counted for the current settings.
async fn until_counted(tab: &Tab) {
    let counted = Tab::at("counted");
    tab.until(&format!("{counted}?.className === 'done' && !document.querySelector('.sets.old')"))
        .await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn sets_move_while_a_slider_moves() {
    let (server, browser, tab, participant) = explorer().await;
    let areas = async || [tab.words("area-0").await, tab.words("area-3").await];
    let before = areas().await;
    // Press keys on a slider, as a user does.
    tab.run(&format!("{}.focus()", Tab::at("epsilon-0"))).await;
    for _ in 0..5 {
        tab.key("ArrowRight").await;
    }
    until_counted(&tab).await;
    let after = areas().await;
    assert!(before[0] != after[0] && before[1] == after[1], "{before:?} {after:?}");
    // A key outside controls moves the time.
    tab.run("document.activeElement.blur()").await;
    tab.key("ArrowRight").await;
    tab.until_step("explorer", 1).await;
    // If the ε of a set is raised above the ε of the following sets, these are raised too.
    tab.enter("epsilon-0", "0.6").await;
    tab.until("location.search.includes('eps=0.6,0.6,0.6,0.6,1')").await;
    let wide = areas().await;
    assert!(wide[0] == wide[1] && wide[1] != after[1], "{wide:?}");
    tab.press("preset-0").await;
    // An error is shown next to its control, and invalid settings give no numbers.
    tab.enter("k", "2,2").await;
    tab.until_says("complaint", "k: expected 10 entries").await;
    assert_eq!(areas().await, ["—", "—"]);
    tab.press("preset-0").await;
    until_counted(&tab).await;
    // Fast dragging of a slider leaves no backlog, because only the last position counts.
    let wild = "for (let i = 0; i < 600; i++) { field.value = (i * 7 % 15) / 100; \
                field.dispatchEvent(new Event('input', { bubbles: true })) }";
    tab.run(&format!("(() => {{ const field = {}; {wild} }})()", Tab::at("epsilon-0"))).await;
    until_counted(&tab).await;
    assert_eq!(tab.attribute("epsilon-0", "value").await.as_deref(), Some("0.08"));
    // Dragging leaks no memory: a thousand moves do not increase the heap.
    let heap = tab.heap_bytes().await;
    for _ in 0..2 {
        tab.run(&format!("(() => {{ const field = {}; {wild} }})()", Tab::at("epsilon-0"))).await;
        until_counted(&tab).await;
    }
    let grown = tab.heap_bytes().await - heap;
    assert!(grown < 2e6, "{grown} bytes more");
    // The link restores the same settings and numbers.
    tab.until("location.search.includes('eps=0.08')").await;
    let link: String = tab.eval("location.href").await;
    let p = tab.words("p-1").await;
    tab.go("about:blank").await;
    tab.go(&link).await;
    tab.until_says("p-1", &p).await;
    // Choose a preset, open a replay at the same instant, and return to the explorer with the same
    // settings.
    tab.press("preset-1").await;
    tab.until_says("sets-table", "0.45").await;
    tab.press("replay-link").await;
    tab.until_step("replay", 1).await;
    tab.press("explorer-link").await;
    tab.until_step("explorer", 1).await;
    tab.until("location.search.includes('predictor=earlier')").await;
    assert!(tab.eval::<String>("location.pathname").await.ends_with(&participant));
    tab.is_well().await;
    drop(server);
    browser.close().await;
}

/// Tuning runs in the background, task by task, with the same results as on the command line.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn tuning_and_areas_are_those_of_the_command_line() {
    const TASKS: &str = "title = \"Sets\"\nphases = [{ phase = \"task\", scenes = 40 }]\n";
    let (server, browser, tab) = start(TASKS).await;
    let driver = Driver::enrol(&server).await;
    driver.drive_restlessly(&server, &SceneParameters::default(), 5).await;
    sign_in(&tab, &server).await;
    let participant = &driver.enrolled.participant_id;
    tab.go(&format!("{}/lab/explorer/{participant}", server.origin)).await;
    until_counted(&tab).await;
    // With a confidence level, twelve calibration tasks are enough for 0.75 but not for 0.9.
    tab.enter("guarantee", "pac").await;
    tab.enter("aim", "0.9").await;
    tab.until_says("lacking", "takes 29 tasks").await;
    tab.enter("aim", "0.75").await;
    tab.press("tune").await;
    tab.until(&Tab::at("in-use")).await;
    until_counted(&tab).await;
    let words = tab.words("found").await;
    until_compared(&tab).await;
    tab.run(&format!("{}.scrollIntoView()", Tab::at("found"))).await;
    take(&tab, "explorer-tuned").await;
    tab.run(&format!("{}.scrollIntoView()", Tab::at("panels"))).await;
    take(&tab, "explorer-areas").await;
    tab.run(&format!("{}.open = true", Tab::at("areas-twin"))).await;
    tab.run(&format!("{}.scrollIntoView()", Tab::at("areas-twin"))).await;
    take(&tab, "explorer-areas-numbers").await;
    let twin = tab.words("areas-twin").await;
    tab.is_well().await;
    browser.close().await;

    let folder = Folder::default();
    let (database, out) = (server.database(), folder.name("found"));
    let study = ["--study", "default", "--participant", "1", "--probability", "0.75"];
    let args = ["shfrs", "--database", &database, "--out", &out];
    run(&[&args[..], &study].concat()).await.json();
    let tuning = rows(folder.path("found/tuning.csv"));
    let row = tuning.iter().find(|row| row["guarantee"] == "pac").unwrap();
    let [epsilon, area] = ["epsilon", "mean_area_m2"].map(|column| number(row, column));
    for part in [
        &row["actions"][..],
        &row["statement"],
        &format!("{} rad/s", fixed(epsilon, 4)),
        &format!("{} m²", fixed(area, 3)),
        &format!("{} (", fixed(number(row, "coverage"), 2)),
    ] {
        assert!(words.contains(part), "{part} in {words}");
    }
    let pareto = rows(folder.path("found/pareto.csv"));
    let baselines: Vec<_> =
        pareto.iter().filter(|row| !row["family"].starts_with("SHFRS")).collect();
    assert_eq!(baselines.len(), 7);
    for row in baselines {
        let after = twin.split(&row["family"]).nth(1).unwrap_or_default();
        let area = fixed(number(row, "mean_area_m2"), 2);
        assert!(after.contains(&area), "{row:?} in {twin}");
    }
}

/// Waits until the comparison has finished.
async fn until_compared(tab: &Tab) {
    let compared = Tab::at("compared");
    tab.until(&format!("{compared}?.value === 1 && !document.querySelector('.panels.old')")).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_explorer_fits_its_window() {
    let (_server, browser, tab, _) = explorer().await;
    tab.enter("time", "3").await;
    tab.until_step("explorer", 15).await;
    take(&tab, "explorer").await;
    tab.enter("k", "2,2").await;
    tab.until_says("complaint", "k: expected 10 entries").await;
    take(&tab, "explorer-wrong").await;
    tab.press("preset-0").await;
    tab.enter("count", "all").await;
    tab.enter("by", "tau").await;
    tab.until_says("seen", "trained the predictor").await;
    until_counted(&tab).await;
    tab.run("document.querySelector('.panel').scrollTop = 900").await;
    tab.run("document.querySelectorAll('.explorer details').forEach(it => it.open = true)").await;
    take(&tab, "explorer-below").await;
    browser.close().await;
}
