//! The log of a run while it is driven: what becomes of the run when the log cannot be written any more.

use swerve_flow::{Event, Observer, StopHandle};
use swerve_log::{LogError, Recorder};

use crate::config::clock::Clock;

/// Records a run. When that fails it is said at once, on standard error; a run in virtual time ends then, one against
/// the real clock drives on.
pub struct Recording {
    recorder: Recorder,
    /// Ends the run.
    stop: Option<StopHandle>,
    told: bool,
}

impl Recording {
    /// Of a run that this clock moves.
    pub fn new(recorder: Recorder, clock: Clock, stop: StopHandle) -> Self {
        let stop = (clock == Clock::Virtual).then_some(stop);
        Self { recorder, stop, told: false }
    }

    /// Waits until all is written.
    ///
    /// # Errors
    /// What failed, once more.
    pub fn finish(self) -> Result<u64, LogError> {
        self.recorder.finish()
    }

    fn tell(&mut self) {
        let Some(error) = self.recorder.failure() else { return };
        self.told = true;
        let bytes = std::fs::metadata(self.recorder.path()).map_or(0, |file| file.len());
        let then = if self.stop.is_some() { "the run ends" } else { "the run drives on without its log" };
        #[expect(clippy::print_stderr, reason = "it cannot wait until the end")]
        {
            eprintln!("warning: {error} ({bytes} bytes are written); {then}");
        }
        if let Some(stop) = &self.stop {
            stop.stop();
        }
    }
}

impl Observer for Recording {
    fn event(&mut self, event: &Event<'_>) {
        self.recorder.event(event);
        if !self.told {
            self.tell();
        }
    }
}
