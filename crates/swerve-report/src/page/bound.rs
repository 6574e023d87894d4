//! Size limits of the page of a run. A run of one minute is shown in full; in longer ones the past is shown at fewer
//! instants, and only the newest steps and messages are kept.

use super::run::{Marks, RunPage};
use crate::halved::halve;

/// Maximum number of rows, numbers and texts in each table.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Steps and messages: one minute at 700 per second. When full, the older half is dropped.
    newest: usize,
    /// Ego states, commands, localization poses: 80 seconds at 100 per second. When full, every second row is dropped,
    /// as in the tables below.
    states: usize,
    /// Plans, track lists and prediction lists: one minute at 20 per second.
    lists: usize,
    /// Numbers in all track lists, and in all prediction lists: one minute with ten actors.
    numbers: usize,
    /// Poses of one actor, and of all actors: one minute at 200 per second, with ten moving.
    poses: [usize; 2],
    /// Pictures of all cameras. When full, the older half is dropped.
    photos: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            newest: 45_000,
            states: 1 << 13,
            lists: 1_250,
            numbers: 640_000,
            poses: [13_000, 130_000],
            photos: 1 << 11,
        }
    }
}

/// Fill level of the tables whose rows differ in length, and their losses.
#[derive(Clone, Debug, Default)]
pub(super) struct Fill {
    pub(super) limits: Limits,
    pub(super) tracked: usize,
    pub(super) predicted: usize,
    pub(super) poses: usize,
    is_thinned: bool,
    /// Instant from which on steps and messages are complete, microseconds.
    complete_from: Option<i64>,
}

impl Fill {
    /// Makes room in the full tables.
    pub(super) fn make_room(&mut self, page: &mut RunPage) {
        let Limits { newest, states, lists, numbers, poses: [of_one, of_all], photos } = self.limits;
        let RunPage { ego, located, commands, .. } = page;
        if ego.t.len() >= states {
            self.is_thinned = true;
            let columns = [&mut ego.t, &mut ego.x, &mut ego.y, &mut ego.h];
            columns.into_iter().for_each(halve);
            [&mut ego.v, &mut ego.a, &mut ego.lat, &mut ego.steer].into_iter().for_each(halve);
        }
        if located.t.len() >= states {
            self.is_thinned = true;
            [&mut located.t, &mut located.off].into_iter().for_each(halve);
            halve(&mut located.sigma);
        }
        if commands.t.len() >= states {
            self.is_thinned = true;
            let columns = [&mut commands.t, &mut commands.steer, &mut commands.throttle, &mut commands.brake];
            columns.into_iter().for_each(halve);
        }
        if page.plans.len() >= lists {
            self.is_thinned = true;
            halve(&mut page.plans);
        }
        if page.tracks.len() >= lists || self.tracked >= numbers {
            self.is_thinned = true;
            halve(&mut page.tracks);
            self.tracked = page.tracks.iter().map(|tracks| 8 * tracks.of.len()).sum();
        }
        if page.predictions.len() >= lists || self.predicted >= numbers {
            self.is_thinned = true;
            halve(&mut page.predictions);
            self.predicted = page.predictions.iter().flat_map(|all| &all.of).map(Vec::len).sum();
        }
        if self.poses >= of_all || page.actors.iter().any(|actor| actor.t.len() >= of_one) {
            self.is_thinned = true;
            for actor in &mut page.actors {
                [&mut actor.t, &mut actor.x, &mut actor.y, &mut actor.h].into_iter().for_each(halve);
            }
            self.poses = page.actors.iter().map(|actor| actor.t.len()).sum();
        }
        if page.photos.len() >= photos {
            self.is_thinned = true;
            page.photos_before += photos / 2;
            page.photos.drain(..photos / 2);
        }
        self.keep_newest(page, newest);
    }

    fn keep_newest(&mut self, page: &mut RunPage, most: usize) {
        let old = most / 2;
        let RunPage { steps, messages, misses, drops, .. } = page;
        if steps.start.len() >= most {
            steps.operator.drain(..old);
            for column in [&mut steps.stamp, &mut steps.start, &mut steps.took] {
                column.drain(..old);
            }
            steps.late.retain_mut(|late| late.checked_sub(old).map(|new| *late = new).is_some());
            self.complete_from = self.complete_from.max(steps.start.first().copied());
        }
        if messages.at.len() >= most {
            [&mut messages.stream, &mut messages.operator]
                .into_iter()
                .for_each(|column| drop(column.drain(..old)));
            for column in [&mut messages.stamp, &mut messages.at, &mut messages.origin] {
                column.drain(..old);
            }
            self.complete_from = self.complete_from.max(messages.at.first().copied());
        }
        for Marks { operator, stamp, at, why } in [misses, drops] {
            if at.len() >= most {
                operator.drain(..old);
                [stamp, at].into_iter().for_each(|column| drop(column.drain(..old)));
                why.drain(..old);
            }
        }
    }

