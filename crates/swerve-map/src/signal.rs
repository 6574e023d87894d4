//! Traffic signals.

use serde::{Deserialize, Serialize};
use swerve_geom::Point2;

use crate::LaneId;

/// Identity of a traffic signal in its map.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct SignalId(pub u32);

/// A traffic light.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Signal {
    /// Identity in the map.
    pub id: SignalId,
    /// Identity in the file that the map is from; may be empty.
    #[serde(default)]
    pub name: String,
    /// Position in the ground plane.
    pub position: Point2,
    /// Direction in which it shines, radians from x towards y: against the traffic that it is for.
    pub heading_rad: f64,
    /// Height over the ground, metres; `None` if unknown.
    #[serde(default)]
    pub height_m: Option<f64>,
    /// Lanes whose traffic obeys it, ordered by identity.
    #[serde(default)]
    pub lanes: Vec<LaneId>,
    /// Name of the controller that switches it together with others; `None` if unknown.
    #[serde(default)]
    pub controller: Option<String>,
    /// Its phases; `None` if they are unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub program: Option<SignalProgram>,
}

/// Aspect of a traffic light.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Aspect {
    /// Green.
    Green,
    /// Yellow.
    Yellow,
    /// Red.
    Red,
    /// Red and yellow, before green: traffic stops as at red.
    RedYellow,
    /// Dark or flashing: the light does not apply.
    Off,
}

/// Phase of a traffic light.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct SignalPhase {
    /// Its aspect.
    pub aspect: Aspect,
    /// Duration, seconds.
    pub duration_s: f64,
}

/// Program of a traffic light: phases that repeat.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct SignalProgram {
    /// Phases in order.
    pub phases: Vec<SignalPhase>,
    /// Time into the first phase at the start, seconds; of any sign, and may exceed the cycle.
    #[serde(default)]
    pub offset_s: f64,
}

/// Error of the phases of a traffic light.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
pub enum ProgramError {
    /// A phase is negative, NaN or too short.
    #[error("expected phases of 0 s, or of at least {PHASE_MIN_S} s, found {0} s")]
    Duration(f64),
    /// The cycle has no duration, or is too long.
    #[error("expected a cycle of more than 0 s and at most {CYCLE_MAX_S:e} s, found {0} s")]
    Cycle(f64),
    /// The offset is too large or NaN.
    #[error("expected an offset of at most {CYCLE_MAX_S:e} s, found {0} s")]
    Offset(f64),
}

/// Longest cycle and largest offset, seconds: a third of the nanoseconds that 64 bits count.
const CYCLE_MAX_S: f64 = 3e9;

/// Shortest phase that is not left out, seconds.
const PHASE_MIN_S: f64 = 1e-3;

impl SignalProgram {
    /// Program of green, yellow and red with these durations, seconds.
    pub fn green_yellow_red(durations_s: [f64; 3], offset_s: f64) -> Self {
        let aspects = [Aspect::Green, Aspect::Yellow, Aspect::Red];
        let phases = aspects.into_iter().zip(durations_s);
        let phases = phases.map(|(aspect, duration_s)| SignalPhase { aspect, duration_s });
        Self { phases: phases.collect(), offset_s }
    }

    /// Adds a phase at the end; one of the same aspect as the last extends it.
    pub fn push(&mut self, aspect: Aspect, duration_s: f64) {
        match self.phases.last_mut().filter(|last| last.aspect == aspect) {
            Some(last) => last.duration_s += duration_s,
            None => self.phases.push(SignalPhase { aspect, duration_s }),
        }
    }

    /// Duration of all phases, seconds.
    pub fn cycle_s(&self) -> f64 {
        self.phases.iter().fold(0.0, |sum_s, phase| sum_s + phase.duration_s)
    }

