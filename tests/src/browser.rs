//! A real browser: headless Chromium with its own profile, real key presses and screenshots.

pub use chromiumoxide::cdp::browser_protocol::emulation::SetEmulatedVisionDeficiencyType as Vision;
use chromiumoxide::cdp::browser_protocol::emulation::{
    MediaFeature, SetCpuThrottlingRateParams, SetDeviceMetricsOverrideParams,
    SetEmulatedMediaParams, SetEmulatedVisionDeficiencyParams,
};
use chromiumoxide::cdp::browser_protocol::input::{
    DispatchKeyEventParams, DispatchKeyEventType, DispatchMouseEventParams, DispatchMouseEventType,
    MouseButton,
};
use chromiumoxide::cdp::browser_protocol::network::{
    EmulateNetworkConditionsByRuleParams, EnableParams, NetworkConditions, SetCacheDisabledParams,
};
use chromiumoxide::cdp::browser_protocol::page::{
    EventJavascriptDialogOpening, HandleJavaScriptDialogParams, SetWebLifecycleStateParams,
    SetWebLifecycleStateState,
};
use chromiumoxide::cdp::browser_protocol::storage::OverrideQuotaForOriginParams;
use chromiumoxide::cdp::js_protocol::heap_profiler::CollectGarbageParams;
use chromiumoxide::cdp::js_protocol::runtime::{
    EventConsoleApiCalled, EventExceptionThrown, GetHeapUsageParams,
};
use chromiumoxide::page::ScreenshotParams;
use chromiumoxide::{BrowserConfig, Page};
use flate2::read::GzDecoder;
use futures_util::StreamExt;
use image::RgbaImage;
use std::io::Read;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::task::JoinHandle;

/// A browser. Dropping it ends the browser.
pub struct Browser {
    browser: chromiumoxide::Browser,
    events: JoinHandle<()>,
    profile: TempDir,
}

/// A test that waits for a change fails if the page stays unchanged for this long. This is far
/// longer than any page needs.
const PATIENCE: Duration = Duration::from_secs(90);

/// Timeout for the start of the browser and for its commands, such as loading a page.
const ANSWERS: Duration = Duration::from_secs(180);

/// Width and height of a desktop window (CSS pixels).
pub const WIDE: (u32, u32) = (1280, 800);
/// Width and height of a phone's window (CSS pixels).
pub const NARROW: (u32, u32) = (390, 844);

fn chromium() -> PathBuf {
    if let Some(given) = std::env::var_os("SIDESTEP_CHROMIUM") {
        return given.into();
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let found = std::env::split_paths(&path)
        .flat_map(|folder| names.map(|name| folder.join(name)))
        .find(|candidate| candidate.is_file());
    found.expect("Chromium: run the tests with `cargo xtask test`, which installs it")
}

/// The processes of the browser with this profile: the processes that have the profile in their
/// arguments, and all their descendants.
fn processes_of(profile: &str) -> Vec<String> {
    let read = |process: &str, name: &str| {
        std::fs::read_to_string(format!("/proc/{process}/{name}")).unwrap_or_default()
    };
    let folder = std::fs::read_dir("/proc").expect("the processes").flatten();
    let names = folder.map(|entry| entry.file_name().to_string_lossy().into_owned());
    let all: Vec<String> = names.filter(|name| name.parse::<u32>().is_ok()).collect();
    let mut found: Vec<String> =
        all.iter().filter(|process| read(process, "cmdline").contains(profile)).cloned().collect();
    let mut next = 0;
    while next < found.len() {
        let parent = found[next].clone();
        let is_child = |process: &&String| {
            let stat = read(process, "stat");
            let fields = stat.rsplit_once(')').map_or("", |(_, fields)| fields);
            fields.split_whitespace().nth(1) == Some(parent.as_str())
        };
        let children: Vec<String> = all.iter().filter(is_child).cloned().collect();
        found.extend(
            children.into_iter().filter(|child| !found.contains(child)).collect::<Vec<_>>(),
        );
        next += 1;
    }
    found
}

/// Whether a process is running and not a zombie.
fn is_running(process: &str) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    stat.rsplit_once(')').is_some_and(|(_, fields)| !fields.trim_start().starts_with('Z'))
}

