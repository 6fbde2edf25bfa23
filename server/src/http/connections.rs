//! The open connections: their maximum number, their timeouts, and the choice of connections to close.

use crate::http::peer::origin;
use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio_util::sync::CancellationToken;

/// Timeout for the head of a request, counted from its first byte. Also the timeout for this first
/// byte, counted from the opening of the connection.
pub const HEAD_LIMIT: Duration = Duration::from_secs(10);
/// Timeout between a response and the next request.
const PAUSE_LIMIT: Duration = Duration::from_secs(75);
/// Timeout for the body of a request. The timeout of the whole request (`guard`) is shorter.
const BODY_LIMIT: Duration = Duration::from_secs(40);
/// Timeout for a client that reads nothing of a pending response.
const BLOCKED_LIMIT: Duration = Duration::from_secs(60);

/// Upper bounds for the open connections.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Number of connections.
    pub all: usize,
    /// Number of connections per origin.
    pub each: usize,
    /// Total size of incomplete bodies (bytes).
    pub body_bytes: usize,
}

/// The state of a connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Idle since it was opened.
    New,
    /// Idle since the last response.
    Pausing,
    /// The client is sending the head of a request.
    Head,
    /// The client is sending the body of a request.
    Body,
    /// The client waits for a response or receives it.
    Answered,
}

#[derive(Debug)]
struct State {
    phase: Phase,
    since: Instant,
    /// The time at which the client stopped reading the pending response.
    blocked_since: Option<Instant>,
    /// Number of bytes of the body that have arrived.
    body_bytes: usize,
}

/// The observable state of a connection.
#[derive(Debug)]
pub struct Watch {
    state: Mutex<State>,
    /// Cancelled to close the connection.
    pub closed: CancellationToken,
    /// Total number of bytes of the incomplete bodies of all connections.
    all_body_bytes: Arc<AtomicUsize>,
}

impl Watch {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn enter(&self, phase: Phase) {
        let mut state = self.state();
        if state.phase != phase {
            (state.phase, state.since) = (phase, Instant::now());
        }
        let bytes = std::mem::take(&mut state.body_bytes);
        self.all_body_bytes.fetch_sub(bytes, Ordering::Relaxed);
    }

    /// Records that bytes arrived. Returns whether they belong to the head of a request, and
    /// whether the head begins with them.
    pub fn received(&self) -> (bool, bool) {
        let mut state = self.state();
        let begins = matches!(state.phase, Phase::New | Phase::Pausing);
        if begins {
            (state.phase, state.since) = (Phase::Head, Instant::now());
        }
        (state.phase == Phase::Head, begins)
    }

    /// Records that the head of a request has arrived.
    pub fn has_head(&self, has_body: bool) {
        self.enter(if has_body { Phase::Body } else { Phase::Answered });
    }

    /// Records that a part of the body has arrived. Returns the number of bytes of incomplete
    /// bodies on all connections.
    pub fn has_body(&self, bytes: usize) -> usize {
        self.state().body_bytes += bytes;
        self.all_body_bytes.fetch_add(bytes, Ordering::Relaxed) + bytes
    }

    /// Records that the body is complete, or no longer needed.
    pub fn body_ended(&self) {
        self.enter(Phase::Answered);
    }

    /// Records that the response was sent.
    pub fn answered(&self) {
        self.enter(Phase::Pausing);
    }

    /// Records whether the client accepted the bytes to be sent.
    pub fn sent(&self, was_taken: bool) {
        let mut state = self.state();
        if was_taken {
            state.blocked_since = None;
        } else {
            state.blocked_since.get_or_insert_with(Instant::now);
        }
    }

    fn is_overdue(&self, now: Instant) -> bool {
        let state = self.state();
        let limit = match state.phase {
            Phase::New | Phase::Head => Some(HEAD_LIMIT),
            Phase::Pausing => Some(PAUSE_LIMIT),
            Phase::Body => Some(BODY_LIMIT),
            Phase::Answered => None,
        };
        let past = |since: Instant, limit| now.saturating_duration_since(since) > limit;
        limit.is_some_and(|limit| past(state.since, limit))
            || state.blocked_since.is_some_and(|since| past(since, BLOCKED_LIMIT))
    }

    /// The time at which the server began to wait for the client, which must send a request or read a
    /// response. `None` if the client waits for the server.
    fn idle_since(&self) -> Option<Instant> {
        let state = self.state();
        match state.phase {
            Phase::Answered => state.blocked_since,
            _ => Some(state.since),
        }
    }

