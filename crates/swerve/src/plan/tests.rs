use swerve_pylot::posed::ProblemFile;

use super::*;

/// Three problems: a straight road with a box in the lane, a gap between two boxes, a turn.
const FILE: &str = include_str!("problems.json");

fn solutions(planner: PosedPlanner, preset: Preset) -> (ProblemFile, Vec<Solution>) {
    let file = serde_json::from_str(FILE).unwrap();
    let solutions = solve_all(&file, &read::select(&file, planner, "fast").unwrap(), preset);
    (file, solutions)
}

#[test]
fn every_planner_solves_its_problems_and_reports_its_cost() {
    for planner in [PosedPlanner::Fot, PosedPlanner::RrtStar, PosedPlanner::HybridAstar] {
        let (_, solutions) = solutions(planner, Preset::Best);
        let s = &solutions[0];
        assert!(s.found && s.reason.is_empty() && s.time_ms > 0.0 && s.work > 0, "{s:?}");
        let needed_m = if planner == PosedPlanner::RrtStar { 1.5 } else { 0.5 };
        assert!(s.clearance_m >= needed_m - 0.01, "{}", s.clearance_m);
        let json = serde_json::to_value(s).unwrap();
        let keys =
            ["id", "found", "reason", "time_ms", "work", "length_m", "cost", "clearance_m", "curvature_max"];
        assert!(keys.iter().all(|key| json.get(key).is_some()));
        assert_eq!(json["path"][0].as_array().unwrap().len(), 4);
    }
    let (_, solutions) = solutions(PosedPlanner::Fot, Preset::Paper);
    assert!(!solutions[1].found && !solutions[1].reason.is_empty() && solutions[1].path.is_empty());
}

/// Arguments of the command for a planner of the registry.
fn args_of(planner: &str) -> PlanArgs {
    PlanArgs {
        overwrite: OverwriteArgs::default(),
        file: "detour".into(),
        planner: planner.into(),
        discretisation: "fast".into(),
        set: Vec::new(),
        preset: PresetName::Best,
        json: false,
        pictures: None,
        how: PictureArgs::default(),
        report: None,
    }
}

