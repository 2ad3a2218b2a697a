//! The page and its WebSocket. What is served is embedded in the binary: no request reads a file.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use tungstenite::handshake::derive_accept_key;
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Message, WebSocket};

use super::guard::{COOKIE, Credentials, Guard};
use super::hub::{Hub, Seen, ToPage};
use super::messages::FromPage;

/// Path, content type and content of what is served.
const FILES: &[(&str, &str, &str)] = &[
    ("/", "text/html; charset=utf-8", include_str!("../../assets/watch/index.html")),
    ("/style.css", "text/css; charset=utf-8", include_str!("../../assets/watch/style.css")),
    script("/app.js", include_str!("../../assets/watch/app.js")),
    script("/camera.js", include_str!("../../assets/watch/camera.js")),
    script("/input.js", include_str!("../../assets/watch/input.js")),
    script("/inspect.js", include_str!("../../assets/watch/inspect.js")),
    script("/kernel.js", include_str!("../../assets/watch/kernel.js")),
    script("/picture.js", include_str!("../../assets/watch/picture.js")),
    script("/plot.js", include_str!("../../assets/watch/plot.js")),
    script("/report.js", include_str!("../../assets/watch/report.js")),
    script("/state.js", include_str!("../../assets/watch/state.js")),
    script("/view.js", include_str!("../../assets/watch/view.js")),
];

const fn script(path: &'static str, text: &'static str) -> (&'static str, &'static str, &'static str) {
    (path, "text/javascript; charset=utf-8", text)
}

/// Nothing from elsewhere, and no other site may frame the page.
const HEADERS: &str = "Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
    Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; \
    connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\nConnection: close\r\n";

const MOST_CLIENTS: usize = 16;
const MOST_CONNECTIONS: usize = 64;
/// Bytes of a request's head.
const LONGEST_HEAD: usize = 16 << 10;
/// A client that takes no byte for so long is dropped.
const PATIENCE: Duration = Duration::from_secs(5);

/// What is served, and to whom what clients say goes.
pub struct Server {
    /// Who may connect.
    pub guard: Guard,
    /// What is shown.
    pub hub: Arc<Hub>,
    /// Called with what a client says, from that client's thread.
    pub said: Box<dyn Fn(u64, FromPage) + Send + Sync>,
}

/// Answers connections in threads of their own, until the process ends.
pub fn serve(listener: TcpListener, server: Arc<Server>) {
    let connections = Arc::new(AtomicUsize::new(0));
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let Ok(stream) = stream else {
                // Out of file handles, for one: not at full speed.
                std::thread::sleep(Duration::from_millis(100));
                continue;
            };
            let (server, count) = (Arc::clone(&server), Arc::clone(&connections));
            if count.fetch_add(1, Ordering::Relaxed) >= MOST_CONNECTIONS {
                count.fetch_sub(1, Ordering::Relaxed);
                continue;
            }
            std::thread::spawn(move || {
                // A connection that breaks is the client's business.
                let _ = answer(stream, &server);
                count.fetch_sub(1, Ordering::Relaxed);
            });
        }
    });
}

