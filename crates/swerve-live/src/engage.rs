//! From a person's request to the edge of the gate's switch.
//!
//! The gate takes a rising edge for an act, and wants all to be well at that instant. A vehicle takes a moment until
//! it listens, and says so in its reports. So the edge comes when the vehicle listens, no driver acts, and all topics
//! that are needed are there; the vehicle is asked until then, but not for ever.
//!
//! Pure: the instant is an input.

use swerve_core::{Span, Time};
use swerve_msg::{GateMode, Switch};
use swerve_stack::config::live::EnableBy;

use super::intake::Request;

/// Between two requests to the vehicle.
const ASK_EVERY: Span = Span::from_ms(200);
/// Requests to drive that come closer than this are one act: a button that is held, a topic that is repeated.
const ACT_GAP: Span = Span::from_ms(1000);
/// For so long at least the switch is off before it goes on, so that the gate sees an edge.
const OFF_MIN: Span = Span::from_ms(100);
/// How long the gate may take to follow the edge.
const EDGE_MAX: Span = Span::from_ms(300);

/// The state of vehicle, person and gate at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Situation {
    /// The instant.
    pub now: Time,
    /// Whether all that is needed was heard lately.
    pub ready: bool,
    /// Whether the vehicle listens to commands, if it says so.
    pub listens: Option<bool>,
    /// Whether the driver acts.
    pub driver: bool,
    /// The gate's mode.
    pub mode: GateMode,
}

/// The next action.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Action {
    /// For the gate.
    pub switch: Switch,
    /// Ask the vehicle to listen.
    pub ask: bool,
    /// A word for the person.
    pub note: Option<&'static str>,
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Phase {
    /// Nobody wants to drive.
    Idle,
    /// The vehicle is asked to accept commands.
    Asking { since: Time, asked: Option<Time> },
    /// The switch is on, since then; asked since.
    On { since: Time, asking_since: Time },
}

/// The state machine.
#[derive(Clone, Debug)]
pub struct Engagement {
    timeout: Span,
    /// The start of the program is an act that has not been done yet.
    at_start: bool,
    phase: Phase,
    last_request: Option<Time>,
    emergency: bool,
    over: bool,
    was_engaged: bool,
}

impl Engagement {
    /// With nobody wanting anything.
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

    /// From here on nobody drives any more.
    pub fn end(&mut self) {
        self.over = true;
    }

    /// Takes in what persons requested.
    pub fn step(&mut self, requests: &[Request], at: &Situation) -> Action {
        let mut note = None;
        for request in requests {
            match *request {
                Request::Emergency(stop) => self.emergency = stop,
                Request::Drive(false) => {
                    self.last_request = None;
                    if self.phase != Phase::Idle {
                        note = Some("the switch was released");
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

    /// A person acts.
    fn press(&mut self, at: &Situation) -> Option<&'static str> {
        let drives = matches!(self.phase, Phase::On { .. }) && at.mode == GateMode::Driving;
        if drives || self.over {
            return None;
        }
        if !at.ready {
            return Some("not all topics that are needed are there: the switch is off");
        }
        self.phase = Phase::Asking { since: at.now, asked: None };
        Some("the vehicle is asked to accept commands")
    }

    fn advance(&mut self, at: &Situation) -> (bool, Option<&'static str>) {
        match self.phase {
            Phase::Idle => (false, None),
            Phase::Asking { since, .. } if at.now - since > self.timeout => {
                self.phase = Phase::Idle;
                let why = match (at.listens, at.driver) {
                    (Some(false), _) => "the vehicle does not listen: the switch is off",
                    (_, true) => "the driver acts: the switch is off",
                    _ => "the gate does not take the switch: it is off",
                };
                (false, Some(why))
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

    /// While the switch is on.
    fn watch(&mut self, at: &Situation, since: Time, asking_since: Time) -> Option<&'static str> {
        if at.driver {
            self.phase = Phase::Idle;
            return Some("the driver took over");
        }
        if at.listens == Some(false) {
            self.phase = Phase::Idle;
            return Some("the vehicle listens no longer: the switch is off");
        }
        if at.mode != GateMode::Manual {
            self.was_engaged |= at.mode == GateMode::Driving;
        } else if !self.was_engaged && at.now - since > EDGE_MAX {
            // There was no sound command at that instant: a new edge.
            self.phase = Phase::Asking { since: asking_since, asked: Some(at.now) };
        }
        None
    }
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
    fn the_edge_comes_when_the_vehicle_listens() {
        let mut bench = Bench::new(EnableBy::Topic);
        assert!(!bench.run(1000, &[]).ask, "nobody asked for it");
        assert!(bench.run(20, &[Request::Drive(true)]).ask);
        assert!(!bench.run(1000, &[]).switch.enable, "it does not listen");
        (bench.at.listens, bench.at.driver) = (Some(true), false);
        assert!(bench.run(20, &[]).switch.enable);
    }

    #[test]
    fn the_start_is_one_act() {
        let mut bench = Bench::new(EnableBy::AtStart);
        bench.at.ready = false;
        assert!(!bench.run(20_000, &[]).ask);
        bench.at.ready = true;
        assert!(bench.run(20, &[]).ask);
        // It does not listen in time, and nobody acts again.
        bench.run(6000, &[]);
        (bench.at.listens, bench.at.driver) = (Some(true), false);
        assert!(!bench.run(1000, &[]).switch.enable);
    }

    #[test]
    fn a_driver_who_took_over_has_to_be_relieved_by_an_act() {
        let mut bench = Bench::driving();
        bench.at.driver = true;
        assert!(!bench.run(20, &[]).switch.enable);
        bench.at.driver = false;
        assert!(!bench.run(5000, &[]).switch.enable);
        // A topic that is repeated all the time is no act.
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
    fn letting_go_and_emergencies_reach_the_gate() {
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
    fn an_edge_that_the_gate_did_not_take_is_given_again() {
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
