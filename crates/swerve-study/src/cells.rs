//! Runs the cells of a study: in parallel, resumable, each result kept the moment it is there.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use anyhow::Context as _;
use serde::{Deserialize, Serialize};
use swerve_core::{Digest, Hasher};
use swerve_drive::Outcome;
use swerve_report::files::{CELLS, refuse_irregular};
use swerve_report::progress::Progress;
use swerve_scenario::Expectation;
use swerve_text::{FILE_MAX, read_string};

use super::grid::{Cell, Study};
use super::table;
use super::timely::Reading;

/// Names in `metrics.json` and `cells.csv` of whether a drive was as its scenario expects, and of what was not.
const AS_EXPECTED: &str = "as_expected";
const NOT_AS_EXPECTED: &str = "not_as_expected";

/// What one cell came to.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct CellResult {
    /// What stands in the table, one an axis.
    pub labels: Vec<String>,
    /// How the run ended.
    pub verdict: String,
    /// Whether nothing was hit.
    #[serde(default)]
    pub no_collision: bool,
    /// Whether no part of the ego left the drivable ground.
    #[serde(default)]
    pub on_road: bool,
    /// Smallest distance to another actor, m.
    pub min_distance_m: Option<f64>,
    /// Ego speed at the first impact, m/s.
    pub impact_speed_mps: Option<f64>,
    /// Largest raw lateral jerk, m/s³.
    pub lateral_jerk_max: Option<f64>,
    /// Digest of the run.
    pub digest: Option<Digest>,
    /// Median response time, ms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub response_p50_ms: Option<f64>,
    /// 99th percentile of the response time, ms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub response_p99_ms: Option<f64>,
    /// Deadlines missed, by all operators.
    #[serde(default)]
    pub misses: u64,
    /// All other metrics of the run that are numbers, by their names in `metrics.json`; what it has none of is not there.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub figures: BTreeMap<String, f64>,
    /// What `metrics.json` says in words or as yes and no, by its names there; what it has none of is not there.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub texts: BTreeMap<String, String>,
    /// Largest added latency that still avoids, ms; only in latency-budget studies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub budget_ms: Option<f64>,
    /// The study's curve, where it asks for one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub curve: Vec<f64>,
    /// What is measured in a timely study.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub timely: Vec<Reading>,
    /// What went wrong, when the run itself failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

impl CellResult {
    /// What a drive came to, held against what its scenario expects of it.
    pub(crate) fn of(cell: &Cell, outcome: &Outcome, expected: Option<&Expectation>) -> Self {
        let metrics = &outcome.metrics;
        let mut texts = table::texts(metrics);
        if let Some(expected) = expected {
            let broken = outcome.broken(expected);
            texts.insert(AS_EXPECTED.into(), broken.is_empty().to_string());
            texts.insert(NOT_AS_EXPECTED.into(), broken.join("; "));
        }
        Self {
            no_collision: metrics.impact.is_none(),
            on_road: metrics.left_road_at_s.is_none(),
            min_distance_m: metrics.min_distance_m,
            impact_speed_mps: metrics.impact_speed_mps,
            lateral_jerk_max: metrics.lateral_jerk.raw_max_mps3,
            digest: Some(outcome.digest),
            response_p50_ms: metrics.response.as_ref().map(|response| response.p50_ms),
            response_p99_ms: metrics.response.as_ref().map(|response| response.p99_ms),
            misses: metrics.operators.iter().map(|operator| operator.misses).sum(),
            figures: table::figures(metrics),
            texts,
            ..Self::blank(cell, metrics.verdict.name())
        }
    }

    /// Whether the drive was as its scenario expects; none where nothing is expected of it.
    pub fn as_expected(&self) -> Option<bool> {
        self.texts.get(AS_EXPECTED).map(|told| told == "true")
    }

    /// In what way it was not.
    pub(crate) fn not_as_expected(&self) -> &str {
        self.texts.get(NOT_AS_EXPECTED).map_or("", String::as_str)
    }

    /// A result without figures.
    pub fn blank(cell: &Cell, verdict: &str) -> Self {
        Self {
            labels: cell.labels.clone(),
            verdict: verdict.into(),
            no_collision: false,
            on_road: false,
            min_distance_m: None,
            impact_speed_mps: None,
            lateral_jerk_max: None,
            digest: None,
            response_p50_ms: None,
            response_p99_ms: None,
            misses: 0,
            figures: BTreeMap::new(),
            texts: BTreeMap::new(),
            budget_ms: None,
            curve: Vec::new(),
            timely: Vec::new(),
            error: None,
        }
    }

