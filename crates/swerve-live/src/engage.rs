//! Engagement: from a user's request to the rising edge of the gate's switch.
//!
//! The gate treats a rising edge as a user action and requires a healthy state at that instant. A vehicle needs a
//! moment until it accepts commands, which it reports. The edge is therefore given when the vehicle accepts
//! commands, the driver does not act, and all required topics are present; until then, and up to a timeout, the
//! vehicle is asked repeatedly.
//!
//! Pure: the instant is an input.

use std::borrow::Cow;

use swerve_core::{Span, Time};
use swerve_msg::{GateMode, Switch};
use swerve_stack::config::live::EnableBy;

use super::intake::Request;
use super::placement::Misplaced;

/// Period of requests to the vehicle.
const ASK_EVERY: Span = Span::from_ms(200);
/// Requests to drive closer together than this are one action: a held button, a repeated topic.
const ACT_GAP: Span = Span::from_ms(1000);
/// Minimum off time of the switch, so that the gate sees an edge.
const OFF_MIN: Span = Span::from_ms(100);
/// Maximum time for the gate to follow the edge.
const EDGE_MAX: Span = Span::from_ms(300);

/// State of vehicle, user and gate at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Situation {
    /// The instant.
    pub now: Time,
    /// True if all required topics were heard recently.
    pub ready: bool,
    /// True if the vehicle accepts commands; `None` if it does not report that.
    pub listens: Option<bool>,
    /// True if the driver acts.
    pub driver: bool,
    /// Mode of the gate.
    pub mode: GateMode,
    /// Reason in the car's pose for not taking it over.
    pub misplaced: Option<Misplaced>,
}

/// Result of a step.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Action {
    /// Switch for the gate.
    pub switch: Switch,
    /// True to ask the vehicle to accept commands.
    pub ask: bool,
    /// Message for the user.
    pub note: Option<Cow<'static, str>>,
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Phase {
    /// No pending request to drive.
    Idle,
    /// The vehicle is asked to accept commands.
    Asking { since: Time, asked: Option<Time> },
    /// The switch is on since `since`; the request was made at `asking_since`.
    On { since: Time, asking_since: Time },
}

/// State machine of the engagement.
#[derive(Clone, Debug)]
pub struct Engagement {
    timeout: Span,
    /// True if enabled at start: the start of the program is a user action that is still pending.
    at_start: bool,
    phase: Phase,
    last_request: Option<Time>,
    emergency: bool,
    over: bool,
    was_engaged: bool,
}

impl Engagement {
    /// Creates the state machine without a request, except at start.
    pub fn new(by: EnableBy, timeout: Span) -> Self {
        Self {
            timeout,
            at_start: by == EnableBy::AtStart,
            phase: Phase::Idle,
            last_request: None,
            emergency: false,
            over: false,
            was_engaged: false,
        }
    }

    /// Ends the drive: the switch stays off from here on.
    pub fn end(&mut self) {
        self.over = true;
    }

    /// Processes the requests of users.
    pub fn step(&mut self, requests: &[Request], at: &Situation) -> Action {
        let mut note = None;
        for request in requests {
            match *request {
                Request::Emergency(stop) => self.emergency = stop,
                Request::Drive(false) => {
                    self.last_request = None;
                    if self.phase != Phase::Idle {
                        note = Some("the switch was released".into());
                    }
                    self.phase = Phase::Idle;
                }
                Request::Drive(true) => {
                    let is_act = self.last_request.is_none_or(|last| at.now - last > ACT_GAP);
                    self.last_request = Some(at.now);
                    if is_act {
                        note = self.press(at).or(note);
                    }
                }
            }
        }
        if self.at_start && at.ready {
            self.at_start = false;
            note = self.press(at).or(note);
        }
        if self.over {
            self.phase = Phase::Idle;
        }
        let (ask, said) = self.advance(at);
        let enable = matches!(self.phase, Phase::On { .. });
        Action { switch: Switch { enable, emergency: self.emergency }, ask, note: said.or(note) }
    }

