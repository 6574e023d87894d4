//! Messages in the forms of other programs, which a log holds beside its own.

use std::borrow::Cow;
use std::sync::Arc;

use swerve_core::Time;
use swerve_flow::Event;

/// Turns what happens in a run into messages for other programs. It changes nothing in the run, and a log's
/// reader passes over what it says.
pub trait Views: Send {
    /// What there is to show of an event, appended to `out`. This is the run's own thread: copy what is needed,
    /// and leave the work to [`View::encode`].
    fn event(&mut self, event: &Event<'_>, out: &mut Vec<View>);
}

/// Appends a message to what there is.
pub type Encode = Box<dyn FnOnce(&mut Vec<u8>) + Send>;

/// A message of a topic of another program's.
pub struct View {
    /// The topic; every message of a topic has one schema.
    pub topic: Arc<str>,
    /// The form of its messages.
    pub schema: fn() -> ViewSchema,
    /// When it is known.
    pub visible_at: Time,
    /// What it describes.
    pub stamp: Time,
    /// How much memory waits with it, bytes, roughly.
    pub bytes: usize,
    /// Appends the message, on the writer's thread; what appends nothing is not logged.
    pub encode: Encode,
}

/// The form of a topic's messages, as MCAP's registry has them (<https://mcap.dev/spec/registry>).
pub struct ViewSchema {
    /// Its name.
    pub name: Cow<'static, str>,
    /// Encoding of the schema and of the messages: `protobuf`.
    pub encoding: &'static str,
    /// The schema itself.
    pub data: Cow<'static, [u8]>,
}
