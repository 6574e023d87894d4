//! Execution of detector and planner: `[execution]`, and the ladders that they choose from.

use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;
use swerve_flow::Reaction;
use swerve_planning::deadline::Params;
use swerve_text::{KeyProblem, did_you_mean, number, overridden};
use toml::Table;

use super::detectors::{Published, find, published};
use super::execution::span_ms;
use super::perception::{CUSTOM, PerceptionConfig, TRUTH};
use super::planning::{PlannerName, PlanningConfig};
use crate::ladder::Rung;
use crate::problems::outside;

/// The four execution models compared by D3 (Gog et al., EuroSys 2022).
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Model {
    /// Detector and planner run on separate timers and read the newest input.
    Periodic,
    /// They run when their input arrives, without a time limit.
    #[default]
    DataDriven,
    /// As data-driven, within constant deadlines.
    StaticDeadlines,
    /// As data-driven, within deadlines that a policy sets for each frame.
    DynamicDeadlines,
}

impl Model {
    /// Returns true if detector and planner have a period or a fixed deadline.
    pub(crate) fn has_lengths(self) -> bool {
        matches!(self, Self::Periodic | Self::StaticDeadlines)
    }
}

/// Reaction of detector and planner to a missed deadline; they compute no other answer.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MissReaction {
    /// Publishes no message; the watermark rises to the stamp.
    #[default]
    Skip,
    /// Publishes the newest finished result again, under the new stamp; nothing before the first result.
    ReuseLast,
}

impl From<MissReaction> for Reaction {
    fn from(reaction: MissReaction) -> Self {
        match reaction {
            MissReaction::Skip => Self::Skip,
            MissReaction::ReuseLast => Self::ReuseLast,
        }
    }
}

/// Execution of detector and planner.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct ExecutionConfig {
    /// Execution model.
    pub model: Model,
    /// Period (`periodic`) or deadline (`static_deadlines`) of the detector, ms; its fixed run time or that of its
    /// highest rung when absent.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub detector_ms: Option<f64>,
    /// Period (`periodic`) or deadline (`static_deadlines`) of the planner, ms; its fixed run time or that of its
    /// highest rung when absent.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub planner_ms: Option<f64>,
    /// Reaction of detector and planner to a missed deadline.
    pub reaction: MissReaction,
    /// Parameters of the deadline policy that differ from its defaults (`swerve_planning::deadline`).
    #[schemars(with = "Params")]
    pub params: toml::Table,
}

impl ExecutionConfig {
    /// Parameters of the deadline policy.
    ///
    /// # Errors
    /// Problems of the parameters, each by its key in `execution.params`.
    pub(crate) fn deadline_params(&self) -> Result<Params, Vec<KeyProblem>> {
        let params: Params = overridden(&Params::default(), &self.params)?;
        params.validate().map_err(outside)?;
        Ok(params)
    }
}

impl PerceptionConfig {
    /// Rungs of the emulated detector, the fastest first; empty without a ladder.
    ///
    /// # Errors
    /// The problem of `perception.ladder`.
    pub(crate) fn rungs(&self) -> Result<Vec<Rung>, String> {
        let name = self.detector.as_str();
        if !self.ladder {
            return Ok(Vec::new());
        }
        let (Some(top), Some((_, suffix))) = (find(name), name.split_once('@')) else {
            return match name {
                TRUTH | CUSTOM => Err(format!("`{name}` is on no ladder; name a published detector")),
                _ => Ok(Vec::new()),
            };
        };
        let on_it = |d: &&Published| {
            let same = d.name.split_once('@').is_some_and(|(_, other)| other == suffix);
            same && d.ms <= top.ms && d.sensing == top.sensing
        };
        let rung = |rung: &Published| {
            let keys = Table::from_iter([
                ("detector".to_owned(), rung.name.clone().into()),
                ("ladder".to_owned(), false.into()),
            ]);
            Ok(Rung { name: rung.name.clone(), run_time: span_ms(rung.ms)?, keys })
        };
        let mut rungs = published().iter().filter(on_it).map(rung).collect::<Result<Vec<_>, String>>()?;
        rungs.sort_by_key(|rung| rung.run_time);
        Ok(rungs)
    }
}

