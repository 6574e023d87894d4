//! What goes between a program and its transport's process: frames of at most [`FRAME_BYTES_MAX`], over a socket that
//! only the two have.

use std::io::{self, Read, Write};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::bridge::{Options, TopicStatistics, WriterGuid};
use crate::clock::StampVerdict;

/// The longest frame: an image of 4,000 by 4,000 pixels fits.
pub(super) const FRAME_BYTES_MAX: usize = 64 << 20;

/// From the program.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Order {
    /// The first: which topics there are, how much memory may be taken, and the setup of [`Orphan`](super::Orphan).
    Start {
        options: Box<Options>,
        memory_bytes: u64,
        #[serde(with = "serde_bytes")]
        setup: Vec<u8>,
    },
    /// The state to go on from where the program dies; takes the place of the one before.
    Leave {
        #[serde(with = "serde_bytes")]
        state: Vec<u8>,
    },
    /// Send a message, as its bytes in CDR.
    Publish {
        endpoint: usize,
        #[serde(with = "serde_bytes")]
        payload: Vec<u8>,
    },
    /// Ask the vehicle for a control mode.
    AskMode { number: u64, mode: u8, timeout_ms: u64 },
    /// Say how the topics are.
    Count,
    /// Leave.
    End,
}

/// From the transport.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum News {
    /// The node is there.
    Started,
    /// It cannot be.
    Refused(String),
    /// A message was handed to DDS, or not.
    Sent,
    /// A message came.
    Message {
        endpoint: usize,
        writer: WriterGuid,
        received_ns: i64,
        source_ns: Option<i64>,
        stamp: Option<StampVerdict>,
        #[serde(with = "serde_bytes")]
        payload: Vec<u8>,
    },
    /// How the topics are; sent all the time, so that who hangs is found out, and where it was asked for.
    Counts { counts: Vec<TopicStatistics>, asked: bool },
    /// Somebody asked for this control mode.
    Mode(u8),
    /// What the vehicle answered.
    Answer { number: u64, taken: Result<bool, String> },
}

fn invalid(what: impl ToString) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what.to_string())
}

/// Writes a frame.
pub(super) fn write(mut to: impl Write, frame: &impl Serialize) -> io::Result<()> {
    let mut bytes = vec![0; 4];
    bytes = postcard::to_extend(frame, bytes).map_err(invalid)?;
    let length = bytes.len() - 4;
    if length > FRAME_BYTES_MAX {
        return Err(invalid(format!("a message of {length} bytes is longer than {FRAME_BYTES_MAX}")));
    }
    bytes[..4].copy_from_slice(&(length as u32).to_le_bytes());
    to.write_all(&bytes)
}

/// Reads a frame.
pub(super) fn read<T: DeserializeOwned>(mut from: impl Read) -> io::Result<T> {
    let mut length = [0; 4];
    from.read_exact(&mut length)?;
    let length = u32::from_le_bytes(length) as usize;
    if length > FRAME_BYTES_MAX {
        return Err(invalid(format!("a frame of {length} bytes is longer than {FRAME_BYTES_MAX}")));
    }
    let mut bytes = vec![0; length];
    from.read_exact(&mut bytes)?;
    postcard::from_bytes(&bytes).map_err(invalid)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::Network;
    use crate::mapping::{Mapping, Side, Vehicle};

    #[test]
    fn a_frame_is_read_as_it_was_written_and_none_is_too_long() {
        let options = Options::from_mapping(&Mapping::of(Vehicle::Autoware, Network::default()), Side::Stack);
        let mut bytes = Vec::new();
        write(
            &mut bytes,
            &Order::Start { options: Box::new(options.clone()), memory_bytes: 1 << 30, setup: vec![5] },
        )
        .unwrap();
        write(&mut bytes, &Order::Publish { endpoint: 3, payload: vec![7; 1000] }).unwrap();
        let mut from = &bytes[..];
        let Order::Start { options: read_back, memory_bytes, setup } = read(&mut from).unwrap() else {
            panic!()
        };
        assert_eq!((*read_back, memory_bytes, setup), (options, 1 << 30, vec![5]));
        let Order::Publish { endpoint: 3, payload } = read(&mut from).unwrap() else { panic!() };
        assert!(payload == [7; 1000] && from.is_empty());
        let long = Order::Publish { endpoint: 0, payload: vec![0; FRAME_BYTES_MAX] };
        assert!(write(&mut Vec::new(), &long).unwrap_err().to_string().contains("is longer than"));
        let refused = read::<Order>(&u32::MAX.to_le_bytes()[..]).unwrap_err().to_string();
        assert!(refused.contains("is longer than"), "{refused}");
        assert!(read::<Order>(&[1, 0, 0, 0, 99][..]).is_err());
    }
}
