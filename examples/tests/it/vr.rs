//! The binary `vr`: a simulated hand and its replay, the server against clients that behave and clients that do not.

use std::process::{Command, Output};

use serde_json::{Value, json};
use tungstenite::Message;

use crate::scratch::Scratch;
use crate::vr_client::{Client, Server};

/// A wall of 2.6 metres by 1.4, facing -x.
const WALL: &str = "v 0 1.3 1\nv 0 -1.3 1\nv 0 -1.3 2.4\nv 0 1.3 2.4\nf 1 2 3\nf 1 3 4\n";

/// Flow of the strokes in two colours, m^3/s: thin enough for the scale of ink.
const FLOW: f64 = 1.5e-7;

pub(crate) fn vr(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_vr")).args(arguments).output().unwrap()
}

pub(crate) fn report(folder: &str) -> Value {
    serde_json::from_str(&std::fs::read_to_string(format!("{folder}/report.json")).unwrap()).unwrap()
}

pub(crate) fn wall(scratch: &Scratch) -> [String; 5] {
    scratch.write("wall.obj", WALL);
    ["--mesh".into(), scratch.path("wall.obj"), "--up".into(), "z".into(), "--scale=1".into()]
}

#[test]
fn a_session_is_flown_as_it_was_seen_and_replays_bit_for_bit() {
    let s = Scratch::new("vr");
    let (first, second) = (s.path("first"), s.path("second"));
    let mesh = wall(&s);
    let mut arguments: Vec<&str> = mesh.iter().map(String::as_str).collect();
    arguments.extend([
        "--experiment",
        "contour",
        "--hand-speed",
        "0.4",
        "--segment",
        "0.5",
        "--texel",
        "0.01",
        "--out",
        &first,
    ]);
    let output = vr(&arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let figures = report(&first);
    assert!(figures["ssim_flown_seen"].as_f64().unwrap() > 0.9, "{figures:#}");
    let (seen, flown) = (figures["paint_seen_ml"].as_f64().unwrap(), figures["paint_flown_ml"].as_f64().unwrap());
    assert!(seen > 1.0 && (flown / seen - 1.0).abs() < 0.03, "{seen} ml seen, {flown} ml flown");
    assert_eq!(figures["targets"], figures["targets_served"]);
    assert!(figures["continued_tasks"].as_u64().unwrap() >= 3, "{figures:#}");
    for file in
        ["session.mcap", "plan.csv", "seen.png", "flown.png", "latency.png", "mission.toml", "mission_charcoal.png"]
    {
        assert!(s.0.join("first").join(file).metadata().is_ok_and(|found| found.len() > 100), "{file}");
    }

    // The pictures are those of the end: as much of the wall is dark in both.
    let dark = |name: &str| {
        let picture = image::open(s.0.join("first").join(name)).unwrap().to_luma8();
        picture.pixels().filter(|pixel| pixel.0[0] < 120).count() as f64
    };
    let (seen, flown) = (dark("seen.png"), dark("flown.png"));
    assert!(seen > 500.0 && (flown / seen - 1.0).abs() < 0.04, "{seen} pixels seen, {flown} flown");

    let recording = format!("{first}/session.mcap");
    let output = vr(&["--replay", &recording, "--out", &second]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let plan = |folder: &str| std::fs::read(format!("{folder}/plan.csv")).unwrap();
    assert!(plan(&first) == plan(&second), "the plans differ");

    // A recording of another surface is told from its plans, and a file that is none by its name.
    s.write("wall.obj", WALL.replace("v 0 1.3 2.4", "v 0.4 1.3 2.4"));
    let output = vr(&["--replay", &recording, "--out", &s.path("third")]);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(1) && text.contains("plans differ"), "{text}");
    let output = vr(&["--replay", &recording, "--out", &first]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("overwrite"));
    let output = vr(&["--replay", &s.path("wall.obj"), "--out", &second]);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(1) && text.contains("wall.obj"), "{text}");
}

