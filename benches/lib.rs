//! Common parts of the benchmarks: rows, medians, files of the summary.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// Present instant of the wall clock.
#[expect(clippy::disallowed_methods, reason = "benches measure this host")]
pub fn now() -> Instant {
    Instant::now()
}

/// Sleeps; for senders whose receiver must be asleep.
#[expect(clippy::disallowed_methods, reason = "a sender at a fixed rate is what is measured")]
pub fn sleep_ms(ms: u64) {
    std::thread::sleep(std::time::Duration::from_millis(ms));
}

/// Writes results to standard output.
#[expect(clippy::print_stdout, reason = "results of a bench go there")]
pub fn print(text: &str) {
    println!("{text}");
}

/// Repeated measurements: sorted, never empty.
#[derive(Clone, Debug)]
pub struct Sample(Vec<f64>);

impl Sample {
    /// Creates a sample of at least one figure.
    ///
    /// # Panics
    /// If there is none.
    pub fn new(mut figures: Vec<f64>) -> Self {
        assert!(!figures.is_empty(), "nothing was measured");
        figures.sort_by(f64::total_cmp);
        Self(figures)
    }

    /// Quantile: the figure that this share of the sample does not exceed.
    pub fn at(&self, share: f64) -> f64 {
        self.0[((self.0.len() - 1) as f64 * share).round() as usize]
    }

    /// All figures in ascending order.
    pub fn figures(&self) -> &[f64] {
        &self.0
    }

    /// Median.
    pub fn median(&self) -> f64 {
        self.at(0.5)
    }

    /// Minimum: the result without disturbance by the host.
    pub fn least(&self) -> f64 {
        self.at(0.0)
    }

    /// `median [minimum .. maximum] unit`
    pub fn text(&self, digits: usize, unit: &str) -> String {
        format!("{:.digits$} [{:.digits$} .. {:.digits$}] {unit}", self.median(), self.least(), self.at(1.0))
    }
}

/// Goal of a figure.
#[derive(Clone, Copy, Debug)]
pub enum Goal {
    /// At most this value.
    Most(f64),
    /// At least this value.
    Least(f64),
    /// For comparison only.
    None,
}

/// Rows of one benchmark, printed at once and kept for the summary.
pub struct Rows {
    file: PathBuf,
    lines: String,
}

impl Rows {
    /// Starts the rows of the benchmark `name`; `folder` is Cargo's folder for such files, `CARGO_TARGET_TMPDIR`.
    /// Partial measurements, and those of machines with another number of cores, are kept separately.
    pub fn new(folder: &str, name: &str) -> Self {
        let parts: String = asked().map(|part| format!(" {part}")).collect();
        let parts = if parts.is_empty() { parts } else { format!(" --{parts}") };
        print(&format!("\n== {name}{parts}"));
        let external =
            std::env::var("CARGO_PKG_NAME").is_ok_and(|package| package == "swerve-benches-external");
        let whose =
            if external { "--manifest-path benches/external/Cargo.toml" } else { "-p swerve-benches" };
        let command = format!("cargo bench {whose} --bench {name}{parts}");
        let lines = format!("{MACHINE}{}\n{COMMAND}{command}\n", machine());
        let file = format!("swerve-bench-{name}{parts}{ON}{} cores.tsv", cores());
        Self { file: Path::new(folder).join(file), lines }
    }

    /// Adds a row: description, figure to compare with the goal, text of the figure, and goal.
    pub fn row(&mut self, what: &str, figure: f64, reads: &str, goal: Goal) {
        let (goal, verdict) = match goal {
            Goal::Most(most) => {
                (format!("<= {most}"), if figure <= most { "reached" } else { "NOT REACHED" })
            }
            Goal::Least(least) => {
                (format!(">= {least}"), if figure >= least { "reached" } else { "NOT REACHED" })
            }
            Goal::None => ("-".to_owned(), ""),
        };
        print(&format!("{what:<66} {reads:<40} {goal:<10} {verdict}"));
        let _infallible = writeln!(self.lines, "{what}\t{reads}\t{goal}\t{verdict}");
    }

    /// Adds a row for a skipped measurement.
    pub fn skipped(&mut self, what: &str, why: &str) {
        self.row(what, 0.0, &format!("skipped: {why}"), Goal::None);
    }

    /// Writes the rows for the summary.
    pub fn finish(self) {
        if let Err(error) = std::fs::write(&self.file, self.lines) {
            print(&format!("{}: {error}", self.file.display()));
        }
    }
}

/// Separator between benchmark name and number of cores in the file names of the summary.
const ON: &str = " on ";

/// Start of the line with the machine in a summary file.
pub const MACHINE: &str = "# ";

/// Start of the line with the command.
pub const COMMAND: &str = "$ ";

/// Processor, cores, and load of the last minute.
fn machine() -> String {
    let read = |file: &str| std::fs::read_to_string(file).unwrap_or_default();
    let cpu = read("/proc/cpuinfo");
    let of = |key: &str| {
        let line = cpu.lines().find(|line| line.starts_with(key));
        line.and_then(|line| line.split(": ").nth(1)).unwrap_or("unknown").to_owned()
    };
    let cores = cores();
    let load = read("/proc/loadavg");
    let load = load.split(' ').next().unwrap_or("unknown");
    format!(
        "{} (family {}, model {}), {cores} cores, load {load}",
        of("model name"),
        of("cpu family"),
        of("model\t")
    )
}

/// True if the program was called to measure (`cargo bench`), not to be tried out (`cargo test --benches`).
pub fn is_asked_to_measure() -> bool {
    std::env::args().any(|argument| argument == "--bench")
}

/// Parts named on the command line after `--`.
fn asked() -> impl Iterator<Item = String> {
    std::env::args().skip(1).filter(|argument| !argument.starts_with("--"))
}

/// True if this part is to be measured: it is named, or no part is.
pub fn is_asked(part: &str) -> bool {
    asked().next().is_none() || asked().any(|name| name == part)
}

/// First number after `--`, or `usual`.
pub fn asked_number(usual: u64) -> u64 {
    asked().find_map(|word| word.parse().ok()).unwrap_or(usual)
}

/// Number of processors of this machine.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Resident memory of this process; zero if the system does not report it.
pub fn resident_kib() -> u64 {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    4 * text.split_whitespace().nth(1).and_then(|pages| pages.parse::<u64>().ok()).unwrap_or(0)
}

/// Processor time of the threads of this process so far, milliseconds, if the system reports it.
pub fn busy_ms() -> Option<f64> {
    let threads = std::fs::read_dir("/proc/self/task").ok()?;
    threads
        .map(|thread| {
            let text = std::fs::read_to_string(thread.ok()?.path().join("schedstat")).ok()?;
            Some(text.split(' ').next()?.parse::<f64>().ok()? * 1e-6)
        })
        .sum()
}

/// Output of a script of `tests/reference`, run by the Python of `SWERVE_PYTHON`; empty if it cannot be run.
pub fn python(script: &str, arguments: &[&Path]) -> String {
    let script = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/reference")).join(script);
    let python = std::env::var("SWERVE_PYTHON").unwrap_or_else(|_| "python3".into());
    let output = Command::new(python).arg(script).args(arguments).output();
    output.map_or_else(|_| String::new(), |output| String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Parses lines of a name and a figure.
pub fn named(lines: &str) -> BTreeMap<String, f64> {
    let row = |line: &str| line.split_once(' ').and_then(|(name, x)| Some((name.into(), x.parse().ok()?)));
    lines.lines().filter_map(row).collect()
}
