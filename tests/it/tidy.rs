//! Project rules: dependencies of crates, licences, and length of pages.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// Cargo metadata of the workspace and all its dependencies.
pub(crate) fn metadata() -> Value {
    // For this host only: needs only the packages fetched to build this test, and no network.
    let host = Command::new("rustc").arg("-vV").output().expect("rustc runs: it compiled this test");
    let host = String::from_utf8(host.stdout).unwrap();
    let host = host.lines().find_map(|line| line.strip_prefix("host: ")).unwrap();
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version=1", "--locked", "--offline", "--filter-platform", host])
        .current_dir(root())
        .output()
        .expect("cargo runs: it built this test");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("cargo metadata is JSON")
}

/// Crate table of ARCHITECTURE.md: crate -> crates of the workspace that it may use ("all" for every one).
fn allowed() -> BTreeMap<String, BTreeSet<String>> {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    text.lines()
        .filter(|line| line.starts_with("| `swerve"))
        .map(|line| {
            let cells: Vec<&str> = line.split('|').map(str::trim).collect();
            let name = cells[1].trim_matches('`').to_owned();
            let uses = cells[3].split_whitespace().filter(|w| *w != "-").map(|w| match w {
                "all" => "all".to_owned(),
                short => format!("swerve-{short}"),
            });
            (name, uses.collect())
        })
        .collect()
}

#[test]
fn crates_use_only_what_the_architecture_lists() {
    let (allowed, metadata) = (allowed(), metadata());
    let packages = metadata["packages"].as_array().unwrap();
    let mut seen = 0;
    for package in packages.iter().filter(|p| p["source"].is_null()) {
        let name = package["name"].as_str().unwrap();
        if matches!(name, "swerve-tests" | "swerve-benches") {
            continue;
        }
        let uses = allowed.get(name).unwrap_or_else(|| panic!("ARCHITECTURE.md does not list {name}"));
        for dependency in package["dependencies"].as_array().unwrap() {
            let on = dependency["name"].as_str().unwrap();
            let real = dependency["kind"].is_null();
            if real && on.starts_with("swerve") {
                assert!(
                    uses.contains("all") || uses.contains(on),
                    "{name} uses {on}, which the table of ARCHITECTURE.md does not list"
                );
            }
        }
        seen += 1;
    }
    assert!(seen >= 13, "only {seen} crates found");
}

/// Heavy packages, and functions confined to one place, with the crates that may name them.
#[test]
fn packages_stay_behind_one_crate() {
    let owners = [
        ("rapier3d", "swerve-sim"),
        ("parry2d-f64", "swerve-eval"),
        ("clarabel", "swerve-control"),
        ("foxglove", "swerve-foxglove"),
        ("jpeg-encoder", "swerve-foxglove"),
        ("iceoryx2", "swerve-ipc"),
        ("mcap", "swerve-log"),
        ("pulp", "swerve-geom"),
        ("wgpu", "swerve-gpu"),
        ("ros2-client", "swerve-ros2"),
        ("strsim", "swerve-text"),
        ("cdr-encoding", "swerve-ros2"),
        (
            "clap",
            "swerve swerve-drive swerve-learn swerve-live swerve-measure swerve-reference swerve-stack swerve-study \
             swerve-timing swerve-view swerve-why",
        ),
        (
            "anyhow",
            "swerve swerve-drive swerve-learn swerve-live swerve-measure swerve-reference swerve-report swerve-stack \
             swerve-study swerve-timing swerve-view swerve-why",
        ),
    ];
    for package in metadata()["packages"].as_array().unwrap().iter().filter(|p| p["source"].is_null()) {
        let name = package["name"].as_str().unwrap();
        for dependency in package["dependencies"].as_array().unwrap().iter().filter(|d| d["kind"].is_null()) {
            let on = dependency["name"].as_str().unwrap();
            if let Some((_, owners)) = owners.iter().find(|(heavy, _)| *heavy == on) {
                assert!(owners.split(' ').any(|owner| owner == name), "{name} uses {on}: only {owners} may");
            }
        }
    }
}

