//! Variation of an actor by the seed, `vary` in its table.

use swerve_core::Rng;
use swerve_text::{Range, TableReader};

use crate::{Actor, Motion};

/// Half ranges of the changes that the seed makes to an actor; each change is uniform in plus or minus its half range.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Vary {
    /// Shift of its start and of the points of its paths along its line, metres.
    pub s_m: f64,
    /// Shift of its start and of the points of its paths across its line, metres.
    pub d_m: f64,
    /// Turn of its start heading and of the directions in which it walks, radians.
    pub heading_rad: f64,
    /// Change of all speeds of its motion, as a share of each.
    pub speed_share: f64,
}

impl Vary {
    pub(crate) fn read(actor: &TableReader<'_>) -> Self {
        let Some(table) = actor.table_if_any("vary") else { return Self::default() };
        let [shift, turn] = [Range::between(0.0, 100.0), Range::between(0.0, core::f64::consts::PI)];
        let vary = Self {
            s_m: table.number_or("s_m", 0.0, shift),
            d_m: table.number_or("d_m", 0.0, shift),
            heading_rad: table.number_or("heading_rad", 0.0, turn),
            speed_share: table.number_or("speed_share", 0.0, Range::between(0.0, 0.9)),
        };
        table.finish();
        vary
    }
}

impl Actor {
    /// Changes the actor by a seed. `index` is its position in the scenario.
    pub(crate) fn varied(&mut self, seed: u64, index: usize) {
        let Vary { s_m, d_m, heading_rad, speed_share } = self.vary;
        let within = |name: &str, half: f64| {
            if half > 0.0 { Rng::keyed(seed, name, &[index as i64]).uniform(-half, half) } else { 0.0 }
        };
        let (s_m, d_m) = (within("scenario actor s", s_m), within("scenario actor d", d_m));
        let turn_by_rad = within("scenario actor heading", heading_rad);
        let faster = 1.0 + within("scenario actor speed", speed_share);
        self.s_m += s_m;
        self.d_m += d_m;
        self.heading_rad += turn_by_rad;
        for leg in &mut self.motion {
            match leg {
                Motion::Wait { .. } | Motion::Track(_) => {}
                Motion::Walk { speed_mps, turn_rad, .. } => {
                    *speed_mps *= faster;
                    *turn_rad += turn_by_rad;
                }
                Motion::Drive { speeds, .. } => {
                    speeds.iter_mut().for_each(|point| point.speed_mps *= faster);
                }
                Motion::Path { speed_mps, points } => {
                    *speed_mps *= faster;
                    for point in points {
                        point.s_m += s_m;
                        point.d_m += d_m;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scenario;

    fn scenario(vary: &str) -> Scenario {
        let text = format!(
            "name = \"x\"\nroad = {{ segments = [{{ length_m = 100.0 }}] }}
            ego = {{ target_speed_mps = 10.0, end_m = 90.0 }}
            [[actor]]
            name = \"person\"
            kind = \"pedestrian\"
            s_m = 60.0
            d_m = 5.0
            {vary}
            motion = [
              {{ walk = {{ speed_mps = 2.0, distance_m = 1.0, direction = \"right\" }} }},
              {{ path = {{ speed_mps = 2.0, points = [[60.0, 1.0]] }} }},
              {{ drive = {{ speeds = [[0.0, 2.0], [1.0, 0.0]] }} }},
            ]"
        );
        Scenario::parse("x.toml", &text).unwrap()
    }

    /// Changes of s, d, heading and speed by a seed.
    fn changes(nominal: &Scenario, seed: u64) -> [f64; 4] {
        let actor = nominal.drawn(seed).actors.remove(0);
        let [
            Motion::Walk { speed_mps, turn_rad, .. },
            Motion::Path { points, .. },
            Motion::Drive { speeds, .. },
        ] = &actor.motion[..]
        else {
            panic!("{:?}", actor.motion)
        };
        assert_eq!(*turn_rad, actor.heading_rad, "it walks as it is turned");
        assert!((points[0].s_m - actor.s_m).abs() < 1e-12 && (points[0].d_m + 4.0 - actor.d_m).abs() < 1e-12);
        assert_eq!((speeds[0].speed_mps, speeds[1].speed_mps), (*speed_mps, 0.0));
        [actor.s_m - 60.0, actor.d_m - 5.0, actor.heading_rad, speed_mps / 2.0 - 1.0]
    }

    #[test]
    fn actor_without_vary_is_as_written() {
        let nominal = scenario("");
        assert!((0..20).all(|seed| nominal.drawn(seed).actors == nominal.actors));
    }

    #[test]
    fn changes_fill_their_ranges() {
        let nominal = scenario("vary = { s_m = 1.0, d_m = 0.5, heading_rad = 0.2, speed_share = 0.1 }");
        let mut most = [0.0_f64; 4];
        for seed in 0..500 {
            for (most, (change, half)) in
                most.iter_mut().zip(changes(&nominal, seed).into_iter().zip([1.0, 0.5, 0.2, 0.1]))
            {
                assert!(change.abs() <= half + 1e-12, "{change} beyond {half}");
                *most = most.max(change.abs() / half);
            }
        }
        assert!(most.iter().all(|share| *share > 0.95), "{most:?}");
        assert_eq!(changes(&nominal, 7), changes(&nominal, 7));
    }

    #[test]
    fn wrong_ranges_are_reported() {
        let text = "name = \"x\"\nroad = { segments = [{ length_m = 100.0 }] }
            ego = { target_speed_mps = 10.0, end_m = 90.0 }
            [[actor]]
            name = \"person\"
            kind = \"pedestrian\"
            s_m = 60.0
            d_m = 5.0
            vary = { s_m = -1.0, speed = 0.1 }";
        let said = Scenario::parse("x.toml", text).unwrap_err().to_string();
        assert!(said.contains("s_m: expected") && said.contains("did you mean `speed_share`"), "{said}");
    }
}
