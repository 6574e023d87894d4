//! `swerve check` reports all errors of all files at once.

use super::check;
use crate::support::{Bench, SHORT};

#[test]
fn check_reports_all_problems_of_all_files() {
    let bench = Bench::new();
    bench.write(
        "a.toml",
        &SHORT.replace("end_m = 20.0", "end_m = nan").replace("to = \"ego\"", "to = \"eg\""),
    );
    bench.write("b.toml", "[sim]\ndt_ms = 0\n[sensing]\nrange_m = -1\n[operator.planer]\nuses = \"gpu0\"\n");
    bench.write("c.toml", "base = { scenario = \"short.toml\" }\n[[axis]]\nkey = \"seed\"\n");
    bench.write(
        "g.toml",
        "[base]\nscenario = \"short.toml\"\nset = { sim.dt_ms = 5 }\n[[axis]]\nkey = \"sensing.range_m\"\n\
         values = [-1, 20, 0]\n[[axis]]\nname = \"s\"\n[[axis.settings]]\nname = \"a\"\nset = { ego.speed = 3 }\n\
         [[axis.settings]]\nname = \"b\"\nset = { control.period_ms = 10 }\n",
    );
    bench.write("d.toml", "span_ms = 100\n[[operator]]\nname = \"camera\"\nevery_ms = 0\n");
    bench.write("e.toml", "[planning\n");
    bench.write("h.toml", "# nothing yet\n");
    bench.write(
        "i.toml",
        "axis = [{ key = \"seed\", valus = [1] }]\nbudget = { max_ms = -1 }\n\
         base = { scenario = \"short.toml\", config = \"gone.toml\" }\n",
    );
    bench.write(
        "j.toml",
        "span = 100\n[[operator]]\nname = \"camera\"\nevery_ms = -1\nruntime = { fixed_ms = 1 }\n",
    );
    bench.write(
        "k.toml",
        "base = { scenario = \"short.toml\", config = \"gone.toml\" }\naxis = [{ key = \"seed\", values = [1] }]\n",
    );
    let args = [
        "check",
        "short.toml",
        "a.toml",
        "b.toml",
        "c.toml",
        "d.toml",
        "e.toml",
        "f.toml",
        "g.toml",
        "h.toml",
        "i.toml",
        "j.toml",
        "k.toml",
    ];
    let said = bench.swerve(&args);
    let says = [
        "a.toml:11: ego.end_m: ",
        "a.toml:18: actor.person.trigger.distance.to: unknown actor \"eg\"",
        "b.toml:2: sim.dt_ms: expected 1 to 20, found 0",
        "b.toml:4: sensing.range_m: expected 0.1 to 10000, found -1",
        "b.toml:5: operator.planer: unknown operator",
        "b.toml:6: operator.planer.uses: unknown resource `gpu0`",
        "c.toml:2: axis[0]: expected `values` or `settings`",
        "d.toml:",
        "e.toml:1: ",
        "f.toml: cannot be read",
        "g.toml:6: sensing.range_m: expected 0.1 to 10000, found -1, in the cell [-1 a]",
        "g.toml:6: sensing.range_m: expected 0.1 to 10000, found 0, in the cell [0 a]",
        "g.toml:11: ego.speed: unknown key; did you mean `speed_mps`?, in the cell [-1 a]",
        "i.toml:1: axis[0].valus: unknown key; did you mean `values`?",
        "i.toml:2: budget.max_ms: expected 0.1 to 100000, found -1",
        "j.toml:1: span: unknown key; did you mean `span_ms`?",
        "j.toml:4: operator[0].every_ms: expected ",
        "k.toml:1: base.config: gone.toml: cannot be read: ",
        "in 12 files",
    ];
    check(&said, &says, &args);
    assert!(!said.stderr.contains("short.toml:"), "{}", said.stderr);
    assert!(!said.stderr.contains("h.toml"), "a configuration may leave out every key: {}", said.stderr);
    assert_eq!(bench.good(&["check", "short.toml"]), "1 file, no problem\n");
}

