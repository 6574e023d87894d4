//! Overtaking with a pose estimate that is valid for a limited distance.

use super::*;

#[test]
fn slow_lead_is_overtaken_only_while_the_pose_estimate_is_valid() {
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
        // Passing a standing vehicle ends where it stands: an ego that has begun completes the pass.
        assert!(within(0.0, &stands).last().unwrap().gap_m < -4.5, "{manner:?}");
    }
}

#[test]
fn a_lead_that_stops_for_two_seconds_is_not_passed() {
    // With 4 m/s2 from 8 m/s to rest at 4 s, then from 6 s on with 2 m/s2 up to 8 m/s.
    let stops = |t_s: f64| {
        let braked_m = at_speeds_m(&[(0.0, 8.0), (2.0, 0.0)], 4.0, t_s.min(4.0));
        let on_s = (t_s - 6.0).clamp(0.0, 4.0);
        [30.0 + braked_m + on_s * on_s + 8.0 * (t_s - 10.0).max(0.0), 0.0]
    };
    let stays = |t_s: f64| stops(t_s.min(6.0));
    let ego = EgoState { speed_mps: 8.0, ..EgoState::default() };
    for manner in &MANNERS[1..] {
        let among = |lead: Script<'_>| {
            drive_from(ego, 12.0, ([5.25, 1.75], *manner), (ActorKind::Car, &[lead]), 16.0)
        };
        let goes_on = among(&stops);
        assert!(over_line(&goes_on).0 == 0.0 && goes_on.last().unwrap().gap_m > 2.0, "{manner:?}");
        assert!(among(&stays).last().unwrap().gap_m < 0.0, "{manner:?}: one that stays is passed");
    }
}

#[test]
fn a_person_who_hurries_across_is_stopped_for() {
    // From the right edge, when the ego's front is 19 m away: 1.6 m/s, and 3.4 m/s after 2 m.
    let hurries = |t_s: f64| {
        let slow_s = (t_s - 2.0).clamp(0.0, 1.25);
        [47.0, -3.4 + 1.6 * slow_s + 3.4 * (t_s - 3.25).clamp(0.0, 2.0)]
    };
    for manner in &MANNERS[1..] {
        let ego = EgoState { speed_mps: 12.0, ..EgoState::default() };
        let others: (ActorKind, &[Script<'_>]) = (ActorKind::Pedestrian, &[&hurries]);
        let drive = drive_from(ego, 12.0, ([5.25, 1.75], *manner), others, 8.0);
        let least_m = drive.iter().map(|i| i.distance_m).fold(f64::INFINITY, f64::min);
        assert!(least_m > 1.0 && over_line(&drive).0 == 0.0, "{manner:?} {least_m}");
        assert!(hardest_mps2(&drive) < 6.6, "{manner:?} {}", hardest_mps2(&drive));
    }
}

/// A person sets off from the right edge: where the ego can stop, it does, and does not cross in front of her or go round.
#[test]
fn an_ego_on_a_fast_road_stops_short_of_a_person_who_steps_out() {
    for (speed_mps, from_m) in [(16.0, 31.0), (18.0, 37.0), (20.0, 45.0), (22.0, 55.0)] {
        let crosses = move |t_s: f64| [from_m, -3.0 + 1.6 * (t_s - 0.1).clamp(0.0, 5.6)];
        for manner in &MANNERS[1..] {
            let ego = EgoState { speed_mps, ..EgoState::default() };
            let others: (ActorKind, &[Script<'_>]) = (ActorKind::Pedestrian, &[&crosses]);
            let drive = drive_from(ego, speed_mps, ([5.25, 1.75], *manner), others, 7.0);
            let least_m = drive.iter().map(|i| i.distance_m).fold(f64::INFINITY, f64::min);
            assert!(least_m > 0.5 && over_line(&drive).0 == 0.0, "{manner:?} {speed_mps} {least_m}");
        }
    }
}

/// A car at 8 m/s that a standing vehicle has hidden comes into sight 45 m ahead when the ego's nose is over the line.
#[test]
fn ego_that_moves_out_stops_at_once_for_a_car_that_comes_into_sight() {
    let stands = |_: f64| [13.0, 0.0];
    let nose_m = |i: &Instant| {
        let corners = Shape::default().footprint(i.ego.pose).corners();
        corners.iter().map(|corner| corner.y_m).fold(f64::NEG_INFINITY, f64::max)
    };
    for manner in &MANNERS[1..] {
        let among = |others: &[Script<'_>], until_s: f64| {
            let others = (ActorKind::Car, others);
            drive_from(EgoState::default(), 9.0, ([5.25, 1.75], *manner), others, until_s)
        };
        let alone = among(&[&stands], 15.0);
        let out = alone.iter().find(|i| nose_m(i) > 2.0).unwrap();
        let (seen_s, from_m) = (out.t_s, out.ego.pose.x_m + 45.0);
        let comes = |t_s: f64| match t_s < seen_s {
            true => [from_m, 500.0],
            false => [from_m - 8.0 * (t_s - seen_s), 3.5],
        };
        let drive = among(&[&stands, &comes], 25.0);
        let least_m = drive.iter().map(|i| i.distance_m).fold(f64::INFINITY, f64::min);
        assert!(least_m > 0.1, "{manner:?} {least_m}");
        assert!(drive.last().unwrap().ego.pose.x_m > 40.0, "{manner:?}: it passes afterwards");
    }
}
