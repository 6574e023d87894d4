//! Objects beside the road: signs, guard rails, street lamps, trees, houses.

use std::collections::BTreeMap;

use swerve_geom::{Obb, Point, Point2, Pose2, Transform};
use swerve_map::{Lane, LaneKind, Map, Mark, MarkKind, Side, StopSign};

use super::ground::MapGround;
use super::roadside::signs;
use super::side::{neighbour, outwards, sign, spans};
use super::station::Station;
use crate::hash::{Draws, mix};
use crate::library::{Kind, MeshLibrary, Model, Size};
use crate::scene::{Instance, Light, Scene};

/// Roads with a higher speed limit have no houses and lamps, m/s.
const TOWN_MPS: f64 = 20.0;
/// Nor have roads with a shoulder that is wider, metres: motorways.
const HARD_SHOULDER_M: f64 = 1.5;
/// Distance of houses from the road, metres.
const SETBACK_M: f64 = 3.0;
/// Reach of balconies and awnings beyond the walls of a house, metres.
const BALCONY_M: f64 = 1.0;
/// Distance of all objects from lanes, metres.
const CLEAR_M: f64 = 0.2;
/// Distance of street lamps along the road, metres.
const LAMPS_M: f64 = 28.0;
/// Distance of the head of a street lamp from its pole, and its height, metres.
const LAMP_HEAD_M: [f64; 2] = [1.8, 7.2];
/// Length of a piece of guard rail, metres.
const RAIL_M: f64 = 4.0;
/// Shapes of each kind; colours vary more.
const SHAPES: usize = 24;
/// Side of a cell in which objects are compared, metres: at least their largest extent.
const CELL_M: f64 = 32.0;
/// Largest coordinates of an object, metres; of a wrong map, they may be anywhere.
const REACH_MAX_M: f64 = 9e6;
const QUARTER: f64 = core::f64::consts::FRAC_PI_2;

/// Adds all objects to a scene.
pub(super) fn add(scene: &mut Scene, map: &Map, seed: u64) {
    let ground = MapGround::new(map);
    let mut draws = Draws::new(seed, 0x3a9);
    let houses = (0..SHAPES).map(|_| house(&mut scene.meshes, &mut draws)).collect();
    let mut plants =
        |kind| (0..SHAPES / 2).map(|_| scene.meshes.model(kind, u64::from(draws.bits()))).collect();
    let (trees, bushes) = (plants(Kind::Tree), plants(Kind::Bush));
    let mut rows = Rows { ground, scene, taken: Taken::default(), houses, trees, bushes };
    rows.signs();
    for lane in map.lanes() {
        rows.rails(lane);
        let is_inside = rows.ground.is_inside(lane.id);
        for (k, side) in (0..).zip([Side::Left, Side::Right]) {
            if !is_inside && neighbour(lane, side).is_none() {
                let purpose = mix(lane.id.0.wrapping_mul(2).wrapping_add(k));
                rows.beside(&Row { lane, side }, &mut Draws::new(seed, purpose));
            }
        }
    }
}

fn house(meshes: &mut MeshLibrary, draws: &mut Draws) -> Model {
    let mut between = |low, high| f64::from(draws.between(low, high));
    let size = Size::from_m(between(11.0, 20.0), between(9.0, 12.0), between(6.5, 15.0));
    meshes.model_sized(Kind::Building, size, u64::from(draws.bits()))
}

/// A border with nothing beyond.
struct Row<'m> {
    lane: &'m Lane,
    side: Side,
}

impl Row<'_> {
    /// Pose beyond the border, facing the road.
    fn pose(&self, s_m: f64, out_m: f64) -> Pose2 {
        let station = Station::new(self.lane, s_m);
        let at = station.at(station.border_m(self.side) + sign(self.side) * out_m);
        let heading_rad = self.lane.line.at(s_m).pose.heading_rad;
        Pose2::new(at.x_m, at.y_m, heading_rad - sign(self.side) * QUARTER)
    }
}

