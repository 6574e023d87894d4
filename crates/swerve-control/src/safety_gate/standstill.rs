//! Standstill detection from the vehicle's reports.

use swerve_core::Time;
use swerve_geom::math;
use swerve_msg::VehicleReport;

/// Time constant of the mean reported speed, seconds. Encoders of 96 counts per turn read at 50 Hz report speeds in
/// steps of half a metre per second: a single report does not distinguish creeping from standing.
const MEAN_S: f64 = 0.2;
/// Mean speed below which the car stands, m/s.
const BELOW_MPS: f64 = 0.1;
/// Mean speed above which a standstill ends, m/s.
const ABOVE_MPS: f64 = 0.3;

/// Standstill detection by a mean of the reports with hysteresis.
///
/// Only the gate's mode depends on it, not the brake.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Standstill {
    /// Stamp of the newest report, and the mean speed then, m/s.
    mean: Option<(Time, f64)>,
    stands: bool,
}

impl Standstill {
    /// Takes a report with a finite speed, in order of stamps.
    pub(super) fn take(&mut self, report: &VehicleReport) {
        let VehicleReport { stamp, speed_mps, .. } = *report;
        let mean_mps = self.mean.map_or(speed_mps, |(before, mean_mps)| {
            let weight = math::exp(-((stamp - before).as_secs() / MEAN_S).max(0.0));
            weight * mean_mps + (1.0 - weight) * speed_mps
        });
        self.mean = Some((stamp, mean_mps));
        self.stands = mean_mps.abs() < if self.stands { ABOVE_MPS } else { BELOW_MPS };
    }

    /// Returns true if the car stands; false without a report.
    pub(super) fn stands(&self) -> bool {
        self.stands
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stands_after(state: &mut Standstill, from_ms: i64, speeds_mps: impl Iterator<Item = f64>) -> bool {
        for (i, speed_mps) in (0..).zip(speeds_mps) {
            state.take(&VehicleReport {
                stamp: Time::from_ms(from_ms + 20 * i),
                speed_mps,
                ..VehicleReport::default()
            });
        }
        state.stands()
    }

    #[test]
    fn one_report_does_not_change_the_state() {
        let mut state = Standstill::default();
        assert!(!stands_after(&mut state, 0, [1.0, 0.0, 1.0, 0.0].into_iter()), "it creeps at 0.5 m/s");
        assert!(stands_after(&mut state, 100, core::iter::repeat_n(0.0, 40)));
        assert!(stands_after(&mut state, 900, core::iter::once(2.0)), "0.19 m/s in the mean");
        assert!(!stands_after(&mut state, 920, core::iter::repeat_n(2.0, 2)), "it rolls");
    }

    #[test]
    fn noise_about_zero_is_a_standstill() {
        let mut state = Standstill::default();
        // Alternating by 0.5 m/s.
        let speeds = (0..100).map(|i| if i % 2 == 0 { 0.5 } else { -0.5 });
        assert!(stands_after(&mut state, 0, speeds));
    }
}