    /// Whether the run ended without collision and on the road.
    pub fn avoided(&self) -> bool {
        matches!(self.verdict.as_str(), "avoided" | "completed")
    }
}

/// Which part of the study this call runs.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shard {
    /// From 1.
    pub index: usize,
    /// How many there are.
    pub count: usize,
}

impl std::str::FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((index, count)) if index >= 1 && index <= count => Ok(Self { index, count }),
            _ => Err(format!("expected I/N with 1 <= I <= N, found `{text}`")),
        }
    }
}

impl Shard {
    /// Whether a cell is in this share.
    pub fn holds(self, cell: &Cell) -> bool {
        cell.index % self.count == self.index - 1
    }
}

/// The finished cells of a study under its output folder, one file each.
pub struct CellStore {
    folder: PathBuf,
}

impl CellStore {
    /// The store in `out`, made when it is not there.
    pub fn open(out: &Path) -> anyhow::Result<Self> {
        let folder = out.join(CELLS);
        std::fs::create_dir_all(&folder).with_context(|| format!("making {}", folder.display()))?;
        Ok(Self { folder })
    }

    /// The result of `cell`, when an earlier call finished it under the same fingerprint; an error names a file
    /// that is not as it was written.
    pub fn load(&self, cell: &Cell, fingerprint: Digest) -> anyhow::Result<Option<CellResult>> {
        let path = self.path(cell, fingerprint);
        let text = match read_string(&path, FILE_MAX) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error).with_context(|| format!("reading {}", path.display())),
        };
        // The same drive may have had other labels, under another name of its scenario.
        let result = unsealed(&text, cell, fingerprint)
            .map(|result| Some(CellResult { labels: cell.labels.clone(), ..result }));
        result.with_context(|| format!("{}: not as it was written", path.display()))
    }

    /// Keeps a finished cell under a checksum: written beside its name first, so that a half-written file is never
    /// taken for a result.
    pub fn save(&self, cell: &Cell, fingerprint: Digest, result: &CellResult) -> anyhow::Result<()> {
        let body = serde_json::to_string(result)?;
        let sealed = format!("{HEAD}{}{BODY}{body}{TAIL}", checksum(&body, cell, fingerprint));
        swerve_report::files::write_whole(&self.path(cell, fingerprint), sealed.as_bytes())
    }

    fn path(&self, cell: &Cell, fingerprint: Digest) -> PathBuf {
        self.folder.join(format!("{:06}-{fingerprint}.json", cell.index))
    }

    /// Where the page of a cell's run lies, if it has one.
    pub fn report(&self, cell: &Cell, fingerprint: Digest) -> PathBuf {
        self.folder.join(format!("{:06}-{fingerprint}.html", cell.index))
    }
}

// A kept cell is the JSON object `{"checksum":"...","result":{...}}`. Framed by hand, because the checksum is of
// the result's bytes: a number that was read and written again may end in another digit.
const HEAD: &str = "{\"checksum\":\"";
const BODY: &str = "\",\"result\":";
const TAIL: &str = "}\n";

/// Holds for one result under one name: a file that was renamed is another's result.
fn checksum(body: &str, cell: &Cell, fingerprint: Digest) -> Digest {
    let mut hasher = Hasher::new();
    hasher.number(cell.index as u64);
    hasher.number(fingerprint.0);
    hasher.bytes(body.as_bytes());
    hasher.digest()
}

fn unsealed(text: &str, cell: &Cell, fingerprint: Digest) -> Option<CellResult> {
    let (sum, body) = text.strip_prefix(HEAD)?.strip_suffix(TAIL)?.split_once(BODY)?;
    if sum != checksum(body, cell, fingerprint).to_string() {
        return None;
    }
    serde_json::from_str(body).ok()
}

/// How the cells of a study are run.
pub struct Runner<'a> {
    /// Finished cells.
    pub store: &'a CellStore,
    /// How many cells at once.
    pub threads: usize,
    /// Which part.
    pub shard: Option<Shard>,
    /// Whether a cell without the page of its run is driven again.
    pub reports: bool,
    /// Set by Ctrl-C: no further cell is started.
    pub stop: &'a AtomicBool,
}

