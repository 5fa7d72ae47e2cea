//! The toolbox: ask a saved scene graph, fuse scans into a map, run benches.

mod ask;
mod bench;
mod fuse;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Tools of the OmniVLN workspace. Progress goes to stderr; with --json, one JSON object goes to stdout.
#[derive(Debug, Parser)]
#[command(name = "omnivln", version, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Asks a saved scene graph where a thing is: rooms, candidates, prompt, reasoning, action
    Ask(ask::AskOptions),
    /// Fuses a folder of posed scans into a mesh, a distance field and places
    Fuse(fuse::FuseOptions),
    /// Measures the whole system
    #[command(subcommand)]
    Bench(BenchCommand),
}

#[derive(Debug, Subcommand)]
enum BenchCommand {
    /// Many buildings and instructions, drawn from a seed, with the referee's verdicts
    Nav(bench::NavOptions),
}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Ask(options) => ask::run(&options),
        Command::Fuse(options) => fuse::run(&options),
        Command::Bench(BenchCommand::Nav(options)) => bench::nav(&options),
    };
    match result {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}
