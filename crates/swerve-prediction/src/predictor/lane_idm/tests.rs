use proptest::prelude::*;
use swerve_core::Span;
use swerve_geom::{Polyline, Pose2};
use swerve_map::{Borders, Features, Lane, LaneId, Map, Signal, SignalId, StopLine};
use swerve_msg::{ActorId, ActorKind, Extent, Prediction, Sighting, Track, TrackList};

use super::*;
use crate::predictor::{PredictorName, predict};

const FIVE_SECONDS: Horizon = Horizon { steps: 50, step: Span::from_ms(100) };

/// A car with sightings over three seconds up to time zero, at `s_m` along a line and at this speed.
fn car(id: u32, line: &Polyline, s_m: f64, speed_mps: f64) -> Track {
    let at = |k: i64| {
        let point = line.at(s_m + 0.1 * speed_mps * k as f64).pose.point();
        Sighting { at: Time::from_ms(100 * k), point }
    };
    let history: Vec<Sighting> = (-30..=0).map(at).collect();
    let pose = line.at(s_m).pose;
    let extent = Extent { length_m: 4.5, width_m: 1.8, height_m: 1.5 };
    let velocity_mps = pose.direction() * speed_mps;
    Track { id: ActorId(id), kind: ActorKind::Car, pose, extent, velocity_mps, history }
}

fn lane(id: u32, points: &[(f64, f64)], successors: &[u32]) -> Lane {
    let points: Vec<Point2> = points.iter().map(|(x, y)| Point2::new(*x, *y)).collect();
    let mut lane = Lane::new(LaneId(id), Polyline::new(&points).unwrap(), Borders::constant(1.75, 1.75));
    lane.successors = successors.iter().copied().map(LaneId).collect();
    lane
}

/// 60 m to the east with a stop line at their end, then straight on or to the left; and a parallel lane with the same
/// light.
fn fork() -> Map {
    let lanes = vec![
        lane(1, &[(0.0, 0.0), (60.0, 0.0)], &[2, 3]),
        lane(2, &[(60.0, 0.0), (200.0, 0.0)], &[]),
        lane(3, &[(60.0, 0.0), (72.0, 3.0), (80.0, 12.0), (82.0, 100.0)], &[]),
        lane(4, &[(0.0, -3.5), (60.0, -3.5)], &[]),
    ];
    let light = Signal {
        id: SignalId(7),
        name: String::new(),
        position: Point2::new(75.0, 6.0),
        heading_rad: 3.1,
        height_m: None,
        lanes: vec![LaneId(1), LaneId(4)],
        controller: None,
        program: None,
    };
    let stop = |lane| StopLine { signals: vec![SignalId(7)], ..StopLine::new(LaneId(lane), 60.0) };
    let features =
        Features { signals: vec![light], stop_lines: vec![stop(1), stop(4)], ..Features::default() };
    Map::with_features(lanes, features).unwrap()
}

fn foretold(tracks: Vec<Track>, lanes: &Map) -> Vec<Modes> {
    let list = TrackList { stamp: Time::ZERO, tracks };
    let found = predict(PredictorName::LaneIdm, &list, &FIVE_SECONDS, Ground::Lanes(lanes)).predictions;
    let found: Vec<Modes> = Prediction::by_actor(&found).map(<[_]>::to_vec).collect();
    for modes in &found {
        let sum: f64 = modes.iter().map(|mode| mode.probability).sum();
        assert!((sum - 1.0).abs() < 1e-9 && modes.len() <= 6, "{sum}");
        let mut places = modes.iter().flat_map(|mode| &mode.path);
        assert!(places.all(|at| at.pose.is_finite() && at.pose.x_m.abs() < 1e7));
    }
    found
}

fn ends(found: &[Modes], k: usize) -> Vec<Pose2> {
    found[k].iter().map(|mode| mode.path[50].pose).collect()
}

#[test]
fn prediction_has_a_cruising_and_a_braking_mode_for_each_path() {
    let lanes = fork();
    let line = |k: usize| &lanes.lanes()[k].line;
    let found = foretold(vec![car(1, line(0), 40.0, 10.0)], &lanes);
    let [on, on_brakes, left, left_brakes] = ends(&found, 0)[..] else { panic!("four modes") };
    assert!(on.x_m > 88.0 && on.y_m.abs() < 0.1, "{on:?}");
    assert!(left.y_m > 15.0 && (left.heading_rad - 1.55).abs() < 0.2, "{left:?}");
    // It stops after 25 m.
    assert!((on_brakes.x_m - 65.0).abs() < 0.5 && left_brakes.y_m < 3.0, "{on_brakes:?} {left_brakes:?}");
    let shares: Vec<f64> = found[0].iter().map(|mode| mode.probability).collect();
    assert!(shares[0] > shares[2] && (shares[0] - 9.0 * shares[1]).abs() < 1e-9, "{shares:?}");
    // Beyond the fork there is only one path.
    let found = foretold(vec![car(1, line(2), 40.0, 10.0)], &lanes);
    assert_eq!(found[0].len(), 2);
    // In the bend, the lateral acceleration is limited to 3 m/s².
    let fast = foretold(vec![car(1, line(0), 40.0, 20.0)], &lanes);
    assert!(ends(&fast, 0)[2].y_m < 70.0 && ends(&fast, 0)[0].x_m > 130.0, "{:?}", ends(&fast, 0));
}

