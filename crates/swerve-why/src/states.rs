//! States of the behaviour planner that explain the end of a drive.

use swerve_eval::{BehaviourMetrics, Metrics, Verdict, Why};

/// Number of changes of state because of the actor that a sentence names.
const NAMED_MAX: usize = 3;

/// Adds to the sentence the states because of its actor, and the state at the collision, or at the end of a drive that
/// ends at rest or out of time.
pub(super) fn with_states(mut why: Why, metrics: &Metrics) -> Why {
    let Some(behaviour) = &metrics.behaviour else { return why };
    if let Some(actor) = &why.actor {
        why.sentence += &because_of(behaviour, actor, metrics.impact.map(|impact| impact.at_s));
    }
    let (at_s, when) = match metrics.impact {
        Some(impact) => (impact.at_s, "at the collision"),
        None if behaviour.stands_since_s.is_some() || metrics.verdict == Verdict::Timeout => {
            (f64::INFINITY, "at the end")
        }
        None => return why,
    };
    if let Some(state) = behaviour.at(at_s) {
        why.sentence += &format!("; {when} the car {}, since {:.2} s", state.words(), state.at_s);
    }
    why
}

/// The first states because of an actor, up to an instant, with their begins.
fn because_of(behaviour: &BehaviourMetrics, actor: &str, until_s: Option<f64>) -> String {
    let is_because = |because: Option<&str>| because == Some(actor);
    let until_s = until_s.unwrap_or(f64::INFINITY);
    let mut changes = behaviour.changes.iter().filter(|change| {
        change.at_s < until_s && change.state.is_some() && is_because(change.because.as_deref())
    });
    let first: Vec<String> = changes
        .by_ref()
        .take(NAMED_MAX)
        .map(|change| format!("{} from {:.2} s on", change.words(), change.at_s))
        .collect();
    match (first.is_empty(), changes.count()) {
        (true, _) => String::new(),
        (false, 0) => format!("; the car {}", first.join(", ")),
        (false, more) => format!("; the car {}, and {more} more changes of state", first.join(", ")),
    }
}
