//! Judgement whether drivers who must give way to the ego do so.

use std::collections::BTreeMap;

use swerve_core::Time;
use swerve_msg::ActorId;

use super::entry::needed_mps2;
use super::others::Vehicle;

/// Time of contrary behaviour after which the judgement of a driver changes, seconds. The mean acceleration shows braking
/// after half of it.
const CHANGES_S: f64 = 0.5;
/// Deceleration for which nobody has to brake yet, m/s².
const EARLY_MPS2: f64 = 2.0;
/// Largest needed deceleration of a driver who gives way, m/s², the share of it with which the driver brakes, and the time
/// before it has to brake from which this is observed, seconds: to be expected to give way, and to remain so.
const BEGINS: (f64, f64, f64) = (3.5, 0.5, 0.0);
const KEEPS: (f64, f64, f64) = (6.0, 0.35, CHANGES_S);
/// Distance into a zone at which a driver may come to rest, metres: bodies are shorter than those of zones.
const OVER_M: f64 = 0.4;
/// Time after which a driver out of view is forgotten, seconds.
const FORGETS_S: f64 = 1.0;

/// Judgement of a driver.
#[derive(Clone, Copy, Debug)]
struct Driver {
    yields: bool,
    /// Time of contrary behaviour, seconds.
    contrary_s: f64,
    at: Time,
}

/// Judgements of all drivers who must give way to the ego.
#[derive(Clone, Debug, Default)]
pub(super) struct Trust {
    drivers: BTreeMap<ActorId, Driver>,
}

impl Trust {
    /// Forgets drivers who have not been judged for some time.
    pub(super) fn forget(&mut self, now: Time) {
        self.drivers.retain(|_, driver| (now - driver.at).as_secs() < FORGETS_S);
    }

    /// True if a driver at a distance before its nearest zone, metres, is expected to give way. The judgement is made once
    /// a frame.
    pub(super) fn expects(&mut self, other: &Vehicle, in_m: f64, now: Time) -> bool {
        let known = self.drivers.get(&other.id).copied();
        let driver = match known {
            Some(known) if known.at == now => known,
            _ => judged(known, other, in_m, now),
        };
        self.drivers.insert(other.id, driver);
        driver.yields && in_m > 0.0
    }
}

/// Next judgement of a driver. It changes after some time of contrary behaviour, or at once if the driver cannot stop.
fn judged(before: Option<Driver>, other: &Vehicle, in_m: f64, now: Time) -> Driver {
    let needed_mps2 = needed_mps2(other.speed_mps, in_m + OVER_M);
    let is_expected = before.is_some_and(|before| before.yields);
    // The time that a change takes is over when the driver has to brake.
    let (most_mps2, share, ahead_s) = if is_expected { KEEPS } else { BEGINS };
    let is_early = self::needed_mps2(other.speed_mps, in_m - ahead_s * other.speed_mps) <= EARLY_MPS2;
    let brakes = -other.gain_mps2 > share * needed_mps2;
    let yields = needed_mps2 <= most_mps2 && (is_early || brakes);
    let contrary = before.filter(|before| before.yields != yields && needed_mps2 <= KEEPS.0);
    let contrary_s = contrary.map(|before| before.contrary_s + (now - before.at).as_secs());
    match contrary_s.filter(|contrary_s| *contrary_s < CHANGES_S) {
        Some(contrary_s) => Driver { yields: !yields, contrary_s, at: now },
        None => Driver { yields, contrary_s: 0.0, at: now },
    }
}
