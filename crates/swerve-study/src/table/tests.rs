use super::*;
use crate::grid::{Budget, Cell};

pub(crate) fn study() -> Study {
    let label = |p: &str, v: &str, s: &str| vec![p.to_owned(), v.to_owned(), s.to_owned()];
    let cells =
        [label("fot", "16", "1"), label("fot", "16", "2"), label("fot", "18", "1"), label("fot", "18", "2")];
    Study {
        file: "s.toml".into(),
        doubt: None,
        lines: std::collections::BTreeMap::new(),
        files: BTreeMap::new(),
        name: "s".into(),
        description: String::new(),
        scenario: "a".into(),
        config: Vec::new(),
        axes: vec!["planner".into(), "speed_mps".into(), "seed".into()],
        base: vec![],
        steps: vec![],
        cells: cells
            .into_iter()
            .enumerate()
            .map(|(index, labels)| Cell { index, labels, scenario: None, config: vec![], sets: vec![] })
            .collect(),
        budget: None,
        timeout_is_good: false,
        off_road_is_good: false,
        curve: None,
        plot: None,
        leave_out: vec![],
        ranking: None,
        timely: None,
        timely_prediction: None,
    }
}

fn result(cell: &Cell, verdict: &str, impact: Option<f64>) -> Option<CellResult> {
    Some(CellResult {
        no_collision: verdict != "collision",
        on_road: verdict != "left_road",
        min_distance_m: Some(0.5),
        impact_speed_mps: impact,
        ..CellResult::blank(cell, verdict)
    })
}

#[test]
fn grid_pools_seeds() {
    let study = study();
    let results = [
        result(&study.cells[0], "avoided", None),
        result(&study.cells[1], "collision", Some(12.0)),
        result(&study.cells[2], "avoided", None),
        None,
    ];
    let grid = Grid::of(&study, &results);
    let lines: Vec<String> = grid.text().lines().map(str::to_owned).collect();
    assert_eq!(lines[0].trim(), "speed_mps");
    assert_eq!(lines[1].split_whitespace().collect::<Vec<_>>(), ["planner", "16", "18"]);
    let (one, two) = ("1/1 (0.21-1.00)", "1/2 (0.09-0.91)");
    assert_eq!(lines[2], format!("fot             {two}        {one}"));
    assert_eq!(lines[3].trim(), "2 on road (0.34-1.00)  1 on road (0.21-1.00)");
    assert_eq!(lines[4].trim(), "impact 12.0 m/s (of 1)");
    assert_eq!(grid.squares[0].share(), Some(0.5));
    let stood = [result(&study.cells[0], "timeout", None), result(&study.cells[1], "collision", Some(9.0))];
    let of = |study: &Study| Grid::of(study, &stood).squares[0].clone();
    assert_eq!(
        (of(&study).share(), of(&study).text().as_str()),
        (Some(0.0), "1/2 (0.09-0.91), 2 on road (0.34-1.00), impact 9.0 m/s (of 1), 1 timeout (0.09-0.91)")
    );
    assert_eq!(of(&Study { timeout_is_good: true, ..study.clone() }).share(), Some(0.5));
    let safe = [result(&study.cells[0], "stopped", None), result(&study.cells[1], "collision", Some(9.0))];
    for (timeout_is_good, share, apart) in [(false, 0.0, 1), (true, 0.5, 0)] {
        let safe = Grid::of(&Study { timeout_is_good, ..study.clone() }, &safe).squares[0].clone();
        assert_eq!(
            (safe.share(), safe.stopped),
            (Some(share), apart),
            "neither good nor bad, unless asked for"
        );
        assert!(safe.text().ends_with("1 stopped (0.09-0.91)"), "{}", safe.text());
    }
    let csv = csv(&study, &results);
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines[1], format!("fot,16,1,avoided,true,true,0.5000,,,,,,0{}", ",".repeat(ALWAYS.len())));
    assert!(lines[0].ends_with(&format!(",misses,{}", ALWAYS.join(","))), "{}", lines[0]);
    let off = [result(&study.cells[0], "left_road", None), result(&study.cells[1], "avoided", None)];
    let of = |study: &Study| Grid::of(study, &off).squares[0].clone();
    assert_eq!(of(&study).share(), Some(0.5));
    assert_eq!(of(&study).text(), "2/2 (0.34-1.00), 1 on road (0.09-0.91)");
    assert_eq!(of(&Study { off_road_is_good: true, ..study }).share(), Some(1.0));
}

#[test]
fn budget_above_the_limit_is_marked() {
    let mut study = study();
    for (cell, label) in study.cells.iter_mut().zip(["fot", LIMIT, "fot", LIMIT]) {
        label.clone_into(&mut cell.labels[0]);
        cell.labels[2] = "1".into();
    }
    let limit = Some("planner".to_owned());
    study.budget = Some(Budget { max_ms: 300.0, scan_ms: 50.0, resolution_ms: 5.0, limit });
    let budgets = [250.0, 200.0, 100.0, 150.0];
    let one = |(cell, ms): (&Cell, f64)| {
        Some(CellResult { budget_ms: Some(ms), ..CellResult::blank(cell, "avoided") })
    };
    let results: Vec<_> = study.cells.iter().zip(budgets).map(one).collect();
    let grid = Grid::of(&study, &results);
    let marked: Vec<bool> = grid.squares.iter().map(|square| square.beyond_limit).collect();
    assert_eq!(marked, [true, false, false, false]);
    let picture = crate::heatmap::draw(&grid, "t").svg();
    assert_eq!(picture.matches("stroke-dasharray").count(), 2, "the square, and the legend: {picture}");
}

