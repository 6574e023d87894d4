//! Thinning of tables in long runs: when a table is full, every second row is dropped.

/// Drops every second row. The first and the last are kept.
pub(crate) fn halve<T>(rows: &mut Vec<T>) {
    let mut left = rows.len();
    let mut is_first = true;
    rows.retain(|_| {
        left -= 1;
        core::mem::take(&mut is_first) || left.is_multiple_of(2)
    });
}

/// Appends a row, thinning the table first if it has `most` rows or more.
pub(crate) fn push_within<T>(rows: &mut Vec<T>, most: usize, row: T) {
    if rows.len() >= most {
        halve(rows);
    }
    rows.push(row);
}
