//! Satellite receivers and the lane of the car, as localizers use them, and the new messages of a window.

use std::sync::Arc;

use swerve_flow::Message;
use swerve_geom::{FrenetPoint, Point2, math};
use swerve_localization::Sensed;
use swerve_localization::flat::Origin;
use swerve_localization::ndt::Isometry3;
use swerve_msg::{Gnss, Route};
use swerve_sim::sense::GnssParams;

use crate::config::SensingConfig;
use crate::site::Site;

/// Distance from the road, in standard deviations, from which a first fix is taken for a reflection.
const OFF_ROAD_SIGMAS: f64 = 3.0;

/// Model of a satellite receiver, and the lane of the car, once the route is known.
pub(super) struct Receiver {
    noise_m: f64,
    bias_m: f64,
    antenna_at_m: [f64; 3],
    origin: Origin,
    route: Option<Arc<Route>>,
}

impl Receiver {
    pub(super) fn new(site: &Site<'_>) -> Self {
        Self::of(&site.config().sensing)
    }

    pub(super) fn of(sensing: &SensingConfig) -> Self {
        let origin = sensing.map_origin();
        let GnssParams { noise_m, bias_m, antenna_at_m, .. } = sensing.gnss;
        Self { noise_m: noise_m.max(0.01), bias_m, antenna_at_m, origin, route: None }
    }

    /// Takes the newest route.
    pub(super) fn follow(&mut self, route: Option<Arc<Route>>) {
        self.route = route.or(self.route.take());
    }

    /// Position of the antenna on the map by a fix: east, north, up, metres.
    pub(super) fn place(&self, fix: &Gnss) -> Option<[f64; 3]> {
        self.origin.east_north_up_m(fix.latitude_deg, fix.longitude_deg, fix.altitude_m)
    }

    /// A fix as a measurement; `offset_m` is the error common to fixes along each axis.
    pub(super) fn sensed(&self, fix: &Gnss, offset_m: f64) -> Option<Sensed> {
        // A receiver's height is half as accurate as its position.
        let up_m = 2.0 * math::hypot(self.noise_m, offset_m);
        let at_m = self.place(fix)?;
        Some(Sensed::Fix { at_m, sigma_m: [self.noise_m, self.noise_m, up_m] })
    }

    /// Pose of the ego by a fix, level and along its lane; `None` without a route.
    pub(super) fn ego(&self, fix: &Gnss) -> Option<Isometry3<f64>> {
        let [east, north, up] = self.place(fix)?;
        let heading_rad = self.lane_heading_rad([east, north, up])?;
        let (sin, cos) = math::sin_cos(heading_rad);
        let [x, y, z] = self.antenna_at_m;
        let at_m = [east - (x * cos - y * sin), north - (x * sin + y * cos), up - z];
        Some(pose_of(at_m, heading_rad))
    }

    /// Heading of the lane at a position, radians; `None` without a route.
    pub(super) fn lane_heading_rad(&self, [x_m, y_m, _]: [f64; 3]) -> Option<f64> {
        let route = self.route.as_ref()?;
        let s_m = route.project(Point2::new(x_m, y_m)).s_m;
        Some(route.line().at(s_m).pose.heading_rad)
    }

    /// Returns true if a position may be on the ground along the route, within the errors of fixes, or no route is
    /// known.
    pub(super) fn may_be_on_road(&self, [x_m, y_m, _]: [f64; 3]) -> bool {
        let Some(route) = &self.route else { return true };
        let FrenetPoint { s_m, d_m } = route.project(Point2::new(x_m, y_m));
        let beyond_m = OFF_ROAD_SIGMAS * self.sigma_m();
        (-route.right_m(s_m) - beyond_m..=route.left_m(s_m) + beyond_m).contains(&d_m)
    }

    /// Standard deviation of a fix, metres.
    pub(super) fn sigma_m(&self) -> f64 {
        math::hypot(self.noise_m, self.bias_m)
    }
}

/// Pose of a car that is level at this position.
pub(super) fn pose_of(at_m: [f64; 3], heading_rad: f64) -> Isometry3<f64> {
    let (sin, cos) = math::sin_cos(heading_rad);
    let [x, y, z] = at_m;
    let rows = [cos, -sin, 0.0, x, sin, cos, 0.0, y, 0.0, 0.0, 1.0, z, 0.0, 0.0, 0.0, 1.0];
    swerve_localization::ndt::pose_of(&rows).unwrap_or_else(Isometry3::identity)
}

/// Messages of a window that were not taken before.
pub(super) fn new_messages<'a, T>(
    window: &'a [Message<T>],
    taken: &mut u64,
) -> impl Iterator<Item = &'a Message<T>> + use<'a, T> {
    let from = *taken;
    *taken = window.last().map_or(from, |newest| newest.header().seq + 1);
    window.iter().filter(move |message| message.header().seq >= from)
}