impl Runner<'_> {
    /// Runs every cell of the shard that is not finished yet. Results are in the order of the cells; a cell that
    /// was not reached is `None`. `prepare` gives a cell's fingerprint, under which `run` computes its result.
    pub fn run<P, F>(&self, study: &Study, prepare: P, run: F) -> anyhow::Result<Vec<Option<CellResult>>>
    where
        P: Fn(&Cell) -> anyhow::Result<Digest> + Sync,
        F: Fn(&Cell, Digest) -> anyhow::Result<CellResult> + Sync,
    {
        let mine = |cell: &&Cell| self.shard.is_none_or(|shard| shard.holds(cell));
        let progress = Progress::cells(study.cells.iter().filter(mine).count());
        let one = |cell: &Cell| -> anyhow::Result<Option<CellResult>> {
            if !mine(&cell) {
                return Ok(None);
            }
            let fingerprint = prepare(cell)?;
            refuse_irregular(&self.store.path(cell, fingerprint))?;
            let kept = self.store.load(cell, fingerprint).unwrap_or_else(|error| {
                progress.tell(&format!("{error:#}; the cell is computed again"));
                None
            });
            // A cell whose run failed is tried again: what was in its way may be gone.
            let is_whole = || !self.reports || self.store.report(cell, fingerprint).is_file();
            let finished = kept.filter(|result| result.error.is_none() && is_whole());
            let result = match finished {
                Some(result) => result,
                None if self.stop.load(Ordering::SeqCst) => return Ok(None),
                None => {
                    let result = run(cell, fingerprint).unwrap_or_else(|error| failed(cell, &error));
                    self.store.save(cell, fingerprint, &result)?;
                    result
                }
            };
            progress.one_done();
            Ok(Some(result))
        };
        let results = on_threads(self.threads, &study.cells, one);
        progress.finish();
        results
    }
}

/// `one` of each item, in their order, on threads of their own: one that waits for threads within a cell, such as those
/// that render, takes no other cell meanwhile, as one of a pool would, on top of its stack. After an error no further
/// item is begun.
fn on_threads<T: Sync, R: Send>(
    threads: usize,
    items: &[T],
    one: impl Fn(&T) -> anyhow::Result<R> + Sync,
) -> anyhow::Result<Vec<R>> {
    let (next, failed) = (AtomicUsize::new(0), AtomicBool::new(false));
    let work = || {
        let mut done = Vec::new();
        while !failed.load(Ordering::Relaxed) {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(index) else { break };
            let result = one(item);
            failed.fetch_or(result.is_err(), Ordering::Relaxed);
            done.push((index, result));
        }
        done
    };
    let mut all = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads.min(items.len())).map(|_| scope.spawn(work)).collect();
        let joined = workers.into_iter().map(|worker| worker.join());
        joined
            .flat_map(|done| done.unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect::<Vec<_>>()
    });
    all.sort_by_key(|(index, _)| *index);
    all.into_iter().map(|(_, result)| result).collect()
}

fn failed(cell: &Cell, error: &anyhow::Error) -> CellResult {
    CellResult { error: Some(format!("{error:#}")), ..CellResult::blank(cell, "failed") }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    thread_local! {
        static WITHIN: Cell<usize> = const { Cell::new(0) };
    }

    /// As where images are rendered: each cell waits for a pool of its own.
    #[test]
    fn a_cell_that_waits_for_a_pool_begins_no_other_on_its_stack() {
        let items: Vec<usize> = (0..64).collect();
        let one = |item: &usize| {
            let depth = WITHIN.replace(WITHIN.get() + 1);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
            pool.install(|| (0..200).for_each(|_| std::thread::yield_now()));
            WITHIN.set(depth);
            anyhow::ensure!(depth == 0, "cell {item} within {depth} others");
            Ok(2 * item)
        };
        assert_eq!(on_threads(3, &items, one).unwrap(), items.iter().map(|k| 2 * k).collect::<Vec<_>>());
    }

    #[test]
    fn the_first_error_is_told_and_ends_the_work() {
        let items: Vec<usize> = (0..1000).collect();
        let begun = AtomicUsize::new(0);
        let said = on_threads(1, &items, |item| {
            begun.fetch_add(1, Ordering::Relaxed);
            anyhow::ensure!(*item < 3, "item {item}");
            Ok(())
        });
        assert_eq!((said.unwrap_err().to_string().as_str(), begun.into_inner()), ("item 3", 4));
    }
}