#[test]
fn nothing_is_lost_or_done_twice_over_lost_connections() {
    let s = Scratch::new("vr-server");
    let out = s.path("out");
    let mesh = wall(&s);
    let mut arguments: Vec<&str> = mesh.iter().map(String::as_str).collect();
    arguments.extend(["--listen", "127.0.0.1:0", "--texel", "0.01", "--out", &out]);
    let server = Server::start(&arguments);
    assert!(server.get("/", "").contains("200") && server.get("/app.js", "").contains("200"));
    assert!(server.get("/../Cargo.toml", "").contains("404") && server.get("/session", "").contains("426"));
    assert!(server.get("/", "Host: evil.example\r\n").contains("403"), "a name that is led here by an attacker");
    let foreign = format!("Host: {}\r\nOrigin: http://evil.example\r\n", server.address);
    assert!(server.get("/session", &foreign).contains("403"), "another page's script");

    let mut client = server.connect("").unwrap();
    assert_eq!(client.send(&Client::states(0, 20)), 20);
    for key in ["", "guessed"] {
        assert_eq!(server.connect(key).unwrap_err(), "4001 Another person is here.");
    }
    // A gap: what follows it is not taken.
    assert_eq!(client.send(&Client::states(25, 30)), 20);
    // The connection is lost; what had arrived comes again with the rest.
    let key = client.key.clone();
    let mut client = server.connect(&key).unwrap();
    assert_eq!((client.next, client.key.as_str()), (20, key.as_str()));
    assert_eq!(client.send(&Client::states(10, 60)), 60);
    assert_eq!(client.end(60)["folder"], out.as_str());
    assert_eq!(server.finish(), Some(0));
    let figures = report(&out);
    let count = |name: &str| figures[name].as_u64().unwrap();
    assert_eq!((count("events"), count("states"), count("repeated_events")), (61, 60, 10));
    assert_eq!((count("event_gaps"), count("missing_ticks"), count("connections")), (1, 0, 2));
    assert_eq!(count("refused_connections"), 5);
    // Thirty ticks of 0.4 ml/s, seen and flown.
    let seen = figures["paint_seen_ml"].as_f64().unwrap();
    assert!((seen - 0.4 * 30.0 / 90.0).abs() < 0.002, "{seen}");
    assert!(figures["paint_flown_ml"].as_f64().unwrap() > 0.9 * seen);
}

/// Middle of the pixels of a colour, as shares of width and height, and how many there are as a share of all.
fn middle(picture: &str, is: impl Fn([u8; 3]) -> bool) -> ([f64; 2], f64) {
    let picture = image::open(picture).unwrap().to_rgb8();
    let (width, height) = picture.dimensions();
    let places: Vec<[f64; 2]> = picture
        .enumerate_pixels()
        .filter(|(_, _, pixel)| is(pixel.0))
        .map(|(x, y, _)| [(f64::from(x) + 0.5) / f64::from(width), (f64::from(y) + 0.5) / f64::from(height)])
        .collect();
    let count = places.len() as f64;
    ([0, 1].map(|k| places.iter().map(|place| place[k]).sum::<f64>() / count), count / f64::from(width * height))
}

