//! Errors are reported once, with their location and what was expected; finished results are kept.

mod checked;

use std::io::{BufRead as _, BufReader};
use std::process::Stdio;

use crate::support::{Bench, SHORT, Said};

/// A call that must fail: a file written first, its arguments, and the parts of its one-line message.
struct Case {
    file: (&'static str, String),
    args: &'static [&'static str],
    says: &'static [&'static str],
}

/// The short scenario with one error.
fn scenario(right: &str, wrong: &str) -> (&'static str, String) {
    assert_eq!(SHORT.matches(right).count(), 1, "`{right}` is not once in the scenario");
    ("bad.toml", SHORT.replace(right, wrong))
}

fn config(text: &str) -> (&'static str, String) {
    ("bad.toml", text.to_owned())
}

/// A wall across the road at the ego's start.
const WALL: &str = "[[actor]]\nname = \"wall\"\nkind = \"static\"\n\
                    size = { length_m = 1.0, width_m = 8.0, height_m = 3.0 }\ns_m = 1.0\nd_m = 0.0\n\n";

const RUN: &[&str] = &["run", "bad.toml", "--out", "o"];
const RUN_CONFIG: &[&str] = &["run", "short.toml", "-c", "bad.toml", "--out", "o"];

fn check(said: &Said, says: &[&str], args: &[&str]) {
    assert!(matches!(said.code, Some(1 | 2)), "{args:?} ends with {:?}", said.code);
    for part in says {
        assert!(said.stderr.contains(part), "{args:?} does not say `{part}`: {}", said.stderr);
    }
    for part in ["panicked", "backtrace", "RUST_"] {
        assert!(!said.stderr.contains(part), "{args:?}: {}", said.stderr);
    }
    assert_eq!(said.stderr.matches("error: ").count(), 1, "{args:?}: {}", said.stderr);
    assert_eq!(said.stdout, "", "{args:?}");
}

fn check_all(cases: Vec<Case>) {
    for Case { file: (name, text), args, says } in cases {
        let bench = Bench::new();
        bench.write(name, &text);
        let said = bench.swerve(args);
        check(&said, says, args);
        assert_eq!(said.stderr.lines().count(), 1, "{args:?}: {}", said.stderr);
        assert!(!bench.path("o").exists(), "{args:?} left a folder behind");
    }
}

#[test]
fn scenarios() {
    let case = |file, says| Case { file, args: RUN, says };
    check_all(vec![
        case(scenario("[end]", "[end]\nafter = 1"), &["bad.toml:", "end.after: unknown key"]),
        case(
            scenario("end_m = 20.0", "end_m = \"far\""),
            &["bad.toml:11: ego.end_m: expected a number", "far"],
        ),
        case(
            scenario("target_speed_mps = 12.0", "target_speed_mps = nan"),
            &["bad.toml:10: ego.target_speed_mps: expected a number from 0 to 100, found nan"],
        ),
        case(
            scenario("target_speed_mps = 12.0", "target_speed_mps = 1000"),
            &["bad.toml:10: ego.target_speed_mps: expected a number from 0 to 100, found 1000"],
        ),
        case(
            scenario("s_m = 30.0\nd_m = 4.0", "s_m = 0.0\nd_m = 0.0"),
            &["bad.toml:9: ego: the ego's start at s = 0 m, d = 0 m is inside the actor \"person\""],
        ),
        case(
            scenario("[expect]", &format!("{WALL}[expect]")),
            &["bad.toml:9: ego: the ego's start", "is inside the actor \"wall\""],
        ),
        case(
            scenario("length_m = 80.0", "length_m = 0.0"),
            &["bad.toml:4: road.segments: the route has no length"],
        ),
        case(
            scenario("to = \"ego\"", "to = \"persn\""),
            &[
                "bad.toml:18: actor.person.trigger.distance.to: unknown actor \"persn\"",
                "did you mean `person`",
            ],
        ),
        case(
            scenario(
                "[end]",
                "[expect.pipeline.fott]\nverdict = \"avoided\"\nmin_distance_m = { min = 0.5 }\n[end]",
            ),
            &["bad.toml:25: expect.pipeline.fott: unknown pipeline `fott`, expected one of "],
        ),
        case(scenario("[road]", "[road"), &["bad.toml:3: not TOML"]),
    ]);
}

