use swerve_msg::{ActorId, ActorKind, Extent};
use swerve_text::{Range, TableReader};

use super::track;

use super::map::{Loaded, line_of};
use super::{ANGLE, DURATION, MOVING, PLACE, SPEED, WAY, identity, unknown_actor};
use crate::{Actor, Along, Direction, Motion, RoadPlace, SpeedPoint, Subject, Trigger, Vary};

/// Kind, name in files, default size (length, width, height in metres) and mass (kg).
const KINDS: [(ActorKind, &str, [f64; 3], f64); 6] = [
    (ActorKind::Car, "car", [4.5, 1.8, 1.5], 1_500.0),
    (ActorKind::Truck, "truck", [5.2, 2.6, 2.5], 7_500.0),
    (ActorKind::Motorcycle, "motorcycle", [2.2, 0.8, 1.5], 280.0),
    (ActorKind::Cyclist, "cyclist", [1.8, 0.6, 1.8], 90.0),
    (ActorKind::Pedestrian, "pedestrian", [0.5, 0.5, 1.8], 75.0),
    (ActorKind::Static, "static", [1.0, 1.0, 1.0], 1_000.0),
];

/// Mass of an actor that has none of its own, kg.
pub(crate) fn usual_mass_kg(kind: ActorKind) -> f64 {
    KINDS.iter().find(|(known, ..)| *known == kind).map_or(0.0, |(.., mass_kg)| *mass_kg)
}

/// Names and map that an actor is read with.
pub(super) struct Setting<'a> {
    pub(super) id: ActorId,
    pub(super) name: &'a str,
    /// Name of the first ego.
    pub(super) ego: &'a str,
    /// All actors and other egos, to resolve references.
    pub(super) known: &'a [(ActorId, &'a str)],
    /// True if the scenario is on a map.
    pub(super) on_map: bool,
    /// The map; `None` after a problem.
    pub(super) map: Option<&'a Loaded>,
}

pub(super) fn read(
    table: &TableReader<'_>,
    Setting { id, name, ego, known, on_map, map }: Setting<'_>,
) -> Actor {
    let kind_names = KINDS.map(|(_, name, _, _)| name);
    let named = table.one_of("kind", &kind_names);
    let (kind, _, size, mass) = KINDS[named.unwrap_or(0)];
    if on_map && table.has("track") {
        return recorded(table, (id, name, kind), extent(table, named.map(|_| kind), size), mass);
    }
    let at_start = on_map && table.has("start");
    let motion = motions(table, kind);
    let fastest_mps = motion.iter().map(Motion::fastest_mps).fold(0.0, f64::max);
    let course = map.filter(|_| at_start).and_then(|map| map.course(table, false, fastest_mps));
    if at_start && map.is_none() {
        // Not read after a problem of the map or of the ego.
        for key in ["start", "goal", "via"] {
            table.value(key);
        }
    }
    let actor = Actor {
        id,
        name: name.to_owned(),
        kind,
        extent: extent(table, named.map(|_| kind), size),
        mass_kg: table.number_or("mass_kg", mass, Range::between(0.1, 100_000.0)),
        s_m: match &course {
            Some(course) => course.start_m,
            None if at_start => 0.0,
            None => table.number("s_m", PLACE),
        },
        d_m: if at_start { table.number_or("d_m", 0.0, PLACE) } else { table.number("d_m", PLACE) },
        heading_rad: table.number_or("heading_rad", 0.0, ANGLE),
        trigger: trigger(table, ego, known),
        motion,
        vary: Vary::read(table),
        line: course.map(line_of),
    };
    if actor.trigger.is_some() && actor.motion.is_empty() {
        table.report("trigger", "has no effect: the actor has no motion");
    }
    table.finish();
    actor
}

/// An actor with recorded motion.
fn recorded(
    table: &TableReader<'_>,
    (id, name, kind): (ActorId, &str, ActorKind),
    extent: Extent,
    mass_kg: f64,
) -> Actor {
    let track = track::read(table);
    let first = track.poses.first().copied().unwrap_or_default();
    let mass_kg = table.number_or("mass_kg", mass_kg, Range::between(0.1, 100_000.0));
    if kind == ActorKind::Static && track.poses.len() > 1 {
        table.report("track", "an actor of kind \"static\" cannot move");
    }
    table.finish();
    let motion = if kind == ActorKind::Static { Vec::new() } else { vec![Motion::Track(track)] };
    Actor { mass_kg, motion, ..Actor::at_rest(id, name.to_owned(), kind, extent, first) }
}

/// Reads the size of an actor; `kind` is `None` if it is wrong, and the size may then be that of any kind.
fn extent(table: &TableReader<'_>, kind: Option<ActorKind>, usual: [f64; 3]) -> Extent {
    let [mut length_m, mut width_m, mut height_m] = usual;
    let side = Range::between(0.01, 1_000.0);
    if let Some(size) = table.table_if_any("size") {
        if kind.is_none() {
            size.number_if_any("radius_m", side);
        }
        if kind == Some(ActorKind::Pedestrian) {
            width_m = 2.0 * size.number_or("radius_m", 0.5 * width_m, Range::between(0.01, 2.0));
            length_m = width_m;
        } else {
            length_m = size.number_or("length_m", length_m, side);
            width_m = size.number_or("width_m", width_m, side);
        }
        height_m = size.number_or("height_m", height_m, side);
        size.finish();
    } else if kind == Some(ActorKind::Static) {
        table.report("size", "is missing: expected { length_m, width_m, height_m } of what cannot move");
    }
    Extent { length_m, width_m, height_m }
}

