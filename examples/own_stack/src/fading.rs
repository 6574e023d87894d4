//! A predictor: all road users go straight on, ever slower.

use serde::{Deserialize, Serialize};
use swerve_core::Span;
use swerve_core::param::{ParamError, require_within};
use swerve_geom::Pose2;
use swerve_msg::{PredictedPose, Prediction, PredictionList, Track, TrackList};
use swerve_prediction::{Ground, Horizon, Predictor};
use swerve_stack::{NamedPredictor, PredictorSetup};

/// Parameters, in `prediction.params`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Time after which a road user has a quarter of its present speed, 0.1 to 100 s.
    fade_s: f64,
}

/// Predicts straight lines of a limited length.
pub struct Fading(Params);

impl Predictor for Fading {
    fn predict(&mut self, tracks: &TrackList, horizon: &Horizon, _: Ground<'_>) -> PredictionList {
        let fade_s = self.0.fade_s;
        let pose_after = |track: &Track, after: Span| {
            // Distance per speed, s: its slope falls from 1 to 1/4 at `fade_s`.
            let share_s = after.as_secs() * fade_s / (after.as_secs() + fade_s);
            let (pose, velocity) = (track.pose, track.velocity_mps);
            Pose2::new(pose.x_m + velocity.x * share_s, pose.y_m + velocity.y * share_s, pose.heading_rad)
        };
        let of = |track: &Track| {
            let afters = (0..=horizon.steps as i64).map(|k| horizon.step * k);
            let pose = |after| PredictedPose { at: tracks.stamp + after, pose: pose_after(track, after) };
            let Track { id, kind, extent, .. } = *track;
            Prediction::single(id, kind, extent, afters.map(pose).collect())
        };
        let predictions = tracks.tracks.iter().map(of).collect();
        PredictionList { stamp: tracks.stamp, predictions, joint: false }
    }
}

impl NamedPredictor for Fading {
    const NAME: &'static str = "fading";
    type Params = Params;

    fn defaults(_: PredictorSetup<'_>) -> Params {
        Params { fade_s: 10.0 }
    }

    fn with_params(params: Params, _: PredictorSetup<'_>) -> Result<Self, ParamError> {
        require_within("fade_s", params.fade_s, [0.1, 100.0])?;
        Ok(Self(params))
    }
}
