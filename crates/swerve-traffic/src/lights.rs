//! Aspects of traffic lights over time.

use std::sync::Arc;

use swerve_core::Time;
use swerve_map::{Aspect, Map, SignalId};

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
            program.map_or(Aspect::Off, |program| program.aspect_at(at.ns()))
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
