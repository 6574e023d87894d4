//! The `foxglove` crate's WebSocket server, for one viewer.
//!
//! That server drops what a viewer does not take and tells nobody how much, so whoever feeds one of these hands over
//! only as much as the viewer has taken of late, and does the dropping and counting. It also lets in the page of any
//! site; it listens on a port of this machine that nobody is told, for somebody in front of it to look at origins, and
//! serves only the first who subscribes.

use std::collections::BTreeMap;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::{Arc, OnceLock};

use foxglove::websocket::{Capability, ChannelView, Client, ServerListener, Status};
use foxglove::{
    ChannelBuilder, Context, PartialMetadata, RawChannel, Schema, SinkId, WebSocketServer,
    WebSocketServerHandle,
};

/// The form of a topic's messages, as MCAP's registry has them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Form {
    /// Of the messages: `protobuf`, `json`.
    pub encoding: String,
    /// The name of the schema.
    pub schema_name: String,
    /// Of the schema: `protobuf`, `jsonschema`.
    pub schema_encoding: String,
    /// The schema.
    pub schema: Vec<u8>,
}

/// Whoever is told which topics a viewer wants. It is called from a thread of the server's and must not wait for the
/// server.
pub trait Listener: Send + Sync + 'static {
    /// The viewer wants a topic from now on.
    fn subscribe(&self, topic: &str);
    /// The viewer wants a topic no more, or it is gone.
    fn unsubscribe(&self, topic: &str);
}

/// A server for one viewer.
pub struct Server {
    context: Arc<Context>,
    handle: Option<WebSocketServerHandle>,
    at: SocketAddr,
    viewer: Arc<OnceLock<SinkId>>,
    channels: BTreeMap<String, Arc<RawChannel>>,
}

impl core::fmt::Debug for Server {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Server").field("at", &self.at).field("topics", &self.channels.keys()).finish()
    }
}

/// Passes on what the viewer asks, and nothing of anybody else.
struct Ears<L> {
    viewer: Arc<OnceLock<SinkId>>,
    listener: L,
}

impl<L: Listener> ServerListener for Ears<L> {
    fn on_subscribe(&self, client: Client, channel: ChannelView<'_>) {
        if client.sink_id().is_some_and(|id| *self.viewer.get_or_init(|| id) == id) {
            self.listener.subscribe(channel.topic());
        }
    }

    fn on_unsubscribe(&self, client: Client, channel: ChannelView<'_>) {
        if client.sink_id() == self.viewer.get().copied() {
            self.listener.unsubscribe(channel.topic());
        }
    }
}

impl Server {
    /// Begins to serve a session on a free port of this machine. `backlog` is the most messages that may be under way
    /// without one being dropped unseen.
    ///
    /// # Errors
    /// No port is free.
    pub fn start(session: &str, backlog: usize, listener: impl Listener) -> Result<Self, String> {
        let (context, viewer) = (Context::new(), Arc::default());
        let handle = WebSocketServer::new()
            .name("swerve")
            .bind(Ipv4Addr::LOCALHOST.to_string(), 0)
            .capabilities([Capability::Time])
            .session_id(session)
            .message_backlog_size(backlog)
            .listener(Arc::new(Ears { viewer: Arc::clone(&viewer), listener }))
            .context(&context)
            .start_blocking()
            .map_err(|error| error.to_string())?;
        let at = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), handle.port());
        Ok(Self { context, handle: Some(handle), at, viewer, channels: BTreeMap::new() })
    }

    /// Where it listens.
    #[must_use]
    pub fn at(&self) -> SocketAddr {
        self.at
    }

    fn handle(&self) -> &WebSocketServerHandle {
        self.handle.as_ref().expect("it is taken when this is dropped")
    }

    /// Another session begins: its time starts again and it has no topic yet.
    pub fn begin(&mut self, session: &str) {
        for channel in core::mem::take(&mut self.channels).into_values() {
            channel.close();
        }
        self.handle().clear_session(Some(session.to_owned()));
    }

    /// Offers a topic.
    ///
    /// # Errors
    /// The crate does not take its form.
    pub fn offer(&mut self, topic: &str, form: &Form) -> Result<(), String> {
        let schema = Schema::new(form.schema_name.clone(), form.schema_encoding.clone(), form.schema.clone());
        let channel = ChannelBuilder::new(topic)
            .context(&self.context)
            .message_encoding(form.encoding.clone())
            .schema(schema)
            .build_raw()
            .map_err(|error| error.to_string())?;
        self.channels.insert(topic.to_owned(), channel);
        Ok(())
    }

    /// Sends a message of a topic to the viewer, and gives whether the viewer wants it; the time is nanoseconds of the
    /// run.
    pub fn send(&self, topic: &str, at_ns: u64, data: &[u8]) -> bool {
        let channel = self.channels.get(topic).filter(|channel| channel.has_sinks());
        let (Some(channel), Some(viewer)) = (channel, self.viewer.get()) else { return false };
        channel.log_with_meta_to_sink(data, PartialMetadata::with_log_time(at_ns), Some(*viewer));
        true
    }

    /// Tells the time of the run, nanoseconds.
    pub fn tell_time(&self, at_ns: u64) {
        self.handle().broadcast_time(at_ns);
    }

    /// Tells how many messages were dropped, as a warning that takes the place of the one before.
    pub fn tell_dropped(&self, count: u64) {
        let message = format!("{count} messages dropped: this viewer takes them more slowly than they come");
        self.handle().publish_status(Status::warning(message).with_id("dropped"));
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        if let Some(handle) = self.handle.take() {
            // Its tasks end with it.
            drop(handle.stop());
        }
    }
}
