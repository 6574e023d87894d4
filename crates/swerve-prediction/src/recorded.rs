//! Recorded tracks from files, and the windows on which predictors are evaluated.

mod made;
mod placed;
mod written;

use std::collections::BTreeMap;
use std::fmt::Display;
use std::sync::Arc;

use swerve_core::{Span, Time};
use swerve_geom::{Point2, Pose2, Vector2};
use swerve_map::Map;
use swerve_msg::{ActorId, ActorKind, Extent, Sighting, Track, TrackList};

pub use made::{made, made_finely};
pub use written::{StepError, commonroad_text};

/// Frames between two rows of a person in the files of ETH and UCY, and the assumed interval, seconds.
const ETH_UCY_FRAMES: i64 = 10;
const ETH_UCY_STEP_S: f64 = 0.4;
/// Interval between two rows of CommonRoad's recorded scenarios, seconds.
const COMMONROAD_STEP_S: f64 = 0.1;
const HEAD: &str = "scenario,id,type,length_m,width_m,step,x_m,y_m,heading_rad,speed_mps";
/// Shortest displacement that defines a heading, metres.
const HARDLY_M: f64 = 0.1;
/// Largest absolute frame number.
const FRAME_MAX: f64 = 1e9;
/// Largest coordinate, metres: UTM northings end at 10,000 km.
const PLACE_MAX_M: f64 = 1e7;

/// Error of reading a recording, with the line.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{line}: {what}")]
pub struct RecordedError {
    /// Line number, from 1.
    pub line: usize,
    /// Error, with the expected content.
    pub what: String,
}

/// A recorded actor.
#[derive(Clone, PartialEq, Debug)]
pub struct RecordedTrack {
    /// Identity within its recording.
    pub id: ActorId,
    /// Kind of actor.
    pub kind: ActorKind,
    /// Size.
    pub extent: Extent,
    /// Steps and positions, at increasing steps.
    pub samples: Vec<(i64, Point2)>,
}

/// Tracks of one scene, in the scene's map frame.
#[derive(Clone, PartialEq, Debug)]
pub struct Recording {
    /// Interval between two steps.
    pub step: Span,
    /// Tracks, ordered by identity.
    pub tracks: Vec<RecordedTrack>,
    /// Lane map of the scene, if known.
    pub lanes: Option<Arc<Map>>,
}

/// An actor that is observed throughout a window.
#[derive(Clone, PartialEq, Debug)]
pub struct Window {
    /// Identity.
    pub id: ActorId,
    /// Positions after the present, one for each step.
    pub truth: Vec<Point2>,
}

/// A present instant: all actors, and those that are observed for long enough to be evaluated.
#[derive(Clone, PartialEq, Debug)]
pub struct Scene {
    /// Tracks with their past up to the last gap, at most as long as the protocol observes.
    pub tracks: TrackList,
    /// Evaluated actors, ordered by identity.
    pub windows: Vec<Window>,
}

/// Evaluation protocol: lengths of past and future, and selection of actors.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Protocol {
    /// Number of sightings up to and including the present; at least 1.
    pub observe: usize,
    /// Number of predicted steps; at least 1.
    pub predict: usize,
    /// Number of sightings between the starts of a track's windows; at least 1.
    pub stride: usize,
    /// Smallest number of evaluated steps, for tracks that end before `predict` steps.
    pub predict_min: usize,
    /// Smallest number of evaluated actors at an instant; instants with fewer are skipped.
    pub actors_min: usize,
}

impl Protocol {
    /// Protocol for actors that are observed throughout, as in Trajectron++.
    pub fn whole(observe: usize, predict: usize) -> Self {
        Self { observe, predict, stride: 1, predict_min: predict, actors_min: 1 }
    }
}

fn wrong(line: usize, what: impl Display) -> RecordedError {
    RecordedError { line, what: what.to_string() }
}

/// Parses a finite number within `most` of zero.
fn number(line: usize, name: &str, word: &str, most: f64) -> Result<f64, RecordedError> {
    match word.trim().parse() {
        Ok(number) if f64::abs(number) <= most => Ok(number),
        _ => {
            Err(wrong(line, format!("{name}: expected a number of at most {most}, found `{}`", word.trim())))
        }
    }
}

/// Parses a whole number, which may be written as `780.0`.
fn whole(line: usize, name: &str, word: &str, most: f64) -> Result<i64, RecordedError> {
    let number = number(line, name, word, most)?;
    match number.fract() == 0.0 {
        true => Ok(number as i64),
        false => Err(wrong(line, format!("{name}: expected a whole number, found `{}`", word.trim()))),
    }
}

fn identity(line: usize, name: &str, word: &str) -> Result<ActorId, RecordedError> {
    let id = whole(line, name, word, f64::from(u32::MAX))?;
    u32::try_from(id)
        .map(ActorId)
        .map_err(|_| wrong(line, format!("{name}: expected no negative number, found `{id}`")))
}

