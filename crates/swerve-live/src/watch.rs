//! Observer of a drive: forwards the gate's output to the sink, and collects metrics.

use std::collections::VecDeque;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex};

use serde::Serialize;
use swerve_core::{Span, Time};
use swerve_flow::{Dispatcher, Event, Observer, Publication};
use swerve_geom::{Map, Pose2};
use swerve_msg::{
    EgoState, GateMode, GateOutput, MotionCommand, Plan, PlanStatus, Refusals, Route, SensorHealth,
    VehicleReport,
};

use super::notices::SensorChecks;
use super::shared::lock;
use super::sink::Order;

/// Present status of the drive, for the other threads.
#[derive(Clone, Copy, Debug, Default)]
pub struct DriveStatus {
    /// Mode of the gate.
    pub mode: GateMode,
    /// Speed of the ego, m/s.
    pub speed_mps: f64,
    /// Pose of the ego in the map; `None` until known.
    pub pose: Option<Pose2<Map>>,
    /// Status of the newest plan.
    pub plan: Option<PlanStatus>,
    /// Instant of the newest plan.
    pub planned: Option<Time>,
    /// Last command while the stack drove, and the newest report of the vehicle.
    pub follow: FollowFigures,
}

/// A command, and the motion that the vehicle reports.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct FollowFigures {
    /// Commanded angle of the front road wheels, radians; positive to the left.
    pub commanded_rad: f64,
    /// Commanded acceleration, m/s².
    pub commanded_mps2: f64,
    /// Reported angle of the front road wheels, radians; positive to the left.
    pub reported_rad: f64,
    /// Reported speed, m/s.
    pub speed_mps: f64,
    /// Mean acceleration of the last second by the reported speed, m/s².
    pub accel_mps2: f64,
}

/// A change of the gate's mode.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct ModeChange {
    /// Instant, seconds of run time.
    pub at_s: f64,
    /// New mode.
    pub mode: GateMode,
    /// Reason of a stop in words, with the streams that were silent or the numbers that deviated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// Metrics of a drive.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct DriveFigures {
    /// Time driven by the stack, seconds.
    pub driving_s: f64,
    /// Distance driven by the stack, metres.
    pub driven_m: f64,
    /// Maximum speed while driven by the stack, m/s.
    pub speed_max_mps: f64,
    /// Median distance of the ego origin from the route, metres.
    pub beside_p50_m: f64,
    /// 99th percentile of that distance, metres.
    pub beside_p99_m: f64,
    /// Maximum of that distance, metres.
    pub beside_max_m: f64,
    /// Modes of the gate, in order.
    pub modes: Vec<ModeChange>,
    /// Commands rejected by the gate.
    pub refused: Refusals,
    /// Commands that the gate limited in value or rate.
    pub limited: u64,
    /// Number of gate outputs.
    pub outputs: u64,
    /// Findings of the monitors of cameras and lidars, by the monitor's name.
    pub monitors: SensorChecks,
}

/// Observer that forwards the gate's output to the sink.
pub struct Outlet(Dispatcher<Watch>);

/// State of the drive so far.
struct Watch {
    orders: Sender<Order>,
    status: Arc<Mutex<DriveStatus>>,
    route: Route,
    mode: Option<GateMode>,
    figures: DriveFigures,
    beside_m: Vec<f32>,
    before: Option<EgoState>,
    /// Reported speeds of the last second, m/s.
    speeds: VecDeque<(Time, f64)>,
    checks: Arc<Mutex<SensorChecks>>,
}

/// Maximum number of reported speeds kept: a second at 2 kHz.
const SPEEDS_MAX: usize = 2000;
/// Maximum number of poses kept for the percentiles: five hours at 50 Hz.
const POSES_MAX: usize = 1_000_000;

