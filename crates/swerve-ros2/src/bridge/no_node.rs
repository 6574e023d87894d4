//! The node of a program that was built without DDS: it does not start.

use std::time::Duration;

use super::{
    BridgeError, Endpoint, EndpointId, Options, PublishError, Received, ServiceError, Stopped,
    TopicStatistics,
};
use crate::message::AnyMessage;

/// A ROS 2 node with its topics. This program was built without DDS, so there is no value.
pub enum Bridge {}

impl Bridge {
    /// Reports that this program was built without ROS 2.
    ///
    /// # Errors
    /// Always.
    pub fn start(_: &Options) -> Result<Self, BridgeError> {
        Err(BridgeError::NotBuilt)
    }

    /// All endpoints in the order of their indices.
    pub fn endpoints(&self) -> &[Endpoint] {
        match *self {}
    }

    /// Publishes a message.
    ///
    /// # Errors
    /// See [`PublishError`].
    pub fn publish(&self, _: EndpointId, _: AnyMessage) -> Result<(), PublishError> {
        match *self {}
    }

    /// Takes a message of any endpoint.
    pub fn take_any(&self) -> Option<(EndpointId, Received)> {
        match *self {}
    }

    /// Waits for a message on any endpoint.
    pub fn wait(&self, _: Duration) -> bool {
        match *self {}
    }

    /// Requests a control mode of the vehicle.
    ///
    /// # Errors
    /// See [`ServiceError`].
    pub fn request_control_mode(&self, _: u8, _: Duration) -> Result<bool, ServiceError> {
        match *self {}
    }

    /// Answers waiting requests for a control mode.
    ///
    /// # Errors
    /// See [`ServiceError`].
    pub fn serve_control_mode(&self, _: impl FnMut(u8) -> bool) -> Result<usize, ServiceError> {
        match *self {}
    }

    /// Statistics so far, by endpoint.
    pub fn statistics(&self) -> Vec<TopicStatistics> {
        match *self {}
    }

    /// Stops the node.
    pub fn stop(self, _: Duration) -> Stopped {
        match self {}
    }
}
