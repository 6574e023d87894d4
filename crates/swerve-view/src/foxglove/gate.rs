//! Gate in front of a viewer's server: checks the origin, forwards both directions, and counts the data that the viewer
//! has read.

use std::io::{self, BufRead as _, BufReader, BufWriter, Read, Write, copy};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::http::{Answer, fields, head_length, read_whole};

/// Subprotocol name used by older programs; the messages used here are the same.
const OLD_NAME: &str = "foxglove.websocket.v1";
/// Current subprotocol name.
const NAME: &str = "foxglove.sdk.v1";

/// Data read by the viewer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Taken {
    /// Number of binary messages: topics and times.
    pub(super) messages: u64,
    /// Bytes of these messages.
    pub(super) bytes: u64,
    /// Number of pongs in response to its pings.
    pub(super) pongs: u64,
    /// True once it has disconnected.
    pub(super) is_gone: bool,
}

/// Shared counter of the data read by the viewer.
#[derive(Debug, Default)]
pub(super) struct Count {
    taken: Mutex<Taken>,
    changed: Condvar,
}

impl Count {
    fn lock(&self) -> MutexGuard<'_, Taken> {
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Taken)) {
        change(&mut self.lock());
        self.changed.notify_all();
    }

    /// Marks the viewer as disconnected.
    pub(super) fn close(&self) {
        self.change(|taken| taken.is_gone = true);
    }

    /// Waits while the viewer is connected and `not_yet` holds, at most for `wait`.
    pub(super) fn wait_while(&self, not_yet: impl Fn(&Taken) -> bool, wait: Duration) -> Taken {
        let waits = |taken: &mut Taken| !taken.is_gone && not_yet(taken);
        *self.changed.wait_timeout_while(self.lock(), wait, waits).unwrap_or_else(PoisonError::into_inner).0
    }

    /// Waits until the viewer has read the pongs to this many pings, or has disconnected.
    fn wait_answered(&self, pings: u64) -> Taken {
        let waits = |taken: &mut Taken| !taken.is_gone && taken.pongs < pings;
        *self.changed.wait_while(self.lock(), waits).unwrap_or_else(PoisonError::into_inner)
    }
}

/// A viewer's connection request.
pub(super) struct Knock {
    viewer: TcpStream,
    request: Vec<u8>,
    by_old_name: bool,
}

impl Knock {
    /// Admits a viewer by its request, or answers with a refusal.
    pub(super) fn admit(viewer: TcpStream, request: Vec<u8>) -> Option<Self> {
        match admit(request) {
            Ok((request, by_old_name)) => Some(Self { viewer, request, by_old_name }),
            Err(refusal) => {
                crate::http::answer(&viewer, &refusal);
                None
            }
        }
    }

    /// Connects the viewer to its server and forwards messages until either disconnects.
    pub(super) fn lead_to(mut self, server: SocketAddr, count: &Count) -> io::Result<()> {
        let mut server = TcpStream::connect(server)?;
        server.set_nodelay(true)?;
        server.write_all(&self.request)?;
        let answer = read_whole(&server).map_err(|_| io::ErrorKind::InvalidData)?;
        let (head, begun) = answer.split_at(head_length(&answer).unwrap_or(answer.len()));
        let text = String::from_utf8_lossy(head);
        let named = if self.by_old_name { text.replace(NAME, OLD_NAME) } else { text.into_owned() };
        self.viewer.write_all(named.as_bytes())?;
        if !named.starts_with("HTTP/1.1 101 ") {
            self.viewer.write_all(begun)?;
            copy(&mut server, &mut self.viewer)?;
            return Ok(());
        }
        for stream in [&self.viewer, &server] {
            stream.set_nodelay(true)?;
            stream.set_read_timeout(None)?;
            stream.set_write_timeout(None)?;
        }
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let _ended = pass_requests(&self.viewer, &server, count);
                count.close();
                hang_up(&self.viewer, &server);
            });
            let ended = pass_frames(begun.chain(&server), &self.viewer, count);
            hang_up(&self.viewer, &server);
            ended
        })
    }
}

fn hang_up(viewer: &TcpStream, server: &TcpStream) {
    for stream in [viewer, server] {
        let _has_gone = stream.shutdown(Shutdown::Both);
    }
}

