//! Drives with little room or time: pulling out from behind parked vehicles, past rows and through gaps, returning from
//! an aborted pass, and stopping short of people.

use super::*;

const WIDE_M: [f64; 2] = [5.25, 1.75];

fn from_rest(y_m: f64) -> EgoState {
    EgoState { pose: Pose2::new(0.0, y_m, 0.0), ..EgoState::default() }
}

/// From rest, right of the centre, behind a car parked so close to the edge that the lane has room beside it.
#[test]
fn an_ego_at_rest_pulls_out_from_behind_a_parked_car() {
    for (d_m, gap_m) in [(-0.8, 4.0), (-1.4, 4.0), (-1.4, 6.0), (-2.2, 6.0), (-2.2, 13.0)] {
        let parked = move |_: f64| [3.7 + gap_m + 2.25, -2.2];
        let ego = EgoState { pose: Pose2::new(0.0, d_m, 0.0), ..EgoState::default() };
        let drive =
            drive_from(ego, 8.0, ([5.25, 3.5], Manner::GoesRound), (ActorKind::Car, &[&parked]), 14.0);
        let end = drive.last().unwrap();
        assert!(end.ego.speed_mps > 7.0 && end.ego.pose.y_m.abs() < 0.3, "{d_m} m {gap_m} m: {end:?}");
        let least_m = drive.iter().map(|it| it.distance_m).fold(f64::INFINITY, f64::min);
        assert!(least_m > 0.35 && hardest_mps2(&drive) < 1.0, "{d_m} m {gap_m} m: {least_m} m");
    }
}

#[test]
fn a_row_of_any_length_is_passed_from_rest() {
    for count in [1, 5, 8] {
        let parked: Vec<_> = (0..count).map(|k| move |_: f64| [14.0 + 6.5 * f64::from(k), -1.2]).collect();
        let parked: Vec<Script<'_>> = parked.iter().map(|one| one as Script<'_>).collect();
        let cars = (ActorKind::Car, &parked[..]);
        let drive = drive_from(from_rest(0.0), 11.0, (WIDE_M, Manner::GoesRound), cars, 25.0);
        let end = drive.last().unwrap().ego.pose;
        assert!(end.x_m > 14.0 + 6.5 * f64::from(count) + 10.0 && end.y_m.abs() < 0.3, "{count}: {end:?}");
        assert!(passes(&drive).1 > 0.4, "{count}: {:?}", passes(&drive));
    }
}

/// 2.6 m between two cars for an ego of 1.86 m: 0.37 m on either side, less than the clearance of 0.5 m.
#[test]
fn a_narrow_gap_is_passed_at_a_walking_pace() {
    let (left, right) = (|_: f64| [60.0, 1.3 + 0.9], |_: f64| [60.0, -1.3 - 0.9]);
    let drive = drive_from(
        EgoState { speed_mps: 9.0, ..EgoState::default() },
        9.0,
        ([1.75; 2], Manner::GoesRound),
        (ActorKind::Car, &[&left, &right]),
        40.0,
    );
    assert!(passes(&drive).0 < 3.0, "{:?}", passes(&drive));
    assert!(drive.last().unwrap().ego.pose.x_m > 75.0 && passes(&drive).1 > 0.3, "{:?}", passes(&drive));
    assert!(hardest_mps2(&drive) < 3.6, "{}", hardest_mps2(&drive));
}

/// People and cyclists moving towards the ego in its lane: 1.5 m, as for those moving the same way.
#[test]
fn people_and_cyclists_approaching_in_the_lane_are_passed_with_room() {
    for kind in [ActorKind::Cyclist, ActorKind::Pedestrian] {
        let towards = |t_s: f64| [160.0 - if kind == ActorKind::Cyclist { 4.0 } else { 1.4 } * t_s, -0.8];
        let drive = drive_among(kind, 12.0, true, Manner::GoesRound, &[&towards], 25.0);
        assert!(passes(&drive).1 > 1.4, "{kind:?} {:?}", passes(&drive));
        assert!(drive.last().unwrap().gap_m < -10.0 && hardest_mps2(&drive) < 3.0, "{kind:?}");
    }
}

/// The ego is overtaking a slow car when an oncoming one appears at 100 m: 4 s until they meet, and 23 m behind the
/// slow car the ego is hardly over the line.
#[test]
fn aborted_pass_returns_before_the_oncoming_car() {
    for seen_s in [5.5, 6.0, 6.5] {
        let slow = |t_s: f64| [62.0 + 5.0 * t_s, 0.0];
        // Until then far beside the road.
        let oncoming = move |t_s: f64| match t_s < seen_s {
            true => [700.0, 200.0],
            false => [12.0 * seen_s + 110.0 - 14.0 * (t_s - seen_s), 3.6],
        };
        let drive = drive(12.0, true, Manner::GoesRound, &[&slow, &oncoming], 25.0);
        assert!(over_line(&drive).1 > 0.0, "{seen_s} s: the pass never began");
        assert!(passes(&drive).1 > 0.7, "{seen_s} s: {:?}", passes(&drive));
        assert!(hardest_mps2(&drive) < 6.0, "{seen_s} s: {}", hardest_mps2(&drive));
    }
}

