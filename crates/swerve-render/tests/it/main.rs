//! Integration tests: one binary, one module a subject.

mod camera_allocations; // passes of a camera into used memory allocate nothing
mod counting; // how often a thread allocates
mod lidar_allocations; // nor do turns of a lidar
