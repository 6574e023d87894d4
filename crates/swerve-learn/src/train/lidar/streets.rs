//! Training streets drawn from a seed, with more parked and moving vehicles than the built-in scenarios have.

use core::f64::consts::PI;
use core::fmt::Write as _;

use anyhow::anyhow;
use swerve_core::Rng;
use swerve_geom::math;
use swerve_scenario::Scenario;

/// Minimum gap between the bumpers of vehicles parked in a row, metres.
const GAP_MIN_M: f64 = 0.5;
/// Minimum clearance between actors at the start, along the road and across it, metres.
const CLEAR_M: f64 = 0.25;
/// Half width of the ego's lane, metres.
const HALF_LANE_M: f64 = 2.0;
/// Lateral offset of oncoming vehicles, metres to the left.
const ONCOMING_M: f64 = 4.0;

/// Scenario of a street with bends, vehicles parked on both sides, oncoming traffic, cyclists and pedestrians.
///
/// # Errors
/// If the street is not a valid scenario, which is a bug in this function.
pub(super) fn street(seed: u64) -> anyhow::Result<Scenario> {
    let mut rng = Rng::keyed(seed, "training street", &[]);
    let lengths = [rng.uniform(50.0, 80.0), rng.uniform(40.0, 60.0), rng.uniform(50.0, 70.0)];
    let bend = rng.uniform(-0.012, 0.012);
    let [left_m, right_m] = [rng.uniform(6.0, 8.6), rng.uniform(2.0, 4.6)];
    let end_m = lengths.iter().sum::<f64>() - 15.0;
    let mut text = format!(
        "name = \"street_{seed}\"\n[road]\nsegments = [{{ length_m = {} }}, {{ length_m = {}, curvature_1pm = {bend} }}, \
         {{ length_m = {} }}]\nleft_m = {left_m}\nright_m = {right_m}\n[ego]\ntarget_speed_mps = {}\nend_m = {end_m}\n\
         [expect]\nverdict = \"avoided\"\nmin_distance_m = {{ min = 0.0 }}\n",
        lengths[0],
        lengths[1],
        lengths[2],
        rng.uniform(7.0, 13.0),
    );
    let mut actors = Actors { text: &mut text, taken: vec![[0.0, 0.0, 6.0, 2.0]] };
    // Parked vehicles stand with two wheels on the pavement if the ground beside the lanes is narrow.
    for (edge_m, side) in [(right_m.max(HALF_LANE_M + 0.9), -1.0), (left_m.max(ONCOMING_M + 3.3), 1.0)] {
        actors.parked(&mut rng, (edge_m, side), end_m);
    }
    actors.moving(&mut rng, end_m);
    actors.people(&mut rng, [left_m, right_m], end_m);
    Scenario::parse("training street", &text).map_err(|problems| anyhow!("street {seed}: {problems:?}"))
}

struct Actors<'a> {
    text: &'a mut String,
    /// Occupied places: s, d, and the extents along them, metres; the ego first.
    taken: Vec<[f64; 4]>,
}

