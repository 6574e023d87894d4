//! Protocol between a program and its transport process: frames of at most [`FRAME_BYTES_MAX`] over a private
//! socket.

use std::io::{self, Read, Write};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::bridge::{Options, TopicStatistics, WriterGuid};
use crate::clock::StampVerdict;

/// Maximum frame length, bytes: an image of 4,000 by 4,000 pixels fits.
pub(super) const FRAME_BYTES_MAX: usize = 64 << 20;

/// Messages from the program.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Order {
    /// First message: topics, memory limit, and the setup of [`Orphan`](super::Orphan).
    Start {
        options: Box<Options>,
        memory_bytes: u64,
        #[serde(with = "serde_bytes")]
        setup: Vec<u8>,
    },
    /// State from which to continue if the program dies; replaces the previous one.
    Leave {
        #[serde(with = "serde_bytes")]
        state: Vec<u8>,
    },
    /// Publish a message, given as CDR bytes.
    Publish {
        endpoint: usize,
        #[serde(with = "serde_bytes")]
        payload: Vec<u8>,
    },
    /// Request a control mode of the vehicle.
    AskMode { number: u64, mode: u8, timeout_ms: u64 },
    /// Report the statistics.
    Count,
    /// Shut down.
    End,
}

/// Messages from the transport process.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum News {
    /// The node was created.
    Started,
    /// The node could not be created.
    Refused(String),
    /// A message was passed to DDS, successfully or not.
    Sent,
    /// A message was received.
    Message {
        endpoint: usize,
        writer: WriterGuid,
        received_ns: i64,
        source_ns: Option<i64>,
        stamp: Option<StampVerdict>,
        #[serde(with = "serde_bytes")]
        payload: Vec<u8>,
    },
    /// Statistics: sent periodically, so that a hanging process is detected, and on request.
    Counts { counts: Vec<TopicStatistics>, asked: bool },
    /// Another node requested this control mode.
    Mode(u8),
    /// Answer of the vehicle.
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
    fn frames_round_trip_within_the_length_limit() {
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
