//! Parameters of the tracker by overlap.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require_all_within};
use swerve_msg::ActorKind;

use super::solid::Solid;

/// What makes a box and a track alike.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Affinity {
    /// Generalised intersection over union of volumes, -1 to 1.
    Giou,
    /// Intersection over union of volumes, 0 to 1.
    Iou,
    /// Distance of the centres, metres.
    Distance,
}

/// How pairs are chosen.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Pairing {
    /// The best pairs in sum.
    Hungarian,
    /// The best pair, then the best of the rest.
    Greedy,
}

/// How things of some kinds are followed.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rules {
    /// What makes a box and a track alike.
    pub affinity: Affinity,
    /// Beyond it they are not: the least overlap, or the largest distance, metres.
    pub limit: f64,
    /// How pairs are chosen.
    pub pairing: Pairing,
    /// Boxes that a track has to have had to be reported.
    pub birth: usize,
    /// Frames without a box at which a track ends.
    pub death: usize,
}

impl Rules {
    /// What a pair costs, below [`cost_max`](Self::cost_max) where it can be one.
    pub(super) fn cost(&self, track: &Solid, found: &Solid) -> f64 {
        match self.affinity {
            Affinity::Distance => track.distance_m(found),
            Affinity::Giou if track.is_far(found, self.limit) => f64::INFINITY,
            Affinity::Giou => 1.0 - track.giou(found),
            Affinity::Iou => 1.0 - track.iou(found),
        }
    }

    pub(super) fn cost_max(&self) -> f64 {
        if self.affinity == Affinity::Distance { self.limit } else { 1.0 - self.limit }
    }
}

/// Parameters of the tracker by overlap.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Boxes with a lower score are ignored.
    pub score_min: f64,
    /// Past positions reported, the present one included.
    pub sightings_max: usize,
    /// Time that noises are those of, seconds: that between two sweeps, where the paper's constants are from.
    pub frame_s: f64,
    /// How motor vehicles are followed, and what cannot move.
    pub vehicle: Rules,
    /// How people on foot are.
    pub pedestrian: Rules,
    /// How people on bicycles are.
    pub cyclist: Rules,
}

impl Default for Params {
    /// Those that the authors publish for KITTI's cars, pedestrians and cyclists.
    fn default() -> Self {
        let rules = |affinity, limit, pairing, [birth, death]: [usize; 2]| Rules {
            affinity,
            limit,
            pairing,
            birth,
            death,
        };
        Self {
            score_min: 0.4,
            sightings_max: 10,
            frame_s: 0.1,
            vehicle: rules(Affinity::Giou, -0.2, Pairing::Hungarian, [3, 2]),
            pedestrian: rules(Affinity::Giou, -0.4, Pairing::Greedy, [1, 4]),
            cyclist: rules(Affinity::Distance, 2.0, Pairing::Hungarian, [3, 4]),
        }
    }
}

/// Motor vehicles, and what cannot move.
const VEHICLES: &[ActorKind] = &[ActorKind::Car, ActorKind::Truck, ActorKind::Motorcycle, ActorKind::Static];

impl Params {
    /// Which kinds may be one track, and their rules.
    pub(super) fn groups(&self) -> [(&'static [ActorKind], &Rules); 3] {
        [
            (VEHICLES, &self.vehicle),
            (&[ActorKind::Pedestrian], &self.pedestrian),
            (&[ActorKind::Cyclist], &self.cyclist),
        ]
    }

    /// The rules of a kind.
    pub fn rules(&self, kind: ActorKind) -> &Rules {
        match kind {
            ActorKind::Pedestrian => &self.pedestrian,
            ActorKind::Cyclist => &self.cyclist,
            ActorKind::Car | ActorKind::Truck | ActorKind::Motorcycle | ActorKind::Static => &self.vehicle,
        }
    }

    /// The first parameter outside its range.
    ///
    /// # Errors
    /// There is one.
    pub fn validate(&self) -> Result<(), ParamError> {
        let limits = |rules: &Rules| match rules.affinity {
            Affinity::Giou => [-1.0, 1.0],
            Affinity::Iou => [0.0, 1.0],
            Affinity::Distance => [0.01, 50.0],
        };
        let counts = [1.0, 100.0];
        require_all_within(&[
            ("score_min", self.score_min, [0.0, 1.0]),
            ("sightings_max", self.sightings_max as f64, [1.0, 1000.0]),
            ("frame_s", self.frame_s, [1e-3, 10.0]),
            ("vehicle.limit", self.vehicle.limit, limits(&self.vehicle)),
            ("vehicle.birth", self.vehicle.birth as f64, counts),
            ("vehicle.death", self.vehicle.death as f64, counts),
            ("pedestrian.limit", self.pedestrian.limit, limits(&self.pedestrian)),
            ("pedestrian.birth", self.pedestrian.birth as f64, counts),
            ("pedestrian.death", self.pedestrian.death as f64, counts),
            ("cyclist.limit", self.cyclist.limit, limits(&self.cyclist)),
            ("cyclist.birth", self.cyclist.birth as f64, counts),
            ("cyclist.death", self.cyclist.death as f64, counts),
        ])
    }
}
