//! A filter that accepts measurements in any order: a late one is inserted at its stamp, and those after it are
//! filtered again.
//!
//! ```text
//! measurements by stamp   |base|--a--b--c--(late)--d--e
//! states after them             1  2  3            5' 6'   re-filtered from the late one on
//! ```
//!
//! The state after a measurement depends only on measurements of earlier stamps, and on those of equal stamps in an
//! order given by their contents. Any order of arrival within `horizon_s` therefore gives the same bits.

mod bridge;
mod estimate;
mod fold;
mod repeats;
mod start;
mod trust;
mod unit;
mod window;

use std::collections::VecDeque;

use swerve_core::{ParamError, Span, Time};

use crate::params::Params;
use estimate::Entry;
pub use estimate::{Estimate, Initial, Mode, Sensed, Source, Taken, Tally};
use fold::Fold;
pub use unit::UnitHealth;

/// Largest number of stored measurements: one second of all sensors at their highest rates.
const KEPT: usize = 2048;

/// The filter with a history of measurements that can be filtered again.
#[derive(Clone, Debug)]
pub struct Localizer {
    params: Params,
    /// State before the first of `entries`.
    base: Fold,
    /// Stamp of the newest measurement in `base`.
    base_stamp: Option<Time>,
    entries: VecDeque<Entry>,
    /// State after each of `entries`.
    states: VecDeque<Fold>,
    too_late: u64,
    nonsense: u64,
}

impl Localizer {
    /// Creates a localizer that waits for its first fix. `heading` is a known initial heading and its standard
    /// deviation, radians, such as that of the lane for a parked car. Without it the localizer initialises from the
    /// course while moving.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(params: Params, heading: Option<[f64; 2]>) -> Result<Self, ParamError> {
        params.validate()?;
        Ok(Self::with(params, Fold::waiting(heading)))
    }

    /// Creates a localizer that continues from a known state at `stamp`.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn starting_at(params: Params, stamp: Time, initial: &Initial) -> Result<Self, ParamError> {
        params.validate()?;
        let fold = Fold::started(&params, stamp, initial);
        Ok(Self { base_stamp: Some(stamp), ..Self::with(params, fold) })
    }

    /// Sets the heading and its standard deviation, radians, before initialisation, for lanes that are known only
    /// with the first fix. Has no effect after a fix has been accepted.
    pub fn suppose_heading(&mut self, heading: [f64; 2]) {
        self.base.suppose_heading(heading);
        self.states.iter_mut().for_each(|state| state.suppose_heading(heading));
    }

    fn with(params: Params, base: Fold) -> Self {
        let (entries, states) = (VecDeque::with_capacity(KEPT + 1), VecDeque::with_capacity(KEPT + 1));
        Self { params, base, base_stamp: None, entries, states, too_late: 0, nonsense: 0 }
    }

    /// Processes a measurement, in any order of stamps.
    pub fn take(&mut self, stamp: Time, what: Sensed) -> Taken {
        if !what.is_sound() {
            self.nonsense += 1;
            return Taken::Nonsense;
        }
        let entry = Entry { stamp, what };
        if self.is_too_late(stamp) {
            self.too_late += 1;
            return Taken::TooLate;
        }
        let key = entry.key();
        let behind = self.entries.iter().rev().take_while(|other| other.key() > key).count();
        let place = self.entries.len() - behind;
        self.entries.insert(place, entry);
        self.states.truncate(place);
        for entry in self.entries.iter().skip(place) {
            let mut state = self.states.back().unwrap_or(&self.base).clone();
            state.take(&self.params, entry);
            self.states.push_back(state);
        }
        self.forget();
        if behind == 0 { Taken::InOrder } else { Taken::Late }
    }

    /// Returns true if a stamp is before the stored history. Based on the newest stamp, so that the order of arrival
    /// has no effect.
    fn is_too_late(&self, stamp: Time) -> bool {
        let newest = self.entries.back().map(|entry| entry.stamp).or(self.base_stamp);
        let by_horizon = newest.is_some_and(|newest| newest - stamp > Span::from_secs(self.params.horizon_s));
        by_horizon || self.base_stamp.is_some_and(|base| stamp < base)
    }

    /// Moves measurements beyond the horizon into the base state.
    fn forget(&mut self) {
        let Some(newest) = self.entries.back().map(|entry| entry.stamp) else { return };
        let horizon = Span::from_secs(self.params.horizon_s);
        while self.entries.front().is_some_and(|first| newest - first.stamp > horizon)
            || self.entries.len() > KEPT
        {
            let (Some(entry), Some(state)) = (self.entries.pop_front(), self.states.pop_front()) else {
                return;
            };
            self.base = state;
            self.base_stamp = Some(entry.stamp);
        }
    }

    /// Latest estimate; `None` before initialisation.
    pub fn estimate(&self) -> Option<Estimate> {
        self.newest().estimate(&self.params)
    }

    /// Latest estimate propagated to a later instant without measurements.
    pub fn estimate_at(&self, at: Time) -> Option<Estimate> {
        let mut fold = self.newest().clone();
        fold.filter()?;
        fold.advance(&self.params, at, None);
        fold.estimate(&self.params)
    }

    /// Condition of the inertial unit after the newest measurement.
    pub fn unit_health(&self) -> UnitHealth {
        let at = self.entries.back().map(|entry| entry.stamp).or(self.base_stamp);
        self.newest().unit.health(&self.params, at.unwrap_or(Time::ZERO))
    }

    /// Quality of the latest estimate.
    pub fn mode(&self) -> Mode {
        self.estimate().map_or(Mode::Lost, |estimate| estimate.mode)
    }

    /// The filter; `None` before initialisation.
    pub fn filter(&self) -> Option<&crate::Eskf> {
        self.newest().filter()
    }

    /// Innovation statistics of a source.
    pub fn tally(&self, source: Source) -> Tally {
        self.newest().tally(source)
    }

    /// Number of dropped measurements: too late, and invalid.
    pub fn dropped(&self) -> [u64; 2] {
        [self.too_late, self.nonsense]
    }

    fn newest(&self) -> &Fold {
        self.states.back().unwrap_or(&self.base)
    }
}

#[cfg(test)]
mod tests;
