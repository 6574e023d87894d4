//! The server: one thread per request with the token, up to a limit.

use std::net::{Ipv4Addr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::Context as _;
use swerve_text::{Problem, from_json};

use crate::drive::Begins;
use crate::http::{Answer, Door, Request, answer};
use crate::reception::receive;
use crate::show::{Ask, Show};

/// Maximum number of simultaneous requests.
const MOST: usize = 32;

pub(crate) struct Server {
    door: Door,
    show: Arc<Show>,
    /// Start parameters of runs, if runs can be started.
    begins: Option<Arc<Begins>>,
    open: AtomicUsize,
}

impl Server {
    /// Starts serving and returns the address.
    pub(crate) fn start(port: u16, show: Arc<Show>, begins: Option<Arc<Begins>>) -> anyhow::Result<String> {
        let taken = || format!("port {port} of 127.0.0.1");
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).with_context(taken)?;
        let host = format!("127.0.0.1:{}", listener.local_addr()?.port());
        // No run depends on these bytes.
        let mut random = [0; 16];
        getrandom::fill(&mut random).map_err(|error| anyhow::anyhow!("a random token: {error}"))?;
        let token = format!("{:032x}", u128::from_le_bytes(random));
        let address = format!("http://{host}/{token}/");
        let door = Door { host, token };
        let server = Arc::new(Self { door, show, begins, open: AtomicUsize::new(0) });
        std::thread::Builder::new().name("view".into()).spawn(move || server.listen(&listener))?;
        Ok(address)
    }

    /// Answers requests. Refusals are short enough to be sent without blocking.
    fn listen(self: &Arc<Self>, listener: &TcpListener) -> std::io::Result<()> {
        receive(listener, |stream, bytes| match self.door.admit(&bytes) {
            Err(refusal) => answer(&stream, &refusal),
            Ok(_) if self.open.load(Ordering::Relaxed) >= MOST => {
                answer(&stream, &Answer::refusal("503 Service Unavailable", "too many requests"));
            }
            Ok(request) => {
                self.open.fetch_add(1, Ordering::Relaxed);
                let server = Arc::clone(self);
                std::thread::spawn(move || {
                    answer(&stream, &server.answer(&request));
                    server.open.fetch_sub(1, Ordering::Relaxed);
                });
            }
        })
    }

    fn answer(&self, request: &Request) -> Answer {
        // A page's request has one line, so line numbers are omitted.
        let bad = |problem: Problem| {
            Answer::refusal("400 Bad Request", Problem { line: None, ..problem }.to_string())
        };
        match (request.is_post, request.path.as_str()) {
            (false, "") => Answer::html(self.show.page()),
            (false, "report") => self.show.whole().map_or_else(not_found, Answer::html),
            (false, "rows") => match from_json("the request", &decoded(&request.query)) {
                Ok(have) => Answer::json(self.show.rows(&have)),
                Err(error) => bad(error),
            },
            (true, "control") => match from_json("the request", &request.body) {
                Ok(ask) => match self.check(&ask).and_then(|()| Ok(self.show.ask(ask)?)) {
                    Ok(()) => Answer::json("{}".into()),
                    Err(why) => Answer::refusal("400 Bad Request", why),
                },
                Err(error) => bad(error),
            },
            _ => not_found(),
        }
    }

    /// Checks that a requested run can be started, so that an invalid setting does not end the current run.
    fn check(&self, ask: &Ask) -> Result<(), String> {
        let (Ask::Restart(with), Some(begins)) = (ask, &self.begins) else { return Ok(()) };
        begins.check(with).map_err(|error| format!("{error:#}"))
    }
}

fn not_found() -> Answer {
    Answer::refusal("404 Not Found", "there is no such page")
}

/// Decodes percent-encoding (RFC 3986, section 2.1).
fn decoded(text: &str) -> String {
    let (mut bytes, mut rest) = (Vec::new(), text.as_bytes());
    while let [first, after @ ..] = rest {
        let code = after.get(..2).filter(|_| *first == b'%').and_then(|two| core::str::from_utf8(two).ok());
        match code.and_then(|two| u8::from_str_radix(two, 16).ok()) {
            Some(byte) => (bytes.push(byte), rest = &after[2..]).1,
            None => (bytes.push(*first), rest = after).1,
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Server's response to a request of its page.
    pub(crate) fn post(show: &Arc<Show>, begins: &Arc<Begins>, body: &str) -> String {
        let door = Door { host: String::new(), token: String::new() };
        let (show, begins) = (Arc::clone(show), Some(Arc::clone(begins)));
        let server = Server { door, show, begins, open: AtomicUsize::new(0) };
        let [path, query] = ["control", ""].map(str::to_owned);
        server.answer(&Request { is_post: true, path, query, body: body.into() }).told()
    }
}
