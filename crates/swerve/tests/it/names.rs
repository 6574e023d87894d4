//! Built-in files are used by name where no file of that name exists; `swerve new` creates a project folder.

use crate::support::{Bench, SHORT, digest};

#[test]
fn scenario_and_configuration_are_found_by_name() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let (scenario, config) =
        (format!("{root}/scenarios/person_crossing.toml"), format!("{root}/configs/paper.toml"));
    let bench = Bench::new();
    let by_path = bench.good(&["run", &scenario, "-c", &config, "--out", "o"]);
    for (scenario, config) in
        [("person_crossing", "paper"), ("scenarios/person_crossing.toml", "configs/paper.toml")]
    {
        let by_name = bench.good(&["run", scenario, "-c", config]);
        assert_eq!(digest(&by_name), digest(&by_path), "{scenario}");
    }
    bench.good(&["replay", "out/person_crossing/log.mcap", "--verify"]);
    bench.good(&["graph", "lane", "-c", "live/autoware"]);
    let tried =
        bench.good(&["run", "lane", "-c", "autoware", "--set", "gate.enabled=true", "--out", "tried"]);
    assert!(tried.contains("COMPLETED") && tried.contains("gate  "), "{tried}");
    assert!(bench.good(&["check", "configs/live"]).ends_with(" files, no problem\n"));
    let check = |set: &str| bench.swerve(&["check", "live/autoware", "--set", set]);
    assert_eq!(check("ego.speed_mps=5").code, Some(0));
    let fault = check("ego.speed_mps=500");
    assert!(
        fault.code == Some(1) && fault.stderr.contains("--set: ego.speed_mps: expected 0 to 70"),
        "{fault:?}"
    );
    bench.good(&["timing", "av"]);
    let solved = bench.good(&["plan", "detour", "--planner", "rrt_star", "--discretisation", "fast"]);
    assert!(solved.contains("rrt_star fast: 2 of 2 solved"), "{solved}");
    let old = bench.swerve(&["plan", "detour", "--planner", "rrt_star", "--config", "fast"]);
    assert!(old.code == Some(2) && old.stderr.contains("--discretisation"), "{old:?}");
}

#[test]
fn files_named_by_a_built_in_study_are_found() {
    let bench = Bench::new();
    bench.good(&["study", "planners", "--shard", "1/240", "--out", "o"]);
    let commands = bench.read("o/commands.txt");
    let first = commands.lines().next().unwrap();
    assert!(
        first.starts_with("swerve run scenarios/person_behind_truck.toml -c configs/paper.toml "),
        "{first}"
    );
    let said = bench.shell(first);
    assert_eq!(said.code, Some(0), "{said:?}");
}

/// A file in any folder can name built-in files.
#[test]
fn file_can_name_built_in_files() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("mine")).unwrap();
    let study =
        "base = { scenario = \"lane\", config = \"paper\" }\n[[axis]]\nkey = \"seed\"\nvalues = [1]\n";
    bench.write("mine/study.toml", study);
    bench.write("mine/live.toml", "[live]\nroute = \"lane\"\n[ros2]\nvehicle = \"autoware\"\n");
    assert_eq!(bench.good(&["check", "mine"]), "2 files, no problem\n");
    bench.good(&["study", "mine/study.toml", "--out", "o"]);
    assert!(
        bench.read("o/commands.txt").starts_with("swerve run lane -c paper "),
        "{}",
        bench.read("o/commands.txt")
    );
    // A file takes precedence over a name here too.
    bench.write("mine/lane", SHORT);
    bench.good(&["study", "mine/study.toml", "--out", "p"]);
    assert!(
        bench.read("p/commands.txt").starts_with("swerve run mine/lane "),
        "{}",
        bench.read("p/commands.txt")
    );
}

#[test]
fn file_takes_precedence_over_a_name() {
    let bench = Bench::new();
    bench.write("lane", SHORT);
    assert!(bench.good(&["run", "lane"]).starts_with("short, "));
    std::fs::remove_file(bench.path("lane")).unwrap();
    // A folder is not a scenario.
    std::fs::create_dir(bench.path("person_crossing")).unwrap();
    assert!(bench.good(&["run", "person_crossing"]).starts_with("person_crossing, "));
}

