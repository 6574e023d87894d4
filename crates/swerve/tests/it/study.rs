//! Cells, resuming, shards, failing cells, reproducing a cell.

use std::fs::File;
use std::path::PathBuf;
use std::time::SystemTime;

use serde_json::Value;

use crate::support::{Bench, SHORT, digest};

/// Two arbitrary keys, one of them with a numeric label, over a base that sets a third.
const STUDY: &str = r#"
[base]
scenario = "short.toml"
set = { operator.planner.runtime = { fixed_ms = 20 } }

[[axis]]
key = "control.period_ms"
values = [10, 20]

[[axis]]
name = "range"
key = "sensing.range_m"
values = [15.0, 60.0]
"#;

fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("study.toml", STUDY);
    bench
}

fn cells(bench: &Bench, out: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(bench.path(out).join("cells")).unwrap();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

#[test]
fn every_combination_is_a_row_and_its_command_repeats_it() {
    let bench = bench();
    let table = bench.good(&["study", "study.toml", "--out", "o", "--set", "ego.speed_mps=11"]);
    assert!(table.contains("4 of 4 cells in o"), "{table}");
    let csv = bench.read("o/cells.csv");
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(
        rows[0][..12],
        [
            "period_ms",
            "range",
            "verdict",
            "no_collision",
            "on_road",
            "min_distance_m",
            "impact_speed_mps",
            "lateral_jerk_max",
            "digest",
            "response_p50_ms",
            "response_p99_ms",
            "misses"
        ]
    );
    // All other metrics are present too; a drive without a collision has no impact.
    let of = |name: &str| rows[0].iter().position(|column| *column == name).unwrap();
    for row in &rows[1..] {
        assert!(row[of("drive.duration_s")].parse::<f64>().unwrap() > 1.0, "{csv}");
        assert_eq!((row.len(), row[of("impact_speed_mps")]), (rows[0].len(), ""), "{csv}");
        // Counts are integers, run times are given by operator, and the nearest actor has its own metrics.
        for (name, told) in [
            ("misses", "0"),
            ("operator.planner.p99_ms", "20"),
            ("operator.planner.drops", "0"),
            ("min_distance_actor", "1"),
            ("stands_before", ""),
            ("waits_at_light", ""),
        ] {
            assert_eq!(row[of(name)], told, "{name}: {csv}");
        }
        assert!(row[of("operator.planner.steps")].parse::<u32>().unwrap() > 10, "{csv}");
    }
    let labels: Vec<_> = rows[1..].iter().map(|row| (row[0], row[1])).collect();
    assert_eq!(labels, [("10", "15.0"), ("10", "60.0"), ("20", "15.0"), ("20", "60.0")]);
    let mut digests: Vec<&str> = rows[1..].iter().map(|row| row[8]).collect();
    assert!(rows[1..].iter().all(|row| row[2] == "avoided" && row[8].len() == 16), "{csv}");
    let commands = bench.read("o/commands.txt");
    assert_eq!(commands.lines().count(), 4);
    for (line, digest) in commands.lines().zip(&digests) {
        let said = bench.shell(&format!("{line} --json --out again --overwrite"));
        assert_eq!(said.code, Some(0), "{line}: {}", said.stderr);
        let again: Value = serde_json::from_str(&said.stdout).unwrap();
        assert_eq!(again["digest"], **digest, "{line}");
    }
    digests.sort_unstable();
    digests.dedup();
    assert_eq!(digests.len(), 4, "both keys change the run: {csv}");
    assert!(bench.read("o/heatmap.svg").trim_end().ends_with("</svg>"));
}

#[test]
fn comparison_of_planners_states_the_use_of_the_comfortable_layer() {
    let bench = Bench::new();
    bench.write(
        "planners.toml",
        "base = { scenario = \"lane\", set = { \"scenario.ego.end_m\" = 30 } }\n\
         axis = [{ key = \"planning.planner\", values = [\"fot\", \"rrt_star\"] }]\n",
    );
    let said = "made every plan of 2 of 2 drives";
    let key = "planning.comfort.enabled=false";
    let table = bench.good(&["study", "planners.toml", "--out", "o"]);
    for text in [table, bench.read("o/heatmap.svg"), bench.read("o/report.html")] {
        assert!(text.contains(said) && text.contains(key), "{text}");
    }
    assert!(bench.read("o/cells.csv").contains(",plans.comfortable_share,"));
    let without = bench.good(&["study", "planners.toml", "--out", "without", "--set", key]);
    assert!(!without.contains("comfortable"), "{without}");
    let one = ["run", "lane", "--set", "scenario.ego.end_m=30", "--out", "one"];
    let run = bench.good(&one);
    assert!(
        run.lines().any(|line| line.trim().starts_with("comfortable layer") && line.ends_with("(100 %)")),
        "{run}"
    );
}

#[test]
fn commands_of_a_budget_drive_it() {
    let bench = Bench::new();
    bench.write(
        "budget.toml",
        "base = { scenario = \"short.toml\", set = { \"planning.added_latency_ms\" = 10 } }\n\
         budget = { max_ms = 40, scan_ms = 30, limit = \"planner\" }\n\
         axis = [{ name = \"planner\", key = \"planning.planner\", values = [\"fot\"] }]\n",
    );
    bench.good(&["study", "budget.toml", "--out", "o"]);
    let csv = bench.read("o/cells.csv");
    assert!(csv.starts_with("planner,budget_ms,budget_is_at_least,verdict\n"), "{csv}");
    let commands = bench.read("o/commands.txt");
    let lines: Vec<&str> = commands.lines().collect();
    let budget_ms: f64 = csv.lines().nth(1).unwrap().split(',').nth(1).unwrap().parse().unwrap();
    let added = format!(" --set planning.added_latency_ms={}", budget_ms + 10.0);
    assert!(lines.len() == 2 && lines[0].ends_with(&added), "{commands}");
    assert!(lines[1].starts_with("# [limit]: "), "{commands}");
    let said = bench.shell(&format!("{} --json --out again", lines[0]));
    let again: Value = serde_json::from_str(&said.stdout).unwrap();
    assert_eq!(again["verdict"], "avoided", "{}", said.stderr);
}

#[test]
fn budget_includes_drives_that_stand_before_someone_in_the_way() {
    let bench = Bench::new();
    let scenario = |name: &str, at_m: f64| {
        let text = format!(
            "name = \"{name}\"\n[road]\nsegments = [{{ length_m = 200.0 }}]\n\
             [ego]\ntarget_speed_mps = 10.0\nstart_speed_mps = 10.0\nend_m = 190.0\n\
             [[actor]]\nname = \"wall\"\nkind = \"static\"\ns_m = {at_m}\nd_m = 0.0\n\
             size = {{ length_m = 1.0, width_m = 12.0, height_m = 2.0 }}\n[end]\ntimeout_s = 15.0\n"
        );
        bench.write(&format!("{name}.toml"), &text);
    };
    // 10 m/s are 6 m of braking at full force.
    scenario("wall", 60.0);
    scenario("close", 8.0);
    bench.write(
        "budget.toml",
        "base = { scenario = \"wall.toml\" }\nbudget = { max_ms = 40, scan_ms = 40 }\n\
         axis = [{ key = \"scenario\", values = [\"wall.toml\", \"close.toml\"] }]\n",
    );
    let table = bench.swerve(&["study", "budget.toml", "--out", "o"]).stdout;
    let csv = bench.read("o/cells.csv");
    let rows: Vec<&str> = csv.lines().skip(1).map(|line| line.split_once(',').unwrap().1).collect();
    assert_eq!(rows, ["40,true,stopped", ",,collision"], "{csv}\n{table}");
}

#[test]
fn finished_cells_are_kept_and_the_rest_is_run() {
    let bench = bench();
    bench.good(&["study", "study.toml", "--out", "o"]);
    let (csv, files) = (bench.read("o/cells.csv"), cells(&bench, "o"));
    assert_eq!(files.len(), 4);
    // Rewritten files get a new modification time; kept ones do not.
    let long_ago = SystemTime::UNIX_EPOCH;
    for file in &files {
        File::options().append(true).open(file).unwrap().set_modified(long_ago).unwrap();
    }
    let kept = || -> Vec<bool> {
        files.iter().map(|f| f.metadata().unwrap().modified().unwrap() == long_ago).collect()
    };
    std::fs::remove_file(&files[1]).unwrap();
    let again = bench.swerve(&["study", "study.toml", "--out", "o"]);
    assert_eq!((again.code, again.stderr.as_str()), (Some(0), ""));
    assert_eq!(kept(), [true, false, true, true]);
    // Under another configuration every cell differs.
    let other = ["study", "study.toml", "--out", "o", "--set", "sim.dt_ms=4"];
    let said = bench.swerve(&other);
    let told = "o: the results of another study `study` are there, with other axes, another base or another --set: expected \
                another --out, or --overwrite";
    assert!(said.code == Some(1) && said.stderr.contains(told), "{said:?}");
    assert_eq!((bench.read("o/cells.csv"), kept()), (csv.clone(), vec![true, false, true, true]));
    bench.good(&[&other[..], &["--overwrite"]].concat());
    assert_ne!(bench.read("o/cells.csv"), csv);
    bench.good(&["study", "study.toml", "--out", "o", "--overwrite"]);
    assert_eq!(bench.read("o/cells.csv"), csv);
    assert_eq!(kept(), [true, false, true, true]);
    // Another study's tables are kept, as a run's results are.
    bench.write("other.toml", STUDY);
    let other = bench.swerve(&["study", "other.toml", "--out", "o"]);
    let told = "o: the results of another study, `study`, are there: expected another --out";
    assert!(other.code == Some(1) && other.stderr.contains(told), "{other:?}");
    assert_eq!(bench.read("o/cells.csv"), csv);
    bench.good(&["run", "short.toml", "--out", "r"]);
    assert!(
        bench
            .swerve(&["suite", "short.toml", "--out", "r"])
            .stderr
            .contains("the results of a run are there")
    );
}

/// Files in a study's folder that the study did not write, or that were edited since, are not replaced, and a pipe does
/// not block it.
#[test]
fn foreign_files_in_a_study_folder_are_not_replaced() {
    let bench = bench();
    let study = |out: &str| bench.swerve(&["study", "study.toml", "--out", out]);
    for name in ["report.html", "cells.csv", "commands.txt", "heatmap.svg"] {
        let out = format!("mine_{name}");
        std::fs::create_dir_all(bench.path(&out).join("cells")).unwrap();
        bench.write(&format!("{out}/{name}"), "mine");
        let said = study(&out);
        let told = format!("{out}: {name} is there, and is of no study");
        assert!(said.code == Some(1) && said.stderr.contains(&told), "{said:?}");
        assert_eq!(bench.read(&format!("{out}/{name}")), "mine");
    }
    bench.good(&["study", "study.toml", "--out", "o"]);
    // Without extended attributes an edit cannot be detected.
    let keeps = |name: &&str| swerve_report::files::is_unchanged(&bench.path(&format!("o/{name}"))).is_some();
    for name in ["report.html", "cells.csv", "commands.txt", "heatmap.svg"].into_iter().filter(keeps) {
        let file = format!("o/{name}");
        let (before, edited) = (bench.read(&file), bench.read(&file) + "my note");
        std::fs::write(bench.path(&file), &edited).unwrap();
        let said = study("o");
        let told = format!("o: {name} was changed since it was written");
        assert!(said.code == Some(1) && said.stderr.contains(&told), "{said:?}");
        assert_eq!(bench.read(&file), edited);
        std::fs::write(bench.path(&file), before).unwrap();
        assert_eq!(study("o").code, Some(0));
    }
    let cell = cells(&bench, "o").remove(0);
    std::fs::remove_file(&cell).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(&cell).status().unwrap().success());
    let said = study("o");
    assert!(said.code == Some(1) && said.stderr.contains("expected a regular file"), "{said:?}");
}

