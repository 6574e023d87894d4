//! Shared memory of a stream: sensors write it, workers read it in place.
//!
//! The sensor, in the coordinator, writes into loans of a service of this stream. A sealed loan is sent to all readers
//! of the stream and to a receiver in the coordinator, which gets the same piece of shared memory: the coordinator's
//! readers, the digest and the log read the same bytes as the workers.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize};
use swerve_msg::block::{Block, BlockId, Memory, Room, Shelf};

use crate::IpcError;
use crate::message::{Depth, Head, Kind};
use crate::service::{Hub, Kept, Loan, WordReceiver, WordSender};

/// Minimum size of a payload in shared memory, bytes; smaller payloads are sent in the message.
const BYTES_MIN: usize = 4096;

/// Memory of one stream, as known at both ends.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct StreamMemory {
    /// Number of the memory.
    pub(crate) memory: u32,
    /// Name of the stream.
    pub(crate) stream: String,
    /// Number of blocks in each message of the stream.
    pub(crate) blocks: usize,
}

impl StreamMemory {
    fn service(&self) -> String {
        format!("memory/{}", self.stream)
    }

    /// Numbers of blocks that may wait for a receiver and that it may hold.
    fn depth(&self) -> Depth {
        const FRAMES_WAITING: usize = 2;
        Depth { waiting: FRAMES_WAITING * self.blocks, held: self.held() + FRAMES_WAITING * self.blocks }
    }

    /// Maximum number of blocks held by the coordinator; beyond it, the sensor writes into unshared memory.
    fn held(&self) -> usize {
        const FRAMES_HELD: usize = 6;
        FRAMES_HELD * self.blocks
    }

    /// Number of newest blocks that a worker keeps for later calls, as far as the coordinator still holds them.
    fn kept(&self) -> usize {
        const FRAMES_KEPT: usize = 4;
        FRAMES_KEPT * self.blocks
    }
}

/// The coordinator's end.
pub(crate) struct Lender {
    of: StreamMemory,
    hub: Arc<Hub>,
    ends: Arc<Mutex<Ends>>,
    live: Arc<Live>,
}

struct Ends {
    /// Created for the first room, which has the largest size in the stream.
    sender: Option<Arc<WordSender>>,
    receiver: WordReceiver,
    seq: u64,
}

impl Lender {
    pub(crate) fn new(hub: Arc<Hub>, of: StreamMemory, live: Arc<Live>) -> Result<Self, IpcError> {
        let receiver = hub.receiver(&of.service(), of.depth())?;
        let ends = Ends { sender: None, receiver, seq: 0 };
        Ok(Self { of, hub, ends: Arc::new(Mutex::new(ends)), live })
    }

    fn sender(&self, bytes: usize) -> Option<Arc<WordSender>> {
        let mut ends = self.ends.lock().unwrap_or_else(PoisonError::into_inner);
        if ends.sender.is_none() {
            let (loans, rooms) = (self.of.held(), self.of.held() + self.of.depth().waiting + self.of.kept());
            let made = self.hub.lending_sender(&self.of.service(), self.of.depth(), loans, rooms, bytes);
            ends.sender = Some(Arc::new(made.ok()?));
        }
        ends.sender.clone()
    }
}

impl Memory for Lender {
    fn room(&self, bytes: usize) -> Option<Box<dyn Room>> {
        if bytes < BYTES_MIN {
            return None;
        }
        let held = Held::one_of(&self.live, self.of.held())?;
        let loan = Loan::of(&*self.sender(bytes)?, bytes)?;
        Some(Box::new(LentRoom { loan, memory: self.of.memory, ends: self.ends.clone(), held }))
    }
}

/// Rooms and blocks of one memory that the coordinator holds.
#[derive(Default)]
pub(crate) struct Live(Mutex<Alive>);

#[derive(Default)]
struct Alive {
    held: usize,
    /// Sequence numbers of the blocks among them.
    seqs: Vec<u64>,
}

impl Live {
    fn alive(&self) -> MutexGuard<'_, Alive> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sequence number of the oldest block that a call may still name; `u64::MAX` if there is none.
    pub(crate) fn oldest(&self) -> u64 {
        self.alive().seqs.iter().copied().min().unwrap_or(u64::MAX)
    }
}

/// Guard that counts one held room or block.
struct Held {
    live: Arc<Live>,
    /// Sequence number, once the room is sealed as a block.
    seq: Option<u64>,
}

impl Held {
    fn one_of(live: &Arc<Live>, most: usize) -> Option<Self> {
        let mut alive = live.alive();
        if alive.held >= most {
            return None;
        }
        alive.held += 1;
        Some(Self { live: live.clone(), seq: None })
    }

    fn sealed(mut self, seq: u64) -> Self {
        self.live.alive().seqs.push(seq);
        self.seq = Some(seq);
        self
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        let mut alive = self.live.alive();
        alive.held -= 1;
        if let Some(at) = self.seq.and_then(|seq| alive.seqs.iter().position(|alive| *alive == seq)) {
            alive.seqs.swap_remove(at);
        }
    }
}