#[test]
fn every_licence_is_permissive() {
    const ALLOWED: [&str; 13] = [
        "MIT",
        "Apache-2.0",
        "BSD-2-Clause",
        "BSD-3-Clause",
        "ISC",
        "Zlib",
        "0BSD",
        "CC0-1.0",
        "Unlicense",
        "Unicode-3.0",
        "IJG",
        "BSL-1.0",
        "Apache-2.0 WITH LLVM-exception",
    ];
    for package in metadata()["packages"].as_array().unwrap() {
        let licence = package["license"].as_str().unwrap_or("none");
        // `A OR B` is a choice, `A AND B` is not; `/` is the old notation of OR.
        let normal = licence.replace(['(', ')'], "").replace('/', " OR ");
        let permissive =
            normal.split(" AND ").all(|part| part.split(" OR ").any(|one| ALLOWED.contains(&one.trim())));
        assert!(permissive, "{} {} is under `{licence}`", package["name"], package["version"]);
    }
}

/// Downloads have checksums from one source: no git revision, no other registry.
#[test]
fn every_package_is_from_the_one_registry() {
    for package in metadata()["packages"].as_array().unwrap() {
        let source = package["source"].as_str().unwrap_or("ours");
        let known = ["ours", "registry+https://github.com/rust-lang/crates.io-index"];
        assert!(known.contains(&source), "{} {} is from {source}", package["name"], package["version"]);
    }
}

/// A test binary links all dependencies of its crate, and one that links everything costs half a minute: a new subject
/// is a module of an existing binary, and a new crate has its tests beside its code.
#[test]
fn test_binaries_are_few() {
    let expected = [
        ("swerve", "it"),
        ("swerve-ipc", "places"), // a separate `main`: it is also the other process
        ("swerve-pylot", "posed_paths_driven"),
        ("swerve-ros2", "it"),
        ("swerve-tests", "it"),
    ];
    let metadata = metadata();
    let mut found = Vec::new();
    for package in metadata["packages"].as_array().unwrap().iter().filter(|p| p["source"].is_null()) {
        for target in package["targets"].as_array().unwrap() {
            let (kind, runs) = (target["kind"][0].as_str().unwrap(), target["test"] == true);
            let name = package["name"].as_str().unwrap();
            match kind {
                "test" => found.push((name, target["name"].as_str().unwrap())),
                "bin" | "bench" => {
                    assert!(!runs, "{name}: a {kind} is linked once more for tests it has none of")
                }
                _ => {}
            }
        }
    }
    found.sort_unstable();
    assert_eq!(found, expected);
}

fn source_files(folder: &Path) -> Vec<(PathBuf, usize)> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.ends_with("target") {
            files.extend(source_files(&path));
        } else if path.extension().is_some_and(|e| e == "rs" || e == "wgsl") {
            let lines = std::fs::read_to_string(&path).unwrap().lines().count();
            files.push((path, lines));
        }
    }
    files
}

#[test]
fn files_are_short_and_the_command_line_stays_thin() {
    let folders = ["crates", "tests", "benches", "examples", "python"];
    let files: Vec<_> = folders.iter().flat_map(|folder| source_files(&root().join(folder))).collect();
    assert!(files.len() > 500, "{}", files.len());
    for (path, lines) in &files {
        within(&path.display().to_string(), *lines, 500);
    }
    // A module with parts is `name.rs` beside `name/`, so that files are distinguishable in an editor.
    let is_mod =
        |path: &Path| path.ends_with("mod.rs") && path.components().any(|part| part.as_os_str() == "src");
    assert!(!files.iter().any(|(path, _)| path.starts_with(root().join("crates")) && is_mod(path)));
    let command_line = source_files(&root().join("crates/swerve/src"));
    let lines: usize = command_line.iter().map(|(_, lines)| lines).sum();
    within("crate swerve", lines, 3000);
}

/// Warns above a limit of lines; fails 10 % above it.
fn within(what: &str, lines: usize, limit: usize) {
    if lines > limit {
        eprintln!("warning: {what} has {lines} lines, more than {limit}: split it by subject");
    }
    assert!(10 * lines <= 11 * limit, "{what} has {lines} lines, 10 % more than {limit}");
}

