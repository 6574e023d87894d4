use swerve_geom::{Point2, Polyline};

use crate::{Borders, Features, Lane, LaneId, Map, StopLine};

fn lane() -> Lane {
    let ends = [Point2::new(0.0, 0.0), Point2::new(50.0, 0.0)];
    Lane::new(LaneId(1), Polyline::new(&ends).unwrap(), Borders::constant(1.5, 1.5))
}

#[test]
fn text_of_a_map_without_features_is_the_list_of_its_lanes() {
    let map = Map::new(vec![lane()]).unwrap();
    let text = serde_json::to_string(&map).unwrap();
    assert_eq!(text, serde_json::to_string(&[lane()]).unwrap());
    assert_eq!(serde_json::from_str::<Map>(&text).unwrap(), map);
    assert_eq!(serde_json::from_str::<Map>(&format!("{{\"lanes\":{text}}}")).unwrap(), map);
}

#[test]
fn text_names_only_features_that_are_there() {
    let stop_lines = vec![StopLine::new(LaneId(1), 49.0)];
    let map = Map::with_features(vec![lane()], Features { stop_lines, ..Features::default() }).unwrap();
    let lanes = serde_json::to_string(&[lane()]).unwrap();
    let expected = format!(
        "{{\"lanes\":{lanes},\"stop_lines\":[{{\"lane\":1,\"s_m\":49.0,\"signals\":[],\"sign\":null}}]}}"
    );
    assert_eq!(serde_json::to_string(&map).unwrap(), expected);
}

#[test]
fn errors_in_a_list_name_the_field() {
    let text = serde_json::to_string(&[lane()]).unwrap();
    for (text, expected) in [
        (text.replace("\"kind\":\"driving\"", "\"kind\":\"fly\""), "unknown variant `fly`"),
        (text.replace("\"id\":1,", ""), "missing field `id`"),
        ("3".to_owned(), "expected a list of lanes, or a table with `lanes`"),
        ("{}".to_owned(), "missing field `lanes`"),
    ] {
        let error = serde_json::from_str::<Map>(&text).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}
