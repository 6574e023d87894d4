//! Route in the ego frame; vehicles beside it mostly stand parallel to it.

use swerve_geom::{Ego, FrenetPoint, Point2, Pose2};
use swerve_msg::Route;

/// Search range along the route from the ego, metres.
const ALONG_M: f64 = 80.0;

/// Route in the ego frame, if known.
pub(crate) struct Road<'a> {
    route: Option<&'a Route>,
    ego: Pose2,
    near_s_m: f64,
}

impl<'a> Road<'a> {
    /// Route relative to the ego's pose in the map.
    pub(crate) fn new(route: Option<&'a Route>, ego: Pose2) -> Self {
        let route = route.filter(|_| ego.is_finite());
        let near_s_m = route.map_or(0.0, |route| route.project(ego.point()).s_m);
        Self { route, ego, near_s_m }
    }

    /// Heading of the route beside a point, in the ego frame, radians, and the distance of the point beyond the
    /// drivable ground, metres.
    pub(crate) fn at(&self, point: Point2<Ego>) -> Option<(f64, f64)> {
        let route = self.route?;
        let at = self.ego.from_local::<Ego>(point);
        let FrenetPoint { s_m, d_m } = route.project_near(at, self.near_s_m, ALONG_M);
        let heading_rad = route.line().at(s_m).pose.heading_rad - self.ego.heading_rad;
        let beyond_m = (d_m - route.left_m(s_m)).max(-d_m - route.right_m(s_m));
        Some((heading_rad, beyond_m))
    }
}
