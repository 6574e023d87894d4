//! Weights of a learned predictor from a file, in place of the shipped ones.

use std::path::Path;

use swerve_prediction::learned::Weights;
use swerve_prediction::{PredictorName, shipped};

use super::PredictionConfig;
use super::camera_detectors::WEIGHTS_MAX;

impl PredictionConfig {
    /// Weights of `prediction.weights`; `None` where the key is absent.
    ///
    /// # Errors
    /// The file cannot be read or is damaged, the predictor has no weights, or the weights are of another network.
    pub fn file_weights(&self) -> Result<Option<Weights>, String> {
        let Some(path) = &self.weights else { return Ok(None) };
        let mut learned = PredictorName::ALL.into_iter().filter(|name| shipped(*name).is_some());
        let name = self.predictor.as_str();
        let Some(own) = learned.clone().find(|learned| learned.name() == name).and_then(shipped) else {
            let learned: Vec<&str> = learned.map(PredictorName::name).collect();
            return Err(format!("expected with a predictor of {}, found `{name}`", learned.join(", ")));
        };
        let bytes = swerve_text::read_bytes(Path::new(path), WEIGHTS_MAX);
        let bytes = bytes.map_err(|error| format!("reading {path}: {error}"))?;
        let weights = Weights::read(&bytes).map_err(|error| format!("{path}: {error}"))?;
        if weights.shape.model == own.shape.model {
            return Ok(Some(weights));
        }
        let is_of =
            |name: &PredictorName| shipped(*name).is_some_and(|of| of.shape.model == weights.shape.model);
        let found = learned.find(is_of).map_or("another net", PredictorName::name);
        Err(format!("{path}: expected weights of `{name}`, found weights of `{found}`"))
    }
}

#[cfg(test)]
mod tests {
    use swerve_text::Document;

    use super::*;
    use crate::Setup;

    fn problem(text: &str) -> Option<String> {
        let document = Document::parse("c.toml", text).unwrap();
        Setup::from_document(&document, &[]).err().map(|problems| problems.to_string())
    }

    #[test]
    fn weights_of_another_predictor_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("mine.weights");
        let weights = shipped(PredictorName::Mfp).unwrap().write();
        std::fs::write(&file, &weights).unwrap();
        let with = |predictor: &str| {
            problem(&format!("[prediction]\npredictor = \"{predictor}\"\nweights = {:?}\n", file.display()))
        };
        assert_eq!(with("mfp"), None);
        let told = with("r2p2").unwrap();
        assert!(told.contains("c.toml:3: prediction.weights: "), "{told}");
        assert!(told.contains("expected weights of `r2p2`, found weights of `mfp`"), "{told}");
        let told = with("kalman").unwrap();
        assert!(told.contains("expected with a predictor of multipath, mfp, r2p2, found `kalman`"), "{told}");
        std::fs::write(&file, &weights[..weights.len() / 2]).unwrap();
        assert!(with("mfp").unwrap().contains("prediction.weights"));
        std::fs::remove_file(&file).unwrap();
        assert!(with("mfp").unwrap().contains("reading "));
    }
}
