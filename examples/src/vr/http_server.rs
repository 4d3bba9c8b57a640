//! The HTTP side: one request per connection, which gets a file of the page or becomes a WebSocket.
//!
//! `httparse` and `tungstenite` do the protocol; the rest is here and not in `tiny_http` (0.12), which gives every connection a thread
//! without a bound and waits for a head without a limit of time: strangers could shut out the owner of the token.

use std::io::{Read, Write};
use std::net::{IpAddr, TcpStream};
use std::time::{Duration, Instant};

use tungstenite::handshake::derive_accept_key;

use super::client_lease::same;
use super::page_kind::PageKind;
use super::web_files::web_file;

/// Longest head of a request, bytes.
const LONGEST_HEAD: usize = 8192;
/// Most headers of a request.
const MOST_HEADERS: usize = 64;
/// Time that a client has for its head.
const HEAD_TIME: Duration = Duration::from_secs(5);

/// Who is let in.
pub(super) struct HttpServer {
    /// Needed in every request where the program can be reached from elsewhere.
    pub(super) token: Option<String>,
    /// Whose files are served.
    pub(super) page: PageKind,
}

/// What a connection is.
pub(super) enum HttpOutcome {
    /// It has been answered.
    Answered,
    /// It was refused.
    Refused,
    /// It asks for the session.
    Session {
        /// Bytes that came after the head.
        rest: Vec<u8>,
        /// What to answer when it is let in.
        answer: String,
        /// The key of a session to come back to.
        key: Option<String>,
    },
}

/// A request as far as it matters.
struct Request {
    path: String,
    query: String,
    host: String,
    origin: Option<String>,
    websocket_key: Option<String>,
}

impl HttpServer {
    /// Reads the head and answers it, but for the last word of a WebSocket's handshake.
    pub(super) fn open(&self, stream: &mut TcpStream) -> std::io::Result<HttpOutcome> {
        let Some((request, rest)) = read_request(stream)? else {
            return refuse(stream, "400 Bad Request", "This is not a request that is understood here.");
        };
        // A name that an attacker lets point here must not open the session to the attacker's page.
        if self.token.is_none() && !is_loopback_name(&request.host) {
            return refuse(
                stream,
                "403 Forbidden",
                "Only 127.0.0.1 and localhost are served; see vr --help about --listen.",
            );
        }
        if request.origin.as_ref().is_some_and(|origin| !origin_is(origin, &request.host)) {
            return refuse(stream, "403 Forbidden", "This session belongs to its own page.");
        }
        // Scripts and styles hold no secret; the page and the session need the token.
        let secret = matches!(request.path.as_str(), "/" | "/session");
        let shown = parameter(&request.query, "token").unwrap_or_default();
        if secret && self.token.as_ref().is_some_and(|token| !same(&shown, token)) {
            return refuse(
                stream,
                "403 Forbidden",
                "The token is missing or wrong: use the address that vr has printed.",
            );
        }
        if request.path == "/session" {
            let Some(key) = request.websocket_key else {
                return refuse(stream, "426 Upgrade Required", "This address speaks WebSocket.");
            };
            let accept = derive_accept_key(key.as_bytes());
            let answer = format!(
                "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: {accept}\r\n\r\n"
            );
            return Ok(HttpOutcome::Session { rest, answer, key: parameter(&request.query, "key") });
        }
        match web_file(&request.path, self.page) {
            Some(file) => answer(stream, "200 OK", file.kind, file.bytes)?,
            None => answer(stream, "404 Not Found", "text/plain", b"There is nothing here.")?,
        }
        Ok(HttpOutcome::Answered)
    }
}

/// Answers with an error.
pub(super) fn refuse(stream: &mut TcpStream, status: &str, why: &str) -> std::io::Result<HttpOutcome> {
    answer(stream, status, "text/plain; charset=utf-8", why.as_bytes())?;
    Ok(HttpOutcome::Refused)
}

fn answer(stream: &mut TcpStream, status: &str, kind: &str, body: &[u8]) -> std::io::Result<()> {
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nConnection: close\r\nCache-Control: no-store\r\n\
         X-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\nContent-Security-Policy: default-src 'self'; \
         connect-src 'self' ws: wss:; img-src 'self' blob: data:; frame-ancestors 'none'\r\n\r\n",
        body.len()
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(body)?;
    stream.flush()
}

fn read_request(stream: &mut TcpStream) -> std::io::Result<Option<(Request, Vec<u8>)>> {
    stream.set_read_timeout(Some(HEAD_TIME))?;
    let begun = Instant::now();
    let mut bytes = Vec::new();
    let mut chunk = [0; 1024];
    while bytes.len() < LONGEST_HEAD && begun.elapsed() < HEAD_TIME {
        let count = stream.read(&mut chunk)?;
        if count == 0 {
            return Ok(None);
        }
        bytes.extend_from_slice(&chunk[..count]);
        let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
        let mut head = httparse::Request::new(&mut headers);
        match head.parse(&bytes) {
            Ok(httparse::Status::Complete(length)) => {
                let request = request_of(&head);
                return Ok(request.map(|request| (request, bytes[length..].to_vec())));
            }
            Ok(httparse::Status::Partial) => {}
            Err(_) => return Ok(None),
        }
    }
    Ok(None)
}

fn request_of(head: &httparse::Request) -> Option<Request> {
    if head.method != Some("GET") {
        return None;
    }
    let header = |name: &str| {
        let found = head.headers.iter().find(|header| header.name.eq_ignore_ascii_case(name))?;
        std::str::from_utf8(found.value).ok().map(str::to_owned)
    };
    let (path, query) = head.path?.split_once('?').unwrap_or((head.path?, ""));
    Some(Request {
        path: path.into(),
        query: query.into(),
        host: header("host")?,
        origin: header("origin"),
        websocket_key: header("sec-websocket-key"),
    })
}

fn parameter(query: &str, name: &str) -> Option<String> {
    query
        .split('&')
        .filter_map(|pair| pair.split_once('='))
        .find(|(key, _)| *key == name)
        .map(|(_, value)| value.into())
}

/// Whether a `Host` header names this machine's loopback.
fn is_loopback_name(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    };
    let bare = name.trim_start_matches('[').trim_end_matches(']');
    name.eq_ignore_ascii_case("localhost") || bare.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

fn origin_is(origin: &str, host: &str) -> bool {
    let named = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
    named.is_some_and(|named| named.eq_ignore_ascii_case(host))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_of_this_machine_are_loopback() {
        for host in ["localhost", "LocalHost:8090", "127.0.0.1:8090", "127.3.2.1", "[::1]:80", "[::1]"] {
            assert!(is_loopback_name(host), "{host}");
        }
        for host in
            ["evil.example", "127.0.0.1.evil.example:8090", "10.0.0.1:8090", "", "localhost.evil:80", "[::2]:80"]
        {
            assert!(!is_loopback_name(host), "{host}");
        }
    }

    #[test]
    fn an_origin_is_its_host_with_its_port() {
        assert!(origin_is("http://127.0.0.1:8090", "127.0.0.1:8090") && origin_is("https://a.b", "a.b"));
        assert!(!origin_is("http://127.0.0.1:8091", "127.0.0.1:8090") && !origin_is("null", "127.0.0.1"));
    }
}