/// Ground that objects cover, by cell.
#[derive(Default)]
struct Taken(BTreeMap<[i64; 2], Vec<Obb>>);

impl Taken {
    fn cell(at: Point2) -> [i64; 2] {
        [at.x_m, at.y_m].map(|m| (m.clamp(-REACH_MAX_M, REACH_MAX_M) / CELL_M).floor() as i64)
    }

    fn is_free(&self, ground: &Obb) -> bool {
        let [column, row] = Self::cell(ground.center.point());
        let cells = (column - 1..=column + 1).flat_map(|x| (row - 1..=row + 1).map(move |y| [x, y]));
        let near = cells.filter_map(|cell| self.0.get(&cell)).flatten();
        near.into_iter().all(|other| !other.overlaps(ground))
    }

    fn add(&mut self, ground: Obb) {
        self.0.entry(Self::cell(ground.center.point())).or_default().push(ground);
    }
}

/// Objects of a scene beside the roads of a map.
struct Rows<'s, 'm> {
    ground: MapGround<'m>,
    scene: &'s mut Scene,
    taken: Taken,
    houses: Vec<Model>,
    trees: Vec<Model>,
    bushes: Vec<Model>,
}

impl Rows<'_, '_> {
    /// Adds an object if the ground that it covers is clear of lanes and other objects.
    fn try_add(&mut self, model: &Model, pose: Pose2, [length_m, width_m]: [f64; 2]) -> bool {
        let covered = Obb::new(pose, length_m, width_m);
        let is_clear = outline(&covered).all(|point| self.ground.is_clear(point, CLEAR_M));
        let is_added = is_clear && self.taken.is_free(&covered) && self.add(model, pose);
        if is_added {
            self.taken.add(covered);
        }
        is_added
    }

    /// Adds an object; false if it is too far away.
    fn add(&mut self, model: &Model, pose: Pose2) -> bool {
        let is_near = [pose.x_m, pose.y_m].into_iter().all(|m| m.abs() < REACH_MAX_M);
        if is_near {
            let at = Point::new(pose.x_m, pose.y_m, self.ground.height_m(pose.point()));
            let placed = Transform::from_roll_pitch_yaw(at, 0.0, 0.0, pose.heading_rad);
            self.scene.add_static(Instance::placed(model, placed));
        }
        is_near
    }

    fn signs(&mut self) {
        for (sign, pose) in signs(&self.ground) {
            let kind = match sign {
                StopSign::Stop => Kind::StopSign,
                StopSign::Yield => Kind::YieldSign,
            };
            let model = self.scene.meshes.model(kind, 1);
            self.taken.add(Obb::new(pose, 1.0, 1.0));
            self.add(&model, pose);
        }
    }

    /// Guard rails along the borders that have one.
    fn rails(&mut self, lane: &Lane) {
        for side in [Side::Left, Side::Right] {
            let is_own = self.ground.has_marks(lane, side);
            let is_rail = |(mark, _): &(&Mark, [f64; 2])| is_own && mark.kind == MarkKind::Barrier;
            for (_, [from_m, to_m]) in spans(lane, side).filter(is_rail) {
                let pieces = ((to_m - from_m) / RAIL_M).round().max(1.0);
                let length_m = (to_m - from_m) / pieces;
                let model =
                    self.scene.meshes.model_sized(Kind::GuardRail, Size::from_m(length_m, 0.3, 0.75), 1);
                for piece in 0..pieces as u32 {
                    let pose = Row { lane, side }.pose(from_m + length_m * (f64::from(piece) + 0.5), 0.15);
                    // Its face is to the right of its direction.
                    self.add(&model, Pose2::new(pose.x_m, pose.y_m, pose.heading_rad + QUARTER));
                }
            }
        }
    }

