//! Addresses on the command line.

use std::net::{SocketAddr, ToSocketAddrs};

/// Host and port; of a name that has several addresses the first of version 4, which more programs listen on.
///
/// # Errors
/// What the system says of it.
pub fn parse(text: &str) -> Result<SocketAddr, String> {
    let wanted = "give host and port, such as 127.0.0.1:8090 or localhost:8090";
    let found: Vec<SocketAddr> = text.to_socket_addrs().map_err(|error| format!("{error}; {wanted}"))?.collect();
    found.iter().find(|address| address.is_ipv4()).or(found.first()).copied().ok_or_else(|| wanted.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_numbers_are_addresses() {
        assert_eq!(parse("localhost:8090"), Ok(SocketAddr::from(([127, 0, 0, 1], 8090))));
        assert_eq!(parse("0.0.0.0:80"), Ok(SocketAddr::from(([0; 4], 80))));
        assert_eq!(parse("[::1]:80").unwrap().port(), 80);
        for wrong in ["localhost", "8090", "", "127.0.0.1:99999", "[::1]"] {
            assert!(parse(wrong).unwrap_err().contains("host and port"), "{wrong}");
        }
    }
}
