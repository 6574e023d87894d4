//! What the run, the server and Ctrl-C share: the run as far as it goes, and what is asked of it.

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
/// How long a page that has everything waits for more.
const WAIT: Duration = Duration::from_millis(500);

pub(crate) fn is_speed(times: f64) -> bool {
    (0.01..=1000.0).contains(&times)
}

/// What a page may ask for.
#[derive(Deserialize, Debug)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum Ask {
    /// Go on.
    Go,
    /// Hold at the next frame.
    Pause,
    /// Go on to the next frame and hold.
    Step,
    /// Times real time; none as fast as it comes.
    Speed { speed: Option<f64> },
    /// Begin again, as told on top of the command line.
    Restart(Begin),
    /// Pedals and steering, in a run that is driven by hand.
    Hold(Held),
}

/// What a run is begun with.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Begin {
    /// In the place of the command line's.
    pub(crate) seed: Option<i64>,
    /// Keys of the configuration or the scenario on top of the command line's, as `KEY=VALUE`.
    pub(crate) set: Vec<String>,
    /// Whether a person drives in the place of the controller.
    pub(crate) by_hand: bool,
    /// Seconds of the run before that are driven again as they were, with its seed and the keys that it had too; what is set
    /// now drives from there on.
    pub(crate) from_s: Option<f64>,
}

/// What a run came to.
#[derive(Clone, Default, Serialize)]
pub(crate) struct Over {
    pub(crate) verdict: Option<String>,
    pub(crate) digest: Option<String>,
    pub(crate) problem: Option<String>,
}

#[derive(Default)]
struct State {
    /// The how manieth run it is.
    run: u64,
    page: String,
    whole: Option<String>,
    report: Option<RunReport>,
    looks: Looks,
    /// Where a person drives it.
    wheel: Option<Wheel>,
    over: Option<Over>,
    holds: bool,
    steps: u32,
    speed: Option<f64>,
    /// Before this instant it goes as the run before did, and is held back by nothing.
    from: Option<Time>,
    /// The real and the virtual instant from which on it keeps time.
    since: Option<(Instant, Time)>,
    stop: Option<StopHandle>,
    next: Option<Begin>,
    quits: bool,
    /// Whether it is a vehicle that is shown: nothing can be asked of it.
    watch_only: bool,
}

/// The run that is shown.
#[derive(Default)]
pub(crate) struct Show {
    state: Mutex<State>,
    changed: Condvar,
    /// Events that the page of a vehicle lacks.
    missed: AtomicU64,
}

/// What a page has.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(crate) struct Has {
    #[serde(flatten)]
    have: Have,
    /// The instant of the newest look, microseconds.
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
    /// Where the run begins to be new.
    pub(crate) fn from(&self) -> Option<Time> {
        self.from_s.map(|from_s| Time::ZERO + Span::from_secs(from_s))
    }
}

impl Show {
    pub(crate) fn new(speed: Option<f64>, holds: bool) -> Self {
        Self { state: Mutex::new(State { speed, holds, ..State::default() }), ..Self::default() }
    }

    /// Of a vehicle: nothing holds it back and nothing can be asked of it.
    pub(crate) fn of_vehicle() -> Self {
        Self { state: Mutex::new(State { watch_only: true, ..State::default() }), ..Self::default() }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A page that stays as it is.
    pub(crate) fn set_page(&self, page: String) {
        self.state().page = page;
    }

    /// The number and the speed of the run that is about to begin.
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
        // What is asked for before the run has begun stops it too.
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

    /// Changes what is known of the run.
    pub(crate) fn with_report<T>(&self, act: impl FnOnce(&mut RunReport) -> T) -> Option<T> {
        self.state().report.as_mut().map(act)
    }

    /// Takes in what happens without ever waiting: what comes while a page is being written is left out of the page.
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

    /// How many events the page lacks.
    pub(crate) fn missed(&self) -> u64 {
        self.missed.load(Ordering::Relaxed)
    }

    /// Takes in what a sensor saw, if a page waits for it.
    pub(crate) fn look(&self, stream: &str, stamp: Time, make: impl FnOnce() -> Option<Sight>) {
        let wanted = self.state().looks.wants(stream);
        if let Some(sight) = wanted.then(make).flatten() {
            self.state().looks.keep(stream, stamp, sight);
        }
    }

    /// Lets the run go on from a frame when it is due, by the real clock and by what the page asks for. Nothing of
    /// the run depends on how long that takes.
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

    /// What to begin with next; none where it is over.
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

    /// The page, as soon as there is one.
    pub(crate) fn page(&self) -> String {
        let none_yet = |state: &mut State| state.page.is_empty() && !state.quits;
        let waited = self.changed.wait_while(self.state(), none_yet);
        waited.unwrap_or_else(PoisonError::into_inner).page.clone()
    }

    pub(crate) fn whole(&self) -> Option<String> {
        self.state().whole.clone()
    }

    /// Does what a page asks for; a restart has been checked.
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

    /// The rows that a page does not have, as JSON; waits a little where there are none.
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
