use super::*;
use crate::{Border, Borders, Junction, JunctionId, LaneId, Mark, Neighbour, Station, features::Features};

fn lane(id: u32, points: &[(f64, f64)]) -> Lane {
    let points: Vec<Point2> = points.iter().map(|&(x, y)| Point2::new(x, y)).collect();
    Lane::new(LaneId(id), Polyline::new(&points).unwrap(), Borders::constant(2.0, 2.0))
}

fn beside(lane: u32, opposite: bool) -> Option<Neighbour> {
    Some(Neighbour { lane: LaneId(lane), opposite })
}

fn marked(left: &[Mark], right: &[Mark]) -> LaneMarks {
    LaneMarks::new(left.to_vec(), right.to_vec()).unwrap()
}

/// Ends of the lines in whole metres, and their looks.
fn drawn(map: &Map) -> Vec<([i32; 4], BorderLook)> {
    let ends = |line: &BorderLine| {
        let (a, b) = (line.points[0], line.points[line.points.len() - 1]);
        [a.x_m, a.y_m, b.x_m, b.y_m].map(|x| x.round() as i32)
    };
    map.border_lines().iter().map(|line| (ends(line), line.look)).collect()
}

#[test]
fn border_between_two_lanes_is_there_once_with_the_marks_that_are_known() {
    // The middle line is known from lane 2 alone, the left one of lane 2 from no lane.
    let right = Lane { left: beside(2, false), ..lane(1, &[(0.0, 0.0), (90.0, 0.0)]) };
    let right = Lane { marks: marked(&[], &[Mark::new(0.0, MarkKind::Kerb)]), ..right };
    let middle = [Mark::new(0.0, MarkKind::Broken), Mark::new(60.0, MarkKind::SolidBroken)];
    let left = Lane { right: beside(1, false), left: beside(3, true), ..lane(2, &[(0.0, 4.0), (90.0, 4.0)]) };
    let left = Lane { marks: marked(&[], &middle), ..left };
    let oncoming = Lane { left: beside(2, true), ..lane(3, &[(90.0, 8.0), (0.0, 8.0)]) };
    let map = Map::new(vec![right, left, oncoming]).unwrap();
    assert_eq!(
        drawn(&map),
        [
            ([0, -2, 90, -2], BorderLook::Solid),
            ([0, 6, 90, 6], BorderLook::Plain),
            ([0, 2, 60, 2], BorderLook::Broken),
            ([60, 2, 90, 2], BorderLook::Solid),
            ([90, 10, 0, 10], BorderLook::Plain),
        ]
    );
}

#[test]
fn broken_line_is_drawn_in_strokes_and_others_from_point_to_point() {
    let points = vec![Point2::new(0.0, 0.0), Point2::new(10.0, 0.0), Point2::new(20.0, 0.0)];
    let pieces = |look| {
        let pieces = BorderLine { points: points.clone(), look }.pieces();
        pieces.iter().map(|[a, b]| [a.x_m, b.x_m]).collect::<Vec<_>>()
    };
    assert_eq!(pieces(BorderLook::Broken), [[0.0, 3.0], [9.0, 12.0], [18.0, 20.0]]);
    assert_eq!(pieces(BorderLook::Plain), [[0.0, 10.0], [10.0, 20.0]]);
}

#[test]
fn border_of_a_straight_lane_bends_at_its_stations() {
    let stations = [(10.0, 1.0), (20.0, 3.0)].map(|(s_m, distance_m)| Station { s_m, distance_m });
    let borders = Borders::new(Border::constant(1.0), Border::linear(&stations).unwrap());
    let lane = Lane { borders, ..lane(1, &[(0.0, 0.0), (50.0, 0.0)]) };
    let at = |side| lane.border_points(side).iter().map(|p| (p.x_m, p.y_m)).collect::<Vec<_>>();
    assert_eq!(at(Side::Right), [(0.0, -1.0), (10.0, -1.0), (20.0, -3.0), (50.0, -3.0)]);
    assert_eq!(at(Side::Left), [0.0, 10.0, 20.0, 50.0].map(|x_m| (x_m, 1.0)));
    assert_eq!(lane.bends_m(), [0.0, 10.0, 20.0, 50.0]);
}

#[test]
fn lanes_inside_a_junction_have_a_look_of_their_own() {
    let inside = lane(4, &[(0.0, 0.0), (20.0, 0.0)]);
    let inside = Lane { marks: marked(&[Mark::new(0.0, MarkKind::Solid)], &[]), ..inside };
    let junction = Junction {
        id: JunctionId(1),
        name: String::new(),
        lanes: vec![LaneId(4)],
        incoming: Vec::new(),
        rights_of_way: Vec::new(),
    };
    let features = Features { junctions: vec![junction], ..Features::default() };
    let map = Map::with_features(vec![inside], features).unwrap();
    let looks: Vec<BorderLook> = map.border_lines().iter().map(|line| line.look).collect();
    assert_eq!(looks, [BorderLook::InJunction; 2]);
}
