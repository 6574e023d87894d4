//! Renamed keys; files may still have the old names.

use toml::{Table, Value};

/// Old and present name of every key that was renamed.
const RENAMED: [(&str, &str); 12] = [
    ("perception.params.distance_spread_m", "perception.params.distance_scale_m"),
    ("perception.params.half_share", "perception.params.half_visibility"),
    ("perception.params.share_spread", "perception.params.visibility_scale"),
    ("perception.params.ghosts_per_frame", "perception.params.false_positives_per_frame"),
    ("perception.params.score_gap", "perception.params.score_separation"),
    ("perception.params.missed", "perception.params.misses"),
    ("perception.params.ghosts", "perception.params.false_positives"),
    ("perception.params.misplaced", "perception.params.pose_errors"),
    ("perception.calibration.ap_other_draws", "perception.calibration.ap_held_out"),
    ("perception.calibration.difficulty", "perception.calibration.error_level"),
    ("perception.calibration.wanted", "perception.calibration.objects"),
    ("perception.params.*.steady", "perception.params.*.correlation"),
];

/// Value that takes precedence where a table has both names.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Counts {
    /// The one under the present name, for a file with both.
    Present,
    /// The one under the old name, for an assignment that overrides a file.
    Old,
}

/// Moves values from old names to present ones. Returns the old names found, each with the present one, in the order of
/// the list.
pub(super) fn renew(table: &mut Table, counts: Counts) -> Vec<(String, String)> {
    let mut told = Vec::new();
    for (old, new) in RENAMED {
        match old.split_once(".*.") {
            None => told.extend(renew_one(table, (old, new), counts)),
            Some((outer, _)) => {
                let within = at(table, outer).map(|table| table.keys().cloned().collect::<Vec<_>>());
                for name in within.into_iter().flatten() {
                    let names = [old, new].map(|path| path.replace('*', &name));
                    told.extend(renew_one(table, (&names[0], &names[1]), counts));
                }
            }
        }
    }
    told
}

fn renew_one(table: &mut Table, (old, new): (&str, &str), counts: Counts) -> Option<(String, String)> {
    let ((outer, old_name), (_, new_name)) = (old.rsplit_once('.')?, new.rsplit_once('.')?);
    let within = at(table, outer)?;
    let value = within.remove(old_name)?;
    match (within.get_mut(new_name), value) {
        (Some(Value::Table(present)), Value::Table(old)) => {
            for (key, value) in old {
                if counts == Counts::Old || !present.contains_key(&key) {
                    present.insert(key, value);
                }
            }
        }
        (Some(_), _) if counts == Counts::Present => {}
        (_, value) => _ = within.insert(new_name.to_owned(), value),
    }
    Some((old.to_owned(), new.to_owned()))
}

fn at<'a>(table: &'a mut Table, dotted: &str) -> Option<&'a mut Table> {
    dotted.split('.').try_fold(table, |table, name| table.get_mut(name).and_then(Value::as_table_mut))
}

/// Warnings about old names in a table, a line each.
pub fn old_names(table: &Table) -> Vec<String> {
    let told = renew(&mut table.clone(), Counts::Present);
    told.into_iter()
        .map(|(old, new)| format!("`{old}` is called `{new}` now; the old name still holds"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_under_old_names_apply_and_are_reported() {
        let text = "[perception.params]\nhalf_share = 0.25\nmissed = { steady = 0.5 }\nscore_gap = 1\n\
                    score_separation = 2\n[perception.calibration]\nwanted = 7\n";
        let mut table: Table = text.parse().unwrap();
        let lines = old_names(&table);
        assert!(
            lines[0]
                .starts_with("`perception.params.half_share` is called `perception.params.half_visibility`")
        );
        assert!(lines.last().unwrap().contains("perception.params.misses.correlation"), "{lines:?}");
        let mut of_set = table.clone();
        assert_eq!(renew(&mut table, Counts::Present).len(), lines.len());
        let present = "[perception.params]\nhalf_visibility = 0.25\nmisses = { correlation = 0.5 }\n\
                       score_separation = 2\n[perception.calibration]\nobjects = 7\n";
        assert_eq!(table, present.parse::<Table>().unwrap());
        assert!(renew(&mut table, Counts::Present).is_empty() && old_names(&table).is_empty());
        renew(&mut of_set, Counts::Old);
        let score = at(&mut of_set, "perception.params").unwrap()["score_separation"].as_integer();
        assert_eq!(score, Some(1));
    }
}
