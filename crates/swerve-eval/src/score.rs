//! Driving scores of other benchmarks, computed as their published code does: CARLA Leaderboard 1.0, 2.0 and 2.1
//! ([`leaderboard`]), Bench2Drive ([`bench2drive`]), nuPlan's closed loop ([`nuplan`]); and surrogate safety measures
//! ([`surrogate`]).
//!
//! All are pure functions of a record of the drive. [`RouteJudge`] makes the Leaderboard's record from the facts of
//! each step, [`DriveJudge`] all scores of a drive. The page `docs/scores.md` has the formulas, their sources, and the differences that remain.

pub mod bench2drive;
mod drive;
mod judge;
pub mod leaderboard;
pub mod nuplan;
pub mod surrogate;

pub use drive::{DriveFacts, DriveJudge, DrivingScores, LeaderboardScore, RouteBench2Drive};
pub use judge::{
    Ego, EmergencyVehicle, Ending, JudgedRoute, RedLight, RouteJudge, RoutePlace, StepFacts, StopSign, Touch,
};

/// Rounds to a number of decimals, as Python's `round`: to the nearest decimal of the exact binary value, ties to even.
fn rounded(value: f64, decimals: usize) -> f64 {
    // The formatted number is the exact one; an addition to it would round twice.
    format!("{value:.decimals$}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::rounded;

    #[test]
    fn rounding_matches_python() {
        // Outputs of Python's round(value, decimals).
        for (value, decimals, wanted) in [
            (0.125, 2, 0.12),
            (0.375, 2, 0.38),
            (2.675, 2, 2.67),
            (0.5, 0, 0.0),
            (1.5, 0, 2.0),
            (-0.125, 2, -0.12),
            (39.988_517_8, 6, 39.988_518),
            (63.27, 2, 63.27),
        ] {
            assert_eq!(rounded(value, decimals), wanted, "{value} {decimals}");
        }
        assert!(rounded(f64::NAN, 3).is_nan());
        assert_eq!(rounded(f64::INFINITY, 3), f64::INFINITY);
    }
}
