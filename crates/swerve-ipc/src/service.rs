//! The one place where services are made. Whoever opens a service first decides how it is (buffers, alignment,
//! overflow), and everybody else has to want the same: with one function for both ends they always do.

use core::fmt::Debug;
#[cfg(test)]
use core::mem::offset_of;
use std::collections::BTreeSet;
use std::fs::{File, OpenOptions, Permissions};
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{
    AllocationStrategy, FileName, LogLevel, Path, SemanticString as _, ServiceName, SignalHandlingMode,
    ZeroCopySend, ipc_threadsafe, set_log_level,
};
use iceoryx2::sample::Sample;
use iceoryx2::sample_mut::SampleMut;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use rustix::fs::{Access, FallocateFlags, access, fallocate, statvfs};

use crate::IpcError;
use crate::folder::{Address, SHARED_MEMORY, shared_files};

/// Several threads use the ports of one process.
pub(crate) type Ipc = ipc_threadsafe::Service;
pub(crate) type Receiver = Subscriber<Ipc, [u8], Head>;
/// What fills images and clouds is words, so that it lies at the addresses that its numbers need. (An alignment
/// asked of a service of bytes is applied by iceoryx2 0.10 to each single byte, in memory set aside.)
pub(crate) type WordSender = Publisher<Ipc, [u64], Head>;
pub(crate) type WordReceiver = Subscriber<Ipc, [u64], Head>;

/// What messages consist of.
pub(crate) trait Element: ZeroCopySend + Debug + 'static {}

impl Element for u8 {}
impl Element for u64 {}

/// What is before the bytes of every message. The type's name holds a fingerprint of its layout, because
/// iceoryx2 compares names and sizes, and would let two layouts of one size meet.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[type_name("swerve.Head.6a438280d2cb8e77")]
pub(crate) struct Head {
    /// Which message; an answer has that of its call.
    pub(crate) seq: u64,
    /// What it is: [`Kind`] as a number.
    pub(crate) kind: u64,
}

/// The fingerprint in the name of [`Head`]: FNV-1a over its size and where its fields lie.
#[cfg(test)]
const LAYOUT: u64 = {
    let facts = [size_of::<Head>(), offset_of!(Head, seq), 8, offset_of!(Head, kind), 8];
    let (mut hash, mut i) = (0xcbf2_9ce4_8422_2325_u64, 0);
    while i < facts.len() {
        hash = (hash ^ facts[i] as u64).wrapping_mul(0x0000_0100_0000_01b3);
        i += 1;
    }
    hash
};

/// What a message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub(crate) enum Kind {
    /// A step to be taken.
    Call = 1,
    /// What came of it.
    Answer,
    /// A place in shared memory that the call names is not to be had any more.
    Missing,
    /// The call makes no sense; the bytes say why.
    Refused,
    /// What fills an image or a part of a point cloud; the number is that of its place.
    Block,
}

impl Kind {
    pub(crate) fn of(head: &Head) -> Option<Self> {
        [Self::Call, Self::Answer, Self::Missing, Self::Refused, Self::Block]
            .into_iter()
            .find(|kind| *kind as u64 == head.kind)
    }
}

/// True if this user may make files in a folder.
///
/// # Errors
/// Why not, as the system says it.
pub fn writable(folder: &std::path::Path) -> io::Result<()> {
    Ok(access(folder, Access::WRITE_OK | Access::EXEC_OK)?)
}

/// A process's access to the shared memory of a run.
pub(crate) struct Hub {
    node: Node<Ipc>,
    backing: Backing,
}

/// Sees to it that there is memory behind what is shared. The system gives it when it is written to, and kills who
/// writes to what it cannot give (`SIGBUS`); so all is asked for before.
#[derive(Clone, Debug)]
struct Backing {
    /// What the names of the run's files start with.
    prefix: String,
}

/// So much more has to be free than is asked for: what iceoryx2 keeps books in.
const SPARE_BYTES: u64 = 1 << 20;

impl Backing {
    fn files(&self) -> BTreeSet<PathBuf> {
        shared_files(&self.prefix).into_iter().collect()
    }

    /// Makes something for which so many bytes of shared memory are needed, and has the system set them aside.
    fn behind<T>(&self, bytes: u64, make: impl FnOnce() -> Result<T, IpcError>) -> Result<T, IpcError> {
        let refused = |error: String| {
            Err(IpcError::Shared { doing: format!("getting shared memory in {SHARED_MEMORY}"), error })
        };
        let free = statvfs(SHARED_MEMORY).map_or(u64::MAX, |system| system.f_bavail * system.f_frsize);
        let needed = bytes.saturating_add(SPARE_BYTES);
        if needed > free {
            return refused(format!("{free} bytes are free, {needed} would be needed"));
        }
        let before = self.files();
        let made = make()?;
        for file in self.files().difference(&before) {
            // One that is gone already needs nothing.
            let Ok(opened) = OpenOptions::new().write(true).open(file) else { continue };
            // iceoryx2 0.10 makes one file that anybody on the machine may write to.
            close_to_others(&opened).map_err(IpcError::of("closing shared memory to other users"))?;
            let length = opened.metadata().map_or(0, |file| file.len());
            if length > 0
                && let Err(error) = fallocate(&opened, FallocateFlags::empty(), 0, length)
            {
                return refused(format!("{length} bytes at once: {error}"));
            }
        }
        Ok(made)
    }
}

