//! Use of the safety gate in a drive.

use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_msg::{GateMode, GateOutput, Refusals, StopCause};

use crate::seconds;

/// Time spent in each mode of the gate, and its interventions.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct GateMetrics {
    /// Time in which the driver drove, seconds.
    pub manual_s: f64,
    /// Time in which the stack drove, seconds.
    pub driving_s: f64,
    /// Time in which the car was brought to a standstill, seconds.
    pub stopping_s: f64,
    /// Time in which the car was held, seconds.
    pub holding_s: f64,
    /// Time in which the stack drove and its command was modified by limits or rates, seconds.
    pub limited_s: f64,
    /// Mode at the end.
    pub end: GateMode,
    /// Stops with start and cause; an emergency during another stop counts separately. If the car rolls and is braked
    /// again, it is the same stop.
    pub stops: Vec<GateStop>,
    /// Refused commands, by reason.
    pub refused: Refusals,
}

/// A stop by the gate.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct GateStop {
    /// Start, seconds.
    pub at_s: f64,
    /// Cause.
    pub cause: StopCause,
}

/// Cause of a stop or hold; `None` while the driver or the stack drives.
pub(crate) fn stop_cause(mode: GateMode) -> Option<StopCause> {
    match mode {
        GateMode::Manual | GateMode::Driving => None,
        GateMode::Stopping(cause) | GateMode::Holding(cause) => Some(cause),
    }
}

/// Accumulates the outputs of a gate, tick by tick.
#[derive(Clone, Debug, Default)]
pub struct GateUse {
    last: Option<(Time, GateOutput)>,
    /// Time in manual, driving, stopping and holding; and limited.
    spans: [Span; 5],
    stops: Vec<(Time, StopCause)>,
}

impl GateUse {
    /// Adds the gate's output at an instant. It holds until the next.
    pub fn take(&mut self, at: Time, output: &GateOutput) {
        let before = self.last.and_then(|(_, before)| stop_cause(before.mode));
        if let Some((since, before)) = &self.last {
            let passed = at - *since;
            let mode = match before.mode {
                GateMode::Manual => 0,
                GateMode::Driving => 1,
                GateMode::Stopping(_) => 2,
                GateMode::Holding(_) => 3,
            };
            self.spans[mode] += passed;
            if before.limited && before.mode == GateMode::Driving {
                self.spans[4] += passed;
            }
        }
        if let GateMode::Stopping(cause) = output.mode
            && before != Some(cause)
        {
            self.stops.push((at, cause));
        }
        self.last = Some((at, *output));
    }

    /// Metrics; `None` without a gate.
    pub fn metrics(&self) -> Option<GateMetrics> {
        let (_, last) = self.last.as_ref()?;
        let [manual_s, driving_s, stopping_s, holding_s, limited_s] = self.spans.map(|span| span.as_secs());
        let stops = self.stops.iter().map(|&(at, cause)| GateStop { at_s: seconds(at), cause });
        Some(GateMetrics {
            manual_s,
            driving_s,
            stopping_s,
            holding_s,
            limited_s,
            end: last.mode,
            stops: stops.collect(),
            refused: last.refusals,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mode_durations_last_until_the_next_output() {
        let mut gate = GateUse::default();
        assert_eq!(gate.metrics(), None);
        let modes = [
            GateMode::Manual,
            GateMode::Driving,
            GateMode::Driving,
            GateMode::Stopping(StopCause::Released),
            GateMode::Stopping(StopCause::Emergency),
            GateMode::Holding(StopCause::Emergency),
            GateMode::Stopping(StopCause::Emergency),
            GateMode::Holding(StopCause::Emergency),
            GateMode::Driving,
            GateMode::Stopping(StopCause::Emergency),
        ];
        for (k, mode) in modes.into_iter().enumerate() {
            let limited = k != 1;
            let refusals = Refusals { stale: k as u64, ..Refusals::default() };
            let output = GateOutput { mode, limited, refusals, ..GateOutput::default() };
            gate.take(Time::from_ms(100 * k as i64), &output);
        }
        let metrics = gate.metrics().unwrap();
        let spans = [metrics.manual_s, metrics.driving_s, metrics.stopping_s, metrics.holding_s];
        let ms = spans.map(|span_s| (span_s * 1e3).round());
        assert_eq!((ms, metrics.limited_s), ([100.0, 300.0, 300.0, 200.0], 0.2));
        let stops: Vec<_> = metrics.stops.iter().map(|stop| (stop.at_s, stop.cause)).collect();
        assert_eq!(
            stops,
            [(0.3, StopCause::Released), (0.4, StopCause::Emergency), (0.9, StopCause::Emergency)]
        );
        assert_eq!((metrics.end, metrics.refused.total()), (GateMode::Stopping(StopCause::Emergency), 9));
    }
}
