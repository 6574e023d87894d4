//! Combinations of a study that are not driven.

use swerve_text::{Document, Problems};

use super::file::{LeaveOut, Step};
use crate::tables::no_axis;

/// True if a combination, one label per axis, is not driven.
pub(super) fn left_out(all: &[LeaveOut], axes: &[String], labels: &[String]) -> bool {
    let has = |(axis, steps): (&String, &Vec<String>)| {
        axes.iter().zip(labels).any(|(name, label)| name == axis && steps.contains(label))
    };
    all.iter().any(|out| out.iter().all(has))
}

/// Checks the combinations to leave out.
pub(super) fn check_left_out(
    document: &Document,
    all: &[LeaveOut],
    (axes, steps): (&[String], &[Vec<Step>]),
    problems: &mut Problems,
) {
    let mut all_of_every_axis = false;
    for (i, out) in all.iter().enumerate() {
        let mut wrong = |message| problems.push(document.problem(&format!("leave_out[{i}]"), message));
        for (name, labels) in out {
            let Some(axis) = axes.iter().position(|axis| axis == name) else {
                wrong(no_axis(name, axes));
                continue;
            };
            let known = |label: &&String| steps[axis].iter().any(|step| step.label == **label);
            for label in labels.iter().filter(|label| !known(label)) {
                wrong(format!("`{name}` has no step `{label}`"));
            }
        }
        let whole = |(name, labels): (&String, &Vec<String>)| {
            let axis = axes.iter().position(|axis| axis == name);
            axis.is_some_and(|axis| steps[axis].iter().all(|step| labels.contains(&step.label)))
        };
        all_of_every_axis |= out.iter().all(whole);
    }
    if all_of_every_axis {
        problems.push(document.problem("leave_out", "nothing is left"));
    }
}