/// Reads pedestrians from a text of ETH or UCY in the form distributed for prediction: `frame person x y`, separated
/// by blanks, in metres, 10 frames per 0.4 s (the recording `eth` actually has 0.667 s).
///
/// # Errors
/// The first invalid line, or a person that occurs twice at one instant.
pub fn eth_ucy(text: &str) -> Result<Recording, RecordedError> {
    let person = Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 };
    let mut tracks = Tracks::default();
    for (k, row) in text.lines().enumerate().filter(|(_, row)| !row.trim().is_empty()) {
        let (line, words) = (k + 1, row.split_whitespace().collect::<Vec<_>>());
        let [frame, id, x, y] = words[..] else {
            return Err(wrong(line, format!("expected `frame person x y`, found {} words", words.len())));
        };
        let frame = whole(line, "frame", frame, FRAME_MAX)?;
        if frame % ETH_UCY_FRAMES != 0 {
            return Err(wrong(
                line,
                format!("frame: expected a multiple of {ETH_UCY_FRAMES}, found `{frame}`"),
            ));
        }
        let place = Point2::new(number(line, "x", x, PLACE_MAX_M)?, number(line, "y", y, PLACE_MAX_M)?);
        let who = (identity(line, "person", id)?, ActorKind::Pedestrian, person);
        tracks.add(line, who, (frame / ETH_UCY_FRAMES, place))?;
    }
    Ok(tracks.into_recording(ETH_UCY_STEP_S))
}

/// Reads vehicles and pedestrians of CommonRoad's recorded scenarios from rows of
/// `scenario,id,type,length_m,width_m,step,x_m,y_m,heading_rad,speed_mps`, after a header with these names: one
/// recording per scenario, ordered by name.
///
/// # Errors
/// The first invalid line, or an actor that occurs twice at one instant.
pub fn commonroad_csv(text: &str) -> Result<BTreeMap<String, Recording>, RecordedError> {
    let mut rows = text.lines().enumerate();
    if rows.next().map(|(_, head)| head.trim()) != Some(HEAD) {
        return Err(wrong(1, format!("expected `{HEAD}`")));
    }
    let mut scenarios: BTreeMap<&str, Tracks> = BTreeMap::new();
    for (k, row) in rows.filter(|(_, row)| !row.trim().is_empty()) {
        let (line, words) = (k + 1, row.split(',').collect::<Vec<_>>());
        let [scenario, id, kind, length, width, step, x, y, ..] = words[..] else {
            return Err(wrong(line, format!("expected 10 columns, found {}", words.len())));
        };
        let side = |name, word| number(line, name, word, 100.0);
        let extent = Extent {
            length_m: side("length_m", length)?.abs(),
            width_m: side("width_m", width)?.abs(),
            height_m: 1.5,
        };
        let place = Point2::new(number(line, "x_m", x, PLACE_MAX_M)?, number(line, "y_m", y, PLACE_MAX_M)?);
        let who = (identity(line, "id", id)?, kind_of(line, kind)?, extent);
        let step = whole(line, "step", step, FRAME_MAX)?;
        scenarios.entry(scenario).or_default().add(line, who, (step, place))?;
    }
    let recording =
        |(name, tracks): (&str, Tracks)| (name.to_owned(), tracks.into_recording(COMMONROAD_STEP_S));
    Ok(scenarios.into_iter().map(recording).collect())
}

fn kind_of(line: usize, word: &str) -> Result<ActorKind, RecordedError> {
    Ok(match word.trim() {
        "car" | "taxi" | "priorityVehicle" => ActorKind::Car,
        "truck" | "bus" | "train" => ActorKind::Truck,
        "motorcycle" => ActorKind::Motorcycle,
        "bicycle" => ActorKind::Cyclist,
        "pedestrian" => ActorKind::Pedestrian,
        other => {
            let known = "car, taxi, priorityVehicle, truck, bus, train, motorcycle, bicycle, pedestrian";
            return Err(wrong(line, format!("type: expected one of {known}, found `{other}`")));
        }
    })
}

/// Accumulates rows to tracks.
#[derive(Default)]
struct Tracks(BTreeMap<ActorId, (ActorKind, Extent, BTreeMap<i64, Point2>)>);

impl Tracks {
    fn add(
        &mut self,
        line: usize,
        (id, kind, extent): (ActorId, ActorKind, Extent),
        (step, place): (i64, Point2),
    ) -> Result<(), RecordedError> {
        let (.., samples) = self.0.entry(id).or_insert_with(|| (kind, extent, BTreeMap::new()));
        match samples.insert(step, place) {
            None => Ok(()),
            Some(_) => Err(wrong(line, format!("{} is a second time at one instant", id.0))),
        }
    }

    fn into_recording(self, step_s: f64) -> Recording {
        let track = |(id, (kind, extent, samples)): (ActorId, (ActorKind, Extent, BTreeMap<i64, Point2>))| {
            RecordedTrack { id, kind, extent, samples: samples.into_iter().collect() }
        };
        let tracks = self.0.into_iter().map(track).collect();
        Recording { step: Span::from_secs(step_s), tracks, lanes: None }
    }
}