#[test]
fn configurations() {
    let case = |text, says| Case { file: config(text), args: RUN_CONFIG, says };
    check_all(vec![
        case(
            "[planning]\nplaner = \"fot\"\n",
            &["bad.toml:2: planning.planer: unknown key", "did you mean `planner`?"],
        ),
        case("[sim]\ndt_ms = \"5\"\n", &["bad.toml:2: sim.dt_ms: expected a number, found the text \"5\""]),
        case("\n[sim]\ndt_ms = 50\n", &["bad.toml:3: sim.dt_ms: expected 1 to 20, found 50"]),
        case(
            "[sensing]\nrange_m = nan\n",
            &["bad.toml:2: sensing.range_m: expected 0.1 to 10000, found NaN"],
        ),
        case(
            "[planning]\nplanner = \"rrtstar\"\n",
            &[
                "bad.toml:2: planning.planner: expected one of \"fot\", \"rrt_star\", ",
                "found \"rrtstar\"",
                "did you mean `rrt_star`?",
            ],
        ),
        case(
            "[operator.planner]\nruntime = { fixed_ms = -1 }\n",
            &["bad.toml:2: operator.planner.runtime.fixed_ms: expected 0 to 86400000, found -1"],
        ),
        case("[planning.params]\nnonsense = 1\n", &["bad.toml:", "planning.params", "nonsense"]),
    ]);
}

#[test]
fn command_lines() {
    let case = |args, says| Case { file: ("unused", String::new()), args, says };
    check_all(vec![
        case(&["run", "nowhere.toml", "--out", "o"], &["nowhere.toml: cannot be read"]),
        case(&["run", "short.toml", "-c", "nowhere.toml", "--out", "o"], &["nowhere.toml: cannot be read"]),
        case(
            &["run", "short.toml", "--out", "o", "--set", "planning.planner=fott"],
            &["--set: planning.planner: expected one of ", "found \"fott\"; did you mean `fot`?"],
        ),
        case(
            &["run", "short.toml", "--out", "o", "--set", "sim.dt_ms=nan"],
            &["--set: sim.dt_ms: expected 1 to 20, found NaN"],
        ),
        case(&["run", "short.toml", "--out", "o", "--set", "seed"], &["--set: seed: expected key=value"]),
        case(
            &["run", "short.toml", "--out", "o", "--runtimes", "none.mcap"],
            &["none.mcap: cannot read the file"],
        ),
        case(&["run", "short.toml", "--out", "short.toml"], &["making short.toml"]),
        case(&["study", "nowhere.toml", "--out", "o"], &["nowhere.toml: cannot be read"]),
        case(&["calibrate", "short.toml", "--out", "no/o"], &["writing no/o: No such file"]),
        case(&["graph", "short.toml", "--picture", "short.toml"], &["short.toml: a picture would replace"]),
        case(&["timing", "short.toml", "--picture", "short.toml"], &["short.toml: a picture would replace"]),
        case(&["replay", "none.mcap"], &["none.mcap: cannot read the file"]),
        case(&["replay", "short.toml"], &["short.toml", "MCAP"]),
        case(&["timing", "nowhere.toml"], &["nowhere.toml"]),
        case(&["graph", "nowhere.toml"], &["nowhere.toml: cannot be read"]),
    ]);
}

#[test]
fn thread_counts_are_bounded() {
    for args in [
        &["run", "short.toml", "--threads", "100000"][..],
        &["run", "short.toml", "--threads", "0"],
        &["replay", "log.mcap", "--threads", "257"],
        &["study", "study.toml", "--threads", "0"],
        &["timing", "short.toml", "--threads", "4000000000"],
    ] {
        check(&Bench::new().swerve(args), &["--threads", args[3], "1..=256"], args);
    }
}

#[test]
fn error_reports_its_cause_once() {
    let said = Bench::new().swerve(&["replay", "none.mcap"]);
    assert_eq!(said.stderr.matches("No such file").count(), 1, "{}", said.stderr);
}