    /// Handles a user action.
    fn press(&mut self, at: &Situation) -> Option<Cow<'static, str>> {
        let drives = matches!(self.phase, Phase::On { .. }) && at.mode == GateMode::Driving;
        if drives || self.over {
            return None;
        }
        if !at.ready {
            return Some("not all topics that are needed are there: the switch is off".into());
        }
        if let Some(misplaced) = at.misplaced {
            return Some(refused(misplaced));
        }
        self.phase = Phase::Asking { since: at.now, asked: None };
        Some("the vehicle is asked to accept commands".into())
    }

    fn advance(&mut self, at: &Situation) -> (bool, Option<Cow<'static, str>>) {
        match self.phase {
            Phase::Idle => (false, None),
            Phase::Asking { .. } if at.misplaced.is_some() => {
                self.phase = Phase::Idle;
                (false, at.misplaced.map(refused))
            }
            Phase::Asking { since, .. } if at.now - since > self.timeout => {
                self.phase = Phase::Idle;
                let why = match (at.listens, at.driver) {
                    (Some(false), _) => "the vehicle does not listen: the switch is off",
                    (_, true) => "the driver acts: the switch is off",
                    _ => "the gate does not take the switch: it is off",
                };
                (false, Some(why.into()))
            }
            Phase::Asking { since, .. }
                if at.now - since >= OFF_MIN && at.ready && !at.driver && at.listens != Some(false) =>
            {
                self.phase = Phase::On { since: at.now, asking_since: since };
                self.was_engaged = false;
                (false, None)
            }
            Phase::Asking { since, asked } => {
                let ask = asked.is_none_or(|asked| at.now - asked >= ASK_EVERY);
                if ask {
                    self.phase = Phase::Asking { since, asked: Some(at.now) };
                }
                (ask, None)
            }
            Phase::On { since, asking_since } => (false, self.watch(at, since, asking_since)),
        }
    }

    /// Monitors the gate while the switch is on.
    fn watch(&mut self, at: &Situation, since: Time, asking_since: Time) -> Option<Cow<'static, str>> {
        if at.driver {
            self.phase = Phase::Idle;
            return Some("the driver took over".into());
        }
        if at.listens == Some(false) {
            self.phase = Phase::Idle;
            return Some("the vehicle listens no longer: the switch is off".into());
        }
        if at.mode != GateMode::Manual {
            self.was_engaged |= at.mode == GateMode::Driving;
        } else if !self.was_engaged && at.now - since > EDGE_MAX {
            // No valid command at that instant: give a new edge.
            self.phase = Phase::Asking { since: asking_since, asked: Some(at.now) };
        }
        None
    }
}

