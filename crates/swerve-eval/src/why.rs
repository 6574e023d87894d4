//! Why a drive ended as it did: the chain from the first sight of an actor to the car's answer, or what else decided it.

use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_msg::truth::Verdict;

/// The chain of one actor, or of what stopped the car where that decided; `why` in `metrics.json` is this struct.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Why {
    /// Name of the actor in the scenario; null where none decided how the drive ended.
    pub actor: Option<String>,
    /// How the drive ended.
    pub verdict: Verdict,
    /// The chain in one sentence.
    pub sentence: String,
    /// What happened of the chain, in order of time; it breaks off where nothing more came of it.
    pub steps: Vec<WhyStep>,
}

/// One step of a chain.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct WhyStep {
    /// What happened.
    pub what: Milestone,
    /// When, seconds of the run.
    pub at_s: f64,
    /// What went by since the step before, without a gap, in order of time; what took no time is left out.
    pub waited: Vec<Wait>,
}

/// What happens to an actor on its way through the stack; and what else makes a car stop and go on.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Milestone {
    /// A sensor frame in which some of it is in sight was taken.
    Visible,
    /// A detector's result with it was published; absent where nothing detects.
    Detected,
    /// A list of tracks with one of it was published.
    Tracked,
    /// A plan was published that would have been another one without it.
    Planned,
    /// A command that follows from such a plan was published.
    Commanded,
    /// The car drove otherwise than it would have, had no plan known of the actor; of the safety gate, it braked.
    Effect,
    /// The safety gate began to stop the car.
    GateStop,
    /// A traffic light turned from green, or was in sight of a car that had to stop at it.
    Light,
    /// The car stood.
    Standstill,
    /// The car went on.
    MovesOff,
    /// The scenario was over.
    End,
}

impl Milestone {
    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Visible => "visible",
            Self::Detected => "detected",
            Self::Tracked => "tracked",
            Self::Planned => "planned",
            Self::Commanded => "commanded",
            Self::Effect => "effect",
            Self::GateStop => "gate_stop",
            Self::Light => "light",
            Self::Standstill => "standstill",
            Self::MovesOff => "moves_off",
            Self::End => "end",
        }
    }
}

/// A step before it is told: what happened, when, and what went by since the one before, in order of time.
pub type Account = (Milestone, Time, Vec<(String, Span)>);

/// Up to when a chain is looked for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Until {
    /// The end of the drive.
    End,
    /// The collision: what came after it is no part of why.
    Impact,
    /// The command: how the car would have driven without the actor is not known.
    Command,
}

/// A part of the time between two steps.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Wait {
    /// What was waited for, such as `run time of planner`.
    #[serde(rename = "for")]
    pub reason: String,
    /// How long, milliseconds.
    pub ms: f64,
}

impl Why {
    /// A chain from its steps: each has its instant and how long was waited for what. `ending` begins the sentence.
    ///
    /// The waits of a step have to be the time since the one before; a build for tests panics where they are not.
    pub fn new(actor: String, verdict: Verdict, (ending, until): (&str, Until), steps: &[Account]) -> Self {
        let sentence = sentence(ending, until, steps);
        Self::told(Some(actor), verdict, sentence, steps)
    }

    /// What decided a drive where that was no actor, in a sentence and in steps like those of a chain.
    pub fn without_actor(verdict: Verdict, sentence: String, steps: &[Account]) -> Self {
        Self::told(None, verdict, sentence, steps)
    }

    fn told(actor: Option<String>, verdict: Verdict, sentence: String, steps: &[Account]) -> Self {
        for pair in steps.windows(2) {
            let waited = pair[1].2.iter().fold(Span::ZERO, |sum, (_, span)| sum + *span);
            let of = actor.as_deref().unwrap_or("the car");
            debug_assert_eq!(waited, pair[1].1 - pair[0].1, "{} of {of}: {:?}", pair[1].0.name(), pair[1].2);
        }
        let step = |(what, at, waited): &Account| WhyStep {
            what: *what,
            at_s: crate::seconds(*at),
            waited: waited.iter().map(|(reason, s)| Wait { reason: reason.clone(), ms: ms(*s) }).collect(),
        };
        Self { actor, verdict, sentence, steps: steps.iter().map(step).collect() }
    }

    /// For the terminal: the sentence, and a line a step.
    pub fn text(&self) -> String {
        let mut text = format!("why: {}\n", self.sentence);
        let mut last_s = None;
        for step in &self.steps {
            let since =
                last_s.map_or_else(String::new, |last| format!("+{:.0} ms", (step.at_s - last) * 1e3));
            let parts: Vec<String> =
                step.waited.iter().map(|w| format!("{} {} ms", w.reason, round(w.ms))).collect();
            let line =
                format!("  {:<10}{:>8.3} s  {since:>9}  {}", step.what.name(), step.at_s, parts.join(", "));
            text += line.trim_end();
            text.push('\n');
            last_s = Some(step.at_s);
        }
        text
    }

    /// When a step happened, seconds; none where the chain broke off before.
    pub fn at_s(&self, what: Milestone) -> Option<f64> {
        self.steps.iter().find(|step| step.what == what).map(|step| step.at_s)
    }
}

