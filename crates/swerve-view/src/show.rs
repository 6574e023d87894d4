//! State shared by the run, the server and Ctrl-C: the run so far, and requests for it.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_drive::page::RunReport;
use swerve_flow::{Event, Observer as _, StopHandle};
use swerve_report::page::{Have, Rows};

use crate::looks::{Looks, Sight};
use crate::wheel::{Held, Wheel};

pub(crate) const NO_SPEED: &str = "expected a number from 0.01 to 1000, or max";
/// Time that a page without new data to fetch waits.
const WAIT: Duration = Duration::from_millis(500);

pub(crate) fn is_speed(times: f64) -> bool {
    (0.01..=1000.0).contains(&times)
}

/// A request of a page.
#[derive(Deserialize, Debug)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum Ask {
    /// Continue.
    Go,
    /// Pause at the next frame.
    Pause,
    /// Continue to the next frame and pause.
    Step,
    /// Set the multiple of real time; `None` for as fast as possible.
    Speed { speed: Option<f64> },
    /// Restart with these parameters on top of the command line.
    Restart(Begin),
    /// Pedals and steering in a manually driven run.
    Hold(Held),
}

/// Start parameters of a run.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Begin {
    /// Seed in place of the command line's.
    pub(crate) seed: Option<i64>,
    /// Keys of the configuration or the scenario on top of the command line's, as `KEY=VALUE`.
    pub(crate) set: Vec<String>,
    /// True if a person drives in place of the controller.
    pub(crate) by_hand: bool,
    /// Seconds of the previous run that are repeated unchanged, with its seed and keys; the new settings apply from
    /// there on.
    pub(crate) from_s: Option<f64>,
}

/// Result of a run.
#[derive(Clone, Default, Serialize)]
pub(crate) struct Over {
    pub(crate) verdict: Option<String>,
    pub(crate) digest: Option<String>,
    pub(crate) problem: Option<String>,
}

#[derive(Default)]
struct State {
    /// Number of the run.
    run: u64,
    page: String,
    whole: Option<String>,
    report: Option<RunReport>,
    looks: Looks,
    /// Manual controls, if a person drives.
    wheel: Option<Wheel>,
    over: Option<Over>,
    holds: bool,
    steps: u32,
    speed: Option<f64>,
    /// Instant until which the run repeats the previous one, without pacing.
    from: Option<Time>,
    /// Real and virtual instant from which on the run is paced.
    since: Option<(Instant, Time)>,
    stop: Option<StopHandle>,
    next: Option<Begin>,
    quits: bool,
    /// True if a vehicle is shown: no requests are accepted.
    watch_only: bool,
}

/// The run shown.
#[derive(Default)]
pub(crate) struct Show {
    state: Mutex<State>,
    changed: Condvar,
    /// Number of events missing from the page of a vehicle.
    missed: AtomicU64,
}

/// State of a page.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(crate) struct Has {
    #[serde(flatten)]
    have: Have,
    /// Stamp of the newest sensor item, microseconds; -1 for none.
    #[serde(default = "before")]
    looked: i64,
}

fn before() -> i64 {
    -1
}

/// Rows for a page.
#[derive(Serialize)]
struct Told<'a> {
    looks: serde_json::Value,
    run: u64,
    state: &'a str,
    #[serde(flatten)]
    rows: Option<Rows>,
    #[serde(flatten)]
    over: Option<&'a Over>,
}

impl Begin {
    /// Instant from which on the run differs.
    pub(crate) fn from(&self) -> Option<Time> {
        self.from_s.map(|from_s| Time::ZERO + Span::from_secs(from_s))
    }
}

impl Show {
    pub(crate) fn new(speed: Option<f64>, holds: bool) -> Self {
        Self { state: Mutex::new(State { speed, holds, ..State::default() }), ..Self::default() }
    }

