//! KITTI labels: one text file per frame, one line per box, columns separated by spaces.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, bail, ensure};
use serde::Serialize;
use swerve_eval::{KittiAp, KittiClass, KittiFound, KittiKind, KittiLevel, KittiTruth, kitti_ap};
use swerve_report::output::{align, tell};
use swerve_text::did_you_mean;

use super::input::{number, text, wrong};
use super::{Compared, cell};

/// Number of columns of a label; a detected box has its score after them.
const COLUMNS: usize = 15;

/// Metrics of each class at each level.
#[derive(Serialize)]
pub(super) struct KittiReport(Vec<ClassReport>);

#[derive(Serialize)]
struct ClassReport {
    class: KittiClass,
    level: KittiLevel,
    #[serde(flatten)]
    ap: KittiAp,
}

/// One line of a label file.
struct Label {
    kind: KittiKind,
    /// Values from the second column on.
    numbers: Vec<f64>,
}

pub(super) fn evaluate(compared: &Compared) -> anyhow::Result<KittiReport> {
    let (truth, _) = labels(&compared.truth, Of::Truth)?;
    let (found, others) = labels(&compared.found, Of::Results)?;
    if let Some(note) = note(&compared.found, &others) {
        tell(&note);
    }
    if truth.is_empty() {
        bail!("{}: expected label files (.txt), found none", compared.truth.display());
    }
    let missing = |a: &BTreeMap<String, Vec<Label>>, b: &BTreeMap<String, Vec<Label>>| {
        a.keys().find(|name| !b.contains_key(*name)).cloned()
    };
    for (of, name) in [(&compared.found, missing(&truth, &found)), (&compared.truth, missing(&found, &truth))]
    {
        if let Some(name) = name {
            bail!("{}: expected a file {name}, as the other folder has one; it may be empty", of.display());
        }
    }
    let truth: Vec<Vec<KittiTruth>> =
        truth.into_values().map(|f| f.iter().map(Label::truth).collect()).collect();
    let found: Vec<Vec<KittiFound>> =
        found.into_values().map(|f| f.iter().map(Label::found).collect()).collect();
    let judged = compared.timely.judged(truth.len());
    let frames: Vec<_> = judged
        .into_iter()
        .map(|(t, r)| (truth[t].clone(), r.map_or_else(Vec::new, |r| found[r].clone())))
        .collect();
    let all = KittiClass::ALL.into_iter().flat_map(|class| KittiLevel::ALL.map(|level| (class, level)));
    let report = |(class, level)| ClassReport { class, level, ap: kitti_ap(&frames, class, level) };
    Ok(KittiReport(all.map(report).collect()))
}

/// Side of an evaluation.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Of {
    Truth,
    /// Labels with a score as last column. Types unknown to KITTI are ignored, as in its own evaluation.
    Results,
}

/// Labels by file, and counts of ignored labels by type.
type Labels = (BTreeMap<String, Vec<Label>>, BTreeMap<String, usize>);

fn note(found: &Path, others: &BTreeMap<String, usize>) -> Option<String> {
    let types: Vec<String> = others.iter().map(|(name, count)| format!("`{name}` ({count})")).collect();
    let of = format!("{}: results of types that KITTI does not have are not evaluated", found.display());
    (!types.is_empty()).then(|| format!("{of}: {}", types.join(", ")))
}

/// Labels of a folder, by file name.
fn labels(folder: &Path, of: Of) -> anyhow::Result<Labels> {
    let (mut files, mut others) = (BTreeMap::new(), BTreeMap::new());
    for entry in std::fs::read_dir(folder).with_context(|| format!("reading {}", folder.display()))? {
        let path = entry?.path();
        if path.extension().is_some_and(|e| e == "txt") {
            ensure!(path.is_file(), "{}: expected a regular file", path.display());
            let text = text(&path)?;
            let mut labels = Vec::new();
            for (k, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
                match label(line, of).map_err(|what| wrong(&path, k + 1, what))? {
                    Ok(label) => labels.push(label),
                    Err(other) => *others.entry(other).or_default() += 1,
                }
            }
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
            files.insert(name.unwrap_or_default(), labels);
        }
    }
    Ok((files, others))
}

/// Parses a label; for a type unknown to KITTI, returns the type.
fn label(line: &str, of: Of) -> Result<Result<Label, String>, String> {
    const NAMES: [&str; COLUMNS + 1] = [
        "type",
        "truncated",
        "occluded",
        "alpha",
        "left",
        "top",
        "right",
        "bottom",
        "height",
        "width",
        "length",
        "x",
        "y",
        "z",
        "rotation_y",
        "score",
    ];
    let columns = if of == Of::Results { COLUMNS + 1 } else { COLUMNS };
    let words: Vec<&str> = line.split_whitespace().collect();
    if words.len() < columns {
        return Err(format!(
            "expected {columns} columns ({}), found {}",
            NAMES[..columns].join(" "),
            words.len()
        ));
    }
    let kind = KittiKind::ALL.into_iter().find(|(name, _)| name.eq_ignore_ascii_case(words[0]));
    let Some((_, kind)) = kind else {
        let near = did_you_mean(words[0], KittiKind::ALL.into_iter().map(|(name, _)| name));
        if near.is_empty() && of == Of::Results {
            return Ok(Err(words[0].to_owned()));
        }
        return Err(format!("type: expected one of KITTI's, found `{}`{near}", words[0]));
    };
    let numbers: Vec<f64> = (1..columns).map(|k| number(NAMES[k], words[k])).collect::<Result<_, _>>()?;
    let [left, top, right, bottom] = edges(&numbers);
    if right < left || bottom < top {
        return Err(format!(
            "left top right bottom: expected edges in order, found {left} {top} {right} {bottom}"
        ));
    }
    Ok(Ok(Label { kind, numbers }))
}

fn edges(numbers: &[f64]) -> [f64; 4] {
    core::array::from_fn(|k| numbers[3 + k])
}

impl Label {
    fn truth(&self) -> KittiTruth {
        let (truncation, occlusion) = (self.numbers[0], self.numbers[1]);
        KittiTruth { kind: self.kind, truncation, occlusion, box_px: edges(&self.numbers) }
    }

    fn found(&self) -> KittiFound {
        KittiFound { kind: self.kind, box_px: edges(&self.numbers), score: self.numbers[COLUMNS - 1] }
    }
}

pub(super) fn table(report: &KittiReport) -> anyhow::Result<String> {
    let mut lines = vec![["", "", "R11", "R40"].map(str::to_owned).to_vec()];
    for ClassReport { class, level, ap } in &report.0 {
        let name = |value: serde_json::Value| value.as_str().unwrap_or_default().to_owned();
        let (class, level) = (name(serde_json::to_value(class)?), name(serde_json::to_value(level)?));
        lines.push(vec![class, level, cell(ap.r11), cell(ap.r40)]);
    }
    Ok(align(&lines))
}
