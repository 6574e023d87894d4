//! Server for the Foxglove app in a program that was built without the feature `foxglove`: it does not start.

use std::net::SocketAddr;
use std::path::PathBuf;

use swerve_flow::{Event, Observer};
use swerve_foxglove::Foxglove;

/// The server. This program was built without it, so there is no value.
#[derive(Clone)]
pub(crate) enum Streams {}

/// Publisher of a run in progress.
pub(crate) enum Shown {}

impl Streams {
    pub(crate) fn start(_: SocketAddr) -> anyhow::Result<(Self, String)> {
        anyhow::bail!(crate::NOT_BUILT)
    }

    pub(crate) fn of_run(&self, _: Foxglove) -> Shown {
        match *self {}
    }

    pub(crate) fn play(&self, _: PathBuf, _: Option<f64>) -> anyhow::Result<()> {
        match *self {}
    }
}

impl Observer for Shown {
    fn event(&mut self, _: &Event<'_>) {
        match *self {}
    }
}
