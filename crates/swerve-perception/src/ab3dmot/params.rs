//! Parameters of the AB3DMOT tracker.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, Ranges, require_within};
use swerve_msg::ActorKind;

use super::solid::Solid;

/// Affinity measure between a box and a track.
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

/// Assignment of boxes to tracks.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Pairing {
    /// Optimal assignment: the largest total affinity.
    Hungarian,
    /// Greedy assignment: the best pair first, then the best of the remaining ones.
    Greedy,
}

/// Tracking rules for a group of object kinds.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields)]
pub struct Rules {
    /// Affinity measure between a box and a track.
    pub affinity: Affinity,
    /// Affinity limit for pairing: the smallest overlap (`giou`: -1 to 1, `iou`: 0 to 1), or the largest distance in
    /// metres (0.01 to 50).
    #[schemars(extend("minimum" = -1, "maximum" = 50))]
    pub limit: f64,
    /// Assignment of boxes to tracks.
    pub pairing: Pairing,
    /// Number of boxes after which a track is reported.
    #[schemars(range(min = 1, max = 100))]
    pub birth: usize,
    /// Number of consecutive frames without a box after which a track ends.
    #[schemars(range(min = 1, max = 100))]
    pub death: usize,
}

impl Rules {
    /// Cost of a pair; below [`cost_max`](Self::cost_max) if the pair is allowed.
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

/// Parameters of the AB3DMOT tracker.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Score below which boxes are ignored, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub score_min: f64,
    /// Number of positions in a track's reported history, including the current one.
    #[schemars(range(min = 1, max = 1000))]
    pub sightings_max: usize,
    /// Frame period to which the noises refer, seconds: the sweep period of the data for which the paper's constants
    /// were tuned.
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub frame_s: f64,
    /// Tracking rules for motor vehicles and static objects.
    #[ranges(nested)]
    pub vehicle: Rules,
    /// Tracking rules for pedestrians.
    #[ranges(nested)]
    pub pedestrian: Rules,
    /// Tracking rules for cyclists.
    #[ranges(nested)]
    pub cyclist: Rules,
}

impl Default for Params {
    /// Parameters published by the authors for KITTI's cars, pedestrians and cyclists.
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

/// Motor vehicles and static objects.
const VEHICLES: &[ActorKind] = &[ActorKind::Car, ActorKind::Truck, ActorKind::Motorcycle, ActorKind::Static];

impl Params {
    /// Groups of kinds that may share a track, and their rules.
    pub(super) fn groups(&self) -> [(&'static [ActorKind], &Rules); 3] {
        [
            (VEHICLES, &self.vehicle),
            (&[ActorKind::Pedestrian], &self.pedestrian),
            (&[ActorKind::Cyclist], &self.cyclist),
        ]
    }

    /// Rules of a kind.
    pub fn rules(&self, kind: ActorKind) -> &Rules {
        match kind {
            ActorKind::Pedestrian => &self.pedestrian,
            ActorKind::Cyclist => &self.cyclist,
            ActorKind::Car | ActorKind::Truck | ActorKind::Motorcycle | ActorKind::Static => &self.vehicle,
        }
    }

    /// Checks that all parameters are in range.
    ///
    /// # Errors
    /// The first parameter outside its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        self.check_ranges()?;
        let groups =
            [("vehicle", &self.vehicle), ("pedestrian", &self.pedestrian), ("cyclist", &self.cyclist)];
        groups.into_iter().try_for_each(|(group, rules)| {
            let range = match rules.affinity {
                Affinity::Giou => [-1.0, 1.0],
                Affinity::Iou => [0.0, 1.0],
                Affinity::Distance => [0.01, 50.0],
            };
            require_within("limit", rules.limit, range).map_err(|error| error.under(group))
        })
    }
}
