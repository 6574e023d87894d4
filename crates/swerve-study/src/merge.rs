//! `swerve study merge`: merges the cells of several shards into one table.

use std::path::{Path, PathBuf};

use swerve_drive::pictures::PictureArgs;
use swerve_drive::problems_error;
use swerve_report::files::{read_whole, write_whole};
use swerve_stack::Registry;

use crate::cells::CellStore;
use crate::output::report;
use crate::{Bench, OutArgs};

/// Merges the finished cells of these folders.
///
/// # Errors
/// If a folder has no cells, a cell is damaged, or a cell is missing in all of them.
pub(crate) fn merge(
    registry: &Registry,
    file: &Path,
    folders: &[PathBuf],
    (out, pictures): (&OutArgs, PictureArgs),
    sets: &[String],
) -> anyhow::Result<()> {
    let bench = Bench::open(registry, file, sets)?;
    let out = out.folder(&bench.study)?;
    for folder in folders {
        anyhow::ensure!(
            folder.join("cells").is_dir(),
            "{}: no folder `cells` of a study in it",
            folder.display()
        );
    }
    let stores: Vec<CellStore> = folders.iter().map(|f| CellStore::open(f)).collect::<Result<_, _>>()?;
    let mut found = Vec::new();
    let mut damaged = Vec::new();
    let (joined, mut pages) = (CellStore::open(&out)?, Vec::new());
    for cell in &bench.study.cells {
        let fingerprint = bench.fingerprint(cell)?;
        let mut result = None;
        for store in &stores {
            let page = store.report(cell, fingerprint);
            if page.is_file() {
                pages.push((page, joined.report(cell, fingerprint)));
            }
            match store.load(cell, fingerprint) {
                Ok(loaded) => result = result.or(loaded),
                Err(error) => damaged.push(format!("{error:#}")),
            }
        }
        found.push((fingerprint, result));
    }
    if !damaged.is_empty() {
        return Err(problems_error(&damaged).context("run the shards of these cells again, then merge again"));
    }
    for (page, copy) in pages.into_iter().filter(|(page, copy)| page != copy) {
        write_whole(&copy, &read_whole(&page)?)?;
    }
    let mut results = Vec::new();
    for (cell, (fingerprint, result)) in bench.study.cells.iter().zip(found) {
        if let Some(result) = &result {
            joined.save(cell, fingerprint, result)?;
        }
        results.push(result);
    }
    swerve_report::output::print(&report(&bench, &results, &out, pictures)?)?;
    let missing = results.iter().filter(|r| r.is_none()).count();
    anyhow::ensure!(
        missing == 0,
        "{missing} cells are in none of the folders (run the missing shards, then merge again)"
    );
    Ok(())
}
