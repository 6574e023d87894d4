//! Third-party code: the rules of `deny.toml`, the bill of materials, the oldest supported compiler.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::{Value, json};

use crate::common::root;
use crate::tidy::metadata;

/// All folders with a separate lock file.
const WORKSPACES: [&str; 6] = [".", "fuzz", "examples/own_stack", "python", "benches/external", "tests/api"];

fn table(file: &str) -> toml::Table {
    let text = std::fs::read_to_string(root().join(file)).unwrap_or_else(|error| panic!("{file}: {error}"));
    text.parse().unwrap_or_else(|error| panic!("{file}: {error}"))
}

fn said(output: &Output) -> String {
    [&output.stdout[..], &output.stderr].map(String::from_utf8_lossy).concat()
}

/// The oldest supported compiler is the one used in CI: an older one was never tried.
#[test]
fn minimum_supported_compiler_is_the_one_used() {
    let promised = table("Cargo.toml")["workspace"]["package"]["rust-version"].as_str().unwrap().to_owned();
    let used = table("rust-toolchain.toml")["toolchain"]["channel"].as_str().unwrap().to_owned();
    assert!(
        used == promised || used.strip_suffix(".0") == Some(&promised),
        "promised {promised}, used {used}"
    );
    for folder in &WORKSPACES[1..] {
        let own = table(&format!("{folder}/Cargo.toml"));
        assert_eq!(own["package"]["rust-version"].as_str(), Some(promised.as_str()), "{folder}");
    }
}

/// A dependency that requires a newer compiler would make the supported version meaningless.
#[test]
fn dependencies_require_no_newer_compiler() {
    let number = |version: &str| -> Vec<u64> {
        let parts = version.split('-').next().unwrap_or_default().split('.');
        parts.map(|part| part.parse().unwrap_or_else(|_| panic!("{version} is no version"))).collect()
    };
    let promised = table("Cargo.toml")["workspace"]["package"]["rust-version"].as_str().unwrap().to_owned();
    let (mut ours, mut asked) = (0, 0);
    for package in metadata()["packages"].as_array().unwrap() {
        let (name, asks) = (package["name"].as_str().unwrap(), package["rust_version"].as_str());
        if package["source"].is_null() {
            ours += 1;
            assert_eq!(asks, Some(promised.as_str()), "{name} promises another compiler");
            let manifest = std::fs::read_to_string(package["manifest_path"].as_str().unwrap()).unwrap();
            let manifest: toml::Table = manifest.parse().unwrap();
            let inherited = manifest["package"]["rust-version"].get("workspace");
            assert_eq!(inherited.and_then(toml::Value::as_bool), Some(true), "{name}: not the workspace's");
        } else if let Some(asks) = asks {
            asked += 1;
            assert!(number(asks) <= number(&promised), "{name} {} asks for {asks}", package["version"]);
        }
    }
    assert!(ours >= 37 && asked > 200, "{ours} packages of ours, {asked} that say what they ask for");
}

/// cargo-deny as installed by `.ci/deny install`.
fn cargo_deny() -> Option<PathBuf> {
    let program = root().join("target/tools/bin/cargo-deny");
    if !program.exists() {
        swerve_tests::skipped_without_tool("run .ci/deny install first");
        return None;
    }
    Some(program)
}

fn package<'a>(metadata: &'a mut Value, name: &str) -> &'a mut Value {
    let mut packages = metadata["packages"].as_array_mut().unwrap().iter_mut();
    packages.find(|package| package["name"] == name).unwrap_or_else(|| panic!("no package {name}"))
}