fn answer(mut stream: TcpStream, server: &Server) -> io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    stream.set_nodelay(true)?;
    let head = read_head(&mut stream)?;
    let mut headers = [httparse::EMPTY_HEADER; 64];
    let mut request = httparse::Request::new(&mut headers);
    if !request.parse(&head).is_ok_and(|status| status.is_complete()) {
        return refuse(&mut stream, "400 Bad Request", "not an HTTP request");
    }
    let header = |name: &str| {
        let found = request.headers.iter().find(|h| h.name.eq_ignore_ascii_case(name));
        found.and_then(|h| std::str::from_utf8(h.value).ok())
    };
    let (path, query) = split_query(request.path.unwrap_or_default());
    let from_query = query.split('&').find_map(|pair| pair.strip_prefix("token="));
    let from_cookie = header("cookie")
        .unwrap_or_default()
        .split(';')
        .find_map(|pair| pair.trim().strip_prefix(COOKIE)?.strip_prefix('='));
    let credentials = Credentials { host: header("host"), origin: header("origin"), token: from_query.or(from_cookie) };
    if let Err(reason) = server.guard.check(&credentials, path == "/socket") {
        return refuse(&mut stream, "403 Forbidden", reason);
    }
    if request.method != Some("GET") {
        return refuse(&mut stream, "405 Method Not Allowed", "only GET is answered");
    }
    if path == "/socket" {
        let Some(key) = header("sec-websocket-key") else {
            return refuse(&mut stream, "400 Bad Request", "not a WebSocket");
        };
        write!(
            stream,
            "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
             Sec-WebSocket-Accept: {}\r\n\r\n",
            derive_accept_key(key.as_bytes())
        )?;
        return talk(&stream, server);
    }
    let Some((_, kind, content)) = FILES.iter().find(|(name, _, _)| *name == path) else {
        return refuse(&mut stream, "404 Not Found", "there is nothing of that name");
    };
    let cookie = match (&server.guard.token, from_query) {
        (Some(token), Some(_)) => format!("Set-Cookie: {COOKIE}={token}; HttpOnly; SameSite=Strict; Path=/\r\n"),
        _ => String::new(),
    };
    let length = content.len();
    write!(
        stream,
        "HTTP/1.1 200 OK\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n{cookie}{HEADERS}\r\n{content}"
    )
}

fn split_query(target: &str) -> (&str, &str) {
    target.split_once('?').unwrap_or((target, ""))
}

fn refuse(stream: &mut TcpStream, status: &str, reason: &str) -> io::Result<()> {
    let length = reason.len();
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: text/plain; charset=utf-8\r\nContent-Length: {length}\r\n{HEADERS}\r\n{reason}"
    )
}

/// Up to the empty line; a WebSocket client says nothing before it is answered.
fn read_head(stream: &mut TcpStream) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    let mut part = [0; 2048];
    while !head.windows(4).any(|w| w == b"\r\n\r\n") {
        let count = stream.read(&mut part)?;
        if count == 0 || head.len() + count > LONGEST_HEAD {
            return Err(io::ErrorKind::InvalidData.into());
        }
        head.extend_from_slice(&part[..count]);
    }
    Ok(head)
}

/// The half of a socket that listens: what it would answer by itself (pongs) would fall into what the other half says.
struct Listening(TcpStream);

impl Read for Listening {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.read(buffer)
    }
}

impl Write for Listening {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        Ok(buffer.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn talk(stream: &TcpStream, server: &Server) -> io::Result<()> {
    let Some(client) = server.hub.join(MOST_CLIENTS) else { return Ok(()) };
    // A page may be silent for as long as it likes.
    stream.set_read_timeout(None)?;
    let (listening, speaking) = (stream.try_clone()?, stream.try_clone()?);
    let hub = Arc::clone(&server.hub);
    let speaker = std::thread::spawn(move || {
        let mut socket = WebSocket::from_raw_socket(speaking, Role::Server, None);
        let mut seen = Seen::default();
        while let Some(message) = hub.next(client, &mut seen) {
            let message = match message {
                ToPage::Text(text) => Message::text(text.as_str()),
                ToPage::Binary(bytes) => Message::binary(bytes.as_slice().to_vec()),
            };
            if socket.send(message).is_err() {
                break;
            }
        }
        hub.leave(client);
        let _ = socket.get_ref().shutdown(Shutdown::Both);
    });
    let config = WebSocketConfig::default().max_message_size(Some(64 << 10)).max_frame_size(Some(64 << 10));
    let mut socket = WebSocket::from_raw_socket(Listening(listening), Role::Server, Some(config));
    while let Ok(message) = socket.read() {
        // What is no message of the page's is passed over.
        if let Some(said) = message.to_text().ok().and_then(|text| serde_json::from_str(text).ok()) {
            (server.said)(client, said);
        }
    }
    server.hub.leave(client);
    let _ = stream.shutdown(Shutdown::Both);
    let _ = speaker.join();
    Ok(())
}
