//! Slopes of the ego's way, which driving on the flat projection neglects.

use swerve_map::{LaneId, Map, Stretch};
use swerve_map_io::MapFile;
use swerve_map_io::slope::Slope;

use super::Way;

/// Standard gravity, m/s².
const GRAVITY_MPS2: f64 = 9.81;

/// A kind of slope and its limits, height over distance.
struct Limits {
    name: &'static str,
    /// From here on, a warning.
    warned: f64,
    /// The largest that is driven.
    most: f64,
}

/// Grades from 0.2 m/s², a tenth of comfortable braking, to 0.8 m/s², at which a stop at 3 m/s² takes a third more road.
const GRADE: Limits = Limits { name: "grade", warned: 0.02, most: 0.08 };
/// Banks above the 2.5 % that drain a road, and the 8 % in curves of rural roads.
const BANK: Limits = Limits { name: "bank", warned: 0.04, most: 0.10 };

/// Warning for a way that is not flat; `None` if it is.
///
/// # Errors
/// If it is too steep or too much banked to be driven on the flat projection.
pub(super) fn warning(file: &MapFile, course: &Way) -> Result<Option<String>, String> {
    let slopes = file.slopes(parts(&file.map, course));
    let of_what = if file.has_roads() { "road" } else { "lane" };
    let found = [(GRADE, &slopes.grade), (BANK, &slopes.bank)];
    let of = |limit: fn(&Limits) -> f64| {
        let above = move |(limits, slope): &(Limits, &Option<Slope>)| {
            let slope = slope.as_ref().filter(|slope| slope.slope.abs() > limit(limits))?;
            Some(described(of_what, limits, slope))
        };
        found.iter().filter_map(above).collect::<Vec<_>>()
    };
    const FLAT: &str = "vehicles are driven on the flat projection of the map";
    if let Some(steep) = of(|limits| limits.most).first() {
        let limits =
            [GRADE, BANK].map(|limits| format!("a {} of at most {:.0} %", limits.name, 100.0 * limits.most));
        return Err(format!("{steep}: {FLAT}, expected {}", limits.join(" and ")));
    }
    let warned = of(|limits| limits.warned);
    Ok((!warned.is_empty()).then(|| format!("{}: {FLAT}", warned.join(", "))))
}

fn described(of_what: &str, limits: &Limits, Slope { slope, road, s_m }: &Slope) -> String {
    let (name, percent) = (limits.name, 100.0 * slope);
    let neglected_mps2 = GRAVITY_MPS2 * slope.abs() / (1.0 + slope * slope).sqrt();
    format!("{of_what} {road:?} has a {name} of {percent:.1} % ({neglected_mps2:.2} m/s²) at s = {s_m:.1} m")
}

/// Lanes from the start to the goal, each with its part, metres.
fn parts(map: &Map, course: &Way) -> Vec<(LaneId, [f64; 2])> {
    let (stretches, line) = (course.route.stretches(), course.route.line());
    let part = |(k, stretch): (usize, &Stretch)| {
        let end_m = stretches.get(k + 1).map_or(line.length(), |next| next.begin_m);
        let ends_m = [stretch.begin_m.max(course.start_m), end_m.min(course.goal_m)];
        let lane = map.lane(stretch.lane).filter(|_| ends_m[1] > ends_m[0])?;
        // After a lane change, a stretch begins within its lane.
        Some((lane.id, ends_m.map(|s_m| lane.line.project(line.at(s_m).pose.point()).s_m)))
    };
    stretches.iter().enumerate().filter_map(part).collect()
}
