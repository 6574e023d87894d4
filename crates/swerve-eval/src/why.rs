//! Causal chain that explains the end of a drive: from the first sight of an actor to the car's response, or another
//! cause.

use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_msg::truth::Verdict;

/// Causal chain of one actor, or of another cause that decided the drive; `why` in `metrics.json`.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Why {
    /// Name of the actor in the scenario; null if no actor decided the drive.
    pub actor: Option<String>,
    /// Verdict on the drive.
    pub verdict: Verdict,
    /// Summary of the chain in one sentence.
    pub sentence: String,
    /// Steps in order of time; the chain may end before its last milestone.
    pub steps: Vec<WhyStep>,
}

/// One step of a chain.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct WhyStep {
    /// Milestone.
    pub what: Milestone,
    /// Instant, seconds of the run.
    pub at_s: f64,
    /// Account of the time since the previous step, without gaps, in order of time; entries of zero length are left
    /// out.
    pub waited: Vec<Wait>,
}

/// Milestones of an actor in the stack, and other events that make a car stop and go.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Milestone {
    /// A sensor frame was taken in which part of the actor is visible.
    Visible,
    /// A detection of the actor was published; absent without a detector.
    Detected,
    /// A track of the actor was published.
    Tracked,
    /// A plan was published that the actor changed.
    Planned,
    /// A command that follows from such a plan was published.
    Commanded,
    /// The car began to deviate from the same drive without the actor; for the safety gate, it braked.
    Effect,
    /// The safety gate began to stop the car.
    GateStop,
    /// A traffic light changed from green, or came into view of a car that had to stop at it.
    Light,
    /// The car came to a standstill.
    Standstill,
    /// The car set off again.
    MovesOff,
    /// The scenario ended.
    End,
}

impl Milestone {
    /// Name in files.
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

/// A step's input: milestone, instant, and the account of the time since the previous one, in order of time.
pub type Account = (Milestone, Time, Vec<(String, Span)>);

/// End of the time span of a chain.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Until {
    /// End of the drive.
    End,
    /// The collision: later events are not part of the chain.
    Impact,
    /// The command: the drive without the actor is not known.
    Command,
    /// The track: plans without the actor are not known.
    Track,
}

/// A part of the time between two steps.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Wait {
    /// Reason for the wait, such as `run time of planner`.
    #[serde(rename = "for")]
    pub reason: String,
    /// Duration, milliseconds.
    pub ms: f64,
}

impl Why {
    /// Creates a chain from its steps, each with its instant and its account. `ending` starts the sentence.
    ///
    /// The waits of a step must add up to the time since the previous one; debug builds panic otherwise.
    pub fn new(actor: String, verdict: Verdict, (ending, until): (&str, Until), steps: &[Account]) -> Self {
        let sentence = sentence(ending, until, steps);
        Self::told(Some(actor), verdict, sentence, steps)
    }

    /// Creates the explanation of a drive that no actor decided, with a sentence and steps like those of a chain.
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

    /// Text for the terminal: the sentence, and one line per step.
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

    /// Instant of a step, seconds; `None` if the chain ended before.
    pub fn at_s(&self, what: Milestone) -> Option<f64> {
        self.steps.iter().find(|step| step.what == what).map(|step| step.at_s)
    }
}

/// Formats milliseconds; values below one keep two decimals.
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
        (Milestone::Visible, Until::End | Until::Command | Until::Track) => "; it had no effect",
        (Milestone::Visible, Until::Impact) => "; it had no effect before the collision",
        (Milestone::Detected, Until::End | Until::Command | Until::Track) => "; no track was made",
        (Milestone::Detected, Until::Impact) => "; no track was made before the collision",
        (Milestone::Tracked, Until::End | Until::Command) => {
            "; no plan would have been another one without it"
        }
        (Milestone::Tracked, Until::Track) => {
            "; how the planner would have planned without it cannot be computed, because it runs in another program (--allow-code starts it)"
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
    // The longest wait of all, if there is one.
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
    fn incomplete_chain_is_stated_with_its_longest_wait() {
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
    fn milestones_missing_at_impact_are_reported() {
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
    fn accounts_with_gaps_are_refused() {
        let mut steps = steps();
        steps[2].2.pop();
        let _ = Why::new("person".into(), Verdict::Collision, ("", Until::Impact), &steps);
    }
}