#[test]
fn a_session_in_two_colours_is_flown_as_a_mission_of_two_paints() {
    let s = Scratch::new("vr-colours");
    let (out, flown) = (s.path("out"), s.path("flown"));
    let mesh = wall(&s);
    let mut arguments: Vec<&str> = mesh.iter().map(String::as_str).collect();
    arguments.extend(["--listen", "127.0.0.1:0", "--offline", "--texel", "0.01", "--out", &out]);
    let server = Server::start(&arguments);
    let mut client = server.connect("").unwrap();
    // Blue first, then red: the strokes are 0.3 m long, their middles at y = 0.65 and -0.45, z = 2.6 and 1.8.
    let strokes = [(0, 4, 0.8, 2.6), (150, 1, -0.3, 1.8)];
    let mut events = Vec::new();
    for (first, colour, y, z) in strokes {
        let along = |k: u64| y - 0.3 * (k.clamp(10, 130) - 10) as f64 / 120.0;
        let mode = |k: u64| if (10..=130).contains(&k) { "painting" } else { "idle" };
        events.extend((0..150).map(|k| Client::state(first + k, mode(k), [along(k), z], (colour, FLOW))));
    }
    events.push(json!({"command": {"sequence": 300, "command": {"do": "end"}}}));
    client.socket.send(Message::text(json!({ "events": events }).to_string())).unwrap();
    assert_eq!(client.ended()["folder"], out.as_str());
    assert_eq!(server.finish(), Some(0));

    let mission = std::fs::read_to_string(format!("{out}/mission.toml")).unwrap();
    let [blue, red] = ["\"blue\"", "\"red\""].map(|name| mission.find(name).expect("both paints are saved"));
    assert!(blue < red, "in the order in which they were used: {mission}");
    let output = Command::new(env!("CARGO_BIN_EXE_paintcopter"))
        .args(["--mission", &format!("{out}/mission.toml"), "--out", &flown])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let figures = report(&flown);
    assert_eq!(figures["paints"], json!(["blue", "red"]));
    for (paint, kilograms) in figures["paint_deposited_kg_by_paint"].as_array().unwrap().iter().enumerate() {
        // 121 ticks, 1.2 kg/l.
        let asked = 1200.0 * FLOW * 121.0 / 90.0;
        let ratio = kilograms.as_f64().unwrap() / asked;
        assert!((ratio - 1.0).abs() < 0.15, "paint {paint}: {ratio} of what the hand gave");
    }
    // The wall is hung: y from 1.3 to -1.3 to the right, z from 2.9 to 1.5 downwards.
    let is_blue = |[r, _, b]: [u8; 3]| b > r;
    let is_red = |[r, g, b]: [u8; 3]| f64::from(r) > 1.6 * f64::from(g) && r > b;
    for (name, place, is) in [
        ("blue", [0.65 / 2.6, 0.3 / 1.4], &is_blue as &dyn Fn([u8; 3]) -> bool),
        ("red", [1.75 / 2.6, 1.1 / 1.4], &is_red),
    ] {
        for picture in [format!("{out}/seen.png"), format!("{flown}/painted.png")] {
            let (found, share) = middle(&picture, is);
            let off = [0, 1].map(|k| (found[k] - place[k]).abs());
            assert!(off[0] < 0.02 && off[1] < 0.02, "{name} of {picture}: {found:?}, asked for {place:?}");
            // A stroke of 0.3 m, a few centimetres wide.
            assert!((0.002..0.012).contains(&share), "{name} of {picture}: {share}");
        }
    }
    // Each paint alone has a complete mission.
    for file in ["1_blue/report.md", "2_red/mission.mcap", "2_red/mission.toml", "painted_view.png", "report.md"] {
        assert!(s.0.join("flown").join(file).metadata().is_ok_and(|found| found.len() > 100), "{file}");
    }
}

