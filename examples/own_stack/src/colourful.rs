//! A camera detector: the feet of whatever is red or blue on the grey road ahead.

use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require_within};
use swerve_geom::Pose2;
use swerve_msg::{ActorKind, DetectedBox, Detections, Extent, Pixels, TrackList};
use swerve_perception::camera::{CameraDetector, Shot, ShotError};
use swerve_stack::config::camera_detectors::ground;
use swerve_stack::{DetectorSetup, NamedDetector};

/// Parameters, in `[operator.NAME.params]`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Difference of red and blue, 1 to 255.
    colour_min: u8,
}

/// Looks at every column or, on the rung `coarse`, at every fourth one.
pub struct Colourful(Params, usize);

impl CameraDetector for Colourful {
    fn detect(&mut self, of: &Shot<'_>, _: Option<&TrackList>, to: &mut Detections) -> Result<(), ShotError> {
        let Pixels::Rgb8(bytes) = &of.image.pixels else { return Err(ShotError::NoColour) };
        let [width, height] = [of.image.width_px, of.image.height_px].map(|px| px as usize);
        let (lens, ground) = (&of.image.camera.intrinsics, ground(&of.image.camera));
        let colour = |pixel: usize| bytes[3 * pixel].abs_diff(bytes[3 * pixel + 2]);
        *to = Detections { stamp: of.image.stamp, boxes: Vec::new() };
        for column in (0..width).step_by(self.1) {
            let mut rows = (ground.horizon_px as usize + 4..height).rev();
            let foot = rows.find(|row| colour(row * width + column) >= self.0.colour_min);
            let Some(foot) = foot else { continue };
            let x_m = ground.focal_px * ground.height_m / (foot as f64 + 1.0 - ground.horizon_px);
            let pose = Pose2::new(x_m + 2.0, (lens.cx_px - column as f64) / lens.fx_px * x_m, 0.0);
            let is_again = |one: &DetectedBox| one.pose.point().distance(pose.point()) < 1.5;
            if pose.y_m.abs() < 4.0 && !to.boxes.iter().any(is_again) {
                let extent = Extent { length_m: 0.6, width_m: 0.6, height_m: 1.7 };
                to.boxes.push(DetectedBox::on_ground(ActorKind::Pedestrian, 0.8, pose, extent));
            }
        }
        Ok(())
    }
}

impl NamedDetector for Colourful {
    const NAME: &'static str = "colourful";
    const RUNGS: &'static [(&'static str, f64)] = &[("coarse", 4.0), ("fine", 12.0)];
    type Params = Params;

    fn defaults(_: DetectorSetup<'_>) -> Params {
        Params { colour_min: 60 }
    }

    fn with_params(params: Params, of: DetectorSetup<'_>) -> Result<Self, ParamError> {
        require_within("colour_min", f64::from(params.colour_min), [1.0, 255.0])?;
        Ok(Self(params, if of.rung == "coarse" { 4 } else { 1 }))
    }
}
