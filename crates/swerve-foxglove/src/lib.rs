//! A run's messages in the forms that Foxglove shows (<https://docs.foxglove.dev/docs/sdk/schemas>), protobuf
//! encoded, for a log to hold them beside its own.
//!
//! [`Foxglove`] watches a run: the ego, others, tracks, predictions, plan and road as `foxglove.SceneUpdate`,
//! frames as `foxglove.FrameTransforms`, cameras as `foxglove.CompressedImage`, `foxglove.RawImage`,
//! `foxglove.CameraCalibration` and `foxglove.ImageAnnotations`, lidars and radars as `foxglove.PointCloud`,
//! the satellite receiver as `foxglove.LocationFix`, what happens as `foxglove.Log`, and figures to plot as
//! [`Figures`]. Messages of somebody else's types are shown as JSON, as a [`Drawing`] or in any other form that is
//! registered: [`Foxglove::with`] and its like. All times are instants of the run, which starts at zero: the same run gives the same messages.
//! With the feature `server` also the crate's WebSocket server, for one viewer: [`Server`].
//! Absences: no file, no clock, no configuration, no simulator; nothing here is read by the stack.

mod camera;
mod cloud;
mod figures;
mod form;
mod own;
mod scene;
#[cfg(feature = "server")]
mod server;
mod watch;
mod words;

pub use camera::{ImageForm, jpeg, logged_image};
pub use cloud::Sensor;
pub use figures::Figures;
pub use own::Drawing;
#[cfg(feature = "server")]
pub use server::{Form, Listener, Server};
pub use watch::{Foxglove, Mount, Setup};
