//! The instants at which something is due, and the operators that have to take a turn.

use swerve_core::Time;

/// The next due instant of every operator, in a tournament tree: the root is the next instant of the run.
///
/// It replaces a heap of events: each operator has one entry, which is updated, so no entry becomes stale and nothing
/// is allocated.
pub(crate) struct Due {
    /// `tree[1]` is the root; the leaf of rank `i` is `tree[leaves + i]`.
    tree: Vec<Time>,
    leaves: usize,
}

impl Due {
    pub(crate) fn new(n: usize) -> Self {
        let leaves = n.next_power_of_two();
        Self { tree: vec![Time::MAX; 2 * leaves], leaves }
    }

    /// Next instant at which something is due; `Time::MAX` if nothing is.
    pub(crate) fn next(&self) -> Time {
        self.tree[1]
    }

    pub(crate) fn get(&self, rank: usize) -> Time {
        self.tree[self.leaves + rank]
    }

    pub(crate) fn set(&mut self, rank: usize, at: Time) {
        let mut node = self.leaves + rank;
        if self.tree[node] == at {
            return;
        }
        self.tree[node] = at;
        while node > 1 {
            node /= 2;
            let least = self.tree[2 * node].min(self.tree[2 * node + 1]);
            if self.tree[node] == least {
                return;
            }
            self.tree[node] = least;
        }
    }

    /// Marks all ranks that are due at `now` or before.
    pub(crate) fn mark(&self, now: Time, ready: &mut Ready) {
        self.mark_below(1, now, ready);
    }

    fn mark_below(&self, node: usize, now: Time, ready: &mut Ready) {
        if self.tree[node] > now {
            return;
        }
        if node >= self.leaves {
            ready.insert(node - self.leaves);
        } else {
            self.mark_below(2 * node, now, ready);
            self.mark_below(2 * node + 1, now, ready);
        }
    }
}

/// Operators that have to take a turn in this sweep, by rank.
pub(crate) struct Ready {
    words: Vec<u64>,
    /// Index before which no word has a bit set.
    first: usize,
}

impl Ready {
    pub(crate) fn new(n: usize) -> Self {
        Self { words: vec![0; n.div_ceil(64)], first: usize::MAX }
    }

    pub(crate) fn insert(&mut self, rank: usize) {
        self.words[rank / 64] |= 1 << (rank % 64);
        self.first = self.first.min(rank / 64);
    }

    /// Removes and returns the lowest rank.
    pub(crate) fn pop(&mut self) -> Option<usize> {
        while let Some(word) = self.words.get_mut(self.first) {
            if *word != 0 {
                let bit = word.trailing_zeros() as usize;
                *word &= *word - 1;
                return Some(self.first * 64 + bit);
            }
            self.first += 1;
        }
        self.first = usize::MAX;
        None
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.words.iter().all(|word| *word == 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_root_is_the_least_and_equal_ones_are_marked_in_order() {
        let mut due = Due::new(70);
        let mut ready = Ready::new(70);
        assert_eq!(due.next(), Time::MAX);
        for (rank, ns) in [(69, 5), (3, 5), (64, 7), (0, 6)] {
            due.set(rank, Time::from_ns(ns));
        }
        assert_eq!(due.next(), Time::from_ns(5));
        due.mark(Time::from_ns(5), &mut ready);
        assert_eq!((ready.pop(), ready.pop(), ready.pop()), (Some(3), Some(69), None));
        due.set(3, Time::MAX);
        due.set(69, Time::MAX);
        assert_eq!(due.next(), Time::from_ns(6));
        assert!(ready.is_empty());
        ready.insert(68);
        ready.insert(2);
        assert_eq!((ready.pop(), ready.pop(), ready.pop()), (Some(2), Some(68), None));
    }
}