/// An edited study counts as another study of the same name.
#[test]
fn every_study_has_a_separate_folder_and_resumes_in_it() {
    let bench = bench();
    let study = |more: &[&str]| bench.good(&[&["study", "study.toml"], more].concat());
    assert!(study(&[]).contains("4 of 4 cells in out/study-1: "));
    let (csv, files) = (bench.read("out/study-1/cells.csv"), cells(&bench, "out/study-1"));
    assert!(study(&["--set", "sim.dt_ms=4"]).contains(" in out/study-2: "));
    bench.write("study.toml", &STUDY.replace("[15.0, 60.0]", "[15.0]"));
    assert!(study(&[]).contains("2 of 2 cells in out/study-3: "));
    assert_eq!(bench.read("out/study/cells.csv"), bench.read("out/study-3/cells.csv"));
    bench.write("study.toml", STUDY);
    assert!(study(&[]).contains("4 of 4 cells in out/study-1: "));
    assert_eq!((bench.read("out/study/cells.csv"), cells(&bench, "out/study-1")), (csv, files));
    // A suite is identified by its scenarios and seeds.
    bench.write("other.toml", SHORT);
    for (scenario, folder) in [("short", "suite-1"), ("other", "suite-2"), ("short", "suite-1")] {
        let said = bench.good(&["suite", &format!("{scenario}.toml"), "--seeds", "1"]);
        assert!(said.contains(&format!("1 of 1 cells in out/{folder}: ")), "{said}");
        assert!(bench.read("out/suite/cells.csv").contains(&format!("\n{scenario},1,")));
    }
    // Nor does the second suite replace results of the first in a folder given by --out.
    let suite = |scenario: &str, more: &[&str]| {
        let words = ["suite", scenario, "--seeds", "1", "--out", "s"];
        bench.swerve(&[&words[..], more].concat())
    };
    assert_eq!(suite("short.toml", &[]).code, Some(0));
    let table = bench.read("s/cells.csv");
    let said = suite("other.toml", &[]);
    assert!(said.code == Some(1) && said.stderr.contains("another study `suite`"), "{said:?}");
    assert_eq!(said.stderr.lines().count(), 1, "{said:?}");
    assert_eq!((bench.read("s/cells.csv"), suite("short.toml", &[]).code), (table, Some(0)));
    assert_eq!(suite("other.toml", &["--overwrite"]).code, Some(0));
    assert!(bench.read("s/cells.csv").contains("\nother,1,"));
    // A run is refused in a study's folder.
    let run = bench.swerve(&["run", "short.toml", "--out", "out/suite-1"]);
    assert!(
        run.code == Some(1) && run.stderr.contains("a study's results are there: expected another --out")
    );
}

