//! Clients that are slow, disconnect while sending, or are gone before the response.

use reqwest::Method;
use sidestep::api::{Progress, routes};
use sidestep::math::SeededRng;
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Driver, Server, driven};
use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};

/// An upload as a raw HTTP request.
fn request(server: &Server, driver: &Driver, trial_id: &str, body: &[u8]) -> Vec<u8> {
    let host = server.origin.trim_start_matches("http://");
    let (route, token) = (routes::my_trial(trial_id), &driver.enrolled.token);
    let head = format!(
        "PUT {route} HTTP/1.1\r\nHost: {host}\r\nAuthorization: Bearer {token}\r\n\
         Content-Type: application/json\r\nContent-Length: {}\r\n\r\n",
        body.len()
    );
    [head.as_bytes(), body].concat()
}

fn connect(server: &Server) -> TcpStream {
    let stream = TcpStream::connect(server.origin.trim_start_matches("http://")).unwrap();
    stream.set_nodelay(true).unwrap();
    stream
}

/// Waits until the server has closed the connection, and returns its response.
fn rest(mut stream: TcpStream) -> Vec<u8> {
    let mut answer = Vec::new();
    // A connection that was reset sends nothing more.
    let _ = stream.read_to_end(&mut answer);
    answer
}

async fn stored(server: &Server, driver: &Driver) -> Vec<String> {
    let me: Progress = driver.me(server).await.into(200);
    me.stored
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_upload_that_breaks_off_stores_nothing_and_arrives_later() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    let mut rng = SeededRng::new(5);
    for (trial_id, scene) in driver.scenes() {
        let trial = driven(&scene);
        let whole = request(&server, &driver, &trial_id, &serde_json::to_vec(&trial).unwrap());
        let before = stored(&server, &driver).await;
        // The upload breaks off in the head, in the body, or before the last byte.
        let mut lengths: Vec<usize> = (0..12).map(|_| rng.below(whole.len())).collect();
        lengths.extend([1, whole.len() - 1]);
        for length in lengths {
            let mut stream = connect(&server);
            stream.write_all(&whole[..length]).unwrap();
            stream.shutdown(Shutdown::Write).unwrap();
            let answer = rest(stream);
            assert!(!answer.starts_with(b"HTTP/1.1 2"), "{}", String::from_utf8_lossy(&answer));
        }
        assert_eq!(stored(&server, &driver).await, before);
        assert_eq!(driver.send(&server, &trial_id, &trial).await.status, 201);
        assert_eq!(stored(&server, &driver).await, [before, vec![trial_id]].concat());
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn whoever_is_gone_before_the_answer_finds_the_trial_once() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    for (trial_id, scene) in driver.scenes() {
        let trial = driven(&scene);
        let whole = request(&server, &driver, &trial_id, &serde_json::to_vec(&trial).unwrap());
        let before = stored(&server, &driver).await;
        // Many uploads of the same trial at the same time, as from an unstable network.
        for _ in 0..20 {
            connect(&server).write_all(&whole).unwrap();
        }
        let again = driver.send(&server, &trial_id, &trial).await;
        assert!([200, 201].contains(&again.status), "{}", again.body);
        assert_eq!(stored(&server, &driver).await, [before, vec![trial_id]].concat());
    }
    let export = server.export("default").await;
    assert_eq!(export.lines().count() - 1, 5 * 50, "each trial once");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn slow_clients_hold_up_nobody_else() {
    const SLOW: usize = 200;
    let server = Server::with_study(SHORT_STUDY).await;
    let [slow, quick] = [Driver::enrol(&server).await, Driver::enrol(&server).await];
    let (trial_id, scene) = slow.scenes()[0].clone();
    let trial = driven(&scene);
    let whole = request(&server, &slow, &trial_id, &serde_json::to_vec(&trial).unwrap());
    // Each client sends half a body or a part of the head, and then nothing.
    let mut waiting = Vec::new();
    for number in 0..SLOW {
        let mut stream = connect(&server);
        let part = if number.is_multiple_of(2) { whole.len() / 2 } else { 40 };
        stream.write_all(&whole[..part]).unwrap();
        waiting.push(stream);
    }
    quick.drive(&server, 5).await;
    assert_eq!(stored(&server, &quick).await.len(), 5);
    assert_eq!(server.get("/readyz").await.status, 200);
    // One of the slow clients finally sends the rest.
    let mut late = waiting.swap_remove(0);
    late.write_all(&whole[whole.len() / 2..]).unwrap();
    let mut answer = [0; 12];
    late.read_exact(&mut answer).unwrap();
    assert_eq!(&answer, b"HTTP/1.1 201");
    drop(waiting);
    assert_eq!(stored(&server, &slow).await, std::slice::from_ref(&trial_id));
    // The same upload again, from another HTTP client.
    let put = slow.request(&server, Method::PUT, &routes::my_trial(&trial_id)).json(&trial);
    assert_eq!(put.send().await.unwrap().status(), 200);
}
