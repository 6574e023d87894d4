//! Models of vehicles in solutions.

/// Model of a vehicle.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Model {
    /// Point mass.
    Pm,
    /// Kinematic single track.
    Ks,
    /// Single track with tyre slip.
    St,
}

impl Model {
    const ALL: [Self; 3] = [Self::Pm, Self::Ks, Self::St];

    /// Name in the identity of a benchmark.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pm => "PM",
            Self::Ks => "KS",
            Self::St => "ST",
        }
    }

    /// The model of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|model| model.name() == name)
    }

    /// Element of a trajectory.
    pub(crate) fn trajectory(self) -> &'static str {
        match self {
            Self::Pm => "pmTrajectory",
            Self::Ks => "ksTrajectory",
            Self::St => "stTrajectory",
        }
    }

    /// Element of a state.
    pub(crate) fn state(self) -> &'static str {
        match self {
            Self::Pm => "pmState",
            Self::Ks => "ksState",
            Self::St => "stState",
        }
    }
}