    /// State for a vehicle: no pacing and no requests.
    pub(crate) fn of_vehicle() -> Self {
        Self { state: Mutex::new(State { watch_only: true, ..State::default() }), ..Self::default() }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sets a static page.
    pub(crate) fn set_page(&self, page: String) {
        self.state().page = page;
    }

    /// Number and speed of the next run.
    pub(crate) fn upcoming(&self) -> (u64, Option<f64>) {
        let state = self.state();
        (state.run + 1, state.speed)
    }

    pub(crate) fn begin(
        &self,
        page: String,
        report: RunReport,
        wheel: Option<Wheel>,
        stop: Option<StopHandle>,
        from: Option<Time>,
    ) {
        let mut state = self.state();
        // A request that arrives before the run has started stops it too.
        if let Some(stop) = stop.as_ref().filter(|_| state.quits || state.next.is_some()) {
            stop.stop();
        }
        let (holds, speed, next, quits) = (state.holds, state.speed, state.next.take(), state.quits);
        let (run, watch_only, report) = (state.run + 1, state.watch_only, Some(report));
        *state = State {
            run,
            page,
            report,
            wheel,
            stop,
            from,
            holds,
            speed,
            next,
            quits,
            watch_only,
            ..State::default()
        };
        self.changed.notify_all();
    }

    /// Modifies the report of the run.
    pub(crate) fn with_report<T>(&self, act: impl FnOnce(&mut RunReport) -> T) -> Option<T> {
        self.state().report.as_mut().map(act)
    }

    /// Adds an event without ever waiting: events during the writing of a page are left out of the page.
    pub(crate) fn glimpse(&self, event: &Event<'_>) {
        let mut state = match self.state.try_lock() {
            Ok(state) => state,
            Err(TryLockError::Poisoned(state)) => state.into_inner(),
            Err(TryLockError::WouldBlock) => {
                self.missed.fetch_add(1, Ordering::Relaxed);
                return;
            }
        };
        if let Some(report) = &mut state.report {
            report.event(event);
        }
    }

    /// Number of events missing from the page.
    pub(crate) fn missed(&self) -> u64 {
        self.missed.load(Ordering::Relaxed)
    }

    /// Adds sensor data if a page waits for it.
    pub(crate) fn look(&self, stream: &str, stamp: Time, make: impl FnOnce() -> Option<Sight>) {
        let wanted = self.state().looks.wants(stream);
        if let Some(sight) = wanted.then(make).flatten() {
            self.state().looks.keep(stream, stamp, sight);
        }
    }

    /// Delays the run at a frame until it is due, by the wall clock and the page's requests. The run does not depend on
    /// the delay.
    #[expect(
        clippy::disallowed_methods,
        reason = "a person watches in real time; the run depends on none of it"
    )]
    pub(crate) fn frame(&self, now: Time, speed_mps: f64) {
        let mut state = self.state();
        if let Some(wheel) = &mut state.wheel {
            wheel.speed_mps = speed_mps;
        }
        self.changed.notify_all();
        loop {
            if state.quits || state.next.is_some() || state.from.is_some_and(|from| now < from) {
                return;
            }
            if state.holds && state.steps == 0 {
                state.since = None;
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
                continue;
            }
            if state.holds {
                state.steps -= 1;
                return;
            }
            let Some(times) = state.speed else { return };
            let (real, begun) = *state.since.get_or_insert_with(|| (Instant::now(), now));
            let due = real + Duration::from_secs_f64((now - begun).as_secs().max(0.0) / times);
            let left = due.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return;
            }
            state = self.changed.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    pub(crate) fn end(&self, over: Over, whole: Option<String>) {
        let mut state = self.state();
        (state.over, state.whole, state.stop) = (Some(over), whole, None);
        self.changed.notify_all();
    }

    /// Start parameters of the next run; `None` at the end.
    pub(crate) fn next(&self) -> Option<Begin> {
        let mut state = self.state();
        while !state.quits && state.next.is_none() {
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        if state.quits { None } else { state.next.take() }
    }

    pub(crate) fn wait_for_quit(&self) {
        while self.next().is_some() {}
    }

    pub(crate) fn quit(&self) {
        self.interrupt(|state| state.quits = true);
    }

    fn interrupt(&self, act: impl FnOnce(&mut State)) {
        let mut state = self.state();
        act(&mut state);
        if let Some(stop) = &state.stop {
            stop.stop();
        }
        self.changed.notify_all();
    }

    /// Page, once there is one.
    pub(crate) fn page(&self) -> String {
        let none_yet = |state: &mut State| state.page.is_empty() && !state.quits;
        let waited = self.changed.wait_while(self.state(), none_yet);
        waited.unwrap_or_else(PoisonError::into_inner).page.clone()
    }

    pub(crate) fn whole(&self) -> Option<String> {
        self.state().whole.clone()
    }

    /// Executes a request of a page; a restart has been checked before.
    pub(crate) fn ask(&self, ask: Ask) -> Result<(), &'static str> {
        if self.state().watch_only {
            return Err("this drive is only watched");
        }
        if let Ask::Restart(with) = ask {
            if with.from_s.is_some_and(|from_s| !(0.0..=1e6).contains(&from_s)) {
                return Err("expected from_s from 0 to 1000000 seconds");
            }
            self.interrupt(|state| state.next = Some(with));
            return Ok(());
        }
        let mut state = self.state();
        if let Ask::Hold(held) = ask {
            return state.wheel.as_ref().ok_or("this run is not driven by hand")?.hold(held);
        }
        match ask {
            Ask::Go => (state.holds, state.steps) = (false, 0),
            Ask::Pause => (state.holds, state.steps) = (true, 0),
            Ask::Step => (state.holds, state.steps) = (true, state.steps.saturating_add(1)),
            Ask::Speed { speed: Some(times) } if !is_speed(times) => return Err(NO_SPEED),
            Ask::Speed { speed } => state.speed = speed,
            Ask::Restart(_) | Ask::Hold(_) => {}
        }
        state.since = None;
        self.changed.notify_all();
        Ok(())
    }

    /// Rows missing from a page, as JSON; waits for a short time if there are none.
    pub(crate) fn rows(&self, Has { have, looked }: &Has) -> String {
        let state = self.state();
        let nothing_new = |state: &mut State| {
            let ego = state.report.as_ref().map(|report| report.so_far().ego.t.last().copied());
            state.over.is_none() && ego.is_none_or(|ego| ego == have.ego)
        };
        let waited = self.changed.wait_timeout_while(state, WAIT, nothing_new);
        let (mut state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let looks = state.looks.since(*looked);
        let rows = state.report.as_ref().map(|report| report.rows(have));
        let how = match () {
            () if state.over.is_some() => "over",
            () if state.holds => "paused",
            () => "running",
        };
        let told = Told { looks, run: state.run, state: how, rows, over: state.over.as_ref() };
        serde_json::to_string(&told).expect("rows are plain structs")
    }
}