#[test]
fn text_metrics_have_columns() {
    let study = study();
    let mut first = result(&study.cells[0], "collision", Some(4.0)).unwrap();
    first.texts = [("impact_name", "person, on foot"), ("end", "collision")]
        .map(|(name, text)| (name.to_owned(), text.to_owned()))
        .into();
    first.figures = [("plans.count".to_owned(), 3.0)].into();
    let results = [Some(first), result(&study.cells[1], "avoided", None), None, None];
    let csv = csv(&study, &results);
    let [head, hit, _] = csv.lines().collect::<Vec<_>>()[..] else { panic!("{csv}") };
    let names = "impact_name,left_road_at_s,min_distance_actor,min_distance_name,plans.count,\
                 stands_before,stands_before_name,waits_at_light";
    assert!(head.ends_with(names), "{head}");
    assert!(hit.ends_with(",collision,,,,,,,\"person, on foot\",,,,3,,,"), "{hit}");
}

#[test]
fn failed_cell_is_reported_and_does_not_count() {
    let study = study();
    let failed = |k: usize| {
        let blank = CellResult::blank(&study.cells[k], "failed");
        Some(CellResult { error: Some("no such file".into()), ..blank })
    };
    let results = [failed(0), result(&study.cells[1], "avoided", None), failed(2), failed(3)];
    let grid = Grid::of(&study, &results);
    assert_eq!(grid.squares[0].text(), "1/1 (0.21-1.00), 1 on road (0.21-1.00), 1 failed");
    assert_eq!((grid.squares[0].share(), grid.squares[1].share()), (Some(1.0), None));
    assert_eq!(grid.squares[1].text(), "2 failed");
    let picture = crate::heatmap::draw(&grid, "t").svg();
    assert!(picture.contains(">2 failed<") && picture.contains(">1 of 1 (0.21-1.00)<"), "{picture}");
}

#[test]
fn budget_without_a_failure_is_a_lower_bound() {
    let budget = Budget { max_ms: 300.0, scan_ms: 50.0, resolution_ms: 5.0, limit: None };
    let study = Study { budget: Some(budget), ..study() };
    for (first, second, told) in [
        (Some(300.0), Some(300.0), "at least 300 ms (300 or more, 2/2)"),
        (Some(300.0), Some(120.0), "at least 300 ms (120-300 or more, 2/2)"),
        (Some(295.0), Some(120.0), "295 ms (120-295, 2/2)"),
    ] {
        let one = |k: usize, ms| {
            Some(CellResult { budget_ms: ms, ..CellResult::blank(&study.cells[k], "avoided") })
        };
        let results = [one(0, first), one(1, second), None, None];
        let grid = Grid::of(&study, &results);
        assert_eq!(grid.squares[0].text(), told);
        let picture = crate::heatmap::draw(&grid, "t").svg();
        assert!(picture.contains(&format!(">{}<", told.split_once(" (").unwrap().0)), "{picture}");
        let csv = csv(&study, &results);
        let wanted = format!("fot,16,1,{},{},avoided", first.unwrap(), first == Some(300.0));
        assert_eq!(csv.lines().nth(1), Some(wanted.as_str()));
    }
}

#[test]
fn budgets_count_the_drives_that_have_one() {
    let study = Study {
        budget: Some(Budget { max_ms: 300.0, scan_ms: 50.0, resolution_ms: 5.0, limit: None }),
        ..study()
    };
    for (budgets, expected) in [
        ([Some(120.0), None], "120 ms (120-120, 1/2)"),
        ([Some(120.0), Some(90.0)], "120 ms (90-120, 2/2)"),
        ([None, None], "none (0/2)"),
    ] {
        let results = [0, 1].map(|k| {
            let budget_ms = budgets[k];
            let verdict = if budget_ms.is_some() { "stopped" } else { "collision" };
            Some(CellResult { budget_ms, ..CellResult::blank(&study.cells[k], verdict) })
        });
        let grid = Grid::of(&study, &results);
        assert_eq!(grid.squares[0].text(), expected);
        let picture = crate::heatmap::draw(&grid, "t").svg();
        assert!(picture.contains(&format!(">{}<", expected.split_once(" (").unwrap().0)), "{picture}");
    }
}

#[test]
fn squares_state_the_share_of_comfortable_plans_if_the_layer_drives() {
    let study = study();
    let with = |cell: &Cell, comfortable: f64, found: f64| {
        let counts = [("comfortable", comfortable), ("found", found)];
        let figures = counts.map(|(name, n)| (format!("plans.counts.{name}"), n)).into();
        result(cell, "avoided", None).map(|result| CellResult { figures, ..result })
    };
    let grid = |plans: [(f64, f64); 4]| {
        let results = study.cells.iter().zip(plans).map(|(cell, (made, found))| with(cell, made, found));
        Grid::of(&study, &results.collect::<Vec<_>>())
    };
    // Both seeds of a square pooled: 40 of 50 and 20 of 30 plans.
    let shared = grid([(40.0, 10.0), (20.0, 10.0), (0.0, 30.0), (0.0, 30.0)]);
    assert!(
        shared.squares[0].text().ends_with(", 75 % of plans comfortable"),
        "{}",
        shared.squares[0].text()
    );
    assert!(shared.squares[1].text().ends_with(", no plan comfortable"), "{}", shared.squares[1].text());
    let picture = crate::heatmap::draw(&shared, "t").svg();
    assert!(
        picture.contains("75 % of plans comfortable") && picture.contains("comfortable layer"),
        "{picture}"
    );
    let without = grid([(0.0, 30.0); 4]);
    assert!(!without.text().contains("comfortable"), "{}", without.text());
    assert!(!crate::heatmap::draw(&without, "t").svg().contains("comfortable"));
}
