//! Effect of an attack, and of an analysis, on honest people.
//!
//! Attackers come through a proxy, from one address on the internet, because the server does not
//! rate-limit programs on its own machine. They run on a separate thread, so that they delay the
//! server but not the measurement.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use crate::subject::Subject;
use reqwest::Method;
use sidestep::api::routes;
use sidestep_tests::load::crowd::{Crowd, Pace};
use sidestep_tests::load::figures::{at_most, row};
use sidestep_tests::{Answer, Folder, Process, run};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::task::JoinSet;
use tokio::time::{MissedTickBehavior, interval, sleep};
use tokio_util::sync::CancellationToken;

/// Uploads of honest people per second, and number of their connections.
const HONEST_PER_S: f64 = 200.0;
const HONEST: usize = 16;

/// Requests of attackers per second, and number of their connections.
const REQUESTS_PER_S: u64 = 1_000;
const ATTACKERS: u64 = 20;

/// A kind of attack.
#[derive(Clone, Copy)]
enum Attack {
    /// Holds this number of connections. They send nothing, or they send this start of a request
    /// and then one byte per second.
    Hold(u64, &'static str),
    /// Sends requests with this head and body.
    Send(&'static str, &'static str),
    /// Sends the same requests, but closes the connection before the response.
    Vanish(&'static str, &'static str),
}

const ATTACKS: [(&str, Attack); 8] = [
    ("2,000 idle connections", Attack::Hold(2_000, "")),
    ("1,000 slow heads", Attack::Hold(1_000, "GET /start HTTP/1.1\r\nHost: local")),
    (
        "500 half bodies",
        Attack::Hold(
            500,
            "POST /api/v1/studies/default/participants HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: 200000\r\n\r\n{\"consent\": true, ",
        ),
    ),
    ("pages", Attack::Send("GET /s/default", "")),
    ("wrong keys", Attack::Send("POST /api/v1/admin/session", "{\"key\":\"open sesame, please\"}")),
    ("wrong tokens", Attack::Send("PUT /api/v1/participants/me/trials/1", "{\"inputs\":[[[[")),
    ("enrolments", Attack::Send("POST /api/v1/studies/default/participants", "{\"consent\":true}")),
    (
        "enrolments that hang up",
        Attack::Vanish("POST /api/v1/studies/default/participants", "{\"consent\":true}"),
    ),
];

/// Measures one server on a new database.
pub(crate) async fn measure(subject: &Subject, folder: &Folder, seconds: f64, chosen: &[String]) {
    let is_chosen = |name: &str| chosen.iter().any(|part| name.contains(part.as_str()));
    println!("\nunder attack ({}; {HONEST_PER_S} honest uploads a second)", subject.name);
    let own = Folder::default();
    let (database, _cluster) = subject.database(folder, "attacks.db");
    // The people whom the analysis will compare.
    let trials = own.name("trials.csv");
    let people = ["simulate", "--participants", "30", "--seed", "1", "--out", &trials];
    run(&people).await.json();
    let mut server = Process::start_with(&own, &database, &["--trusted-proxy", "127.0.0.1"]).await;
    let key = server.key().await;
    let url = database.url();
    run(&["import", "--study", "analysed", "--trials", &trials, "--database", &url]).await.json();
    let crowd = Crowd::of(&[&server]);
    crowd.enrol((HONEST_PER_S * seconds * 12.0 / 59.0) as usize, HONEST, 120.0).await;
    let honest = async || {
        crowd.take_latencies();
        crowd.upload(HONEST, seconds, Pace::PerSecond(HONEST_PER_S)).await;
        crowd.take_latencies()
    };
    honest().await;
    let alone = honest().await;
    let alone_ms = alone.quantile_ms(0.99);
    row("nobody else", format!("{alone_ms:.1} ms"), format!("99 of 100 within; {alone}"));
    let said = |name: &str, beside: &sidestep_tests::load::Latencies, more: String| {
        let ratio = beside.quantile_ms(0.99) / alone_ms;
        let figure = format!("{:.1} ms, {ratio:.2}×", beside.quantile_ms(0.99));
        row(name, figure, format!("{}; {beside}{more}", at_most(ratio, 2.0, "×")));
    };
    let address: SocketAddr = server.origin.trim_start_matches("http://").parse().expect("a port");
    for (name, attack) in ATTACKS.into_iter().filter(|(name, _)| is_chosen(name)) {
        let (stop, count) = (CancellationToken::new(), Arc::new(AtomicU64::new(0)));
        let (stopped, counted) = (stop.clone(), Arc::clone(&count));
        let attackers = std::thread::spawn(move || attackers(address, attack, &stopped, counted));
        // Wait until the attack is under way.
        sleep(Duration::from_secs(1)).await;
        let beside = honest().await;
        stop.cancel();
        attackers.join().expect("attackers");
        let count = count.load(Ordering::Relaxed);
        said(name, &beside, format!("; {count} of the attackers' requests were answered"));
        row("  put off by a 503, problems", crowd.troubles(), "");
        sleep(Duration::from_secs(2)).await;
    }
    const ANALYSIS: &str = "an analysis of 30 people";
    if !is_chosen(ANALYSIS) {
        return;
    }
    let ask = server.request(Method::POST, &routes::admin_analyses("analysed")).bearer_auth(&key);
    let asked = Answer::of(ask.json(&serde_json::json!({}))).await;
    assert_eq!(asked.status, 201, "{}", asked.body);
    sleep(Duration::from_secs(1)).await;
    let beside = honest().await;
    let route = routes::admin_analysis(asked.body["id"].as_str().expect("an id"));
    let now = Answer::of(server.request(Method::GET, &route).bearer_auth(&key)).await;
    let state = now.body["state"].as_str().unwrap_or("?").to_owned();
    said(ANALYSIS, &beside, format!("; afterwards it is {state}"));
}

/// Runs the attack on its own runtime until it is stopped.
fn attackers(
    server: SocketAddr,
    attack: Attack,
    stop: &CancellationToken,
    answered: Arc<AtomicU64>,
) {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.expect("a runtime");
    let all = async {
        let mut tasks = JoinSet::new();
        let count = match attack {
            Attack::Hold(count, _) => count,
            Attack::Send(..) | Attack::Vanish(..) => ATTACKERS,
        };
        for _ in 0..count {
            let answered = Arc::clone(&answered);
            tasks.spawn(async move {
                loop {
                    // If the server closes a connection, the attacker opens a new one.
                    if attacker(server, attack, &answered).await.is_err() {
                        sleep(Duration::from_millis(50)).await;
                    }
                }
            });
        }
        stop.cancelled().await;
    };
    runtime.block_on(all);
}

async fn attacker(server: SocketAddr, attack: Attack, answered: &AtomicU64) -> io::Result<()> {
    match attack {
        Attack::Hold(_, begin) => {
            let mut stream = TcpStream::connect(server).await?;
            stream.write_all(begin.as_bytes()).await?;
            loop {
                sleep(Duration::from_secs(1)).await;
                if begin.is_empty() {
                    if stream.read(&mut [0; 64]).await? == 0 {
                        return Ok(());
                    }
                } else {
                    stream.write_all(b"x").await?;
                }
            }
        }
        Attack::Send(head, body) | Attack::Vanish(head, body) => {
            let request = request(head, body);
            let mut ticks = interval(Duration::from_millis(1_000 * ATTACKERS / REQUESTS_PER_S));
            ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
            let mut stream = TcpStream::connect(server).await?;
            let mut answer = vec![0; 65_536];
            loop {
                ticks.tick().await;
                stream.write_all(request.as_bytes()).await?;
                if matches!(attack, Attack::Vanish(..)) {
                    stream = TcpStream::connect(server).await?;
                    continue;
                }
                if stream.read(&mut answer).await? == 0 {
                    return Ok(());
                }
                answered.fetch_add(1, Ordering::Relaxed);
            }
        }
    }
}

fn request(head: &str, body: &str) -> String {
    let length = body.len();
    format!(
        "{head} HTTP/1.1\r\nHost: localhost\r\nX-Forwarded-For: 192.0.2.7\r\n\
         Content-Type: application/json\r\nContent-Length: {length}\r\n\r\n{body}"
    )
}
