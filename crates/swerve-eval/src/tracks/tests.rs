use super::*;
use crate::verdict::tests::{actor, world};
use swerve_geom::{Pose2, Vector2};
use swerve_msg::{ActorKind, Extent};

/// A truck 20 m ahead, and a person beside it who walks to the left.
fn truth() -> WorldState {
    let mut state = world(1000, 0.0);
    let mut person = actor(2, ActorKind::Pedestrian, Pose2::new(26.0, -3.0, 0.0), 0.5, 0.5);
    person.velocity_mps = Vector2::new(0.0, 2.0);
    state.actors = vec![actor(1, ActorKind::Truck, Pose2::new(20.0, -3.0, 0.0), 8.0, 2.5), person];
    state
}

fn track(id: u32, kind: ActorKind, (x_m, y_m): (f64, f64), vy_mps: f64) -> Track {
    Track {
        id: ActorId(id),
        kind,
        pose: Pose2::new(x_m, y_m, 0.0),
        extent: Extent::default(),
        velocity_mps: Vector2::new(0.0, vy_mps),
        history: Vec::new(),
    }
}

/// The person is in sight; the truck is not yet.
const SIGHTS: [Sight; 2] = [
    Sight { actor: ActorId(1), at: Time::from_ms(1001) },
    Sight { actor: ActorId(2), at: Time::from_ms(1000) },
];

fn compared(lists: &[(i64, Vec<Track>)]) -> TrackComparison {
    let mut comparison = TrackComparison::default();
    for (ms, tracks) in lists {
        let list = TrackList { stamp: Time::from_ms(1000), tracks: tracks.clone() };
        // Standard deviations of 0.5 m and 1 m/s.
        let covariance = Matrix4::from_diagonal(&Vector4::new(0.25, 0.25, 1.0, 1.0));
        comparison.add((&list, Time::from_ms(*ms)), &truth(), &SIGHTS, |_| Some(covariance));
    }
    comparison
}

#[test]
fn delays_are_those_of_the_first_track_and_of_the_first_right_velocity() {
    let person = |vy_mps| vec![track(7, ActorKind::Pedestrian, (26.2, -3.0), vy_mps)];
    let comparison =
        compared(&[(1100, vec![]), (1150, person(0.0)), (1200, person(1.5)), (1250, person(2.0))]);
    let seen = Followed { tracked_s: Some(1.15), velocity_known_s: Some(1.2) };
    assert_eq!(comparison.followed(ActorId(2)), seen);
    assert_eq!(comparison.followed(ActorId(1)), Followed::default());
    let early = compared(&[(1100, vec![track(7, ActorKind::Truck, (20.0, -3.0), 0.0)])]);
    assert_eq!(early.followed(ActorId(1)), Followed::default(), "before its first sight");
    // A track of a vehicle at the place of a person says nothing about the person.
    let confused = compared(&[(1100, vec![track(7, ActorKind::Car, (26.0, -3.0), 2.0)])]);
    assert_eq!(confused.followed(ActorId(2)), Followed::default());
}

#[test]
fn metrics_count_duplicates_ghosts_and_tracks_that_change_their_road_user() {
    let truck = |id| track(id, ActorKind::Truck, (20.5, -3.0), 0.0);
    let ghost = track(9, ActorKind::Car, (60.0, 8.0), 0.0);
    let moved = track(3, ActorKind::Truck, (26.0, -3.0), 2.0);
    let metrics = compared(&[
        (1100, vec![truck(3), truck(4)]),
        (1200, vec![truck(3), ghost]),
        (1300, vec![truck(3)]),
        (1400, vec![moved]),
    ])
    .metrics();
    assert_eq!((metrics.tracks, metrics.entries), (3, 6));
    let share = |value: Option<f64>, sixths: f64| assert!((value.unwrap() - sixths / 6.0).abs() < 1e-12);
    share(metrics.duplicate_share, 2.0);
    share(metrics.ghost_share, 1.0);
    // Three of four entries of track 3, and track 4; the ghost belongs to no road user.
    share(metrics.purity, 4.0);
    assert_eq!(metrics.velocity_rms_mps, Some(0.0));
    // Four entries 0.5 m off along x, and one without error.
    assert!((metrics.nees.unwrap() - 4.0 / 5.0).abs() < 1e-12, "{metrics:?}");
    assert_eq!(compared(&[]).metrics(), TrackMetrics::default());
}
