use serde::{Deserialize, Serialize};
use swerve_core::Time;

use crate::Signal;

/// The traffic lights in a camera's image.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TrafficLights {
    /// Instant of the image.
    pub stamp: Time,
    /// Those of a map in its order, or what was found from the top of the image to its bottom.
    pub lights: Vec<TrafficLight>,
}

/// One of them.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TrafficLight {
    /// Its name on the map; none without a map.
    pub name: Option<String>,
    /// What it shows, by this image and those before it; none where that is not known.
    pub signal: Option<Signal>,
    /// What this image alone shows.
    pub seen: Option<Signal>,
    /// How sure that is, 0 to 1; 0 where nothing is seen.
    pub score: f64,
    /// From the ego's origin to it over the ground, metres.
    pub distance_m: f64,
    /// Where its stop line is along the route, metres; none without a map.
    pub stop_s_m: Option<f64>,
    /// Left, top, right and bottom edge of its head in the image, pixels.
    pub image_px: [f64; 4],
}

impl TrafficLight {
    /// What it shows, how sure that is, and how far it is, in a few words.
    pub fn words(&self) -> String {
        let shown = self.signal.map_or("unknown", Signal::name);
        format!("{shown} {:.2} {:.0} m", self.score, self.distance_m)
    }
}
