//! Parts of the cost functions that need no reference path.
//!
//! Source: `commonroad_dc.costs` of `commonroad-drivability-checker` 2025.4.0: each part is the integral of a square by
//! Simpson's rule over the states, differences by `numpy.diff`.

use core::fmt;

use crate::{Driven, Model, PlanningProblem};

/// A cost function of the benchmark.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum CostFunction {
    /// T.
    Jb1,
    /// SA, SR, D.
    Sa1,
    /// T, V, A, J, D, L.
    Wx1,
    /// A, SA, SR, L, V, O.
    Sm1,
    /// A, SA, SR, L, O.
    Sm2,
    /// A, SA, SR, V, O.
    Sm3,
    /// Jlat, Jlon, Vlon, ID.
    Mw1,
    /// Jlon, SR, D, LC.
    Tr1,
    /// A name without a function.
    Tr2,
}

/// A part of a cost function.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Part {
    /// Acceleration.
    A,
    /// Jerk.
    J,
    /// Steering angle.
    Sa,
    /// Steering rate.
    Sr,
    /// Path length.
    L,
    /// Duration.
    T,
    /// Difference from the goal's lowest speed.
    V,
    /// Inverse duration; 10 for durations of at least a step, as in the official evaluation.
    Id,
    /// Distance to obstacles along the reference path; not computed.
    D,
    /// Orientation against the reference path; not computed.
    O,
    /// Offset from the middle of the lane; not computed.
    Lc,
    /// Lateral jerk along the reference path; not computed.
    Jlat,
    /// Longitudinal jerk along the reference path; not computed.
    Jlon,
    /// Speed along the reference path; not computed.
    Vlon,
}

impl CostFunction {
    const ALL: [Self; 9] =
        [Self::Jb1, Self::Sa1, Self::Wx1, Self::Sm1, Self::Sm2, Self::Sm3, Self::Mw1, Self::Tr1, Self::Tr2];

    /// Name in the identity of a benchmark.
    pub fn name(self) -> &'static str {
        match self {
            Self::Jb1 => "JB1",
            Self::Sa1 => "SA1",
            Self::Wx1 => "WX1",
            Self::Sm1 => "SM1",
            Self::Sm2 => "SM2",
            Self::Sm3 => "SM3",
            Self::Mw1 => "MW1",
            Self::Tr1 => "TR1",
            Self::Tr2 => "TR2",
        }
    }

    /// The function of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|function| function.name() == name)
    }

    /// Names of all functions, for messages.
    pub(crate) fn names() -> String {
        Self::ALL.map(Self::name).join(", ")
    }

    /// Parts with their weights.
    pub fn parts(self) -> &'static [(Part, f64)] {
        use Part::{A, D, Id, J, Jlat, Jlon, L, Lc, O, Sa, Sr, T, V, Vlon};
        match self {
            Self::Jb1 => &[(T, 1.0)],
            Self::Sa1 => &[(Sa, 0.1), (Sr, 0.1), (D, 100_000.0)],
            Self::Wx1 => &[(T, 10.0), (V, 1.0), (A, 0.1), (J, 0.1), (D, 0.1), (L, 10.0)],
            Self::Sm1 => &[(A, 50.0), (Sa, 50.0), (Sr, 50.0), (L, 1.0), (V, 20.0), (O, 50.0)],
            Self::Sm2 => &[(A, 50.0), (Sa, 50.0), (Sr, 50.0), (L, 1.0), (O, 50.0)],
            Self::Sm3 => &[(A, 50.0), (Sa, 50.0), (Sr, 50.0), (V, 20.0), (O, 50.0)],
            Self::Mw1 => &[(Jlat, 5.0), (Jlon, 0.5), (Vlon, 0.2), (Id, 1.0)],
            Self::Tr1 => &[(Jlon, 0.01), (Sr, 22.0), (D, 8.0), (Lc, 0.5)],
            Self::Tr2 => &[],
        }
    }
}

impl Part {
    /// Name in the official evaluation.
    pub fn name(self) -> &'static str {
        match self {
            Self::A => "A",
            Self::J => "J",
            Self::Sa => "SA",
            Self::Sr => "SR",
            Self::L => "L",
            Self::T => "T",
            Self::V => "V",
            Self::Id => "ID",
            Self::D => "D",
            Self::O => "O",
            Self::Lc => "LC",
            Self::Jlat => "Jlat",
            Self::Jlon => "Jlon",
            Self::Vlon => "Vlon",
        }
    }
}

/// Costs of a solution.
#[derive(Clone, PartialEq, Debug)]
pub struct Costs {
    /// The cost function.
    pub function: CostFunction,
    /// Parts with weight and value; `None` for parts that are not computed.
    pub parts: Vec<(Part, f64, Option<f64>)>,
}