#[test]
fn unknown_name_is_reported_with_the_nearest() {
    let bench = Bench::new();
    for (args, says) in [
        (&["run", "person_behind_trukc"][..], "did you mean the scenario `person_behind_truck`"),
        (&["run", "short.toml", "-c", "papr"], "did you mean the configuration `paper`"),
        (&["study", "planers"], "did you mean the study `planners`"),
        (&["live", "autowear"], "did you mean the configuration `autoware`"),
        (
            &["plan", "detuor", "--planner", "fot", "--discretisation", "fast"],
            "did you mean the problem file `detour`",
        ),
    ] {
        let said = bench.swerve(args);
        assert_eq!(said.code, Some(1), "{said:?}");
        let is_told = said.stderr.contains("cannot be read: ") && said.stderr.contains(says);
        assert!(is_told && said.stderr.lines().count() == 1, "{args:?}: {}", said.stderr);
    }
}

#[test]
fn word_in_the_wrong_place_is_answered_with_the_right_one() {
    let bench = Bench::new();
    bench.good(&["run", "short.toml", "--out", "out/short"]);
    for (args, says) in [
        (&["why", "short"][..], "there is no log short; did you mean `out/short`?"),
        (&["why", "lane"], "there is no log lane; `swerve run lane` records one in a folder below `out`"),
        (
            &["replay", "elsewhere"],
            "there is no log elsewhere; `swerve run SCENARIO` records one in a folder",
        ),
        (&["operators", "plannr"], "unknown kind `plannr`; did you mean `planner`?"),
        (&["run", "short.toml", "--set", "latency=200"], "`planning.added_latency_ms`"),
        (&["run", "short.toml", "-c", "qqqq"], "; the program has brake_failure, camera_objects, "),
        (&["run", "short.toml", "--planner", "aeb"], "`--set planning.planner=aeb`"),
    ] {
        let said = bench.swerve(args);
        assert!(said.code != Some(0) && said.stderr.contains(says), "{args:?}: {}", said.stderr);
    }
}

#[test]
fn settings_without_an_effect_are_noted() {
    let bench = Bench::new();
    bench.write("c.toml", "[operator.detector]\ndelay_ms = 5\n");
    let sets = ["--set", "operator.detector.runtime.fixed_ms=100"];
    let said = bench.swerve(&[&["run", "short.toml", "-c", "c.toml", "--out", "o"], &sets[..]].concat());
    assert_eq!(said.code, Some(0), "{said:?}");
    let reason =
        "has no effect: operator `detector` does not run; it runs with `perception.detector = \"NAME\"`";
    for note in [
        format!("note: --set: operator.detector.runtime: {reason}"),
        format!("note: c.toml:2: operator.detector.delay_ms: {reason}"),
    ] {
        assert!(said.stderr.contains(&note), "{note}: {}", said.stderr);
    }
}

#[test]
fn scenarios_of_the_folder_and_built_in_ones_are_listed() {
    let bench = Bench::new();
    let shipped = bench.good(&["scenarios"]);
    assert!(shipped.lines().any(|line| line.starts_with("person_behind_truck ")), "{shipped}");
    std::fs::create_dir(bench.path("scenarios")).unwrap();
    bench.write("scenarios/mine.toml", &SHORT.replace("\"short\"", "\"mine\"\ndescription = \"My own.\""));
    let both = bench.good(&["scenarios"]);
    let first = both.lines().next().unwrap();
    assert!(first.starts_with("scenarios/mine.toml ") && first.ends_with("  My own."), "{both}");
    assert_eq!(both.lines().count(), 1 + shipped.lines().count(), "{both}");
}

/// Every command of the README, in an empty folder: drives last half a second, and a study runs one cell.
#[test]
fn commands_of_the_readme_run_in_an_empty_folder() {
    let readme = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../README.md")).unwrap();
    let fenced = readme.split("```sh\n").skip(1).filter_map(|block| block.split("```").next());
    let studies =
        readme.split('`').filter(|code| code.starts_with("swerve study ") && !code.contains("FILE"));
    let bench = Bench::new();
    let mut seen = 0;
    for line in fenced.flat_map(str::lines).chain(studies) {
        let line = line.replace("cargo run --release -p swerve -- ", "swerve ");
        let shorter = match line.split_whitespace().nth(1) {
            _ if !line.starts_with("swerve ") => continue,
            Some("run") => " --set scenario.end.timeout_s=0.5",
            Some("study") => " --threads 1 --shard 1/10000",
            _ => "",
        };
        let said = bench.shell(&format!("{line}{shorter}"));
        assert_eq!(said.code, Some(0), "{line}: {said:?}");
        seen += 1;
    }
    assert!(seen >= 7, "only {seen} commands found");
}

