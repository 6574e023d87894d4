//! Ranking of settings: cells pooled over all axes but some, and compared with each other.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::fmt::Write as _;

use swerve_eval::median;
use swerve_report::output::align;

use super::chance::{interval, mcnemar, wilson};
use super::csv::field;
use super::grid::Study;
use super::result::CellResult;
use super::tables::Ranking;

/// Results of one setting, pooled over all its cells.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Ranked {
    /// Labels, in the order of `settings`.
    pub labels: Vec<String>,
    /// Finished runs.
    pub runs: usize,
    /// Number of these runs with a collision.
    pub collisions: usize,
    /// Number of these runs that neither ended well nor hit.
    pub others: usize,
    /// Sum of the impact speeds, m/s.
    pub impact_sum_mps: f64,
    /// Median of the runs' median response times, ms.
    pub response_p50_ms: Option<f64>,
    /// Median of the runs' 99th percentiles of the response time, ms.
    pub response_p99_ms: Option<f64>,
    /// Missed deadlines in all runs.
    pub misses: u64,
    /// True for each run with a collision, by its steps on the other axes.
    hits: BTreeMap<Vec<String>, bool>,
}

/// Result of a run with its steps on the axes over which settings are pooled.
type Run<'a> = (Vec<String>, &'a CellResult);

/// Comparison of two settings by the runs that agree on all other axes.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Paired {
    /// Number of pairs of runs.
    pub pairs: usize,
    /// Pairs of which only the run of the worse setting hit.
    pub only_worse: usize,
    /// Pairs of which only the run of the better setting hit.
    pub only_better: usize,
    /// Probability of a difference as large by chance (exact test of McNemar, two-sided).
    pub p: f64,
}

