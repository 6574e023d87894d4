//! Detectors for cameras and lidars that a configuration can name: built-in ones, files of weights, and those of other
//! crates.

use std::borrow::Cow;

use serde::Serialize;
use serde::de::DeserializeOwned;
use swerve_core::ParamError;
use swerve_perception::camera::CameraDetector;
use swerve_perception::lidar::{self, LidarDetector};
use swerve_perception::{CameraObjects, LidarObjects};
use swerve_text::{KeyProblem, overridden};
use swerve_vision::acf::Weights;

use crate::config::camera_detectors::{run_time, weights};
use crate::config::execution::Runtime;
use crate::named::Of;
use crate::problems::{outside, within};

/// Settings of an operator `camera_objects` for its detector.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct DetectorSetup<'a> {
    /// Rung: the way to use the detector.
    pub rung: &'a str,
    /// `score_min`: score below which boxes are not reported.
    pub score_min: f64,
}

/// One way to use a detector: a compromise of accuracy and run time.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct DetectorRung {
    /// Name in the key `rung`.
    pub(crate) name: Cow<'static, str>,
    /// Run time; `None` if none was measured.
    pub(crate) run_time: Option<Runtime>,
    /// True if it searches some images around tracks only, and therefore reads them.
    pub(crate) follows_tracks: bool,
}

/// A camera detector that the key `detector` of an operator `camera_objects` can name.
///
/// [`Registry::with_detector`](crate::Registry::with_detector) adds one. It then has everything that built-in detectors
/// have: rungs with run times, the ladder of rungs, periodic execution, deadlines, sensor fusion, studies.
pub trait NamedDetector: CameraDetector + Sized + 'static {
    /// Name in `detector`.
    const NAME: &'static str;

    /// Rungs, the ways to use it, at least one and the coarsest first: names in the key `rung`, and run times, ms. The
    /// last one is used where the key is absent.
    const RUNGS: &'static [(&'static str, f64)];

    /// True if it reads tracks, to search around them.
    const FOLLOWS_TRACKS: bool = false;

    /// Parameters: the keys of `params`.
    type Params: Serialize + DeserializeOwned;

    /// Default parameters.
    fn defaults(of: DetectorSetup<'_>) -> Self::Params;

    /// Creates the detector.
    ///
    /// # Errors
    /// A parameter out of its range.
    fn with_params(params: Self::Params, of: DetectorSetup<'_>) -> Result<Self, ParamError>;
}

/// A lidar detector that `kind` of an operator can name.
///
/// [`Registry::with_lidar_detector`](crate::Registry::with_lidar_detector) adds one. It then has everything that the
/// built-in detector has: the mounting pose of its lidar, the pose of the ego at each sweep, run times, sensor fusion.
pub trait NamedLidarDetector: LidarDetector + Sized + 'static {
    /// Name of the kind.
    const NAME: &'static str;

    /// Description in `swerve operators`.
    const DOC: &'static str;

    /// Parameters: the keys of the operator.
    type Params: Serialize + DeserializeOwned + Default;

    /// Checks the parameters.
    ///
    /// # Errors
    /// A parameter out of its range.
    fn validate(_: &Self::Params) -> Result<(), ParamError> {
        Ok(())
    }

    /// Creates the detector.
    ///
    /// # Errors
    /// A parameter out of its range.
    fn with_params(params: Self::Params) -> Result<Self, ParamError>;
}

impl NamedLidarDetector for LidarObjects {
    const NAME: &'static str = "lidar_objects";
    const DOC: &'static str = "boxes of cars, trucks, cyclists and people in a lidar's points";
    type Params = lidar::Params;

    fn validate(params: &lidar::Params) -> Result<(), ParamError> {
        params.validate()
    }

    fn with_params(params: lidar::Params) -> Result<Self, ParamError> {
        Self::new(params)
    }
}

/// A detector's type, erased.
pub(crate) trait AnyDetector: Send + Sync {
    /// Rungs, at least one.
    ///
    /// # Errors
    /// The detector is damaged.
    fn rungs(&self) -> Result<Vec<DetectorRung>, String>;

    /// The detector, from parameters that differ from the defaults.
    ///
    /// # Errors
    /// Problems by their keys in the operator's table.
    fn build(
        &self,
        of: DetectorSetup<'_>,
        params: &toml::Table,
    ) -> Result<Box<dyn CameraDetector>, Vec<KeyProblem>>;
}

impl<D: NamedDetector> AnyDetector for Of<D> {
    fn rungs(&self) -> Result<Vec<DetectorRung>, String> {
        let rung = |&(name, ms): &(&'static str, f64)| DetectorRung {
            name: name.into(),
            run_time: Some(Runtime::fixed(ms)),
            follows_tracks: D::FOLLOWS_TRACKS,
        };
        Ok(D::RUNGS.iter().map(rung).collect())
    }

    fn build(
        &self,
        of: DetectorSetup<'_>,
        params: &toml::Table,
    ) -> Result<Box<dyn CameraDetector>, Vec<KeyProblem>> {
        let built = overridden(&D::defaults(of), params)
            .and_then(|params| D::with_params(params, of).map_err(outside));
        Ok(Box::new(built.map_err(|found| within("params", found))?))
    }
}

/// A detector without neural networks: a built-in one, or one in a file of weights.
pub(crate) struct ByWeights(pub(crate) Cow<'static, str>);

impl ByWeights {
    fn weights(&self) -> Result<Weights, String> {
        weights(&self.0)
    }
}

impl AnyDetector for ByWeights {
    fn rungs(&self) -> Result<Vec<DetectorRung>, String> {
        let rung = |rung: swerve_vision::acf::Rung| DetectorRung {
            run_time: run_time(&self.0, &rung.name),
            follows_tracks: rung.whole_every > 1,
            name: rung.name.into(),
        };
        Ok(self.weights()?.rungs.into_iter().map(rung).collect())
    }

    fn build(
        &self,
        of: DetectorSetup<'_>,
        params: &toml::Table,
    ) -> Result<Box<dyn CameraDetector>, Vec<KeyProblem>> {
        if let Some(key) = params.keys().next() {
            return Err(vec![(format!("params.{key}"), "unknown key; expected none".to_owned())]);
        }
        let wrong = |message: String| vec![("detector".to_owned(), message)];
        let weights = self.weights().map_err(wrong)?;
        let rung = crate::config::camera_detectors::rung(&weights, of.rung).map_err(wrong)?.clone();
        let objects = CameraObjects::new(weights, rung, of.score_min);
        Ok(Box::new(objects.map_err(|error| wrong(format!("`{}`: {error}", self.0)))?))
    }
}
