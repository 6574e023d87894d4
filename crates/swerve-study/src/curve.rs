//! Time curves of a study: for every combination the median over its seeds, with quartiles.

use std::sync::atomic::AtomicBool;

use swerve_core::{Span, Time};
use swerve_draw::color::{Look, looks_repeat, series as look_of};
use swerve_draw::{Axes, Canvas, Picture, Style, Text, names_beside};
use swerve_drive::{Outcome, drive_unless};
use swerve_flow::{Event, Observer};
use swerve_msg::Imu;
use swerve_msg::truth::WorldState;
use swerve_report::output::align;
use swerve_scenario::Scenario;
use swerve_stack::Setup;

use super::grid::Study;
use super::result::CellResult;
use super::tables::Curve;

/// Sampling interval: Pylot's sensors run at 20 Hz.
const EVERY: Span = Span::from_ms(50);

/// Collects the lateral accelerations of a run.
#[derive(Default)]
struct Readings {
    lateral_mps2: Vec<f64>,
    touched: bool,
}

impl Observer for Readings {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload else { return };
        if let Some(world) = payload.downcast_ref::<WorldState>() {
            self.touched |= world.collisions_of_ego().next().is_some();
        }
        if let Some(imu) = payload.downcast_ref::<Imu>() {
            let due = Time::ZERO + EVERY * self.lateral_mps2.len() as i64;
            if !self.touched && imu.stamp >= due {
                self.lateral_mps2.push(imu.accel_mps2[1]);
            }
        }
    }
}

impl Curve {
    /// Drives the scenario, until `stop` is set. Returns the outcome and the curve.
    pub(super) fn drive(
        self,
        config: &Setup,
        scenario: &Scenario,
        stop: &AtomicBool,
    ) -> anyhow::Result<(Outcome, Vec<f64>)> {
        let mut readings = Readings::default();
        let outcome = drive_unless(stop, config, scenario, &mut [&mut readings])?;
        let jerk = readings.lateral_mps2.windows(2).map(|pair| (pair[1] - pair[0]) / EVERY.as_secs());
        Ok((outcome, jerk.collect()))
    }

    /// Peak and root mean square of each combination's runs, as medians over the runs.
    pub(super) fn text(self, study: &Study, results: &[Option<CellResult>]) -> String {
        let head = [self.title(), "largest (quartiles)", "root mean square"].map(str::to_owned).to_vec();
        let lines = series(study, results).into_iter().map(|series| {
            let largest = |curve: &&Vec<f64>| curve.iter().fold(0.0_f64, |most, j| most.max(j.abs()));
            let mean_square = |curve: &&Vec<f64>| {
                (curve.iter().map(|j| j * j).sum::<f64>() / curve.len().max(1) as f64).sqrt()
            };
            let most = quartiles(series.curves.iter().map(largest).collect());
            let rms = quartiles(series.curves.iter().map(mean_square).collect());
            let name = format!("{} {}", series.panel, series.name);
            vec![name, format!("{:.0} ({:.0}-{:.0})", most[1], most[0], most[2]), format!("{:.1}", rms[1])]
        });
        align(&std::iter::once(head).chain(lines).collect::<Vec<_>>())
    }

    fn title(self) -> &'static str {
        match self {
            Self::LateralJerk => "lateral jerk, m/s\u{b3}",
        }
    }

    /// Draws a panel for every combination of all axes but the last, with one line per step of the last.
    pub(super) fn draw(self, study: &Study, results: &[Option<CellResult>]) -> Picture {
        let all = series(study, results);
        let mut panels: Vec<&str> = all.iter().map(|series| series.panel.as_str()).collect();
        panels.dedup();
        let bands: Vec<Vec<[f64; 3]>> = all.iter().map(Series::bands).collect();
        let scale = Scale::of(&bands);
        let mut canvas = Canvas::default();
        let title = if study.description.is_empty() { &study.name } else { &study.description };
        canvas.text((LEFT, 28.0), title, Text::TITLE);
        let mut width = LEFT + PANEL_W + 24.0;
        for (row, panel) in panels.iter().enumerate() {
            let top = TOP + row as f64 * (PANEL_H + GAP);
            scale.draw_axes(&mut canvas, top, &format!("{panel}: {}", self.title()));
            let of_panel = all.iter().zip(&bands).filter(|(series, _)| series.panel == *panel);
            if let Some(note) = looks_repeat(of_panel.clone().count()) {
                canvas.text((LEFT, top + PANEL_H + 44.0), &note, Text::SOFT);
            }
            let mut names: Vec<(Style, String)> = Vec::new();
            for (k, (series, band)) in of_panel.enumerate() {
                scale.draw_band(&mut canvas, top, (band, look_of(k)));
                names.push((look_of(k).line(LINE_W), series.name.clone()));
            }
            let used = names_beside(&mut canvas, (LEFT + PANEL_W + 12.0, top), &names);
            width = width.max(LEFT + PANEL_W + 12.0 + used + 16.0);
        }
        let height = TOP + panels.len() as f64 * (PANEL_H + GAP) + 10.0;
        canvas.finish(width, height, title)
    }
}

const LEFT: f64 = 64.0;
const TOP: f64 = 56.0;
const PANEL_W: f64 = 760.0;
const PANEL_H: f64 = 220.0;
const GAP: f64 = 56.0;

/// Width of a line.
const LINE_W: f64 = 1.6;

/// Runs of one combination.
struct Series<'a> {
    /// Labels of all axes but the last.
    panel: String,
    /// Label of the last axis.
    name: String,
    curves: Vec<&'a Vec<f64>>,
}