#[test]
fn planners_of_the_registry_solve_the_problems_of_roads() {
    let file: ProblemFile = serde_json::from_str(FILE).unwrap();
    for planner in Registry::standard().planners().filter(|name| PosedPlanner::named(name).is_none()) {
        let config = read::config(&args_of(planner), &Registry::standard()).unwrap();
        let posed = Posed::Named(read::on_road(&file, &config, "fast").unwrap());
        let solutions = solve_all(&file, &posed, Preset::Best);
        assert_eq!(solutions.len(), file.problems.fot.len());
        let s = &solutions[0];
        assert!(s.found && s.time_ms > 0.0 && s.length_m > 5.0 && s.length_m == s.cost, "{planner}: {s:?}");
        assert_eq!(s.path[0], [0.0, 0.0, 0.0, 0.0], "{planner}");
        assert!(picture::draw(&file, &posed, 0, s).svg().contains("<title>box ahead</title>"));
        // The same start in the coordinates of the line.
        let along = r#""frenet_ic": [0, 14, 0, 0, 0], "target_speed": 14"#;
        let file = FILE.replace(r#""pos": [0, 0], "vel": [14, 0], "target_speed": 14"#, along);
        let file: ProblemFile = serde_json::from_str(&file).unwrap();
        let again =
            &solve_all(&file, &Posed::Named(read::on_road(&file, &config, "fast").unwrap()), Preset::Best)[0];
        assert_eq!(again.path, s.path, "{planner}");
    }
    let config = read::config(&args_of("waypoint"), &Registry::standard()).unwrap();
    let without = ProblemFile::default();
    let error = read::on_road(&without, &config, "fast").unwrap_err().to_string();
    assert_eq!(error, "problems.fot: no problem of a road, which this planner requires");
}

#[test]
fn pictures_show_path_and_outlines_and_escape_names() {
    for (planner, name) in
        [(PosedPlanner::Fot, "box ahead"), (PosedPlanner::HybridAstar, "side &lt;step&gt;")]
    {
        let (file, solutions) = solutions(planner, Preset::Best);
        let posed = read::select(&file, planner, "fast").unwrap();
        let svg = picture::draw(&file, &posed, 0, &solutions[0]).svg();
        let outlines = svg.matches("stroke-opacity=\"0.55\"").count();
        assert!(svg.contains(&format!("<title>{name}</title>")) && outlines > 5, "{outlines}");
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }
    let (file, solutions) = solutions(PosedPlanner::Fot, Preset::Best);
    let posed = read::select(&file, PosedPlanner::Fot, "fast").unwrap();
    assert!(picture::draw(&file, &posed, 1, &solutions[1]).svg().contains("not found"));
    assert_eq!(picture_name(3, "a/b ../c"), "003_a_b_.._c");
}

#[test]
fn errors_name_file_line_and_nearest_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("problems.json");
    let fault = |text: &str| {
        std::fs::write(&path, text).unwrap();
        format!("{:#}", read(&path).expect_err("wrong on purpose"))
    };
    let typo = fault(&FILE.replace("\"waypoints\": [[0, 0]", "\"waypoint\": [[0, 0]"));
    assert!(typo.contains("problems.json:15: problems.fot[0].waypoint: unknown key"), "{typo}");
    assert!(typo.contains("did you mean `waypoints`?"), "{typo}");
    let cut = fault(&FILE[..FILE.len() / 2]);
    assert!(cut.contains("problems.json:") && cut.contains("ends too early"), "{cut}");
    let huge = fault(&FILE.replace("\"vel\": [14, 0]", "\"vel\": [1e999, 0]"));
    assert!(
        huge.contains("problems.json:16: problems.fot[0].vel[0]: expected a number of at most 1.79"),
        "{huge}"
    );
    assert!(huge.ends_with(", found 1e999"), "{huge}");
    assert!(format!("{:#}", read(&folder.path().join("none.json")).unwrap_err()).contains("none.json"));

    let file = serde_json::from_str(FILE).unwrap();
    let refused =
        |file: &ProblemFile, name: &str| read::select(file, PosedPlanner::Fot, name).unwrap_err().to_string();
    assert_eq!(
        refused(&file, "fats"),
        "configs.fot: no entry `fats`: expected one of \"fast\"; did you mean `fast`?"
    );
    let mut empty = file.clone();
    empty.problems.fot.clear();
    empty.problems.rrt_star.clear();
    assert_eq!(
        refused(&empty, "fast"),
        "problems.fot: no problem for this planner: the file has some for \"hybrid_astar\""
    );
    empty.configs.fot.clear();
    assert_eq!(
        refused(&empty, "fast"),
        "configs.fot: no entry `fast`: the file has some for \"rrt_star\", \"hybrid_astar\""
    );
    assert_eq!(
        refused(&ProblemFile::default(), "fast"),
        "configs.fot: no entry `fast`: the file has none for any planner"
    );
}

/// A setting out of range is reported with its key in the file, its value and the range.
#[test]
fn numbers_out_of_range_are_reported_with_key_and_range() {
    let cases = [
        (PosedPlanner::Fot, "\"dt\": 0.3", "\"dt\": -0.3", "`dt` is -0.3, expected 0.02 to 10"),
        (
            PosedPlanner::RrtStar,
            "\"step_size\": 0.5",
            "\"step_size\": 0",
            "`step_size` is 0, expected 0.001 to 1000",
        ),
        (
            PosedPlanner::RrtStar,
            "\"goal\": [40, 0]",
            "\"goal\": [4e9, 0]",
            "`goal` is 4000000000, expected numbers below 10000000 in size",
        ),
        (
            PosedPlanner::HybridAstar,
            "\"rad_step\": 0.75",
            "\"rad_step\": 0.002",
            "`rad_step` is 0.002, expected a thousandth of rad_lower_range + rad_upper_range or more",
        ),
        (
            PosedPlanner::HybridAstar,
            "\"radius\": 6.0",
            "\"radius\": -6.0",
            "`radius` is -6, expected 0.01 to 1000",
        ),
    ];
    for (planner, right, wrong, expected) in cases {
        let file: ProblemFile = serde_json::from_str(&FILE.replace(right, wrong)).unwrap();
        let posed = read::select(&file, planner, "fast").unwrap();
        for preset in [Preset::Paper, Preset::Best] {
            let solution = &solve_all(&file, &posed, preset)[0];
            assert!(
                !solution.found && solution.invalid && solution.reason == expected,
                "{wrong}: {}",
                solution.reason
            );
        }
    }
}

