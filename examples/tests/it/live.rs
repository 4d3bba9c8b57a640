//! A run as it goes: what viewers and the recording are told.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::process::{Command, Stdio};
use std::time::Duration;

use foxglove::Decode as _;
use foxglove::messages::{CompressedImage, FrameTransforms, SceneUpdate};
use tungstenite::Message;
use tungstenite::client::IntoClientRequest as _;
use tungstenite::http::HeaderValue;

use crate::scratch::Scratch;
use crate::strange_recordings::{FRAMES, recording, scan};

/// Messages of a recording by topic.
fn messages(s: &Scratch) -> BTreeMap<String, Vec<(u64, Vec<u8>)>> {
    let bytes = std::fs::read(s.0.join("out/scan.mcap")).unwrap();
    let mut out: BTreeMap<String, Vec<(u64, Vec<u8>)>> = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        out.entry(message.channel.topic.clone()).or_default().push((message.log_time, message.data.to_vec()));
    }
    out
}

#[test]
fn a_recording_of_a_run_holds_what_became_of_it() {
    let s = recording("record");
    let ran = scan(&s, &["--poses", "tracked", "--record"]);
    assert!(ran.ok, "{}", ran.said);
    let told = messages(&s);
    let count = |topic: &str| told.get(topic).map_or(0, Vec::len);
    assert_eq!([count("/tf"), count("/camera/pose"), count("/tracking")], [FRAMES, FRAMES, FRAMES - 1], "{told:?}");
    assert_eq!(count("/camera/image"), 3);
    let transforms = FrameTransforms::decode(&told["/tf"][3].1[..]).unwrap();
    assert_eq!(transforms.transforms[0].child_frame_id, "camera");
    // Stamps of the recording.
    assert_eq!(told["/tf"][3].0, 10_300_000_000);
    let image = CompressedImage::decode(&told["/camera/image"][0].1[..]).unwrap();
    let picture = image::load_from_memory(&image.data).unwrap();
    assert_eq!((picture.width(), picture.height()), (160, 120));
    let numbers: serde_json::Value = serde_json::from_slice(&told["/tracking"][5].1).unwrap();
    assert!(numbers["tracked"] == true && numbers["agreement"].as_f64().unwrap() > 0.9, "{numbers}");
    // The patches, each in place of what it was before, are the mesh.
    let mut patches = BTreeMap::new();
    for (_, data) in &told["/map"] {
        for entity in SceneUpdate::decode(&data[..]).unwrap().entities {
            let indices = entity.triangles.iter().map(|t| t.indices.len()).sum::<usize>();
            patches.insert(entity.id, indices / 3);
        }
    }
    assert!(patches.len() > 8, "{patches:?}");
    assert_eq!(patches.values().sum::<usize>() as f64, ran.figure("triangles"));
    // The same run makes the same file, with more threads, too.
    let first = std::fs::read(s.0.join("out/scan.mcap")).unwrap();
    let again = Command::new(env!("CARGO_BIN_EXE_scan"))
        .args(["--sequence", s.0.to_str().unwrap(), "--out", &s.path("out"), "--voxel", "0.02", "--threads", "3"])
        .args(["--poses", "tracked", "--record", "--ros2"])
        .output()
        .unwrap();
    assert!(again.status.success());
    assert!(first == std::fs::read(s.0.join("out/scan.mcap")).unwrap());
    // And once more for ROS 2, message by message.
    let for_ros2 = std::fs::read(s.0.join("out/scan.ros2.mcap")).unwrap();
    let topics = |bytes: &[u8]| {
        let messages = mcap::MessageStream::new(bytes).unwrap().map(Result::unwrap);
        messages.map(|message| (message.channel.topic.clone(), message.log_time)).collect::<Vec<_>>()
    };
    assert!(topics(&for_ros2) == topics(&first));
}

