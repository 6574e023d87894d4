//! Maps of other programs: readers of ASAM OpenDRIVE 1.4 to 1.8, SUMO, Lanelet2 and CommonRoad.
//!
//! [`MapFile`] is a map of any format with the names of its file, for scenarios, and [`slope`] the grade and bank of its
//! lanes.
//!
//! [`sumo`], [`lanelet2`] and [`commonroad`] make a [`lane_map::LaneMap`] of a file: the [`swerve_map::Map`] with the
//! names of the file. [`mod@format`] finds the format, [`overview`] and [`picture::lanes`] are the output of `swerve map show`
//! for them.
//!
//! [`opendrive::Network`] is an OpenDRIVE file as it is: roads with their reference lines, profiles and lanes, junctions, signals,
//! objects. It is evaluated exactly, at a road, lane section, lane and arc length ([`opendrive::Network::sample`]), in
//! the frame that the header's offset leads to: metres, x east, y north, z up, headings in radians from x towards y.
//! [`import`](import::import) makes the [`swerve_map::Map`] of it, on the flat projection. [`links`] measures how lane
//! ends meet, [`summary`], [`picture`] and [`points`] are the output of `swerve map show`, [`route`] reads places
//! and writes ways over lanes.
//!
//! [`xml`] and [`content`] read XML files of other kinds with the same checks, such as CommonRoad's obstacles.
//!
//! **Errors.** All [`Problems`] of a file at once, each with line, column and element. A file with *faults* is not read:
//! numbers that are missing or not finite, unsorted or duplicate records, lane identities with holes. *Defects* leave the
//! geometry as it is, so that published files with them are read: links to things that are not there, ends that do not
//! meet, unknown types. Unknown elements are counted, and refused where they carry geometry. Files are at most 256 MiB
//! with 20 million nodes, nested 256 deep, roads together at most 2,000 km.
//!
//! **Source.** ASAM OpenDRIVE 1.8 and its predecessors; clauses are of 1.8. `swerve_geom::math` gives the same bits on
//! every machine.
//!
//! Excluded: writing, geodesy (`geoReference` is text), OpenCRG and 1.8's surface strips, lane heights (kept, not added
//! to z), railways, commands and files other than those passed in as text.

mod assemble;
pub mod commonroad;
pub mod content;
mod cubic;
mod curve;
mod draft;
mod features;
pub mod format;
pub mod import;
mod joints;
pub mod lane_map;
pub mod lanelet2;
pub mod links;
mod map_file;
pub mod opendrive;
pub mod overview;
pub mod picture;
pub mod points;
mod problem;
pub mod route;
pub mod slope;
mod strip;
pub mod summary;
pub mod sumo;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
pub mod xml;

pub use map_file::MapFile;
pub use problem::{PROBLEMS_MAX, Problem, Problems, quoted};
pub use xml::FILE_MAX;