#[test]
fn studies() {
    let study = |text: &str| ("bad.toml", format!("base = {{ scenario = \"short.toml\" }}\n{text}"));
    let case = |text, says| Case { file: study(text), args: &["study", "bad.toml", "--out", "o"], says };
    check_all(vec![
        case("[[axis]]\nkey = \"seed\"\n", &["bad.toml:2: axis[0]: expected `values` or `settings`"]),
        case(
            "[[axis]]\nname = \"s\"\n[[axis.settings]]\nname = \"a\"\n[[axis.settings]]\nname = \"b\"\nscenario = \"lain\"\n",
            &[
                "bad.toml:8: axis[0].settings[1].scenario: lain: cannot be read: ",
                "did you mean the scenario `lane`",
            ],
        ),
        case(
            "[[axis]]\nkey = \"seed\"\nvalus = [1]\n",
            &["bad.toml:4: axis[0].valus: unknown key; did you mean `values`?"],
        ),
        case(
            "[[axis]]\nkey = \"planning.planner\"\nvalues = [\"fot\", \"fott\"]\n",
            &["bad.toml:4: planning.planner: expected one of ", "did you mean `fot`?", "[fott]"],
        ),
        case(
            "[[axis]]\nkey = \"sensing.range_m\"\nvalues = [20, -1]\n",
            &["bad.toml:4: sensing.range_m: expected 0.1 to 10000, found -1, in the cell [-1]"],
        ),
    ]);
}

#[test]
fn calibration_speeds_are_validated() {
    for speeds in ["nan", "0", "-1", "71", "1e308", "16,inf"] {
        let speeds = format!("--speeds={speeds}");
        let args = ["calibrate", "short.toml", &speeds];
        check(&Bench::new().swerve(&args), &["--speeds", "expected m/s above 0 and at most 70"], &args);
    }
}

/// Writing to a full disk is an error; a closed pipe is not.
#[test]
#[cfg(target_os = "linux")]
fn lost_output_is_reported() {
    let bench = Bench::new();
    let said = bench.shell("swerve graph short.toml > /dev/full");
    check(&said, &["writing to standard output"], &["graph"]);
    assert_eq!(bench.shell("swerve graph short.toml | head -1").stderr, "");
}

#[test]
fn varied_key_cannot_also_be_set() {
    let axis = "[[axis]]\nkey = \"planning.planner\"\nvalues = [\"fot\"]\n";
    check_all(vec![Case {
        file: ("bad.toml", format!("base = {{ scenario = \"short.toml\" }}\n{axis}")),
        args: &["study", "bad.toml", "--out", "o", "--set", "planning.planner=aeb"],
        says: &["--set: planning.planner: the axis `planner` of the study varies it"],
    }]);
}

#[test]
fn damaged_logs() {
    let bench = Bench::new();
    bench.good(&["run", "short.toml", "--out", "o"]);
    let whole = std::fs::read(bench.path("o/log.mcap")).unwrap();
    std::fs::write(bench.path("short.mcap"), &whole[..whole.len() / 2]).unwrap();
    let mut wrong = whole.clone();
    wrong[whole.len() / 3] ^= 1;
    std::fs::write(bench.path("wrong.mcap"), wrong).unwrap();
    for log in ["short.mcap", "wrong.mcap"] {
        for args in
            [&["replay", log, "--verify"][..], &["run", "short.toml", "--out", "p", "--runtimes", log]]
        {
            let said = bench.swerve(args);
            check(&said, &[log, "damaged at byte"], args);
            assert_eq!(said.stderr.lines().count(), 1, "{}", said.stderr);
        }
        // The recorded part of an interrupted run can still be analysed.
        for args in [
            &["why", log][..],
            &["report", log, "--out", "page.html"],
            &["report", log, "o/log.mcap", "--out", "pair.html"],
            &["replay", log],
            &["replay", log, "--from", "planning", "--set", "planning.planner=waypoint"],
        ] {
            let said = bench.swerve(args);
            assert_eq!((said.code, said.stderr.lines().count()), (Some(0), 1), "{args:?}: {said:?}");
            assert!(said.stderr.starts_with("note: the log is not complete, it is read up to "), "{said:?}");
        }
    }
    // Also while its page is served.
    let mut view = bench.command(&["view", "short.mcap", "--no-open", "--port", "0"]);
    let mut view = view.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut address = String::new();
    BufReader::new(view.stdout.take().unwrap()).read_line(&mut address).unwrap();
    view.kill().unwrap();
    let said = String::from_utf8(view.wait_with_output().unwrap().stderr).unwrap();
    assert!(address.starts_with("http://"), "{address}{said}");
    assert!(said.starts_with("note: the log is not complete, ") && said.lines().count() == 1, "{said}");
    assert_eq!(std::fs::read(bench.path("o/log.mcap")).unwrap(), whole);
    assert!(!bench.path("p").exists());
    bench.good(&["replay", "o/log.mcap", "--verify"]);
}

