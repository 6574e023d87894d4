//! Overtaking with a pose that lasts for a way only.

use super::*;

#[test]
fn a_slow_lead_is_overtaken_only_where_the_pose_lasts() {
    let ego = EgoState { speed_mps: 14.0, ..EgoState::default() };
    let slow = |t_s: f64| [40.0 + 6.0 * t_s, 0.0];
    let stands = |_: f64| [60.0, 0.0];
    for manner in &MANNERS[1..] {
        let within = |most_m: f64, ahead: Script<'_>| {
            let ground = ([5.25, 1.75], *manner);
            drive_within(most_m, ego, 14.0, ground, (ActorKind::Car, &[ahead]), 20.0)
        };
        let free = within(f64::INFINITY, &slow);
        let way_m = 14.0 * over_line(&free).0;
        let long = within(way_m + 30.0, &slow);
        assert!(long.last().unwrap().gap_m < -20.0, "{manner:?}");
        let short = within(0.5 * way_m, &slow);
        assert!(over_line(&short).0 == 0.0 && short.last().unwrap().gap_m > 9.0, "{manner:?} {way_m}");
        // What stands ends where it stands: an ego that has begun to pass it comes past.
        assert!(within(0.0, &stands).last().unwrap().gap_m < -4.5, "{manner:?}");
    }
}