/// A digit changed by hand, a truncated file, a file under another's name, one that is not text.
#[test]
fn corrupted_cell_is_reported_and_computed_again() {
    let bench = bench();
    bench.good(&["study", "study.toml", "--out", "o"]);
    let (csv, files) = (bench.read("o/cells.csv"), cells(&bench, "o"));
    let whole: Vec<Vec<u8>> = files.iter().map(|file| std::fs::read(file).unwrap()).collect();
    let text = String::from_utf8(whole[0].clone()).unwrap();
    let kept: Value = serde_json::from_str(&text).expect("a kept cell is JSON");
    let distance = kept["result"]["min_distance_m"].to_string();
    assert_eq!(text.matches(&distance).count(), 1, "{text}");
    std::fs::write(&files[0], text.replace(&distance, "1234.5")).unwrap();
    std::fs::write(&files[1], &whole[1][..whole[1].len() / 2]).unwrap();
    std::fs::write(&files[2], &whole[3]).unwrap();
    std::fs::write(&files[3], [0xff; 300]).unwrap();
    let names: Vec<_> = files.iter().map(|f| f.file_name().unwrap().to_str().unwrap()).collect();

    let merge = ["study", "merge", "o", "--study", "study.toml", "--out", "merged"];
    let said = bench.swerve(&merge);
    assert_eq!((said.code, said.stdout.as_str()), (Some(1), ""));
    for name in &names {
        assert_eq!(said.stderr.matches(*name).count(), 1, "{name}: {}", said.stderr);
    }
    assert!(!bench.path("merged/cells.csv").exists());

    let said = bench.swerve(&["study", "study.toml", "--out", "o"]);
    assert_eq!((said.code, said.stderr.lines().count()), (Some(0), 4), "{said:?}");
    for name in &names {
        let told = |line: &&str| line.contains(*name) && line.ends_with("the cell is computed again");
        assert_eq!(said.stderr.lines().filter(told).count(), 1, "{name}: {}", said.stderr);
    }
    assert_eq!(bench.read("o/cells.csv"), csv);
    assert!(files.iter().zip(&whole).all(|(file, bytes)| std::fs::read(file).unwrap() == *bytes));
    bench.good(&merge);
    assert_eq!(bench.read("merged/cells.csv"), csv);
}