struct LentRoom {
    loan: Loan,
    memory: u32,
    ends: Arc<Mutex<Ends>>,
    held: Held,
}

impl Room for LentRoom {
    fn bytes(&self) -> &[u8] {
        self.loan.bytes()
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        self.loan.bytes_mut()
    }

    fn seal(self: Box<Self>) -> Result<Arc<dyn Block>, String> {
        let Self { loan, memory, ends, held } = *self;
        let mut ends = ends.lock().unwrap_or_else(PoisonError::into_inner);
        ends.seq += 1;
        let place = BlockId { memory, seq: ends.seq };
        loan.send(Head { seq: place.seq, kind: Kind::Block as u64 }).map_err(|error| error.to_string())?;
        loop {
            let received = ends.receiver.receive().map_err(|error| format!("shared memory: {error:?}"))?;
            let Some(received) = received else {
                return Err("shared memory: what was sent did not come".into());
            };
            if received.user_header().seq == place.seq {
                let held = Some(held.sealed(place.seq));
                return Ok(Arc::new(LentBlock { received: Kept(received), place, _held: held }));
            }
        }
    }
}

/// A sealed block, at either end.
struct LentBlock {
    received: Kept,
    place: BlockId,
    _held: Option<Held>,
}

impl Block for LentBlock {
    fn bytes(&self) -> &[u8] {
        self.received.bytes()
    }

    fn place(&self) -> BlockId {
        self.place
    }
}

/// A worker's end: the received blocks of all memories that it reads, as far as calls may still name them.
pub(crate) struct Shelves {
    /// In the order of their numbers.
    memories: Vec<RefCell<Stack>>,
    /// True if a requested block was not found.
    missed: Cell<bool>,
}

struct Stack {
    of: StreamMemory,
    receiver: WordReceiver,
    blocks: VecDeque<Arc<LentBlock>>,
}

impl Shelves {
    pub(crate) fn new(hub: &Hub, memories: &[StreamMemory]) -> Result<Self, IpcError> {
        let stack = |of: &StreamMemory| {
            let receiver = hub.receiver(&of.service(), of.depth())?;
            let stack = Stack { of: of.clone(), receiver, blocks: VecDeque::new() };
            Ok(RefCell::new(stack))
        };
        let memories = memories.iter().map(stack).collect::<Result<_, _>>()?;
        Ok(Self { memories, missed: Cell::new(false) })
    }

    /// Splits a call into the numbers of the oldest blocks that calls may name, and the call itself.
    pub(crate) fn split<'a>(&self, call: &'a [u8]) -> Option<(&'a [[u8; 8]], &'a [u8])> {
        let (oldest, call) = call.split_at_checked(8 * self.memories.len())?;
        Some((oldest.as_chunks().0, call))
    }

    /// Receives the blocks sent since the last time and drops those that no call will name any more.
    pub(crate) fn tidy(&self, oldest: &[[u8; 8]]) {
        for (stack, oldest) in self.memories.iter().zip(oldest) {
            let stack = &mut *stack.borrow_mut();
            let oldest = u64::from_le_bytes(*oldest);
            while stack.take_in() {}
            let most = stack.of.kept();
            while stack.blocks.len() > most
                || stack.blocks.front().is_some_and(|block| block.place.seq < oldest)
            {
                stack.blocks.pop_front();
            }
        }
    }

    /// Returns true if a block was missed since the last call of this function.
    pub(crate) fn has_missed(&self) -> bool {
        self.missed.take()
    }
}

impl Stack {
    /// Receives the next block, if one was sent. A block that cannot be received counts as missed once it is requested.
    fn take_in(&mut self) -> bool {
        let Ok(Some(received)) = self.receiver.receive() else { return false };
        let place = BlockId { memory: self.of.memory, seq: received.user_header().seq };
        self.blocks.push_back(Arc::new(LentBlock { received: Kept(received), place, _held: None }));
        true
    }

    fn find(&mut self, seq: u64) -> Option<Arc<LentBlock>> {
        while self.blocks.back().is_none_or(|newest| newest.place.seq < seq) {
            if !self.take_in() {
                return None;
            }
        }
        let index = self.blocks.binary_search_by_key(&seq, |block| block.place.seq).ok()?;
        Some(self.blocks[index].clone())
    }
}

impl Shelf for Shelves {
    fn find(&self, place: BlockId) -> Option<Arc<dyn Block>> {
        let mut stacks = self.memories.iter();
        let stack = stacks.find(|stack| stack.borrow().of.memory == place.memory);
        let found = stack.and_then(|stack| stack.borrow_mut().find(place.seq));
        if found.is_none() {
            self.missed.set(true);
        }
        found.map(|block| block as Arc<dyn Block>)
    }
}