fn trigger(table: &TableReader<'_>, ego: &str, known: &[(ActorId, &str)]) -> Option<Trigger> {
    let table = table.table_if_any("trigger")?;
    let which = table.only_one(&["distance", "time", "reaches"]);
    let trigger = which.and_then(|key| {
        let inner = table.table_if_any(key)?;
        let trigger = match key {
            "distance" => Trigger::Distance {
                to: subject(&inner, "to", ego, known),
                within_m: inner.number("within_m", WAY),
            },
            "time" => Trigger::Time { at_s: inner.number("at_s", Range::between(0.0, 86_400.0)) },
            _ => {
                Trigger::Reaches { who: subject(&inner, "who", ego, known), s_m: inner.number("s_m", PLACE) }
            }
        };
        inner.finish();
        Some(trigger)
    });
    table.finish();
    trigger
}

fn subject(table: &TableReader<'_>, key: &'static str, ego: &str, known: &[(ActorId, &str)]) -> Subject {
    match table.text_if_any(key).as_deref() {
        None | Some("ego") => Subject::Ego,
        Some(name) if name == ego => Subject::Ego,
        Some(name) => {
            if let Some(id) = identity(name, known) {
                return Subject::Actor(id);
            }
            table.report(key, unknown_actor(name, known, &["ego", ego]));
            Subject::Ego
        }
    }
}

fn motions(table: &TableReader<'_>, kind: ActorKind) -> Vec<Motion> {
    let legs = table.tables("motion", |_| None);
    if kind == ActorKind::Static && !legs.is_empty() {
        table.report("motion", "an actor of kind \"static\" cannot move");
    }
    let motions: Vec<(usize, Motion)> =
        legs.iter().enumerate().filter_map(|(i, leg)| motion(leg).map(|motion| (i, motion))).collect();
    for (i, motion) in &motions {
        if i + 1 < legs.len() && is_endless(motion) {
            let next = &legs[i + 1];
            let message =
                "is never reached: the drive before it has no distance_m and does not come to a stop";
            next.report_whole(message);
        }
    }
    motions.into_iter().map(|(_, motion)| motion).collect()
}

fn is_endless(motion: &Motion) -> bool {
    match motion {
        Motion::Drive { speeds, distance_m: None, .. } => {
            speeds.last().is_some_and(|last| last.speed_mps > 0.0)
        }
        _ => false,
    }
}

fn motion(table: &TableReader<'_>) -> Option<Motion> {
    let key = table.only_one(&["wait", "walk", "drive", "path"])?;
    let leg = table.table_if_any(key)?;
    let motion = match key {
        "wait" => Motion::Wait { for_s: leg.number("for_s", DURATION) },
        "walk" => walk(&leg),
        "drive" => drive(&leg),
        _ => Motion::Path { speed_mps: leg.number("speed_mps", MOVING), points: points(&leg) },
    };
    leg.finish();
    table.finish();
    Some(motion)
}

fn walk(leg: &TableReader<'_>) -> Motion {
    const WAYS: [(Direction, &str); 4] = [
        (Direction::Left, "left"),
        (Direction::Right, "right"),
        (Direction::Ahead, "ahead"),
        (Direction::Back, "back"),
    ];
    Motion::Walk {
        speed_mps: leg.number("speed_mps", MOVING),
        distance_m: leg.number("distance_m", WAY),
        direction: WAYS[leg.one_of("direction", &WAYS.map(|(_, name)| name)).unwrap_or(0)].0,
        turn_rad: 0.0,
    }
}

fn drive(leg: &TableReader<'_>) -> Motion {
    let along = match leg.has("along").then(|| leg.one_of("along", &["road", "heading"])).flatten() {
        Some(1) => Along::Heading,
        _ => Along::Road,
    };
    let distance_m = leg.number_if_any("distance_m", WAY);
    let speeds = match leg.only_one(&["speed_mps", "speeds"]) {
        Some("speed_mps") => {
            vec![SpeedPoint { at_s: 0.0, speed_mps: leg.number("speed_mps", MOVING) }]
        }
        Some(_) => speeds(leg),
        None => Vec::new(),
    };
    if distance_m.is_some() && speeds.last().is_some_and(|last| last.speed_mps == 0.0) {
        leg.report("distance_m", "is not needed: the speeds end at 0, which ends the leg");
    }
    Motion::Drive { along, speeds, distance_m }
}

fn speeds(leg: &TableReader<'_>) -> Vec<SpeedPoint> {
    let wanted = "an array of pairs [seconds since the leg began, m/s]";
    let pairs = leg.pairs("speeds", wanted, [Range::between(0.0, 86_400.0), SPEED]);
    if pairs.first().is_some_and(|first| first[0] != 0.0) {
        leg.report("speeds", format!("expected the first pair at 0 s, found {} s", pairs[0][0]));
    }
    if let Some(two) = pairs.windows(2).find(|two| two[0][0] >= two[1][0]) {
        leg.report(
            "speeds",
            format!("expected increasing times, found {} s after {} s", two[1][0], two[0][0]),
        );
    }
    if pairs.len() == 1 && pairs[0][1] == 0.0 {
        leg.report("speeds", "never moves: expected a speed above 0, or \"wait\"");
    }
    pairs.into_iter().map(|[at_s, speed_mps]| SpeedPoint { at_s, speed_mps }).collect()
}

fn points(leg: &TableReader<'_>) -> Vec<RoadPlace> {
    let pairs = leg.pairs("points", "an array of pairs [s, d] in metres", [PLACE, PLACE]);
    pairs.into_iter().map(|[s_m, d_m]| RoadPlace { s_m, d_m }).collect()
}
