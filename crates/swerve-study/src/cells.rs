//! Execution of a study's cells: parallel and resumable; each result is stored as soon as it is available.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use anyhow::Context as _;
use swerve_core::{Digest, Hasher};
use swerve_drive::{Outcome, Stopped};
use swerve_report::files::{CELLS, refuse_irregular};
use swerve_report::progress::Progress;
use swerve_scenario::Expectation;
use swerve_text::{FILE_MAX, read_string};

use super::columns::{AS_EXPECTED, EGO, NOT_AS_EXPECTED, figures, texts};
use super::grid::{Cell, Study};
use super::result::CellResult;

impl CellResult {
    /// Result of a drive, compared with its scenario's expectations. Of several egos it has the metrics of the one that
    /// fared worst.
    pub(crate) fn of(cell: &Cell, outcome: &Outcome, expected: Option<&Expectation>) -> Self {
        let (ego, metrics) = outcome.worst();
        let mut texts = texts(metrics);
        texts.extend(ego.map(|ego| (EGO.to_owned(), ego.to_owned())));
        let mut result = Self {
            no_collision: metrics.impact.is_none(),
            on_road: metrics.left_road_at_s.is_none(),
            min_distance_m: metrics.min_distance_m,
            impact_speed_mps: metrics.impact_speed_mps,
            lateral_jerk_max: metrics.lateral_jerk.raw_max_mps3,
            digest: Some(outcome.digest),
            response_p50_ms: metrics.response.as_ref().map(|response| response.p50_ms),
            response_p99_ms: metrics.response.as_ref().map(|response| response.p99_ms),
            misses: metrics.operators.iter().map(|operator| operator.misses).sum(),
            figures: figures(metrics),
            texts,
            scores: metrics.scores.clone(),
            ..Self::blank(cell, metrics.verdict.name())
        };
        if let Some(expected) = expected {
            result.expects(&outcome.broken(expected));
        }
        result
    }

    /// States the expectations that the drive did not meet.
    pub(crate) fn expects(&mut self, broken: &[String]) {
        self.texts.insert(AS_EXPECTED.into(), broken.is_empty().to_string());
        self.texts.insert(NOT_AS_EXPECTED.into(), broken.join("; "));
    }
}

/// Part of a study that one call runs.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shard {
    /// Index, starting at 1.
    pub index: usize,
    /// Number of parts.
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
    /// True if the cell belongs to this part.
    pub fn holds(self, cell: &Cell) -> bool {
        cell.index % self.count == self.index - 1
    }
}

/// Finished cells of a study in its output folder, one file each.
pub struct CellStore {
    folder: PathBuf,
}

impl CellStore {
    /// Opens the store in `out`, creating it if necessary.
    pub fn open(out: &Path) -> anyhow::Result<Self> {
        let folder = out.join(CELLS);
        std::fs::create_dir_all(&folder).with_context(|| format!("making {}", folder.display()))?;
        Ok(Self { folder })
    }

    /// Result of `cell`, if an earlier call finished it under the same fingerprint. Fails on a file that was modified.
    pub fn load(&self, cell: &Cell, fingerprint: Digest) -> anyhow::Result<Option<CellResult>> {
        let path = self.path(cell, fingerprint);
        let text = match read_string(&path, FILE_MAX) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error).with_context(|| format!("reading {}", path.display())),
        };
        // The same drive may have had other labels, under another scenario name.
        let result = unsealed(&text, cell, fingerprint)
            .map(|result| Some(CellResult { labels: cell.labels.clone(), ..result }));
        result.with_context(|| format!("{}: not as it was written", path.display()))
    }

    /// Stores a finished cell with a checksum. The file is written under a temporary name first, so that a partial file
    /// is never read as a result.
    pub fn save(&self, cell: &Cell, fingerprint: Digest, result: &CellResult) -> anyhow::Result<()> {
        let body = serde_json::to_string(result)?;
        let sealed = format!("{HEAD}{}{BODY}{body}{TAIL}", checksum(&body, cell, fingerprint));
        swerve_report::files::write_whole(&self.path(cell, fingerprint), sealed.as_bytes())
    }

    fn path(&self, cell: &Cell, fingerprint: Digest) -> PathBuf {
        self.folder.join(format!("{:06}-{fingerprint}.json", cell.index))
    }

    /// Path of the page of a cell's run; the page may not exist.
    pub fn report(&self, cell: &Cell, fingerprint: Digest) -> PathBuf {
        self.folder.join(format!("{:06}-{fingerprint}.html", cell.index))
    }
}

