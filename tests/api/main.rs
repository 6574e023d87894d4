//! Public API: the public items of the crates used by external packages, compared with the lists kept beside this file.
//! A change may affect external code, so it must be visible in a review.
//!
//! `.ci/api` compares them, `.ci/api renew` rewrites the lists.

use std::collections::BTreeSet;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// Crates that the pages recommend to build on, and crates with items in their signatures.
const CRATES: [&str; 17] = [
    "swerve",
    "swerve-control",
    "swerve-core",
    "swerve-drive",
    "swerve-flow",
    "swerve-foxglove",
    "swerve-geom",
    "swerve-localization",
    "swerve-log",
    "swerve-map",
    "swerve-msg",
    "swerve-perception",
    "swerve-planning",
    "swerve-prediction",
    "swerve-stack",
    "swerve-text",
    "swerve-vehicle",
];

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> ExitCode {
    match run(std::env::args().nth(1).as_deref()) {
        Ok(changes) if changes.is_empty() => ExitCode::SUCCESS,
        Ok(changes) => {
            eprint!("{changes}");
            eprintln!(
                "Public items are not those of tests/api/*.txt; a line with `-` can break what others have built."
            );
            eprintln!("If that is meant, add it to CHANGELOG.md and renew the lists: .ci/api renew");
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn run(wish: Option<&str>) -> Outcome<String> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    document(here)?;
    let mut changes = String::new();
    for name in CRATES {
        let (file, now) = (here.join(name).with_extension("txt"), items(here, name)?);
        match wish {
            None => changes += &difference(name, &std::fs::read_to_string(&file).unwrap_or_default(), &now),
            Some("renew") => std::fs::write(&file, now)?,
            Some(other) => return Err(format!("expected nothing or `renew`, found `{other}`").into()),
        }
    }
    Ok(changes)
}

/// Runs rustdoc with JSON output for each crate.
fn document(here: &Path) -> Outcome<()> {
    let mut call = Command::new("cargo");
    // Of the whole workspace, as in CI: for a few crates alone cargo would compile dependencies with other features.
    call.args(["doc", "--locked", "--quiet", "--workspace", "--no-deps", "--all-features"]);
    call.env("RUSTDOC", here.join("rustdoc")).env("SWERVE_API_CRATES", CRATES.join(" ").replace('-', "_"));
    call.env("RUSTDOCFLAGS", "-Zunstable-options --output-format=json --cap-lints=allow");
    call.env("CARGO_TARGET_DIR", target(here)).current_dir(here.join("../.."));
    let status = call.status()?;
    if status.success() { Ok(()) } else { Err(format!("cargo doc: {status}").into()) }
}

fn target(here: &Path) -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| here.join("../../target"), PathBuf::from)
}

/// Public items of a crate, one per line, in order. For derived traits only the `impl` is kept.
fn items(here: &Path, name: &str) -> Outcome<String> {
    let json = target(here).join("doc").join(name.replace('-', "_")).with_extension("json");
    let read = |derived_too: bool| {
        public_api::Builder::from_rustdoc_json(&json)
            .omit_blanket_impls(true)
            .omit_auto_trait_impls(true)
            .omit_auto_derived_impls(!derived_too)
            .build()
            .map_err(|error| format!("{}: {error}", json.display()))
    };
    let own: BTreeSet<String> = read(false)?.items().map(ToString::to_string).collect();
    let all = read(true)?;
    let lines = all.items().map(ToString::to_string);
    Ok(lines.filter(|line| own.contains(line) || line.starts_with("impl")).map(|line| line + "\n").collect())
}

/// Lines that are in only one of two lists.
fn difference(name: &str, kept: &str, now: &str) -> String {
    let (kept, now): (BTreeSet<&str>, BTreeSet<&str>) = (kept.lines().collect(), now.lines().collect());
    let gone = kept.difference(&now).map(|line| format!("{name} - {line}\n"));
    gone.chain(now.difference(&kept).map(|line| format!("{name} + {line}\n"))).collect()
}
