//! A running `vr` and a client that speaks as its page does.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::{Message, WebSocket};

/// A running server; ended if a test fails.
pub(crate) struct Server {
    pub(crate) child: Child,
    pub(crate) address: String,
    pub(crate) query: String,
}

impl Server {
    pub(crate) fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_vr"))
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let (address, query) = line.trim().trim_start_matches("http://").split_once('/').unwrap();
        Self { child, address: address.into(), query: query.into() }
    }

    /// The status line of a request.
    pub(crate) fn get(&self, path: &str, headers: &str) -> String {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        // A connection that becomes a session, though it should not, stays open.
        stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        let host = if headers.contains("Host:") { String::new() } else { format!("Host: {}\r\n", self.address) };
        stream.write_all(format!("GET {path} HTTP/1.1\r\n{host}{headers}\r\n").as_bytes()).unwrap();
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).lines().next().unwrap_or("").to_owned()
    }

    pub(crate) fn connect(&self, key: &str) -> Result<Client, String> {
        let stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        let address =
            format!("ws://{}/session{}&key={key}", self.address, if self.query.is_empty() { "?" } else { &self.query });
        let (socket, _) = tungstenite::client(&address, stream).map_err(|error| error.to_string())?;
        let mut client = Client { socket, key: String::new(), next: 0 };
        let welcome = match client.socket.read().unwrap() {
            Message::Close(why) => {
                return Err(why.map_or_else(String::new, |why| format!("{} {}", why.code, why.reason)));
            }
            message => serde_json::from_str::<Value>(message.to_text().unwrap()).unwrap(),
        };
        client.key = welcome["key"].as_str().unwrap().into();
        client.next = welcome["next_sequence"].as_u64().unwrap();
        Ok(client)
    }

    /// Its exit code; `None` if it does not end within a minute.
    pub(crate) fn finish(mut self) -> Option<i32> {
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_mins(1) {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status.code();
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        None
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
    }
}

#[derive(Debug)]
pub(crate) struct Client {
    pub(crate) socket: WebSocket<TcpStream>,
    pub(crate) key: String,
    pub(crate) next: u64,
}

impl Client {
    /// The next message of a type.
    pub(crate) fn until(&mut self, kind: &str) -> Value {
        loop {
            if let Message::Text(text) = self.socket.read().unwrap() {
                let message: Value = serde_json::from_str(&text).unwrap();
                if message["type"] == kind {
                    return message;
                }
            }
        }
    }

    /// Ends the session; the last words.
    pub(crate) fn end(&mut self, sequence: u64) -> Value {
        let end = json!({"events": [{"command": {"sequence": sequence, "command": {"do": "end"}}}]});
        self.socket.send(Message::text(end.to_string())).unwrap();
        self.ended()
    }

    /// The last words: where the results are.
    pub(crate) fn ended(&mut self) -> Value {
        loop {
            let notice = self.until("notice")["notice"].take();
            if notice["type"] == "ended" {
                return notice;
            }
        }
    }

    pub(crate) fn send(&mut self, events: &[Value]) -> u64 {
        self.socket.send(Message::text(json!({ "events": events }).to_string())).unwrap();
        self.until("ack")["next_sequence"].as_u64().unwrap()
    }

    /// States of a gun before the wall, in the order of `sequence`; they paint between 10 and 40.
    pub(crate) fn states(from: u64, to: u64) -> Vec<Value> {
        let mode = |k| if (10..40).contains(&k) { "painting" } else { "idle" };
        (from..to).map(|k| Self::state(k, mode(k), [0.2 - 0.005 * k as f64, 2.2], (0, 4e-7))).collect()
    }

    /// A gun 10 cm before the wall, at `y` and `z`.
    pub(crate) fn state(k: u64, mode: &str, [y, z]: [f64; 2], (colour, flow): (u8, f64)) -> Value {
        json!({"state": {"version": 1, "sequence": k, "time": k as f64 / 90.0, "mode": mode,
            "nozzle": {"translation": [-0.1, y, z], "rotation": [0.0, 0.0, 0.0, 1.0]},
            "cradle": {"position": [-1.0, 0.0, 2.2], "heading": 0.0}, "colour": colour, "flow": flow}})
    }
}