#[test]
fn check_reports_all_missing_and_mistyped_keys() {
    let bench = Bench::new();
    bench.write("s.toml", "base = { config = 3 }\n[[axis]]\nvalues = 5\n[budget]\nscan_ms = true\n");
    bench.write(
        "t.toml",
        "span_ms = \"long\"\n[[operator]]\nevery_ms = [1]\n[[operator]]\nname = \"b\"\nat = [3]\n\
         runtime = { fixed_ms = 1 }\ndeadline = { anchor = 3 }\n[resource.gpu]\n",
    );
    bench.write(
        "c.toml",
        "planning = 3\n[sim]\ndraws = 1\n[control]\ncontroller = [\"pid\"]\n[operator.planner]\n\
         runtime = { normal_ms = [1] }\n[resource]\ngpu = {}\n",
    );
    bench.write(
        "o.toml",
        "axis = [{ key = \"seed\", values = [1] }]\nbase = { scenario = \"none.toml\", config = \"c.toml\" }",
    );
    let args = ["check", "s.toml", "t.toml", "c.toml", "o.toml"];
    let said = bench.swerve(&args);
    let says = [
        "s.toml:1: base.scenario: is missing: expected a text",
        "s.toml:1: base.config: expected a file, or an array of files, found 3",
        "s.toml:3: axis[0].values: expected an array, a range such as",
        "s.toml:4: budget.max_ms: is missing: expected a number",
        "s.toml:5: budget.scan_ms: expected a number, found true",
        "t.toml:1: span_ms: expected a number, found the text \"long\"",
        "t.toml:2: operator[0].name: is missing: expected a text",
        "t.toml:2: operator[0].runtime: is missing: expected a table",
        "t.toml:3: operator[0].every_ms: expected a number, found an array of 1",
        "t.toml:6: operator[1].at[0]: expected a text, found 3",
        "t.toml:8: operator[1].deadline.ms: is missing: expected a number",
        "t.toml:8: operator[1].deadline.anchor: expected one of \"arrival\", \"stamp\", \"start\", found 3",
        "t.toml:9: resource.gpu.slots: is missing: expected a whole number that is not negative",
        "c.toml:1: planning: expected a table, found 3",
        "c.toml:3: sim.draws: expected true or false, found 1",
        "c.toml:5: control.controller: expected a text, found an array of 1",
        "c.toml:7: operator.planner.runtime.normal_ms: expected an array of 2 values, found an array of 1",
        "c.toml:9: resource.gpu.slots: is missing: expected a whole number that is not negative",
        "o.toml:2: base.scenario: none.toml: cannot be read",
        "error: 19 problems in 4 files",
    ];
    check(&said, &says, &args);
    assert_eq!(said.stderr.lines().count(), 20, "each once: {}", said.stderr);
}

/// A million cells of independent axes need only a few hundred configurations.
#[test]
fn study_of_a_million_cells_is_checked_by_its_axes() {
    let bench = Bench::new();
    let numbers = |scale: f64| (1..=100).map(|i| format!("{}, ", f64::from(i) * scale)).collect::<String>();
    let axis = |key: &str, values: &str| format!("[[axis]]\nkey = \"{key}\"\nvalues = [{values}]\n");
    let study = |speeds: &str| {
        let head = "base = { scenario = \"short.toml\" }\n".to_owned();
        head + &axis("seed", &numbers(1.0))
            + &axis("ego.speed_mps", speeds)
            + &axis("sensing.range_m", &numbers(1.0))
    };
    bench.write("good.toml", &study(&numbers(0.5)));
    assert_eq!(bench.good(&["check", "good.toml"]), "1 file, no problem\n");
    bench.write("bad.toml", &study(&numbers(1.0).replace("100", "-1")));
    let args = ["check", "bad.toml"];
    let speed = |found| {
        format!("bad.toml:7: ego.speed_mps: expected 0 to 70, found {found}, in the cell [1 {found} 1]")
    };
    check(&bench.swerve(&args), &[&speed("71"), &speed("-1"), "30 problems in 1 file"], &args);
}

/// Files of other programs in a folder are skipped with a note; Swerve's files are checked even if misspelt.
#[test]
fn check_of_a_folder_skips_foreign_files() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("mine")).unwrap();
    bench.write("mine/Cargo.toml", "[package]\nname = \"mine\"\n[dependencies]\n");
    bench.write("mine/pyproject.toml", "[project]\nname = \"mine\"\n[tool.ruff]\nline-length = 100\n");
    bench.write("mine/a.toml", "[planning]\nplanner = \"fot\"\n");
    let said = bench.swerve(&["check", "mine"]);
    assert_eq!((said.code, said.stdout.as_str()), (Some(0), "1 file, no problem\n"), "{said:?}");
    assert_eq!(
        said.stderr,
        "left out, as none of their keys is one of Swerve's: mine/Cargo.toml, mine/pyproject.toml\n"
    );
    bench.write("mine/b.toml", "[operator.planer]\n");
    bench.write("mine/c.toml", "[planing]\n[sim]\n");
    let said = bench.swerve(&["check", "mine"]);
    assert!(
        said.stderr.contains("b.toml:1: operator.planer") && said.stderr.contains("c.toml:1: planing"),
        "{said:?}"
    );
    // A file named on the command line is always checked.
    let said = bench.swerve(&["check", "mine/pyproject.toml"]);
    assert!(said.stderr.contains("mine/pyproject.toml:1: project: unknown key"), "{said:?}");
}
