//! Position of a moving pose along a line that may cross or touch itself.

use crate::{FrenetPoint, Point2, Polyline, Pose2};

/// Search radius around the previous position beyond twice the distance moved, metres.
const REACH_M: f64 = 15.0;

/// Lateral offset above which the whole line is searched, metres.
const FAR_M: f64 = 15.0;

/// Tracks a pose along a line: continuous where the line closes or crosses itself.
///
/// Each position is searched for near the previous one. The first position, and one after a jump away from the line,
/// is the nearest on the whole line whose direction matches the pose ([`Polyline::project_pose`]).
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct LineTracker {
    last: Option<(f64, Point2)>,
}

impl LineTracker {
    /// Creates a tracker that starts near arc length `s_m`, with the pose at `point`.
    pub fn starting_at(s_m: f64, point: Point2) -> Self {
        Self { last: Some((s_m, point)) }
    }

    /// Position of `pose` along `line`, given that of the previous call.
    pub fn locate(&mut self, line: &Polyline, pose: Pose2) -> FrenetPoint {
        let point = pose.point();
        let near = self.last.map(|(s_m, before)| {
            let reach_m = REACH_M + 2.0 * before.distance(point);
            line.project_near(point, s_m, reach_m)
        });
        let place = match near {
            Some(near) if near.d_m.abs() <= FAR_M => near,
            Some(near) => {
                let anywhere = line.project_pose(pose);
                if anywhere.d_m.abs() < 0.5 * near.d_m.abs() { anywhere } else { near }
            }
            None => line.project_pose(pose),
        };
        self.last = Some((place.s_m, point));
        place
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::TAU;

    use super::*;
    use crate::math;

    /// Points about every metre along segments of (length, curvature), from the origin along x.
    fn line(segments: &[(f64, f64)]) -> Polyline {
        let mut pose = Pose2::new(0.0, 0.0, 0.0);
        let mut points = vec![pose.point()];
        for &(length_m, curvature_1pm) in segments {
            let n = length_m.ceil();
            for _ in 0..n as usize {
                let step_m = length_m / n;
                let half_rad = 0.5 * curvature_1pm * step_m;
                // Chord of the arc.
                let chord_m = if half_rad == 0.0 { step_m } else { step_m * math::sin(half_rad) / half_rad };
                let middle: Pose2 = Pose2::new(pose.x_m, pose.y_m, pose.heading_rad + half_rad);
                let end = middle.ahead(chord_m);
                pose = Pose2::new(end.x_m, end.y_m, pose.heading_rad + 2.0 * half_rad);
                points.push(pose.point());
            }
        }
        Polyline::new(&points).unwrap()
    }

    /// Follows poses `d_m` beside the line every `step_m`; returns the largest error of arc length and offset.
    fn worst(line: &Polyline, d_m: f64, step_m: f64) -> f64 {
        let mut tracker = LineTracker::default();
        let steps = (line.length() / step_m) as usize;
        let off = |k: usize| {
            let s_m = k as f64 * step_m;
            let on_line = line.at(s_m).pose;
            let at = line.to_map(FrenetPoint { s_m, d_m });
            let place = tracker.locate(line, Pose2::new(at.x_m, at.y_m, on_line.heading_rad));
            (place.s_m - s_m).abs().max((place.d_m - d_m).abs())
        };
        (0..=steps).map(off).fold(0.0, f64::max)
    }

    #[test]
    fn positions_are_continuous_on_roads_that_close_or_cross() {
        let radius_m = 25.0;
        let turn = |share: f64| (share * TAU * radius_m, 1.0 / radius_m);
        let back = |share: f64| (share * TAU * radius_m, -1.0 / radius_m);
        for segments in [
            vec![(15.0, 0.0), turn(1.0), (40.0, 0.0)],
            vec![(15.0, 0.0), turn(1.05), (40.0, 0.0)],
            vec![(15.0, 0.0), turn(3.0), (40.0, 0.0)],
            vec![(12.0, 0.0), turn(1.0), back(1.0), (40.0, 0.0)],
        ] {
            let line = line(&segments);
            for (d_m, step_m) in [(0.0, 0.1), (1.2, 0.5), (-1.2, 5.0), (0.4, 12.0)] {
                // The arc is approximated by 1 m chords, within a few centimetres.
                let worst_m = worst(&line, d_m, step_m);
                assert!(worst_m < 0.1, "{segments:?} {d_m}: {worst_m}");
            }
        }
    }

    #[test]
    fn tracker_stays_on_its_lap_where_projection_finds_the_first() {
        let line = line(&[(15.0, 0.0), (2.0 * TAU * 25.0, 0.04)]);
        let s_m = 15.0 + TAU * 25.0 + 40.0;
        let there = line.at(s_m).pose;
        assert!((line.project_pose(there).s_m - 55.0).abs() < 0.1, "the first of two equal places");
        let mut tracker = LineTracker::starting_at(s_m - 5.0, there.point());
        assert!((tracker.locate(&line, there).s_m - s_m).abs() < 0.1);
    }

    #[test]
    fn projected_pose_takes_the_branch_of_its_direction_at_a_crossing() {
        // Three quarters of a circle to the left, then straight across the start at a right angle.
        let line = line(&[(40.0, 0.0), (0.75 * TAU * 20.0, 0.05), (60.0, 0.0)]);
        let crossing_s_m = 40.0 + 0.75 * TAU * 20.0 + 20.0;
        let at = Pose2::new(20.0, 0.3, -core::f64::consts::FRAC_PI_2);
        assert!((line.project_pose(at).s_m - (crossing_s_m - 0.3)).abs() < 0.3);
        assert!((line.project_pose(Pose2::new(20.0, 0.3, 0.0)).s_m - 20.0).abs() < 1e-6);
    }

    #[test]
    fn tracker_recovers_after_a_jump() {
        let line = line(&[(400.0, 0.0)]);
        let mut tracker = LineTracker::starting_at(10.0, Point2::new(300.0, 0.0));
        let place = tracker.locate(&line, Pose2::new(300.0, 1.0, 0.0));
        assert!((place.s_m - 300.0).abs() < 1e-9 && (place.d_m - 1.0).abs() < 1e-9, "{place:?}");
    }
}
