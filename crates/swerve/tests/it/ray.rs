//! The shards of a study on two local Ray workers, by the script of the how-to page. `SWERVE_PYTHON`
//! names a Python that has Ray, where `python3` has not.

use std::process::Command;

use crate::support::{Bench, Said};

/// The page's script, for two workers and another study.
fn script() -> String {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/howto/run_a_study.md");
    let page = std::fs::read_to_string(page).unwrap();
    let block = page.split("```python\n").nth(1).expect("the page holds a script for Ray");
    let mut script = block.split("```").next().unwrap().to_owned();
    let changes = [
        ("SHARDS = 8", "SHARDS = 2"),
        ("\"configs/studies/planners.toml\"", "\"study.toml\""),
        ("ray.init()", "ray.init(num_cpus=2, include_dashboard=False)"),
    ];
    for (from, to) in changes {
        assert_eq!(script.matches(from).count(), 1, "`{from}` is not once in the page's script");
        script = script.replace(from, to);
    }
    script
}

#[test]
#[ignore = "Ray"]
fn the_pages_script_runs_shards_on_two_workers() {
    let script = script();
    let python = std::env::var("SWERVE_PYTHON").unwrap_or_else(|_| "python3".into());
    let has_ray = Command::new(&python).args(["-c", "import ray"]).output().is_ok_and(|o| o.status.success());
    if !has_ray {
        println!("skipped: {python} has no Ray (pip install ray; SWERVE_PYTHON names another Python)");
        return;
    }
    let bench = Bench::new();
    let axis = "[[axis]]\nkey = \"seed\"\nvalues = [1, 2, 3, 4, 5]\n";
    bench.write("study.toml", &format!("base = {{ scenario = \"short.toml\" }}\n{axis}"));
    bench.write("shards.py", &script);
    let mut call = bench.shell_command(&format!("{python} shards.py"));
    let said = Said::of(&call.env("RAY_USAGE_STATS_ENABLED", "0").output().unwrap());
    assert_eq!(said.code, Some(0), "{said:?}");
    bench.good(&["study", "study.toml", "--out", "whole"]);
    for name in ["cells.csv", "heatmap.svg"] {
        assert_eq!(
            bench.read(&format!("out/planners/{name}")),
            bench.read(&format!("whole/{name}")),
            "{name}"
        );
    }
    assert_eq!(bench.read("out/shards/1/cells.csv").lines().count(), 4);
    assert_eq!(bench.read("out/shards/2/cells.csv").lines().count(), 3);
}
