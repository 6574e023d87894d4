//! The `foxglove` crate's WebSocket server, for one viewer.
//!
//! The `foxglove` crate drops messages that a viewer does not accept in time, without reporting the number. The
//! caller therefore passes only as many messages as the viewer has recently accepted, and drops and counts the
//! rest. The `foxglove` crate also accepts connections from pages of any site: this server listens on an
//! unpublished local port, behind a proxy that checks origins, and serves only the first client that subscribes.

use std::collections::BTreeMap;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::{Arc, OnceLock};

use foxglove::websocket::{Capability, ChannelView, Client, ServerListener, Status};
use foxglove::{
    ChannelBuilder, Context, PartialMetadata, RawChannel, Schema, SinkId, WebSocketServer,
    WebSocketServerHandle,
};

/// Schema of a topic, as in the MCAP registry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Form {
    /// Encoding of the messages: `protobuf`, `json`.
    pub encoding: String,
    /// Name of the schema.
    pub schema_name: String,
    /// Encoding of the schema: `protobuf`, `jsonschema`.
    pub schema_encoding: String,
    /// Schema data.
    pub schema: Vec<u8>,
}

/// Receives the subscriptions of the viewer. Called on a thread of the server; must not wait for the server.
pub trait Listener: Send + Sync + 'static {
    /// Called when the viewer subscribes to a topic.
    fn subscribe(&self, topic: &str);
    /// Called when the viewer unsubscribes from a topic or disconnects.
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

/// Forwards the subscriptions of the viewer and ignores all other clients.
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
    /// Starts to serve a session on a free local port. `backlog` is the number of messages that may be in transit
    /// before the `foxglove` crate drops any.
    ///
    /// # Errors
    /// If no port is free.
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

    /// Address on which it listens.
    #[must_use]
    pub fn at(&self) -> SocketAddr {
        self.at
    }

    fn handle(&self) -> &WebSocketServerHandle {
        self.handle.as_ref().expect("it is taken when this is dropped")
    }

    /// Begins another session: the time restarts and there are no topics.
    pub fn begin(&mut self, session: &str) {
        for channel in core::mem::take(&mut self.channels).into_values() {
            channel.close();
        }
        self.handle().clear_session(Some(session.to_owned()));
    }

    /// Advertises a topic.
    ///
    /// # Errors
    /// If the `foxglove` crate rejects its schema.
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

    /// Sends a message of a topic to the viewer; returns true if the topic has a subscriber. The time is in
    /// nanoseconds of the run.
    pub fn send(&self, topic: &str, at_ns: u64, data: &[u8]) -> bool {
        let channel = self.channels.get(topic).filter(|channel| channel.has_sinks());
        let (Some(channel), Some(viewer)) = (channel, self.viewer.get()) else { return false };
        channel.log_with_meta_to_sink(data, PartialMetadata::with_log_time(at_ns), Some(*viewer));
        true
    }

    /// Broadcasts the time of the run, nanoseconds.
    pub fn tell_time(&self, at_ns: u64) {
        self.handle().broadcast_time(at_ns);
    }

    /// Reports the number of dropped messages as a warning that replaces the previous one.
    pub fn tell_dropped(&self, count: u64) {
        let message = format!("{count} messages dropped: this viewer takes them more slowly than they come");
        self.handle().publish_status(Status::warning(message).with_id("dropped"));
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        if let Some(handle) = self.handle.take() {
            // The tasks of the server end with it.
            drop(handle.stop());
        }
    }
}
