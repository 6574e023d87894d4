//! Acceleration of a vehicle: the smallest of those for the vehicles ahead, the places to stop at and a free road.

use swerve_road_user::idm::Idm;

use crate::car::Car;
use crate::junction::Junctions;

/// Deceleration that drivers count on, of others and of themselves, m/s².
const BRAKE_MAX_MPS2: f64 = 8.0;
/// Deceleration in an emergency, on a dry road, m/s². No vehicle brakes harder: who is cut off hits the other.
const EMERGENCY_MPS2: f64 = 9.0;
/// Gap that is kept in any case, metres.
const GAP_MIN_M: f64 = 0.5;
/// Gap at standstill before a place to stop at, metres.
const WALL_GAP_M: f64 = 0.2;

/// Things that a driver regards.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ahead {
    /// Gaps to vehicles, metres, and their speeds, m/s.
    pub(crate) leads: Vec<(f64, f64)>,
    /// Distances to places to stop at, metres.
    pub(crate) walls_m: Vec<f64>,
}

/// Acceleration of a driver, m/s².
pub(crate) fn gain_mps2(car: &Car, desired_mps: f64, ahead: &Ahead, dt_s: f64) -> f64 {
    let v = car.speed_mps;
    let mut gain_mps2 = car.idm.acceleration_mps2(v, desired_mps, None).max(-3.0);
    for lead in &ahead.leads {
        gain_mps2 = gain_mps2.min(car.idm.acceleration_mps2(v, desired_mps, Some(*lead)));
    }
    let stops = Idm { headway_s: 0.0, stand_gap_m: WALL_GAP_M, ..car.idm };
    for &wall_m in &ahead.walls_m {
        gain_mps2 = gain_mps2.min(stops.acceleration_mps2(v, desired_mps, Some((wall_m, 0.0))));
    }
    gain_mps2 = gain_mps2.max(-BRAKE_MAX_MPS2);
    for &(gap_m, lead_mps) in &ahead.leads {
        gain_mps2 = gain_mps2.min((safe_mps(gap_m - GAP_MIN_M, lead_mps, dt_s) - v) / dt_s);
    }
    for &wall_m in &ahead.walls_m {
        gain_mps2 = gain_mps2.min((safe_mps(wall_m, 0.0, dt_s) - v) / dt_s);
    }
    // Rest is rest: an acceleration of almost nothing would creep.
    if v < 0.05 && gain_mps2 < 0.05 { -v / dt_s } else { gain_mps2.max(-v / dt_s).max(-EMERGENCY_MPS2) }
}

/// Largest speed after a tick from which a vehicle stops behind another that brakes as hard as it can (Gipps 1981).
fn safe_mps(gap_m: f64, lead_mps: f64, dt_s: f64) -> f64 {
    let b = BRAKE_MAX_MPS2 * dt_s;
    let square = b * b + 2.0 * BRAKE_MAX_MPS2 * gap_m.max(0.0) + lead_mps * lead_mps;
    if gap_m <= 0.0 { 0.0 } else { (square.sqrt() - b).max(0.0) }
}

impl Junctions<'_> {
    /// Acceleration of a driver, m/s², and whether a red light holds it, itself or by the vehicles ahead.
    pub(crate) fn decide(
        &self,
        cars: &[Car],
        who: usize,
        red_m: Option<f64>,
        walls_m: &[f64],
    ) -> (f64, bool) {
        let car = &cars[who];
        let mut ahead = Ahead::default();
        let leads = self.scene.leads(self.net, car, who);
        ahead.leads.extend(leads.iter().map(|lead| (lead.gap_m, lead.speed_mps)));
        ahead.leads.extend(self.merge_leads(cars, who));
        ahead.walls_m.extend(red_m.map(|red_m| red_m - car.x_m));
        ahead.walls_m.extend(self.wait_m(cars, who).map(|wait_m| wait_m - car.x_m));
        ahead.walls_m.extend(walls_m.iter().map(|wall_m| wall_m - car.x_m));
        let v = car.speed_mps;
        if let Some(block) = car.next_block() {
            let to_m = block.stop_m - car.x_m;
            // Farther away, the block may still become free in time.
            if to_m < v * v / (2.0 * car.idm.brake_mps2) + v + 6.0 {
                ahead.walls_m.push(to_m);
            }
        }
        ahead.walls_m.extend(car.end(self.net).map(|end| end.wall_m() - car.half_m() - car.x_m));
        let desired_mps = car.desired_mps(self.net, self.params.brake_mps2);
        let gain_mps2 = gain_mps2(car, desired_mps, &ahead, self.dt_s);
        let near_red = red_m.is_some_and(|red_m| red_m - car.x_m < 30.0);
        let lead = leads.iter().min_by(|a, b| a.gap_m.total_cmp(&b.gap_m));
        let behind_red = lead
            .is_some_and(|lead| lead.gap_m < 10.0 && cars.get(lead.who).is_some_and(|ahead| ahead.at_red));
        (gain_mps2, near_red || behind_red)
    }
}

#[cfg(test)]
mod tests {
    use super::safe_mps;

    #[test]
    fn safe_speed_stops_behind_the_lead() {
        for (gap_m, lead_mps) in [(1.0, 0.0), (20.0, 0.0), (5.0, 10.0), (0.2, 3.0)] {
            let (dt_s, brake_mps2) = (0.1, 8.0);
            let v = safe_mps(gap_m, lead_mps, dt_s);
            let own_m = v * dt_s + v * v / (2.0 * brake_mps2);
            let lead_m = lead_mps * lead_mps / (2.0 * brake_mps2);
            assert!((own_m - lead_m - gap_m).abs() < 1e-9, "{gap_m} {lead_mps}: {own_m}");
        }
        assert_eq!(safe_mps(-1.0, 9.0, 0.1), 0.0);
    }
}