/// All combinations in the order of the study, with seeds merged.
fn series<'a>(study: &Study, results: &'a [Option<CellResult>]) -> Vec<Series<'a>> {
    let shown: Vec<usize> = (0..study.axes.len()).filter(|&a| study.axes[a] != "seed").collect();
    let mut all: Vec<Series<'a>> = Vec::new();
    for result in results.iter().flatten().filter(|result| !result.curve.is_empty()) {
        let labels: Vec<&str> = shown.iter().map(|&a| result.labels[a].as_str()).collect();
        let (name, panel) = labels.split_last().map_or(("", String::new()), |(n, p)| (*n, p.join(" ")));
        match all.iter_mut().find(|series| series.panel == panel && series.name == name) {
            Some(series) => series.curves.push(&result.curve),
            None => all.push(Series { panel, name: name.to_owned(), curves: vec![&result.curve] }),
        }
    }
    all
}

impl Series<'_> {
    /// Quartiles at each instant that at least half of the runs reach.
    fn bands(&self) -> Vec<[f64; 3]> {
        let at = |k: usize| self.curves.iter().filter_map(|curve| curve.get(k).copied()).collect::<Vec<_>>();
        (0..).map(at).take_while(|values| 2 * values.len() >= self.curves.len()).map(quartiles).collect()
    }
}

/// Lower quartile, median and upper quartile, linearly interpolated between samples; zeros if there are no values.
pub(super) fn quartiles(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    let value = |k: usize| values.get(k).or(values.last()).copied().unwrap_or(0.0);
    [1, 2, 3].map(|q| {
        let (k, share) = (last * q / 4, (last * q % 4) as f64 / 4.0);
        value(k) + share * (value(k + 1) - value(k))
    })
}

/// Time and value range of the panels.
struct Scale {
    /// Indices of the first and the last sample.
    from: usize,
    to: usize,
    most: f64,
}

impl Scale {
    /// From one second before the first notable value to half a second after the last.
    fn of(bands: &[Vec<[f64; 3]>]) -> Self {
        let most = bands.iter().flatten().flatten().fold(1.0_f64, |most, x| most.max(x.abs()));
        let busy = |quartiles: &[f64; 3]| quartiles.iter().any(|x| x.abs() > 0.05 * most);
        let first = bands.iter().filter_map(|band| band.iter().position(busy)).min().unwrap_or(0);
        let last = bands.iter().filter_map(|band| band.iter().rposition(busy)).max().unwrap_or(first + 1);
        Self { from: first.saturating_sub(20), to: last + 10, most: 1.05 * most }
    }

    /// Axes of the panel with this top edge, over seconds.
    fn axes(&self, top: f64) -> Axes {
        let x = (self.from as f64 * EVERY.as_secs(), self.to as f64 * EVERY.as_secs());
        Axes { corner: (LEFT, top), size: (PANEL_W, PANEL_H), x, y: (-self.most, self.most) }
    }

    fn draw_axes(&self, canvas: &mut Canvas, top: f64, title: &str) {
        self.axes(top).panel(canvas, (12.0, 6.0), (title, "time (s)"));
    }

    fn draw_band(&self, canvas: &mut Canvas, top: f64, (band, look): (&[[f64; 3]], Look)) {
        let axes = self.axes(top);
        let shown = self.from.min(band.len())..band.len().min(self.to + 1);
        let at = |quartile: usize, k: usize| axes.at(k as f64 * EVERY.as_secs(), band[k][quartile]);
        let around = shown.clone().map(|k| at(0, k)).chain(shown.clone().rev().map(|k| at(2, k)));
        canvas.path(around, true, Style::fill(look.color).filled_by(0.18));
        canvas.path(shown.map(|k| at(1, k)), false, look.line(LINE_W));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_are_quartiles_of_the_runs_that_last_long_enough() {
        let curves = [vec![1.0, 5.0, 9.0], vec![2.0, 6.0], vec![3.0], vec![4.0], vec![5.0, 7.0]];
        let series = Series { panel: String::new(), name: String::new(), curves: curves.iter().collect() };
        assert_eq!(series.bands(), [[2.0, 3.0, 4.0], [5.5, 6.0, 6.5]]);
        assert_eq!(quartiles(Vec::new()), [0.0; 3]);
        assert_eq!(quartiles(vec![3.0, 1.0]), [1.5, 2.0, 2.5]);
    }

    /// The curve is at its peak over the whole panel, so any label within the panel would cover data.
    #[test]
    fn line_names_are_beside_the_panel() {
        let study = crate::table::tests::study();
        let of = |cell| CellResult { curve: vec![50.0; 80], ..CellResult::blank(cell, "avoided") };
        let results: Vec<_> = study.cells.iter().map(|cell| Some(of(cell))).collect();
        let svg = Curve::LateralJerk.draw(&study, &results).svg();
        let number = |line: &str, name: &str| -> f64 {
            line.split(&format!("{name}=\"")).nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
        };
        let texts = |name: &str| -> Vec<&str> {
            svg.lines()
                .filter(|line| line.starts_with("<text") && line.contains(&format!(">{name}<")))
                .collect()
        };
        for name in ["16", "18"] {
            let named = texts(name);
            assert_eq!(named.len(), 1, "{name}");
            let left = number(named[0], " x");
            assert!(left > LEFT + PANEL_W, "{name} at {left}");
            assert!(left + number(named[0], "textLength") < number(&svg, "width"), "{name} is cut");
        }
    }
}