impl Actors<'_> {
    /// Adds an actor, unless its place is occupied.
    fn add(&mut self, kind: &str, size: [f64; 3], place: [f64; 3], motion: &str) {
        let ([length, width, height], [s, d, heading]) = (size, place);
        let (sin, cos) = math::sin_cos(heading);
        let along = length * cos.abs() + width * sin.abs();
        let across = length * sin.abs() + width * cos.abs();
        let is_near = |[other_s, other_d, other_along, other_across]: &[f64; 4]| {
            (s - other_s).abs() < 0.5 * (along + other_along) + CLEAR_M
                && (d - other_d).abs() < 0.5 * (across + other_across) + CLEAR_M
        };
        if self.taken.iter().any(is_near) {
            return;
        }
        self.taken.push([s, d, along, across]);
        let size = match kind {
            "pedestrian" => format!("radius_m = {}", 0.5 * length),
            _ => format!("length_m = {length}, width_m = {width}"),
        };
        let _ = writeln!(
            self.text,
            "[[actor]]\nname = \"{kind} {}\"\nkind = \"{kind}\"\nsize = {{ {size}, height_m = {height} }}\n\
             s_m = {s}\nd_m = {d}\nheading_rad = {heading}\n{motion}",
            self.taken.len()
        );
    }

    /// Adds a row of vehicles parked along a kerb, or at right angles to it.
    fn parked(&mut self, rng: &mut Rng, (edge_m, side): (f64, f64), end_m: f64) {
        let density = rng.uniform(0.3, 0.9);
        let is_across = rng.unit() < 0.25;
        let mut s_m = 12.0 + rng.uniform(0.0, 10.0);
        while s_m < end_m {
            let (kind, size) = vehicle(rng, if is_across { 0.0 } else { 0.08 });
            let heading = if rng.unit() < 0.5 { 0.0 } else { PI } + if is_across { 0.5 * PI } else { 0.0 };
            let out_m = rng.uniform(-0.1, 0.15);
            let d_m = if is_across { edge_m + 0.5 * size[0] - 0.5 } else { edge_m - 0.5 * size[1] } + out_m;
            let along_m = if is_across { size[1] } else { size[0] };
            s_m += 0.5 * along_m;
            if rng.unit() < density {
                self.add(kind, size, [s_m, side * d_m, heading + 0.03 * rng.normal()], "");
            }
            s_m += 0.5 * along_m + GAP_MIN_M + rng.uniform(0.0, 2.5);
        }
    }

    fn moving(&mut self, rng: &mut Rng, end_m: f64) {
        let mut s_m = rng.uniform(35.0, 60.0);
        while s_m < end_m {
            let (kind, size) = vehicle(rng, 0.2);
            let (from, speed) = (s_m, rng.uniform(4.0, 12.0));
            let stops = (1..).map(|k| from - 5.0 * f64::from(k)).take_while(|s| *s > 0.0);
            let points: Vec<String> = stops.map(|s| format!("[{s:.1}, {ONCOMING_M}]")).collect();
            let motion = format!(
                "motion = [{{ path = {{ speed_mps = {speed}, points = [{}] }} }}]",
                points.join(", ")
            );
            self.add(kind, size, [s_m, ONCOMING_M, PI], &motion);
            s_m += rng.uniform(14.0, 45.0);
        }
        // A car ahead of the ego.
        let (_, size) = vehicle(rng, 0.0);
        let speed = rng.uniform(8.0, 13.0);
        let motion = format!("motion = [{{ drive = {{ along = \"road\", speed_mps = {speed} }} }}]");
        self.add("car", size, [rng.uniform(22.0, 34.0), 0.0, 0.0], &motion);
    }

    fn people(&mut self, rng: &mut Rng, [left_m, right_m]: [f64; 2], end_m: f64) {
        for _ in 0..8 {
            let (edge_m, side) = if rng.unit() < 0.5 { (left_m, 1.0) } else { (right_m, -1.0) };
            let place = [rng.uniform(10.0, end_m), side * (edge_m + rng.uniform(0.6, 2.2)), 0.0];
            let direction = if rng.unit() < 0.5 { "ahead" } else { "back" };
            let speed = rng.uniform(0.8, 1.8);
            let motion = format!(
                "motion = [{{ walk = {{ speed_mps = {speed}, distance_m = 40.0, direction = \"{direction}\" }} }}]"
            );
            self.add("pedestrian", [0.5, 0.5, rng.uniform(1.2, 1.9)], place, &motion);
        }
        for _ in 0..5 {
            let drive = "motion = [{ drive = { along = \"heading\", speed_mps = 3.0, distance_m = 15.0 } }]";
            let (d_m, heading) = match rng.below(3) {
                0 => (-HALF_LANE_M + 0.3, 0.0),
                1 => (ONCOMING_M + 1.7, PI),
                _ => (-right_m - rng.uniform(0.8, 2.0), rng.uniform(-PI, PI)),
            };
            let place = [rng.uniform(15.0, end_m), d_m, heading];
            self.add("cyclist", [1.8, 0.6, rng.uniform(1.6, 1.85)], place, drive);
        }
    }
}

/// Car, van or, with probability `trucks`, truck: its kind, and length, width and height in metres.
fn vehicle(rng: &mut Rng, trucks: f64) -> (&'static str, [f64; 3]) {
    let drawn = rng.unit();
    if drawn < trucks {
        return ("truck", [rng.uniform(5.2, 9.0), rng.uniform(2.3, 2.6), rng.uniform(2.5, 3.5)]);
    }
    if drawn < trucks + 0.12 {
        return ("car", [rng.uniform(4.4, 5.2), rng.uniform(1.9, 2.1), rng.uniform(1.8, 2.1)]);
    }
    ("car", [rng.uniform(3.7, 4.9), rng.uniform(1.65, 1.9), rng.uniform(1.4, 1.65)])
}
