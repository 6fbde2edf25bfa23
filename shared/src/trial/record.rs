//! The evidence about a trial that is recorded in addition to inputs and states.

use super::{Flag, PageEvent};

/// Latest plausible time of a clock (ms since 1970): the year 2100.
pub const LAST_MS: f64 = 4_102_444_800_000.0;

/// Upper bound on a person's key presses within a second.
///
/// The record for one piano key is [824 presses in a
/// minute](https://www.guinnessworldrecords.com/news/2017/6/portuguese-musician-breaks-record-for-astonishingly-fast-piano-key-hitting-475329),
/// by two alternating fingers, which is 13.7 per second. Two hands at this rate would make 27.5
/// presses per second.
pub const FASTEST_PRESSES: usize = 30;

/// A key press or release.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedKey {
    /// Time after the scene's start (ms).
    pub t_ms: f64,
    /// Whether the key went down.
    pub down: bool,
}

/// The recorded evidence about a trial.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Record<'a> {
    /// Start of the trial on the participant's clock (ms since 1970), if known.
    pub started_at_ms: Option<f64>,
    /// When each input was sampled (ms after the start).
    pub sampled_at_ms: &'a [f64],
    /// The key events.
    pub keys: &'a [RecordedKey],
    /// The page events.
    pub page_events: &'a [PageEvent],
    /// Whether one of the record's texts contains U+FFFD instead of a character that files cannot
    /// contain.
    pub replaced: bool,
}

impl Record<'_> {
    /// The flags of this record.
    #[must_use]
    pub fn flags(&self) -> Vec<Flag> {
        let keys = || self.keys.iter().map(|key| key.t_ms);
        let page = self.page_events.iter().map(|event| event.t_ms);
        let rise = rises(self.sampled_at_ms.iter().copied()) && rises(keys()) && rises(page);
        let presses = self.keys.iter().filter(|key| key.down).map(|key| key.t_ms).collect();
        [
            (self.started_at_ms.is_some_and(|ms| !is_right_clock(ms)), Flag::WrongClock),
            (!rise, Flag::UnorderedTimes),
            (are_too_fast(presses), Flag::FastKeys),
            (self.replaced, Flag::ReplacedCharacters),
        ]
        .into_iter()
        .filter_map(|(seen, flag)| seen.then_some(flag))
        .collect()
    }
}

/// Whether a clock's time (ms since 1970) is plausible: from 1970 to 2100.
#[must_use]
pub fn is_right_clock(ms: f64) -> bool {
    (0.0..=LAST_MS).contains(&ms)
}

/// Whether times never decrease.
fn rises(times: impl Iterator<Item = f64>) -> bool {
    times.is_sorted()
}

/// Whether more presses fall within a second than a person can make.
fn are_too_fast(mut presses_ms: Vec<f64>) -> bool {
    presses_ms.sort_by(f64::total_cmp);
    let mut spans = presses_ms.windows(FASTEST_PRESSES + 1);
    spans.any(|span| span[FASTEST_PRESSES] - span[0] < 1000.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::PageEventKind;

    /// `count` presses and releases at intervals of `gap_ms`.
    fn pressed(count: usize, gap_ms: f64) -> Vec<RecordedKey> {
        let key = |i| RecordedKey { t_ms: i as f64 * gap_ms, down: i % 2 == 0 };
        (0..2 * count).map(key).collect()
    }

    fn of_keys(keys: &[RecordedKey]) -> Vec<Flag> {
        Record { keys, ..Record::default() }.flags()
    }

    #[test]
    fn keys_that_no_person_presses_are_flagged() {
        // 200 presses in 0.8 s: 400 events, 2 ms apart.
        assert_eq!(of_keys(&pressed(200, 2.0)), [Flag::FastKeys]);
        // Two hands at the record rate: 27.5 presses per second for a whole trial.
        assert_eq!(of_keys(&pressed(275, 1000.0 / 55.0)), []);
        // The window is half open and one second long: the 31st press is too fast after 999 ms, but
        // not after 1000 ms.
        let mut keys = pressed(FASTEST_PRESSES + 1, 1.0);
        for (i, key) in keys.iter_mut().enumerate() {
            key.t_ms = (i / 2) as f64;
        }
        keys[2 * FASTEST_PRESSES].t_ms = 999.0;
        keys[2 * FASTEST_PRESSES + 1].t_ms = 1001.0;
        assert_eq!(of_keys(&keys), [Flag::FastKeys]);
        keys[2 * FASTEST_PRESSES].t_ms = 1000.0;
        assert_eq!(of_keys(&keys), []);
        // A few bounces of a key are not flagged.
        assert_eq!(of_keys(&pressed(FASTEST_PRESSES, 1.0)), []);
    }

    #[test]
    fn clocks_that_cannot_be_right_are_flagged() {
        let flags = |ms| Record { started_at_ms: Some(ms), ..Record::default() }.flags();
        for ms in [0.0, 1.7e12, LAST_MS] {
            assert_eq!(flags(ms), []);
        }
        for ms in [-5.0, -0.5, LAST_MS + 1.0, 1e300, -1e300] {
            assert_eq!(flags(ms), [Flag::WrongClock], "{ms}");
        }
        assert_eq!(Record::default().flags(), []);
    }

    #[test]
    fn times_that_go_back_and_replaced_characters_are_flagged() {
        let keys = [5.0, 4.0].map(|t_ms| RecordedKey { t_ms, down: true });
        assert_eq!(of_keys(&keys), [Flag::UnorderedTimes]);
        let sampled = Record { sampled_at_ms: &[0.0, 200.0, 200.0, 199.0], ..Record::default() };
        assert_eq!(sampled.flags(), [Flag::UnorderedTimes]);
        let events = [3.0, 2.0].map(|t_ms| PageEvent { t_ms, kind: PageEventKind::Resized });
        let page = Record { page_events: &events, ..Record::default() };
        assert_eq!(page.flags(), [Flag::UnorderedTimes]);
        let replaced = Record { replaced: true, ..Record::default() };
        assert_eq!(replaced.flags(), [Flag::ReplacedCharacters]);
    }
}