/// A viewer that asks for the map when half of it does not change any more is shown all of it.
#[test]
fn a_viewer_that_comes_late_sees_all_of_the_map() {
    let s = recording("live");
    // After the first round the same frames over and over, five metres aside: what was mapped at first stays as it is.
    for name in ["depth.txt", "rgb.txt", "groundtruth.txt"] {
        let text = std::fs::read_to_string(s.0.join(name)).unwrap();
        let again = (0..60).flat_map(|round| {
            text.lines().map(move |line| {
                let words: Vec<&str> = line.split(' ').collect();
                let stamp = words[0].parse::<f64>().unwrap() + 2.0 * f64::from(round);
                let mut rest: Vec<String> = words[1..].iter().map(ToString::to_string).collect();
                if name == "groundtruth.txt" && round > 0 {
                    rest[0] = (words[1].parse::<f64>().unwrap() + 5.0).to_string();
                }
                format!("{stamp} {}\n", rest.join(" "))
            })
        });
        s.write(name, again.collect::<String>());
    }
    let mut run = Command::new(env!("CARGO_BIN_EXE_scan"))
        .args(["--sequence", s.0.to_str().unwrap(), "--out", &s.path("out"), "--voxel", "0.02", "--threads", "1"])
        .args(["--live", "127.0.0.1:0"])
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(run.stderr.take().unwrap()).lines().map(Result::unwrap);
    let line = lines.find(|line| line.contains("live view: ")).unwrap();
    let address = line.split_whitespace().find_map(|word| word.strip_prefix("ws://")).unwrap().to_string();
    // What is said afterwards must not fill the pipe.
    let rest = std::thread::spawn(move || lines.count());
    let mut request = format!("ws://{address}/").into_client_request().unwrap();
    request.headers_mut().insert("Sec-WebSocket-Protocol", HeaderValue::from_static("foxglove.sdk.v1"));
    let stream = TcpStream::connect(&address).unwrap();
    stream.set_read_timeout(Some(Duration::from_mins(1))).unwrap();
    let (mut socket, _) = tungstenite::client(request, stream).unwrap();
    let (mut topics, mut seen, mut asked) = (BTreeMap::new(), BTreeSet::new(), false);
    let map_from = Duration::from_secs(16).as_nanos() as u64;
    let mut patches = BTreeMap::new();
    while let Ok(message) = socket.read() {
        match message {
            Message::Text(text) => {
                let message: serde_json::Value = serde_json::from_str(&text).unwrap();
                if message["op"] == "advertise" {
                    let channels = message["channels"].as_array().unwrap();
                    for channel in channels {
                        topics.insert(channel["id"].as_u64().unwrap(), channel["topic"].as_str().unwrap().to_string());
                    }
                    let others: Vec<u64> = topics.iter().filter(|(_, t)| *t != "/map").map(|(id, _)| *id).collect();
                    socket.send(subscribe(&others)).unwrap();
                }
            }
            Message::Binary(data) if data[0] == 1 => {
                let id = u64::from(u32::from_le_bytes(data[1..5].try_into().unwrap()));
                // The rounds aside have long begun.
                if !asked && u64::from_le_bytes(data[5..13].try_into().unwrap()) > map_from {
                    let map: Vec<u64> = topics.iter().filter(|(_, t)| *t == "/map").map(|(id, _)| *id).collect();
                    socket.send(subscribe(&map)).unwrap();
                    asked = true;
                }
                seen.insert(topics[&id].clone());
                if topics[&id] == "/map" {
                    let update = SceneUpdate::decode(&data[13..]).unwrap();
                    patches.extend(update.entities.into_iter().map(|entity| {
                        let indices = entity.triangles.iter().map(|t| t.indices.len()).sum::<usize>();
                        (entity.id, indices / 3)
                    }));
                }
            }
            _ => {}
        }
    }
    let expected = ["/camera/image", "/camera/pose", "/map", "/tf", "/trajectory"];
    assert!(expected.iter().all(|topic| seen.contains(*topic)), "{seen:?}");
    drop(socket);
    assert!(run.wait().unwrap().success());
    rest.join().unwrap();
    // To the end: what the viewer has is the mesh.
    let report: serde_json::Value =
        serde_json::from_slice(&std::fs::read(s.0.join("out/report.json")).unwrap()).unwrap();
    assert_eq!(report["triangles"].as_u64().unwrap() as usize, patches.values().sum::<usize>(), "{patches:?}");
}

/// Subscriptions with the numbers of their channels.
fn subscribe(channels: &[u64]) -> Message {
    let subscriptions: Vec<_> = channels.iter().map(|id| serde_json::json!({ "id": id, "channelId": id })).collect();
    Message::text(serde_json::json!({ "op": "subscribe", "subscriptions": subscriptions }).to_string())
}

#[test]
fn an_address_that_is_taken_is_named() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let s = recording("taken");
    let ran = scan(&s, &["--live", &address]);
    assert!(!ran.ok);
    ran.says(&["--live", &address, "choose another address or port"]);
}
