//! Execution of operators, as TOML: run time, busy policy, deadline. Shared by pipelines and `swerve timing`.

use crate::problems::problem;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{Ranges, require, require_within};
use swerve_core::{Span, Time};
use swerve_flow::{Anchor, Full, Late, Policy, Reaction, RuntimeModel};
use swerve_text::{KeyProblem, number};

/// A run-time model: exactly one of its keys.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields)]
pub struct Runtime {
    /// `zero = true`: takes no time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zero: Option<bool>,
    /// Constant run time, ms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = MS_MAX))]
    pub fixed_ms: Option<f64>,
    /// Run times used in turn, ms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = LEAST_MS, max = MS_MAX)))]
    pub cycle_ms: Option<Vec<f64>>,
    /// Normal distribution: mean and standard deviation, ms; cut at zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = 0.0, max = MS_MAX)))]
    pub normal_ms: Option<[f64; 2]>,
    /// Log-normal distribution: median in ms (0.001 to 86400000), and standard deviation of the logarithm (0 to 10).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log_normal_ms: Option<[f64; 2]>,
    /// Pairs of percentile (0 to 100) and ms (0 to 86400000), increasing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub percentiles_ms: Option<Vec<[f64; 2]>>,
    /// Run time by counted work: base in ms and time per unit of work in µs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[ranges(nested)]
    pub work: Option<WorkTime>,
    /// Factor on the run time measured on this host; not repeatable without its log.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1e6))]
    pub measured: Option<f64>,
}

/// Run time by counted work.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields)]
pub struct WorkTime {
    /// Time before the first unit, ms.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = MS_MAX))]
    pub base_ms: f64,
    /// Time per unit, µs.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub per_unit_us: f64,
}

/// Shortest time in a configuration that must not be zero: a microsecond.
const LEAST_MS: f64 = 0.001;

/// Longest time in a configuration: a day.
pub(crate) const MS_MAX: f64 = 86_400_000.0;

/// Milliseconds as a span; refused when not finite, negative or longer than a day.
pub fn span_ms(ms: f64) -> Result<Span, String> {
    if ms.is_finite() && (0.0..=MS_MAX).contains(&ms) {
        return Ok(Span::from_secs(ms * 1e-3));
    }
    Err(format!("expected 0 to {MS_MAX}, found {}", number(ms)))
}

/// Span of a time in milliseconds that is already checked.
pub fn span_of_ms(ms: f64) -> Span {
    Span::from_secs(ms * 1e-3)
}

/// The same as an instant of the run.
pub fn time_of_ms(ms: f64) -> Time {
    Time::ZERO + span_of_ms(ms)
}

impl Runtime {
    /// A constant run time.
    pub fn fixed(ms: f64) -> Self {
        Self { fixed_ms: Some(ms), ..Self::default() }
    }

    /// Usual run time of a step, ms, as far as the model defines it; by work, the time before the first unit.
    pub fn typical_ms(&self) -> f64 {
        let mean = |times: &Vec<f64>| times.iter().sum::<f64>() / times.len().max(1) as f64;
        let median = |points: &Vec<[f64; 2]>| {
            points.iter().find(|[percent, _]| *percent >= 50.0).or(points.last()).map_or(0.0, |[_, ms]| *ms)
        };
        let first = |pair: &[f64; 2]| pair[0];
        self.fixed_ms
            .or(self.cycle_ms.as_ref().map(mean))
            .or(self.normal_ms.as_ref().map(first))
            .or(self.log_normal_ms.as_ref().map(first))
            .or(self.percentiles_ms.as_ref().map(median))
            .or(self.work.map(|work| work.base_ms))
            .unwrap_or(0.0)
    }

    /// Longest run time of a step, ms, as far as the model defines it; else the usual one.
    pub fn most_ms(&self) -> f64 {
        let last = |points: &Vec<[f64; 2]>| points.last().map_or(0.0, |[_, ms]| *ms);
        self.percentiles_ms.as_ref().map_or_else(|| self.typical_ms(), last)
    }

    /// The engine's run-time model.
    ///
    /// # Errors
    /// The problem of the wrong key.
    pub fn model(&self) -> Result<RuntimeModel, String> {
        self.model_by_key().map_err(|(key, message)| match key.as_str() {
            "" => message,
            key => format!("`{key}`: {message}"),
        })
    }

