//! A client of Foxglove's WebSocket protocol: subscribes to what can be shown.

use std::net::{TcpStream, ToSocketAddrs};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::time::Duration;

use serde::Deserialize;
use serde_json::json;
use tungstenite::client::IntoClientRequest as _;
use tungstenite::error::ProtocolError;
use tungstenite::http::HeaderValue;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Message, WebSocket};

use super::super::error::VrError;
use super::feed::{Feed, FeedMessage, Heard, is_shown};

/// The versions of the protocol that are spoken: what is used of them is the same.
const PROTOCOLS: &str = "foxglove.sdk.v1, foxglove.websocket.v1";
/// Time in which the source must answer.
const PATIENCE: Duration = Duration::from_secs(5);
/// Longest message, bytes: the map of a large building in one piece.
const LONGEST_MESSAGE: usize = 256 << 20;
/// Messages that wait to be shown.
const WAITING: usize = 1024;
/// First byte of a message of a channel, and of a header the length.
const MESSAGE_DATA: u8 = 1;
const HEADER: usize = 13;

/// What the server says in text, as far as it matters.
#[derive(Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
enum ServerText {
    #[serde(rename_all = "camelCase")]
    ServerInfo {
        name: String,
    },
    Advertise {
        channels: Vec<Advertised>,
    },
    Status {
        message: String,
    },
    #[serde(other)]
    Other,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Advertised {
    id: u64,
    topic: String,
    encoding: String,
    schema_name: String,
}

/// The run.
pub(super) struct FoxgloveClient {
    address: String,
    heard: Receiver<Heard>,
    over: bool,
}

impl FoxgloveClient {
    /// Connects to host and port; a thread listens from then on.
    pub(super) fn connect(address: &str) -> Result<Self, VrError> {
        let refuse = |why: String| VrError::Watch { address: address.into(), why };
        let socket = handshake(address).map_err(refuse)?;
        let (said, heard) = sync_channel(WAITING);
        std::thread::spawn(move || {
            let end = hear(socket, &said).unwrap_or_else(|why| format!("the connection to the run is lost: {why}"));
            let _ = said.send(Heard::Over(end));
        });
        Ok(Self { address: address.into(), heard, over: false })
    }
}

impl Feed for FoxgloveClient {
    fn take(&mut self, _: bool) -> Option<Heard> {
        match self.heard.try_recv() {
            Ok(heard) => {
                self.over |= matches!(heard, Heard::Over(_));
                Some(heard)
            }
            Err(TryRecvError::Disconnected) if !self.over => {
                self.over = true;
                Some(Heard::Over("the run is over".into()))
            }
            Err(_) => None,
        }
    }

    fn name(&self) -> String {
        format!("ws://{}", self.address)
    }

    fn elapsed(&self) -> Option<f64> {
        None
    }
}

fn handshake(address: &str) -> Result<WebSocket<TcpStream>, String> {
    let mut error = "the name has no address".to_owned();
    for place in address.to_socket_addrs().map_err(|why| why.to_string())? {
        let stream = match TcpStream::connect_timeout(&place, PATIENCE) {
            Ok(stream) => stream,
            Err(why) => {
                error = why.to_string();
                continue;
            }
        };
        stream.set_read_timeout(Some(PATIENCE)).map_err(|why| why.to_string())?;
        let mut request = format!("ws://{address}").into_client_request().map_err(|why| why.to_string())?;
        request.headers_mut().insert("Sec-WebSocket-Protocol", HeaderValue::from_static(PROTOCOLS));
        let config =
            WebSocketConfig::default().max_message_size(Some(LONGEST_MESSAGE)).max_frame_size(Some(LONGEST_MESSAGE));
        let (socket, _) = tungstenite::client::client_with_config(request, stream, Some(config))
            .map_err(|why| format!("it does not speak Foxglove's protocol ({why})"))?;
        // A run may say nothing for as long as it likes.
        socket.get_ref().set_read_timeout(None).map_err(|why| why.to_string())?;
        return Ok(socket);
    }
    Err(error)
}

/// Listens until the connection ends; how it ended.
fn hear(mut socket: WebSocket<TcpStream>, said: &SyncSender<Heard>) -> Result<String, tungstenite::Error> {
    let mut channels: Vec<Advertised> = Vec::new();
    loop {
        let heard = match socket.read() {
            Ok(Message::Text(text)) => match serde_json::from_str(&text) {
                Ok(ServerText::Advertise { channels: new }) => {
                    let first = channels.len();
                    channels.extend(new.into_iter().filter(|c| c.encoding == "protobuf" && is_shown(&c.schema_name)));
                    let wanted = channels.iter().enumerate().skip(first);
                    let list: Vec<_> = wanted.map(|(id, c)| json!({ "id": id, "channelId": c.id })).collect();
                    socket.send(Message::text(json!({ "op": "subscribe", "subscriptions": list }).to_string()))?;
                    None
                }
                Ok(ServerText::ServerInfo { name }) => Some(Heard::Said(format!("connected to {name}"))),
                Ok(ServerText::Status { message }) => Some(Heard::Said(message)),
                Ok(ServerText::Other) | Err(_) => None,
            },
            Ok(Message::Binary(bytes)) => message_of(&bytes, &channels).map(Heard::Message),
            // Some programs end without a goodbye.
            Ok(Message::Close(_))
            | Err(
                tungstenite::Error::ConnectionClosed
                | tungstenite::Error::Protocol(ProtocolError::ResetWithoutClosingHandshake),
            ) => {
                return Ok("the run is over".into());
            }
            Ok(_) => None,
            Err(error) => return Err(error),
        };
        if heard.is_some_and(|heard| said.send(heard).is_err()) {
            return Ok("nobody watches any more".into());
        }
    }
}

/// Opcode, subscription (u32), time (u64), then the message.
fn message_of(bytes: &[u8], channels: &[Advertised]) -> Option<FeedMessage> {
    let subscription = bytes.get(1..5).filter(|_| bytes[0] == MESSAGE_DATA)?;
    let id = u32::from_le_bytes(subscription.try_into().ok()?);
    let channel = channels.get(id as usize)?;
    let data = bytes.get(HEADER..)?.to_vec();
    Some(FeedMessage { topic: channel.topic.clone(), schema: channel.schema_name.clone(), data })
}
