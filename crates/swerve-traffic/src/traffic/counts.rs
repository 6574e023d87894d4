//! Counts of events.

/// Numbers of events since the start of a run.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Counts {
    /// Actors for which there was no legal place at the start.
    pub left_out: u64,
    /// Vehicles that left at the end of the map and entered at another place.
    pub re_entries: u64,
    /// Actors that stood for longer than 180 s outside a red phase; each entered at another place.
    pub deadlocks: u64,
    /// Circles of drivers who gave way to each other, resolved by letting the one with the lowest identity go first.
    pub circles: u64,
    /// Drivers who entered a junction although there was no room beyond, after 60 s: of roads that are full in a circle,
    /// nobody could move otherwise.
    pub full_roads: u64,
    /// Lane changes begun.
    pub lane_changes: u64,
    /// Ticks at which a driver braked in an emergency, by 8.5 to 9 m/s².
    pub hard_brakes: u64,
}
