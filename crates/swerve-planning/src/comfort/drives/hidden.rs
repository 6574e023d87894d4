//! Drives past vehicles that may hide somebody.

use swerve_msg::{ActorKind, EgoState};
use swerve_vehicle::Shape;

use super::{Instant, MANNERS, Script, drive_by, hardest_mps2, layer, over_line};
use crate::occlusion;

/// Drives among cars, with the rule for hidden places or without it.
fn drive(has_rule: bool, manner: super::Manner, speed_mps: f64, others: &[Script<'_>]) -> Vec<Instant> {
    let rule = occlusion::Params {
        phantom_speed_mps: 2.0,
        reaction_s: 0.35,
        brake_mps2: 7.0,
        least_speed_mps: 5.5,
        sight_m: 100.0,
    };
    let layer = layer(manner).with_occlusion(has_rule.then_some(rule));
    let ego = EgoState { speed_mps, ..EgoState::default() };
    drive_by(layer, f64::INFINITY, ego, speed_mps, [5.25, 4.5], (ActorKind::Car, others), 15.0)
}

/// A car stands 1.3 m beside the ego's outline: a person needs 0.67 s to the ego's side, 0.32 s of them are left to
/// brake with 7 m/s²: less than the least speed, which holds until the front is past the car.
#[test]
fn ego_slows_gently_beside_a_standing_car_that_may_hide_a_person() {
    let front_m = Shape::default().length_m - Shape::default().rear_overhang_m;
    for manner in MANNERS {
        let parked = |_: f64| [100.0, -3.2];
        let past_mps = |drive: &[Instant]| {
            let past = drive.iter().find(|i| i.ego.pose.x_m + front_m > 102.0).unwrap();
            past.ego.speed_mps
        };
        let slow = drive(true, manner, 14.0, &[&parked]);
        assert!((5.0..6.0).contains(&past_mps(&slow)), "{manner:?} {}", past_mps(&slow));
        assert!(hardest_mps2(&slow) < 3.5, "{manner:?} {}", hardest_mps2(&slow));
        assert!(slow.last().unwrap().ego.speed_mps > 8.0, "{manner:?} {:?}", slow.last());
        assert!(past_mps(&drive(false, manner, 14.0, &[&parked])) > 13.5, "{manner:?}");
        // Beyond the lane's other side and a pavement nobody reaches the ego in time.
        let far = |_: f64| [100.0, -7.0];
        assert!(past_mps(&drive(true, manner, 14.0, &[&far])) > 13.5, "{manner:?}");
    }
}

/// At 14 m/s past a car of 6 m/s, an oncoming car of 14 m/s at the end of 100 m of sight would be near before the ego is
/// back: after some 4 s over the line they have closed by 112 m.
#[test]
fn moving_car_is_not_overtaken_beyond_the_sight_along_the_other_lane() {
    for manner in &MANNERS[1..] {
        let lead = |t_s: f64| [60.0 + 6.0 * t_s, 0.0];
        assert!(over_line(&drive(false, *manner, 14.0, &[&lead])).0 > 1.0, "{manner:?}");
        let behind = drive(true, *manner, 14.0, &[&lead]);
        assert!(over_line(&behind).0 == 0.0 && behind.iter().all(|i| i.distance_m > 1.0), "{manner:?}");
    }
}
