//! Services of a program that was built without the feature `processes`: they have no values, and joining a run is an
//! error.

use core::convert::Infallible;

use crate::IpcError;
use crate::folder::Address;
use crate::message::{Depth, Head, Kind};

/// Access of a process to the shared memory of a run.
pub(crate) enum Hub {}

/// Sending end of a message service.
pub(crate) enum Sender {}
pub(crate) type WordSender = Sender;

/// Receiving end of a service.
pub(crate) enum Receiver {}
pub(crate) type WordReceiver = Receiver;

/// Received message.
pub(crate) enum Sample {}

/// Message that is being written.
pub(crate) enum Loan {}

/// Received message that is kept for a while.
pub(crate) struct Kept(pub(crate) Sample);

impl Hub {
    pub(crate) fn join(_: &Address) -> Result<Self, IpcError> {
        Err(IpcError::NotBuilt)
    }

    pub(crate) fn sender(&self, _: &str, _: Depth, _: usize) -> Result<Sender, IpcError> {
        match *self {}
    }

    pub(crate) fn lending_sender(
        &self,
        _: &str,
        _: Depth,
        _: usize,
        _: usize,
        _: usize,
    ) -> Result<WordSender, IpcError> {
        match *self {}
    }

    pub(crate) fn receiver(&self, _: &str, _: Depth) -> Result<Receiver, IpcError> {
        match *self {}
    }
}

impl Sender {
    pub(crate) fn send(&self, _: u64, _: Kind, _: &[u8]) -> Result<(), IpcError> {
        match *self {}
    }
}

impl Receiver {
    pub(crate) fn receive(&self) -> Result<Option<Sample>, Infallible> {
        match *self {}
    }
}

impl Sample {
    pub(crate) fn user_header(&self) -> &Head {
        match *self {}
    }

    pub(crate) fn payload(&self) -> &[u8] {
        match *self {}
    }
}

impl Loan {
    pub(crate) fn of(sender: &WordSender, _: usize) -> Option<Self> {
        match *sender {}
    }

    pub(crate) fn bytes(&self) -> &[u8] {
        match *self {}
    }

    pub(crate) fn bytes_mut(&mut self) -> &mut [u8] {
        match *self {}
    }

    pub(crate) fn send(self, _: Head) -> Result<(), IpcError> {
        match self {}
    }
}

impl Kept {
    pub(crate) fn bytes(&self) -> &[u8] {
        self.0.payload()
    }
}
