//! Elements of a map beside its lanes, and their consistency.

use core::fmt;

use serde::{Deserialize, Serialize};
use swerve_geom::Point2;

use crate::{
    Area, Crossing, Junction, Lane, LaneId, ProgramError, Signal, SignalId, SignalProgram, StopLine,
};

/// Elements of a map beside its lanes.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Features {
    /// Junctions, ordered by identity in a map.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub junctions: Vec<Junction>,
    /// Traffic signals, ordered by identity in a map.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub signals: Vec<Signal>,
    /// Stop lines, ordered by lane and arc length in a map.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stop_lines: Vec<StopLine>,
    /// Crossings, ordered by identity in a map.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub crossings: Vec<Crossing>,
    /// Areas, ordered by identity in a map.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub areas: Vec<Area>,
}

/// An element of a map, for messages.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Feature {
    /// Junction with this identity.
    Junction(u32),
    /// Signal with this identity.
    Signal(u32),
    /// A stop line of this lane.
    StopLine(u32),
    /// Crossing with this identity.
    Crossing(u32),
    /// Area with this identity.
    Area(u32),
}

impl fmt::Display for Feature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Junction(id) => write!(f, "junction {id}"),
            Self::Signal(id) => write!(f, "signal {id}"),
            Self::StopLine(lane) => write!(f, "stop line of lane {lane}"),
            Self::Crossing(id) => write!(f, "crossing {id}"),
            Self::Area(id) => write!(f, "area {id}"),
        }
    }
}

/// Error of an element beside the lanes.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
pub enum FeatureError {
    /// Two elements of a kind have the same identity.
    #[error("{0} is there twice")]
    Twice(Feature),
    /// An element refers to a missing lane.
    #[error("{feature} names lane {}, which is not there", .lane.0)]
    Lane {
        /// The element.
        feature: Feature,
        /// Identity that is missing.
        lane: LaneId,
    },
    /// A stop line refers to a missing signal.
    #[error("{feature} names signal {}, which is not there", .signal.0)]
    Signal {
        /// The stop line.
        feature: Feature,
        /// Identity that is missing.
        signal: SignalId,
    },
    /// A stop line is beyond the ends of its lane.
    #[error("{feature} is at {s_m} m, expected 0 to {length_m} m")]
    Place {
        /// The stop line.
        feature: Feature,
        /// Its arc length, metres.
        s_m: f64,
        /// Length of the lane, metres.
        length_m: f64,
    },
    /// A right of way of a junction is for a lane that is neither inside nor incoming.
    #[error("{feature} gives a right of way for lane {}, which is neither inside nor incoming", .lane.0)]
    Outside {
        /// The junction.
        feature: Feature,
        /// The lane.
        lane: LaneId,
    },
    /// Coordinates are NaN or infinite.
    #[error("{0} has coordinates that are not finite")]
    NotFinite(Feature),
    /// The phases of a signal are inconsistent.
    #[error("{feature}: {error}")]
    Program {
        /// The signal.
        feature: Feature,
        /// Problem of its phases.
        error: ProgramError,
    },
    /// An outline has too few corners.
    #[error("{feature} has {corners} corners, expected at least 3")]
    Corners {
        /// The element.
        feature: Feature,
        /// Number of corners.
        corners: usize,
    },
}