impl Outlet {
    /// Creates an observer that sends to `orders` and updates `status` for the other threads.
    pub fn new(orders: Sender<Order>, status: Arc<Mutex<DriveStatus>>, route: Route) -> Self {
        let figures = DriveFigures::default();
        let (beside_m, speeds, checks) = (Vec::new(), VecDeque::new(), Arc::default());
        let watch =
            Watch { orders, status, route, mode: None, figures, beside_m, before: None, speeds, checks };
        let watch = Dispatcher::new(watch)
            .on::<SensorHealth>(|watch, publication, health| {
                let mut checks = lock(&watch.checks);
                checks.entry(publication.operator.to_owned()).or_default().take(health);
            })
            .on::<GateOutput>(Watch::gate)
            .on::<EgoState>(Watch::pose)
            .on::<VehicleReport>(Watch::report)
            .on::<Plan>(|watch, publication, plan| {
                let mut status = lock(&watch.status);
                (status.plan, status.planned) = (Some(plan.status), Some(publication.visible_at));
            });
        Self(watch)
    }

    /// Findings of the monitors so far, for the other threads.
    pub(super) fn checks(&self) -> Arc<Mutex<SensorChecks>> {
        self.0.state().checks.clone()
    }

    /// Returns the metrics and closes the channel of orders; the sink then stops a car that is still driven.
    pub fn conclude(self) -> DriveFigures {
        self.0.into_state().conclude()
    }
}

impl Watch {
    fn conclude(mut self) -> DriveFigures {
        self.beside_m.sort_by(f32::total_cmp);
        let at = |share: f64| {
            let n = self.beside_m.len();
            self.beside_m.get(((n.max(1) - 1) as f64 * share) as usize).map_or(0.0, |m| f64::from(*m))
        };
        self.figures.beside_p50_m = at(0.5);
        self.figures.beside_p99_m = at(0.99);
        self.figures.beside_max_m = at(1.0);
        self.figures.monitors = std::mem::take(&mut *lock(&self.checks));
        self.figures
    }

    fn gate(&mut self, publication: &Publication<'_>, output: &GateOutput) {
        // Fails only if the sink has ended, which happens only after the channel is closed.
        let _ = self.orders.send(Order::Gate(*output));
        if self.mode.replace(output.mode) != Some(output.mode) {
            let at_s = publication.visible_at.as_secs();
            self.figures.modes.push(ModeChange { at_s, mode: output.mode, reason: None });
            lock(&self.status).mode = output.mode;
        }
        if output.mode == GateMode::Driving {
            let follow = &mut lock(&self.status).follow;
            let MotionCommand { steering_rad, accel_mps2, .. } = output.command;
            (follow.commanded_rad, follow.commanded_mps2) = (steering_rad, accel_mps2);
        }
        self.figures.refused = output.refusals;
        self.figures.limited += u64::from(output.limited);
        self.figures.outputs += 1;
    }

    fn report(&mut self, _: &Publication<'_>, report: &VehicleReport) {
        let VehicleReport { stamp, speed_mps, steering_rad, .. } = *report;
        self.speeds.push_back((stamp, speed_mps));
        while self.speeds.len() > SPEEDS_MAX
            || self.speeds.get(1).is_some_and(|(second, _)| stamp - *second >= Span::from_ms(1000))
        {
            self.speeds.pop_front();
        }
        let first = self.speeds.front().filter(|(first, _)| stamp > *first);
        let accel_mps2 =
            first.map_or(0.0, |(first, before_mps)| (speed_mps - before_mps) / (stamp - *first).as_secs());
        let follow = &mut lock(&self.status).follow;
        (follow.reported_rad, follow.speed_mps, follow.accel_mps2) = (steering_rad, speed_mps, accel_mps2);
    }

    fn pose(&mut self, _: &Publication<'_>, ego: &EgoState) {
        {
            let mut status = lock(&self.status);
            (status.speed_mps, status.pose) = (ego.speed_mps, Some(ego.pose));
        }
        let before = self.before.replace(*ego);
        if self.mode != Some(GateMode::Driving) {
            return;
        }
        let figures = &mut self.figures;
        if let Some(before) = before {
            let dt = (ego.stamp - before.stamp).min(Span::from_ms(1000));
            figures.driving_s += dt.as_secs();
            figures.driven_m += before.pose.point().distance(ego.pose.point());
        }
        figures.speed_max_mps = figures.speed_max_mps.max(ego.speed_mps);
        if self.beside_m.len() < POSES_MAX {
            self.beside_m.push(self.route.project(ego.pose.point()).d_m.abs() as f32);
        }
    }
}

impl Observer for Outlet {
    fn event(&mut self, event: &Event<'_>) {
        self.0.event(event);
    }
}
