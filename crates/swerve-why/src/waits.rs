//! Accounts of the time between two messages, without gaps.

use swerve_core::{Span, Time};
use swerve_flow::InputKind;

use super::timeline::{Loss, Seen, Timeline};

/// Time between two instants, explained backwards from the later one.
struct Ledger {
    floor: Time,
    cursor: Time,
    parts: Vec<(String, Span)>,
}

impl Ledger {
    fn new(floor: Time, end: Time) -> Self {
        Self { floor, cursor: end.max(floor), parts: Vec::new() }
    }

    /// Attributes the time since `from` to this reason.
    fn since(&mut self, from: Time, reason: String) {
        let from = from.clamp(self.floor, self.cursor);
        if from == self.cursor {
            return;
        }
        let span = self.cursor - from;
        self.cursor = from;
        match self.parts.last_mut() {
            Some((known, sum)) if *known == reason => *sum += span,
            _ => self.parts.push((reason, span)),
        }
    }

    fn finish(mut self) -> Vec<(String, Span)> {
        self.parts.reverse();
        self.parts
    }
}

impl Timeline<'_> {
    /// Accounts for the time from one message to a later one of `stream`. Earlier frames of its operator that gave a
    /// result, but not yet this one, count as `idle` of the operator.
    pub(super) fn waits(&self, stream: &str, since: Seen, until: Seen, idle: &str) -> Vec<(String, Span)> {
        let mut account = Ledger::new(since.at, until.at);
        let frame = self.message(stream, until.stamp, &mut account);
        let operator = self.publisher(stream);
        // For each earlier frame, from its stamp to that of the next one.
        for (stamp, loss) in self.frames(stream, since.stamp, frame).into_iter().rev() {
            let reason = match loss {
                Some(Loss::Dropped) => format!("busy {operator}"),
                Some(Loss::Missed) if !self.is_repeated(stream, stamp, until.at) => {
                    format!("deadline of {operator}")
                }
                // Its result was published later, in answer to another frame's deadline.
                Some(Loss::Missed) | None => format!("{idle} {operator}"),
            };
            account.since(stamp, reason);
        }
        account.since(since.at, format!("phase of {}", self.beat(operator)));
        account.finish()
    }

    /// Follows a path of operators, each at its first step that can read the previous one's message; returns the
    /// instant at which the message that `to` reads is published.
    pub(super) fn follow(
        &self,
        (path, to): (&[String], &str),
        from: Time,
        waits: &mut Vec<(String, Span)>,
    ) -> Option<Time> {
        let (mut readable, mut published) = (from, from);
        for (k, operator) in path.iter().enumerate() {
            let stream = self.inputs_from(path.get(k + 1).map_or(to, String::as_str), operator)?;
            let starts =
                |seen: &Seen| self.step(operator, seen.stamp).map_or(seen.at, |step| step.start) >= readable;
            let next = self.all(&stream).find(starts)?;
            let mut account = Ledger::new(published, next.at);
            let tick = self.message(&stream, next.stamp, &mut account);
            account.since(tick.max(readable), format!("busy {operator}"));
            account.since(readable, format!("phase of {operator}"));
            let before = k.checked_sub(1).map_or("", |k| path[k].as_str());
            account.since(published, format!("delay of {before}"));
            waits.extend(account.finish());
            published = next.at;
            readable = published + self.delay(operator);
        }
        Some(published)
    }

    /// Stream of an operator that the next one of a path reads.
    fn inputs_from(&self, next: &str, operator: &str) -> Option<String> {
        self.inputs(next).find(|input| input.from.as_deref() == Some(operator))?.stream.clone()
    }

    /// Explains the time before a message, back to the stamp of the frame that its result was computed for, and returns
    /// that stamp.
    fn message(&self, stream: &str, stamp: Time, account: &mut Ledger) -> Time {
        let operator = self.publisher(stream);
        let Some(header) = self.header(stream, stamp) else { return stamp };
        account.since(header.visible_at, format!("delay of {operator}"));
        // A missed deadline may have repeated the result of an earlier frame, which was held back until then.
        let (answers, stamp) = (stamp, header.reused_from.unwrap_or(stamp));
        let is_missed = self.loss(operator, answers) == Some(Loss::Missed);
        let held_back = if is_missed && answers != stamp { "deadline" } else { "queue" };
        match self.step(operator, stamp) {
            // The deadline passed before there was a result.
            step if is_missed && step.is_none_or(|step| step.end > header.visible_at) => {
                account.since(step.map_or(stamp, |step| step.start), format!("deadline of {operator}"));
            }
            Some(step) => {
                account.since(step.end, format!("{held_back} of {operator}"));
                account.since(step.start, format!("run time of {operator}"));
            }
            None => {}
        }
        if self.is_timed(operator) {
            account.since(stamp, format!("busy {operator}"));
            return stamp;
        }
        // The latest of the inputs that its frame waited for.
        let inputs = self.inputs(operator).filter(|input| input.kind == InputKind::At);
        let ready = inputs.filter_map(|input| {
            let (stream, from) = (input.stream.as_deref()?, input.from.as_deref()?);
            Some((self.header(stream, stamp)?.visible_at + self.delay(from), stream))
        });
        match ready.max_by_key(|(at, _)| *at) {
            Some((at, stream)) => {
                account.since(at, format!("busy {operator}"));
                self.message(stream, stamp, account)
            }
            None => {
                account.since(stamp, format!("transfer of {operator}"));
                stamp
            }
        }
    }

    /// Operator whose timer triggers an operator's frames.
    fn beat<'s>(&'s self, operator: &'s str) -> &'s str {
        let before = self.inputs(operator).find(|input| input.kind == InputKind::At);
        match before.and_then(|input| input.from.as_deref()) {
            Some(before) if !self.is_timed(operator) => self.beat(before),
            _ => operator,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn account_stays_within_its_bounds_without_gaps() {
        let mut account = Ledger::new(Time::from_ms(10), Time::from_ms(50));
        account.since(Time::from_ms(40), "a".into());
        account.since(Time::from_ms(45), "later than where it stands".into());
        account.since(Time::from_ms(30), "b".into());
        account.since(Time::from_ms(20), "b".into());
        account.since(Time::ZERO, "c".into());
        let wait = |reason: &str, ms| (reason.to_owned(), Span::from_ms(ms));
        assert_eq!(account.finish(), [wait("c", 10), wait("b", 20), wait("a", 10)]);
    }
}