/// The rules refuse violations: one package property is changed at a time.
#[test]
fn rule_violations_are_refused() {
    let Some(program) = cargo_deny() else { return };
    type Change = fn(&mut Value);
    let cases: [(&str, &str, Option<&str>, Change); 6] = [
        ("nothing is changed", "licenses", None, |_| {}),
        ("a licence that asks for one's own source", "licenses", Some("rejected"), |metadata| {
            package(metadata, "rayon")["license"] = json!("GPL-3.0-only");
        }),
        ("no licence", "licenses", Some("unlicensed"), |metadata| {
            package(metadata, "swerve-core")["license"] = Value::Null;
        }),
        ("any version will do", "bans", Some("wildcard"), |metadata| {
            let all = package(metadata, "swerve-geom")["dependencies"].as_array_mut().unwrap();
            all.iter_mut().find(|d| !d["source"].is_null()).unwrap()["req"] = json!("*");
        }),
        ("a revision of a repository", "sources", Some("source-not-allowed"), |metadata| {
            package(metadata, "rayon")["source"] =
                json!("git+https://example.com/rayon#0123456789012345678901234567890123456789");
        }),
        ("another registry", "sources", Some("source-not-allowed"), |metadata| {
            package(metadata, "rayon")["source"] = json!("registry+https://example.com/index");
        }),
    ];
    let folder = tempfile::tempdir().unwrap();
    for (what, check, refused, change) in cases {
        let mut metadata = metadata();
        change(&mut metadata);
        let file = folder.path().join("metadata.json");
        std::fs::write(&file, metadata.to_string()).unwrap();
        let mut call = Command::new(&program);
        call.args(["--locked", "--offline", "--log-level=error", "--config=deny.toml", "--metadata-path"]);
        let output = call.arg(&file).args(["check", check]).current_dir(root()).output().unwrap();
        let told = said(&output);
        assert_eq!(output.status.success(), refused.is_none(), "{what}: {told}");
        assert!(refused.is_none_or(|lint| told.contains(&format!("error[{lint}]"))), "{what}: {told}");
    }
}

/// CI checks every lock file against the rules; a new one must be added to the list.
#[test]
fn every_lock_file_is_checked() {
    let script = std::fs::read_to_string(root().join(".ci/deny")).unwrap();
    let list = script.lines().find_map(|line| line.strip_prefix("for folder in ")).unwrap();
    let list: BTreeSet<&str> = list.strip_suffix("; do").unwrap().split(' ').collect();
    assert_eq!(list, BTreeSet::from(WORKSPACES));
    let output = Command::new("git").args(["ls-files", "*Cargo.lock"]).current_dir(root()).output();
    let Some(output) = output.ok().filter(|output| output.status.success()) else { return };
    let there: BTreeSet<String> = String::from_utf8(output.stdout).unwrap().lines().map(folder_of).collect();
    assert_eq!(there, WORKSPACES.map(str::to_owned).into());
    assert!(std::fs::read_to_string(root().join(".ci/run")).unwrap().contains(".ci/deny"));
}

fn folder_of(file: &str) -> String {
    let folder = Path::new(file).parent().unwrap();
    if folder.as_os_str().is_empty() { ".".to_owned() } else { folder.display().to_string() }
}

/// Runs `.ci/sbom`; `None` without Python.
fn bill(into: &Path) -> Option<String> {
    let python = Command::new("python3").args(["-c", "import tomllib"]).output();
    if !python.is_ok_and(|output| output.status.success()) {
        swerve_tests::skipped_without_tool("needs python3 of version 3.11 or later");
        return None;
    }
    let mut call = Command::new("python3");
    call.arg(root().join(".ci/sbom")).arg(into).env("CARGO_NET_OFFLINE", "true");
    let output = call.output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    Some(std::fs::read_to_string(into).unwrap())
}

/// Name and version of the packages that cargo would build for the program with these features, as listed by
/// `cargo tree`.
fn built(features: &str) -> BTreeSet<(String, String)> {
    let mut call = Command::new(env!("CARGO"));
    call.args([
        "tree",
        "--locked",
        "--offline",
        "--package=swerve",
        "--features",
        features,
        "--edges=normal,build",
    ]);
    let output = call.args(["--prefix=none", "--no-dedupe"]).current_dir(root()).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    let listed = String::from_utf8(output.stdout).unwrap();
    let words = |line: &str| {
        let mut words = line.split(' ');
        Some((words.next()?.to_owned(), words.next()?.strip_prefix('v')?.to_owned()))
    };
    listed.lines().filter_map(words).collect()
}