    /// The time at which the client began to send a body. `None` if it is not sending a body.
    fn body_since(&self) -> Option<Instant> {
        let state = self.state();
        (state.phase == Phase::Body).then_some(state.since)
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.enter(Phase::Answered);
    }
}

/// The open connections.
#[derive(Debug)]
pub struct Connections {
    limits: Limits,
    table: Mutex<Table>,
    body_bytes: Arc<AtomicUsize>,
}

#[derive(Debug, Default)]
struct Table {
    next: u64,
    open: HashMap<u64, (IpAddr, Arc<Watch>)>,
    counts: HashMap<IpAddr, usize>,
}

impl Connections {
    /// An empty table of connections.
    #[must_use]
    pub fn new(limits: Limits) -> Self {
        Self { limits, table: Mutex::default(), body_bytes: Arc::default() }
    }

    /// Adds a connection from `address`, and closes other connections if necessary. Returns `None`
    /// if no other connection can be closed without aborting a request. The limit per origin does
    /// not apply to a proxy.
    pub fn admit(self: &Arc<Self>, address: IpAddr, is_proxy: bool) -> Option<Admitted> {
        let origin = origin(address);
        let mut table = self.table();
        if !is_proxy && table.count(origin) >= self.limits.each {
            table.make_room(Some(origin));
            if table.count(origin) >= self.limits.each {
                return None;
            }
        }
        if table.open.len() >= self.limits.all {
            let most = table.counts.iter().max_by_key(|(_, count)| **count).map(|(it, _)| *it);
            if table.make_room(most) == 0 && table.make_room(None) == 0 {
                return None;
            }
        }
        let watch = Arc::new(Watch {
            state: Mutex::new(State {
                phase: Phase::New,
                since: Instant::now(),
                blocked_since: None,
                body_bytes: 0,
            }),
            closed: CancellationToken::new(),
            all_body_bytes: Arc::clone(&self.body_bytes),
        });
        let id = table.next;
        table.next += 1;
        table.open.insert(id, (origin, Arc::clone(&watch)));
        *table.counts.entry(origin).or_default() += 1;
        Some(Admitted { id, watch, connections: Arc::clone(self) })
    }

    /// Closes some connections on which the server waits for the client. Used when the system cannot
    /// open another connection.
    pub fn make_room(&self) {
        self.table().make_room(None);
    }

    /// Number of open connections.
    #[must_use]
    pub fn count(&self) -> usize {
        self.table().open.len()
    }

    /// Closes the connections that have exceeded a timeout.
    pub fn close_overdue(&self) {
        let now = Instant::now();
        self.table().close_those(|watch| watch.is_overdue(now));
    }

    /// `held` is the total size of all incomplete bodies (bytes). If it is too large, closes the
    /// connections that have been sending their bodies longest.
    pub fn relieve(&self, held: usize) {
        if held <= self.limits.body_bytes {
            return;
        }
        let mut table = self.table();
        let senders = table.open.iter().filter_map(|(id, (_, watch))| {
            let bytes = watch.state().body_bytes;
            Some((watch.body_since()?, *id, bytes))
        });
        let mut senders: Vec<_> = senders.collect();
        senders.sort_unstable();
        // Recompute the total, because `held` may include connections that were just closed and are no
        // longer in the table.
        let mut held: usize = senders.iter().map(|(_, _, bytes)| bytes).sum();
        for (_, id, bytes) in senders {
            if held <= self.limits.body_bytes / 4 * 3 {
                break;
            }
            table.close(id);
            held = held.saturating_sub(bytes);
        }
    }

    fn table(&self) -> MutexGuard<'_, Table> {
        self.table.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Table {
    fn count(&self, origin: IpAddr) -> usize {
        self.counts.get(&origin).copied().unwrap_or(0)
    }

    /// Closes the connections (of one origin, or of all) on which the server has been waiting
    /// longest. Each call closes several connections, so that this search is rarely necessary.
    /// Returns the number of closed connections.
    fn make_room(&mut self, origin: Option<IpAddr>) -> usize {
        let of_origin = |from: IpAddr| origin.is_none_or(|origin| origin == from);
        let idle = self.open.iter().filter(|(_, (from, _))| of_origin(*from));
        let idle = idle.filter_map(|(id, (_, watch))| Some((watch.idle_since()?, *id)));
        let mut idle: Vec<_> = idle.collect();
        idle.sort_unstable();
        let enough = (idle.len() / 16).max(1);
        idle.truncate(enough);
        for (_, id) in &idle {
            self.close(*id);
        }
        idle.len()
    }

    fn close_those(&mut self, is_meant: impl Fn(&Watch) -> bool) {
        let meant = self.open.iter().filter(|(_, (_, watch))| is_meant(watch)).map(|(id, _)| *id);
        for id in meant.collect::<Vec<_>>() {
            self.close(id);
        }
    }

    fn close(&mut self, id: u64) {
        let Some((origin, watch)) = self.open.remove(&id) else { return };
        watch.closed.cancel();
        if let Some(count) = self.counts.get_mut(&origin) {
            *count -= 1;
            if *count == 0 {
                self.counts.remove(&origin);
            }
        }
    }
}

/// The slot of an open connection, released on drop.
#[derive(Debug)]
pub struct Admitted {
    id: u64,
    /// The state of the connection.
    pub watch: Arc<Watch>,
    connections: Arc<Connections>,
}

impl Admitted {
    /// The table that contains this connection.
    #[must_use]
    pub fn connections(&self) -> Arc<Connections> {
        Arc::clone(&self.connections)
    }
}

impl Drop for Admitted {
    fn drop(&mut self) {
        self.connections.table().close(self.id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::new(192, 0, 2, 1));
    const THERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::new(192, 0, 2, 2));

