//! Creation of all services. The process that opens a service first sets its properties (buffers, alignment, overflow),
//! and all others must request the same; one function for both ends guarantees that.

use core::fmt::Debug;
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

use rustix::fs::{FallocateFlags, fallocate, statvfs};

use crate::IpcError;
use crate::folder::{Address, shared_files, writable};
use crate::leftovers::SHARED_MEMORY;
use crate::message::{Depth, Head, Kind};

/// Thread-safe service: several threads use the ports of one process.
pub(crate) type Ipc = ipc_threadsafe::Service;
pub(crate) type Receiver = Subscriber<Ipc, [u8], Head>;
/// Sender of image and point cloud data, in words so that the data is aligned for its numbers. (In a service of bytes,
/// iceoryx2 0.10 applies a requested alignment to each single byte of preallocated memory.)
pub(crate) type WordSender = Publisher<Ipc, [u64], Head>;
pub(crate) type WordReceiver = Subscriber<Ipc, [u64], Head>;

/// Element type of messages.
pub(crate) trait Element: ZeroCopySend + Debug + 'static {}

impl Element for u8 {}
impl Element for u64 {}

/// Access of a process to the shared memory of a run.
pub(crate) struct Hub {
    node: Node<Ipc>,
    backing: Backing,
}

/// Reserves the memory behind shared files. The system otherwise allocates it on the first write, and kills a process
/// that writes where it cannot allocate any (`SIGBUS`).
#[derive(Clone, Debug)]
struct Backing {
    /// Prefix of the names of the run's files.
    prefix: String,
}

/// Free bytes required in addition to the request, for the bookkeeping of iceoryx2.
const SPARE_BYTES: u64 = 1 << 20;

impl Backing {
    fn files(&self) -> BTreeSet<PathBuf> {
        shared_files(&self.prefix).into_iter().collect()
    }

    /// Runs `make`, which needs `bytes` of shared memory, and has the system reserve the files that it creates.
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
            // A file that is already gone needs nothing.
            let Ok(opened) = OpenOptions::new().write(true).open(file) else { continue };
            // iceoryx2 0.10 creates one file that every user on the machine may write to.
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

/// Removes the access rights of all users other than the owner of a file.
fn close_to_others(file: &File) -> io::Result<()> {
    let mode = file.metadata()?.permissions().mode();
    file.set_permissions(Permissions::from_mode(mode & 0o700))
}

/// Sending end of a message service.
pub(crate) struct Sender {
    publisher: Publisher<Ipc, [u8], Head>,
    backing: Backing,
    /// Longest message for which memory is reserved, bytes.
    room: AtomicUsize,
}

/// Maximum number of messages of one sender at a time: being written, waiting, and being read by the receiver.
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

/// Maximum number of readers of one service.
const READERS_MAX: usize = 16;

/// Number of words that hold `bytes` bytes.
fn words(bytes: usize) -> usize {
    bytes.div_ceil(size_of::<u64>())
}

impl Hub {
    /// Joins a run.
    pub(crate) fn join(address: &Address) -> Result<Self, IpcError> {
        // Errors of iceoryx2 reach the user through the results of its calls, not through its log.
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

    /// Creates or opens the service of this name. All ends of services are created through this function.
    fn service<T: Element>(&self, name: &str, depth: Depth) -> Result<PortFactory<Ipc, [T], Head>, IpcError> {
        let doing = || format!("opening service {name}");
        let id = ServiceName::new(name).map_err(IpcError::of(doing()))?;
        self.node
            .service_builder(&id)
            .publish_subscribe::<[T]>()
            .user_header::<Head>()
            // The newest message matters, and a sender never waits for a receiver that may be dead.
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

    /// Creates the sending end of a message service, initially for messages of up to `bytes`.
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

    /// As [`sender`](Self::sender), for messages of at most `bytes` in memory that never grows: at most `loans` of them
    /// are being written at a time, and there are at most `rooms` in total.
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

    /// Creates the receiving end of a service.
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

/// Message that is being written. Several threads may read it; writing requires exclusive access.
pub(crate) struct Loan(SampleMut<Ipc, [u64], Head>);

/// Received message that is kept for a while. Several threads may read it.
pub(crate) struct Kept(pub(crate) Sample<Ipc, [u64], Head>);

#[expect(
    unsafe_code,
    reason = "iceoryx2 says that samples may be sent between threads, not that they may be shared"
)]
// SAFETY: through a shared reference, bytes are only read. Nothing else writes them during the lifetime of this value:
// a loan belongs to its holder alone. Apart from the pointer to the bytes, everything in both types is behind a lock in
// `ipc_threadsafe`, which also makes them `Send`.
unsafe impl Sync for Loan {}

#[expect(
    unsafe_code,
    reason = "iceoryx2 says that samples may be sent between threads, not that they may be shared"
)]
// SAFETY: as above; a received message has no writer until it is returned, when this is dropped.
unsafe impl Sync for Kept {}

impl Loan {
    /// Loans zeroed memory for `bytes` bytes, rounded up to a word; `None` if none is left.
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
    use crate::message::TALK;

    #[test]
    fn hub_refuses_to_lend_more_memory_than_is_free() {
        let folder = crate::folder::RunFolder::create().unwrap();
        let hub = Hub::join(&folder.address).unwrap();
        let refused = hub.lending_sender("memory/big", TALK, 2, 1 << 30, 1 << 20).unwrap_err().to_string();
        assert!(refused.contains("would be needed"), "{refused}");
        hub.lending_sender("memory/small", TALK, 2, 4, 1 << 16).unwrap();
    }

    #[test]
    fn shared_files_are_closed_to_other_users() {
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
}