    /// Index of the phase at an instant, the time into it, and the time to its end, all in nanoseconds; `None` without
    /// phases. Each phase includes its first instant and excludes its end.
    pub fn phase_at(&self, at_ns: i64) -> Option<(usize, i64, i64)> {
        let ns = |s: f64| (s * 1e9).round() as i64;
        let cycle: i64 = self.phases.iter().map(|phase| ns(phase.duration_s)).sum();
        let mut into = (at_ns + ns(self.offset_s)).rem_euclid(cycle.max(1));
        for (k, phase) in self.phases.iter().enumerate() {
            let length = ns(phase.duration_s);
            if into < length {
                return Some((k, into, length - into));
            }
            into -= length;
        }
        None
    }

    /// Aspect at an instant in nanoseconds. A light with phases without durations stays red.
    pub fn aspect_at(&self, at_ns: i64) -> Aspect {
        self.phase_at(at_ns).map_or(Aspect::Red, |(k, ..)| self.phases[k].aspect)
    }

    /// Checks the durations and the offset.
    ///
    /// # Errors
    /// The first duration that is wrong, a cycle that is empty or too long, an offset that is too large.
    pub fn check(&self) -> Result<(), ProgramError> {
        let mut durations_s = self.phases.iter().map(|phase| phase.duration_s);
        if let Some(wrong_s) = durations_s.find(|s| !(*s == 0.0 || *s >= PHASE_MIN_S)) {
            return Err(ProgramError::Duration(wrong_s));
        }
        let cycle_s = self.cycle_s();
        if cycle_s == 0.0 || cycle_s > CYCLE_MAX_S {
            return Err(ProgramError::Cycle(cycle_s));
        }
        if self.offset_s.abs() <= CYCLE_MAX_S { Ok(()) } else { Err(ProgramError::Offset(self.offset_s)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_repeat_with_their_offset() {
        let program = SignalProgram::green_yellow_red([10.0, 3.0, 7.0], 5.0);
        for (at_s, aspect) in [
            (0, Aspect::Green),
            (5, Aspect::Yellow),
            (8, Aspect::Red),
            (15, Aspect::Green),
            (35, Aspect::Green),
        ] {
            assert_eq!(program.aspect_at(at_s * 1_000_000_000), aspect, "{at_s} s");
        }
        assert_eq!(program.phase_at(6_000_000_000), Some((1, 1_000_000_000, 2_000_000_000)));
        assert_eq!(SignalProgram::default().aspect_at(0), Aspect::Red);
    }

    #[test]
    fn program_refuses_durations_that_are_no_cycle() {
        let check = |durations_s: [f64; 3], offset_s: f64| {
            let found = SignalProgram::green_yellow_red(durations_s, offset_s).check();
            found.map_err(|error| error.to_string()).err().unwrap_or_default()
        };
        assert_eq!(check([10.0, 0.0, 20.0], -45.0), "");
        for (duration_s, found) in [(-1.0, "-1"), (1e-9, "0.000000001"), (f64::NAN, "NaN")] {
            let message = format!("expected phases of 0 s, or of at least 0.001 s, found {found} s");
            assert_eq!(check([10.0, duration_s, 20.0], 0.0), message);
        }
        let cycle = "expected a cycle of more than 0 s and at most 3e9 s, found ";
        assert_eq!(check([0.0; 3], 0.0), format!("{cycle}0 s"));
        assert_eq!(check([f64::INFINITY, 3.0, 20.0], 0.0), format!("{cycle}inf s"));
        assert_eq!(SignalProgram::default().check().unwrap_err().to_string(), format!("{cycle}0 s"));
        assert_eq!(check([1.0; 3], f64::NAN), "expected an offset of at most 3e9 s, found NaN s");
    }

    #[test]
    fn equal_phases_in_a_row_are_one() {
        let mut program = SignalProgram::default();
        for (aspect, duration_s) in [(Aspect::Red, 4.0), (Aspect::Red, 2.5), (Aspect::Green, 5.0)] {
            program.push(aspect, duration_s);
        }
        let phases: Vec<_> = program.phases.iter().map(|phase| (phase.aspect, phase.duration_s)).collect();
        assert_eq!((phases, program.cycle_s()), (vec![(Aspect::Red, 6.5), (Aspect::Green, 5.0)], 11.5));
    }
}
