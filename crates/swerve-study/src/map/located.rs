//! A lidar found by a map, and by its own way, against the truth; wheels and gyroscopes straighten its turns.

use std::fmt;

use serde::Serialize;
use swerve_localization::eskf::angle_between;
use swerve_localization::map_file::MapFile;
use swerve_localization::matcher::{Guess, Matcher};
use swerve_localization::ndt::{Isometry3, Vector3};
use swerve_localization::odometry::Odometry;

/// How far off the first guess is along and across the road, metres, and how sure it says that it is.
const START_M: [f64; 2] = [1.0, 0.5];
const START_SIGMA: [f64; 2] = [1.5, 0.09];

/// Both on their way.
pub(super) struct Located<'a> {
    map: &'a MapFile,
    /// From the first turn on, with the truth of that.
    matcher: Option<(Matcher, Isometry3<f64>)>,
    odometry: Odometry,
    truth: Vec<Vector3<f64>>,
    /// Squares of errors on the ground (m²) and of the heading (rad²), each a turn.
    errors: Vec<[f64; 2]>,
    unmatched: usize,
    degenerate: usize,
    odometry_off_m: f64,
}

/// What is told.
#[derive(Serialize)]
pub(super) struct Report {
    turns: usize,
    way_m: f64,
    ndt_rms_2d_m: f64,
    ndt_max_2d_m: f64,
    ndt_heading_rms_deg: f64,
    ndt_unmatched: usize,
    ndt_degenerate: usize,
    odometry_end_off_m: f64,
    odometry_percent: f64,
}

impl<'a> Located<'a> {
    pub(super) fn new(map: &'a MapFile) -> Self {
        Self {
            map,
            matcher: None,
            odometry: Odometry::new(),
            truth: Vec::new(),
            errors: Vec::new(),
            unmatched: 0,
            degenerate: 0,
            odometry_off_m: 0.0,
        }
    }

    pub(super) fn take(&mut self, turn: &super::Turn) {
        let truth = turn.map_from_lidar;
        let (matcher, first) = self.matcher.get_or_insert_with(|| {
            let mut map_from_lidar = truth;
            map_from_lidar.translation.vector += Vector3::new(START_M[0], START_M[1], 0.0);
            let [sigma_m, sigma_rad] = START_SIGMA;
            (Matcher::new(self.map, 1, Guess { map_from_lidar, sigma_m, sigma_rad, particles: 200 }), truth)
        });
        let (sweep, moved) = (&turn.motion.sweep, turn.motion.over_turn);
        let since_last = if turn.motion.is_first { Isometry3::identity() } else { moved };
        let found = matcher.take(turn.measured.iter().copied(), sweep, &since_last);
        self.unmatched += usize::from(found.is_none());
        self.degenerate += usize::from(found.is_some_and(|found| found.degenerate > 0));
        let pose = matcher.pose();
        let off = pose.translation.vector - truth.translation.vector;
        let heading = angle_between(&truth.rotation, &pose.rotation);
        self.errors.push([off.x * off.x + off.y * off.y, heading * heading]);
        let way = *first * self.odometry.take_moved(turn.measured.iter().copied(), sweep, &moved).pose();
        self.odometry_off_m = (way.translation.vector - truth.translation.vector).norm();
        self.truth.push(truth.translation.vector);
    }

    pub(super) fn report(&self) -> Option<Report> {
        let way_m: f64 = self.truth.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
        let turns = self.errors.len();
        let mean = |k: usize| self.errors.iter().map(|error| error[k]).sum::<f64>() / turns as f64;
        (turns > 1).then(|| Report {
            turns,
            way_m,
            ndt_rms_2d_m: mean(0).sqrt(),
            ndt_max_2d_m: self.errors.iter().map(|error| error[0]).fold(0.0, f64::max).sqrt(),
            ndt_heading_rms_deg: mean(1).sqrt().to_degrees(),
            ndt_unmatched: self.unmatched,
            ndt_degenerate: self.degenerate,
            odometry_end_off_m: self.odometry_off_m,
            odometry_percent: 100.0 * self.odometry_off_m / way_m.max(1.0),
        })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} turns, {:.1} m", self.turns, self.way_m)?;
        writeln!(
            f,
            "by the map: {:.3} m rms on the ground, at most {:.3} m, {:.3}°; {} turns unmatched, {} degenerate",
            self.ndt_rms_2d_m,
            self.ndt_max_2d_m,
            self.ndt_heading_rms_deg,
            self.ndt_unmatched,
            self.ndt_degenerate
        )?;
        writeln!(
            f,
            "by its own way: {:.3} m off at the end, {:.2} %",
            self.odometry_end_off_m, self.odometry_percent
        )
    }
}
