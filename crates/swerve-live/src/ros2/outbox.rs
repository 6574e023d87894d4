//! Outgoing messages.

use std::sync::Arc;
use std::sync::mpsc::{SyncSender, TrySendError};

use swerve_ros2::AnyMessage;
use swerve_ros2::bridge::EndpointId;
use swerve_ros2::transport::Transport;

/// Builds a message; `None` if it cannot be represented in ROS.
pub(super) type Make = Box<dyn FnOnce() -> Option<AnyMessage> + Send>;

/// Outgoing messages.
pub(super) struct Outbox {
    pub(super) bridge: Arc<Transport>,
    pub(super) queues: [SyncSender<(EndpointId, Make)>; 2],
    /// Messages dropped because their queue was full, by endpoint.
    pub(super) dropped: Vec<u64>,
}

impl Outbox {
    /// Builds and sends a small message.
    pub(super) fn small(
        &mut self,
        id: EndpointId,
        make: impl FnOnce() -> Option<AnyMessage> + Send + 'static,
    ) {
        self.post(0, id, Box::new(make));
    }

    /// Builds and sends a large message.
    pub(super) fn large(
        &mut self,
        id: EndpointId,
        make: impl FnOnce() -> Option<AnyMessage> + Send + 'static,
    ) {
        self.post(1, id, Box::new(make));
    }

    fn post(&mut self, queue: usize, id: EndpointId, make: Make) {
        if let Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) =
            self.queues[queue].try_send((id, make))
        {
            self.dropped[id.0] += 1;
        }
    }
}
