//! Road users that stopped, set off or came into sight moving recently, and may change their pace again.

use std::collections::BTreeMap;

use swerve_core::{Span, Time};
use swerve_msg::{ActorId, Prediction};

/// Thresholds with hysteresis: a road user at rest starts to move at the first speed; a moving one comes to rest below
/// the second, m/s.
const MOVES_MPS: f64 = 1.0;
const STANDS_MPS: f64 = 0.4;

/// Time for which changes are remembered.
const LATELY: Span = Span::from_ms(3000);

/// Pace of each road user, and the instant of its last change.
#[derive(Debug, Default)]
pub(super) struct Changes(BTreeMap<ActorId, Pace>);

#[derive(Clone, Copy, Debug)]
struct Pace {
    moves: bool,
    changed: Option<Time>,
    seen: Time,
}

impl Changes {
    /// Updates from predictions, whose first points give the speeds, and returns the road users that changed recently.
    pub(super) fn take(&mut self, stamp: Time, predictions: &[Prediction]) -> Vec<ActorId> {
        for one in predictions {
            let Some(speed_mps) = speed_mps(one) else { continue };
            let moves = speed_mps >= MOVES_MPS;
            // Whoever comes into sight moving may have set off behind what hid it.
            let new = Pace { moves, changed: moves.then_some(stamp), seen: stamp };
            let pace = self.0.entry(one.id).or_insert(new);
            pace.seen = stamp;
            let moves = speed_mps >= if pace.moves { STANDS_MPS } else { MOVES_MPS };
            if moves != pace.moves {
                (pace.moves, pace.changed) = (moves, Some(stamp));
            }
        }
        self.0.retain(|_, pace| stamp - pace.seen <= LATELY);
        let lately = |pace: &Pace| pace.changed.is_some_and(|changed| stamp - changed <= LATELY);
        self.0.iter().filter(|(_, pace)| lately(pace)).map(|(id, _)| *id).collect()
    }
}

/// Speed at the beginning of a prediction, m/s.
fn speed_mps(one: &Prediction) -> Option<f64> {
    let [now, next] = [one.path.first()?, one.path.get(1)?];
    let dt_s = (next.at - now.at).as_secs();
    (dt_s > 0.0).then(|| now.pose.point().distance(next.pose.point()) / dt_s)
}

#[cfg(test)]
mod tests {
    use swerve_geom::Pose2;
    use swerve_msg::{ActorKind, Extent, PredictedPose};

    use super::*;

    fn at(id: u32, speed_mps: f64, stamp: Time) -> Prediction {
        let place = |k: i64| PredictedPose {
            at: stamp + Span::from_ms(100) * k,
            pose: Pose2::new(0.1 * k as f64 * speed_mps, 0.0, 0.0),
        };
        let extent = Extent { length_m: 4.0, width_m: 2.0, height_m: 1.5 };
        Prediction::single(ActorId(id), ActorKind::Car, extent, (0..2).map(place).collect())
    }

    #[test]
    fn changes_of_pace_are_remembered_for_three_seconds() {
        let mut changes = Changes::default();
        let mut seen = |s: f64, speeds: [f64; 3]| {
            let stamp = Time::ZERO + Span::from_secs(s);
            let all: Vec<_> = (1..).zip(speeds).map(|(id, speed_mps)| at(id, speed_mps, stamp)).collect();
            changes.take(stamp, &all).iter().map(|id| id.0).collect::<Vec<_>>()
        };
        // One stops, one sets off, and one at rest seems to move a little.
        assert_eq!(seen(-4.0, [8.0, 0.0, 0.0]), [1], "came into sight moving");
        assert_eq!(seen(0.0, [8.0, 0.0, 0.0]), [0; 0]);
        assert_eq!(seen(1.0, [0.5, 0.9, 0.7]), [0; 0]);
        assert_eq!(seen(2.0, [0.3, 1.2, 0.7]), [1, 2]);
        assert_eq!(seen(4.9, [0.8, 1.2, 0.0]), [1, 2]);
        assert_eq!(seen(5.1, [0.8, 1.2, 0.7]), [0; 0]);
        assert_eq!(seen(5.2, [1.1, 1.2, 0.7]), [1], "on again");
    }
}
