//! Warnings about models for camera images that cells use outside their domain.

use std::collections::BTreeMap;

use swerve_report::output::tell;

use crate::Bench;

impl Bench {
    /// Reports on standard error, a line each, the models for camera images that cells use outside their domain, with
    /// the number of these cells.
    ///
    /// # Errors
    /// If the configuration of a cell is invalid.
    pub(crate) fn note_domain(&self) -> anyhow::Result<()> {
        // Cells that differ in other keys have the same warnings.
        let matters = |key: &str| ["operator", "render"].contains(&key.split('.').next().unwrap_or(key));
        let mut of_settings = BTreeMap::new();
        let mut cells = BTreeMap::<String, usize>::new();
        for cell in &self.study.cells {
            let sets = cell.sets.iter().filter(|(key, _)| matters(key));
            let settings =
                (&cell.config, sets.map(|(key, value)| format!("{key}={value}")).collect::<Vec<_>>());
            let warnings = match of_settings.get(&settings) {
                Some(warnings) => warnings,
                None => {
                    let warnings = self.config(cell)?.beyond_domain();
                    of_settings.entry(settings).or_insert(warnings)
                }
            };
            for warning in warnings {
                *cells.entry(warning.clone()).or_default() += 1;
            }
        }
        for (warning, count) in cells {
            let count = if count == 1 { "1 cell".to_owned() } else { format!("{count} cells") };
            tell(&format!("warning: {count}: {warning}"));
        }
        Ok(())
    }
}
