//! Messages in the forms of other programs, which a log holds beside its own.

use std::borrow::Cow;
use std::sync::Arc;

use swerve_core::Time;
use swerve_flow::Event;

/// Turns what happens in a run into messages for other programs. It changes nothing in the run, and a log's
/// reader passes over what it says.
pub trait Views: Send {
    /// Appends what there is to show of an event to `out`. This is the run's own thread: copy what is needed,
    /// and leave the work to [`View::encode`].
    fn event(&mut self, event: &Event<'_>, out: &mut Vec<View>);
}

/// Appends a message to what there is.
pub type Encode = Box<dyn FnOnce(&mut Vec<u8>) + Send>;

/// A topic of another program's: every message of it has one form.
#[derive(Clone, Debug)]
pub struct ViewTopic {
    /// Its name, beginning with a slash.
    pub name: String,
    /// The form of its messages.
    pub schema: ViewSchema,
}

/// A message of a topic of another program's.
pub struct View {
    /// The topic.
    pub topic: Arc<ViewTopic>,
    /// When it is known.
    pub visible_at: Time,
    /// The instant that it describes.
    pub stamp: Time,
    /// How much memory waits with it, bytes, roughly.
    pub bytes: usize,
    /// Appends the message, on the writer's thread; what appends nothing is not logged.
    pub encode: Encode,
}

/// The form of a topic's messages, as MCAP's registry has them (<https://mcap.dev/spec/registry>).
#[derive(Clone, Debug)]
pub struct ViewSchema {
    /// Its name.
    pub name: Cow<'static, str>,
    /// Encoding of the messages: `protobuf`, `json`.
    pub message_encoding: &'static str,
    /// Encoding of the schema: `protobuf`, `jsonschema`.
    pub encoding: &'static str,
    /// The schema itself.
    pub data: Cow<'static, [u8]>,
}
