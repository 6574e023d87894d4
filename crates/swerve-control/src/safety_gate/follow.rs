//! Check that the vehicle follows its commands, by its reported speed and steering angle.
//!
//! ```text
//! steering:      reported angle        in  [least, greatest] of the last `response_s` of commands, +- tolerance
//! acceleration:  slope of the speed    in  the same over the fitted time and `response_s` before, +- tolerance
//! speed:         reported speed        at most the permitted one, + tolerance
//! ```
//!
//! The range of the commands stands for any actuator that responds within `response_s`, whatever its dynamics. A car
//! that brakes on ice is slower to stop than commanded, but it slows down: too little deceleration counts only if the
//! car does not slow down at all. Too little acceleration never counts (power, slopes).

use std::collections::VecDeque;

use swerve_core::{Span, Time};
use swerve_msg::{StopCause, VehicleReport};

use super::GateParams;

/// Interval of kept commands and reports.
const EVERY: Span = Span::from_ms(10);
/// Longest gap between two reports that a fit bridges.
const GAP_MAX: Span = Span::from_ms(300);
/// Speed below which a car may stand: brakes hold it, and its steering may not move, m/s.
const MOVES_MPS: f64 = 0.5;
/// Deceleration of a car that brakes on ice, m/s².
const ICE_MPS2: f64 = 0.3;
/// Fewest reports of a fit.
const REPORTS_MIN: usize = 5;
/// Number of its standard errors by which a fitted acceleration may differ.
const SIGMAS: f64 = 3.0;

/// Least and greatest value.
#[derive(Clone, Copy, Debug)]
struct Range {
    least: f64,
    greatest: f64,
}

impl Range {
    const NONE: Self = Self { least: f64::INFINITY, greatest: f64::NEG_INFINITY };

    fn with(self, other: Self) -> Self {
        Self { least: self.least.min(other.least), greatest: self.greatest.max(other.greatest) }
    }

    fn of(value: f64) -> Self {
        Self { least: value, greatest: value }
    }
}

/// Commands of a short time.
#[derive(Clone, Copy, Debug)]
struct Sent {
    /// Instant of the first one; it holds until the next.
    at: Time,
    steering_rad: Range,
    accel_mps2: Range,
}

/// Speed fitted by a straight line.
struct Fit {
    slope_mps2: f64,
    /// Standard error of the slope, m/s².
    error_mps2: f64,
}

/// Compares the reports with the commands since the gate drives.
#[derive(Clone, Debug, Default)]
pub(super) struct FollowCheck {
    since: Option<Time>,
    sent: VecDeque<Sent>,
    /// Stamps and speeds of the latest reports, m/s.
    speeds: VecDeque<(Time, f64)>,
    /// Highest speed so far that is no excess: the permitted one, or that at which the car was taken over, m/s.
    allowed_mps: Option<f64>,
    steering_off: Option<Time>,
    speed_off: Option<Time>,
    fault: Option<StopCause>,
}

impl FollowCheck {
    /// Forgets all: the gate does not drive.
    pub(super) fn clear(&mut self) {
        if self.since.is_some() {
            *self = Self::default();
        }
    }

    /// Takes a command sent to the vehicle.
    pub(super) fn take_command(&mut self, now: Time, steering_rad: f64, accel_mps2: f64, p: &GateParams) {
        if p.ignored_after_s <= 0.0 {
            return;
        }
        self.since = self.since.or(Some(now));
        let steering_rad = Range::of(steering_rad);
        let accel_mps2 = Range::of(accel_mps2);
        match self.sent.back_mut().filter(|last| now - last.at < EVERY) {
            Some(last) => {
                last.steering_rad = last.steering_rad.with(steering_rad);
                last.accel_mps2 = last.accel_mps2.with(accel_mps2);
            }
            None => self.sent.push_back(Sent { at: now, steering_rad, accel_mps2 }),
        }
        let kept = Span::from_secs(p.response_s + p.ignored_after_s + p.report_timeout_s);
        while self.sent.get(1).is_some_and(|second| now - second.at > kept) {
            self.sent.pop_front();
        }
    }

