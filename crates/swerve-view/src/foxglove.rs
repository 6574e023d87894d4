//! Serves a run, or a log of one, to the Foxglove app: the `/view` channels of a log, over a WebSocket.
//!
//! Each viewer has a separate server of the `foxglove` crate, behind a gate. The crate admits pages of any site and
//! does not report dropped messages. The gate checks the origin and counts the data that the viewer has read; messages
//! that the viewer does not read in time are dropped, and counted, before they reach the server.

mod gate;
mod hub;
#[cfg(test)]
pub(crate) mod tests;
mod viewer;

use std::collections::BTreeSet;
use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use swerve_flow::{Event, Observer};
use swerve_foxglove::{Form, Foxglove};
use swerve_log::{Bag, LogError, View, ViewTopic, Views};
use swerve_report::output::tell;

use crate::reception::receive;
use gate::Knock;
use hub::{Hub, Message};

/// Maximum number of simultaneous viewers.
const MOST: usize = 8;
/// Nanoseconds per second.
const SECOND_NS: f64 = 1e9;

/// The server, which runs until the program ends.
#[derive(Clone)]
pub(crate) struct Streams(Arc<Hub>);

impl Streams {
    /// Starts serving and returns the address.
    ///
    /// # Errors
    /// If the address is in use or does not belong to this machine.
    pub(crate) fn start(at: SocketAddr) -> anyhow::Result<(Self, String)> {
        let listener = TcpListener::bind(at).with_context(|| format!("--foxglove: listening at {at}"))?;
        let address = format!("ws://{}", listener.local_addr()?);
        // No run depends on these bytes.
        let mut random = [0; 8];
        getrandom::fill(&mut random).map_err(|error| anyhow::anyhow!("a random name: {error}"))?;
        let hub = Arc::new(Hub::new(format!("{:016x}", u64::from_le_bytes(random))));
        let streams = Self(Arc::clone(&hub));
        std::thread::Builder::new().name("foxglove".into()).spawn(move || listen(&hub, &listener))?;
        Ok((streams, address))
    }

    /// Starts the session of another run; returns its observer.
    pub(crate) fn of_run(&self, views: Foxglove) -> Shown {
        self.0.begin();
        Shown { hub: Arc::clone(&self.0), views: Box::new(views), shown: Vec::new() }
    }

    /// Plays a log from its start when the first viewer connects, and again when another one connects after its end.
    ///
    /// # Errors
    /// If the file cannot be opened.
    pub(crate) fn play(&self, log: PathBuf, speed: Option<f64>) -> anyhow::Result<()> {
        Bag::open(&log)?;
        let hub = Arc::clone(&self.0);
        std::thread::Builder::new().name("play".into()).spawn(move || {
            let mut seen = 0;
            loop {
                let Some(viewers) = hub.wait_for_viewers(seen, Duration::from_secs(1)) else { continue };
                seen = viewers;
                hub.begin();
                if let Err(error) = play(&hub, &log, speed) {
                    tell(&format!("error: {}", swerve_report::output::message(&error)));
                    return;
                }
            }
        })?;
        Ok(())
    }
}

fn listen(hub: &Arc<Hub>, listener: &TcpListener) -> std::io::Result<()> {
    let open = Arc::new(AtomicUsize::new(0));
    receive(listener, |stream, request| {
        let Some(knock) = Knock::admit(stream, request) else { return };
        // Viewers beyond the limit are disconnected.
        if open.load(Ordering::Relaxed) >= MOST {
            return;
        }
        open.fetch_add(1, Ordering::Relaxed);
        let (hub, open) = (Arc::clone(hub), Arc::clone(&open));
        std::thread::spawn(move || {
            // A viewer that disconnected, or was not a viewer, is not an error.
            let _ended = viewer::serve(&hub, knock);
            open.fetch_sub(1, Ordering::Relaxed);
        });
    })
}

/// Publishes a run in progress. The run only hands the messages over; they are encoded in the viewers' threads.
pub(crate) struct Shown {
    hub: Arc<Hub>,
    views: Box<dyn Views>,
    shown: Vec<View>,
}

impl Observer for Shown {
    fn event(&mut self, event: &Event<'_>) {
        self.views.event(event, &mut self.shown);
        for View { topic, visible_at, bytes, encode, .. } in self.shown.drain(..) {
            let make = move || {
                let mut data = Vec::new();
                encode(&mut data);
                data
            };
            let at_ns = u64::try_from(visible_at.ns()).unwrap_or(0);
            self.hub.publish(&topic.name, || form(&topic), Message::new(at_ns, bytes, Box::new(make)));
        }
    }
}

fn form(ViewTopic { schema, .. }: &ViewTopic) -> Form {
    Form {
        encoding: schema.message_encoding.to_owned(),
        schema_name: schema.name.clone().into_owned(),
        schema_encoding: schema.encoding.to_owned(),
        schema: schema.data.clone().into_owned(),
    }
}

/// Plays the `/view` channels of a log in real time times `speed`; as fast as possible without a speed.
#[expect(clippy::disallowed_methods, reason = "a person watches in real time what is recorded already")]
fn play(hub: &Hub, log: &Path, speed: Option<f64>) -> anyhow::Result<()> {
    let mut bag = Bag::open(log)?;
    let begun = Instant::now();
    let mut topics = BTreeSet::new();
    loop {
        let message = match bag.next_message() {
            Ok(Some(message)) => message,
            // The truncation was already reported by the page of the log.
            Ok(None) | Err(LogError::CutOff { .. }) => break,
            Err(error) => return Err(error.into()),
        };
        let topic = &bag.topics()[message.topic];
        if !topic.name.starts_with("/view/") {
            continue;
        }
        topics.insert(message.topic);
        if let Some(speed) = speed {
            let due = Duration::from_secs_f64(message.received_ns as f64 / SECOND_NS / speed);
            std::thread::sleep(due.saturating_sub(begun.elapsed()));
        }
        let form = || Form {
            encoding: topic.encoding.clone(),
            schema_name: topic.type_name.clone(),
            schema_encoding: topic.schema_encoding.clone(),
            schema: topic.schema.clone(),
        };
        let (bytes, data) = (message.data.len(), message.data);
        let message = Message::new(message.received_ns, bytes, Box::new(move || data));
        hub.publish(&topic.name, form, message);
    }
    anyhow::ensure!(
        !topics.is_empty(),
        "{}: it holds nothing for Foxglove (under /view): expected a log of a run with log.foxglove = true",
        log.display()
    );
    Ok(())
}
