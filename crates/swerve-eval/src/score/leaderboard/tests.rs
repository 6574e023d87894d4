use swerve_geom::Point2;

use super::*;

fn record(completion: f64, counts: Counts) -> RouteRecord {
    RouteRecord { route_length_m: 1000.0, route_completion: completion, counts, ..RouteRecord::default() }
}

#[test]
fn each_infraction_has_its_published_factor() {
    let one = |set: fn(&mut Counts)| {
        let mut counts = Counts::default();
        set(&mut counts);
        Version::ALL.map(|version| record(100.0, counts).score(version).penalty)
    };
    // 1 / (1 + c), rounded to six decimals, in 2.1.
    assert_eq!(one(|counts| counts.collisions_pedestrian = 1), [0.5, 0.5, 0.5]);
    assert_eq!(one(|counts| counts.collisions_vehicle = 1), [0.6, 0.6, 0.588_235]);
    assert_eq!(one(|counts| counts.collisions_layout = 1), [0.65, 0.65, 0.625]);
    assert_eq!(one(|counts| counts.red_light = 1), [0.7, 0.7, 0.714_286]);
    assert_eq!(one(|counts| counts.stop_infraction = 1), [0.8, 0.8, 0.8]);
    assert_eq!(one(|counts| counts.scenario_timeouts = 1), [1.0, 0.7, 0.714_286]);
    assert_eq!(one(|counts| counts.yield_emergency_vehicle_infractions = 1), [1.0, 0.7, 0.714_286]);
    assert_eq!(one(|counts| counts.route_dev = 1), [1.0, 1.0, 1.0]);
    // A second one multiplies in 1.0 and 2.0, and adds in 2.1.
    assert_eq!(one(|counts| counts.collisions_pedestrian = 2), [0.25, 0.25, 0.333_333]);
}

#[test]
fn checkpoints_at_or_above_the_traffic_cost_nothing() {
    let slow = RouteRecord {
        min_speed_checkpoints_percent: vec![100.0, 250.0, 50.0, 100.0],
        ..record(100.0, Counts::default())
    };
    assert_eq!(Version::ALL.map(|version| slow.score(version).penalty), [1.0, 0.85, 0.833_333]);
    assert_eq!(slow.infractions(), 1);
}

#[test]
fn status_names_the_reason_that_the_leaderboard_names() {
    let status = |completion: f64, set: fn(&mut RouteRecord)| {
        let mut record = record(completion, Counts::default());
        set(&mut record);
        [Version::V1_0, Version::V2_1].map(|version| record.status(version).to_string())
    };
    assert_eq!(status(100.0, |_| {}), ["Completed", "Perfect"]);
    assert_eq!(status(100.0, |record| record.outside_route_lanes_percent = 0.1), ["Completed", "Completed"]);
    assert_eq!(status(99.99, |_| {}), ["Failed", "Failed"]);
    let both = status(40.0, |record| (record.counts.route_dev, record.counts.vehicle_blocked) = (1, 1));
    assert_eq!(both[1], "Failed - Agent got blocked");
    let late = status(40.0, |record| {
        record.counts.route_timeout = 1;
        record.failure = Some(Failure::AgentCrashed);
    });
    assert_eq!(late[0], "Failed - Agent timed out");
    assert_eq!(
        status(0.0, |record| record.failure = Some(Failure::AgentCrashed))[0],
        "Failed - Agent crashed"
    );
}

#[test]
fn totals_follow_the_rules_of_their_version() {
    let vehicle = |count| Counts { collisions_vehicle: count, ..Counts::default() };
    let records = [record(100.0, vehicle(1)), record(50.0, vehicle(0)), record(0.0, vehicle(4))];
    let first = total(&records, Version::V1_0).unwrap();
    let second = total(&records, Version::V2_0).unwrap();
    assert_eq!(first.routes.iter().map(|route| route.driving_score).collect::<Vec<_>>(), [60.0, 50.0, 0.0]);
    // Mean 36.667, squares 544.4, 177.8, 1344.4 over 2.
    assert!((first.driving_score - 110.0 / 3.0).abs() < 1e-12);
    assert!((first.std_dev.unwrap() - (3_100.0_f64 / 3.0).sqrt()).abs() < 1e-9);
    assert_eq!((second.driving_score, second.std_dev), (36.666_667, Some(32.146)));
    // The route without progress has no rate in 1.0; in 2.0 its collisions count over 1.5 km.
    assert_eq!(first.per_km["collisions_vehicle"], 1.0);
    assert_eq!(second.per_km["collisions_vehicle"], 3.333);
    assert_eq!((first.status, second.status), (Status::Failed(None), Status::Failed(None)));
    let one = [record(100.0, vehicle(0))];
    assert_eq!(total(&one, Version::V1_0).unwrap().std_dev, None);
    assert_eq!(total(&one, Version::V2_1).unwrap().std_dev, Some(0.0));
    assert_eq!(total(&one, Version::V2_1).unwrap().status, Status::Perfect);
    assert_eq!(total(&[], Version::V2_1), None);
    // No progress at all: the distance is at least a metre.
    assert_eq!(
        total(&[record(0.0, vehicle(1))], Version::V2_0).unwrap().per_km["collisions_vehicle"],
        1000.0
    );
}

#[test]
fn repeated_contacts_count_by_party_place_and_speed() {
    // Instant, party, x of the ego, speed of the ego; counted by 1.0 and by 2.x.
    let events = [
        ((0.0, Some(1), 0.0, 5.0), [true, true]),
        // The same party within 5 s, although 20 m on.
        ((4.0, Some(1), 20.0, 5.0), [false, false]),
        ((5.1, Some(1), 20.0, 5.0), [true, true]),
        // Another party 4 m on: beyond the 3 m of 1.0, within the 5 m of 2.x.
        ((6.0, Some(2), 24.0, 5.0), [true, false]),
        ((7.0, None, 40.0, 5.0), [true, true]),
        // The static world has no identity, only a place.
        ((7.1, None, 40.5, 5.0), [false, false]),
        ((7.5, None, 46.0, 5.0), [true, true]),
        // An ego that stands is hit.
        ((30.0, Some(3), 80.0, 0.05), [true, false]),
    ];
    for (k, version) in [Version::V1_0, Version::V2_0].into_iter().enumerate() {
        let mut collisions = Collisions::new(version);
        for ((at_s, other, x_m, ego_speed_mps), wanted) in events {
            let contact = Contact { at_s, other, ego: Point2::new(x_m, 0.0), ego_speed_mps };
            collisions.step(at_s, contact.ego);
            assert_eq!(collisions.counts(&contact), wanted[k], "{version:?} at {at_s}");
        }
    }
}
