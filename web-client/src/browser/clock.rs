//! The page's clock.

use crate::runtime::Address;
use std::cell::Cell;
use web_sys::{Performance, Window};

/// Maximum speed of the clock in a simulated participation.
const MAX_SPEED: f64 = 50.0;

/// The page's clock: the time since the page was opened (ms). It is monotonic and unaffected by
/// changes to the time of day. It equals the browser's clock, except in a simulated participation
/// at another speed.
///
/// At another speed, the clock stops whenever work is due and continues when the page has done that
/// work. So nothing is ever late, even on a slow machine.
pub(super) struct Clock {
    performance: Option<Performance>,
    is_simulated: bool,
    speed: f64,
    /// A time on the browser's clock, and the reading of this clock at that time.
    set: Cell<(f64, f64)>,
    /// The reading at which this clock stops.
    stop_ms: Cell<f64>,
}

impl Clock {
    /// Creates the clock of a page with this address. `simulate=…&speed=N` makes it run N times as
    /// fast as the browser's clock.
    pub(super) fn new(window: &Window, address: &Address) -> Self {
        let wanted: Option<f64> =
            address.parameter("speed").and_then(|text| crate::json::read(text.as_bytes()));
        let is_simulated = address.parameter("simulate").is_some();
        let speed = wanted.filter(|wanted| is_simulated && (1.0..=MAX_SPEED).contains(wanted));
        Self {
            performance: window.performance(),
            is_simulated,
            speed: speed.unwrap_or(1.0),
            set: Cell::default(),
            stop_ms: Cell::new(f64::INFINITY),
        }
    }

    /// Whether the simulator operates the page.
    pub(super) fn is_simulated(&self) -> bool {
        self.is_simulated
    }

    /// Whether this clock is faster than the browser's clock.
    pub(super) fn is_hurried(&self) -> bool {
        self.speed > 1.0
    }

    /// The current time.
    pub(super) fn now_ms(&self) -> f64 {
        self.of(self.performance.as_ref().map_or(0.0, Performance::now))
    }

    /// Converts a time on the browser's clock, such as the time stamp of an event, to this clock.
    pub(super) fn of(&self, browser_ms: f64) -> f64 {
        let (at, shown) = self.set.get();
        let mut passed_ms = (browser_ms - at) * self.speed;
        if self.is_hurried() {
            // Time must advance between two events, even though the browser's time stamps are
            // coarse.
            passed_ms = passed_ms.max(1e-3);
        }
        (shown + passed_ms).min(self.stop_ms.get())
    }

    /// The time to wait until this clock shows `until_ms`, in whole milliseconds of the browser's
    /// clock.
    pub(super) fn wait_ms(&self, until_ms: f64) -> i32 {
        self.browser_ms(until_ms - self.now_ms())
    }

    /// Converts a duration on this clock (ms) to whole milliseconds of the browser's clock.
    pub(super) fn browser_ms(&self, duration_ms: f64) -> i32 {
        (duration_ms / self.speed).max(0.0).ceil() as i32
    }

    /// Sets the time at which something is next due. An accelerated clock stops at that time.
    pub(super) fn stop_at(&self, due_ms: Option<f64>) {
        if self.is_hurried() {
            let browser_ms = self.performance.as_ref().map_or(0.0, Performance::now);
            self.set.set((browser_ms, self.of(browser_ms)));
            self.stop_ms.set(due_ms.unwrap_or(f64::INFINITY));
        }
    }
}