impl PlanningConfig {
    /// Rungs of the planner, the fastest first; empty without a ladder.
    ///
    /// # Errors
    /// The key in `planning` and its problem.
    pub(crate) fn rungs(&self) -> Result<Vec<Rung>, (&'static str, String)> {
        let Some(name) = &self.ladder else {
            return match self.rung_ms {
                Some(_) => Err(("rung_ms", "needs a `ladder`".into())),
                None => Ok(Vec::new()),
            };
        };
        let names = || ladders().iter().map(|ladder| ladder.name.as_str());
        let Some(ladder) = ladders().iter().find(|ladder| ladder.name == *name) else {
            let near = did_you_mean(name, names());
            let all = names().collect::<Vec<_>>().join(", ");
            return Err(("ladder", format!("unknown ladder `{name}`, expected one of {all}{near}")));
        };
        if ladder.planner != self.planner {
            let (is, not) = (ladder.planner.as_str(), self.planner.as_str());
            return Err(("ladder", format!("`{name}` is one of `{is}`, not of `{not}`")));
        }
        let top_ms = self.rung_ms.unwrap_or(f64::INFINITY);
        if self.rung_ms.is_some() && !ladder.rung.iter().any(|rung| rung.ms == top_ms) {
            let all: Vec<String> = ladder.rung.iter().map(|rung| number(rung.ms)).collect();
            let found = number(top_ms);
            return Err(("rung_ms", format!("expected one of {}, found {found}", all.join(", "))));
        }
        let mut rungs = Vec::new();
        for rung in ladder.rung.iter().filter(|rung| rung.ms <= top_ms) {
            let keys = Table::from_iter([("params".to_owned(), rung.params.clone().into())]);
            let run_time = span_ms(rung.ms).map_err(|message| ("ladder", message))?;
            rungs.push(Rung { name: rung.name.clone(), run_time, keys });
        }
        rungs.sort_by_key(|rung| rung.run_time);
        Ok(rungs)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Ladder {
    name: String,
    planner: PlannerName,
    #[serde(rename = "source")]
    _source: String,
    rung: Vec<PlannerRung>,
}

#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlannerRung {
    name: String,
    ms: f64,
    params: toml::Table,
}

fn ladders() -> &'static [Ladder] {
    static ALL: LazyLock<Vec<Ladder>> = LazyLock::new(|| {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct File {
            ladder: Vec<Ladder>,
        }
        let file: File = swerve_text::built_in(include_str!("ladders.toml"));
        file.ladder
    });
    &ALL
}

#[cfg(test)]
mod tests {
    use crate::Setup;
    use crate::assembly::Assembly;
    use swerve_core::Span;
    use swerve_text::{Document, parse_assignment};