#[test]
fn box_with_swapped_corners_is_refused() {
    let swapped = FILE.replace("[[28, -0.5, 29, 0.5]]", "[[29, -0.5, 28, 0.5]]");
    let error = serde_json::from_str::<ProblemFile>(&swapped).unwrap_err();
    assert!(error.to_string().starts_with("an obstacle is [29.0, -0.5, 28.0, 0.5], expected "), "{error}");
    assert_eq!(error.line(), 15);
}

/// The how-to page shows the command's output, except for host-dependent numbers.
#[test]
fn how_to_page_shows_the_command_output() {
    let page = include_str!("../../../../docs/howto/plan.md");
    let shown = page.split("```text\n").nth(1).unwrap().split("```").next().unwrap();
    let file = read(std::path::Path::new("detour")).unwrap();
    let posed = read::select(&file, PosedPlanner::RrtStar, "fast").unwrap();
    let args = args_of("rrt_star");
    let mut solutions = solve_all(&file, &posed, Preset::Best);
    // The times shown in the page.
    for (solution, time_ms) in solutions.iter_mut().zip([0.860, 0.706]) {
        solution.time_ms = time_ms;
    }
    assert_eq!(table(&args, &solutions), shown);
}

/// The problems translated to another origin.
fn moved(east: f64, north: f64) -> ProblemFile {
    let mut file: serde_json::Value = serde_json::from_str(FILE).unwrap();
    let add = |to: &mut serde_json::Value, by: f64| *to = (to.as_f64().unwrap() + by).into();
    let points = |place: &mut serde_json::Value| {
        for (k, number) in place.as_array_mut().unwrap().iter_mut().enumerate() {
            // A third number is a heading; a third and a fourth are another corner.
            add(number, if k % 2 == 0 { east } else { north });
        }
    };
    for problems in file["problems"].as_object_mut().unwrap().values_mut() {
        for problem in problems.as_array_mut().unwrap() {
            for (key, value) in problem.as_object_mut().unwrap() {
                match key.as_str() {
                    "waypoints" | "obstacles" => value.as_array_mut().unwrap().iter_mut().for_each(points),
                    "pos" => points(value),
                    "start" | "goal" => {
                        add(&mut value[0], east);
                        add(&mut value[1], north);
                    }
                    _ => {}
                }
            }
        }
    }
    serde_json::from_value(file).unwrap()
}

#[test]
fn plans_are_the_same_at_utm_coordinates() {
    let at = [691_200.0, 5_335_040.0];
    let file = moved(at[0], at[1]);
    for planner in [PosedPlanner::Fot, PosedPlanner::RrtStar, PosedPlanner::HybridAstar] {
        let far = solve_all(&file, &read::select(&file, planner, "fast").unwrap(), Preset::Best);
        let (_, near) = solutions(planner, Preset::Best);
        for (near, far) in near.iter().zip(&far) {
            assert_eq!(
                (near.found, near.path.len()),
                (far.found, far.path.len()),
                "{}: {}",
                far.id,
                far.reason
            );
            for (a, b) in near.path.iter().zip(&far.path) {
                let off_m = (a[0] + at[0] - b[0]).abs().max((a[1] + at[1] - b[1]).abs());
                assert!(off_m < 1e-6, "{}: {off_m} m", near.id);
            }
        }
    }
}
