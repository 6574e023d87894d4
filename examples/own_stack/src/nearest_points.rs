//! A lidar detector: the nearest points above the road ahead, as one box.

use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require_within};
use swerve_geom::{Point, Pose2};
use swerve_msg::{ActorKind, DetectedBox, Detections, Extent, PointCloud};
use swerve_perception::lidar::{LidarDetector, Scan};
use swerve_stack::NamedLidarDetector;

/// Its keys in `[operator.NAME]`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Half of the width that it looks at, 0.5 to 10 m.
    half_width_m: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self { half_width_m: 3.0 }
    }
}

/// Finds one object in each sweep.
pub struct NearestPoints(Params);

impl LidarDetector for NearestPoints {
    fn detect(&mut self, scan: &Scan<'_>, out: &mut Detections) {
        let PointCloud { stamp, x_m, y_m, z_m, .. } = scan.cloud;
        let points = x_m.iter().zip(&y_m[..]).zip(&z_m[..]).map(|((&x, &y), &z)| {
            let point = Point::new(f64::from(x), f64::from(y), f64::from(z));
            (scan.ego_from_lidar * point).coords
        });
        let is_ahead = |x_m: f64, y_m: f64| x_m > scan.own_m[1] && y_m.abs() < self.0.half_width_m;
        let ahead = points.filter(|p| is_ahead(p.x, p.y) && (0.4..2.0).contains(&p.z));
        let nearest = ahead.min_by(|a, b| a.x.total_cmp(&b.x));
        let extent = Extent { length_m: 0.6, width_m: 0.6, height_m: 1.7 };
        let pose = nearest.map(|at| Pose2::new(at.x + 0.3, at.y, 0.0));
        let found = pose.map(|pose| DetectedBox::on_ground(ActorKind::Pedestrian, 0.9, pose, extent));
        *out = Detections { stamp: *stamp, boxes: found.into_iter().collect() };
    }
}

impl NamedLidarDetector for NearestPoints {
    const NAME: &'static str = "nearest_points";
    const DOC: &'static str = "box of the nearest points above the road ahead";
    type Params = Params;

    fn validate(params: &Params) -> Result<(), ParamError> {
        require_within("half_width_m", params.half_width_m, [0.5, 10.0])
    }

    fn with_params(params: Params) -> Result<Self, ParamError> {
        Ok(Self(params))
    }
}
