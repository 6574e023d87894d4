//! Progress of long work, on standard error.

use indicatif::{ProgressBar, ProgressStyle};

/// A progress bar; silent where standard error is no terminal.
pub struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// Counts the cells of a study.
    pub fn cells(count: usize) -> Self {
        let bar = ProgressBar::new(count as u64);
        bar.set_style(style("{bar:32} {pos}/{len} cells  {elapsed}  {eta} left"));
        Self { bar }
    }

    /// Counts drives.
    pub fn drives(count: usize) -> Self {
        let bar = ProgressBar::new(count as u64);
        bar.set_style(style("{bar:32} {pos}/{len} drives  {elapsed}  {eta} left"));
        Self { bar }
    }

    /// Counts detectors that are fitted.
    pub fn fits(count: usize) -> Self {
        let bar = ProgressBar::new(count as u64);
        bar.set_style(style("{bar:32} {pos}/{len} detectors fitted  {elapsed}  {eta} left"));
        Self { bar }
    }

    /// Counts the configurations that a study's checks look at.
    pub fn checks(count: usize) -> Self {
        let bar = ProgressBar::new(count as u64);
        bar.set_style(style("{bar:32} {pos}/{len} configurations checked  {elapsed}  {eta} left"));
        Self { bar }
    }

    /// Follows simulated time, in tenths of a second.
    pub fn simulated(until_s: f64) -> Self {
        let bar = ProgressBar::new((until_s * 10.0) as u64);
        bar.set_style(style("{bar:32} {msg}  {elapsed}"));
        Self { bar }
    }

    /// One more of what is counted is done.
    pub fn one_done(&self) {
        self.bar.inc(1);
    }

    /// Says something on a line of its own, above the bar.
    pub fn tell(&self, line: &str) {
        self.bar.suspend(|| eprintln!("{line}"));
    }

    /// The run reached `now_s` seconds of simulated time.
    pub fn simulated_to(&self, now_s: f64) {
        self.bar.set_position((now_s * 10.0) as u64);
        self.bar.set_message(format!("{now_s:.1} s simulated"));
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// How a drive with a vehicle goes: a line in place, and what happens above it; where standard error is no terminal,
/// what happens alone.
pub struct LiveLine {
    bar: ProgressBar,
    tells: bool,
}

impl LiveLine {
    /// Tells at all?
    pub fn new(tells: bool) -> Self {
        let bar = if tells { ProgressBar::new_spinner() } else { ProgressBar::hidden() };
        bar.set_style(style("{msg}"));
        Self { bar, tells }
    }

    /// How it goes now.
    pub fn progress(&self, line: &str) {
        self.bar.set_message(line.to_owned());
        self.bar.tick();
    }

    /// What has happened, at this second.
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
