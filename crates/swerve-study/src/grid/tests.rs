use super::*;

fn study(text: &str) -> Result<Study, Problems> {
    let document = Document::parse("s.toml", text).unwrap();
    let place = (Path::new("dir"), "s".to_owned());
    let checked = document.to_checked(|file| {
        let (study, problems) = Study::checked(&document, file, place, &[]);
        if problems.is_empty() { Ok(study) } else { Err(problems) }
    });
    checked.map(Study::expand)
}

#[test]
fn axes_multiply_and_the_last_is_fastest() {
    let study = study(
        "base = { scenario = \"a.toml\", set = { \"x.y\" = 1 } }\n\
         [[axis]]\nkey = \"planning.planner\"\nvalues = [\"fot\", \"rrt_star\"]\n\
         [[axis]]\nname = \"load\"\n[[axis.settings]]\nname = \"high\"\nset = { operator.planner.runtime.fixed_ms = 5 }\n\
         [[axis]]\nkey = \"seed\"\nvalues = [1, 2, 3]\n",
    )
    .unwrap();
    assert_eq!(study.axes, ["planner", "load", "seed"]);
    assert_eq!(study.cells.len(), 6);
    assert_eq!(study.cells[4].labels, ["rrt_star", "high", "2"]);
    let keys: Vec<&str> = study.cells[4].sets.iter().map(|(k, _)| k.as_str()).collect();
    assert_eq!(keys, ["x.y", "planning.planner", "operator.planner.runtime", "seed"]);
    assert_eq!(
        study.command(&study.cells[0]),
        "swerve run dir/a.toml --set x.y=1 --set 'planning.planner=\"fot\"' --set 'operator.planner.runtime={ fixed_ms = 5 }' --set seed=1"
    );
}

/// A table changes the keys that it names, wherever it is: as `--set`, in a study, and in a later file.
#[test]
fn table_is_merged_wherever_it_is_set() {
    let base = "[perception.tracker]\nscore_min = 0.5\nprobation_s = 0.06\nperson = { speed_mps = 6.0 }\n";
    let document = || Document::parse("base.toml", base).unwrap();
    let text = |document: &Document, sets: &Sets| {
        swerve_stack::Setup::from_document(document, sets).unwrap().to_text()
    };
    let changed = base.replace("0.5", "0.7").replace("6.0", "4.0");
    let wanted = text(&Document::parse("changed.toml", changed).unwrap(), &Vec::new());
    let table = "{ score_min = 0.7, person = { speed_mps = 4.0 } }";
    let given = swerve_text::parse_assignment(&format!("perception.tracker={table}")).unwrap();
    assert_eq!(text(&document(), &vec![given]), wanted, "--set");
    let other = Document::parse("other.toml", format!("perception.tracker = {table}\n")).unwrap();
    assert_eq!(text(&other.over(document()), &Vec::new()), wanted, "-c");
    let seed = "[[axis]]\nkey = \"seed\"\nvalues = [0]\n";
    for of_study in [
        format!("base = {{ scenario = \"a\", set = {{ perception.tracker = {table} }} }}\n{seed}"),
        format!(
            "base = {{ scenario = \"a\" }}\n[[axis]]\nkey = \"perception.tracker\"\nvalues = [{table}]\n"
        ),
        format!(
            "base = {{ scenario = \"a\" }}\n[[axis]]\nname = \"t\"\n[[axis.settings]]\nname = \"x\"\n\
             set = {{ perception.tracker = {table} }}\n"
        ),
    ] {
        let study = study(&of_study).unwrap();
        let sets: Sets = study.cells[0].sets.iter().filter(|(key, _)| key != "seed").cloned().collect();
        assert_eq!(text(&document(), &sets), wanted, "{of_study}");
    }
}

#[test]
fn built_in_names_apply_where_no_file_exists() {
    let text = "base = { scenario = \"lane\", config = \"paper\" }\n[[axis]]\nkey = \"seed\"\nvalues = [1]\n";
    let study = study(text).unwrap();
    assert_eq!(study.command(&study.cells[0]), "swerve run lane -c paper --set seed=1");
}

