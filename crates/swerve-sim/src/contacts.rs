//! Contacts over the steps of a run: when they begin, end, and are reported as a collision.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use swerve_core::{Span, Time};
use swerve_msg::ActorId;
use swerve_msg::truth::Collision;

/// Gap that ends a contact after [`PARTED`], metres.
pub(crate) const PARTED_M: f64 = 0.1;
/// Time that two bodies must be apart for another contact to be a new collision and not a rebound.
const PARTED: Span = Span::from_ms(1_000);
/// Number of steps that a contact of the outlines waits for an impulse of the bodies.
pub(crate) const PATIENCE: u8 = 2;

/// Contacts of a run, by their parties.
#[derive(Clone, Default, Debug)]
pub(crate) struct Contacts(BTreeMap<[ActorId; 2], Contact>);

/// Contact of two bodies.
#[derive(Clone, PartialEq, Debug)]
enum Contact {
    /// Contact; reported once the impulse is known, or without one after `patience` more steps.
    Begun { collision: Collision, patience: u8 },
    /// Reported contact. Ends once they have been apart by [`PARTED_M`] for [`PARTED`] since `touched`.
    Reported { touched: Time },
}

/// Distance and impulse of two bodies after a step.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Touch {
    /// Gap of the outlines, metres; zero if they touch.
    pub(crate) gap_m: f64,
    /// Impulse between the bodies, N s.
    pub(crate) impulse_n_s: f64,
}

impl Touch {
    /// True if the bodies touch.
    pub(crate) fn is_contact(&self) -> bool {
        self.gap_m == 0.0 || self.impulse_n_s > 0.0
    }
}

impl Contacts {
    /// Adds two bodies that touch at the start of the run, which is no collision.
    pub(crate) fn touch_from_start(&mut self, parties: [ActorId; 2]) {
        self.0.insert(parties, Contact::Reported { touched: Time::ZERO });
    }

    /// True if the two touch, or have not been apart for long enough since.
    pub(crate) fn contains(&self, parties: [ActorId; 2]) -> bool {
        self.0.contains_key(&parties)
    }

    /// Parties of all contacts for which [`contains`](Self::contains) is true, in order.
    pub(crate) fn parties(&self) -> impl Iterator<Item = [ActorId; 2]> {
        self.0.keys().copied()
    }

    /// Updates the contact of two bodies after the step that ends at `now`. Returns their collision, in the step in which
    /// its impulse is known, or `patience` steps after the first contact. `collision` is called if they touch anew.
    pub(crate) fn update(
        &mut self,
        (parties, now): ([ActorId; 2], Time),
        touch: Touch,
        patience: u8,
        collision: impl FnOnce() -> Collision,
    ) -> Option<Collision> {
        let Touch { gap_m, impulse_n_s } = touch;
        let contact = match self.0.entry(parties) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(_) if !touch.is_contact() => return None,
            Entry::Vacant(new) => new.insert(Contact::Begun { collision: collision(), patience }),
        };
        match contact {
            Contact::Begun { collision, patience } if impulse_n_s > 0.0 || *patience == 0 => {
                let collision = Collision { impulse_n_s, ..collision.clone() };
                *contact = Contact::Reported { touched: now };
                return Some(collision);
            }
            Contact::Begun { patience, .. } => *patience -= 1,
            Contact::Reported { touched } if gap_m <= PARTED_M || impulse_n_s > 0.0 => *touched = now,
            Contact::Reported { touched } if now - *touched > PARTED => {
                self.0.remove(&parties);
            }
            Contact::Reported { .. } => {}
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PARTIES: [ActorId; 2] = [ActorId(3), ActorId(5)];

    /// Instants of the collisions reported for a gap and an impulse at each instant, every 10 ms, and their impulses.
    fn reported(contacts: &mut Contacts, patience: u8, steps: &[(f64, f64)]) -> Vec<(usize, f64)> {
        let mut reported = Vec::new();
        for (k, &(gap_m, impulse_n_s)) in steps.iter().enumerate() {
            let now = Time::from_ms(10 * (k as i64 + 1));
            let collision = || Collision {
                stamp: now,
                parties: PARTIES,
                impulse_n_s: 0.0,
                closing_speed_mps: 2.0,
                speeds_mps: [1.0, 1.0],
            };
            let hit = contacts.update((PARTIES, now), Touch { gap_m, impulse_n_s }, patience, collision);
            reported.extend(hit.map(|hit| (k, hit.impulse_n_s)));
        }
        reported
    }

    #[test]
    fn contact_waits_for_its_impulse() {
        let of = |patience, steps: &[(f64, f64)]| reported(&mut Contacts::default(), patience, steps);
        assert_eq!(of(2, &[(1.0, 0.0), (0.0, 0.0), (0.0, 7.0), (0.0, 9.0)]), [(2, 7.0)]);
        assert_eq!(of(2, &[(0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)]), [(2, 0.0)]);
        assert_eq!(of(0, &[(0.0, 0.0), (0.0, 3.0)]), [(0, 0.0)]);
    }

    #[test]
    fn rebound_within_a_second_is_the_same_collision() {
        let hit_again_after = |apart: usize| {
            let steps = [vec![(0.0, 1.0)], vec![(0.3, 0.0); apart], vec![(0.0, 1.0)]].concat();
            reported(&mut Contacts::default(), 2, &steps).len()
        };
        assert_eq!((hit_again_after(99), hit_again_after(101)), (1, 2));
    }

    #[test]
    fn contact_from_the_start_is_reported_once_it_begins_anew() {
        let mut contacts = Contacts::default();
        contacts.touch_from_start(PARTIES);
        let steps =
            [vec![(0.0, 0.0); 500], vec![(0.05, 2.0); 10], vec![(0.3, 0.0); 110], vec![(0.0, 1.0)]].concat();
        assert_eq!(reported(&mut contacts, 2, &steps), [(620, 1.0)]);
        assert!(contacts.contains(PARTIES));
    }
}
