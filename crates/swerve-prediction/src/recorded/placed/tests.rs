use swerve_core::Span;
use swerve_geom::Polyline;
use swerve_map::{Borders, Lane, LaneId, Map};
use swerve_msg::{ActorId, ActorKind, Extent};

use super::*;
use crate::recorded::RecordedTrack;

/// Two lanes that cross at (50, 0), one of them curved.
fn crossing() -> Arc<Map> {
    let lane = |id, points: &[(f64, f64)]| {
        let points: Vec<Point2> = points.iter().map(|(x, y)| Point2::new(*x, *y)).collect();
        Lane::new(LaneId(id), Polyline::new(&points).unwrap(), Borders::constant(1.75, 1.75))
    };
    let lanes = vec![
        lane(1, &[(0.0, 0.0), (100.0, 0.0)]),
        lane(2, &[(50.0, -60.0), (50.0, 20.0), (60.0, 40.0), (80.0, 50.0)]),
    ];
    Arc::new(Map::new(lanes).unwrap())
}

/// Tracks along both lanes, translated by `off`, 0.3 m to the left of the centre.
fn driven(lanes: &Map, off: Vector2) -> Recording {
    let track = |(k, lane): (usize, &Lane)| {
        let place = |step: i64| {
            let pose = lane.line.at(step as f64).pose;
            (step, pose.point() + pose.direction().left() * 0.3 + off)
        };
        let extent = Extent { length_m: 4.5, width_m: 1.8, height_m: 1.5 };
        let samples = (2..80).map(place).collect();
        RecordedTrack { id: ActorId(k as u32), kind: ActorKind::Car, extent, samples }
    };
    let tracks = lanes.lanes().iter().enumerate().map(track).collect();
    Recording { step: Span::from_ms(100), tracks, lanes: None }
}

#[test]
fn recording_is_moved_onto_the_driven_lanes() {
    let lanes = crossing();
    for off in [Vector2::default(), Vector2::new(37.3, -81.9), Vector2::new(-140.0, 120.4)] {
        let recording = driven(&lanes, off);
        let (moved, share) = recording.placed(&lanes).unwrap();
        let shift: Vector2 = moved.tracks[1].samples[9].1 - recording.tracks[1].samples[9].1;
        // A common offset to the left of two directions cannot be separated from a translation.
        assert!((shift + off).norm() < 0.6, "{off:?}: {shift:?}");
        assert!(share > 0.8, "{share}");
        assert_eq!(moved.lanes.as_deref(), Some(&*lanes));
    }
}

#[test]
fn standing_or_distant_recordings_are_not_placed() {
    let lanes = crossing();
    assert!(driven(&lanes, Vector2::new(900.0, 0.0)).placed(&lanes).is_none());
    let mut stands = driven(&lanes, Vector2::default());
    stands.tracks.iter_mut().for_each(|track| {
        let first = track.samples[0].1;
        track.samples.iter_mut().for_each(|(_, point)| *point = first);
    });
    assert!(stands.placed(&lanes).is_none());
    // In the opposite direction, no position is on a lane of its direction.
    let mut back = driven(&lanes, Vector2::default());
    back.tracks.truncate(1);
    back.tracks[0].samples.iter_mut().for_each(|(_, point)| point.x_m = 100.0 - point.x_m);
    assert!(back.placed(&lanes).is_none());
}