#[test]
fn shards_merge_to_the_same_bytes() {
    let bench = bench();
    bench.good(&["study", "study.toml", "--out", "whole"]);
    let first = bench.good(&["study", "study.toml", "--out", "one", "--shard", "1/2"]);
    assert!(first.contains("2 of 4 cells"), "{first}");
    let early = bench.swerve(&["study", "merge", "one", "--study", "study.toml", "--out", "early"]);
    assert!(
        early.code == Some(1) && early.stderr.contains("2 cells are in none of the folders"),
        "{early:?}"
    );
    bench.good(&["study", "study.toml", "--out", "two", "--shard", "2/2", "--threads", "1"]);
    bench.good(&["study", "merge", "two", "one", "--study", "study.toml", "--out", "merged"]);
    for name in ["cells.csv", "heatmap.svg", "commands.txt"] {
        assert!(bench.read(&format!("merged/{name}")) == bench.read(&format!("whole/{name}")), "{name}");
    }
    for wrong in ["0/2", "3/2", "1", "a/b"] {
        let said = bench.swerve(&["study", "study.toml", "--shard", wrong]);
        assert!(said.code == Some(2) && said.stderr.contains("expected I/N with 1 <= I <= N"), "{said:?}");
    }
}

/// A full queue that must not drop ends its run; the study reports it and keeps the others.
#[test]
fn failing_cell_leaves_the_others() {
    let bench = bench();
    bench.write(
        "failing.toml",
        r#"
        [base]
        scenario = "short.toml"
        set = { operator.planner.runtime = { fixed_ms = 300 } }
        [[axis]]
        name = "policy"
        key = "operator.planner.policy"
        values = ["queue(1, fail)", "skip_to_latest"]
        "#,
    );
    for call in ["first", "second"] {
        let said = bench.swerve(&["study", "failing.toml", "--out", "o"]);
        assert_eq!(said.code, Some(1), "{call} call");
        assert!(
            said.stderr.starts_with("error: 1 cells failed, the first of them [queue(1, fail)]: "),
            "{said:?}"
        );
        assert!(said.stderr.contains("planner") && said.stderr.contains("swerve run short.toml"), "{said:?}");
        assert!(!said.stderr.contains("panicked"), "{said:?}");
        let csv = bench.read("o/cells.csv");
        let rows: Vec<&str> = csv.lines().skip(1).collect();
        let empty = rows[0].strip_prefix("\"queue(1, fail)\",failed,").unwrap();
        assert!(empty.chars().all(|c| c == ','), "{empty}");
        assert!(
            rows.len() == 2 && rows[1].starts_with("skip_to_latest,") && !rows[1].contains("failed"),
            "{csv}"
        );
    }
}