// A stored cell is the JSON object `{"checksum":"...","result":{...}}`. It is assembled by hand because the checksum
// covers the result's bytes: a number that is parsed and written again may change its last digit.
const HEAD: &str = "{\"checksum\":\"";
const BODY: &str = "\",\"result\":";
const TAIL: &str = "}\n";

/// Checksum of a result under its name, so that a renamed file is detected.
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

/// Execution settings for the cells of a study.
pub struct Runner<'a> {
    /// Finished cells.
    pub store: &'a CellStore,
    /// Number of cells run at the same time.
    pub threads: usize,
    /// Part of the study to run; all of it if `None`.
    pub shard: Option<Shard>,
    /// If true, a cell whose run has no page is run again.
    pub reports: bool,
    /// Set by Ctrl-C: no further cell is started, and a cell whose drive was stopped is not stored.
    pub stop: &'a AtomicBool,
}

impl Runner<'_> {
    /// Runs all unfinished cells of the shard. Results are in the order of the cells; `None` for a cell that was not
    /// reached. `prepare` returns a cell's fingerprint, under which `run` computes its result.
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
            // A cell whose run failed is tried again, as the cause may be gone.
            let is_whole = || !self.reports || self.store.report(cell, fingerprint).is_file();
            let finished = kept.filter(|result| result.error.is_none() && is_whole());
            let result = match finished {
                Some(result) => result,
                None if self.stop.load(Ordering::SeqCst) => return Ok(None),
                None => {
                    let result = match run(cell, fingerprint) {
                        Err(error) if error.is::<Stopped>() => return Ok(None),
                        result => result.unwrap_or_else(|error| failed(cell, &error)),
                    };
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

/// Applies `one` to each item, in order, on dedicated threads. A thread that waits for others within a cell, such as
/// render threads, would in a shared pool start another cell on top of its stack; here it does not. After an error no
/// further item is started.
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

    /// As when images are rendered: each cell waits for its own pool.
    #[test]
    fn cell_that_waits_for_a_pool_starts_no_other_on_its_stack() {
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

    /// The flag is set before the first drive, but the runner does not know of it: the drive itself ends.
    #[test]
    fn cell_of_a_stopped_drive_is_not_stored_and_driven_later() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("study.toml");
        let text = "base = { scenario = \"lane\" }\n[[axis]]\nkey = \"seed\"\nvalues = [1, 2]\n";
        std::fs::write(&file, text).unwrap();
        let bench = crate::Bench::open(&swerve_stack::Registry::default(), &file, &[]).unwrap();
        let (store, stop) = (CellStore::open(folder.path()).unwrap(), AtomicBool::new(false));
        let runner = Runner { store: &store, threads: 1, shard: None, reports: false, stop: &stop };
        let drive = |is_stopped: bool| {
            bench.stop.store(is_stopped, Ordering::SeqCst);
            let run = |cell: &_, _| bench.run_cell(cell, None);
            let found = runner.run(&bench.study, |cell| bench.fingerprint(cell), run).unwrap();
            let stored = std::fs::read_dir(folder.path().join(CELLS)).unwrap().count();
            (found.into_iter().flatten().map(|result| result.verdict).collect::<Vec<_>>(), stored)
        };
        assert_eq!(drive(true), (Vec::new(), 0));
        assert_eq!(drive(false), (vec!["completed".to_owned(); 2], 2));
        assert_eq!(drive(true).0.len(), 2, "finished cells are read");
    }

    #[test]
    fn first_error_is_returned_and_ends_the_work() {
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
