//! Timely accuracy: accuracy of a result at the instant at which it can be used (Gog et al. 2021, section 5; Li et al.
//! 2020 for the end-anchored form, streaming accuracy).
//!
//! Results have the stamp of the frame that they describe and are finished a run time later. Ground truth exists only
//! at the instants of frames, so the end of a run is moved to a frame. This module decides which result is compared
//! with which frame; any metric can then evaluate the pair.

use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};

/// Rule for moving the end of a run to a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Snap {
    /// First frame that is not earlier.
    #[default]
    Ceil,
    /// Nearest frame; of two the later one.
    Round,
}

/// Time of a finished result.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Finished {
    /// Instant that it describes.
    pub stamp: Time,
    /// Time from then until it can be used: run time and all waiting.
    pub after: Span,
}

impl Snap {
    /// Frame of an instant; `None` beyond the last one (for `Round`, by more than half of the last gap). `frames` must
    /// be increasing.
    pub fn frame(self, frames: &[Time], at: Time) -> Option<usize> {
        let next = frames.partition_point(|frame| *frame < at);
        let Some(before) = next.checked_sub(1).filter(|_| self == Self::Round) else {
            return (next < frames.len()).then_some(next);
        };
        let since = at - frames[before];
        match frames.get(next) {
            Some(frame) if since >= *frame - at => Some(next),
            Some(_) => Some(before),
            None => {
                let gap = before.checked_sub(1).map_or(Span::ZERO, |k| frames[before] - frames[k]);
                (since.ns() * 2 < gap.ns()).then_some(before)
            }
        }
    }
}

/// For every result, in order, the frame at which it is finished: (result, frame). Results that end beyond the last
/// frame are left out.
pub fn start_anchored(frames: &[Time], results: &[Finished], snap: Snap) -> Vec<(usize, usize)> {
    let of = |(k, r): (usize, &Finished)| Some((k, snap.frame(frames, r.stamp + r.after)?));
    results.iter().enumerate().filter_map(of).collect()
}

/// For every frame, the result with the newest stamp among those finished by then, of equal ones the later in their
/// order; `None` if there is none yet, which counts as an empty result.
pub fn end_anchored(frames: &[Time], results: &[Finished], snap: Snap) -> Vec<Option<usize>> {
    let mut newest: Vec<Option<usize>> = vec![None; frames.len()];
    for (result, frame) in start_anchored(frames, results, snap) {
        newest[frame] = newer(results, newest[frame], Some(result));
    }
    for frame in 1..frames.len() {
        newest[frame] = newer(results, newest[frame - 1], newest[frame]);
    }
    newest
}

fn newer(results: &[Finished], a: Option<usize>, b: Option<usize>) -> Option<usize> {
    a.into_iter().chain(b).max_by_key(|&k| (results[k].stamp, k))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn results(of_ms: &[(i64, i64)]) -> Vec<Finished> {
        of_ms.iter().map(|&(s, d)| Finished { stamp: Time::from_ms(s), after: Span::from_ms(d) }).collect()
    }

    #[test]
    fn ends_are_moved_to_frames() {
        let frames = [0, 100, 200].map(Time::from_ms);
        for (at_ms, ceil, round) in [
            (0, Some(0), Some(0)),
            (1, Some(1), Some(0)),
            (49, Some(1), Some(0)),
            (50, Some(1), Some(1)),
            (100, Some(1), Some(1)),
            (249, None, Some(2)),
            (250, None, None),
        ] {
            let at = Time::from_ms(at_ms);
            assert_eq!(Snap::Ceil.frame(&frames, at), ceil, "{at_ms}");
            assert_eq!(Snap::Round.frame(&frames, at), round, "{at_ms}");
        }
        assert_eq!(Snap::Round.frame(&[], Time::from_ms(1)), None);
    }

    #[test]
    fn results_are_paired_by_their_end_and_by_frames() {
        let frames = [0, 100, 200, 300, 400].map(Time::from_ms);
        // The second takes long; the third, of a newer frame, is finished before it.
        let results = results(&[(0, 110), (100, 290), (200, 90), (300, 120)]);
        assert_eq!(start_anchored(&frames, &results, Snap::Ceil), [(0, 2), (1, 4), (2, 3)]);
        assert_eq!(start_anchored(&frames, &results, Snap::Round), [(0, 1), (1, 4), (2, 3), (3, 4)]);
        assert_eq!(end_anchored(&frames, &results, Snap::Ceil), [None, None, Some(0), Some(2), Some(2)]);
        assert_eq!(end_anchored(&frames, &results, Snap::Round), [None, Some(0), Some(0), Some(2), Some(3)]);
    }

    #[test]
    fn each_frame_has_its_own_result_at_zero_run_time() {
        let frames = [0, 33, 67, 100].map(Time::from_ms);
        let results = results(&[(0, 0), (33, 0), (67, 0), (100, 0)]);
        for snap in [Snap::Ceil, Snap::Round] {
            assert_eq!(start_anchored(&frames, &results, snap), [(0, 0), (1, 1), (2, 2), (3, 3)]);
            assert_eq!(end_anchored(&frames, &results, snap), [0, 1, 2, 3].map(Some));
        }
    }
}