impl Browser {
    /// Starts a browser.
    ///
    /// # Panics
    /// If it does not start.
    pub async fn start() -> Self {
        Self::with_profile(TempDir::new().expect("a folder")).await
    }

    /// Kills the browser, as a power cut would, and restarts it with its files on disk.
    ///
    /// # Panics
    /// If it does not start.
    pub async fn killed(self) -> Self {
        let Self { mut browser, events, profile } = self;
        // The browser's other processes would keep its databases locked for a while after the first
        // process ends.
        let all = processes_of(&profile.path().to_string_lossy());
        browser.kill().await.expect("a process").expect("a kill");
        events.abort();
        for process in &all {
            let _ = std::process::Command::new("kill").args(["-KILL", process]).output();
        }
        let since = Instant::now();
        while all.iter().any(|process| is_running(process)) {
            assert!(since.elapsed() < PATIENCE, "Chromium does not end");
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        Self::with_profile(profile).await
    }

    async fn with_profile(profile: TempDir) -> Self {
        let config = BrowserConfig::builder()
            .chrome_executable(chromium())
            .no_sandbox()
            .new_headless_mode()
            .user_data_dir(profile.path())
            .launch_timeout(ANSWERS)
            .request_timeout(ANSWERS)
            .window_size(WIDE.0, WIDE.1)
            // The client's default viewport would make every window a touch screen.
            .viewport(None)
            .args([
                "disable-gpu",
                // WebGL without a GPU.
                "enable-unsafe-swiftshader",
                "disable-background-networking",
                "disable-component-update",
                "disable-sync",
                "no-first-run",
                "mute-audio",
            ])
            .build()
            .expect("a configuration");
        let (browser, mut handler) =
            chromiumoxide::Browser::launch(config).await.expect("Chromium starts");
        let events = tokio::spawn(async move {
            while let Some(event) = handler.next().await {
                // A newer Chromium sends messages that this client does not know. They cause
                // errors, which are ignored.
                drop(event);
            }
        });
        Self { browser, events, profile }
    }

    /// Opens an address in a new tab with a window of 1280 × 800 in the light colour scheme.
    ///
    /// # Panics
    /// If it cannot be opened.
    pub async fn open(&self, url: &str) -> Tab {
        let page = self.browser.new_page("about:blank").await.expect("a tab");
        let complaints = Arc::new(Mutex::new(Vec::new()));
        let mut thrown = page.event_listener::<EventExceptionThrown>().await.expect("events");
        let mut called = page.event_listener::<EventConsoleApiCalled>().await.expect("events");
        let heard = Arc::clone(&complaints);
        tokio::spawn(async move {
            loop {
                let words = tokio::select! {
                    Some(event) = thrown.next() => {
                        let exception = event.exception_details.exception.as_ref();
                        exception.and_then(|thrown| thrown.description.clone()).unwrap_or_default()
                    }
                    Some(event) = called.next() => {
                        let words = event.args.iter().filter_map(|arg| arg.value.as_ref());
                        format!("{:?}", words.collect::<Vec<_>>())
                    }
                    else => break,
                };
                heard.lock().expect("a list").push(words);
            }
        });
        let mut asked =
            page.event_listener::<EventJavascriptDialogOpening>().await.expect("events");
        let warnings = Arc::new(AtomicUsize::new(0));
        let (told, asking) = (Arc::clone(&warnings), page.clone());
        tokio::spawn(async move {
            while asked.next().await.is_some() {
                told.fetch_add(1, Ordering::Relaxed);
                // If the page was closed meanwhile, no answer is needed.
                let _ = asking.execute(HandleJavaScriptDialogParams::new(true)).await;
            }
        });
        let tab = Tab { page, complaints, warnings };
        tab.look(WIDE, false).await;
        tab.go(url).await;
        tab
    }

    /// Ends the browser and waits until its process has ended.
    pub async fn close(mut self) {
        // The browser might have ended already.
        let _ = self.browser.close().await;
        let _ = self.browser.wait().await;
        self.events.abort();
    }
}

/// A mouse action.
#[derive(Clone, Copy, Debug)]
pub enum Mouse {
    /// Moves without a button pressed.
    Move,
    /// Presses the left button.
    Press,
    /// Moves with the left button pressed.
    Drag,
    /// Releases the left button.
    Release,
    /// Rolls the mouse wheel by this many pixels, towards the user if positive.
    Roll(f64),
}

/// A tab.
pub struct Tab {
    page: Page,
    complaints: Arc<Mutex<Vec<String>>>,
    warnings: Arc<AtomicUsize>,
}

impl Tab {
    /// How often a page asked for confirmation before leaving. The answer was always yes.
    #[must_use]
    pub fn warnings(&self) -> usize {
        self.warnings.load(Ordering::Relaxed)
    }