    fn connections(all: usize, each: usize) -> Arc<Connections> {
        Arc::new(Connections::new(Limits { all, each, body_bytes: 100 }))
    }

    fn is_open(admitted: &Admitted) -> bool {
        !admitted.watch.closed.is_cancelled()
    }

    #[test]
    fn an_origin_with_too_many_loses_the_one_that_waits_longest() {
        let all = connections(100, 2);
        let [first, second] = [(); 2].map(|()| all.admit(HERE, false).unwrap());
        first.watch.has_head(false);
        let third = all.admit(HERE, false).unwrap();
        assert_eq!([&first, &second, &third].map(is_open), [true, false, true]);
        third.watch.has_head(false);
        assert!(all.admit(HERE, false).is_none(), "both are being answered");
        assert!(all.admit(THERE, false).is_some() && all.admit(HERE, true).is_some());
        first.watch.answered();
        let fourth = all.admit(HERE, false).unwrap();
        assert_eq!([&first, &third, &fourth].map(is_open), [false, true, true]);
    }

    #[test]
    fn when_all_places_are_taken_who_has_most_gives_one() {
        let all = connections(3, 10);
        let honest = all.admit(THERE, false).unwrap();
        let many = [(); 2].map(|()| all.admit(HERE, false).unwrap());
        let new = all.admit(THERE, false).unwrap();
        assert_eq!([&honest, &many[0], &many[1], &new].map(is_open), [true, false, true, true]);
        drop((honest, many, new));
        assert!(all.table().open.is_empty() && all.table().counts.is_empty());
    }

    #[test]
    fn who_takes_nothing_of_an_answer_gives_a_place() {
        let all = connections(2, 10);
        let [reading, blocked] = [(); 2].map(|()| {
            let it = all.admit(HERE, false).unwrap();
            it.watch.has_head(false);
            it
        });
        blocked.watch.sent(false);
        let new = all.admit(THERE, false).unwrap();
        assert_eq!([&reading, &blocked, &new].map(is_open), [true, false, true]);
    }

    #[test]
    fn half_bodies_are_cut_off_the_oldest_first() {
        let all = connections(10, 10);
        let senders = [(); 3].map(|()| {
            let sender = all.admit(HERE, false).unwrap();
            sender.watch.has_head(true);
            sender
        });
        for sender in &senders {
            all.relieve(sender.watch.has_body(40));
        }
        assert_eq!(senders.each_ref().map(is_open), [false, false, true], "down to 75 bytes");
        senders[2].watch.body_ended();
        drop(senders);
        assert_eq!(all.body_bytes.load(Ordering::Relaxed), 0);
    }

    #[test]
    fn each_phase_has_its_limit() {
        let all = connections(10, 10);
        let it = all.admit(HERE, false).unwrap();
        let overdue = |s| it.watch.is_overdue(Instant::now() + Duration::from_secs(s));
        assert!(!overdue(9) && overdue(11), "no request");
        assert_eq!((it.watch.received(), it.watch.received()), ((true, true), (true, false)));
        assert!(!overdue(9) && overdue(11), "a slow head");
        it.watch.has_head(true);
        assert_eq!(it.watch.received(), (false, false));
        assert!(!overdue(39) && overdue(41), "a slow body");
        it.watch.body_ended();
        assert!(!overdue(10_000), "the server is slow");
        it.watch.sent(false);
        assert!(!overdue(59) && overdue(61), "nobody takes the answer");
        it.watch.sent(true);
        it.watch.answered();
        assert!(!overdue(74) && overdue(76), "a long pause");
    }
}