#[test]
fn values_can_be_ranges_including_both_ends() {
    let labels = |values: &str| {
        let text = format!("base = {{ scenario = \"a\" }}\n[[axis]]\nkey = \"seed\"\nvalues = {values}\n");
        let study = study(&text).map_err(|problems| problems.iter().next().unwrap().to_string());
        study.map(|study| study.steps[0].iter().map(|step| step.label.clone()).collect::<Vec<_>>().join(" "))
    };
    for (values, wanted) in [
        ("\"1..4\"", "1 2 3 4"),
        ("\"-1..0\"", "-1 0"),
        ("{ from = 0, to = 120, step = 40 }", "0 40 80 120"),
        ("{ from = 0, to = 100, step = 40 }", "0 40 80"),
        ("{ from = 0.1, to = 0.5, step = 0.1 }", "0.1 0.2 0.3 0.4 0.5"),
        ("{ from = 16, to = 17, step = 0.5 }", "16.0 16.5 17.0"),
    ] {
        assert_eq!(labels(values).as_deref(), Ok(wanted));
    }
    for (values, part) in [
        ("\"4..1\"", "axis[0].values: expected the lower number first, found \"4..1\""),
        ("\"1..18446744073709551615\"", "18446744073709551615"),
        ("\"a..b\"", "axis[0].values: expected an array, a range"),
        ("{ from = 0, to = 1, step = 0 }", "a `step` that is above 0"),
        ("{ from = 0, to = 1, stp = 1 }", "did you mean `step`?"),
        ("{ from = 0, to = 1e9, step = 1 }", "at most 100000 values"),
        ("{ from = -9223372036854775807, to = 9223372036854775807, step = 1 }", "at most 100000 values"),
    ] {
        let said = labels(values).unwrap_err();
        assert!(said.contains(part), "{values}: {said}");
    }
}

#[test]
fn axis_can_be_over_scenarios_and_base_can_have_several_configurations() {
    let text = "base = { scenario = \"lane\", config = [\"paper\", \"ros2\"] }\n\
                [[axis]]\nkey = \"scenario\"\nvalues = [\"lane\", \"x/a.toml\"]\n\
                [[axis]]\nkey = \"actor.person.speed_mps\"\nvalues = [2, 3]\n";
    let study = study(text).unwrap();
    assert_eq!(study.cells[3].labels, ["a", "3"]);
    assert_eq!(
        study.command(&study.cells[3]),
        "swerve run dir/x/a.toml -c paper -c ros2 --set actor.person.speed_mps=3"
    );
}

#[test]
fn setting_adds_configurations_over_those_of_the_base() {
    let text = "base = { scenario = \"lane\", config = \"ros2\" }\n\
                [[axis]]\nname = \"pose\"\n\
                settings = [{ name = \"truth\" }, { name = \"rtk\", config = \"localizer\", set = { seed = 7 } }]\n\
                [[axis]]\nkey = \"planning.added_latency_ms\"\nvalues = [0, 100]\n";
    let study = study(text).unwrap();
    let commands: Vec<String> = study.cells.iter().map(|cell| study.command(cell)).collect();
    assert_eq!(commands[1], "swerve run lane -c ros2 --set planning.added_latency_ms=100");
    assert_eq!(
        commands[2],
        "swerve run lane -c ros2 -c localizer --set seed=7 --set planning.added_latency_ms=0"
    );
    let files = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
    assert_eq!(study.configs(), BTreeSet::from([files(&["ros2"]), files(&["ros2", "localizer"])]));
}

