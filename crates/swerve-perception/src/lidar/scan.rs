//! Input of the lidar object detector.

use swerve_geom::{Ego, Lidar, Transform};
use swerve_msg::{EgoState, PointCloud, Route};

/// Sweep and the state of the ego when it was measured.
#[derive(Clone, Copy, Debug)]
pub struct Scan<'a> {
    /// Points of the sweep.
    pub cloud: &'a PointCloud,
    /// Pose of the lidar above level ground: its mounting pose, with the pitch of the body.
    pub ego_from_lidar: Transform<Ego, Lidar>,
    /// Measured ego state at the cloud's stamp.
    pub ego: EgoState,
    /// Outline of the ego, within which points are ignored: rear and front from the origin, half of the width, metres.
    pub own_m: [f64; 3],
    /// Route, if known; vehicles mostly stand parallel to it.
    pub route: Option<&'a Route>,
}
