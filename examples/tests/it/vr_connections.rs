//! The server of `vr` when many come, when another person is there, and when it ends.

use std::io::Write;
use std::net::TcpStream;
use std::time::{Duration, Instant};

use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};
use serde_json::json;
use tungstenite::Message;

use crate::scratch::Scratch;
use crate::vr::{report, vr, wall};
use crate::vr_client::{Client, Server};

/// Arguments that serve a small wall; results in `out`.
fn arguments(s: &Scratch, out: &str) -> Vec<String> {
    let served = ["--listen", "localhost:0", "--texel", "0.02", "--out", out];
    wall(s).into_iter().chain(served.map(String::from)).collect()
}

fn serve(arguments: &[String]) -> Server {
    Server::start(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
}

/// Half-open connections by the hundred, again and again, from the machine that the page is on: some say nothing, some half a request.
#[test]
fn who_has_the_token_paints_on_while_strangers_hold_the_door() {
    let s = Scratch::new("vr-door");
    let out = s.path("out");
    let server = serve(&arguments(&s, &out));
    let mut client = server.connect("").unwrap();
    let mut strangers = Vec::new();
    let begun = Instant::now();
    let mut next = 0;
    for round in 0..4 {
        for k in 0..250 {
            let mut stream = TcpStream::connect(&server.address).unwrap();
            if k % 2 == 0 {
                let _ = stream.write_all(b"GET / HTTP/1.1\r\nHost: local");
            }
            strangers.push(stream);
        }
        assert_eq!(client.send(&Client::states(next, next + 10)), next + 10);
        next += 10;
        // The page is still given out, and a lost connection comes back.
        assert!(server.get("/app.js", "").contains("200"), "round {round}");
        let key = client.key.clone();
        client = server.connect(&key).unwrap();
        assert_eq!(client.next, next);
    }
    // No head is waited for: each takes its five seconds if it is.
    assert!(begun.elapsed() < Duration::from_secs(5), "{:?}", begun.elapsed());
    client.end(next);
    assert_eq!(server.finish(), Some(0));
    assert!(report(&out)["refused_connections"].as_u64().unwrap() >= 1000 - 128);
}

/// A page goes on sending what the hand does until it hears that the session is over.
#[test]
fn the_last_words_reach_a_page_that_does_not_stop_talking() {
    let s = Scratch::new("vr-last");
    let out = s.path("out");
    let server = serve(&arguments(&s, &out));
    let mut client = server.connect("").unwrap();
    client.send(&Client::states(0, 60));
    client
        .socket
        .send(Message::text(json!({"events": [{"command": {"sequence": 60, "command": {"do": "end"}}}]}).to_string()))
        .unwrap();
    for k in 61..1000 {
        let more = json!({ "events": Client::states(k, k + 1) }).to_string();
        if client.socket.send(Message::text(more)).is_err() {
            break;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    let ended = client.ended();
    assert_eq!((&ended["folder"], &ended["failed"]), (&json!(out), &json!(null)));
    assert_eq!(server.finish(), Some(0));
    assert_eq!(report(&out)["states"], 60);
}

#[test]
fn no_session_overwrites_another() {
    let s = Scratch::new("vr-kept");
    let out = s.path("out");
    for _ in 0..3 {
        let server = serve(&arguments(&s, &out));
        let mut client = server.connect("").unwrap();
        client.send(&Client::states(0, 60));
        client.end(60);
        assert_eq!(server.finish(), Some(0));
    }
    let sessions = || {
        std::fs::read_dir(&out)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension().is_some_and(|e| e == "mcap"))
    };
    assert_eq!(sessions().count(), 3);
    for (number, session) in sessions().enumerate() {
        let again = s.path(&format!("again{number}"));
        assert!(vr(&["--replay", session.to_str().unwrap(), "--out", &again]).status.success());
    }
}

/// Ended by `kill -9`, a session is what was recorded up to a few seconds before.
#[cfg(unix)]
#[test]
fn a_session_that_was_killed_is_painted_again() {
    let s = Scratch::new("vr-killed");
    let out = s.path("out");
    let mut server = serve(&arguments(&s, &out));
    let mut client = server.connect("").unwrap();
    // Five seconds must pass before it makes anything safe.
    let begun = Instant::now();
    let mut next = 0;
    while begun.elapsed() < Duration::from_millis(5600) {
        client.send(&Client::states(next, next + 9));
        next += 9;
        std::thread::sleep(Duration::from_millis(100));
    }
    server.child.kill().unwrap();
    server.child.wait().unwrap();
    let part = format!("{out}/session.mcap.part");
    let again = s.path("again");
    let output = vr(&["--replay", &part, "--out", &again]);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && text.contains("its end is missing"), "{text}");
    let states = report(&again)["states"].as_u64().unwrap();
    assert!(states > next / 2 && states <= next, "{states} of {next}");
}

/// Frames that no browser sends, after a handshake that is one.
#[test]
fn raw_frames_end_their_connection_and_nothing_else() {
    let s = Scratch::new("vr-frames");
    let out = s.path("out");
    let server = serve(&arguments(&s, &out));
    let mut generator = SplitMix64::seed_from_u64(11);
    let mut random = move |below: u64| generator.next_u64() % below;
    let text = json!({ "events": Client::states(0, 1) }).to_string();
    let mut key = String::new();
    for round in 0..400 {
        let mut client = server.connect(&key).unwrap();
        key.clone_from(&client.key);
        let stream = client.socket.get_mut();
        let mut frame = vec![random(256) as u8];
        match round % 4 {
            // A length that is not there, of 7, 16 or 64 bits.
            0 => frame.extend([
                0x80 | (124 + random(4)) as u8,
                random(256) as u8,
                0xff,
                0xff,
                0xff,
                0xff,
                0xff,
                0xff,
                0xff,
            ]),
            // Without a mask, which a client must set.
            1 => {
                frame.push(text.len().min(125) as u8);
                frame.extend(text.as_bytes());
            }
            // Reserved bits and kinds of frames.
            2 => frame = vec![0xff, 0x84, 1, 2, 3, 4, 5, 6, 7, 8],
            _ => frame.extend((0..random(64)).map(|_| 0_u8).collect::<Vec<_>>()),
        }
        let _ = stream.write_all(&frame);
        if round % 3 == 0 {
            let _ = stream.shutdown(std::net::Shutdown::Write);
        }
    }
    let mut client = server.connect(&key).unwrap();
    let next = client.next;
    assert_eq!(client.send(&Client::states(next, next + 60)), next + 60);
    client.end(next + 60);
    assert_eq!(server.finish(), Some(0));
}