    /// Goes to an address.
    ///
    /// # Panics
    /// If it cannot be opened.
    pub async fn go(&self, url: &str) {
        self.page.goto(url).await.expect("the page opens");
    }

    /// Runs JavaScript in every page that this tab opens from now on, before the page's own
    /// scripts.
    ///
    /// # Panics
    /// If the browser refuses.
    pub async fn before_pages(&self, code: &str) {
        self.page.evaluate_on_new_document(code).await.expect("a script for pages to come");
    }

    /// Throttles the page's processor by this factor.
    ///
    /// # Panics
    /// If the browser refuses.
    pub async fn slow_down(&self, times: f64) {
        let rate = SetCpuThrottlingRateParams::new(times);
        self.page.execute(rate).await.expect("a slower processor");
    }

    /// Sets the network's latency and bandwidth, and disables the browser's cache.
    ///
    /// # Panics
    /// If the browser refuses.
    pub async fn slow_network(&self, latency_ms: f64, bytes_per_s: f64) {
        let everything = NetworkConditions::new("", latency_ms, bytes_per_s, bytes_per_s);
        let network = EmulateNetworkConditionsByRuleParams::new(false, vec![everything]);
        self.page.execute(EnableParams::default()).await.expect("a network to change");
        self.page.execute(SetCacheDisabledParams::new(true)).await.expect("no cache");
        self.page.execute(network).await.expect("a slower network");
    }

    /// Heap size of the page's JavaScript after garbage collection (bytes).
    ///
    /// # Panics
    /// If the browser does not return it.
    pub async fn heap_bytes(&self) -> f64 {
        self.page.execute(CollectGarbageParams::default()).await.expect("a collection");
        self.page.execute(GetHeapUsageParams::default()).await.expect("the usage").used_size
    }

    /// Closes the tab immediately, without confirmation.
    ///
    /// # Panics
    /// If it cannot be closed.
    pub async fn close(self) {
        self.page.close().await.expect("the tab closes");
    }

    /// Takes the page offline or back online.
    ///
    /// # Panics
    /// If the browser refuses.
    pub async fn offline(&self, offline: bool) {
        #[expect(deprecated, reason = "what is to replace it is not in every Chromium")]
        let network =
            chromiumoxide::cdp::browser_protocol::network::EmulateNetworkConditionsParams::new(
                offline, 0.0, -1.0, -1.0,
            );
        self.page.execute(network).await.expect("other conditions");
    }

    /// Freezes the page's scripts and timers for a while, as a browser does with an unused page.
    ///
    /// # Panics
    /// If the browser refuses.
    pub async fn freeze(&self, pause: Duration) {
        use SetWebLifecycleStateState::{Active, Frozen};
        for state in [Frozen, Active] {
            let state = SetWebLifecycleStateParams::new(state);
            self.page.execute(state).await.expect("another state");
            tokio::time::sleep(pause).await;
        }
    }

    /// Limits the storage for pages of this origin to `bytes`. Call this before they store
    /// anything.
    ///
    /// # Panics
    /// If the browser refuses.
    pub async fn limit_storage(&self, origin: &str, bytes: u32) {
        let quota = OverrideQuotaForOriginParams::builder().origin(origin).quota_size(bytes);
        self.page.execute(quota.build().expect("a quota")).await.expect("another quota");
    }

    /// Zooms the page as the browser's zoom does, with fewer and larger CSS pixels in the same
    /// window.
    ///
    /// # Panics
    /// If the browser refuses.
    pub async fn zoom(&self, percent: u32) {
        let [width, height] = [WIDE.0, WIDE.1].map(|px| i64::from(px * 100 / percent));
        let ratio = f64::from(percent) / 100.0;
        let size = SetDeviceMetricsOverrideParams::new(width, height, ratio, false);
        self.page.execute(size).await.expect("a size");
    }

