//! Numbers of road users and the parameters of their behaviour.

use swerve_core::Span;
use swerve_map::LaneId;
use swerve_road_user::idm::{Idm, STAND_GAP_M};
use swerve_road_user::mobil::Mobil;

/// Traffic to create.
#[derive(Clone, PartialEq, Debug)]
pub struct TrafficSetup {
    /// Number of cars.
    pub vehicles: usize,
    /// Number of pedestrians.
    pub pedestrians: usize,
    /// Number of cyclists.
    pub cyclists: usize,
    /// Identity of the first actor. Cars come first, then pedestrians, then cyclists.
    pub first_id: u32,
    /// Interval of decisions, 50 ms to 100 ms.
    pub tick: Span,
    /// Smallest distance of a new actor from reserved boxes and from the ego, metres.
    pub reserve_m: f64,
    /// Places that are closed to vehicles: lanes, and arc lengths along them in metres.
    pub closed: Vec<(LaneId, f64)>,
    /// Behaviour of drivers.
    pub drivers: DriverParams,
}

impl Default for TrafficSetup {
    fn default() -> Self {
        Self {
            vehicles: 0,
            pedestrians: 0,
            cyclists: 0,
            first_id: 1,
            tick: Span::from_ms(100),
            reserve_m: 20.0,
            closed: Vec::new(),
            drivers: DriverParams::default(),
        }
    }
}

/// Behaviour of drivers. Each driver draws its values from the ranges.
///
/// The defaults are near those for city traffic in Treiber and Kesting, "Traffic Flow Dynamics" (2013), chapters 11 (car
/// following) and 14 (lane changes).
#[derive(Clone, PartialEq, Debug)]
pub struct DriverParams {
    /// Desired speed as a ratio to the speed limit, lowest and highest.
    pub speed_shares: [f64; 2],
    /// Desired time gap, lowest and highest, seconds.
    pub headways_s: [f64; 2],
    /// Largest acceleration, lowest and highest, m/s².
    pub gains_mps2: [f64; 2],
    /// Comfortable deceleration, m/s².
    pub brake_mps2: f64,
    /// Gap at standstill, metres.
    pub stand_gap_m: f64,
    /// Largest lateral acceleration in bends, m/s².
    pub lateral_mps2: f64,
    /// Speed limit of lanes without one, m/s.
    pub default_limit_mps: f64,
    /// Lane changes.
    pub mobil: Mobil,
    /// Time between the passage of a junction and the arrival of a car with priority, seconds. With the time to pass, a
    /// car at rest needs a gap of 4 s to 6 s.
    pub margin_s: f64,
    /// Waiting time at a junction after which a driver also takes gaps that make others brake comfortably, seconds.
    pub patience_s: f64,
}

impl Default for DriverParams {
    fn default() -> Self {
        Self {
            speed_shares: [0.9, 1.1],
            headways_s: [1.0, 1.4],
            gains_mps2: [1.0, 1.6],
            brake_mps2: 2.0,
            stand_gap_m: STAND_GAP_M,
            lateral_mps2: 2.5,
            default_limit_mps: 50.0 / 3.6,
            mobil: Mobil { politeness: 0.2, threshold_mps2: 0.2, safe_mps2: 2.0 },
            margin_s: 1.0,
            patience_s: 45.0,
        }
    }
}

impl DriverParams {
    /// Identical drivers, for comparisons with other programs.
    pub fn uniform(idm: Idm) -> Self {
        Self {
            speed_shares: [1.0; 2],
            headways_s: [idm.headway_s; 2],
            gains_mps2: [idm.gain_mps2; 2],
            brake_mps2: idm.brake_mps2,
            stand_gap_m: idm.stand_gap_m,
            ..Self::default()
        }
    }
}
