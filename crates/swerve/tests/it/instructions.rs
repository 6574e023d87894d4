//! Instruction counts of the program: nearly the same on every machine and at any load, unlike times. Counted by
//! valgrind on the test build of the program (its run-time crates are optimised there too) and compared with
//! `tests/reference/instructions.toml`. `SWERVE_COUNTS=write` rewrites that file. Needs valgrind.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use serde::Deserialize;

use crate::support::Bench;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// Ratio to the stored count above which the test fails. Two runs of one program differ by 0.1 %; builds with and
/// without incremental compilation, which partitions crates differently, by up to 17 %.
const MOST: f64 = 1.25;

const HEAD: &str = "# Instructions of calls of the program, in millions, as tests build it. Written by\n\
                    # CARGO_INCREMENTAL=0 SWERVE_COUNTS=write cargo test --workspace --test it -- --ignored instructions\n";

#[derive(Deserialize)]
struct Counts {
    call: Vec<Call>,
}

#[derive(Deserialize)]
struct Call {
    /// Command-line arguments, relative to the root of the repository.
    args: String,
    millions: f64,
}

/// Millions of instructions of one call.
fn count(args: &str) -> f64 {
    let bench = Bench::new();
    let out = bench.path("out").display().to_string();
    let mut command = Command::new("valgrind");
    command.args(["--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"]);
    command.arg(env!("CARGO_BIN_EXE_swerve")).args(args.split(' ')).current_dir(ROOT);
    if args.starts_with("run") || args.starts_with("look") {
        command.args(["--out", &out]);
    }
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{args}: {said}");
    let refs = said.lines().find_map(|line| line.split("refs:").nth(1)).unwrap_or_else(|| panic!("{said}"));
    refs.trim().replace(',', "").parse::<f64>().unwrap() / 1e6
}

/// Counts of several calls, run in parallel.
fn counts<'a>(calls: impl IntoIterator<Item = &'a str>) -> Vec<f64> {
    std::thread::scope(|scope| {
        let counts: Vec<_> = calls.into_iter().map(|args| scope.spawn(move || count(args))).collect();
        counts.into_iter().map(|count| count.join().unwrap()).collect()
    })
}

/// True if valgrind is available. If not, prints a note, or fails in CI.
fn has_valgrind() -> bool {
    let found = Command::new("valgrind").arg("--version").output().is_ok();
    if !found {
        swerve_tests::skipped_without_tool("valgrind is not installed");
    }
    found
}

/// A long road with people who walk beside it, each on a separate path.
fn crowd(people: usize) -> String {
    let mut text =
        "name = \"crowd\"\n[road]\nsegments = [{ length_m = 3000.0 }]\nlane_width_m = 4.0\nleft_m = 30.0\n\
        right_m = 30.0\n[ego]\ntarget_speed_mps = 10.0\nend_m = 2900.0\n[end]\ntimeout_s = 1.0\n"
            .to_owned();
    for k in 0..people {
        let (s_m, d_m) = (60.0 + 2.5 * (k / 10) as f64, 5.0 + 2.0 * (k % 10) as f64);
        let speed_mps = 0.5 + 0.1 * (k % 10) as f64;
        let _infallible = write!(
            text,
            "[[actor]]\nname = \"p{k}\"\nkind = \"pedestrian\"\ns_m = {s_m:.1}\nd_m = {d_m:.1}\n\
             motion = [{{ walk = {{ speed_mps = {speed_mps:.1}, distance_m = 20.0, direction = \"ahead\" }} }}]\n"
        );
    }
    text
}

/// Computes for a minute or more: `.ci/run` runs it beside the tests with the real clock.
mod long {
    use super::*;

    /// Four times as many actors may cost little more than four times as much.
    #[test]
    #[ignore = "a minute of valgrind"]
    fn cost_per_actor_does_not_grow_with_their_number() {
        if !has_valgrind() {
            return;
        }
        let bench = Bench::new();
        let cases = [("check", 500, 4.6), ("run", 100, 5.0)];
        let calls: Vec<String> = cases
            .iter()
            .flat_map(|(command, few, _)| [(command, *few), (command, 4 * few)])
            .map(|(command, people)| {
                let file = format!("crowd{people}.toml");
                bench.write(&file, &crowd(people));
                format!("{command} {}", bench.path(&file).display())
            })
            .collect();
        let counts = counts(calls.iter().map(String::as_str));
        for ((command, few, most), counts) in cases.iter().zip(counts.chunks(2)) {
            let (little, much) = (counts[0], counts[1]);
            println!("{command}: {few} actors {little:.0} M, four times as many {much:.0} M");
            assert!(much < *most * little, "{command}: {:.2} times as much, expected {most}", much / little);
        }
    }

    #[test]
    #[ignore = "a minute of valgrind"]
    fn instruction_counts_do_not_exceed_the_reference() {
        if !has_valgrind() {
            return;
        }
        let file = Path::new(ROOT).join("tests/reference/instructions.toml");
        let stored: Counts = toml::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
        let (mut told, mut moved) = (HEAD.to_owned(), String::new());
        let counts = counts(stored.call.iter().map(|call| call.args.as_str()));
        for (Call { args, millions }, now) in stored.call.iter().zip(counts) {
            let _infallible = write!(told, "\n[[call]]\nargs = {args:?}\nmillions = {now:.0}\n");
            let ratio = now / millions;
            if ratio > MOST {
                let _infallible = writeln!(moved, "{args}: {millions:.0} -> {now:.0} M, {ratio:.3} times");
            }
        }
        if std::env::var_os("SWERVE_COUNTS").is_some_and(|what| what == "write") {
            std::fs::write(file, told).unwrap();
            return;
        }
        assert!(moved.is_empty(), "{moved}If that is meant, SWERVE_COUNTS=write stores the new counts.");
    }
}
