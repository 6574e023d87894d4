//! Maps of any format, with the names of their files.

use std::collections::BTreeMap;
use std::sync::Arc;

use swerve_geom::Point2;
use swerve_map::router::Stop;
use swerve_map::{LaneHint, LaneId, LaneIndex, LaneKind, Map};

use crate::commonroad::{self, Centers};
use crate::format::Format;
use crate::import::{LaneSource, import};
use crate::lane_map::LaneMap;
use crate::links::Links;
use crate::opendrive::Network;
use crate::slope::{Profile, Slopes};
use crate::{lanelet2, route, sumo};

/// A map read from a file of any format.
#[derive(Clone, Debug)]
pub struct MapFile {
    /// The map.
    pub map: Arc<Map>,
    /// True where traffic keeps to the left, if only on some roads.
    pub left_hand: bool,
    /// Of a network of SUMO, the offset of its coordinates: a place of the map is a place of the file less this, metres.
    pub net_offset_m: Option<[f64; 2]>,
    names: Names,
}

/// Names of lanes in the file.
#[derive(Clone, Debug)]
enum Names {
    /// Roads, lane sections and lanes of OpenDRIVE.
    Roads(Box<Network>, Vec<LaneSource>),
    /// Names of lanes, and the slopes of those that are not level.
    Lanes(BTreeMap<LaneId, String>, BTreeMap<LaneId, Profile>),
}

impl MapFile {
    /// Reads the text of a file, whose name decides its format if its root element does not. A network of SUMO that is far
    /// from the origin is moved towards it (`sumo::read_near`).
    ///
    /// # Errors
    /// A message of one or more lines: an unknown format, or all faults of the file.
    pub fn read(file: &str, text: &str) -> Result<Self, String> {
        let mut net_offset_m = None;
        let lanes = match Format::of(file, text).map_err(|message| format!("{file}: {message}"))? {
            Format::OpenDrive => return Self::of_network(file, text),
            Format::CommonRoad => commonroad::read(file, text, Centers::Rounded).map(|read| read.lanes),
            Format::Lanelet2 => lanelet2::read(file, text).map(|read| read.lanes),
            Format::Sumo => sumo::read_near(file, text).map(|read| {
                net_offset_m = Some(read.net_offset_m);
                read.lanes
            }),
        };
        let LaneMap { left_hand, map, names, profiles, .. } =
            lanes.map_err(|problems| problems.to_string())?;
        Ok(Self { map: Arc::new(map), left_hand, net_offset_m, names: Names::Lanes(names, profiles) })
    }

    fn of_network(file: &str, text: &str) -> Result<Self, String> {
        let network = Network::read(file, text).map_err(|problems| problems.to_string())?;
        let imported = import(&network, &Links::of(&network)).map_err(|error| format!("{file}: {error}"))?;
        let left_hand = network.roads.iter().any(|road| road.left_hand);
        let names = Names::Roads(Box::new(network), imported.lanes);
        Ok(Self { map: Arc::new(imported.map), left_hand, net_offset_m: None, names })
    }

    /// True if its lanes are named by road, lane and arc length along the road (OpenDRIVE); else they have a name each.
    pub fn has_roads(&self) -> bool {
        matches!(self.names, Names::Roads(..))
    }

    /// Name of a lane: `road:section:lane` for OpenDRIVE.
    pub fn name(&self, lane: LaneId) -> String {
        match &self.names {
            Names::Roads(network, lanes) => {
                let name = |source: &LaneSource| route::source_name(network, *source);
                lanes.get(lane.0 as usize).map_or_else(String::new, name)
            }
            Names::Lanes(names, _) => names.get(&lane).cloned().unwrap_or_default(),
        }
    }

    /// Place on a driving lane at `s_m` metres along a road of OpenDRIVE.
    ///
    /// # Errors
    /// If the file has no such road, the road no such lane there, or the lane is of another kind.
    pub fn on_road(&self, road: &str, lane: i32, s_m: f64) -> Result<Stop, String> {
        match &self.names {
            Names::Roads(network, lanes) => {
                route::stop_on_road(network, (&self.map, lanes), (road, lane, s_m))
            }
            Names::Lanes(..) => Err("the map has no roads: expected the name of a lane".to_owned()),
        }
    }

    /// Place on a driving lane at `s_m` metres along it.
    ///
    /// # Errors
    /// If the file has no such lane, it is of another kind, or shorter.
    pub fn on_lane(&self, name: &str, s_m: f64) -> Result<Stop, String> {
        match &self.names {
            Names::Lanes(names, _) => route::stop_on_named(&self.map, names, name, s_m),
            Names::Roads(..) => {
                Err("lanes of OpenDRIVE have no names: expected road, lane and s_m".to_owned())
            }
        }
    }

    /// Largest slopes of parts of lanes, each between two arc lengths. Lanes without heights have none, and those of SUMO
    /// have no bank.
    pub fn slopes(&self, parts: impl IntoIterator<Item = (LaneId, [f64; 2])>) -> Slopes {
        let mut slopes = Slopes::default();
        for (id, part_m) in parts {
            let Some(lane) = self.map.lane(id) else { continue };
            let length_m = lane.line.length();
            let shares = part_m.map(|s_m| (s_m / length_m).clamp(0.0, 1.0));
            match &self.names {
                Names::Roads(network, lanes) => {
                    let source = lanes.get(id.0 as usize);
                    source.into_iter().for_each(|source| slopes.add(network, source, shares));
                }
                Names::Lanes(names, profiles) => {
                    if let (Some(name), Some(profile)) = (names.get(&id), profiles.get(&id)) {
                        slopes.add_profile(profile, (name, length_m), shares);
                    }
                }
            }
        }
        slopes
    }

    /// Place on the driving lane that is nearest to a point; of several lanes there, on the one whose direction differs
    /// least from `heading_rad`.
    ///
    /// # Errors
    /// If the map has no driving lane.
    pub fn near(&self, point: Point2, heading_rad: Option<f64>) -> Result<Stop, String> {
        let off_rad = |stop: &Stop| {
            let lane = self.map.lane(stop.lane).map(|lane| lane.line.at(stop.s_m).pose.heading_rad);
            heading_rad.zip(lane).map_or(0.0, |(a, b)| swerve_geom::angle_between(a, b).abs())
        };
        let places = self.map.at(point).filter(|place| {
            heading_rad.is_some()
                && self.map.lane(place.lane).is_some_and(|lane| lane.kind == LaneKind::Driving)
        });
        let stops = places.map(|place| Stop { lane: place.lane, s_m: place.place.s_m });
        if let Some(stop) = stops.min_by(|a, b| off_rad(a).total_cmp(&off_rad(b)).then(a.lane.cmp(&b.lane))) {
            return Ok(stop);
        }
        let index = LaneIndex::of(&self.map, |lane| lane.kind == LaneKind::Driving);
        let found = index.nearest_from(point, &mut LaneHint::default());
        let found = found.ok_or("the map has no driving lanes")?;
        Ok(route::on_lane(&self.map, found.lane, found.place.s_m))
    }
}