/// Milliseconds as a person reads them: what is below one is not nothing.
fn round(ms: f64) -> String {
    if ms < 1.0 { format!("{ms:.2}") } else { format!("{ms:.0}") }
}

fn ms(span: Span) -> f64 {
    span.ns() as f64 / 1e6
}

fn sentence(ending: &str, until: Until, steps: &[Account]) -> String {
    let (Some(first), Some(last)) = (steps.first(), steps.last()) else {
        let before = if until == Until::Impact { " before the collision" } else { "" };
        return format!("{ending}; no sensor frame had it in sight{before}");
    };
    let mut text = format!("{ending}: in sight at {:.3} s", first.1.as_secs());
    for pair in steps.windows(2) {
        let after = ms(pair[1].1 - pair[0].1);
        text += &match pair[1].0 {
            Milestone::Effect => {
                format!(", and {after:.0} ms later the car drove otherwise than it would have without it")
            }
            Milestone::Planned => format!(", a plan changed because of it {after:.0} ms later"),
            what => format!(", {} {after:.0} ms later", what.name()),
        };
    }
    let missing = match (last.0, until) {
        (Milestone::Visible, Until::End | Until::Command) => "; it had no effect",
        (Milestone::Visible, Until::Impact) => "; it had no effect before the collision",
        (Milestone::Detected, Until::End | Until::Command) => "; no track was made",
        (Milestone::Detected, Until::Impact) => "; no track was made before the collision",
        (Milestone::Tracked, Until::End | Until::Command) => {
            "; no plan would have been another one without it"
        }
        (Milestone::Tracked, Until::Impact) => "; no plan had changed because of it before the collision",
        (Milestone::Planned, Until::End | Until::Command) => "; no command followed from that",
        (Milestone::Planned, Until::Impact) => "; no command had followed from that before the collision",
        (Milestone::Commanded, Until::End) => "; no effect found: the car drove as it would have without it",
        (Milestone::Commanded, Until::Impact) => {
            "; no effect found: up to the collision the car drove as it would have without it"
        }
        (Milestone::Commanded, Until::Command) => {
            "; how the car would have driven without it cannot be computed from this log"
        }
        _ => "",
    };
    text += missing;
    // The longest wait of all, where there is one to name.
    let mut sums: Vec<(&str, Span)> = Vec::new();
    for (reason, span) in steps[1..].iter().flat_map(|step| &step.2) {
        match sums.iter_mut().find(|(known, _)| known == reason) {
            Some((_, sum)) => *sum += *span,
            None => sums.push((reason, *span)),
        }
    }
    if let Some((reason, span)) = sums.into_iter().max_by_key(|(_, span)| *span) {
        text += &format!(" ({:.0} ms in all, {:.0} of them {reason})", ms(last.1 - first.1), ms(span));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps() -> Vec<Account> {
        let wait = |reason: &str, ms| (reason.to_owned(), Span::from_ms(ms));
        vec![
            (Milestone::Visible, Time::from_ms(4850), Vec::new()),
            (Milestone::Tracked, Time::from_ms(4850), Vec::new()),
            (
                Milestone::Planned,
                Time::from_ms(4900),
                vec![wait("busy planner", 20), wait("run time of planner", 30)],
            ),
        ]
    }

    #[test]
    fn a_chain_that_breaks_off_says_so_and_names_the_longest_wait() {
        let why = Why::new(
            "person".into(),
            Verdict::Unfinished,
            ("it came within 6.00 m of person", Until::End),
            &steps(),
        );
        assert_eq!(
            why.sentence,
            "it came within 6.00 m of person: in sight at 4.850 s, tracked 0 ms later, a plan changed because of it 50 ms \
             later; no command followed from that (50 ms in all, 30 of them run time of planner)"
        );
        assert_eq!((why.at_s(Milestone::Planned), why.at_s(Milestone::Effect)), (Some(4.9), None));
        let json = serde_json::to_value(&why).unwrap();
        assert_eq!(json["steps"][2]["waited"][1]["for"], "run time of planner");
        assert_eq!(
            (&json["steps"][2]["what"], json["steps"][2]["waited"][1]["ms"].as_f64()),
            (&"planned".into(), Some(30.0))
        );
        assert!(
            why.text().contains("  planned      4.900 s     +50 ms  busy planner 20 ms"),
            "{}",
            why.text()
        );
    }

    #[test]
    fn what_was_missing_at_the_impact_is_told_as_that() {
        let all = steps();
        let told = |steps: &[Account]| {
            let ending = ("it hit person at 5.00 s", Until::Impact);
            Why::new("person".into(), Verdict::Collision, ending, steps).sentence
        };
        for (known, missing) in [
            (0, "no sensor frame had it in sight before the collision"),
            (1, "it had no effect before the collision"),
            (2, "no plan had changed because of it before the collision"),
            (3, "no command had followed from that before the collision"),
        ] {
            let sentence = told(&all[..known]);
            assert!(sentence.contains(missing), "{sentence}");
        }
    }

    #[test]
    #[cfg(debug_assertions)]
    #[should_panic(expected = "planned of person")]
    fn accounts_that_leave_a_gap_are_refused() {
        let mut steps = steps();
        steps[2].2.pop();
        let _ = Why::new("person".into(), Verdict::Collision, ("", Until::Impact), &steps);
    }
}
