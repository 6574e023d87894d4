//! Tables of lane places: `road,section,lane,s` in, their samples out.

use core::fmt::Write as _;

use crate::opendrive::{Network, Sample};

/// Columns of the output.
const COLUMNS: &str = "road,section,lane,type,s,width,x,y,z,hdg_ref,hdg_lane";

/// Samples lanes at the places of a table. Its first line names the columns, among them `road`, `section`, `lane` and
/// `s`, in any order; rows of the output are in the order of the input. Positions have 0.1 µm, headings 1e-9 rad.
///
/// # Errors
/// The first line that cannot be read or names a place that is not there, as `file:line: message`.
pub fn sampled(network: &Network, file: &str, table: &str) -> Result<String, String> {
    let mut lines = table.lines().enumerate().map(|(k, line)| (k + 1, line.trim_end_matches('\r')));
    let (_, head) =
        lines.next().ok_or_else(|| format!("{file}: expected a line with the names of the columns"))?;
    let names: Vec<&str> = head.trim_start_matches('\u{feff}').split(',').map(str::trim).collect();
    let mut columns = [0; 4];
    for (column, name) in columns.iter_mut().zip(["road", "section", "lane", "s"]) {
        *column = names.iter().position(|one| *one == name).ok_or_else(|| {
            let hint = swerve_text::did_you_mean(name, names.iter().copied());
            format!("{file}:1: expected the columns road, section, lane, s; `{name}` is missing{hint}")
        })?;
    }
    let mut out = format!("{COLUMNS}\n");
    for (number, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let row = row(network, &columns, line).map_err(|message| format!("{file}:{number}: {message}"))?;
        out.push_str(&row);
    }
    Ok(out)
}

fn row(network: &Network, columns: &[usize; 4], line: &str) -> Result<String, String> {
    let cells: Vec<&str> = line.split(',').map(str::trim).collect();
    let cell = |k: usize| cells.get(columns[k]).copied().unwrap_or("");
    let whole = |name: &str, text: &str| format!("{name}: expected a whole number, found {text:?}");
    let road = cell(0);
    let section: usize = cell(1).parse().map_err(|_| whole("section", cell(1)))?;
    let lane: i32 = cell(2).parse().map_err(|_| whole("lane", cell(2)))?;
    let s_m: f64 = cell(3).parse().map_err(|_| format!("s: expected a number, found {:?}", cell(3)))?;
    let sample = network.sample(road, section, lane, s_m).map_err(|error| error.to_string())?;
    let found = network.road(road).and_then(|road| road.sections.get(section)?.lane(lane));
    let kind = found.map_or("", |lane| lane.kind.name());
    let Sample { position_m: [x, y, z], reference_heading_rad, heading_rad, width_m } = sample;
    let mut row = String::new();
    let _infallible = writeln!(
        row,
        "{road},{section},{lane},{kind},{s_m},{width_m:.7},{x:.7},{y:.7},{z:.7},{reference_heading_rad:.9},{heading_rad:.9}"
    );
    Ok(row)
}
