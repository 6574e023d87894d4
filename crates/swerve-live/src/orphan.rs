//! Stop of a vehicle whose controlling program has died, by the transport process, which outlives it.
//!
//! With each command the program leaves the `Legacy` with that process. If the program's end of the socket closes
//! without a farewell (kill -9, out of memory, an abort), the process brakes as the [`Sink`] does when the gate
//! falls silent: to a standstill with the last steering angle. Then it releases the vehicle and ends.

use core::time::Duration;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use anyhow::Context as _;
use swerve_core::Span;
use swerve_drive::problems_error;
use swerve_ros2::AnyMessage;
use swerve_ros2::bridge::{Bridge, EndpointId, TopicStatistics};
use swerve_ros2::convert::Epoch;
use swerve_ros2::mapping::{Mapping, Role};
use swerve_ros2::transport::Orphan;
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_stack::config::LiveConfig;
use swerve_stack::config::live::EnableBy;
use swerve_text::Document;

use crate::legacy::Legacy;
use crate::shared::lock;
use crate::sink::Sink;
use crate::vehicle::{self, Car, VehicleInterface};
use crate::wire::{HostClock, Sent, Taken, Wire, sends};

/// Period of polling the vehicle's reports.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Runs the transport process.
///
/// # Errors
/// If it was not started by a run.
pub fn run_transport(registry: &Registry) -> anyhow::Result<()> {
    let started_by = "`swerve transport` is started by `swerve live` and `swerve run --ros2`";
    // An error would have no reader: the vehicle's time-out brakes then.
    let stopped = |orphan: Orphan<'_>| drop(stop(registry, &orphan));
    swerve_ros2::transport::run(stopped).context(started_by)
}

/// Stops the vehicle if the program was driving it.
///
/// # Errors
/// If the configuration or the state that the program left cannot be read.
fn stop(registry: &Registry, orphan: &Orphan<'_>) -> anyhow::Result<()> {
    let legacy: Legacy = serde_json::from_slice(&orphan.state).context("the last command")?;
    if !legacy.last.engaged {
        return Ok(());
    }
    let text = String::from_utf8(orphan.setup.clone()).context("the configuration")?;
    let document = Document::parse("configuration of the drive", text)?;
    let config =
        Setup::from_document_with(registry, &document, &[]).map_err(|problems| problems_error(&problems))?;
    let live = config.live.clone().context("the configuration has no `[live]`")?;
    let mapping = config.ros2_mapping()?;
    let wire = OrphanWire { bridge: orphan.bridge, sends: sends(&mapping, orphan.bridge.endpoints()) };
    let interface = || vehicle::interface(mapping.vehicle, &config);
    stop_over(&wire, [interface(), interface()], &live, &mapping, legacy);
    Ok(())
}

/// Stops the vehicle over a wire. One interface sends commands, the other parses reports.
fn stop_over(
    wire: &dyn Wire,
    [commands, reports]: [Box<dyn VehicleInterface>; 2],
    live: &LiveConfig,
    mapping: &Mapping,
    Legacy { last, stop }: Legacy,
) {
    let clock = HostClock::start();
    let car = Arc::<Mutex<Car>>::default();
    let sink = Sink {
        wire,
        interface: commands,
        car: car.clone(),
        clock: clock.into(),
        epoch: Epoch { ns: clock.epoch_ns() },
        stop,
        stop_max: Span::from_secs(live.stop_timeout_s),
        has_mode_service: !live.control_mode_service.is_empty(),
        says_enable: live.enable == EnableBy::AtStart,
        gave_up: Arc::default(),
    };
    let over = AtomicBool::new(false);
    let (heard, over_now) = (&car, &over);
    std::thread::scope(|scope| {
        scope.spawn(move || {
            while !over_now.load(Ordering::Relaxed) {
                wire.wait(LOOK_EVERY);
                while let Some(Taken { name, message, .. }) = wire.take() {
                    if let Some(topic) = mapping.topic(name) {
                        let facts = reports.facts(&message);
                        lock(heard).hear(topic.role, message.kind(), clock.now(), facts);
                    }
                }
            }
        });
        sink.take_over(last);
        over.store(true, Ordering::Relaxed);
    });
}

/// The bridge of this process as a wire.
struct OrphanWire<'a> {
    bridge: &'a Bridge,
    sends: BTreeMap<Role, EndpointId>,
}

impl Wire for OrphanWire<'_> {
    fn wait(&self, timeout: Duration) -> bool {
        self.bridge.wait(timeout)
    }

    fn take(&self) -> Option<Taken<'_>> {
        let (EndpointId(id), received) = self.bridge.take_any()?;
        let name = self.bridge.endpoints()[id].name.as_str();
        Some(Taken { name, message: received.message, received_ns: received.received_ns })
    }

    fn send(&self, role: Role, message: AnyMessage) -> Sent {
        match self.sends.get(&role) {
            None => Sent::NoTopic,
            Some(id) if self.bridge.publish(*id, message).is_ok() => Sent::Done,
            Some(_) => Sent::Failed,
        }
    }

    fn ask_mode(&self, mode: u8, timeout: Duration) -> Result<bool, String> {
        self.bridge.request_control_mode(mode, timeout).map_err(|error| error.to_string())
    }

    fn statistics(&self) -> Vec<TopicStatistics> {
        self.bridge.statistics()
    }
}
