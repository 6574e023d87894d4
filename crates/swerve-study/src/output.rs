//! Files and text of a study's results.

use std::path::Path;

use swerve_drive::page::REPORT;
use swerve_drive::pictures::PictureArgs;
use swerve_report::files::write_whole;
use swerve_report::output::quoted;
use swerve_report::page::{Figures, Page};

use crate::grid::Study;
use crate::result::CellResult;
use crate::{Bench, heatmap, page, plot, ranking, table, timely};

/// Writes all results of a study; returns the text for the terminal.
pub(super) fn report(
    bench: &Bench,
    results: &[Option<CellResult>],
    out: &Path,
    pictures: PictureArgs,
) -> anyhow::Result<String> {
    let study = &bench.study;
    if let Some(timely) = &study.timely {
        let chart = timely::chart::Chart::of(study, timely, results);
        write_whole(&out.join("timely.csv"), chart.csv().as_bytes())?;
        let drawn = pictures.write_in(out, "timely", &chart.draw())?;
        write_whole(&out.join(REPORT), timely_page(study, &chart).html().as_bytes())?;
        let (done, all) = (results.iter().flatten().count(), study.cells.len());
        let at = out.display();
        let text =
            format!("{}{done} of {all} cells in {at}: report.html, timely.csv, {drawn}\n", chart.text());
        return Ok(text);
    }
    let grid = table::Grid::of(study, results);
    let title = if study.description.is_empty() { &study.name } else { &study.description };
    write_whole(&out.join("cells.csv"), table::csv(study, results).as_bytes())?;
    let heat = pictures.write_in(out, "heatmap", &heatmap::draw(&grid, title))?;
    let lines = study.cells.iter().zip(results).map(|(cell, result)| bench.repeat(cell, result.as_ref()));
    let commands = lines.collect::<anyhow::Result<Vec<_>>>()?;
    write_whole(&out.join("commands.txt"), (commands.join("\n") + "\n").as_bytes())?;
    let reports = bench.reports(out)?;
    let done = results.iter().flatten().count();
    let repeats = match study.budget {
        None => "repeats each cell",
        Some(_) => "drives each cell at its budget",
    };
    let mut more = String::new();
    let mut drawn = Vec::new();
    if let Some(curve) = study.curve {
        let picture = curve.draw(study, results);
        more = pictures.write_in(out, "curve", &picture)? + ", ";
        drawn.push(("Curves".to_owned(), picture.svg()));
    }
    let mut tables = study.curve.map_or_else(String::new, |curve| curve.text(study, results) + "\n");
    if let Some(plot) = &study.plot {
        let means = plot::Means::of(study, plot, results);
        write_whole(&out.join("plot.csv"), means.csv().as_bytes())?;
        let picture = means.draw();
        more += &format!("plot.csv, {}, ", pictures.write_in(out, "plot", &picture)?);
        drawn.push(("Plot".to_owned(), picture.svg()));
        tables += &(means.text() + "\n");
    }
    let mut foreseen = String::new();
    if let Some((timely_prediction, folder)) = &study.timely_prediction {
        let measured = timely_prediction.measure(folder)?;
        let picture = measured.draw(title);
        write_whole(&out.join("timely_prediction.csv"), measured.csv().as_bytes())?;
        write_whole(&out.join("crossover.csv"), measured.crossover_csv().as_bytes())?;
        more += &format!(
            "timely_prediction.csv, crossover.csv, {}, ",
            pictures.write_in(out, "timely_prediction", &picture)?
        );
        drawn.push(("Predictions that are late".to_owned(), picture.svg()));
        foreseen = measured.text() + "\n";
    }
    write_whole(
        &out.join(REPORT),
        page::page(study, results, (&commands, reports), drawn, grid.note.clone()).html().as_bytes(),
    )?;
    if let Some(ranking) = &study.ranking {
        let settings = ranking::settings(study, ranking, results);
        write_whole(&out.join("ranking.csv"), ranking::csv(ranking, &settings).as_bytes())?;
        tables += &(ranking::text(ranking, &settings) + "\n");
    }
    tables += &CellResult::note_without_steps(results);
    Ok(format!(
        "{}\n{foreseen}{tables}{done} of {} cells in {}: report.html, cells.csv, {heat}, {more}commands.txt (one line {repeats})\n",
        grid.text(),
        study.cells.len(),
        out.display()
    ))
}

/// Page of a study with curves instead of verdicts.
fn timely_page(study: &Study, chart: &timely::chart::Chart<'_>) -> Page<Figures> {
    let csv = chart.csv();
    let mut rows = csv.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let title = if study.description.is_empty() { &study.name } else { &study.description };
    let figures = Figures {
        command: format!("swerve study {}", quoted(&study.file)),
        columns: rows.next().unwrap_or_default(),
        rows: rows.collect(),
        pictures: vec![("Over time".to_owned(), chart.draw().svg())],
    };
    Page::new("figures", title, figures)
}
