//! Random streets as scenarios, for training and testing detectors and segmentations.
//!
//! A street is a straight, optionally a bend, and a straight again, with pavements. Pedestrians walk and stand on both
//! sides and two cross. On some streets cars are parked; others come towards the ego or drive ahead of it, with trucks
//! and cyclists among them. Streets from number 1000 on also have traffic across: cars broadside, standing in exits and
//! crossing, and adults, children and cyclists that cross in full stride close to the ego.

use core::f64::consts::PI;
use core::fmt::Write as _;

use swerve_core::Rng;

/// End of the ego's drive, metres.
const END_M: f64 = 130.0;
/// First street with traffic across.
const ACROSS: u32 = 1000;

/// Scenario text; all numbers are drawn from the street's own number.
pub(super) fn street(number: u32) -> String {
    let mut street =
        Street { rng: Rng::keyed(u64::from(number), "street", &[]), text: String::new(), actors: 0 };
    let bend = street.one_of(&["0.0", "0.0", "0.008", "-0.008", "0.012"]);
    let left_m = if street.chance(0.5) { 6.0 } else { 8.0 };
    let first_m = street.rng.uniform(50.0, 90.0);
    street.text = format!(
        "name = \"street_{number}\"\ndescription = \"a random street\"\n\
         [expect]\nverdict = \"avoided\"\nmin_distance_m = {{ min = 0.0 }}\n\
         [road]\nsegments = [{{ length_m = {first_m:.1} }}, {{ length_m = 60.0, curvature_1pm = {bend} }}, {{ length_m = 90.0 }}]\n\
         lane_width_m = 4.0\nleft_m = {left_m:.1}\nright_m = 2.0\n\
         [ego]\ntarget_speed_mps = 9.0\nend_m = {END_M:.1}\n[end]\ntimeout_s = 25.0\n"
    );
    street.people(left_m);
    street.parked(left_m);
    street.traffic();
    if number >= ACROSS {
        street.across(left_m);
    }
    street.text
}

struct Street {
    rng: Rng,
    text: String,
    actors: usize,
}

impl Street {
    fn chance(&mut self, share: f64) -> bool {
        self.rng.unit() < share
    }

    fn one_of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.rng.below(all.len())]
    }

    /// Adds an actor at an arc length and offset, with a heading along the road and further keys.
    fn actor(&mut self, kind: &str, at_m: [f64; 2], heading_rad: f64, more: &str) {
        self.actors += 1;
        let ([s, d], number) = (at_m, self.actors);
        // Writing to a string cannot fail.
        let _ = write!(
            self.text,
            "[[actor]]\nname = \"{kind}{number}\"\nkind = \"{kind}\"\ns_m = {s:.2}\nd_m = {d:.2}\nheading_rad = {heading_rad:.3}\n{more}\n"
        );
    }

    fn person(&mut self, at_m: [f64; 2], heading_rad: f64, motion: &str) {
        let height_m = self.rng.uniform(1.5, 1.95);
        let more = format!("size = {{ radius_m = 0.25, height_m = {height_m:.2} }}\n{motion}");
        self.actor("pedestrian", at_m, heading_rad, &more);
    }

    fn people(&mut self, left_m: f64) {
        let mut s = 8.0;
        while s < 165.0 {
            let right = self.chance(0.55);
            let d = if right {
                self.rng.uniform(-4.2, -2.7)
            } else {
                self.rng.uniform(left_m + 0.9, left_m + 2.2)
            };
            if self.chance(0.25) {
                let heading_rad = self.rng.uniform(-3.1, 3.1);
                self.person([s, d], heading_rad, "");
            } else {
                let (direction, heading_rad) = self.one_of(&[("ahead", 0.0), ("back", PI)]);
                let speed_mps = self.rng.uniform(1.0, 1.7);
                let walk =
                    format!("speed_mps = {speed_mps:.2}, distance_m = 40.0, direction = \"{direction}\"");
                self.person([s, d], heading_rad, &format!("motion = [{{ walk = {{ {walk} }} }}]"));
            }
            s += self.rng.uniform(4.0, 14.0);
        }
        for from_m in [60.0, 106.0] {
            let (s, speed_mps) = (self.rng.uniform(from_m, from_m + 45.0), self.rng.uniform(0.8, 1.4));
            let walk = format!(
                "speed_mps = {speed_mps:.2}, distance_m = {:.1}, direction = \"right\"",
                left_m - 2.2
            );
            self.person([s, left_m + 0.3], -1.57, &format!("motion = [{{ walk = {{ {walk} }} }}]"));
        }
    }

    fn car(&mut self) -> &'static str {
        self.one_of(&[
            "size = { length_m = 4.5, width_m = 1.8, height_m = 1.5 }",
            "size = { length_m = 4.0, width_m = 1.75, height_m = 1.48 }",
            "size = { length_m = 4.7, width_m = 1.9, height_m = 1.7 }",
            "size = { length_m = 5.2, width_m = 2.0, height_m = 2.2 }",
        ])
    }

    /// Adds a row of parked cars on the far side, if the road is wide enough.
    fn parked(&mut self, left_m: f64) {
        if left_m < 8.0 {
            return;
        }
        let mut s = self.rng.uniform(10.0, 25.0);
        while s < 150.0 {
            if self.chance(0.6) {
                let (heading_rad, size) = (self.one_of(&[0.0, PI]), self.car());
                self.actor("car", [s, 6.9], heading_rad, size);
            }
            s += self.rng.uniform(7.0, 12.0);
        }
    }

    fn traffic(&mut self) {
        let mut s = self.rng.uniform(30.0, 60.0);
        for _ in 0..self.one_of(&[2, 3]) {
            if self.chance(0.7) {
                let (size, speed_mps) = (self.car(), self.rng.uniform(2.0, 6.0));
                let drive =
                    format!("along = \"road\", speed_mps = {speed_mps:.1}, distance_m = {:.1}", s - 8.0);
                self.actor("car", [s, 3.9], PI, &format!("{size}\nmotion = [{{ drive = {{ {drive} }} }}]"));
            } else {
                self.actor("truck", [s, 4.0], PI, "");
            }
            s += self.rng.uniform(22.0, 45.0);
        }
        if self.chance(0.7) {
            let (s, size, speed_mps) = (self.rng.uniform(14.0, 30.0), self.car(), self.rng.uniform(7.0, 9.0));
            let drive = format!("along = \"road\", speed_mps = {speed_mps:.1}, distance_m = 120.0");
            self.actor("car", [s, 0.0], 0.0, &format!("{size}\nmotion = [{{ drive = {{ {drive} }} }}]"));
        }
        for k in 0..self.rng.below(3) {
            let from_m = 20.0 + 50.0 * k as f64;
            let (s, heading_rad) = (self.rng.uniform(from_m, from_m + 45.0), self.one_of(&[0.0, PI]));
            let d = if heading_rad == 0.0 { -1.5 } else { 2.0 };
            self.actor("cyclist", [s, d], heading_rad, "");
        }
    }
}