/// Takes all rights from others than the owner of a file.
fn close_to_others(file: &File) -> io::Result<()> {
    let mode = file.metadata()?.permissions().mode();
    file.set_permissions(Permissions::from_mode(mode & 0o700))
}

/// The writing end of a service of messages.
pub(crate) struct Sender {
    publisher: Publisher<Ipc, [u8], Head>,
    backing: Backing,
    /// The longest message for which there is room.
    room: AtomicUsize,
}

/// So many messages of one end there may be at once: being written, waiting, and being read by the one at the other
/// end.
const MESSAGES_MAX: usize = 12;

impl Sender {
    /// Sends a message.
    pub(crate) fn send(&self, seq: u64, kind: Kind, bytes: &[u8]) -> Result<(), IpcError> {
        let fill = || {
            let loan = self.publisher.loan_slice_uninit(bytes.len());
            loan.map_err(IpcError::of("room for a message"))
        };
        let loan = if bytes.len() > self.room.load(Ordering::Relaxed) {
            let room = bytes.len().next_power_of_two();
            let loan = self.backing.behind((MESSAGES_MAX * room) as u64, fill)?;
            self.room.store(room, Ordering::Relaxed);
            loan
        } else {
            fill()?
        };
        let mut message = loan.write_from_slice(bytes);
        *message.user_header_mut() = Head { seq, kind: kind as u64 };
        message.send().map(drop).map_err(IpcError::of("sending a message"))
    }
}

/// How many messages a service holds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Depth {
    /// That a receiver has not taken yet; the oldest goes when there are more.
    pub(crate) waiting: usize,
    /// That a receiver holds at once.
    pub(crate) held: usize,
}

/// For calls and answers: one is on its way at a time, and after a kill one more.
pub(crate) const TALK: Depth = Depth { waiting: 4, held: 4 };

/// At most so many workers read what one sensor writes.
const READERS_MAX: usize = 16;

/// So many words hold so many bytes.
fn words(bytes: usize) -> usize {
    bytes.div_ceil(size_of::<u64>())
}

impl Hub {
    /// Joins a run.
    pub(crate) fn join(address: &Address) -> Result<Self, IpcError> {
        // What it has to say reaches the user through the errors of its calls.
        set_log_level(LogLevel::Fatal);
        let mut config = Config::default();
        config.global.prefix = FileName::new(address.prefix.as_bytes()).map_err(IpcError::of("a prefix"))?;
        let root = address.root.as_os_str().as_encoded_bytes();
        config.global.set_root_path(&Path::new(root).map_err(IpcError::of("a path"))?);
        writable(std::path::Path::new(SHARED_MEMORY)).map_err(|why| IpcError::Shared {
            doing: format!("shared memory in {SHARED_MEMORY}"),
            error: format!("{why}: expected a folder that this user may write to"),
        })?;
        let backing = Backing { prefix: address.prefix.clone() };
        let node = backing.behind(0, || {
            let node = NodeBuilder::new().config(&config);
            let node = node.signal_handling_mode(SignalHandlingMode::Disabled);
            node.create::<Ipc>().map_err(IpcError::of("joining the run's shared memory"))
        })?;
        Ok(Self { node, backing })
    }

    /// The service of this name, made or opened: all its ends come through here.
    fn service<T: Element>(&self, name: &str, depth: Depth) -> Result<PortFactory<Ipc, [T], Head>, IpcError> {
        let doing = || format!("opening service {name}");
        let id = ServiceName::new(name).map_err(IpcError::of(doing()))?;
        self.node
            .service_builder(&id)
            .publish_subscribe::<[T]>()
            .user_header::<Head>()
            // The newest matters, and a sender never waits for a receiver that may be dead.
            .enable_safe_overflow(true)
            .history_size(0)
            .max_publishers(2)
            .max_subscribers(READERS_MAX)
            .max_nodes(READERS_MAX + 2)
            .subscriber_max_buffer_size(depth.waiting)
            .subscriber_max_borrowed_samples(depth.held)
            .open_or_create()
            .map_err(IpcError::of(doing()))
    }

