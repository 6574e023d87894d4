//! Camera detector of an operator: by name or from a file of weights; its rungs and run times.

use std::sync::Arc;

use swerve_perception::camera::CameraDetector;
use swerve_text::KeyProblem;
use swerve_vision::acf::Weights;

use crate::config::camera_detectors::{CameraObjectsTable, DEFAULT_RUNG, no_rung, stored};
use crate::config::execution::Runtime;
use crate::detectors::{AnyDetector, ByWeights, DetectorRung, DetectorSetup};
use crate::registry::Registry;

/// Camera detector of this name in the registry, or the one in this file of weights; with its rungs.
///
/// # Errors
/// There is neither, or the file is damaged.
fn detector(registry: &Registry, name: &str) -> Result<(Arc<dyn AnyDetector>, Vec<DetectorRung>), String> {
    let detector = match registry.detectors.shared(name) {
        Some(detector) => detector,
        None => {
            let names = registry.detectors().collect();
            let _weights = stored("detector", name, (None, names), Weights::read)?;
            Arc::new(ByWeights(name.to_owned().into()))
        }
    };
    let rungs = detector.rungs()?;
    Ok((detector, rungs))
}

/// Position of the rung of this name.
///
/// # Errors
/// There is no such rung.
fn position(rungs: &[DetectorRung], name: &str) -> Result<usize, String> {
    let last_by_default = (name == DEFAULT_RUNG).then_some(rungs.len().saturating_sub(1));
    rungs
        .iter()
        .position(|rung| rung.name == name)
        .or(last_by_default)
        .ok_or_else(|| no_rung(name, rungs.iter().map(|rung| &*rung.name)))
}

impl CameraObjectsTable {
    /// Detector of this table with its rungs, and the position of the named one.
    ///
    /// # Errors
    /// The problem by its key.
    pub(crate) fn chosen(&self, registry: &Registry) -> Result<Chosen<'_>, KeyProblem> {
        let wrong = |key: &str| {
            let key = key.to_owned();
            move |message| (key, message)
        };
        let (detector, rungs) = detector(registry, &self.detector).map_err(wrong("detector"))?;
        let named = position(&rungs, &self.rung).map_err(wrong("rung"))?;
        Ok(Chosen { table: self, detector, rungs, named })
    }

    /// Detector of this table at the named rung.
    ///
    /// # Errors
    /// Problems by their keys.
    pub fn detector(&self, registry: &Registry) -> Result<Box<dyn CameraDetector>, Vec<KeyProblem>> {
        let chosen = self.chosen(registry).map_err(|problem| vec![problem])?;
        chosen.build(&chosen.rungs[chosen.named])
    }

    /// Run time of the named rung.
    pub fn run_time(&self, registry: &Registry) -> Option<Runtime> {
        let chosen = self.chosen(registry).ok()?;
        chosen.run_time(&chosen.rungs[chosen.named])
    }
}

/// The detector that a table names.
pub(crate) struct Chosen<'a> {
    table: &'a CameraObjectsTable,
    detector: Arc<dyn AnyDetector>,
    pub(crate) rungs: Vec<DetectorRung>,
    named: usize,
}

impl Chosen<'_> {
    /// The named rung.
    pub(crate) fn named(&self) -> &DetectorRung {
        &self.rungs[self.named]
    }

    /// Rungs that may be used, in the detector's order. A rung that searches around tracks is on a ladder only if it is
    /// the named one: its longest run time is that of the same rung without tracks.
    pub(crate) fn taken(&self) -> impl Iterator<Item = &DetectorRung> {
        let first = if self.table.ladder { 0 } else { self.named };
        let rungs = self.rungs[first..=self.named].iter().enumerate();
        rungs.filter(move |(k, rung)| first + k == self.named || !rung.follows_tracks).map(|(_, rung)| rung)
    }

    /// Checks that there is a rung of this name.
    pub(crate) fn known(&self, name: &str) -> Result<(), String> {
        let is_known = self.rungs.iter().any(|rung| rung.name == name);
        if is_known { Ok(()) } else { Err(no_rung(name, self.rungs.iter().map(|rung| &*rung.name))) }
    }

    /// Run time of a rung.
    pub(crate) fn run_time(&self, rung: &DetectorRung) -> Option<Runtime> {
        let own = self.table.run_times_ms.get(&*rung.name).map(|ms| Runtime::fixed(*ms));
        own.or_else(|| rung.run_time.clone())
    }

    /// The detector at a rung.
    pub(crate) fn build(&self, rung: &DetectorRung) -> Result<Box<dyn CameraDetector>, Vec<KeyProblem>> {
        let setup = DetectorSetup { rung: &rung.name, score_min: self.table.score_min };
        self.detector.build(setup, &self.table.params)
    }
}