impl Street {
    /// Adds traffic across the road: one car or runner every 8 to 14 metres.
    fn across(&mut self, left_m: f64) {
        let mut s = self.rng.uniform(18.0, 26.0);
        while s < END_M + 25.0 {
            let right = self.chance(0.5);
            // Outer edge of the places of people on the pavement, and the direction away from the road.
            let (edge_m, outwards) = if right { (-4.3, -1.0) } else { (left_m + 2.3, 1.0) };
            let across_rad = -outwards * 0.5 * PI;
            let heading_rad = across_rad + self.rng.uniform(-0.3, 0.3);
            let within_m = self.rng.uniform(10.0, 26.0);
            let behind_m = |rng: &mut Rng, from_m, to_m| edge_m + outwards * rng.uniform(from_m, to_m);
            match self.rng.below(4) {
                0 => {
                    let (d, size) = (behind_m(&mut self.rng, 3.2, 5.0), self.car());
                    let distance_m = self.rng.uniform(0.5, 5.0);
                    self.crossing("car", [s, d], (heading_rad, 60.0, 2.5, distance_m), size);
                }
                1 => {
                    let (d, size) = (behind_m(&mut self.rng, 3.2, 6.0), self.car());
                    let speed_mps = self.rng.uniform(5.0, 9.0);
                    self.crossing("car", [s, d], (across_rad, 14.0 + within_m, speed_mps, 30.0), size);
                }
                2 => {
                    let d = behind_m(&mut self.rng, 0.4, 1.0);
                    let (height_m, speed_mps) = (self.rng.uniform(1.1, 1.9), self.rng.uniform(1.6, 3.2));
                    let size = format!("size = {{ radius_m = 0.22, height_m = {height_m:.2} }}");
                    self.crossing("pedestrian", [s, d], (heading_rad, within_m, speed_mps, 25.0), &size);
                }
                _ => {
                    let (d, speed_mps) = (behind_m(&mut self.rng, 1.2, 1.8), self.rng.uniform(2.5, 4.5));
                    self.crossing("cyclist", [s, d], (heading_rad, within_m, speed_mps, 25.0), "");
                }
            }
            s += self.rng.uniform(8.0, 14.0);
        }
    }

    /// Adds an actor that moves straight ahead, with a speed over a distance, once the ego is within a distance.
    fn crossing(
        &mut self,
        kind: &str,
        at_m: [f64; 2],
        (heading_rad, within_m, speed_mps, distance_m): (f64, f64, f64, f64),
        size: &str,
    ) {
        let drive = format!("along = \"heading\", speed_mps = {speed_mps:.1}, distance_m = {distance_m:.1}");
        let trigger = format!("trigger = {{ distance = {{ within_m = {within_m:.1} }} }}");
        self.actor(
            kind,
            at_m,
            heading_rad,
            &format!("{size}\n{trigger}\nmotion = [{{ drive = {{ {drive} }} }}]"),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streets_are_valid_and_distinct_scenarios() {
        let texts: Vec<String> =
            (0..40).chain(100..106).chain(900..912).chain(1000..1030).chain(1900..1915).map(street).collect();
        for (k, text) in texts.iter().enumerate() {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("street.toml");
            std::fs::write(&path, text).unwrap();
            swerve_drive::read_scenario(&path).unwrap_or_else(|error| panic!("street {k}: {error:#}"));
            assert_eq!(texts.iter().filter(|other| *other == text).count(), 1);
        }
        for kind in ["pedestrian", "car", "truck", "cyclist"] {
            let with = texts.iter().filter(|text| text.contains(&format!("kind = \"{kind}\""))).count();
            assert!(with >= 15, "{with} streets with a {kind}");
        }
    }
}
