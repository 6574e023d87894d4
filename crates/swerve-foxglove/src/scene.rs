//! The world as boxes and lines: `foxglove.SceneUpdate` and `foxglove.FrameTransforms`.

use foxglove::messages::line_primitive::Type as LineType;
use foxglove::messages::scene_entity_deletion::Type as Deletion;
use foxglove::messages::{
    Color, CubePrimitive, FrameTransform, FrameTransforms, LinePrimitive, Point3, Pose, Quaternion,
    SceneEntity, SceneEntityDeletion, SceneUpdate, TextPrimitive, Timestamp,
};
use swerve_core::Time;
use swerve_geom::{Ego, FrenetPoint, Map, Pose2, Transform, math};
use swerve_map::{BorderLine, BorderLook};
use swerve_msg::truth::Actor;
use swerve_msg::{ActorNames, Extent, Lanes, Plan, PredictionList, TrackList};

use crate::form::{
    EGO, MAP, colour, colour_of, coords, frame_of, name_of, point, rotation, timestamp, upright, vector,
};
use crate::setup::{Mount, Setup};

/// Height of ground lines, metres, to avoid overlap with the ground.
const OVER_M: f64 = 0.05;
/// Spacing of the points of a line along the road, metres.
const STEP_M: f64 = 2.0;
const WHITE: [u8; 4] = [235, 235, 235, 255];
const GREY: [u8; 4] = [120, 120, 120, 255];
const GREEN: [u8; 4] = [60, 230, 120, 255];
const CYAN: [u8; 4] = [40, 220, 255, 255];
const ORANGE: [u8; 4] = [255, 170, 40, 255];

/// Transform from the car to the map.
pub(crate) fn map_from_ego(at: Time, pose: Transform<Map, Ego>) -> FrameTransforms {
    FrameTransforms { transforms: vec![transform(timestamp(at), MAP, EGO.into(), &pose)] }
}

/// Transforms from the sensors to the car.
pub(crate) fn ego_from_sensors(at: Time, mounts: &[Mount]) -> FrameTransforms {
    let of = |mount: &Mount| transform(timestamp(at), EGO, frame_of(&mount.name), &mount.ego_from_sensor);
    FrameTransforms { transforms: mounts.iter().map(of).collect() }
}

fn transform<A, B>(at: Timestamp, parent: &str, child: String, of: &Transform<A, B>) -> FrameTransform {
    FrameTransform {
        timestamp: Some(at),
        parent_frame_id: parent.into(),
        child_frame_id: child,
        translation: Some(vector(coords(of.origin()))),
        rotation: Some(rotation(of)),
    }
}

/// Static scene: the lanes of the map, the lines of the road, and the car in its own frame.
pub(crate) fn ground(at: Time, setup: &Setup) -> SceneUpdate {
    let line = setup.route.line();
    let n = (line.length() / STEP_M).ceil().max(1.0) as usize;
    let beside = |d_m: &dyn Fn(f64) -> f64, colour| {
        let s_at = |k: usize| line.length() * k as f64 / n as f64;
        let on = |k: usize| line.to_map(FrenetPoint { s_m: s_at(k), d_m: d_m(s_at(k)) });
        strip((0..=n).map(|k| [on(k).x_m, on(k).y_m, OVER_M]).map(point).collect(), colour, 0.12)
    };
    let mut lines = vec![beside(&|s_m| -setup.route.right_m(s_m), WHITE)];
    lines.extend(setup.lines_m.iter().map(|line| beside(&|s_m| line.at(s_m), GREY)));
    lines.push(beside(&|s_m| setup.route.left_m(s_m), WHITE));
    let shape = &setup.shape;
    let extent = Extent { length_m: shape.length_m, width_m: shape.width_m, height_m: shape.height_m };
    let center = Pose2::new(shape.center_ahead_m(), 0.0, 0.0);
    let body = cube(center, 0.0, extent, colour([240, 240, 240, 110]));
    let road = SceneEntity { lines, ..entity(at, "road") };
    let ego = SceneEntity { frame_id: EGO.into(), cubes: vec![body], ..entity(at, "ego") };
    let map = setup.map.iter().map(|map| SceneEntity { lines: map_lines(map), ..entity(at, "map") });
    SceneUpdate { deletions: Vec::new(), entities: map.chain([road, ego]).collect() }
}

