//! Read-only view of a vehicle driven by `swerve live`.

use swerve_drive::RunInput;
use swerve_drive::page::RunReport;
use swerve_drive::views::live_views;
use swerve_flow::{Event, Observer};
use swerve_foxglove::Foxglove;
use swerve_live::{Drive, LiveArgs, Onlooker, run_before};
use swerve_report::output::tell;
use swerve_stack::Registry;

use crate::drive::live_page;
use crate::foxglove::{Shown, Streams};
use crate::show::Show;

/// Drives with a configuration as `swerve live` does, and shows it.
///
/// # Errors
/// Same as [`run_before`].
pub(crate) fn drive(
    input: &RunInput,
    registry: &Registry,
    show: &Show,
    streams: Option<Streams>,
) -> anyhow::Result<()> {
    let mut watch = Watch { show, streams, shown: None };
    let driven = run_before(
        &LiveArgs::of(input.scenario.clone(), input.set.clone(), input.code()),
        registry,
        Some(&mut watch),
    );
    let missed = show.missed();
    if missed > 0 {
        tell(&format!(
            "the page did not show {missed} events, which came while it was written; the log has them"
        ));
    }
    driven
}

struct Watch<'a> {
    show: &'a Show,
    streams: Option<Streams>,
    shown: Option<Shown>,
}

impl Onlooker for Watch<'_> {
    fn begin(&mut self, drive: &Drive, command: String) -> anyhow::Result<()> {
        let Drive { config, scenario, .. } = drive;
        let report = RunReport::live(config, scenario, command)?;
        self.show.begin(live_page(self.show, &report, false, true), report, None, None, None);
        let views = || config.registry.with_views_of(Foxglove::new(live_views(config, scenario)));
        self.shown = self.streams.as_ref().map(|streams| streams.of_run(views()));
        Ok(())
    }
}

impl Observer for Watch<'_> {
    fn event(&mut self, event: &Event<'_>) {
        self.show.glimpse(event);
        if let Some(shown) = &mut self.shown {
            shown.event(event);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::show::Ask;

    #[test]
    fn vehicle_view_accepts_no_requests() {
        let show = Show::of_vehicle();
        for ask in
            [Ask::Go, Ask::Pause, Ask::Step, Ask::Speed { speed: None }, Ask::Restart(Default::default())]
        {
            assert_eq!(show.ask(ask), Err("this drive is only watched"));
        }
    }
}
