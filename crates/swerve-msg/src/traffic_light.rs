//! Traffic lights in camera images.

use serde::{Deserialize, Serialize};
use swerve_core::Time;

use crate::Signal;

/// Traffic lights in one camera image.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TrafficLights {
    /// Instant of the image.
    pub stamp: Time,
    /// In map order; without a map, from the top of the image to the bottom.
    pub lights: Vec<TrafficLight>,
}

/// One traffic light.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TrafficLight {
    /// Name on the map; `None` without a map.
    pub name: Option<String>,
    /// Signal, filtered over this and previous images; `None` if unknown.
    pub signal: Option<Signal>,
    /// Signal in this image alone.
    pub seen: Option<Signal>,
    /// Confidence of `seen`, 0 to 1; 0 if nothing was seen.
    pub score: f64,
    /// Horizontal distance from the ego origin, metres.
    pub distance_m: f64,
    /// Position of its stop line along the newest route, metres; `None` without a map, or for other traffic.
    pub stop_s_m: Option<f64>,
    /// Left, top, right and bottom edge of the light's head in the image, pixels.
    pub image_px: [f64; 4],
}

impl TrafficLight {
    /// Short description: signal, confidence and distance.
    pub fn words(&self) -> String {
        let shown = self.signal.map_or("unknown", Signal::name);
        format!("{shown} {:.2} {:.0} m", self.score, self.distance_m)
    }
}
