//! What the program costs, in instructions: nearly the same on every machine and at any load, where a time is neither.
//! Counted by valgrind, of the program as tests are built (what runs are made of is optimised there too), and held against
//! `tests/reference/instructions.toml`; `SWERVE_COUNTS=write` writes that file anew. Needs valgrind.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use serde::Deserialize;

use crate::support::Bench;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// How many times the stored count is a slowdown that somebody has to explain. Two runs of one program differ by 0.1 %;
/// builds with and without incremental compilation, which cut crates into other parts, by up to 17 %.
const MOST: f64 = 1.25;

const HEAD: &str = "# Instructions of calls of the program, in millions, as tests build it. Written by\n\
                    # CARGO_INCREMENTAL=0 SWERVE_COUNTS=write cargo test --workspace --test it -- --ignored instructions\n";

#[derive(Deserialize)]
struct Counts {
    call: Vec<Call>,
}

#[derive(Deserialize)]
struct Call {
    /// The program's arguments, from the top folder of the repository.
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

#[test]
#[ignore = "a minute of valgrind"]
fn the_program_takes_no_more_instructions_than_before() {
    if Command::new("valgrind").arg("--version").output().is_err() {
        assert!(std::env::var_os("SWERVE_CI").is_none(), "SWERVE_CI is set, and valgrind is not installed");
        eprintln!("skipped: valgrind is not installed");
        return;
    }
    let file = Path::new(ROOT).join("tests/reference/instructions.toml");
    let stored: Counts = toml::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    let (mut told, mut moved) = (HEAD.to_owned(), String::new());
    for Call { args, millions } in &stored.call {
        let now = count(args);
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