impl Costs {
    /// Sum of the weighted parts; `None` if one is not computed, or the function has none.
    pub fn total(&self) -> Option<f64> {
        if self.parts.is_empty() {
            return None;
        }
        self.parts.iter().map(|(_, weight, value)| Some(weight * (*value)?)).sum()
    }
}

/// Formats the parts, and the total or the parts that are missing in it.
impl fmt::Display for Costs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.function.name())?;
        let missing: Vec<&str> =
            self.parts.iter().filter(|part| part.2.is_none()).map(|part| part.0.name()).collect();
        match self.total() {
            Some(total) => write!(f, " = {total:.6}")?,
            None if self.parts.is_empty() => write!(f, " is not defined")?,
            None => write!(f, " has no total: {} are not computed", missing.join(", "))?,
        }
        for (part, weight, value) in &self.parts {
            if let Some(value) = value {
                write!(f, "; {} {value:.6} (weight {weight})", part.name())?;
            }
        }
        Ok(())
    }
}

/// Costs of a solution of a planning problem by a cost function, given the duration of a step.
pub fn costs(function: CostFunction, problem: &PlanningProblem, driven: &Driven, step_s: f64) -> Costs {
    let value = |part: Part| part_value(part, problem, driven, step_s);
    let parts = function.parts().iter().map(|(part, weight)| (*part, *weight, value(*part)));
    Costs { function, parts: parts.collect() }
}

fn part_value(part: Part, problem: &PlanningProblem, driven: &Driven, step_s: f64) -> Option<f64> {
    let states = &driven.states;
    let is_track = driven.model != Model::Pm;
    let speeds = || states.iter().map(|state| state.speed_mps).collect::<Vec<f64>>();
    let steering = || states.iter().map(|state| state.steering_rad).collect::<Vec<f64>>();
    let squares = |values: Vec<f64>| {
        simpson(&values.into_iter().map(|value| value * value).collect::<Vec<f64>>(), step_s)
    };
    let duration_s = || {
        let steps =
            states.last().map_or(0, |state| state.step) - states.first().map_or(0, |state| state.step);
        f64::from(steps) * step_s
    };
    Some(match part {
        Part::T => duration_s(),
        Part::Id => 1.0 / duration_s().min(0.1),
        _ if !is_track => return None,
        Part::L => simpson(&speeds(), step_s),
        Part::A => squares(rates(&speeds(), step_s)),
        Part::J => squares(rates(&rates(&speeds(), step_s), step_s)),
        Part::Sa => squares(steering()),
        Part::Sr => squares(rates(&steering(), step_s)),
        Part::V => {
            let lowest = problem.goals.iter().filter_map(|goal| goal.speed_mps).map(|speeds| speeds.from);
            let wanted = lowest.reduce(f64::min).filter(|speed_mps| *speed_mps != 0.0);
            wanted.map_or(0.0, |wanted| squares(speeds().into_iter().map(|speed| wanted - speed).collect()))
        }
        Part::D | Part::O | Part::Lc | Part::Jlat | Part::Jlon | Part::Vlon => return None,
    })
}

fn rates(values: &[f64], step_s: f64) -> Vec<f64> {
    values.windows(2).map(|two| (two[1] - two[0]) / step_s).collect()
}

/// Simpson's rule; the last interval of an even number of samples by Cartwright's correction, as in SciPy from 1.11 on.
fn simpson(values: &[f64], step: f64) -> f64 {
    let plain = |values: &[f64]| {
        let inner: f64 = (1..values.len() - 1).map(|k| if k % 2 == 1 { 4.0 } else { 2.0 } * values[k]).sum();
        step / 3.0 * (values[0] + inner + values[values.len() - 1])
    };
    match values {
        [] | [_] => 0.0,
        [a, b] => 0.5 * step * (a + b),
        values if values.len() % 2 == 1 => plain(values),
        [head @ .., last] => {
            let [.., before, at] = head else { return 0.0 };
            plain(head) + step * (5.0 * last + 8.0 * at - before) / 12.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Exact for parabolas with any number of samples but two.
    #[test]
    fn simpson_integrates_parabolas_exactly() {
        for count in [3_u32, 4, 5, 8, 9] {
            let step = 0.1;
            let values: Vec<f64> = (0..count).map(|k| (f64::from(k) * step).powi(2)).collect();
            let end = f64::from(count - 1) * step;
            assert!((simpson(&values, step) - end.powi(3) / 3.0).abs() < 1e-12, "{count}");
        }
        assert!((simpson(&[1.0, 2.0], 0.1) - 0.15).abs() < 1e-15);
    }

    #[test]
    fn function_with_an_unknown_part_has_no_total() {
        let costs = |value| Costs {
            function: CostFunction::Sa1,
            parts: vec![(Part::Sa, 0.1, Some(2.0)), (Part::D, 8.0, value)],
        };
        assert_eq!(costs(None).total(), None);
        assert_eq!(costs(Some(1.0)).total(), Some(8.2));
        assert!(costs(None).to_string().contains("D are not computed"));
    }
}
