use proptest::prelude::*;

use super::*;

/// Two parallel lanes, the left one with a successor; a stop line with a light, and a sign.
const SMALL: &str = include_str!("small.xml");

fn told(text: &str) -> String {
    commonroad_lanelets(text).unwrap_err().to_string()
}

#[test]
fn lanelets_are_read_as_lanes() {
    let lanes = commonroad_lanelets(SMALL).unwrap();
    let of = |id| lanes.map().lane(LaneId(id)).unwrap();
    assert_eq!(lanes.map().lanes().len(), 3);
    assert_eq!(of(1).successors, [LaneId(3)]);
    assert_eq!(of(1).right, Some(Neighbour { lane: LaneId(2), opposite: false }));
    assert_eq!(of(2).left, Some(Neighbour { lane: LaneId(1), opposite: false }));
    assert_eq!((of(1).speed_limit_mps, of(2).speed_limit_mps), (Some(13.4112), None));
    assert_eq!((of(2).kind, of(3).kind), (LaneKind::Cycling, LaneKind::Driving));
    assert_eq!((of(1).line.length(), of(1).width_m(10.0)), (20.0, 3.5));
    assert_eq!((of(3).width_m(0.0), of(3).width_m(10.0)), (3.5, 4.5), "as the bounds go apart");
    let [first, second] = lanes.map().stop_lines() else { panic!("two stop lines") };
    assert_eq!((first.lane, first.s_m, &first.signals[..]), (LaneId(1), 20.0, &[8, 9].map(SignalId)[..]));
    assert_eq!((second.lane, second.s_m, second.signals.len()), (LaneId(3), 6.0, 0));
}

#[test]
fn invalid_maps_are_reported_with_their_line() {
    assert!(told("").starts_with("1: "));
    assert_eq!(told("<osm/>"), "1: expected `<commonRoad>`, found `<osm>`");
    assert_eq!(told("<commonRoad/>"), "1: expected lanelets, found none");
    let with = |from: &str, to: &str| {
        assert!(SMALL.contains(from), "{from}");
        told(&SMALL.replacen(from, to, 1))
    };
    assert_eq!(with("</commonRoad>", ""), "1: the root node was opened but never closed");
    assert_eq!(with("id=\"1\"", "id=\"-1\""), "3: id: expected no negative number, found `-1`");
    assert!(with("id=\"1\"", "id=\"9e99\"").starts_with("3: id: expected a number of at most 4294967295"));
    assert_eq!(with("id=\"1\"", "name=\"1\""), "3: <lanelet>: expected an attribute `id`");
    assert_eq!(with("<x>0</x>", "<x>NaN</x>"), "5: x: expected a number of at most 10000000, found `NaN`");
    assert_eq!(with("<x>0</x>", ""), "5: <point>: expected <x>");
    assert_eq!(
        with("<point><x>0</x><y>3.5</y></point>", ""),
        "3: lanelet 1: expected as many points to the left as to the right, found 1 and 2"
    );
    assert_eq!(
        with("<successor ref=\"3\"/>", "<successor ref=\"7\"/>"),
        "3: lane 1 names lane 7, which is not there"
    );
    assert_eq!(
        with("drivingDir=\"same\"", "drivingDir=\"up\""),
        "17: drivingDir: expected same or opposite, found `up`"
    );
    assert_eq!(
        with("<adjacentLeft drivingDir=\"same\" ref=\"1\"/>", ""),
        "3: lane 1 has lane 2 beside it, but not the other way round"
    );
    assert_eq!(
        with("<additionalValue>13.4112</additionalValue>", ""),
        "52: <trafficSignElement>: expected <additionalValue>"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Truncated files and files with a few changed characters give lanes, or one error with a valid line.
    #[test]
    fn reader_survives_arbitrary_changes(
        cut in 0..SMALL.len(),
        changes in prop::collection::vec(
            (0..SMALL.len(), prop::sample::select(vec!["9", "<", "-", "e9", "\"", "", "NaN"])),
            0..4,
        ),
    ) {
        let mut text = SMALL.to_owned();
        for (at, word) in changes {
            if text.is_char_boundary(at) && at < text.len() {
                text.replace_range(at..=at, word);
            }
        }
        for text in [text.as_str(), text.get(..cut).unwrap_or_default()] {
            if let Err(error) = commonroad_lanelets(text) {
                prop_assert!(error.line >= 1 && error.line <= text.lines().count().max(1) + 1, "{error}");
            }
        }
    }
}