/// Request for the server, and true if the protocol had its old name.
fn admit(request: Vec<u8>) -> Result<(Vec<u8>, bool), Answer> {
    let text = String::from_utf8_lossy(&request);
    let head = text.split("\r\n\r\n").next().unwrap_or_default();
    let origins = fields(head, "origin");
    if origins.iter().any(|origin| !may_look(origin)) {
        return Err(Answer::refusal("403 Forbidden", "another site's page asks"));
    }
    let offered = fields(head, "sec-websocket-protocol").join(",");
    let offered: Vec<&str> = offered.split(',').map(str::trim).collect();
    let by_old_name = offered.contains(&OLD_NAME) && !offered.contains(&NAME);
    let renamed = by_old_name.then(|| text.replace(OLD_NAME, NAME).into_bytes());
    Ok((renamed.unwrap_or(request), by_old_name))
}

/// True if a page of this origin may connect: the Foxglove app, or a program on this machine. Otherwise the page of any
/// site could connect through the browser that shows it. Without an origin the client is not a browser.
fn may_look(origin: &str) -> bool {
    let Some((scheme, place)) = origin.split_once("://") else { return false };
    let host = match place.strip_prefix('[') {
        Some(v6) => v6.split(']').next(),
        None => place.split(':').next(),
    };
    let host = host.unwrap_or_default();
    let is_foxglove = scheme == "https" && (host == "foxglove.dev" || host.ends_with(".foxglove.dev"));
    let is_here = matches!(host, "localhost" | "127.0.0.1" | "::1");
    is_foxglove || is_here || !matches!(scheme, "http" | "https")
}

/// Opcodes of frames that are counted.
const BINARY: u8 = 2;
const PING: u8 = 9;
const PONG: u8 = 10;

/// Maximum size of a viewer's message, bytes: a subscription to ten thousand topics.
const REQUEST_BYTES_MAX: u64 = 1 << 20;

/// Head of a WebSocket frame (RFC 6455, section 5.2), including the mask of a client's frame.
struct FrameHead {
    bytes: [u8; 14],
    len: usize,
    /// Length of the payload, bytes.
    payload: u64,
}

impl FrameHead {
    fn read(mut from: impl Read) -> io::Result<Self> {
        let mut bytes = [0; 14];
        from.read_exact(&mut bytes[..2])?;
        let short = bytes[1] & 0x7f;
        let end = match short {
            126 => 4,
            127 => 10,
            _ => 2,
        };
        let mask = if bytes[1] & 0x80 == 0 { 0 } else { 4 };
        let len = end + mask;
        from.read_exact(&mut bytes[2..len])?;
        let long = bytes[2..end].iter().fold(0, |length, byte| length << 8 | u64::from(*byte));
        Ok(Self { bytes, len, payload: if end == 2 { u64::from(short) } else { long } })
    }

    fn kind(&self) -> u8 {
        self.bytes[0] & 0x0f
    }

    fn is_control(&self) -> bool {
        self.bytes[0] & 0x08 != 0
    }

    fn is_final(&self) -> bool {
        self.bytes[0] & 0x80 != 0
    }

    /// Forwards the frame.
    fn pass(&self, from: &mut impl Read, to: &mut impl Write) -> io::Result<()> {
        to.write_all(&self.bytes[..self.len])?;
        if copy(&mut from.take(self.payload), to)? < self.payload {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        Ok(())
    }
}

/// Forwards a server's frames and counts those read by the viewer's connection.
fn pass_frames(from: impl Read, to: impl Write, count: &Count) -> io::Result<()> {
    let (mut from, mut to) = (BufReader::with_capacity(1 << 16, from), BufWriter::with_capacity(1 << 16, to));
    while !from.fill_buf()?.is_empty() {
        let head = FrameHead::read(&mut from)?;
        head.pass(&mut from, &mut to)?;
        if from.buffer().is_empty() {
            to.flush()?;
        }
        match head.kind() {
            BINARY => count.change(|taken| {
                taken.messages += 1;
                taken.bytes += head.payload;
            }),
            PONG => count.change(|taken| taken.pongs += 1),
            _ => {}
        }
    }
    Ok(())
}

/// Forwards a viewer's frames. The server keeps each answer until the viewer reads it, so a ping is forwarded only once
/// the previous answer was read: no further frames are read from a viewer that never reads.
fn pass_requests(from: impl Read, mut to: impl Write, count: &Count) -> io::Result<()> {
    let mut from = BufReader::new(from);
    let (mut pings, mut message_bytes) = (0, 0_u64);
    while !from.fill_buf()?.is_empty() {
        let head = FrameHead::read(&mut from)?;
        if !head.is_control() {
            message_bytes = message_bytes.saturating_add(head.payload);
        }
        let payload = if head.is_control() { head.payload } else { message_bytes };
        if payload > REQUEST_BYTES_MAX {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "a message of a viewer is too long"));
        }
        if !head.is_control() && head.is_final() {
            message_bytes = 0;
        }
        if head.kind() == PING {
            if count.wait_answered(pings).is_gone {
                return Ok(());
            }
            pings += 1;
        }
        head.pass(&mut from, &mut to)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_of_other_sites_are_refused() {
        for (origin, may) in [
            ("https://app.foxglove.dev", true),
            ("http://localhost:8080", true),
            ("http://[::1]:8080", true),
            ("file://", true),
            ("https://evil.example", false),
            ("https://notfoxglove.dev", false),
            ("http://localhost.evil.example", false),
            ("http://app.foxglove.dev", false),
            ("null", false),
        ] {
            assert_eq!(may_look(origin), may, "{origin:?}");
        }
    }

