//! The subset of HTTP/1.1 (RFC 9112) needed by a page shown on this machine only: one request per connection.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

/// Maximum size of a request, bytes, including its body.
pub(crate) const LONGEST: usize = 16 * 1024;
/// Time limit for a client to send its request, and to read a part of the answer.
pub(crate) const PATIENCE: Duration = Duration::from_secs(5);

/// A validated request: it has the token and does not come from a page of another site.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Request {
    /// True for `POST`, false for `GET`.
    pub(crate) is_post: bool,
    /// Path after the token.
    pub(crate) path: String,
    /// Query after `?`.
    pub(crate) query: String,
    /// Body.
    pub(crate) body: String,
}

/// A response.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Answer {
    status: &'static str,
    kind: &'static str,
    body: String,
}

impl Answer {
    pub(crate) fn html(body: String) -> Self {
        Self { status: "200 OK", kind: "text/html; charset=utf-8", body }
    }

    pub(crate) fn json(body: String) -> Self {
        Self { status: "200 OK", kind: "application/json", body }
    }

    /// Status and body.
    #[cfg(test)]
    pub(crate) fn told(&self) -> String {
        format!("{} {}", self.status, self.body)
    }

    pub(crate) fn cut_off() -> Self {
        Self::refusal("408 Request Timeout", "the request was cut off")
    }

    pub(crate) fn refusal(status: &'static str, why: impl Into<String>) -> Self {
        Self { status, kind: "text/plain; charset=utf-8", body: why.into() + "\n" }
    }
}

/// Access control: the address of the page, as `127.0.0.1:PORT`, and the token.
#[derive(Clone, Debug)]
pub(crate) struct Door {
    pub(crate) host: String,
    pub(crate) token: String,
}

impl Door {
    /// Parses a request, or returns the reason for its refusal.
    pub(crate) fn admit(&self, bytes: &[u8]) -> Result<Request, Answer> {
        let bad = || Answer::refusal("400 Bad Request", "expected a request of HTTP/1.1");
        let text = core::str::from_utf8(bytes).map_err(|_| bad())?;
        let (head, body) = text.split_once("\r\n\r\n").ok_or_else(bad)?;
        let (first, _) = head.split_once("\r\n").ok_or_else(bad)?;
        let words: Vec<&str> = first.split(' ').collect();
        let [method, target, "HTTP/1.1"] = words[..] else { return Err(bad()) };
        let fields = |name: &str| fields(head, name);
        if fields("host") != [self.host.as_str()] {
            return Err(Answer::refusal("403 Forbidden", "another host was asked for"));
        }
        let origin = format!("http://{}", self.host);
        if fields("origin").iter().any(|of| *of != origin) {
            return Err(Answer::refusal("403 Forbidden", "another site asks"));
        }
        let is_post = match method {
            "GET" => false,
            // A browser sends the origin with every POST; a client without one is not this server's page.
            "POST" if fields("origin").is_empty() => {
                return Err(Answer::refusal("403 Forbidden", "no origin was given"));
            }
            "POST" => true,
            _ => return Err(Answer::refusal("405 Method Not Allowed", "expected GET or POST")),
        };
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        let inside = path.strip_prefix('/').and_then(|path| path.strip_prefix(self.token.as_str()));
        let Some(path) = inside.and_then(|path| path.strip_prefix('/')) else {
            return Err(Answer::refusal("403 Forbidden", "the address lacks the token"));
        };
        Ok(Request { is_post, path: path.into(), query: query.into(), body: body.into() })
    }
}

/// The received part of a request or response.
#[derive(Debug, Default)]
pub(crate) struct Incoming {
    pub(crate) bytes: Vec<u8>,
    /// Total length, once the head is complete.
    length: Option<usize>,
}

impl Incoming {
    /// Reads once; returns true if it is complete.
    ///
    /// # Errors
    /// If it is too long, or the connection has ended.
    pub(crate) fn read(&mut self, mut from: impl Read) -> Result<bool, Answer> {
        let mut part = [0; 4096];
        let read = match from.read(&mut part) {
            Err(error) if error.kind() == ErrorKind::Interrupted => return Ok(false), // by a signal
            read => read.map_err(|_| Answer::cut_off())?,
        };
        self.bytes.extend_from_slice(&part[..read]);
        self.length = self.length.or_else(|| whole_length(&self.bytes));
        if self.bytes.len() > LONGEST || self.length.is_some_and(|length| length > LONGEST) {
            return Err(Answer::refusal("413 Content Too Large", format!("over {LONGEST} bytes")));
        }
        let is_complete = self.length.is_some_and(|length| self.bytes.len() >= length);
        if read == 0 && !is_complete {
            return Err(Answer::refusal("400 Bad Request", "the request was cut off"));
        }
        Ok(is_complete)
    }
}

/// Reads a whole request or response and any data that arrived with it.
///
/// # Errors
/// Those of [`Incoming::read`], or if nothing arrives for [`PATIENCE`].
pub(crate) fn read_whole(stream: &TcpStream) -> Result<Vec<u8>, Answer> {
    stream.set_read_timeout(Some(PATIENCE)).map_err(|_| Answer::cut_off())?;
    let mut incoming = Incoming::default();
    while !incoming.read(stream)? {}
    Ok(incoming.bytes)
}

