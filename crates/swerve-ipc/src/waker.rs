//! What wakes the process at the other end: a pair of connected sockets.
//!
//! One system call wakes, one waits, and nothing has to be emptied or switched before or after. The end of a
//! process, however it comes, closes its end: whoever waits at the other is woken by that too. A worker has its end
//! as standard input and output, behind the setup that came through it.
//!
//! What goes through it is words of eight bytes: zero is a wake-up, a number says which start of a worker is ready.

use core::time::Duration;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::sync::Arc;

use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::net::{RecvFlags, SendFlags, Shutdown, recv, send, shutdown};

const WORD: usize = size_of::<u64>();

/// One end: wakes who waits at the other, and is woken from there.
pub(crate) struct Waker(OwnedFd);

impl Waker {
    /// Both ends. `look_around`: waits at the first one last no longer.
    pub(crate) fn pair(look_around: Duration) -> io::Result<(Self, UnixStream)> {
        let (here, there) = UnixStream::pair()?;
        here.set_read_timeout(Some(look_around))?;
        Ok((Self(here.into()), there))
    }

    /// The end that this process was started with. A message can come later than its wake-up, where the processes are
    /// on two hosts: whoever waits here looks around too.
    pub(crate) fn inherited(look_around: Duration) -> io::Result<Self> {
        let here = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
        here.set_read_timeout(Some(look_around))?;
        Ok(Self(here.into()))
    }

    pub(crate) fn socket(&self) -> io::Result<UnixStream> {
        self.0.try_clone().map(UnixStream::from)
    }

    /// Wakes the other end. One that is gone is that of a dead process, of which others take care.
    pub(crate) fn wake(&self) {
        // A full socket has been waking for long. Nothing waits here for a process that does not listen.
        let _unheard = self.send(&[0; WORD]);
    }

    /// Says that this start of a worker, counted from 1, is ready.
    pub(crate) fn ready(&self, start: u64) {
        let _unheard = self.send(&start.to_le_bytes());
    }

    fn send(&self, bytes: &[u8]) -> Result<usize, Errno> {
        send(&self.0, bytes, SendFlags::DONTWAIT | SendFlags::NOSIGNAL)
    }

    /// Waits until the process at the other end is gone, or has closed its end; takes nothing away.
    pub(crate) fn wait_closed(&self) {
        let mut ends = [PollFd::new(&self.0, PollFlags::empty())];
        while poll(&mut ends, None) == Err(Errno::INTR) {}
    }

    /// Tells the other end that nobody is here any more.
    pub(crate) fn close(&self) {
        // A process that is gone already cannot be told.
        let _gone = shutdown(&self.0, Shutdown::Both);
    }
}

/// What came through a [`Waker`].
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Signal {
    /// A wake-up, for whatever it may be.
    Wake,
    /// This start of a worker is ready.
    Ready(u64),
    /// Nothing, for long enough.
    TimedOut,
    /// The process at the other end is gone.
    Closed,
}

/// How long to wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Timeout {
    /// For what came already.
    Zero,
    /// For the read timeout of the socket.
    Set,
}

/// Takes in what comes from the other end of a [`Waker`].
pub(crate) struct Listener {
    pub(crate) waker: Arc<Waker>,
    buffer: [u8; 64 * WORD],
    /// What of it came and was not taken.
    begin: usize,
    end: usize,
}

impl Listener {
    pub(crate) fn at(waker: Arc<Waker>) -> Self {
        Self { waker, buffer: [0; 64 * WORD], begin: 0, end: 0 }
    }

    /// The next signal. Wake-ups in a row are one.
    pub(crate) fn listen(&mut self, timeout: Timeout) -> Signal {
        let mut woken = false;
        loop {
            let word = self.buffer[self.begin..self.end].first_chunk().map(|word| u64::from_le_bytes(*word));
            match word {
                Some(0) => {
                    woken = true;
                    self.begin += WORD;
                }
                // What came behind a wake-up is for the next time.
                _ if woken => return Signal::Wake,
                Some(start) => {
                    self.begin += WORD;
                    return Signal::Ready(start);
                }
                None => match self.receive(timeout) {
                    Ok(0) => return Signal::Closed,
                    Ok(_) => {}
                    // Should it be interrupted, the waiting one looks around a little early.
                    Err(Errno::INTR | Errno::AGAIN) => return Signal::TimedOut,
                    Err(_) => return Signal::Closed,
                },
            }
        }
    }

    /// Takes bytes in; what is left of a word stays before them.
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
    fn it_rings_at_the_other_end_and_says_when_nobody_is_there() {
        let [mut here, mut there] = pair();
        assert_eq!(here.listen(Timeout::Set), Signal::TimedOut, "it does not wait forever");
        // More often than anybody listens.
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
    fn words_come_as_they_were_said_in_whatever_pieces() {
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

    /// Many more with `SWERVE_FUZZ=1`.
    fn cases() -> ProptestConfig {
        let cases = if std::env::var_os("SWERVE_FUZZ").is_some() { 100_000 } else { 500 };
        let rng_seed = RngSeed::Fixed(7);
        ProptestConfig { cases, failure_persistence: None, rng_seed, ..ProptestConfig::default() }
    }

    proptest! {
        #![proptest_config(cases())]

        /// Whatever comes through the socket is rings and numbers, and has an end.
        #[test]
        fn whatever_is_said_is_heard_to_its_end(bytes in prop::collection::vec(0..3_u8, 0..400)) {
            let (here, there) = Waker::pair(Duration::from_millis(5)).unwrap();
            here.send(&bytes).unwrap();
            drop(here);
            let mut listener = Listener::at(Arc::new(Waker(there.into())));
            let words = bytes.len() / WORD + 1;
            let heard = (0..=words).find(|_| listener.listen(Timeout::Set) == Signal::Closed);
            prop_assert!(heard.is_some());
        }

        /// What a worker is told at its start.
        #[test]
        fn what_is_no_setup_is_refused(
            bytes in prop::collection::vec(any::<u8>(), 0..200),
            length in any::<Option<u64>>(),
        ) {
            let length = length.unwrap_or(bytes.len() as u64);
            let framed = [&length.to_le_bytes()[..], &bytes].concat();
            let _either_way = crate::Setup::read(&framed[..]).is_ok();
        }
    }
}