#[test]
fn ten_thousand_bad_messages_are_counted_and_the_session_goes_on() {
    let s = Scratch::new("vr-hostile");
    let out = s.path("out");
    let mesh = wall(&s);
    let mut arguments: Vec<&str> = mesh.iter().map(String::as_str).collect();
    arguments.extend(["--listen", "0.0.0.0:0", "--texel", "0.02", "--out", &out]);
    let server = Server::start(&arguments);
    assert!(server.query.starts_with("?token=") && server.query.len() == 39, "{}", server.query);
    assert!(server.get("/", "").contains("403") && server.get("/?token=0123", "").contains("403"));
    let handshake = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
    for path in ["/session", "/session?token=0123", "/session?key=0123"] {
        assert!(server.get(path, handshake).contains("403"), "{path}");
    }
    assert!(server.get(&format!("/{}", server.query), "").contains("200"));

    let mut client = server.connect("").unwrap();
    let key = client.key.clone();
    let sound = json!({"events": Client::states(0, 1)}).to_string();
    let mut sent = 0_u64;
    let mut send = |client: &mut Client, message: Message| {
        client.socket.write(message).unwrap();
        sent += 1;
        // The server answers each of them; unread answers would fill the line.
        if sent.is_multiple_of(50) {
            client.socket.flush().unwrap();
            for _ in 0..50 {
                client.until("ack");
            }
        }
    };
    for k in 0..9_950_usize {
        let message = match k % 5 {
            0 => Message::text(&sound[..k % sound.len()]),
            1 => Message::binary(vec![k as u8; k % 300]),
            2 => Message::text(format!("{{\"events\":[{{\"state\":{k}}}]}}")),
            3 => Message::text("[".repeat(k % 400)),
            _ => Message::text(json!({"events": [], "more": k}).to_string()),
        };
        send(&mut client, message);
    }
    // Sound messages with numbers that no headset sends are events that are refused.
    let odd = json!({"events": [{"state": {"version": 1, "sequence": 0, "time": 1e300, "mode": "painting",
        "nozzle": {"translation": [1e30, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0, 9.0]},
        "cradle": {"position": [0.0, 0.0, 0.0], "heading": 0.0}, "colour": 200, "flow": 9.0}}]});
    client.socket.send(Message::text(odd.to_string())).unwrap();
    assert_eq!(client.until("ack")["next_sequence"], 1);
    // Oversized ones end the connection, not the session.
    for _ in 0..50 {
        let _ = client.socket.send(Message::text("x".repeat(1_500_000)));
        client = server.connect(&key).unwrap();
    }
    assert_eq!(client.send(&Client::states(1, 60)), 60);
    assert_eq!(client.end(60)["folder"], out.as_str());
    assert_eq!(server.finish(), Some(0));
    let figures = report(&out);
    let count = |name: &str| figures[name].as_u64().unwrap();
    assert_eq!(count("malformed_messages"), 10_000);
    assert_eq!((count("refused_events"), count("states")), (1, 59));
}

#[test]
fn a_hand_that_meets_no_surface_is_no_result() {
    let s = Scratch::new("vr-small");
    s.write("small.obj", "v 0 0.1 1\nv 0 -0.1 1\nv 0 -0.1 1.2\nv 0 0.1 1.2\nf 1 2 3\nf 1 3 4\n");
    let mesh = s.path("small.obj");
    let output = vr(&[
        "--mesh",
        &mesh,
        "--up=z",
        "--scale=1",
        "--experiment",
        "contour",
        "--hand-speed=1",
        "--out",
        &s.path("out"),
    ]);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(1) && text.contains("met no surface") && text.contains("--scale"), "{text}");
}

#[test]
fn options_that_would_be_ignored_and_sources_that_say_nothing_are_refused() {
    let s = Scratch::new("vr-refused");
    s.write("none.mcap", "no recording");
    let out = s.path("out");
    let refused = |arguments: &[&str], word: &str| {
        let arguments: Vec<&str> = arguments.iter().copied().chain(["--out", &out]).collect();
        let output = vr(&arguments);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code().is_some_and(|code| code != 0) && text.contains(word), "{arguments:?}: {text}");
    };
    refused(&["--experiment", "contour", "--pigments", &out], "--experiment layers");
    refused(&["--watch", &s.path("none.mcap")], "none.mcap");
    refused(&["--watch", &s.path("missing.mcap")], "missing.mcap");
    // Nobody listens on a port that was free a moment ago.
    let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    refused(&["--watch", &free], "scan --live");
    refused(&["--watch", "wss://127.0.0.1:1"], "ws://");
}
