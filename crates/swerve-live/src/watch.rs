//! Observer of a drive: forwards the gate's output to the sink, and collects metrics.

use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex};

use serde::Serialize;
use swerve_core::Span;
use swerve_flow::{Dispatcher, Event, Observer, Publication};
use swerve_geom::Point2;
use swerve_msg::{EgoState, GateMode, GateOutput, Plan, PlanStatus, Refusals, Route, SensorHealth};

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
    /// Position of the ego in the map; `None` until known.
    pub at: Option<Point2>,
    /// Status of the newest plan.
    pub plan: Option<PlanStatus>,
}

/// A change of the gate's mode.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct ModeChange {
    /// Instant, seconds of run time.
    pub at_s: f64,
    /// New mode.
    pub mode: GateMode,
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
    checks: Arc<Mutex<SensorChecks>>,
}

/// Maximum number of poses kept for the percentiles: five hours at 50 Hz.
const POSES_MAX: usize = 1_000_000;

impl Outlet {
    /// Creates an observer that sends to `orders` and updates `status` for the other threads.
    pub fn new(orders: Sender<Order>, status: Arc<Mutex<DriveStatus>>, route: Route) -> Self {
        let figures = DriveFigures::default();
        let (beside_m, checks) = (Vec::new(), Arc::default());
        let watch = Watch { orders, status, route, mode: None, figures, beside_m, before: None, checks };
        let watch = Dispatcher::new(watch)
            .on::<SensorHealth>(|watch, publication, health| {
                let mut checks = lock(&watch.checks);
                checks.entry(publication.operator.to_owned()).or_default().take(health);
            })
            .on::<GateOutput>(Watch::gate)
            .on::<EgoState>(Watch::pose)
            .on::<Plan>(|watch, _, plan| lock(&watch.status).plan = Some(plan.status));
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
            self.figures.modes.push(ModeChange { at_s: publication.visible_at.as_secs(), mode: output.mode });
            lock(&self.status).mode = output.mode;
        }
        self.figures.refused = output.refusals;
        self.figures.limited += u64::from(output.limited);
        self.figures.outputs += 1;
    }

    fn pose(&mut self, _: &Publication<'_>, ego: &EgoState) {
        {
            let mut status = lock(&self.status);
            (status.speed_mps, status.at) = (ego.speed_mps, Some(ego.pose.point()));
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
