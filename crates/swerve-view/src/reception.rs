//! Reads the requests of a listener's connections in one thread without blocking on any of them.

use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::net::{TcpListener, TcpStream};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::http::{Answer, Incoming, PATIENCE, answer};

/// Maximum number of connections with an incomplete request. Each uses a descriptor and at most [`LONGEST`] bytes.
///
/// [`LONGEST`]: crate::http::LONGEST
const INCOMPLETE_MAX: usize = 256;
/// Number of connections accepted before the others are read again.
const ACCEPTED_MAX: usize = 16;
/// Pause while the process has no free descriptor.
const SCARCE: Duration = Duration::from_millis(100);

/// A connection whose request is incomplete.
struct Connection {
    stream: TcpStream,
    request: Incoming,
    since: Instant,
}

/// Reads requests forever and passes each complete one to `take` with its connection.
///
/// A connection with an incomplete request is closed [`PATIENCE`] after its start, or earlier as the oldest of
/// [`INCOMPLETE_MAX`] when another one is accepted, so that idle connections block nobody.
pub(crate) fn receive(listener: &TcpListener, mut take: impl FnMut(TcpStream, Vec<u8>)) -> io::Result<()> {
    listener.set_nonblocking(true)?;
    let mut connections = VecDeque::new();
    loop {
        let is_readable = wait(listener, &connections);
        connections = read(connections, &is_readable, &mut take);
        accept(listener, &mut connections);
    }
}

#[expect(clippy::disallowed_methods, reason = "clients are waited for in real time")]
fn now() -> Instant {
    Instant::now()
}

/// Waits for a client; returns for each connection true if it is readable.
fn wait(listener: &TcpListener, connections: &VecDeque<Connection>) -> Vec<bool> {
    let mut all: Vec<PollFd<'_>> =
        connections.iter().map(|connection| PollFd::new(&connection.stream, PollFlags::IN)).collect();
    all.push(PollFd::new(listener, PollFlags::IN));
    let left = connections.front().map(|oldest| PATIENCE.saturating_sub(oldest.since.elapsed()));
    let left = left.and_then(|left| Timespec::try_from(left).ok());
    if poll(&mut all, left.as_ref()).is_err() {
        return vec![false; connections.len()]; // interrupted by a signal
    }
    all[..connections.len()].iter().map(|one| !one.revents().is_empty()).collect()
}

/// Reads available data; returns the connections whose requests are still incomplete.
fn read(
    connections: VecDeque<Connection>,
    is_readable: &[bool],
    take: &mut impl FnMut(TcpStream, Vec<u8>),
) -> VecDeque<Connection> {
    let mut incomplete = VecDeque::with_capacity(connections.len());
    for (mut connection, is_readable) in connections.into_iter().zip(is_readable) {
        let has_come = if *is_readable { connection.request.read(&connection.stream) } else { Ok(false) };
        match has_come {
            Ok(true) => take(connection.stream, connection.request.bytes),
            Ok(false) if connection.since.elapsed() < PATIENCE => incomplete.push_back(connection),
            Ok(false) => answer(&connection.stream, &Answer::cut_off()),
            Err(refusal) => answer(&connection.stream, &refusal),
        }
    }
    incomplete
}

/// Accepts some connections, closing the oldest incomplete ones if needed.
fn accept(listener: &TcpListener, connections: &mut VecDeque<Connection>) {
    for accepted in 0..ACCEPTED_MAX {
        match listener.accept() {
            Ok((stream, _)) => {
                connections.push_back(Connection { stream, request: Incoming::default(), since: now() });
                if connections.len() > INCOMPLETE_MAX {
                    connections.pop_front();
                }
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => return,
            // The client has gone or there is no free descriptor: the accepted connections are read first.
            Err(_) if accepted > 0 => return,
            Err(_) if connections.pop_front().is_some() => {}
            Err(_) => {
                let _waited = poll(&mut [], Timespec::try_from(SCARCE).ok().as_ref());
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read as _, Write as _};
    use std::net::SocketAddr;
    use std::sync::mpsc::{Receiver, channel};

    use super::*;

    fn received() -> (SocketAddr, Receiver<Vec<u8>>) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let at = listener.local_addr().unwrap();
        let (sender, requests) = channel();
        std::thread::spawn(move || receive(&listener, |_, request| drop(sender.send(request))));
        (at, requests)
    }

    fn connect(at: SocketAddr) -> TcpStream {
        let stream = TcpStream::connect(at).unwrap();
        stream.set_read_timeout(Some(4 * PATIENCE)).unwrap();
        stream
    }

    #[test]
    fn oldest_idle_connection_is_closed_for_a_new_one() {
        let (at, requests) = received();
        let mut idle: Vec<TcpStream> = (0..INCOMPLETE_MAX).map(|_| connect(at)).collect();
        let mut new = connect(at);
        new.write_all(b"GET / HTTP/1.1\r\n\r\n").unwrap();
        assert_eq!(requests.recv_timeout(2 * PATIENCE).unwrap(), b"GET / HTTP/1.1\r\n\r\n");
        let begun = now();
        assert_eq!(idle[0].read(&mut [0; 64]).unwrap(), 0, "the oldest is closed without an answer");
        assert!(begun.elapsed() < PATIENCE / 2);
        // The youngest one can still send its request.
        idle[INCOMPLETE_MAX - 1].write_all(b"GET /late HTTP/1.1\r\n\r\n").unwrap();
        assert!(requests.recv_timeout(2 * PATIENCE).unwrap().starts_with(b"GET /late"));
    }

    #[test]
    fn slowly_sending_connection_is_closed_in_time() {
        let (at, requests) = received();
        let mut slow = connect(at);
        let begun = now();
        slow.set_read_timeout(Some(PATIENCE / 10)).unwrap();
        let answer = loop {
            let _may_be_closed = slow.write_all(b"G");
            let mut answer = [0; 12];
            match slow.read_exact(&mut answer) {
                Ok(()) => break answer,
                Err(_) => assert!(begun.elapsed() < 2 * PATIENCE, "it is still open"),
            }
        };
        assert_eq!(&answer, b"HTTP/1.1 408");
        assert!(begun.elapsed() > PATIENCE / 2 && requests.try_recv().is_err());
    }
}
