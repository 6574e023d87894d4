//! Lanelet maps of CommonRoad: a crossing in Los Angeles with lights, T-junctions, streets of a small town, two lanes that
//! become one.

use super::*;

const TOWN: &str = "worlds/commonroad/factory/PRI_Barceloneta-1_5_T-1.xml.gz";
const CROSSING: &str = "worlds/commonroad/ngsim/USA_Lanker-2_2_T-1.xml.gz";
const RAMP: &str = "worlds/commonroad/hand_crafted/ZAM_Ramp-1_1-T-1.xml.gz";
const T_JUNCTION: &str = "worlds/commonroad/hand_crafted/ZAM_Tjunction-1_106_T-1.xml.gz";
const ZIP: &str = "worlds/commonroad/hand_crafted/ZAM_Zip-1_9_T-1.xml.gz";

const SITUATIONS: [Situation; 8] = [
    Situation {
        name: "green light",
        map: CROSSING,
        drive: r#"
[[map.light]]
signals = ["3832", "3835"]
green_s = 30.0
red_s = 20.0
[[map.light]]
signals = ["3834", "3837"]
green_s = 17.0
red_s = 33.0
offset_s = 20.0
[ego]
start = { lane = "3557", s_m = 5.0 }
goal = { lane = "3710", s_m = 20.0 }
target_speed_mps = 10.0
start_speed_mps = 10.0
[[actor]]
name = "waiting"
kind = "car"
start = { lane = "3506", s_m = 20.0 }
[end]
timeout_s = 60.0"#,
        // 178 m; the light is green for 30 s. The other stands 5 m before its line, 20 m beside the ego's lane.
        expect: r#"
verdict = "avoided"
duration_s = { min = 17.6, max = 18.5 }
min_distance_m = { min = 20.0 }
comfort_share = { min = 1.0 }
distance_over_line_m = { max = 0.0 }"#,
    },
    Situation {
        name: "red light",
        map: CROSSING,
        drive: r#"
[[map.light]]
signals = ["3832", "3835"]
green_s = 20.0
red_s = 20.0
offset_s = 25.0
[[map.light]]
signals = ["3834", "3837"]
green_s = 17.0
red_s = 23.0
offset_s = 5.0
[ego]
start = { lane = "3557", s_m = 5.0 }
goal = { lane = "3710", s_m = 20.0 }
target_speed_mps = 10.0
start_speed_mps = 10.0
[[actor]]
name = "crossing"
kind = "car"
start = { lane = "3506", s_m = 3.0 }
motion = [{ drive = { speed_mps = 8.0 } }]
[end]
timeout_s = 60.0"#,
        // Red until 18 s. The line is 60 m ahead; the 118 m behind it take 11.8 s, and 3 s more from rest.
        expect: r#"
verdict = "avoided"
duration_s = { min = 30.0, max = 37.0 }
min_distance_m = { min = 10.0 }
comfort_share = { min = 1.0 }
distance_over_line_m = { max = 0.0 }"#,
    },
    Situation {
        name: "car from the right",
        map: TOWN,
        drive: r#"
[ego]
start = { lane = "19724", s_m = 32.0 }
goal = { lane = "19727", s_m = 30.0 }
target_speed_mps = 9.0
start_speed_mps = 8.0
[[actor]]
name = "from_right"
kind = "car"
start = { lane = "19714", s_m = 4.0 }
goal = { lane = "19711", s_m = 10.0 }
motion = [{ drive = { speed_mps = 9.0 } }]
[end]
timeout_s = 60.0"#,
        // Both lanes are 3.5 m wide. The ego is where they cross after 38 + 16 m, 6.1 s, the car after 38 + 20 m, 6.5 s. The
        // way is 108 m, 12 s; who waits loses at most 3 s, and half a second until the way counts as free.
        expect: r#"
verdict = "avoided"
duration_s = { min = 12.0, max = 15.5 }
min_distance_m = { min = 1.0 }
distance_over_line_m = { max = 0.0 }"#,
    },
    Situation {
        name: "left turn",
        map: T_JUNCTION,
        drive: r#"
[ego]
start = { lane = "50195", s_m = 70.0 }
goal = { lane = "50203", s_m = 50.0 }
target_speed_mps = 10.0
start_speed_mps = 10.0
[[actor]]
name = "oncoming_1"
kind = "car"
start = { lane = "50201", s_m = 30.0 }
goal = { lane = "50197", s_m = 100.0 }
motion = [{ drive = { speed_mps = 9.0 } }]
[[actor]]
name = "oncoming_2"
kind = "car"
start = { lane = "50201", s_m = 5.0 }
goal = { lane = "50197", s_m = 100.0 }
motion = [{ drive = { speed_mps = 9.0 } }]
[end]
timeout_s = 60.0"#,
        // The way is 144 m, 14.4 s. The second car is in the junction for 67 to 95 m, 7.4 to 10.6 s, and the ego would be
        // there after 70 to 95 m, 7 to 10 s: it loses 3 to 8 s.
        expect: r#"
verdict = "avoided"
duration_s = { min = 17.0, max = 23.0 }
min_distance_m = { min = 1.0 }
distance_over_line_m = { max = 0.0 }"#,
    },
    Situation {
        name: "two lanes become one",
        map: ZIP,
        drive: r#"
[ego]
start = { lane = "25", s_m = 20.0 }
goal = { lane = "24", s_m = 120.0 }
target_speed_mps = 13.0
start_speed_mps = 12.0
[[actor]]
name = "car"
kind = "car"
start = { lane = "26", s_m = 30.0 }
motion = [{ drive = { speed_mps = 12.0 } }]
[end]
timeout_s = 60.0"#,
        // The lanes are 3.5 m apart: 1.7 m between two cars. 280 m take 21.6 s, or 23.4 s at the speed of the car, which is
        // 10 m ahead, and at most 3 s more for a gap.
        expect: r#"
verdict = "avoided"
duration_s = { min = 21.5, max = 26.5 }
min_distance_m = { min = 1.5 }
comfort_share = { min = 1.0 }
distance_over_line_m = { max = 0.0 }"#,
    },
    Situation {
        name: "ramp",
        map: RAMP,
        drive: r#"
[ego]
start = { lane = "2", s_m = 4.0 }
goal = { lane = "8", s_m = 40.0 }
target_speed_mps = 15.0
start_speed_mps = 14.0
[[actor]]
name = "car"
kind = "car"
start = { lane = "5", s_m = 8.0 }
motion = [{ drive = { speed_mps = 14.0 } }]
[end]
timeout_s = 60.0"#,
        // 216 m, 14.4 s; the car beside the ego drives 14 m/s, and the ego lets it go ahead or goes ahead of it.
        expect: r#"
verdict = "avoided"
duration_s = { min = 14.4, max = 19.0 }
min_distance_m = { min = 1.0 }
comfort_share = { min = 1.0 }
distance_over_line_m = { max = 0.0 }"#,
    },
    Situation {
        name: "parked truck",
        map: T_JUNCTION,
        drive: r#"
[ego]
start = { lane = "50203", s_m = 5.0 }
goal = { lane = "50203", s_m = 175.0 }
target_speed_mps = 10.0
start_speed_mps = 10.0
[[actor]]
name = "truck"
kind = "truck"
start = { lane = "50203", s_m = 80.0 }
d_m = -0.3
[[actor]]
name = "oncoming"
kind = "car"
start = { lane = "50205", s_m = 10.0 }
motion = [{ drive = { speed_mps = 9.0 } }]
[end]
timeout_s = 90.0"#,
        // The car comes from 183 - 10 - 80 m beyond the truck: past it after 10.6 s, when the ego has waited 2 to 4 s. The
        // way is 170 m, 17 s; 5 to 8 s are lost by slowing down and going on.
        expect: r#"
verdict = "avoided"
duration_s = { min = 22.0, max = 32.0 }
min_distance_m = { min = 0.4 }
comfort_share = { min = 1.0 }
time_in_oncoming_lane_s = { min = 1.0, max = 8.0 }"#,
    },
    Situation {
        name: "closed road",
        map: TOWN,
        drive: r#"
[[map.closure]]
at = { lane = "19829", s_m = 15.0 }
reported_s = 2.0
[ego]
start = { lane = "19714", s_m = 5.0 }
goal = { lane = "20335", s_m = 40.0 }
target_speed_mps = 9.0
start_speed_mps = 8.0
[[actor]]
name = "barrier"
kind = "static"
size = { length_m = 0.5, width_m = 3.0, height_m = 1.0 }
start = { lane = "19829", s_m = 15.0 }
[end]
timeout_s = 120.0"#,
        // The shortest way is 37 + 41 + 15 + 29 + 36 + 35 + 40 m. The way around is 37 + 29 + 39 + 39 + 11 + 34 + 24 + 40 m,
        // 28 s, with 2 to 3 s for each of four turns, and 40 m from the barrier.
        expect: r#"
verdict = "avoided"
duration_s = { min = 32.0, max = 40.0 }
min_distance_m = { min = 35.0 }
comfort_share = { min = 1.0 }
distance_over_line_m = { max = 0.0 }"#,
    },
];

#[test]
fn situations_on_lanelet_maps() {
    all_are_as_expected(&SITUATIONS);
}
