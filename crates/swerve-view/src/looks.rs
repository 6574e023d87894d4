//! Latest camera and lidar data, reduced for a page. Data that arrives before the previous item was fetched is dropped
//! and counted, at no cost.

use std::collections::BTreeMap;

use serde::Serialize;
use swerve_core::Time;
use swerve_geom::{Ego, Lidar, Point, Transform};
use swerve_msg::PointCloud;

/// Maximum number of points of a cloud drawn by a page.
const POINTS: usize = 1500;
/// Heights above ground of points on obstacles but not on bridges, metres.
const HEIGHTS_M: core::ops::Range<f64> = 0.3..3.0;

/// Data of a sensor.
#[derive(Clone, PartialEq, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Sight {
    /// An image as a data URL.
    Photo(String),
    /// Top view positions: forward and to the left of the ego's origin, centimetres, alternating.
    Points(Vec<i32>),
}

#[derive(Clone, PartialEq, Debug, Serialize)]
struct Look {
    stream: String,
    /// Stamp, microseconds.
    t: i64,
    /// Number of items that no page has fetched.
    dropped: u64,
    #[serde(flatten)]
    sight: Sight,
    #[serde(skip)]
    is_taken: bool,
}

/// The newest item of each stream.
#[derive(Default)]
pub(crate) struct Looks(BTreeMap<String, Look>);

impl Looks {
    /// True if a page waits for the next item of a stream; otherwise counts one as dropped.
    pub(crate) fn wants(&mut self, stream: &str) -> bool {
        let Some(last) = self.0.get_mut(stream).filter(|last| !last.is_taken) else { return true };
        last.dropped += 1;
        false
    }

    /// Stores an item for the pages.
    pub(crate) fn keep(&mut self, stream: &str, stamp: Time, sight: Sight) {
        let dropped = self.0.get(stream).map_or(0, |last| last.dropped);
        let look = Look { stream: stream.into(), t: stamp.ns() / 1000, dropped, sight, is_taken: false };
        self.0.insert(stream.to_owned(), look);
    }

    /// Items newer than an instant, microseconds, as JSON.
    pub(crate) fn since(&mut self, looked: i64) -> serde_json::Value {
        let newer = self.0.values_mut().filter(|look| look.t > looked);
        let taken = newer.map(|look| {
            look.is_taken = true;
            &*look
        });
        serde_json::to_value(taken.collect::<Vec<_>>()).unwrap_or_default()
    }
}

/// Thinned top view of a point cloud.
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
    fn unfetched_item_is_kept_and_later_ones_are_counted() {
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
    fn top_view_of_a_cloud_shows_obstacles_on_the_ground() {
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