#[test]
fn command_line_settings_take_precedence_over_the_file() {
    let bench = bench();
    let runtime = "operator.planner.runtime={ fixed_ms = 120 }";
    bench.good(&["study", "study.toml", "--out", "file"]);
    bench.good(&["study", "study.toml", "--out", "set", "--set", runtime]);
    assert_ne!(bench.read("file/cells.csv"), bench.read("set/cells.csv"));
}

#[test]
fn suite_drives_every_scenario_with_every_seed_and_reports_the_expected_ones() {
    let bench = Bench::new();
    bench.write("hit.toml", &SHORT.replace("\"avoided\"", "\"collision\""));
    bench.write("slow.toml", "[planning]\nadded_latency_ms = 10.0\n");
    let suite =
        ["suite", ".", "-c", "slow.toml", "--set", "ego.speed_mps=11", "--seeds", "1..2", "--out", "o"];
    let told = bench.good(&suite);
    let lines: Vec<&str> = told.lines().collect();
    assert!(
        lines.contains(
            &"hit           0 of 2 (0.00-0.66)  seed 1: expected the verdict collision, got avoided"
        ),
        "{told}"
    );
    assert!(lines.contains(&"short         2 of 2 (0.34-1.00)"), "{told}");
    assert_eq!(
        lines.last(),
        Some(&"2 of 4 (0.15-0.85) drives as their scenarios expect (95 % intervals)"),
        "{told}"
    );
    let csv = bench.read("o/cells.csv");
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows[0][..3], ["scenario", "seed", "verdict"]);
    let column = rows[0].iter().position(|name| *name == "as_expected").unwrap();
    let kept: Vec<_> = rows[1..].iter().map(|row| (row[0], row[1], row[column])).collect();
    assert_eq!(
        kept,
        [("hit", "1", "false"), ("hit", "2", "false"), ("short", "1", "true"), ("short", "2", "true")]
    );
    // Its command lines reproduce its runs, and its page is a study's page.
    let line = bench.read("o/commands.txt").lines().nth(3).unwrap().to_owned();
    let again = bench.shell(&line);
    assert_eq!(digest(&again.stdout), rows[4][8], "{line}");
    assert!(bench.good(&["report", "o"]).contains("report.html"));
    for (more, says) in [
        (&["--strict"][..], "2 of 4 drives not as their scenarios expect (--strict)"),
        (&["--set", "seed=3"], "--set: seed: expected in --seeds"),
        (&["--set", "planning.planer=1"], "--set: planning.planer: "),
    ] {
        let said = bench.swerve(&[&suite[..], more].concat());
        assert_eq!(said.code, Some(1), "{said:?}");
        assert!(said.stderr.contains(says), "{said:?}");
    }
    bench.good(&["suite", "short.toml", "--seeds", "1", "--strict", "--out", "p"]);
}