    fn config(sets: &[&str]) -> Result<Setup, String> {
        let sets: Vec<_> = sets.iter().map(|set| parse_assignment(set).unwrap()).collect();
        let document = Document::parse("c.toml", String::new()).unwrap();
        Setup::from_document(&document, &sets)
            .map_err(|problems| problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))
    }

    const D3: [&str; 3] =
        ["perception.detector=efficientdet-d5@d3", "perception.ladder=true", "planning.ladder=fot@d3"];

    fn on_ladders(sets: &[&str]) -> Result<Setup, String> {
        config(&[&D3, sets].concat())
    }

    #[test]
    fn ladder_ends_at_the_named_rung() {
        let ms = |rungs: Vec<Span>| rungs.iter().map(|span| span.as_ms()).collect::<Vec<_>>();
        let config = on_ladders(&["planning.rung_ms=148"]).unwrap();
        let detectors = config.perception.rungs().unwrap();
        assert_eq!(ms(detectors.iter().map(|r| r.run_time).collect()), [20.0, 50.0, 80.0, 150.0]);
        assert!(detectors.iter().all(|rung| rung.keys["detector"].as_str() == Some(&rung.name)));
        let planners = config.planning.rungs().unwrap();
        assert_eq!(ms(planners.iter().map(|r| r.run_time).collect()), [30.0, 40.0, 67.0, 148.0]);
        assert!(planners.iter().all(|rung| rung.keys["params"].is_table()));
        assert!(Setup::default().perception.rungs().unwrap().is_empty());
        assert!(Setup::default().planning.rungs().unwrap().is_empty());
    }

    /// Periods or deadlines of these operators, ms.
    fn lengths<const N: usize>(config: &Setup, names: [&str; N]) -> [Option<f64>; N] {
        let assembly = Assembly::new(config).unwrap();
        let of = |name| {
            let schedule = &assembly.operator(name)?.schedule;
            schedule.period.or(schedule.deadline).map(Span::as_ms)
        };
        names.map(of)
    }

    #[test]
    fn period_defaults_to_the_run_time() {
        let of = |sets: &[&str]| {
            let config = on_ladders(&[sets, &["execution.model=periodic"]].concat()).unwrap();
            lengths(&config, ["detector", "planner", "tracker"])
        };
        assert_eq!(of(&["planning.rung_ms=67"]), [Some(150.0), Some(67.0), None]);
        assert_eq!(of(&["execution.detector_ms=200"]), [Some(200.0), Some(309.0), None]);
        assert_eq!(lengths(&on_ladders(&[]).unwrap(), ["planner"]), [None]);
        let fixed = on_ladders(&["execution.model=static_deadlines", "execution.planner_ms=100"]).unwrap();
        assert_eq!(lengths(&fixed, ["detector", "planner"]), [Some(150.0), Some(100.0)]);
    }

    /// Operators are scheduled by kind, whatever their name.
    #[test]
    fn second_planner_has_a_period() {
        let text = "[execution]\nmodel = \"periodic\"\nplanner_ms = 70\n[operator.spare]\nkind = \"planner\"\n\
                    reads = { predictions = \"predictor\" }\n[operator.controller]\nreads = { plan = \"planner.plan\" }\n";
        let config = Setup::from_document(&Document::parse("c.toml", text).unwrap(), &[]).unwrap();
        assert_eq!(lengths(&config, ["planner", "spare"]), [Some(70.0), Some(70.0)]);
    }

    #[test]
    fn invalid_execution_settings_are_refused_with_their_key() {
        let refused = |sets: &[&str], expected: &str| {
            let said = on_ladders(sets).expect_err("wrong on purpose");
            assert!(said.contains(expected), "{said}");
        };
        refused(&["perception.detector=truth"], "perception.ladder: `truth` is on no ladder");
        refused(&["planning.ladder=fot@d4"], "unknown ladder `fot@d4`, expected one of fot@d3");
        refused(&["planning.planner=aeb"], "planning.ladder: `fot@d3` is one of `fot`, not of `aeb`");
        refused(
            &["planning.rung_ms=50"],
            "planning.rung_ms: expected one of 30, 40, 67, 148, 208, 309, found 50",
        );
        refused(
            &["execution.model=static_deadlines", "execution.detector_ms=nan"],
            "execution.detector_ms: expected 1 to 10000, found NaN",
        );
        refused(
            &[
                "execution.model=periodic",
                "perception.ladder=false",
                "perception.detector=truth",
                "execution.detector_ms=5",
            ],
            "execution.detector_ms: there is no detector",
        );
        refused(&["execution.planner_ms=30"], "only `periodic` and `static_deadlines` have use for it");
        refused(&["execution.model=periodic", "execution.planner_ms=0"], "expected 1 to 10000, found 0");
        refused(&["execution.reaction=on_deadline"], "\"reuse_last\"");
        refused(&["execution.model=dynamic_deadline"], "dynamic_deadlines");
        refused(
            &["execution.params.brake_mps2=-1"],
            "execution.params.brake_mps2: expected 0.1 to 20, found -1",
        );
        refused(&["execution.params.brake=1"], "execution.params.brake: unknown key");
        refused(
            &["execution.model=dynamic_deadlines", "operator.planner.deadline={ ms = 5 }"],
            "operator.planner.deadline: `execution.model` sets the deadline",
        );
        refused(
            &["operator.detector.runtime={ fixed_ms = 5 }"],
            "operator.detector.runtime: the rungs of its ladder",
        );
        let said = config(&["planning.rung_ms=30"]).unwrap_err();
        assert!(said.contains("planning.rung_ms: needs a `ladder`"), "{said}");
        let said = config(&["execution.model=periodic"]).unwrap_err();
        assert!(said.contains("execution.planner_ms: expected milliseconds, as no fixed run time"), "{said}");
    }
}