/// A run that fails before it starts leaves earlier results unchanged.
#[test]
fn failed_call_keeps_earlier_results() {
    let bench = Bench::new();
    bench.good(&["run", "short.toml", "--out", "o"]);
    let files = ["log.mcap", "trace.json", "metrics.json", "story.svg"];
    let read = || files.map(|name| std::fs::read(bench.path("o").join(name)).unwrap());
    let before = read();
    for extra in [["--runtimes", "none.mcap"], ["--set", "planning.planner=fott"], ["-c", "nowhere.toml"]] {
        let args = [&["run", "short.toml", "--out", "o"][..], &extra].concat();
        check(&bench.swerve(&args), &[], &args);
        assert!(read() == before, "{extra:?}");
    }
}

#[test]
fn doctor_reports_only_what_the_machine_has() {
    let bench = Bench::new();
    let said = Said::of(&bench.command(&["doctor"]).env_remove("XDG_RUNTIME_DIR").output().unwrap());
    assert_eq!((said.code, said.stderr.as_str()), (Some(0), ""), "{said:?}");
    assert!(
        said.stdout.starts_with("swerve ") && said.stdout.matches("shared memory").count() == 1,
        "{said:?}"
    );
    assert!(!said.stdout.contains("XDG_RUNTIME_DIR"), "{said:?}");
}

/// Simulates another run that writes to the folder.
#[test]
fn folder_used_by_another_run_is_refused() {
    let bench = Bench::new();
    bench.good(&["run", "short.toml", "--out", "o"]);
    let log = bench.path("o/log.mcap");
    let before = std::fs::read(&log).unwrap();
    let held = swerve_report::files::claim(&bench.path("o")).unwrap();
    let args = ["run", "short.toml", "--out", "o", "--seed", "9"];
    check(&bench.swerve(&args), &["error: o: another run writes its results there"], &args);
    assert!(std::fs::read(&log).unwrap() == before && !bench.path("o/log.partial.mcap").exists());
    drop(held);
    bench.good(&args);
    assert!(std::fs::read(&log).unwrap() != before);
}

#[test]
fn endless_key_is_refused() {
    let bench = Bench::new();
    bench
        .write("s.toml", "base = { scenario = \"short.toml\" }\naxis = [{ key = \"seed\", values = [1] }]\n");
    let set = format!("{}=1", vec!["a"; 20_000].join("."));
    for args in [["run", "short.toml", "--set", &set], ["study", "s.toml", "--set", &set]] {
        let said = bench.swerve(&args);
        assert_eq!(said.code, Some(1), "{}", args[0]);
        assert!(said.stderr.contains("at most 80 parts") && said.stderr.len() < 500, "{}", said.stderr);
    }
}

/// A FIFO without a writer, and a symbolic link back to the folder.
#[cfg(unix)]
#[test]
fn check_of_a_folder_skips_pipes_and_link_loops() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("all")).unwrap();
    bench.write("all/lane.toml", crate::support::SHORT);
    let pipe = bench.path("all/x.toml");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    std::os::unix::fs::symlink(bench.path("all"), bench.path("all/again")).unwrap();
    assert_eq!(bench.good(&["check", "all"]), "1 file, no problem\n");
}