/// A package optimised in test builds takes several times as long to compile: each has its measured reason in
/// docs/performance.md.
#[test]
fn few_packages_are_optimised_for_tests() {
    let manifest = std::fs::read_to_string(root().join("Cargo.toml")).unwrap();
    let manifest: toml::Table = manifest.parse().unwrap();
    let profiles = manifest["profile"].as_table().unwrap();
    let metadata = metadata();
    let packages = metadata["packages"].as_array().unwrap();
    for (profile, settings) in profiles {
        let overrides = settings.get("package").and_then(toml::Value::as_table).into_iter().flatten();
        let named: Vec<&String> = overrides.filter(|(_, set)| optimised(set)).map(|(name, _)| name).collect();
        for name in named.iter().filter(|name| **name != "*") {
            assert!(packages.iter().any(|p| p["name"] == name.as_str()), "{profile}: no package {name}");
        }
        assert!(named.len() <= OPTIMISED_MAX, "{profile}: {} packages have an opt-level", named.len());
    }
}

/// CI builds the Python package in the same target folder: with the same profile it builds fewer packages again.
#[test]
fn python_package_has_the_test_profile_of_the_workspace() {
    let profile = |file: &str| {
        let manifest: toml::Table = std::fs::read_to_string(root().join(file)).unwrap().parse().unwrap();
        manifest["profile"]["dev"].clone()
    };
    assert_eq!(profile("python/Cargo.toml"), profile("Cargo.toml"));
}

/// True if a package's settings enable optimisation.
fn optimised(settings: &toml::Value) -> bool {
    settings.get("opt-level").is_some_and(|level| level.as_integer() != Some(0))
}

/// Maximum number of packages with a separate opt-level in one profile.
const OPTIMISED_MAX: usize = 30;

#[test]
fn pages_keep_their_length() {
    for (page, lines_max) in [("README.md", 120), ("ARCHITECTURE.md", 250)] {
        let lines = std::fs::read_to_string(root().join(page)).unwrap().lines().count();
        within(page, lines, lines_max);
    }
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let words = readme.split_whitespace().count();
    assert!(words <= 1200, "README.md has {words} words, more than 1200");
}

/// Number of files touched by a new operator, four, and by a new sensor, five: for existing ones, the sources that know
/// the operator or its message by name. The text that places it in the built-in pipeline does not count: a custom
/// operator is placed by its configuration.
#[test]
fn few_files_know_an_operator_and_its_message() {
    let cases: [(&str, &[&str], &[&str]); 2] = [
        (
            "an operator with keys, three streams and a message",
            &["DeadlinePolicy", "deadline_policy", "ResponseBudget"],
            &[
                "swerve-msg/src/deadline.rs",
                "swerve-msg/src/lib.rs",
                "swerve-stack/src/operators.rs",
                "swerve-stack/src/operators/deadlines.rs",
                // Reads the message to summarize it after a run.
                "swerve-drive/src/rungs.rs",
            ],
        ),
        (
            "a sensor with a message and what it measures",
            &["RedLights", "RedLightSensor", "RedLightEvents", "red_light_sensor"],
            &[
                "swerve-msg/src/event.rs",
                "swerve-msg/src/lib.rs",
                "swerve-sim/src/sense/events.rs",
                "swerve-stack/src/operators.rs",
                "swerve-stack/src/operators/events.rs",
            ],
        ),
    ];
    let sources = sources();
    for (what, names, expected) in cases {
        let is_word = |word: &str| names.contains(&word);
        let knows = |text: &str| text.split(|c: char| !c.is_alphanumeric() && c != '_').any(is_word);
        let known: BTreeSet<&str> =
            sources.iter().filter(|(_, text)| knows(text)).map(|(path, _)| path.as_str()).collect();
        let expected: BTreeSet<&str> = expected.iter().copied().collect();
        assert_eq!(known, expected, "{what} is known elsewhere");
    }
}

