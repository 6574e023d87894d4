//! Wake-up channel to the process at the other end: a pair of connected sockets.
//!
//! One system call wakes, one waits, and nothing has to be drained or re-armed before or after. When a process ends for
//! any reason, its end closes, which also wakes a process that waits at the other end. A worker's end is its standard
//! input and output, after the setup that it received there.
//!
//! The channel carries words of eight bytes: zero is a wake-up, any other number is the start of a worker that is
//! ready.

use core::time::Duration;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::sync::Arc;

use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::net::{RecvFlags, SendFlags, Shutdown, recv, send, shutdown};

const WORD: usize = size_of::<u64>();

/// One end: wakes the process at the other end, and is woken by it.
pub(crate) struct Waker(OwnedFd);

impl Waker {
    /// Creates both ends. A wait at the first one lasts at most `look_around`.
    pub(crate) fn pair(look_around: Duration) -> io::Result<(Self, UnixStream)> {
        let (here, there) = UnixStream::pair()?;
        here.set_read_timeout(Some(look_around))?;
        Ok((Self(here.into()), there))
    }

    /// The end that this process was started with. Between two hosts a message can arrive after its wake-up, so waits
    /// at this end last at most `look_around` too.
    pub(crate) fn inherited(look_around: Duration) -> io::Result<Self> {
        let here = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
        here.set_read_timeout(Some(look_around))?;
        Ok(Self(here.into()))
    }

    pub(crate) fn socket(&self) -> io::Result<UnixStream> {
        self.0.try_clone().map(UnixStream::from)
    }

    /// Wakes the other end. Without effect if its process is dead, which is detected elsewhere.
    pub(crate) fn wake(&self) {
        // A full socket already holds wake-ups. This process never waits for one that does not listen.
        let _unheard = self.send(&[0; WORD]);
    }

    /// Reports that start `start` of a worker, counted from 1, is ready.
    pub(crate) fn ready(&self, start: u64) {
        let _unheard = self.send(&start.to_le_bytes());
    }

    fn send(&self, bytes: &[u8]) -> Result<usize, Errno> {
        send(&self.0, bytes, SendFlags::DONTWAIT | SendFlags::NOSIGNAL)
    }

    /// Waits until the process at the other end is gone or has closed its end; reads nothing.
    pub(crate) fn wait_closed(&self) {
        let mut ends = [PollFd::new(&self.0, PollFlags::empty())];
        while poll(&mut ends, None) == Err(Errno::INTR) {}
    }

    /// Signals to the other end that this end is closed.
    pub(crate) fn close(&self) {
        // Fails if the other process is already gone.
        let _gone = shutdown(&self.0, Shutdown::Both);
    }
}

/// Signal received through a [`Waker`].
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Signal {
    /// A wake-up, for any reason.
    Wake,
    /// This start of a worker is ready.
    Ready(u64),
    /// No signal within the timeout.
    TimedOut,
    /// The process at the other end is gone, or has closed its end.
    Closed,
}

/// Maximum duration of a wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Timeout {
    /// No wait: only signals that have already arrived.
    Zero,
    /// Read timeout of the socket.
    Set,
}

/// Receiver of signals from the other end of a [`Waker`].
pub(crate) struct Listener {
    pub(crate) waker: Arc<Waker>,
    buffer: [u8; 64 * WORD],
    /// Range of the received bytes that are not yet consumed.
    begin: usize,
    end: usize,
}

impl Listener {
    pub(crate) fn at(waker: Arc<Waker>) -> Self {
        Self { waker, buffer: [0; 64 * WORD], begin: 0, end: 0 }
    }

    /// Returns the next signal. Consecutive wake-ups count as one.
    pub(crate) fn listen(&mut self, timeout: Timeout) -> Signal {
        let mut woken = false;
        loop {
            let word = self.buffer[self.begin..self.end].first_chunk().map(|word| u64::from_le_bytes(*word));
            match word {
                Some(0) => {
                    woken = true;
                    self.begin += WORD;
                }
                // A word after a wake-up is left for the next call.
                _ if woken => return Signal::Wake,
                Some(start) => {
                    self.begin += WORD;
                    return Signal::Ready(start);
                }
                None => match self.receive(timeout) {
                    Ok(0) => return Signal::Closed,
                    Ok(_) => {}
                    // After an interruption the caller polls a little early.
                    Err(Errno::INTR | Errno::AGAIN) => return Signal::TimedOut,
                    Err(_) => return Signal::Closed,
                },
            }
        }
    }