    /// Reloads the page.
    ///
    /// # Panics
    /// If it cannot be loaded.
    pub async fn reload(&self) {
        self.page.reload().await.expect("the page loads again");
    }

    /// Sets the size of the window and the colour scheme.
    ///
    /// # Panics
    /// If the browser refuses.
    pub async fn look(&self, (width, height): (u32, u32), dark: bool) {
        let size =
            SetDeviceMetricsOverrideParams::new(i64::from(width), i64::from(height), 1.0, false);
        self.page.execute(size).await.expect("a size");
        let scheme = if dark { "dark" } else { "light" };
        let media = SetEmulatedMediaParams::builder()
            .feature(MediaFeature::new("prefers-color-scheme", scheme))
            .build();
        self.page.execute(media).await.expect("a colour scheme");
    }

    /// Emulates a vision deficiency.
    ///
    /// # Panics
    /// If the browser refuses.
    pub async fn see(&self, vision: &Vision) {
        let vision = SetEmulatedVisionDeficiencyParams::new(vision.clone());
        self.page.execute(vision).await.expect("another vision");
    }

    /// Zooms a window of [`WIDE`] to 200 %, and asks for reduced motion.
    ///
    /// # Panics
    /// If the browser refuses.
    pub async fn zoom_and_calm(&self) {
        self.zoom(200).await;
        let media = SetEmulatedMediaParams::builder()
            .feature(MediaFeature::new("prefers-reduced-motion", "reduce"))
            .build();
        self.page.execute(media).await.expect("reduced motion");
    }

    /// Evaluates a JavaScript expression.
    ///
    /// # Panics
    /// If the expression throws, or its value is not a `T`.
    pub async fn eval<T: serde::de::DeserializeOwned>(&self, expression: &str) -> T {
        let result = self.page.evaluate(expression).await;
        let result = result.unwrap_or_else(|error| panic!("{expression}: {error}"));
        result.into_value().unwrap_or_else(|error| panic!("{expression}: {error}"))
    }

    /// Runs JavaScript for its side effects.
    ///
    /// # Panics
    /// If it throws.
    pub async fn run(&self, code: &str) {
        let result = self.page.evaluate(format!("void ({code})")).await;
        result.unwrap_or_else(|error| panic!("{code}: {error}"));
    }

    /// Goes back in the tab's history.
    ///
    /// # Panics
    /// If the page throws.
    pub async fn back(&self) {
        // The navigation would cancel a call that waits for it.
        self.run("setTimeout(() => history.back())").await;
    }

    /// Waits until the page's address has this query, which includes the question mark.
    ///
    /// # Panics
    /// If this does not happen.
    pub async fn until_search(&self, search: &str) {
        self.until(&format!("location.search === {search:?}")).await;
    }

