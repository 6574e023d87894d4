//! What wakes the process at the other end: a pair of connected sockets.
//!
//! One system call rings, one waits, and nothing has to be emptied or switched before or after. The end of a
//! process, however it comes, closes its end: whoever waits at the other is woken by that too. A worker has its end
//! as standard input and output, behind the setup that came through it.
//!
//! What goes through it is words of eight bytes: zero is a ring, a number says which start of a worker is ready.

use core::time::Duration;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::sync::Arc;

use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::net::{RecvFlags, SendFlags, Shutdown, recv, send, shutdown};

const WORD: usize = size_of::<u64>();

/// One end: rings at the other, and is rung from there.
pub(crate) struct Bell(OwnedFd);

impl Bell {
    /// Both ends. `look_around`: waits at the first one last no longer.
    pub(crate) fn pair(look_around: Duration) -> io::Result<(Self, UnixStream)> {
        let (here, there) = UnixStream::pair()?;
        here.set_read_timeout(Some(look_around))?;
        Ok((Self(here.into()), there))
    }

    /// The end that this process was started with. A message can come later than its ring, where the processes are
    /// on two hosts: whoever waits here looks around too.
    pub(crate) fn inherited(look_around: Duration) -> io::Result<Self> {
        let here = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
        here.set_read_timeout(Some(look_around))?;
        Ok(Self(here.into()))
    }

    pub(crate) fn socket(&self) -> io::Result<UnixStream> {
        self.0.try_clone().map(UnixStream::from)
    }

    /// Rings. A bell that is gone is that of a dead process, of which others take care.
    pub(crate) fn ring(&self) {
        // A full socket has been ringing for long. Nothing waits here for a process that does not listen.
        let _unheard = self.send(&[0; WORD]);
    }

    /// Says that this start of a worker, counted from 1, is ready.
    pub(crate) fn ready(&self, start: u64) {
        let _unheard = self.send(&start.to_le_bytes());
    }

    fn send(&self, bytes: &[u8]) -> Result<usize, Errno> {
        send(&self.0, bytes, SendFlags::DONTWAIT | SendFlags::NOSIGNAL)
    }

    /// Waits until the process at the other end is gone, or has hung up; takes nothing away.
    pub(crate) fn wait_alone(&self) {
        let mut ends = [PollFd::new(&self.0, PollFlags::empty())];
        while poll(&mut ends, None) == Err(Errno::INTR) {}
    }

    /// Tells the other end that nobody is here any more.
    pub(crate) fn hang_up(&self) {
        // A process that is gone already cannot be told.
        let _gone = shutdown(&self.0, Shutdown::Both);
    }
}

/// What was heard at a bell.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Heard {
    /// It rang, for whatever it may be.
    Ring,
    /// This start of a worker is ready.
    Ready(u64),
    /// It was quiet for long enough.
    Nothing,
    /// The process at the other end is gone.
    Alone,
}

/// How long to listen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Patience {
    /// For what was heard already.
    None,
    /// As the bell was made for.
    AWhile,
}

/// Listens at a bell.
pub(crate) struct Ear {
    pub(crate) bell: Arc<Bell>,
    heard: [u8; 64 * WORD],
    /// What of it was heard and not taken.
    begin: usize,
    end: usize,
}

impl Ear {
    pub(crate) fn at(bell: Arc<Bell>) -> Self {
        Self { bell, heard: [0; 64 * WORD], begin: 0, end: 0 }
    }

    /// The next that is heard. Rings in a row are one.
    pub(crate) fn listen(&mut self, patience: Patience) -> Heard {
        let mut rang = false;
        loop {
            let word = self.heard[self.begin..self.end].first_chunk().map(|word| u64::from_le_bytes(*word));
            match word {
                Some(0) => {
                    rang = true;
                    self.begin += WORD;
                }
                // What came behind a ring is heard the next time.
                _ if rang => return Heard::Ring,
                Some(start) => {
                    self.begin += WORD;
                    return Heard::Ready(start);
                }
                None => match self.receive(patience) {
                    Ok(0) => return Heard::Alone,
                    Ok(_) => {}
                    // Should it be interrupted, the waiting one looks around a little early.
                    Err(Errno::INTR | Errno::AGAIN) => return Heard::Nothing,
                    Err(_) => return Heard::Alone,
                },
            }
        }
    }

    /// Takes bytes in; what is left of a word stays before them.
    fn receive(&mut self, patience: Patience) -> Result<usize, Errno> {
        self.heard.copy_within(self.begin..self.end, 0);
        (self.begin, self.end) = (0, self.end - self.begin);
        let flags = match patience {
            Patience::None => RecvFlags::DONTWAIT,
            Patience::AWhile => RecvFlags::empty(),
        };
        let (_, received) = recv(&self.bell.0, &mut self.heard[self.end..], flags)?;
        self.end += received;
        Ok(received)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    use super::*;

    fn pair() -> [Ear; 2] {
        let (here, there) = Bell::pair(Duration::from_millis(5)).unwrap();
        [here, Bell(there.into())].map(|bell| Ear::at(Arc::new(bell)))
    }

    #[test]
    fn it_rings_at_the_other_end_and_says_when_nobody_is_there() {
        let [mut here, mut there] = pair();
        assert_eq!(here.listen(Patience::AWhile), Heard::Nothing, "it does not wait forever");
        // More often than anybody listens.
        (0..10_000).for_each(|_| there.bell.ring());
        here.bell.ring();
        assert_eq!(
            [here.listen(Patience::AWhile), there.listen(Patience::AWhile)],
            [Heard::Ring, Heard::Ring]
        );
        there.bell.hang_up();
        while here.listen(Patience::AWhile) == Heard::Ring {}
        assert_eq!(here.listen(Patience::AWhile), Heard::Alone);
        here.bell.wait_alone();
        here.bell.ring();
        drop(here);
        assert_eq!(there.listen(Patience::AWhile), Heard::Alone);
        there.bell.wait_alone();
    }

    #[test]
    fn words_come_as_they_were_said_in_whatever_pieces() {
        let [here, mut there] = pair();
        here.bell.ready(3);
        here.bell.ring();
        here.bell.ring();
        here.bell.ready(258);
        for heard in [Heard::Ready(3), Heard::Ring, Heard::Ready(258), Heard::Nothing] {
            assert_eq!(there.listen(Patience::None), heard);
        }
        let word = 258_u64.to_le_bytes();
        here.bell.send(&word[..3]).unwrap();
        assert_eq!(there.listen(Patience::None), Heard::Nothing);
        here.bell.send(&word[3..]).unwrap();
        assert_eq!(there.listen(Patience::None), Heard::Ready(258));
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
            let (here, there) = Bell::pair(Duration::from_millis(5)).unwrap();
            here.send(&bytes).unwrap();
            drop(here);
            let mut ear = Ear::at(Arc::new(Bell(there.into())));
            let words = bytes.len() / WORD + 1;
            let heard = (0..=words).find(|_| ear.listen(Patience::AWhile) == Heard::Alone);
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
