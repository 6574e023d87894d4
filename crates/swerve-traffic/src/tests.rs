//! Tests of traffic: whole drives on maps.

mod changes;
mod draws;
mod drives;
mod flow;
mod following;
mod junctions;
mod long;
mod people;
mod run;
mod world;
