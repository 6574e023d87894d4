//! Progress of long work, on standard error: a bar in a terminal, otherwise occasional lines.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use swerve_flow::{Event, Observer, Sent};
use swerve_msg::EgoState;

/// Progress of long work.
pub struct Progress {
    bar: ProgressBar,
    _lines: Option<Lines>,
}

impl Progress {
    /// Counts the cells of a study.
    pub fn cells(count: usize) -> Self {
        Self::counting(count, "cells")
    }

    /// Counts simulated drives.
    pub fn drives(count: usize) -> Self {
        Self::counting(count, "drives")
    }

    /// Counts fitted detectors.
    pub fn fits(count: usize) -> Self {
        Self::counting(count, "detectors fitted")
    }

    /// Counts parts of a model in training, such as `trees grown`.
    pub fn learning(count: usize, parts: &'static str) -> Self {
        Self::counting(count, parts)
    }

    /// Counts the configurations that a study checks.
    pub fn checks(count: usize) -> Self {
        Self::counting(count, "configurations checked")
    }

    fn counting(count: usize, what: &'static str) -> Self {
        let bar = ProgressBar::new(count as u64);
        bar.set_style(style(&format!("{{bar:32}} {{pos}}/{{len}} {what}  {{elapsed}}  {{eta}} left")));
        let line = move |bar: &ProgressBar| format!("{} of {count} {what}", bar.position());
        Self { _lines: Lines::begin(&bar, line), bar }
    }

    /// Follows simulated time, in steps of a tenth of a second.
    pub fn simulated(until_s: f64) -> Self {
        let bar = ProgressBar::new((until_s * 10.0) as u64);
        bar.set_style(style("{bar:32} {msg}  {elapsed}"));
        let line = move |bar: &ProgressBar| {
            format!("{:.1} s simulated of at most {until_s}", bar.position() as f64 * 0.1)
        };
        Self { _lines: Lines::begin(&bar, line), bar }
    }

    /// Advances the count by one.
    pub fn one_done(&self) {
        self.bar.inc(1);
    }

    /// Prints a line above the bar.
    pub fn tell(&self, line: &str) {
        self.bar.suspend(|| eprintln!("{line}"));
    }

    /// Reports that the run reached `now_s` seconds of simulated time.
    pub fn simulated_to(&self, now_s: f64) {
        self.bar.set_position((now_s * 10.0) as u64);
        self.bar.set_message(format!("{now_s:.1} s simulated"));
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// Follows a run by the stamps of its ego states.
impl Observer for Progress {
    fn event(&mut self, event: &Event<'_>) {
        if let Event::Publication(publication) = event
            && publication.payload.is_some_and(Sent::is::<EgoState>)
        {
            self.simulated_to(publication.visible_at.as_secs());
        }
    }

    fn wants_host_time(&self) -> bool {
        false
    }
}

/// Occasional progress lines in place of a hidden bar, printed by a thread, since one step of the work may take long.
struct Lines {
    /// Dropping this ends the thread.
    _end: Sender<()>,
}

/// Time to the first line, and minimum spacing.
const FIRST: Duration = Duration::from_secs(10);

/// Maximum number of lines.
const LINES_MAX: usize = 20;

impl Lines {
    /// Starts the lines if the bar is hidden; `None` if it is visible.
    fn begin(bar: &ProgressBar, line: impl Fn(&ProgressBar) -> String + Send + 'static) -> Option<Self> {
        if !bar.is_hidden() {
            return None;
        }
        let (end, ended) = channel::<()>();
        let bar = bar.clone();
        let say = move || {
            let mut now = Duration::ZERO;
            for at in instants() {
                match ended.recv_timeout(at - now) {
                    Err(RecvTimeoutError::Timeout) if !bar.is_finished() => {
                        crate::output::tell(&format!("{}, after {} s", line(&bar), at.as_secs()));
                    }
                    _ => return,
                }
                now = at;
            }
        };
        // If the thread cannot be started, no lines are printed.
        std::thread::Builder::new().name("progress".into()).spawn(say).ok()?;
        Some(Self { _end: end })
    }
}

/// Times of the lines since the start of the work: ten seconds apart at first, then at growing intervals, so that hours
/// of work need few lines.
fn instants() -> impl Iterator<Item = Duration> {
    let next = |at: &Duration| Some(*at + FIRST.max(*at / 2));
    std::iter::successors(Some(FIRST), next).take(LINES_MAX)
}

/// Status of a drive with a vehicle: a line updated in place, with events printed above it. If standard error is not a
/// terminal, events and occasional status lines.
pub struct LiveLine {
    bar: ProgressBar,
    tells: bool,
    _lines: Option<Lines>,
}

impl LiveLine {
    /// Creates the status line; if `tells` is false, nothing is printed.
    pub fn new(tells: bool) -> Self {
        let bar = if tells { ProgressBar::new_spinner() } else { ProgressBar::hidden() };
        bar.set_style(style("{msg}"));
        let lines = tells.then(|| Lines::begin(&bar, ProgressBar::message)).flatten();
        Self { bar, tells, _lines: lines }
    }

    /// Updates the status.
    pub fn progress(&self, line: &str) {
        self.bar.set_message(line.to_owned());
        self.bar.tick();
    }

    /// Prints an event with its time in seconds.
    pub fn note(&self, at_s: f64, what: &str) {
        if self.tells {
            self.bar.suspend(|| eprintln!("{at_s:6.1} s  {what}"));
        }
    }
}

impl Drop for LiveLine {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_lines_are_few_and_start_ten_seconds_apart() {
        let at: Vec<u64> = instants().map(|at| at.as_secs()).collect();
        assert_eq!(at[..5], [10, 20, 30, 45, 67]);
        assert!(at.len() <= 20 && *at.last().unwrap() > 8 * 3600, "{at:?}");
    }
}
