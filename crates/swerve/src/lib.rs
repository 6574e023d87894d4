//! The binary's library: configuration, operator adapters, graph assembly, commands, studies, reports.

pub mod config;