    /// Waits until a JavaScript expression is true.
    ///
    /// # Panics
    /// If it stays false for 90 s and the page does not change.
    pub async fn until(&self, expression: &str) {
        let (mut since, mut shown) = (Instant::now(), String::new());
        loop {
            // While a page loads, the expression cannot be evaluated.
            let result = self.page.evaluate(format!("Boolean({expression})")).await;
            let holds = result.ok().and_then(|value| value.into_value::<bool>().ok());
            if holds == Some(true) {
                return;
            }
            if since.elapsed() > PATIENCE {
                let words: String = self.eval("document.body.innerText").await;
                let complaints = self.complaints.lock().expect("a list").clone();
                assert!(
                    words != shown,
                    "never true: {expression}\nthe page says: {words}\ncomplaints: {complaints:?}"
                );
                // The page is still making progress, for example with a slow solve on a busy
                // machine.
                (since, shown) = (Instant::now(), words);
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }

    /// A JavaScript expression for the element with this `data-testid`.
    #[must_use]
    pub fn at(test_id: &str) -> String {
        format!("document.querySelector('[data-testid=\"{test_id}\"]')")
    }

    /// Waits until an element exists and is enabled, and clicks it by script.
    pub async fn press(&self, test_id: &str) {
        let element = Self::at(test_id);
        self.until(&format!("{element} && !{element}.disabled")).await;
        self.run(&format!("{element}.click()")).await;
    }

    /// Waits until an element exists and is enabled, and clicks its centre with real mouse events.
    ///
    /// # Panics
    /// If the browser refuses.
    pub async fn click(&self, test_id: &str) {
        let element = Self::at(test_id);
        self.until(&format!("{element} && !{element}.disabled")).await;
        let middle = format!(
            "(box => [box.left + box.width / 2, box.top + box.height / 2])\
             ({element}.getBoundingClientRect())"
        );
        let middle: [f64; 2] = self.eval(&middle).await;
        for does in [Mouse::Move, Mouse::Press, Mouse::Release] {
            self.mouse(does, middle).await;
        }
    }

    /// Waits for an element, and returns its text.
    pub async fn words(&self, test_id: &str) -> String {
        let element = Self::at(test_id);
        self.until(&element).await;
        self.eval(&format!("{element}.textContent")).await
    }

    /// Waits until an element's text contains these words.
    pub async fn until_says(&self, test_id: &str, words: &str) {
        self.until(&format!("{}?.textContent.includes({words:?})", Self::at(test_id))).await;
    }

    /// Sets a field's value and fires an input event, like a user's input.
    pub async fn enter(&self, test_id: &str, value: &str) {
        let field = Self::at(test_id);
        let told = "dispatchEvent(new Event('input', {bubbles: true}))";
        self.run(&format!("{field}.value = {value:?}, {field}.{told}")).await;
    }

    /// An attribute of an element. `None` if the element or the attribute does not exist.
    pub async fn attribute(&self, test_id: &str, name: &str) -> Option<String> {
        self.eval(&format!("{}?.getAttribute('{name}') ?? null", Self::at(test_id))).await
    }

    /// Waits until the scene on a canvas has reached this step.
    pub async fn until_step(&self, canvas: &str, step: usize) {
        let element = Self::at(canvas);
        self.until(&format!("Number({element}?.dataset.step) >= {step}")).await;
    }

    /// Waits until the browser has painted the page in its current state.
    ///
    /// # Panics
    /// If it does not paint.
    pub async fn until_painted(&self) {
        // The second frame begins when the first is done, and by then all running animations are
        // known. Animations of hidden elements, for example in closed details, might never end, so
        // they are excluded.
        let painted = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => \
                       Promise.allSettled(document.getAnimations() \
                       .filter(a => a.effect.target.checkVisibility()).map(a => a.finished)) \
                       .then(() => requestAnimationFrame(() => done(true))))))";
        assert!(self.eval::<bool>(painted).await);
    }

    /// Presses and releases a key.
    pub async fn key(&self, key: &str) {
        self.key_down(key).await;
        self.key_up(key).await;
    }

    /// Presses a key down.
    pub async fn key_down(&self, key: &str) {
        self.send_key(key, DispatchKeyEventType::RawKeyDown).await;
        // The browser activates a button on the key's character event.
        if key == "Enter" || digit(key).is_some() {
            self.send_key(key, DispatchKeyEventType::Char).await;
        }
    }

    /// Releases a key.
    pub async fn key_up(&self, key: &str) {
        self.send_key(key, DispatchKeyEventType::KeyUp).await;
    }

    async fn send_key(&self, key: &str, kind: DispatchKeyEventType) {
        let (code, number) = match key {
            "ArrowLeft" => ("ArrowLeft", 37),
            "ArrowRight" => ("ArrowRight", 39),
            "ArrowUp" => ("ArrowUp", 38),
            "ArrowDown" => ("ArrowDown", 40),
            "Escape" => ("Escape", 27),
            "a" => ("KeyA", 65),
            "b" => ("KeyB", 66),
            "d" => ("KeyD", 68),
            "n" => ("KeyN", 78),
            "Home" => ("Home", 36),
            " " => ("Space", 32),
            "Enter" => ("Enter", 13),
            "Tab" => ("Tab", 9),
            other => match digit(other) {
                Some(digit) => ("", 48 + i64::from(digit)),
                None => panic!("the number of the key {other} is not known here"),
            },
        };
        let event = DispatchKeyEventParams::builder()
            .r#type(kind.clone())
            .key(key)
            .code(code)
            .windows_virtual_key_code(number);
        let event = match kind {
            DispatchKeyEventType::Char => event.text(if key == "Enter" { "\r" } else { key }),
            _ => event,
        };
        let event = event.build().expect("a key event");
        self.page.execute(event).await.expect("a key press");
    }

