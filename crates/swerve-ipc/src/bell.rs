//! What wakes the process at the other end, and brings it small messages: a pair of connected sockets.
//!
//! One system call rings, one waits, and nothing has to be emptied or switched before or after. The end of a
//! process, however it comes, closes its end: whoever waits at the other is woken by that too. A worker has its end
//! as standard input, behind the setup that came through it.
//!
//! What goes through it is notes: a head of sixteen bytes, and so many bytes as that says.

use core::time::Duration;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::sync::Arc;

use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::net::{RecvFlags, SendFlags, Shutdown, recv, send, shutdown};

use crate::service::{Head, Kind};

/// The longest note, its head included: the system takes it as a whole or not at all.
const NOTE_MAX: usize = 4096;

/// So many bytes stand before what a note says.
pub(crate) const HEAD: usize = 16;

/// One end: rings at the other, and is rung from there.
pub(crate) struct Bell(OwnedFd);

impl Bell {
    /// Both ends. `look_around`: waits at the first one last no longer.
    pub(crate) fn pair(look_around: Duration) -> io::Result<(Self, UnixStream)> {
        let (here, there) = UnixStream::pair()?;
        here.set_read_timeout(Some(look_around))?;
        Ok((Self(here.into()), there))
    }

    /// The end that this process was started with. What is longer than a note can come later than its ring, where
    /// the processes are on two hosts: whoever waits here looks around too.
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
        let _unheard = self.send(&[0; HEAD]);
    }

    /// Rings, and brings what stands in `note` behind room for its head. Says whether it could be sent.
    pub(crate) fn bring(&self, head: Head, note: &mut [u8]) -> bool {
        let Some(said) = note.len().checked_sub(HEAD).and_then(|said| u32::try_from(said).ok()) else {
            return false;
        };
        if note.len() > NOTE_MAX {
            return false;
        }
        note[..4].copy_from_slice(&said.to_le_bytes());
        note[4..8].copy_from_slice(&(head.kind as u32).to_le_bytes());
        note[8..HEAD].copy_from_slice(&head.seq.to_le_bytes());
        self.send(note) == Ok(note.len())
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
pub(crate) enum Heard<'a> {
    /// It rang, for whatever it may be.
    Ring,
    /// A note.
    Note(Head, &'a [u8]),
    /// It was quiet for long enough.
    Nothing,
    /// What came is no note.
    Garbled,
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
    heard: Box<[u8; 2 * NOTE_MAX]>,
    /// What of it was heard and not taken.
    begin: usize,
    end: usize,
}

impl Ear {
    pub(crate) fn at(bell: Arc<Bell>) -> Self {
        Self { bell, heard: Box::new([0; 2 * NOTE_MAX]), begin: 0, end: 0 }
    }

    /// The next that is heard. Rings in a row are one.
    pub(crate) fn listen(&mut self, patience: Patience) -> Heard<'_> {
        let mut rang = false;
        loop {
            match split(&self.heard[self.begin..self.end]) {
                Ok(Some((Head { kind: 0, .. }, _))) => {
                    rang = true;
                    self.begin += HEAD;
                }
                // A note that came behind a ring is heard the next time.
                Ok(_) if rang => return Heard::Ring,
                Ok(Some((head, len))) => {
                    let begin = self.begin + HEAD;
                    self.begin = begin + len;
                    return Heard::Note(head, &self.heard[begin..begin + len]);
                }
                Ok(None) => match self.receive(patience) {
                    Ok(0) => return Heard::Alone,
                    Ok(_) => {}
                    // Should it be interrupted, the waiting one looks around a little early.
                    Err(Errno::INTR | Errno::AGAIN) => return Heard::Nothing,
                    Err(_) => return Heard::Alone,
                },
                Err(Garbled) => return Heard::Garbled,
            }
        }
    }

    /// Takes bytes in; there is always room for the rest of a note.
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

#[derive(Debug, PartialEq, Eq)]
struct Garbled;

/// The head of the first note, and how long what follows is; none while not all of it is there.
fn split(bytes: &[u8]) -> Result<Option<(Head, usize)>, Garbled> {
    let Some((head, rest)) = bytes.split_first_chunk::<HEAD>() else { return Ok(None) };
    let [a, b, c, d, e, f, g, h, seq @ ..] = *head;
    let len = u32::from_le_bytes([a, b, c, d]) as usize;
    let head = Head { seq: u64::from_le_bytes(seq), kind: u64::from(u32::from_le_bytes([e, f, g, h])) };
    let is_ring = head.kind == 0 && len == 0;
    if len > NOTE_MAX - HEAD || !(is_ring || Kind::of(&head).is_some()) {
        return Err(Garbled);
    }
    Ok((rest.len() >= len).then_some((head, len)))
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

    const CALL: Head = Head { seq: 7, kind: Kind::Call as u64 };

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
    fn notes_come_as_they_were_brought_in_whatever_pieces() {
        let [here, mut there] = pair();
        let mut longest = vec![3; NOTE_MAX];
        for n in [0, 1, 100, NOTE_MAX - HEAD] {
            let mut note = vec![5; HEAD + n];
            assert!(here.bell.bring(CALL, &mut note));
            assert!(here.bell.bring(CALL, &mut longest));
            here.bell.ring();
            assert_eq!(there.listen(Patience::AWhile), Heard::Note(CALL, &note[HEAD..]));
            assert_eq!(there.listen(Patience::AWhile), Heard::Note(CALL, &longest[HEAD..]));
            assert_eq!(there.listen(Patience::AWhile), Heard::Ring);
        }
        assert!(!here.bell.bring(CALL, &mut vec![3; NOTE_MAX + 1]));
        assert!(!here.bell.bring(CALL, &mut [3; HEAD - 1]));
        here.bell.bring(CALL, &mut longest);
        for piece in longest.chunks(1000) {
            here.bell.send(piece).unwrap();
        }
        for _ in 0..2 {
            assert_eq!(there.listen(Patience::AWhile), Heard::Note(CALL, &longest[HEAD..]));
        }
        here.bell.send(&[255; HEAD]).unwrap();
        assert_eq!(there.listen(Patience::AWhile), Heard::Garbled);
    }

    /// Many more with `SWERVE_FUZZ=1`.
    fn cases() -> ProptestConfig {
        let cases = if std::env::var_os("SWERVE_FUZZ").is_some() { 100_000 } else { 500 };
        let rng_seed = RngSeed::Fixed(7);
        ProptestConfig { cases, failure_persistence: None, rng_seed, ..ProptestConfig::default() }
    }

    proptest! {
        #![proptest_config(cases())]

        /// Whatever comes through the socket: notes that are no longer than one may be, or that it is none.
        #[test]
        fn what_is_no_note_is_found_out(
            notes in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..50), 1..4),
            noise in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
            cut in 0..300_usize,
        ) {
            let (here, there) = Bell::pair(Duration::from_millis(5)).unwrap();
            let mut bytes = Vec::new();
            for note in &notes {
                bytes.extend_from_slice(&(note.len() as u32).to_le_bytes());
                bytes.extend_from_slice(&(Kind::Answer as u32).to_le_bytes());
                bytes.extend_from_slice(&7_u64.to_le_bytes());
                bytes.extend_from_slice(note);
            }
            for (at, value) in noise {
                let at = at.index(bytes.len());
                bytes[at] = value;
            }
            bytes.truncate(cut);
            here.send(&bytes).unwrap();
            drop(here);
            let mut ear = Ear::at(Arc::new(Bell(there.into())));
            loop {
                match ear.listen(Patience::AWhile) {
                    Heard::Note(_, said) => prop_assert!(said.len() <= NOTE_MAX - HEAD),
                    Heard::Ring => {}
                    Heard::Alone | Heard::Garbled => break,
                    Heard::Nothing => prop_assert!(false, "the other end is closed"),
                }
            }
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