/// An oncoming car that stays over the line blocks the lane, and is not passed on its other side.
#[test]
fn an_oncoming_car_over_the_line_is_not_passed_on_its_other_side() {
    let oncoming = |t_s: f64| [150.0 - 8.0 * t_s, 1.5];
    for manner in &MANNERS[1..] {
        let drive = drive(8.0, true, *manner, &[&oncoming], 15.0);
        assert!(passes(&drive).1 > 0.2 && over_line(&drive).0 == 0.0, "{manner:?} {:?}", passes(&drive));
    }
}

/// The ego does not pass a lead that goes round a standing car and returns before it: the lead drives away.
#[test]
fn standing_car_that_a_lead_reveals_is_passed_behind_it() {
    let standing = |_: f64| [138.0, 0.0];
    let lead = |t_s: f64| {
        let x_m = 25.0 + 13.5 * t_s;
        let out = ((x_m - 112.0) / 16.0).clamp(0.0, 1.0) - ((x_m - 150.0) / 25.0).clamp(0.0, 1.0);
        [x_m, 3.75 * out]
    };
    let drive = drive(13.5, true, Manner::GoesRound, &[&standing, &lead], 25.0);
    assert!(drive.last().unwrap().ego.pose.x_m > 160.0, "{:?}", drive.last());
    assert!(passes(&drive).1 > 0.4 && hardest_mps2(&drive) < 2.0, "{:?}", passes(&drive));
}

/// Beside the parked car the lane has 0.1 m less than comfort requires, and the other lane is not free: past it in the
/// ego's lane at a walking pace, wherever that begins.
#[test]
fn parked_car_is_passed_within_the_lane_while_others_come() {
    for speed_mps in [6.0, 8.0, 10.0] {
        let parked = |_: f64| [100.0, -1.43];
        let first = move |t_s: f64| [100.0 + 98.0 * 10.0 / speed_mps - 10.0 * t_s, 3.5];
        let next = move |t_s: f64| [first(t_s)[0] + 40.0, 3.5];
        let drive = drive(speed_mps, true, Manner::GoesRound, &[&parked, &first, &next], 45.0);
        assert!(drive.last().unwrap().ego.pose.x_m > 120.0, "{speed_mps}: {:?}", drive.last());
        assert!(passes(&drive).1 > 0.25 && hardest_mps2(&drive) < 3.6, "{speed_mps}: {:?}", passes(&drive));
        assert_eq!(over_line(&drive).0, 0.0, "{speed_mps}");
    }
}

/// Between the cars there is no room to return at speed: the second one must not slow the pass of the first one.
#[test]
fn two_double_parked_cars_are_passed_at_once() {
    for second_m in [115.0, 125.0, 130.0, 136.0, 145.0] {
        let (first, second) = (|_: f64| [102.0, -0.9], move |_: f64| [second_m, -0.9]);
        let drive = drive(12.0, true, Manner::GoesRound, &[&first, &second], 20.0);
        assert!(drive.last().unwrap().ego.pose.x_m > second_m + 20.0, "{second_m}: {:?}", drive.last());
        assert!(passes(&drive).1 > 0.4 && hardest_mps2(&drive) < 3.6, "{second_m}: {:?}", passes(&drive));
    }
}

/// An oncoming car comes in sight at 100 m while the ego moves out before a standing one: the ego stops aligned with
/// the lane, far enough behind to move out again, and passes later.
#[test]
fn standing_car_is_passed_after_a_pass_given_up_for_an_oncoming_car() {
    let seen_s = |speed_mps: f64| if speed_mps < 12.0 { 4.4 } else { 4.0 };
    for (speed_mps, share) in [9.0, 11.0, 13.0].into_iter().flat_map(|v| [0.7, 0.8, 0.9, 1.0].map(|k| (v, k)))
    {
        let seen_s = share * seen_s(speed_mps);
        let standing = move |_: f64| [30.0 + 4.5 * speed_mps, 0.0];
        let oncoming = move |t_s: f64| match t_s < seen_s {
            true => [700.0, 200.0],
            false => [speed_mps * seen_s + 100.0 - speed_mps * (t_s - seen_s), 3.5],
        };
        let drive = drive(speed_mps, true, Manner::GoesRound, &[&standing, &oncoming], 40.0);
        let case = format!("{speed_mps} m/s, seen at {seen_s} s");
        assert!(drive.last().unwrap().ego.pose.x_m > 110.0, "{case}: {:?}", drive.last());
        assert!(passes(&drive).1 > 0.38 && hardest_mps2(&drive) < 5.0, "{case}: {:?}", passes(&drive));
        let at_rest = drive.iter().filter(|it| it.ego.speed_mps < 0.1);
        assert!(
            at_rest.clone().all(|it| it.ego.pose.heading_rad.abs() < 0.15 && it.gap_m > 4.5),
            "{case}: {:?}",
            at_rest.clone().next()
        );
    }
}

