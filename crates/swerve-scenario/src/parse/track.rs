//! Recorded motion of actors.

use std::sync::Arc;

use swerve_geom::Pose2;
use swerve_text::{Range, TableReader};
use toml::Value;

use super::PLACE;
use crate::Track;

/// Most poses of a track.
const POSES_MAX: usize = 100_000;

/// Reads the table `track`; without poses after a problem.
pub(super) fn read(table: &TableReader<'_>) -> Track {
    let Some(track) = table.table("track") else { return none() };
    let from_s = track.number_or("from_s", 0.0, Range::between(0.0, 86_400.0));
    let step_s = track.number("step_s", Range::between(0.001, 10.0));
    let points = track.pairs("at", "an array of pairs [x, y] in metres", [PLACE, PLACE]);
    let headings_rad = headings(&track);
    if points.len() > POSES_MAX {
        track.report("at", format!("expected at most {POSES_MAX} poses, found {}", points.len()));
    }
    let are_read = !points.is_empty() && !headings_rad.is_empty();
    if are_read && points.len() != headings_rad.len() {
        let (at, headings) = (points.len(), headings_rad.len());
        track.report("heading_rad", format!("expected {at} numbers as in `at`, found {headings}"));
    }
    track.finish();
    let poses: Arc<[Pose2]> =
        points.iter().zip(headings_rad).map(|([x, y], heading)| Pose2::new(*x, *y, heading)).collect();
    match poses.is_empty() {
        true => none(),
        false => Track { from_s, step_s, poses },
    }
}

/// Values after a problem.
fn none() -> Track {
    Track { from_s: 0.0, step_s: 0.1, poses: Arc::from([Pose2::default()]) }
}

fn headings(track: &TableReader<'_>) -> Vec<f64> {
    const WANTED: &str = "an array of headings in radians";
    let Some(value) = track.value("heading_rad") else {
        track.report("heading_rad", format!("is missing: expected {WANTED}"));
        track.reading().guess();
        return Vec::new();
    };
    let number = |value: &Value| match value {
        Value::Float(number) => Some(*number).filter(|number| number.is_finite() && number.abs() <= 100.0),
        Value::Integer(number) => Some(*number as f64).filter(|number| number.abs() <= 100.0),
        _ => None,
    };
    let read = value.as_array().and_then(|all| all.iter().map(number).collect::<Option<Vec<f64>>>());
    read.unwrap_or_else(|| {
        track.mistyped("heading_rad", WANTED, value);
        track.reading().guess();
        Vec::new()
    })
}