impl Ranked {
    fn of(labels: Vec<String>, pooled: &[Run<'_>]) -> Self {
        let hit = |result: &&CellResult| result.verdict == "collision";
        let results = pooled.iter().map(|(_, result)| *result);
        let collisions = results.clone().filter(hit).count();
        let avoided = results.clone().filter(|result| result.avoided()).count();
        let runs = results.clone().count();
        Self {
            labels,
            runs,
            collisions,
            others: runs - collisions - avoided,
            impact_sum_mps: results.clone().filter(hit).filter_map(|r| r.impact_speed_mps).sum(),
            response_p50_ms: median(results.clone().filter_map(|r| r.response_p50_ms)),
            response_p99_ms: median(results.clone().filter_map(|r| r.response_p99_ms)),
            misses: results.map(|r| r.misses).sum(),
            hits: pooled.iter().map(|(others, result)| (others.clone(), hit(result))).collect(),
        }
    }

    /// Compares this setting with a better one.
    pub fn against(&self, better: &Self) -> Paired {
        let pairs = self.hits.iter().filter_map(|(others, hit)| Some((*hit, *better.hits.get(others)?)));
        let count = |wanted: (bool, bool)| pairs.clone().filter(|pair| *pair == wanted).count();
        let (only_worse, only_better) = (count((true, false)), count((false, true)));
        Paired { pairs: pairs.count(), only_worse, only_better, p: mcnemar(only_worse, only_better) }
    }

    /// Share of runs with a collision, 0 to 1.
    fn hit_share(&self) -> f64 {
        self.collisions as f64 / self.runs.max(1) as f64
    }

    /// Order: fewer collisions first, then slower ones, then fewer other runs that did not end well.
    fn better_than(&self, other: &Self) -> Ordering {
        let slow = self.impact_sum_mps / self.runs.max(1) as f64;
        let other_slow = other.impact_sum_mps / other.runs.max(1) as f64;
        let ended = |s: &Self| s.others as f64 / s.runs.max(1) as f64;
        self.hit_share()
            .total_cmp(&other.hit_share())
            .then(slow.total_cmp(&other_slow))
            .then(ended(self).total_cmp(&ended(other)))
    }

    /// Cells of the terminal's table: counts with their 95 % intervals.
    fn cells(&self) -> Vec<String> {
        let counted = |n: usize| format!("{n}/{} {}", self.runs, interval(n, self.runs));
        let mut cells = self.columns();
        (cells[1], cells[3]) = (counted(self.collisions), counted(self.others));
        cells.remove(0);
        cells
    }

    fn columns(&self) -> Vec<String> {
        let impact = match self.collisions {
            0 => "-".into(),
            n => format!("{:.1}", self.impact_sum_mps / n as f64),
        };
        let ms = |x: Option<f64>| x.map_or_else(|| "-".into(), |x| format!("{x:.0}"));
        let counts = [self.runs, self.collisions].map(|n| n.to_string());
        let rest = [impact, self.others.to_string(), ms(self.response_p50_ms), ms(self.response_p99_ms)];
        counts.into_iter().chain(rest).chain([self.misses.to_string()]).collect()
    }
}

const COLUMNS: [&str; 6] = ["collisions", "impact m/s", "others", "response p50 ms", "p99 ms", "misses"];

/// All settings, the best first. Failed cells have no result and do not count.
pub fn settings(study: &Study, ranking: &Ranking, results: &[Option<CellResult>]) -> Vec<Ranked> {
    let axes: Vec<usize> =
        ranking.settings.iter().filter_map(|name| study.axes.iter().position(|axis| axis == name)).collect();
    let labels_of = |result: &CellResult| -> Vec<String> {
        axes.iter().filter_map(|&axis| result.labels.get(axis).cloned()).collect()
    };
    let others_of = |result: &CellResult| -> Vec<String> {
        let others = result.labels.iter().enumerate().filter(|(axis, _)| !axes.contains(axis));
        others.map(|(_, label)| label.clone()).collect()
    };
    let mut by_labels: Vec<(Vec<String>, Vec<Run<'_>>)> = Vec::new();
    for result in results.iter().flatten().filter(|result| result.error.is_none()) {
        let (labels, one) = (labels_of(result), (others_of(result), result));
        match by_labels.iter_mut().find(|(known, _)| *known == labels) {
            Some((_, pooled)) => pooled.push(one),
            None => by_labels.push((labels, vec![one])),
        }
    }
    let mut settings: Vec<Ranked> =
        by_labels.into_iter().map(|(labels, pooled)| Ranked::of(labels, &pooled)).collect();
    settings.sort_by(Ranked::better_than);
    settings
}

/// `ranking.csv`: all settings, the best first.
pub fn csv(ranking: &Ranking, settings: &[Ranked]) -> String {
    let mut text = String::new();
    for axis in &ranking.settings {
        let _ = write!(text, "{},", field(axis));
    }
    text += "runs,collisions,collisions_low,collisions_high,impact_mean_mps,others,others_low,others_high,response_p50_ms,response_p99_ms,misses,pairs,only_this_hit,only_above_hit,p\n";
    for (k, setting) in settings.iter().enumerate() {
        let mut columns = setting.columns();
        columns.iter_mut().filter(|cell| *cell == "-").for_each(String::clear); // statistics packages read numbers
        // From the right, as insertions shift the columns after them.
        for (count, behind) in [(setting.others, 4), (setting.collisions, 2)] {
            let (low, high) = wilson(count, setting.runs);
            columns.splice(behind..behind, [low, high].map(|share| format!("{share:.3}")));
        }
        columns.extend(match k.checked_sub(1).map(|above| setting.against(&settings[above])) {
            None => [const { String::new() }; 4],
            Some(Paired { pairs, only_worse, only_better, p }) => {
                [pairs.to_string(), only_worse.to_string(), only_better.to_string(), format!("{p:.4}")]
            }
        });
        let cells = setting.labels.iter().cloned().chain(columns);
        text += &cells.map(|cell| field(&cell)).collect::<Vec<_>>().join(",");
        text.push('\n');
    }
    text
}

/// Text for the terminal: the best setting of each value of `best_of`, else the ten best.
pub fn text(ranking: &Ranking, settings: &[Ranked]) -> String {
    let place = ranking.best_of.as_ref().and_then(|name| ranking.settings.iter().position(|s| s == name));
    let mut seen: Vec<&str> = Vec::new();
    let shown: Vec<&Ranked> = match place {
        None => settings.iter().take(10).collect(),
        Some(place) => settings
            .iter()
            .filter(|setting| {
                let label = setting.labels[place].as_str();
                !seen.contains(&label) && {
                    seen.push(label);
                    true
                }
            })
            .collect(),
    };
    let mut head: Vec<String> = ranking.settings.clone();
    head.extend(COLUMNS.map(str::to_owned));
    head.push("p".to_owned());
    let mut lines = vec![head];
    for (k, setting) in shown.iter().enumerate() {
        let p = k.checked_sub(1).map(|above| match setting.against(shown[above]).p {
            p if p < 0.001 => "<0.001".to_owned(),
            p => format!("{p:.3}"),
        });
        let cells = setting.labels.iter().cloned().chain(setting.cells());
        lines.push(cells.chain([p.unwrap_or_else(|| "-".to_owned())]).collect());
    }
    let mut text = match &ranking.best_of {
        Some(name) => format!("the best setting of each {name}\n"),
        None => "the best settings\n".to_owned(),
    };
    text += &align(&lines);
    text += "collisions, and others: runs that neither hit nor ended well (stopped, left the road, ran out of time), each of \
             all runs with its 95 % interval\n";
    text += "p: exact test of McNemar against the row above, over the runs that agree on all other axes\n";
    text
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use swerve_text::Problems;

    use super::*;

    const STUDY: &str = "base = { scenario = \"a.toml\" }\n\
        [ranking]\nsettings = [\"model\", \"period\"]\nbest_of = \"model\"\n\
        [[leave_out]]\nmodel = [\"b\"]\nperiod = [\"2\", \"3\"]\n\
        [[axis]]\nname = \"model\"\n[[axis.settings]]\nname = \"a\"\n[[axis.settings]]\nname = \"b\"\n\
        [[axis]]\nname = \"period\"\nkey = \"sensing.period_ms\"\nvalues = [1, 2, 3]\n\
        [[axis]]\nkey = \"seed\"\nvalues = [1, 2]\n";

    fn study(text: &str) -> Result<Study, String> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("s.toml");
        std::fs::write(&file, text).unwrap();
        let said =
            |problems: Problems| problems.iter().map(|p| p.message.clone()).collect::<Vec<_>>().join("\n");
        Study::read(Path::new(&file), &[]).map(Study::expand).map_err(said)
    }

    fn results(study: &Study, hits: impl Fn(&[String]) -> Option<f64>) -> Vec<Option<CellResult>> {
        let one = |cell: &super::super::grid::Cell| {
            let impact = hits(&cell.labels);
            let verdict = if impact.is_some() { "collision" } else { "avoided" };
            let blank = CellResult::blank(cell, verdict);
            Some(CellResult { impact_speed_mps: impact, response_p50_ms: Some(100.0), misses: 1, ..blank })
        };
        study.cells.iter().map(one).collect()
    }

    #[test]
    fn ranking_finds_the_best_setting_of_each_value() {
        let study = study(STUDY).unwrap();
        // Combinations left out are not driven: one period under b, three under a.
        assert_eq!(study.cells.len(), (3 + 1) * 2);
        assert!(study.cells.iter().enumerate().all(|(index, cell)| cell.index == index));
        let ranking = study.ranking.clone().unwrap();
        // Under a, period 1 hits twice, 2 once at 5 m/s, 3 once at 4 m/s. Under b there are no collisions.
        let results = results(&study, |labels| match [&*labels[0], &*labels[1], &*labels[2]] {
            ["a", "1", _] => Some(9.0),
            ["a", "2", "1"] => Some(5.0),
            ["a", "3", "1"] => Some(4.0),
            _ => None,
        });
        let mut with_failed = results.clone();
        let hit = with_failed[0].as_mut().unwrap();
        (hit.verdict, hit.error) = ("failed".into(), Some("no such file".into()));
        let pooled = settings(&study, &ranking, &with_failed);
        let of_failed = pooled.iter().find(|s| s.labels == ["a", "1"]).unwrap();
        assert_eq!((of_failed.runs, of_failed.collisions, of_failed.others), (1, 1, 0));
        let settings = settings(&study, &ranking, &results);
        let order: Vec<String> = settings.iter().map(|s| s.labels.join(" ")).collect();
        assert_eq!(order, ["b 1", "a 3", "a 2", "a 1"]);
        assert_eq!((settings[3].collisions, settings[3].runs, settings[3].misses), (2, 2, 2));
        let text = text(&ranking, &settings);
        assert!(text.ends_with("over the runs that agree on all other axes\n"), "{text}");
        assert!(!text.contains("a      2") && text.contains("  1/2 (0.09-0.91)  "), "{text}");
        assert_eq!(
            csv(&ranking, &settings).lines().nth(2).unwrap(),
            "a,3,2,1,0.095,0.905,4.0,0,0.000,0.658,100,,2,2,1,0,1.0000"
        );
    }

    #[test]
    fn settings_are_compared_by_pairs_of_runs() {
        let text = "base = { scenario = \"a.toml\" }\n[ranking]\nsettings = [\"model\"]\n\
            [[axis]]\nname = \"model\"\n[[axis.settings]]\nname = \"a\"\n[[axis.settings]]\nname = \"b\"\n\
            [[axis]]\nkey = \"seed\"\nvalues = \"1..10\"\n";
        let study = study(text).unwrap();
        // Both hit at seed 10; at 1 to 8 only `a`; at 9 only `b`.
        let results = results(&study, |labels| match (&*labels[0], labels[1].parse::<u32>().unwrap()) {
            ("a", 1..=8) | ("b", 9) | (_, 10) => Some(5.0),
            _ => None,
        });
        let ranking = study.ranking.clone().unwrap();
        let settings = settings(&study, &ranking, &results);
        assert_eq!(settings[1].labels, ["a"]);
        // 2 (1 + 9) / 2^9.
        let paired = Paired { pairs: 10, only_worse: 8, only_better: 1, p: 20.0 / 512.0 };
        assert_eq!(settings[1].against(&settings[0]), paired);
        assert!(csv(&ranking, &settings).ends_with(",10,8,1,0.0391\n"));
        assert!(super::text(&ranking, &settings).contains("  0.039\n"));
    }

    #[test]
    fn unknown_axes_and_steps_are_refused() {
        let wrong = |from: &str, to: &str| study(&STUDY.replace(from, to)).unwrap_err();
        assert_eq!(
            wrong("[\"model\", \"period\"]", "[\"modell\", \"period\"]"),
            "no axis of the name `modell`; expected one of \"model\", \"period\", \"seed\"\n\
             `model` is not one of `settings`; expected one of \"modell\", \"period\""
        );
        assert_eq!(
            wrong("best_of = \"model\"", "best_of = \"seed\""),
            "`seed` is not one of `settings`; expected one of \"model\", \"period\""
        );
        assert_eq!(
            wrong("model = [\"b\"]", "modle = [\"b\"]"),
            "no axis of the name `modle`; expected one of \"model\", \"period\", \"seed\""
        );
        assert_eq!(wrong("period = [\"2\", \"3\"]", "period = [\"2\", \"4\"]"), "`period` has no step `4`");
        assert_eq!(
            wrong("model = [\"b\"]\nperiod = [\"2\", \"3\"]", "model = [\"a\", \"b\"]"),
            "nothing is left"
        );
    }
}
