//! Sentences about failures.

use core::fmt;

use super::{Failure, StateId, Verdict};

impl fmt::Display for StateId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "problem {}, step {}", self.problem, self.step)
    }
}

/// Formats `valid`, or one failure per line.
impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_valid() {
            return f.write_str("valid");
        }
        let lines: Vec<String> = self.failures.iter().map(ToString::to_string).collect();
        f.write_str(&lines.join("\n"))
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unsolved { missing, unknown } => {
                let parts = [("no solution of problem", missing), ("no problem for solution", unknown)];
                let parts = parts.iter().filter(|(_, ids)| !ids.is_empty());
                let parts: Vec<String> = parts.map(|(what, ids)| format!("{what} {}", list(ids))).collect();
                f.write_str(&parts.join("; "))
            }
            Self::Goal { at, late_steps, off_m, off_mps, is_turned } => {
                let mut parts = Vec::new();
                if *late_steps > 0 {
                    parts.push(format!("{late_steps} steps outside the time of the goal"));
                }
                if *off_m > 0.0 {
                    parts.push(format!("{off_m:.3} m from it"));
                }
                if *off_mps > 0.0 {
                    parts.push(format!("speed {off_mps:.3} m/s outside its interval"));
                }
                if *is_turned {
                    parts.push("heading outside its interval".to_owned());
                }
                write!(f, "{at}: the goal is not reached: {}", parts.join(", "))
            }
            Self::Start { at, quantity, expected, found } => {
                write!(f, "{at}: wrong start: {quantity}: expected {expected}, found {found}")
            }
            Self::Obstacle { at, obstacle, shared_m2, from_behind } => {
                let side = if *from_behind { " from behind" } else { "" };
                write!(f, "{at}: collision with obstacle {obstacle}{side}")?;
                shared_m2.map_or(Ok(()), |shared_m2| write!(f, ", {shared_m2:.3} m² in common"))
            }
            Self::OffRoad { at, outside_m2 } => {
                write!(f, "{at}: off the road: {outside_m2:.3} m² of the outline on no lanelet")
            }
            Self::EachOther { at, other } => write!(f, "{at}: collision with the vehicle of problem {other}"),
            Self::Infeasible { at, miss, count, of } => {
                write!(
                    f,
                    "{at}: infeasible: the nearest input is {:.1} cm and {:.4} rad short ({:+.1} cm along x, {:+.1} \
                     cm along y); {count} of {of} steps are infeasible",
                    100.0 * miss.distance_m(),
                    miss.off_rad.abs(),
                    100.0 * miss.off_m[0],
                    100.0 * miss.off_m[1],
                )
            }
        }
    }
}

fn list(ids: &[u32]) -> String {
    let ids: Vec<String> = ids.iter().map(ToString::to_string).collect();
    ids.join(", ")
}
