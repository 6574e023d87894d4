//! Scenarios: parses the text form (TOML) to a checked [`Scenario`], or reports every problem of the file at once.
//!
//! A scenario has a road, the start and goal of the ego, the other actors with their triggers and motions, and the
//! expected result of the run. Positions are given along the road: `s` metres from its start, `d` metres to the left
//! of the centre line of the ego's lane. **All vehicle positions, including the ego's, refer to the centre of the
//! outline.** [`Scenario::drawn`] is the only function that applies the variations of a seed.
//!
//! **Text form**, with all keys (`?`: optional; lengths in metres, angles in radians):
//!
//! ```toml
//! name = "person_crossing"
//! description = "for people"                          # ?
//! seeded = true                                       # ? false: a seed varies sensors only
//! reactive = "off"                                    # ? "idm": recorded vehicles brake along their path, see `track`
//!
//! [road]                                              # from the map's origin along +x
//! segments = [{ length_m = 100.0, curvature_1pm = 0.0 }]  # curvature ?, positive turns left
//! lane_width_m = 4.0                                  # ?
//! left_m = 6.0                                        # ? drivable to the left of the lane's centre: half the lane
//! right_m = 2.0                                       # ? to the right: half the lane
//! friction = 0.9                                      # ?
//!
//! [[road.light]]                                      # ? traffic lights for the ego's lane
//! name = "crossing"
//! stop_s_m = 38.0                                     # the stop line
//! s_m = 40.0                                          # ? position of the mast: 2 m behind the stop line
//! d_m = -3.0                                          # ? 1 m to the right of the drivable ground
//! green_s = 12.0                                      # green, then yellow, then red, and again
//! yellow_s = 3.0                                      # ?
//! red_s = 10.0
//! offset_s = 8.0                                      # ? 0; time into the cycle at the start of the run
//!
//! [[slippery]]                                        # ? patches of the ground with a friction of their own, at most 200
//! name = "ice"
//! friction = 0.2                                      # under the wheels that are on it
//! s_m = 60.0                                          # its begin
//! length_m = 15.0
//! d_m = 0.0                                           # ? 0; its middle
//! width_m = 4.0                                       # ? the lane's
//!
//! [ego]
//! s_m = 0.0                                           # ?
//! d_m = 0.0                                           # ?
//! heading_rad = 0.0                                   # ? relative to the road
//! target_speed_mps = 12.0
//! start_speed_mps = 12.0                              # ? the target speed
//! end_m = 90.0                                        # the goal along the road
//!
//! [[actor]]
//! name = "person"
//! kind = "pedestrian"                                 # car, truck, motorcycle, cyclist, pedestrian, static
//! size = { radius_m = 0.25, height_m = 1.8 }          # ? others: length_m, width_m, height_m
//! mass_kg = 75.0                                      # ?
//! s_m = 42.0
//! d_m = 5.0
//! heading_rad = 0.0                                   # ?
//! trigger = { distance = { to = "ego", within_m = 30.0 } }  # ? at the start; or one of
//! #         { time = { at_s = 2.0 } }
//! #         { reaches = { who = "ego", s_m = 20.0 } }
//! motion = [                                          # ? legs, one after the other
//!   { wait = { for_s = 1.0 } },
//!   { walk = { speed_mps = 3.5, distance_m = 5.5, direction = "right" } },    # left, right, ahead, back
//!   { path = { speed_mps = 2.0, points = [[44.0, 1.0], [48.0, 1.0]] } },      # places [s, d]
//!   { drive = { along = "road", speeds = [[0.0, 0.0], [3.0, 6.0]] } },        # or "heading"; or speed_mps = ...;
//! ]                                                                           # distance_m ?
//! vary = { s_m = 0.5, d_m = 0.3, heading_rad = 0.1, speed_share = 0.1 }      # ? half ranges of the seed's changes
//!
//! [end]                                               # ?
//! timeout_s = 30.0                                    # ?
//! after_collision_s = 2.0                             # ?
//! standstill = { near = "person", within_m = 25.0, for_s = 2.0 }  # ? ends the run; near and within_m ?
//!
//! [expect]                                            # ?
//! verdict = "avoided"                                 # avoided, completed, collision, left_road, stopped, timeout
//! min_distance_m = { min = 0.3 }                      # ? bounds of the metrics in `Metric`
//! [expect.pipeline.slow]                              # ? for a pipeline of that name
//! verdict = "collision"
//! impact_speed_mps = { min = 2.0, max = 9.0 }
//! ```
//!
//! **On a map**, tables `map`, `ego`, `actor` and `slippery` have these keys in place of `road`, `s_m` and `end_m`:
//!
//! ```toml
//! [map]                                               # in place of [road]
//! file = "crossing.xodr"                              # OpenDRIVE, Lanelet2, CommonRoad or SUMO; from this file's folder
//! friction = 0.9                                      # ?
//! all_lights = false                                  # ?; true: signals without phases are lights that are off
//!
//! [[map.light]]                                       # ? phases of signals of the map, in place of the file's
//! controller = "north_south"                          # or signals = ["light_north", "light_south"]
//! green_s = 12.0                                      # and yellow_s and offset_s, as for lights of a road
//! red_s = 10.0
//!
//! [[map.closure]]                                     # ? a place on a lane that is closed to traffic; the cause is an actor
//! at = { road = "4", lane = -1, s_m = 90.0 }
//! reported_s = 5.0                                    # ? 0; time from which it is reported
//!
//! [ego]
//! start = { road = "4", lane = -1, s_m = 20.0 }       # or { lane = "name", s_m = 20.0 } or { x_m = 5.0, y_m = -1.8 }
//! via = [{ x_m = 1.7, y_m = 0.0, heading_rad = 1.57 }]       # ?
//! goal = { road = "2", lane = 1, s_m = 50.0 }
//! target_speed_mps = 13.0                             # ? the highest speed limit on the way
//!
//! [[actor]]
//! name = "car"
//! kind = "car"
//! start = { road = "1", lane = -1, s_m = 30.0 }       # ? in place of s_m, which is along the ego's route
//! goal = { road = "3", lane = 1, s_m = 30.0 }         # ? and via; without it, along lanes that turn least
//!
//! [[actor]]
//! name = "recorded"
//! kind = "car"
//! track = { from_s = 0.5, step_s = 0.1, at = [[5.0, 1.0], [6.0, 1.0]], heading_rad = [0.0, 0.0] }  # in place of start and
//! #                                                     motion; absent before and after
//!
//! [[slippery]]                                        # ? with start, goal and via as an actor, else along the ego's route
//! name = "ice"
//! start = { road = "1", lane = -1, s_m = 30.0 }
//! friction = 0.2
//! length_m = 15.0
//!
//! [traffic]                                           # ? road users that drive and walk by themselves, at most 2,000
//! vehicles = 60                                       # ? 0
//! pedestrians = 40                                    # ? 0
//! cyclists = 5                                        # ? 0
//! ```
//!
//! **Another simulator**: in place of `[traffic]`, vehicles of SUMO are the other road users. See `docs/sumo.md`.
//!
//! ```toml
//! [world]
//! sumo = "town.sumocfg"
//! begin_s = 25200.0                                   # ? that of the configuration, as are step_s and the offset
//! warmup_s = 300.0                                    # ? 60
//! step_s = 0.1                                        # ?
//! range_m = 150.0                                     # ? 150
//! timeout_s = 60.0                                    # ? 60
//! offset_x_m = 0.0                                    # ?
//! offset_y_m = 0.0                                    # ?
//! ```
//!
//! **Several egos**, each with a stack of its own, have a table each in place of `[ego]`. The first is the one that triggers
//! name "ego", and along whose way places of actors are given:
//!
//! ```toml
//! [ego.first]
//! target_speed_mps = 12.0                             # and the other keys of an ego
//! end_m = 90.0
//! [ego.second]
//! s_m = -20.0
//! target_speed_mps = 12.0
//! end_m = 90.0
//! ```
//!
//! Excluded: physics, clocks; the only files that are opened are the one passed to [`Scenario::read`] and the map that it
//! names.

mod check;
mod draw;
mod expect;
mod lines;
mod map_text;
mod model;
mod parse;
mod road;
mod set;
mod slippery;
mod sumo_world;
mod vary;

pub use draw::sensor_phase;
pub use expect::{Bound, Expectation, Metric};
pub use lines::RoadLines;
pub use map_text::MapText;
pub use model::{
    Actor, Along, Direction, Draws, EgoStart, End, Motion, OtherEgo, RoadPlace, Scenario, SpeedPoint,
    Standstill, Subject, Track, Traffic, Trigger,
};
pub use road::{Closure, Course, KERB_M, MapCourse, PAVEMENT_M, Road, Segment, Strip, TrafficLight};
pub use set::{is_scenario_key, split_sets};
pub use slippery::Slippery;
pub use sumo_world::SumoWorld;
pub use swerve_map::{Aspect, SignalPhase, SignalProgram};
pub use swerve_msg::truth::Verdict;
pub use vary::Vary;