    #[test]
    fn frames_pass_unchanged_and_binary_ones_are_counted() {
        let lengths: [usize; 5] = [0, 125, 126, 65_535, 70_000];
        let mut sent = Vec::new();
        for (k, length) in lengths.into_iter().enumerate() {
            for opcode in [1_u8, 2] {
                sent.push(0x80 | opcode);
                match length {
                    0..126 => sent.push(length as u8),
                    126..65_536 => sent.extend([&[126][..], &(length as u16).to_be_bytes()].concat()),
                    _ => sent.extend([&[127][..], &(length as u64).to_be_bytes()].concat()),
                }
                sent.resize(sent.len() + length, k as u8);
            }
        }
        let (count, mut came) = (Count::default(), Vec::new());
        pass_frames(&sent[..], &mut came, &count).unwrap();
        assert!(came == sent);
        let bytes = lengths.iter().sum::<usize>() as u64;
        assert_eq!(*count.lock(), Taken { messages: 5, bytes, pongs: 0, is_gone: false });
        assert!(pass_frames(&sent[..sent.len() - 1], &mut Vec::new(), &count).is_err());
    }

    /// A client's frame with a zero mask.
    fn request(kind: u8, length: usize) -> Vec<u8> {
        let mut frame = vec![0x80 | kind, 0x80 | 127];
        frame.extend((length as u64).to_be_bytes());
        frame.resize(frame.len() + 4 + length, 0);
        frame
    }

    #[test]
    fn ping_is_forwarded_once_the_previous_answer_was_read() {
        let sent = request(PING, 100).repeat(1000);
        let count = Count::default();
        let passed = Mutex::new(Vec::new());
        let at_most = |pings: usize| {
            let wait = || passed.lock().unwrap().len() < pings * sent.len() / 1000;
            while wait() {
                std::thread::yield_now();
            }
            std::thread::park_timeout(Duration::from_millis(20));
            assert_eq!(passed.lock().unwrap().len(), pings * sent.len() / 1000);
        };
        struct To<'a>(&'a Mutex<Vec<u8>>);
        impl Write for To<'_> {
            fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
                self.0.lock().unwrap().write(bytes)
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        std::thread::scope(|scope| {
            let passing = scope.spawn(|| pass_requests(&sent[..], To(&passed), &count));
            at_most(1);
            count.change(|taken| taken.pongs += 1);
            at_most(2);
            count.close();
            passing.join().unwrap().unwrap();
        });
        assert_eq!(passed.into_inner().unwrap(), sent[..2 * sent.len() / 1000]);
    }

    #[test]
    fn request_beyond_the_bound_is_refused_whole_or_in_pieces() {
        const TEXT: u8 = 1;
        let count = Count::default();
        let bound = REQUEST_BYTES_MAX as usize;
        pass_requests(&request(TEXT, bound).repeat(3)[..], io::sink(), &count).unwrap();
        pass_requests(&request(TEXT, bound + 1)[..], io::sink(), &count).unwrap_err();
        let mut pieces = request(TEXT, bound / 2);
        pieces[0] &= 0x7f;
        let next = request(0, bound / 2 + 1);
        pass_requests(&[&pieces[..], &next].concat()[..], io::sink(), &count).unwrap_err();
    }
}