/// Borders of all lanes of a map, as pairs of points: painted lines white, the others grey, thin inside junctions.
fn map_lines(map: &swerve_map::Map) -> Vec<LinePrimitive> {
    let borders = map.border_lines();
    let lines = |looks: &[BorderLook], colour, thickness| {
        let shown = borders.iter().filter(|line| looks.contains(&line.look));
        let ends = shown.flat_map(BorderLine::pieces).flatten();
        let points: Vec<Point3> = ends.map(|end| point([end.x_m, end.y_m, OVER_M])).collect();
        let line_list = LineType::LineList as i32;
        (!points.is_empty()).then(|| LinePrimitive { r#type: line_list, ..strip(points, colour, thickness) })
    };
    let painted = lines(&[BorderLook::Solid, BorderLook::Broken], WHITE, 0.12);
    let plain = lines(&[BorderLook::Plain], GREY, 0.12);
    [painted, plain, lines(&[BorderLook::InJunction], GREY, 0.04)].into_iter().flatten().collect()
}

/// Ground truth of the other road users.
pub(crate) fn actors(at: Time, actors: &[Actor], names: &ActorNames) -> SceneUpdate {
    let of = |actor: &Actor| {
        let body = cube(actor.pose, actor.z_m, actor.extent, colour_of(actor.kind, 200));
        let top_m = actor.z_m + actor.extent.height_m + 0.4;
        let number = || format!("{} {}", name_of(actor.kind), actor.id.0);
        let words = names.get(&actor.id).cloned().unwrap_or_else(number);
        let texts = vec![text(actor.pose, top_m, words)];
        SceneEntity { cubes: vec![body], texts, ..entity(at, &format!("actor {}", actor.id.0)) }
    };
    anew(at, actors.iter().map(of).collect())
}

/// Tracks of the stack: box, history, and motion within the next second.
pub(crate) fn tracks(list: &TrackList) -> SceneUpdate {
    let of = |track: &swerve_msg::Track| {
        let colour = colour_of(track.kind, 255);
        let outline = LinePrimitive {
            r#type: LineType::LineList as i32,
            points: edges(track.pose, track.extent),
            ..strip(Vec::new(), GREY, 0.06)
        };
        let outline = LinePrimitive { color: Some(colour), ..outline };
        let past = track.history.iter().map(|s| [s.point.x_m, s.point.y_m, OVER_M]).map(point).collect();
        let from = track.pose.point();
        let to = from + track.velocity_mps;
        let ahead = [[from.x_m, from.y_m, 0.5], [to.x_m, to.y_m, 0.5]].map(point).to_vec();
        let lines = vec![outline, strip(past, GREY, 0.05), strip(ahead, ORANGE, 0.08)];
        SceneEntity { lines, ..entity(list.stamp, &format!("track {}", track.id.0)) }
    };
    anew(list.stamp, list.tracks.iter().map(of).collect())
}

/// Predictions of the stack, with the ellipse of one standard deviation at the end of each.
pub(crate) fn predictions(list: &PredictionList) -> SceneUpdate {
    let of = |(k, prediction): (usize, &swerve_msg::Prediction)| {
        let path = prediction.path.iter().map(|p| [p.pose.x_m, p.pose.y_m, OVER_M]).map(point).collect();
        let color = Some(colour_of(prediction.kind, 160));
        let line = |points, thickness| LinePrimitive { color, ..strip(points, GREY, thickness) };
        let end = prediction.path.last().zip(prediction.covariances_m2.last());
        let ellipse = end.map(|(end, covariance_m2)| line(ellipse(end.pose, *covariance_m2), 0.05));
        let id = format!("prediction {} of {}", k, prediction.id.0);
        let lines = core::iter::once(line(path, 0.15)).chain(ellipse).collect();
        SceneEntity { lines, ..entity(list.stamp, &id) }
    };
    anew(list.stamp, list.predictions.iter().enumerate().map(of).collect())
}

/// Ellipse of one standard deviation around a position.
fn ellipse(at: Pose2, [xx, xy, yy]: [f64; 3]) -> Vec<Point3> {
    let x_m = xx.max(f64::MIN_POSITIVE).sqrt();
    let (along_m, beside_m) = (xy / x_m, (yy - xy * xy / (x_m * x_m)).max(0.0).sqrt());
    let on = |k: i32| {
        let (sin, cos) = math::sin_cos(f64::from(k) * core::f64::consts::TAU / 24.0);
        point([at.x_m + x_m * cos, at.y_m + along_m * cos + beside_m * sin, OVER_M])
    };
    (0..=24).map(on).collect()
}

/// Plan of the stack; orange for a fallback.
pub(crate) fn plan(plan: &Plan) -> SceneUpdate {
    let path = plan.points.iter().map(|p| [p.pose.x_m, p.pose.y_m, 2.0 * OVER_M]).map(point).collect();
    let line = strip(path, if plan.status.is_fallback() { ORANGE } else { GREEN }, 0.3);
    anew(plan.stamp, vec![SceneEntity { lines: vec![line], ..entity(plan.stamp, "plan") }])
}

/// Detected parts of the lane lines.
pub(crate) fn lanes(lanes: &Lanes) -> SceneUpdate {
    let line = |line: swerve_msg::LaneLine| {
        strip(line.places().map(|[x, y]| point([x, y, 2.0 * OVER_M])).collect(), CYAN, 0.15)
    };
    let lines = [lanes.left, lanes.right].into_iter().flatten().map(line).collect();
    let seen =
        SceneEntity { frame_id: EGO.into(), frame_locked: false, lines, ..entity(lanes.stamp, "lanes") };
    anew(lanes.stamp, vec![seen])
}

/// Scene update that replaces everything on the topic.
pub(crate) fn anew(at: Time, entities: Vec<SceneEntity>) -> SceneUpdate {
    let all = SceneEntityDeletion {
        timestamp: Some(timestamp(at)),
        r#type: Deletion::All as i32,
        id: String::new(),
    };
    SceneUpdate { deletions: vec![all], entities }
}

pub(crate) fn entity(at: Time, id: &str) -> SceneEntity {
    SceneEntity {
        timestamp: Some(timestamp(at)),
        frame_id: MAP.into(),
        id: id.into(),
        frame_locked: true,
        ..SceneEntity::default()
    }
}

/// A box with its lower face at height `bottom_m`.
pub(crate) fn cube(pose: Pose2, bottom_m: f64, extent: Extent, color: Color) -> CubePrimitive {
    CubePrimitive {
        pose: Some(upright(pose, bottom_m + 0.5 * extent.height_m)),
        size: Some(vector([extent.length_m, extent.width_m, extent.height_m])),
        color: Some(color),
    }
}

pub(crate) fn text(pose: Pose2, z_m: f64, words: String) -> TextPrimitive {
    TextPrimitive {
        pose: Some(upright(pose, z_m)),
        billboard: true,
        font_size: 0.5,
        scale_invariant: false,
        color: Some(colour(WHITE)),
        text: words,
    }
}

pub(crate) fn strip(points: Vec<Point3>, color: [u8; 4], thickness: f64) -> LinePrimitive {
    let identity = Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 };
    LinePrimitive {
        r#type: LineType::LineStrip as i32,
        pose: Some(Pose { position: Some(vector([0.0; 3])), orientation: Some(identity) }),
        thickness,
        scale_invariant: false,
        points,
        color: Some(colour(color)),
        colors: Vec::new(),
        indices: Vec::new(),
    }
}

/// Edges of a box on the map plane, as pairs of points.
fn edges(pose: Pose2, extent: Extent) -> Vec<Point3> {
    box_edges(pose, extent).into_iter().flatten().map(point).collect()
}

/// The twelve edges of a box on the map plane, metres.
pub(crate) fn box_edges(pose: Pose2, extent: Extent) -> [[[f64; 3]; 2]; 12] {
    let corners = extent.footprint(pose).corners();
    let at = |k: usize, z_m: f64| [corners[k % 4].x_m, corners[k % 4].y_m, z_m];
    let top_m = extent.height_m;
    core::array::from_fn(|k| match k {
        0..4 => [at(k, 0.0), at(k + 1, 0.0)],
        4..8 => [at(k, top_m), at(k + 1, top_m)],
        _ => [at(k, 0.0), at(k, top_m)],
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use swerve_core::Span;
    use swerve_geom::{Point2, Polyline, Vector2};
    use swerve_map::{Borders, Lane, LaneId, LaneMarks, Mark, MarkKind};
    use swerve_msg::{ActorId, ActorKind, Route};
    use swerve_vehicle::VehicleParams;

    use super::*;

    #[test]
    fn static_scene_has_the_lanes_of_the_map_beside_the_road() {
        let line = |y_m: f64| Polyline::new(&[Point2::new(0.0, y_m), Point2::new(30.0, y_m)]).unwrap();
        let lane = |id, y_m| Lane::new(LaneId(id), line(y_m), Borders::constant(2.0, 2.0));
        let broken = LaneMarks::new(vec![Mark::new(0.0, MarkKind::Broken)], vec![]).unwrap();
        let near = Lane { marks: broken, ..lane(1, 0.0) };
        let setup = |map| Setup {
            route: Route::uniform(line(0.0), 2.0, 2.0),
            lines_m: Vec::new(),
            map,
            shape: VehicleParams::default().shape,
            dead_time: Span::ZERO,
            mounts: Vec::new(),
            images: None,
            raw_images: false,
            detectors: Vec::new(),
            actors: Default::default(),
            tracks: Default::default(),
            ego_from_pose: false,
        };
        let shown = |map| ground(Time::ZERO, &setup(map)).entities;
        let ids = |entities: &[SceneEntity]| entities.iter().map(|e| e.id.clone()).collect::<Vec<_>>();
        assert_eq!(ids(&shown(None)), ["road", "ego"]);
        let entities = shown(Some(Arc::new(swerve_map::Map::new(vec![near, lane(2, 20.0)]).unwrap())));
        assert_eq!(ids(&entities), ["map", "road", "ego"]);
        let [painted, plain] = &entities[0].lines[..] else { panic!("{:?}", entities[0].lines) };
        // Four strokes of the broken line, and three borders without marks, each from its begin to its end.
        let ends = |line: &LinePrimitive| line.points.iter().map(|p| (p.x, p.y)).collect::<Vec<_>>();
        let strokes = [0.0, 3.0, 9.0, 12.0, 18.0, 21.0, 27.0, 30.0].map(|x| (x, 2.0));
        assert_eq!(ends(painted), strokes);
        assert_eq!(ends(plain), [-2.0, 22.0, 18.0].map(|y| [(0.0, y), (30.0, y)]).as_flattened());
        assert!([painted, plain].iter().all(|line| line.r#type == LineType::LineList as i32));
    }

    #[test]
    fn actors_are_named_as_in_the_scenario_or_by_kind_and_number() {
        let actor = |id, kind| Actor {
            id: ActorId(id),
            kind,
            pose: Pose2::default(),
            z_m: 0.0,
            extent: Extent::default(),
            velocity_mps: Vector2::new(0.0, 0.0),
        };
        let others = [actor(1, ActorKind::Truck), actor(2, ActorKind::Pedestrian)];
        let shown = actors(Time::ZERO, &others, &[(ActorId(1), "parked truck".to_owned())].into());
        let words: Vec<&str> = shown.entities.iter().map(|entity| entity.texts[0].text.as_str()).collect();
        assert_eq!(words, ["parked truck", "pedestrian 2"]);
    }
}