    /// The engine's run-time model.
    ///
    /// # Errors
    /// The wrong key, empty for the whole table, and its problem.
    pub fn model_by_key(&self) -> Result<RuntimeModel, KeyProblem> {
        self.check_ranges().map_err(problem)?;
        let wrong = |key: &str, message: &str| (key.to_owned(), message.to_owned());
        let mut models = Vec::new();
        if let Some(zero) = self.zero {
            if !zero {
                return Err(wrong("zero", "expected true; name another model instead"));
            }
            models.push(RuntimeModel::Zero);
        }
        if let Some(ms) = self.fixed_ms {
            models.push(RuntimeModel::Fixed(span_of_ms(ms)));
        }
        if let Some(times) = &self.cycle_ms {
            if times.is_empty() {
                return Err(wrong("cycle_ms", "expected at least one time"));
            }
            models.push(RuntimeModel::Cycle(times.iter().map(|ms| span_of_ms(*ms)).collect()));
        }
        if let Some([mean, deviation]) = self.normal_ms {
            models.push(RuntimeModel::Normal { mean: span_of_ms(mean), deviation: span_of_ms(deviation) });
        }
        if let Some([median, sigma]) = self.log_normal_ms {
            require_within("log_normal_ms", median, [LEAST_MS, MS_MAX]).map_err(problem)?;
            let is_sigma = (0.0..=10.0).contains(&sigma);
            require("log_normal_ms", sigma, is_sigma, "a sigma from 0 to 10").map_err(problem)?;
            models.push(RuntimeModel::LogNormal { median: span_of_ms(median), sigma });
        }
        if let Some(points) = &self.percentiles_ms {
            let points = percentiles(points).map_err(|message| wrong("percentiles_ms", &message))?;
            models.push(RuntimeModel::Percentiles(points));
        }
        if let Some(work) = self.work {
            let base = span_of_ms(work.base_ms);
            models.push(RuntimeModel::Work { base, per_unit_ns: work.per_unit_us * 1e3 });
        }
        if let Some(scale) = self.measured {
            models.push(RuntimeModel::Measured { scale });
        }
        match models.len() {
            1 => Ok(models.remove(0)),
            n => {
                let message = format!(
                    "expected exactly one of zero, fixed_ms, cycle_ms, normal_ms, log_normal_ms, percentiles_ms, work, measured; found {n}"
                );
                Err(wrong("", &message))
            }
        }
    }
}

fn percentiles(points: &[[f64; 2]]) -> Result<Vec<(f64, Span)>, String> {
    let point = |[percent, ms]: &[f64; 2]| Ok((*percent, span_ms(*ms)?));
    let points = points.iter().map(point).collect::<Result<Vec<_>, String>>()?;
    let inside = points.iter().all(|(p, _)| (0.0..=100.0).contains(p));
    let rising = points.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 <= w[1].1);
    if points.is_empty() || !inside || !rising {
        return Err("expected pairs [percentile, ms] with percentiles rising within 0 to 100 and times that do not fall".into());
    }
    Ok(points)
}