    /// The writing end of a service of messages, of `bytes` at first.
    pub(crate) fn sender(&self, name: &str, depth: Depth, bytes: usize) -> Result<Sender, IpcError> {
        const LOANS: usize = 2;
        let make = || {
            self.service::<u8>(name, depth)?
                .publisher_builder()
                .max_loaned_samples(LOANS)
                .initial_max_slice_len(bytes)
                .allocation_strategy(AllocationStrategy::PowerOfTwo)
                .override_sample_preallocation(|most| most.min(MESSAGES_MAX))
                .create()
                .map_err(IpcError::of(format!("a sender of {name}")))
        };
        let publisher = self.backing.behind((MESSAGES_MAX * bytes) as u64, make)?;
        Ok(Sender { publisher, backing: self.backing.clone(), room: AtomicUsize::new(bytes) })
    }

    /// As [`sender`](Self::sender), for messages of at most `bytes` in memory that never grows: so many of
    /// them may be being written, and so many there are at all.
    pub(crate) fn lending_sender(
        &self,
        name: &str,
        depth: Depth,
        loans: usize,
        rooms: usize,
        bytes: usize,
    ) -> Result<WordSender, IpcError> {
        let make = || {
            self.service::<u64>(name, depth)?
                .publisher_builder()
                .max_loaned_samples(loans)
                .initial_max_slice_len(words(bytes))
                .allocation_strategy(AllocationStrategy::Static)
                .override_sample_preallocation(move |most| most.min(rooms))
                .create()
                .map_err(IpcError::of(format!("a sender of {name}")))
        };
        self.backing.behind((rooms * bytes) as u64, make)
    }

    /// The reading end of a service.
    pub(crate) fn receiver<T: Element>(
        &self,
        name: &str,
        depth: Depth,
    ) -> Result<Subscriber<Ipc, [T], Head>, IpcError> {
        self.backing.behind(0, || {
            let made =
                self.service::<T>(name, depth)?.subscriber_builder().buffer_size(depth.waiting).create();
            made.map_err(IpcError::of(format!("a receiver of {name}")))
        })
    }
}

/// A message that is being written. Several threads may look at it, one at a time writes.
pub(crate) struct Loan(SampleMut<Ipc, [u64], Head>);

/// A message that was received and is kept for a while. Several threads read it.
pub(crate) struct Kept(pub(crate) Sample<Ipc, [u64], Head>);

#[expect(
    unsafe_code,
    reason = "iceoryx2 says that samples may be sent between threads, not that they may be shared"
)]
// SAFETY: all that is done through a shared reference is reading bytes. Nothing else writes them while this lives:
// a loan is its holder's alone. What both types have beside the pointer to them is behind a lock in
// `ipc_threadsafe`, which is what makes them `Send`.
unsafe impl Sync for Loan {}

#[expect(
    unsafe_code,
    reason = "iceoryx2 says that samples may be sent between threads, not that they may be shared"
)]
// SAFETY: as above; a received message has no writer at all until it is given back, when this is dropped.
unsafe impl Sync for Kept {}

impl Loan {
    /// Room for so many bytes and no word more, all zero; none if there is none left.
    pub(crate) fn of(sender: &WordSender, bytes: usize) -> Option<Self> {
        sender.loan_slice(words(bytes)).ok().map(Self)
    }

    pub(crate) fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(self.0.payload())
    }

    pub(crate) fn bytes_mut(&mut self) -> &mut [u8] {
        bytemuck::cast_slice_mut(self.0.payload_mut())
    }

    pub(crate) fn send(mut self, head: Head) -> Result<(), IpcError> {
        *self.0.user_header_mut() = head;
        self.0.send().map(drop).map_err(IpcError::of("sending a message"))
    }
}

impl Kept {
    pub(crate) fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(self.0.payload())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_is_lent_than_there_is() {
        let folder = crate::folder::RunFolder::create().unwrap();
        let hub = Hub::join(&folder.address).unwrap();
        let refused = hub.lending_sender("memory/big", TALK, 2, 1 << 30, 1 << 20).unwrap_err().to_string();
        assert!(refused.contains("would be needed"), "{refused}");
        hub.lending_sender("memory/small", TALK, 2, 4, 1 << 16).unwrap();
    }

    #[test]
    fn no_other_user_reads_or_writes_what_a_run_shares() {
        let folder = crate::folder::RunFolder::create().unwrap();
        let hub = Hub::join(&folder.address).unwrap();
        let _ends = (hub.sender("a", TALK, 100).unwrap(), hub.receiver::<u8>("a", TALK).unwrap());
        let files = shared_files(&folder.address.prefix);
        assert!(files.len() > 2, "{files:?}");
        for file in files {
            let mode = std::fs::metadata(&file).unwrap().permissions().mode();
            assert_eq!(mode & 0o077, 0, "{}: {mode:o}", file.display());
        }
    }

    #[test]
    fn the_name_of_the_header_holds_its_layout() {
        let written = include_str!("service.rs").split("swerve.Head.").nth(1).unwrap().split('"').next();
        assert_eq!(written, Some(format!("{LAYOUT:016x}").as_str()));
    }
}
