//! Aspects of traffic lights over time.

use std::sync::Arc;

use swerve_core::{Span, Time};
use swerve_map::{Aspect, Map, SignalId, SignalProgram};

/// Aspect of each traffic light at any instant. Later instants than the present one may be asked for.
#[derive(Clone)]
pub struct Lights(Arc<dyn Fn(SignalId, Time) -> Aspect + Send + Sync>);

impl Lights {
    /// Lights that are switched by a function.
    pub fn new(aspect: impl Fn(SignalId, Time) -> Aspect + Send + Sync + 'static) -> Self {
        Self(Arc::new(aspect))
    }

    /// Lights with the programs of the map; those without one are off.
    pub fn of_map(map: &Arc<Map>) -> Self {
        let map = Arc::clone(map);
        Self::new(move |id, at| {
            let program = map.signal(id).and_then(|signal| signal.program.as_ref());
            program.map_or(Aspect::Off, |program| aspect_at(program, at))
        })
    }

    /// Aspect of a light.
    pub fn aspect(&self, id: SignalId, at: Time) -> Aspect {
        (self.0)(id, at)
    }

    /// The most restrictive aspect of several lights at a stop line.
    pub(crate) fn strictest(&self, ids: &[SignalId], at: Time) -> Aspect {
        let order = |aspect: &Aspect| match aspect {
            Aspect::Off => 0,
            Aspect::Green => 1,
            Aspect::Yellow => 2,
            Aspect::RedYellow => 3,
            Aspect::Red => 4,
        };
        ids.iter().map(|id| self.aspect(*id, at)).max_by_key(order).unwrap_or(Aspect::Off)
    }
}

impl core::fmt::Debug for Lights {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("Lights")
    }
}

/// Each phase includes its first instant and excludes its end.
fn aspect_at(program: &SignalProgram, at: Time) -> Aspect {
    let length = |s: f64| Span::from_secs(s).ns();
    let cycle: i64 = program.phases.iter().map(|phase| length(phase.duration_s)).sum();
    let mut into = (at.ns() + length(program.offset_s)).rem_euclid(cycle.max(1));
    for phase in &program.phases {
        if into < length(phase.duration_s) {
            return phase.aspect;
        }
        into -= length(phase.duration_s);
    }
    Aspect::Red
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_repeat_with_their_offset() {
        let program = SignalProgram::green_yellow_red([10.0, 3.0, 7.0], 5.0);
        for (at_s, aspect) in [
            (0.0, Aspect::Green),
            (5.0, Aspect::Yellow),
            (8.0, Aspect::Red),
            (15.0, Aspect::Green),
            (35.0, Aspect::Green),
        ] {
            assert_eq!(aspect_at(&program, Time::ZERO + Span::from_secs(at_s)), aspect, "{at_s} s");
        }
    }
}
