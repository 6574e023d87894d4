//! SORT: simple online and realtime tracking (Bewley et al. 2016, arXiv 1602.00763).

use swerve_geom::{heaviest_pairs, image_iou};

use super::{ImageDetection, ImageTrack, ImageTracker, centred, edges, surest_usable};
use crate::axis::Axis;

/// Initial variances: of centre, area and aspect ratio; of their unobserved rates.
const FIRST: [f64; 2] = [10.0, 1e4];

/// Process noise per frame of value and rate: of the centre, of the area, of the aspect ratio.
const NOISE: [[f64; 2]; 3] = [[1.0, 0.01], [1.0, 1e-4], [1.0, 0.0]];

/// Measurement variances: of the centre; of area and aspect ratio.
const MEASURED: [f64; 2] = [1.0, 10.0];

/// Parameters of SORT.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Params {
    /// Smallest overlap of a box with its track.
    pub iou_min: f64,
    /// Consecutive frames without a box after which a track ends.
    pub age_max: u64,
    /// Consecutive frames with a box after which a track is reported, except in this many frames at the start.
    pub hits_min: u64,
}

impl Default for Params {
    fn default() -> Self {
        Self { iou_min: 0.3, age_max: 1, hits_min: 3 }
    }
}

/// Tracks boxes by overlap alone.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Sort {
    params: Params,
    frames: u64,
    given: u64,
    tracks: Vec<Followed>,
}

#[derive(Clone, PartialEq, Debug)]
struct Followed {
    id: u64,
    score: f64,
    /// Centre (across, down), area, width over height: px, px, px², 1.
    state: [Axis; 4],
    unseen: u64,
    streak: u64,
}

impl Sort {
    /// Tracker without tracks.
    pub fn new(params: Params) -> Self {
        Self { params, ..Self::default() }
    }

    /// Box of each track, if any.
    fn pair(&self, tracks: &[[f64; 4]], found: &[&ImageDetection]) -> Vec<Option<usize>> {
        let mut of = vec![None; tracks.len()];
        let mut edges = Vec::new();
        for (t, track) in tracks.iter().enumerate() {
            for (d, detection) in found.iter().enumerate() {
                let iou = image_iou(*track, detection.box_px);
                if iou > 0.0 {
                    edges.push((t, d, iou));
                }
            }
        }
        let near = |&&(_, _, iou): &&(usize, usize, f64)| iou > self.params.iou_min;
        let mut degree = (vec![0_u32; tracks.len()], vec![0_u32; found.len()]);
        for &(t, d, _) in edges.iter().filter(near) {
            degree.0[t] += 1;
            degree.1[d] += 1;
        }
        // As in the reference: without competing pairs all near ones are paired; else the assignment with the largest
        // sum is computed first and distant pairs are removed afterwards.
        if degree.0.iter().chain(&degree.1).all(|n| *n <= 1) {
            for &(t, d, _) in edges.iter().filter(near) {
                of[t] = Some(d);
            }
            if edges.iter().any(|e| near(&e)) {
                return of;
            }
        }
        for (t, d) in heaviest_pairs(tracks.len(), found.len(), &edges) {
            of[t] = Some(d).filter(|d| image_iou(tracks[t], found[*d].box_px) >= self.params.iou_min);
        }
        of
    }
}

impl ImageTracker for Sort {
    /// Returns the tracks with a box in this frame, newest first.
    fn update(&mut self, found: &[ImageDetection]) -> Vec<ImageTrack> {
        self.frames += 1;
        let found: Vec<&ImageDetection> = surest_usable(found).into_iter().map(|(_, found)| found).collect();
        self.tracks.iter_mut().for_each(Followed::predict);
        self.tracks.retain(|track| track.edges().iter().all(|x| x.is_finite()));
        let predicted: Vec<[f64; 4]> = self.tracks.iter().map(Followed::edges).collect();
        let pairs = self.pair(&predicted, &found);
        let mut is_taken = vec![false; found.len()];
        for (track, d) in self.tracks.iter_mut().zip(&pairs) {
            if let Some(d) = *d {
                track.update(found[d]);
                is_taken[d] = true;
            }
        }
        for (detection, _) in found.iter().zip(&is_taken).filter(|(_, is_taken)| !**is_taken) {
            self.given += 1;
            self.tracks.push(Followed::founded(self.given, detection));
        }
        let Params { age_max, hits_min, .. } = self.params;
        let is_early = self.frames <= hits_min;
        let is_told = |t: &&Followed| t.unseen == 0 && (t.streak >= hits_min || is_early);
        let told = self.tracks.iter().rev().filter(is_told);
        let told = told.map(|t| ImageTrack { id: t.id, box_px: t.edges(), score: t.score }).collect();
        self.tracks.retain(|track| track.unseen <= age_max);
        told
    }
}

/// Centre, area and aspect ratio of a rectangle.
fn shape(box_px: [f64; 4]) -> [f64; 4] {
    let [x, y, width, height] = centred(box_px);
    [x, y, width * height, width / height]
}

impl Followed {
    fn founded(id: u64, found: &ImageDetection) -> Self {
        let [x, y, area, aspect] = shape(found.box_px);
        let moving = |value| Axis::new(value, FIRST);
        let state = [moving(x), moving(y), moving(area), Axis::new(aspect, [FIRST[0], 0.0])];
        Self { id, score: found.score, state, unseen: 0, streak: 0 }
    }

    fn predict(&mut self) {
        let area = &mut self.state[2];
        if area.value + area.rate <= 0.0 {
            area.rate = 0.0;
        }
        for (axis, noise) in self.state.iter_mut().zip([0, 0, 1, 2]) {
            axis.predict(1.0, NOISE[noise]);
        }
        if self.unseen > 0 {
            self.streak = 0;
        }
        self.unseen += 1;
    }

    fn update(&mut self, found: &ImageDetection) {
        for ((axis, measured), noise) in self.state.iter_mut().zip(shape(found.box_px)).zip([0, 0, 1, 1]) {
            axis.update(measured, MEASURED[noise]);
        }
        (self.score, self.unseen) = (found.score, 0);
        self.streak += 1;
    }

    /// Left, top, right, bottom; not finite if area or aspect ratio have become negative.
    fn edges(&self) -> [f64; 4] {
        let [x, y, area, aspect] = self.state.map(|axis| axis.value);
        let width = (area * aspect).sqrt();
        edges([x, y, width, area / width])
    }
}
