//! An observer of a drive: it takes the gate's words on their way to the sink, and the figures.

use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex};

use serde::Serialize;
use swerve_core::Span;
use swerve_flow::{Dispatcher, Event, Observer, Publication};
use swerve_geom::Point2;
use swerve_msg::{EgoState, GateMode, GateOutput, Plan, PlanStatus, Refusals, Route};

use super::intake::lock;
use super::sink::Order;

/// The drive at the moment, for the other threads.
#[derive(Clone, Copy, Debug, Default)]
pub struct DriveStatus {
    /// The gate's mode.
    pub mode: GateMode,
    /// The ego's speed, m/s.
    pub speed_mps: f64,
    /// Where the ego is; none before that is known.
    pub at: Option<Point2>,
    /// The newest plan's status.
    pub plan: Option<PlanStatus>,
}

/// A change of the gate's mode.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct ModeChange {
    /// When, seconds of the run.
    pub at_s: f64,
    /// The mode from then on.
    pub mode: GateMode,
}

/// Figures of a drive.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct DriveFigures {
    /// How long the stack drove, s.
    pub driving_s: f64,
    /// How far it drove, m.
    pub driven_m: f64,
    /// The highest speed meanwhile, m/s.
    pub speed_max_mps: f64,
    /// Half of the time the ego's origin was at most this far beside the route, m.
    pub beside_p50_m: f64,
    /// 99 of 100 of the time.
    pub beside_p99_m: f64,
    /// At the most.
    pub beside_max_m: f64,
    /// All modes of the gate, in order.
    pub modes: Vec<ModeChange>,
    /// Commands that the gate refused.
    pub refused: Refusals,
    /// Commands that the gate had to change to be within limits or rates.
    pub limited: u64,
    /// Outputs of the gate.
    pub outputs: u64,
}

/// Takes the gate's outputs to the sink, and counts.
pub struct Outlet(Dispatcher<Watch>);

/// The drive so far.
struct Watch {
    orders: Sender<Order>,
    status: Arc<Mutex<DriveStatus>>,
    route: Route,
    mode: Option<GateMode>,
    figures: DriveFigures,
    beside_m: Vec<f32>,
    before: Option<EgoState>,
}

/// Poses that are kept for the percentiles: five hours at 50 Hz.
const POSES_MAX: usize = 1_000_000;

impl Outlet {
    /// Into `orders`, with `status` for the other threads.
    pub fn new(orders: Sender<Order>, status: Arc<Mutex<DriveStatus>>, route: Route) -> Self {
        let figures = DriveFigures::default();
        let watch = Watch { orders, status, route, mode: None, figures, beside_m: Vec::new(), before: None };
        let watch = Dispatcher::new(watch)
            .on::<GateOutput>(Watch::gate)
            .on::<EgoState>(Watch::pose)
            .on::<Plan>(|watch, _, plan| lock(&watch.status).plan = Some(plan.status));
        Self(watch)
    }

    /// The figures so far. The orders end here: the sink stops what still drives.
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
        self.figures
    }

    fn gate(&mut self, publication: &Publication<'_>, output: &GateOutput) {
        // It fails where the sink is gone, which only happens after the orders' end.
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