    /// Performs a mouse action at a position in the window (CSS pixels).
    ///
    /// # Panics
    /// If the browser refuses.
    pub async fn mouse(&self, does: Mouse, [x, y]: [f64; 2]) {
        use DispatchMouseEventType::{MouseMoved, MousePressed, MouseReleased, MouseWheel};
        let (kind, held) = match does {
            Mouse::Move => (MouseMoved, false),
            Mouse::Drag => (MouseMoved, true),
            Mouse::Press => (MousePressed, true),
            Mouse::Release => (MouseReleased, false),
            Mouse::Roll(_) => (MouseWheel, false),
        };
        let mut event = DispatchMouseEventParams::new(kind, x, y);
        event.buttons = Some(i64::from(held));
        if !matches!(does, Mouse::Move) {
            event.button = Some(MouseButton::Left);
            event.click_count = Some(1);
        }
        if let Mouse::Roll(px) = does {
            event.button = None;
            (event.delta_x, event.delta_y) = (Some(0.0), Some(px));
        }
        self.page.execute(event).await.expect("a mouse");
    }

    /// Takes a screenshot of the window, and also stores it under `target/screenshots`.
    ///
    /// # Panics
    /// If it cannot be taken or stored.
    pub async fn picture(&self, name: &str) -> RgbaImage {
        let bytes = self.page.screenshot(ScreenshotParams::builder().build()).await;
        let bytes = bytes.expect("a picture");
        let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../target/screenshots"));
        std::fs::create_dir_all(&folder).expect("a folder");
        std::fs::write(folder.join(format!("{name}.png")), &bytes).expect("a file");
        image::load_from_memory(&bytes).expect("a PNG").into_rgba8()
    }

    /// Checks that the page has reported no error.
    ///
    /// # Panics
    /// If it has reported an error.
    pub fn is_quiet(&self) {
        let complaints = self.complaints.lock().expect("a list").clone();
        assert!(complaints.is_empty(), "{complaints:?}");
    }

    /// Checks that the page has reported no error and is not too wide for the window, and that
    /// axe-core finds no accessibility violation.
    ///
    /// # Panics
    /// If a check fails.
    pub async fn is_well(&self) {
        self.is_quiet();
        let excess: f64 = self
            .eval("document.documentElement.scrollWidth - document.documentElement.clientWidth")
            .await;
        assert!(excess <= 0.0, "the page is {excess} px too wide");
        self.is_accessible().await;
    }

    /// Checks the accessibility of the page in its current state with axe-core.
    ///
    /// # Panics
    /// If axe-core finds a violation.
    pub async fn is_accessible(&self) {
        const AXE: &[u8] = include_bytes!("../data/axe-core/axe.min.js.gz");
        if self.eval::<bool>("typeof axe === 'undefined'").await {
            let mut code = String::new();
            GzDecoder::new(AXE).read_to_string(&mut code).expect("axe-core");
            self.page.evaluate(code).await.expect("axe-core starts");
        }
        // Finish colour transitions first, because some start late on a busy machine.
        let violations: Vec<String> = self
            .eval(
                "document.getAnimations().filter(a => a instanceof CSSTransition) \
                 .forEach(a => a.finish()), axe.run({preload: false, resultTypes: ['violations']}).then(found => \
                 found.violations.map(v => v.id + ': ' + v.help + ' ' \
                 + v.nodes.map(n => n.html + ' ' + n.failureSummary).join(' | ')))",
            )
            .await;
        assert!(violations.is_empty(), "{violations:#?}");
    }
}

/// Number of pixels of a picture whose channels all differ by at most 6 from this colour.
#[must_use]
pub fn count_pixels(picture: &RgbaImage, colour: [u8; 3]) -> usize {
    let near =
        |pixel: &image::Rgba<u8>| pixel.0.iter().zip(colour).all(|(&a, b)| a.abs_diff(b) <= 6);
    picture.pixels().filter(|pixel| near(pixel)).count()
}

/// The digit that a key types.
fn digit(key: &str) -> Option<u32> {
    let mut letters = key.chars();
    letters.next().filter(|_| letters.next().is_none())?.to_digit(10)
}