/// Modules of `swerve-stack` import modules of their layer and of those below, as ARCHITECTURE.md lists them.
#[test]
fn layers_of_the_stack_hold() {
    let page = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let lines =
        page.lines().skip_while(|line| !line.starts_with("settings: ")).take_while(|line| *line != "```");
    let layers: Vec<Vec<&str>> = lines.map(|line| line.split(' ').skip(1).collect()).collect();
    let layer = |module: &str| layers.iter().position(|modules| modules.contains(&module));
    let mut wrong = Vec::new();
    for (path, text) in sources() {
        let Some(file) = path.strip_prefix("swerve-stack/src/").filter(|file| *file != "lib.rs") else {
            continue;
        };
        let module = file.split(['/', '.']).next().unwrap();
        let own = layer(module).unwrap_or_else(|| panic!("ARCHITECTURE.md: no layer has `{module}`"));
        let code = text.split("\n#[cfg(test)]\n").next().unwrap().lines();
        let code = code.filter(|line| !line.trim_start().starts_with("//"));
        let used = code.flat_map(|line| line.split("crate::").skip(1));
        let used = used.map(|rest| rest.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap());
        let above = used.filter(|used| layer(used).is_none_or(|layer| layer > own));
        wrong.extend(above.map(|used| format!("{file} uses `{used}`")));
    }
    assert!(layers.len() == 5 && wrong.is_empty(), "{} layers: {wrong:#?}", layers.len());
}

/// A named pipe or a device in place of a file could block: files are opened by `swerve_text::open_file`.
#[test]
fn files_are_opened_in_one_place() {
    // Files of the system and of the program itself, whose names do not come from outside.
    const OTHERS: [&str; 11] = [
        "swerve-text/src/file.rs",
        "swerve-flow/src/host.rs",
        "swerve-gpu/src/drivers.rs",
        "swerve-ipc/src/error.rs",
        "swerve-ipc/src/folder.rs",
        "swerve-ipc/src/leftovers.rs",
        "swerve-report/src/files.rs",
        "swerve-ros2/src/bridge.rs",
        // Parts of tests.
        // Locks a folder.
        "swerve-study/src/folder.rs",
        "swerve-vision/src/samples.rs",
        "swerve-vision/src/video.rs",
    ];
    let opens = ["File::open(", "fs::read(", "fs::read_to_string("];
    let mut found = Vec::new();
    for (name, text) in sources().into_iter().filter(|(name, _)| !OTHERS.contains(&name.as_str())) {
        // Tests at the end of the file.
        let code = text.rsplit_once("\nmod tests {").map_or(&*text, |(code, _)| code);
        found.extend(opens.iter().filter(|call| code.contains(**call)).map(|call| format!("{name}: {call}")));
    }
    assert!(found.is_empty(), "expected `swerve_text::open_file`, `read_bytes` or `read_string`: {found:?}");
}

/// The root contains only intended files: no results of runs.
#[test]
fn root_holds_no_results() {
    let listed = Command::new("git").args(["ls-files"]).current_dir(root()).output();
    let Ok(listed) = listed.map(|listed| String::from_utf8(listed.stdout).unwrap()) else { return };
    let strays: Vec<&str> = listed
        .lines()
        .filter(|file| !file.contains('/'))
        .filter(|file| {
            ![".md", ".toml", "Cargo.lock", "CITATION.cff"].iter().any(|ending| file.ends_with(ending))
        })
        .filter(|file| !file.starts_with("LICENSE-") && !file.starts_with('.'))
        .collect();
    assert!(strays.is_empty(), "{strays:?}");
}

/// No file has the marks of a merge that was not finished.
#[test]
fn merges_are_finished() {
    let listed = Command::new("git").args(["grep", "-lE", "^(<{7}|>{7}) "]).current_dir(root()).output();
    let found = listed.map_or_else(|_| Vec::new(), |listed| listed.stdout);
    assert!(found.is_empty(), "{}", String::from_utf8_lossy(&found));
}

/// Sources of all crates without their tests: path relative to `crates/`, text.
fn sources() -> Vec<(String, String)> {
    let crates = root().join("crates");
    let files = source_files(&crates).into_iter().map(|(path, _)| path);
    let text = |path: PathBuf| {
        let name = path.strip_prefix(&crates).ok()?.to_str()?.to_owned();
        let mut parts = name.split('/').skip(1);
        let is_source = parts.next() == Some("src") && !parts.any(|part| part.starts_with("tests"));
        is_source.then(|| (name, std::fs::read_to_string(&path).unwrap()))
    };
    let sources: Vec<_> = files.filter_map(text).collect();
    assert!(sources.len() > 200, "only {} sources found", sources.len());
    sources
}