    /// Sentences about the dropped data.
    pub(super) fn notes(&self) -> impl Iterator<Item = String> {
        let thinned = "The drive is long: its past is shown at fewer instants; the log has all.";
        let thinned = self.is_thinned.then(|| thinned.to_owned());
        let newest = self.complete_from.map(|us| {
            let s = us as f64 * 1e-6;
            format!("The drive is long: steps and messages before {s:.0} s are left out; the log has all.")
        });
        thinned.into_iter().chain(newest)
    }
}

#[cfg(test)]
mod tests {
    use swerve_core::{Span, Time};
    use swerve_geom::{Pose2, Vector2};
    use swerve_msg::{ActorId, ActorKind, EgoState, Extent, Track, TrackList};

    use super::super::{Collector, Have, Message};
    use super::*;

    const TINY: Limits = Limits { newest: 64, states: 32, lists: 8, numbers: 100, poses: [8, 8], photos: 4 };

    fn track(pose: Pose2) -> Track {
        let extent = Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 };
        let (kind, velocity_mps) = (ActorKind::Pedestrian, Vector2::new(0.0, 0.0));
        Track { id: ActorId(3), kind, pose, extent, velocity_mps, history: Vec::new() }
    }

    /// A drive at 1 m/s with `states` ego states, 20 ms apart, each with a list of one track.
    fn driven(states: i64, limits: Limits) -> Collector {
        let mut collector = Collector::new();
        collector.limit(limits);
        for k in 0..states {
            let at = Time::ZERO + Span::from_ms(20 * k);
            let message = |stream| Message { stream, operator: "o", stamp: at, at, origin: None };
            let pose = Pose2::new(at.as_secs(), 0.0, 0.0);
            collector.message(message("ego"), Some(&EgoState { stamp: at, pose, ..EgoState::default() }));
            let tracks = TrackList { stamp: at, tracks: vec![track(pose)] };
            collector.message(message("tracks"), Some(&tracks));
            collector.step("o", at, at, at, k % 7 == 0);
        }
        collector
    }

    #[test]
    fn tables_stay_within_their_limits_from_the_first_instant_to_the_last() {
        for states in [10, 31, 32, 33, 1000, 1001] {
            let page = driven(states, TINY).finish();
            let end = 20_000 * (states - 1);
            let ego = &page.ego;
            assert!(ego.t.len() <= 32 && page.messages.at.len() <= 64 && page.steps.start.len() <= 64);
            assert_eq!([ego.t.first(), ego.t.last()], [Some(&0), Some(&end)], "{states}");
            // Rows stay consistent: at 1 m/s, 100 cm per 1,000,000 us.
            assert!(ego.t.iter().zip(&ego.x).all(|(t, x)| *t == 10_000 * x), "{states}");
            assert!(8 * page.tracks.len() <= 104);
            assert_eq!(page.messages.at.last(), Some(&end));
            for late in &page.steps.late {
                assert_eq!(page.steps.start[*late] / 20_000 % 7, 0, "{states}");
            }
            let late = page.steps.start.iter().filter(|t| *t / 20_000 % 7 == 0).count();
            assert_eq!(page.steps.late.len(), late);
        }
    }

    #[test]
    fn drive_of_a_minute_is_shown_whole_and_without_notes() {
        let (long, tiny) = (driven(1_200, Limits::default()), driven(1_200, TINY));
        assert_eq!(long.notes().count(), 0);
        assert_eq!(long.so_far().ego.t.len(), 1_200);
        let notes: Vec<String> = tiny.notes().collect();
        assert!(notes.len() == 2 && notes[1].contains("before 23 s"), "{notes:?}");
    }

    #[test]
    fn page_that_is_shown_live_gets_each_new_row_once_across_a_thinning() {
        let mut have = Have::default();
        let mut seen = Vec::new();
        for states in 1..200 {
            let rows = driven(states, TINY).rows(&have);
            let rows = serde_json::to_value(&rows).unwrap();
            let t = rows["ego"]["t"].as_array().unwrap().clone();
            have.ego = t.last().and_then(serde_json::Value::as_i64).or(have.ego);
            seen.extend(t);
        }
        let expected: Vec<i64> = (0..199).map(|k| 20_000 * k).collect();
        assert_eq!(seen, expected);
    }
}