#[test]
fn huge_numbers_are_shortened_in_errors() {
    let bench = Bench::new();
    bench.write("s.toml", &SHORT.replace("end_m = 20.0", "end_m = 1e308"));
    bench.write(
        "c.toml",
        "[sim]\ndt_ms = 1e308\nvehicle = { dead_time_s = 1e308 }\n[operator.planner]\nruntime = { measured = 1e308 }\n\
         delay_ms = 1e308\n[planning.params]\nhorizon_s = 1e308\n",
    );
    bench.write(
        "t.toml",
        "span_ms = 1e308\n[[operator]]\nname = \"a\"\nevery_ms = 1e308\nruntime = { log_normal_ms = [1, 1e308] }\n",
    );
    bench.write(
        "y.toml",
        "base = { scenario = \"short.toml\" }\nbudget = { max_ms = 1e308 }\n[[axis]]\nkey = \"seed\"\nvalues = [1e308]\n",
    );
    bench.write(
        "z.toml",
        "base = { scenario = \"short.toml\" }\n[[axis]]\nkey = \"sim.dt_ms\"\nvalues = [1e308]\n",
    );
    let said = bench.swerve(&["check", "s.toml", "c.toml", "t.toml", "y.toml", "z.toml"]);
    assert!(said.stderr.contains("sim.dt_ms: expected 1 to 20, found 1e308\n"), "{}", said.stderr);
    assert!(said.stderr.lines().count() >= 10, "{}", said.stderr);
    for line in said.stderr.lines() {
        assert!(line.len() < 300 && !line.contains("00000000"), "{line}");
    }
    for args in [["--set", "sim.dt_ms=1e308"], ["--set", "ego.speed_mps=-1e308"]] {
        let said = bench.swerve(&[&["run", "short.toml", "--out", "o"][..], &args].concat());
        assert!(said.code == Some(1) && said.stderr.len() < 120, "{}", said.stderr);
    }
}

#[test]
fn output_folder_that_cannot_be_created_is_reported_before_the_run() {
    let bench = Bench::new();
    bench.write(
        "study.toml",
        "base = { scenario = \"short.toml\" }\n[[axis]]\nkey = \"seed\"\nvalues = [1]\n",
    );
    for args in [["run", "short.toml", "--out", "study.toml"], ["study", "study.toml", "--out", "short.toml"]]
    {
        let said = bench.swerve(&args);
        check(&said, &["making ", args[3]], &args);
        assert_eq!(said.stderr.lines().count(), 1, "{}", said.stderr);
    }
    assert_eq!(bench.read("short.toml"), SHORT);
}

#[test]
fn endless_file_is_not_read_to_its_end() {
    let bench = Bench::new();
    std::fs::File::create(bench.path("big.toml")).unwrap().set_len((16 << 20) + 1).unwrap();
    for args in [&["run", "big.toml"][..], &["run", "short.toml", "-c", "big.toml"], &["check", "big.toml"]] {
        let said = bench.swerve(args);
        assert!(said.code != Some(0) && said.stderr.contains("larger than 16 MiB"), "{args:?}: {said:?}");
    }
    if cfg!(unix) {
        assert!(bench.shell("swerve run /dev/stdin < /dev/zero").stderr.contains("larger than 16 MiB"));
    }
}

#[test]
fn scenario_requires_a_name() {
    for name in ["../up", "a/b", "", " ", "tab\\t", " edge"] {
        check_all(vec![Case {
            file: scenario("name = \"short\"", &format!("name = \"{name}\"")),
            args: RUN,
            says: &[
                "bad.toml:1: name: expected a name of letters, digits, spaces, underscores and hyphens, found",
            ],
        }]);
    }
}

#[test]
fn control_characters_in_names_are_refused_and_reach_no_terminal() {
    let actor = |name: &str| scenario("name = \"person\"", &format!("name = \"{name}\""));
    for name in ["a\\u001b[2Jb", "a\\u0000b", "a\\nb", "\\u009b31m", "\\u007f"] {
        check_all(vec![Case {
            file: actor(name),
            args: RUN,
            says: &[
                "actor[0].name: expected a text that is not blank, without control characters, found the text \"",
            ],
        }]);
    }
    // Other texts are printed without control characters, wherever they come from.
    let bench = Bench::new();
    for (file, text) in [
        ("c.toml", "[planning]\nplanner = \"a\\u001b[2Jb\"\n"),
        ("s.toml", "base = { scenario = \"no\\u001b[2J.toml\" }\n[[axis]]\nkey = \"seed\"\nvalues = [1]\n"),
    ] {
        bench.write(file, text);
        let said = bench.swerve(&["check", file]);
        let is_shown = |text: &str| text.chars().all(|c| !c.is_control() || c == '\n');
        assert!(said.code == Some(1) && is_shown(&said.stderr) && is_shown(&said.stdout), "{said:?}");
        assert!(said.stderr.contains("\\u{1b}[2J"), "{said:?}");
    }
}
