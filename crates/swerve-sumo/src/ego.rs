//! The ego in SUMO: its route, its insertion, its moves.

use swerve_geom::{Obb, Pose2};
use swerve_map::LaneKind;
use swerve_map::router::{Stop, find_over};
use swerve_map_io::sumo::Net;
use swerve_msg::truth::EgoTruth;

use crate::SumoError;
use crate::states::{LENGTH, WIDTH};
use crate::wire::{Command, Domain, Insertion, Value};

/// Name of the ego, of its route and of its type in SUMO.
pub(crate) const EGO: &str = "swerve.ego";
const ROUTE: &str = "swerve.route";
const KIND: &str = "DEFAULT_VEHTYPE";

/// Largest distance of the ego's start from the lanes of the net, metres.
const OFF_MAX_M: f64 = 50.0;

/// Edges of the net that lead from the start over further places to the goal, in the frame of the map.
pub(crate) fn edges(
    net: &Net,
    name: &str,
    stops: &[Pose2],
    offset_m: [f64; 2],
) -> Result<Vec<String>, SumoError> {
    let map = &net.lanes.map;
    let moved = [0, 1].map(|k| net.net_offset_m[k] - offset_m[k]);
    let stop = |pose: &Pose2| -> Option<(f64, Stop)> {
        // In the frame of the net as it was read.
        let at = swerve_geom::Point2::new(pose.x_m - moved[0], pose.y_m - moved[1]);
        let ways = map.lanes().iter().filter(|lane| lane.kind == LaneKind::Driving).map(|lane| {
            let s_m = lane.line.project(at).s_m.clamp(0.0, lane.line.length());
            let pose_there = lane.line.at(s_m).pose;
            let turn_rad = swerve_geom::angle_between(pose_there.heading_rad, pose.heading_rad).abs();
            let off_m = pose_there.point().distance(at);
            (off_m + 5.0 * turn_rad, off_m, Stop { lane: lane.id, s_m })
        });
        ways.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, off_m, stop)| (off_m, stop))
    };
    let found: Option<Vec<(f64, Stop)>> = stops.iter().map(stop).collect();
    let found = found.filter(|found| !found.is_empty());
    let found = found.ok_or_else(|| SumoError::Setting(format!("{name} has no lanes for cars")))?;
    let (off_m, _) = found[0];
    if off_m > OFF_MAX_M {
        let Pose2 { x_m, y_m, .. } = stops[0];
        return Err(SumoError::Setting(format!(
            "the ego starts at ({x_m:.1}, {y_m:.1}) m of the map, {off_m:.0} m from the nearest lane of {name}: \
             expected a map in the coordinates of the net, moved by `world.offset_m` = [{}, {}]",
            offset_m[0], offset_m[1]
        )));
    }
    let places: Vec<Stop> = found.into_iter().map(|(_, stop)| stop).collect();
    // Without a way, the ego is on the edge of its start; SUMO accepts it anywhere else, too.
    let way = find_over(map, &places, &[]).map(|way| way.lanes).unwrap_or_default();
    let lanes = core::iter::once(places[0].lane).chain(way.into_iter().map(|(_, lane)| lane));
    let mut edges: Vec<String> = Vec::new();
    for lane in lanes {
        let Some(source) = net.sources.get(lane.0 as usize) else { continue };
        if !source.edge.starts_with(':') && edges.last() != Some(&source.edge) {
            edges.push(source.edge.clone());
        }
    }
    match edges.is_empty() {
        true => {
            Err(SumoError::Setting(format!("the ego starts inside a junction of {name}: expected a lane")))
        }
        false => Ok(edges),
    }
}

/// Adds the route of the ego.
pub(crate) fn route(edges: &[String]) -> Command {
    Command::add_route(ROUTE, edges)
}

/// Commands that insert the ego on its route.
pub(crate) fn insertion(outline: &Obb) -> [Command; 3] {
    let size =
        |variable: u8, value_m: f64| Command::set(Domain::Vehicle, variable, EGO, &Value::Double(value_m));
    let insertion = Insertion {
        route: ROUTE,
        kind: KIND,
        depart: ["first", "base", "0"],
        arrive: ["current", "max", "current"],
    };
    [
        Command::add_vehicle(EGO, &insertion),
        size(LENGTH, 2.0 * outline.half_length_m),
        size(WIDTH, 2.0 * outline.half_width_m),
    ]
}

/// Moves the ego to where it is after `ahead_s` seconds at its velocity and yaw rate.
pub(crate) fn move_to(ego: &EgoTruth, outline: &Obb, ahead_s: f64, offset_m: [f64; 2]) -> Command {
    let velocity = ego.velocity_mps.coords;
    let turned_rad = outline.center.heading_rad + ego.state.yaw_rate_radps * ahead_s;
    let center = Pose2::<swerve_geom::Map>::new(
        outline.center.x_m + velocity.x * ahead_s,
        outline.center.y_m + velocity.y * ahead_s,
        turned_rad,
    );
    let front = center.ahead(outline.half_length_m);
    let place = [front.x_m + offset_m[0], front.y_m + offset_m[1]];
    Command::move_to(EGO, place, (90.0 - turned_rad.to_degrees()).rem_euclid(360.0))
}
