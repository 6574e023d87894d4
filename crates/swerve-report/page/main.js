// Draws the page of the data that it holds.

function main() {
  const page = JSON.parse(document.getElementById("data").textContent);
  const shows = { run: showRun, live: showLive, study: showStudy, runs: showRuns, studies: showStudies, figures: showFigures };
  shows[page.kind](page);
}

/** Pictures and a table. */
function showFigures(page) {
  const picture = ([title, text]) => {
    const image = el("img", { src: `data:image/svg+xml;charset=utf-8,${encodeURIComponent(text)}`, alt: title, style: "max-width:100%;background:#fff" });
    return el("div", {}, el("h3", {}, title), image);
  };
  const search = el("input", { type: "text", placeholder: "filter", "aria-label": "filter" });
  const place = el("div", { id: "cells" });
  const shown = () => page.rows.filter((row) => row.join(" ").toLowerCase().includes(search.value.toLowerCase()));
  const show = () => place.replaceChildren(table(page.columns, shown(), { sort: true }));
  search.addEventListener("input", show);
  document.getElementById("page").append(
    el("header", {}, el("h1", {}, page.title), el("p", { class: "soft" }, `Swerve ${page.version}`)),
    page.rows.length > 0 ? section("table", "Table", el("div", { class: "bar" }, search, el("button", { click: () => save(`${page.title}.csv`, "text/csv", csv([page.columns, ...page.rows])) }, "CSV")), place) : "",
    page.pictures.length > 0 ? section("pictures", "Pictures", ...page.pictures.map(picture)) : "",
    section("repeat", "Again", commandLine(page.command)));
  show();
}

main();
