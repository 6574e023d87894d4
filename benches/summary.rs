//! The joined table of all benches: the last one of `cargo bench`.

use swerve_benches::{is_asked_to_measure, print};

fn main() {
    if !is_asked_to_measure() {
        return;
    }
    let mut files: Vec<_> = std::fs::read_dir(env!("CARGO_TARGET_TMPDIR"))
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|e| e == "tsv"))
        .collect();
    files.sort();
    let mut lines: Vec<Vec<String>> = Vec::new();
    for file in &files {
        let name =
            file.file_stem().map(|s| s.to_string_lossy().replace("swerve-bench-", "")).unwrap_or_default();
        for line in std::fs::read_to_string(file).unwrap_or_default().lines() {
            let cells = std::iter::once(name.as_str()).chain(line.split('\t')).map(str::to_owned);
            lines.push(cells.collect());
        }
    }
    let width = |column: usize| {
        lines.iter().filter_map(|l| l.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..5).map(width).collect();
    print("\n== summary: median [least .. largest] over the rounds of each bench");
    for line in &lines {
        let cells: Vec<String> =
            line.iter().zip(&widths).map(|(cell, &width)| format!("{cell:<width$}")).collect();
        print(cells.join("  ").trim_end());
    }
    let missed = lines.iter().filter(|l| l.last().is_some_and(|v| v == "NOT REACHED")).count();
    let held = lines.iter().filter(|l| l.last().is_some_and(|v| v == "reached")).count();
    print(&format!("{held} goals reached, {missed} not reached"));
}
