//! The way as it lies in the ego frame: what stands beside it mostly stands along it.

use swerve_geom::{Ego, FrenetPoint, Point2, Pose2};
use swerve_msg::Route;

/// How far along the way from the ego it is looked at, metres.
const ALONG_M: f64 = 80.0;

/// The way, where it is known.
pub(crate) struct Road<'a> {
    route: Option<&'a Route>,
    ego: Pose2,
    near_s_m: f64,
}

impl<'a> Road<'a> {
    /// As seen from the ego's pose in the map.
    pub(crate) fn new(route: Option<&'a Route>, ego: Pose2) -> Self {
        let route = route.filter(|_| ego.is_finite());
        let near_s_m = route.map_or(0.0, |route| route.project(ego.point()).s_m);
        Self { route, ego, near_s_m }
    }

    /// Its heading beside a point, in the ego frame, radians, and how far beyond the drivable ground the point is, metres.
    pub(crate) fn at(&self, point: Point2<Ego>) -> Option<(f64, f64)> {
        let route = self.route?;
        let at = self.ego.from_local::<Ego>(point);
        let FrenetPoint { s_m, d_m } = route.project_near(at, self.near_s_m, ALONG_M);
        let heading_rad = route.line().at(s_m).pose.heading_rad - self.ego.heading_rad;
        let beyond_m = (d_m - route.left_m(s_m)).max(-d_m - route.right_m(s_m));
        Some((heading_rad, beyond_m))
    }
}
