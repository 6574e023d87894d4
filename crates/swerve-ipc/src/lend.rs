//! Memory of one stream that sensors write into and workers read in place.
//!
//! The coordinator's sensor gets loans of a service of its own. A sealed loan is sent to all that read the stream,
//! and to a receiver of the coordinator's own, which takes the very same piece of shared memory: what the
//! coordinator's readers, the digest and the log read is what the workers read.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize};
use swerve_msg::block::{Block, Memory, Place, Room, Shelf};

use crate::IpcError;
use crate::service::{Depth, Head, Hub, Kept, Kind, Loan, WordReceiver, WordSender};

/// Smaller payloads are no burden in a message.
const BYTES_MIN: usize = 4096;

/// The memory of one stream, as both sides know it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct StreamMemory {
    /// Its number.
    pub(crate) memory: u32,
    /// The stream.
    pub(crate) stream: String,
    /// How many blocks each of its messages consists of.
    pub(crate) blocks: usize,
}

impl StreamMemory {
    fn service(&self) -> String {
        format!("memory/{}", self.stream)
    }

    /// Frames that a worker has, or could have.
    fn depth(&self) -> Depth {
        const FRAMES_WAITING: usize = 2;
        Depth { waiting: FRAMES_WAITING * self.blocks, held: self.held() + FRAMES_WAITING * self.blocks }
    }

    /// The blocks that the coordinator has at most; what more its sensor writes is in memory of its own.
    fn held(&self) -> usize {
        const FRAMES_HELD: usize = 6;
        FRAMES_HELD * self.blocks
    }

    /// The newest blocks, of which a worker keeps for calls to come what the coordinator still has.
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
    /// Made for the first room, whose size is the largest of the stream.
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

/// The rooms and blocks of one memory that the coordinator has.
#[derive(Default)]
pub(crate) struct Live(Mutex<Alive>);

#[derive(Default)]
struct Alive {
    held: usize,
    /// Of the blocks among them.
    seqs: Vec<u64>,
}

impl Live {
    fn alive(&self) -> MutexGuard<'_, Alive> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// No call will name an older block than this one.
    pub(crate) fn oldest(&self) -> u64 {
        self.alive().seqs.iter().copied().min().unwrap_or(u64::MAX)
    }
}

/// One of as many as may be held.
struct Held {
    live: Arc<Live>,
    /// Once it is a block.
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
        let place = Place { memory, seq: ends.seq };
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

/// What was written, at either end.
struct LentBlock {
    received: Kept,
    place: Place,
    _held: Option<Held>,
}

impl Block for LentBlock {
    fn bytes(&self) -> &[u8] {
        self.received.bytes()
    }

    fn place(&self) -> Place {
        self.place
    }
}

/// A worker's end: what it was sent of all memories that it reads and may still be asked for.
pub(crate) struct Shelves {
    /// By their numbers.
    memories: Vec<RefCell<Stack>>,
    /// A block was asked for that is not there.
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

    /// Splits a call into what it says of the oldest blocks that calls may name, and the call itself.
    pub(crate) fn split<'a>(&self, call: &'a [u8]) -> Option<(&'a [[u8; 8]], &'a [u8])> {
        let (oldest, call) = call.split_at_checked(8 * self.memories.len())?;
        Some((oldest.as_chunks().0, call))
    }

    /// Takes in what was sent since the last time, and lets go of what no call will name any more.
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

    /// Whether a block was missed since the last time.
    pub(crate) fn has_missed(&self) -> bool {
        self.missed.take()
    }
}

impl Stack {
    /// Takes in the next block, if one was sent. What cannot be received is missed when it is asked for.
    fn take_in(&mut self) -> bool {
        let Ok(Some(received)) = self.receiver.receive() else { return false };
        let place = Place { memory: self.of.memory, seq: received.user_header().seq };
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
    fn find(&self, place: Place) -> Option<Arc<dyn Block>> {
        let mut stacks = self.memories.iter();
        let stack = stacks.find(|stack| stack.borrow().of.memory == place.memory);
        let found = stack.and_then(|stack| stack.borrow_mut().find(place.seq));
        if found.is_none() {
            self.missed.set(true);
        }
        found.map(|block| block as Arc<dyn Block>)
    }
}