/// Parses a busy policy: `skip_to_latest`, `queue(2)`, `queue(2, drop_newest)`, `pipelined(4)`, `pipelined(4,
/// overtaking)`, `pipelined(4, put_off 50)` with ms.
pub fn parse_policy(text: &str) -> Result<Policy, String> {
    let wrong = || {
        format!(
            "unknown policy `{text}`, expected skip_to_latest, queue(N), queue(N, drop_oldest | drop_newest | fail), pipelined(N), pipelined(N, overtaking) or pipelined(N, put_off MS) with N from 1 to 1000000"
        )
    };
    if text.trim() == "skip_to_latest" {
        return Ok(Policy::SkipToLatest);
    }
    let (name, rest) = text.trim().split_once('(').ok_or_else(wrong)?;
    let inner = rest.strip_suffix(')').ok_or_else(wrong)?;
    let mut parts = inner.split(',').map(str::trim);
    let (name, n, word) = (name.trim(), parts.next().unwrap_or_default(), parts.next());
    if parts.next().is_some() || !["queue", "pipelined"].contains(&name) {
        return Err(wrong());
    }
    let n = n.parse().ok().filter(|n| (1..=1_000_000).contains(n));
    let n: usize =
        n.ok_or_else(|| format!("expected an N from 1 to 1000000 in `{name}(N)`, found `{text}`"))?;
    match (name, word) {
        ("queue", None | Some("drop_oldest")) => Ok(Policy::queue(n)),
        ("queue", Some("drop_newest")) => Ok(Policy::Queue { capacity: n, full: Full::DropNewest }),
        ("queue", Some("fail")) => Ok(Policy::Queue { capacity: n, full: Full::Fail }),
        ("pipelined", None) => Ok(Policy::pipelined(n)),
        ("pipelined", Some("overtaking")) => Ok(Policy::Pipelined { places: n, late: Late::Overtaken }),
        ("pipelined", Some(text)) => {
            let ms = text.strip_prefix("put_off ").and_then(|ms| ms.trim().parse().ok());
            let by = ms.and_then(|ms| span_ms(ms).ok()).filter(|by| *by > Span::ZERO).ok_or_else(wrong)?;
            Ok(Policy::Pipelined { places: n, late: Late::PutOff(by) })
        }
        _ => Err(wrong()),
    }
}

/// Deadline of an operator.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields)]
pub struct Deadline {
    /// Length of the deadline, ms.
    #[schemars(range(min = LEAST_MS, max = MS_MAX))]
    pub ms: f64,
    /// Event from which the deadline counts.
    #[serde(default)]
    pub anchor: Anchor,
    /// Reaction to a missed deadline.
    #[serde(default)]
    pub reaction: Reaction,
}

impl Deadline {
    /// The engine's deadline, or the problem.
    pub fn deadline(&self) -> Result<swerve_flow::Deadline, String> {
        self.check_ranges().map_err(|error| problem(error).1)?;
        let length = span_of_ms(self.ms);
        Ok(swerve_flow::Deadline::after(length).anchor(self.anchor).reaction(self.reaction))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn policies_are_read_as_written() {
        assert_eq!(parse_policy("queue(2)"), Ok(Policy::queue(2)));
        assert_eq!(
            parse_policy("queue( 2 , drop_newest )"),
            Ok(Policy::Queue { capacity: 2, full: Full::DropNewest })
        );
        assert_eq!(
            parse_policy("pipelined(4, overtaking)"),
            Ok(Policy::Pipelined { places: 4, late: Late::Overtaken })
        );
        let put_off = Policy::Pipelined { places: 4, late: Late::PutOff(Span::from_ms(50)) };
        assert_eq!(parse_policy("pipelined(4, put_off 50)"), Ok(put_off));
        assert_eq!(parse_policy(&put_off.to_string()), Ok(put_off));
        for wrong in [
            "queue",
            "queue(0)",
            "queue(-1)",
            "pipelined(4, drop_newest)",
            "pipelined(4, put_off)",
            "pipelined(4, put_off 0)",
            "pipelined(4, put_off nan)",
            "skip",
            "queue(1,drop_oldest,x)",
        ] {
            assert!(parse_policy(wrong).is_err(), "{wrong}");
        }
        for wrong in ["queue(0)", "queue( -1, fail)", "pipelined(1000001)", "queue(two)", "pipelined()"] {
            let said = parse_policy(wrong).unwrap_err();
            let name = wrong.split('(').next().unwrap();
            assert_eq!(said, format!("expected an N from 1 to 1000000 in `{name}(N)`, found `{wrong}`"));
        }
    }

    #[test]
    fn runtime_has_exactly_one_model() {
        assert_eq!(Runtime::fixed(5.0).model(), Ok(RuntimeModel::Fixed(Span::from_ms(5))));
        assert!(Runtime::default().model().is_err());
        assert!(Runtime { zero: Some(true), ..Runtime::fixed(1.0) }.model().is_err());
        for ms in [f64::NAN, -1.0, f64::INFINITY, 1e12] {
            assert!(Runtime::fixed(ms).model().is_err(), "{ms}");
        }
        assert!(Runtime { cycle_ms: Some(vec![5.0, 0.0]), ..Runtime::default() }.model().is_err());
    }
}
