//! The links in docs/figures.md show what the document promises.

use crate::{sign_in, start, take};
use sidestep_tests::{Driver, Tab};

const DOCUMENT: &str = include_str!("../../../../docs/figures.md");
/// The study has enough tasks to learn from some of them.
const STUDY: &str = "title = \"Figures\"\nphases = [{ phase = \"task\", scenes = 11 }]\n";

/// The links in the section of the document whose title begins with `heading`.
fn links(heading: &str) -> Vec<&'static str> {
    let section = DOCUMENT
        .split("\n## ")
        .find(|section| section.starts_with(heading))
        .expect("a section of that name");
    let items = section.lines().filter_map(|line| line.strip_prefix("- `/lab/"));
    items.map(|rest| rest.split('`').next().expect("a first part")).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_figure_of_the_paper_has_its_link() {
    let (server, browser, tab) = start(STUDY).await;
    let driver = Driver::enrol(&server).await;
    let driven = driver.drive(&server, 11).await;
    sign_in(&tab, &server).await;
    let open = async |link: &str| {
        let link =
            link.replace("TRIAL", &driven[3].0).replace("PERSON", &driver.enrolled.participant_id);
        tab.go(&format!("{}/lab/{link}", server.origin)).await;
    };

    let [begin, later] = links("Figure 1").try_into().unwrap();
    open(begin).await;
    tab.until_step("replay", 0).await;
    take(&tab, "figure-1-begin").await;
    open(later).await;
    tab.until_step("replay", 20).await;
    assert!(!tab.eval::<bool>("document.body.textContent.includes('is not valid')").await);

    let [moment, slice, tube] = links("Figure 2").try_into().unwrap();
    open(moment).await;
    tab.until_step("replay", 20).await;
    take(&tab, "figure-2").await;
    open(slice).await;
    tab.until_says("map", "V (m)").await;
    assert_eq!(tab.eval::<String>("document.querySelector('output').textContent").await, "135°");
    open(tube).await;
    tab.until(&Tab::at("tube")).await;

    let settings = links("Figure 3");
    assert_eq!(settings.len(), 3);
    let mut areas = Vec::new();
    for (link, epsilon) in settings.into_iter().zip(["0", "0.2", "0"]) {
        open(link).await;
        tab.until_says("area-4", ".").await;
        assert_eq!(tab.attribute("epsilon-0", "value").await.as_deref(), Some(epsilon));
        let area = async |set: usize| -> f64 {
            tab.words(&format!("area-{set}")).await.split(' ').next().unwrap().parse().unwrap()
        };
        areas.push([area(0).await, area(4).await]);
    }
    let [left, middle, right] = areas.try_into().unwrap();
    // As in the paper, a larger ε makes a set larger, a smaller k makes it no larger, and the last
    // set stays the same.
    assert!(left[0] < middle[0] && right[0] <= left[0], "{left:?} {middle:?} {right:?}");
    assert!(left[1] == middle[1] && middle[1] == right[1]);
    take(&tab, "figure-3").await;
    browser.close().await;
}