    /// Receives bytes, after the rest of an incomplete word.
    fn receive(&mut self, timeout: Timeout) -> Result<usize, Errno> {
        self.buffer.copy_within(self.begin..self.end, 0);
        (self.begin, self.end) = (0, self.end - self.begin);
        let flags = match timeout {
            Timeout::Zero => RecvFlags::DONTWAIT,
            Timeout::Set => RecvFlags::empty(),
        };
        let (_, received) = recv(&self.waker.0, &mut self.buffer[self.end..], flags)?;
        self.end += received;
        Ok(received)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    use super::*;

    fn pair() -> [Listener; 2] {
        let (here, there) = Waker::pair(Duration::from_millis(5)).unwrap();
        [here, Waker(there.into())].map(|waker| Listener::at(Arc::new(waker)))
    }

    #[test]
    fn waker_wakes_the_other_end_and_detects_when_it_is_closed() {
        let [mut here, mut there] = pair();
        assert_eq!(here.listen(Timeout::Set), Signal::TimedOut, "it does not wait forever");
        // More often than the other end listens.
        (0..10_000).for_each(|_| there.waker.wake());
        here.waker.wake();
        assert_eq!([here.listen(Timeout::Set), there.listen(Timeout::Set)], [Signal::Wake, Signal::Wake]);
        there.waker.close();
        while here.listen(Timeout::Set) == Signal::Wake {}
        assert_eq!(here.listen(Timeout::Set), Signal::Closed);
        here.waker.wait_closed();
        here.waker.wake();
        drop(here);
        assert_eq!(there.listen(Timeout::Set), Signal::Closed);
        there.waker.wait_closed();
    }

    #[test]
    fn listener_reassembles_words_received_in_pieces() {
        let [here, mut there] = pair();
        here.waker.ready(3);
        here.waker.wake();
        here.waker.wake();
        here.waker.ready(258);
        for heard in [Signal::Ready(3), Signal::Wake, Signal::Ready(258), Signal::TimedOut] {
            assert_eq!(there.listen(Timeout::Zero), heard);
        }
        let word = 258_u64.to_le_bytes();
        here.waker.send(&word[..3]).unwrap();
        assert_eq!(there.listen(Timeout::Zero), Signal::TimedOut);
        here.waker.send(&word[3..]).unwrap();
        assert_eq!(there.listen(Timeout::Zero), Signal::Ready(258));
    }

    /// Number of cases: 500, or 100,000 with `SWERVE_FUZZ=1`.
    fn cases() -> ProptestConfig {
        let cases = if std::env::var_os("SWERVE_FUZZ").is_some() { 100_000 } else { 500 };
        let rng_seed = RngSeed::Fixed(7);
        ProptestConfig { cases, failure_persistence: None, rng_seed, ..ProptestConfig::default() }
    }

    proptest! {
        #![proptest_config(cases())]

        /// Any bytes that arrive through the socket are read as wake-ups and numbers, up to the end of the connection.
        #[test]
        fn listener_reads_any_bytes_up_to_their_end(bytes in prop::collection::vec(0..3_u8, 0..400)) {
            let (here, there) = Waker::pair(Duration::from_millis(5)).unwrap();
            here.send(&bytes).unwrap();
            drop(here);
            let mut listener = Listener::at(Arc::new(Waker(there.into())));
            let words = bytes.len() / WORD + 1;
            let heard = (0..=words).find(|_| listener.listen(Timeout::Set) == Signal::Closed);
            prop_assert!(heard.is_some());
        }

        /// Any bytes instead of a worker's setup are read or refused, without a panic.
        #[test]
        fn setup_is_read_or_refused_without_a_panic(
            bytes in prop::collection::vec(any::<u8>(), 0..200),
            length in any::<Option<u64>>(),
        ) {
            let length = length.unwrap_or(bytes.len() as u64);
            let framed = [&length.to_le_bytes()[..], &bytes].concat();
            let _either_way = crate::WorkerSetup::read(&framed[..]).is_ok();
        }
    }
}
