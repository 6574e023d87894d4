//! Published files of all formats with changed values: they are read and shown, or refused with a place; nothing panics.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use swerve_map::{LaneIndex, LaneKind, Map};
use swerve_tests::data_or_skip;

use crate::commonroad::tests::shared::unpacked;
use crate::commonroad::{self, Centers};
use crate::lane_map::LaneMap;
use crate::overview::Overview;
use crate::picture::lanes::draw;
use crate::testing::below;
use crate::{MapFile, Problems, lanelet2, sumo};

/// Changed files of each format.
const CASES: u64 = 24;
/// Largest size of a file that is changed, bytes.
const BYTES_MAX: usize = 300_000;
/// Most values that are changed in a file.
const CHANGES_MAX: usize = 4;

/// Values in place of those of a file.
const VALUES: [&str; 24] = [
    "",
    " ",
    "0",
    "-0",
    "1",
    "-1",
    "2",
    "7",
    "NaN",
    "inf",
    "1e308",
    "-1e9",
    "1e9",
    "1e-300",
    "999999999",
    "4294967295",
    "-2147483648",
    "0.5",
    "true",
    "false",
    "x",
    "0,0",
    "0,0 1,1 0,0",
    "é\u{1F6A6}",
];

/// Random numbers that are the same in each run (xorshift64*).
struct Random(u64);

impl Random {
    fn below(&mut self, count: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) as usize % count.max(1)
    }
}

/// Ranges of the values of attributes, and of texts between tags.
fn values(text: &str) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    let (mut quote, mut tag_end) = (None, None);
    for (k, byte) in text.bytes().enumerate() {
        match (byte, quote) {
            (b'"', None) => quote = Some(k + 1),
            (b'"', Some(from)) => {
                found.push((from, k));
                quote = None;
            }
            (b'>', None) => tag_end = Some(k + 1),
            (b'<', None) => found.extend(
                tag_end.take().filter(|from| !text[*from..k].trim().is_empty()).map(|from| (from, k)),
            ),
            _ => {}
        }
    }
    found
}

/// The text with some values replaced: by a number that is odd, or by another value of the file.
fn changed(text: &str, random: &mut Random) -> String {
    let values = values(text);
    if values.is_empty() {
        return text.to_owned();
    }
    let mut changes: Vec<(usize, usize, String)> = Vec::new();
    for _ in 0..=random.below(CHANGES_MAX) {
        let (from, to) = values[random.below(values.len())];
        let (other_from, other_to) = values[random.below(values.len())];
        let own = &text[from..to];
        let value = match random.below(4) {
            0 => text[other_from..other_to].to_owned(),
            1 => format!("-{own}"),
            _ => VALUES[random.below(VALUES.len())].to_owned(),
        };
        changes.push((from, to, value));
    }
    changes.sort_by_key(|change| core::cmp::Reverse(change.0));
    changes.dedup_by_key(|change| change.0);
    let mut text = text.to_owned();
    changes.into_iter().for_each(|(from, to, value)| text.replace_range(from..to, &value));
    text
}

/// Files of an ending below a folder, with their texts.
fn texts(folder: &str, ending: &str) -> Option<Vec<String>> {
    let paths = below(&data_or_skip(folder)?, &[ending]);
    let read = |path: &PathBuf| match ending.ends_with(".gz") {
        true => unpacked(path),
        false => std::fs::read_to_string(path).unwrap(),
    };
    Some(paths.iter().map(read).filter(|text| text.len() <= BYTES_MAX).collect())
}

fn check_map(map: &Map) {
    let _index = LaneIndex::new(map);
    for lane in map.lanes() {
        let width_m = lane.width_m(0.5 * lane.line.length());
        assert!(width_m.is_finite() && width_m >= 0.0 && lane.line.length() > 0.0);
    }
    assert!(map.signals().iter().all(|signal| signal.program.as_ref().is_none_or(|one| one.check().is_ok())));
}

fn check_lanes(read: Result<LaneMap, Problems>, bytes: usize) {
    let lanes = match read {
        Ok(lanes) => lanes,
        Err(problems) => {
            return assert!(!problems.is_empty() && problems.iter().all(|problem| problem.line > 0));
        }
    };
    let overview = Overview::of(&lanes.map, bytes);
    let _text = (overview.text("m", &lanes), overview.json("m", &lanes));
    if let Some(extent_m) = overview.extent_m {
        let _picture = draw(&lanes.map, extent_m, "m", None);
    }
    check_map(&lanes.map);
}

/// Changes files in turn, `cases` times in all, and checks each result.
fn check(files: Option<Vec<String>>, check: impl Fn(&str)) {
    let Some(files) = files else { return };
    let failed = (0..CASES).filter(|case| {
        let mut random = Random(0x9E37_79B9_7F4A_7C15 ^ (case + 1));
        let _warm = (random.below(2), random.below(2));
        let text = changed(&files[random.below(files.len())], &mut random);
        catch_unwind(AssertUnwindSafe(|| check(&text))).is_err()
    });
    let failed: Vec<u64> = failed.collect();
    assert!(failed.is_empty(), "cases {failed:?}");
}

#[test]
fn changed_networks_of_sumo_are_read_or_refused() {
    check(texts("worlds", ".net.xml"), |text| {
        check_lanes(sumo::read("m", text).map(|net| net.lanes), text.len())
    });
}

#[test]
fn changed_scenarios_of_commonroad_are_read_or_refused() {
    check(texts("worlds/commonroad", ".xml.gz"), |text| {
        check_lanes(commonroad::read("m", text, Centers::Rounded).map(|roads| roads.lanes), text.len());
    });
}

#[test]
fn changed_lanelet2_maps_are_read_or_refused() {
    let maps = Path::new(env!("CARGO_MANIFEST_DIR")).join("maps");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(maps).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|end| end == "osm"));
    files.sort();
    let texts = files.iter().map(|path| std::fs::read_to_string(path).unwrap()).collect();
    check(Some(texts), |text| check_lanes(lanelet2::read("m", text).map(|read| read.lanes), text.len()));
}

#[test]
fn changed_networks_of_opendrive_are_read_or_refused() {
    check(texts("external", ".xodr"), |text| {
        let Ok(file) = MapFile::read("m.xodr", text) else { return };
        check_map(&file.map);
        let driving = file.map.lanes().iter().filter(|lane| lane.kind == LaneKind::Driving);
        let slopes = file.slopes(driving.map(|lane| (lane.id, [0.0, lane.line.length()])));
        assert!([slopes.grade, slopes.bank].into_iter().flatten().all(|one| one.slope.is_finite()));
    });
}
