//! Sorts the messages of a recording by the recorder's time.
//!
//! Recorders write in order of reception within a few milliseconds, and tools that convert or merge recordings
//! store topic after topic. Messages are therefore sorted by time, as in `ros2 bag play`. Within a topic, times do
//! not run backwards by more than a second, except after a clock was set or for damaged messages; these keep their
//! position.

use std::collections::BTreeMap;
use std::sync::Arc;

use swerve_log::{BagMessage, BagTopic};

/// Largest plausible disorder within a topic, ns.
const DISORDER_MAX_NS: i128 = 1_000_000_000;
/// Largest plausible gap before a message, ns.
const GAP_MAX_NS: i128 = 60_000_000_000;
/// Number of consecutive consistent times that indicate that the clock was set.
const AGREE: u32 = 20;

/// Sort key: how often the topic's clock was set back before the message, then its time, ns.
type SortKey = (u32, i128);

/// Messages to be sorted.
#[derive(Default)]
pub(super) struct Order {
    /// State by topic name: channels of one topic are merged.
    topics: BTreeMap<String, Course>,
    newest: Option<SortKey>,
    messages: Vec<(SortKey, Arc<BagTopic>, BagMessage)>,
    /// Messages with an earlier time than a preceding one in the file.
    pub(super) earlier: u64,
}

/// Time of a topic so far.
#[derive(Clone, Copy, Default)]
struct Course {
    newest: Option<SortKey>,
    /// Latest implausible time, and the number of consecutive messages consistent with it.
    odd: Option<(i128, u32)>,
}

impl Order {
    /// Adds the next message of the recording.
    pub(super) fn add(&mut self, topic: &Arc<BagTopic>, message: BagMessage) {
        let course = self.topics.entry(topic.name.clone()).or_default();
        let place = course.place(i128::from(message.received_ns), self.newest);
        self.earlier += u64::from(self.newest.is_some_and(|newest| place < newest));
        self.newest = self.newest.max(Some(place));
        self.messages.push((place, Arc::clone(topic), message));
    }

    /// All messages by time; equal times keep the order of the recording.
    pub(super) fn sorted(mut self) -> impl Iterator<Item = (Arc<BagTopic>, BagMessage)> {
        self.messages.sort_by_key(|(place, ..)| *place);
        self.messages.into_iter().map(|(_, topic, message)| (topic, message))
    }
}

impl Course {
    fn place(&mut self, time_ns: i128, newest_of_all: Option<SortKey>) -> SortKey {
        let own = *self.newest.get_or_insert((0, time_ns));
        let of_all = newest_of_all.unwrap_or(own);
        // A slow topic may pause for long while others continue.
        let latest_ns = if own.0 == of_all.0 { own.1.max(of_all.1) } else { own.1 } + GAP_MAX_NS;
        let fits_own = (own.1 - DISORDER_MAX_NS..=latest_ns).contains(&time_ns);
        let is_near = |other_ns: i128| (-DISORDER_MAX_NS..=GAP_MAX_NS).contains(&(time_ns - other_ns));
        if fits_own || is_near(of_all.1) {
            let place = (if fits_own { own.0 } else { of_all.0 }, time_ns);
            self.odd = None;
            self.newest = Some(own.max(place));
            return place;
        }
        let count = match self.odd {
            Some((before_ns, count)) if is_near(before_ns) => count + 1,
            _ => 1,
        };
        self.odd = Some((time_ns, count));
        if count < AGREE {
            return own.max(of_all);
        }
        let place = (own.0 + u32::from(time_ns < own.1), time_ns);
        (self.odd, self.newest) = (None, Some(place));
        place
    }
}

#[cfg(test)]
mod tests {
    use swerve_core::Rng;

    use super::*;

    const MS: u64 = 1_000_000;
    const START: u64 = 1_700_000_000_000 * MS;

    /// Topics and times, ms after the start, after sorting.
    fn sorted(messages: &[(&str, u64)]) -> (Vec<(String, u64)>, u64) {
        let mut order = Order::default();
        for (name, ms) in messages {
            let topic = BagTopic { name: (*name).to_owned(), ..BagTopic::default() };
            let received_ns = START.wrapping_add(ms.wrapping_mul(MS));
            order.add(&Arc::new(topic), BagMessage { topic: 0, received_ns, data: Vec::new() });
        }
        let earlier = order.earlier;
        let ms = |message: &BagMessage| message.received_ns.wrapping_sub(START) / MS;
        (order.sorted().map(|(topic, message)| (topic.name.clone(), ms(&message))).collect(), earlier)
    }

    /// Ten seconds of two topics at 100 and 10 Hz, in order.
    fn drive() -> Vec<(&'static str, u64)> {
        let both = |k: u64| [k.is_multiple_of(10).then_some(("cloud", 10 * k)), Some(("pose", 10 * k))];
        (0..1000).flat_map(both).flatten().collect()
    }

    fn named(messages: &[(&str, u64)]) -> Vec<(String, u64)> {
        messages.iter().map(|(name, ms)| ((*name).to_owned(), *ms)).collect()
    }

    #[test]
    fn order_interleaves_topics_stored_one_after_another() {
        let drive = drive();
        assert_eq!(sorted(&drive), (named(&drive), 0));
        for first in ["pose", "cloud"] {
            let mut by_topic = drive.clone();
            by_topic.sort_by_key(|(name, _)| *name != first);
            let (mut all, earlier) = sorted(&by_topic);
            // Equal times keep the order of the file.
            all.sort_by(|a, b| (a.1, &a.0).cmp(&(b.1, &b.0)));
            assert_eq!(all, named(&drive));
            assert!(earlier > 0);
        }
    }

    #[test]
    fn order_sorts_messages_displaced_by_half_a_second() {
        let mut rng = Rng::keyed(3, "disorder", &[]);
        let mut drawn: Vec<_> =
            drive().into_iter().map(|m| (m.1 as f64 + rng.uniform(0.0, 500.0), m)).collect();
        drawn.sort_by(|a, b| a.0.total_cmp(&b.0));
        let shuffled: Vec<_> = drawn.into_iter().map(|(_, message)| message).collect();
        let times: Vec<u64> = sorted(&shuffled).0.into_iter().map(|(_, ms)| ms).collect();
        assert!(times.is_sorted() && times.len() == 1100);
    }

    #[test]
    fn order_keeps_the_rest_after_a_clock_reset_or_damaged_time() {
        let mut set_back = drive();
        set_back.extend(drive().into_iter().map(|(name, ms)| (name, ms.wrapping_sub(3_600_000))));
        let (all, _) = sorted(&set_back);
        assert_eq!(all[..1100], named(&set_back)[..1100]);
        let mut damaged = drive();
        damaged[500].1 = u64::MAX / MS;
        damaged[600].1 = 3_000_000_000;
        damaged[700].1 = 0_u64.wrapping_sub(START / MS);
        let mut others = sorted(&damaged).0;
        assert_eq!(others.len(), 1100);
        others.retain(|(_, ms)| *ms < 10_000);
        let mut expected = named(&damaged);
        expected.retain(|(_, ms)| *ms < 10_000);
        assert_eq!(others, expected);
    }
}