fn text<'a>(value: &'a Value, key: &str) -> &'a str {
    value[key].as_str().unwrap_or_else(|| panic!("no {key} in {value}"))
}

/// Optional features keep their dependencies out of the first command of the README.
#[test]
fn first_command_builds_no_dependency_of_a_feature() {
    let names =
        |features: &str| built(features).into_iter().map(|(name, _)| name).collect::<BTreeSet<String>>();
    let (first, full) = (names(""), names("full"));
    for heavy in ["iceoryx2", "rustdds", "tokio", "wgpu", "zstd-sys"] {
        assert!(full.contains(heavy) && !first.contains(heavy), "{heavy}");
    }
}

#[test]
fn bill_of_materials_matches_the_lock_file() {
    let folder = tempfile::tempdir().unwrap();
    let Some(first) = bill(&folder.path().join("a.json")) else { return };
    assert!(bill(&folder.path().join("b.json")).is_some_and(|second| second == first), "not repeatable");
    let bill: Value = serde_json::from_str(&first).unwrap();
    let lock = table("Cargo.lock");
    let of = |package: &toml::Value, key: &str| {
        package.get(key).and_then(toml::Value::as_str).unwrap_or_default().to_owned()
    };
    let locked: BTreeMap<(String, String), String> = lock["package"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| ((of(p, "name"), of(p, "version")), of(p, "checksum")))
        .collect();

    let root = &bill["metadata"]["component"];
    let mut listed = BTreeSet::from([(text(root, "name").to_owned(), text(root, "version").to_owned())]);
    let mut refs = BTreeSet::from([text(root, "bom-ref")]);
    for component in bill["components"].as_array().unwrap() {
        let name = (text(component, "name").to_owned(), text(component, "version").to_owned());
        let sum = component["hashes"][0]["content"].as_str().unwrap_or_default();
        assert_eq!(locked.get(&name).map(String::as_str), Some(sum), "{name:?}");
        assert!(!text(&component["licenses"][0], "expression").contains('/'), "{name:?}");
        assert!(text(component, "purl").starts_with(&format!("pkg:cargo/{}@{}", name.0, name.1)));
        assert!(listed.insert(name) && refs.insert(text(component, "bom-ref")), "twice: {component}");
    }
    assert_eq!(listed, built("full"));

    // The graph has every component once, each reachable from the program.
    let edges: BTreeMap<&str, Vec<&str>> = bill["dependencies"]
        .as_array()
        .unwrap()
        .iter()
        .map(|node| {
            (
                text(node, "ref"),
                node["dependsOn"].as_array().unwrap().iter().filter_map(Value::as_str).collect(),
            )
        })
        .collect();
    let (mut reached, mut next) = (BTreeSet::new(), vec![text(root, "bom-ref")]);
    while let Some(one) = next.pop() {
        if reached.insert(one) {
            next.extend(&edges[one]);
        }
    }
    assert_eq!(reached, refs);
    is_valid(&folder.path().join("a.json"));
}

/// Validates a bill against CycloneDX's schema, if `tests/readers/install` has installed it.
fn is_valid(bill: &Path) {
    const CHECK: &str = "import sys; from cyclonedx.schema import SchemaVersion; \
         from cyclonedx.validation.json import JsonStrictValidator as Validator; \
         wrong = Validator(SchemaVersion.V1_5).validate_str(open(sys.argv[1]).read()); \
         sys.exit(str(wrong) if wrong else 0)";
    let python = root().join("target/readers/python/bin/python");
    let there = Command::new(&python).args(["-c", "import cyclonedx, jsonschema"]).output();
    if !there.is_ok_and(|output| output.status.success()) {
        swerve_tests::skipped_without_tool("run tests/readers/install first");
        return;
    }
    let output = Command::new(python).args(["-c", CHECK]).arg(bill).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
}