impl Features {
    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        let Self { junctions, signals, stop_lines, crossings, areas } = self;
        junctions.is_empty()
            && signals.is_empty()
            && stop_lines.is_empty()
            && crossings.is_empty()
            && areas.is_empty()
    }

    /// Sorts all elements, and the identities that they refer to, which are kept once.
    pub(crate) fn sort(&mut self) {
        let Self { junctions, signals, stop_lines, crossings, areas } = self;
        for junction in &mut *junctions {
            once(&mut junction.lanes);
            once(&mut junction.incoming);
            once(&mut junction.rights_of_way);
        }
        signals.iter_mut().for_each(|signal| once(&mut signal.lanes));
        stop_lines.iter_mut().for_each(|line| once(&mut line.signals));
        crossings.iter_mut().for_each(|crossing| once(&mut crossing.lanes));
        junctions.sort_by_key(|junction| junction.id);
        signals.sort_by_key(|signal| signal.id);
        stop_lines.sort_by(|a, b| {
            let place = a.lane.cmp(&b.lane).then(a.s_m.total_cmp(&b.s_m));
            place.then_with(|| (&a.signals, a.sign).cmp(&(&b.signals, b.sign)))
        });
        crossings.sort_by_key(|crossing| crossing.id);
        areas.sort_by_key(|area| area.id);
    }

    /// Checks sorted elements; `lanes` are ordered by identity.
    pub(crate) fn check(&self, lanes: &[Lane]) -> Result<(), FeatureError> {
        self.check_identities()?;
        for junction in &self.junctions {
            check_junction(junction, lanes)?;
        }
        for signal in &self.signals {
            let feature = Feature::Signal(signal.id.0);
            lanes_exist(feature, &signal.lanes, lanes)?;
            let numbers = [
                signal.position.x_m,
                signal.position.y_m,
                signal.heading_rad,
                signal.height_m.unwrap_or(0.0),
            ];
            if !numbers.iter().all(|number| number.is_finite()) {
                return Err(FeatureError::NotFinite(feature));
            }
            let program = signal.program.as_ref().map_or(Ok(()), SignalProgram::check);
            program.map_err(|error| FeatureError::Program { feature, error })?;
        }
        self.stop_lines.iter().try_for_each(|line| self.check_stop_line(line, lanes))?;
        for crossing in &self.crossings {
            let feature = Feature::Crossing(crossing.id.0);
            lanes_exist(feature, &crossing.lanes, lanes)?;
            check_outline(feature, &crossing.outline)?;
        }
        self.areas.iter().try_for_each(|area| check_outline(Feature::Area(area.id.0), &area.outline))
    }

    fn check_identities(&self) -> Result<(), FeatureError> {
        let Self { junctions, signals, crossings, areas, .. } = self;
        let twice = first_twice(junctions, |one| one.id.0)
            .map(Feature::Junction)
            .or_else(|| first_twice(signals, |one| one.id.0).map(Feature::Signal))
            .or_else(|| first_twice(crossings, |one| one.id.0).map(Feature::Crossing))
            .or_else(|| first_twice(areas, |one| one.id.0).map(Feature::Area));
        twice.map_or(Ok(()), |feature| Err(FeatureError::Twice(feature)))
    }

    fn check_stop_line(&self, line: &StopLine, lanes: &[Lane]) -> Result<(), FeatureError> {
        let feature = Feature::StopLine(line.lane.0);
        let lane = find(lanes, line.lane).ok_or(FeatureError::Lane { feature, lane: line.lane })?;
        let length_m = lane.line.length();
        if !(0.0..=length_m).contains(&line.s_m) {
            return Err(FeatureError::Place { feature, s_m: line.s_m, length_m });
        }
        let is_missing = |id: &&SignalId| self.signals.binary_search_by_key(*id, |signal| signal.id).is_err();
        match line.signals.iter().find(is_missing) {
            Some(&signal) => Err(FeatureError::Signal { feature, signal }),
            None => Ok(()),
        }
    }
}

/// Sorts, and removes duplicates.
fn once<T: Ord>(all: &mut Vec<T>) {
    all.sort_unstable();
    all.dedup();
}

/// First identity that two neighbours of a sorted list have.
fn first_twice<T>(sorted: &[T], id: impl Fn(&T) -> u32) -> Option<u32> {
    sorted.windows(2).find(|two| id(&two[0]) == id(&two[1])).map(|two| id(&two[0]))
}

fn find(lanes: &[Lane], id: LaneId) -> Option<&Lane> {
    lanes.binary_search_by_key(&id, |lane| lane.id).ok().map(|index| &lanes[index])
}

fn lanes_exist(feature: Feature, named: &[LaneId], lanes: &[Lane]) -> Result<(), FeatureError> {
    match named.iter().find(|id| find(lanes, **id).is_none()) {
        Some(&lane) => Err(FeatureError::Lane { feature, lane }),
        None => Ok(()),
    }
}

fn check_junction(junction: &Junction, lanes: &[Lane]) -> Result<(), FeatureError> {
    let feature = Feature::Junction(junction.id.0);
    lanes_exist(feature, &junction.lanes, lanes)?;
    lanes_exist(feature, &junction.incoming, lanes)?;
    let is_outside = |id: &LaneId| {
        junction.lanes.binary_search(id).is_err() && junction.incoming.binary_search(id).is_err()
    };
    let mut named = junction.rights_of_way.iter().flat_map(|right| [right.lane, right.to]);
    named.find(is_outside).map_or(Ok(()), |lane| Err(FeatureError::Outside { feature, lane }))
}

fn check_outline(feature: Feature, outline: &[Point2]) -> Result<(), FeatureError> {
    if outline.len() < 3 {
        return Err(FeatureError::Corners { feature, corners: outline.len() });
    }
    if outline.iter().all(|corner| corner.x_m.is_finite() && corner.y_m.is_finite()) {
        return Ok(());
    }
    Err(FeatureError::NotFinite(feature))
}

#[cfg(test)]
mod tests;
