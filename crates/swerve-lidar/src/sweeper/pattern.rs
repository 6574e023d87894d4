//! Firing pattern of a turn: directions of the beams, and azimuths and instants of the columns.

use core::ops::Range;

use swerve_geom::math;
use swerve_scene::vector::scale;

use crate::spec::LidarSpec;

/// Firing pattern of a lidar.
pub(crate) struct Pattern {
    pub(super) spec: LidarSpec,
    /// Duration of a turn, nanoseconds.
    pub(super) period_ns: i64,
    /// Directions of the beams in a column at azimuth 0.
    pub(super) beams: Vec<[f32; 3]>,
    pub(super) columns: Vec<Column>,
}

/// Column of a turn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Column {
    /// Sine and cosine of its azimuth.
    pub(super) azimuth: [f64; 2],
    /// Firing time since the first column, nanoseconds.
    pub(super) at_ns: i64,
    pub(super) offset_s: f32,
}

/// Nanoseconds per second.
const SECOND_NS: f64 = 1e9;

impl Pattern {
    /// Pattern of a valid specification.
    pub(super) fn new(spec: LidarSpec) -> Self {
        let period_ns = (SECOND_NS / spec.rate_hz).round() as i64;
        let beams = spec.beams.iter().map(|beam| {
            let (sin_elevation, cos_elevation) = math::sin_cos(beam.elevation_rad);
            let (sin_azimuth, cos_azimuth) = math::sin_cos(beam.azimuth_rad);
            [cos_elevation * cos_azimuth, cos_elevation * sin_azimuth, sin_elevation].map(|x| x as f32)
        });
        let turn_rad = if spec.is_clockwise { -1.0 } else { 1.0 } * 2.0 * core::f64::consts::PI;
        let columns = (0..spec.columns).map(|k| {
            let share = f64::from(k) / f64::from(spec.columns);
            let (sin, cos) = math::sin_cos(spec.first_azimuth_rad + turn_rad * share);
            let at_ns = column_ns(k, period_ns, spec.columns);
            Column { azimuth: [sin, cos], at_ns, offset_s: (at_ns as f64 / SECOND_NS) as f32 }
        });
        let (beams, columns) = (beams.collect(), columns.collect());
        Self { spec, period_ns, beams, columns }
    }

    /// Largest number of points per turn.
    pub(super) fn points_max(&self) -> usize {
        self.beams.len() * self.columns.len()
    }

    /// Columns of a turn with instants in `[begin_ns, end_ns)`; consecutive pieces cover each column once.
    pub(super) fn columns_between(&self, begin_ns: i64, end_ns: i64) -> Range<u32> {
        let (period, columns) = (i128::from(self.period_ns), i128::from(self.spec.columns));
        // The first column fired at or after an instant t is the smallest k with k period / columns >= t.
        let from = |at_ns: i64| {
            let at = i128::from(at_ns.clamp(0, self.period_ns));
            let k = ((at * columns) / period).clamp(0, columns);
            let late = |k: i128| k >= columns || k * period / columns >= i128::from(at_ns);
            if late(k) { k } else { k + 1 }
        };
        let first = from(begin_ns) as u32;
        first..(from(end_ns) as u32).max(first)
    }

    /// Firing time of a column since the first, seconds.
    pub(crate) fn offset_s(&self, column: u32) -> f32 {
        self.columns[column as usize].offset_s
    }

    /// Sine and cosine of a column's azimuth.
    pub(crate) fn azimuth(&self, column: u32) -> [f32; 2] {
        self.columns[column as usize].azimuth.map(|part| part as f32)
    }

    /// Point at a range along a beam of a column with this azimuth, sensor frame.
    pub(crate) fn point(&self, ring: usize, [sin, cos]: [f32; 2], range_m: f32) -> [f32; 3] {
        let [x, y, z] = self.beams[ring];
        scale([x * cos - y * sin, x * sin + y * cos, z], range_m)
    }
}

/// Firing time of a column since the first, nanoseconds.
fn column_ns(column: u32, period_ns: i64, columns: u32) -> i64 {
    (i128::from(column) * i128::from(period_ns) / i128::from(columns)) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_between_covers_every_column_once() {
        for (columns, rate_hz) in [(1800, 10.0), (2083, 10.0), (7, 333.0), (1, 20.0), (2048, 9.7)] {
            let spec = LidarSpec { columns, rate_hz, ..LidarSpec::default() };
            let pattern = Pattern::new(spec);
            let (mut next, mut from) = (0, -3_000_000);
            while from < pattern.period_ns {
                let fired = pattern.columns_between(from, from + 5_000_000);
                assert_eq!(fired.start, next);
                for column in fired.clone() {
                    assert!((from..from + 5_000_000).contains(&pattern.columns[column as usize].at_ns));
                }
                (next, from) = (fired.end, from + 5_000_000);
            }
            assert_eq!(next, columns);
            assert_eq!(pattern.columns_between(9, 9).len(), 0);
            assert_eq!(pattern.columns_between(i64::MIN, i64::MAX), 0..columns);
        }
        let pattern = Pattern::new(LidarSpec::default());
        assert_eq!(pattern.columns_between(5_000_000, 10_000_000), 90..180);
    }
}
