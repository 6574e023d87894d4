//! Combined table of all benchmarks, the last one of `cargo bench`. `--bench summary -- --page docs/performance.md`
//! writes the rows of the benchmarks that have been run to that page, between the marks with their names; folders named
//! after the page contain rows of other machines.

use std::path::Path;

use swerve_benches::{COMMAND, MACHINE, is_asked_to_measure, print};

/// One benchmark: name, machine, command, and rows of description, text, goal and verdict.
struct Bench {
    name: String,
    machine: String,
    command: String,
    rows: Vec<[String; 4]>,
}

impl Bench {
    fn read(file: &Path) -> Option<Self> {
        let name = file.file_stem()?.to_string_lossy().strip_prefix("swerve-bench-")?.to_owned();
        let text = std::fs::read_to_string(file).ok()?;
        let (mut machine, mut command, mut rows) = (String::new(), String::new(), Vec::new());
        for line in text.lines() {
            if let Some(told) = line.strip_prefix(MACHINE) {
                machine = told.to_owned();
            } else if let Some(told) = line.strip_prefix(COMMAND) {
                command = told.to_owned();
            } else {
                let mut cells = line.split('\t').map(str::to_owned);
                rows.push([(); 4].map(|()| cells.next().unwrap_or_default()));
            }
        }
        Some(Self { name, machine, command, rows })
    }

    /// Text between its marks.
    fn block(&self) -> String {
        let mut text = format!("Rows of `{}` on {}:\n\n", self.command, self.machine);
        text += "| what | measured | goal | |\n|---|---|---|---|\n";
        for row in &self.rows {
            text += &format!("| {} |\n", row.join(" | "));
        }
        text
    }

    /// Replaces its block in a page, or appends it.
    fn write_into(&self, page: &mut String) {
        let [begin, end] = ["rows of", "end of"].map(|mark| format!("<!-- {mark} {} -->\n", self.name));
        let inner = page.find(&begin).map(|at| at + begin.len());
        match inner.and_then(|from| Some(from..from + page[from..].find(&end)?)) {
            Some(old) => page.replace_range(old, &self.block()),
            None => *page += &format!("\n{begin}{}{end}", self.block()),
        }
    }
}

fn main() {
    if !is_asked_to_measure() {
        return;
    }
    let mut arguments = std::env::args().skip_while(|argument| argument != "--page").skip(1);
    let page = arguments.next();
    let folders = std::iter::once(env!("CARGO_TARGET_TMPDIR").to_owned()).chain(arguments);
    let entries = folders.filter_map(|folder| std::fs::read_dir(folder).ok()).flatten();
    let mut files: Vec<_> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.sort();
    let benches: Vec<Bench> = files.iter().filter_map(|file| Bench::read(file)).collect();
    if let Some(page) = page {
        // Cargo runs a benchmark in its package's folder.
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(page);
        let mut page = std::fs::read_to_string(&path).expect("a page that is there");
        benches.iter().for_each(|bench| bench.write_into(&mut page));
        std::fs::write(&path, page).expect("the page is to be written");
    }
    let lines: Vec<[&str; 5]> = benches
        .iter()
        .flat_map(|bench| {
            bench.rows.iter().map(|[what, reads, goal, verdict]| [&bench.name, what, reads, goal, verdict])
        })
        .map(|cells| cells.map(String::as_str))
        .collect();
    let widths: [usize; 5] =
        std::array::from_fn(|column| lines.iter().map(|l| l[column].chars().count()).max().unwrap_or(0));
    print("\n== summary: median [least .. largest] over the rounds of each bench");
    for line in &lines {
        let cells: Vec<String> =
            line.iter().zip(widths).map(|(cell, width)| format!("{cell:<width$}")).collect();
        print(cells.join("  ").trim_end());
    }
    let count = |verdict: &str| lines.iter().filter(|line| line[4] == verdict).count();
    print(&format!("{} goals reached, {} not reached", count("reached"), count("NOT REACHED")));
}
