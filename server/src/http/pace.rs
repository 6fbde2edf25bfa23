//! How fast somebody may ask, enrol people and guess keys.

use crate::http::error::ApiError;
use crate::http::throttle::{SharedThrottle, Throttle};
use crate::secrets;
use crate::store::Store;
use std::net::{IpAddr, Ipv4Addr};
use std::time::Duration;

/// How fast an origin and a token may ask. A whole class behind one address stays far below. Programs on this
/// machine that speak for nobody else are not limited: whoever runs them can do more than ask.
#[derive(Debug)]
pub struct Pace {
    requests: Throttle<IpAddr>,
    enrolments: SharedThrottle,
    of_token: Throttle<[u8; 32]>,
}

impl Pace {
    /// Nobody has asked for anything yet. Servers of one database count enrolments together, and requests each
    /// for itself: these protect the server.
    #[must_use]
    pub fn new(store: &Store) -> Self {
        Self {
            // Hundreds of people open the page, each with a dozen files.
            requests: Throttle::new(6_000, Duration::from_micros(3_333)),
            enrolments: SharedThrottle::new(store, "enrolments", 1_000, Duration::from_millis(100)),
            // A browser that was offline for the whole hour sends sixty trials at once.
            of_token: Throttle::new(600, Duration::from_millis(20)),
        }
    }

    /// Counts a request from `origin`, with its token, and whether it enrols somebody.
    ///
    /// # Errors
    /// 429 if the origin or the token asks too fast.
    pub async fn count(
        &self,
        origin: IpAddr,
        token: Option<&str>,
        enrols: bool,
    ) -> Result<(), ApiError> {
        let too_many = |what| move |wait| ApiError::Throttled(what, wait);
        self.requests.take(origin).map_err(too_many("requests from this address"))?;
        if let Some(token) = token {
            let taken = self.of_token.take(secrets::hash(token));
            taken.map_err(too_many("requests with this token"))?;
        }
        if enrols {
            let taken = self.enrolments.take(origin).await;
            taken.map_err(too_many("enrolments from this address"))?;
        }
        Ok(())
    }
}

/// The wrong keys of each origin, and of all together.
///
/// Refusing every key from an origin would also refuse the right one of whoever shares it. So each key is
/// compared; but where many wrong ones came from, and everywhere while many come from everywhere, only after
/// a while. Whoever does not wait for the answer has not guessed.
#[derive(Debug)]
pub struct Guesses {
    of_origin: SharedThrottle,
    /// Under the address of nobody.
    of_all: SharedThrottle,
    /// What a key waits before it is compared.
    wait: Duration,
}

/// The address of nobody.
const ALL: IpAddr = IpAddr::V4(Ipv4Addr::UNSPECIFIED);

impl Guesses {
    /// Nobody has guessed yet. Servers of one database count together.
    #[must_use]
    pub fn new(store: &Store) -> Self {
        let throttle = |kind, burst, pause| SharedThrottle::new(store, kind, burst, pause);
        Self {
            of_origin: throttle("guesses", 10, Duration::from_secs(6)),
            of_all: throttle("all_guesses", 1_000, Duration::from_millis(600)),
            wait: Duration::from_secs(1),
        }
    }

    /// Waits, if too many wrong keys came.
    pub async fn slow_down(&self, origin: IpAddr) {
        if self.of_origin.is_spent(origin).await || self.of_all.is_spent(ALL).await {
            tokio::time::sleep(self.wait).await;
        }
    }

    /// Counts a wrong key.
    ///
    /// # Errors
    /// The time after which the next may come, if there are too many of this origin.
    pub async fn count(&self, origin: IpAddr) -> Result<(), Duration> {
        let _ = self.of_all.take(ALL).await;
        self.of_origin.take(origin).await
    }
}