    /// Takes a report with finite numbers, in order of stamps.
    pub(super) fn take_report(&mut self, report: &VehicleReport, p: &GateParams) {
        let VehicleReport { stamp, speed_mps, .. } = *report;
        let Some(since) = self.since.filter(|since| stamp > *since) else { return };
        match self.speeds.back() {
            Some((last, _)) if stamp - *last < EVERY => return,
            Some((last, _)) if stamp - *last > GAP_MAX => self.speeds.clear(),
            _ => {}
        }
        self.speeds.push_back((stamp, speed_mps));
        let window = Span::from_secs(p.ignored_after_s);
        while self.speeds.get(1).is_some_and(|(second, _)| stamp - *second >= window) {
            self.speeds.pop_front();
        }
        self.speed_off = if self.is_too_fast(speed_mps, p) { self.speed_off.or(Some(stamp)) } else { None };
        self.steering_off =
            if self.steers_otherwise(report, p) { self.steering_off.or(Some(stamp)) } else { None };
        let lasts = |off: Option<Time>| off.is_some_and(|off| stamp - off >= window);
        self.fault = match () {
            () if lasts(self.steering_off) => Some(StopCause::SteeringDeviation),
            () if lasts(self.speed_off) => Some(StopCause::SpeedExcess),
            () if self.accelerates_otherwise(since, stamp, p) => Some(StopCause::AccelDeviation),
            () => None,
        };
    }

    /// The deviation that lasted for too long.
    pub(super) fn fault(&self) -> Option<StopCause> {
        self.fault
    }

    /// A car that was faster when the gate took over may slow down to the permitted speed, but not become faster.
    fn is_too_fast(&mut self, speed_mps: f64, p: &GateParams) -> bool {
        let allowed = self.allowed_mps.unwrap_or(f64::INFINITY).min(speed_mps.max(p.speed_max_mps));
        self.allowed_mps = Some(allowed);
        p.speed_excess_mps > 0.0 && speed_mps > allowed + p.speed_excess_mps
    }

    fn steers_otherwise(&self, report: &VehicleReport, p: &GateParams) -> bool {
        let tolerance_rad = p.steering_error_rad;
        if tolerance_rad <= 0.0 || report.speed_mps.abs() < MOVES_MPS {
            return false;
        }
        let from = report.stamp - Span::from_secs(p.response_s);
        let Range { least, greatest } = self.commanded(from, report.stamp, |sent| sent.steering_rad);
        report.steering_rad < least - tolerance_rad || report.steering_rad > greatest + tolerance_rad
    }

    fn accelerates_otherwise(&self, since: Time, stamp: Time, p: &GateParams) -> bool {
        let from = stamp - Span::from_secs(p.ignored_after_s + p.response_s);
        let whole =
            self.speeds.front().is_some_and(|(first, _)| (stamp - *first).as_secs() >= p.ignored_after_s);
        let moves = self.speeds.iter().all(|(_, speed_mps)| *speed_mps > MOVES_MPS);
        if p.accel_error_mps2 <= 0.0 || from < since || !whole || !moves {
            return false;
        }
        let Some(Fit { slope_mps2, error_mps2 }) = self.fit(stamp) else { return false };
        let Range { least, greatest } = self.commanded(from, stamp, |sent| sent.accel_mps2);
        let tolerance = p.accel_error_mps2 + SIGMAS * error_mps2;
        let too_fast = slope_mps2 > greatest + tolerance && slope_mps2 > -ICE_MPS2;
        too_fast || slope_mps2 < least.min(0.0) - tolerance
    }

    /// Range of the commands that were in effect between two instants.
    fn commanded(&self, from: Time, to: Time, of: fn(&Sent) -> Range) -> Range {
        let mut range = Range::NONE;
        for (k, sent) in self.sent.iter().enumerate() {
            let ended = self.sent.get(k + 1).is_some_and(|next| next.at < from);
            if !ended && sent.at <= to {
                range = range.with(of(sent));
            }
        }
        range
    }

    /// Least-squares line through the speeds.
    fn fit(&self, stamp: Time) -> Option<Fit> {
        let n = self.speeds.len();
        if n < REPORTS_MIN {
            return None;
        }
        let count = n as f64;
        let points = || self.speeds.iter().map(|(at, speed_mps)| ((*at - stamp).as_secs(), *speed_mps));
        let mean_s = points().map(|(t, _)| t).sum::<f64>() / count;
        let mean_mps = points().map(|(_, v)| v).sum::<f64>() / count;
        let sum_tt: f64 = points().map(|(t, _)| (t - mean_s) * (t - mean_s)).sum();
        let sum_tv: f64 = points().map(|(t, v)| (t - mean_s) * (v - mean_mps)).sum();
        let slope_mps2 = sum_tv / sum_tt;
        let rest: f64 = points()
            .map(|(t, v)| {
                let off = v - mean_mps - slope_mps2 * (t - mean_s);
                off * off
            })
            .sum();
        Some(Fit { slope_mps2, error_mps2: (rest / (count - 2.0) / sum_tt).sqrt() })
    }
}

#[cfg(test)]
mod tests;
