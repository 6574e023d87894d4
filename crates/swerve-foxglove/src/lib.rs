//! Converts the messages of a run to Foxglove schemas (<https://docs.foxglove.dev/docs/sdk/schemas>), protobuf
//! encoded, to be stored in its log.
//!
//! [`Foxglove`] observes a run. It publishes the ego, other actors, tracks, predictions, plan and road as
//! `foxglove.SceneUpdate`, frames as `foxglove.FrameTransforms`, cameras as `foxglove.CompressedImage`,
//! `foxglove.RawImage`, `foxglove.CameraCalibration` and `foxglove.ImageAnnotations`, lidars and radars as
//! `foxglove.PointCloud`, the satellite receiver as `foxglove.LocationFix`, events as `foxglove.Log`, and time
//! series as [`Figures`]. Third-party message types are published as JSON, as a [`Drawing`] or in any other
//! registered schema: see [`Foxglove::with`] and its variants. All times are instants of the run, which starts at
//! zero: the same run yields the same messages.
//! With the feature `server` also the crate's WebSocket server, for one viewer: [`Server`].
//! Contains no file, no clock, no configuration and no simulator; the stack reads nothing from it.

mod camera;
mod cloud;
mod figures;
mod form;
mod own;
mod scene;
#[cfg(feature = "server")]
mod server;
mod setup;
mod watch;
mod words;

pub use camera::{jpeg, logged_image};
pub use cloud::Sensor;
pub use figures::Figures;
pub use own::Drawing;
#[cfg(feature = "server")]
pub use server::{Form, Listener, Server};
pub use setup::{ImageForm, Mount, Setup};
pub use watch::Foxglove;
