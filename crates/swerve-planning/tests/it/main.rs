//! Integration tests: one binary, one module a subject.

mod counting; // how often a thread allocates
mod fot_allocations; // a plan of FOT allocates its points only
mod posed_paths_driven; // paths of posed problems, driven by the vehicle model
mod search_allocations; // RRT* and hybrid A* allocate nothing once grown
