//! Where an actor of the traffic is kept, by its identity.

use swerve_msg::ActorId;

/// Place of an actor in the list of its kind.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Slot {
    Car(usize),
    Walker(usize),
}

/// Slots of all actors. Their identities follow each other, apart from those of actors that found no place.
#[derive(Clone, Debug, Default)]
pub(super) struct Slots {
    first_id: u32,
    slots: Vec<Option<Slot>>,
}

impl Slots {
    /// Slots of cars and of pedestrians, given by their identities in order.
    pub(super) fn new(
        first_id: u32,
        cars: impl Iterator<Item = ActorId>,
        walkers: impl Iterator<Item = ActorId>,
    ) -> Self {
        let mut slots = Vec::new();
        let cars = cars.enumerate().map(|(k, id)| (id, Slot::Car(k)));
        let walkers = walkers.enumerate().map(|(k, id)| (id, Slot::Walker(k)));
        for (id, slot) in cars.chain(walkers) {
            let at = (id.0 - first_id) as usize;
            slots.resize(slots.len().max(at + 1), None);
            slots[at] = Some(slot);
        }
        Self { first_id, slots }
    }

    /// Slot of an actor; `None` for one that is not of the traffic.
    pub(super) fn of(&self, id: ActorId) -> Option<Slot> {
        let at = id.0.checked_sub(self.first_id)?;
        self.slots.get(at as usize).copied().flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_are_found_by_identity() {
        let slots = Slots::new(5, [5, 7].map(ActorId).into_iter(), [8, 11].map(ActorId).into_iter());
        let of = |id: u32| slots.of(ActorId(id));
        assert_eq!([of(5), of(7)], [Some(Slot::Car(0)), Some(Slot::Car(1))]);
        assert_eq!([of(8), of(11)], [Some(Slot::Walker(0)), Some(Slot::Walker(1))]);
        assert!([0, 4, 6, 9, 10, 12, u32::MAX].iter().all(|id| of(*id).is_none()));
        assert_eq!(Slots::default().of(ActorId(0)), None);
    }
}