#[test]
fn slowdown_of_the_lead_propagates_back_along_the_lane() {
    let lanes = fork();
    let line = &lanes.lanes()[1].line;
    let column = |ahead_mps: f64| {
        let mut cars: Vec<Track> = (0..4).map(|k| car(k, line, 15.0 * f64::from(k), 10.0)).collect();
        cars.push(car(4, line, 60.0, ahead_mps));
        foretold(cars, &lanes)
    };
    let (slow, even) = (column(4.0), column(10.0));
    let lost_m: Vec<f64> = (0..4).map(|k| ends(&even, k)[0].x_m - ends(&slow, k)[0].x_m).collect();
    assert!(
        lost_m.windows(2).all(|two| two[0] < two[1]) && lost_m[0] > 0.1 && lost_m[3] > 12.0,
        "{lost_m:?}"
    );
    for k in 0..4 {
        assert!(ends(&slow, k)[0].x_m + 4.5 < ends(&slow, k + 1)[0].x_m, "{k} drives into the next");
    }
}

#[test]
fn vehicle_waiting_at_a_stop_line_implies_a_red_light() {
    let lanes = fork();
    let line = |k: usize| &lanes.lanes()[k].line;
    let comes = car(1, line(0), 20.0, 10.0);
    let alone = foretold(vec![comes.clone()], &lanes);
    assert!(ends(&alone, 0)[0].x_m > 66.0);
    // In the parallel lane, a vehicle waits at the line.
    let waits = car(2, line(3), 56.0, 0.0);
    let both = foretold(vec![comes, waits], &lanes);
    let front_m = ends(&both, 0)[0].x_m + 2.25;
    assert!((54.0..=60.1).contains(&front_m), "{front_m}");
    assert!((ends(&both, 1)[0].x_m - 56.0).abs() < 2.0, "who waits goes on waiting: {:?}", ends(&both, 1)[0]);
    // A vehicle too close to stop passes.
    let close = car(1, line(0), 52.0, 12.0);
    let found = foretold(vec![close, car(2, line(3), 56.0, 0.0)], &lanes);
    assert!(ends(&found, 0)[0].x_m > 90.0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Arbitrary lane maps with arbitrary vehicles: probabilities sum to 1, and positions are finite.
    #[test]
    fn predictions_are_valid_on_arbitrary_lanes(
        points in prop::collection::vec((-60.0..60.0, -60.0..60.0), 4..9),
        links in prop::collection::vec((0_usize..8, 0_usize..8), 0..20),
        cars in prop::collection::vec((-80.0..80.0, -80.0..80.0, -20.0..20.0, -20.0..20.0), 1..8),
    ) {
        // Lane k leads from point k to the next; each link adds a lane between two points.
        let n = points.len();
        let (mut lanes, mut ends): (Vec<Lane>, Vec<(usize, usize)>) = (Vec::new(), Vec::new());
        let pairs = (0..n).map(|k| (k, (k + 1) % n)).chain(links.iter().map(|(a, b)| (a % n, b % n)));
        for (a, b) in pairs.filter(|(a, b)| a != b) {
            lanes.push(lane(lanes.len() as u32, &[points[a], points[b]], &[]));
            ends.push((a, b));
        }
        for k in 0..lanes.len() {
            let next = (0..ends.len()).filter(|j| ends[*j].0 == ends[k].1);
            lanes[k].successors = next.map(|j| LaneId(j as u32)).collect();
        }
        let stop_lines = vec![StopLine::new(LaneId(0), lanes[0].line.length().min(1.0))];
        let features = Features { stop_lines, ..Features::default() };
        let lanes = Map::with_features(lanes, features).unwrap();
        let track = |(k, &(x, y, vx, vy)): (usize, &(f64, f64, f64, f64))| {
            let to = (x + 3.0 * vx + 1e-3, y + 3.0 * vy);
            let line = Polyline::new(&[Point2::new(x, y), Point2::new(to.0, to.1)]).unwrap();
            car(k as u32, &line, 0.0, libm::hypot(vx, vy))
        };
        let found = foretold(cars.iter().enumerate().map(track).collect(), &lanes);
        prop_assert_eq!(found.len(), cars.len());
    }
}
