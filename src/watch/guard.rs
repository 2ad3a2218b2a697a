//! Who may speak to the server: the page that it served, from a browser on this machine, or whoever has the token.
//!
//! A page of any other site can make a browser connect to a port of this machine. By its `Origin` it is refused; by `Host`,
//! one whose name was made to mean this machine (DNS rebinding).

use std::net::{IpAddr, SocketAddr};

/// What a request is checked against.
#[derive(Clone, Debug)]
pub struct Guard {
    /// Where the server listens.
    pub address: SocketAddr,
    /// What a request must know, if others than this machine can connect.
    pub token: Option<String>,
}

/// The parts of a request that the guard looks at.
#[derive(Clone, Copy, Debug, Default)]
pub struct Credentials<'a> {
    /// The header `Host`.
    pub host: Option<&'a str>,
    /// The header `Origin`.
    pub origin: Option<&'a str>,
    /// The token from the query or the cookie.
    pub token: Option<&'a str>,
}

/// The cookie that holds the token once a page was opened with it.
pub const COOKIE: &str = "sunfleck_token";

impl Guard {
    /// Whether a request may be answered; `Err` says why not.
    ///
    /// # Errors
    /// The reason, for the answer.
    pub fn check(&self, request: &Credentials<'_>, is_socket: bool) -> Result<(), &'static str> {
        let host = request.host.ok_or("the request has no Host")?;
        if !self.is_own(host) {
            return Err("the Host is not this server");
        }
        let own = |origin: &str| origin.strip_prefix("http://").is_some_and(|name| name.eq_ignore_ascii_case(host));
        match request.origin {
            Some(origin) if !own(origin) => return Err("the Origin is another site"),
            None if is_socket => return Err("the request has no Origin"),
            _ => {}
        }
        match &self.token {
            Some(token) if !request.token.is_some_and(|given| equal(token, given)) => {
                Err("open the address that sunfleck printed: it has a token")
            }
            _ => Ok(()),
        }
    }

    /// Names can be made to mean any address, so only `localhost` is taken, and numbers.
    fn is_own(&self, host: &str) -> bool {
        let (name, port) = match host.rsplit_once(':') {
            Some((name, port)) if !port.ends_with(']') => (name, port.parse().ok()),
            _ => (host, Some(80)),
        };
        if port != Some(self.address.port()) {
            return false;
        }
        if name.eq_ignore_ascii_case("localhost") {
            return true;
        }
        let number = name.strip_prefix('[').and_then(|n| n.strip_suffix(']')).unwrap_or(name);
        match number.parse::<IpAddr>() {
            Ok(ip) if self.address.ip().is_unspecified() || ip.is_loopback() => true,
            Ok(ip) => ip == self.address.ip(),
            Err(_) => false,
        }
    }
}

/// In a time that does not tell how much is right.
fn equal(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |difference, (a, b)| difference | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(guard: &Guard, host: &str, origin: Option<&str>, token: Option<&str>, is_socket: bool) -> bool {
        guard.check(&Credentials { host: Some(host), origin, token }, is_socket).is_ok()
    }

    #[test]
    fn only_the_own_page_is_answered() {
        let guard = Guard { address: "127.0.0.1:8417".parse().unwrap(), token: None };
        for host in ["127.0.0.1:8417", "localhost:8417", "LOCALHOST:8417", "[::1]:8417"] {
            assert!(check(&guard, host, None, None, false), "{host}");
            assert!(check(&guard, host, Some(&format!("http://{host}")), None, true), "{host}");
            assert!(!check(&guard, host, None, None, true), "a socket without Origin");
        }
        for host in
            ["evil.example:8417", "127.0.0.1", "127.0.0.1:80", "localhost.evil.example:8417", "192.168.1.2:8417", ""]
        {
            assert!(!check(&guard, host, None, None, false), "{host}");
        }
        for origin in
            ["http://evil.example", "null", "https://127.0.0.1:8417", "http://127.0.0.1:8418", "http://localhost:8417"]
        {
            assert!(!check(&guard, "127.0.0.1:8417", Some(origin), None, true), "{origin}");
        }
        assert!(guard.check(&Credentials::default(), false).is_err());
    }

    #[test]
    fn beyond_this_machine_the_token_is_needed() {
        let guard = Guard { address: "0.0.0.0:8417".parse().unwrap(), token: Some("secret".to_owned()) };
        assert!(check(&guard, "192.168.1.2:8417", None, Some("secret"), false));
        for token in [None, Some(""), Some("secre"), Some("secrets"), Some("Secret")] {
            assert!(!check(&guard, "192.168.1.2:8417", None, token, false), "{token:?}");
        }
        assert!(!check(&guard, "evil.example:8417", None, Some("secret"), false));
    }
}
