//! Moving up while the ego gives way.

use super::*;

/// The ego at rest before its line, and its decision after 2 s.
fn waits(posed: &mut Posed) -> Decision {
    posed.decide_after(2.0)
}

/// Distance by which a decision lets the front move, metres.
fn moves_m(posed: &Posed, decision: &Decision) -> f64 {
    decision.stops[0].s_m - posed.front_m
}

/// Lets a light show a signal.
fn show(posed: &mut Posed, line_m: f64, signal: Signal) {
    let light = TrafficLight { signal: Some(signal), stop_s_m: Some(line_m), ..TrafficLight::default() };
    posed.lights = Some(TrafficLights { lights: vec![light], ..TrafficLights::default() });
}

/// From the side road over the priority road, with a car from the left that leaves no gap.
fn from_side_road(map: Posed, before_m: f64) -> Posed {
    let posed = map.route(on_arm(FROM_SOUTH, -80.0), on_arm(FROM_SOUTH, 60.0));
    posed.ego(on_arm(FROM_SOUTH, -11.0), before_m, 0.0).car(on_arm(FROM_WEST, -20.0), 9.0)
}

#[test]
fn ego_moves_up_to_the_first_zone_after_a_second_at_rest() {
    let mut posed = from_side_road(Posed::on("crossing_priority.xodr"), 1.0);
    let at_line = posed.decide();
    assert!(moves_m(&posed, &at_line) < 1.0, "{at_line:?}");
    let decision = waits(&mut posed);
    assert_eq!(
        (decision.state, decision.because, causes(&decision)),
        (Some(DrivingState::Creep), Some(ActorId(1)), vec![StopReason::GiveWay])
    );
    assert!(decision.speed_mps(posed.front_m, 1.0) == 1.5, "{:?}", decision.limits);
    // The lane of the car begins 3.5 m before the middle, 7.5 m beyond the border of the junction. Left turns into the
    // ego's road cut the corner.
    let to_m = moves_m(&posed, &decision);
    assert!((3.0..8.5).contains(&to_m), "{to_m}");
    // It moves, stays there, and waits for a gap.
    (posed.front_m, posed.speed_mps) = (posed.front_m + 0.5 * to_m, 1.2);
    let moving = posed.decide();
    assert_eq!((moving.state, moving.stops), (Some(DrivingState::Creep), decision.stops.clone()));
    (posed.front_m, posed.speed_mps) = (posed.front_m + 0.5 * to_m - 1.0, 0.0);
    for _ in 0..30 {
        let decision = posed.decide();
        assert_eq!(decision.state, Some(DrivingState::WaitForGap));
        assert!((moves_m(&posed, &decision) - 1.0).abs() < 1e-9, "{decision:?}");
    }
    // Once the car is past, it goes.
    posed.aim(1, on_arm(FROM_WEST, 12.0), 9.0);
    assert_eq!(causes(&posed.decide_after(0.5)), []);
}

#[test]
fn ego_that_stands_before_its_place_waits() {
    // It does not start, or it comes to rest on its way; the place stays.
    for moves_m in [0.0, 1.0] {
        let mut posed = from_side_road(Posed::on("crossing_priority.xodr"), 1.0);
        let begins = waits(&mut posed);
        (posed.front_m, posed.speed_mps) = (posed.front_m + moves_m, 1.2 * moves_m);
        assert_eq!(posed.decide().state, Some(DrivingState::Creep));
        posed.speed_mps = 0.0;
        let decisions: Vec<Decision> = (0..200).map(|_| posed.decide()).collect();
        assert!(decisions.iter().all(|decision| decision.stops == begins.stops), "{begins:?}");
        let creeps =
            decisions.iter().take_while(|decision| decision.state == Some(DrivingState::Creep)).count();
        assert!(creeps <= 20, "{creeps} frames");
        let rest = &decisions[creeps..];
        assert!(rest.iter().all(|decision| decision.state == Some(DrivingState::WaitForGap)));
        // Once it can, it goes on as slowly.
        assert_eq!(rest[0].speed_mps(posed.front_m, 1.0), 1.5);
    }
}

#[test]
fn ego_stays_at_the_line_where_it_would_be_in_the_way() {
    // A vehicle stands ahead.
    let mut posed = from_side_road(Posed::on("crossing_priority.xodr"), 1.0);
    posed.others.clear();
    posed = posed.car(on_arm(FROM_WEST, -20.0), 9.0).car(on_arm(FROM_SOUTH, -6.0), 0.0);
    let behind = waits(&mut posed);
    assert!(moves_m(&posed, &behind) < 1.0, "{behind:?}");
}

#[test]
fn ego_does_not_stop_on_a_crossing() {
    let with_crossing = |y_m: [f64; 2]| {
        let map = map_with_crossing("crossing_priority.xodr", [(0.0, y_m[0]), (4.0, y_m[1])]);
        let mut posed = from_side_road(Posed::with(map), 1.0);
        let decision = waits(&mut posed);
        moves_m(&posed, &decision)
    };
    // It would stand with its front, or with its rear, on the crossing; from before the line it clears one far behind.
    assert!(with_crossing([-9.0, -7.0]) < 1.0);
    assert!(with_crossing([-11.3, -9.8]) < 1.0);
    assert!(with_crossing([-30.0, -28.0]) > 3.0);
}

#[test]
fn ego_stands_at_a_stop_sign_for_a_second_before_it_moves_up() {
    let (lanes, mut features) = Map::clone(&Posed::on("crossing_priority.xodr").map).into_parts();
    for line in &mut features.stop_lines {
        line.sign = Some(StopSign::Stop);
    }
    let map = Arc::new(Map::with_features(lanes, features).unwrap());
    let mut posed = from_side_road(Posed::with(map), 1.0);
    for _ in 0..10 {
        let decision = posed.decide();
        assert_eq!(
            (causes(&decision), decision.state),
            (vec![StopReason::StopSign], Some(DrivingState::StopSign))
        );
    }
    assert_eq!(waits(&mut posed).state, Some(DrivingState::Creep));
}

#[test]
fn ego_stays_at_the_line_of_a_light() {
    let turn = [FROM_WEST, FROM_SOUTH];
    let mut posed = at_crossing("crossing.xodr", turn, 2.2, 0.0).car(on_arm(FROM_EAST, -25.0), 9.0);
    let line_m = posed.front_m + 0.2;
    show(&mut posed, line_m, Signal::Green);
    assert_eq!(waits(&mut posed).state, Some(DrivingState::WaitForGap));
}
