//! What cameras and lidars saw last, small enough for a page: what comes while nobody has taken the one before is
//! dropped and counted, and costs nothing.

use std::collections::BTreeMap;

use serde::Serialize;
use swerve_core::Time;
use swerve_geom::{Ego, Lidar, Point, Transform};
use swerve_msg::PointCloud;

/// Points of a cloud that a page draws, at most.
const POINTS: usize = 1500;
/// What stands on the ground and is no bridge, metres above it.
const HEIGHTS_M: core::ops::Range<f64> = 0.3..3.0;

/// What a sensor saw.
#[derive(Clone, PartialEq, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Sight {
    /// An image, as an address that holds it.
    Photo(String),
    /// Places from above: ahead of the ego's origin and to the left, centimetres, one after the other.
    Points(Vec<i32>),
}

#[derive(Clone, PartialEq, Debug, Serialize)]
struct Look {
    stream: String,
    /// Microseconds.
    t: i64,
    /// How many there were that no page has seen.
    dropped: u64,
    #[serde(flatten)]
    sight: Sight,
    #[serde(skip)]
    is_taken: bool,
}

/// The newest of each stream.
#[derive(Default)]
pub(crate) struct Looks(BTreeMap<String, Look>);

impl Looks {
    /// Whether a page waits for the next one of a stream; where none does, one more is dropped.
    pub(crate) fn wants(&mut self, stream: &str) -> bool {
        let Some(last) = self.0.get_mut(stream).filter(|last| !last.is_taken) else { return true };
        last.dropped += 1;
        false
    }

    /// Keeps a look for the pages.
    pub(crate) fn keep(&mut self, stream: &str, stamp: Time, sight: Sight) {
        let dropped = self.0.get(stream).map_or(0, |last| last.dropped);
        let look = Look { stream: stream.into(), t: stamp.ns() / 1000, dropped, sight, is_taken: false };
        self.0.insert(stream.to_owned(), look);
    }

    /// Those that were made after an instant, microseconds, as JSON.
    pub(crate) fn since(&mut self, looked: i64) -> serde_json::Value {
        let newer = self.0.values_mut().filter(|look| look.t > looked);
        let taken = newer.map(|look| {
            look.is_taken = true;
            &*look
        });
        serde_json::to_value(taken.collect::<Vec<_>>()).unwrap_or_default()
    }
}

/// A cloud from above, thinned out.
pub(crate) fn from_above(cloud: &PointCloud, ego_from_lidar: Transform<Ego, Lidar>) -> Sight {
    let place = |k: usize| {
        let [x, y, z] = cloud.get(k)?.place_m.map(f64::from);
        let place = (ego_from_lidar * Point::new(x, y, z)).coords;
        HEIGHTS_M.contains(&place.z).then(|| [place.x, place.y].map(|m| (100.0 * m).round() as i32))
    };
    let places: Vec<[i32; 2]> = (0..cloud.len()).filter_map(place).collect();
    let step = places.len().div_ceil(POINTS).max(1);
    Sight::Points(places.into_iter().step_by(step).flatten().collect())
}

#[cfg(test)]
mod tests {
    use serde_json::json;
    use swerve_msg::LidarPoint;

    use super::*;

    #[test]
    fn what_nobody_took_is_kept_and_the_next_ones_are_counted() {
        let mut looks = Looks::default();
        let photo = |text: &str| Sight::Photo(text.into());
        assert!(looks.wants("eye"));
        looks.keep("eye", Time::from_ms(50), photo("a"));
        assert!(!looks.wants("eye") && !looks.wants("eye") && looks.wants("other"));
        let one = json!([{ "stream": "eye", "t": 50_000, "dropped": 2, "photo": "a" }]);
        assert_eq!(looks.since(-1), one);
        assert_eq!((looks.since(50_000), looks.since(-1)), (json!([]), one), "another page has it too");
        assert!(looks.wants("eye"));
        looks.keep("eye", Time::from_ms(200), photo("b"));
        assert_eq!(looks.since(50_000)[0]["dropped"], 2);
    }

    #[test]
    fn a_cloud_from_above_is_what_stands_on_the_ground() {
        let mut cloud = PointCloud::default();
        for (x, z) in [(10.0, -1.9), (10.0, -1.0), (12.0, 0.0), (20.0, 9.0)] {
            let place_m = [x, -2.0, z];
            cloud.push(LidarPoint { place_m, ..LidarPoint::default() });
        }
        let mount = Transform::from_roll_pitch_yaw(Point::new(1.0, 0.0, 2.0), 0.0, 0.0, 0.0);
        assert_eq!(from_above(&cloud, mount), Sight::Points(vec![1100, -200, 1300, -200]));
        (0..4000).for_each(|_| cloud.push(LidarPoint { place_m: [5.0, 0.0, 0.0], ..LidarPoint::default() }));
        let Sight::Points(many) = from_above(&cloud, mount) else { unreachable!("points") };
        assert!(many.len() <= 2 * POINTS && many.len() > POINTS, "{}", many.len());
    }
}
