//! Additional files without the outputs of their detectors, which SUMO would write beside them.

use std::path::{Path, PathBuf};

use swerve_map_io::xml::{Element, parse};

use crate::SumoError;
use crate::read::text_of;

/// Attributes that name files to write.
const OUTPUTS: [&str; 3] = ["file", "output", "dest"];

/// The file itself, or a copy in `folder` that writes nothing, for files with outputs.
///
/// # Errors
/// If it cannot be read, is not XML, or cannot be copied.
pub(crate) fn without_outputs(path: &Path, folder: &Path, number: usize) -> Result<PathBuf, SumoError> {
    let text = text_of(path)?;
    let file = path.display().to_string();
    let document = parse(&file, &text).map_err(|problems| SumoError::Setting(problems.to_string()))?;
    let elements = document.descendants().filter(Element::is_element);
    let outputs = elements.flat_map(|at| at.attributes()).filter(|one| OUTPUTS.contains(&one.name()));
    let mut ranges: Vec<_> = outputs.map(|one| one.range_value()).collect();
    if ranges.is_empty() {
        return Ok(path.to_owned());
    }
    ranges.sort_by_key(|range| range.start);
    let mut changed = text.clone();
    for range in ranges.into_iter().rev() {
        // SUMO writes nothing to a file of this name.
        changed.replace_range(range, "NUL");
    }
    let copy = folder.join(format!("{number}.add.xml"));
    let written = std::fs::write(&copy, changed);
    written.map_err(|error| SumoError::Setting(format!("{} cannot be written: {error}", copy.display())))?;
    Ok(copy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outputs_are_replaced_and_other_files_stay() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.add.xml");
        let text = "<additional><e1Detector id=\"file\" file=\"o.xml\"/><e2 file='p'/></additional>";
        std::fs::write(&path, text).unwrap();
        let copy = without_outputs(&path, folder.path(), 3).unwrap();
        let found = std::fs::read_to_string(&copy).unwrap();
        assert_eq!(found, text.replace("o.xml", "NUL").replace("'p'", "'NUL'"));
        std::fs::write(&path, "<additional><busStop id=\"x\"/></additional>").unwrap();
        assert_eq!(without_outputs(&path, folder.path(), 3), Ok(path));
    }
}
