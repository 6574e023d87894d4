//! Trackers of boxes that a configuration can name: built-in ones, and those of other crates.

use serde::Serialize;
use serde::de::DeserializeOwned;
use swerve_core::ParamError;
use swerve_perception::{Ab3dMot, GroundTracker, Tracker, ab3dmot, detector, tracker};
use swerve_text::{KeyProblem, overridden};

use crate::named::Of;
use crate::problems::outside;

/// Detector in front of a tracker, and settings of its tracks.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct TrackerSetup<'a> {
    /// Errors of the emulated detector, or the emulation's defaults.
    pub behind: &'a detector::Params,
    /// Number of past sightings that the predictor requires in a track.
    pub sightings_max: usize,
}

/// A tracker that `perception.tracker.algorithm` can name.
///
/// [`Registry::with_tracker`](crate::Registry::with_tracker) adds one. It then tracks the boxes of any detector in drives
/// and studies, with run times, as built-in trackers do.
pub trait NamedTracker: GroundTracker + Sized + 'static {
    /// Name in `perception.tracker.algorithm`.
    const NAME: &'static str;

    /// Parameters: the other keys of `perception.tracker`.
    type Params: Serialize + DeserializeOwned;

    /// Default parameters.
    fn defaults(of: TrackerSetup<'_>) -> Self::Params;

    /// Creates the tracker.
    ///
    /// # Errors
    /// A parameter out of its range.
    fn with_params(params: Self::Params, of: TrackerSetup<'_>) -> Result<Self, ParamError>;
}

/// A tracker's type, erased.
pub(crate) trait AnyTracker: Send + Sync {
    /// The tracker, from parameters that differ from the defaults.
    fn build(
        &self,
        of: TrackerSetup<'_>,
        params: &toml::Table,
    ) -> Result<Box<dyn GroundTracker>, Vec<KeyProblem>>;
}

impl<T: NamedTracker> AnyTracker for Of<T> {
    fn build(
        &self,
        of: TrackerSetup<'_>,
        params: &toml::Table,
    ) -> Result<Box<dyn GroundTracker>, Vec<KeyProblem>> {
        let params = overridden(&T::defaults(of), params)?;
        Ok(Box::new(T::with_params(params, of).map_err(outside)?))
    }
}

impl NamedTracker for Tracker {
    const NAME: &'static str = "sort";
    type Params = tracker::Params;

    fn defaults(TrackerSetup { behind, sightings_max }: TrackerSetup<'_>) -> tracker::Params {
        tracker::Params {
            sightings_max,
            range_noise_m: behind.range_noise_m,
            range_noise_share: behind.range_noise_share,
            bearing_noise_rad: behind.bearing_noise_rad,
            ..tracker::Params::default()
        }
    }

    fn with_params(params: tracker::Params, _: TrackerSetup<'_>) -> Result<Self, ParamError> {
        Self::new(params)
    }
}

impl NamedTracker for Ab3dMot {
    const NAME: &'static str = "ab3dmot";
    type Params = ab3dmot::Params;

    fn defaults(of: TrackerSetup<'_>) -> ab3dmot::Params {
        ab3dmot::Params { sightings_max: of.sightings_max, ..ab3dmot::Params::default() }
    }

    fn with_params(params: ab3dmot::Params, _: TrackerSetup<'_>) -> Result<Self, ParamError> {
        Self::new(params)
    }
}
