//! Lane maps as scenes: asphalt, marks, pavements, islands, crossings, grass, and what is beside the road.
//!
//! [`map_pieces`] is the ground. [`add_map`] adds it to a scene with all that is static: signs at stop lines, guard
//! rails, street lamps, trees and houses, which are drawn from a seed and keep clear of all lanes. Traffic lights switch,
//! so that the caller places them: [`signal_masts`] lists their poses. [`MapGround`] has the height of the ground.
//!
//! **Heights.** Lanes for vehicles are at 0, pavements and islands at 0.12 m, paint 6 mm above the lanes, grass 6 cm
//! below.
//!
//! **Overlaps.** Lanes cross and overlap inside junctions. All asphalt has one material, one height and a pattern that is
//! fixed to the map, so that overlaps look like one surface. Pavements are left out where a lane for vehicles is. Marks of
//! lanes inside junctions are not painted. Gaps between lanes are paved, and so are the corners of junctions between roads
//! with pavements, for pedestrians.
//!
//! **Tiles.** Ground is divided into square tiles, and each tile is drawn or culled as a whole.

mod area;
mod corner;
mod ground;
mod marks;
mod pavement;
mod roadside;
mod scenery;
mod side;
mod station;
mod surface;
mod tiles;

use swerve_geom::Point2;
use swerve_map::Map;

pub use ground::MapGround;
pub use roadside::{SignalMast, signal_masts};

use crate::library::{RoadPiece, ground_pieces};
use crate::paving::GRASS_M;
use crate::scene::Scene;
use side::is_road;
use station::Strip;
use tiles::Tiles;

/// Grass beyond the lanes, metres.
const HORIZON_M: f64 = 440.0;

/// Adds a map to a scene with all that is static on it and beside it. The seed varies houses, trees and their places.
pub fn add_map(scene: &mut Scene, map: &Map, seed: u64) {
    for piece in map_pieces(map) {
        scene.add_piece(piece);
    }
    scenery::add(scene, map, seed);
}

/// The ground of a map: surfaces, marks, pavements, islands, crossings, and grass around them.
pub fn map_pieces(map: &Map) -> Vec<RoadPiece> {
    let ground = MapGround::new(map);
    let strips: Vec<Strip<'_>> = map.lanes().iter().map(Strip::new).collect();
    let mut tiles = Tiles::default();
    for strip in &strips {
        if is_road(strip.lane.kind) {
            surface::lane(&mut tiles, &ground, strip);
        } else {
            pavement::lane(&mut tiles, &ground, strip);
        }
        marks::borders(&mut tiles, &ground, strip);
    }
    for lane in ground.corners.lanes() {
        pavement::lane(&mut tiles, &ground, &Strip::new(lane));
    }
    map.junctions().iter().for_each(|junction| surface::holes(&mut tiles, &ground, junction));
    map.areas().iter().for_each(|one| area::area(&mut tiles, &ground, one));
    marks::stop_lines(&mut tiles, map);
    map.crossings().iter().for_each(|crossing| marks::crossing(&mut tiles, &ground, crossing));
    let mut pieces = tiles.pieces();
    pieces.extend(grass(map));
    pieces
}

fn grass(map: &Map) -> Vec<RoadPiece> {
    let points = map.lanes().iter().flat_map(|lane| lane.line.points());
    let bounds = points.fold(None, |bounds: Option<[Point2; 2]>, p| {
        let [low, high] = bounds.unwrap_or([*p, *p]);
        let low = Point2::new(low.x_m.min(p.x_m), low.y_m.min(p.y_m));
        Some([low, Point2::new(high.x_m.max(p.x_m), high.y_m.max(p.y_m))])
    });
    let Some([low, high]) = bounds else { return Vec::new() };
    let moved = |p: Point2, by_m: f64| Point2::new(p.x_m + by_m, p.y_m + by_m);
    ground_pieces(moved(low, -HORIZON_M), moved(high, HORIZON_M), GRASS_M)
}

#[cfg(test)]
mod tests;