/// Every command and file shown in the README of a new folder.
#[test]
fn new_folder_runs_at_once() {
    let bench = Bench::new();
    let said = bench.good(&["new", "begin/here"]);
    assert!(said.contains("cd begin/here\n  swerve run scenario.toml -c config.toml"), "{said}");
    let rules: toml::Table = bench.read("begin/here/.taplo.toml").parse().unwrap();
    for rule in rules["rule"].as_array().unwrap() {
        let schema = rule["schema"]["path"].as_str().unwrap();
        let schema: serde_json::Value =
            serde_json::from_str(&bench.read(&format!("begin/here/{schema}"))).unwrap();
        assert!(schema["properties"].is_object(), "{rule}");
    }
    let readme = bench.read("begin/here/README.md");
    let mut seen = 0;
    for block in readme.split("```sh\n").skip(1) {
        for line in block.split("```").next().unwrap().lines() {
            let said = bench.shell(&format!("cd begin/here && {line}"));
            assert_eq!(said.code, Some(0), "{line}: {said:?}");
            match seen {
                0 => assert!(
                    said.stdout.contains("AVOIDED") && said.stdout.contains("as the scenario"),
                    "{said:?}"
                ),
                1 => assert!(said.stdout.contains("COLLISION"), "{said:?}"),
                _ => {}
            }
            seen += 1;
        }
    }
    assert!(seen >= 7, "only {seen} commands found");
    bench.good(&["check", "begin/here/scenario.toml", "begin/here/config.toml"]);
    let own = bench.swerve(&["check", "begin/here"]);
    let unknown = "own.toml:4: operator.planner.kind: unknown kind `slow_down` (one of your own is known to";
    assert!(own.stderr.contains(unknown), "{own:?}");
    assert!(own.stderr.contains("`cargo run --` in the place of `swerve`"), "{own:?}");
    assert!(own.stderr.ends_with("error: 1 problem in 3 files\n"), "a manifest is none of ours: {own:?}");
}

#[test]
fn suggested_next_command_is_quoted() {
    let said = Bench::new().good(&["new", "a b/c d"]);
    assert!(said.contains("\n  cd 'a b/c d'\n"), "{said}");
}

#[test]
fn new_folder_replaces_nothing() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("empty")).unwrap();
    bench.good(&["new", "empty"]);
    for place in ["empty", ".", "short.toml"] {
        let said = bench.swerve(&["new", place]);
        assert_eq!((said.code, said.stdout.as_str()), (Some(1), ""), "{place}");
        assert!(said.stderr.starts_with("error: ") && said.stderr.lines().count() == 1, "{said:?}");
    }
    assert_eq!(bench.read("short.toml"), SHORT);
    assert_eq!(bench.read("empty/README.md"), include_str!("../../template/README.md"));
}

/// Computes for a minute or more: `.ci/run` runs it beside the tests with the real clock.
mod long {
    use super::*;

    /// The package of a new folder, against this checkout, as its README describes.
    #[test]
    #[ignore = "builds a package on Swerve"]
    fn package_of_a_new_folder_builds_and_drives() {
        let bench = Bench::new();
        bench.good(&["new", "begin"]);
        // `.ci/python` uses the same builds of Swerve's crates.
        bench.use_builds_of_the_workspace("begin");
        let said = std::process::Command::new(env!("CARGO"))
            .args(["run", "--offline", "--quiet", "--", "run", "scenario.toml", "-c", "own.toml"])
            .env("CARGO_TARGET_DIR", Bench::target())
            .current_dir(bench.path("begin"))
            .output()
            .unwrap();
        let (out, err) = (String::from_utf8_lossy(&said.stdout), String::from_utf8_lossy(&said.stderr));
        assert!(said.status.success() && out.contains("AVOIDED"), "{out}{err}");
        let readme = bench.read("begin/README.md");
        let expected = readme.split("```text\n").nth(2).unwrap().split("```").next().unwrap();
        for line in expected.lines() {
            assert!(out.contains(line.trim_end()), "README says `{line}`\n{out}");
        }
    }
}
