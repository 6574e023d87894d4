use proptest::prelude::*;

use super::*;

/// Road users anywhere, in any direction.
fn tracks() -> impl Strategy<Value = Vec<(bool, [f64; 3], f64)>> {
    let pose = [-60.0..60.0, -60.0..60.0, -4.0..4.0];
    prop::collection::vec((any::<bool>(), pose, 0.0..20.0), 0..12)
}

proptest! {
    #[test]
    fn stops_are_not_behind_the_front(
        before_m in -30.0..60.0f64,
        speed_mps in 0.0..16.0f64,
        to in 0..3i32,
        tracks in tracks(),
    ) {
        let to = [FROM_WEST, FROM_SOUTH, FROM_NORTH][to as usize];
        let mut posed = at_crossing("crossing_right_first.xodr", [FROM_WEST, to], before_m, speed_mps);
        for (walks, [x_m, y_m, heading_rad], speed_mps) in tracks {
            let kind = if walks { ActorKind::Pedestrian } else { ActorKind::Car };
            posed = posed.other(kind, Pose2::new(x_m, y_m, heading_rad), speed_mps);
        }
        for _ in 0..5 {
            let decision = posed.decide();
            prop_assert!(decision.stops.iter().all(|stop| stop.s_m >= posed.front_m), "{decision:?}");
            prop_assert!(decision.stops.is_sorted_by(|a, b| a.s_m <= b.s_m));
            prop_assert!(decision.yields.is_sorted_by(|a, b| a < b));
            prop_assert!(decision.expected_to_yield.is_sorted_by(|a, b| a.id < b.id));
            posed.front_m += 0.1 * speed_mps;
        }
    }
}