    fn beside(&mut self, row: &Row<'_>, draws: &mut Draws) {
        if is_in_town(&self.ground, row.lane) {
            self.lamps(row);
            self.plants(row, [0.8, 1.8], draws);
            self.houses(row, draws);
        } else {
            self.plants(row, [4.0, 8.0], draws);
        }
    }

    fn lamps(&mut self, row: &Row<'_>) {
        let model = self.scene.meshes.model(Kind::StreetLamp, 1);
        // The lamps of both sides alternate.
        let mut s_m = if row.side == Side::Left { 3.0 } else { 3.0 + 0.5 * LAMPS_M };
        while s_m < row.lane.line.length() {
            let pose = row.pose(s_m, 0.5);
            if self.try_add(&model, pose, [0.3, 0.3]) {
                let head = pose.ahead(LAMP_HEAD_M[0]);
                self.scene.lights.push(Light::street_lamp([head.x_m, head.y_m, LAMP_HEAD_M[1]]));
            }
            s_m += LAMPS_M;
        }
    }

    fn plants(&mut self, row: &Row<'_>, [near_m, far_m]: [f32; 2], draws: &mut Draws) {
        let mut s_m = f64::from(draws.between(0.0, 9.0));
        while s_m < row.lane.line.length() {
            let models = if draws.chance(0.7) { &self.trees } else { &self.bushes };
            let shape = models[draws.below(models.len())];
            let model = Model { look: models[draws.below(models.len())].look, ..shape };
            let out_m = f64::from(draws.between(near_m, far_m));
            let turn_rad = f64::from(draws.between(0.0, 6.0));
            let pose = row.pose(s_m, out_m);
            self.try_add(&model, Pose2::new(pose.x_m, pose.y_m, turn_rad), [0.8, 0.8]);
            s_m += f64::from(draws.between(12.0, 28.0));
        }
    }

    fn houses(&mut self, row: &Row<'_>, draws: &mut Draws) {
        let mut s_m = f64::from(draws.between(0.0, 3.0));
        while s_m < row.lane.line.length() {
            let shape = self.houses[draws.below(self.houses.len())];
            let model = Model { look: self.houses[draws.below(self.houses.len())].look, ..shape };
            let [length_m, depth_m, _] = model.size.metres().map(f64::from);
            let out_m = SETBACK_M + 0.5 * depth_m + f64::from(draws.between(0.0, 2.0));
            let pose = row.pose((s_m + 0.5 * length_m).min(row.lane.line.length()), out_m);
            // The front is to the right of its direction.
            let pose = Pose2::new(pose.x_m, pose.y_m, pose.heading_rad + QUARTER);
            self.try_add(&model, pose, [length_m, depth_m].map(|m| m + 2.0 * BALCONY_M));
            s_m += length_m + f64::from(draws.between(1.0, 7.0));
        }
    }
}

/// False for roads with a high speed limit or a hard shoulder.
fn is_in_town(ground: &MapGround<'_>, lane: &Lane) -> bool {
    let is_slow = lane.speed_limit_mps.is_none_or(|limit_mps| limit_mps <= TOWN_MPS);
    let is_soft = |lane: &Lane| lane.kind != LaneKind::Shoulder || lane.width_m(0.0) <= HARD_SHOULDER_M;
    let beside = |side| outwards(ground.map, lane, side).all(|(other, _)| is_soft(other));
    is_slow && is_soft(lane) && beside(Side::Left) && beside(Side::Right)
}

/// Points of a rectangle's edges, at most 2 m apart, and its middle.
fn outline(rectangle: &Obb) -> impl Iterator<Item = Point2> {
    let corners = rectangle.corners();
    let edges = (0..4).flat_map(move |k| {
        let (from, to) = (corners[k], corners[(k + 1) % 4]);
        let steps = (0.5 * from.distance(to)).ceil().max(1.0) as u32;
        (0..steps).map(move |step| from + (to - from) * (f64::from(step) / f64::from(steps)))
    });
    edges.chain([rectangle.center.point()])
}