#[test]
fn wrong_study_files_are_reported_with_their_place() {
    let wrong = |text: &str| {
        let problems = study(text).expect_err("wrong on purpose");
        problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    let same = "base = { scenario = \"a\" }\n[[axis]]\nkey = \"ego.speed_mps\"\nvalues = [1]\n[[axis]]\nkey = \"speed_mps\"\nvalues = [2]\n";
    assert!(
        wrong(same)
            .contains("axis[1]: a second axis of the name `speed_mps`: give one of them another by `name = ")
    );
    let of_actor = study(&same.replace("\"speed_mps\"", "\"actor.person.speed_mps\"")).expect("two names");
    assert_eq!(of_actor.axes, ["speed_mps", "person.speed_mps"]);
    assert_eq!(
        wrong("base = { scenario = \"a\" }\n[[axis]]\nkey = \"seed\"\nvalues = [3, 1, 3]\n"),
        "s.toml:2: axis[0]: `3` occurs twice"
    );
    assert!(wrong("base = { scenario = \"a\" }\naxis = []\n").contains("at least one axis"));
    assert_eq!(
        wrong(
            "base = { scenario = \"a\" }\n[[axis]]\nkey = \"seed\"\n[[axis]]\nvalues = [1]\n\
             [budget]\nmax_ms = 1e308\nlimit = \"planer\"\n"
        ),
        "s.toml:2: axis[0]: expected `values` or `settings` that are not empty\n\
         s.toml:4: axis[1]: `values` need a `key`\n\
         s.toml:8: budget.limit: no axis of the name `planer`; the study has none\n\
         s.toml:7: budget.max_ms: expected 0.1 to 100000, found 1e308"
    );
    let budget = |keys: &str| {
        wrong(&format!(
            "base = {{ scenario = \"a\" }}\naxis = [{{ key = \"seed\", values = [1] }}]\n[budget]\n{keys}"
        ))
    };
    for (keys, said) in [
        (
            "max_ms = 300\nscan_ms = 301\n",
            "5: budget.scan_ms: expected 0.1 to 300 (budget.max_ms), found 301",
        ),
        ("max_ms = 30\n", "3: budget.scan_ms: expected 0.1 to 30 (budget.max_ms), found 50"),
        (
            "max_ms = 300\nscan_ms = 5\nresolution_ms = 6\n",
            "6: budget.resolution_ms: expected 0.1 to 5 (budget.scan_ms), found 6",
        ),
    ] {
        assert_eq!(budget(keys), format!("s.toml:{said}"));
    }
    assert_eq!(
        wrong("base = { scenari = \"a\" }\n[[axis]]\nkey = \"seed\"\nvalues = 3\n"),
        "s.toml:1: base.scenari: unknown key; did you mean `scenario`?\n\
         s.toml:4: axis[0].values: expected an array, a range such as \"1..20\", or { from = 0, to = 400, step = 40 }, found 3"
    );
}

/// Line 3 is `x`, line 4 `y`, line 5 `lines`; the axis with numbers begins in line 6.
#[test]
fn wrong_plots_and_repeated_values_are_reported_before_the_first_drive() {
    let sound = "base = { scenario = \"lane\" }\n[plot]\nx = \"speed_mps\"\ny = \"min_distance_m\"\n\
                 lines = [\"planner\"]\n[[axis]]\nkey = \"ego.speed_mps\"\nvalues = [8, 9.5]\n\
                 [[axis]]\nkey = \"planning.planner\"\nvalues = [\"fot\", \"rrt_star\"]\n";
    assert!(study(sound).is_ok());
    for (old, new, wanted) in [
        (
            "min_distance_m",
            "min_distanc_m",
            "s.toml:4: plot.y: `cells.csv` has no column `min_distanc_m`; did you mean `min_distance_m`?",
        ),
        (
            "min_distance_m",
            "verdict",
            "s.toml:4: plot.y: expected a column with numbers or booleans; `verdict` has words",
        ),
        ("[\"planner\"]", "[\"planner\", \"planner\"]", "s.toml:5: plot.lines: `planner` occurs twice"),
        ("[8, 9.5]", "[8, 9.5, 8.0]", "s.toml:6: axis[0]: `8` and `8.0` are the same number"),
        ("[8, 9.5]", "[\"8\", \"8.0\"]", "s.toml:3: plot.x: `8` and `8.0` are the same number"),
        ("[8, 9.5]", "[8, 9.5, 8]", "s.toml:6: axis[0]: `8` occurs twice"),
    ] {
        let text = sound.replacen(old, new, 1);
        assert_ne!(text, sound);
        let found: Vec<String> =
            study(&text).unwrap_err().iter().map(|problem| problem.to_string()).collect();
        assert!(found.iter().any(|problem| problem == wanted), "{found:#?}, expected {wanted}");
    }
    let ranked = sound.replace("[plot]", "[ranking]\nsettings = [\"planner\", \"planner\"]\n[plot]");
    let found = study(&ranked).unwrap_err().to_string();
    assert_eq!(found, "s.toml:3: ranking.settings: `planner` occurs twice");
}