/// Message about a car that is not taken over.
fn refused(misplaced: Misplaced) -> Cow<'static, str> {
    format!("{misplaced}: the switch is off").into()
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Bench {
        engagement: Engagement,
        at: Situation,
    }

    impl Bench {
        fn new(by: EnableBy) -> Self {
            let at = Situation {
                now: Time::ZERO,
                ready: true,
                listens: Some(false),
                driver: true,
                mode: GateMode::Manual,
                misplaced: None,
            };
            Self { engagement: Engagement::new(by, Span::from_secs(5.0)), at }
        }

        /// Steps every 20 ms; the gate follows the switch.
        fn run(&mut self, ms: i64, requests: &[Request]) -> Action {
            let mut action = Action::default();
            let mut requests = requests;
            for _ in 0..ms / 20 {
                self.at.now += Span::from_ms(20);
                action = self.engagement.step(requests, &self.at);
                requests = &[];
                self.at.mode = match (action.switch.enable, self.at.driver) {
                    (true, false) => GateMode::Driving,
                    _ => GateMode::Manual,
                };
            }
            action
        }

        fn driving() -> Self {
            let mut bench = Self::new(EnableBy::Topic);
            assert!(bench.run(20, &[Request::Drive(true)]).ask);
            (bench.at.listens, bench.at.driver) = (Some(true), false);
            assert!(bench.run(140, &[]).switch.enable);
            bench
        }
    }

    #[test]
    fn engagement_gives_the_edge_once_the_vehicle_accepts_commands() {
        let mut bench = Bench::new(EnableBy::Topic);
        assert!(!bench.run(1000, &[]).ask, "nobody asked for it");
        assert!(bench.run(20, &[Request::Drive(true)]).ask);
        assert!(!bench.run(1000, &[]).switch.enable, "it does not listen");
        (bench.at.listens, bench.at.driver) = (Some(true), false);
        assert!(bench.run(20, &[]).switch.enable);
    }

    #[test]
    fn engagement_is_refused_while_the_car_is_off_its_route() {
        let off = Some(Misplaced::Across { angle_deg: 90.0 });
        let note = "the car heads 90 degrees off its route, more than 60: the switch is off";
        let mut bench = Bench::new(EnableBy::Topic);
        (bench.at.listens, bench.at.driver, bench.at.misplaced) = (Some(true), false, off);
        let action = bench.run(20, &[Request::Drive(true)]);
        assert_eq!((action.ask, action.note.as_deref()), (false, Some(note)));
        // Its return is not a user action.
        bench.at.misplaced = None;
        assert!(!bench.run(3000, &[]).switch.enable);
        assert!(bench.run(140, &[Request::Drive(true)]).switch.enable);
        // While the stack drives, this is no condition.
        bench.at.misplaced = off;
        assert!(bench.run(1000, &[]).switch.enable);
        // Its pose is known only after the request.
        let mut late = Bench::new(EnableBy::Topic);
        assert!(late.run(20, &[Request::Drive(true)]).ask);
        (late.at.listens, late.at.driver, late.at.misplaced) = (Some(true), false, off);
        let action = late.run(20, &[]);
        assert_eq!((action.switch.enable, action.note.as_deref()), (false, Some(note)));
        assert!(!late.run(1000, &[]).switch.enable);
    }

    #[test]
    fn engagement_at_start_is_a_single_request() {
        let mut bench = Bench::new(EnableBy::AtStart);
        bench.at.ready = false;
        assert!(!bench.run(20_000, &[]).ask);
        bench.at.ready = true;
        assert!(bench.run(20, &[]).ask);
        // The vehicle does not accept commands in time, and there is no further user action.
        bench.run(6000, &[]);
        (bench.at.listens, bench.at.driver) = (Some(true), false);
        assert!(!bench.run(1000, &[]).switch.enable);
    }

    #[test]
    fn engagement_requires_a_new_action_after_a_takeover() {
        let mut bench = Bench::driving();
        bench.at.driver = true;
        assert!(!bench.run(20, &[]).switch.enable);
        bench.at.driver = false;
        assert!(!bench.run(5000, &[]).switch.enable);
        // A topic that is repeated continuously is not a user action.
        let mut held = Bench::driving();
        for ms in 0..100 {
            held.at.driver = (20..40).contains(&ms);
            let on = held.run(100, &[Request::Drive(true)]).switch.enable;
            assert_eq!(on, ms < 20, "{ms}");
        }
        assert!(held.run(1500, &[]).switch == Switch::default());
        assert!(held.run(140, &[Request::Drive(true)]).switch.enable);
    }

    #[test]
    fn engagement_forwards_release_and_emergency() {
        let mut bench = Bench::driving();
        assert!(bench.run(20, &[Request::Emergency(true)]).switch.emergency);
        assert!(!bench.run(20, &[Request::Emergency(false)]).switch.emergency);
        assert!(!bench.run(20, &[Request::Drive(false)]).switch.enable);
        assert!(bench.run(140, &[Request::Drive(true)]).switch.enable, "a new act");
        bench.engagement.end();
        assert!(!bench.run(20, &[]).switch.enable);
        assert!(!bench.run(2000, &[Request::Drive(true)]).switch.enable, "it is over");
    }

    #[test]
    fn engagement_repeats_an_edge_that_the_gate_missed() {
        let mut bench = Bench::driving();
        bench.engagement.step(&[Request::Drive(false)], &bench.at);
        bench.at.mode = GateMode::Manual;
        let mut edges = 0;
        let mut before = false;
        let mut request = &[Request::Drive(true)][..];
        for _ in 0..100 {
            bench.at.now += Span::from_ms(20);
            let on = bench.engagement.step(request, &bench.at).switch.enable;
            request = &[];
            edges += i32::from(on && !before);
            before = on;
        }
        assert!(edges >= 3, "{edges}");
    }
}
