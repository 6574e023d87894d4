//! Latency of sensors with exposure, readout and transfer.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Span;

/// Durations of exposure, readout and transfer of one frame; all zero by default: captured and available at once.
///
/// The **stamp** of a frame is the middle of its exposure. It becomes **visible** after its transfer,
/// [`visible_after`](Self::visible_after) later. In the engine a sensor ticks at its stamps, and the time from there to
/// the end of the transfer is the run time of its step.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SensorTiming {
    /// Exposure, or echo collection, milliseconds.
    pub exposure_ms: f64,
    /// Readout of the frame, milliseconds.
    pub readout_ms: f64,
    /// Transfer to the computer, milliseconds.
    pub transfer_ms: f64,
    /// True if rows are exposed one after the other during readout, instead of all at once before it.
    pub rolling: bool,
}

impl SensorTiming {
    /// Time from the start of the exposure to the stamp. For a rolling shutter: from the start of its first row.
    pub fn starts_before(&self) -> Span {
        ms(0.5 * self.exposure_ms + if self.rolling { 0.5 * self.readout_ms } else { 0.0 })
    }

    /// Time from the stamp to the end of the transfer.
    ///
    /// A global-shutter frame is read out after its exposure: half the exposure, the readout, the transfer. The stamp
    /// of a rolling-shutter frame is the middle of its middle row: half the readout follows.
    pub fn visible_after(&self) -> Span {
        let readout_ms = if self.rolling { 0.5 * self.readout_ms } else { self.readout_ms };
        ms(0.5 * self.exposure_ms + readout_ms + self.transfer_ms)
    }

    /// Time from the stamp to the middle of the exposure of `row` (from the top, from 0) of `rows`.
    pub fn row_offset(&self, row: u32, rows: u32) -> Span {
        if !self.rolling || rows < 2 {
            return Span::ZERO;
        }
        ms(self.readout_ms * (f64::from(row.min(rows - 1)) / f64::from(rows - 1) - 0.5))
    }

    /// Number of frames between stamp and end of transfer at once, with one every `period`: the pipeline depth an
    /// operator needs to lose none.
    pub fn in_flight(&self, period: Span) -> usize {
        let (period, after) = (period.ns().max(1), self.visible_after().ns());
        usize::try_from((after + period - 1) / period).unwrap_or(0).max(1)
    }
}

fn ms(ms: f64) -> Span {
    Span::from_secs(ms * 1e-3)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: SensorTiming =
        SensorTiming { exposure_ms: 10.0, readout_ms: 16.0, transfer_ms: 4.0, rolling: false };

    #[test]
    fn frame_is_visible_at_the_end_of_its_transfer() {
        assert_eq!((CAMERA.starts_before(), CAMERA.visible_after()), (Span::from_ms(5), Span::from_ms(25)));
        let rolling = SensorTiming { rolling: true, ..CAMERA };
        // First row from 13 ms before the stamp, last row until 13 ms after it.
        assert_eq!(
            (rolling.starts_before(), rolling.visible_after()),
            (Span::from_ms(13), Span::from_ms(17))
        );
        assert_eq!(SensorTiming::default().visible_after(), Span::ZERO);
    }

    #[test]
    fn rows_of_a_rolling_frame_are_spread_around_the_stamp() {
        let rolling = SensorTiming { rolling: true, ..CAMERA };
        let of = |row| rolling.row_offset(row, 601);
        assert_eq!((of(0), of(300), of(600)), (Span::from_ms(-8), Span::ZERO, Span::from_ms(8)));
        assert_eq!((of(9999), rolling.row_offset(0, 1)), (Span::from_ms(8), Span::ZERO));
        assert_eq!(CAMERA.row_offset(0, 601), Span::ZERO);
    }

    #[test]
    fn frames_in_flight_are_counted() {
        let of = |period_ms| CAMERA.in_flight(Span::from_ms(period_ms));
        assert_eq!((of(50), of(25), of(24), of(10)), (1, 1, 2, 3));
        assert_eq!(SensorTiming::default().in_flight(Span::from_ms(50)), 1);
        assert_eq!(CAMERA.in_flight(Span::ZERO), 25_000_000);
    }
}
