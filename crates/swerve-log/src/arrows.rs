//! Provenance of step results: from which sensor frames they derive.

use std::collections::{BTreeMap, VecDeque};

use swerve_core::Time;

/// Number of remembered messages per stream; a reader of an older one gets no arrow.
const MESSAGES: usize = 256;
/// Number of sensor frames followed at once; older ones that have not reached a command are given up.
const CHAINS: usize = 1024;

/// Next point of an arrow.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) enum Arrow {
    /// Starts at a sensor's step.
    Start { chain: u64 },
    /// Passes through a step that reads data derived from the frame.
    Through { chain: u64 },
    /// Ends at a step of a command operator.
    End { chain: u64, sensor: String, stamp: Time },
}

impl Arrow {
    pub(crate) fn chain(&self) -> u64 {
        match *self {
            Self::Start { chain } | Self::Through { chain } | Self::End { chain, .. } => chain,
        }
    }
}

/// Follows sensor frames through the steps that read data derived from them.
pub(crate) struct Arrows {
    commands: Vec<String>,
    streams: BTreeMap<String, VecDeque<Known>>,
    /// Frames that have not reached a command yet; the first has the number `oldest`.
    chains: VecDeque<Option<Chain>>,
    oldest: u64,
}

/// A message with known provenance.
struct Known {
    stamp: Time,
    origin: Option<Time>,
    chains: Vec<u64>,
}

/// A sensor frame and the operators that it has reached.
struct Chain {
    sensor: String,
    stamp: Time,
    visited: Vec<String>,
}

impl Arrows {
    /// Creates the tracker; arrows end at the operators named in `commands`.
    pub(crate) fn new(commands: &[&str]) -> Self {
        Self {
            commands: commands.iter().map(|&name| name.into()).collect(),
            streams: BTreeMap::new(),
            chains: VecDeque::new(),
            oldest: 0,
        }
    }

    /// Registers the inputs of a step; returns the arrows that reach it.
    pub(crate) fn step<'a>(
        &mut self,
        operator: &str,
        reads: impl Iterator<Item = (&'a str, Option<Time>)>,
    ) -> Vec<Arrow> {
        let ends = self.commands.iter().any(|name| name == operator);
        let (chains, _) = self.behind(reads);
        chains.into_iter().filter_map(|chain| self.visit(chain, operator, ends)).collect()
    }

    /// Registers a published message; returns the start of an arrow if it is a sensor frame.
    pub(crate) fn message<'a>(
        &mut self,
        operator: &str,
        stream: &str,
        stamp: Time,
        origin: Option<Time>,
        reads: impl Iterator<Item = (&'a str, Option<Time>)>,
    ) -> Option<Arrow> {
        let (mut chains, newest) = self.behind(reads);
        // A message whose inputs are all older than its own origin was measured at this step.
        let measured = origin == Some(stamp) && newest < origin;
        let started = measured.then(|| {
            let chain = self.start(operator, stamp);
            chains = vec![chain];
            Arrow::Start { chain }
        });
        let known = self.streams.entry(stream.into()).or_default();
        known.push_back(Known { stamp, origin, chains });
        if known.len() > MESSAGES {
            known.pop_front();
        }
        started
    }

    /// Sensor frames behind the inputs, and the newest origin among them.
    fn behind<'a>(&self, reads: impl Iterator<Item = (&'a str, Option<Time>)>) -> (Vec<u64>, Option<Time>) {
        let (mut chains, mut newest) = (Vec::new(), None);
        for (stream, stamp) in reads {
            let known = self.streams.get(stream);
            // Stamps increase within a stream.
            let found = known.zip(stamp).and_then(|(known, stamp)| {
                known.binary_search_by_key(&stamp, |k| k.stamp).ok().map(|place| &known[place])
            });
            let Some(message) = found else { continue };
            newest = newest.max(message.origin);
            chains.extend(message.chains.iter().copied().filter(|&chain| self.is_open(chain)));
        }
        chains.sort_unstable();
        chains.dedup();
        (chains, newest)
    }

    fn start(&mut self, sensor: &str, stamp: Time) -> u64 {
        let chain = Chain { sensor: sensor.into(), stamp, visited: vec![sensor.into()] };
        self.chains.push_back(Some(chain));
        if self.chains.len() > CHAINS {
            self.chains.pop_front();
            self.oldest += 1;
        }
        self.oldest + self.chains.len() as u64 - 1
    }

    fn slot(&self, chain: u64) -> Option<usize> {
        chain.checked_sub(self.oldest).map(|place| place as usize)
    }

    fn is_open(&self, chain: u64) -> bool {
        self.slot(chain).is_some_and(|slot| self.chains[slot].is_some())
    }

    fn visit(&mut self, chain: u64, operator: &str, ends: bool) -> Option<Arrow> {
        let slot = self.slot(chain)?;
        if ends {
            let Chain { sensor, stamp, .. } = self.chains[slot].take()?;
            return Some(Arrow::End { chain, sensor, stamp });
        }
        let frame = self.chains[slot].as_mut()?;
        if frame.visited.iter().any(|name| name == operator) {
            return None;
        }
        frame.visited.push(operator.into());
        Some(Arrow::Through { chain })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(ms: i64) -> Time {
        Time::from_ms(ms)
    }

    #[test]
    fn arrows_follow_a_frame_to_its_first_command() {
        let mut arrows = Arrows::new(&["control"]);
        let none = || core::iter::empty();
        assert_eq!(arrows.message("pose", "pose", ms(100), None, none()), None);
        let start = arrows.message("camera", "image", ms(100), Some(ms(100)), none());
        assert_eq!(start, Some(Arrow::Start { chain: 0 }));
        let image = || [("image", Some(ms(100)))].into_iter();
        assert_eq!(arrows.step("detector", image()), [Arrow::Through { chain: 0 }]);
        assert_eq!(arrows.message("detector", "boxes", ms(100), Some(ms(100)), image()), None);
        let control = || [("pose", Some(ms(180))), ("boxes", Some(ms(100)))].into_iter();
        let end = Arrow::End { chain: 0, sensor: "camera".into(), stamp: ms(100) };
        assert_eq!(arrows.step("control", control()), [end]);
        assert_eq!(arrows.step("control", control()), [], "the first only");
        assert_eq!(arrows.step("detector", image()), [], "and nothing after it");
    }

    #[test]
    fn arrows_give_up_frames_that_never_reach_a_command() {
        let mut arrows = Arrows::new(&["control"]);
        for k in 0..5000 {
            arrows.message("camera", "image", ms(k), Some(ms(k)), core::iter::empty());
        }
        assert!(arrows.chains.len() == CHAINS && arrows.streams["image"].len() == MESSAGES);
        assert_eq!(arrows.step("control", [("image", Some(ms(0)))].into_iter()), []);
        assert_eq!(arrows.step("control", [("image", Some(ms(4999)))].into_iter()).len(), 1);
    }
}
