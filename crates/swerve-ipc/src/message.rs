//! Messages between the coordinator and a worker: header, kinds, and how many a service holds.

#[cfg(test)]
use core::mem::offset_of;

#[cfg(feature = "processes")]
use iceoryx2::prelude::ZeroCopySend;

/// Header of every message. The type's name contains a fingerprint of its layout, because iceoryx2 compares only names
/// and sizes and would accept two different layouts of the same size.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "processes", derive(ZeroCopySend), type_name("swerve.Head.6a438280d2cb8e77"))]
pub(crate) struct Head {
    /// Sequence number of the message; an answer has that of its call.
    pub(crate) seq: u64,
    /// Kind of the message: [`Kind`] as a number.
    pub(crate) kind: u64,
}

/// Fingerprint in the name of [`Head`]: FNV-1a over its size and the offsets and sizes of its fields.
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

/// Kind of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub(crate) enum Kind {
    /// Request to execute a step.
    Call = 1,
    /// Result of the step.
    Answer,
    /// A place in shared memory named by the call is no longer available.
    Missing,
    /// The call cannot be executed; the bytes state the reason.
    Refused,
    /// Data of an image or of a part of a point cloud; the sequence number is that of its place.
    Block,
}

impl Kind {
    pub(crate) fn of(head: &Head) -> Option<Self> {
        [Self::Call, Self::Answer, Self::Missing, Self::Refused, Self::Block]
            .into_iter()
            .find(|kind| *kind as u64 == head.kind)
    }
}

/// Numbers of messages that a service holds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Depth {
    /// Messages that a receiver has not taken yet; the oldest is dropped when there are more.
    pub(crate) waiting: usize,
    /// Messages that a receiver holds at once.
    pub(crate) held: usize,
}

/// Depth for calls and answers: one at a time is under way, and one more after a kill.
pub(crate) const TALK: Depth = Depth { waiting: 4, held: 4 };

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_the_header_holds_its_layout() {
        let written = include_str!("message.rs").split("swerve.Head.").nth(1).unwrap().split('"').next();
        assert_eq!(written, Some(format!("{LAYOUT:016x}").as_str()));
    }
}
