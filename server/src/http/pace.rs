//! Rate limits for requests, enrolments and wrong keys.

use crate::http::error::ApiError;
use crate::http::throttle::{SharedThrottle, Throttle};
use crate::store::Store;
use crate::support::secrets;
use std::net::{IpAddr, Ipv4Addr};
use std::time::Duration;

/// Rate limits per origin and per token. A whole school class behind one address stays far below
/// these limits. Local programs that are not proxies are exempt, because users of this machine
/// could overload the server in other ways, too.
#[derive(Debug)]
pub struct Pace {
    requests: Throttle<IpAddr>,
    enrolments: SharedThrottle,
    of_token: Throttle<[u8; 32]>,
}

impl Pace {
    /// New rate limits. Servers that share a database also share the counts of enrolments. Each
    /// server counts requests on its own, to protect itself.
    #[must_use]
    pub fn new(store: &Store) -> Self {
        Self {
            // Hundreds of participants can open the page at the same time, and each page loads a
            // dozen files.
            requests: Throttle::new(6_000, Duration::from_micros(3_333)),
            enrolments: SharedThrottle::new(store, "enrolments", 1_000, Duration::from_millis(100)),
            // A browser that was offline for a whole session of one hour uploads sixty trials
            // without pauses.
            of_token: Throttle::new(600, Duration::from_millis(20)),
        }
    }

    /// Counts a request from `origin` with its token. `enrols` states whether it is an enrolment.
    ///
    /// # Errors
    /// 429 if the origin or the token exceeds its rate limit.
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

/// Rate limits for wrong keys, per origin and for all origins together.
///
/// Refusing all keys from an origin would also refuse the correct key of another user at this origin.
/// So every key is compared, but with a delay if the origin has sent many wrong keys, or if all origins
/// together have sent very many. A client that does not wait for the response learns nothing.
#[derive(Debug)]
pub struct Guesses {
    of_origin: SharedThrottle,
    /// The limit for all origins together, counted for the address [`ALL`].
    of_all: SharedThrottle,
    /// The delay before a key is compared.
    wait: Duration,
}

/// Placeholder address for all origins together.
const ALL: IpAddr = IpAddr::V4(Ipv4Addr::UNSPECIFIED);

impl Guesses {
    /// New rate limits. Servers that share a database also share the counts of wrong keys.
    #[must_use]
    pub fn new(store: &Store) -> Self {
        let throttle = |kind, burst, pause| SharedThrottle::new(store, kind, burst, pause);
        Self {
            of_origin: throttle("guesses", 10, Duration::from_secs(6)),
            of_all: throttle("all_guesses", 1_000, Duration::from_millis(600)),
            wait: Duration::from_secs(1),
        }
    }

    /// Waits if this origin, or all origins together, have sent too many wrong keys.
    pub async fn slow_down(&self, origin: IpAddr) {
        if self.of_origin.is_spent(origin).await || self.of_all.is_spent(ALL).await {
            tokio::time::sleep(self.wait).await;
        }
    }

    /// Counts a wrong key.
    ///
    /// # Errors
    /// If this origin has sent too many wrong keys, the time after which it is allowed to send the
    /// next key.
    pub async fn count(&self, origin: IpAddr) -> Result<(), Duration> {
        let _ = self.of_all.take(ALL).await;
        self.of_origin.take(origin).await
    }
}