impl Recording {
    /// All instants with an evaluated actor, in order.
    pub fn scenes(&self, protocol: &Protocol) -> Vec<Scene> {
        let mut judged: BTreeMap<i64, Vec<Window>> = BTreeMap::new();
        for track in &self.tracks {
            for present in track.presents(protocol) {
                let after =
                    &track.samples[present + 1..track.samples.len().min(present + 1 + protocol.predict)];
                let truth =
                    after[..track.run(present, after.len())].iter().map(|(_, place)| *place).collect();
                judged.entry(track.samples[present].0).or_default().push(Window { id: track.id, truth });
            }
        }
        judged.retain(|_, windows| windows.len() >= protocol.actors_min);
        judged
            .into_iter()
            .map(|(step, windows)| Scene { tracks: self.tracks_at(step, protocol), windows })
            .collect()
    }

    /// Tracks of all actors at one step.
    fn tracks_at(&self, step: i64, protocol: &Protocol) -> TrackList {
        let tracks = self.tracks.iter().filter_map(|track| track.at(step, protocol.observe, self.step));
        TrackList { stamp: Time::ZERO + self.step * step, tracks: tracks.collect() }
    }
}

impl Recording {
    /// The recording at another speed, backwards if it is negative: `speed` steps become one, with positions
    /// interpolated between steps. Steps within a gap are dropped. `speed` must not be zero.
    pub fn played(&self, speed: f64) -> Self {
        let tracks =
            self.tracks.iter().map(|track| track.played(speed)).filter(|one| !one.samples.is_empty());
        // Lanes are directed, and actors that drive backwards violate that.
        Self { step: self.step, tracks: tracks.collect(), lanes: None }
    }
}

impl RecordedTrack {
    /// As [`Recording::played`].
    fn played(&self, speed: f64) -> Self {
        let ends = [self.samples.first(), self.samples.last()]
            .map(|end| end.map_or(0.0, |end| end.0 as f64 / speed));
        let steps = ends[0].min(ends[1]).ceil() as i64..=ends[0].max(ends[1]).floor() as i64;
        let sample = |step: i64| {
            let at = step as f64 * speed;
            let after = self.samples.partition_point(|(own, _)| (*own as f64) < at);
            let (own, place) = self.samples.get(after)?;
            if *own as f64 == at {
                return Some((step, *place));
            }
            let (before, from) = self.samples.get(after.checked_sub(1)?)?;
            (before + 1 == *own).then(|| (step, *from + (*place - *from) * (at - *before as f64)))
        };
        Self { samples: steps.filter_map(sample).collect(), ..self.clone() }
    }

    /// Number of consecutive samples after `from` without a gap, at most `most`.
    fn run(&self, from: usize, most: usize) -> usize {
        let follows = |k: &usize| self.samples[from + k].0 == self.samples[from].0 + *k as i64;
        (1..=most).take_while(follows).count()
    }

    /// Indices of the samples at which it is evaluated.
    fn presents(&self, protocol: &Protocol) -> impl Iterator<Item = usize> {
        let (observe, least) =
            (protocol.observe.max(1), protocol.observe.max(1) - 1 + protocol.predict_min.max(1));
        let firsts = (0..self.samples.len()).step_by(protocol.stride.max(1));
        firsts
            .filter(move |first| first + least < self.samples.len() && self.run(*first, least) == least)
            .map(move |first| first + observe - 1)
    }

    /// Track as a tracker would report it at `step`; `None` if the actor is absent.
    fn at(&self, step: i64, observe: usize, span: Span) -> Option<Track> {
        let present = self.samples.binary_search_by_key(&step, |(at, _)| *at).ok()?;
        let first = present.saturating_sub(observe.max(1) - 1);
        let from = (first..=present)
            .rev()
            .take_while(|k| self.samples[*k].0 == step - (present - k) as i64)
            .last()?;
        let sighting = |(at, point): &(i64, Point2)| Sighting { at: Time::ZERO + span * *at, point: *point };
        let history: Vec<Sighting> = self.samples[from..=present].iter().map(sighting).collect();
        let (last, before) = (history[history.len() - 1], history.iter().rev().nth(1));
        let velocity_mps =
            before.map_or(Vector2::default(), |before| (last.point - before.point) * (1.0 / span.as_secs()));
        // An actor at rest keeps the heading of its last motion.
        let mut moved = self.samples[..=present].iter().rev().map(|(_, place)| last.point - *place);
        let heading_rad = moved.find(|way| way.norm() > HARDLY_M).map_or(0.0, Vector2::heading);
        let pose = Pose2::new(last.point.x_m, last.point.y_m, heading_rad);
        Some(Track { id: self.id, kind: self.kind, pose, extent: self.extent, velocity_mps, history })
    }
}

#[cfg(test)]
mod tests;