/// Length of a complete head, including the empty line after it.
pub(crate) fn head_length(bytes: &[u8]) -> Option<usize> {
    bytes.windows(4).position(|four| four == b"\r\n\r\n").map(|at| at + 4)
}

/// Values of all header fields of this name.
pub(crate) fn fields<'a>(head: &'a str, name: &str) -> Vec<&'a str> {
    let fields = head.split("\r\n").filter_map(|line| line.split_once(':'));
    fields.filter(|(n, _)| n.eq_ignore_ascii_case(name)).map(|(_, v)| v.trim()).collect()
}

/// Total length of a request or response with a complete head.
fn whole_length(bytes: &[u8]) -> Option<usize> {
    let head = head_length(bytes)?;
    let text = String::from_utf8_lossy(&bytes[..head]).to_ascii_lowercase();
    let length = text.lines().find_map(|line| line.strip_prefix("content-length:")?.trim().parse().ok());
    Some(length.unwrap_or(0_usize).saturating_add(head))
}

/// Sends a response and closes the connection; a client that has disconnected is ignored.
pub(crate) fn answer(mut stream: &TcpStream, answer: &Answer) {
    let Answer { status, kind, body } = answer;
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nConnection: close\r\n\
         Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
         Content-Security-Policy: frame-ancestors 'none'\r\n\r\n",
        body.len()
    );
    let _gone = stream
        .set_write_timeout(Some(PATIENCE))
        .and_then(|()| stream.write_all(head.as_bytes()))
        .and_then(|()| stream.write_all(body.as_bytes()));
}

#[cfg(test)]
mod tests {
    use std::net::{Shutdown, TcpListener};

    use super::*;

    /// Status of the response to a request, or the path after the token.
    fn asked(request: &str) -> Result<String, String> {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let mut client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let (server, _) = listener.accept().unwrap();
        client.write_all(request.as_bytes()).unwrap();
        client.shutdown(Shutdown::Write).unwrap();
        let door = Door { host: "127.0.0.1:80".into(), token: "secret".into() };
        let request = read_whole(&server).and_then(|bytes| door.admit(&bytes));
        request.map(|request| request.path + &request.body).map_err(|no| no.status[..3].into())
    }

    #[test]
    fn only_the_servers_page_is_admitted() {
        let host = "Host: 127.0.0.1:80\r\n";
        let own = "Origin: http://127.0.0.1:80\r\n";
        let long = "x".repeat(LONGEST);
        let cases = [
            (format!("GET /secret/rows HTTP/1.1\r\n{host}\r\n"), Ok("rows")),
            (format!("GET /secret/rows HTTP/1.1\r\n{host}{own}\r\n"), Ok("rows")),
            (format!("POST /secret/do HTTP/1.1\r\n{host}{own}Content-Length: 2\r\n\r\n{{}}"), Ok("do{}")),
            (format!("POST /secret/do HTTP/1.1\r\n{host}Content-Length: 2\r\n\r\n{{}}"), Err("403")),
            (format!("POST /secret/do HTTP/1.1\r\n{host}{own}Content-Length: 9\r\n\r\n{{}}"), Err("400")),
            (format!("GET /wrong!/rows HTTP/1.1\r\n{host}\r\n"), Err("403")),
            (format!("GET / HTTP/1.1\r\n{host}\r\n"), Err("403")),
            (format!("GET /secret HTTP/1.1\r\n{host}\r\n"), Err("403")),
            ("GET /secret/ HTTP/1.1\r\nHost: evil.example:80\r\n\r\n".into(), Err("403")),
            ("GET /secret/ HTTP/1.1\r\nHost: localhost:80\r\n\r\n".into(), Err("403")),
            (format!("GET /secret/ HTTP/1.1\r\n{host}{host}\r\n"), Err("403")),
            ("GET /secret/ HTTP/1.1\r\nAccept: *\r\n\r\n".into(), Err("403")),
            (format!("GET /secret/ HTTP/1.1\r\n{host}Origin: http://evil.example\r\n\r\n"), Err("403")),
            (format!("GET /secret/ HTTP/1.1\r\n{host}Origin: null\r\n\r\n"), Err("403")),
            (format!("OPTIONS /secret/ HTTP/1.1\r\n{host}{own}\r\n"), Err("405")),
            (format!("GET /secret/{long} HTTP/1.1\r\n{host}\r\n"), Err("413")),
            (format!("POST /secret/ HTTP/1.1\r\n{host}{own}Content-Length: 99999\r\n\r\n"), Err("413")),
            ("GET /secret/ HTTP/1.1".into(), Err("400")),
            ("nonsense\r\n\r\n".into(), Err("400")),
        ];
        for (request, expected) in cases {
            let expected = expected.map(String::from).map_err(String::from);
            assert_eq!(asked(&request), expected, "{}", &request[..request.len().min(120)]);
        }
    }
}
