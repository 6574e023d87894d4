//! Comparison of perception with the ground truth, accumulated over a ride.

use swerve_eval::{AveragePrecision, Confusion, Found, Recalls, TrackingFrame, TrackingMetrics, image_iou};

use super::ride::{Boxed, Sight};
use crate::result::Reading;
use crate::tables::Measure;

/// Selection of the frames that are compared.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Anchor {
    Start,
    End,
}

/// Upper bound of Cityscapes ids; 0 is unknown and not a class.
const CLASSES: u8 = 34;
/// Minimum overlap of a match.
const OVERLAP_MIN: f64 = 0.5;

/// Score of one measure at one run time.
pub(super) struct Score {
    measure: Measure,
    pub(super) anchor: Anchor,
    pub(super) time: usize,
    values: Vec<f64>,
    precision: AveragePrecision,
    tracked: Vec<TrackingFrame>,
}

impl Score {
    /// Scores for both anchors; trackers need a regular stream of frames and are evaluated with the `start` anchor
    /// only.
    pub(super) fn both(measure: Measure, time: usize) -> impl Iterator<Item = Self> {
        let is_asked = move |anchor: &Anchor| *anchor == Anchor::Start || !measure.tracks();
        [Anchor::Start, Anchor::End].into_iter().filter(is_asked).map(move |anchor| Self {
            measure,
            anchor,
            time,
            values: Vec::new(),
            precision: AveragePrecision::new(OVERLAP_MIN),
            tracked: Vec::new(),
        })
    }

    /// Compares the perceived frame with the ground truth; `None` counts as an empty report.
    pub(super) fn take(&mut self, seen: Option<&Sight>, there: &Sight) {
        let nothing = Sight::default();
        let found = seen.unwrap_or(&nothing);
        match self.measure {
            Measure::Miou => {
                let value = seen.map_or(Some(0.0), |seen| mean_iou(&there.labels, &seen.labels));
                self.values.extend(value);
            }
            Measure::GroupedMiou => {
                let value = seen.map_or(Some(0.0), |seen| mean_iou(&there.grouped, &seen.grouped));
                self.values.extend(value);
            }
            Measure::ForestMiou => {
                let value = seen.map_or(Some(0.0), |seen| mean_iou(&there.grouped, &seen.segmented));
                self.values.extend(value);
            }
            Measure::Ap50 => self.values.extend(share_right(&there.people, &found.people)),
            Measure::DetectorAp50 => {
                let all: Vec<Found> =
                    found.found.iter().map(|&(f, counts)| Found { score: f.score, counts }).collect();
                let wanted: Vec<bool> = there.wanted.iter().map(|(_, counts)| *counts).collect();
                let overlap = |f: usize, w: usize| image_iou(found.found[f].0.box_px, there.wanted[w].0.1);
                self.precision.frame(&all, &wanted, overlap);
            }
            Measure::Sort | Measure::Bytetrack => {
                let counting = there.wanted.iter().filter(|(_, counts)| *counts);
                let truth: Vec<Boxed> = counting.map(|(boxed, _)| *boxed).collect();
                let place = self.measure.place().unwrap_or_default();
                self.tracked.push(TrackingFrame::of_boxes(&truth, &found.tracks[place]));
            }
        }
    }

    /// Readings, with the run times in the units of the study.
    pub(super) fn readings(self, named: &[f64]) -> Vec<Reading> {
        let at = named[self.time];
        let anchor = if self.anchor == Anchor::Start { "start" } else { "end" };
        let of = |series: String, values: Vec<f64>| Reading { series, at, values };
        let one = |series: String, value: Option<f64>| of(series, value.into_iter().collect());
        match self.measure {
            Measure::Miou => vec![of(format!("mIoU {anchor}"), self.values)],
            Measure::GroupedMiou => vec![of(format!("mIoU of 7 classes {anchor}"), self.values)],
            Measure::ForestMiou => vec![of(format!("mIoU of the forest {anchor}"), self.values)],
            Measure::Ap50 => vec![of(format!("AP50 {anchor}"), self.values)],
            Measure::DetectorAp50 => {
                vec![one(format!("detector AP50 {anchor}"), self.precision.value(Recalls::Coco101))]
            }
            Measure::Sort | Measure::Bytetrack => {
                let name = if self.measure == Measure::Sort { "SORT" } else { "ByteTrack" };
                let all = TrackingMetrics::of(&self.tracked);
                vec![
                    one(format!("MOTA {name}"), all.clear.mota),
                    one(format!("IDF1 {name}"), all.identity.idf1),
                    one(format!("HOTA {name}"), Some(all.hota.hota)),
                ]
            }
        }
    }
}

impl Measure {
    /// True if the measure needs a regular stream of frames.
    pub(super) fn tracks(self) -> bool {
        self.place().is_some()
    }

    /// Index of a tracker among the tracks of a sight.
    fn place(self) -> Option<usize> {
        match self {
            Self::Sort => Some(0),
            Self::Bytetrack => Some(1),
            Self::Miou | Self::GroupedMiou | Self::ForestMiou | Self::Ap50 | Self::DetectorAp50 => None,
        }
    }
}

/// Mean over the classes that occur in either image; `None` if there are none.
pub(super) fn mean_iou(there: &[u8], seen: &[u8]) -> Option<f64> {
    let mut confusion = Confusion::new(CLASSES, None);
    confusion.image(there, seen).expect("the renderer's labels are Cityscapes ids");
    let ious: Vec<f64> = (1..CLASSES).filter_map(|class| confusion.iou(class)).collect();
    (!ious.is_empty()).then(|| ious.iter().sum::<f64>() / ious.len() as f64)
}

/// Share of the perceived boxes that match a true one, each a different one. 0 if only one of the lists is empty,
/// `None` if both are.
pub(super) fn share_right(there: &[Boxed], seen: &[Boxed]) -> Option<f64> {
    let mut one = AveragePrecision::new(OVERLAP_MIN);
    let found = vec![Found { score: 1.0, counts: true }; seen.len()];
    one.frame(&found, &vec![true; there.len()], |f, w| image_iou(seen[f].1, there[w].1));
    match (there.len(), seen.len()) {
        (0, 0) => None,
        (_, 0) | (0, _) => Some(0.0),
        _ => one.curve()?.last().map(|(_, precision)| *precision),
    }
}
