//! The `xodr` crate as a second reader. Its points are `f32`, its z contains the heights of lanes.

use crate::opendrive::Network;

/// Largest distance of the centre lines of all lanes in the ground plane, and of their heights, metres; and the number
/// of samples. The offset of the header, which the other reader does not apply, must be zero.
pub(super) fn worst_m(network: &Network, text: &str) -> ([f64; 2], usize) {
    let other = xodr::load_str(text).unwrap_or_else(|error| panic!("{error}"));
    let lanes: usize =
        network.roads.iter().flat_map(|road| &road.sections).map(|one| one.lanes().count()).sum();
    let (mut worst, mut count) = ([0.0_f64; 2], 0);
    for lane in (0..lanes).map(xodr::LaneId) {
        let Some(place) = other.road_lane(lane) else { continue };
        let Some(road) = other.road(place.road) else { continue };
        let Some(own) = network.road(road.od_id()) else { panic!("road {}", road.od_id()) };
        let [from_m, to_m] = own.section_span_m(place.section).unwrap();
        for share in [0.001, 0.13, 0.5, 0.77, 0.999] {
            let s_m = from_m + share * (to_m - from_m);
            let point = other.lane_point(xodr::LanePosition { lane, s: s_m, offset: 0.0 });
            let Some(point) = point else { continue };
            let sample = network.sample(road.od_id(), place.section, place.od_id, s_m).unwrap();
            let [x, y, z] = sample.position_m;
            let [a, b, c] = point.to_array().map(f64::from);
            worst[0] = worst[0].max((x - a).abs()).max((y - b).abs());
            worst[1] = worst[1].max((z - c).abs());
            count += 1;
        }
    }
    (worst, count)
}
