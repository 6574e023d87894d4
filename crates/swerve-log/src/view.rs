//! Views: messages in third-party formats that a log contains in addition to its own.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use swerve_core::Time;
use swerve_flow::Event;

/// Converts events of a run to messages for other programs. Views are passive: they never affect the run, and log
/// readers skip them.
pub trait Views: Send {
    /// Appends the views of an event to `out`. Runs on the thread of the run: copy the data and leave the work to
    /// [`View::encode`].
    fn event(&mut self, event: &Event<'_>, out: &mut Vec<View>);
}

/// Encoder that appends a message to a buffer.
pub type Encode = Box<dyn FnOnce(&mut Vec<u8>) + Send>;

/// Topic of a view; all its messages have one schema.
#[derive(Clone, Debug)]
pub struct ViewTopic {
    /// Name, beginning with a slash.
    pub name: String,
    /// Schema of its messages.
    pub schema: ViewSchema,
    /// Entries of the metadata of its channel, beside those of the log.
    pub metadata: BTreeMap<String, String>,
    /// Metadata record of the file, by name, that readers of the messages need; written with the channel.
    pub file_metadata: Option<(String, BTreeMap<String, String>)>,
}

impl ViewTopic {
    /// Topic without metadata.
    pub fn new(name: String, schema: ViewSchema) -> Self {
        Self { name, schema, metadata: BTreeMap::new(), file_metadata: None }
    }
}

/// A message of a view.
pub struct View {
    /// Topic of the message.
    pub topic: Arc<ViewTopic>,
    /// Instant at which it becomes visible.
    pub visible_at: Time,
    /// The instant that it describes.
    pub stamp: Time,
    /// Approximate memory held until encoding, bytes.
    pub bytes: usize,
    /// Appends the message, on the writer thread; an empty message is not logged.
    pub encode: Encode,
}

/// Schema of a topic, as in the MCAP registry (<https://mcap.dev/spec/registry>).
#[derive(Clone, Debug)]
pub struct ViewSchema {
    /// Name of the schema.
    pub name: Cow<'static, str>,
    /// Encoding of the messages: `protobuf`, `json`.
    pub message_encoding: &'static str,
    /// Encoding of the schema: `protobuf`, `jsonschema`.
    pub encoding: &'static str,
    /// Schema data.
    pub data: Cow<'static, [u8]>,
}