/// The lead reaches the standing car before the ego could be past both: it may pull out.
#[test]
fn lead_that_must_pull_out_is_not_overtaken() {
    for (speed_mps, lead_mps) in [(14.0, 8.0), (14.0, 7.0), (12.0, 5.0)] {
        let standing = move |_: f64| [40.0 + 13.0 * lead_mps, 0.0];
        let lead = move |t_s: f64| {
            let x_m = 40.0 + lead_mps * t_s;
            let ahead_m = x_m - standing(0.0)[0];
            let out = ((ahead_m + 26.0) / 16.0).clamp(0.0, 1.0) - ((ahead_m - 10.0) / 20.0).clamp(0.0, 1.0);
            [x_m, 3.4 * out]
        };
        let drive = drive(speed_mps, true, Manner::GoesRound, &[&lead, &standing], 40.0);
        assert!(passes(&drive).1 > 0.4 && hardest_mps2(&drive) < 3.6, "{lead_mps}: {:?}", passes(&drive));
        assert!(drive.last().unwrap().ego.pose.x_m > 200.0, "{lead_mps}: {:?}", drive.last());
    }
}

/// A walker begins to cross from the right 11 m before an ego that is 0.6 m left of its centre.
#[test]
fn ego_beside_its_centre_stops_for_a_walker() {
    for d_m in [0.0, 0.3, 0.6] {
        let walker = |t_s: f64| [18.5, -2.4 + 1.4 * (t_s - 0.3).max(0.0)];
        let ego = EgoState { speed_mps: 8.5, pose: Pose2::new(0.0, d_m, 0.0), ..EgoState::default() };
        let people = (ActorKind::Pedestrian, &[&walker as Script<'_>][..]);
        let drive = drive_from(ego, 9.0, (WIDE_M, Manner::GoesRound), people, 6.0);
        assert!(
            over_line(&drive).0 == 0.0 && drive.last().unwrap().t_s > 5.9,
            "{d_m}: {:?}",
            over_line(&drive)
        );
        assert!(passes(&drive).1 > 0.3 && hardest_mps2(&drive) < 6.5, "{d_m}: {:?}", passes(&drive));
    }
}

/// An oncoming cyclist 0.5 to 0.8 m over the line: the ego meets her on the right, as an oncoming car.
#[test]
fn oncoming_cyclist_over_the_line_is_met_on_the_right() {
    for (d_m, right_m) in [(1.3, 1.75), (1.1, 1.75), (0.8, 2.2)] {
        let towards = move |t_s: f64| [130.0 - 5.0 * t_s, d_m];
        let ego = EgoState { speed_mps: 11.0, ..EgoState::default() };
        let cyclists = (ActorKind::Cyclist, &[&towards as Script<'_>][..]);
        let drive = drive_from(ego, 11.0, ([5.25, right_m], Manner::GoesRound), cyclists, 15.0);
        let most_m = drive.iter().map(|it| it.ego.pose.y_m).fold(0.0, f64::max);
        assert!(most_m < 0.1 && passes(&drive).1 > 0.4, "{d_m}: {most_m} {:?}", passes(&drive));
        assert!(drive.last().unwrap().ego.pose.x_m > 90.0, "{d_m}: {:?}", drive.last());
    }
}

/// She walks to the edge of the lane, stops for 2.5 s facing across, and goes on when the ego is near.
#[test]
fn ego_stays_slow_past_a_pedestrian_who_just_stopped_beside_the_lane() {
    // A slow drift keeps her heading.
    let waits = |t_s: f64| [70.0, 2.3 - 0.02 * t_s + 1.4 * (2.5 - t_s).max(0.0) - 1.4 * (t_s - 5.0).max(0.0)];
    let ego = EgoState { speed_mps: 11.0, ..EgoState::default() };
    let people = (ActorKind::Pedestrian, &[&waits as Script<'_>][..]);
    let drive = drive_from(ego, 11.0, (WIDE_M, Manner::GoesRound), people, 12.0);
    let after_s = |t_s: f64| drive.iter().find(|it| it.t_s >= t_s).unwrap().ego.speed_mps;
    assert!(after_s(4.9) < 8.0 && hardest_mps2(&drive) < 5.5, "{} {}", after_s(4.9), hardest_mps2(&drive));
    assert!(passes(&drive).1 > 0.5 && drive.last().unwrap().ego.pose.x_m > 70.0, "{:?}", passes(&drive));
}
