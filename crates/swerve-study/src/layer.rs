//! Share of the comfortable layer: number of plans that it made, and whether a comparison of planners is meaningful.

use std::collections::{BTreeMap, BTreeSet};

use super::grid::{Cell, Study};
use super::result::CellResult;

/// Key by which a study varies the planner.
const PLANNER: &str = "planning.planner";
/// Prefix of plan counts in a cell's metrics.
const COUNTS: &str = "plans.counts.";

/// Numbers of plans in one or more drives.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Plans {
    /// Plans made by the comfortable layer.
    pub comfortable: u64,
    /// All plans.
    pub all: u64,
}

impl Plans {
    /// Counts of one drive; zero if no plan was counted.
    pub(crate) fn of(result: &CellResult) -> Self {
        let counts = || result.figures.iter().filter_map(|(name, n)| Some((name.strip_prefix(COUNTS)?, *n)));
        let sum = |is_one: &dyn Fn(&str) -> bool| {
            counts().filter(|(name, _)| is_one(name)).map(|(_, n)| n as u64).sum()
        };
        Self { comfortable: sum(&|name| name == "comfortable"), all: sum(&|_| true) }
    }

    /// Adds the counts of another drive.
    pub(crate) fn add(&mut self, other: Self) {
        self.comfortable += other.comfortable;
        self.all += other.all;
    }

    fn are_all_comfortable(self) -> bool {
        self.all > 0 && self.comfortable == self.all
    }

    /// Share of the comfortable layer as text; `None` without plans. `all` and `no` are used only for exactly all and
    /// none.
    pub(crate) fn text(self) -> Option<String> {
        match (self.comfortable, self.all) {
            (_, 0) => None,
            (0, _) => Some("no plan comfortable".into()),
            (made, all) if made == all => Some("all plans comfortable".into()),
            (made, all) => {
                let percent = (100.0 * made as f64 / all as f64).round().clamp(1.0, 99.0);
                Some(format!("{percent:.0} % of plans comfortable"))
            }
        }
    }
}

/// Note on the number of drives in a comparison of planners in which the comfortable layer made every plan for all
/// planners, so that the planners cannot differ. `None` if there are no such drives.
pub(crate) fn note(study: &Study, results: &[Option<CellResult>]) -> Option<String> {
    let sets_planner = |axis: &usize| {
        study
            .steps
            .get(*axis)
            .is_some_and(|steps| steps.iter().any(|step| step.sets.iter().any(|(key, _)| key == PLANNER)))
    };
    let (planner, others): (Vec<usize>, Vec<usize>) = (0..study.axes.len()).partition(sets_planner);
    let labels = |cell: &Cell, axes: &[usize]| -> Vec<String> {
        axes.iter().map(|axis| cell.labels[*axis].clone()).collect()
    };
    let mut drives = 0;
    // Drives that differ only in the planner: the planners and the number of drives.
    let mut alike: BTreeMap<Vec<String>, (BTreeSet<Vec<String>>, usize)> = BTreeMap::new();
    for (cell, result) in study.cells.iter().zip(results) {
        let Some(result) = result.as_ref().filter(|result| result.error.is_none()) else { continue };
        drives += 1;
        if Plans::of(result).are_all_comfortable() {
            let (planners, n) = alike.entry(labels(cell, &others)).or_default();
            planners.insert(labels(cell, &planner));
            *n += 1;
        }
    }
    let n: usize = alike.values().filter(|(planners, _)| planners.len() > 1).map(|(_, n)| n).sum();
    (n > 0).then(|| {
        format!(
            "The comfortable layer made every plan of {n} of {drives} drives, whichever the planner: planners are not \
             compared there. Without the layer: planning.comfort.enabled=false"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Step;
    use crate::table::tests::study;

    fn result(cell: &Cell, comfortable: u64, found: u64) -> Option<CellResult> {
        let counts = [("comfortable", comfortable), ("found", found), ("route", 0)];
        let figures = counts.map(|(name, n)| (format!("{COUNTS}{name}"), n as f64)).into();
        Some(CellResult { figures, ..CellResult::blank(cell, "avoided") })
    }

    /// Study of two planners at two speeds, with one seed each.
    fn of_planners() -> Study {
        let mut study = study();
        let step = |name: &str, key: &str| Step {
            label: name.into(),
            sets: vec![(key.into(), name.into())],
            ..Step::default()
        };
        study.steps = vec![
            vec![step("fot", PLANNER), step("rrt_star", PLANNER)],
            vec![step("16", "ego.speed_mps"), step("18", "ego.speed_mps")],
            vec![step("1", "seed")],
        ];
        let labels =
            [["fot", "16", "1"], ["fot", "18", "1"], ["rrt_star", "16", "1"], ["rrt_star", "18", "1"]];
        for (cell, labels) in study.cells.iter_mut().zip(labels) {
            cell.labels = labels.map(str::to_owned).to_vec();
        }
        study
    }

    #[test]
    fn comparison_of_planners_driven_by_the_layer_is_noted() {
        let study = of_planners();
        let results = |plans: [(u64, u64); 4]| -> Vec<Option<CellResult>> {
            study.cells.iter().zip(plans).map(|(cell, (made, found))| result(cell, made, found)).collect()
        };
        let said = |plans| note(&study, &results(plans));
        let all = said([(30, 0); 4]).unwrap();
        assert!(
            all.contains("every plan of 4 of 4 drives") && all.contains("planning.comfort.enabled=false")
        );
        // At 18 m/s one of the two planners planned itself, so these drives can be compared.
        let part = said([(30, 0), (30, 0), (30, 0), (29, 1)]).unwrap();
        assert!(part.contains("every plan of 2 of 4 drives"), "{part}");
        assert_eq!(said([(30, 0), (29, 1), (29, 1), (30, 0)]), None);
        assert_eq!(said([(0, 30); 4]), None);
        assert_eq!(said([(0, 0); 4]), None, "without plans there is nothing to say");
        let mut unplanned = study.clone();
        unplanned.steps[0].iter_mut().for_each(|step| step.sets[0].0 = "control.controller".into());
        assert_eq!(note(&unplanned, &results([(30, 0); 4])), None, "planners are not compared");
    }

    #[test]
    fn all_means_every_plan_is_comfortable() {
        let text = |comfortable, all| Plans { comfortable, all }.text();
        assert_eq!(text(0, 0), None);
        assert_eq!(text(0, 9).unwrap(), "no plan comfortable");
        assert_eq!(text(9, 9).unwrap(), "all plans comfortable");
        assert_eq!(text(999, 1000).unwrap(), "99 % of plans comfortable");
        assert_eq!(text(1, 1000).unwrap(), "1 % of plans comfortable");
        assert_eq!(text(3, 4).unwrap(), "75 % of plans comfortable");
    }
}
