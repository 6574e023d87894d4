//! Gaps between lane ends.

use swerve_map::LaneId;

use crate::commonroad::{Centers, read};

/// A lanelet from x to x + 20 with the middle at y, and the lanelets that follow it.
fn lanelet(id: u32, [x, y]: [f64; 2], successors: &[u32]) -> String {
    let bound = |name: &str, y: f64| {
        let point = |x: f64| format!("<point><x>{x}</x><y>{y}</y></point>");
        format!("<{name}>{}{}</{name}>", point(x), point(x + 20.0))
    };
    let successors: String = successors.iter().map(|id| format!("<successor ref=\"{id}\"/>")).collect();
    format!(
        "<lanelet id=\"{id}\">{}{}{successors}</lanelet>",
        bound("leftBound", y + 2.0),
        bound("rightBound", y - 2.0)
    )
}

#[test]
fn gaps_are_closed_up_to_half_a_metre_and_listed() {
    // Offset of the second lane, joined, listed.
    let cases = [
        ([0.0, 0.0], true, false),
        ([0.0, 0.0005], true, false),
        ([0.0, 0.09], true, true),
        ([0.3, 0.0], true, true),
        ([0.0, 0.49], true, true),
        ([0.3, 0.41], false, true),
        ([0.0, -3.0], false, true),
    ];
    for ([dx, dy], is_joined, is_listed) in cases {
        let text = format!(
            "<commonRoad commonRoadVersion=\"2020a\">{}{}</commonRoad>",
            lanelet(1, [0.0, 0.0], &[2]),
            lanelet(2, [20.0 + dx, dy], &[])
        );
        let lanes = read("m.xml", &text, Centers::Rounded).unwrap().lanes;
        let [first, second] = [1, 2].map(|id| lanes.map.lane(LaneId(id)).unwrap());
        assert_eq!(first.successors.contains(&LaneId(2)), is_joined, "{dx} {dy}");
        assert_eq!(lanes.gaps.len(), usize::from(is_listed), "{dx} {dy}");
        if let [gap] = &lanes.gaps[..] {
            assert!(
                (gap.gap_m - swerve_geom::math::hypot(dx, dy)).abs() < 1e-9 && gap.joined == is_joined,
                "{gap:?}"
            );
            assert_eq!(gap.ends, "lane 1 at its end and lane 2 at its start");
        }
        let [end, start] = [first.line.points()[first.line.points().len() - 1], second.line.points()[0]];
        assert!(!is_joined || end.distance(start) <= 0.1, "{dx} {dy}");
        // The borders stay where they are.
        for (lane, y_m, at_x_m) in [(first, 2.0, [1.0, 10.0, 19.9]), (second, dy + 2.0, [20.5, 30.0, 39.0])] {
            for x_m in at_x_m {
                let place = lane.line.project(swerve_geom::Point2::new(x_m, y_m));
                assert!((lane.borders.left_m(place.s_m) - place.d_m).abs() < 1e-3, "{dx} {dy} {x_m}");
            }
        }
    }
}
