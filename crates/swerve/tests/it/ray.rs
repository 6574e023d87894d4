//! Study shards on two local Ray workers. `SWERVE_PYTHON` names a Python with Ray, if `python3` has none.

use std::process::Command;

use crate::support::{Bench, Said};

#[test]
#[ignore = "Ray"]
fn study_runs_on_two_workers() {
    let python = std::env::var("SWERVE_PYTHON").unwrap_or_else(|_| "python3".into());
    let has_ray = Command::new(&python).args(["-c", "import ray"]).output().is_ok_and(|o| o.status.success());
    if !has_ray {
        swerve_tests::skipped(&format!(
            "{python} has no Ray (pip install ray; SWERVE_PYTHON names another Python)"
        ));
        return;
    }
    let bench = Bench::new();
    let axis = "[[axis]]\nkey = \"seed\"\nvalues = [1, 2, 3, 4, 5]\n";
    bench.write("study.toml", &format!("base = {{ scenario = \"short.toml\" }}\n{axis}"));
    let mut call = bench.shell_command("swerve study study.toml --on ray --shards 2 --out o");
    call.env("RAY_USAGE_STATS_ENABLED", "0").env("SWERVE_PYTHON", &python);
    let said = Said::of(&call.output().unwrap());
    assert_eq!(said.code, Some(0), "{said:?}");
    bench.good(&["study", "study.toml", "--out", "whole"]);
    for name in ["cells.csv", "heatmap.svg"] {
        assert_eq!(bench.read(&format!("o/{name}")), bench.read(&format!("whole/{name}")), "{name}");
    }
    assert_eq!(bench.read("o/shards/1/cells.csv").lines().count(), 4);
    assert_eq!(bench.read("o/shards/2/cells.csv").lines().count(), 3);
}

#[test]
fn missing_ray_is_reported_and_the_job_is_written() {
    let bench = Bench::new();
    bench.write(
        "study.toml",
        "base = { scenario = \"short.toml\" }\n[[axis]]\nkey = \"seed\"\nvalues = [1]\n",
    );
    let said = bench.shell("SWERVE_PYTHON=no_such_python swerve study study.toml --on ray --out o");
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.stderr.contains("no_such_python has no Ray (pip install ray"), "{said:?}");
    assert!(bench.read("o/study_on_ray.py").contains("import ray"));
}
