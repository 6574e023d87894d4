//! Tests of the catalogue's completeness.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use swerve_core::Time;
use swerve_msg::WheelOdometry;
use toml::{Table, Value};

use super::*;
use crate::convert::{Epoch, SteeringGear, VehicleState, report_to_ros};
use crate::mapping::{Purpose, Side};
use crate::samples::sample;

/// A message with a stamp that its row does not name would always look new.
#[test]
fn catalogue_names_the_stamp_of_every_message_with_one() {
    for &kind in Kind::ALL {
        let message = sample(kind);
        let fields = Table::try_from(&message).expect("messages are tables");
        let header = fields.get("header").and_then(|header| header.get("stamp"));
        let held = header.or_else(|| fields.get("stamp"));
        let said = message.stamp().map(|stamp| Value::try_from(stamp).expect("a stamp is a table"));
        if kind == Kind::Engage {
            assert!(held.is_some() && said.is_none(), "a person's act is new when it comes");
            continue;
        }
        assert_eq!(said.as_ref(), held, "{kind}");
    }
}

#[test]
fn reports_are_built_in_each_of_their_types() {
    let state = VehicleState {
        wheels: WheelOdometry { stamp: Time::from_ms(1500), speed_mps: 7.0, ..WheelOdometry::default() },
        ..VehicleState::default()
    };
    let mut made = 0;
    for role in Role::ALL.iter().filter(|role| role.purpose() == Purpose::Report) {
        for &kind in role.kinds() {
            let report = report_to_ros(kind, &state, &SteeringGear::default(), Epoch::default(), "base_link");
            let report = report.unwrap_or_else(|| panic!("{}: nothing is said in {kind}", role.name()));
            assert_eq!(report.kind(), kind);
            assert_eq!(report.check(), Ok(()), "{kind}");
            made += 1;
        }
    }
    assert!(made > 20, "{made}");
}

/// A topic published by both sides would have no reader.
#[test]
fn roles_are_published_by_the_side_of_their_purpose() {
    for role in Role::ALL {
        let side = match role.purpose() {
            Purpose::Sensor
            | Purpose::Localization
            | Purpose::Report
            | Purpose::Frames
            | Purpose::Perception => Side::Vehicle,
            Purpose::Motion | Purpose::Auxiliary | Purpose::Display => Side::Stack,
            Purpose::Switch => continue,
        };
        assert_eq!(role.side(), side, "{}", role.name());
    }
}

/// Source files of the crates, each with its text up to its tests.
fn sources() -> Vec<(PathBuf, String)> {
    fn read(folder: &Path, found: &mut Vec<(PathBuf, String)>) {
        for entry in std::fs::read_dir(folder).expect("sources are there") {
            let path = entry.expect("sources can be listed").path();
            if path.is_dir() {
                read(&path, found);
            } else if path.extension().is_some_and(|e| e == "rs") && !path.ends_with("tests.rs") {
                let text = std::fs::read_to_string(&path).expect("sources are text");
                let code = text.split("#[cfg(test)]\nmod tests {").next().expect("there is a first part");
                found.push((path, code.to_owned()));
            }
        }
    }
    let mut found = Vec::new();
    for folder in ["src", "../swerve-live/src"] {
        read(&Path::new(env!("CARGO_MANIFEST_DIR")).join(folder), &mut found);
    }
    found
}

/// Returns true if `text` names a message: as a kind, as a variant of `AnyMessage`, or as a Rust type.
fn names(text: &str, variant: &str, kind: Kind) -> bool {
    let word = |text: &str, word: &str| {
        let is_part = |c: char| c.is_alphanumeric() || c == '_';
        text.match_indices(word).any(|(at, _)| {
            let after = text[at + word.len()..].chars().next();
            !text[..at].ends_with(is_part) && !after.is_some_and(is_part)
        })
    };
    let list = format!("{}::{{", kind.package());
    let imported = || {
        let lists = text.split(&list).skip(1);
        lists.filter_map(|list| list.split('}').next()).any(|list| word(list, kind.name()))
    };
    word(text, &format!("Kind::{variant}"))
        || word(text, &format!("AnyMessage::{variant}"))
        || word(text, &format!("{}::{}", kind.package(), kind.name()))
        || imported()
}

/// The fields and checks of a message are in the file of its package, everything else about it in the tables.
/// Any other file that names it must be a use: a conversion, a vehicle's interface, the intake, the simulated car.
#[test]
fn a_message_is_known_in_two_files_beside_what_is_made_of_it() {
    let sources = sources();
    let is_use = |path: &Path| {
        let path = path.to_string_lossy();
        ["/src/convert/", "swerve-live/src/"].iter().any(|part| path.contains(part))
    };
    let mut by_files: BTreeMap<usize, BTreeSet<Kind>> = BTreeMap::new();
    for &kind in Kind::ALL {
        let variant = format!("{kind:?}");
        let package = format!("msg/{}.rs", kind.package());
        let mut uses = 0;
        for (path, text) in &sources {
            let is_part_of_another = path.parent().is_some_and(|folder| folder.ends_with("msg"));
            let tables = ["src/message.rs", "mapping/role.rs", "mapping/tables.rs"];
            let is_table = tables.iter().any(|table| path.ends_with(table));
            if path.ends_with(&package) || is_table || is_part_of_another {
                continue;
            }
            if names(text, &variant, kind) {
                assert!(is_use(path), "{} names {kind}, which is no use of it", path.display());
                uses += 1;
            }
        }
        let own = sources.iter().find(|(path, _)| path.ends_with(&package)).expect("each package has a file");
        assert!(own.1.contains(&format!("pub struct {} {{", kind.name())), "{kind}");
        by_files.entry(2 + uses).or_default().insert(kind);
    }
    // High enough to fail if the search finds nothing.
    let of_three: usize = by_files.range(3..).map(|(_, kinds)| kinds.len()).sum();
    assert!(of_three > 30, "{by_files:?}");
}
